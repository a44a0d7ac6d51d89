"""Where a spring has length zero: a peak of the potential, no equilibrium, or neither is proved.

A spring of stiffness k and free length L0, of which F(q) leads from end to end, pushes there in a direction
that is not known. Forces are f(q) + k L0 J' w: f is smooth, J' is the transpose of dF/dq, and w is F / |F|
or, where F = 0, anything no longer than 1.

If there is a d with d . f > k L0 |J d| all over a box, none of these forces is zero in it, and the potential
falls along d (Clarke, Optimization and nonsmooth analysis, 1983). If J is square and regular and
|J'^-1 f| < k L0, forces do work on all motion along which F grows and keeps its direction. So the potential
has a strict maximum where F = 0, and no other place of the box is an equilibrium. With two coordinates or
more a maximum parts nothing: a path through it can pass beside it, and lower.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from enum import Enum
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from fastmech.arrays import Floats
from fastmech.intervals.arithmetic import Interval, Matrix, magnitude, product, sub
from fastmech.models.balance import enclosing, enclosures, jumping
from fastmech.models.statics import Statics
from fastmech.models.writer import expanded

#: By how much a box is enlarged, over its width, to hold the zero that it may have on its rim.
WIDER = 0.25

#: Sizes are computed less exactly than bounds, but to more than this share.
ROUNDING = 1e-12


class AtZero(Enum):
    """What is proved of a box in which a spring may have length zero."""

    PEAK = "peak"  #: the potential has one strict maximum in it, and no other place is at rest
    MOVES = "moves"  #: no place of it is at rest


def at_length_zero(statics: Statics, p: Floats, domain: Floats, box: Floats) -> AtZero | None:
    """What is proved of a box (n, 2); None: nothing. Parameters ``p`` (count, 2) are intervals."""
    half = (0.5 + WIDER) * (box[:, 1] - box[:, 0]) + 1e-15 * (1.0 + np.abs(box).max())
    middle = 0.5 * box[:, 0] + 0.5 * box[:, 1]
    wide = np.stack([middle - half, middle + half], axis=1)
    within = (domain[:, 2] > 0.0) | ((wide[:, 0] > domain[:, 0]) & (wide[:, 1] < domain[:, 1]))
    for components, text in _cones(statics):
        bounds = enclosures([(float(low), float(high)) for low, high in p], text)
        if _moves(bounds(box), components):
            return AtZero.MOVES
        square = components == len(box) > 1
        if square and statics.conservative and within.all() and (zero := _peak(bounds, wide)):
            here = all(low <= x[1] and x[0] <= high for x, (low, high) in zip(zero, box, strict=True))
            return AtZero.PEAK if here else AtZero.MOVES
    return None


@lru_cache(maxsize=64)
def _cones(statics: Statics) -> tuple[tuple[int, str], ...]:
    """Of each spring the components of F, and the text of k L0, F, J by rows and f, see :func:`enclosing`."""
    q, r = [coordinate.symbol for coordinate in statics.coordinates], sympy.Dummy("r", positive=True)
    found: dict[Any, tuple[int, str]] = {}
    for way in statics.springs:
        square = expanded(sum(part**2 for part in way), q)
        factor, root = sympy.sqrt(square).as_coeff_Mul()
        if root in found or not root.has(*q):
            continue
        terms = [term.xreplace({root: r}) for term in statics.stored]
        zero = {r: sympy.S.Zero}
        cone = -sum(sympy.diff(term, r).xreplace(zero) for term in terms) / factor
        if cone == 0 or cone.has(*q) or any(sympy.diff(term, r, 3) != 0 for term in terms):
            continue
        smooth = [term.xreplace(zero) + sympy.diff(term, r, 2) / 2 * square / factor**2 for term in terms]
        own = (sum(sympy.diff(term, a) for term in smooth) for a in q)
        forces = [other - slope for other, slope in zip(statics.other, own, strict=True)]
        rest = jumping(statics._replace(forces=tuple(forces), stored=tuple(smooth)))
        slopes = [sympy.diff(part, a) for part in way for a in q]
        found[root] = len(way), enclosing(statics, [cone, *way, *slopes, *rest.forces])
    return tuple(found.values())


def _moves(values: Sequence[Interval], components: int) -> bool:
    """Whether a direction d has d . f > k L0 |J d| for all of a box."""
    cone, _, J, f = _parts(values, components)
    if not _bounded(values):
        return False
    inverse = np.linalg.pinv(_middle(J))
    d = [[(x, x)] for x in (inverse @ inverse.T @ _middle(f))[:, 0].tolist()]
    pushed = product(_transposed(d), f)[0][0]
    return magnitude(cone) * _size(product(J, d)) < pushed[0]


def _peak(bounds: Callable[[Floats], list[Interval]], box: Floats) -> list[Interval] | None:
    """Where in a box F has its one zero, by Krawczyk's test; None if not, or if not |J'^-1 f| < k L0."""
    n, values = len(box), bounds(box)
    cone, _, J, f = _parts(values, n)
    if not _bounded(values) or abs(np.linalg.det(middle := _middle(J))) == 0.0:
        return None
    C, one = _exact(np.linalg.inv(middle)), _exact(np.eye(n))
    centre = 0.5 * box[:, 0] + 0.5 * box[:, 1]
    at = _exact(centre[:, None])
    away = _less([[(float(low), float(high))] for low, high in box], at)
    F = _parts(bounds(np.stack([centre, centre], axis=1)), n)[1]
    image = [row[0] for row in _less(_less(at, product(C, F)), product(_less(product(C, J), one), away))]
    if not all(low < x[0] and x[1] < high for x, (low, high) in zip(image, box, strict=True)):
        return None
    # x = J'^-1 f solves x = C' f + (1 - J C)' x.
    apart = _size(_less(one, product(J, C)))
    push = _size(product(_transposed(C), f))
    return image if apart < 1.0 and push < (1.0 - apart) * (1.0 - ROUNDING) * cone[0] else None


def _parts(values: Sequence[Interval], components: int) -> tuple[Interval, Matrix, Matrix, Matrix]:
    """k L0, F (m, 1), J (m, n) and f (n, 1)."""
    n = (len(values) - 1 - components) // (components + 1)
    slopes = values[1 + components : -n]
    J = [slopes[n * i : n * (i + 1)] for i in range(components)]
    return values[0], [[x] for x in values[1 : 1 + components]], J, [[x] for x in values[-n:]]


def _bounded(values: Sequence[Interval]) -> bool:
    return all(magnitude(x) < math.inf for x in values)


def _middle(a: Matrix) -> Floats:
    return np.array(a).mean(axis=2)


def _exact(a: Any) -> Matrix:
    return [[(x, x) for x in row] for row in a.tolist()]


def _transposed(a: Matrix) -> Matrix:
    return list(zip(*a, strict=True))


def _less(a: Matrix, b: Matrix) -> Matrix:
    return [[sub(x, y) for x, y in zip(*rows, strict=True)] for rows in zip(a, b, strict=True)]


def _size(a: Matrix) -> float:
    """An upper bound of the root of the sum of squares."""
    return math.hypot(*(magnitude(x) for row in a for x in row)) * (1.0 + ROUNDING)
