"""What users write without the package: the mechanism in Numba, one trajectory at a time.

``scalar_rhs`` is also the right-hand side that the libraries in the other files are given.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fastmech.arrays import Floats
from fastmech.jit import FLAGS
from fastmech.studies.bench.measure import BenchProblem, Solve


@njit(nogil=True, **FLAGS)  # type: ignore[untyped-decorator]
def accelerations(phi: float, theta: float, u: float, w: float, p: Floats) -> tuple[float, float]:
    """(phi'', theta'') as a user would type them; ``p`` are the reduced coefficients."""
    s1, c1, s12, c12 = np.sin(phi), np.cos(phi), np.sin(phi + theta), np.cos(phi + theta)
    root = np.sqrt(4.0 - s1 * s1)
    k = s1 * (1.0 + c1 / root)
    dk = c1 + (c1 * c1 - s1 * s1) / root + (s1 * c1) ** 2 / (root * root * root)
    r1 = p[3] * c12 - p[2] * c1 - p[5] * s1 - p[6] * k * k * u - p[1] * k * dk * u * u - c12 * w * w
    r2 = p[3] * c12 - p[4] * np.sin(theta) - p[5] * np.cos(theta) - c12 * u * u
    phi_ddot = (r1 - s12 * r2) / (p[0] + p[1] * k * k + c12 * c12)
    return phi_ddot, r2 - s12 * phi_ddot


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
