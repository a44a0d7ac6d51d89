"""``fastmech status`` and ``fastmech export``."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from cli.refusal import assert_refused

from fastmech import open_results

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
    def interrupt(self, scene, context):
        raise KeyboardInterrupt

    assert_refused(invoke("status", "x.h5"), "x.h5", "neither a result nor a scan in progress")
    with monkeypatch.context() as patch:
        patch.setattr("fastmech.scan_types.equilibria.EquilibriaScan.run", interrupt)
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


def test_csv(invoke, result):
    done = invoke("export", result, "--to", "csv", "--out", "tables", "--section", "map")
    assert done.exit_code == 0
    with Path("tables/map_F0_c1_root.csv").open(newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head[:4] == ["F0 [N]", "c1 [N/m]", "root", "phi [rad]"]
    with open_results(result) as results:
        phi = results["map"]["phi"].data
    found = np.array([float(row[3]) for row in rows]).reshape(phi.shape)
    np.testing.assert_array_equal(found, phi)
    assert [float(rows[-1][0]), float(rows[-1][1])] == [300.0, 400.0]


def test_npz(invoke, result):
    assert invoke("export", result, "--to", "npz", "--out", "arrays").exit_code == 0
    with open_results(result) as results, np.load("arrays/map.npz") as arrays:
        assert set(arrays) == set(results["map"])
        for name in arrays:
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
        (["--select", "cusp=99"], "cusp = 99"),
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
