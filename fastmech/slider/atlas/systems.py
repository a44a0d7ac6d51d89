"""The equations of folds, pitchforks, cusps and vanishing damping over one or two parameters.

Unknowns are z = (phi, theta, u) or (phi, theta, u, v), where u and v run from 0 to 1 over the parameters'
ranges. With the notation of ``fastmech.slider.theorem`` and xk = -Ak sin yk an equilibrium has equal
pulls A1 cos y1 = A2 cos y2 = A3 cos y3, and its Hessian is singular where x1 x2 + x2 x3 + x3 x1 = 0. The null
vector has the parts 1/x1 : 1/x2 : 1/x3 along y1, y2, y3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fastmech.arrays import Floats
from fastmech.scene import Scene
from fastmech.slider.atlas.axes import coefficient_columns
from fastmech.slider.atlas.cover import DefiningSystem
from fastmech.slider.reduced import potential_gradient, potential_hessian

#: A part of a load that is this small beside the largest load of a plane is rounding.
ROUNDING = 1e-14

#: Two loads, or pulls, that are this near all over a plane agree by symmetry.
SYMMETRIC = 1e-12


#: An amplitude over the largest load of a plane below which it is zero within rounding.
VANISHING = 1e-9


@dataclass(frozen=True)
class Plane:
    """One or two parameters of a scene and the ranges in which they are looked at, rising or falling."""

    scene: Scene
    names: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    sheared: bool = False  #: the second unknown is phi + theta instead of theta: where the spring is stiff
    parts_of_loads: Floats = field(init=False)  #: (4, 2^parameters), see ``loads``

    def __post_init__(self) -> None:
        """Loads over l are linear in every parameter: their corners tell them everywhere."""
        corners = np.meshgrid(*([0.0, 1.0] for _ in self.names), indexing="ij")
        values = self.values([part.ravel() for part in corners])
        c = coefficient_columns(self.scene, values)
        full = {**self.scene.parameters, **values}
        over_l = full["m2"] * full["l"]
        rows = [np.broadcast_to(x * over_l, corners[0].size) for x in (c.lift, c.spring, c.gravity, c.force)]
        parts = np.array(rows, dtype=np.float64).reshape(4, *corners[0].shape)
        size = np.abs(parts).max()
        for axis in range(1, parts.ndim):
            first, last = np.split(parts, 2, axis=axis)
            parts = np.concatenate([first, last - first], axis=axis)
        parts = np.where(np.abs(parts) > ROUNDING * size, parts, 0.0) / (size if size > 0.0 else 1.0)
        object.__setattr__(self, "parts_of_loads", parts.reshape(4, -1))

    def values(self, parts: Any) -> dict[str, Any]:
        """Parameters at (u, v)."""
        each = zip(self.names, self.low, self.high, parts, strict=True)
        return {name: a + (b - a) * part for name, a, b, part in each}

    def in_units(self, z: Floats) -> tuple[Any, Any, Floats, Floats]:
        """Parameters at points (..., unknowns), the second one 0 of one alone; phi, theta in [-pi, pi)."""
        at = z.T
        second = at[1] - at[0] if self.sheared else at[1]
        phi, theta = (np.mod(angle + np.pi, 2.0 * np.pi) - np.pi for angle in (at[0], second))
        x, y = (*self.values(at[2:]).values(), 0.0)[:2]
        return x, y, phi, theta

    def parts(self, values: Any) -> Floats:
        """(u, v) of parameters."""
        low, high = np.array(self.low), np.array(self.high)
        return np.asarray((np.asarray(values) - low) / (high - low))

    def loads(self, parts: Any) -> tuple[Any, Any, Any, Any]:
        """Lift, spring, gravity, force at (u, v), over the largest one of the plane's corners."""
        ones = [1.0, parts[0]] if len(self.names) == 1 else [1.0, parts[1], parts[0], parts[0] * parts[1]]
        found = []
        for row in self.parts_of_loads:
            load: Any = float(row[0])
            for part, one in zip(row[1:], ones[1:], strict=True):
                load = load + one * float(part) if part != 0.0 else load
            found.append(load)
        return found[0], found[1], found[2], found[3]


@dataclass(frozen=True)
class ParameterPoint:
    """Gradient, Hessian and what else systems are made of at z, over the plane's largest load."""

    phi: Any
    theta: Any
    pulls: tuple[Any, Any, Any]  #: A1 cos y1, A2 cos y2, A3 cos y3: equal at an equilibrium, paper (17)
    bent: tuple[Any, Any, Any]  #: x1, x2, x3
    loads: tuple[Any, Any, Any, Any]

    @property
    def gradient(self) -> tuple[Any, Any]:
        """Of U."""
        return self.pulls[0] - self.pulls[2], self.pulls[1] - self.pulls[2]

    @property
    def hessian(self) -> tuple[Any, Any, Any]:
        """Of U: phi phi, phi theta, theta theta."""
        x1, x2, x3 = self.bent
        return x1 + x3, x3, x2 + x3

    @property
    def determinant(self) -> Any:
        """Of the Hessian, without cancellation where one pull is stiff."""
        x1, x2, x3 = self.bent
        return x1 * x2 + (x1 + x2) * x3

    @property
    def third(self) -> Any:
        """Third derivative of U along the null direction of a singular Hessian; zero at a cusp."""
        h11, h12, h22 = self.hessian
        flat = np.abs(h11) > np.abs(h22)
        v1, v2 = np.where(flat, h12, h22), np.where(flat, -h11, -h12)
        size = np.sqrt(v1 * v1 + v2 * v2)
        return 3.0 * self.pulls[2] * v1 * v2 * (v1 + v2) / size**3

    @property
    def size(self) -> Any:
        """Of the loads here."""
        return np.sqrt(sum(load * load for load in self.loads))

    @property
    def residual(self) -> float:
        """Largest one of gradient and determinant, over the loads."""
        size = self.size + (self.size == 0.0)
        left = [*(g / size for g in self.gradient), self.determinant / size**2]
        return float(np.max(np.abs(left)))

    @property
    def isolated(self) -> Any:
        """Whether equilibria are: no two of the three amplitudes are zero within rounding."""
        a, C, b, f = self.loads
        amplitudes = np.array(np.broadcast_arrays(np.hypot(a, f), np.hypot(b, f), C))
        return np.sort(amplitudes, axis=0)[1] > VANISHING


