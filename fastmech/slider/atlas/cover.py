"""All solutions of a system within a rectangle of parameters, by branch and prune, with a proof.

The unknowns are two angles and one or two parts of parameters' ranges; the solutions are points or curves. A
box of unknowns is dropped where one of the equations, or one of them multiplied by the inverse of the
Jacobian at the box's centre, keeps its sign, and shrunk to where it does not. What is left is split. Where
Newton's method finds a solution in a small box the curve through it is followed.

**Neighbourhoods.** Let z be a solution, t the unit null vector of the Jacobian there (for curves) and M the
inverse of the Jacobian with the row t. In a box round z the Jacobian of (F, t.w) stays so near to the one at
z that M times their difference is at most q < 1, in the norm whose unit ball is the box. So (F, t.w) is one
to one there, and by contraction every value of t.(w - z) up to (1 - q) times the box's size along t is taken
by a solution. Hence all solutions of this neighbourhood lie on the one arc through z, and a box within it
needs no further look. The set of solutions is **complete** when no box is left. Bounds hold in double
precision, with an allowance for rounding.

Values, slopes and bounds of an expression over many boxes, compiled once for every expression. An expression
is recorded as a list of operations and interpreted by one kernel, in forward differentiation with a
remainder. Over the box |z - c| <= h a function has the value v and the slopes d at the centre c, and nowhere
in the box are its slopes further than e from d. So it stays within (|d| + e/2) h of v: e grows with the box
at least as fast as the box, hence the mean of its bound on the way from c is at most one half of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fastmech.arrays import Floats
from fastmech.atlas.continuation import Curve
from fastmech.interrupts import check
from fastmech.jit import CUBE, INTEGERS, MATRIX, VECTOR, inlined, kernel

CONSTANT, VARIABLE, ADD, SUBTRACT, MULTIPLY, SINE, COSINE = range(7)

#: Allowance for rounding of expressions of order one.
ROUNDING = 1e-14

OPERATIONS = types.Array(types.int64, 2, "C")


@kernel(types.void(OPERATIONS, VECTOR, MATRIX, MATRIX, INTEGERS, MATRIX, CUBE, CUBE))
def enclose(
    tape: NDArray[np.int64],
    constants: Floats,
    centre: Floats,
    half: Floats,
    wanted: NDArray[np.int64],
    value: Floats,
    slope: Floats,
    bend: Floats,
) -> None:
    """Write v (boxes, m), d and e (boxes, m, n) of the m ``wanted`` operations over boxes (boxes, n).

    As soon as one of them cannot vanish in a box all are NaN there.
    """
    steps, n = tape.shape[0], centre.shape[1]
    v, r, d, e = np.zeros(steps), np.zeros(steps), np.zeros((steps, n)), np.zeros((steps, n))
    for p in range(centre.shape[0]):
        done, possible = 0, True
        for m in range(wanted.shape[0]):
            for k in range(done, wanted[m] + 1):
                kind, x, y = tape[k, 0], tape[k, 1], tape[k, 2]
                if kind == CONSTANT:
                    v[k] = constants[k]
                    continue
                if kind == VARIABLE:
                    v[k], r[k], d[k, x] = centre[p, x], half[p, x], 1.0
                    continue
                if kind in (ADD, SUBTRACT):
                    sign = 1.0 if kind == ADD else -1.0
                    v[k] = v[x] + sign * v[y]
                    for i in range(n):
                        d[k, i] = d[x, i] + sign * d[y, i]
                        e[k, i] = e[x, i] + e[y, i]
                elif kind == MULTIPLY:
                    v[k] = v[x] * v[y]
                    most_x, most_y = abs(v[x]) + r[x], abs(v[y]) + r[y]
                    for i in range(n):
                        d[k, i] = d[x, i] * v[y] + d[y, i] * v[x]
                        e[k, i] = e[x, i] * most_y + abs(d[x, i]) * r[y]
                        e[k, i] += e[y, i] * most_x + abs(d[y, i]) * r[x]
                else:
                    v[k], along = np.sin(v[x]), np.cos(v[x])
                    if kind == COSINE:
                        v[k], along = along, -v[k]
                    change = abs(v[k]) * r[x] + 0.5 * abs(along) * r[x] * r[x]
                    for i in range(n):
                        d[k, i] = along * d[x, i]
                        e[k, i] = abs(d[x, i]) * change + e[x, i] * (abs(along) + change)
                r[k] = 0.0
                for i in range(n):
                    r[k] += (abs(d[k, i]) + 0.5 * e[k, i]) * half[p, i]
            done = max(done, wanted[m] + 1)
            last = wanted[m]
            if r[last] > 0.0 and abs(v[last]) > r[last] + ROUNDING:
                possible = False
                break
        for m in range(wanted.shape[0]):
            value[p, m] = v[wanted[m]] if possible else np.nan
            for i in range(n):
                slope[p, m, i] = d[wanted[m], i] if possible else np.nan
                bend[p, m, i] = e[wanted[m], i] if possible else np.nan


class Enclosure(NamedTuple):
    """Of m functions of n variables over boxes."""

    value: Floats  #: (boxes, m) at the centres
    slope: Floats  #: (boxes, m, n) there
    bend: Floats  #: (boxes, m, n): by how much the slopes may change within the box


#: What is recorded of NumPy's functions, which operators call too.
KINDS = {np.add: ADD, np.subtract: SUBTRACT, np.multiply: MULTIPLY, np.sin: SINE, np.cos: COSINE}


@dataclass(frozen=True, eq=False)
class Term(NDArrayOperatorsMixin):
    """A number within an expression that is being recorded."""

    tape: list[tuple[int, int, int, float]]
    slot: int

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *given: Any) -> Term:
        """The next number: operators and NumPy's functions come here."""
        if ufunc is np.negative:
            return -1.0 * self
        one, two = (given * 2)[:2]  # a function of one has its argument twice
        first, second = (
            x.slot if isinstance(x, Term) else self._record(CONSTANT, 0, 0, x) for x in (one, two)
        )
        return Term(self.tape, self._record(KINDS[ufunc], first, second, 0.0))

    def _record(self, kind: int, one: int, two: int, value: float) -> int:
        self.tape.append((kind, one, two, float(value)))
        return len(self.tape) - 1


