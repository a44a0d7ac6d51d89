"""What users write without the package: the mechanism in Numba, one trajectory at a time.

The accelerations are what every other library is given too, with its own sines, cosines and roots.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any

import numpy as np
from numba import njit

from fastmech.arrays import Floats
from fastmech.jit import FLAGS
from fastmech.studies.bench.measure import BenchProblem, Solve


def lagrange(phi: Any, theta: Any, u: Any, w: Any, p: Any) -> tuple[Any, Any]:
    """(phi'', theta'') as a user would type them; ``p`` are the reduced coefficients."""
    s1, c1, s12, c12 = sin(phi), cos(phi), sin(phi + theta), cos(phi + theta)
    inverse = 1.0 / sqrt(4.0 - s1 * s1)
    q = c1 * inverse
    k = s1 + s1 * q
    dk = c1 + q * c1 - s1 * s1 * (1.0 - q * q) * inverse
    r1 = c12 * (p[3] - w * w) - p[2] * c1 - p[5] * s1 - k * u * (p[6] * k + p[1] * dk * u)
    r2 = c12 * (p[3] - u * u) - p[4] * sin(theta) - p[5] * cos(theta)
    phi_ddot = (r1 - s12 * r2) / (p[0] + c12 * c12 + p[1] * k * k)
    return phi_ddot, r2 - s12 * phi_ddot


accelerations = njit(nogil=True, **FLAGS)(lagrange)


@njit(nogil=True, **FLAGS)  # type: ignore[untyped-decorator]
def scalar_rhs(t: float, y: Floats, p: Floats) -> Floats:
    """Derivatives of one state (4,)."""
    phi_ddot, theta_ddot = accelerations(y[0], y[1], y[2], y[3], p)
    return np.array([y[2], y[3], phi_ddot, theta_ddot])


@njit(nogil=True, **FLAGS)  # type: ignore[untyped-decorator]
def in_scalars(starts: Floats, p: Floats, h: float, steps: int) -> Floats:
    """RK4, one trajectory after the other; the states and stages are local numbers."""
    final = np.empty_like(starts)
    for i in range(len(starts)):
        a, b, u, w = starts[i]
        for _ in range(steps):
            u1, w1 = accelerations(a, b, u, w, p)
            u2, w2 = accelerations(a + 0.5 * h * u, b + 0.5 * h * w, u + 0.5 * h * u1, w + 0.5 * h * w1, p)
            # The stages' rates are the angles' derivatives.
            ua, wa = u + 0.5 * h * u1, w + 0.5 * h * w1
            u3, w3 = accelerations(a + 0.5 * h * ua, b + 0.5 * h * wa, u + 0.5 * h * u2, w + 0.5 * h * w2, p)
            ub, wb = u + 0.5 * h * u2, w + 0.5 * h * w2
            uc, wc = u + h * u3, w + h * w3
            u4, w4 = accelerations(a + h * ub, b + h * wb, uc, wc, p)
            a += h / 6.0 * (u + 2.0 * (ua + ub) + uc)
            b += h / 6.0 * (w + 2.0 * (wa + wb) + wc)
            u += h / 6.0 * (u1 + 2.0 * (u2 + u3) + u4)
            w += h / 6.0 * (w1 + 2.0 * (w2 + w3) + w4)
        final[i] = a, b, u, w
    return final


def prepared(h: float, problem: BenchProblem) -> Solve:
    """The loop at a fixed step."""
    p, steps = np.array(problem.coefficients), round(problem.t_end / h)
    return lambda starts: in_scalars(starts, p, problem.t_end / steps, steps)
