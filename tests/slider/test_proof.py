"""The completeness proof: complete where it should be, never where something is missing or wrong."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from slider.scenes import unit_roots

from fastmech.outcome import Outcome
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.equilibria import find_equilibria
from fastmech.slider.solve import Roots, certify, existence_radius, solve_rows
from fastmech.slider.theorem import EPS, expected_count, normal_form, pulls

PAPER = Scene(c2=1100 / 3, alpha=0.0)
SCENES = 2000


def random_coefficients(n: int, seed: int) -> NDArray[np.float64]:
    """Four decades of stiffness, both signs of the force, l 0.2-4 m, masses 0.1-100 kg."""
    rng = np.random.default_rng(seed)
    scene: Any = SimpleNamespace(
        m1=10 ** rng.uniform(-1, 2, n),
        m2=10 ** rng.uniform(-1, 2, n),
        m3=10 ** rng.uniform(-1, 2, n),
        l=rng.uniform(0.2, 4.0, n),
        c1=10 ** rng.uniform(0, 4, n),
        c2=10 ** rng.uniform(0, 4, n),
        beta=np.full(n, 100.0),
        g=np.full(n, 9.80665),
        F0=rng.choice([-1.0, 1.0], n) * 10 ** rng.uniform(-1, 4, n),
        alpha=np.zeros(n),
    )
    columns: Any = reduce(scene)
    return np.ascontiguousarray(np.stack(columns, axis=1))


@pytest.fixture(scope="module")
def coefficients() -> NDArray[np.float64]:
    return random_coefficients(SCENES, seed=7)


@pytest.fixture(scope="module")
def solution(coefficients: NDArray[np.float64]) -> Roots:
    return solve_rows(coefficients)


def test_random_scenes_are_proved(solution: Roots) -> None:
    proved = np.count_nonzero(solution.outcome == Outcome.COMPLETE) / SCENES
    print(f"proved complete: {100 * proved:.2f} % of {SCENES} random scenes")
    assert proved >= 0.999
    assert set(np.unique(solution.count)) == {4, 6}


def grid_newton(a: float, C: float, b: float, f: float, starts: int = 40) -> list[tuple[float, float]]:
    """Equilibria by plain Newton from a grid of starts: knows nothing of the counting theorem."""
    x = np.linspace(-np.pi, np.pi, starts, endpoint=False) + 0.05
    phi, theta = (v.ravel() for v in np.meshgrid(x, x))
    with np.errstate(all="ignore"):
        for _ in range(60):
            g1 = a * np.cos(phi) + f * np.sin(phi) - C * np.cos(phi + theta)
            g2 = b * np.sin(theta) + f * np.cos(theta) - C * np.cos(phi + theta)
            h12 = C * np.sin(phi + theta)
            h11 = f * np.cos(phi) - a * np.sin(phi) + h12
            h22 = b * np.cos(theta) - f * np.sin(theta) + h12
            d = h11 * h22 - h12**2
            phi, theta = phi - (h22 * g1 - h12 * g2) / d, theta - (h11 * g2 - h12 * g1) / d
    good = np.abs(g1) + np.abs(g2) < 1e-11 * max(abs(a), C, b, abs(f))
    roots: list[tuple[float, float]] = []
    for p, t in zip(phi[good], theta[good], strict=True):
        if all(
            abs(math.remainder(p - q, math.tau)) + abs(math.remainder(t - r, math.tau)) > 1e-6
            for q, r in roots
        ):
            roots.append((p, t))
    return roots


def test_grid_search_finds_nothing_else(coefficients: NDArray[np.float64], solution: Roots) -> None:
    for row in range(60):
        _, _, lift, spring, gravity, force, _, _ = coefficients[row]
        for phi, theta in grid_newton(lift, spring, gravity, force):
            near = np.abs(np.exp(1j * solution.phi[row]) - np.exp(1j * phi)) + np.abs(
                np.exp(1j * solution.theta[row]) - np.exp(1j * theta)
            )
            assert np.nanmin(near) < 1e-6


def test_counts_agree_with_the_polynomial_at_fifty_digits(
    coefficients: NDArray[np.float64], solution: Roots
) -> None:
    for row in range(40):
        _, _, lift, spring, gravity, force, _, _ = coefficients[row]
        assert len(unit_roots(lift, gravity, spring, force)) == solution.count[row]


def listed(scene: Scene) -> tuple[Any, Any, list[float], list[float]]:
    c = reduce(scene)
    p = pulls(c.mass, c.lift, c.spring, c.gravity, c.force)
    found = find_equilibria(scene)
    return p, normal_form(p), list(found.phi), list(found.theta)


def outcome(p: Any, n: Any, phi: list[float], theta: list[float]) -> Outcome:
    return Outcome(certify(p, n, len(phi), np.array(phi), np.array(theta), np.empty(len(phi))))


@pytest.mark.parametrize("force", [100.0, 0.0, 1.3])
def test_a_wrong_list_is_never_complete(force: float) -> None:
    p, n, phi, theta = listed(PAPER.replace(F0=force))
    count = len(phi)
    assert outcome(p, n, phi, theta) is Outcome.COMPLETE
    for i in range(count):
        assert outcome(p, n, phi[:i] + phi[i + 1 :], theta[:i] + theta[i + 1 :]) is Outcome.UNPROVED
        j = (i + 1) % count
        twice = (
            [phi[j] if k == i else phi[k] for k in range(count)],
            [theta[j] if k == i else theta[k] for k in range(count)],
        )
        assert outcome(p, n, *twice) is Outcome.UNPROVED
        false = [x + 0.3 * (k == i) for k, x in enumerate(phi)]
        assert outcome(p, n, false, theta) is Outcome.UNPROVED
        # A nearly right entry of 1e-9 rad is proved, with a radius that says so.
        near = [x + 1e-9 * (k == i) for k, x in enumerate(phi)]
        assert outcome(p, n, near, theta) is Outcome.COMPLETE


def test_two_more_appear_exactly_at_the_fold() -> None:
    low, high = 1.3, 1.5
    while (middle := 0.5 * (low + high)) not in (low, high):
        if find_equilibria(PAPER.replace(F0=middle)).certificate.fold_margin > 0.0:
            low = middle
        else:
            high = middle
    at = find_equilibria(PAPER.replace(F0=low))
    assert at.certificate.outcome is Outcome.AT_FOLD
    assert at.certificate.expected is None
    assert sorted(at.kind) == ["degenerate", "maximum", "minimum", "saddle", "saddle"]
    merged = next(e for e in at if e.kind == "degenerate")
    assert abs(np.linalg.det(merged.hessian)) < 1e-6 * np.abs(merged.hessian).max() ** 2
    for step in 10.0 ** np.arange(-9, 0):
        six, four = (
            find_equilibria(PAPER.replace(F0=low - step)),
            find_equilibria(PAPER.replace(F0=low + step)),
        )
        assert (len(six), len(four)) == (6, 4)
        assert six.certificate.complete
        assert four.certificate.complete


def test_pitchfork_of_the_unforced_scene() -> None:
    # a = b = 10, C = 5: 1/A1 = 1/A2 + 1/A3, three equilibria merge at one.
    scene = Scene(m1=1.0, m2=1.0, l=1.0, g=10.0, c1=5.0, c2=10.0, F0=0.0, alpha=0.0)
    at = find_equilibria(scene)
    assert at.certificate.outcome is Outcome.AT_FOLD
    assert at.kind == ("degenerate", "saddle", "saddle", "maximum")
    assert len(find_equilibria(scene.replace(c1=5.001))) == 6
    assert len(find_equilibria(scene.replace(c1=4.999))) == 4


def test_corner_where_two_amplitudes_agree() -> None:
    """a = b, F = 0 keeps two amplitudes equal: branches have corners, the count does not care."""
    scene = Scene(m1=1.0, m2=1.0, l=1.0, g=10.0, c1=20.0, c2=10.0, F0=0.0, alpha=0.0)
    found = find_equilibria(scene)
    assert found.certificate.complete
    assert len(found) == 6


@pytest.mark.parametrize(
    "c1", [math.sqrt(2.0), np.nextafter(math.sqrt(2.0), 0.0), np.nextafter(math.sqrt(2.0), 2.0)]
)
def test_all_laps_meet_in_one_point(c1: float) -> None:
    """Equal amplitudes and D = pi: the whole Hessian vanishes and every lap of two branches ends there."""
    scene = Scene(m1=1.0, m2=1.0, l=1.0, g=1.0, c1=float(c1), c2=3.0, F0=1.0, alpha=0.0)
    found = find_equilibria(scene)
    assert found.certificate.outcome is Outcome.AT_FOLD
    merged = [e for e in found if e.kind == "degenerate"]
    assert len(merged) == 1
    np.testing.assert_allclose(merged[0].hessian, 0.0, atol=1e-4)


def test_expected_count_in_plain_python() -> None:
    c = reduce(PAPER)
    assert expected_count(normal_form(pulls(c.mass, c.lift, c.spring, c.gravity, c.force))) == 4


def test_the_radius_does_not_tell_where_the_search_began(
    coefficients: NDArray[np.float64], solution: Roots
) -> None:
    """Places within rounding of one another have one radius: verdicts at rounding's edge rest on it."""
    rng = np.random.default_rng(3)
    for row in range(0, SCENES, 10):
        p = pulls(*coefficients[row][[0, 2, 3, 4, 5]])
        for phi, theta in zip(solution.phi[row], solution.theta[row], strict=True):
            if math.isnan(phi):
                continue
            aside = EPS * rng.uniform(-1.0, 1.0, (8, 2))
            told = [existence_radius(p, phi + one, theta + other)[0] for one, other in aside]
            assert max(told) <= min(told) * (1.0 + 1e-6)
