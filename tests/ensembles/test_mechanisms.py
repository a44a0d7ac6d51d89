"""Trajectories of mechanisms: the engine runs what the derivation gives."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import fastmech as fm
from fastmech.ensembles.work_precision import operations_of
from fastmech.models.motion import system_of

STARTS = np.random.default_rng(2).uniform(-1.5, 1.5, (40, 4))


def pendulums(t: float, y: np.ndarray) -> list[float]:
    """The double pendulum's rates with unit lengths, masses 2 and 1, g = 9.81: the textbook's formulas."""
    a, b, u, v = y
    m1, m2, g, d = 2.0, 1.0, 9.81, a - b
    below = 2.0 * m1 + m2 - m2 * np.cos(2.0 * a - 2.0 * b)
    up = (
        -g * (2.0 * m1 + m2) * np.sin(a) - m2 * g * np.sin(a - 2.0 * b)
        - 2.0 * np.sin(d) * m2 * (v * v + u * u * np.cos(d))
    )  # fmt: skip
    low = 2.0 * np.sin(d) * (u * u * (m1 + m2) + g * (m1 + m2) * np.cos(a) + v * v * m2 * np.cos(d))
    return [u, v, up / below, low / below]


@pytest.mark.parametrize("formulation", ["lagrange", "hamilton"])
def test_the_double_pendulum_moves_as_scipy_tells(formulation: str) -> None:
    mechanism = fm.mechanisms.double_pendulum().replace(m1=2.0)
    found = fm.integrate(mechanism, STARTS, 2.0, dt=0.005, method="dop853", formulation=formulation)
    assert found.names == ("upper", "lower", "upper_dot", "lower_dot")
    for start, end in zip(STARTS, found.y[-1], strict=True):
        wanted = solve_ivp(pendulums, (0.0, 2.0), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        np.testing.assert_allclose(end, wanted, atol=2e-8)


@pytest.mark.parametrize("method", ["rk4", "abm8"])
def test_the_paper_s_mechanism_gives_the_scene_s_trajectories(method: str) -> None:
    times = [0.5, 1.0, 2.0]
    for formulation in ("lagrange", "hamilton"):
        ours, theirs = (
            fm.integrate(model, STARTS, dt=0.01, method=method, t_eval=times, formulation=formulation)
            for model in (fm.mechanisms.slider_pendulum(), fm.Scene())
        )
        np.testing.assert_allclose(ours.y, theirs.y, atol=1e-10)


@pytest.mark.parametrize("n", [1, 2, 4])
@pytest.mark.parametrize("formulation", ["lagrange", "hamilton"])
@pytest.mark.slow
def test_undamped_chains_keep_their_energy(n: int, formulation: str) -> None:
    chain = fm.mechanisms.pendulum_chain(n).replace(F=0.0)
    starts = np.random.default_rng(n).uniform(-2.0, 2.0, (20, 2 * n))
    end = fm.integrate(chain, starts, 1.0, dt=0.001, method="dop853", formulation=formulation).y[-1]
    before, after = (sum(chain.energies(y)) for y in (starts, end))
    np.testing.assert_allclose(after, before, rtol=1e-11, atol=1e-10)


def test_parameters_may_differ_between_trajectories() -> None:
    mechanism = fm.mechanisms.slider_pendulum()
    own = {"m2": np.linspace(5.0, 20.0, len(STARTS)), "F0": np.linspace(-100.0, 100.0, len(STARTS))}
    for formulation in ("lagrange", "hamilton"):
        found = fm.integrate(mechanism, STARTS, 1.0, dt=0.01, parameters=own, formulation=formulation)
        for k in (0, 17, 39):
            alone = mechanism.replace(**{name: float(values[k]) for name, values in own.items()})
            end = fm.integrate(alone, STARTS[k : k + 1], 1.0, dt=0.01, formulation=formulation).y[-1, 0]
            np.testing.assert_allclose(found.y[-1, k], end, rtol=1e-12, atol=1e-12)
    with pytest.raises(fm.InputError, match="kinetic: is not positive definite"):
        fm.integrate(mechanism, STARTS, 1.0, parameters={"m2": -own["m2"]})
    with pytest.raises(fm.InputError, match=r"parameters\.m8: unknown name"):
        fm.integrate(mechanism, STARTS, 1.0, parameters={"m8": own["m2"]})


def test_terms_that_are_not_there_cost_nothing() -> None:
    """A parameter that is zero leaves the compiled code, unless its values differ between trajectories."""
    mechanism = fm.mechanisms.slider_pendulum().replace(beta=0.0, alpha=0.0)
    free, full = system_of(mechanism.with_terms(()), "lagrange"), system_of(mechanism, "lagrange")
    assert len(free.parameters) < len(full.parameters)
    assert operations_of(free.rhs, [0.5] * (5 + len(free.parameters))) + 10 < operations_of(
        full.rhs, [0.5] * (5 + len(full.parameters))
    )
    own = {"beta": np.linspace(0.0, 100.0, len(STARTS))}
    found = fm.integrate(mechanism, STARTS, 1.0, dt=0.01, parameters=own)
    for beta, k in ((0.0, 0), (100.0, 39)):
        alone = fm.integrate(mechanism.replace(beta=beta), STARTS[k : k + 1], 1.0, dt=0.01)
        np.testing.assert_allclose(found.y[-1, k], alone.y[-1, 0], rtol=1e-11)


def bumpy(t: float) -> float:
    return fm.sin(3.0 * t) / (1.0 + t)


TIMES, VALUES = np.linspace(0.0, 4.0, 9), np.array([0.0, 1.0, -1.0, 2.0, 0.5, -3.0, 1.0, 0.0, 2.0])
FORCES: list[tuple[fm.loads.Load, Callable[[float], float], tuple[float, ...]]] = [
    (fm.loads.Constant(2.0), lambda t: 2.0, ()),
    (fm.loads.Decaying(3.0, 0.5), lambda t: 3.0 * np.exp(-0.5 * t), ()),
    (fm.loads.Harmonic(2.0, 5.0, mean=1.0, phase=0.3), lambda t: 1.0 + 2.0 * np.sin(5.0 * t + 0.3), ()),
    (fm.loads.Pulse(4.0, 0.5, 1.0), lambda t: 4.0 * (0.5 <= t < 1.5), (0.5, 1.5)),
    (fm.loads.Ramp(-4.0, 0.5, 1.0), lambda t: -4.0 * min(max(t - 0.5, 0.0), 1.0), (0.5, 1.5)),
    (fm.loads.Sampled(TIMES, VALUES, "linear"), lambda t: float(np.interp(t, TIMES, VALUES)), tuple(TIMES)),
    (fm.loads.Function(bumpy), lambda t: np.sin(3.0 * t) / (1.0 + t), ()),
]


@pytest.mark.parametrize("case", range(len(FORCES)))
def test_loads_act_on_lanes(case: int) -> None:
    """A driven oscillator, against SciPy from kink to kink; rk4's steps end at the kinks too."""
    load, force, kinks = FORCES[case]
    x = fm.lengths("x")
    mechanism = fm.Mechanism(
        x, {"m": 2.0}, points={"P": (x, 0)}, masses={"P": sympy.Symbol("m")},
        springs=[fm.Spring((0, 0), "P", 9.0)], dampers=[fm.Damper((0, 0), "P", 0.3, along=(1, 0))],
        forces=[fm.Force("P", load, (1, 0)), fm.Force("P", fm.loads.Constant(0.5), (-1, 0))],
    )  # fmt: skip
    starts = np.random.default_rng(case).uniform(-1.0, 1.0, (20, 2))
    found = fm.integrate(mechanism, starts, 3.0, dt=0.0025, method="rk4")
    single = fm.integrate(mechanism, starts, 3.0, dt=0.0025, method="rk4", dtype="float32")
    atol = 1e-8 if not kinks else 2e-3  # a step in a discontinuous force is a step long
    for start, end in zip(starts, found.y[-1], strict=True):
        y, ends = start, sorted({0.0, 3.0, *(t for t in kinks if 0.0 < t < 3.0)})
        for a, b in pairwise(ends):
            y = solve_ivp(
                lambda t, y: [y[1], (force(t) - 0.5 - 9.0 * y[0] - 0.3 * y[1]) / 2.0],
                (a, np.nextafter(b, a)), y, "DOP853", rtol=1e-11, atol=1e-12,
            ).y[:, -1]  # fmt: skip
        np.testing.assert_allclose(end, y, atol=atol)
    np.testing.assert_allclose(single.y, found.y, atol=1e-4)


