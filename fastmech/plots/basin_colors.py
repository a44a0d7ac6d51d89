"""Colours and names of basins: a label has the same colour in every picture, whatever else is in it."""

from __future__ import annotations

from itertools import product

import numpy as np

from fastmech.plots.labels import coordinates_of, symbol
from fastmech.plots.style import PALETTE
from fastmech.results import Dataset

#: Wells and turns of each angle, either way, whose basins have a colour of their own.
WELLS, TURNS = 2, 2

#: Colours of further wells, from the end of the list.
OTHERS = 8

#: Colours by how usual a label is. After Okabe and Ito's each next one was chosen as far as possible from all
#: before it in OKLab (Ottosson 2020), and from white, black and the greys of :mod:`fastmech.plots.basins`, as
#: seen by normal, protanopic and deuteranopic eyes (Machado, Oliveira, Fernandes, IEEE Trans. Visualization
#: and Computer Graphics 15 (2009) 1291); none too dark for black marks on top.
COLORS = [PALETTE[name] for name in ("sky", "orange", "green", "yellow", "purple", "blue", "vermillion")]
COLORS += [
    "#a7d8ba", "#6200ff", "#4e89ff", "#3b766c", "#a7ffb1", "#62d8ff", "#a7450a", "#76c480", "#ce00a7",
    "#c4d880", "#62c4c4", "#4e6ce2", "#009dd8", "#baebeb", "#ebc400", "#eb763b", "#6c5889", "#ce3b45",
    "#c414ce", "#62b16c", "#00a7ff", "#3b8980", "#3b804e", "#ffb1eb", "#eb9db1", "#ceeb80", "#e258ce",
    "#b16c9d", "#b1ebc4", "#ebb14e", "#00a74e", "#d8ff80", "#76ba9d", "#4ed8d8", "#624eff", "#b1ffd8",
    "#9300c4", "#b1ce93", "#a79dc4", "#586c31", "#d831ba", "#e2ff00", "#89ce6c",
]  # fmt: skip

#: Colour of all other basins.
FURTHER = "#9a9a9a"


def _how_usual(label: tuple[int, int, int]) -> tuple[int, ...]:
    """Smaller: more usual. A turn of phi mostly comes with one back of theta: the second rod turns little."""
    well, phi, theta = label
    return abs(phi) + abs(theta) + abs(phi + theta), well, abs(phi), phi, theta


_LABELS = sorted(product(range(WELLS), range(-TURNS, TURNS + 1), range(-TURNS, TURNS + 1)), key=_how_usual)
_COLOR_OF = dict(zip(_LABELS, COLORS, strict=True))


def well_number(dataset: Dataset, well: int) -> int:
    """Place from 0 of a well among the wells; ``well`` is an index among the dataset's equilibria."""
    wells = np.flatnonzero(dataset["equilibrium_morse_index"].data == 0)
    return int(np.flatnonzero(wells == well)[0])


def basin_color(dataset: Dataset, well: int, turns: tuple[int, ...]) -> str:
    """Colour of a copy of a well; ``well`` is an index among the dataset's equilibria."""
    number = well_number(dataset, well)
    if number >= WELLS and not any(turns):
        return COLORS[-1 - (number - WELLS) % OTHERS]
    first, second = (*turns, 0)[:2]
    return FURTHER if any(turns[2:]) else _COLOR_OF.get((number, first, second), FURTHER)


def basin_name(dataset: Dataset, well: int, turns: tuple[int, ...]) -> str:
    """Name of a copy of a well; ``well`` is an index among the dataset's equilibria."""
    wells = int(np.count_nonzero(dataset["equilibrium_morse_index"].data == 0))
    text = f"well {well_number(dataset, well) + 1}" if wells > 1 else "the well"
    names = map(symbol, coordinates_of(dataset))
    made = [f"{t:+d} {name}" for t, name in zip(turns, names, strict=True) if t]
    return f"{text}, {', '.join(made)} turn{'s' * (len(made) > 1 or abs(sum(turns)) > 1)}" if made else text
