"""Whole steps of explicit methods in one loop over lanes, made for one right-hand side.

Stage by stage, a step reads and writes its stages or its history several times. Here all that a lane needs in
a step are local numbers: the loop's source is written from the right-hand side and the method's weights, and
compiled when a run first asks for it. Blocks are :data:`~fastmech.kernels.blocks.VECTOR_LANES` wide and their
width is known to the compiler: rows of a block lie at constant distances, so it sees that none overlap. Some
blocks take a step together: while one waits for its numbers, the processor works on another.

The history of an Adams method is a ring whose rows are kept twice, one ring after the other: wherever it
begins, its rows lie in the order of their times. The ring has one row more than the formula, which the step's
derivative takes.

An Adams predictor of order k is a sum over backward differences of the history, h (f_n + 1/2 nabla f_n + ..
+ gamma_(k-1) nabla^(k-1) f_n) (Hairer, Norsett, Wanner, *Solving ODEs I*, section III.1); without its last
term it is that of order k - 1. That term is small where a polynomial describes the history. It is not where
steps are too long for the motion, nor where the method's spurious roots have grown: differences magnify what
alternates from step to step. A lane's greatest one is kept, in the states that its right-hand side names.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from textwrap import indent
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.jit import lanes, named_tuple
from fastmech.kernels.blocks import VECTOR_LANES, Rates, identifier, loops


class LaneArrays(NamedTuple):
    """Blocks of lanes, flat, as steps are given them."""

    Y: Floats  #: states (blocks, dim, lanes)
    params: Floats  #: parameters (blocks, count, lanes), or of one block for all
    memory: Floats  #: histories, then a row of the greatest last terms (blocks, 2 rows + 3, dim, lanes)
    lost: NDArray[np.bool_]  #: scratch: who needs the library's trigonometry in it (blocks, lanes)


class Steps(NamedTuple):
    """Steps of some blocks."""

    t: float  #: time of step 0 [s]
    h: float  #: length [s]
    first: int  #: first step
    last: int  #: the step after the last one
    begin: int  #: first block
    end: int  #: the block after the last one
    given: int  #: numbers of a block's parameters; 0: all have those of the first
    oldest: int  #: row before that of the oldest derivative in the history


#: ``advance(lanes, steps)`` gives the number of steps taken, negative if some lanes are lost in the last one:
#: that is to be done again for them.
Advance = Callable[[LaneArrays, Steps], int]

#: Steps between two looks at the last term: a history is about as long, so that little passes unseen.
EVERY = 8

#: States, and products of a step's sums, up to which steps are made whole: what is longer takes longer to
#: compile than it saves.
MOST_STATES, MOST_PRODUCTS = 16, 1200

#: Rows of a step above which the compiler does not compare each with each to see whether arrays overlap. It
#: is told then that they do not; of fewer rows it makes better code by itself.
MOST_ROWS = 100


STEPS = named_tuple([*[types.float64] * 2, *[types.int64] * 6], Steps)


def advance_signature(precision: Any) -> Any:
    """Signature of :data:`Advance`."""
    flags = types.Array(types.boolean, 1, "C")
    return types.int64(named_tuple([*[lanes(precision, 1)] * 3, flags], LaneArrays), STEPS)


class Formula(NamedTuple):
    """An explicit Runge-Kutta method, or an Adams method, which has a predictor."""

    name: str
    a: tuple[tuple[float, ...], ...] = ()  #: rows of the lower triangle
    b: tuple[float, ...] = ()  #: weights
    c: tuple[float, ...] = ()  #: nodes
    predictor: tuple[float, ...] = ()  #: weights of the derivatives at t_n, t_(n-1), ...
    corrector: tuple[float, ...] = ()  #: at t_(n+1), t_n, ...; empty for an explicit method
    rows: int = 0  #: of an Adams method's history; a starter puts the derivatives at its steps' begins there

    @property
    def products(self) -> int:
        """Products in the sums of a step, for each state."""
        return sum(
            weight != 0.0 for row in (*self.a, self.b, self.predictor, self.corrector) for weight in row
        )


_HEAD = '''"""Made by fastmech: steps of {name} of {rates}, {precision}, each in one loop."""

from numba.core import types
from numpy import float32

from fastmech.jit import called, kernel
from fastmech.kernels.attempt import attempt
from fastmech.kernels.bits import NO_LANE, apart, not_inlined, noted
from fastmech.kernels.steps import advance_signature

{look}
@kernel(advance_signature(types.{precision}))
def {function}(lanes, steps):
{apart}    h = {h}
    for chunk in range(steps.first // {every}, (steps.last + {every} - 1) // {every}):
{looking}        for k in range(max(steps.first, {every} * chunk), min(steps.last, {every} * (chunk + 1))):
            t = steps.t + k * steps.h
            lost = NO_LANE
            for block in range(steps.begin, steps.end):
                y = lanes.Y[block * {size} : (block + 1) * {size}]
                p = lanes.params[block * steps.given :]
{prepare}                for i in range({width}):
{loop}
            if lost:
                return steps.first - k - 1
    return steps.last - steps.first
'''

#: Before the loop: where it is told who needs the library's functions, and where the history is.
_RANGED = """\
told = lanes.lost[(block - steps.begin) * {width} : (block - steps.begin + 1) * {width}]
"""
_HISTORY = """\
place = (block * {carried} + (steps.oldest + k - steps.first) % {ring}) * {size}
f = lanes.memory[place : place + {window}]
"""

_LOOK = """
@called
def look(lanes, steps, k):
    not_inlined()
    h = {h}
    for block in range(steps.begin, steps.end):
{history}        place = (block * {carried} + {carried} - 1) * {size}
        greatest = lanes.memory[place : place + {width}]
        for i in range({width}):
            term = greatest[i]
{terms}            greatest[i] = term

