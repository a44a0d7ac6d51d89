from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
import sympy
from own_ends import depths

import fastmech as fm
from fastmech.basins.erosion import erosion
from fastmech.basins.measures.labels import norm_on
from fastmech.disturbance.motion import kinetic_norm
from fastmech.slider.lagrange import metric

BISTABLE = fm.Scene(F0=0.0, c1=294.9, c2=92.85, alpha=0.0)


class Ends(NamedTuple):
    well: np.ndarray
    turns: np.ndarray


GRID = {"phi": np.linspace(-3.2, 3.2, 41), "theta": np.linspace(-3.2, 3.2, 41)}
RADIUS = 0.4


@cache
def wells_of(scene: fm.Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Indices, states and norms of a scene's minima."""
    equilibria = fm.find_equilibria(scene)
    index = [i for i, e in enumerate(equilibria) if e.kind == "minimum"]
    places = np.array([[equilibria[i].phi, equilibria[i].theta, 0.0, 0.0] for i in index])
    return np.array(index), places, np.array([kinetic_norm(scene, equilibria[i]) for i in index])


def balls(scene: fm.Scene, y: np.ndarray) -> Ends:
    """A made-up rule: within RADIUS of a well in its norm one ends there, else there a turn further."""
    index, places, norms = wells_of(scene)
    sizes = np.linalg.norm((y - places[:, None]) @ norms, axis=2)
    turns = np.zeros((len(y), 2), dtype=int)
    turns[sizes.min(axis=0) > RADIUS, 1] = 1
    return Ends(index[sizes.argmin(axis=0)], turns)


def test_measures_of_known_basins() -> None:
    """Each well's own copy has a ball as its basin: all radii are the ball's."""
    profile = erosion(BISTABLE, "F0", [85.3], GRID, label_starts=balls, most_shock=1.0, n=4000, directions=16)
    scene = BISTABLE.replace(F0=85.3)
    wells = [e for e in fm.find_equilibria(scene) if e.kind == "minimum"]
    np.testing.assert_allclose(profile.shock, RADIUS, rtol=1e-3)
    np.testing.assert_allclose(profile.kick, RADIUS, rtol=1e-3)
    assert profile.stability.sum() == pytest.approx(1.0)  # turns do not count there
    for w in range(len(wells)):
        e = wells[int(np.argmin([abs(e.phi - profile.position["phi"][0, w]) for e in wells]))]
        part = norm_on(kinetic_norm(scene, e), 4, (0, 1))
        step = np.linalg.norm(np.array([0.16, 0.16]) @ part)
        assert RADIUS - 1e-9 <= profile.lim[0, w] < RADIUS + step
        assert RADIUS - step < profile.factor[0, w] < RADIUS + step
        assert not profile.lim_at_window[0, w]
        # The ball's area over the window's: pi r^2/det(part).
        a = metric(scene, (e.phi, e.theta)) / (scene.m2 * scene.l**2)
        area = np.pi * RADIUS**2 / np.sqrt(np.linalg.det(a)) / 6.4**2
        assert profile.gim[0, w] == pytest.approx(area, rel=0.2)
        assert profile.lower[0, w] < profile.stability[0, w] < profile.upper[0, w]


def test_wells_keep_their_identity_where_their_order_changes() -> None:
    """At F0 = 0 the two wells are mirror images: which is the deeper one changes there."""
    values = np.linspace(-40.0, 40.0, 5)
    small = {name: line[::10] for name, line in GRID.items()}
    profile = erosion(BISTABLE, "F0", values, small, label_starts=balls, most_shock=1.0, n=500, directions=4)
    deepest = [fm.find_equilibria(BISTABLE.replace(F0=float(v)))[0].phi for v in values]
    assert deepest[0] > 2.0
    assert deepest[-1] < 1.0
    assert profile.position["phi"].shape == (5, 2)
    assert (np.abs(np.sin(np.diff(profile.position["phi"], axis=0))) < 0.4).all()
    assert (np.abs(np.diff(profile.position["theta"], axis=0)) < 0.4).all()
    # Mirrored: phi to pi - phi, theta to -theta, F0 to -F0.
    np.testing.assert_allclose(
        np.cos(profile.position["phi"][::-1, 1]), -np.cos(profile.position["phi"][:, 0]), atol=1e-9
    )
    np.testing.assert_allclose(
        profile.position["theta"][::-1, 1], -profile.position["theta"][:, 0], atol=1e-9
    )


def test_starts_without_a_label_leave_room_above_the_measures() -> None:
    """A ring of the true ball is not decided: what it could add is told, and it is the whole ball."""

    def undecided_ring(scene: fm.Scene, y: np.ndarray) -> Ends:
        ends = balls(scene, y)
        _, places, norms = wells_of(scene)
        sizes = np.linalg.norm((y - places[:, None]) @ norms, axis=2).min(axis=0)
        return Ends(np.where((sizes > RADIUS / 2) & (sizes <= RADIUS), -1, ends.well), ends.turns)

    options: dict[str, Any] = {"most_shock": 1.0, "n": 200, "directions": 4}
    whole = erosion(BISTABLE, "F0", [85.3], GRID, label_starts=balls, **options)
    ring = erosion(BISTABLE, "F0", [85.3], GRID, label_starts=undecided_ring, **options)
    for name in ("gim", "lim"):
        assert (getattr(ring, name) < 0.8 * getattr(whole, name)).all()
    for name in ("gim", "lim", "factor"):
        most = getattr(ring, f"{name}_at_most")
        assert (most >= getattr(whole, name)).all()
        np.testing.assert_array_equal(getattr(whole, f"{name}_at_most"), getattr(whole, name))
    np.testing.assert_array_equal(ring.lim_at_most, whole.lim)
    assert "of the starts have no label: a longer t_end may tell" in " ".join(str(ring).split())
    assert "no label" not in str(whole)


def test_starts_that_leave_their_range_end_elsewhere() -> None:
    """They are no undecided ones: no measure has room above it."""

    def ring_that_leaves(scene: fm.Scene, y: np.ndarray) -> Any:
        ends = balls(scene, y)
        _, places, norms = wells_of(scene)
        leaves = np.linalg.norm((y - places[:, None]) @ norms, axis=2).min(axis=0) > RADIUS / 2
        status = np.where(leaves, fm.Status.OUT_OF_RANGE, fm.Status.OK)
        return SimpleNamespace(well=np.where(leaves, -1, ends.well), turns=ends.turns, status=status)

    options: dict[str, Any] = {"most_shock": 1.0, "n": 200, "directions": 4}
    smaller = erosion(BISTABLE, "F0", [85.3], GRID, label_starts=ring_that_leaves, **options)
    assert "no label" not in str(smaller)
    np.testing.assert_array_equal(smaller.undecided, 0.0)
    np.testing.assert_array_equal(smaller.gim_at_most, smaller.gim)
    np.testing.assert_allclose(smaller.shock, RADIUS / 2, rtol=0.02)


def test_a_slice_of_rates_goes_through_the_well() -> None:
    rates = {"theta_dot": np.linspace(-4, 4, 41), "phi_dot": np.linspace(-4, 4, 41)}
    profile = erosion(BISTABLE, "c1", [290.0], rates, label_starts=balls, most_shock=1.0, n=200, directions=4)
    scene = BISTABLE.replace(c1=290.0)
    e = fm.find_equilibria(scene)[0]
    step = np.abs(np.array([0.2, 0.2]) @ norm_on(kinetic_norm(scene, e), 4, (3, 2))).sum()
    assert (profile.lim >= RADIUS - 1e-9).all()
    assert (profile.lim < RADIUS + step).all()


def test_a_well_erodes_towards_its_fold() -> None:
    """The shallow well vanishes at c2 = 98.59 N/m: shock and stability fall, NaN behind it."""
    scene, values = BISTABLE.replace(F0=85.3), [95.0, 98.0, 100.0]
    axes = {"phi": np.linspace(-3.1, -2.2, 7), "theta": np.linspace(-2.1, -1.3, 7)}
    profile = erosion(scene, "c2", values, axes, most_shock=0.3, t_end=10.0, n=100, directions=4)
    shallow = int(np.flatnonzero(np.isnan(profile.position["phi"][-1]))[0])
    deep = 1 - shallow
    assert not np.isnan(profile.position["phi"][:, deep]).any()
    for measure in (profile.shock, profile.kick, profile.stability, profile.gim):
        assert measure[0, shallow] > measure[1, shallow] > 0.0
        assert np.isnan(measure[2, shallow])
    assert (profile.shock[:2, shallow] <= profile.kick[:2, shallow] * (1.0 + 1e-3)).all()
    for v in (0, 1):  # a kick out of the well has more energy than the well is deep
        now = scene.replace(c2=values[v])
        i = int(np.nanargmin(depths(now)))
        e = fm.find_equilibria(now)[i]
        a = metric(now, (e.phi, e.theta))
        square = np.linalg.eigvals(np.linalg.solve(a, e.hessian)).max()
        energy = 0.5 * profile.kick[v, shallow] ** 2 * square * now.m2 * now.l**2
        assert energy > depths(now)[i]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scene": fm.Scene()}, "scene.alpha = 0.7: must be 0"),
        ({"axes": {"ph": [0.0, 1.0]}}, "axes.ph: unknown name; did you mean 'phi'?"),
        ({"axes": {}}, "axes = {}: must map at least one state"),
        ({"axes": {"phi": [0.0, 1.0, 1.0]}}, "axes.phi: must rise in equal steps"),
        ({"axes": {"phi": [-180.0, 180.0]}}, "axes.phi: reaches 180, beyond 4 turns; angles are in rad"),
        ({"values": [1.0, 3.0, 2.0]}, "values[2] = 2 after 3: must rise or fall throughout"),
        ({"n": 0}, "n = 0: must be an integer not less than 1"),
        ({"scene": BISTABLE.replace(beta=0.0)}, "scene.beta = 0: must be greater than 0"),
        ({"parameter": "F1"}, "parameter = 'F1': did you mean 'F0'?"),
        ({"progress": 3}, "progress = 3: must be a function of the number of finished values"),
    ],
)
def test_wrong_arguments_are_refused(changes: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {
        "scene": BISTABLE, "parameter": "F0", "values": [1.0, 2.0], "label_starts": balls, "axes": GRID,
        "most_shock": 1.0,
    }  # fmt: skip
    with pytest.raises(fm.InputError) as refusal:
        erosion(**(arguments | changes))
    assert str(refusal.value).startswith(message)


@pytest.mark.slow
def test_the_papers_mechanism_erodes_as_its_scene() -> None:
    mechanism = fm.mechanisms.slider_pendulum().replace(F0=0.0, c1=294.9, c2=92.85, alpha=0.0)
    axes = {"phi": np.linspace(-3.1, 3.1, 7), "theta": np.linspace(-3.1, 3.1, 7)}
    one, other = (
        erosion(system, "F0", [85.3], axes, most_shock=0.6, t_end=30.0, n=100, directions=32)
        for system in (BISTABLE, mechanism)
    )
    for name in ("phi", "theta"):
        np.testing.assert_allclose(other.position[name], one.position[name], atol=1e-9)
    for name in ("stability", "gim", "lim", "factor", "shock", "kick"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=2e-3, err_msg=name)


def test_a_truss_s_well_lasts_until_it_snaps() -> None:
    """The upper well ends at 2 k L (1 - cos^(2/3) a)^(3/2); the lower one stays."""
    truss = fm.mechanisms.von_mises_truss().replace(b=4.0, P=0.0)
    k, span, rise = (truss.parameters[name] for name in ("k", "span", "rise"))
    length = np.hypot(span / 2, rise)
    load = 2.0 * k * length * (1.0 - (span / 2 / length) ** (2.0 / 3.0)) ** 1.5
    values = np.array([0.5, 0.99, 0.9999, 1.0001]) * load

    def upwards(system: fm.Mechanism, y: np.ndarray) -> Ends:
        """A made-up rule: up ends up."""
        places = fm.find_equilibria(system).position
        minima = [i for i, e in enumerate(fm.find_equilibria(system)) if e.kind == "minimum"]
        height = places[minima, 1]
        up, down = minima[int(height.argmax())], minima[int(height.argmin())]
        return Ends(np.where(y[:, 1] > 0.0, up, down), np.zeros((len(y), 2), dtype=int))

    axes = {"x": np.linspace(-0.5, 0.5, 5), "y": np.linspace(-1.0, 1.0, 9)}
    profile = erosion(truss, "P", values, axes, label_starts=upwards, most_shock=3.0, n=400, directions=4)
    heights = profile.position["y"]
    assert heights.shape == (4, 2)
    upper = int(np.argmax(heights[0]))
    assert np.isfinite(heights[:3]).all()
    assert np.isnan(heights[3, upper])
    assert (np.diff(heights[:3], axis=0) < 0.0).all()
    np.testing.assert_allclose(profile.stability[:3, upper], 0.5, atol=0.1)
    with pytest.raises(fm.InputError, match=r"axes\.z: unknown name; allowed: x, y, x_dot, y_dot"):
        erosion(truss, "P", values, {"z": [0.0, 1.0]}, most_shock=1.0)


def test_a_column_under_a_following_force_has_no_wells() -> None:
    column = fm.mechanisms.ziegler_column().replace(b=0.3)
    axes = {"lower": np.linspace(-1.0, 1.0, 5), "upper": np.linspace(-1.0, 1.0, 5)}
    with pytest.raises(fm.InputError, match="ziegler_column: has forces that are not known to come from a"):
        erosion(column, "P", [0.1, 0.5], axes, most_shock=1.0)


def test_a_coordinate_may_be_named_as_a_measure_is() -> None:
    shock, (k, b) = fm.angles("shock", -1.0, 1.0), sympy.symbols("k b")
    hinge = fm.Mechanism(
        [shock], {"k": 1.0, "b": 0.5}, kinetic=shock.dot**2 / 2, potential=k * shock**2 / 2 - shock**4 / 4,
        dissipation=b * shock.dot**2 / 2,
    )  # fmt: skip

    def stay(system: fm.Mechanism, y: np.ndarray) -> Ends:
        return Ends(np.where(np.abs(y[:, 0]) < 0.5, 0, 1), np.zeros((len(y), 1), dtype=int))

    axes = {"shock": np.linspace(-0.9, 0.9, 5)}
    profile = erosion(hinge, "k", [0.5], axes, label_starts=stay, most_shock=1.0, n=40, directions=4)
    np.testing.assert_allclose(profile.position["shock"], 0.0, atol=1e-12)
    assert profile.shock[0, 0] == pytest.approx(0.5, rel=1e-2)
