"""PyTorch: a Runge-Kutta step written by hand over 8,192 lanes, under ``torch.compile``."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from fastmech.bench.entrant import Entrant, Prepare, Solve
from fastmech.bench.problem import Problem
from fastmech.integrators.tableaus import TABLEAUS
from fastmech.mechanism.coefficients import Coefficients, reduce

#: The module that this file needs.
NEEDS = "torch"

LANES = 8192

STEPS = {
    "rk4": (0.05, 0.02),
    "tsit5": (0.12, 0.08, 0.05, 0.03),
    "dop853": (0.12, 0.08, 0.05, 0.03, 0.018),
}


def entrants(problem: Problem) -> Iterator[Entrant]:
    """Every method at its steps."""
    for method, steps in STEPS.items():
        for dt in steps:
            h = dt * problem.pace
            yield Entrant(f"torch.compile {method}", f"dt = {h:g} s", prepared(method, h), least=LANES)


def runge_kutta(method: str, h: Any, rates: Any) -> Any:
    """One step of a method on a tuple of arrays, every stage typed out when it is traced."""
    tableau = TABLEAUS[method]

    def step(y: tuple[Any, ...]) -> tuple[Any, ...]:
        stages: list[Any] = []
        for row in [*tableau.a, tableau.b]:
            z = y
            if stages:
                weights = [(h * float(a), k) for a, k in zip(row, stages, strict=True) if a]
                z = tuple(x + sum(a * k[i] for a, k in weights) for i, x in enumerate(y))
            if len(stages) < tableau.stages:
                stages.append(rates(z))
        return z

    return step


@cache
def compiled(method: str, p: Coefficients) -> Any:
    """A step ``(phi, theta, u, w, h)`` as machine code, compiled once for all steps."""
    import torch

    def rates(y: tuple[Any, ...]) -> tuple[Any, ...]:
        phi, theta, u, w = y
        s1, c1, s12, c12 = torch.sin(phi), torch.cos(phi), torch.sin(phi + theta), torch.cos(phi + theta)
        inverse = 1.0 / torch.sqrt(4.0 - s1 * s1)
        q = c1 * inverse
        k = s1 + s1 * q
        dk = c1 + q * c1 - s1 * s1 * (1.0 - q * q) * inverse
        r1 = c12 * (p.spring - w * w) - p.lift * c1 - p.force * s1
        r1 = r1 - k * u * (p.damping * k + p.slider * dk * u)
        r2 = c12 * (p.spring - u * u) - p.gravity * torch.sin(theta) - p.force * torch.cos(theta)
        phi_ddot = (r1 - s12 * r2) / (p.mass + c12 * c12 + p.slider * k * k)
        return u, w, phi_ddot, r2 - s12 * phi_ddot

    def step(phi: Any, theta: Any, u: Any, w: Any, h: Any) -> tuple[Any, ...]:
        return tuple(runge_kutta(method, h, rates)((phi, theta, u, w)))

    return torch.compile(step, dynamic=False, fullgraph=True)


def prepared(method: str, h: float) -> Prepare:
    """The loop over steps."""

    def prepare(problem: Problem, threads: int) -> Solve:
        import torch

        torch.set_num_threads(threads)
        step, steps = compiled(method, reduce(problem.scene)), round(problem.t_end / h)
        length = torch.tensor(problem.t_end / steps, dtype=torch.float64)

        def solve(starts: Any) -> Any:
            with torch.no_grad():
                y = tuple(torch.from_numpy(np.ascontiguousarray(column)) for column in starts.T)
                for _ in range(steps):
                    y = step(*y, length)
                return torch.stack(y, dim=1).numpy()

        return solve

    return prepare
