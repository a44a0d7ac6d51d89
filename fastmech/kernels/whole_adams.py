"""Whole steps of Adams methods of Lagrange's equations in one loop over lanes.

Sum by sum and stage by stage, a step reads and writes its history several times. Here a lane's predicted and
corrected states are local numbers, read once from the history and written once. Blocks are as wide as two
vectors of the longest kind, and their width is known to the compiler: all rows of a block's history lie at
constant distances, so it sees that none of them overlap.

A correction moves the angles by far less than a step does. Their sines and cosines are those of the predicted
angles, turned by the difference: of order 4 in it, which is itself of the predictor's order in the step.
"""

from __future__ import annotations

from textwrap import indent
from typing import Any, Protocol

from numpy.typing import NDArray

from fastmech.kernels.blocks import VECTOR_LANES
from fastmech.kernels.last_term import EVERY, LOOKED_AT, term_weights
from fastmech.kernels.whole_steps import ACCELERATIONS, ANGLES, RATES, compiled, terms_of


class Formula(Protocol):
    """What a loop is made from: an Adams method."""

    @property
    def name(self) -> str:
        """Name of the method."""

    @property
    def predictor(self) -> NDArray[Any]:
        """Weights of the derivatives at t_n, t_(n-1), ..."""

    @property
    def corrector(self) -> NDArray[Any]:
        """Weights of the derivatives at t_(n+1), t_n, ...; empty for an explicit method."""


_HEAD = '''"""Made by fastmech: steps of {name} of Lagrange's equations, each in one loop."""

from fastmech.jit import ADVANCE_SIGNATURE, kernel
from fastmech.kernels.blocks import DAMPING, DECAY, FORCE, write_decay
from fastmech.kernels.far import STRETCH, may_be_far
from fastmech.kernels.sincos import sincos
from fastmech.mechanism.equations import lagrange_accelerations


@kernel(ADVANCE_SIGNATURE)
def advance(t, h, first, last, F, oldest, Y, p, work, checked):
    y, own = Y.reshape(Y.size), p.reshape(p.size)
    for begin in range(first, last, STRETCH):
        if checked and may_be_far(Y, h):
            return begin - first
        for k in range(begin, min(begin + STRETCH, last)):
            f = F[(oldest + k - first) * {row} : (oldest + k - first + {rows} + 1) * {row}]
            if k % {every} == 0:
                for i in range({lanes}):
{look}{decay}            for i in range({lanes}):
'''

_DECAY = """            write_decay(t + (k + 1) * h, p, DECAY, work)
"""

#: The angles' sines and cosines, turned from the predicted to the corrected ones.
_TURN = """
d1, d2 = phi_n - phi_p, theta_n - theta_p
q1, q2 = d1 * d1, d2 * d2
sine1, sine2 = d1 - d1 * q1 * (1.0 / 6.0), d2 - d2 * q2 * (1.0 / 6.0)
versine1, versine2 = q1 * (0.5 - q1 * (1.0 / 24.0)), q2 * (0.5 - q2 * (1.0 / 24.0))
s1, c1 = s1 + (c1 * sine1 - s1 * versine1), c1 - (s1 * sine1 + c1 * versine1)
s2, c2 = s2 + (c2 * sine2 - s2 * versine2), c2 - (s2 * sine2 + c2 * versine2)
"""


def source(method: Formula, terms: str) -> str:
    """The loop of a method for a combination of terms (:func:`~fastmech.kernels.select.terms`): a module."""
    decays, corrects = "decaying" in terms, bool(method.corrector.size)
    rows, row = method.predictor.size, len(RATES) * VECTOR_LANES
    push = "force * work[0, i]" if decays else "force"
    text = _HEAD.format(
        name=method.name,
        rows=rows,
        row=row,
        lanes=VECTOR_LANES,
        every=EVERY,
        look=indent(_look(method.predictor), " " * 20),
        decay=_DECAY if decays else "",
    )
    loop = "".join(f"{state}0 = {_at('y', d)}\n" for d, (state, _) in enumerate(RATES))
    names = "mass", "slider", "lift", "spring", "gravity"
    loop += "".join(f"{name} = {_at('own', place)}\n" for place, name in enumerate(names))
    loop += f"force = {_at('own', 'FORCE') if decays or 'constant' in terms else None}\n"
    loop += f"damping = {_at('own', 'DAMPING') if 'damped' in terms else None}\n"
    new = "_p" if corrects else "_n"  # the state that the history alone gives
    for d, (state, rate) in enumerate(RATES):
        past = [_at("f", (rows - 1 - age) * len(RATES) + d) for age in range(rows)]
        loop += "".join(f"f{age} = {value}\n" for age, value in enumerate(past))
        loop += f"{state}{new} = {state}0 + h * ({_sum(method.predictor)})\n"
        if corrects:
            loop += f"{rate}_w = {_sum(method.corrector[1:])}\n"
    loop += ANGLES.format(s=new) + ACCELERATIONS.format(s=new, push=push)
    if corrects:
        for state, rate in RATES:
            loop += f"{state}_n = {state}0 + h * ({rate}_w + {float(method.corrector[0])!r} * {rate}_p)\n"
        loop += _TURN + ACCELERATIONS.format(s="_n", push=push)
    for d, (state, rate) in enumerate(RATES):
        loop += f"{_at('y', d)}, {_at('f', rows * len(RATES) + d)} = {state}_n, {rate}_n\n"
    return text + indent(loop, " " * 16) + "    return last - first\n"


def _look(predictor: NDArray[Any]) -> str:
    """A lane's last terms of the predictor, the greatest of which stay in the last rows of ``work``."""
    rows, text = predictor.size, ""
    weights = [float(weight) for weight in term_weights(predictor)]
    for angle in range(LOOKED_AT):
        past = (_at("f", (rows - 1 - age) * len(RATES) + angle) for age in range(rows))
        term = " + ".join(f"{weight!r} * {f}" for weight, f in zip(weights, past, strict=True))
        seen = f"work[work.shape[0] - {LOOKED_AT - angle}, i]"
        text += f"term = abs(h * ({term}))\n{seen} = term if term > {seen} else {seen}\n"
    return text


def _at(array: str, row: int | str) -> str:
    """A lane's number in a row of a block, flat."""
    return f"{array}[{row} * {VECTOR_LANES} + i]"


def _sum(weights: NDArray[Any]) -> str:
    return " + ".join(f"{float(weight)!r} * f{age}" for age, weight in enumerate(weights))


def whole_adams_steps(rhs: Any, method: Formula) -> Any:
    """``advance(t, h, first, last, F, oldest, Y, p, work, checked)`` of one of Lagrange's right-hand sides.

    It takes a block of ``VECTOR_LANES`` lanes through the steps ``first`` to ``last`` (excluded) from the
    time t [s] on, in place. ``F`` holds derivatives (rows, dim, lanes), flat: those at the times of the
    history in rows ``oldest`` and following, and after them room for one of every step; the first row of
    ``work`` is scratch, its last ones keep the greatest last terms of the predictor, see
    :mod:`fastmech.kernels.last_term`. The result is the number of steps done: where ``checked``, these end
    before a stretch that lanes may begin far out. A lane that does is not to be used.
    """
    return compiled(source(method, terms_of(rhs))).advance
