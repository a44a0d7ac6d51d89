"""heyoka: adaptive Taylor series, eight trajectories in a vector, 512-bit where the processor has it."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.bench.entrant import Entrant, Prepare, Solve
from fastmech.bench.own_systems import spoken
from fastmech.bench.problem import Problem
from fastmech.ensembles.system import System
from fastmech.mechanism.coefficients import reduce

Floats = NDArray[np.float64]

#: The module that this file needs.
NEEDS = "heyoka"

TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10, 1e-12, 1e-14, 2.2e-16)


def equations(problem: Problem) -> list[Any]:
    """Those of a system, or Lagrange's over m2 l^2: the shortest decomposition of those tried."""
    import heyoka as hy

    if isinstance(problem.scene, System):
        rhs = spoken(problem.scene.rhs, sin=hy.sin, cos=hy.cos, inverse_cube=lambda s: s**-1.5)
        state = hy.make_vars(*problem.scene.state)
        return list(zip(state, rhs(hy.time, *state), strict=True))
    p = reduce(problem.scene)
    phi, theta, u, w = hy.make_vars("phi", "theta", "u", "w")
    s, c, s12, c12 = hy.sin(phi), hy.cos(phi), hy.sin(phi + theta), hy.cos(phi + theta)
    root = hy.sqrt(4.0 - s * s)
    q = c / root
    k, dk = s + s * q, c + (c * c - s * s + (s * q) ** 2.0) / root
    r1 = c12 * (p.spring - w * w) - p.lift * c - p.force * s
    r1 = r1 - k * u * (p.damping * k + p.slider * dk * u)
    r2 = c12 * (p.spring - u * u) - p.gravity * hy.sin(theta) - p.force * hy.cos(theta)
    phi_ddot = (r1 - s12 * r2) / (p.mass + c12 * c12 + p.slider * (k * k))
    return [(phi, u), (theta, w), (u, phi_ddot), (w, r2 - s12 * phi_ddot)]


def entrants(problem: Problem) -> Iterator[Entrant]:
    """Batches of the recommended size at all tolerances, every second one also on all cores."""
    for number, tolerance in enumerate(TOLERANCES):
        setting = f"tol = {tolerance:g}"
        yield Entrant("heyoka batch", setting, prepared(tolerance), threaded=number % 2 == 0)


def prepared(tolerance: float) -> Prepare:
    """One integrator for every thread; each takes its share of the batches."""

    def prepare(problem: Problem, threads: int) -> Solve:
        import heyoka as hy

        width = hy.recommended_simd_size()
        first = hy.taylor_adaptive_batch(
            equations(problem),
            np.zeros((problem.starts.shape[1], width)),
            tol=tolerance,
            high_accuracy=False,
            compact_mode=False,
            fast_math=True,
            force_avx512=True,
        )
        flows = [first, *(deepcopy(first) for _ in range(threads - 1))]
        stop = np.full(width, problem.t_end)

        def share(flow: Any, starts: Floats) -> Floats:
            final = np.empty_like(starts)
            for i in range(0, len(starts), width):
                flow.set_time(0.0)
                flow.state[:] = starts[i : i + width].T
                flow.propagate_until(stop)
                final[i : i + width] = flow.state.T
            return final

        if threads == 1:
            return lambda starts: share(first, starts)

        def solve(starts: Floats) -> Floats:
            parts = [np.ascontiguousarray(starts[k::threads]) for k in range(threads)]
            final = np.empty_like(starts)
            with ThreadPoolExecutor(threads) as pool:
                for k, part in enumerate(pool.map(share, flows, parts)):
                    final[k::threads] = part
            return final

        return solve

    return prepare
