"""Stability functions, axis and step limits against closed forms, printed values and differenced maps."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import sympy

import fastmech as fm
from fastmech.ensembles.status import Status
from fastmech.errors import InputError
from fastmech.integrators.methods import METHODS, ImplicitRungeKutta, RungeKutta
from fastmech.slider.equilibria import find_equilibria
from fastmech.step_limits.amplification import (
    stability_function,
    stability_polynomial,
)
from fastmech.step_limits.warning import (
    impulse_limit,
    impulse_ratio,
    largest_stable_step,
    stable_step,
    step_limit,
    step_warning,
)
from fastmech.studies.hardcases.limits import amplification, imaginary_limit, measured_stable_step, real_limit

EXPLICIT = [name for name, method in METHODS.items() if not isinstance(method, ImplicitRungeKutta)]
RUNGE_KUTTA = [name for name, method in METHODS.items() if isinstance(method, RungeKutta)]
SCENE = fm.Scene(c2=1100 / 3, alpha=0.0)
MINIMUM = next(e for e in find_equilibria(SCENE) if e.morse_index == 0)


@pytest.mark.parametrize("name", RUNGE_KUTTA)
def test_stability_polynomials_begin_as_the_exponential(name: str) -> None:
    order = METHODS[name].order
    expected = [1.0 / float(sympy.factorial(k)) for k in range(order + 1)]
    atol = 1e-15 * np.abs(METHODS[name].tableau.b).sum() ** 2  # verner6 has weights of 170
    np.testing.assert_allclose(stability_polynomial(METHODS[name])[: order + 1], expected, rtol=0, atol=atol)


#: Numerator and denominator: Hairer, Wanner, Solving ODEs II, table IV.3.1 (diagonal and first subdiagonal).
PADE = {
    "gauss2": ([1, 1 / 2], [1, -1 / 2]),
    "gauss4": ([1, 1 / 2, 1 / 12], [1, -1 / 2, 1 / 12]),
    "gauss6": ([1, 1 / 2, 1 / 10, 1 / 120], [1, -1 / 2, 1 / 10, -1 / 120]),
    "radau3": ([1, 1 / 3], [1, -2 / 3, 1 / 6]),
    "radau5": ([1, 2 / 5, 1 / 20], [1, -3 / 5, 3 / 20, -1 / 60]),
}


@pytest.mark.parametrize("name", PADE)
def test_implicit_stability_functions_are_the_pade_approximations(name: str) -> None:
    z = np.random.default_rng(0).normal(size=40) * 3 + 3j * np.random.default_rng(1).normal(size=40)
    numerator, denominator = (np.polynomial.polynomial.polyval(z, c) for c in PADE[name])
    np.testing.assert_allclose(stability_function(METHODS[name], z), numerator / denominator, rtol=1e-10)


def test_axis_limits_that_are_printed() -> None:
    """RK4: root of R(-x) = 1, and 2 sqrt 2; AB5 90/551 (zeta = -1 there), Hairer, Wanner, section V.1."""
    assert real_limit(METHODS["euler"]) == pytest.approx(2.0)
    x = sympy.Symbol("x")
    root = sympy.nsolve(1 - x + x**2 / 2 - x**3 / 6 + x**4 / 24 - 1, x, 2.8)
    assert real_limit(METHODS["rk4"]) == pytest.approx(float(root), rel=1e-9)
    assert imaginary_limit(METHODS["rk4"]) == pytest.approx(np.sqrt(8.0), rel=1e-9)
    assert imaginary_limit(METHODS["heun3"]) == pytest.approx(np.sqrt(3.0), rel=1e-9)
    assert [imaginary_limit(METHODS[n]) for n in ("euler", "midpoint", "ab5", "ab6")] == [0.0] * 4
    assert real_limit(METHODS["ab5"]) == pytest.approx(90 / 551, rel=1e-9)
    assert real_limit(METHODS["gauss4"]) == real_limit(METHODS["radau5"]) == np.inf


@pytest.mark.parametrize("name", EXPLICIT)
@pytest.mark.slow
def test_predicted_limit_is_the_measured_one(name: str) -> None:
    """Table 1's minimum has two decaying pairs; the prediction knows only the method's coefficients."""
    predicted = largest_stable_step(SCENE, MINIMUM, name)
    assert measured_stable_step(SCENE, MINIMUM, name) == pytest.approx(predicted, rel=1e-5)


@pytest.mark.parametrize("beta", [1.0, 1e4])
@pytest.mark.parametrize("name", ["rk4", "dop853", "abm8", "ab6"])
def test_weak_and_heavy_damping(name: str, beta: float) -> None:
    scene = SCENE.replace(beta=beta)
    predicted = largest_stable_step(scene, MINIMUM, name)
    assert measured_stable_step(scene, MINIMUM, name) == pytest.approx(predicted, rel=0.02)


@pytest.mark.slow
def test_what_sets_no_limit() -> None:
    assert (
        largest_stable_step(SCENE, MINIMUM, "radau5")
        == measured_stable_step(SCENE, MINIMUM, "sdirk4")
        == np.inf
    )
    assert stable_step(METHODS["rk4"], [3.0]) == np.inf
    assert stable_step(METHODS["rk4"], [3.0, -2.0]) == pytest.approx(real_limit(METHODS["rk4"]) / 2)
    assert stable_step(METHODS["rk4"], [2j, -2j]) == pytest.approx(np.sqrt(2.0), rel=1e-4)


def test_amplification_of_adams_methods_is_what_a_run_does() -> None:
    """Growth a step of y' = -y, mean over the last hundred steps beyond the limit."""
    decay = fm.System(minus, ["y"], {})
    for name, h in (("ab5", 0.2), ("abm8", 0.7)):
        run = fm.integrate(decay, [1.0], t_eval=h * np.arange(1, 200), dt=h, method=name)
        size = np.abs(run.y[:, 0, 0])  # the root may be complex: the largest of each twenty
        growth = (size[-20:].max() / size[-120:-100].max()) ** 0.01
        assert growth == pytest.approx(float(amplification(METHODS[name], -h)), rel=0.01)