class DefiningSystem:
    """m equations F(z) = 0 in n unknowns, recorded once.

    ``equations`` takes the unknowns, a sequence of n numbers, and returns the m left sides. It may add,
    subtract, multiply and take sines and cosines.
    """

    def __init__(self, equations: Callable[[Any], tuple[Any, ...]], unknowns: int) -> None:
        tape: list[tuple[int, int, int, float]] = [(VARIABLE, i, 0, 0.0) for i in range(unknowns)]
        left = equations([Term(tape, i) for i in range(unknowns)])
        self.unknowns = unknowns
        self._wanted = np.array([term.slot for term in left])
        self._tape = np.array([row[:3] for row in tape])
        self._constants = np.array([row[3] for row in tape])

    def over(self, centre: Floats, half: Floats) -> Enclosure:
        """Values, slopes and bounds over boxes (boxes, n)."""
        (boxes, n), m = centre.shape, self._wanted.size
        found = Enclosure(np.empty((boxes, m)), np.empty((boxes, m, n)), np.empty((boxes, m, n)))
        centre, half = np.ascontiguousarray(centre), np.ascontiguousarray(half)
        enclose(self._tape, self._constants, centre, half, self._wanted, **found._asdict())
        return found

    def __call__(self, z: Floats) -> tuple[Floats, Floats]:
        """F and its Jacobian at a point."""
        found = self.over(z[None], np.zeros((1, z.size)))
        return found.value[0], found.slope[0]


#: Boxes of the start along an angle and along a parameter.
ANGLES, PARTS = 16, 4

#: Boxes that are looked at in all, and size of a box that is not split any more.
MOST_BOXES, SMALLEST = 1_200_000, 1e-8

#: Solutions that lead along a curve that is known, or along none, before the search is given up: at a curve's
#: singular points its neighbourhoods vanish, and where there are many the search would not end.
MOST_VAIN = 50

#: Largest q of a neighbourhood, and of a box in which Newton's method is tried.
CONTRACTION, RIPE = 0.75, 0.5

#: Neighbourhoods: longest and shortest half length tried [rad and parts], their ratios; width over length.
WIDEST, NARROWEST, SHORTER, THIN = 0.05, 1e-8, 0.5, 0.1

