"""Defining systems of a mechanism's critical points: equations with their Jacobians, regular where those are.

With the forces f at rest, their Jacobian J by coordinates and its null vectors w and v, a fold has f = 0 and
g = 0, where g is the bordered scalar of J (Govaerts 2000, chapter 3). By symmetry, or where one position is
at rest whatever the parameters, v f_u = 0 for every parameter u, and these equations are singular: they are
unfolded by f + b v = 0 with a further unknown b, which comes out as zero. At a Hopf point the
matrix K - w^2 M + i w C is singular, where two frequencies coalesce K - s M twice, and where a growing swing
becomes two motions that grow without swinging K + x C + x^2 M twice.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.atlas.continuation import Equations, newton
from fastmech.models.mechanism import Linear, Mechanism, short_way
from fastmech.models.stability import spectra

#: How far Newton's method may go to where flutter begins.
NEAR = 0.01


class Border(NamedTuple):
    """A square matrix near a singular one, by its least singular value."""

    scalar: complex  #: zero where the matrix is singular; its derivative is that of the bordered scalar
    left: NDArray[np.complex128]
    right: NDArray[np.complex128]
    bordered: NDArray[np.complex128]  #: the matrix and both vectors


def border(matrix: NDArray[np.complex128] | Floats) -> Border:
    """Singular vectors of the least singular value; the scalar's sign is that of these vectors."""
    left, sizes, right = np.linalg.svd(matrix)
    v, w, n = left[:, -1], right[-1].conj(), len(matrix)
    whole = np.zeros((n + 1, n + 1), dtype=np.result_type(matrix))
    whole[:n, :n], whole[:n, n], whole[n, :n] = matrix, v, w.conj()
    return Border(-sizes[-1], v, w, whole)


