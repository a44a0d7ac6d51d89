"""Motions by SciPy's DOP853 at 1e-12, which tests of the engine compare with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from oracles import motion_rates
from scipy.integrate import solve_ivp

from fastmech.scene import Scene

Floats = NDArray[np.float64]


def motions(rates: Callable[[float, Floats], Floats], starts: Floats, times: ArrayLike) -> Floats:
    """States (times, n, dim) of all trajectories, solved as one system; ``rates(t, y)`` of y (n, dim)."""
    clock = np.asarray(times, dtype=np.float64)
    found = solve_ivp(
        lambda t, y: rates(t, y.reshape(starts.shape)).ravel(),
        (0.0, clock[-1]),
        starts.ravel(),
        method="DOP853",
        t_eval=clock,
        rtol=1e-12,
        atol=1e-12,
    )
    assert found.success
    return found.y.T.reshape(clock.size, *starts.shape)


def motions_of(scene: Scene, starts: Floats, times: ArrayLike) -> Floats:
    """The mechanism's motions, by Newton's equations."""
    return motions(motion_rates(scene.parameters), starts, times)


def errors(y: Floats, right: Floats) -> Floats:
    """Error of each trajectory (n,): worst component at the worst output time."""
    return np.asarray(np.abs(y - right).max(axis=(0, 2)))


def rest_starts(n: int, seed: int = 0) -> Floats:
    """At rest, angles anywhere."""
    angles = np.random.default_rng(seed).uniform(-np.pi, np.pi, (n, 2))
    return np.concatenate([angles, np.zeros((n, 2))], axis=1)
