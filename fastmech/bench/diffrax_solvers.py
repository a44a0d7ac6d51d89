"""diffrax: solvers for JAX under ``vmap``, compiled by XLA for each setting.

XLA's pool is held to one thread so that rates are those of one core; its flags must stand before JAX is
imported, so a process that has imported it already keeps its own.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np

from fastmech.bench.entrant import Entrant, Prepare, Solve
from fastmech.bench.problem import Problem
from fastmech.mechanism.coefficients import reduce

#: The module that this file needs.
NEEDS = "diffrax"

#: Solver, whether its step adapts, and its tolerances or steps. Every setting compiles for some seconds.
#: A step written by hand under ``fori_loop`` was no faster than these.
RUNS: tuple[tuple[str, bool, tuple[float, ...]], ...] = (
    ("Tsit5", False, (0.1, 0.05, 0.02)),
    ("Dopri8", True, (1e-6, 1e-9, 1e-12)),
)


def entrants(problem: Problem) -> Iterator[Entrant]:
    """Every solver at its settings."""
    for solver, adapts, values in RUNS:
        for value in values:
            x = value if adapts else value * problem.pace
            setting = f"rtol = {x:g}" if adapts else f"dt = {x:g} s"
            how = "adaptive" if adapts else "constant step"
            yield Entrant(f"diffrax {solver}, {how}", setting, prepared(solver, adapts, x), most=1024)


def _jax() -> Any:
    one = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    if one not in os.environ.get("XLA_FLAGS", ""):
        os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {one}".strip()
    import jax

    jax.config.update("jax_enable_x64", True)
    return jax


def _rates(jnp: Any, p: Any, phi: Any, theta: Any, u: Any, w: Any) -> tuple[Any, Any, Any, Any]:
    """Derivatives of a state, or of lanes."""
    s1, c1, s12, c12 = jnp.sin(phi), jnp.cos(phi), jnp.sin(phi + theta), jnp.cos(phi + theta)
    q = c1 / jnp.sqrt(4.0 - s1 * s1)
    k = s1 + s1 * q
    dk = c1 + q * c1 - s1 * s1 * (1.0 - q * q) / jnp.sqrt(4.0 - s1 * s1)
    r1 = c12 * (p.spring - w * w) - p.lift * c1 - p.force * s1 - k * u * (p.damping * k + p.slider * dk * u)
    r2 = c12 * (p.spring - u * u) - p.gravity * jnp.sin(theta) - p.force * jnp.cos(theta)
    phi_ddot = (r1 - s12 * r2) / (p.mass + c12 * c12 + p.slider * k * k)
    return u, w, phi_ddot, r2 - s12 * phi_ddot


def prepared(solver: str, adapts: bool, value: float) -> Prepare:
    """``diffeqsolve`` over all trajectories at once."""

    def prepare(problem: Problem, threads: int) -> Solve:
        jax = _jax()
        import diffrax

        p, end = reduce(problem.scene), problem.t_end
        term = diffrax.ODETerm(lambda t, y, args: jax.numpy.stack(_rates(jax.numpy, p, *y)))
        if adapts:
            controller: Any = diffrax.PIDController(rtol=value, atol=0.1 * value)
            first, most = None, 1_000_000
        else:
            controller = diffrax.ConstantStepSize()
            first, most = end / round(end / value), round(end / value) + 1

        def one(y: Any) -> Any:
            return diffrax.diffeqsolve(
                term, getattr(diffrax, solver)(), 0.0, end, first, y, stepsize_controller=controller,
                saveat=diffrax.SaveAt(t1=True), max_steps=most,
                adjoint=diffrax.ForwardMode(),
            ).ys[-1]  # fmt: skip

        all_of_them = jax.jit(jax.vmap(one))
        return lambda starts: np.asarray(all_of_them(starts))

    return prepare
