"""The variables of disturbed ensembles: names, dimensions, units and meanings, in one place.

A table of the section has a row for each trajectory of each equilibrium; what has other dimensions is in the
groups ``linear``, ``quantiles`` and ``halving``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.basins.disturbed import Outcome
from fastmech.results import ANGLE_UNITS, NO_CODE, STATE_UNITS, Variable, flags, numbers, parts

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0)
QUANTILE = Variable(("quantile",), np.array(QUANTILES), "1", "quantile")

ABOUT_SHARES = {
    "share_returned": "share that is proved to return",
    "share_returned_at_most": "share that returned, if all whose end is not known did",
    "share_returned_lower": "lower end of the 95 % Wilson interval, none of those returning",
    "share_returned_upper": "upper end of the 95 % Wilson interval, all of those returning",
}
ABOUT_QUANTILES = "quantiles of the time to return over those that return, inf: later than the end of the run"

_EACH, _EVERY = ("equilibrium",), ("equilibrium", "trajectory")
_TURNS = dict.fromkeys(ANGLE_UNITS, "1")

#: What is known of every trajectory: type, what stands for one that is not computed yet, unit, meaning. What
#: has several units is a variable for each of them.
_TRAJECTORY: dict[str, tuple[str, float, str | Mapping[str, str], str]] = {
    "start": ("f8", np.nan, STATE_UNITS, "{} at the start"),
    "final": ("f8", np.nan, STATE_UNITS, "{} at the end, or of the last finite state"),
    "failed": ("f8", np.nan, "s", "time of the last finite state where it failed on the way"),
    "outcome": ("i1", -1, "1", "where it ends"),
    "end_equilibrium": ("i1", -1, "1", "stable equilibrium at which it is proved to end"),
    "turns": ("i8", 0, _TURNS, "full turns of {} made on the way there"),
    "time_to_return": (
        "f8",
        np.nan,
        "s",
        "end of the first step from which on every step ended in the ball of return, NaN: none by t_end",
    ),
    "excursion": ("f8", np.nan, ANGLE_UNITS, "largest departure of {} at the ends of steps, NaN: failed"),
}

#: Names of what is known of every trajectory.
TRAJECTORY_VARIABLES = tuple(_TRAJECTORY)


def empty_trajectories(names: list[str], count: int) -> dict[str, NDArray[Any]]:
    """Arrays of so many trajectories that have not been computed."""
    found = {}
    for name in names:
        dtype, nothing, unit, _ = _TRAJECTORY[name]
        found[name] = np.full((count,) if isinstance(unit, str) else (count, len(unit)), nothing, dtype)
    return found


def trajectory_variables(arrays: Mapping[str, NDArray[Any]]) -> dict[str, Variable]:
    """Arrays over (equilibrium, trajectory, ...) as variables."""
    codes: dict[str, Any] = {"outcome": flags(Outcome, fill=-1), "end_equilibrium": NO_CODE}
    found: dict[str, Variable] = {}
    for name, (_, _, unit, about) in _TRAJECTORY.items():
        if name not in arrays:
            continue
        if isinstance(unit, str):
            found[name] = Variable(_EVERY, arrays[name], unit, about, codes.get(name, {}))
        else:
            found |= parts(name, _EVERY, arrays[name], unit, about)
    return found


def equilibrium_variables(
    phi: NDArray[np.float64], theta: NDArray[np.float64], omega: NDArray[np.float64]
) -> dict[str, Variable]:
    """The disturbed equilibria."""
    return {
        **numbers("equilibrium", len(phi), "number of the equilibrium"),
        "phi": Variable(_EACH, phi, "rad", "angle phi of the disturbed equilibrium"),
        "theta": Variable(_EACH, theta, "rad", "angle theta of the disturbed equilibrium"),
        "omega": Variable(_EACH, omega, "rad/s", "frequency in the norm"),
    }


def share_variables(shares: Mapping[str, NDArray[np.float64]]) -> dict[str, Variable]:
    """The shares of a tally of each equilibrium."""
    return {name: Variable(_EACH, shares[name], "1", about) for name, about in ABOUT_SHARES.items()}


def quantile_variables(quantiles: NDArray[np.float64]) -> dict[str, Variable]:
    """Quantiles of the times to return to each equilibrium."""
    dims = ("equilibrium", "quantile")
    return {
        "quantile": QUANTILE,
        "time_to_return_quantile": Variable(dims, quantiles, "s", ABOUT_QUANTILES),
    }


def halving_variables(errors: NDArray[np.float64]) -> dict[str, Variable]:
    """How far final states of some trajectories are from those of half the step."""
    return parts(
        "halving_difference",
        ("equilibrium", "sample"),
        errors,
        {"angle": "rad", "rate": "rad/s"},
        "largest difference of a final {} from that with half the step, first trajectories; NaN: failed",
    )


def linear_variables(directions: NDArray[np.float64], limit: NDArray[np.float64]) -> dict[str, Variable]:
    """How far the linearized motion can be trusted."""
    return {
        **parts(
            "linear_direction",
            ("equilibrium", "direction"),
            directions,
            STATE_UNITS,
            "{} of a disturbance of size 1 rad",
        ),
        "linear_limit": Variable(
            ("equilibrium", "direction"),
            limit,
            "rad",
            "size up to which the linearized motion keeps the tolerance, inf: beyond all tried, 0: below",
        ),
    }
