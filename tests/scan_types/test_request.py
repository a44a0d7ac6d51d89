"""Request files: what is read, and that every mistake is found before anything runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from fastmech.errors import InputError
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.equilibrium_map import EquilibriumMapScan
from fastmech.scan_types.request import Request, Scan, read_request
from fastmech.scene import Scene

FULL = """
title = "two scans"

[scene]
m1 = 9
beta = 100.5

[scan.first]
kind = "motion"
start = { phi = 1 }
t_end = 2.5
outputs = 11

[scan.second]
kind = "equilibrium_map"
scene = { alpha = 0.0, m1 = 8.0 }
axes.F0 = { start = -10.0, stop = 10.0, num = 3 }
"""


def read(folder: Path, text: str) -> Request:
    path = folder / "request.toml"
    path.write_text(text, encoding="utf-8")
    return read_request(path, scan_kinds())


def test_kinds_are_found():
    assert {"motion", "equilibria", "disturbed_motion", "disturbed", "equilibrium_map"} <= set(scan_kinds())
    for name, kind in scan_kinds().items():
        assert issubclass(kind, Scan)
        assert kind.kind == name


def test_everything_is_read(tmp_path: Path):
    request = read(tmp_path, FULL)
    assert request.title == "two scans"
    assert request.text == FULL
    assert request.scene == Scene(m1=9.0, beta=100.5)
    assert list(request.scans) == ["first", "second"]
    first = request.scans["first"].model_dump()
    assert (first["start"], first["t_end"], first["outputs"]) == ({"phi": 1.0}, 2.5, 11)
    second = request.scans["second"]
    assert isinstance(second, EquilibriumMapScan)
    assert second.axes["F0"].array.tolist() == [-10.0, 0.0, 10.0]


def test_a_scan_has_the_scene_with_its_changes(tmp_path: Path):
    request = read(tmp_path, FULL)
    assert request.scene_of("first") == request.scene
    assert request.scene_of("second") == Scene(m1=8.0, beta=100.5, alpha=0.0)


def test_what_is_left_out_is_the_default(tmp_path: Path):
    request = read(tmp_path, '[scan.a]\nkind = "motion"\n')
    assert request.title == "request"
    assert request.scene == Scene()
    assert request.scans["a"] == scan_kinds()["motion"]()


def test_the_project_s_own_requests_are_valid():
    requests = sorted((Path(__file__).parents[2] / "scans").glob("*.toml"))
    assert requests
    for path in requests:
        assert read_request(path, scan_kinds()).scans


A = '[scan.a]\nkind = "motion"\n'
MAP = '[scan.a]\nkind = "equilibrium_map"\n'

MISTAKES = {
    "unknown table": ("[scnee]\n" + A, "scnee: unknown name; did you mean 'scene'?"),
    "title": ("title = 3\n" + A, "title = 3: must be a text"),
    "scene is no table": ("scene = 3\n" + A, "scene = 3: must be a table"),
    "scan is no table": ("[scan]\na = 3", "scan.a = 3: must be a table"),
    "no scan": ("title = 'none'", "asks for no scan"),
    "parameter": ("[scene]\nbata = 3\n" + A, "scene.bata: unknown name; did you mean 'beta'?"),
    "parameter's value": ("[scene]\nm2 = -1\n" + A, "scene.m2 = -1: input should be greater than 0"),
    "parameter's type": ('[scene]\nm2 = "12 kg"\n' + A, "scene.m2 = '12 kg': "),
    "changed parameter": (
        A + "scene = { bata = 3 }",
        "scan.a.scene.bata: unknown name; did you mean 'beta'?",
    ),
    "changed value": (A + "scene = { l = 0 }", "scan.a.scene.l = 0: input should be greater than 0"),
    "changes are no table": (A + "scene = 3", "scan.a.scene = 3: "),
    "name": ('[scan."a b"]\nkind = "motion"', "scan.a b: the name 'a b'"),
    "no kind": ("[scan.a]", "scan.a.kind: missing; allowed: "),
    "kind": ('[scan.a]\nkind = "motions"', "scan.a.kind = 'motions': unknown; did you mean 'motion'?"),
    "kind's type": ("[scan.a]\nkind = 1", "scan.a.kind = 1: unknown"),
    "field": (A + "output = 3", "scan.a.output: unknown name; did you mean 'outputs'?"),
    "field's value": (A + "dt = 0.0", "scan.a.dt = 0.0: input should be greater than 0"),
    "field's type": (A + "outputs = 3.5", "scan.a.outputs = 3.5: "),
    "a truth value for a number": (A + "t_end = true", "scan.a.t_end = True: "),
    "nan": (A + "t_end = nan", "scan.a.t_end = nan: "),
    "infinity": (A + "t_end = inf", "scan.a.t_end = inf: "),
    "no axes": (MAP, "scan.a.axes: missing"),
    "empty axes": (MAP + "axes = {}", "scan.a.axes = {}: "),
    "axis": (MAP + "axes.F1 = { start = 0.0, stop = 1.0, num = 2 }", "unknown parameter 'F1'"),
    "axis without end": (
        MAP + "axes.F0 = { start = 0.0, num = 2 }",
        "scan.a.axes.F0 = {'start': 0.0, 'num': 2}: stop is missing",
    ),
    "axis of no point": (MAP + "axes.F0 = { start = 0.0, stop = 1.0, num = 0 }", "scan.a.axes.F0.num = 0: "),
    "five axes": (
        '[scan.a]\nkind = "basins"\n' + "".join(f"axes.a{k} = {{values = [0.0]}}\n" for k in range(5)),
        ": at most 4 entries are allowed",
    ),
    "not TOML": ("[scan", "is not valid TOML"),
}


@pytest.mark.parametrize("what", MISTAKES)
def test_a_mistake_is_one_line(tmp_path: Path, what: str):
    text, message = MISTAKES[what]
    with pytest.raises(InputError) as error:
        read(tmp_path, text)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_files_that_cannot_be_read(tmp_path: Path):
    with pytest.raises(InputError, match=r"none\.toml: cannot be read: No such file"):
        read_request(tmp_path / "none.toml", scan_kinds())
    with pytest.raises(InputError, match="cannot be read"):
        read_request(tmp_path, scan_kinds())
    (tmp_path / "latin.toml").write_bytes("title = 'größe'".encode("latin-1"))
    with pytest.raises(InputError, match=r"latin\.toml: is not valid TOML"):
        read_request(tmp_path / "latin.toml", scan_kinds())
