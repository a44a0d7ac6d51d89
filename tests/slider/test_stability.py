"""Verdicts on stability: the paper's cases, the special scenes, and what the criteria must agree on."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import oracle
from slider.draws import decades, held_scenes

import fastmech as fm
from fastmech.errors import InputError
from fastmech.scene import Scene
from fastmech.slider.equilibria import Equilibrium, find_equilibria
from fastmech.slider.linearize import SIN_PHI, SIN_PSI, UNLOADED, jacobian
from fastmech.slider.stability import Classification, classify
from fastmech.studies.hardcases.limits import measured_stable_step

PAPER = Scene(c2=1100 / 3, alpha=0.0)


def cases() -> dict[int, Classification]:
    """The paper's cases 1 to 4."""
    ordered = sorted(find_equilibria(PAPER), key=lambda e: -e.phi)
    return {case: classify(PAPER, e) for case, e in zip((2, 1, 3, 4), ordered, strict=True)}


def test_table_4_to_its_printed_digits() -> None:
    printed = {
        1: [4.634, -30.063, -78.206, -111.798],  # what the paper printed for case 1 is case 3
        3: [5.57, -0.13725, 36.64, -54.391],
        4: [1.13, -59.192, -19.307, 257.085],
    }
    for case, coefficients in printed.items():
        np.testing.assert_allclose(cases()[case].polynomial, [1.0, *coefficients], atol=1.1e-3)
    # Case 2 lost characters in print: 6.6..1, 36.5..4, 145.864, 28..85.
    np.testing.assert_allclose(cases()[2].polynomial, [1.0, 6.66706, 36.53999, 145.864, 284.85], atol=1e-3)


def test_paper_verdicts() -> None:
    found = cases()
    assert {case: c.verdict for case, c in found.items()} == {
        1: "unstable",
        2: "asymptotically stable",
        3: "unstable",
        4: "unstable",
    }
    assert found[2].sylvester.verdict == "stable"
    assert found[2].hurwitz.verdict == found[2].spectrum.verdict == "asymptotically stable"
    assert found[2].decay_rate == pytest.approx(0.11702822, rel=1e-6)
    assert found[2].decay_time == pytest.approx(1.0 / 0.11702822, rel=1e-6)
    assert "Kelvin-Tait-Chetaev" in found[4].explanation


def test_numbers_against_numpy() -> None:
    for c in cases().values():
        p3, p2, p1, p0 = c.polynomial[1:]
        hurwitz = np.array([[p3, p1, 0, 0], [1, p2, p0, 0], [0, p3, p1, 0], [0, 1, p2, p0]])
        determinants = [np.linalg.det(hurwitz[:k, :k]) for k in range(1, 5)]
        np.testing.assert_allclose(c.hurwitz_determinants, determinants, rtol=1e-9)
        roots = np.roots(c.polynomial)
        roots = roots[np.lexsort((-roots.imag, -roots.real))]
        np.testing.assert_allclose(c.eigenvalues, roots, rtol=1e-8)


def test_undamped_scene_is_stable_only() -> None:
    scene = PAPER.replace(beta=0.0)
    c = classify(scene, find_equilibria(scene)[0])
    assert (c.verdict, c.sylvester.verdict) == ("stable", "stable")
    assert (c.hurwitz.verdict, c.spectrum.verdict) == ("critical", "critical")
    assert "beta = 0" in c.explanation
    assert c.unreached is None
    assert (c.decay_rate, c.decay_time) == (0.0, np.inf)
    np.testing.assert_allclose(sorted(c.eigenvalues.imag)[2:], c.natural_frequencies, rtol=1e-10)


MISSED = {
    SIN_PHI: ((166.722372, 162.5, 17.35486052), (0.0, 0.3), (2.597, 3.030)),
    SIN_PSI: ((89.2075641978, 96.0, 50.0327795757), (-0.3, 0.3), (2.3953,)),
    UNLOADED: ((60.0, 120.0, 78.4532), (-2.21414614, -1.58635572), (3.1623,)),
    UNLOADED + " hanging": ((40.0, 52.5104064692, 31.79704), (-np.pi / 2, -0.65530742), (2.0919,)),
    UNLOADED + " symmetric": ((0.0, 47.07192, 44.59704), (-np.pi / 2, 0.0), (1.9806,)),
}


