"""Branch and prune: all zeros of forces in a box or on a torus, each proved to be there and to be alone.

A box is dropped where a force, or the mean-value form of one, cannot be zero in it, and shrinks to what the
Krawczyk operator K leaves of it (Neumaier: Interval methods for systems of equations, 1990, section 5.1).
Where K maps a box that holds the one at hand into its own inside, that larger box has one zero: boxes in it
are dropped, so that a zero on the face of two boxes is listed once. Other boxes are cut in two. Boxes are
treated in the order of their making, all about equally small: a limit on their number leaves the small ones,
at the places that need a closer look.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types

from fastmech.callee import CalleeType
from fastmech.intervals.arithmetic import add, div, magnitude, mul, sub
from fastmech.jit import CUBE, EXACT, INTEGERS, MATRIX, VECTOR, called, kernel, lanes, named_tuple


@called
def invert(J: Any, A: Any, C: Any) -> bool:
    """``C`` (n, n): approximate inverse of the midpoint of ``J`` (n, n, 2); ``A`` (n, n) is scratch.

    False where it is singular within rounding or not finite.
    """
    n = len(C)
    for i in range(n):
        for j in range(n):
            A[i, j] = 0.5 * J[i, j, 0] + 0.5 * J[i, j, 1]
            C[i, j] = 1.0 if i == j else 0.0
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if not (abs(A[best, k]) > 1e-300 and abs(A[best, k]) < np.inf):
            return False
        for j in range(n):
            A[k, j], A[best, j] = A[best, j], A[k, j]
            C[k, j], C[best, j] = C[best, j], C[k, j]
        pivot = A[k, k]
        for j in range(n):
            A[k, j] /= pivot
            C[k, j] /= pivot
        for i in range(n):
            factor = A[i, k]
            if i != k:
                for j in range(n):
                    A[i, j] -= factor * A[k, j]
                    C[i, j] -= factor * C[k, j]
    return True


@called
def orientation(J: Any, A: Any) -> int:
    """Sign of the determinant of every matrix in ``J`` (n, n, 2), 0 if not proved.

    Gaussian elimination in ``A``, of J's shape; a pivot is the entry that is proved farthest from zero.
    """
    n = len(J)
    sign = 1
    for i in range(n):
        for j in range(n):
            A[i, j, 0], A[i, j, 1] = J[i, j, 0], J[i, j, 1]
    for k in range(n):
        best, most = k, 0.0
        for i in range(k, n):
            least = max(A[i, k, 0], -A[i, k, 1])
            if least > most:
                best, most = i, least
        if most == 0.0:
            return 0
        if best != k:
            sign = -sign
            for j in range(n):
                for e in range(2):
                    A[k, j, e], A[best, j, e] = A[best, j, e], A[k, j, e]
        if A[k, k, 1] < 0.0:
            sign = -sign
        for i in range(k + 1, n):
            factor = div((A[i, k, 0], A[i, k, 1]), (A[k, k, 0], A[k, k, 1]))
            for j in range(k + 1, n):
                less = mul(factor, (A[k, j, 0], A[k, j, 1]))
                A[i, j, 0], A[i, j, 1] = sub((A[i, j, 0], A[i, j, 1]), less)
    return sign


@called
def positive_eigenvalues(J: Any, A: Any, V: Any) -> int:
    """How many eigenvalues of every symmetric matrix in ``J`` (n, n, 2) are positive and all others negative.

    -1 if not proved; ``A`` and ``V`` (n, n) are scratch. The matrix of approximate eigenvectors V (Jacobi's
    method) makes V^T J V nearly diagonal: where each of its Gershgorin discs lies on one side of zero it is
    regular, hence V is, and by Sylvester's law of inertia the discs' sides are the eigenvalues' signs.
    """
    n = len(J)
    for i in range(n):
        for j in range(n):
            A[i, j] = 0.25 * (J[i, j, 0] + J[i, j, 1] + J[j, i, 0] + J[j, i, 1])
            V[i, j] = 1.0 if i == j else 0.0
    for _ in range(12):
        for i in range(n):
            for j in range(i + 1, n):
                if A[i, j] != 0.0:
                    t = (A[j, j] - A[i, i]) / (2.0 * A[i, j])
                    t = (1.0 if t >= 0.0 else -1.0) / (abs(t) + np.sqrt(t * t + 1.0))
                    c = 1.0 / np.sqrt(t * t + 1.0)
                    s = t * c
                    for k in range(n):
                        A[k, i], A[k, j] = c * A[k, i] - s * A[k, j], s * A[k, i] + c * A[k, j]
                        V[k, i], V[k, j] = c * V[k, i] - s * V[k, j], s * V[k, i] + c * V[k, j]
                    for k in range(n):
                        A[i, k], A[j, k] = c * A[i, k] - s * A[j, k], s * A[i, k] + c * A[j, k]
    positive = 0
    for i in range(n):
        disc, around = (0.0, 0.0), (0.0, 0.0)
        for j in range(n):
            entry = (0.0, 0.0)
            for k in range(n):
                row = (0.0, 0.0)
                for m in range(n):
                    row = add(row, mul((J[k, m, 0], J[k, m, 1]), (V[m, j], V[m, j])))
                entry = add(entry, mul(row, (V[k, i], V[k, i])))
            if i == j:
                disc = entry
            else:
                radius = magnitude(entry)
                around = add(around, (radius, radius))
        if sub(disc, around)[0] > 0.0:
            positive += 1
        elif not add(disc, around)[1] < 0.0:
            return -1
    return positive


FORCES_SIGNATURE = types.boolean(MATRIX, MATRIX, MATRIX, CUBE)
FORCES = CalleeType(FORCES_SIGNATURE)

#: ``energy(q, v, p, found)``: the least and the greatest energy over a box of coordinates and rates.
ENERGY_SIGNATURE = types.void(MATRIX, MATRIX, MATRIX, VECTOR)
ENERGY = CalleeType(ENERGY_SIGNATURE)

TWO_PI = 2.0 * np.pi

#: Why a box is left: numbers in ``Found.reason``.
SMALL, LIMIT, UNDEFINED, AT_END, UNCLEAR, BENT = range(1, 7)

#: Forces bend where a derivative changes over a zero's box by more of the largest one, and by as much over a
#: wider box.
BEND = 1e-3

#: What is not decided so many widths of its box from where forces have no bounds is so because of that.
NEARBY = 100.0

#: A box of this part of the domain is left as it is: about a fold, forces of order one are rounding in it.
SMALLEST = 2.0**-30

#: Factor at most by which a box that is as small as any may be is widened for a proof: where derivatives are
#: large beside each other, K of the box itself may be all rounding.
MOST_WIDENED = 1e5

#: Newton's method looks for zeros from some boxes that a limit leaves, one for so many that it allows: no
#: more than a tenth is added to the time of the search.
PER_START = 500

#: A box so wide beside the domain tells of a zero only that it is there.
WIDE = 1e-3

#: Steps of Newton's method at most, the longest and the last, and differences for slopes, over the domain.
STEPS, LONGEST, LAST, APART = 40, 0.1, 1e-12, 1e-7

#: Part of its width at which a box is cut: symmetric mechanisms have zeros in the middles.
CUT = 0.487

#: By how much boxes may be wrong that are compared modulo a turn [rad], which is rounded.
MARGIN = 1e-14


class Found(NamedTuple):
    """What was found for each row of parameters; the first axis is the row."""

    zeros: Any  #: enclosures (rows, most, n, 2); angles are not reduced to a turn
    orientation: Any  #: (rows, most) int8: sign of the Jacobian's determinant; 0 not proved
    positive: Any  #: (rows, most) int8: positive eigenvalues of a symmetric Jacobian; -1 not proved
    left: Any  #: boxes that are not decided (rows, most_left, n, 2)
    reason: Any  #: why (rows, most_left) int8
    count: Any  #: (rows, 3) int64: zeros, boxes left (also what is beyond most_left), boxes treated


class _Work(NamedTuple):
    """Scratch arrays of a search."""

    box: Any  #: the box at hand (n, 2)
    before: Any  #: as it was before it shrank (n, 2)
    rest: Any  #: what was left of it (n, 2)
    middle: Any  #: its midpoint as a box (n, 2)
    away: Any  #: the box from there (n, 2)
    image: Any  #: K of the box (n, 2)
    f: Any  #: forces over the box (n, 2)
    g: Any  #: forces at the midpoint (n, 2)
    J: Any  #: Jacobian over the box (n, n, 2)
    D: Any  #: scratch (n, n, 2)
    A: Any  #: scratch (n, n)
    C: Any  #: inverse of the Jacobian's midpoint (n, n)
    whole: Any  #: boxes with one zero each (most, n, 2)
    inner: Any  #: where it lies in them (most, n, 2)
    known: Any  #: numbers of these and of boxes to begin with, 0 for the domain (2,) int64


def work(n: int, most: int) -> _Work:
    """Scratch arrays for ``n`` coordinates and at most ``most`` zeros."""
    shapes = [(n, 2)] * 8 + [(n, n, 2)] * 2 + [(n, n)] * 2 + [(most, n, 2)] * 2
    return _Work(*map(np.empty, shapes), np.zeros(2, dtype=np.int64))  # type: ignore[call-arg]


_WORK = named_tuple([MATRIX] * 8 + [CUBE] * 2 + [MATRIX] * 2 + [CUBE] * 2 + [INTEGERS], _Work)
_CUBES = lanes(types.float64, 4)
_BYTES = types.Array(types.int8, 2, "C")
_FOUND = named_tuple([_CUBES, _BYTES, _BYTES, _CUBES, _BYTES, types.Array(types.int64, 2, "C")], Found)

#: What became of a box.
_EMPTY, _ONE, _SHRUNK, _UNKNOWN = range(4)


@called
def _shrink(forces: Any, p: Any, w: Any) -> int:
    """Shrink ``w.box`` to what K leaves of it; ``_ONE`` where K lies in its inside: it has one zero."""
    n = len(w.box)
    for i in range(n):
        w.before[i, 0], w.before[i, 1] = w.box[i, 0], w.box[i, 1]
    if not forces(w.box, p, w.f, w.J):
        return _EMPTY
    for i in range(n):
        c = 0.5 * w.box[i, 0] + 0.5 * w.box[i, 1]
        w.middle[i, 0], w.middle[i, 1] = c, c
        w.away[i, 0], w.away[i, 1] = sub((w.box[i, 0], w.box[i, 1]), (c, c))
    forces(w.middle, p, w.g, w.D)
    known = True
    for i in range(n):
        value = (w.g[i, 0], w.g[i, 1])
        for j in range(n):
            value = add(value, mul((w.J[i, j, 0], w.J[i, j, 1]), (w.away[j, 0], w.away[j, 1])))
        if value[0] > 0.0 or value[1] < 0.0:
            return _EMPTY
        known &= value[1] < np.inf
    if not known or not invert(w.J, w.A, w.C):
        return _UNKNOWN
    inside = True
    for i in range(n):
        value = (w.middle[i, 0], w.middle[i, 0])
        for k in range(n):
            value = sub(value, mul((w.C[i, k], w.C[i, k]), (w.g[k, 0], w.g[k, 1])))
        for j in range(n):
            slope = (1.0, 1.0) if i == j else (0.0, 0.0)
            for k in range(n):
                slope = sub(slope, mul((w.C[i, k], w.C[i, k]), (w.J[k, j, 0], w.J[k, j, 1])))
            value = add(value, mul(slope, (w.away[j, 0], w.away[j, 1])))
        w.image[i, 0], w.image[i, 1] = value
        inside &= value[0] > w.box[i, 0] and value[1] < w.box[i, 1]
    for i in range(n):
        low, high = max(w.box[i, 0], w.image[i, 0]), min(w.box[i, 1], w.image[i, 1])
        if low > high:
            return _EMPTY
        w.box[i, 0], w.box[i, 1] = low, high
    return _ONE if inside else _SHRUNK


@called
def _turned(a: Any, b: Any, turn: float) -> float:
    """Whole turns that bring the middle of interval ``a`` nearest to that of ``b``; 0 where ``turn`` is."""
    return turn * np.floor((b[0] + b[1] - a[0] - a[1]) / (2.0 * turn) + 0.5) if turn > 0.0 else 0.0


@called
def _lies_in(a: Any, b: Any, domain: Any) -> bool:
    """Whether box ``a`` lies in box ``b``, modulo turns."""
    for i in range(len(a)):
        turn = _turned(a[i], b[i], domain[i, 2])
        margin = MARGIN * (1.0 + abs(turn)) if turn != 0.0 else 0.0
        if not (a[i, 0] + turn >= b[i, 0] + margin and a[i, 1] + turn <= b[i, 1] - margin):
            return False
    return True


@called
def _apart(a: Any, b: Any, domain: Any) -> bool:
    """Whether two boxes much smaller than a turn have nothing in common, modulo turns."""
    for i in range(len(a)):
        turn = _turned(a[i], b[i], domain[i, 2])
        margin = MARGIN * (1.0 + abs(turn)) if turn != 0.0 else 0.0
        if a[i, 0] + turn > b[i, 1] + margin or a[i, 1] + turn < b[i, 0] - margin:
            return True
    return False


@called
def _known(w: Any, domain: Any) -> bool:
    """Whether the box at hand lies in one whose only zero has been found."""
    for k in range(w.known[0]):  # noqa: SIM110
        if _lies_in(w.box, w.whole[k], domain):
            return True
    return False


@called
def _note_left(box: Any, reason: int, found: Any, row: int) -> None:
    k = found.count[row, 1]
    found.count[row, 1] += 1
    if k < found.left.shape[1]:
        found.reason[row, k] = reason
        for i in range(len(box)):
            found.left[row, k, i, 0], found.left[row, k, i, 1] = box[i, 0], box[i, 1]


@called
def _copy(source: Any, target: Any) -> None:
    for i in range(len(source)):
        target[i, 0], target[i, 1] = source[i, 0], source[i, 1]


@called
def _widen(w: Any, domain: Any, factor: float) -> None:
    """The rest of a box, wider by a factor and by no less than rounding."""
    for i in range(len(w.box)):
        c, width = 0.5 * w.rest[i, 0] + 0.5 * w.rest[i, 1], w.rest[i, 1] - w.rest[i, 0]
        half = 0.5 * factor * (width + MARGIN * (abs(c) + domain[i, 1] - domain[i, 0]))
        w.box[i, 0], w.box[i, 1] = c - half, c + half


@called
def _change(J: Any) -> tuple[float, float]:
    """By how much a Jacobian changes over a box, and its largest entry."""
    change, largest = 0.0, 0.0
    for i in range(len(J)):
        for j in range(len(J)):
            change = max(change, J[i, j, 1] - J[i, j, 0])
            largest = max(largest, magnitude((J[i, j, 0], J[i, j, 1])))
    return change, largest


@called
def _bends(forces: Any, p: Any, domain: Any, w: Any) -> bool:
    """Whether derivatives seem to jump in a box with a zero: they change, and no more so in a wider box.

    ``w.J`` is the Jacobian over ``w.box``, which are both kept then.
    """
    change, largest = _change(w.J)
    if change <= BEND * largest:
        return False
    _copy(w.box, w.rest)
    _widen(w, domain, 8.0)
    forces(w.box, p, w.f, w.J)
    wider, _ = _change(w.J)
    _copy(w.rest, w.box)
    forces(w.box, p, w.f, w.J)
    return wider < 2.0 * change


@called
def _close_in(forces: Any, p: Any, domain: Any, w: Any) -> bool:
    """Shrink ``w.box`` to its one zero; False where it stays wide, as forces bend in it too much for K.

    ``w.whole`` has a box with this zero alone. About a soft position K narrows a wide box slowly, but from a
    narrow one, about where Newton's method ends, it is quick; if that lies in the whole box it is the same.
    """
    if _shrinks(forces, p, domain, w) <= SMALLEST:
        return True
    whole = w.whole[w.known[0]]
    if _newton(forces, p, domain, w) and _beside(forces, p, domain, w) and _lies_in(w.box, whole, domain):
        _shrinks(forces, p, domain, w)
        if _is_even(w.J):
            return True
    _copy(whole, w.box)
    wide = _shrinks(forces, p, domain, w) > WIDE
    _copy(w.box, w.rest)
    return not wide and _is_even(w.J)


@called
def _is_even(J: Any) -> bool:
    """Whether a Jacobian changes over a box by no more than half of its largest entry."""
    change, largest = _change(J)
    return change <= 0.5 * largest


@called
def _shrinks(forces: Any, p: Any, domain: Any, w: Any) -> float:
    """The greatest width that K leaves of ``w.box``, as part of the domain's, when it narrows no further."""
    widest = 0.0
    for _ in range(200):  # K converges quadratically in the end, down to the rounding of the forces
        _shrink(forces, p, w)
        fast, widest = False, 0.0
        for i in range(len(w.box)):
            width = w.box[i, 1] - w.box[i, 0]
            fast |= width < 0.95 * (w.before[i, 1] - w.before[i, 0])
            widest = max(widest, width / (domain[i, 1] - domain[i, 0]))
        if not fast and widest <= SMALLEST:
            break
    return widest


