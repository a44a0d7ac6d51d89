"""Names of things as pictures and their legends write them."""

from __future__ import annotations

import numpy as np

from fastmech.results import Dataset, Variable

#: Places and labels of the ticks of an angle's axis over one turn.
PI_TICKS = ([-np.pi, -np.pi / 2, 0.0, np.pi / 2, np.pi], ["-π", "-π/2", "0", "π/2", "π"])


def equilibrium_names(dataset: Dataset) -> list[str]:
    """One name for each equilibrium of a dataset: its number (from 1) and place."""
    places = zip(dataset["phi"].data, dataset["theta"].data, strict=True)
    return [
        f"{number}: φ = {phi:z.3f}, θ = {theta:z.3f} rad"
        for number, (phi, theta) in enumerate(places, start=1)
    ]


def flag_codes(variable: Variable) -> dict[str, int]:
    """Meaning and code of a variable of flags."""
    meanings = str(variable.attrs["flag_meanings"]).split()
    return dict(zip(meanings, (int(value) for value in variable.attrs["flag_values"]), strict=True))
