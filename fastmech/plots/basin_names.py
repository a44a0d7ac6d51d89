"""Names of basins in words: the well's number, and the turns to its copy."""

from __future__ import annotations

import numpy as np

from fastmech.plots.basin_colors import well_number
from fastmech.results import Dataset


def basin_name(dataset: Dataset, well: int, turns: tuple[int, int]) -> str:
    """Name of a copy of a well; ``well`` is an index among the dataset's equilibria."""
    wells = int(np.count_nonzero(dataset["equilibrium_morse_index"].data == 0))
    text = f"well {well_number(dataset, well) + 1}" if wells > 1 else "the well"
    made = [f"{t:+d} {symbol}" for t, symbol in zip(turns, ("φ", "θ"), strict=True) if t]
    return f"{text}, {', '.join(made)} turn{'s' * (len(made) > 1 or abs(sum(turns)) > 1)}" if made else text