@called
def _note_zero(forces: Any, balance: Any, p: Any, domain: Any, w: Any, found: Any, row: int) -> None:
    """Keep the one zero of the box after those of ``w.whole``, which lies in ``w.box``."""
    n, count = len(w.box), w.known[0]
    for k in range(count):
        if _lies_in(w.box, w.whole[k], domain) or _lies_in(w.inner[k], w.whole[count], domain):
            return
        if not _apart(w.box, w.inner[k], domain):
            _note_left(w.box, UNCLEAR, found, row)
            return
    within, outside = True, False
    for i in range(n):
        w.inner[count, i, 0], w.inner[count, i, 1] = w.box[i, 0], w.box[i, 1]
        if domain[i, 2] == 0.0:
            within &= w.box[i, 0] >= domain[i, 0] and w.box[i, 1] <= domain[i, 1]
            outside |= w.box[i, 1] < domain[i, 0] or w.box[i, 0] > domain[i, 1]
    w.known[0] += 1
    if outside:
        return
    k = found.count[row, 0]
    forces(w.box, p, w.f, w.J)
    sign = orientation(w.J, w.D)
    clear = balance(w.box, p, w.f, w.J) and k < found.zeros.shape[1]
    if not within or not clear or _bends(balance, p, domain, w):
        reason = BENT if clear else UNCLEAR
        _note_left(w.box, reason if within else AT_END, found, row)
        return
    found.orientation[row, k] = sign
    found.positive[row, k] = positive_eigenvalues(w.J, w.A, w.C)
    for i in range(n):
        found.zeros[row, k, i, 0], found.zeros[row, k, i, 1] = w.box[i, 0], w.box[i, 1]
    found.count[row, 0] += 1


