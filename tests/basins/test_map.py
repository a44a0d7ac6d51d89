"""Maps: slices, refinement, systems with basins known in closed form, wrong requests."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fastmech as fm
from fastmech.basins import label
from fastmech.basins.refine import refine_grid
from fastmech.ensembles.status import Status

CONSTANT = fm.Scene(alpha=0.0)
BISTABLE = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)
FULL = np.linspace(-np.pi, np.pi, 41)


def bent(t: float, x: float, y: float, bend: float) -> tuple[float, float]:
    """u' = u - u^3, y' = -y with u = x + bend y^2: basins meet where u = 0."""
    u = x + bend * y * y
    return u - u * u * u + 2.0 * bend * y * y, -y


def arrived(t: float, x: float, y: float) -> float:
    """Near one of the two attractors (+-1, 0)."""
    return (2.0 if x > 0.0 else 1.0) if abs(abs(x) - 1.0) + abs(y) < 0.05 else 0.0


BENT = fm.System(bent, state=["x", "y"], parameters={"bend": 0.7}, stop=arrived)


def alone(t, a):
    """Ends at 1 or -1."""
    return (a - a**3,)


def among_six(t, a, b, c, d, e, f):
    """The same beside five states that die out."""
    return a - a**3, -b, -c, -d, -e, -f


@pytest.mark.parametrize(("rates", "states"), [(alone, "a"), (among_six, "abcdef")])
def test_maps_of_systems_of_one_state_and_of_six(rates: Any, states: str) -> None:
    found = fm.map_basins(fm.System(rates, [*states], {}), {"a": np.array([-1.5, -0.5, 0.5, 1.5])}, 20.0)
    assert (found.well[:2] == found.well[0]).all()
    assert (found.well[2:] == 1 - found.well[0]).all()
    assert len(found.labels[1]) == 2


@pytest.mark.parametrize("refine", [None, 8])
def test_a_basin_in_closed_form(refine: int | None) -> None:
    x, y = np.linspace(-2.0, 2.0, 65), np.linspace(-1.5, 1.5, 51)
    found = fm.map_basins(BENT, {"x": x, "y": y}, 30.0, dt=0.1, refine=refine)
    side = x[:, None] + 0.7 * y**2
    expected = np.where(side > 0.0, 2, 1)
    clear = np.abs(side) > 1e-9
    np.testing.assert_array_equal(found.well[clear], expected[clear])
    assert found.computed.all() == (refine is None)
    assert found.counts["captured"] >= np.count_nonzero(clear)


def test_measures_take_maps_and_starts_as_they_take_labels() -> None:
    x = np.linspace(-2.0, 2.0, 65)
    found = fm.map_basins(BENT, {"x": x, "y": x}, 30.0, dt=0.1)
    which, shares = fm.basin_fractions(found)
    assert which.tolist() == [1, 2]
    assert shares.count.tolist() == [np.count_nonzero(found.well == code) for code in which]
    assert fm.basin_stability(found, 2).count == shares.count[1]
    assert fm.finite_time_basin_stability(found, found.time, 2, 1e3).count == shares.count[1]
    assert fm.basin_entropy(found) == fm.basin_entropy(found.well)
    assert fm.boundary_dimension(found).dimension == fm.boundary_dimension(found.well).dimension
    assert fm.wada_merge_test(found).labels.tolist() == [1, 2]
    assert (
        fm.fractal_boundary_test(found, balls=500).reason
        == fm.fractal_boundary_test(found.well, balls=500).reason
    )
    place = [1.0, 0.0]
    by_map = fm.integrity(found, found.axes, 2, place, np.eye(2))
    assert by_map.lim == fm.integrity(found.well, found.axes, 2, place, np.eye(2)).lim


def test_parameters_of_starts_own_bend_their_own_boundaries() -> None:
    """Basins meet where x + bend y^2 = 0, with a bend for each row of the map; progress is told in pieces."""
    x, bend, told = np.linspace(-2.0, 2.0, 801), np.array([-0.8, -0.1, 0.0, 0.4, 0.7, 1.2]), []
    found = fm.map_basins(
        BENT, {"y": [0.9, 0.91, 0.92, 0.93, 0.94, 0.95], "x": x}, 30.0, fixed={}, dt=0.1,
        parameters={"bend": bend[:, None]}, progress=told.append,
    )  # fmt: skip
    side = x + bend[:, None] * (np.linspace(0.9, 0.95, 6) ** 2)[:, None]
    clear = np.abs(side) > 1e-9
    np.testing.assert_array_equal(found.well[clear], np.where(side > 0.0, 2, 1)[clear])
    assert sum(told) == found.well.size
    assert len(told) >= 2
    whole = fm.map_basins(
        BENT, {"y": [0.9, 1.4], "x": x[::8]}, 30.0, dt=0.1, refine=8, parameters={"bend": 0.4}
    )
    side = x[::8] + 0.4 * np.array([[0.81], [1.96]])
    assert (whole.well == np.where(side > 0.0, 2, 1))[np.abs(side) > 1e-9].all()


def test_a_start_on_the_boundary_of_a_system_is_undecided() -> None:
    found = fm.map_basins(BENT, {"x": [-1.0, 0.0, 1.0]}, 20.0, dt=0.1)
    assert found.status.tolist() == [Status.CAPTURED, Status.UNDECIDED, Status.CAPTURED]
    assert found.tree is None


def pendulum(t: float, x: float, x_dot: float) -> tuple[float, float]:
    """The driven pendulum x'' = -0.1 x' + 0.5 - sin x."""
    return x_dot, 0.5 - 0.1 * x_dot - fm.sin(x)