class Balance:
    """Balance of a mechanism over one or two parameters, scaled.

    Points are (coordinates, further unknowns, u) or (..., u, v): angles in rad, lengths over their ranges by
    2 pi, parameters from 0 to 1 over theirs.
    """

    def __init__(self, mechanism: Mechanism, axes: Mapping[str, Sequence[float] | Floats]) -> None:
        """Over ranges of parameters, from the first value of each to the last."""
        from fastmech.models.expansion import expansion  # SymPy: only where a mechanism is there

        self.mechanism, self.names = mechanism, tuple(axes)
        self.n, self._made = len(mechanism.coordinates), expansion(mechanism, self.names)
        self.low, high = (np.array([float(values[end]) for values in axes.values()]) for end in (0, -1))
        self.span = high - self.low
        sizes = [1.0 if c.periodic else (c.high - c.low) / (2.0 * np.pi) for c in mechanism.coordinates]
        self.size = np.array(sizes)
        self.turning = np.array(mechanism.turning)
        self._by = np.concatenate([self.size, self.span])
        self.energy, self.rate = 1.0, 1.0  # units of what follows

    def point(self, position: Floats, values: Floats, *more: float) -> Floats:
        """Scaled, of coordinates [rad or m] and parameters' values."""
        return np.concatenate([position / self.size, more, (values - self.low) / self.span])

    def position(self, z: Floats) -> Floats:
        """Coordinates [rad or m] at points (..., unknowns), angles in (-pi, pi]."""
        found = z[..., : self.n] * self.size
        return np.where(self.turning, -(np.remainder(np.pi - found, 2.0 * np.pi) - np.pi), found)

    def values(self, z: Floats) -> Floats:
        """Parameters' values at points (..., unknowns)."""
        return np.asarray(self.low + self.span * z[..., -len(self.names) :])

    def apart(self, a: Floats, b: Floats) -> Floats:
        """Difference of points, angles the short way."""
        return short_way(a - b, self.mechanism.turning)

    def in_range(self, z: Floats) -> bool:
        """Whether coordinates and parameters are within their ranges."""
        position, part = z[: self.n] * self.size, z[-len(self.names) :]
        low, high = self.mechanism.ranges.T
        within = (part >= 0.0).all() and (part <= 1.0).all()
        return bool(within and ((position >= low) & (position <= high)).all())

    def rescale(self, z: Floats) -> None:
        """Take the stiffness and the fastest frequency at a point for the units of energy and rate."""
        self.energy = self.rate = 1.0
        stiffness, mass = np.abs(self.forces(z)[1][:, : self.n]).max(), np.abs(self.motion(z)[0][0]).max()
        self.energy = float(stiffness) or 1.0
        self.rate = float(np.sqrt(stiffness / mass)) or 1.0

    def forces(self, z: Floats) -> tuple[Floats, Floats, Floats]:
        """Forces (n,), derivatives by coordinates and parameters (n, k) and second ones (n, k, k)."""
        n, k = self.n, len(self._by)
        found = _numbers(self._made.forces, self._arguments(z), n * (1 + k + k * k))
        unit = self.size / self.energy
        value, first, second = np.split(found, [n, n + n * k])
        first = first.reshape(n, k) * unit[:, None] * self._by
        second = second.reshape(n, k, k) * unit[:, None, None] * self._by[:, None] * self._by
        return value * unit, first, second

    def motion(self, z: Floats) -> tuple[Floats, Floats]:
        """Metric and damping (2, n, n) and their derivatives by coordinates and parameters (2, n, n, k)."""
        n, k = self.n, len(self._by)
        found = _numbers(self._made.motion, self._arguments(z), 2 * n * n * (1 + k))
        unit = self.size[:, None] * self.size / self.energy
        scaled = np.array([unit * self.rate**2, unit * self.rate])
        value, first = np.split(found, [2 * n * n])
        return value.reshape(2, n, n) * scaled, first.reshape(2, n, n, k) * scaled[..., None] * self._by

    def determinant(self, z: Floats) -> float:
        """Of the forces' Jacobian by coordinates."""
        return float(np.linalg.det(self.forces(z)[1][:, : self.n]))

    def linear(self, z: Floats) -> Linear:
        """Mass, damping and stiffness at points (..., unknowns)."""
        values = dict(zip(self.names, np.moveaxis(self.values(z), -1, 0), strict=True))
        return self.mechanism.linear(self.position(z), values)

    def flutters(self, z: Floats) -> bool:
        """Whether an equilibrium swings more and more."""
        roots = spectra(self.linear(z[None]))[0]
        return bool(((roots.roots.real > roots.errors) & (np.abs(roots.roots.imag) > roots.errors)).any())

    def flutter(self, z: Floats) -> Floats:
        """The equilibrium very near one that begins to flutter; itself if Newton's method finds none."""
        linear = self.linear(z[None])
        own = spectra(linear)[0]
        fast = abs(float(own.roots[0, 0].imag * own.rate[0])) / self.rate
        equations, more = (self.hopf, fast) if linear.damping.any() else (self.coalescence, fast * fast)
        found = newton(equations, np.insert(z, self.n, more), NEAR)
        return z if found is None else np.delete(found, self.n)

    def _arguments(self, z: Floats) -> list[float]:
        return [*(z[: self.n] * self.size).tolist(), *self.values(z).tolist()]

    def _known(self, z: Floats) -> NDArray[np.intp]:
        """Columns of coordinates and parameters among a point's unknowns."""
        parameters = len(self.names)
        return np.concatenate([np.arange(self.n), np.arange(len(z) - parameters, len(z))])

    def defining(self, kind: str, rate: float) -> tuple[Equations, list[float]]:
        """Equations of critical points, and what their further unknown is about at a rate [rad/s or 1/s]."""
        swing = rate / self.rate
        return {
            "fold": (self.singular, []),
            "pitchfork": (self.unfolded, [0.0]),
            "Hopf": (self.hopf, [swing]),
            "coalescence": (self.coalescence, [swing * swing]),
            "flutter-divergence": (self.parting, [swing]),
        }[kind]

    def rest(self, z: Floats) -> tuple[Floats, Floats]:
        """f = 0."""
        value, first, _ = self.forces(z)
        return value, first

    def singular(self, z: Floats) -> tuple[Floats, Floats]:
        """f = 0 and g = 0: folds, where no symmetry makes these singular; g has one sign on a side."""
        value, first, second = self.forces(z)
        at = border(first[:, : self.n])
        sign = np.sign(np.linalg.det(at.bordered))
        slope = -np.einsum("i,ijk,j->k", at.left, second[:, : self.n], at.right)
        return np.append(value, sign * at.scalar), np.vstack([first, sign * slope])

    def unfolded(self, z: Floats) -> tuple[Floats, Floats]:
        """f + b v = 0, g = 0 and v f_u = 0: pitchforks; z = (coordinates, b, parameters).

        The parameters change along g's gradient, where the singular matrix changes.
        """
        value, first, second = self.forces(z)
        n, known, b = self.n, self._known(z), z[self.n]
        at = border(first[:, :n])
        slope = -np.einsum("i,ijk,j->k", at.left, second[:, :n], at.right)
        size = float(np.linalg.norm(slope[n:]))
        along = slope[n:] / size if size > 0.0 else np.ones(len(slope) - n)
        right = -np.einsum("i,ijk->jk", at.left, second[:, :n])
        turned = np.linalg.solve(at.bordered.T, np.vstack([right, np.zeros(len(slope))]))[:n]
        moved = first[:, n:] @ along
        rows = np.zeros((n + 2, len(z)))
        rows[:n, known], rows[:n, n] = first + b * turned, at.left
        rows[n, known] = slope
        rows[n + 1, known] = moved @ turned + np.einsum("i,ijk,j->k", at.left, second[:, n:], along)
        return np.concatenate([value + b * at.left, [at.scalar, at.left @ moved]]), rows

    def hopf(self, z: Floats) -> tuple[Floats, Floats]:
        """f = 0 and K - w^2 M + i w C is singular; z = (coordinates, w, u, v)."""
        value, first, second = self.forces(z)
        (mass, damping), slopes = self.motion(z)
        n, known, w = self.n, self._known(z), z[self.n]
        at = border(-first[:, :n] - w * w * mass + 1j * w * damping)
        changes = -second[:, :n] - w * w * slopes[0] + 1j * w * slopes[1]
        row = np.empty(len(z), dtype=np.complex128)
        row[known] = -np.einsum("i,ijk,j->k", at.left.conj(), changes, at.right)
        row[n] = -(at.left.conj() @ (-2.0 * w * mass + 1j * damping) @ at.right)
        rows = np.zeros((n + 2, len(z)))
        rows[:n, known], rows[n], rows[n + 1] = first, row.real, row.imag
        return np.concatenate([value, [at.scalar.real, 0.0]]), rows

    def coalescence(self, z: Floats) -> tuple[Floats, Floats]:
        """f = 0, and s is a root of det(K - s M) = 0 twice; z = (coordinates, s, u, v), nothing damps."""
        (mass, _), (slopes, _) = self.motion(z)
        s = z[self.n]
        return self._twice(z, (-s * mass, -s * slopes), (-mass, -slopes), np.zeros_like(mass))

    def parting(self, z: Floats) -> tuple[Floats, Floats]:
        """f = 0, and x is a real root of det(K + x C + x^2 M) = 0 twice; z = (coordinates, x, u, v)."""
        (mass, damping), (heavy, slopes) = self.motion(z)
        x = z[self.n]
        added = x * damping + x * x * mass, x * slopes + x * x * heavy
        return self._twice(z, added, (damping + 2.0 * x * mass, slopes + 2.0 * x * heavy), 2.0 * mass)

    def _twice(
        self, z: Floats, added: tuple[Floats, Floats], once: tuple[Floats, Floats], again: Floats
    ) -> tuple[Floats, Floats]:
        """f = 0, and K + A(x) is singular twice: A and its two derivatives by x, the first with slopes."""
        value, first, second = self.forces(z)
        n, known, (slope, bent) = self.n, self._known(z), once
        at = border(-first[:, :n] + added[0])
        changes, turned = np.zeros((n, n, len(z))), np.zeros((n, n, len(z)))
        changes[:, :, known], turned[:, :, known] = -second[:, :n] + added[1], bent
        changes[:, :, n], turned[:, :, n] = slope, again
        empty = np.zeros(len(z))
        left = -np.einsum("i,ijk->jk", at.left, changes)
        right = -np.einsum("ijk,j->ik", changes, at.right)
        turned_left = np.linalg.solve(at.bordered.T, np.vstack([left, empty]))[:n]
        turned_right = np.linalg.solve(at.bordered, np.vstack([right, empty]))[:n]
        rows = np.zeros((n + 2, len(z)))
        rows[:n, known] = first
        rows[n] = -np.einsum("i,ijk,j->k", at.left, changes, at.right)
        rows[n + 1] = (
            (slope @ at.right) @ turned_left
            + (at.left @ slope) @ turned_right
            + np.einsum("i,ijk,j->k", at.left, turned, at.right)
        )
        return np.concatenate([value, [at.scalar, at.left @ slope @ at.right]]), rows

    def bend(self, z: Floats) -> tuple[float, float, Floats]:
        """v f_qq w w and the size of v f_u, with v: a fold's is zero at a cusp, all along a pitchfork's."""
        _, first, second = self.forces(z)
        at = border(first[:, : self.n])
        bent = np.einsum("i,ijk,j,k", at.left, second[:, : self.n, : self.n], at.right, at.right)
        return float(bent), float(np.abs(at.left @ first[:, self.n :]).max()), np.asarray(at.left)


def _numbers(function: Callable[..., list[float]], arguments: list[float], count: int) -> Floats:
    """What a function gives, NaN where it is not defined."""
    try:
        return np.array(function(*arguments), dtype=np.float64)
    except (ValueError, ArithmeticError, TypeError):  # a root of a negative number is complex: no such place
        return np.full(count, np.nan)
