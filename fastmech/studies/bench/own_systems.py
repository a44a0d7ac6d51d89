"""Systems of the study of own systems, fixed before anything was measured: equations, starts, end times.

Ends are so early that motions magnify errors by 30 to 2,000 at most: errors show methods, not chaos.
Each function is written once. :func:`spoken` gives it another library's sine, cosine and roots.
"""

from __future__ import annotations

import types
from collections.abc import Callable
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from fastmech.arrays import Floats
from fastmech.ensembles.system import System
from fastmech.jit import FLAGS
from fastmech.kernels.sincos import cos, sin

#: Starts of each system.
STARTS = 16_384

#: Mass of the Moon over that of Earth and Moon.
MU = 0.01215


@njit(**FLAGS)  # type: ignore[untyped-decorator]
def inverse_cube(s: float) -> float:
    """s^(-3/2)."""
    return 1.0 / (s * sqrt(s))


def duffing(t, x, v):  # type: ignore[no-untyped-def]
    """Hardening and softening oscillator, driven."""
    return v, x - x * x * x - 0.2 * v + 0.3 * cos(1.2 * t)


def lorenz(t, x, y, z):  # type: ignore[no-untyped-def]
    """Lorenz (1963): sigma = 10, rho = 28, beta = 8/3."""
    return 10.0 * (y - x), x * (28.0 - z) - y, x * y - 8.0 / 3.0 * z


def henon_heiles(t, x, y, u, v):  # type: ignore[no-untyped-def]
    """Motion in the potential (x^2 + y^2)/2 + x^2 y - y^3/3 (Henon, Heiles, Astron. J. 69 (1964), 73)."""
    return u, v, -x - 2.0 * x * y, -y - x * x + y * y


def three_body(t, x, y, u, v):  # type: ignore[no-untyped-def]
    """Restricted three-body problem in rotating coordinates: Earth, Moon and a third body without mass."""
    a, b = x + MU, x - (1.0 - MU)
    p, q = (1.0 - MU) * inverse_cube(a * a + y * y), MU * inverse_cube(b * b + y * y)
    return u, v, 2.0 * v + x - p * a - q * b, -2.0 * u + y - (p + q) * y


def double_pendulum(t, a, b, u, v):  # type: ignore[no-untyped-def]
    """Two equal masses on equal rods of 1 m, absolute angles [rad]."""
    s, c = sin(a - b), cos(a - b)
    f = -s * v * v - 2.0 * 9.81 * sin(a)
    h = s * u * u - 9.81 * sin(b)
    d = 1.0 / (2.0 - c * c)
    return u, v, (f - c * h) * d, (2.0 * h - c * f) * d


def chain(t, a, b, c, d, p, q, r, s):  # type: ignore[no-untyped-def]
    """Four pendulums, each coupled to its neighbours by a torsion spring."""
    f, g = -sin(a) + 0.5 * (b - a), -sin(b) + 0.5 * (a - b + c - b)
    h, k = -sin(c) + 0.5 * (b - c + d - c), -sin(d) + 0.5 * (c - d)
    return p, q, r, s, f, g, h, k


def starts_in(low: Any, high: Any, n: int = STARTS) -> Floats:
    """The first n of the starts in a box, shape (n, dim)."""
    return np.ascontiguousarray(np.random.default_rng(1).uniform(low, high, (STARTS, len(low)))[:n])


class OwnSystem(NamedTuple):
    """A system with the box in which its starts are uniform."""

    rhs: Callable[..., Any]
    state: str
    low: tuple[float, ...]
    high: tuple[float, ...]
    t_end: float  #: s

    def system(self) -> System:
        """The problem as a user writes it."""
        return System(self.rhs, self.state.split(), {})

    def starts(self, n: int = STARTS) -> Floats:
        """The first n starts, shape (n, dim)."""
        return starts_in(self.low, self.high, n)


SYSTEMS = {
    "Duffing, 2 states, driven": OwnSystem(duffing, "x v", (-2.0, -2.0), (2.0, 2.0), 6.0),
    "Lorenz, 3 states": OwnSystem(lorenz, "x y z", (-10.0, -10.0, 10.0), (10.0, 10.0, 40.0), 0.75),
    "Henon-Heiles, 4 states": OwnSystem(henon_heiles, "x y u v", (-0.25,) * 4, (0.25,) * 4, 30.0),
    "three bodies, 4 states": OwnSystem(
        three_body, "x y u v", (0.44, 0.82, -0.05, -0.05), (0.54, 0.92, 0.05, 0.05), 4.0
    ),
    "double pendulum, 4 states, sines": OwnSystem(double_pendulum, "a b u v", (-1.0,) * 4, (1.0,) * 4, 5.0),
    "four pendulums, 8 states, sines": OwnSystem(
        chain, "a b c d p q r s", (-2.0,) * 4 + (-1.0,) * 4, (2.0,) * 4 + (1.0,) * 4, 20.0
    ),
}


def spoken(function: Callable[..., Any], **names: Any) -> Callable[..., Any]:
    """The same function with other meanings of ``sin``, ``cos``, ``sqrt`` and ``inverse_cube``."""
    code: Any = function
    return types.FunctionType(code.__code__, code.__globals__ | names, code.__name__)


def in_numpy(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same function of arrays of any precision."""
    names = {"sin": np.sin, "cos": np.cos, "sqrt": np.sqrt, "inverse_cube": lambda s: s**-1.5}
    return spoken(function, **names)
