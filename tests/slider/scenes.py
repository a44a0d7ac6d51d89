"""Random scenes as vectors, and the degree-6 polynomial, for tests that share nothing with the package."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def random_scenes(n: int, seed: int) -> dict[str, Floats]:
    """Four decades of stiffness, forces of both signs, l 0.2-4 m, masses 0.1-100 kg."""
    rng = np.random.default_rng(seed)
    return {
        "m1": 10 ** rng.uniform(-1, 2, n),
        "m2": 10 ** rng.uniform(-1, 2, n),
        "m3": 10 ** rng.uniform(-1, 2, n),
        "l": rng.uniform(0.2, 4.0, n),
        "c1": 10 ** rng.uniform(0, 4, n),
        "c2": 10 ** rng.uniform(0, 4, n),
        "F0": rng.choice([-1.0, 1.0], n) * 10 ** rng.uniform(-1, 4, n),
    }


def loads(scenes: Any, number: Any = np.longdouble, g: float = 9.80665) -> tuple[Any, Any, Any, Any]:
    """a, b, C, f [J] of the scenes in a wider number type."""
    s = {name: number(value) for name, value in scenes.items()}
    gravity = number(g)
    a = (s["m1"] + s["m2"]) * gravity * s["l"] - s["c2"] * s["l"] ** 2
    return a, s["m2"] * gravity * s["l"], s["c1"] * s["l"] ** 2, s["F0"] * s["l"]


def polynomial(a: Any, b: Any, C: Any, f: Any) -> Any:
    """Its seven coefficients, highest power first, along the last axis."""
    size = np.sqrt(a * a + b * b + C * C + f * f)
    a, b, C, f = (np.asarray(x / size, dtype=np.float64) for x in (a, b, C, f))
    w, q = f + 1j * b, a - 1j * f
    one, two = np.zeros((*a.shape, 7), complex), np.zeros((*a.shape, 7), complex)
    one[..., 1], one[..., 3], one[..., 5] = w * w, -2.0 * w * w.conj(), w.conj() ** 2
    one *= (C**2)[..., None]
    square = np.stack([q * q, 0 * q, 2 * q * q.conj(), 0 * q, q.conj() ** 2], axis=-1)
    pair = np.stack([-C * w, w * w.conj() + C * C, -C * w.conj()], axis=-1)
    for i in range(5):
        for j in range(3):
            two[..., i + j] += square[..., i] * pair[..., j]
    return one + two


def roots(coefficients: Any) -> Any:
    """All six roots of many polynomials, as eigenvalues of companion matrices."""
    n = len(coefficients)
    companion = np.zeros((n, 6, 6), complex)
    companion[:, np.arange(1, 6), np.arange(5)] = 1.0
    companion[:, 0, :] = -coefficients[:, 1:] / coefficients[:, :1]
    return np.linalg.eigvals(companion)


def exact_unit_roots(scene: dict[str, float]) -> int:
    """Number of roots on the unit circle at 60 digits."""
    with mpmath.workdps(60):
        return len(unit_roots(*loads(scene, lambda x: mpmath.mpf(float(x)))))


def unit_roots(a: Any, b: Any, C: Any, f: Any) -> list[Any]:
    """Roots of the polynomial on the unit circle, at 60 digits."""
    with mpmath.workdps(60):
        a, b, C, f = (mpmath.mpf(x) for x in (a, b, C, f))
        w, q = mpmath.mpc(f, b), mpmath.mpc(a, -f)

        def times(x: list[Any], y: list[Any]) -> list[Any]:
            out = [mpmath.mpc(0)] * (len(x) + len(y) - 1)
            for i, u in enumerate(x):
                for j, v in enumerate(y):
                    out[i + j] += u * v
            return out

        half = [w, 0, -mpmath.conj(w)]
        first = times([C**2, 0], times(half, half))
        lift = [q, 0, mpmath.conj(q)]
        second = times(times(lift, lift), times([-C, mpmath.conj(w)], [w, -C]))
        total = [x + y for x, y in zip([0] * (7 - len(first)) + first, second, strict=True)]
        found = mpmath.polyroots(total, maxsteps=1000, extraprec=500)
        return [z for z in found if abs(abs(z) - 1) < mpmath.mpf(10) ** -25]
