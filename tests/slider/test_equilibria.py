"""Equilibria of single scenes against references that were computed elsewhere."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import oracle
from slider.draws import held_scenes

from fastmech.errors import InputError
from fastmech.outcome import Outcome
from fastmech.scene import Scene
from fastmech.slider.atlas.map import map_equilibria
from fastmech.slider.equilibria import Equilibria, find_equilibria

DATA = Path(__file__).parents[2] / "data" / "equilibria.toml"
REFERENCE = {entry["name"]: entry for entry in tomllib.loads(DATA.read_text())["scene"]}

PAPER = Scene(c2=1100 / 3, alpha=0.0)
WEIGHT = 22 * 9.80665  # (m1 + m2) g of Table 1 [N]


def on_torus(angle: float) -> float:
    return math.remainder(angle, 2 * math.pi)


@pytest.mark.parametrize("name", REFERENCE)
def test_reference_scene(name: str) -> None:
    entry = REFERENCE[name]
    found = find_equilibria(Scene(**entry["parameters"]))
    assert found.certificate.outcome is Outcome.COMPLETE
    assert len(found) == found.certificate.expected == len(entry["equilibria"])
    unmatched = list(found)
    for expected in entry["equilibria"]:
        phi, theta = float(expected["phi"]), float(expected["theta"])
        near = [e for e in unmatched if abs(on_torus(e.phi - phi)) + abs(on_torus(e.theta - theta)) < 1e-9]
        assert len(near) == 1, (phi, theta)
        unmatched.remove(near[0])
        assert near[0].morse_index == expected["morse_index"]
        # The proved radius holds for the reference of 30 digits; wrapping costs two roundings of pi.
        distance = math.hypot(on_torus(near[0].phi - phi), on_torus(near[0].theta - theta))
        assert distance <= near[0].radius + 1e-15


def test_table_2_to_the_printed_digit() -> None:
    printed = {(0.68803, -2.91483), (1.45058, -0.23257), (-1.35581, -2.52980), (-2.44693, 1.52262)}
    assert {(round(e.phi, 5), round(e.theta, 5)) for e in find_equilibria(PAPER)} == printed


def test_table_3_to_the_printed_digit() -> None:
    found = sorted(find_equilibria(PAPER), key=lambda e: -e.phi)  # cases 2, 1, 3, 4
    printed = [
        [[554.30, 238.27], [238.27, 410.22]],
        [[87.916, -201.204], [-201.204, -316.435]],  # what the paper printed for case 1 is case 3
        [[-97.63, 171.96], [171.96, 123.33]],
        [[-492.81, -202.66], [-202.66, -320.45]],
    ]
    np.testing.assert_allclose([e.hessian for e in found], printed, atol=0.01)
    assert [e.kind for e in found] == ["minimum", "saddle", "saddle", "maximum"]


def test_energy_and_hessian_against_the_oracle() -> None:
    found = find_equilibria(PAPER)
    params = PAPER.parameters
    for e in found:
        assert e.energy == pytest.approx(
            float(oracle().potential(params, (e.phi, e.theta), F=100.0)), rel=1e-14
        )
        hessian = np.array(oracle().hessian(params, (e.phi, e.theta), F=100.0), dtype=float)
        np.testing.assert_allclose(e.hessian, hessian, rtol=1e-13)
    assert list(found.energy) == sorted(found.energy)


def test_radius_encloses_the_root_at_forty_digits() -> None:
    scene = Scene(m1=0.3, m2=40.0, m3=2.0, l=0.7, c1=9000.0, c2=3.0, F0=-700.0, alpha=0.0)
    params = scene.parameters
    for e in find_equilibria(scene):
        with mpmath.workdps(40):
            root = mpmath.findroot(
                lambda phi, theta: oracle().gradient(params, (phi, theta), F=-700.0), (e.phi, e.theta)
            )
            assert mpmath.norm(root - mpmath.matrix([e.phi, e.theta])) <= e.radius < 1e-12


@pytest.mark.parametrize(
    ("changes", "count"),
    [
        ({"F0": 0.0}, 6),
        ({"F0": 1.38}, 6),
        ({"F0": 1.42}, 4),
        ({"c1": 0.0}, 4),
        ({"c2": 0.0}, 6),
        ({"c1": 0.0, "c2": 0.0}, 4),
        ({"F0": 0.0, "c2": WEIGHT / 1.25}, 4),
        ({"c1": math.hypot(100.0, 12 * 9.80665) / 1.25}, 4),
        ({"g": 0.0}, 4),
        ({"c1": 1e-9}, 4),
        ({"c1": 1e12}, 4),
        ({"c2": 1e12}, 4),
    ],
)
def test_count(changes: dict[str, float], count: int) -> None:
    found = find_equilibria(PAPER.replace(**changes))
    assert found.certificate.complete
    assert len(found) == count


def test_six_can_be_two_minima_or_two_maxima() -> None:
    kinds = find_equilibria(PAPER.replace(F0=0.0)).kind
    assert (kinds.count("minimum"), kinds.count("saddle"), kinds.count("maximum")) == (1, 3, 2)
    kinds = find_equilibria(PAPER.replace(F0=85.3, c1=294.9, c2=92.85)).kind
    assert (kinds.count("minimum"), kinds.count("saddle"), kinds.count("maximum")) == (2, 3, 1)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        (
            {"c1": 0.0, "F0": 0.0, "c2": WEIGHT / 1.25},
            "c1 = 0, F = 0, (m1 + m2) g = c2 l, the last within rounding",
        ),
        (
            {"c1": 0.0, "F0": 0.0, "c2": 22 * 9.8125, "g": 9.8125, "l": 1.0},
            "c1 = 0, F = 0, (m1 + m2) g = c2 l",
        ),
        ({"g": 0.0, "F0": 0.0, "c1": 0.0}, "c1 = 0, F = 0, g = 0"),
        ({"g": 0.0, "F0": 0.0, "c2": 0.0}, "F = 0, g = 0, c2 = 0"),
    ],
)
def test_degenerate_scene_names_its_condition(changes: dict[str, float], named: str) -> None:
    found = find_equilibria(PAPER.replace(**changes))
    assert found.certificate.outcome is Outcome.DEGENERATE
    assert found.certificate.sentence == f"equilibria are not isolated: {named}"
    assert len(found) == 0


def test_force_is_frozen_at_a_time() -> None:
    decaying = PAPER.replace(alpha=0.7)
    assert find_equilibria(decaying).force == 0.0
    assert len(find_equilibria(decaying)) == 6
    assert find_equilibria(decaying, at=0).force == 100.0
    assert find_equilibria(decaying, at=2.0).force == pytest.approx(100.0 * math.exp(-1.4), rel=1e-15)
    assert find_equilibria(PAPER).force == find_equilibria(PAPER, at=5.0).force == 100.0
    shown, left = repr(find_equilibria(decaying)), "(F0 = 100 N, alpha = 0.7 1/s)"
    assert f"force F = 0 N on M2, decayed {left}" in shown
    assert len(shown.splitlines()) <= 6
    assert "theta = 0 rad" in shown  # rounding leaves 3e-31
    assert "theta = 0 rad" in repr(find_equilibria(decaying)[0])
    assert f"force F = 24.6597 N on M2, frozen at t = 2 s {left}" in repr(find_equilibria(decaying, at=2.0))
    assert "force" not in repr(find_equilibria(PAPER))
    assert f"force F = 0 N on M2, decayed {left}" in repr(map_equilibria(decaying, {"c1": [100.0]}))


@pytest.mark.parametrize("at", [-1.0, math.nan, "soon", None])
def test_wrong_time_is_refused(at: float) -> None:
    with pytest.raises(InputError, match=r"^at = .*: must be a time >= 0 s"):
        find_equilibria(PAPER, at=at)


@pytest.mark.parametrize("change", [{"c1": 1e30, "m2": 1e-30}, {"l": 1e-30, "F0": -1e30}, {"m1": 1e30}])
def test_the_most_extreme_scenes_are_answered(change: dict[str, float]) -> None:
    """At the bounds of what a scene may hold nothing leaves double precision."""
    certificate = find_equilibria(PAPER.replace(**change)).certificate
    assert certificate.outcome in (Outcome.COMPLETE, Outcome.AT_FOLD)
    assert certificate.expected == 4


def test_is_a_sequence() -> None:
    found = find_equilibria(PAPER)
    assert isinstance(found, Equilibria)
    assert found[0] is next(iter(found))
    assert [e.phi for e in found[1:]] == list(found.phi[1:])
    assert found.hessian.shape == (4, 2, 2)
    assert list(found.morse_index) == [0, 1, 1, 2]


@settings(max_examples=200, deadline=None)
@given(held_scenes())
def test_mirrored_force_mirrors_the_equilibria(scene: Scene) -> None:
    right, left = find_equilibria(scene), find_equilibria(scene.replace(F0=-scene.F0))
    assert right.certificate.outcome == left.certificate.outcome
    mirrored = {
        (e.kind, round(math.sin(e.phi), 6), round(math.sin(-e.theta), 6)) for e in left if e.radius < 1e-7
    }
    straight = {
        (e.kind, round(math.sin(e.phi), 6), round(math.sin(e.theta), 6)) for e in right if e.radius < 1e-7
    }
    for kind, phi, theta in straight:
        assert any(
            kind == other and abs(phi - p) < 3e-6 and abs(theta - t) < 3e-6 for other, p, t in mirrored
        )


@settings(max_examples=200, deadline=None)
@given(held_scenes(), st.floats(-20.0, 20.0).map(lambda power: 2.0**power))
def test_scaling_masses_stiffnesses_and_force_changes_nothing(scene: Scene, factor: float) -> None:
    changes = {name: factor * getattr(scene, name) for name in ("m1", "m2", "m3", "c1", "c2", "F0")}
    first, second = find_equilibria(scene), find_equilibria(scene.replace(**changes))
    assert first.kind == second.kind
    for e in first:
        if e.radius < 1e-7:  # mirror images have one energy: rounding orders them
            assert any(
                abs(on_torus(e.phi - f.phi)) + abs(on_torus(e.theta - f.theta)) <= 2 * (e.radius + f.radius)
                for f in second
                if f.kind == e.kind
            )


#: Beside c1 = 0, F = 0, c2 = (m1 + m2) g/l, where equilibria are not isolated: U is nearly flat.
BESIDE = [(2e-10, 0.0, 1e-12), (2e-10, 0.0, -1e-12), (2e-10, 0.0, 2e-12), (2e-10, 1e-12, 1e-12)]


@pytest.mark.parametrize(("c1", "F0", "away"), BESIDE)
def test_beside_the_degenerate_set_the_list_is_proved(c1: float, F0: float, away: float) -> None:
    """Forty digits count four equilibria there, each in its ball; Newton's method stops along the valley."""
    scene = Scene(c1=c1, F0=F0, c2=22 * 9.80665 / 1.25 * (1 + away), alpha=0.0)
    found = find_equilibria(scene)
    with mpmath.workdps(40):
        m1, m2, l, g, c2, f = (
            mpmath.mpf(getattr(scene, name)) for name in ("m1", "m2", "l", "g", "c2", "F0")
        )
        a, b, C = (m1 + m2) * g - c2 * l, m2 * g, mpmath.mpf(scene.c1) * l

        def theta(phi: Any, side: int) -> Any:
            """b sin theta + f cos theta = a cos phi + f sin phi, on one of two sides."""
            pull = mpmath.asin((a * mpmath.cos(phi) + f * mpmath.sin(phi)) / mpmath.hypot(b, f))
            return (pull if side else mpmath.pi - pull) - mpmath.atan2(f, b)

        def left(phi: Any, side: int) -> Any:
            return a * mpmath.cos(phi) + f * mpmath.sin(phi) - C * mpmath.cos(phi + theta(phi, side))

        roots = []
        grid = [mpmath.mpf(k) / 100 for k in range(-314, 316)]
        for side in (0, 1):
            values = [left(phi, side) for phi in grid]
            for k in range(len(grid) - 1):
                if values[k] * values[k + 1] < 0:
                    phi = mpmath.findroot(lambda x: left(x, side), grid[k : k + 2], solver="anderson")  # noqa: B023
                    roots.append((float(phi), float(theta(phi, side))))
    assert (len(roots), len(found), found.certificate.outcome) == (4, 4, Outcome.COMPLETE)
    for e in found:
        apart = [
            abs(np.exp(1j * e.phi) - np.exp(1j * x)) + abs(np.exp(1j * e.theta) - np.exp(1j * y))
            for x, y in roots
        ]
        assert min(apart) <= e.radius
