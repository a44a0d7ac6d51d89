"""Right-hand sides as data, and the loop over lanes that is made from them.

What is integrated is handed over as :class:`Rates`: a function of one trajectory's numbers, and what is known
of it. From that the package writes loops over lanes (trajectories side by side in memory): here the block
right-hand side, in :mod:`fastmech.kernels.steps` the steps of explicit methods. They are branch-free, over
contiguous rows of a small block, so that they become packed instructions. Lanes whose angles exceed the range
of the packed trigonometry are done again, one by one: a lane's result never depends on its neighbours.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.generated import new_module, run_module
from fastmech.jit import in_precision, rhs_signature

Block = NDArray[np.float64]

#: Width of the blocks of explicit methods, of which other widths are multiples: whole vectors of any
#: processor, in either precision.
VECTOR_LANES = 16


class Rates(NamedTuple):
    """A right-hand side: rates of one trajectory's states.

    ``functions`` gives, for the name of a module and a precision ("float64" or "float32"), what the module's
    loops call: ``rates(t, *states, *parameters)``, a tuple, right for any finite numbers, all of them of that
    precision: a double among them would turn a lane's arithmetic into its own. Where ``ranged`` is
    set also ``rates_within``, an :func:`~fastmech.kernels.attempt.attempted` one that raises in place of
    calling the library for an angle beyond the packed range. Where ``near`` is set, one that tells instead
    whether the lane is beyond, and gives the rates and what it keeps: with that, ``rates_near(t, *states,
    *parameters, kept)`` gives the rates close to those states, as a corrector wants them.

    Of a ``vector`` the function is ``rates(t, y, p, found)``, with arrays of one trajectory's numbers; it
    writes into the last one. Its blocks have one lane.
    """

    name: str  #: for the text of what is made; differs with the functions, or ``prints`` does
    states: int
    #: Their rows, in the function's order, or tuples of those; None: a term that is not there.
    parameters: tuple[int | tuple[int | None, ...], ...]
    functions: Callable[[str, str], dict[str, Any]]
    prints: tuple[str, ...] = ()  #: fingerprints of the functions
    ranged: bool = False
    near: bool = False
    vector: bool = False
    looked_at: int = 0  #: first states that tell steps too large, see :mod:`fastmech.kernels.steps`

    def arguments(self, t: str, states: Sequence[str], parameter: str) -> str:
        """Text of the function's arguments; ``parameter`` is that of one, with its row as ``{}``."""

        def text(rows: Any) -> str:
            if isinstance(rows, tuple):
                return f"({', '.join(map(text, rows))},)"
            return "None" if rows is None else parameter.format(rows)

        return ", ".join([t, *states, *map(text, self.parameters)])

    def evaluation(self, raised: str, rates: Sequence[str], arguments: str) -> str:
        """Text that gives the ``rates`` their values, and says whether the lane ``raised``."""
        found = f"({', '.join(rates)},)"
        if not self.ranged:
            return f"{found} = rates({arguments}) + ()"  # only tuples have that, of a length known before
        if self.near:
            return f"{raised}, {found}, kept = rates_within({arguments})"
        return f"{raised}, {found} = attempt(rates_within, ({arguments},))"


_HEAD = '''"""Made by fastmech: the block right-hand side of {name}, {precision}."""

import numpy as np
from numba.core.types import {precision}

from fastmech.jit import kernel, rhs_signature
from fastmech.kernels.attempt import attempt
from fastmech.kernels.bits import apart


@kernel(rhs_signature({precision}))
def {function}(t, Y, dY, p):
    apart()
    t = {precision}(t)
'''

_LOOP = """\
    for i in range(Y.shape[1]):
        {evaluation}
{stores}
"""

#: NaN tells which lanes are to be done again; a sum over lanes would need blocks of several vectors.
_AGAIN = """\
        dY[0, i] = {precision}(np.nan) if raised else rate0
    lost = 0
    for i in range(Y.shape[1]):
        lost += dY[0, i] != dY[0, i]
    if lost:
        for i in range(Y.shape[1]):
            if dY[0, i] != dY[0, i]:
                ({rates},) = rates({arguments}) + ()
{again}
"""

_VECTOR = """\
    if Y.shape[1] == 1:
        rates(t, Y.reshape(Y.shape[0]), p.reshape(p.shape[0]), dY.reshape(Y.shape[0]))
        return
    y, found = np.empty(Y.shape[0], Y.dtype), np.empty(Y.shape[0], Y.dtype)
    own = np.empty(p.shape[0], Y.dtype)
    for i in range(Y.shape[1]):
        for d in range(Y.shape[0]):
            y[d] = Y[d, i]
        for row in range(p.shape[0]):
            own[row] = p[row, i]
        rates(t, y, own, found)
        for d in range(Y.shape[0]):
            dY[d, i] = found[d]
"""


@cache
def block_kernel(rates: Rates, precision: str = "float64") -> Any:
    """``rhs(t, Y, dY, p)`` over a block of lanes, see :func:`fastmech.jit.rhs_signature`."""
    found = [f"rate{d}" for d in range(rates.states)]
    stores = "\n".join(f"        dY[{d}, i] = {rate}" for d, rate in enumerate(found))
    arguments = rates.arguments("t", [f"Y[{d}, i]" for d in range(rates.states)], "p[{}, i]")
    loop = _VECTOR if rates.vector else _LOOP + (_AGAIN if rates.ranged else "")
    function = identifier(f"rates_of_{rates.name}")
    text = (_HEAD + loop).format(
        name=rates.name,
        function=function,
        precision=precision,
        evaluation=rates.evaluation("raised", found, arguments),
        rates=", ".join(found),
        arguments=arguments,
        stores=stores,
        again=stores.replace("        ", " " * 16),
    )
    made = loops(rates, precision, text, function)
    made.rates = rates
    return made


def identifier(text: str) -> str:
    """A name for Python made from a text."""
    return re.sub(r"\W", "_", text)


def loops(rates: Rates, precision: str, text: str, function: str) -> Any:
    """A function of a module's text that calls those of a right-hand side."""
    module = new_module("loop", text, rates.prints)
    vars(module).update(rates.functions(module.__name__, precision))
    return getattr(run_module(module, text), function)


@cache
def in_single(rhs: Any) -> Any:
    """A block right-hand side for lanes of float32, compiled when a run asks for it."""
    rates = getattr(rhs, "rates", None)
    return in_precision(rhs, "float32", rhs_signature) if rates is None else block_kernel(rates, "float32")