def nearest(scene: Scene, phi: float, theta: float) -> Equilibrium:
    return min(find_equilibria(scene), key=lambda e: abs(e.phi - phi) + abs(e.theta - theta))


@pytest.mark.parametrize("name", MISSED)
def test_a_missed_mode_is_recognised_and_named(name: str) -> None:
    (F0, c1, c2), (phi, theta), undamped = MISSED[name]
    scene = Scene(F0=F0, c1=c1, c2=c2, alpha=0.0)
    e = nearest(scene, phi, theta)
    assert (e.phi, e.theta) == pytest.approx((phi, theta), abs=1e-8)
    c = classify(scene, e)
    assert (c.sylvester.verdict, c.hurwitz.verdict, c.spectrum.verdict) == ("stable", "critical", "critical")
    assert c.verdict == "asymptotically stable"
    assert c.unreached is not None
    assert name.startswith(c.unreached)
    assert c.reach[c.unreached] < 1e-9 < min(v for k, v in c.reach.items() if k != c.unreached)
    assert "algebraic" in c.explanation
    for frequency in undamped:
        assert np.abs(c.natural_frequencies - frequency).min() < 1e-3


@pytest.mark.parametrize("name", MISSED)
@pytest.mark.parametrize("away", [1e-3, 1e-6])
def test_decay_rate_near_a_missed_mode_against_forty_digits(name: str, away: float) -> None:
    (F0, c1, c2), (phi, theta), _ = MISSED[name]
    scene = Scene(F0=F0, c1=c1 * (1.0 + away), c2=c2, alpha=0.0)
    e = nearest(scene, phi, theta)
    c = classify(scene, e)
    assert c.verdict == "asymptotically stable"
    params = scene.parameters
    with mpmath.workdps(40):
        root = mpmath.findroot(lambda x, y: oracle().gradient(params, (x, y), F=F0), (e.phi, e.theta))
        roots = mpmath.polyroots(
            oracle().characteristic_polynomial(params, tuple(root), F=F0), maxsteps=500, extraprec=200
        )
        slowest = float(-max(mpmath.re(z) for z in roots))
    # The closed form is right to first order in the gap, the eigenvalues to their own bound.
    assert c.decay_rate == pytest.approx(slowest, rel=2e-2, abs=c.eigenvalue_errors.max())


def test_closed_form_decay_where_eigenvalues_have_no_digits() -> None:
    (F0, c1, c2), (phi, theta), _ = MISSED[SIN_PSI]
    scene = Scene(F0=F0, c1=c1 * (1.0 + 1e-8), c2=c2, alpha=0.0)
    e = nearest(scene, phi, theta)
    c = classify(scene, e)
    assert c.unreached == SIN_PSI
    params = scene.parameters
    with mpmath.workdps(40):
        root = mpmath.findroot(lambda x, y: oracle().gradient(params, (x, y), F=F0), (e.phi, e.theta))
        roots = mpmath.polyroots(
            oracle().characteristic_polynomial(params, tuple(root), F=F0), maxsteps=500, extraprec=200
        )
        slowest = float(-max(mpmath.re(z) for z in roots))
    assert c.decay_rate == pytest.approx(slowest, rel=1e-5)
    assert 0.0 < c.decay_rate < 1e-15


def test_fold_gives_no_verdict() -> None:
    scene = Scene(m1=1.0, m2=1.0, l=1.0, g=10.0, c1=5.0, c2=10.0, F0=0.0, alpha=0.0)
    found = find_equilibria(scene)
    merged = next(e for e in found if e.kind == "degenerate")
    c = classify(scene, merged)
    assert (c.verdict, c.sylvester.verdict) == ("critical", "critical")
    assert "second order does not decide" in c.explanation
    assert np.isnan(c.decay_rate)


