from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles import motion_rates
from scipy.integrate import solve_ivp

import fastmech as fm
from fastmech.basins.shock_limit import impulse_start
from fastmech.basins.snapping import SnappingMap, Window, critical_forces, map_snapping
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.status import Status
from fastmech.slider.lagrange import kinetic_energy, metric, potential_energy

#: Forces about the known changes at alpha = 5, and whether each leaves.
FORCES = np.array([800.0, 1545.0, 1550.0, 2500.0, 4200.0, 4205.0, 4330.0, 4335.0, 6000.0])
LEAVES = [False, False, True, True, True, False, False, True, True]


def scipy_turns(scene: fm.Scene, start: np.ndarray) -> np.ndarray:
    """Turns that a motion has made by the time it can make no more, by SciPy's DOP853 at 1e-12.

    At Table 1 without force every way out of the well passes a saddle: (pi/2, pi) is the lowest.
    """
    run = solve_ivp(
        motion_rates(scene.parameters),
        (0.0, 20.0),
        start,
        method="DOP853",
        rtol=1e-12,
        atol=1e-12,
    )
    final = run.y[:, -1]
    energy = kinetic_energy(scene, final) + potential_energy(scene, final[:2])
    assert abs(scene.F0) * np.exp(-20.0 * scene.alpha) < 1e-30
    assert energy < potential_energy(scene, [np.pi / 2, np.pi])
    return np.round((final[:2] - start[:2]) / (2.0 * np.pi)).astype(int)


def test_table_1_leaves_where_it_is_known_to() -> None:
    snapping = map_snapping(fm.Scene(), FORCES, [0.05, 0.7, 5.0])
    assert snapping.counts["captured"] == 27
    np.testing.assert_array_equal(snapping.left, [[False] * 9, [False] * 9, LEAVES])
    np.testing.assert_array_equal(snapping.smallest, [np.nan, np.nan, 1550.0])
    windows = snapping.windows(2)
    back = [w for w in windows[1:] if not w.left]
    assert [(w.first, w.last) for w in back] == [(4205.0, 4330.0)]
    for k in (1, 2, 4, 7):  # of these by an integrator of another kind
        rest = snapping.equilibria[0]
        start = np.array([rest.phi, rest.theta, 0.0, 0.0])
        right = scipy_turns(fm.Scene(F0=float(FORCES[k]), alpha=5.0), start)
        np.testing.assert_array_equal(snapping.turns[2, k], right)


def test_a_force_to_the_left_is_another_matter() -> None:
    """The slider lies to the right, so that only the potential is its own mirror image."""
    forces = np.array([-3000.0, -1545.0, -900.0])
    snapping = map_snapping(fm.Scene(), forces, [5.0])
    rest = snapping.equilibria[0]
    for k, force in enumerate(forces):
        right = scipy_turns(fm.Scene(F0=force, alpha=5.0), np.array([rest.phi, rest.theta, 0.0, 0.0]))
        np.testing.assert_array_equal(snapping.turns[0, k], right)
    assert snapping.left[0].tolist() == [True, True, False]
    assert snapping.smallest.tolist() == [-1545.0]
    (critical,) = critical_forces(snapping, fm.Scene(), tolerance=1.0)
    assert -1545.0 < critical < -900.0
    sides = map_snapping(fm.Scene(), [critical, critical + 1.0], [5.0])
    assert sides.left.tolist() == [[True, False]]


def test_the_critical_force_is_narrowed_down() -> None:
    coarse = map_snapping(fm.Scene(), [500.0, 1500.0, 2500.0], [0.7, 5.0])
    found = critical_forces(coarse, fm.Scene(), tolerance=0.5)
    assert np.isnan(found[0])
    assert 1545.0 < found[1] <= 1550.0
    sides = map_snapping(fm.Scene(), [found[1] - 0.5, found[1]], [5.0])
    assert sides.left.tolist() == [[False, True]]


@pytest.mark.slow
def test_a_small_device_s_forces_are_told_as_exactly_as_a_large_one_s() -> None:
    """Lengths over 100 and forces over 1e4, times as they are: an exactly similar device."""
    own, k = fm.Scene(c1=294.9, c2=92.85, F0=100.0), 1e-4
    masses = {name: k * getattr(own, name) for name in ("m1", "m2", "m3")}
    small = own.replace(
        **masses, l=own.l / 100, g=own.g / 100, c1=k * own.c1, c2=k * own.c2, beta=k * own.beta, F0=1.0
    )
    found = [
        critical_forces(map_snapping(scene, size * np.array([500.0, 1000.0]), [0.7]), scene)[0] / size
        for scene, size in ((own, 1.0), (small, k / 100))
    ]
    assert found[0] == pytest.approx(312.94, abs=0.05)
    assert found[1] == pytest.approx(found[0], rel=1e-9)


def test_the_impulse_is_the_limit_of_fast_forces() -> None:
    """State differences fall as 1/alpha; far from the critical impulse the ends are the same."""
    scene = fm.Scene(F0=0.0, alpha=0.0)
    rest = fm.find_equilibria(scene)[0]
    impulses = np.array([150.0, 170.0, 400.0])
    kicked = np.array([impulse_start(scene, rest, impulse) for impulse in impulses])
    momentum = np.einsum("ij,nj->ni", metric(scene, (rest.phi, rest.theta)), kicked[:, 2:])
    lever = [-scene.l * np.sin(rest.phi), -scene.l * np.cos(rest.theta)]
    np.testing.assert_allclose(momentum, impulses[:, None] * lever, rtol=1e-12)

    start = np.tile([rest.phi, rest.theta, 0.0, 0.0], (3, 1))
    limit = integrate(scene, kicked, 0.25, 0.001, "dop853").y[-1]
    errors = []
    for alpha in (2000.0, 4000.0, 8000.0):
        own = {"F0": impulses * alpha, "alpha": np.full(3, alpha)}
        near = integrate(scene, start, 0.25, 2e-5, "dop853", parameters=own).y[-1]
        errors.append(np.abs(near - limit).max())
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.05)

    fast = map_snapping(scene, impulses * 2000.0, [2000.0])
    assert fast.left.tolist() == [[False, True, True]]
    for k in range(3):
        right = scipy_turns(scene, kicked[k])
        np.testing.assert_array_equal(fast.turns[0, k], right)


