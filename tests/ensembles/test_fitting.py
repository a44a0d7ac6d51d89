"""Steps that fit each trajectory: the bound behind them, the ladder that they stand on, runs in pieces."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from ensembles.references import errors, motions_of
from ensembles.starts import Floats, random_starts

import fastmech as fm
from fastmech.ensembles.fitting import fit_steps
from fastmech.errors import InputError
from fastmech.scene import Scene
from fastmech.slider.coefficients import Coefficients
from fastmech.slider.motion import SceneMotion

SCENE = Scene(alpha=0.0)
#: Only weights pull on phi and theta, one each: U is least at (-pi/2, 0), and known there.
HANGING = Scene(c1=0.0, c2=0.0, F0=0.0, beta=0.0)
BOTTOM = np.array([-np.pi / 2, 0.0])


def fitted_steps(motion: SceneMotion, starts: Floats, dt: float, exponent: float) -> Floats:
    """The step [s] of every trajectory."""
    return dt * fit_steps(motion, starts, dt, 1.0, exponent).shares


def kinetic_norm(scene: Any, y: Floats) -> Floats:
    """sqrt(2 T / (m2 l^2)) of states (..., 4), from the points' velocities, paper (6) and (8)."""
    phi, theta, u, v = np.moveaxis(y, -1, 0)
    first = u**2
    second = (-np.sin(phi) * u - np.cos(theta) * v) ** 2 + (np.cos(phi) * u + np.sin(theta) * v) ** 2
    slider = ((np.sin(phi) + np.sin(phi) * np.cos(phi) / np.sqrt(4.0 - np.sin(phi) ** 2)) * u) ** 2
    return np.asarray(
        np.sqrt((scene["m1"] * first + scene["m2"] * second + scene["m3"] * slider) / scene["m2"])
    )


def random_scenes(n: int, decaying: bool) -> dict[str, Floats]:
    random = np.random.default_rng(11)
    limits = {
        "m1": (0.5, 20.0),
        "m2": (0.5, 20.0),
        "m3": (0.0, 20.0),
        "l": (0.5, 3.0),
        "c1": (0.0, 400.0),
        "c2": (0.0, 800.0),
        "beta": (0.0, 200.0),
        "F0": (-400.0, 400.0),
        "alpha": (0.01, 3.0) if decaying else (0.0, 0.0),
    }
    own = {name: random.uniform(low, high, n) for name, (low, high) in limits.items()}
    own["beta"][::3] = 0.0
    return own


@pytest.mark.parametrize("decaying", [False, True])
def test_no_motion_is_faster_than_its_bound(decaying: bool) -> None:
    """200 random scenes for 4 s, a third of them undamped, half of them from rest."""
    n = 200
    own, starts = random_scenes(n, decaying), random_starts(n, seed=5)
    starts[::2, 2:] = 0.0
    run = fm.integrate(
        Scene(), starts, t_eval=np.linspace(0.0, 4.0, 201), dt=0.002, method="dop853", parameters=own
    )
    assert not run.status.any()
    c = Scene()._motion(own)
    bound, speed = c.speed(starts), kinetic_norm(own, run.y).max(axis=0)
    assert (speed <= bound * (1.0 + 1e-9)).all()
    assert np.median(bound / speed) < 3.0  # a bound of use: infinity would hold as well


def test_the_bound_is_the_speed_itself_where_the_energy_is_least() -> None:
    """From the bottom of U no motion becomes faster than it is; elsewhere by the height above the bottom."""
    c, rates = HANGING._motion({}), np.random.default_rng(3).uniform(-9.0, 9.0, (20, 2))
    starts = np.concatenate([np.tile(BOTTOM, (20, 1)), rates], axis=1)
    np.testing.assert_allclose(c.speed(starts), kinetic_norm(HANGING.parameters, starts), rtol=1e-12)
    top = np.array([[np.pi / 2, np.pi, 0.0, 0.0]])  # 2 l ((m1 + m2) g + m2 g) above
    m1, m2, l, g = HANGING.m1, HANGING.m2, HANGING.l, HANGING.g
    np.testing.assert_allclose(
        c.speed(top), np.sqrt(2.0 * 2.0 * ((m1 + m2) * g + m2 * g) / (m2 * l)), rtol=1e-12
    )