DAMPED = {
    "Table 1": PAPER,
    "rod unloaded": Scene(F0=60.0, c1=120.0, c2=78.4532, alpha=0.0),
    "near dead centre": Scene(
        m1=0.2103706201903843, m2=0.3072486776843184, m3=12.256981283333854, l=3.338837025172671,
        c1=349.29338294274726, c2=208.51225172109602, F0=1162.522905183408, alpha=0.0,
    ),
}  # fmt: skip


@pytest.mark.parametrize("beta", [1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9, 1e12])
@pytest.mark.parametrize("name", DAMPED)
def test_eigenvalues_and_their_verdict_against_fifty_digits(name: str, beta: float) -> None:
    """Their rates span 24 decades. By Kelvin-Tait-Chetaev each negative direction of U is one that grows."""
    scene = DAMPED[name].replace(beta=beta)
    params = scene.parameters
    for e in find_equilibria(scene):
        c = classify(scene, e)
        with mpmath.workdps(50):
            root = mpmath.findroot(
                lambda x, y: oracle().gradient(params, (x, y), F=scene.F0), (e.phi, e.theta)
            )
            polynomial = oracle().characteristic_polynomial(params, tuple(root), F=scene.F0)
            roots = mpmath.polyroots(polynomial, maxsteps=2000, extraprec=600)
            for value, error in zip(c.eigenvalues, c.eigenvalue_errors, strict=True):
                assert min(float(abs(mpmath.mpc(value) - z)) for z in roots) <= error
            # At the minima of the second scene damping misses a mode: rounding is left of the sign.
            noise = mpmath.mpf(10) ** -30
            growing = sum(mpmath.re(z) > noise for z in roots)
            silent = sum(abs(mpmath.re(z)) <= noise for z in roots)
        assert growing == e.morse_index
        assert silent == 0 or (name == "rod unloaded" and e.kind == "minimum")
        slowest = float(-max(mpmath.re(z) for z in roots))
        verdict = "unstable" if growing else "asymptotically stable"
        if silent or 0.0 < slowest < 1e-14:  # no double tells it from none
            verdict = "critical"
        assert (c.spectrum.verdict, c.hurwitz.verdict) == (verdict, verdict)
        if verdict == "asymptotically stable":
            assert c.decay_rate == pytest.approx(slowest, rel=1e-3)


@settings(max_examples=200)
@given(held_scenes(beta=st.one_of(st.just(0.0), decades)))
def test_kelvin_tait_chetaev(scene: Scene) -> None:
    """As many eigenvalues are unstable as the Hessian has negative ones, up to rounding."""
    for e in find_equilibria(scene):
        c = classify(scene, e)
        expected = {"minimum": ("stable", "asymptotically stable"), "degenerate": ("critical",)}
        if c.sylvester.verdict != "critical":
            assert c.verdict in expected.get(e.kind, ("unstable",))
        unstable = int(np.count_nonzero(c.eigenvalues.real > c.eigenvalue_errors))
        undecided = int(np.count_nonzero(np.abs(c.eigenvalues.real) <= c.eigenvalue_errors))
        if e.kind != "degenerate":
            assert unstable <= e.morse_index <= unstable + undecided


@settings(max_examples=200)
@given(held_scenes(beta=st.one_of(st.just(0.0), decades)))
def test_criteria_never_contradict_each_other(scene: Scene) -> None:
    for e in find_equilibria(scene):
        c = classify(scene, e)
        verdicts = {c.sylvester.verdict, c.hurwitz.verdict, c.spectrum.verdict, c.verdict}
        assert not ("unstable" in verdicts and verdicts & {"stable", "asymptotically stable"})


