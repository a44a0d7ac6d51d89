from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from own_ends import depths, ends

import fastmech as fm
from fastmech.basins.label import number_wells, well_numbers, well_of_number
from fastmech.basins.shock import Shock, brute_force_shock, minimal_shock
from fastmech.disturbance.motion import kinetic_norm
from fastmech.slider.lagrange import kinetic_energy

PLACE = np.array([0.2, -0.1, 0.3])
AXES = np.array([1.0, 0.5, 2.0])


def ellipsoid(y: np.ndarray) -> np.ndarray:
    """4 within the ellipsoid of these half axes about the place, 9 outside."""
    return np.where((((y - PLACE) / AXES) ** 2).sum(axis=1) < 1.0, 4, 9)


@pytest.mark.nojit
def test_an_ellipsoid_s_shortest_axis_is_found() -> None:
    shock = minimal_shock(ellipsoid, PLACE, np.eye(3), most=5.0)
    assert shock.size == pytest.approx(0.5, rel=1e-3)
    np.testing.assert_allclose(np.abs(shock.shock), [0.0, 0.5, 0.0], atol=0.03)
    assert shock.label == 9
    assert np.isnan(shock.undecided_from)
    assert ellipsoid(PLACE[None] + shock.shock) == 9


@pytest.mark.nojit
def test_the_norm_decides_what_is_small() -> None:
    """With lengths times (1, 4, 0.1) the half axes are 1, 2 and 0.2 long."""
    shock = minimal_shock(ellipsoid, PLACE, np.diag([1.0, 4.0, 0.1]), most=5.0)
    assert shock.size == pytest.approx(0.2, rel=1e-3)
    assert abs(shock.shock[2]) == pytest.approx(2.0, rel=1e-2)


@pytest.mark.nojit
def test_a_shock_of_some_states_alone() -> None:
    shock = minimal_shock(ellipsoid, PLACE, np.eye(3), most=5.0, coordinates=(2, 0))
    assert shock.size == pytest.approx(1.0, rel=1e-3)
    assert shock.shock[1] == 0.0
    alone = minimal_shock(ellipsoid, PLACE, np.eye(3), most=5.0, coordinates=(1,))
    assert alone.size == pytest.approx(0.5, rel=1e-3)


@pytest.mark.nojit
def test_nothing_is_found_beyond_the_largest_size() -> None:
    for search in (minimal_shock, brute_force_shock):
        shock = search(ellipsoid, PLACE, np.eye(3), most=0.49)
        assert np.isnan(shock.size)
        assert np.isnan(shock.shock).all()
        assert shock.label == -1


@pytest.mark.nojit
def test_a_guess_finds_a_narrow_way_out() -> None:
    """A hole of half a degree: one of 128 random directions in the plane rarely meets it."""

    def holed(y: np.ndarray) -> np.ndarray:
        radius, angle = np.hypot(*y.T), np.arctan2(y[:, 1], y[:, 0])
        return ((radius > 2.0) | ((radius > 1.0) & (np.abs(angle - 1.0) < 0.004))).astype(int)

    blind = minimal_shock(holed, [0.0, 0.0], np.eye(2), most=3.0, directions=8)
    told = minimal_shock(
        holed, [0.0, 0.0], np.eye(2), most=3.0, directions=8, guess=[[np.cos(1.0), np.sin(1.0)]]
    )
    assert blind.size == pytest.approx(2.0, rel=1e-3)
    assert told.size == pytest.approx(1.0, rel=1e-3)


@pytest.mark.nojit
def test_the_first_of_several_ways_out_counts() -> None:
    """A shell of another basin inside: left at 1, entered again at 1.5, left for good at 2."""

    def shell(y: np.ndarray) -> np.ndarray:
        radius = np.linalg.norm(y, axis=1)
        return np.where((radius > 1.0) & (radius < 1.5), 1, np.where(radius > 2.0, 2, 0))

    shock = minimal_shock(shell, [0.0, 0.0], np.eye(2), most=4.0)
    assert (shock.size, shock.label) == (pytest.approx(1.0, rel=1e-3), 1)


@pytest.mark.nojit
def test_starts_without_a_label_are_told_and_have_not_left() -> None:
    def foggy(y: np.ndarray) -> np.ndarray:
        radius = np.linalg.norm(y, axis=1)
        return np.where(radius > 1.0, 1, np.where(radius > 0.8, -1, 0))

    shock = minimal_shock(foggy, [0.0, 0.0], np.eye(2), most=2.0)
    assert shock.size == pytest.approx(1.0, rel=1e-3)
    assert 0.8 < shock.undecided_from < 0.9


@pytest.mark.nojit
def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(fm.InputError, match=r"^attractor: has no label itself"):
        minimal_shock(lambda y: np.full(len(y), -1), [0.0], [[1.0]], most=1.0)
    with pytest.raises(fm.InputError, match=r"^guess: must be finite and differ from 0"):
        minimal_shock(ellipsoid, PLACE, np.eye(3), most=1.0, coordinates=(0,), guess=[[0.0, 1.0, 0.0]])