@called
def _narrower(w: Any) -> bool:
    """Whether K was narrower than the box that it was of, along every coordinate."""
    for i in range(len(w.box)):
        if not (w.image[i, 1] - w.image[i, 0] < 0.9 * (w.before[i, 1] - w.before[i, 0])):
            return False
    return True


@called
def _cut(w: Any, domain: Any) -> int:
    """The coordinate along which forces change most over the box; -1 where it is as small as any may be."""
    n = len(w.box)
    widest, smeared, direction, known = 0.0, -1.0, 0, True
    for j in range(n):
        widest = max(widest, (w.box[j, 1] - w.box[j, 0]) / (domain[j, 1] - domain[j, 0]))
    for j in range(n):
        smear, width = 0.0, w.box[j, 1] - w.box[j, 0]
        for i in range(n):
            total = 0.0
            for k in range(n):
                total += magnitude((w.J[i, k, 0], w.J[i, k, 1])) * (w.box[k, 1] - w.box[k, 0])
            known &= total < np.inf
            smear += magnitude((w.J[i, j, 0], w.J[i, j, 1])) * width / total if total > 0.0 else 0.0
        relative = width / (domain[j, 1] - domain[j, 0])
        smear = (smear if known else relative) if 16.0 * relative >= widest else -1.0
        if smear > smeared:
            smeared, direction = smear, j
    return direction if widest > SMALLEST else -1


