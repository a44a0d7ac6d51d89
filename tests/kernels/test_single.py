"""Lanes of float32: their sine and cosine, what the compiler made of their kernels, their motions."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import llvmlite.binding as llvm
import mpmath
import numba
import numpy as np
import pytest
from ensembles.references import errors, rest_starts
from kernels.blocks_of_lanes import evaluate, kernel, lanes
from kernels.test_compiled_code import LIBRARY, basic_blocks
from numpy.typing import NDArray

import fastmech as fm
from fastmech import jit
from fastmech.ensembles.run import run_ensemble
from fastmech.errors import InputError
from fastmech.integrators.methods import METHODS
from fastmech.jit import FLAGS
from fastmech.kernels.blocks import in_single
from fastmech.kernels.sincos import REDUCTION_LIMIT, cos, sin, sincos
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.kernels.select import FORMULATIONS, right_hand_side

Singles = NDArray[np.float32]
SCENE = Scene(alpha=0.0)
TIMES = np.linspace(0.0, 5.0, 11)


@cache
def compiled() -> Any:
    """``sincos`` as kernels for float32 compile it, and ``sin`` and ``cos`` of right-hand sides."""

    @numba.njit(**FLAGS)
    def run(x: Singles, out: Singles) -> None:
        for i in range(x.size):
            out[0, i], out[1, i] = sincos(x[i])
            out[2, i], out[3, i] = sin(x[i]), cos(x[i])

    return run


def sines(x: Singles) -> Singles:
    out = np.empty((4, x.size), dtype=np.float32)
    compiled()(x, out)
    return out


@cache
def points() -> Singles:
    """100,000 ones, and the neighbours of every multiple of pi/2 up to 10,000."""
    random = np.random.default_rng(7)
    spread = np.concatenate([random.uniform(-1e4, 1e4, 60_000), random.uniform(-10.0, 10.0, 40_000)])
    near = (np.arange(-6366, 6367) * (np.pi / 2)).astype(np.float32)
    up, down = np.nextafter(near, np.float32(np.inf)), np.nextafter(near, np.float32(-np.inf))
    edge = np.array([1e4, -1e4, 0.0], dtype=np.float32)
    return np.concatenate([spread.astype(np.float32), near, up, down, edge])


def test_absolute_error_up_to_10_000() -> None:
    """Twice what rounding to float32 costs below 1; NumPy's float64 functions are exact beside it."""
    x = points()
    s, c, sine, cosine = sines(x)
    assert np.abs(s - np.sin(x.astype(np.float64))).max() <= 1.3e-7
    assert np.abs(c - np.cos(x.astype(np.float64))).max() <= 1.3e-7
    np.testing.assert_array_equal(sine, s)
    np.testing.assert_array_equal(cosine, c)


needs_fma = pytest.mark.skipif(
    not llvm.get_host_cpu_features().get("fma", False),
    reason="no packed fused instructions on this processor",
)


@needs_fma
def test_absolute_error_up_to_the_limit() -> None:
    """The same for a million angles, and beside every multiple of pi/2."""
    spread = np.random.default_rng(8).uniform(-REDUCTION_LIMIT, REDUCTION_LIMIT, 10**6)
    near = np.arange(int(REDUCTION_LIMIT / (np.pi / 2))) * (np.pi / 2)
    x = np.concatenate([spread, near, [REDUCTION_LIMIT]]).astype(np.float32)
    s, c, sine, cosine = sines(x)
    assert np.abs(s - np.sin(x.astype(np.float64))).max() <= 1.3e-7
    assert np.abs(c - np.cos(x.astype(np.float64))).max() <= 1.3e-7
    np.testing.assert_array_equal([sine, cosine], [s, c])


def test_relative_error_beside_zeros() -> None:
    """1e-4 of the value: the rest of pi/2 is rounded after its first 43 bits, and is taken 6,366 times."""
    x = points()[100_000:]
    s, c, *_ = sines(x)
    right = np.sin(x.astype(np.float64)), np.cos(x.astype(np.float64))
    for mine, exact in zip((s, c), right, strict=True):
        small = (np.abs(exact) < 1e-3) & (exact != 0.0)
        assert np.abs(mine[small] / exact[small] - 1.0).max() <= 1e-4


def test_some_of_them_against_mpmath() -> None:
    x = points()[::60]
    s, c, *_ = sines(x)
    with mpmath.workdps(30):
        right = np.array([[float(mpmath.sin(v)), float(mpmath.cos(v))] for v in x.tolist()]).T
    assert np.abs([s, c] - right).max() <= 1.3e-7


