"""What a fixed-step method is to those who run it: a name, what a step costs, and one call."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fastmech.callee import callee
from fastmech.integrators.batch import Batch, Floats
from fastmech.integrators.explicit import Weights, formula_of, take_steps, weights_of
from fastmech.integrators.implicit_tableau import ImplicitTableau
from fastmech.integrators.multistep_weights import bashforth, moulton
from fastmech.integrators.tableau import Tableau
from fastmech.kernels.blocks import VECTOR_LANES
from fastmech.kernels.whole import Formula


class Method(Protocol):
    """A fixed-step method, whatever its family."""

    @property
    def name(self) -> str:
        """Name in the registry."""

    @property
    def order(self) -> int:
        """Order of the error in the step's length."""

    @property
    def source(self) -> str:
        """Where its formula comes from."""

    @property
    def start_steps(self) -> int:
        """Steps at the start, and where the step's length changes, of a starter; 0 for most methods."""

    @property
    def rows(self) -> int:
        """Derivatives of a block that a step works on: stages or history."""

    @property
    def carried(self) -> int:
        """What it carries of each lane from call to call, in states' sizes; 0: nothing."""

    @property
    def lanes(self) -> int:
        """Width of its blocks; 0: any."""

    def evaluations(self, steps: int) -> int:
        """Right-hand sides that so many steps of equal length take, the starter's included."""

    def run(self, rhs: Any, observe: Any, batch: Batch) -> Floats | None:
        """Take a batch through its times.

        Returns:
            ``None``, or of a method that can fail (blocks, lanes): NaN, or the time [s] of the last state of
            a lane that has failed, which it keeps.
        """


class OneStep:
    """What a Runge-Kutta method takes from its tableau, explicit or implicit."""

    tableau: Any

    @property
    def name(self) -> str:
        """Name in the registry."""
        return str(self.tableau.name)

    @property
    def order(self) -> int:
        """Order of the error in the step's length."""
        return int(self.tableau.order)

    @property
    def source(self) -> str:
        """Where its coefficients come from."""
        return str(self.tableau.source)

    @property
    def start_steps(self) -> int:
        """None: every step stands alone."""
        return 0

    @property
    def rows(self) -> int:
        """Stages."""
        return int(self.tableau.stages)

    @property
    def carried(self) -> int:
        """Nothing."""
        return 0


@dataclass(frozen=True)
class RungeKutta(OneStep):
    """An explicit Runge-Kutta method: its tableau."""

    tableau: Tableau

    def evaluations(self, steps: int) -> int:
        """Right-hand sides that so many steps take."""
        return steps * self.tableau.stages

    @property
    def lanes(self) -> int:
        """Those of whole steps."""
        return VECTOR_LANES

    @property
    def formulas(self) -> tuple[Formula, Formula]:
        """What whole steps are made from: those of the start, and the others."""
        return (formula_of(self.tableau),) * 2

    @cached_property
    def weights(self) -> Weights:
        """Its weights as arrays."""
        return weights_of(self.tableau)

    def run(self, rhs: Any, observe: Any, batch: Batch) -> None:
        """Take a batch through its times."""
        take_steps(self, rhs, observe, batch)


@dataclass(frozen=True)
class Adams:
    """An Adams method, started by a Runge-Kutta method.

    Explicit (Adams-Bashforth): one right-hand side a step, a history of ``order`` derivatives; error constant
    0.32 (order 6), 0.29 (8). With ``corrects`` a pair in PECE mode on a history of ``order - 1`` derivatives:
    Adams-Bashforth of order ``order - 1`` predicts, Adams-Moulton of ``order`` corrects, two right-hand sides
    a step; the corrector's error constant is -0.0094 (order 8), -0.0068 (10), -0.0052 (12). Predicting with
    order ``order - 1`` costs nothing in order: the predictor's error enters times h.

    The starter takes as many steps of the same length as the history is short of. Its local error is of the
    method's order, or, for orders 10 and 12, of order 9 but far below the method's at every useful step.
    """

    name: str
    order: int
    corrects: bool
    starter: Tableau
    source: str

    @cached_property
    def predictor(self) -> NDArray[np.float64]:
        """Weights of the derivatives at t_n, t_(n-1), ...: explicit formula."""
        return np.array(bashforth(self.order - 1 if self.corrects else self.order), dtype=np.float64)

    @cached_property
    def corrector(self) -> NDArray[np.float64]:
        """Weights of the derivatives at t_(n+1), t_n, ...: implicit formula; empty without a corrector."""
        return np.array(moulton(self.order) if self.corrects else [], dtype=np.float64)

    @property
    def start_steps(self) -> int:
        """Steps that the history is short of."""
        return self.predictor.size - 1

    @property
    def rows(self) -> int:
        """History."""
        return self.predictor.size

    @property
    def carried(self) -> int:
        """History, twice, and the greatest last terms of the predictor, see :mod:`fastmech.kernels.whole`."""
        return 2 * self.predictor.size + 3

    @property
    def lanes(self) -> int:
        """Those of whole steps."""
        return VECTOR_LANES

    @property
    def formulas(self) -> tuple[Formula, Formula]:
        """What whole steps are made from: the starter's, and its own."""
        predictor, corrector = tuple(self.predictor.tolist()), tuple(self.corrector.tolist())
        own = Formula(self.name, predictor=predictor, corrector=corrector, rows=len(predictor))
        return formula_of(self.starter, len(predictor)), own

    @cached_property
    def weights(self) -> Weights:
        """Its weights and its starter's as arrays."""
        return weights_of(self.starter, self.predictor, self.corrector)

    def evaluations(self, steps: int) -> int:
        """Right-hand sides that so many steps of equal length take, the first and the starter's included."""
        start = min(steps, self.start_steps)
        others = (steps > start) + (steps - start) * (2 if self.corrects else 1)
        return start * self.starter.stages + others

    def run(self, rhs: Any, observe: Any, batch: Batch) -> None:
        """Take a batch through its times."""
        take_steps(self, rhs, observe, batch)


#: Newton iterations that a step of ordinary length takes: what ``evaluations`` reckons with.
TYPICAL_ITERATIONS = 4


@dataclass(frozen=True)
class ImplicitRungeKutta(OneStep):
    """An implicit Runge-Kutta method, and the Jacobian of what it is to integrate.

    ``jacobian`` and ``inverse`` are block kernels (:data:`fastmech.jit.JACOBIAN_SIGNATURE`,
    :data:`fastmech.jit.INVERSE_SIGNATURE`); ``None`` takes forward differences of the right-hand side, and
    elimination.
    """

    tableau: ImplicitTableau
    jacobian: Any = None
    inverse: Any = None

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
        from fastmech.integrators.implicit import Calls, drive_implicit, inverse_by_elimination

        jacobian, inverse = self.jacobian or rhs, self.inverse or inverse_by_elimination
        failed = np.full(batch.Y.shape[::2], np.nan)
        calls = Calls(*map(callee, (rhs, jacobian, inverse, observe)))
        scheme = self.tableau.scheme._replace(differences=self.jacobian is None)
        drive_implicit(calls, scheme, batch.ready(self.carried), failed)
        return failed


def with_jacobian(method: Method, jacobian: Any, inverse: Any = None) -> Method:
    """The method, told the Jacobian, and how to solve its systems, if it is one that needs them."""
    if isinstance(method, ImplicitRungeKutta) and jacobian is not None:
        return replace(method, jacobian=jacobian, inverse=inverse)
    return method