@called
def _bounded(w: Any) -> bool:
    """Whether forces and their Jacobian over a box have bounds."""
    for i in range(len(w.box)):
        if not magnitude((w.f[i, 0], w.f[i, 1])) < np.inf:
            return False
        for j in range(len(w.box)):
            if not magnitude((w.J[i, j, 0], w.J[i, j, 1])) < np.inf:
                return False
    return True


@called
def _treat(forces: Any, p: Any, domain: Any, w: Any) -> tuple[int, int, float]:
    """What became of ``w.box``, along which coordinate the rest is to be cut, and what part of it is left.

    With ``_ONE`` the box ``w.before`` has one zero, which lies in ``w.box``.
    """
    became = _shrink(forces, p, w)
    if became in (_EMPTY, _ONE):
        return became, 0, 0.0
    part = 1.0
    for i in range(len(w.box)):
        width = w.before[i, 1] - w.before[i, 0]
        if width > SMALLEST * (domain[i, 1] - domain[i, 0]):  # a narrower one says nothing about the others
            part *= (w.box[i, 1] - w.box[i, 0]) / width
    direction = _cut(w, domain)
    _copy(w.box, w.rest)
    factor, last = 1.2, 1.2 if direction >= 0 else MOST_WIDENED
    while became == _SHRUNK and factor <= last and (direction < 0 or _narrower(w)):
        _widen(w, domain, factor)
        again = _shrink(forces, p, w)
        if again in (_EMPTY, _ONE):
            return again, 0, 0.0
        factor *= 8.0
    _copy(w.rest, w.box)
    return became, direction, part