#: Functions that take an equilibrium, as calls with a scene and an equilibrium.
TAKERS: dict[str, Callable[..., Any]] = {
    "classify": classify,
    "disturb": lambda s, e: fm.disturb(s, e, 4, t_end=0.1),
    "disturbed_motion": lambda s, e: fm.disturbed_motion(s, e, [0.1, 0.0, 0.0, 0.0], [0.1]),
    "find_snap": fm.find_snap,
    "jacobian": jacobian,
    "kinetic_norm": fm.kinetic_norm,
    "largest_stable_step": lambda s, e: fm.largest_stable_step(s, e, "rk4"),
    "linear_range": lambda s, e: fm.linear_range(s, e, directions=2),
    "map_snapping": lambda s, e: fm.map_snapping(s, [1.0], [1.0], start=e),
    "measured_stable_step": lambda s, e: measured_stable_step(s, e, "rk4"),
    "transient_growth": fm.transient_growth,
}


@pytest.mark.parametrize("name", TAKERS)
@pytest.mark.parametrize("change", [{"F0": 85.0}, {"c1": 200.0}])
def test_an_equilibrium_of_another_scene_is_refused(name: str, change: dict[str, float]) -> None:
    scene = Scene(F0=0.0, c1=294.9, c2=92.85, alpha=0.0)
    foreign = find_equilibria(scene.replace(**change))[0]
    with pytest.raises(InputError, match=r"^equilibrium = \(.*\) rad, F = (85|0) N: [^\n]*$"):
        TAKERS[name](scene, foreign)
    with pytest.raises(InputError, match=r"^(equilibrium|start) = 3: must be "):
        TAKERS[name](scene, 3)


@pytest.mark.parametrize("name", TAKERS)
@pytest.mark.parametrize("change", [{"F0": 1e-6}, {"c1": 1e-6}, {"m1": 1e-7}, {"l": 1e-8}])
def test_one_of_almost_the_same_scene_is_refused_too(name: str, change: dict[str, float]) -> None:
    scene = Scene(F0=40.0, c1=294.9, c2=92.85, alpha=0.0)
    ((field, by),) = change.items()
    foreign = find_equilibria(scene.replace(**{field: getattr(scene, field) + by}))[0]
    force = r"40(\.000001)?" if field == "F0" else "40"
    with pytest.raises(InputError, match=rf"^equilibrium = \(.*\) rad, F = {force} N: [^\n]*$"):
        TAKERS[name](scene, foreign)


def test_only_the_force_of_a_weightless_scene_differs() -> None:
    """With phi = 0, theta = pi/2 and no weights the force pulls along both rods: any force has rest there."""
    scene = Scene(g=0.0, c1=100.0, c2=0.0, F0=50.0, alpha=0.0)
    there = next(e for e in find_equilibria(scene) if abs(e.phi) + abs(e.theta - np.pi / 2) < 1e-9)
    assert classify(scene, there).verdict != "critical"
    for other in (scene.replace(F0=-50.0), scene.replace(F0=0.0)):
        with pytest.raises(
            InputError, match=r"F = 50 N: this scene \(F0 = -?\d+ N, alpha = 0 1/s\) does not"
        ):
            classify(other, there)


def test_a_decaying_force_is_each_of_its_values() -> None:
    decaying = Scene(F0=100.0, alpha=0.7)
    for at in (0.0, 1.0, np.inf):
        for e in find_equilibria(decaying, at):
            assert classify(decaying, e).minors.size == 2
    for force in (101.0, -1.0):
        e = find_equilibria(decaying.replace(F0=force, alpha=0.0))[0]
        with pytest.raises(InputError, match=r"alpha = 0\.7 1/s\) does not rest there"):
            classify(decaying, e)


def test_the_proof_is_the_scenes_own() -> None:
    """What an equilibrium says of its index and radius is not taken for granted: a place is enough."""
    scene = PAPER.replace(F0=0.0, c2=22 * 9.80665 / 1.25, c1=1e-9)
    for e in find_equilibria(scene):
        lying = dataclasses.replace(e, morse_index=(e.morse_index + 1) % 3, radius=0.0)
        assert classify(scene, lying).verdict == classify(scene, e).verdict
