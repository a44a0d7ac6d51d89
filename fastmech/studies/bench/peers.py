"""Who takes part beside the package, each by a function that prepares one of its solvers at one setting.

To add a library, write such a function, which imports it, and name it in ``entrants.toml``. All are given the
mechanism as a user without the package would type it, with their own sines, cosines and roots. SciPy and
pynamicalsys go one trajectory at a time, numbalsoda in one Numba loop over the trajectories,
heyoka in batches of one vector, diffrax (``vmap``) and PyTorch (``torch.compile``) on all trajectories at
once.
"""

from __future__ import annotations

import os
from functools import cache
from math import cos, sin, sqrt
from typing import Any

import numpy as np
import sympy
from numba import carray, cfunc, njit, types  # type: ignore[attr-defined]

from fastmech.arrays import Floats
from fastmech.ensembles.system import System
from fastmech.integrators.tableaus import TABLEAUS
from fastmech.jit import FLAGS
from fastmech.kernels.sincos import sincos
from fastmech.models.mechanism import Mechanism
from fastmech.scene import Scene
from fastmech.slider.coefficients import Coefficients, reduce
from fastmech.slider.reduced import lagrange_accelerations
from fastmech.studies.bench.devices import explicit
from fastmech.studies.bench.measure import BenchProblem, Solve
from fastmech.studies.bench.own_systems import spoken

_COUNT = len(Coefficients._fields)
_POINTER = types.CPointer(types.float64)  # type: ignore[no-untyped-call]


def lagrange(phi: Any, theta: Any, u: Any, w: Any, p: Any) -> tuple[Any, Any]:
    """(phi'', theta'') as a user would type them; ``p`` are the reduced coefficients."""
    s1, c1, s12, c12 = sin(phi), cos(phi), sin(phi + theta), cos(phi + theta)
    inverse = 1.0 / sqrt(4.0 - s1 * s1)
    t = s1 * c1 * inverse
    k, dk = s1 + t, c1 + (c1 * c1 - s1 * s1 + t * t) * inverse
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


def plain(h: float, problem: BenchProblem) -> Solve:
    """Plain Numba's RK4 at a fixed step."""
    p, steps = np.array(problem.coefficients), round(problem.t_end / h)
    return lambda starts: in_scalars(starts, p, problem.t_end / steps, steps)


#: Lanes of a block: all of it is in the first cache at any width, so the engine's widest serves both methods.
LANES = 256

_HEAD = """
def integrate(starts, final, width, h, given):
    steps, (mass, slider, lift, spring, gravity, force, damping, _) = given
    Y = np.empty((4, width))
    for first in range(0, len(starts), width):
        lanes = min(width, len(starts) - first)
        Y[:, :lanes] = starts[first : first + lanes].T
        for _ in range(steps):
            for i in range(lanes):
                a0, b0, u0, w0 = Y[0, i], Y[1, i], Y[2, i], Y[3, i]
"""
_STAGE = """
                s1, c1 = sincos(a{s})
                s2, c2 = sincos(b{s})
                f{s}, g{s} = lagrange_accelerations(
                    (s1, c1, s2, c2), (u{s}, w{s}), (mass, slider, lift, spring, gravity), force, damping
                )
"""
_TAIL = """
                Y[0, i], Y[1, i], Y[2, i], Y[3, i] = a{s}, b{s}, u{s}, w{s}
        final[first : first + lanes] = Y[:, :lanes].T
"""


@cache
def compiled(method: str) -> Any:
    """The loop of a method as machine code."""
    tableau, text = TABLEAUS[method], _HEAD + _STAGE.format(s=0)
    for s, row in enumerate([*tableau.a[1:], tableau.b], start=1):
        for state, rate in (("a", "u"), ("b", "w"), ("u", "f"), ("w", "g")):
            terms = " + ".join(f"{float(x)!r} * {rate}{j}" for j, x in enumerate(row) if x)
            text += f"                {state}{s} = {state}0 + h * ({terms})\n"
        text += (_STAGE if s < tableau.stages else _TAIL).format(s=s)
    names = {"np": np, "sincos": sincos, "lagrange_accelerations": lagrange_accelerations}
    exec(compile(text, f"<fused {method}>", "exec"), names)
    return njit(nogil=True, **FLAGS)(names["integrate"])