def test_beyond_the_limit_and_not_finite() -> None:
    """Whatever the size of an angle; to a rounding of float32."""
    limit = np.float32(REDUCTION_LIMIT)
    x = np.array([np.nextafter(limit, np.float32(np.inf)), -3e6, 1e10, -1e22, 3e38], dtype=np.float32)
    with mpmath.workdps(60):
        right = [[float(f(v)) for v in x.tolist()] for f in (mpmath.sin, mpmath.cos)]
    assert np.abs(sines(x)[2:] - right).max() <= 6e-8
    assert np.isnan(sines(np.array([np.nan, np.inf, -np.inf], dtype=np.float32))[2:]).all()


NAMES = ("free", "damped_constant", "damped_decaying")
KERNELS = {f"{formulation}-{terms}": (formulation, terms) for formulation in FORMULATIONS for terms in NAMES}
SCENES = {"free": Scene(beta=0.0, F0=0.0), "damped_constant": SCENE, "damped_decaying": Scene()}


@pytest.mark.parametrize("name", KERNELS)
def test_derivatives_are_those_of_float64(name: str) -> None:
    """To a share of the largest derivative; two lanes lie beyond the reduction's limit."""
    formulation, terms = KERNELS[name]
    Y = lanes(33).astype(np.float32)
    Y[0, 5], Y[1, 20] = 2e6, -5e7
    params = np.repeat(np.array(reduce(SCENES[terms]), dtype=np.float32)[:, None], 33, axis=1)
    dY = np.full(Y.shape, np.nan, dtype=np.float32)
    in_single(kernel(formulation, terms))(0.3, Y, dY, params)
    right = evaluate(kernel(formulation, terms), SCENES[terms], Y.astype(np.float64), t=0.3)
    assert dY.dtype == np.float32
    assert (np.abs(dY - right).max(axis=1) <= 1e-5 * np.abs(right).max(axis=1)).all()


@cache
def compiled_anew(formulation: str, terms: str) -> Any:
    return jit.compiled_anew(in_single(kernel(formulation, terms)))


def lane_loop(code: str) -> str:
    """Blocks that take packed square roots and floors."""
    calls = (r"= .*call .*@llvm\.floor\.v(?:4|8|16)f32", r"= .*call .*@llvm\.sqrt\.v(?:4|8|16)f32")
    return "\n".join(b for b in basic_blocks(code) if all(re.search(call, b) for call in calls))


@needs_fma
@pytest.mark.parametrize("name", ["lagrange-damped_constant", "hamilton-damped_decaying"])
def test_lanes_are_packed_float32(name: str) -> None:
    """No number of the loop over lanes is a double, none is converted, no library is called."""
    loop = lane_loop("".join(compiled_anew(*KERNELS[name]).inspect_llvm().values()))
    assert len(re.findall(r"= f(?:add|sub|mul|div) .*<(?:4|8|16) x float>", loop)) >= 40
    assert not re.search(r"\bdouble\b|fpext|fptrunc", loop)
    assert not LIBRARY.search(loop)


@cache
def magnification() -> NDArray[np.float64]:
    """How far a change of 1e-6 of any component of the start goes in 5 s, over 1e-6: by abm12 in float64."""
    starts, found = rest_starts(100), np.zeros(100)
    right = fm.integrate(SCENE, starts, t_eval=TIMES, dt=0.005, method="abm12").y
    for component in range(4):
        moved = fm.integrate(
            SCENE, starts + 1e-6 * np.eye(4)[component], t_eval=TIMES, dt=0.005, method="abm12"
        )
        found = np.maximum(found, errors(moved.y, right) / 1e-6)
    return found


@pytest.mark.parametrize("method", ["tsit5", "ab6"])
@pytest.mark.parametrize("formulation", ["lagrange", "hamilton"])
def test_motions_are_those_of_float64(method: str, formulation: str) -> None:
    """100 starts from rest, 5 s: 1e-4 rad and rad/s, or eight roundings (1e-6) that the motion magnifies.

    One passes a saddle's edge and magnifies every error 3,000 times, whatever the precision of the lanes.
    """
    starts = rest_starts(100)
    dt = {"tsit5": 0.01, "ab6": 0.005}[method]
    arguments: dict[str, Any] = {"dt": dt, "method": method, "formulation": formulation}
    double = fm.integrate(SCENE, starts, t_eval=TIMES, **arguments)
    single = fm.integrate(SCENE, starts, t_eval=TIMES, dtype="float32", **arguments)
    assert (double.precision, single.precision) == ("float64", "float32")
    assert single.y.dtype == np.float64
    assert not single.status.any()
    found = errors(single.y, double.y)
    assert found.max() > 0.0
    assert (found <= np.maximum(1e-6 * magnification(), 1e-4)).all()