#: Largest distance of a curve's points over the reach of their neighbourhoods, and halvings to get there.
SPACING, MOST_HALVINGS = 1.0, 12

#: Neighbourhoods of a curve after which no more are added.
MOST_NEIGHBOURHOODS = 20_000

#: Periods of the unknowns, 0: none.
TURNS = np.array([2.0 * np.pi, 2.0 * np.pi, 0.0, 0.0])


def apart(a: Floats, b: Floats) -> Floats:
    """Difference of points (phi, theta, u, v), angles the short way."""
    gap = a - b
    gap[..., :2] = np.mod(gap[..., :2] + np.pi, 2.0 * np.pi) - np.pi
    return gap


@inlined
def minor(A: Floats, i: int, k: int) -> float:
    """The cofactor of an entry of a matrix (4, 4)."""
    r, q, s = (i + 1) % 4, (i + 2) % 4, (i + 3) % 4
    x, y, z = (k + 1) % 4, (k + 2) % 4, (k + 3) % 4
    size = (
        A[r, x] * (A[q, y] * A[s, z] - A[q, z] * A[s, y])
        - A[r, y] * (A[q, x] * A[s, z] - A[q, z] * A[s, x])
        + A[r, z] * (A[q, x] * A[s, y] - A[q, y] * A[s, x])
    )
    return size if (i + k) % 2 == 0 else -size


@kernel(types.void(CUBE, CUBE, MATRIX))
def invert(slope: Floats, inverse: Floats, tangent: Floats) -> None:
    """Write M (boxes, n, 3) and t (boxes, n) of Jacobians (boxes, 3, n); NaN where they are singular."""
    n = slope.shape[2]
    A = np.zeros((4, 4))
    A[3, 3] = 1.0
    for p in range(slope.shape[0]):
        for i in range(3):
            for k in range(n):
                A[i, k] = slope[p, i, k]
        if n == 4:
            for k in range(4):
                tangent[p, k] = minor(A, 3, k)
            size = np.sqrt(tangent[p, 0] ** 2 + tangent[p, 1] ** 2 + tangent[p, 2] ** 2 + tangent[p, 3] ** 2)
            for k in range(4):
                tangent[p, k] /= size
                A[3, k] = tangent[p, k]
        determinant = 0.0
        for k in range(4):
            determinant += A[3, k] * minor(A, 3, k)
        for k in range(n):
            for i in range(3):
                inverse[p, k, i] = minor(A, i, k) / determinant


def inverses(slope: Floats) -> tuple[Floats, Floats]:
    """M (boxes, n, 3) and t (boxes, n), zero for points, of Jacobians (boxes, 3, n)."""
    boxes, _, n = slope.shape
    inverse, t = np.empty((boxes, n, 3)), np.zeros((boxes, n))
    invert(slope, inverse, t)
    lost = ~np.isfinite(inverse).all(axis=(1, 2))
    inverse[lost], t[lost] = np.nan, 0.0
    return inverse, t