"""

_LOOKING = """\
        if {every} * chunk >= steps.first:
            look(lanes, steps, {every} * chunk)
"""


@cache
def whole_steps(rates: Rates, formula: Formula, precision: str) -> Any:
    """:data:`Advance` of a method for a right-hand side; ``None`` where it would be too long."""
    if rates.vector or rates.states > MOST_STATES or rates.states * formula.products > MOST_PRODUCTS:
        return None
    return loops(rates, precision, source(rates, formula, precision), _function(rates, formula))


def source(rates: Rates, formula: Formula, precision: str) -> str:
    """The text of the loop."""
    writer = _Writer(rates, precision)
    steps = writer.adams if formula.predictor else writer.runge_kutta
    loop = steps(formula)
    return _HEAD.format(
        name=formula.name,
        rates=rates.name,
        function=_function(rates, formula),
        precision=precision,
        h=writer.h,
        size=writer.size,
        width=VECTOR_LANES,
        every=EVERY,
        apart="    apart()\n" if rates.states * (formula.rows + 4) > MOST_ROWS else "",
        look=writer.look,
        looking=_LOOKING.format(every=EVERY) if writer.look else "",
        prepare=indent(writer.prepare, " " * 16),
        loop=indent(loop, " " * 20),
    )


def _function(rates: Rates, formula: Formula) -> str:
    return identifier(f"{formula.name}_steps_of_{rates.name}")


def term_weights(predictor: Sequence[float]) -> list[float]:
    """Weights of f_n, f_(n-1), ... in the last term over h: gamma_(k-1) (-1)^a binomial(k - 1, a).

    The oldest derivative is in no other term, so its weight in the predictor tells gamma_(k-1).
    """
    k, weights = len(predictor), [abs(predictor[-1])]
    for age in range(1, k):
        weights.append(-weights[-1] * (k - age) / age)
    return weights


class _Writer:
    """Text of the arithmetic of a step for one right-hand side."""

    def __init__(self, rates: Rates, precision: str) -> None:
        self._rates, self._single = rates, precision == "float32"
        self._states = range(rates.states)
        self.size, self.h = rates.states * VECTOR_LANES, "float32(steps.h)" if self._single else "steps.h"
        self.prepare = _RANGED.format(width=VECTOR_LANES) if rates.ranged else ""
        self.look = ""

    def runge_kutta(self, formula: Formula) -> str:
        """A step of a Runge-Kutta method; y0, y1, ... are the stages' states, and the last one the step's."""
        text, stages = self._begin(), len(formula.b)
        if formula.rows:
            self.prepare += self._history(formula.rows)
        for s, row in enumerate([*formula.a[1:], formula.b]):
            text += self._evaluate(s, f"t + {formula.c[s]!r} * steps.h" if formula.c[s] else "t")
            for d in self._states:
                rates = {f"k{stage}_{d}": weight for stage, weight in enumerate(row)}
                text += f"y{s + 1}_{d} = y0_{d} + h * ({self._sum(rates)})\n"
        if formula.rows:
            text += self._keep(formula.rows, 0)
        return text + self._end(range(stages), stages)

    def adams(self, formula: Formula) -> str:
        """A step of an Adams method: y1 is predicted, y2 corrected."""
        rows, new = formula.rows, "t + steps.h"
        self.prepare += self._history(rows)
        self.look = self._look(formula)
        text, first, *others = self._begin(), *(formula.corrector or (0.0,))
        for d in self._states:
            past = [f"f{age}" for age in range(rows)]
            text += "".join(f"{name} = {self._past(rows, age, d)}\n" for age, name in enumerate(past))
            predicted = dict(zip(past, formula.predictor, strict=True))
            text += f"y1_{d} = y0_{d} + h * ({self._sum(predicted)})\n"
            if others:
                text += f"w{d} = {self._sum(dict(zip(past, others, strict=True)))}\n"
        text += self._evaluate(1, new)
        if not others:
            return text + self._keep(rows, 1) + self._end([1], 1)
        for d in self._states:
            text += f"y2_{d} = y0_{d} + h * (w{d} + {self._number(first)} * k1_{d})\n"
        if self._rates.near:
            found = ", ".join(f"k2_{d}" for d in self._states)
            text += f"({found},) = rates_near({self._arguments(new, 2)}, kept)\n"
        else:
            text += self._evaluate(2, new)
        return text + self._keep(rows, 2) + self._end([1] if self._rates.near else [1, 2], 2)

    def _history(self, rows: int) -> str:
        window = (rows + 2) * self.size
        return _HISTORY.format(carried=2 * rows + 3, ring=rows + 1, size=self.size, window=window)

    def _keep(self, rows: int, number: int) -> str:
        """Put a derivative into the history, twice."""
        places = [(self._at("f", d), self._at("f", (rows + 1) * len(self._states) + d)) for d in self._states]
        return "".join(f"{a} = {b} = k{number}_{d}\n" for d, (a, b) in enumerate(places))

    def _look(self, formula: Formula) -> str:
        """The greatest last term of the predictor, now and then."""
        rows, text, weights = formula.rows, "", term_weights(formula.predictor)
        for d in range(self._rates.looked_at):
            term = self._sum({self._past(rows, age, d): weight for age, weight in enumerate(weights)})
            text += f"found = abs(h * ({term}))\nterm = found if found > term else term\n"
        return _LOOK.format(
            h=self.h,
            history=indent(self._history(rows), " " * 8),
            carried=2 * rows + 3,
            size=self.size,
            width=VECTOR_LANES,
            terms=indent(text, " " * 12),
        )

    def _past(self, rows: int, age: int, d: int) -> str:
        return self._at("f", (rows - age) * len(self._states) + d)

    def _begin(self) -> str:
        return "".join(f"y0_{d} = {self._at('y', d)}\n" for d in self._states)

    def _evaluate(self, number: int, t: str) -> str:
        found = [f"k{number}_{d}" for d in self._states]
        return self._rates.evaluation(f"lost{number}", found, self._arguments(t, number)) + "\n"

    def _arguments(self, t: str, number: int) -> str:
        t = f"float32({t})" if self._single else t
        return self._rates.arguments(t, [f"y{number}_{d}" for d in self._states], self._at("p", "{}"))

    def _end(self, evaluated: Sequence[int], last: int) -> str:
        """Who is lost keeps its state: the step is taken again."""
        text, kept = "", ""
        if self._rates.ranged:
            # Of a single condition the compiler makes branches; h is a number.
            raised = " | ".join([*(f"lost{number}" for number in evaluated), "(h != h)"])
            text, kept = (
                f"raised = {raised}\nlost, told[i] = noted(lost, raised), raised\n",
                "y0_{d} if raised else ",
            )
        for d in self._states:
            text += f"{self._at('y', d)} = {kept.format(d=d)}y{last}_{d}\n"
        return text

    def _number(self, value: float) -> str:
        return f"float32({value!r})" if self._single else repr(value)

    def _sum(self, weights: dict[str, float]) -> str:
        return " + ".join(f"{self._number(weight)} * {name}" for name, weight in weights.items() if weight)

    @staticmethod
    def _at(array: str, row: int | str) -> str:
        """A lane's number in a row of a block."""
        return f"{array}[{row} * {VECTOR_LANES} + i]"