def test_an_attractor_of_a_system_is_disturbed_from_its_first_point() -> None:
    """x' = x - x^3: from each of the wells at +-1 the boundary at 0 is 1 away."""
    system = fm.System(lambda t, x: (x - x * x * x,), ["x"], {})
    found = fm.find_attractors(system, {"x": (-2.0, 2.0)}, 200)
    for attractor in found:
        assert minimal_shock(found, attractor, [[1.0]], most=3.0).size == pytest.approx(1.0, rel=1e-3)


def test_an_equilibrium_of_a_scene_needs_neither_labels_nor_norm() -> None:
    """They are those of the copies, in the kinetic-energy norm: the same search, step by step."""
    scene = fm.Scene(alpha=0.0)
    well = fm.find_equilibria(scene)[0]
    place, norm = [well.phi, well.theta, 0.0, 0.0], kinetic_norm(scene, well)
    few = {"most": 3.0, "coordinates": (2, 3), "directions": 8, "tolerance": 1e-2}
    found = minimal_shock(scene, well, **few)
    told = minimal_shock(well_numbers(scene), place, norm, **few)
    assert (found.size, found.label) == (told.size, told.label)
    np.testing.assert_array_equal(found.shock, told.shock)
    index, turns = well_of_number(found.label)
    assert index == 0
    assert turns != (0, 0)
    end = fm.label_starts(scene, place + found.shock)
    assert tuple(end.turns[0]) == turns
    with pytest.raises(fm.InputError, match=r"^norm: missing; only an equilibrium of a scene"):
        minimal_shock(scene, place, most=1.0)


def test_a_slow_device_s_shock_needs_its_own_time() -> None:
    """All times 1,000 times as long: nothing is known after 60 s, all after 1,000 times as many."""
    scene, T = fm.Scene(alpha=0.0), 1000.0
    slow = scene.replace(
        g=scene.g / T**2, c1=scene.c1 / T**2, c2=scene.c2 / T**2, beta=scene.beta / T, F0=scene.F0 / T**2
    )
    few = {"most": 3.0, "coordinates": (2, 3), "directions": 8, "tolerance": 1e-2}
    right = minimal_shock(scene, fm.find_equilibria(scene)[0], **few)
    well = fm.find_equilibria(slow)[0]
    found = minimal_shock(slow, well, t_end=60.0 * T, **few)
    assert found.size == pytest.approx(right.size, rel=1e-2)
    short = minimal_shock(slow, well, t_end=60.0, **few)
    assert np.isnan(short.size)
    assert "not all ends are known from size" in str(short)
    assert "a longer t_end may tell" in " ".join(str(short).split())
    with pytest.raises(fm.InputError, match=r"^t_end = 5.0: is for a scene or mechanism"):
        minimal_shock(ellipsoid, PLACE, np.eye(3), most=1.0, t_end=5.0)


@pytest.mark.nojit
def test_copies_have_numbers_of_their_own() -> None:
    ends = SimpleNamespace(
        well=np.array([0, 5, -1, 3]), turns=np.array([[0, 0], [-7, 300], [0, 0], [4000, -1]], dtype=np.int32)
    )
    numbers = number_wells(ends)  # type: ignore[arg-type]
    assert numbers[2] == -1
    assert [well_of_number(int(k)) for k in numbers[[0, 1, 3]]] == [
        (0, (0, 0)), (5, (-7, 300)), (3, (4000, -1)),
    ]  # fmt: skip


@cache
def bistable_kick(beta: float) -> tuple[fm.Scene, Shock, Shock, float]:
    """Smallest velocity kick out of the shallow well, by search and by brute force, and the well's depth."""
    scene = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0, beta=beta)
    e = fm.find_equilibria(scene)[1]

    def copies(y: np.ndarray) -> np.ndarray:
        label, turns, _ = ends(scene, y, 30.0)
        return np.where(label < 0, -1, (label != 1) | (turns != 0).any(axis=1))

    place, norm = [e.phi, e.theta, 0.0, 0.0], kinetic_norm(scene, e)
    found = minimal_shock(copies, place, norm, most=1.0, coordinates=(2, 3), directions=16)
    brute = brute_force_shock(copies, place, norm, most=1.0, coordinates=(2, 3), directions=200)
    return scene, found, brute, depths(scene)[1]


def test_the_mechanism_s_smallest_kick_agrees_with_brute_force() -> None:
    _, found, brute, _ = bistable_kick(121.0)
    assert found.size <= brute.size * (1.0 + 1e-3)
    assert found.size == pytest.approx(brute.size, rel=2e-2)


def test_no_kick_out_of_a_well_has_less_energy_than_its_depth() -> None:
    scene, found, _, depth = bistable_kick(121.0)
    e = fm.find_equilibria(scene)[1]
    energy = kinetic_energy(scene, np.array([e.phi, e.theta, 0.0, 0.0]) + found.shock)
    assert depth < energy < 3.0 * depth
    norm = kinetic_norm(scene, e)
    assert np.linalg.norm(found.shock @ norm) == pytest.approx(found.size, rel=1e-9)
