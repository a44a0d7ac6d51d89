"""``fastmech run``: from a request to a result file, or one line and nothing written."""

from __future__ import annotations

from pathlib import Path

import pytest
from cli.refusal import assert_refused

from fastmech import Scene, open_results
from fastmech.scan_types.motion import Motion

MOTION = '[scan.a]\nkind = "motion"\noutputs = 3\nt_end = 0.1\n'


def files() -> set[str]:
    return {str(path) for path in Path().rglob("*") if path.is_file()}


def test_end_to_end(invoke, tiny):
    result = invoke("run", tiny, "--threads", "1")
    assert result.exit_code == 0
    assert result.stderr == ""
    assert "Results: results/tiny.h5" in result.stdout
    assert "fastmech info results/tiny.h5" in result.stdout
    assert "fastmech plot results/tiny.h5" in result.stdout
    assert files() == {"tiny.toml", "results/tiny.h5"}
    with open_results("results/tiny.h5") as results:
        assert results.attrs["title"] == "a tiny request"
        assert results.attrs["request"] == tiny.read_text(encoding="utf-8")
        assert results.attrs["request_file"] == "tiny.toml"
        assert results.attrs["threads"] == 1
        assert results.attrs["wall_time_s"] > 0
        assert Scene(**results.scene) == Scene(c1=150.0)
        assert results.sections == ("swing", "rest")
        assert results["swing"].attrs["kind"] == "motion"
        assert results["rest"].attrs["kind"] == "equilibria"
        assert results["rest"].attrs["scene_alpha"] == 0.0
        assert results["rest"].attrs["wall_time_s"] > 0
        assert results["swing"].sizes["time"] == 5


def test_out_names_the_file(invoke, tiny):
    assert invoke("run", tiny, "--out", "deep/down/x.h5").exit_code == 0
    assert Path("deep/down/x.h5").is_file()
    assert not Path("results").exists()


