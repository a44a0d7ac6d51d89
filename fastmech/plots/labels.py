"""Names of things as pictures and their legends write them."""

from __future__ import annotations

from collections.abc import Container
from typing import TYPE_CHECKING

import numpy as np

from fastmech.results import Dataset, Variable

if TYPE_CHECKING:
    from matplotlib.axis import Axis

#: A code that no variable has.
NOWHERE = 1 << 40

#: Places and labels of the ticks of an angle's axis over one turn.
PI_TICKS = ([-np.pi, -np.pi / 2, 0.0, np.pi / 2, np.pi], ["-π", "-π/2", "0", "π/2", "π"])


def equilibrium_names(dataset: Dataset) -> list[str]:
    """One name for each equilibrium of a dataset: its number (from 1) and place."""
    places = zip(dataset["phi"].data, dataset["theta"].data, strict=True)
    return [
        f"{number}: φ = {phi:z.3f}, θ = {theta:z.3f} rad"
        for number, (phi, theta) in enumerate(places, start=1)
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