def minus(t: float, y: float) -> tuple[float]:
    return (-y,)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.slow
def test_impulse_of_a_decaying_force(name: str) -> None:
    """y' = exp(-alpha t) to the end, as the method itself sums it."""
    decaying = fm.System(exponential, ["y"], {"alpha": 1.0})
    for x in (0.1, 0.7, 5.0):
        run = fm.integrate(decaying, [0.0], 400.0, dt=x, method=name, parameters={"alpha": np.array([1.0])})
        h = 400.0 / run.steps
        assert run.y[0, 0, 0] == pytest.approx(impulse_ratio(METHODS[name], h), rel=1e-9, abs=1e-12)
    assert abs(impulse_ratio(METHODS[name], 0.99 * impulse_limit(METHODS[name])) - 1.0) < 0.01


def exponential(t: float, y: float, alpha: float) -> tuple[float]:
    return (np.exp(-alpha * t),)


def test_rk4_turns_a_tiny_impulse_into_a_large_one() -> None:
    """1e-4 N s at alpha = 1e6, F0 = 100 N: RK4 at 0.01 s makes it 0.167 N s, and is told so."""
    assert impulse_ratio(METHODS["rk4"], 1e4) * 1e-4 == pytest.approx(1 / 6, rel=1e-3)
    scene = SCENE.replace(alpha=1e6)
    warning = step_warning(scene, 0.01, "rk4")
    assert warning is not None
    assert (
        "dt = 0.01 s: too long for rk4 here, the decaying force would give 1.67e+03 times its impulse"
        in warning
    )
    assert step_warning(scene, impulse_limit(METHODS["rk4"]) / 1.2e6, "rk4") is None


def test_warnings() -> None:
    assert step_warning(SCENE, 0.01, "rk4") is None
    assert step_warning(SCENE.replace(beta=1e6), 0.01, "radau5") is None
    heavy = step_warning(SCENE.replace(beta=1e6), 0.01, "rk4")
    assert heavy is not None
    assert "would grow" in heavy
    would_do = float(heavy.split("dt = ")[2].split(" s")[0])
    assert step_warning(SCENE.replace(beta=1e6), would_do, "rk4") is None
    fast = step_warning(SCENE, 0.02, "gauss6", [[0.0, 0.0, 100.0, -1.0]])
    assert fast is not None
    assert "would turn 2 rad a step; dt = 0.009 s would do" in fast


@pytest.mark.parametrize("method", ["rk4", "abm8"])
def test_the_scene_s_limit_holds_at_every_equilibrium(method: str) -> None:
    for change in ({}, {"beta": 1e4}, {"F0": 400.0}, {"c1": 1e5}):
        scene = SCENE.replace(**change)
        for e in find_equilibria(scene):
            if e.morse_index == 0:
                assert step_limit(scene, method) <= 1.05 * largest_stable_step(scene, e, method)


@pytest.mark.parametrize("call", ["integrate", "parameters", "disturb", "label_starts"])
def test_a_step_beyond_the_limit_is_told_before_the_run(call: str) -> None:
    scene = fm.Scene(alpha=0.0, beta=1e5)
    minimum = next(e for e in find_equilibria(scene) if e.morse_index == 0)
    runs: dict[str, Callable[[], object]] = {
        "integrate": lambda: fm.integrate(scene, [0, 0, 0, 0], 0.1, 0.01),
        "parameters": lambda: fm.integrate(
            fm.Scene(), np.zeros((3, 4)), 0.1, 0.01, parameters={"beta": [1.0, 1e5, 10.0]}
        ),
        "disturb": lambda: fm.disturb(scene, minimum, 4, t_end=0.1, dt=0.01, method="rk4"),
        "label_starts": lambda: fm.label_starts(scene, [0, 0, 0, 0], 0.1, dt=0.01, method="rk4"),
    }
    with pytest.warns(
        fm.StepWarning, match=r"^dt = 0.01 s: too long for rk4 here, .*; dt = 0.00\d+ s would do"
    ):
        runs[call]()


