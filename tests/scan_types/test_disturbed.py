"""The section of disturbed ensembles: every trajectory by own Runge-Kutta steps, norms by the oracle.

Ensembles run with the classical method and a fixed step, so all that happens at the ends of steps can be had
again without the package; SciPy tells how far that is from the truth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pytest
import scipy.interpolate
import scipy.linalg
import scipy.stats
from oracles import motion_rates
from scan_types.values import (
    Floats,
    Norm,
    check_labels,
    decoded,
    deepest_first,
    oracle_jacobian,
    rk4,
    run_scan,
    scipy_motion,
    stored,
    together,
)

import fastmech as fm
from fastmech.results import Dataset
from fastmech.scan_types.disturbed import DisturbedScan
from fastmech.scan_types.request import RunContext
from fastmech.scene import Scene

STATE = {"phi": "rad", "theta": "rad", "phi_dot": "rad/s", "theta_dot": "rad/s"}

UNITS = {
    "equilibrium": "1", "trajectory": "1", "phi": "rad", "theta": "rad", "omega": "rad/s", "failed": "s",
    "disturbance_radius": "rad",
    "return_radius": "rad",
    "outcome": "1", "end_equilibrium": "1", "turns_phi": "1", "turns_theta": "1", "time_to_return": "s",
    "excursion_phi": "rad", "excursion_theta": "rad", "share_returned": "1", "quantile": "1",
    "share_returned_at_most": "1", "share_returned_lower": "1", "share_returned_upper": "1",
    "halving_difference_angle": "rad", "halving_difference_rate": "rad/s",
    "time_to_return_quantile": "s", "linear_limit": "rad",
    **{f"{of}_{n}": unit for of in ("start", "final", "linear_direction") for n, unit in STATE.items()},
}  # fmt: skip

QUANTILES = [0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0]

#: Strong damping of a light slider: within 6 s most, not all, come to rest, many some turns away. The other
#: run is so short that little is decided, of two minima.
SETTLING = DisturbedScan(
    trajectories=300, radius=1.6, return_radius=0.1, seed=5, t_end=6.0, dt=0.02, method="rk4",
    linear_horizon=0.7, linear_tolerance=0.04, linear_directions=2,
)  # fmt: skip
BRIEF = DisturbedScan(
    trajectories=200, radius=0.3, return_radius=0.2, seed=11, t_end=0.3, dt=0.07, method="rk4",
    linear_horizon=1.0, linear_tolerance=0.05, linear_directions=1,
)  # fmt: skip


@dataclass
class Run:
    """A stored section and the same ensembles by own steps."""

    scan: DisturbedScan
    scene: Scene
    angles: Floats
    section: Dataset

    def __post_init__(self) -> None:
        self.params = self.scene.parameters
        self.norms = [Norm(self.params, q) for q in self.angles]
        self.centers = np.concatenate([self.angles, np.zeros_like(self.angles)], axis=1)
        self.starts = together(self.section, "start")
        self.count = int(np.ceil(self.scan.t_end / self.scan.dt))
        self.step = self.scan.t_end / self.count

    @cached_property
    def states(self) -> Floats:
        """States at the start and the ends of steps, shape (steps + 1, equilibrium, trajectory, 4)."""
        return rk4(motion_rates(self.params), self.starts, self.scan.t_end, self.count)

    @cached_property
    def places(self) -> list[list[tuple[int, int, int]]]:
        """Equilibrium and turns at which every trajectory rests at the end; (-1, 0, 0) for none."""
        return [[self.place(y) for y in ensemble] for ensemble in together(self.section, "final")]

    def place(self, y: Floats) -> tuple[int, int, int]:
        for i, norm in enumerate(self.norms):
            turns = np.rint((y[:2] - norm.q) / (2.0 * np.pi))
            if norm(y - self.centers[i] - [*(2.0 * np.pi * turns), 0.0, 0.0]) > self.scan.return_radius:
                continue
            lowest = norm.squares[0]
            enough = 0.5 * lowest * norm.inertia * self.scan.return_radius**2
            if lowest < 0.0 or norm.excess(y) <= enough:
                return i, int(turns[0]), int(turns[1])
        return -1, 0, 0

    def outcome(self, index: int, place: tuple[int, int, int]) -> str:
        end, *turns = place
        assert self.norms[end].squares[0] > 0.0
        return "returned" if end == index and turns == [0, 0] else "elsewhere"


def settling_scene() -> tuple[Scene, Floats]:
    # Neither the slider's mass nor the damper moves an equilibrium.
    scene, angles = deepest_first("table_1")
    return scene.replace(beta=30.0, m3=0.5), angles


MAKE: dict[str, Callable[[], tuple[DisturbedScan, Scene, Floats]]] = {
    "settling": lambda: (SETTLING, *settling_scene()),
    "brief": lambda: (BRIEF, *deepest_first("bistable")),
}


@pytest.fixture(scope="module", params=list(MAKE))
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Run:
    scan, scene, angles = MAKE[request.param]()
    return Run(scan, scene, angles, stored(scan, scene, tmp_path_factory.mktemp("disturbed")))


def test_labels(run: Run) -> None:
    section = run.section
    check_labels(section, UNITS)
    assert section["outcome"].dims == section["time_to_return"].dims == ("equilibrium", "trajectory")
    assert section["start_phi"].dims == section["excursion_phi"].dims == ("equilibrium", "trajectory")
    assert section["trajectory"].data.tolist() == list(range(run.scan.trajectories))
    assert section["equilibrium"].data.tolist() == list(range(len(run.angles)))
    assert section["time_to_return_quantile"].dims == ("equilibrium", "quantile")
    assert section["linear_direction_phi"].dims == ("equilibrium", "direction")
    assert section["linear_limit"].dims == ("equilibrium", "direction")
    assert section["halving_difference_rate"].dims == ("equilibrium", "sample")


def test_equilibria_and_norm(run: Run) -> None:
    found = np.stack([run.section["phi"].data, run.section["theta"].data], axis=-1)
    np.testing.assert_allclose(found, run.angles, rtol=0, atol=1e-12)
    omegas = [norm.omega for norm in run.norms]
    np.testing.assert_allclose(run.section["omega"].data, omegas, rtol=1e-10)


def test_starts_are_uniform_in_the_ball(run: Run) -> None:
    shares = []
    for norm, center, starts in zip(run.norms, run.centers, run.starts, strict=True):
        away = starts - center
        sizes = norm(away) / run.scan.radius
        assert sizes.max() <= 1.0 + 1e-12
        shares.append(sizes**4)
        # In the eyes of the norm all directions are alike: covariance 1/(d + 2) = 1/6 of the unit matrix.
        root = np.linalg.cholesky(norm.metric / norm.inertia)
        points = away @ scipy.linalg.block_diag(root, root / norm.omega) / run.scan.radius
        rng = np.random.default_rng([run.scan.seed, len(shares) - 1])
        normal = rng.standard_normal(points.shape)
        drawn = normal / np.linalg.norm(normal, axis=1)[:, None] * rng.random((len(points), 1)) ** 0.25
        np.testing.assert_allclose(points, drawn, rtol=0, atol=1e-10)
        np.testing.assert_allclose(np.cov(points.T), np.eye(4) / 6.0, atol=0.06)
        np.testing.assert_allclose(points.mean(axis=0), np.zeros(4), atol=0.13)
    assert scipy.stats.kstest(np.concatenate(shares), "uniform").pvalue > 0.01
    # Each equilibrium has its own stream.
    assert np.unique(np.round(np.concatenate(shares), 12)).size == run.starts[..., 0].size


def test_finals_and_excursions_are_runge_kutta_s(run: Run) -> None:
    np.testing.assert_allclose(together(run.section, "final"), run.states[-1], rtol=0, atol=1e-6)
    times = np.linspace(0.0, run.scan.t_end, len(run.states))
    away_by = (run.states - run.centers[:, None])[..., :2].reshape(len(times), -1)
    rates = run.states[..., 2:].reshape(len(times), -1)
    farthest = []
    for way, rate in zip(away_by.T, rates.T, strict=True):
        spline = scipy.interpolate.CubicHermiteSpline(times, way, rate)
        turns_at = spline.derivative().roots(extrapolate=False)
        farthest.append(np.abs(spline(np.append(times, turns_at))).max())
    found = together(run.section, "excursion")
    departures = np.reshape(farthest, found.shape)
    # These steps lead a few elsewhere than they are proved to go: nothing is said of how far they swing.
    end, turns = run.section["end_equilibrium"].data, together(run.section, "turns")
    away = np.linalg.norm(run.states[-1][..., :2] - run.angles[end] - 2 * np.pi * turns, axis=-1)
    astray = np.isnan(found).any(axis=-1)
    assert astray.mean() < 0.01
    assert (away[astray] > np.pi / 2).all()
    np.testing.assert_allclose(found[~astray], departures[~astray], rtol=0, atol=1e-6)


def test_error_estimate(run: Run) -> None:
    finals = together(run.section, "final")
    count = 2 * run.count
    finer = rk4(motion_rates(run.params), run.starts[:, :256], run.scan.t_end, count)[-1]
    errors = np.stack([np.abs(finer - finals[:, :256])[..., k : k + 2].max(axis=-1) for k in (0, 2)], axis=-1)
    found = together(run.section, "halving_difference")
    assert run.section.attrs["error_estimate"] == found.max()
    assert run.section.attrs["error_estimate_median"] == np.median(found)
    assert found.shape == (len(run.angles), min(256, run.scan.trajectories), 2)
    np.testing.assert_allclose(found, errors, rtol=1e-3, atol=1e-6)
    # The truth is not much further away than half the step tells.
    truth = scipy_motion(run.params, run.starts[:, :4], np.array([run.scan.t_end]))[-1]
    away = np.abs(truth - finals[:, :4]).max(axis=-1)
    assert (away <= 1.5 * found[:, :4].max(axis=-1) + 1e-9).all()


def test_outcomes(run: Run) -> None:
    """What is proved is where SciPy comes to rest; or, where that takes minutes, what labels say."""
    end, turns = run.section["end_equilibrium"].data, together(run.section, "turns")
    names = np.array(decoded(run.section["outcome"]))
    known = (names == "returned") | (names == "elsewhere")
    np.testing.assert_array_equal(known, end >= 0)
    assert not turns[~known].any()
    if run.scan is SETTLING:
        some = slice(0, 30)
        rest = scipy_motion(run.params, run.starts[:, some], np.array([80.0]))[-1]
        assert known[:, some].mean() > 0.9
        for i, k in np.argwhere(known[:, some]):
            place = run.place(rest[i, k])
            assert (end[i, k], *turns[i, k]) == place
            assert names[i, k] == run.outcome(i, place)
    else:
        labels = fm.label_starts(run.scene, run.starts.reshape(-1, 4), run.scan.t_end, dt=0.07, method="rk4")
        np.testing.assert_array_equal(labels.well.reshape(end.shape), end)
        np.testing.assert_array_equal(labels.turns.reshape(turns.shape), turns)
    attrs = run.section["outcome"].attrs
    meanings = (
        "returned elsewhere at_saddle undecided out_of_range not_finite step_too_large not_converged "
        "start_not_finite"
    )
    assert (attrs["flag_values"].tolist(), attrs["flag_meanings"]) == ([8, 9, 7, 6, 10, 1, 2, 4, 3], meanings)
    assert run.section.attrs["failed"] == 0


def test_the_runs_have_every_outcome_that_is_no_failure(run: Run) -> None:
    seen = set(np.ravel(np.array(decoded(run.section["outcome"]))))
    if run.scan is SETTLING:
        assert {"returned", "elsewhere"} <= seen
        turns = together(run.section, "turns").reshape(-1, 2)
        assert {-1, 0} <= set(turns[:, 0].tolist())
        assert {-1, 0, 1} <= set(turns[:, 1].tolist())
    else:
        assert {"returned", "undecided"} <= seen


def test_time_to_return(run: Run) -> None:
    returned = np.array(decoded(run.section["outcome"])) == "returned"
    for i, (norm, center) in enumerate(zip(run.norms, run.centers, strict=True)):
        inside = norm(run.states[:, i] - center) <= run.scan.return_radius
        times = np.full(run.scan.trajectories, np.nan)
        for k in np.flatnonzero(returned[i]):
            if run.places[i][k] != (i, 0, 0):
                continue  # not there at the end of the run
            first = 0
            for step in range(run.count + 1):
                first = first if inside[step, k] else step + 1
            times[k] = first * run.step
        np.testing.assert_allclose(run.section["time_to_return"].data[i], times, rtol=0, atol=1e-10)


def test_statistics(run: Run) -> None:
    np.testing.assert_array_equal(run.section["quantile"].data, QUANTILES)
    outcomes, times = decoded(run.section["outcome"]), run.section["time_to_return"].data
    for i, row in enumerate(outcomes):
        share, most = row.count("returned") / len(row), 1.0 - row.count("elsewhere") / len(row)
        assert run.section["share_returned"].data[i] == pytest.approx(share)
        assert run.section["share_returned_at_most"].data[i] == pytest.approx(most)
        low, high = (run.section[f"share_returned_{end}"].data[i] for end in ("lower", "upper"))
        assert 0.0 <= low <= share + 1e-15
        assert 1.0 >= high >= most - 1e-15
        settled = sorted(
            np.inf if np.isnan(t) else t  # back later than the end of the run
            for t, where in zip(times[i].tolist(), row, strict=True)
            if where == "returned"
        )
        quantiles = []
        for q in QUANTILES:
            if not settled:
                quantiles.append(np.nan)
                continue
            place = q * (len(settled) - 1)
            low = int(place)
            high = min(low + 1, len(settled) - 1)
            if np.isinf(settled[high]):
                quantiles.append(np.inf if place > low else settled[low])
                continue
            quantiles.append(settled[low] + (place - low) * (settled[high] - settled[low]))
        np.testing.assert_allclose(run.section["time_to_return_quantile"].data[i], quantiles, rtol=1e-12)
    assert run.section["share_returned"].data[0] > 0.0
    assert np.isnan(run.section["time_to_return_quantile"].data[-1]).all()


def test_linear_directions_and_limits(run: Run) -> None:
    tolerance = run.scan.linear_tolerance
    times = np.linspace(0.0, run.scan.linear_horizon, 201)
    directions, limits = together(run.section, "linear_direction"), run.section["linear_limit"].data
    assert limits.shape == (len(run.angles), run.scan.linear_directions)
    assert np.isfinite(limits).all()
    assert (limits > 1e-6).all()
    for norm, center, rays, ends in zip(run.norms, run.centers, directions, limits, strict=True):
        np.testing.assert_allclose(norm(rays), 1.0, rtol=1e-12)
        # Not beyond the tolerance on the way there; at the limit the tolerance is passed.
        relative = np.array([0.05, 0.3, 0.6, 0.9, 0.997, 1.003])
        starts = relative[:, None, None] * ends[:, None] * rays
        nonlinear = scipy_motion(run.params, center + starts, times) - center
        jacobian = oracle_jacobian(run.params, norm.q)
        growth = scipy.linalg.expm(times[:, None, None] * jacobian)
        linear = np.einsum("tij,...j->t...i", growth, starts)
        deviation = norm(nonlinear - linear).max(axis=0) / norm(nonlinear).max(axis=0)
        assert (deviation[:-1] <= tolerance).all()
        assert (deviation[-1] > tolerance).all()
    assert not np.allclose(directions[:, 0, 0] / directions[0, 0, 0], 1.0)


def test_attributes(run: Run) -> None:
    request = run.scan.model_dump(exclude={"scene", "variables", "axes"})
    steps = [run.section.attrs[f"{name}_step"] for name in ("shortest", "longest")]
    assert steps == pytest.approx([run.step, run.step], rel=1e-15)
    assert {name: run.section.attrs[name] for name in request} == request
    assert "uniform in the ball" in run.section.attrs["distribution"]


def test_failures_are_counted(tmp_path: Path) -> None:
    scan = DisturbedScan(trajectories=100, radius=1.0, t_end=2.0, dt=0.25, method="rk4", linear_directions=1)
    section = stored(scan, settling_scene()[0].replace(beta=60.0), tmp_path)
    outcomes = np.ravel(np.array(decoded(section["outcome"]))).tolist()
    failed = outcomes.count("not_finite") + outcomes.count("step_too_large")
    assert section.attrs["failed"] == failed
    assert "step_too_large" in outcomes
    assert np.isfinite(together(section, "final")).all()  # the last finite states of those that failed
    on_the_way = ~np.isnan(section["failed"].data)
    assert on_the_way.any()
    assert (np.array(decoded(section["outcome"]))[on_the_way] == "step_too_large").all()
    assert (section["failed"].data[on_the_way] < 2.0).all()
    assert section.attrs["failures"].startswith(f"{failed} of {len(outcomes)} trajectories failed: ")


def test_less_may_be_kept(tmp_path: Path) -> None:
    """Labels only: nothing else of the trajectories, what is counted is the same."""
    fields = {"trajectories": 600, "t_end": 4.0, "return_radius": 0.1, "linear_directions": 1}
    scene = settling_scene()[0]
    whole = stored(DisturbedScan(**fields), scene, tmp_path)
    less = stored(DisturbedScan(**fields, variables=["outcome"]), scene, tmp_path)
    gone = set(whole) - set(less)
    apart = {f"{of}_{name}" for of in ("start", "final") for name in STATE}
    apart |= {f"{of}_{angle}" for of in ("turns", "excursion") for angle in ("phi", "theta")}
    assert gone == {"end_equilibrium", "failed", "time_to_return"} | apart
    for name in less:
        np.testing.assert_array_equal(less[name].data, whole[name].data)
    assert np.isfinite(less["time_to_return_quantile"].data).any()
    assert set(DisturbedScan.draw(less, {})) == {"linear_range", "outcomes"}
    with pytest.raises(ValueError, match="unknown variable 'finl'; did you mean 'final'"):
        DisturbedScan(variables=["finl"])


def test_blocks_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tiles of 256 trajectories and 5 directions: the same bits as one tile of each equilibrium."""
    scan = DisturbedScan(trajectories=700, t_end=0.5, linear_directions=12)
    scene = deepest_first("table_1")[0]
    whole = run_scan(scan, scene, RunContext(threads=2))
    monkeypatch.setattr("fastmech.scan_types.disturbed.EVALUATIONS", 1)
    monkeypatch.setattr("fastmech.scan_types.disturbed.DIRECTIONS", 5)
    assert scan.tiling(scene).count == len(whole["phi"].data) * 6
    small = run_scan(scan, scene, RunContext(threads=1))
    for name in whole:
        assert whole[name].data.tobytes() == small[name].data.tobytes(), name


