"""The compiled solver for rows of scenes, and the sentence that says what its proof came to."""

from __future__ import annotations

import numpy as np

from fastmech.equilibria.outcome import Outcome
from fastmech.equilibria.search import MOST, FloatArray
from fastmech.equilibria.solve import Solution, solve
from fastmech.jit import interpreted


def solve_rows(coefficients: FloatArray, inherit: bool = False, compiled: bool = True) -> Solution:
    """Equilibria of n scenes from their (n, 8) reduced coefficients, contiguous, the force frozen.

    ``inherit`` starts each scene from the one before it, which pays where neighbours are alike. Without
    ``compiled`` plain Python does the same, up to rounding: in milliseconds a scene, with nothing to compile.
    """
    n = len(coefficients)
    result = Solution(
        phi=np.empty((n, MOST)),
        theta=np.empty((n, MOST)),
        energy=np.empty((n, MOST)),
        radius=np.empty((n, MOST)),
        index=np.empty((n, MOST), dtype=np.int8),
        count=np.empty(n, dtype=np.int8),
        expected=np.empty(n, dtype=np.int8),
        outcome=np.empty(n, dtype=np.int8),
        margin=np.empty(n),
    )
    with np.errstate(all="ignore"):
        (solve if compiled else interpreted(solve))(coefficients, inherit, result)
    return result


def explain(outcome: Outcome, count: int, expected: int, margin: float) -> str:
    """One sentence for a certificate; a degenerate scene's is made from its parameters instead."""
    if outcome is Outcome.COMPLETE:
        change = "two of them merge" if margin > 0.0 else "two more appear"
        return f"all {count} are proved to exist and to be all; {abs(margin):.3g} rad from where {change}"
    if outcome is Outcome.AT_FOLD:
        there = f"{expected} exist" if expected else "how many exist is hidden"
        return f"at a fold within rounding: {there}, {count} are told apart, the merging ones as degenerate"
    if np.isnan(margin):
        return "not proved: the reduced coefficients are not finite"
    return f"not proved: {count} equilibria listed, {expected or 'four to six'} must exist"
