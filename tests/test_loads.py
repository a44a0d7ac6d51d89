"""Loads over time, and what they tell of themselves."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy
from scipy.interpolate import CubicSpline

import fastmech as fm
from fastmech.loads import Constant, Decaying, Function, Harmonic, Load, Pulse, Ramp, Sampled, held_at

pytestmark = pytest.mark.nojit

TIMES, VALUES = [0.0, 0.5, 1.5, 2.0], [1.0, -2.0, 3.0, 0.5]
LOADS: list[Load] = [
    Constant(-3.0),
    Decaying(-4.0, 0.6),
    Harmonic(2.0, 3.0, mean=1.0, phase=0.4),
    Pulse(5.0, 0.5, 1.0),
    Ramp(-2.0, 0.3, 1.4),
    Sampled(TIMES, VALUES),
    Sampled(TIMES, VALUES, "linear"),
    Function(lambda t: math.exp(-t) * t, bound=1.0 / math.e),
]
GRID = np.linspace(0.0, 30.0, 30001)


def values(load: Load, t: np.ndarray) -> np.ndarray:
    if isinstance(load, Sampled | Function):
        return np.array(list(map(load.function, t.tolist())))
    symbol = sympy.Symbol("t", real=True)
    return np.array(np.broadcast_to(sympy.lambdify(symbol, load.expression(symbol))(t), t.shape), dtype=float)


WANTED = [
    lambda t: -3.0 + 0.0 * t,
    lambda t: -4.0 * np.exp(-0.6 * t),
    lambda t: 1.0 + 2.0 * np.sin(3.0 * t + 0.4),
    lambda t: np.where((t >= 0.5) & (t < 1.5), 5.0, 0.0),
    lambda t: -2.0 * np.clip((t - 0.3) / 1.4, 0.0, 1.0),
    lambda t: CubicSpline(TIMES, VALUES, bc_type="clamped")(np.clip(t, 0.0, 2.0)),
    lambda t: np.interp(t, TIMES, VALUES),
    lambda t: np.exp(-t) * t,
]


@pytest.mark.parametrize(("load", "wanted"), list(zip(LOADS, WANTED, strict=True)))
def test_values_over_time(load: Load, wanted) -> None:  # type: ignore[no-untyped-def]
    np.testing.assert_allclose(values(load, GRID), wanted(GRID), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("load", LOADS)
def test_bounds_and_means_and_periods_hold(load: Load) -> None:
    facts, found = load.facts(), values(load, GRID)
    assert np.abs(found).max() <= facts.bound * (1.0 + 1e-12)
    assert np.abs(found).max() >= facts.bound * (1.0 - 1e-3)
    if facts.period is None:
        assert found[-1] == pytest.approx(facts.mean, abs=1e-6)
    else:
        one = values(load, np.linspace(0.0, facts.period, 1000, endpoint=False))
        assert one.mean() == pytest.approx(facts.mean, abs=1e-12)
        np.testing.assert_allclose(values(load, GRID + facts.period), found, atol=1e-10)


@pytest.mark.parametrize("t", [0.0, 0.4, 1.2, 2.5])
@pytest.mark.parametrize("load", [load for load in LOADS if not isinstance(load, Harmonic | Function)])
def test_no_motion_takes_more_work_than_is_left(load: Load, t: float) -> None:
    """The best motion goes from end to end wherever the load's slope changes sign: its work is the bound."""
    later = np.linspace(t, 40.0, 20001)
    force = values(load, later) - load.facts().mean
    variation = np.abs(np.diff(force)).sum()
    best = 0.5 * (abs(force[0]) + variation)  # of x within half a unit of zero, by summation by parts
    assert load.work_left(t) == pytest.approx(best, rel=5e-3, abs=1e-6)
    assert load.work_left(t, reach=4.0) == 4.0 * load.work_left(t)
    rng = np.random.default_rng(1)
    for _ in range(20):
        x = np.interp(later, np.sort(rng.uniform(t, 5.0, 30)), rng.uniform(-0.5, 0.5, 30))
        assert np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(x)) <= load.work_left(t) * (1 + 5e-3) + 1e-9


def test_what_never_fades_can_do_any_work() -> None:
    assert Harmonic(1.0, 2.0).work_left(100.0) == math.inf
    assert Harmonic(0.0, 2.0, mean=3.0).work_left(0.0) == 0.0
    assert Function(math.cos).work_left(0.0) == math.inf
    assert Function(math.cos).facts().bound == math.inf


def test_equilibria_tell_for_which_loads_they_are() -> None:
    loads = (Constant(2.0), Harmonic(0.0, 2.0, mean=3.0), Harmonic(1.0, 2.0), Decaying(1.0, 0.0))
    assert held_at(loads) == "loads that change are held: Harmonic at its mean"
    assert held_at([Decaying(1.0, 2.0)]) == "loads that change are held: Decaying at what it comes to"
    assert held_at(loads[:2]) == ""


