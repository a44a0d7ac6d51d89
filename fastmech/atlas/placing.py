"""A critical point over one parameter placed by its defining system, and what rounding leaves open.

Lists of equilibria tell about where something changes; near to where equilibria meet rounding hides them from
lists, but not from equations that are regular there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.atlas.branch import ROUNDING
from fastmech.atlas.continuation import newton
from fastmech.atlas.defining import Balance, border

#: Whose equations a kind of critical point has; of two the first that have a solution.
EQUATIONS: dict[str, tuple[str, ...]]
EQUATIONS = {one: (one,) for one in ("fold", "pitchfork", "Hopf", "coalescence", "flutter-divergence")}
EQUATIONS |= {"exchange": ("pitchfork",), "divergence": ("pitchfork", "fold")}

#: How far Newton's method may go, and how far beside the solution it is tried what rounding does to it.
REACH, BESIDE = 0.1, 1e-10

#: Rounding may move a solution so many times as far as the trials show.
SURE = 4.0

#: Parts of a direction that are rounding, in digits.
DIGITS = 9


class Located(NamedTuple):
    """Where a critical point is."""

    value: float  #: of the parameter
    width: float  #: of the interval about the value in which rounding may leave it
    position: Floats  #: [rad or m]
    direction: Floats | None = None  #: in which the stiffness is zero, largest part 1; None: a swing


def placed(balance: Balance, kind: str, about: tuple[Floats, float], rate: float) -> Located | None:
    """The critical point of a kind that is about a position and value; None: its equations tell none.

    ``rate`` is about that of the swing [rad/s], or of the growth [1/s].
    """
    position, value = about
    start, n = balance.point(position, np.array([value])), balance.n
    balance.rescale(start)
    for name in EQUATIONS[kind]:
        equations, more = balance.defining(name, rate)
        z = newton(equations, np.insert(start, n, more), REACH)
        if z is None:
            continue
        trials = []
        for x in z + BESIDE * np.concatenate([np.eye(z.size), -np.eye(z.size)]):
            force, jacobian = equations(x)
            try:
                trials.append(x - np.linalg.solve(jacobian, force) - z)
            except np.linalg.LinAlgError:
                trials.append(np.full(z.size, np.inf))
        moved = SURE * np.abs(trials).max(axis=0)
        if not np.isfinite(moved).all() or (name == "pitchfork" and abs(z[n]) > max(moved[n], ROUNDING)):
            continue
        low, span = float(balance.low[0]), float(balance.span[0])
        unit = float(np.spacing(max(abs(low), abs(low + span))))
        z[:n][np.abs(z[:n]) <= moved[:n]] = 0.0
        value, width = float(balance.values(z)[0]), 2.0 * (span * float(moved[-1]) + SURE * unit)
        direction = _direction(balance, z) if name in ("fold", "pitchfork") else None
        return Located(value, width, balance.position(z) + 0.0, direction)
    return None


def _direction(balance: Balance, z: Floats) -> Floats:
    right = border(balance.forces(z)[1][:, : balance.n]).right * balance.size
    return np.asarray(np.round(right / right[np.abs(right).argmax()], DIGITS) + 0.0)