@pytest.mark.parametrize("method", ["rk4", "ab6"])
def test_block_size_and_threads_do_not_matter(method: str) -> None:
    starts, params = rest_starts(300), np.array(reduce(SCENE))

    def states(block_lanes: int, threads: int) -> Any:
        return run_ensemble(
            right_hand_side(reduce(SCENE)),
            params,
            starts,
            [0.0, 0.3, 0.5],
            0.02,
            METHODS[method],
            threads=threads,
            block_lanes=block_lanes,
            precision=np.float32,
        ).states

    right = states(256, 1)
    np.testing.assert_array_equal(right, right.astype(np.float32))
    for block_lanes, threads in ((1, 1), (7, 2), (48, 1), (300, 2)):
        np.testing.assert_array_equal(states(block_lanes, threads), right)


def turning(t: float, x: float, v: float, w: float) -> tuple[float, float]:
    return v, -x - 0.2 * v + 0.3 * cos(w * t)


def test_a_time_makes_no_lane_double() -> None:
    """The loop over lanes has no double: the time is rounded before it."""
    code = "".join(
        jit.compiled_anew(in_single(fm.System(turning, ["x", "v"], {"w": 1.2}).kernel))
        .inspect_llvm()
        .values()
    )
    loop = "\n".join(b for b in basic_blocks(code) if re.search(r"@llvm\.floor\.v(?:4|8|16)f32", b))
    assert loop
    assert not re.search(r"\bdouble\b|fpext", loop)


def test_long_forced_motions_are_those_of_float64() -> None:
    """A driven oscillator after 20,000 rad of its force: rounding moves those by 6e-4 (t) and 8e-4 (w)."""
    system = fm.System(turning, ["x", "v"], {"w": 1.2})
    w, t = 1.2, 16_000.0
    run = fm.integrate(system, [[0.4, -0.2]], t, 0.05, dtype="float32")
    steady = 0.3 * np.exp(1j * w * t) / (1.0 - w * w + 0.2j * w)
    found = run.y[-1, 0] - [steady.real, (1j * w * steady).real]
    assert 0.0 < np.abs(found).max() <= 1e-3


def test_statuses_in_float32() -> None:
    starts = rest_starts(40)
    right = fm.integrate(SCENE, starts, 0.5, dtype="float32")
    starts[3, 0] = np.nan
    run, others = fm.integrate(SCENE, starts, 0.5, dtype="float32"), np.arange(40) != 3
    np.testing.assert_array_equal(run.y[:, others], right.y[:, others])
    np.testing.assert_array_equal(run.status == fm.Status.START_NOT_FINITE, ~others)


def falling(t: float, x: float) -> tuple[float]:
    return (-1.0,)


def below_zero(t: float, x: float) -> float:
    return 7.0 if x < 0.0 else 0.0


def test_a_system_in_float32() -> None:
    """x' = -1: exact in either precision where the steps are."""
    run = fm.integrate(fm.System(falling, ["x"], {}), [[1.0], [2.5]], 2.0, 0.125, dtype="float32")
    np.testing.assert_allclose(run.y[0, :, 0], [-1.0, 0.5], atol=1e-6)


def test_what_float32_cannot_do_is_refused() -> None:
    stopping = fm.System(falling, ["x"], {}, stop=below_zero)
    with pytest.raises(InputError, match=r"^dtype = 'float32': not with a stopping condition$"):
        fm.integrate(stopping, [1.0], 2.0, 0.1, dtype="float32")
    for method in ("gauss4", "radau5", "sdirk4"):
        message = f"^dtype = 'float32': not with the implicit method {method}$"
        with pytest.raises(InputError, match=message):
            fm.integrate(SCENE, rest_starts(1), 1.0, 0.1, method, dtype="float32")
    with pytest.raises(InputError, match=r"^dtype = 'float16': must be one of float64, float32$"):
        fm.integrate(SCENE, rest_starts(1), 1.0, 0.1, dtype="float16")