@called
def _newton(forces: Any, p: Any, domain: Any, w: Any) -> bool:
    """From the middle of ``w.box`` to ``w.rest``, a point beside a zero in the domain; False if none."""
    n = len(w.box)
    for i in range(n):
        c = 0.5 * w.box[i, 0] + 0.5 * w.box[i, 1]
        w.rest[i, 0], w.rest[i, 1] = c, c
    for _ in range(STEPS):
        forces(w.rest, p, w.g, w.D)
        for j in range(n):
            _copy(w.rest, w.middle)
            apart = APART * (domain[j, 1] - domain[j, 0])
            w.middle[j, 0], w.middle[j, 1] = w.rest[j, 0] + apart, w.rest[j, 1] + apart
            forces(w.middle, p, w.f, w.J)
            for i in range(n):
                slope = 0.5 * (w.f[i, 0] + w.f[i, 1] - w.g[i, 0] - w.g[i, 1]) / apart
                w.D[i, j, 0], w.D[i, j, 1] = slope, slope
        if not invert(w.D, w.A, w.C):
            return False
        longest = 0.0
        for i in range(n):
            w.away[i, 0] = 0.0
            for j in range(n):
                w.away[i, 0] += w.C[i, j] * (0.5 * w.g[j, 0] + 0.5 * w.g[j, 1])
            longest = max(longest, abs(w.away[i, 0]) / (domain[i, 1] - domain[i, 0]))
        if not longest < np.inf:
            return False
        within, part = True, min(1.0, LONGEST / max(longest, LAST))
        for i in range(n):
            c = w.rest[i, 0] - part * w.away[i, 0]
            if domain[i, 2] > 0.0:
                c -= domain[i, 2] * np.floor((c - domain[i, 0]) / domain[i, 2])
            within &= c >= domain[i, 0] and c <= domain[i, 1]
            w.rest[i, 0], w.rest[i, 1] = c, c
        if longest <= LAST:
            return within
    return False