BAD = {
    "unknown key of a scan": (MOTION + "t_ned = 1.0", ["scan.a.t_ned", "'t_end'"]),
    "unknown key of the scene": ("[scene]\nbetta = 1.0\n" + MOTION, ["scene.betta", "'beta'"]),
    "unknown key of a scan's scene": (MOTION + "scene = { betta = 1.0 }", ["scan.a.scene.betta", "'beta'"]),
    "unknown table": ("[scenes]\n" + MOTION, ["scenes", "'scene'"]),
    "wrong type": (MOTION + 'dt = "small"', ["scan.a.dt", "'small'"]),
    "wrong type in the scene": ("[scene]\nm1 = true\n" + MOTION, ["scene.m1 = True"]),
    "m1 = 0": ("[scene]\nm1 = 0\n" + MOTION, ["scene.m1 = 0", "greater than 0"]),
    "m2 = 0": ("[scene]\nm2 = 0.0\n" + MOTION, ["scene.m2 = 0.0", "greater than 0"]),
    "l = 0": ("[scene]\nl = 0.0\n" + MOTION, ["scene.l = 0.0", "greater than 0"]),
    "l < 0": ("[scene]\nl = -1.25\n" + MOTION, ["scene.l = -1.25", "greater than 0"]),
    "beta < 0": ("[scene]\nbeta = -1.0\n" + MOTION, ["scene.beta = -1.0", "greater than or equal to 0"]),
    "alpha < 0": ("[scene]\nalpha = -0.1\n" + MOTION, ["scene.alpha = -0.1", "greater than or equal to 0"]),
    "c1 < 0": ("[scene]\nc1 = -5.0\n" + MOTION, ["scene.c1 = -5.0", "greater than or equal to 0"]),
    "c2 < 0": (MOTION + "scene = { c2 = -5.0 }", ["scan.a.scene.c2 = -5.0", "greater than or equal to 0"]),
    "not a number": ("[scene]\nF0 = nan\n" + MOTION, ["scene.F0 = nan", "finite"]),
    "infinite": (MOTION + "phi = inf", ["scan.a.phi = inf", "finite"]),
    "unknown kind": ('[scan.a]\nkind = "moton"', ["scan.a.kind = 'moton'", "'motion'"]),
    "no kind": ("[scan.a]\ndt = 0.1", ["scan.a.kind", "missing", "motion"]),
    "unknown method": (MOTION + 'method = "rk5"', ["scan.a", "method = 'rk5'", "rk4"]),
    "no scan": ("[scene]\nm1 = 1.0", ["asks for no scan"]),
    "a scan named like a parameter": (MOTION.replace("scan.a", "scan.c1"), ["scan.c1", "parameter"]),
    "a name with a dash": (MOTION.replace("scan.a", "scan.a-b"), ["scan.a-b"]),
    "not TOML": ("[scan.a\n", ["not valid TOML"]),
    "decaying force": ('[scan.a]\nkind = "disturbed"\ntrajectories = 1', ["scan.a", "scene.alpha = 0.7"]),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_request_is_one_line_and_nothing_is_written(invoke, what):
    text, fragments = BAD[what]
    Path("bad.toml").write_text(text, encoding="utf-8")
    assert_refused(invoke("run", "bad.toml", "--out", "x.h5"), *fragments)
    assert files() == {"bad.toml"}


@pytest.mark.parametrize("what", ["unknown key of a scan", "m1 = 0"])
def test_bad_request_leaves_the_older_file(invoke, what):
    Path("bad.toml").write_text(BAD[what][0], encoding="utf-8")
    Path("x.h5").write_text("older", encoding="utf-8")
    assert_refused(invoke("run", "bad.toml", "--out", "x.h5", "--fresh"))
    assert Path("x.h5").read_text(encoding="utf-8") == "older"


def test_missing_request(invoke):
    assert_refused(invoke("run", "none.toml"), "none.toml", "No such file")
    assert files() == set()


def test_request_is_a_folder(invoke):
    Path("folder.toml").mkdir()
    assert_refused(invoke("run", "folder.toml"), "folder.toml")


def test_existing_output_needs_fresh(invoke, tiny):
    Path("x.h5").write_text("older", encoding="utf-8")
    assert_refused(invoke("run", tiny, "--out", "x.h5"), "x.h5: exists already", "--fresh")
    assert Path("x.h5").read_text(encoding="utf-8") == "older"
    assert invoke("run", tiny, "--out", "x.h5", "--fresh").exit_code == 0
    with open_results("x.h5") as results:
        assert results.sections == ("swing", "rest")


@pytest.mark.parametrize("fresh", [[], ["--fresh"]])
def test_output_that_cannot_be_written(invoke, tiny, monkeypatch, fresh):
    def must_not_run(self, scene, context):
        raise AssertionError("the place of the result is tried before the first scan")

    monkeypatch.setattr(Motion, "run", must_not_run)
    Path("file").write_text("no folder", encoding="utf-8")
    assert_refused(invoke("run", tiny, "--out", "file/x.h5", *fresh), "file/x.h5", "cannot be written")
    Path("folder").mkdir()
    assert_refused(invoke("run", tiny, "--out", "folder", *fresh), "folder")
    assert files() == {"tiny.toml", "file"}


def test_failing_scan_writes_nothing(invoke, tiny, monkeypatch):
    def fail(self, scene, context):
        raise RuntimeError("out of luck")

    monkeypatch.setattr("fastmech.scan_types.equilibria.EquilibriaScan.run", fail)
    with pytest.raises(RuntimeError, match="out of luck"):
        invoke("run", tiny, "--out", "x.h5")
    assert files() == {"tiny.toml"}
    Path("x.h5").write_text("older", encoding="utf-8")
    with pytest.raises(RuntimeError, match="out of luck"):
        invoke("run", tiny, "--out", "x.h5", "--fresh")
    assert files() == {"tiny.toml", "x.h5"}
    assert Path("x.h5").read_text(encoding="utf-8") == "older"


def test_interruption_is_one_line_and_writes_nothing(invoke, tiny, monkeypatch):
    def interrupt(self, scene, context):
        context.stage("long work", 10)(1)
        raise KeyboardInterrupt

    monkeypatch.setattr(Motion, "run", interrupt)
    result = invoke("run", tiny, "--out", "x.h5")
    assert result.exit_code == 130
    assert result.stderr == "fastmech: interrupted\n"
    assert result.stdout == ""
    assert files() == {"tiny.toml"}
