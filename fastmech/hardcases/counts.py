"""How many right-hand sides an implicit method really takes, and RK4 at its stability limit beside it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fastmech.hardcases.references import Floats, Goal
from fastmech.integrators.batch import Batch, observe_nothing
from fastmech.integrators.method import ImplicitRungeKutta
from fastmech.integrators.methods import METHODS
from fastmech.integrators.tableaus.implicit import IMPLICIT_TABLEAUS
from fastmech.kernels.counting import CALLS, JACOBIANS, counting_jacobian, counting_lagrange
from fastmech.kernels.jacobians import lagrange_inverse, lagrange_jacobian
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
    params = np.concatenate([np.array(reduce(goal.scene), dtype=np.float64), np.zeros(2)])
    batch = Batch(
        times=np.linspace(0.0, goal.t_end, steps + 1),
        steps=np.ones(steps, dtype=np.int64),
        params=params[None, :, None].copy(),
        observer_params=np.zeros(0),
        Y=goal.start[None, :, None].copy(),
        record=np.zeros((1, 0, 1)),
        out=np.empty((1, steps, 4, 1)),
    )
    formula = ImplicitRungeKutta(IMPLICIT_TABLEAUS[method], counting_jacobian, lagrange_inverse)
    formula.run(counting_lagrange, observe_nothing, batch)
    calls, jacobians = (int(batch.params[0, row, 0]) for row in (CALLS, JACOBIANS))
    path = np.concatenate([goal.start[None], batch.out[0, :, :, 0]])
    return Work(path[-1], calls, jacobians, path)


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
