"""Basins whose boundaries are known, for tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Directions of straight boundaries [rad]: along an axis, a diagonal, and in between.
ANGLES = (0.0, 0.3, np.pi / 4, 1.2, np.pi / 2, 2.5)


def disc(y: Floats) -> Integers:
    """1 within 0.7 of the origin of the first two states, else 0."""
    return (y[:, 0] ** 2 + y[:, 1] ** 2 < 0.49).astype(np.int64)


def gaps(x: Floats, ratio: float = 1.0 / 3.0, depth: int = 40) -> Integers:
    """Order of the gap of a Cantor set on [0, 1] that points are in; 0 outside.

    Each piece has two left, ``ratio`` as long, at its ends: the dimension is ln 2/ln(1/ratio). Every point of
    the set is a limit of gaps of all high orders.
    """
    x, order = np.array(x, dtype=np.float64), np.full(x.shape, -1)
    order[(x < 0.0) | (x > 1.0)] = 0
    for k in range(1, depth + 1):
        order[(order < 0) & (x > ratio) & (x < 1.0 - ratio)] = k
        x = np.clip(np.where(x < 0.5, x, x - 1.0 + ratio) / ratio, 0.0, 1.0)
    return np.where(order < 0, depth, order)


def cantor(y: Floats, ratio: float = 1.0 / 3.0) -> Integers:
    """Two labels whose boundary is a Cantor set along the first state: gaps of odd and even order."""
    return gaps(y[:, 0], ratio) % 2


def along(n: int, angle: float, shift: float = 0.3) -> Floats:
    """Distance of the points of an n x n grid along a direction from its middle [steps]."""
    i = np.arange(n) - (n - 1) / 2.0
    return np.cos(angle) * i[:, None] + np.sin(angle) * i + shift


def stripes(n: int, angle: float, width: float, labels: int = 2) -> Integers:
    """Straight bands on an n x n grid, so many steps wide."""
    return np.floor(along(n, angle) / width).astype(np.int64) % labels


def round_spots(n: int, radius: float) -> Integers:
    """Discs in rows, three radii apart, the rows inclined to the grid."""
    u, v = (along(n, angle) / (3.0 * radius) % 1.0 - 0.5 for angle in (0.3, 0.3 + np.pi / 2))
    return (np.hypot(u, v) < 1.0 / 3.0).astype(np.int64)


def smooth_map(n: int, labels: int, seed: int, waves: float = 3.0) -> Integers:
    """The largest of random sums of waves: smooth boundaries that meet in threes."""
    rng = np.random.default_rng(seed)
    x = np.linspace(-np.pi, np.pi, n)
    fields = []
    for _ in range(labels):
        k, phase, size = rng.uniform(-waves, waves, (6, 2)), rng.uniform(0, 2 * np.pi, 6), rng.normal(size=6)
        terms = [s * np.cos(a * x[:, None] + b * x + p) for (a, b), p, s in zip(k, phase, size, strict=True)]
        fields.append(np.sum(terms, axis=0))
    return np.argmax(fields, axis=0)


def koch(n: int, angle: float, scale: float = 0.8, depth: int = 14) -> Integers:
    """Koch's snowflake on an n x n grid, its boundary of dimension ln 4/ln 3; ``scale``: its side over n."""
    i = (np.arange(n) - (n - 1) / 2.0) / (n * scale)
    z = (i[:, None] + 1j * i).ravel() * np.exp(1j * angle)
    corners = np.exp(2j * np.pi * np.arange(3) / 3) / np.sqrt(3.0)
    inside = np.ones(z.size, dtype=bool)
    for a, b in zip(corners, np.roll(corners, -1), strict=True):
        inside &= ((z - a) / (b - a)).imag >= 0.0
    for a, b in zip(corners, np.roll(corners, -1), strict=True):
        # Seen from the edge as 0 to 1 with the outside above, all is under flat triangles, four in each.
        place = np.arange(z.size)
        w = ((z - a) / (b - a)).conjugate()
        for _ in range(depth):
            under = (w.imag >= 0.0) & (w.imag <= np.tan(np.pi / 6) * np.minimum(w.real, 1.0 - w.real) + 1e-15)
            place, w = place[under], w[under]
            middle = w.imag <= np.sqrt(3.0) * np.minimum(w.real - 1.0 / 3.0, 2.0 / 3.0 - w.real)
            inside[place[middle]] = True
            place, w = place[~middle], w[~middle]
            top = 0.5 + 1j * np.sqrt(3.0) / 6.0
            ends = ((0.0, 1 / 3), (1 / 3, top), (top, 2 / 3), (2 / 3, 1.0))
            parts = [(w - first) / (last - first) for first, last in ends]
            flat = [p.imag <= np.tan(np.pi / 6) * np.minimum(p.real, 1.0 - p.real) + 1e-15 for p in parts]
            w = np.select([f & (p.imag >= 0.0) for f, p in zip(flat, parts, strict=True)], parts, -1.0)
    return inside.reshape(n, n).astype(np.int64)


def rough(n: int, angle: float, power: float, seed: int) -> Integers:
    """Sides of Weierstrass' curve sum b^(-power k) cos(b^k u + phase), b = 1.9, of dimension 2 - power."""
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, 32)
    u, v = along(n, angle) / n, along(n, angle + np.pi / 2) / n
    terms = (1.9 ** (-power * k) * np.cos(2.0 * np.pi * 1.9**k * u + p) for k, p in enumerate(phases))
    return (3.0 * v < sum(terms)).astype(np.int64)


def newton(n: int, angle: float = 0.0, span: float = 1.5, middle: complex = 0.0) -> Integers:
    """Roots of z^3 = 1 that Newton's method finds from n x n starts in a square; -1: none."""
    x = np.linspace(-span, span, n)
    z = (x[:, None] + 1j * x) * np.exp(1j * angle) + middle
    with np.errstate(all="ignore"):
        for _ in range(60):
            z = z - (z**3 - 1.0) / (3.0 * z * z)
    away = np.abs(z[..., None] - np.exp(2j * np.pi * np.arange(3) / 3))
    away = np.where(np.isfinite(away), away, np.inf)
    return np.where(away.min(axis=-1) < 1e-6, away.argmin(axis=-1), -1)


def duffing(n: int, periods: int = 25, steps: int = 60) -> Integers:
    """Wells in which x'' + 0.25 x' - x + x^3 = 0.2 cos t ends from n x n starts in [-2, 2]^2.

    The force is above Melnikov's threshold 4 * 0.25 cosh(pi/2)/(3 sqrt(2) pi) = 0.188, where the saddle's
    manifolds cross and the boundary becomes fractal (Moon and Li, Phys. Rev. Lett. 55 (1985) 1439).
    """
    v, x = np.meshgrid(np.linspace(-2, 2, n), np.linspace(-2, 2, n))
    h = 2.0 * np.pi / steps
    y = np.stack([x, v])

    def rate(t: float, y: Floats) -> Floats:
        return np.stack([y[1], 0.2 * np.cos(t) - 0.25 * y[1] + y[0] - y[0] * y[0] * y[0]])

    for t in h * np.arange(periods * steps):
        a = rate(t, y)
        b = rate(t + h / 2, y + h / 2 * a)
        c = rate(t + h / 2, y + h / 2 * b)
        y = y + h / 6 * (a + 2 * b + 2 * c + rate(t + h, y + h * c))
    return (y[0] > 0.0).astype(np.int64)