def test_windows_are_runs_of_equal_ends() -> None:
    turns = np.zeros((1, 5, 2), dtype=int)
    turns[0, 2] = [0, -1]
    snapping = SnappingMap(
        np.arange(1.0, 6.0), np.array([2.0]), fm.find_equilibria(fm.Scene()), 0,
        np.array([[0, 0, 0, 0, -1]]), turns, np.full((1, 5), 3.0),
        np.array([[*[Status.CAPTURED] * 4, Status.UNDECIDED]], dtype=np.int8),
    )  # fmt: skip
    assert snapping.windows(0) == [
        Window(1.0, 2.0, 0, (0, 0), False),
        Window(3.0, 3.0, 0, (0, -1), True),
        Window(4.0, 4.0, 0, (0, 0), False),
        Window(5.0, 5.0, -1, (0, 0), False),
    ]
    assert snapping.smallest.tolist() == [3.0]
    assert snapping.counts["undecided"] == 1


def test_what_is_not_captured_by_the_end_has_no_label() -> None:
    """A force that still pushes with 6 kN may do any work; one of 1 N may not."""
    snapping = map_snapping(fm.Scene(), [1.0, 6000.0], [0.001], t_end=0.5)
    assert snapping.status.tolist() == [[Status.CAPTURED, Status.UNDECIDED]]
    assert snapping.label.tolist() == [[0, -1]]
    assert not snapping.left.any()
    assert snapping.time.tolist()[0] == [0.5, pytest.approx(np.nan, nan_ok=True)]


def test_labels_are_those_of_a_map_s_starts() -> None:
    """The same motions by the observer that looks at every step and stops as soon as it can."""
    forces, rates = [1545.0, 2500.0, 4300.0], [0.7, 5.0]
    snapping = map_snapping(fm.Scene(), forces, rates)
    rest = snapping.equilibria[0]
    for k, rate in enumerate(rates):
        for j, force in enumerate(forces):
            own = fm.label_starts(fm.Scene(F0=force, alpha=rate), [rest.phi, rest.theta, 0.0, 0.0])
            assert own.well[0] == snapping.label[k, j]
            np.testing.assert_array_equal(own.turns[0], snapping.turns[k, j])
            assert own.time[0] <= snapping.time[k, j]  # it looks every second only


def test_a_force_that_drives_onto_a_saddle_is_not_given_a_label() -> None:
    """Between neighbouring floating-point forces on both sides of the critical one no step can decide."""
    low, high = 1545.0, 1547.0
    while np.nextafter(low, high) < high:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        at = map_snapping(fm.Scene(), [middle], [5.0], t_end=30.0)
        if at.label[0, 0] < 0:
            assert Status(at.status[0, 0]) in (Status.AT_SADDLE, Status.UNDECIDED)
            return
        low, high = (low, middle) if at.left[0, 0] else (middle, high)
    pytest.fail("every force has a label")


@pytest.mark.parametrize(("side", "bracket"), [(0.0, (150.0, 170.0)), (np.pi, (145.0, 165.0))])
def test_the_least_blow_on_m2_is_that_of_scipy(side: float, bracket: tuple[float, float]) -> None:
    """The limit of critical forces, to either side: no even impulse below it turns anything over."""
    scene = fm.Scene(F0=0.0, alpha=0.0)
    rest = fm.find_equilibria(scene)[0]
    found = fm.shock_limit(scene, rest, "M2", side).found.impulse
    assert bracket[0] < found < bracket[1]
    for impulse in np.linspace(bracket[0], bracket[1], 9):
        turned = scipy_turns(scene, fm.impulse_start(scene, rest, impulse, "M2", side)).any()
        assert turned == (impulse >= found)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"alpha": [0.0, 1.0]},
            "alpha = 0: must be greater than 0 1/s; a constant force has another",
        ),
        ({"alpha": [2.0, 1.0]}, "alpha: must be greater than 0 1/s and rise"),
        ({"F0": (10, 100, 5)}, "F0 = (10, 100, 5): may be start, stop and number; give numpy.linspace"),
        ({"F0": [1.0, 2.0, 2.0]}, "F0[2] = 2 after 2: must rise or fall throughout, no value twice"),
        (
            {"F0": np.arange(1.0, 30_001.0), "alpha": np.arange(1.0, 30_001.0)},
            "F0, alpha: 9e+08 motions would",
        ),
        ({"F0": [-1.0, 1.0]}, "F0: must rise, be of one sign and nowhere be 0 N"),
        ({"scene": fm.Scene(beta=0.0)}, "scene.beta = 0: must be greater than 0"),
        ({"progress": 3}, "progress = 3: must be a function of the number of finished motions"),
        ({"start": fm.find_equilibria(fm.Scene())[1]}, "start: is a saddle, must be a minimum"),
    ],
)
def test_wrong_arguments_are_refused(changes: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"scene": fm.Scene(), "F0": [1.0], "alpha": [1.0]}
    with pytest.raises(fm.InputError) as refusal:
        map_snapping(**(arguments | changes))
    assert str(refusal.value).startswith(message)