def test_no_label_comes_out_beyond_the_limit() -> None:
    """Within the limit every motion returns; beyond it none is said to, though many look like it."""
    minimum = next(e for e in find_equilibria(SCENE) if e.morse_index == 0)
    limit = step_limit(SCENE, "rk4")
    within = fm.disturb(SCENE, minimum, 64, dt=0.5 * limit, method="rk4")
    assert within.share_returned == 1.0
    with pytest.warns(fm.StepWarning):
        beyond = fm.disturb(SCENE, minimum, 64, dt=1.2 * limit, method="rk4")
    assert set(beyond.outcome) == {Status.STEP_TOO_LARGE}
    assert (beyond.end_index == -1).all()
    assert beyond.failures.startswith("64 of 64 trajectories failed: 64 step_too_large")


@pytest.mark.parametrize(
    ("change", "start", "dt", "method"),
    [
        ({"alpha": 1e6}, [1.4, -0.2, 0.0, 0.0], 0.01, "rk4"),
        ({}, [0.0, 0.3, 20.0, 0.0], 0.06, "dop853"),
    ],
    ids=["impulse", "turn"],
)
def test_what_is_warned_of_has_a_status_beside_its_states(
    change: dict[str, float], start: list[float], dt: float, method: str
) -> None:
    """With the number that the warning names both are gone."""
    scene, starts = SCENE.replace(**change), np.array([start, [np.nan, 0.0, 0.0, 0.0]])
    with pytest.warns(fm.StepWarning, match="would do$") as told:
        run = fm.integrate(scene, starts, 0.3, dt, method)
    assert run.status.tolist() == [fm.Status.STEP_TOO_LARGE, fm.Status.START_NOT_FINITE]
    assert np.isfinite(run.y[:, 0]).all()
    assert run.failures == (
        "2 of 2 trajectories failed: 1 step_too_large, 1 start_not_finite; use a smaller dt"
    )
    would_do = float(str(told[0].message).split("dt = ")[2].split(" s")[0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert fm.integrate(scene, starts[:1], 0.3, would_do, method).status.tolist() == [fm.Status.OK]


def test_the_step_taken_decides() -> None:
    """A run shorter than dt takes a shorter step; without damper and number energy alone is judge."""
    heavy = SCENE.replace(beta=1e5)
    start = [1.4, -0.2, 0.0, 0.0]
    assert fm.integrate(heavy, start, 1e-4, 0.01).status.tolist() == [fm.Status.OK]
    assert fm.integrate(heavy, start, t_eval=[0.0], dt=0.01).status.tolist() == [fm.Status.OK]
    still = SCENE.replace(beta=0.0, F0=0.0)
    assert fm.integrate(still, start, 0.1, 1e-4, "euler").status.tolist() == [fm.Status.OK]


@pytest.mark.slow
def test_no_label_from_steps_beyond_the_limit() -> None:
    scene, starts = SCENE.replace(beta=1e5), [[0.9, 0.4, 0.0, 0.0], [0.1, 0.2, 0.0, 0.0]]
    with pytest.warns(fm.StepWarning):
        beyond = fm.label_starts(scene, starts, 20.0, dt=0.05, method="rk4")
    assert set(beyond.status) == {fm.Status.STEP_TOO_LARGE}
    assert (beyond.well == -1).all()
    assert set(fm.label_starts(scene, starts, 20.0, method="radau5").status) == {fm.Status.CAPTURED}


def test_no_step_will_do() -> None:
    told = step_warning(SCENE.replace(beta=0.0, F0=0.0), 0.01, "euler")
    assert told is not None
    assert "no step will do" in told


@pytest.mark.parametrize("dt", [0.0, -1.0, float("nan"), float("inf"), "0.1", None])
def test_a_step_must_be_a_positive_number(dt: object) -> None:
    with pytest.raises(InputError, match=r"^dt = .*: must be a finite number of s greater than 0$"):
        step_warning(SCENE, dt, "rk4")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("starts", "said"),
    [("abc", "must be numbers"), ([1.0, 2.0], r"has shape \(2,\)"), (np.zeros((2, 2, 4)), "has shape")],
)
def test_starts_must_be_states(starts: object, said: str) -> None:
    with pytest.raises(InputError, match=f"^starts: {said}"):
        step_warning(SCENE, 0.01, "rk4", starts)  # type: ignore[arg-type]


@pytest.mark.parametrize("limit", [largest_stable_step, measured_stable_step])
def test_limits_refuse_what_is_no_equilibrium_of_a_scene(limit: Callable[..., float]) -> None:
    with pytest.raises(InputError, match=r"^scene = None: must be a Scene or a Mechanism$"):
        limit(None, MINIMUM, "rk4")
    for wrong in (None, (0.0, 0.0), "minimum"):
        with pytest.raises(InputError, match=r"^equilibrium = .*: must be one of fm.find_equilibria"):
            limit(SCENE, wrong, "rk4")
    with pytest.raises(InputError, match=r"^equilibrium.phi = nan: must be finite$"):
        limit(SCENE, replace(MINIMUM, phi=np.nan), "rk4")
    for method in (None, 3, ["rk4"], "rk9"):
        with pytest.raises(InputError, match=r"^method = .*: unknown; known: "):
            limit(SCENE, MINIMUM, method)
