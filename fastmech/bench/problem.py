"""The benchmark's problems: ensembles, and a reference by SciPy from equations typed here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """An ensemble whose final states are wanted."""

    name: str
    description: str
    scene: Scene
    starts: Floats  #: shape (n, 4)
    t_end: float  #: s


def rest_starts(n: int) -> Problem:
    """Table 1, constant force, at rest with phi in [0.5, 2.5] and theta in [-1, 1], for 10 s."""
    rng = np.random.default_rng(1)
    starts = np.zeros((n, 4))
    starts[:, 0] = rng.uniform(0.5, 2.5, n)
    starts[:, 1] = rng.uniform(-1.0, 1.0, n)
    return Problem(
        "rest", "rest starts, phi in [0.5, 2.5], theta in [-1, 1] rad", Scene(alpha=0.0), starts, 10.0
    )


def fast_starts(n: int) -> Problem:
    """Table 1, constant force, any angles and rates up to 10 rad/s, for 10 s."""
    rng = np.random.default_rng(2)
    starts = np.concatenate([rng.uniform(-np.pi, np.pi, (n, 2)), rng.uniform(-10.0, 10.0, (n, 2))], axis=1)
    return Problem("fast", "any angles, |phi'|, |theta'| up to 10 rad/s", Scene(alpha=0.0), starts, 10.0)


PROBLEMS: dict[str, Callable[[int], Problem]] = {"rest": rest_starts, "fast": fast_starts}


def scalar_rhs(t: float, y: Floats, p: Floats) -> Floats:
    """The equations of motion as a user would type them for SciPy: one state, library trigonometry.

    ``p`` are the reduced coefficients of a scene with damper and constant force.
    """
    s1, c1, s12, c12 = np.sin(y[0]), np.cos(y[0]), np.sin(y[0] + y[1]), np.cos(y[0] + y[1])
    root = np.sqrt(4.0 - s1 * s1)
    k = s1 * (1.0 + c1 / root)
    dk = c1 + (c1 * c1 - s1 * s1) / root + (s1 * c1) ** 2 / root**3
    r1 = -p[2] * c1 + p[3] * c12 - p[5] * s1 - p[6] * k * k * y[2]
    r1 = r1 - p[1] * k * dk * y[2] ** 2 - c12 * y[3] ** 2
    r2 = -p[4] * np.sin(y[1]) + p[3] * c12 - p[5] * np.cos(y[1]) - c12 * y[2] ** 2
    a11 = p[0] + 1.0 + p[1] * k * k
    phi_ddot = (r1 - s12 * r2) / (a11 - s12 * s12)
    return np.array([y[2], y[3], phi_ddot, r2 - s12 * phi_ddot])


def reference(problem: Problem, count: int, rhs: Callable[..., Floats], rtol: float) -> Floats:
    """Final states of the first ``count`` starts by SciPy's DOP853, shape (count, 4)."""
    p = np.array(reduce(problem.scene))
    span = (0.0, problem.t_end)
    return np.array(
        [
            solve_ivp(rhs, span, y0, method="DOP853", args=(p,), rtol=rtol, atol=0.1 * rtol).y[:, -1]
            for y0 in problem.starts[:count]
        ]
    )
