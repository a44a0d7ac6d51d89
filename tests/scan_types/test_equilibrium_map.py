"""The map as a scan: its layout, its curves, and the same result in memory and streamed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scan_types.values import run_scan

import fastmech as fm
from fastmech.errors import InputError
from fastmech.results import Dataset
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.equilibrium_map import EquilibriumMapScan
from fastmech.scan_types.request import RunContext, read_request
from fastmech.scan_types.snap import SnapScan
from fastmech.scene import Scene
from fastmech.store.provenance import provenance
from fastmech.store.read import open_results
from fastmech.store.write import Stream, write_results

SCENE = Scene(c1=294.9, c2=92.85, F0=85.3, alpha=0.0)
AXES = {
    "F0": {"start": -300.0, "stop": 300.0, "num": 31},
    "c2": {"start": 0.0, "stop": 300.0, "num": 23},
}


def mapped() -> Dataset:
    result = run_scan(EquilibriumMapScan(axes=AXES), SCENE, RunContext())
    assert isinstance(result, Dataset)
    return result


def test_padding_is_as_documented() -> None:
    dataset = mapped()
    empty = np.arange(6) >= dataset["count"].data[..., None]
    for name in ("phi", "theta", "radius", "energy", "frequency", "decay_time", "depth", "shock_limit_m2"):
        assert dataset[name].dims == ("F0", "c2", "root")
        assert np.isnan(dataset[name].data[empty]).all(), name
    for name in ("hessian_phi_phi", "hessian_theta_theta", "eigenvalue_re_1", "eigenvalue_im_4"):
        assert np.isnan(dataset[name].data[empty]).all(), name
    codes = ("morse_index", "sheet", "verdict", "verdict_sylvester", "verdict_hurwitz", "verdict_eigenvalues")
    for name in codes:
        assert (dataset[name].data[empty] == -1).all(), name
        assert dataset[name].attrs["_FillValue"] == -1, name
        assert -1 not in dataset[name].codes.values(), name
        assert (dataset[name].data[~empty] >= 0).all(), name
    assert "NaN" in dataset.attrs["layout"]


def test_curves_come_with_the_map() -> None:
    dataset = mapped().groups["curves"]
    assert list(dataset["fold_proof"].data) == ["complete"]
    assert set(dataset["fold_kind"].data) == {0}
    assert dataset["cusp_F0"].data.size >= 4
    assert set(np.unique(dataset["undamped_vanishes"].data)) >= {0, 2}
    assert all(dataset[f"undamped_{one}"].data.ndim == 0 for one in ("crossings", "off_curves", "cut_short"))
    line = run_scan(
        EquilibriumMapScan(axes={"F0": {"start": -800.0, "stop": 800.0, "num": 99}}), SCENE, RunContext()
    )
    assert line.groups["curves"]["fold_F0"].data == pytest.approx(
        [-671.1627073982018, 671.1627073982018], abs=1e-9
    )


def test_xarray_opens_a_map_with_names_and_units(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    path = tmp_path / "map.h5"
    attrs = {**provenance(1), "title": "map"}
    write_results(path, scene_parameters={}, sections={"map": mapped()}, attrs=attrs)
    with xarray.open_dataset(path, group="map", engine="h5netcdf") as opened:
        assert opened["F0"].attrs["units"] == "N"
        assert opened["c2"].attrs["units"] == "N/m"
        assert opened["phi"].sel(F0=300.0, c2=0.0).dims == ("root",)
        assert all("units" in variable.attrs for variable in opened.variables.values())
        assert set(opened.coords) == {"F0", "c2", "root"}
        assert list(opened["root"]) == list(range(6))
        count = opened["phi"].notnull().sum("root")
        assert count.equals(opened["count"].astype(count.dtype))
        # What the layout's text promises: the deepest first, reductions without a mask, entries by name.
        first = opened["energy"].isel(root=0)
        assert bool((first == opened["energy"].min("root")).all())
        stiff = opened["hessian_theta_theta"].where(opened["morse_index"] == 0)
        assert float(stiff.min()) > 0.0
        assert bool(
            (opened["eigenvalue_re_1"] >= opened["eigenvalue_re_4"])
            .where(opened["phi"].notnull(), True)
            .all()
        )
        # A row for each slot of each point, whatever curves there are, and codes that are none are missing.
        table = opened.to_dataframe()
        assert len(table) == 31 * 23 * 6
        assert table["verdict"].isna().sum() == (6 - opened["count"]).sum()
        # One identity across the map: pick a sheet and there is one value at a point.
        one = opened["phi"].where(opened["sheet"] == 0)
        assert one.max("root").dims == ("F0", "c2")
        assert int(one.notnull().sum("root").max()) == 1


def test_tiles_agree_with_the_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = mapped()
    monkeypatch.setattr("fastmech.scan_types.equilibrium_map.TILE_POINTS", 100)
    tiling = EquilibriumMapScan(axes=AXES).tiling(SCENE)
    assert tiling.count == 9
    assert sum(map(tiling.items, range(tiling.count))) == 31 * 23
    tiles = [tiling.compute(index, RunContext(threads=1)) for index in range(tiling.count)]
    result = tiling.assemble(tiles.__getitem__)
    assert isinstance(result, Stream)
    path = tmp_path / "map.h5"
    attrs = {**provenance(1), "title": "map"}
    write_results(path, scene_parameters={}, sections={"map": result}, attrs=lambda: attrs)
    with open_results(path) as results:
        streamed = results["map"].load()
    assert set(streamed) == set(whole)
    for group in ("curves", "sheets"):
        for name, variable in whole.groups[group].variables.items():
            np.testing.assert_array_equal(streamed.groups[group][name].data, variable.data)
    for name in whole:
        one, two = whole[name], streamed[name]
        assert (one.dims, one.units, one.long_name) == (two.dims, two.units, two.long_name), name
        if one.data.dtype.kind == "f":
            # Tiles start afresh, so angles may differ in their last bits, and a rate of nothing entirely.
            settled = np.isfinite(one.data) & (np.abs(one.data) < 1e6)
            np.testing.assert_allclose(two.data[settled], one.data[settled], rtol=1e-6, atol=1e-6)
        else:
            np.testing.assert_array_equal(two.data, one.data)


def test_pictures_read_a_part_of_a_large_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = mapped()
    path = tmp_path / "map.h5"
    attrs = {**provenance(1), "title": "map"}
    write_results(path, scene_parameters={}, sections={"map": whole}, attrs=attrs)
    monkeypatch.setattr("fastmech.plots.map_view.MOST_DRAWN", 10)
    monkeypatch.setattr("fastmech.store.decode.PIECE_BYTES", 4000)
    with open_results(path) as results:
        drawn = EquilibriumMapScan.read(results["map"], SCENE.parameters)
    assert drawn.sizes["F0"] <= 10
    assert drawn.sizes["c2"] <= 10
    for name in drawn:
        part = tuple({"F0": slice(None, None, 4), "c2": slice(None, None, 3)}.get(d, slice(None))
                     for d in whole[name].dims)  # fmt: skip
        np.testing.assert_array_equal(drawn[name].data, whole[name].data[part], err_msg=name)
        assert drawn[name].dims == whole[name].dims
    assert {"phi", "sheet", "count"} <= set(drawn)
    assert {"fold_F0", "undamped_c2"} <= set(drawn.groups["curves"])
    assert not {"hessian_phi_phi", "eigenvalue_re_1", "radius"} & set(drawn)
    figures = EquilibriumMapScan.draw(drawn, SCENE.parameters)
    assert figures["count"].get_suptitle().endswith("; 1 in 4 values of F0; 1 in 3 values of c2")


def test_of_a_third_axis_only_the_drawn_plane_is_read(tmp_path: Path) -> None:
    axes = AXES | {"c1": {"start": 280.0, "stop": 310.0, "num": 4}}
    whole = run_scan(EquilibriumMapScan(axes=axes), SCENE, RunContext())
    assert isinstance(whole, Dataset)
    path = tmp_path / "map.h5"
    attrs = {**provenance(1), "title": "map"}
    write_results(path, scene_parameters={}, sections={"map": whole}, attrs=attrs)
    with open_results(path) as results:
        drawn = EquilibriumMapScan.read(results["map"], SCENE.parameters)
    # 290 N/m is the nearest of 280, 290, 300, 310 to the scene's 294.9.
    assert list(drawn["c1"].data) == [290.0]
    np.testing.assert_array_equal(drawn["phi"].data, whole["phi"].data[:, :, 1:2])
    assert "c1 = 290 N/m" in EquilibriumMapScan.draw(drawn, SCENE.parameters)["count"].get_suptitle()


def test_chosen_variables_only() -> None:
    result = run_scan(EquilibriumMapScan(axes=AXES, variables=["count", "phi"]), SCENE, RunContext())
    assert {"count", "phi", "sheet"} <= set(result)
    assert "depth" not in result
    with pytest.raises(fm.InputError, match="unknown variable 'phii'; did you mean 'phi'"):
        EquilibriumMapScan(axes=AXES, variables=["phii"]).check(SCENE)


def test_a_mechanism_s_wells_are_proved_where_their_depth_is_asked_for() -> None:
    """A pendulum's well is 2 l sqrt((m g)^2 + F^2) deep."""
    chain, loads = fm.mechanisms.pendulum_chain(1), {"F": {"start": 0.0, "stop": 9.0, "num": 4}}
    dataset = run_scan(EquilibriumMapScan(axes=loads, variables=["depth"]), chain, RunContext())
    assert isinstance(dataset, Dataset)
    deep = 2.0 * chain.parameters["l"] * np.hypot(chain.parameters["g"], dataset["F"].data)
    np.testing.assert_allclose(np.nanmax(dataset["depth"].data, axis=1), deep, rtol=1e-9)
    assert "depth" not in run_scan(EquilibriumMapScan(axes=loads), chain, RunContext())