def test_the_ladder_of_steps() -> None:
    """theta' = w 2^(k/4) at the bottom: the speed bound is k rungs above the vibration's frequency w."""
    c, rungs = HANGING._motion({}), np.arange(1, 17)
    w = float(c.frequency)
    starts = np.zeros((rungs.size, 4))
    starts[:, :2] = BOTTOM
    starts[:, 3] = 0.999 * w * 2.0 ** (rungs / 4.0)
    np.testing.assert_allclose(fitted_steps(c, starts, 0.1, 1.0), 0.1 * 2.0 ** (-rungs / 4.0), rtol=1e-14)
    doubled = 0.1 * 2.0 ** (-np.ceil(1.5 * (rungs - 0.006)) / 4.0)
    np.testing.assert_allclose(fitted_steps(c, starts, 0.1, 1.5), doubled, rtol=1e-14)
    np.testing.assert_array_equal(fitted_steps(c, 0.0 * starts + [*BOTTOM, 0.0, 0.0], 0.1, 1.0), 0.1)


@pytest.mark.parametrize(("asked", "halvings"), [(2.0**10, 14), (2.0**16, 8), (2.0**20, 8), (2.0**29, 1)])
def test_motions_of_too_many_steps_get_none(asked: float, halvings: int) -> None:
    """Of a second: 2^24 steps at most or 256 times those of slow motion, and 2^30 in any case.

    theta' = w 2^k at the bottom halves a step k times; who is alone is told the same.
    """
    c, k = HANGING._motion({}), np.arange(0, 20)
    starts = np.tile([*BOTTOM, 0.0, 0.0], (k.size, 1))
    starts[:, 3] = 0.999 * float(c.frequency) * 2.0**k
    found = fit_steps(c, starts, 1.0 / asked, 1.0, 1.0)
    np.testing.assert_array_equal(found.shares, 0.5**k)
    np.testing.assert_array_equal(found.aside, k > halvings)
    each = fit_steps(c, starts, np.full(k.size, 1.0 / asked), 1.0, 1.0)
    np.testing.assert_array_equal(each.aside, found.aside)
    alone = [fit_steps(c, start[None], 1.0 / asked, 1.0, 1.0).aside[0] for start in starts]
    np.testing.assert_array_equal(alone, found.aside)


def test_nothing_is_set_aside_for_what_is_asked_of_all() -> None:
    """More steps than 2^30 of slow motion are meant; a start that is not finite has a status of its own."""
    c, fast = HANGING._motion({}), np.array([[*BOTTOM, 0.0, 1e2], [*BOTTOM, 0.0, np.nan]])
    assert fit_steps(c, fast, 2.0**-20, 2.0**-4, 1.0).aside.tolist() == [False, False]
    assert fit_steps(c, fast, 2.0**-31, 1.0, 1.0).aside.tolist() == [False, False]
    assert fit_steps(c, fast, 2.0**-29, 1.0, 1.0).aside.tolist() == [True, False]


@pytest.mark.parametrize("scene", [SCENE, Scene(), HANGING])
def test_steps_stand_on_the_ladder_and_depend_on_the_own_start_alone(scene: Scene) -> None:
    c, starts = scene._motion({}), random_starts(300)
    starts[17, 2] = np.nan
    steps = fitted_steps(c, starts, 0.02, 1.5)
    assert (steps <= 0.02).all()
    assert np.unique(steps).size > 3
    rungs = 4.0 * np.log2(0.02 / steps)
    np.testing.assert_allclose(rungs, np.round(rungs), atol=1e-9)
    order = np.random.default_rng(1).permutation(300)
    np.testing.assert_array_equal(fitted_steps(c, starts[order], 0.02, 1.5), steps[order])
    alone = [fitted_steps(c, start[None], 0.02, 1.5)[0] for start in starts]
    np.testing.assert_array_equal(alone, steps)


def test_own_scenes_have_own_steps() -> None:
    own, starts = random_scenes(30, decaying=True), random_starts(30)
    c = Scene()._motion(own)
    steps = fitted_steps(c, starts, 0.02, 1.0)
    for i, start in enumerate(starts):
        one = SceneMotion(Coefficients(*(float(values[i]) for values in c.c)))
        assert fitted_steps(one, start[None], 0.02, 1.0)[0] == steps[i]