def fused(method: str, h: float, problem: BenchProblem) -> Solve:
    """The engine's yardstick: one loop in blocks of lanes for this mechanism and one method.

    Nothing is general here: parameters are numbers, the tableau's entries are literals, a step's stages are
    local numbers. The source is generated from the tableau and uses the package's own trigonometry and
    accelerations, so what is left to compare is the engine around them.
    """
    kernel, p = compiled(method), problem.coefficients
    steps = int(np.ceil(problem.t_end / h - 1e-9))

    def solve(starts: Floats) -> Floats:
        final = np.empty_like(starts)
        kernel(starts, final, LANES, problem.t_end / steps, (steps, p))
        return final

    return solve


def scipy(method: str, tolerance: float, problem: BenchProblem, atol: float | None = None) -> Solve:
    """One ``solve_ivp`` after the other, with the compiled right-hand side; ``atol``: a tenth by default."""
    from scipy.integrate import solve_ivp

    p, span = np.array(problem.coefficients), (0.0, problem.t_end)
    options = {"method": method, "args": (p,), "rtol": tolerance, "atol": atol or 0.1 * tolerance}
    return lambda starts: np.array(
        [solve_ivp(scalar_rhs, span, y0, t_eval=span[1:], **options).y[:, -1] for y0 in starts]
    )


def pynamicalsys(h: float, problem: BenchProblem) -> Solve:
    """RK4, a trajectory a call."""
    from pynamicalsys import ContinuousDynamicalSystem

    p = np.array(problem.coefficients)
    step = problem.t_end / round(problem.t_end / h)
    system = ContinuousDynamicalSystem(
        equations_of_motion=scalar_rhs, system_dimension=4, parameters=p, number_of_parameters=p.size
    )
    system.integrator("rk4", time_step=step)
    end = problem.t_end - step  # it adds a step to the time that it is given
    return lambda starts: np.array([system.evolve_system(y0, end) for y0 in starts])


@cache
def _numbalsoda(method: str) -> Any:
    """A solver's loop and the right-hand side."""
    import numbalsoda

    solver = getattr(numbalsoda, method)

    @cfunc(types.void(types.float64, _POINTER, _POINTER, _POINTER), **FLAGS)
    def rhs(t, y, dy, data):  # type: ignore[no-untyped-def]
        dy[0], dy[1] = y[2], y[3]
        dy[2], dy[3] = accelerations(y[0], y[1], y[2], y[3], carray(data, (_COUNT,)))

    @njit(nogil=True, **FLAGS)
    def loop(address, starts, times, p, tolerance):  # type: ignore[no-untyped-def]
        final = np.empty_like(starts)
        for i in range(len(starts)):
            found, _ = solver(address, starts[i], times, p, tolerance, atol=0.1 * tolerance, mxstep=1000000)
            final[i] = found[-1]
        return final

    return loop, rhs


def numbalsoda(method: str, tolerance: float, problem: BenchProblem) -> Solve:
    """LSODA or DOP853."""
    loop, rhs = _numbalsoda(method)
    p, times = np.array(problem.coefficients), np.array([0.0, problem.t_end])
    return lambda starts: loop(rhs.address, starts, times, p, tolerance)


def _rates(library: Any, p: Coefficients, y: Any) -> tuple[Any, Any, Any, Any]:
    """Derivatives of a state by the sines, cosines and roots of a library."""
    phi, theta, u, w = y
    own = spoken(lagrange, sin=library.sin, cos=library.cos, sqrt=library.sqrt)
    return u, w, *own(phi, theta, u, w, p)