def test_requests_of_the_atlas_are_valid() -> None:
    for path in sorted((Path(__file__).parents[2] / "scans").glob("atlas_*.toml")):
        assert read_request(path, scan_kinds()).scans


def test_snap_scan() -> None:
    dataset = run_scan(SnapScan(), SCENE, RunContext())
    assert dataset.sizes["equilibrium"] == 2
    assert np.nanmin(dataset["snap_below"].data) == pytest.approx(-671.1627073982018, abs=1e-9)
    with pytest.raises(InputError, match="searched"):
        run_scan(SnapScan(searched=[0.0, 1.0]), SCENE, RunContext())


def test_snap_scan_of_a_spring_and_a_place() -> None:
    scene = Scene(F0=0.0, c1=20.0, c2=92.85, alpha=0.0)
    dataset = run_scan(SnapScan(parameter="c1", position=[-1.57, 0.0]), scene, RunContext())
    assert (dataset.sizes["equilibrium"], dataset["snap_above"].units) == (1, "N/m")
    assert dataset["snap_above"].data == pytest.approx(43.17473449, abs=1e-7)
    assert dataset["turns_unstable"].data.tolist() == [[False, True]]
    with pytest.raises(ValueError, match="must be one that moves equilibria"):
        run_scan(SnapScan(parameter="beta"), scene, RunContext())


def test_a_map_too_large_for_any_machine_is_refused_at_once() -> None:
    axis = {"start": 0.0, "stop": 1.0, "num": 100_000}
    scan = EquilibriumMapScan(axes={"F0": axis, "c1": axis})
    with pytest.raises(InputError, match=r"^axes: ask for 1e\+10 points, at most 5e\+07 are allowed$"):
        scan.check(Scene(alpha=0.0))