@pytest.mark.parametrize("name", ["ab6", "abm8"])
@pytest.mark.slow
def test_a_history_ends_where_a_load_bends(name: str) -> None:
    """m x'' = F that rises until a step's end: x is a cubic, then a parabola, but for rounding."""
    x, m = fm.lengths("x"), sympy.Symbol("m")
    rising = fm.Force("P", fm.loads.Ramp(1.0, 0.0, 1.0), (1, 0))
    mechanism = fm.Mechanism(x, {"m": 2.0}, points={"P": (x, 0)}, masses={"P": m}, forces=[rising])
    found = fm.integrate(mechanism, [0.3, 0.0], 3.0, dt=0.03125, method=name).y[-1, 0]
    np.testing.assert_allclose(found, [0.3 + (1 / 6 + 2 / 2 + 4 / 2) / 2, (1 / 2 + 2) / 2], rtol=1e-13)


def test_a_follower_force_may_feed_energy_in() -> None:
    """Beyond its critical load Ziegler's column flutters away from upright, below it does not."""
    start = np.array([[1e-6, -1e-6, 0.0, 0.0]])
    for P, grows in ((2.0, False), (2.2, True)):
        end = fm.integrate(fm.mechanisms.ziegler_column().replace(P=P), start, 40.0, dt=0.01).y[-1]
        assert bool(np.abs(end).max() > 1e-4) == grows