def test_symbols_become_numbers() -> None:
    F, w = sympy.symbols("F w")
    found = Harmonic(F, 2 * w, mean=F / 2).at({"F": 4.0, "w": 3.0})
    assert found.facts() == (2.0, 6.0, pytest.approx(math.pi / 3.0))
    with pytest.raises(fm.InputError, match="Decaying: has no values of w"):
        Decaying(F, w).at({"F": 1.0})
    with pytest.raises(fm.InputError, match=r"Decaying.rate = -1.0: must be finite and at least 0"):
        Decaying(F, w).at({"F": 1.0, "w": -1.0})


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: Decaying(1.0, -1.0), "Decaying.rate = -1.0: must be finite and at least 0"),
        (
            lambda: Harmonic(1.0, 0.0, phase=1.0),
            "Harmonic.frequency = 0.0: must be finite and > 0; give a Constant load",
        ),
        (lambda: Pulse(1.0, 0.0, -1.0), "Pulse.duration = -1.0"),
        (lambda: Ramp(1.0, 0.0, 0.0), "Ramp.duration = 0.0: must be finite and > 0"),
        (lambda: Sampled([0.0], [1.0]), "Sampled.times"),
        (lambda: Sampled([0.0, 0.0], [1.0, 2.0]), "Sampled.times"),
        (lambda: Sampled([0.0, math.inf], [1.0, 2.0]), r"Sampled.times = \[0.0, inf\]: .* finite, rising"),
        (lambda: Sampled([0.0, 1.0], [1.0]), r"Sampled.values = \[1.0\]: must be 2 finite numbers, one for"),
        (lambda: Sampled([0.0, 1.0], [1j, 2.0]), r"Sampled.values = \[1j, 2.0\]: must be 2 finite numbers"),
        (lambda: Sampled([0.0, 1.0], np.array([1j, 2.0])), "Sampled.values = array"),
        (lambda: Sampled([0.0, 1.0], [[1.0], [2.0, 3.0]]), "Sampled.values = "),
        (lambda: Sampled([0.0, 1e-320], [0.0, 1.0]), "Sampled.values: change by too much, or too fast"),
        (lambda: Sampled([0.0, 1e-320], [0.0, 1.0], "linear"), "Sampled.values: change by"),
        (lambda: Sampled([0.0, 1e-300, 1.0], [0.0, 1.0, 0.0]), "Sampled.values: change by"),
        (lambda: Sampled([0.0, 1.0, 2.0], [1e308, -1e308, 1e308]), "Sampled.values: change by"),
        (lambda: Sampled([0.0, 1.0, 2.0], [1e308, -1e308, 1e308], "linear"), "Sampled.values: change by"),
        (lambda: Sampled("ab", [1.0]), "Sampled.times = 'ab'"),
        (lambda: Sampled([0.0, 1.0], [1.0, math.nan]), r"Sampled.values = \[1.0, nan\]: must be 2"),
        (lambda: Sampled([0.0, 1.0], [1.0, 2.0], "quintic"), "Sampled.interpolation = 'quintic'"),
        (lambda: Function(3.0), "Function.function = 3.0"),  # type: ignore[arg-type]
        (lambda: Function(lambda t: "1.0"), "must give a number at any time, as at 0 s$"),  # type: ignore
        (lambda: Function(lambda t: None), "must give a number at any time, as at 0 s$"),  # type: ignore
        (lambda: Function(lambda t, x: t), "Function.function = <.*, not raise TypeError$"),  # type: ignore
        (lambda: Function(lambda t: 1.0 / t), "must give a number .*, not raise ZeroDivisionError$"),
        (lambda: Pulse(1.0, math.nan, 1.0), "Pulse.start = nan: must be a finite number or an expression of"),
        (lambda: Constant(1j), "Constant.value = 1j: must be a finite number or an expression of parameters"),
        (lambda: Constant("a"), "Constant.value = 'a'"),
        (lambda: Constant(math.inf), "Constant.value = inf: must be a finite number or an expression"),
        (lambda: Pulse(1.0, 0.0, math.inf), "Pulse.duration = inf: must be a finite number"),
        (lambda: Function(abs, mean="x"), "Function.mean = 'x': must be a finite number"),  # type: ignore
        (lambda: Function(abs, bound=-1.0), "Function.bound = -1.0: must be finite and at least 0"),
        (lambda: Function(abs, period=0.0), "Function.period = 0.0: must be finite and > 0"),
        (lambda: Function(abs, period="a"), "Function.period = 'a': must be finite and > 0"),  # type: ignore
        (lambda: Function(np.sin), "must be a Python function of the time"),
        (lambda: Harmonic("a", 1.0), "Harmonic.amplitude = 'a'"),
    ],
)
def test_wrong_loads_are_refused(make, told: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(fm.InputError, match=told):
        make()


def test_no_way_leads_to_a_harmonic_load_that_stands_still() -> None:
    """Its mean would be another one than over a period: as a parameter, replaced, and of each trajectory."""
    q, w = fm.angles("q"), sympy.Symbol("w")
    settings = {"kinetic": q.dot**2 / 2, "forces": [fm.Torque(q, Harmonic(1.0, w, 0.0, 1.5))]}
    told = "Harmonic.frequency = 0.0: must be finite and > 0"
    with pytest.raises(fm.InputError, match=told):
        fm.Mechanism(q, {"w": 0.0}, **settings)
    driven = fm.Mechanism(q, {"w": 1.0}, **settings)
    with pytest.raises(fm.InputError, match=told):
        driven.replace(w=0.0)
    with pytest.raises(fm.InputError, match=told):
        fm.integrate(driven, np.zeros((2, 2)), 1.0, parameters={"w": [0.0, 1.0]})
    with pytest.raises(fm.InputError, match=told):
        fm.map_equilibria(driven, {"w": [0.0, 1.0]})


def test_a_spline_s_extremes_scale_with_its_times_and_values() -> None:
    """Of one rise from 0 to 1 and back the spline's peak is 1; of 0, 1, -1, 0 it is beyond the samples."""
    for time, value in ((1.0, 1.0), (1e-100, 1e-300), (1e90, 1e300)):
        up = Sampled([0.0, time, 2.0 * time], [0.0, value, 0.0])
        assert up.to_come(0.0) == pytest.approx((0.0, 2.0 * value))
        both = Sampled(np.arange(4) * time, [0.0, value, -value, 0.0])
        fine = max(abs(both.function(x)) for x in np.linspace(0.0, 3.0 * time, 3001).tolist())
        assert value < fine <= both.facts().bound == pytest.approx(fine, rel=1e-5)