def diffrax(solver: str, adapts: bool, value: float, problem: BenchProblem) -> Solve:
    """``diffeqsolve`` for JAX; every setting compiles for some seconds.

    XLA's pool is held to one thread so that rates are those of one core; its flags must stand before JAX is
    imported, so a process that has imported it already keeps its own. A step written by hand under
    ``fori_loop`` was no faster.
    """
    one = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    if one not in os.environ.get("XLA_FLAGS", ""):
        os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {one}".strip()
    import jax

    jax.config.update("jax_enable_x64", True)
    import diffrax

    p, end = problem.coefficients, problem.t_end
    term = diffrax.ODETerm(lambda t, y, args: jax.numpy.stack(_rates(jax.numpy, p, y)))
    steps = round(end / value)
    chosen: Any = (diffrax.ConstantStepSize(), end / steps, steps + 1)
    if adapts:
        chosen = (diffrax.PIDController(rtol=value, atol=0.1 * value), None, 1_000_000)
    controller, first, most = chosen

    def one_start(y: Any) -> Any:
        return diffrax.diffeqsolve(
            term, getattr(diffrax, solver)(), 0.0, end, first, y0=y, stepsize_controller=controller,
            saveat=diffrax.SaveAt(t1=True), max_steps=most, adjoint=diffrax.ForwardMode(),
        ).ys[-1]  # fmt: skip

    all_of_them = jax.jit(jax.vmap(one_start))
    return lambda starts: np.asarray(all_of_them(starts))


@cache
def _torch(method: str, p: Coefficients) -> Any:
    """A step ``(phi, theta, u, w, h)`` compiled once for all steps, every stage typed out."""
    import torch

    tableau = TABLEAUS[method]

    def step(phi: Any, theta: Any, u: Any, w: Any, h: Any) -> tuple[Any, ...]:
        y: tuple[Any, ...] = (phi, theta, u, w)
        z, stages = y, list[Any]()
        for row in [*tableau.a[1:], tableau.b]:
            stages.append(_rates(torch, p, z))
            weights = [(h * float(a), k) for a, k in zip(row, stages, strict=True) if a]
            z = tuple(x + sum(a * k[i] for a, k in weights) for i, x in enumerate(y))
        return z

    return torch.compile(step, dynamic=False, fullgraph=True)


def torch(method: str, h: float, problem: BenchProblem) -> Solve:
    """A Runge-Kutta step written by hand over 8,192 lanes."""
    import torch

    torch.set_num_threads(1)
    step, steps = _torch(method, problem.coefficients), round(problem.t_end / h)
    length = torch.tensor(problem.t_end / steps, dtype=torch.float64)

    def solve(starts: Floats) -> Floats:
        with torch.no_grad():
            y = tuple(torch.from_numpy(np.ascontiguousarray(column)) for column in starts.T)
            for _ in range(steps):
                y = step(*y, length)
            return np.asarray(torch.stack(y, dim=1).numpy())

    return solve


def heyoka_equations(scene: Scene | System | Mechanism) -> list[Any]:
    """Of a scene Lagrange's over m2 l^2, the shortest decomposition of those tried; of others their own."""
    import heyoka as hy

    if isinstance(scene, System):
        rhs = spoken(scene.rhs, sin=hy.sin, cos=hy.cos, inverse_cube=lambda s: s**-1.5)
        state = hy.make_vars(*scene.state)
        return list(zip(state, rhs(hy.time, *state), strict=True))
    if isinstance(scene, Mechanism):
        state, rates = explicit(scene)
        known = {symbol: hy.make_vars(symbol.name) for symbol in state}
        return [(known[s], hy.from_sympy(sympy.sympify(r), known)) for s, r in zip(state, rates, strict=True)]
    state = hy.make_vars("phi", "theta", "u", "w")
    return list(zip(state, _rates(hy, reduce(scene), state), strict=True))


def heyoka(tolerance: float, problem: BenchProblem) -> Solve:
    """Adaptive Taylor series, 512-bit where the processor has it."""
    import heyoka as hy

    width = hy.recommended_simd_size()
    flow = hy.taylor_adaptive_batch(
        heyoka_equations(problem.scene),
        np.zeros((problem.starts.shape[1], width)),
        tol=tolerance,
        high_accuracy=False,
        compact_mode=False,
        fast_math=True,
        force_avx512=True,
    )
    stop = np.full(width, problem.t_end)

    def solve(starts: Floats) -> Floats:
        final = np.empty_like(starts)
        for i in range(0, len(starts), width):
            flow.set_time(0.0)
            flow.state[:] = starts[i : i + width].T
            flow.propagate_until(stop)
            final[i : i + width] = flow.state.T
        return final

    return solve
