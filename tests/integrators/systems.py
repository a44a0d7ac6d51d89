"""Problems with known solutions; the linear one is also the example of a user's own system."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.run import run_ensemble
from fastmech.integrators.methods import METHODS
from fastmech.jit import RHS_SIGNATURE, kernel
from fastmech.scene import Scene

Floats = NDArray[np.float64]

DATA = Path(__file__).parents[2] / "data"


@kernel(RHS_SIGNATURE)
def forced_linear(t: float, Y: Floats, dY: Floats, p: Floats) -> None:
    """y' = A (y - u(t)) + u'(t) with A = [[p0, p1], [-p1, p2]] and u(t) = (sin 2t, exp(-t/2))."""
    u0, u1 = math.sin(2.0 * t), math.exp(-0.5 * t)
    v0, v1 = 2.0 * math.cos(2.0 * t), -0.5 * u1
    for i in range(Y.shape[1]):
        x0, x1 = Y[0, i] - u0, Y[1, i] - u1
        dY[0, i] = p[0, i] * x0 + p[1, i] * x1 + v0
        dY[1, i] = -p[1, i] * x0 + p[2, i] * x1 + v1


@kernel(RHS_SIGNATURE)
def driven(t: float, Y: Floats, dY: Floats, p: Floats) -> None:
    """y' = p0 (y - sin(p1 t)) + p1 cos(p1 t)."""
    for i in range(Y.shape[1]):
        dY[0, i] = p[0, i] * (Y[0, i] - math.sin(p[1, i] * t)) + p[1, i] * math.cos(p[1, i] * t)


@dataclass(frozen=True)
class Linear:
    """Exact: y(t) = u(t) + exp(A (t - t0)) (y(t0) - u(t0))."""

    params: Floats
    t0: float
    starts: Floats

    def exact(self, t: float) -> Floats:
        a, b, c = self.params
        with mpmath.workdps(30):  # SciPy's expm leaves 3e-14 here
            flow = mpmath.expm((mpmath.mpf(t) - self.t0) * mpmath.matrix([[a, b], [-b, c]]))
        flow = np.array(flow.tolist(), dtype=np.float64)
        return np.asarray(self.forced(t) + (self.starts - self.forced(self.t0)) @ flow.T)

    @staticmethod
    def forced(t: float) -> Floats:
        return np.array([np.sin(2 * t), np.exp(-t / 2)])

    def run(self, times: Floats, dt: float, method: str, **options: Any) -> Floats:
        run = run_ensemble(forced_linear, self.params, self.starts, times, dt, METHODS[method], **options)
        assert not run.status.any()
        return run.states


LINEAR = Linear(np.array([-0.3, 5.0, -0.5]), 0.5, np.random.default_rng(3).uniform(-2, 2, (11, 2)))


@cache
def paper_motion() -> tuple[Scene, Floats, Floats, Floats]:
    """Scene, start, times and states of the paper's motion to 25 digits (see data/README.md)."""
    data = tomllib.loads((DATA / "paper_motion.toml").read_text(encoding="utf-8"))
    names = ("phi", "theta", "phi_dot", "theta_dot")
    times = np.array([state["t"] for state in data["state"]])
    states = np.array([[float(state[name]) for name in names] for state in data["state"]])
    return Scene(**data["parameters"]), np.array([data["start"][name] for name in names]), times, states


def linear_error(method: str, steps: int) -> float:
    """Largest error over lanes after four seconds in so many equal steps."""
    y = LINEAR.run(np.array([0.5, 4.5]), 4.0 / steps, method)
    return float(np.abs(y[0] - LINEAR.exact(4.5)).max())


def mechanism_error(method: str, steps: int) -> float:
    """Largest error over the states after 1, 2 and 5 s of the paper's motion, so many steps a second."""
    scene, start, times, states = paper_motion()
    run = integrate(scene, start, dt=1.0 / steps, method=method, t_eval=times[:3])
    assert run.steps == 5 * steps
    return float(np.abs(run.y[:, 0] - states[:3]).max())


def driven_error(method: str, steps: int) -> float:
    """Error after two seconds of a slow system that a fast force drives: large errors at stable steps."""
    rate, frequency, start, t = -0.5, 100.0, 0.5, 2.0
    times, params = np.array([0.0, t]), np.array([rate, frequency])
    run = run_ensemble(driven, params, np.array([[start]]), times, t / steps, METHODS[method])
    exact = math.sin(frequency * t) + start * math.exp(rate * t)
    return abs(float(run.states[-1, 0, 0]) - exact)
