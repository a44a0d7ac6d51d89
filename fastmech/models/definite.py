"""Whether a kinetic energy is positive definite all over the coordinates' ranges, by intervals.

By Sylvester's criterion: all leading minors of the metric are positive. They are written as sums of sines and
cosines, which intervals bound closely, so that one box is enough as a rule.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import sympy

from fastmech.arrays import Floats
from fastmech.errors import InputError
from fastmech.generated import kept_text
from fastmech.models.balance import enclosing, enclosures

if TYPE_CHECKING:
    from fastmech.models.mechanism import Mechanism


#: Operations of the longest determinant: to write it as a sum takes minutes for much longer ones.
LONGEST = 400

#: Boxes that are looked at before it stays open.
MOST_BOXES = 500


def definite(mechanism: Mechanism) -> tuple[bool | None, Floats]:
    """Whether the metric is positive definite everywhere, proved, and where it is not.

    None where that stays open: where a range that matters is endless, where more than :data:`MOST_BOXES`
    boxes are needed, and where the metric is too long or has functions without known bounds.
    """

    each = enumerate(mechanism.coordinates)
    endless = {k: c.symbol for k, c in each if math.isinf(c.low) or math.isinf(c.high)}

    def text() -> str:
        metric = mechanism.equations.metric
        minors = [metric[:k, :k].det(method="berkowitz") for k in range(1, metric.rows + 1)]
        if metric.free_symbols & {*endless.values()} or sympy.count_ops(minors[-1]) > LONGEST:
            return ""
        try:
            return enclosing(mechanism, minors)
        except InputError:
            return ""

    name = "_".join([mechanism.prints, *map(str, endless)])
    if not (kept := kept_text("definite", name, text)):
        return None, np.empty(0)
    minors = enclosures(mechanism, kept)
    todo = [np.array([(c.low, c.high) for c in mechanism.coordinates])]
    for _ in range(MOST_BOXES):
        if not todo:
            break
        box = todo.pop(0)  # the widest first: beside a zero no box is narrow enough
        found = minors(box)
        if any(high <= 0.0 for _, high in found):
            return False, np.where(np.isinf(box), 0.0, box).mean(1)
        if not all(low > 0.0 for low, _ in found):
            finite = np.where(np.isinf(box), 0.0, box)  # an endless range does not matter
            middle, side = finite.mean(1), int(np.argmax(finite[:, 1] - finite[:, 0]))
            todo += [box.copy(), box.copy()]
            todo[-1][side, 0] = todo[-2][side, 1] = middle[side]
    return None if todo else True, np.empty(0)