@called
def _beside(forces: Any, p: Any, domain: Any, w: Any) -> bool:
    """Whether a box about the point ``w.rest``, the narrowest that shows it, has one zero: ``w.before``."""
    factor = 8.0
    while MARGIN * factor < 1.0:
        _widen(w, domain, factor)
        if _shrink(forces, p, w) == _ONE:
            return True
        factor *= 8.0
    return False


@called
def _around(forces: Any, p: Any, domain: Any, w: Any) -> bool:
    """Whether a box about the point ``w.rest``, the widest that shows it, has one zero: ``w.before``."""
    factor = 1.0 / MARGIN
    while factor > 1.0:
        _widen(w, domain, factor)
        became = _shrink(forces, p, w)
        if became in (_EMPTY, _ONE):
            return became == _ONE
        factor *= 0.125
    return False


@called
def _search(forces: Any, balance: Any, p: Any, domain: Any, boxes: Any, w: Any, found: Any, row: int) -> None:
    """Treat the boxes of one row of parameters."""
    head, tail, most = 0, w.known[1], len(w.whole)
    if tail == 0:
        tail, w.known[0] = 1, 0
        for i in range(len(domain)):
            boxes[0, i, 0], boxes[0, i, 1] = domain[i, 0], domain[i, 1]
    limit = (len(boxes) - tail) // 2
    while head < min(tail, limit):
        _copy(boxes[head], w.box)
        head += 1
        if _known(w, domain):
            continue
        became, direction, part = _treat(forces, p, domain, w)
        if became == _ONE and w.known[0] < most:
            _copy(w.before, w.whole[w.known[0]])
            if _close_in(forces, p, domain, w):
                _note_zero(forces, balance, p, domain, w, found=found, row=row)
                continue
            became, direction, part = _SHRUNK, _cut(w, domain), 1.0
        if became == _ONE:
            _note_left(w.box, UNCLEAR, found, row)
        elif became != _EMPTY and not _known(w, domain):
            if direction < 0:
                # What cannot be inverted may be defined all the same, as where equilibria merge exactly.
                small = became == _SHRUNK or _bounded(w)
                if small:
                    _widen(w, domain, NEARBY)
                    small = not forces(w.box, p, w.f, w.J) or _bounded(w)
                    if small:
                        _copy(w.rest, w.box)
                _note_left(w.box, SMALL if small else UNDEFINED, found, row)
                continue
            _copy(w.box, boxes[tail])
            tail += 1
            if part > 0.5:
                low, high = w.box[direction, 0], w.box[direction, 1]
                _copy(w.box, boxes[tail])
                boxes[tail, direction, 0] = boxes[tail - 1, direction, 1] = low + CUT * (high - low)
                tail += 1
    starts = min(tail - head, limit // PER_START + 1)
    for k in range(starts):  # what may be listed none the less
        _copy(boxes[head + k * (tail - head) // starts], w.box)
        if w.known[0] < most and _newton(forces, p, domain, w):
            _copy(w.rest, w.box)
            if not _known(w, domain) and _around(forces, p, domain, w):
                _copy(w.before, w.whole[w.known[0]])
                if _close_in(forces, p, domain, w):
                    _note_zero(forces, balance, p, domain, w, found=found, row=row)
    for k in range(head, tail):
        _copy(boxes[k], w.box)
        if forces(w.box, p, w.f, w.J):
            _note_left(w.box, LIMIT if _bounded(w) else UNDEFINED, found, row)
    found.count[row, 2] += head
    kept = 0
    for k in range(min(found.count[row, 1], found.left.shape[1])):  # some lie in what was proved later
        _copy(found.left[row, k], w.box)
        if found.reason[row, k] >= AT_END or not _known(w, domain):
            _copy(w.box, found.left[row, kept])
            found.reason[row, kept] = found.reason[row, k]
            kept += 1
        else:
            found.count[row, 1] -= 1


@kernel(types.void(FORCES, FORCES, MATRIX, CUBE, CUBE, _WORK, _FOUND), **EXACT)
def search(forces: Any, balance: Any, domain: Any, parameters: Any, boxes: Any, w: Any, found: Any) -> None:
    """All zeros of ``forces`` in a domain, for each row of ``parameters`` (rows, count, 2).

    Args:
        forces: kernel of :data:`FORCES_SIGNATURE`: enclosures of forces and Jacobian over a box.
        balance: another with the same zeros and orientations, whose Jacobian's eigenvalues are told.
        domain: (n, 3): lowest and highest value of each coordinate and its period, 0 if it has none.
        parameters: lowest and highest value of each parameter; what is found holds for all in between.
        boxes: scratch (2 limit + 2, n, 2): ``limit`` boxes are treated at most for each row. With one row the
            first may be given, see ``_Work.known``, after a search of the same zeros in the rest.
        w: scratch of :func:`work`.
        found: what was found; to it is added.
    """
    for row in range(len(parameters)):
        _search(forces, balance, parameters[row], domain, boxes, w=w, found=found, row=row)