@pytest.mark.parametrize("fit", [True, [0.0, 0.4, 1.1]])
@pytest.mark.parametrize("method", ["rk4", "ab6"])
def test_a_fitted_ensemble_equals_single_runs(fit: Any, method: str) -> None:
    starts = random_starts(60, seed=9) * np.array([1.0, 1.0, 2.0, 2.0])
    arguments: dict[str, Any] = {"t_eval": [0.0, 0.3, 1.1, 1.5], "dt": 0.01, "method": method, "fit": fit}
    run = fm.integrate(SCENE, starts, **arguments)
    assert run.trajectory_dt.shape == (1 if fit is True else 3, 60)
    assert run.trajectory_steps.shape == (60,)
    assert np.unique(run.trajectory_steps).size > 3
    for i, start in enumerate(starts):
        alone = fm.integrate(SCENE, start, **arguments)
        np.testing.assert_array_equal(alone.y[:, 0], run.y[:, i])
        np.testing.assert_array_equal(alone.trajectory_dt[:, 0], run.trajectory_dt[:, i])
        assert alone.trajectory_steps[0] == run.trajectory_steps[i]


def test_steps_that_are_reported() -> None:
    """One output: the fewest equal steps not longer than the fitted one."""
    starts = random_starts(80, seed=2)
    run = fm.integrate(SCENE, starts, 2.0, dt=0.01, fit=True)
    number = np.ceil(2.0 / fitted_steps(SCENE._motion({}), starts, 0.01, 1.0) - 1e-9)
    np.testing.assert_array_equal(run.trajectory_steps, number)
    np.testing.assert_allclose(run.trajectory_dt[0], 2.0 / number, rtol=1e-13)
    assert run.steps == number.max()
    assert run.dt == run.trajectory_dt.max()


def test_a_second_fit_never_shortens_a_step() -> None:
    """The damper slows motions down: later pieces have longer steps, none beyond dt."""
    starts = random_starts(50, seed=4) * np.array([1.0, 1.0, 3.0, 3.0])
    run = fm.integrate(SCENE, starts, t_eval=[1.0, 2.0, 4.0], dt=0.0125, fit=[0.0, 1.0, 2.0])
    assert (
        np.diff(run.trajectory_dt, axis=0) >= -1e-3 * run.trajectory_dt[1:]
    ).all()  # equal steps in another interval
    assert (run.trajectory_dt[2] > 1.3 * run.trajectory_dt[0]).any()
    assert run.trajectory_dt.max() <= 0.0125 * (1.0 + 1e-12)


@pytest.mark.parametrize("scene", [SCENE, Scene()])
@pytest.mark.parametrize("formulation", ["lagrange", "hamilton"])
@pytest.mark.parametrize(
    "times",
    [
        [0.0, 0.2, 0.5, 0.7, 1.25, 1.5, 2.0],  # in every piece, at both cuts
        [0.0, 0.5, 1.25, 2.0],  # at the ends of pieces only
        [0.1, 2.0],  # none in the second piece
        [1.3, 1.7],  # the first only in the last piece
        [0.0, 1.25],  # the last at a cut
        [0.3],  # all before the cuts, which are none then
        [0.0],
    ],
)
def test_outputs_of_a_run_in_pieces(scene: Scene, formulation: str, times: list[float]) -> None:
    starts = random_starts(10, seed=6) * np.array([1.0, 1.0, 0.5, 0.5])
    run = fm.integrate(
        scene,
        starts,
        t_eval=times,
        dt=0.02,
        method="dop853",
        fit=[cut for cut in (0.0, 0.5, 1.25) if cut <= times[-1]],
        formulation=formulation,
    )
    np.testing.assert_array_equal(run.t, times)
    assert run.y.shape == (len(times), 10, 4)
    assert len(run.trajectory_dt) == 1 + sum(cut < times[-1] for cut in (0.5, 1.25))
    right = motions_of(scene, starts, times) if times[-1] > 0.0 else starts[None]
    assert errors(run.y, right).max() < 1e-8


