"""The engine's yardstick: one loop for this mechanism and one method, every stage typed out.

Nothing is general here: parameters are numbers, the tableau's entries are literals, a step's stages are
local numbers in one loop over the lanes of a block. The source is generated from the tableau and uses the
package's own trigonometry and accelerations, so what is left to compare is the engine around them.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import njit

from fastmech.arrays import Floats
from fastmech.integrators.tableaus import TABLEAUS
from fastmech.jit import FLAGS
from fastmech.kernels.sincos import sincos
from fastmech.slider.equations import lagrange_accelerations
from fastmech.studies.bench.measure import BenchProblem, Solve

#: Lanes of a block: all of it is in the first cache at any width, so the engine's widest serves both methods.
LANES = 256

_HEAD = """
def integrate(starts, final, width, h, steps, mass, slider, lift, spring, gravity, force, damping):
    Y = np.empty((4, width))
    for first in range(0, len(starts), width):
        lanes = min(width, len(starts) - first)
        Y[:, :lanes] = starts[first : first + lanes].T
        for _ in range(steps):
            for i in range(lanes):
                a0, b0, u0, w0 = Y[0, i], Y[1, i], Y[2, i], Y[3, i]
"""
_STAGE = """
                s1, c1 = sincos(a{s})
                s2, c2 = sincos(b{s})
                f{s}, g{s} = lagrange_accelerations(
                    s1, c1, s2, c2, u{s}, w{s}, mass, slider, lift, spring, gravity, force, damping
                )
"""
_TAIL = """
                Y[0, i], Y[1, i], Y[2, i], Y[3, i] = a{s}, b{s}, u{s}, w{s}
        final[first : first + lanes] = Y[:, :lanes].T
"""


@cache
def compiled(method: str) -> Any:
    """The loop of a method as machine code."""
    tableau, text = TABLEAUS[method], _HEAD + _STAGE.format(s=0)
    for s, row in enumerate([*tableau.a[1:], tableau.b], start=1):
        for state, rate in (("a", "u"), ("b", "w"), ("u", "f"), ("w", "g")):
            terms = " + ".join(f"{float(x)!r} * {rate}{j}" for j, x in enumerate(row) if x)
            text += f"                {state}{s} = {state}0 + h * ({terms})\n"
        text += (_STAGE if s < tableau.stages else _TAIL).format(s=s)
    names = {"np": np, "sincos": sincos, "lagrange_accelerations": lagrange_accelerations}
    exec(compile(text, f"<fused {method}>", "exec"), names)
    return njit(nogil=True, **FLAGS)(names["integrate"])


def prepared(method: str, h: float, problem: BenchProblem) -> Solve:
    """A method at a fixed step, in blocks of lanes."""
    kernel, p = compiled(method), problem.coefficients
    steps = int(np.ceil(problem.t_end / h - 1e-9))

    def solve(starts: Floats) -> Floats:
        final = np.empty_like(starts)
        kernel(starts, final, LANES, problem.t_end / steps, steps, *p[:7])
        return final

    return solve
