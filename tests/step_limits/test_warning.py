"""Steps that a run shows to be too long, and the linear theory that warns of them."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from ensembles.references import motions_of

import fastmech as fm
from fastmech.integrators.methods import METHODS, Adams
from fastmech.step_limits.amplification import amplifies, stability_function
from fastmech.step_limits.warning import stable_step, step_limit, step_warning
from fastmech.studies.hardcases.limits import companion

TOO_LARGE = fm.Status.STEP_TOO_LARGE


@pytest.mark.parametrize(
    ("beta", "method", "dt", "error"),
    [
        (1e-6, "ab5", 0.005, 1e-5),
        (1e-6, "midpoint", 0.002, 1e-3),
        (1e-6, "midpoint", 0.005, 1e-2),
    ],
)
def test_accurate_runs_are_not_failed(beta: float, method: str, dt: float, error: float) -> None:
    scene, start = fm.Scene(beta=beta, F0=0.0), [0.3, 0.2, 0.0, 0.0]
    expected = fm.integrate(scene, start, 5.0, dt=5e-4, method="dop853").y[-1]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fm.StepWarning)
        found = fm.integrate(scene, start, 5.0, dt=dt, method=method)
    assert np.abs(found.y[-1] - expected).max() < error
    assert found.status.tolist() == [fm.Status.OK]


@pytest.mark.parametrize(
    ("t_end", "status", "error"), [(5.0, fm.Status.OK, (0.0, 1e-6)), (14.0, TOO_LARGE, (1e-2, np.inf))]
)
def test_errors_of_an_adams_method_count_once_they_show(
    t_end: float, status: fm.Status, error: tuple[float, float]
) -> None:
    """Its parasitic root is 1.08 a step at the minima, about which the motion goes to and fro."""
    scene, start = fm.Scene(beta=1.0, F0=0.0), [0.3, 0.2, 0.0, 0.0]
    with pytest.warns(fm.StepWarning):
        run = fm.integrate(scene, start, t_end, dt=0.02, method="abm12")
    assert run.status.tolist() == [status]
    least, most = error
    assert least <= np.abs(run.y[-1, 0] - motions_of(scene, np.array([start]), [t_end])[0, 0]).max() < most


@pytest.mark.parametrize("method", ["midpoint", "heun2", "ab5", "abm12", "tsit5", "rk4"])
def test_a_weak_damper_is_as_none(method: str) -> None:
    none = step_limit(fm.Scene(beta=0.0, F0=0.0), method)
    assert none > 0.0
    for beta in (1e-12, 1e-9, 1e-6):
        assert step_limit(fm.Scene(beta=beta, F0=0.0), method) == pytest.approx(none, rel=0.02)
        within = step_warning(fm.Scene(beta=beta, F0=0.0), 0.95 * none, method)
        assert within is None


@pytest.mark.parametrize("method", ["midpoint", "heun2", "ralston2"])
def test_a_mode_that_the_damper_does_not_reach_leaves_a_limit(method: str) -> None:
    """At this equilibrium sin(phi + theta) = 0: a mode's real part is rounding, of either sign."""
    scene = fm.Scene(alpha=0.0, F0=89.2075641978, c1=96.0, c2=50.0327795757)
    assert step_limit(scene, method) > 1e-3
    for real in (-1e-17, 0.0, 1e-17, -1e-13):
        limit = stable_step(METHODS[method], [real + 1j, real - 1j])
        assert limit == pytest.approx(0.02, rel=1e-3)  # |R(iy)|^2 = 1 + y^4/4, so y^3/8 = 1e-6


@pytest.mark.parametrize("name", METHODS)
def test_what_is_amplified(name: str) -> None:
    """Against R itself, and the eigenvalues of the history's map."""
    rng, method = np.random.default_rng(1), METHODS[name]
    z = (-rng.uniform(0, 1.5, 400) + 1j * rng.uniform(0, 1.5, 400)) * np.repeat([1.0, 0.1], 200)
    factor = 1.0 + 10.0 ** rng.uniform(-7, -1, 400)
    if not isinstance(method, Adams):
        expected = np.abs(stability_function(method, z))
    else:
        expected = np.abs(np.linalg.eigvals(companion(method, z))).max(axis=-1)
    assert amplifies(method, z, factor).tolist() == (expected > factor).tolist()


@pytest.mark.parametrize("method", ["rk4", "ab6", "dop853", "tsit5"])
@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_no_trajectories_are_judged_without_a_word(method: str, alpha: float) -> None:
    run = fm.integrate(fm.Scene(alpha=alpha), np.zeros((0, 4)), 1.0, dt=0.5, method=method)
    assert run.status.shape == (0,)