def test_a_bad_start_leaves_others_alone() -> None:
    starts = random_starts(40)
    right = fm.integrate(SCENE, starts, 1.0, fit=[0.0, 0.5])
    starts[13, 3] = np.inf
    run, others = fm.integrate(SCENE, starts, 1.0, fit=[0.0, 0.5]), np.arange(40) != 13
    np.testing.assert_array_equal(run.y[:, others], right.y[:, others])
    np.testing.assert_array_equal(run.status == fm.Status.START_NOT_FINITE, ~others)


def test_no_trajectories() -> None:
    run = fm.integrate(SCENE, np.empty((0, 4)), t_eval=[0.1, 0.2], fit=[0.0, 0.15])
    assert run.y.shape == (2, 0, 4)
    assert run.trajectory_steps.shape == (0,)


def falling(t: float, x: float) -> tuple[float]:
    return (-x,)


def test_a_system_has_no_energy_to_fit_to() -> None:
    with pytest.raises(InputError, match=r"^fit: only for a scene"):
        fm.integrate(fm.System(falling, ["x"], {}), [1.0], 1.0, fit=True)


@pytest.mark.parametrize(
    ("fit", "message"),
    [
        ([0.5, 0.2], "fit[1] = 0.2: must be finite, not negative and strictly rising times in s"),
        ([0.0, 0.0], "fit[1] = 0: must be finite, not negative and strictly rising times in s"),
        ([-0.1, 0.2], "fit[0] = -0.1: must be finite, not negative and strictly rising times in s"),
        ([[0.0], [0.1, 0.2]], "fit: must be times in s"),
        ([0.0, np.nan], "fit[1] = nan: must be finite, not negative and strictly rising times in s"),
        ([0.0, 0.5, 1.5], "fit[2] = 1.5: must not lie behind the run's end, 1 s"),
        (3.0, "fit[0] = 3: must not lie behind the run's end, 1 s"),
        ([], "fit: has shape (0,), must be a row of at least one time"),
        ([[0.0, 1.0]], "fit: has shape (1, 2), must be a row of at least one time"),
        ("often", "fit: must be times in s"),
        (None, "fit: "),
    ],
)
def test_bad_times_are_refused_in_one_line(fit: Any, message: str) -> None:
    with pytest.raises(InputError, match=f"^{re.escape(message)}") as error:
        fm.integrate(SCENE, [0.9, 0.4, 0.0, 0.0], 1.0, fit=fit)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("speed", [1e20, 1e100, 1e300])
@pytest.mark.parametrize("fit", [True, [0.0, 0.5]])
@pytest.mark.filterwarnings("ignore::fastmech.step_limits.warning.StepWarning")
def test_a_start_that_no_steps_follow_leaves_others_alone(speed: float, fit: Any) -> None:
    """It would take more steps than can be counted; the others are the same to the bit."""
    starts = random_starts(40)
    right = fm.integrate(SCENE, np.delete(starts, 13, axis=0), t_eval=[0.0, 1.0], fit=fit)
    starts[13, 2] = speed
    run, others = fm.integrate(SCENE, starts, t_eval=[0.0, 1.0], fit=fit), np.arange(40) != 13
    np.testing.assert_array_equal(run.y[:, others], right.y)
    np.testing.assert_array_equal(run.trajectory_dt[:, others], right.trajectory_dt)
    np.testing.assert_array_equal(run.status[others], right.status)
    assert run.status[13] == fm.Status.STEP_TOO_LARGE
    assert run.failures == "1 of 40 trajectories failed: 1 step_too_large; use a smaller dt"
    np.testing.assert_array_equal(run.y[0, 13], starts[13])
    assert np.isnan(run.y[1, 13]).all()
    assert run.failed is not None
    assert run.last is not None
    assert run.failed[13] == 0.0
    np.testing.assert_array_equal(run.last[13], starts[13])


def test_a_step_that_is_too_short_for_all_is_still_refused() -> None:
    with pytest.raises(InputError, match=r"^dt = .* s: gives .* steps, at most 2e\+10 are possible$"):
        fm.integrate(SCENE, [0.1, 0.2, 0.0, 0.0], 1.0, dt=1e-17, fit=True)
