"""Names of things as pictures and their legends write them."""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import TYPE_CHECKING

import numpy as np

from fastmech.results import Dataset, Variable

if TYPE_CHECKING:
    from matplotlib.axis import Axis

    from fastmech.store.read import Section

#: Parameters of a mechanism that a title tells.
MOST_TOLD = 6

#: A code that no variable has.
NOWHERE = 1 << 40

#: Places and labels of the ticks of an angle's axis over one turn.
PI_TICKS = ([-np.pi, -np.pi / 2, 0.0, np.pi / 2, np.pi], ["-π", "-π/2", "0", "π/2", "π"])


SYMBOLS = {"phi": "φ", "theta": "θ", "phi_dot": "φ'", "theta_dot": "θ'"}

#: The paper's coordinates, of which both turn fully.
ANGLES = ("phi", "theta")


def symbol(name: str) -> str:
    """How pictures write a coordinate or a rate."""
    return SYMBOLS.get(name, f"{name.removesuffix('_dot')}'" if name.endswith("_dot") else name)


def coordinates_of(dataset: Dataset | Section) -> tuple[str, ...]:
    """Names of the coordinates that a section is about."""
    return tuple(dataset.attrs.get("coordinate_names", ANGLES))


def setting_of(dataset: Dataset, parameters: Mapping[str, float]) -> str:
    """A mechanism and some of its parameters, for titles."""
    each = ", ".join(f"{name} = {value:g}" for name, value in list(parameters.items())[:MOST_TOLD])
    return f"{dataset.attrs['mechanism']}: {each}{', ...' * (len(parameters) > MOST_TOLD)}"


def quantity(dataset: Dataset, name: str) -> str:
    """What a coordinate or a rate is, with its unit, for an axis."""
    unit = dataset[name].units
    kind = {"rad": "angle", "m": "position"}.get(unit, "rate")
    return f"{'' if symbol(name) == kind else f'{kind} '}{symbol(name)} [{unit}]"


def equilibrium_names(dataset: Dataset) -> list[str]:
    """One name for each equilibrium of a dataset: its number (from 1) and place."""
    names = coordinates_of(dataset)
    units = [dataset[name].units for name in names]
    told = [f" {unit}" if unit != after else "" for unit, after in zip(units, [*units[1:], ""], strict=True)]
    return [
        f"{number}: "
        + ", ".join(f"{symbol(n)} = {v:z.3f}{unit}" for n, v, unit in zip(names, place, told, strict=True))
        for number, place in enumerate(zip(*(dataset[name].data for name in names), strict=True), start=1)
    ]


class Codes(dict[str, int]):
    """Codes by their meanings; a meaning that the file does not know is no code."""

    def __missing__(self, meaning: str) -> int:
        return NOWHERE

    def others(self, known: Container[str]) -> list[str]:
        """Meanings that the file knows and this version does not: it is older or newer."""
        return [meaning for meaning in self if meaning not in known]


def flag_codes(variable: Variable) -> Codes:
    """Meanings and codes of a variable of flags, as the file explains them itself."""
    return Codes(variable.codes)


def logarithmic(axis: Axis) -> None:
    """Ticks of a logarithmic axis whose labels keep apart, over a part of a decade or over many."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    if high < 30.0 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