def test_far_turns_and_single_lanes_keep_their_bits() -> None:
    """The packed loop hands lanes beyond its range to the library, whatever stands beside them."""
    mechanism = fm.mechanisms.double_pendulum()
    starts = np.concatenate([STARTS, STARTS + np.array([1e7, 0.0, 0.0, 0.0])])
    for method in ("rk4", "abm8"):
        together = fm.integrate(mechanism, starts, 0.5, dt=0.01, method=method, threads=2).y
        for k in (3, 44):
            alone = fm.integrate(mechanism, starts[k : k + 1], 0.5, dt=0.01, method=method).y
            np.testing.assert_array_equal(together[:, k], alone[:, 0])


@pytest.mark.slow
def test_tolerances_and_work_precision_take_mechanisms() -> None:
    mechanism = fm.mechanisms.cart_pendulum()
    starts = np.random.default_rng(0).uniform(-0.5, 0.5, (200, 4))
    truth = fm.integrate(mechanism, starts, 2.0, dt=0.002, method="dop853").y[-1]
    for formulation in ("lagrange", "hamilton"):
        found = fm.integrate(mechanism, starts, 2.0, tol=1e-6, formulation=formulation)
        assert np.abs(found.y[-1] - truth).max() < 1e-6
    table = fm.work_precision(mechanism, starts, 2.0, errors=[1e-4], methods=["rk4", "dop853"])
    assert {p.method for p in table.points} == {"rk4", "dop853"}


