"""Lyapunov exponents and transient growth: published values, SciPy's tangent flow, closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.linalg
from scipy.integrate import solve_ivp

import fastmech as fm
from fastmech.errors import InputError
from fastmech.models.equilibria import RestingPlace
from fastmech.slider.equilibria import find_equilibria
from fastmech.slider.linearize import jacobian
from fastmech.transients.lyapunov import largest_lyapunov, transient_growth

CONSERVATIVE = fm.Scene(c2=1100 / 3, beta=0.0, F0=0.0)


def lorenz(t: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    return 10.0 * (y - x), x * (28.0 - z) - y, x * y - 8.0 / 3.0 * z


def henon_heiles(t: float, x: float, y: float, u: float, v: float) -> tuple[float, float, float, float]:
    return u, v, -x - 2.0 * x * y, -y - x * x + y * y


def damped(t: float, x: float, v: float) -> tuple[float, float]:
    return v, -4.0 * x - 0.2 * v


def test_lorenz() -> None:
    """0.9056 for the standard parameters (Sprott, Chaos and Time-Series Analysis, 2003)."""
    system = fm.System(lorenz, ["x", "y", "z"], {})
    starts = np.random.default_rng(0).uniform([-5, -5, 15], [5, 5, 30], (16, 3))
    found = largest_lyapunov(system, starts, 300.0, 0.01)
    spread = found.largest.std() / 4.0
    assert found.largest.mean() == pytest.approx(0.9056, abs=4 * spread)
    assert spread < 0.01


def test_henon_heiles_against_scipy_s_tangent_flow() -> None:
    """Finite time, E = 1/8, chaotic and regular starts: the same number from the variational equations."""

    def variational(t: float, s: np.ndarray) -> np.ndarray:
        x, y, u, v = s[:4]
        J = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-1 - 2 * y, -2 * x, 0, 0], [-2 * x, -1 + 2 * y, 0, 0]])
        return np.concatenate([[u, v, -x - 2 * x * y, -y - x * x + y * y], J @ s[4:]])

    first = 1.0 / np.sqrt(np.arange(2.0, 6.0))
    starts = np.array([[0.0, -0.25, 0.42, 0.0], [0.0, 0.1, 0.48, 0.1]])
    found = largest_lyapunov(fm.System(henon_heiles, ["x", "y", "u", "v"], {}), starts, 100.0, 0.05)
    for i, start in enumerate(starts):
        begin = np.concatenate([start, first / np.linalg.norm(first)])
        solution = solve_ivp(variational, (0, 100), begin, method="DOP853", rtol=1e-12, atol=1e-12)
        expected = np.log(np.linalg.norm(solution.y[4:, -1])) / 100.0
        assert found.largest[i] == pytest.approx(expected, abs=1e-6)
    assert found.largest[0] > 2 * found.largest[1]


#: Largest exponent of the Henon-Heiles system over 1e4 s from x = 0, y = -0.25, p_y = 0, p_x > 0, E = 1/8, as
#: printed by the package pynamicalsys (github.com/mrolims/pynamicalsys, commit 0b83e01ae401, notebook
#: tests/hamiltonian_systems/test_lyapunov.ipynb, outputs 7, 12 and 16): with RK4, with Yoshida's fourth-order
#: and with the Verlet method. The motion is chaotic, so each method has its own, and they scatter as
#: neighbouring motions do. The figure of Skokos, Bountis, Antonopoulos, Physica D 231 (2007), 30-54, usually
#: cited for this start, was not at hand to be read.
PRINTED = (0.03787512, 0.0521435, 0.05969748)


def test_henon_heiles_as_printed() -> None:
    """Within three standard errors of the difference of two means: 16 motions within 1e-9 of the start."""
    y = np.append(-0.25, -0.25 + 1e-9 * np.random.default_rng(1).normal(size=15))
    u = np.sqrt(2.0 / 8.0 - y**2 + 2.0 * y**3 / 3.0)  # so that E = 1/8
    starts = np.stack([0.0 * y, y, u, 0.0 * y], axis=1)
    found = largest_lyapunov(fm.System(henon_heiles, ["x", "y", "u", "v"], {}), starts, 1e4, 0.1).largest
    error = found.std(ddof=1) * np.sqrt(1.0 / found.size + 1.0 / len(PRINTED))
    assert found.mean() == pytest.approx(np.mean(PRINTED), abs=3.0 * error)
    assert error < 0.01


def test_a_linear_system_decays_at_its_rate() -> None:
    found = largest_lyapunov(fm.System(damped, ["x", "v"], {}), [1.0, 0.0], 400.0, 0.02)
    assert found.largest[0] == pytest.approx(-0.1, abs=2e-3)


def test_the_mechanism() -> None:
    """Energetic undamped motion is chaotic, small oscillation is not; doubling the time halves the latter."""
    starts = np.array([[0.3, 2.5, 3.0, -4.0], [0.966643893412244, 0.4487989505128276, 0.0, 0.0]])
    found = largest_lyapunov(CONSERVATIVE, starts, 400.0, 0.01)
    assert found.largest[0] > 0.3
    assert found.largest[1] < 0.03
    assert found.exponents.shape == (20, 2)


def test_wrong_arguments() -> None:
    with pytest.raises(InputError, match=r"^dt = 0: "):
        largest_lyapunov(CONSERVATIVE, [0, 0, 0, 0], 1.0, 0)
    with pytest.raises(InputError, match=r"^parameters = 3: must map names to values"):
        largest_lyapunov(CONSERVATIVE, [0, 0, 0, 0], 1.0, parameters=3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"^dt = 1e-300: .* more than 1e\+13 steps"):
        largest_lyapunov(CONSERVATIVE, [0, 0, 0, 0], 1e300, 1e-300)
    with pytest.raises(InputError, match=r"^scene = 3: must be a Scene, a Mechanism or a System"):
        largest_lyapunov(3, [0, 0, 0, 0], 1.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("slower", [0.01, 50.0])
def test_the_default_step_follows_the_scene(slower: float) -> None:
    """The same device with all times so many times as long has exponents over that."""
    scene, start = fm.Scene(alpha=0.0), np.array([0.9, 0.4, 1.0, 0.5])
    T = slower
    similar = scene.replace(
        g=scene.g / T**2, c1=scene.c1 / T**2, c2=scene.c2 / T**2, beta=scene.beta / T, F0=scene.F0 / T**2
    )
    names = ("m1", "m2", "m3", "l", "c1", "c2", "beta", "g", "F0")
    values = {name: getattr(similar, name) for name in names}
    mechanism = fm.mechanisms.slider_pendulum().replace(**values, alpha=0.0)
    there = start / [1.0, 1.0, T, T]
    for system in (similar, mechanism):
        found = largest_lyapunov(system, there, 5.0 * T)
        assert found.status.tolist() == [fm.Status.OK]
        assert np.isfinite(found.largest).all()
        fine = largest_lyapunov(system, there, 5.0 * T, 0.005 * T)
        np.testing.assert_allclose(found.exponents, fine.exponents, rtol=1e-4, atol=1e-6 / T)


def test_motions_that_fail_have_a_status() -> None:
    """Two fail, one of them at the start; steps too long are warned of; what shows has a status."""
    starts = [[0.9, 0.4, 0.0, 0.0], [np.nan, 0.0, 0.0, 0.0], [0.0, 0.0, 1e200, 0.0]]
    found = largest_lyapunov(CONSERVATIVE, starts, 1.0)
    assert found.status.tolist() == [fm.Status.OK, fm.Status.START_NOT_FINITE, fm.Status.NOT_FINITE]
    assert np.isfinite(found.largest).tolist() == [True, False, False]
    assert "2 of 3 trajectories failed: 1 not_finite, 1 start_not_finite" in " ".join(repr(found).split())
    with pytest.warns(fm.StepWarning, match=r"too long for dop853 here"):
        largest_lyapunov(fm.Scene(alpha=0.0, beta=1e4), [0.8, -1.4, 0.0, 0.0], 0.5, 0.02)
    with pytest.warns(fm.StepWarning, match=r"too long for dop853 here"):
        turning = largest_lyapunov(CONSERVATIVE, [0.9, 0.4, 30.0, 0.0], 0.5, 0.05)
    assert turning.status.tolist() == [fm.Status.STEP_TOO_LARGE]
    assert np.isfinite(turning.largest).all()
    assert turning.failures


@pytest.mark.parametrize("change", [{}, {"beta": 0.0}, {"c1": 294.9, "c2": 92.85, "F0": 85.3}])
def test_transient_growth(change: dict[str, float]) -> None:
    """At a passive minimum the energy norm never grows; at a saddle at least as the eigenvalue says."""
    scene = fm.Scene(alpha=0.0).replace(**change)
    kinds = set()
    for e in find_equilibria(scene):
        growth = transient_growth(scene, e, 2.0)
        fastest = float(np.linalg.eigvals(jacobian(scene, e)).real.max())
        kinds.add(e.kind)
        if e.morse_index == 0:
            assert growth.reactivity == pytest.approx(0.0, abs=1e-12)
            assert growth.amplification == pytest.approx(1.0, abs=1e-12)
        else:
            assert growth.reactivity >= fastest - 1e-9
            assert growth.amplification >= np.exp(2.0 * fastest) * (1 - 1e-9)
            flow = scipy.linalg.expm(2.0 * jacobian(scene, e))
            assert growth.amplification <= np.linalg.cond(flow) * np.exp(2.0 * growth.reactivity)
    assert {"minimum", "saddle"} <= kinds


def test_growth_about_a_mechanism_s_equilibria() -> None:
    """As of the paper's scene; never of an undamped minimum; without a potential there is no energy norm."""
    scene = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)
    paper = fm.mechanisms.slider_pendulum()
    paper = paper.replace(**{name: scene.parameters[name] for name in paper.parameters})

    def at(system: fm.Mechanism, q: Any, index: int | None) -> RestingPlace:
        return RestingPlace(np.array(q), 0.0, system.linear(q).stiffness, 0, index)

    for one in find_equilibria(scene):
        found = transient_growth(paper, at(paper, one.position, one.morse_index), 2.0)
        expected = transient_growth(scene, one, 2.0)
        assert found.amplification == pytest.approx(expected.amplification, rel=1e-9)
        assert (found.reactivity, found.time) == pytest.approx((expected.reactivity, expected.time), abs=1e-9)
    truss, column = fm.mechanisms.von_mises_truss(), fm.mechanisms.ziegler_column()
    up = at(truss, [0.0, 0.5], 0)
    assert transient_growth(truss, up).time == 0.0
    for index in (None, -2):
        with pytest.raises(
            InputError, match=r"^ziegler_column: disturbances have no energy norm here; that "
        ):
            transient_growth(column, at(column, [0.0, 0.0], index))
    with pytest.raises(InputError, match=r": is another mechanism's$"):
        transient_growth(paper, up)


@pytest.mark.parametrize("until", [0.0, -1.0, np.nan, np.inf, "a"])
def test_growth_has_an_end(until: object) -> None:
    scene = fm.Scene(alpha=0.0)
    with pytest.raises(fm.InputError, match=r"^until = .* s greater than 0$"):
        transient_growth(scene, fm.find_equilibria(scene)[0], until)  # type: ignore[arg-type]
