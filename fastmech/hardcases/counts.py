"""How many right-hand sides an implicit method really takes, and RK4 at its stability limit beside it.

The implicit driver is run as plain Python, where right-hand sides and Jacobians are functions that count.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fastmech.hardcases.case import Floats
from fastmech.hardcases.walk import Goal
from fastmech.integrators.explicit import observe_nothing
from fastmech.integrators.implicit import SECOND_ORDER, integrate_implicit_block
from fastmech.integrators.methods import METHODS
from fastmech.integrators.tableaus.implicit import IMPLICIT_TABLEAUS
from fastmech.kernels.jacobians import lagrange_jacobian
from fastmech.kernels.select import right_hand_side
from fastmech.mechanism.coefficients import reduce
from fastmech.step_limits.predict import stable_step


class Work(NamedTuple):
    """What a run took."""

    state: Floats  #: (4,) at the end
    calls: int  #: right-hand sides
    jacobians: int
    path: Floats  #: states (steps + 1, 4)


def counted(goal: Goal, method: str, steps: int) -> Work:
    """A run of an implicit method in equal steps with every call counted."""
    prepared = IMPLICIT_TABLEAUS[method].prepared
    c = reduce(goal.scene)
    rhs, calls = right_hand_side(c), [0, 0]

    def counting_rhs(t: float, Y: Floats, dY: Floats, params: Floats) -> None:
        calls[0] += 1
        rhs(t, Y, dY, params)

    def counting_jacobian(t: float, Y: Floats, J: Floats, params: Floats) -> None:
        calls[1] += 1
        lagrange_jacobian(t, Y, J, params)

    driver: Any = integrate_implicit_block
    Y, out = goal.start[:, None].copy(), np.empty((steps, 4, 1))
    with np.errstate(all="ignore"):
        getattr(driver, "py_func", driver)(
            counting_rhs,
            counting_jacobian,
            observe_nothing,
            SECOND_ORDER,
            prepared.a,
            prepared.nodes,
            prepared.final,
            prepared.back,
            prepared.forth,
            prepared.eigenvalues,
            prepared.extrapolation,
            prepared.remainder,
            np.linspace(0.0, goal.t_end, steps + 1),
            np.ones(steps, dtype=np.int64),
            Y,
            np.array(c, dtype=np.float64)[:, None],
            np.zeros(0),
            np.zeros((0, 1)),
            out,
            np.full(1, np.nan),
        )
    path = np.concatenate([goal.start[None], out[:, :, 0]])
    return Work(Y[:, 0], calls[0], calls[1], path)


def path_eigenvalues(goal: Goal, path: Floats) -> Floats:
    """Eigenvalues (states, 4) [1/s] of the motion linearized along a path (states, 4)."""
    Y = np.ascontiguousarray(path.T)
    J = np.empty((16, len(path)))
    own = np.repeat(np.array(reduce(goal.scene), dtype=np.float64)[:, None], len(path), axis=1)
    lagrange_jacobian(0.0, Y, J, own)
    return np.asarray(np.linalg.eigvals(J.T.reshape(-1, 4, 4)))


def explicit_calls(goal: Goal, path: Floats, method: str = "rk4") -> float:
    """Right-hand sides of an explicit method whose step is the stability limit all along a path.

    Fewer than with any fixed step, which the narrowest place on the path sets.
    """
    formula = METHODS[method]
    limits = np.array([stable_step(formula, values) for values in path_eigenvalues(goal, path)])
    steps = goal.t_end * float(np.mean(1.0 / limits))
    return steps * formula.evaluations(1000) / 1000.0