def rests_or_turns(t: float, x: float, x_dot: float) -> float:
    """1: below the barrier at 5 pi/6 and on the well's side of it, 2: turned far beyond where it could stop.

    A start at 10 rad/s or less that falls into no well by 400 rad has its terminal speed long since.
    """
    turns = np.floor((x - np.pi / 6.0 + np.pi) / (2.0 * np.pi))
    place = x - 2.0 * np.pi * turns
    energy = 0.5 * x_dot * x_dot - 0.5 * place - fm.cos(place)
    barrier = 0.5 * np.sqrt(3.0) - 5.0 * np.pi / 12.0
    if energy < barrier and place < 5.0 * np.pi / 6.0:
        return 1.0
    return 2.0 if x > 400.0 else 0.0


def test_a_pendulum_rests_as_often_as_published() -> None:
    """Share at rest over [-pi, pi] + asin(0.5) and +-10 rad/s: 0.152 of 10,000 random starts.

    Stender and Hoffmann, Nonlinear Dynamics 107 (2022), case 1. A grid's own error is far below theirs.
    """
    middle = (np.arange(80) + 0.5) / 80.0
    axes = {"x": np.pi / 6.0 + np.pi * (2.0 * middle - 1.0), "x_dot": 10.0 * (2.0 * middle - 1.0)}
    system = fm.System(pendulum, state=["x", "x_dot"], parameters={}, stop=rests_or_turns)
    found = fm.map_basins(system, axes, 400.0, dt=0.1)
    which, shares = fm.basin_fractions(found.well)
    assert which.tolist() == [1, 2]
    assert found.counts["captured"] == found.well.size
    low, high = fm.wilson(1520, 10_000, confidence=0.997)
    assert low < shares.fraction[0] < high


@pytest.mark.parametrize(
    ("scene", "axes", "t_end"),
    [
        (CONSTANT, {"phi": FULL, "theta": FULL}, 60.0),
        (fm.Scene(), {"phi": FULL, "theta": FULL}, 60.0),
        (CONSTANT, {"theta": FULL, "theta_dot": np.linspace(-9.0, 9.0, 37)}, 60.0),
        (BISTABLE, {"phi": np.linspace(0.0, 1.4, 33), "theta": np.linspace(0.0, 1.0, 33)}, 60.0),
        (BISTABLE.replace(beta=300.0), {"phi": FULL, "theta": FULL}, 150.0),
        (CONSTANT, {"phi": FULL[::3], "theta": FULL[::3], "phi_dot": np.linspace(-3.0, 3.0, 7)}, 60.0),
    ],
)
def test_refined_maps_are_the_full_ones(scene: fm.Scene, axes: dict[str, Any], t_end: float) -> None:
    full = fm.map_basins(scene, axes, t_end)
    some = fm.map_basins(scene, axes, t_end, refine=4)
    for name in ("well", "turns", "status"):
        np.testing.assert_array_equal(getattr(full, name), getattr(some, name))
    np.testing.assert_array_equal(full.time[some.computed], some.time[some.computed])
    assert np.isnan(some.time[~some.computed]).all()
    assert not some.computed.all()
    assert full.computed.all()


