"""Sine and cosine in systems of one's own: right at any size, packed, no lane the neighbour of another."""

from __future__ import annotations

import re
from typing import Any

import llvmlite.binding as llvm
import mpmath
import numba
import numpy as np
import pytest
from kernels.test_compiled_code import LIBRARY, PACKED, PACKED_QUADRANT, VECTOR_ARITHMETIC, basic_blocks
from numpy.typing import NDArray

import fastmech as fm
from fastmech.jit import compiled_anew
from fastmech.kernels.blocks import in_single
from fastmech.kernels.sincos import REDUCTION_LIMIT, cos, sin

Floats = NDArray[np.float64]

pytestmark = pytest.mark.skipif(
    numba.config.DISABLE_JIT, reason="how the compiled loop over lanes deals with angles beyond its range"
)

EDGE = [REDUCTION_LIMIT, np.nextafter(REDUCTION_LIMIT, np.inf)]
FAR = np.array([*EDGE, 1.5e6, -3.3e6, 1e9, 6381956970095103 * 2.0**797, -1e15, 1e22, -1e300])


@numba.njit
def sine_of_twice(x: float) -> Any:
    return fm.sin(2.0 * x)


def pair(t: float, x: float, y: float, k: float) -> tuple[float, float]:
    return fm.sin(k * x), cos(x + 0.0 * y)


def chosen(t: float, x: float, y: float, k: float) -> tuple[float, float]:
    """A comparison would swallow a NaN."""
    return (1.0 if sin(k * x) > 0.0 else -1.0), fm.cos(x)


def through_another(t: float, x: float, y: float, k: float) -> tuple[float, float]:
    return sine_of_twice(0.5 * k * x), fm.cos(x)


def with_a_nested_one(t: float, x: float, y: float, k: float) -> tuple[float, float]:
    def inner(z: float) -> Any:
        return sin(z)

    return inner(k * x), fm.cos(x)


FUNCTIONS = {f.__name__: f for f in (pair, chosen, through_another, with_a_nested_one)}
EVERY = pytest.mark.parametrize("name", FUNCTIONS)


def kernel(name: str) -> Any:
    return fm.System(FUNCTIONS[name], ["x", "y"], {"k": 1.0}).kernel


def rates(rhs: Any, x: Any, precision: Any = np.float64) -> Any:
    Y = np.array([x, np.zeros(len(x))], dtype=precision)
    dY = np.full(Y.shape, 7.0, dtype=precision)
    rhs(0.0, Y, dY, np.ones((1, len(x)), dtype=precision))
    return dY


def right(x: Any) -> Floats:
    """Sine and cosine by mpmath."""
    with mpmath.workdps(360):
        return np.array([[float(f(v)) for v in x.tolist()] for f in (mpmath.sin, mpmath.cos)])


@EVERY
def test_any_finite_angle(name: str) -> None:
    """2.3e-16 within the packed range, and beyond it the C library's accuracy."""
    expected = right(FAR)
    if name == "chosen":
        expected[0] = np.sign(expected[0])
    np.testing.assert_allclose(rates(kernel(name), FAR), expected, rtol=0, atol=2.3e-16)


@EVERY
def test_any_finite_angle_in_float32(name: str) -> None:
    x = np.array([1e4, 1.00001e4, -3e4, 1e10, -1e22, 3e38], dtype=np.float32)
    expected = right(x)
    if name == "chosen":
        expected[0] = np.sign(expected[0])
    found = rates(in_single(kernel(name)), x, np.float32)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1.3e-7)


@EVERY
@pytest.mark.parametrize("far", [EDGE[1], 1e22, np.nan, np.inf])
def test_a_lane_beyond_leaves_the_others_as_they_are(name: str, far: float) -> None:
    """Bit for bit, in the vectors and in what is left of the loop; and it is what it is alone."""
    x, rhs = np.random.default_rng(3).uniform(-1e5, 1e5, 37), kernel(name)
    alone = rates(rhs, x)
    for lane in (0, 9, 36):
        disturbed = x.copy()
        disturbed[lane] = far
        found, others = rates(rhs, disturbed), np.arange(37) != lane
        np.testing.assert_array_equal(found[:, others], alone[:, others])
        np.testing.assert_array_equal(found[:, [lane]], rates(rhs, np.array([far])))
        assert np.isnan(found[1, lane]) == (not np.isfinite(far))


@pytest.mark.skipif(not llvm.get_host_cpu_features().get("fma", False), reason="no packed fused instructions")
@EVERY
def test_the_loop_over_lanes_is_packed(name: str) -> None:
    shipped = kernel(name)
    anew = compiled_anew(shipped)
    blocks = basic_blocks("".join(anew.inspect_llvm().values()))
    loops = [block for block in blocks if PACKED_QUADRANT.search(block)]
    assert len(VECTOR_ARITHMETIC.findall(loops[0])) >= 40  # the later ones do lanes again
    assert not LIBRARY.search(loops[0])
    machine = basic_blocks("".join(anew.inspect_asm().values()))
    machine = [b for b in machine if re.search(r"\bvpsllq\s.*%[yz]mm", b) and not re.search(r"\bcall", b)]
    assert max(len(PACKED.findall(b)) for b in machine) >= 30


def turning(t: float, x: float, rate: float) -> tuple[float]:
    return (rate * (1.0 + 0.0 * fm.sin(x)),)


def crest(t: float, x: float) -> Any:
    return fm.sin(x) > 0.99


def test_a_run_through_the_limit_goes_on() -> None:
    """x grows from below the limit to beyond it and stops where its sine says so; True is code 1."""
    system = fm.System(turning, ["x"], {"rate": 1.0}, stop=crest)
    starts = REDUCTION_LIMIT - np.array([[0.3], [5.0], [400.0]])
    run = fm.integrate(system, starts, 8.0, 2.0**-7)
    assert run.stop_code is not None
    assert run.stop_code.tolist() == [1, 1, 1]
    crossing = np.mod(np.arcsin(0.99) - starts[:, 0], 2.0 * np.pi)
    assert run.stop_time is not None
    assert (np.abs(run.stop_time - crossing) <= 2.0**-7 + 1e-6).all()
