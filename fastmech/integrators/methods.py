"""What a method is to those who run it; every method by its name, and which one to use.

Measured on the mechanism (largest error of final states, right-hand sides a trajectory): the Adams methods
need the fewest right-hand sides at every accuracy, because each step costs one or two. With steps fitted to
each trajectory (:mod:`fastmech.ensembles.fitting`) ``abm8`` leads down to errors of 1e-5, ``abm10`` to 1e-9,
``abm12`` below, with ``ab6`` and ``ab7`` close behind; of the Runge-Kutta methods ``tsit5`` leads down to
1e-4, ``verner6`` and ``dop853`` to 1e-7, ``hairer10`` below. Choose a Runge-Kutta method where outputs are
close together or unevenly spaced (an Adams method starts anew whenever its step changes), where trajectories
are short, or where the step is large for the system: the Adams methods' stability intervals are short and end
abruptly,

    =========  ====  =====  =====  =====  ====  =====  =====
    method     ab5   ab6    ab7    ab8    abm8  abm10  abm12
    -h lambda  0.16  0.087  0.046  0.024  0.58  0.34   0.21
    =========  ====  =====  =====  =====  ====  =====  =====

for y' = lambda y with real lambda < 0.

The implicit methods are stable at any step for every decaying motion: ``gauss2``, ``gauss4`` and ``gauss6``
(A-stable) keep the energy of conservative scenes over long times in Hamilton's formulation; ``radau3``,
``radau5`` and ``sdirk4`` (L-stable) are for heavy damping, where the explicit methods' limit and not the
accuracy would set the step.

An Adams formula advances by the integral over one step of the polynomial that interpolates the derivative at
equidistant times (Hairer, Norsett, Wanner, *Solving ODEs I*, section III.1); its weights are computed exactly
from that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, cached_property
from typing import Any

import numpy as np

from fastmech.arrays import Floats
from fastmech.callee import callee
from fastmech.errors import InputError, shown
from fastmech.integrators.explicit import Batch, bound, formula_of
from fastmech.integrators.implicit import ImplicitCalls, drive_implicit, inverse_by_elimination
from fastmech.integrators.tableau import ImplicitTableau, Tableau
from fastmech.integrators.tableaus import TABLEAUS
from fastmech.integrators.tableaus.implicit import IMPLICIT_TABLEAUS
from fastmech.kernels.blocks import VECTOR_LANES
from fastmech.kernels.steps import Formula


def interpolatory_weights(nodes: Sequence[int]) -> list[Fraction]:
    """Weights of the quadrature over [0, 1] that is exact for polynomials of degree below ``len(nodes)``.

    The integral of each Lagrange polynomial on ``nodes`` (times in steps, relative to the step's start).
    """
    weights = []
    for node in nodes:
        polynomial, scale = [Fraction(1)], Fraction(1)  # coefficients by rising power
        for other in nodes:
            if other != node:
                scale *= node - other
                shifted, scaled = [Fraction(0), *polynomial], [other * c for c in (*polynomial, Fraction(0))]
                polynomial = [a - b for a, b in zip(shifted, scaled, strict=True)]
        integral = sum((c / (power + 1) for power, c in enumerate(polynomial)), Fraction(0))
        weights.append(integral / scale)
    return weights


@cache
def bashforth(order: int) -> tuple[Fraction, ...]:
    """Explicit formula: weights of f at t_n, t_(n-1), ..., t_(n-order+1)."""
    return tuple(interpolatory_weights(range(0, -order, -1)))


@cache
def moulton(order: int) -> tuple[Fraction, ...]:
    """Implicit formula: weights of f at t_(n+1), t_n, ..., t_(n-order+2)."""
    return tuple(interpolatory_weights(range(1, 1 - order, -1)))


#: Newton iterations that a step of ordinary length takes: what ``evaluations`` reckons with.
TYPICAL_ITERATIONS = 4


class Method:
    """A fixed-step method, whatever its family."""

    name: str  #: in the registry
    order: int  #: of the error in the step's length
    source: str  #: where its formula comes from
    rows: int  #: derivatives of a block that a step works on: stages or history
    start_steps: int = 0  #: steps at the start, and where the step's length changes, of a starter
    carried: int = 0  #: what it carries of each lane from call to call, in states' sizes
    lanes: int = 0  #: width of its blocks; 0: any

    def evaluations(self, steps: int) -> int:
        """Right-hand sides that so many steps of equal length take, the starter's included."""
        return steps * self.rows

    def run(self, rhs: Any, observe: Any, batch: Batch) -> Floats | None:
        """Take a batch through its times.

        Returns:
            ``None``, or of a method that can fail (blocks, lanes): NaN, or the time [s] of the last state of
            a lane that has failed, which it keeps.
        """
        raise NotImplementedError

    def _named_by(self, tableau: Tableau, carried: int = 0) -> None:
        """What a Runge-Kutta method takes from its tableau."""
        own = {"name": tableau.name, "order": tableau.order, "source": tableau.source}
        vars(self).update(own, rows=tableau.stages, carried=carried)


class Explicit(Method):
    """A method whose driver is :func:`fastmech.integrators.explicit.drive`."""

    lanes = VECTOR_LANES
    formulas: tuple[Formula, Formula]  #: what whole steps are made from: those of the start, and the others

    def run(self, rhs: Any, observe: Any, batch: Batch) -> None:
        """Take a batch through its times."""
        known, (_, dim, width) = vars(rhs).setdefault("bound", {}), batch.Y.shape
        key = id(self), id(observe), batch.Y.dtype, dim, width
        if key not in known:  # who is named by its id is kept alive
            known[key] = *bound(self, (rhs, observe), (batch.Y.dtype, dim, width)), self, observe
        drive, calls, weights, *_ = known[key]
        drive(calls, weights, batch.ready(self.carried))


@dataclass(frozen=True)
class RungeKutta(Explicit):
    """An explicit Runge-Kutta method: its tableau."""

    tableau: Tableau

    def __post_init__(self) -> None:
        self._named_by(self.tableau)
        vars(self).update(formulas=(formula_of(self.tableau),) * 2)


@dataclass(frozen=True)
class Adams(Explicit):
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

    def __post_init__(self) -> None:
        rows = self.order - self.corrects
        vars(self).update(rows=rows, start_steps=rows - 1, carried=2 * rows + 3)

    @cached_property
    def predictor(self) -> Floats:
        """Weights of the derivatives at t_n, t_(n-1), ...: explicit formula."""
        return np.array(bashforth(self.rows), dtype=np.float64)

    @cached_property
    def corrector(self) -> Floats:
        """Weights of the derivatives at t_(n+1), t_n, ...: implicit formula; empty without a corrector."""
        return np.array(moulton(self.order) if self.corrects else [], dtype=np.float64)

    @cached_property
    def formulas(self) -> tuple[Formula, Formula]:  # type: ignore[override]
        """The starter's, and its own."""
        predictor, corrector = tuple(self.predictor.tolist()), tuple(self.corrector.tolist())
        own = Formula(self.name, predictor=predictor, corrector=corrector, rows=self.rows)
        return formula_of(self.starter, self.rows), own

    def evaluations(self, steps: int) -> int:
        """Right-hand sides that so many steps of equal length take, the first and the starter's included."""
        start = min(steps, self.start_steps)
        others = (steps > start) + (steps - start) * (2 if self.corrects else 1)
        return start * self.starter.stages + others


@dataclass(frozen=True)
class ImplicitRungeKutta(Method):
    """An implicit Runge-Kutta method, and what solves the systems of what it is to integrate.

    ``inverse`` is a block kernel (:data:`fastmech.jit.INVERSE_SIGNATURE`); ``None`` takes elimination. The
    Jacobian is that of forward differences of the right-hand side.
    """

    tableau: ImplicitTableau
    inverse: Any = None

    def __post_init__(self) -> None:
        # The last step's increments, from which the next one's are guessed, and the sum's compensation.
        self._named_by(self.tableau, carried=self.tableau.stages + 1)

    def evaluations(self, steps: int) -> int:
        """Right-hand sides that so many steps take where Newton's iteration converges as usual."""
        return steps * self.rows * TYPICAL_ITERATIONS

    def run(self, rhs: Any, observe: Any, batch: Batch) -> Floats | None:
        """Take a batch through its times; a lane has failed where Newton's iteration no longer converged."""
        failed = np.full(batch.Y.shape[::2], np.nan)
        calls = ImplicitCalls(*map(callee, (rhs, self.inverse or inverse_by_elimination, observe)))
        drive_implicit(calls, self.tableau.scheme, batch.ready(self.carried), failed)
        return failed


def with_inverse(method: Method, inverse: Any) -> Method:
    """The method, told how to solve its systems, if it is one that has any."""
    return replace(method, inverse=inverse) if isinstance(method, ImplicitRungeKutta) else method


_EXPLICIT = "Adams; Bashforth, Adams, Theories of Capillary Action, 1883; weights derived exactly"
_CORRECTED = (
    "Moulton, New Methods in Exterior Ballistics, 1926, with Adams-Bashforth of one order less as predictor"
)

_ALL: tuple[Method, ...] = (
    *map(RungeKutta, TABLEAUS.values()),
    Adams("ab5", 5, False, TABLEAUS["tsit5"], _EXPLICIT),
    Adams("ab6", 6, False, TABLEAUS["tsit5"], _EXPLICIT),
    Adams("ab7", 7, False, TABLEAUS["verner6"], _EXPLICIT),
    Adams("ab8", 8, False, TABLEAUS["verner7"], _EXPLICIT),
    Adams("abm8", 8, True, TABLEAUS["dop853"], _CORRECTED),
    Adams("abm10", 10, True, TABLEAUS["dop853"], _CORRECTED),
    Adams("abm12", 12, True, TABLEAUS["dop853"], _CORRECTED),
    *map(ImplicitRungeKutta, IMPLICIT_TABLEAUS.values()),
)

#: Every method by its name.
METHODS: dict[str, Method] = {method.name: method for method in _ALL}

#: What other libraries call them, in lower case.
_ELSEWHERE = {"rk45": "dopri5", "ode45": "dopri5", "dp5": "dopri5", "radau": "radau5", "vern6": "verner6"}


def find_method(name: str) -> Method:
    """The method of this name.

    Raises:
        InputError: no such method; the message lists the known ones, after the one that is meant by a name in
            capitals or another library's.
    """
    if isinstance(name, str) and name in METHODS:
        return METHODS[name]
    low = name.lower() if isinstance(name, str) else ""
    meant = _ELSEWHERE.get(low, low if low in METHODS else None)
    hint = "" if meant is None else f"did you mean {meant!r}? "
    raise InputError(f"method = {shown(name)}: unknown; {hint}known: {', '.join(METHODS)}")
