"""The last term of an Adams predictor, by which those of two orders lie apart: do the steps resolve a motion?

The predictor of order k is a sum over backward differences of the history, h (f_n + 1/2 nabla f_n + .. +
gamma_(k-1) nabla^(k-1) f_n) (Hairer, Norsett, Wanner, *Solving ODEs I*, section III.1); without its last term
it is that of order k - 1. The term is small where a polynomial describes the history. It is not where steps
are too long for the motion, nor where the method's spurious roots have grown: differences magnify what
alternates from step to step.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.jit import inlined, rounded_to

Floats = NDArray[np.float64]

#: States of a lane that are looked at, the first ones: a scene's angles.
LOOKED_AT = 2

#: Steps between two looks: a history is about as long, so that little passes unseen.
EVERY = 8


@inlined
def term_weights(predictor: Floats) -> Any:
    """Weights of f_n, f_(n-1), ... in the last term over h: gamma_(k-1) (-1)^a binomial(k - 1, a).

    The oldest derivative is in no other term, so its weight in the predictor tells gamma_(k-1).
    """
    k = predictor.size
    weights = np.empty(k)
    weights[0] = abs(predictor[k - 1])
    for age in range(1, k):
        weights[age] = -weights[age - 1] * (k - age) / age
    return weights


@inlined
def note_term(
    greatest: Floats, term: Floats, f: Floats, row: NDArray[np.int64], weights: Any, h: Any
) -> None:
    """Keep the greatest last term of lanes in ``greatest`` (rows of lanes, flat); ``term`` is scratch.

    The derivative of ``age`` steps ago is in ``f[row[age]]``, flat too. NaN leaves ``greatest`` as it is.
    """
    size = greatest.size
    for i in range(size):
        term[i] = 0.0
    for age in range(weights.size):
        weight, past = rounded_to(term, h * weights[age]), f[row[age]]
        for i in range(size):
            term[i] += weight * past[i]
    for i in range(size):
        found = abs(term[i])
        greatest[i] = found if found > greatest[i] else greatest[i]