class Neighbourhoods:
    """Boxes round solutions that hold nothing but the arcs through these.

    ``points`` are those of a curve in order, or one alone; polished ones are added between them until each
    neighbourhood holds its neighbours. ``radius`` (points, n) and ``reach`` (points,), along the tangent, are
    how far it extends.
    """

    def __init__(self, system: DefiningSystem, points: Floats) -> None:
        self.system = system
        here = self._at(points)
        for _ in range(MOST_HALVINGS):
            z, _, _, reach = here
            gap = apart(z[1:], z[:-1])
            far = np.linalg.norm(gap, axis=1) > SPACING * np.maximum(reach[1:], reach[:-1])
            if not far.any() or len(z) > MOST_NEIGHBOURHOODS:
                break
            between = self._at(polished(self.system, z[:-1][far] + 0.5 * gap[far]))
            place = np.flatnonzero(far) + 1
            here = tuple(  # type: ignore[assignment]
                np.insert(old, place, new, axis=0) for old, new in zip(here, between, strict=True)
            )
        self.points, self.tangents, self.radius, self.reach = here
        self._tree = cKDTree(wrapped(self.points), boxsize=TURNS[: points.shape[1]])

    def _at(self, points: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Points, tangents, radius and reach."""
        inverse, t = inverses(self.system.over(points, np.zeros_like(points)).slope)
        size = np.abs(inverse)
        shape = np.abs(t) + (THIN if t.any() else 1.0)
        radius, change = np.zeros_like(shape), np.ones((len(points), 1))
        long, todo = WIDEST, np.arange(len(points))
        while todo.size and long > NARROWEST:
            size_, there = size[todo], points[todo]
            # As wide as twice what the curve may bend away within its length.
            tried = long * shape[todo]
            for _ in range(2):
                tried = long * shape[todo] + 2.0 * self._bent(size_, there, tried)
            now = (self._bent(size_, there, tried) / tried).max(axis=1, keepdims=True)
            good = now[:, 0] < CONTRACTION
            radius[todo[good]], change[todo[good]] = tried[good], now[good]
            long, todo = SHORTER * long, todo[~good]
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = (1.0 - change)[:, 0] * (radius / np.abs(t)).min(axis=1)
        return points, t, radius, reach

    def _bent(self, size: Floats, points: Floats, radius: Floats) -> Floats:
        """How far the change of the Jacobian within a box may lead away."""
        return ((size @ self.system.over(points, radius).bend) @ radius[:, :, None])[:, :, 0]

    def hold(self, centre: Floats, half: Floats) -> NDArray[np.bool_]:
        """Whether boxes (boxes, n) lie within one neighbourhood."""
        held = np.zeros(len(centre), dtype=bool)
        small = np.flatnonzero((half <= self.radius.max(axis=0)).all(axis=1))
        if not small.size:
            return held
        centre, half = centre[small], half[small]
        beyond = float(np.linalg.norm(self.radius, axis=1).max())
        nearest = self._tree.query(wrapped(centre), k=2, distance_upper_bound=beyond)[1]
        nearest = np.minimum(nearest, len(self.points) - 1)  # where there is none so near: one further away
        for near in nearest.T:
            gap, t = apart(centre, self.points[near]), self.tangents[near]
            within = (np.abs(gap) + half <= self.radius[near]).all(axis=1)
            along = np.abs((gap * t).sum(axis=1)) + (np.abs(t) * half).sum(axis=1)
            held[small] |= within & (along <= self.reach[near])
        return held


def polished(system: DefiningSystem, points: Floats) -> Floats:
    """Solutions near points (points, n) by Newton's method, the nearest ones of curves."""
    for _ in range(4):
        found = system.over(points, np.zeros_like(points))
        inverse = inverses(found.slope)[0]
        points = points - np.nan_to_num(inverse @ found.value[:, :, None])[:, :, 0]
    return points


def wrapped(points: Floats) -> Floats:
    """Angles from 0 to 2 pi."""
    z = points.copy()
    z[:, :2] = np.mod(z[:, :2], 2.0 * np.pi)
    z[:, :2][z[:, :2] >= 2.0 * np.pi] = 0.0  # what is below zero by rounding
    return z


@dataclass
class Covered:
    """What a search has found."""

    curves: list[Curve]
    open: Floats  #: (places, n) of boxes that are left; none: complete
    cut_short: bool  #: at ``MOST_BOXES`` or ``MOST_VAIN``


def solutions(system: DefiningSystem, follow: Callable[[Floats], Curve | None]) -> Covered:
    """All solutions of a system with the unknowns phi, theta [rad] and one or two parts from 0 to 1.

    Args:
        system: as many equations as unknowns, or one less.
        follow: gives the curve through a solution, within the rectangle; None: there is none.
    """
    centre, half = start(system.unknowns)
    curves: list[Curve] = []
    known: list[Neighbourhoods] = []
    tiny, looked_at, vain = [centre[:0]], 0, 0
    while 0 < len(centre) <= MOST_BOXES - looked_at and vain < MOST_VAIN:
        check()
        looked_at += len(centre)
        centre, half, slope, ripe = pruned(system, centre, half)
        left = ~held_by(known, centre, half)
        centre, half, slope, ripe = centre[left], half[left], slope[left], ripe[left]
        z = polished(system, centre[ripe])
        near = (np.abs(z - centre[ripe]) <= 2.0 * half[ripe].max(axis=1, keepdims=True)).all(axis=1)
        z = z[near & ((z[:, 2:] >= 0.0) & (z[:, 2:] <= 1.0)).all(axis=1)]
        z = z[~held_by(known, z, np.zeros_like(z))]
        before = len(known)
        while len(z) and vain < MOST_VAIN:
            check()
            seed, z = z[:1], z[1:]
            curve = follow(seed[0])
            if curve is not None and held_by(known, curve.points, np.zeros_like(curve.points)).mean() < 0.5:
                curves.append(curve)
                known.append(Neighbourhoods(system, curve.points))
                z = z[~held_by(known[-1:], z, np.zeros_like(z))]
            vain += not held_by(known[-1:], seed, np.zeros_like(seed))[0]
        left = ~held_by(known[before:], centre, half)
        small = half.max(axis=1) < SMALLEST
        tiny.append(centre[left & small])
        left &= ~small
        centre, half = split(centre[left], half[left], slope[left])
    return Covered(curves, np.concatenate([*tiny, centre]), len(centre) > 0)


def held_by(known: list[Neighbourhoods], centre: Floats, half: Floats) -> NDArray[np.bool_]:
    """Which boxes (boxes, n) lie within a neighbourhood of one of the curves."""
    held = np.zeros(len(centre), dtype=bool)
    for one in known:
        held[~held] = one.hold(centre[~held], half[~held])
    return held


def start(n: int) -> tuple[Floats, Floats]:
    """Boxes that cover the torus and the rectangle."""
    pieces = (ANGLES,) * 2 + (PARTS,) * (n - 2)
    length = np.array([2.0 * np.pi] * 2 + [1.0] * (n - 2))
    centre = (np.indices(tuple(pieces)).reshape(n, -1).T + 0.5) / pieces * length
    centre[:, :2] -= np.pi
    return centre, np.tile(0.5 * length / np.array(pieces), (len(centre), 1))


def pruned(
    system: DefiningSystem, centre: Floats, half: Floats
) -> tuple[Floats, Floats, Floats, NDArray[np.bool_]]:
    """What is left of boxes: centres, halves, slopes, and whether at most one arc can pass through."""
    value, slope, bend = system.over(centre, half)
    kept = ~np.isnan(value[:, 0])
    centre, half, value, slope, bend = (x[kept] for x in (centre, half, value, slope, bend))
    rest = 0.5 * (bend @ half[:, :, None])[:, :, 0] + ROUNDING
    inverse, t = inverses(slope)
    lost = np.isnan(inverse[:, 0, 0])
    inverse[lost] = 0.0
    step = -(inverse @ value[:, :, None])[:, :, 0]
    room = (np.abs(inverse) @ rest[:, :, None])[:, :, 0]
    # Every solution in the box is centre + step + s t, up to room, with some s.
    reach = (np.abs(t) * half).sum(axis=1)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.sort(np.stack([(-half - room - step) / t, (half + room - step) / t]), axis=0)
    moves = np.abs(t) > 1e-12
    first = np.where(moves, ends[0], -reach).max(axis=1)
    last = np.where(moves, ends[1], reach).min(axis=1)
    along = np.sort(np.stack([first[:, None] * t, last[:, None] * t]), axis=0)
    low = np.maximum(-half, step + along[0] - room)
    high = np.minimum(half, step + along[1] + room)
    low[lost], high[lost] = -half[lost], half[lost]
    kept = lost | ((first <= last) & (low <= high).all(axis=1))
    change = ((np.abs(inverse) @ bend) @ half[:, :, None])[:, :, 0]
    ripe = ~lost & (change <= RIPE * half).all(axis=1)
    low, high = low[kept], high[kept]
    return centre[kept] + 0.5 * (low + high), 0.5 * (high - low), slope[kept], ripe[kept]


def split(centre: Floats, half: Floats, slope: Floats) -> tuple[Floats, Floats]:
    """Every box in four, along the unknowns that change the equations most."""
    for _ in range(2):
        weight = (np.abs(slope).max(axis=1) + 1e-3) * half
        widest = np.arange(half.shape[1]) == np.argmax(weight, axis=1)[:, None]
        half = np.where(widest, 0.5 * half, half)
        shift = np.where(widest, half, 0.0)
        centre, half = np.concatenate([centre - shift, centre + shift]), np.concatenate([half, half])
        slope = np.concatenate([slope, slope])
    return centre, half