def test_refinement_follows_a_boundary_that_it_has_seen_once() -> None:
    """A comb of teeth one point wide: the first level sees its back and follows it into each tooth."""
    picture = np.zeros((65, 65), dtype=np.int64)
    picture[:20] = 1
    picture[20:60:, 9:57:6] = 1
    asked: list[int] = []

    def compute(points: np.ndarray, stride: int) -> np.ndarray:
        asked.extend(points.tolist())
        return picture.ravel()[points]

    source = refine_grid(picture.shape, 8, compute)
    assert (picture.ravel()[source] == picture.ravel())[: 24 * 65].all()
    assert len(set(asked)) == len(asked) < picture.size
    island = np.zeros((33, 33), dtype=np.int64)
    island[4:6, 4:6] = 1  # between the nodes of the first level: missed, as the documentation says
    source = refine_grid(island.shape, 8, lambda points, stride: island.ravel()[points])
    assert (island.ravel()[source] == 0).all()


@pytest.mark.parametrize(
    ("scene", "axes", "t_end", "refine"),
    [
        (BISTABLE, {"phi": (-3.2, 3.2, 92), "theta": (-3.2, 3.2, 92)}, 30.0, None),
        (BISTABLE, {"phi": (-3.2, 3.2, 40), "theta": (-3.2, 3.2, 50)}, 30.0, None),
        (CONSTANT, {"phi_dot": (-20.0, 20.0, 92), "theta_dot": (-20.0, 20.0, 92)}, 40.0, None),
        (CONSTANT, {"phi": (-3.2, 3.2, 161), "theta": (-3.2, 3.2, 161)}, 40.0, 16),
    ],
)
def test_progress_tells_the_time_left_within_a_factor_of_two(
    scene: fm.Scene, axes: dict[str, Any], t_end: float, refine: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a clock that runs with the integration steps, which is what takes the time."""
    clock, seen = [0.0], []
    follow = label.StartRuns.follow

    def timed(runs: label.StartRuns, *args: Any) -> Any:
        before = runs.steps
        paths = follow(runs, *args)
        clock[0] += runs.steps - before
        return paths

    monkeypatch.setattr(label.StartRuns, "follow", timed)
    values = {name: np.linspace(*span) for name, span in axes.items()}
    fm.map_basins(scene, values, t_end, refine=refine, progress=lambda done: seen.append((done, clock[0])))
    done = np.cumsum([number for number, _ in seen])
    total = np.prod([v.size for v in values.values()])
    assert done[-1] == total
    assert (np.diff(done, prepend=0) > 0).all()
    if total < 4096:  # seconds: one word at the end is all that it says
        assert len(seen) == 1
    else:
        assert len(seen) >= 4
    for points, moment in zip(done[:-1], [time for _, time in seen][:-1], strict=True):
        left = moment * (total - points) / points
        assert 0.5 < left / (clock[0] - moment) < 2.0


def test_labels_number_wells_and_turns() -> None:
    found = fm.map_basins(CONSTANT, {"phi": FULL, "theta": FULL}, 60.0)
    label, table = found.labels
    np.testing.assert_array_equal(table[label][..., 0], found.well)
    np.testing.assert_array_equal(table[label][..., 1:], found.turns)
    assert sorted(map(tuple, table)) == [tuple(row) for row in table]


def test_fixed_coordinates_are_starts() -> None:
    axes = {"phi_dot": np.linspace(-5.0, 5.0, 9), "theta": np.linspace(-1.0, 2.0, 5)}
    found = fm.map_basins(CONSTANT, axes, fixed={"phi": -2.0, "theta_dot": 1.5})
    i, j = 2, 3
    one = fm.label_starts(CONSTANT, [-2.0, axes["theta"][j], axes["phi_dot"][i], 1.5])
    assert found.well[i, j] == one.well[0]
    assert found.turns[i, j].tolist() == one.turns[0].tolist()
    assert found.time[i, j] == one.time[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axes": {"phi": [0.0, 1.0]}}, r"axes = \['phi'\]: must be 2 to 4"),
        ({"axes": {"phi": [0.0, 1.0], "thta": [0.0]}}, r"axes.thta: unknown name; did you mean 'theta'"),
        ({"axes": {"phi": [0.0, 1.0], 3: [0.0, 1.0]}}, r"axes.3: unknown name; must be a text and no int: "),
        ({"axes": {"phi": [1.0, 0.0], "theta": [0.0]}}, r"^axes\.phi: falls from 1 to 0, must rise$"),
        (
            {"axes": {"phi": [0.0, 1.0, 1.0], "theta": [0.0]}},
            r"^axes\.phi\[2\] = 1 after 1: must rise or fall",
        ),
        (
            {"axes": {"phi": (0, 3, 5), "theta": [0.0]}},
            r"^axes\.phi = \(0, 3, 5\): may be start, stop and number",
        ),
        (
            {"axes": {"phi": [-180.0, 180.0], "theta": [0.0]}},
            r"^axes\.phi: reaches 180, beyond 4 turns; angles are in rad",
        ),
        (
            {"axes": {"phi": [0.0], "phi_dot": [0.0]}, "fixed": {"theta": -90.0}},
            r"^fixed\.theta: reaches 90, beyond 4",
        ),
        ({"axes": None}, r"^axes = None: must map coordinates to their values$"),
        (
            {"axes": dict.fromkeys(("phi", "theta"), np.linspace(-3, 3, 30_000))},
            r'^axes: ask for 9e\+08 starts, at most 5e\+07 are allowed; .* fastmech run, kind = "basins"$',
        ),
        ({"fixed": {"phi": 1.0}}, r"fixed.phi: must be one of the coordinates without an axis"),
        ({"progress": 3}, "progress = 3: must be a function of the number of finished starts"),
        ({"refine": 3}, r"refine = 3: must be a power of two"),
        ({"t_end": 0.0}, r"t_end = 0.0: must be a finite number of s greater than 0"),
        ({"scene": fm.Scene(beta=0.0)}, r"scene.beta = 0"),
        ({"scene": BENT, "axes": {"x": [0.0]}}, r"dt: missing"),
        ({"parameters": {"F0": 3.0}}, r"parameters: only a system's may differ"),
        ({"scene": BENT, "axes": {"x": [0.0]}, "parameters": {"bnd": 1.0}}, r"parameters.bnd: .* 'bend'"),
        (
            {"scene": BENT, "axes": {"x": [0.0]}, "parameters": {"bend": [1.0, 2.0]}},
            r"parameters.bend: .* \(1,\)",
        ),
    ],
)
def test_wrong_requests(change: dict[str, Any], message: str) -> None:
    good = {"scene": CONSTANT, "axes": {"phi": [0.0, 1.0], "theta": [0.0, 1.0]}}
    with pytest.raises(fm.InputError, match=message):
        fm.map_basins(**(good | change))


def test_two_milliard_starts_are_refused_before_they_are_copied() -> None:
    starts = np.broadcast_to(np.zeros(4), (2_000_000_000, 4))
    for refused in (
        lambda: fm.label_starts(CONSTANT, starts),
        lambda: fm.integrate(CONSTANT, starts, 1.0, dt=0.1),
    ):
        with pytest.raises(fm.InputError, match=r"^\w+: the states would take 59\.6 GiB on the way, [^\n]*$"):
            refused()
    with pytest.raises(fm.InputError, match=r"^n = 2000000000: must be an integer not greater than"):
        fm.disturb(CONSTANT, fm.find_equilibria(CONSTANT)[0], 2_000_000_000)
