"""Implicit Runge-Kutta methods as those who run them see them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np

from fastmech.callee import callee
from fastmech.integrators.batch import Batch, Floats
from fastmech.integrators.implicit_tableau import ImplicitTableau
from fastmech.integrators.method import Method, OneStep

#: Newton iterations that a step of ordinary length takes: what ``evaluations`` reckons with.
TYPICAL_ITERATIONS = 4


@dataclass(frozen=True)
class ImplicitRungeKutta(OneStep):
    """An implicit Runge-Kutta method, and the Jacobian of what it is to integrate.

    ``jacobian`` is a block kernel (:data:`fastmech.jit.JACOBIAN`); ``None`` takes forward differences of the
    right-hand side. ``second_order`` says that the state is two angles and then their velocities.
    """

    tableau: ImplicitTableau
    jacobian: Any = None
    second_order: bool = False

    @property
    def lanes(self) -> int:
        """Any."""
        return 0

    @property
    def carried(self) -> int:
        """The last step's increments, from which the next one's are guessed, and the sum's compensation."""
        return int(self.tableau.stages) + 1

    def evaluations(self, steps: int) -> int:
        """Right-hand sides that so many steps take where Newton's iteration converges as usual."""
        return steps * self.tableau.stages * TYPICAL_ITERATIONS

    def run(self, rhs: Any, observe: Any, batch: Batch) -> Floats | None:
        """Take a batch through its times.

        Returns:
            (blocks, lanes): NaN, or the time [s] at which Newton's iteration no longer converged; such a lane
            keeps the state that it had then.
        """
        # Their kernels are loaded when a run first needs them: a first result comes sooner.
        drive = import_module("fastmech.integrators.implicit").integrate_implicit_block
        newton = import_module("fastmech.integrators.newton")
        kind = newton.SECOND_ORDER if self.second_order else newton.GENERAL
        kind = newton.DIFFERENCES if self.jacobian is None else kind
        prepared = self.tableau.prepared
        blocks, _, lanes = batch.Y.shape
        failed, memory = np.full((blocks, lanes), np.nan), batch.memory_of(self.carried)
        phase = batch.phase.copy()
        for block in range(blocks):
            batch.phase[:] = phase
            drive(
                callee(rhs),
                callee(rhs if self.jacobian is None else self.jacobian),
                callee(observe),
                kind,
                prepared.a,
                prepared.nodes,
                prepared.final,
                prepared.back,
                prepared.forth,
                prepared.eigenvalues,
                prepared.extrapolation,
                prepared.remainder,
                batch.times,
                batch.steps,
                batch.Y[block],
                batch.params[min(block, len(batch.params) - 1)],
                batch.observer_params,
                batch.record[block],
                batch.out[block],
                failed[block],
                memory[block],
                batch.phase,
            )
        return failed


def with_jacobian(method: Method, jacobian: Any, second_order: bool) -> Method:
    """The method, told the Jacobian if it is one that needs it."""
    if isinstance(method, ImplicitRungeKutta) and jacobian is not None:
        return replace(method, jacobian=jacobian, second_order=second_order)
    return method
