"""Basins whose boundaries are known, for tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def disc(y: Floats) -> Integers:
    """1 within 0.7 of the origin of the first two states, else 0."""
    return (y[:, 0] ** 2 + y[:, 1] ** 2 < 0.49).astype(np.int64)


def cantor(y: Floats, depth: int = 30) -> Integers:
    """Which of two labels the gap of the middle-third Cantor set has that the first state in [0, 1] is in.

    Gaps of odd and even order differ, so the boundary is the Cantor set itself, of dimension ln 2/ln 3.
    """
    x, order = y[:, 0].copy(), np.full(len(y), -1)
    for k in range(depth):
        x *= 3.0
        digit = np.floor(x)
        order[(digit == 1.0) & (order < 0)] = k
        x -= digit
    return order % 2


def newton(n: int) -> Integers:
    """Roots of z^3 = 1 that Newton's method finds from n x n starts in [-1.5, 1.5]^2; -1: none."""
    x = np.linspace(-1.5, 1.5, n)
    z = x[:, None] + 1j * x
    with np.errstate(all="ignore"):
        for _ in range(60):
            z = z - (z**3 - 1.0) / (3.0 * z * z)
    away = np.abs(z[..., None] - np.exp(2j * np.pi * np.arange(3) / 3))
    away = np.where(np.isfinite(away), away, np.inf)
    return np.where(away.min(axis=-1) < 1e-6, away.argmin(axis=-1), -1)
