"""``fastmech status`` and ``fastmech export``."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from cli.refusal import assert_refused

from fastmech import open_results
from fastmech.results import Dataset, Variable
from fastmech.store.provenance import provenance
from fastmech.store.write import write_results

MAP = """
[scene]
alpha = 0.0
[scan.map]
kind = "equilibrium_map"
axes.F0 = { start = -300.0, stop = 300.0, num = 5 }
axes.c1 = { start = 0.0, stop = 400.0, num = 3 }
"""


@pytest.fixture
def result(invoke) -> Path:
    Path("map.toml").write_text(MAP, encoding="utf-8")
    assert invoke("run", "map.toml", "--out", "map.h5").exit_code == 0
    return Path("map.h5")


def test_status(invoke, tiny, monkeypatch):
    def interrupt(scene):
        raise KeyboardInterrupt

    assert_refused(invoke("status", "x.h5"), "x.h5", "neither a result nor a scan in progress")
    with monkeypatch.context() as patch:
        patch.setattr("fastmech.scan_types.equilibria.find_equilibria", interrupt)
        stopped = invoke("run", tiny, "--out", "x.h5")
    assert stopped.exit_code == 130
    assert "interrupted; 4 of 5 tiles are kept in x.h5.parts; the same command goes on" in stopped.stderr
    shown = invoke("status", "x.h5", "--snapshot", "now.h5")
    assert "4 of 4 tiles  swing" in shown.stdout
    assert "0 of 1 tiles  rest" in shown.stdout
    assert "nobody works on it" in shown.stdout
    with open_results("now.h5") as results:
        assert results.sections == ("swing",)
    assert invoke("run", tiny, "--out", "x.h5").exit_code == 0
    assert invoke("status", "x.h5").stdout == "x.h5: complete\n"


OWN = """
import sympy
import fastmech as fm