def point_at(plane: Plane, z: Any) -> ParameterPoint:
    """Everything at z, a sequence of numbers, vectors or terms that are recorded."""
    a, C, b, f = plane.loads(z[2:])
    phi, theta, psi = (z[0], z[1] - z[0], z[1]) if plane.sheared else (z[0], z[1], z[0] + z[1])
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    s12, c12 = np.sin(psi), np.cos(psi)
    # Without the spring the gradient is what balances its pull.
    p1, p2 = potential_gradient((s1, c1, s2, c2), 0.0, (a, 0.0, b), f)
    x1, _, x2 = potential_hessian((s1, c1, s2, c2), 0.0, (a, 0.0, b), f)
    return ParameterPoint(phi, theta, (p1, p2, C * c12), (x1, x2, C * s12), (a, C, b, f))


def suited(plane: Plane) -> Plane:
    """The plane with the unknowns that its stiffest pull is a function of one of."""
    _, C, b, f = plane.loads(np.indices((2,) * len(plane.names)).reshape(len(plane.names), -1))
    return replace(plane, sheared=bool(np.max(C) > np.max(np.hypot(b, f))))


def system(plane: Plane, equations: Callable[[ParameterPoint], tuple[Any, ...]]) -> DefiningSystem:
    """The equations of a ``ParameterPoint``, recorded."""
    return DefiningSystem(lambda z: equations(point_at(plane, z)), 2 + len(plane.names))


def fold(plane: Plane) -> DefiningSystem:
    """gradient = 0, det Hessian = 0."""

    def equations(p: ParameterPoint) -> tuple[Any, ...]:
        first, second = p.gradient
        return first, p.pulls[0] - p.pulls[1] if plane.sheared else second, p.determinant

    return system(plane, equations)


def rest(plane: Plane) -> DefiningSystem:
    """gradient = 0: the equilibria themselves, over one parameter."""
    return system(plane, lambda p: p.gradient)


def cusp(plane: Plane, other: int | None) -> DefiningSystem:
    """Three equilibria merge: the null vector has no part along y ``other``, or (None) the pulls are zero."""
    if other is None:
        return system(plane, lambda p: (*p.pulls, p.determinant))
    one, two = ((other + k) % 3 for k in (1, 2))
    return system(plane, lambda p: (*p.gradient, p.bent[one], p.bent[two]))


#: Kind of folds, ``fold`` or ``pitchfork``, and the equations of all that are of it.
Family = tuple[str, DefiningSystem]


def families(plane: Plane) -> list[Family]:
    """The equations that together hold for every fold of a plane, and are regular where folds usually are.

    By the counting theorem of ``balance`` all folds of a scene that is its own mirror image, f (a - b) = 0,
    lie at the symmetric positions cos y1 = cos y2 = 0: they are pitchforks, and the equations of a fold are
    singular there. Where two amplitudes agree exchanging their angles is another symmetry. Then either
    sin yi = sin yj = 0, a pitchfork, or yi = yj.
    """
    somewhere = np.random.default_rng(0).random((len(plane.names), 8))
    a, C, b, f = np.broadcast_arrays(*plane.loads(somewhere))
    A = (np.hypot(a, f), np.hypot(b, f), C)

    def zero(x: Floats) -> bool:
        return bool((np.abs(x) <= SYMMETRIC * np.max(A, axis=0)).all())

    if zero(f):
        return [("pitchfork", system(plane, lambda p: (np.cos(p.phi), np.sin(p.theta), p.determinant)))]
    if zero(a - b):
        return [("pitchfork", system(plane, lambda p: (*p.pulls[:2], p.determinant)))]
    for one, two, other in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        if zero(A[one] - A[two]):
            return exchanged(plane, one, two, other)
    return [("fold", fold(plane))]


def exchanged(plane: Plane, one: int, two: int, other: int) -> list[Family]:
    """Folds where the amplitudes ``one`` and ``two`` agree all over the plane."""

    def split(p: ParameterPoint) -> tuple[Any, ...]:
        return p.bent[one], p.bent[two], p.pulls[two] - p.pulls[other]

    def together(p: ParameterPoint) -> tuple[Any, ...]:
        sine = p.bent[one] * p.pulls[two] - p.bent[two] * p.pulls[one]  # of yj - yi
        return sine, p.pulls[one] - p.pulls[other], p.bent[one] + 2.0 * p.bent[other]

    return [("pitchfork", system(plane, split)), ("fold", system(plane, together))]
