"""Disturbed ensembles over parameters: every sheet's numbers are those of ``fm.disturb`` at its point."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plots.legibility import assert_legible
from scan_types.values import check_labels, run_scan, stored

import fastmech as fm
from fastmech.results import Dataset
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.disturbed import DisturbedScan
from fastmech.scan_types.request import RunContext, read_request

BISTABLE = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)
#: Both wells, and beyond the fold of the shallow one.
F0, C2 = np.array([0.0, 60.0, 120.0]), np.array([80.0, 110.0])
AXES = {"F0": {"start": 0.0, "stop": 120.0, "num": 3}, "c2": {"start": 80.0, "stop": 110.0, "num": 2}}
SMALL: dict[str, Any] = {"trajectories": 40, "radius": 1.0, "t_end": 20.0, "seed": 3}
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0)


@pytest.fixture(scope="module")
def section(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return stored(DisturbedScan(axes=AXES, **SMALL), BISTABLE, tmp_path_factory.mktemp("disturbed_map"))


def test_labels(section: Dataset) -> None:
    shares = [f"share_returned{end}" for end in ("", "_at_most", "_lower", "_upper")]
    units = dict.fromkeys([*shares, "sheet", "sheet_morse_index", "quantile", "share_failed"], "1")
    angles = ("phi", "theta", "largest_excursion_phi", "largest_excursion_theta", "return_radius")
    units |= dict.fromkeys(angles, "rad")
    check_labels(section, units | {"F0": "N", "c2": "N/m", "time_to_return_quantile": "s", "t_end": "s"})
    assert section["share_returned"].dims == ("F0", "c2", "sheet")
    assert section["time_to_return_quantile"].dims == ("F0", "c2", "sheet", "quantile")
    asked = DisturbedScan(axes=AXES, **SMALL)
    assert {name: section.attrs[name] for name in asked.settings} == asked.settings
    assert (section.attrs["failed"], section.attrs["refused"]) == (0, 0)


def test_every_equilibrium_is_in_its_sheet(section: Dataset) -> None:
    atlas = fm.map_equilibria(BISTABLE, {"F0": F0, "c2": C2})
    np.testing.assert_array_equal(section["sheet_morse_index"].data, atlas.sheet_morse_index)
    there = np.isfinite(section["phi"].data)
    assert there.sum() == atlas.count.sum() == np.isfinite(section["share_returned"].data).sum()
    for sheet in section["sheet"].data:
        for name in ("phi", "theta"):
            every = getattr(atlas, name)
            right = np.where(atlas.sheet == sheet, every, -np.inf).max(axis=-1)
            found = section[name].data[..., sheet]
            np.testing.assert_array_equal(np.where(np.isnan(found), -np.inf, found), right)


@pytest.mark.filterwarnings("ignore:equilibrium. is a")
def test_numbers_are_those_of_disturb(section: Dataset) -> None:
    for i, k in ((0, 0), (1, 1), (2, 0)):
        scene = BISTABLE.replace(F0=float(F0[i]), c2=float(C2[k]))
        for e in fm.find_equilibria(scene):
            apart = np.abs(section["phi"].data[i, k] - e.phi) + np.abs(section["theta"].data[i, k] - e.theta)
            at = (i, k, int(np.nanargmin(apart)))
            assert apart[at[-1]] < 1e-9
            run = fm.disturb(scene, e, 40, radius=1.0, t_end=20.0, seed=3)
            shares = run.returned
            for end, value in (
                ("", run.share_returned),
                ("_at_most", run.share_returned_at_most),
                ("_lower", shares.lower),
                ("_upper", shares.upper),
            ):
                assert section[f"share_returned{end}"].data[at] == pytest.approx(float(value), rel=1e-14)
            farthest = [section[f"largest_excursion_{angle}"].data[at] for angle in ("phi", "theta")]
            np.testing.assert_array_equal(farthest, run.excursion.max(axis=0))
            late = run.outcome == fm.Status.RETURNED
            times = np.where(np.isnan(run.time_to_return[late]), 1e9, run.time_to_return[late])
            quantiles = section["time_to_return_quantile"].data[at]
            if not late.any():
                assert np.isnan(quantiles).all()
                continue
            right = np.quantile(times, QUANTILES)
            np.testing.assert_allclose(quantiles[right < 1e6], right[right < 1e6], rtol=1e-12)
            assert np.isinf(quantiles[right > 1e6]).all()
    # In 20 s much is not decided here, and an unstable equilibrium is never returned to.
    shares = section["share_returned"].data
    assert (section["share_returned_at_most"].data - shares > 0.05).any()
    unstable = section["sheet_morse_index"].data > 0
    assert np.nanmax(shares[..., unstable]) == 0.0
    assert np.nanmax(shares[..., ~unstable]) > 0.5


def test_tiles_need_no_other_one_and_no_threads(section: Dataset) -> None:
    tiling = DisturbedScan(axes=AXES, **SMALL).tiling(BISTABLE)
    last = tiling.count - 1
    alone = tiling.compute(last, RunContext(threads=1))
    look = tiling.assemble(lambda index: alone if index == last else tiling.missing(index))
    assert isinstance(look, Dataset)
    look = look.merged
    share = look["share_returned"].data
    assert np.isfinite(share).sum() == 1
    there = np.isfinite(share)
    for name in (
        "share_returned",
        "share_returned_at_most",
        "largest_excursion_phi",
        "time_to_return_quantile",
    ):
        np.testing.assert_array_equal(look[name].data[there], section[name].data[there])


def test_a_tile_is_left_between_blocks() -> None:
    class Left(Exception):  # noqa: N818
        pass

    def leave() -> None:
        raise Left

    with pytest.raises(Left):
        DisturbedScan(axes=AXES, **SMALL).tiling(BISTABLE).compute(0, RunContext(threads=1, check=leave))


def test_failures_and_refusals_are_no_results() -> None:
    """Steps far too long lose trajectories; a ball of return that meets another equilibrium is refused."""
    scene = fm.Scene(c1=2000.0, c2=8000.0, beta=20.0, alpha=0.0)
    axes = {"F0": {"start": 0.0, "stop": 100.0, "num": 2}}
    fields: dict[str, Any] = {"trajectories": 64, "radius": 1.0, "t_end": 20.0}
    lost = run_scan(DisturbedScan(axes=axes, dt=0.05, **fields), scene, RunContext(threads=1))
    failed = lost["share_failed"].data
    assert lost.attrs["failed"] == np.nansum(failed) * 64 > 20
    assert (lost["share_returned_at_most"].data >= failed - 1e-15)[np.isfinite(failed)].all()
    assert np.nanmax(lost["largest_excursion_theta"].data) < 1e4
    kept = run_scan(DisturbedScan(axes=axes, **fields), scene, RunContext(threads=1))
    assert kept.attrs["failed"] == 0
    refused = run_scan(DisturbedScan(axes=axes, return_radius=3.0, **fields), scene, RunContext(threads=1))
    assert refused.attrs["refused"] == np.isfinite(refused["phi"].data).sum()
    assert str(refused.attrs["refused_first"]).startswith("return_radius = 3 rad: must not exceed")
    for dataset in (lost, refused):
        figures = DisturbedScan.draw(dataset, scene.parameters)
        for figure in figures.values():
            assert_legible(figure)
        texts = [text.get_text() for text in figures["excursions"].legends[0].get_texts()]
        assert any("failed numerically" in text for text in texts)


@pytest.mark.parametrize("axes", [AXES, {"c2": AXES["c2"]}, AXES | {"c1": AXES["c2"] | {"num": 1}}])
def test_pictures(axes: dict[str, Any]) -> None:
    found = run_scan(
        DisturbedScan(axes=axes, **SMALL | {"trajectories": 12}), BISTABLE, RunContext(threads=1)
    )
    figures = DisturbedScan.draw(found, BISTABLE.parameters)
    assert set(figures) == {"share_returned", "time_to_return", "excursions"}
    for figure in figures.values():
        assert_legible(figure)


@pytest.mark.nojit
def test_the_request_in_the_repository_is_valid() -> None:
    request = read_request(Path(__file__).parents[2] / "scans" / "disturbed_map.toml", scan_kinds())
    assert all(isinstance(scan, DisturbedScan) and scan.axes for scan in request.scans.values())


@pytest.mark.nojit
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ("axes.c4 = {start=1.0, stop=2.0, num=3}", r"unknown parameter 'c4'"),
        ("axes.alpha = {start=0.0, stop=2.0, num=3}", r"scan.b.scene.alpha = 2: must be 0"),
        ("axes.beta = {start=0.0, stop=1.0, num=3}", r"beta = 0"),
        ("axes.m1 = {start=0.0, stop=1.0, num=3}", r"m1 = 0"),
        (
            "axes.c1 = {start=1.0, stop=2.0, num=3}\nlinear_directions = 4",
            r"linear_directions: is nothing of a",
        ),
        (
            "axes.c1 = {start=1.0, stop=2.0, num=3}\ntrajectories = 100_000",
            r"trajectories = 100000: must be at",
        ),
        (
            "axes = {c1 = {start=1.0, stop=2.0, num=1000}, c2 = {start=1.0, stop=2.0, num=1000}}",
            r"1e\+06 points",
        ),
    ],
)
def test_wrong_requests(changes: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "r.toml"
    path.write_text(f'[scene]\nalpha = 0.0\n[scan.b]\nkind = "disturbed"\n{changes}\n')
    with pytest.raises(fm.InputError, match=message):
        read_request(path, scan_kinds())
