"""The equations of folds, cusps, branchings and vanishing damping over two parameters, with derivatives.

Unknowns are z = (phi, theta, u, v), where u and v run from 0 to 1 over the two parameters' ranges. Residuals
are over the loads on the mechanism, so they are pure numbers. Derivatives come from complex steps, exact to
rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.axes import coefficient_columns
from fastmech.atlas.continuation import System
from fastmech.mechanism.reduced import potential_gradient, potential_hessian
from fastmech.scene import Scene

Floats = NDArray[np.float64]

#: The imaginary step: f(x + ih) has the imaginary part h f'(x), without any difference.
H = 1e-30


@dataclass(frozen=True)
class Plane:
    """Two parameters of a scene and the ranges in which they are looked at."""

    scene: Scene
    names: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]

    def values(self, parts: Any) -> dict[str, Any]:
        """Parameters at (u, v)."""
        return {
            name: a + (b - a) * part
            for name, a, b, part in zip(self.names, self.low, self.high, parts, strict=True)
        }

    def parts(self, values: Any) -> Floats:
        """(u, v) of parameters."""
        low, high = np.array(self.low), np.array(self.high)
        return np.asarray((np.asarray(values) - low) / (high - low))

    def coefficients(self, parts: Any) -> tuple[Any, Any, Any, Any]:
        """Lift, spring, gravity, force [1/s^2] at (u, v)."""
        c = coefficient_columns(self.scene, self.values(parts))
        return c.lift, c.spring, c.gravity, c.force


@dataclass(frozen=True)
class Point:
    """Gradient, Hessian and what else systems are made of at z, over the loads."""

    phi: Any
    theta: Any
    gradient: tuple[Any, Any]
    hessian: tuple[Any, Any, Any]
    pull: Any  #: C cos(phi + theta), the common pull at an equilibrium, paper (17)
    spring: Any
    amplitudes: tuple[Any, Any, Any]  #: of the three pulls over phi, theta, psi (see ``balance``)
    turn: Any  #: f (a - b) = cos D A_phi A_theta

    @property
    def determinant(self) -> Any:
        """Of the Hessian."""
        h11, h12, h22 = self.hessian
        return h11 * h22 - h12 * h12

    @property
    def third(self) -> Any:
        """Third derivative of U along the null direction of a singular Hessian; zero at a cusp."""
        h11, h12, h22 = self.hessian
        flat = np.abs(h11) > np.abs(h22)
        v1, v2 = np.where(flat, h12, h22), np.where(flat, -h11, -h12)
        size = np.sqrt(v1 * v1 + v2 * v2)
        return 3.0 * self.pull * v1 * v2 * (v1 + v2) / size**3


def point_at(plane: Plane, z: Any) -> Point:
    """Everything at z, shape (4, columns): the columns may be complex."""
    a, C, b, f = (np.broadcast_to(np.asarray(c), z[0].shape) for c in plane.coefficients(z[2:]))
    loads = np.sqrt(np.abs(a) ** 2 + 2.0 * np.abs(C) ** 2 + np.abs(b) ** 2 + 2.0 * np.abs(f) ** 2)
    loads = np.where(loads > 0.0, loads, 1.0)
    a, C, b, f = a / loads, C / loads, b / loads, f / loads
    s1, c1, s2, c2 = np.sin(z[0]), np.cos(z[0]), np.sin(z[1]), np.cos(z[1])
    s12, c12 = np.sin(z[0] + z[1]), np.cos(z[0] + z[1])
    return Point(
        z[0],
        z[1],
        potential_gradient(s1, c1, s2, c2, c12, a, C, b, f),
        potential_hessian(s1, c1, s2, c2, s12, a, C, b, f),
        C * c12,
        C,
        (np.sqrt(a * a + f * f), np.sqrt(b * b + f * f), C),
        f * (a - b),
    )


def system(plane: Plane, equations: Callable[[Point], tuple[Any, ...]]) -> System:
    """F(z) and its Jacobian for equations made of a ``Point``."""

    def evaluate(z: Floats) -> tuple[Floats, Floats]:
        columns = np.repeat(z[:, None].astype(complex), z.size + 1, axis=1)
        columns[:, 1:] += 1j * H * np.eye(z.size)
        values = np.array(equations(point_at(plane, columns)))
        return values[:, 0].real, values[:, 1:].imag / H

    return evaluate


def fold(plane: Plane) -> System:
    """gradient = 0, det Hessian = 0."""
    return system(plane, lambda p: (*p.gradient, p.determinant))


def cusp(plane: Plane) -> System:
    """A fold along whose null direction the third derivative vanishes too."""
    return system(plane, lambda p: (*p.gradient, p.determinant, p.third))


def rest(plane: Plane) -> System:
    """gradient = 0: the equilibria themselves, over one parameter."""
    return system(plane, lambda p: p.gradient)


def dead_centre(plane: Plane) -> System:
    """An equilibrium with sin phi = 0: small motions do not move the damper."""
    return system(plane, lambda p: (*p.gradient, np.sin(p.phi)))


def straight(plane: Plane) -> System:
    """An equilibrium with sin(phi + theta) = 0: M2 swings without pulling at M1."""
    return system(plane, lambda p: (*p.gradient, np.sin(p.phi + p.theta)))


def unloaded(plane: Plane) -> System:
    """An equilibrium with U_theta,theta = C: the rod M1M2 is unloaded and M2 swings by itself."""
    return system(plane, lambda p: (*p.gradient, p.hessian[2] - p.spring))


def over_parameters(plane: Plane, equation: Callable[[Point], Any]) -> System:
    """One equation for (u, v) alone, with its derivatives; of the ``Point`` it uses no angle."""

    def evaluate(z: Floats) -> tuple[Floats, Floats]:
        columns = np.zeros((4, 3), dtype=complex)
        columns[2:] = z[:, None]
        columns[2:, 1:] += 1j * H * np.eye(2)
        value = equation(point_at(plane, columns))
        return value[:1].real, value[None, 1:].imag / H

    return evaluate


def branching(plane: Plane, smallest: int) -> System:
    """Two equilibria branch off a third where the scene is its own mirror image all over the plane.

    There D = +-pi/2, and the fold of ``balance`` is 1/A1 = 1/A2 + 1/A3, A1 the smallest amplitude.
    """

    def equation(p: Point) -> Any:
        one, two, three = (p.amplitudes[(smallest + k) % 3] for k in range(3))
        return two * three - one * (two + three)

    return over_parameters(plane, equation)


def exchange(plane: Plane, largest: int) -> System:
    """The same where the two smaller amplitudes agree all over the plane: the fold is A1 = A3 |cos D|."""

    def equation(p: Point) -> Any:
        one = p.amplitudes[(largest + 1) % 3]
        cosine = p.turn / (p.amplitudes[0] * p.amplitudes[1])
        return p.amplitudes[largest] * cosine * np.sign(cosine[0].real) - one

    return over_parameters(plane, equation)
