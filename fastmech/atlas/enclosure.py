"""Values, slopes and bounds of an expression over many boxes, compiled once for every expression.

An expression is recorded as a list of operations and interpreted by one kernel, in forward differentiation
with a remainder. Over the box |z - c| <= h a function has the value v and the slopes d at the centre c, and
nowhere in the box are its slopes further than e from d. So it stays within (|d| + e/2) h of v: e grows with
the box at least as fast as the box, hence the mean of its bound on the way from c is at most one half of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.jit import CUBE, INTEGERS, MATRIX, VECTOR, kernel

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


@dataclass(frozen=True)
class Term:
    """A number within an expression that is being recorded."""

    tape: list[tuple[int, int, int, float]]
    slot: int

    def _then(self, kind: int, x: Any, y: Any) -> Term:
        one, two = (z.slot if isinstance(z, Term) else self._constant(float(z)) for z in (x, y))
        self.tape.append((kind, one, two, 0.0))
        return Term(self.tape, len(self.tape) - 1)

    def _constant(self, value: float) -> int:
        self.tape.append((CONSTANT, 0, 0, value))
        return len(self.tape) - 1

    def __add__(self, other: Any) -> Term:
        return self._then(ADD, self, other)

    def __radd__(self, other: Any) -> Term:
        return self._then(ADD, other, self)

    def __sub__(self, other: Any) -> Term:
        return self._then(SUBTRACT, self, other)

    def __rsub__(self, other: Any) -> Term:
        return self._then(SUBTRACT, other, self)

    def __mul__(self, other: Any) -> Term:
        return self._then(MULTIPLY, self, other)

    def __rmul__(self, other: Any) -> Term:
        return self._then(MULTIPLY, other, self)

    def __neg__(self) -> Term:
        return self._then(MULTIPLY, -1.0, self)

    def sin(self) -> Term:
        """What ``np.sin`` calls."""
        return self._then(SINE, self, self)

    def cos(self) -> Term:
        """What ``np.cos`` calls."""
        return self._then(COSINE, self, self)


@dataclass
class System:
    """m equations F(z) = 0 in n unknowns, recorded once.

    ``equations`` takes the unknowns, a sequence of n numbers, and returns the m left sides. It may add,
    subtract, multiply and take sines and cosines.
    """

    equations: Callable[[Any], tuple[Any, ...]]
    unknowns: int
    _tape: NDArray[np.int64] = field(init=False)
    _constants: Floats = field(init=False)
    _wanted: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        tape: list[tuple[int, int, int, float]] = [(VARIABLE, i, 0, 0.0) for i in range(self.unknowns)]
        start = [Term(tape, i) for i in range(self.unknowns)]
        self._wanted = np.array([left.slot for left in self.equations(start)])
        self._tape = np.array([row[:3] for row in tape])
        self._constants = np.array([row[3] for row in tape])

    @property
    def left(self) -> int:
        """The number m of equations."""
        return self._wanted.size

    def over(self, centre: Floats, half: Floats) -> Enclosure:
        """Values, slopes and bounds over boxes (boxes, n)."""
        (boxes, n), m = centre.shape, self._wanted.size
        found = Enclosure(np.empty((boxes, m)), np.empty((boxes, m, n)), np.empty((boxes, m, n)))
        centre, half = np.ascontiguousarray(centre), np.ascontiguousarray(half)
        enclose(self._tape, self._constants, centre, half, self._wanted, *found)
        return found

    def __call__(self, z: Floats) -> tuple[Floats, Floats]:
        """F and its Jacobian at a point."""
        found = self.over(z[None], np.zeros((1, z.size)))
        return found.value[0], found.slope[0]