def test_a_seed_of_128_bits_is_kept_whole(tmp_path: Path) -> None:
    """HDF5 has no such integers: the file holds its digits."""
    scene, seed = Scene(alpha=0.0), 2**128 - 1
    brief = {"trajectories": 3, "t_end": 0.1, "method": "rk4", "linear_directions": 1}
    section = stored(DisturbedScan(seed=seed, **brief), scene, tmp_path)
    assert section.attrs["seed"] == str(seed)
    other = stored(DisturbedScan(seed=2**64 - 1, **brief), scene, tmp_path)
    assert other.attrs["seed"] == 2**64 - 1
    assert (section["start_phi"].data != other["start_phi"].data).all()


def test_heavy_damping_fails_nothing(tmp_path: Path) -> None:
    heavy = Scene(F0=-150.0, c1=260.0, c2=60.0, alpha=0.0, beta=1e5)
    section = stored(
        DisturbedScan(trajectories=64, radius=1.2, t_end=20.0, linear_directions=2), heavy, tmp_path
    )
    assert section.attrs["failed"] == 0
    assert section.attrs["method"] == "radau5"
    assert section.attrs["error_estimate_median"] < 1e-4


def test_what_cannot_be_disturbed_is_refused_before_anything_is_computed() -> None:
    """All along a line in closed form; a ball of return by the equilibria alone."""
    line = Scene(alpha=0.0, F0=0.0, c1=0.0, c2=22.0 * 9.80665 / 1.25)
    with pytest.raises(fm.InputError, match="equilibria are not isolated: c1 = 0, F = 0"):
        DisturbedScan().check(line)
    with pytest.raises(fm.InputError, match="return_radius = 3 rad: must not exceed"):
        DisturbedScan(return_radius=3.0).tiling(Scene(alpha=0.0))