@pytest.mark.parametrize("quantile", [0.9, 1.0])
@pytest.mark.parametrize("case", [0, 1, 3, 4])
@pytest.mark.slow
def test_tolerances_are_kept_where_loads_decide(case: int, quantile: float) -> None:
    """Of smooth loads every error is told; steps end where a pulse or a ramp begins and ends.

    So methods keep their order, and few steps are enough.
    """
    load, force, kinks = FORCES[case]
    x = fm.lengths("x")
    mechanism = fm.Mechanism(
        x, kinetic=x.dot**2 / 2, potential=2 * x**2 + x**4 / 4, points={"P": (x, 0)},
        forces=[fm.Force("P", load, (1, 0))],
    )  # fmt: skip
    starts = np.random.default_rng(case).uniform(-1.0, 1.0, (30, 2))
    found = fm.integrate(mechanism, starts, 3.0, tol=1e-6, quantile=quantile)
    if quantile == 1.0 or kinks:  # so few are followed each by itself past kinks
        assert found.error is not None
        assert np.isfinite(found.error).all()
    else:
        assert found.error is None
    assert found.steps < 400
    errors = []
    for start, end in zip(starts, found.y[-1], strict=True):
        y = start
        for a, b in pairwise([0.0, *kinks, 3.0]):
            y = solve_ivp(
                lambda t, y: [y[1], force(t) - 4.0 * y[0] - y[0] ** 3], (a, np.nextafter(b, a)), y,
                "DOP853", rtol=1e-12, atol=1e-13,
            ).y[:, -1]  # fmt: skip
        errors.append(np.abs(end - y).max())
    assert np.sort(errors)[math.ceil(quantile * 30) - 1] <= 1e-6


def test_steps_end_where_loads_jump_also_beside_one_of_unknown_source() -> None:
    """Its error is not known, and the other load's jumps are: a pulse between two jumps, against SciPy."""
    made: dict[str, Any] = {"fm": fm}
    exec("def f(t):\n    return fm.sin(3.0 * t) / (1.0 + t * t)", made)
    x = fm.lengths("x")
    pulse = fm.Force("P", fm.loads.Pulse(4.0, 0.5, 0.25), (1, 0))
    mechanism = fm.Mechanism(
        x, kinetic=x.dot**2 / 2, potential=2 * x**2 + x**4 / 4, points={"P": (x, 0)},
        forces=[pulse, fm.Force("P", fm.loads.Function(made["f"]), (1, 0))],
    )  # fmt: skip
    found = fm.integrate(mechanism, [0.3, -0.2], 3.0, tol=1e-9)
    assert found.error_estimate == math.inf
    assert "error not known" in repr(found)
    assert "its source is not at hand; define it in a file" in str(found.reason)
    y = np.array([0.3, -0.2])
    for a, b, push in ((0.0, 0.5, 0.0), (0.5, 0.75, 4.0), (0.75, 3.0, 0.0)):
        y = solve_ivp(
            lambda t, y, push: [
                y[1], np.sin(3.0 * t) / (1.0 + t * t) + push - 4.0 * y[0] - y[0] ** 3,
            ], (a, b), y, "DOP853", rtol=1e-12, atol=1e-13, args=(push,),
        ).y[:, -1]  # fmt: skip
    np.testing.assert_allclose(found.y[-1, 0], y, rtol=0, atol=1e-9)
    assert found.steps < 5000


def test_the_largest_exponent_of_a_mechanism() -> None:
    """A damped pendulum at rest: the slower of the two rates of its linear motion."""
    q = fm.angles("q")
    mechanism = fm.Mechanism(q, kinetic=q.dot**2 / 2, potential=-sympy.cos(q), dissipation=q.dot**2 * 0.15)
    found = fm.largest_lyapunov(mechanism, [[0.0, 0.0]], 200.0, dt=0.02)
    assert found.exponents[-1, 0] == pytest.approx(-0.15, abs=0.02)


def test_wrong_arguments_get_a_line() -> None:
    mechanism = fm.mechanisms.double_pendulum()
    with pytest.raises(fm.InputError, match="must be a Scene, a Mechanism or a System"):
        fm.integrate(3, STARTS, 1.0)  # type: ignore[arg-type]
    with pytest.raises(fm.InputError, match="fit: only for a scene"):
        fm.integrate(mechanism, STARTS, 1.0, fit=True)
    with pytest.raises(fm.InputError, match="y0"):
        fm.integrate(mechanism, STARTS[:, :3], 1.0)
    with pytest.raises(fm.InputError, match="formulation = 'newton'"):
        fm.integrate(mechanism, STARTS, 1.0, formulation="newton")


def test_only_mechanisms_import_sympy() -> None:
    code = (
        "import sys, fastmech as fm; fm.integrate; fm.System; fm.Mechanism; fm.loads;"
        "assert 'sympy' not in sys.modules;"
        "fm.angles('phi'); assert 'sympy' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