q, size = fm.angles("q"), sympy.Symbol("size")
place = (sympy.sin(q), -sympy.cos(q))
push = fm.Force("M", fm.loads.Harmonic(size, 2.0), (1, 0))
how = {"points": {"M": place}, "masses": {"M": 1}, "forces": [push], "gravity": 9.81, "name": "pushed"}
damper = fm.TorsionDamper(q, 0.5)
pushed, other = (fm.Mechanism(q, {"size": F}, dampers=[damper], **how) for F in (1.0, 2.0))
"""

OWN_SCANS = """
[scan.fall]
kind = "motion"
t_end = 1.0
outputs = 3
start.q = 0.5
[scan.ends]
kind = "attractors"
ranges.q = [-3.0, 3.0]
n = 3
"""


def test_status_of_a_mechanism_of_ones_own(invoke, monkeypatch):
    """Without the mechanism, and without running its file; a snapshot, which is assembled, asks for it."""

    def interrupt(*given, **more):
        raise KeyboardInterrupt

    monkeypatch.setattr("fastmech.scan_types.attractors.find_attractors", interrupt)
    own, request = Path("own.py"), Path("own.toml")
    own.write_text(OWN, encoding="utf-8")
    request.write_text(OWN_SCANS, encoding="utf-8")
    assert invoke("run", request, "--out", "x.h5", "--mechanism", "own.py:pushed").exit_code == 130
    own.rename("moved.py")
    request.unlink()
    shown = invoke("status", "x.h5")
    assert shown.exit_code == 0
    assert "3 of 3 tiles  fall, 3 of 3 integrations" in shown.stdout
    assert "0 of 1 tiles  ends" in shown.stdout
    snapshot = ["status", "x.h5", "--snapshot", "now.h5"]
    missing, other = invoke(*snapshot), invoke(*snapshot, "--mechanism", "moved.py:other")
    assert missing.exit_code == other.exit_code == 2
    assert "x.h5: is of the mechanism 'pushed', which the file does not hold; give" in missing.stderr
    assert "x.h5: the scan in progress differs: scene.size = 1.0 there, 2.0 here" in other.stderr
    assert invoke(*snapshot, "--mechanism", "moved.py:pushed").exit_code == 0
    with open_results("now.h5") as results:
        assert results.sections == ("fall",)
        assert results["fall"]["q"].data[0] == 0.5
    assert "--mechanism needs --snapshot" in invoke("status", "x.h5", "--mechanism", "moved.py:pushed").stderr


def test_csv(invoke, result):
    done = invoke("export", result, "--to", "csv", "--out", "tables", "--section", "map")
    assert done.exit_code == 0
    with Path("tables/map_F0_c1_root.csv").open(newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(line for line in file if not line.startswith("#"))
    assert head[:4] == ["F0 [N]", "c1 [N/m]", "root", "phi [rad]"]
    with open_results(result) as results:
        phi = results["map"]["phi"].data
    found = np.array([float(row[3]) for row in rows]).reshape(phi.shape)
    np.testing.assert_array_equal(found, phi)
    assert [float(rows[-1][0]), float(rows[-1][1])] == [300.0, 400.0]


def test_npz(invoke, result):
    assert invoke("export", result, "--to", "npz", "--out", "arrays").exit_code == 0
    with open_results(result) as results, np.load("arrays/map.npz") as arrays:
        assert set(arrays) == {*results["map"], "attributes.json"}
        for name in results["map"]:
            np.testing.assert_array_equal(arrays[name], results["map"][name].data)


def test_netcdf(invoke, result):
    xarray = pytest.importorskip("xarray")
    assert invoke("export", result, "--to", "nc", "--out", "nc", "--select", "F0=149").exit_code == 0
    with xarray.open_dataset("nc/map.nc", engine="h5netcdf") as opened, open_results(result) as results:
        assert opened["F0"].item() == 150.0
        assert opened["phi"].dims == ("c1", "root")
        assert opened["phi"].attrs["units"] == "rad"
        np.testing.assert_array_equal(opened["phi"].values, results["map"]["phi"].data[3])


def test_selection(invoke, result):
    with open_results(result) as results:
        section = results["map"]
        chosen = section.select(["phi", "count"], F0=-140.0, c1=210.0)
        assert chosen["phi"].dims == ("root",)
        assert (chosen["F0"].data.item(), chosen["c1"].data.item()) == (-150.0, 200.0)
        np.testing.assert_array_equal(chosen["phi"].data, section["phi"].data[1, 1])
        assert section.select(["phi"], root=2)["phi"].dims == ("F0", "c1")
        whole = section.select()
        assert set(whole) == set(section)


def test_selection_is_told(invoke, result):
    done = invoke("export", result, "--to", "npz", "--out", "x", "--select", "F0=-140", "--select", "c1=200")
    assert done.exit_code == 0
    assert "map: F0 = -150 N (nearest to -140)\nmap: c1 = 200 N/m\n" in done.stdout
    again = invoke("export", result, "--to", "npz", "--out", "y", "--select", "F0=-149", "--json")
    assert json.loads(again.stdout)["selected"] == ["map: F0 = -150 N (nearest to -149)"]


def test_a_range(invoke, result):
    done = invoke("export", result, "--to", "npz", "--out", "x", "--select", "F0=-10:150")
    assert done.exit_code == 0
    assert "map: F0 = 0 to 150 N (2 of 5 values)" in done.stdout
    with open_results(result) as results, np.load("x/map.npz") as arrays:
        np.testing.assert_array_equal(arrays["F0"], [0.0, 150.0])
        np.testing.assert_array_equal(arrays["phi"], results["map"]["phi"].data[2:4])


@pytest.mark.parametrize(
    ("arguments", "fragment"),
    [
        (["--select", "F0"], "NAME=VALUE"),
        (["--select", "F0=x"], "NAME=VALUE"),
        (["--select", "F0=nan"], "NAME=VALUE"),
        (["--select", "F0=1:2:3"], "NAME=LOW:HIGH"),
        (["--select", "F0=1e9"], "F0 = 1000000000: must be within -300 to 300 N"),
        (["--select", "F0=10:20"], "F0 = 10 to 20: must be within -300 to 300 N and hold at least one value"),
        (["--select", "F0=20:10"], "must not be above"),
        (["--select", "F0=1", "--select", "F0=2"], "twice"),
        (["--select", "F1=1"], "F1"),
        (["--select", "cusp=99", "--section", "map/curves"], "cusp = 99"),
        (["--variable", "phii"], "phii"),
        (["--section", "none"], "none"),
    ],
)
def test_wrong_names_are_refused(invoke, result, arguments, fragment):
    assert_refused(invoke("export", result, "--to", "csv", "--out", "x", *arguments), fragment)
    assert not Path("x").exists()


def test_existing_files_are_kept(invoke, result):
    Path("out").mkdir()
    Path("out/map.npz").write_text("mine")
    assert_refused(invoke("export", result, "--to", "npz", "--out", "out"), "exists already", "--fresh")
    assert Path("out/map.npz").read_text() == "mine"
    assert invoke("export", result, "--to", "npz", "--out", "out", "--fresh").exit_code == 0


@pytest.mark.parametrize(
    ("content", "fragment"),
    [
        (b"", "is empty"),
        (np.random.default_rng(5).bytes(4000), "is not an HDF5 file"),
        (b"\x89HDF\r\n\x1a\n" + np.random.default_rng(6).bytes(4000), "is damaged"),
    ],
)
def test_status_of_what_is_no_result(invoke, content, fragment):
    Path("x.h5").write_bytes(content)
    assert_refused(invoke("status", "x.h5"), f"x.h5: {fragment}")


@pytest.mark.parametrize("kept", [0.1, 0.5, 0.999])
def test_status_of_a_truncated_result(invoke, result, kept):
    content = result.read_bytes()
    result.write_bytes(content[: int(kept * len(content))])
    assert_refused(invoke("status", result), f"{result}: is damaged", "truncated")


@pytest.mark.parametrize("command", ["status", "info"])
def test_a_loop_of_links_is_told(invoke, command):
    Path("a.h5").symlink_to("b.h5")
    Path("b.h5").symlink_to("a.h5")
    assert_refused(invoke(command, "a.h5"), "a.h5: cannot be read: Too many levels of symbolic links")


def test_status_of_a_snapshot_and_of_a_tile(invoke, tiny):
    assert invoke("run", tiny, "--tile", "swing:1", "--keep", "t1.h5").exit_code == 0
    assert_refused(invoke("status", "t1.h5"), "t1.h5: is one tile, not the result of a scan")


def everything_told(text: str) -> list[str]:
    """What an export has to say of the map: one fragment for each thing."""
    assert 'kind = "equilibrium_map"' in text  # the request
    return [
        "alpha = 0.0", "fastmech_version", "numba_version", "scene_c1", "162.5", "N/m", "history",
        "fastmech", "CF-1.11", "what is proved of the count", "at_fold", "negative eigenvalues",
    ]  # fmt: skip


@pytest.mark.parametrize("form", ["csv", "npz", "nc"])
def test_exports_keep_everything(invoke, result, form):
    if form == "nc":
        pytest.importorskip("h5netcdf")
    assert invoke("export", result, "--to", form, "--out", "out", "--select", "F0=150").exit_code == 0
    if form == "csv":
        text = "".join(Path(f"out/map_c1{root}.csv").read_text(encoding="utf-8") for root in ("", "_root"))
        assert "# outcome = what is proved of the count (0: complete, 1: at_fold" in text
        assert "# selected: " in text
    elif form == "npz":
        with np.load("out/map.npz") as arrays:
            text = arrays["attributes.json"].decode()
        about = json.loads(text)
        assert about["attributes"]["scene_c1"] == 162.5
        assert about["variables"]["outcome"]["flag_values"] == [0, 1, 2, 3]
        assert about["variables"]["morse_index"]["_FillValue"] == -1
        text = text.replace('\\"', '"')
    else:
        with h5py.File("out/map.nc") as file:
            attrs = {**file.attrs}
            attrs |= {f"{name}.{key}": v for name in file for key, v in file[name].attrs.items()}
        assert attrs["scene_c1"] == 162.5
        assert attrs["morse_index._FillValue"] == -1
        assert attrs["outcome.flag_values"].tolist() == [0, 1, 2, 3]
        text = "\n".join(f"{key}: {value}" for key, value in attrs.items())
    for fragment in everything_told(text):
        assert fragment in text, fragment


def test_pandas_reads_a_table_below_its_comments(invoke, result):
    pandas = pytest.importorskip("pandas")
    assert invoke("export", result, "--to", "csv", "--out", "tables").exit_code == 0
    table = pandas.read_csv("tables/map_F0_c1.csv", comment="#")
    with open_results(result) as results:
        np.testing.assert_array_equal(table["count"], results["map"]["count"].data.ravel())
    curves = pandas.read_csv("tables/map/curves_fold_point.csv", comment="#")
    assert {"fold_F0 [N]", "fold_c1 [N/m]"} <= set(curves)


def test_variables_named_like_arguments_of_numpy(invoke):
    awkward = Dataset(
        {name: Variable(("n",), np.arange(3.0), "1", name) for name in ("file", "allow_pickle", "args")}
    )
    attrs = {**provenance(1), "title": "awkward names"}
    write_results("a.h5", scene_parameters={}, sections={"one": awkward}, attrs=attrs)
    assert invoke("export", "a.h5", "--to", "npz", "--out", "out").exit_code == 0
    with np.load("out/one.npz") as arrays:
        assert arrays["file"].tolist() == arrays["allow_pickle"].tolist() == [0.0, 1.0, 2.0]


def test_a_group_is_exported_alone(invoke, result):
    assert invoke("export", result, "--to", "npz", "--out", "out", "--section", "map/curves").exit_code == 0
    assert [str(path) for path in Path("out").rglob("*.*")] == ["out/map/curves.npz"]
