"""``fastmech run``: from a request to a result file, or one line and nothing written."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest
from cli.refusal import assert_refused

import fastmech as fm
from fastmech import Scene, open_results
from fastmech.scan_types.disturbed import DisturbedTiling

#: What a tile of a motion calls.
INTEGRATE = "fastmech.scan_types.motion.integrate"

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
    "infinite": (MOTION + "start.phi = inf", ["scan.a.start.phi = inf", "finite"]),
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
    def must_not_run(*arguments, **options):
        raise AssertionError("the place of the result is tried before the first scan")

    monkeypatch.setattr(INTEGRATE, must_not_run)
    Path("file").write_text("no folder", encoding="utf-8")
    assert_refused(invoke("run", tiny, "--out", "file/x.h5", *fresh), "file/x.h5", "cannot be written")
    Path("folder").mkdir()
    assert_refused(invoke("run", tiny, "--out", "folder", *fresh), "folder")
    assert files() == {"tiny.toml", "file"}


def interrupt(*arguments, **options):
    raise KeyboardInterrupt


def out_of_luck(*arguments, **options):
    raise RuntimeError("out of luck")


def test_a_crash_is_one_line_with_the_command_that_repeats_it(invoke, tiny, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr("fastmech.scan_types.equilibria.find_equilibria", out_of_luck)
        result = invoke("run", tiny, "--out", "x.h5")
        assert result.exit_code == 1
        assert result.stdout == ""
        (line,) = result.stderr.splitlines()
        assert "1 of 5 tiles failed twice, the first with RuntimeError: out of luck" in line
        assert "(alone: fastmech run tiny.toml --out x.h5 --tile rest:0 --keep tile.h5)" in line
        assert "4 of 5 tiles are kept in x.h5.parts; the same command goes on" in line
        assert not Path("x.h5").exists()
        with pytest.raises(RuntimeError, match="out of luck"):
            invoke("run", tiny, "--tile", "rest:0")
    monkeypatch.setattr(INTEGRATE, out_of_luck)  # this tile is there already
    assert invoke("run", tiny, "--out", "x.h5").exit_code == 0
    assert files() == {"tiny.toml", "x.h5"}


def test_a_tile_that_crashes_once_is_tried_again(invoke, tiny, monkeypatch):
    calls = []

    def fail_once(*arguments, **options):
        calls.append(arguments)
        return (out_of_luck if len(calls) == 1 else fm.integrate)(*arguments, **options)

    monkeypatch.setattr(INTEGRATE, fail_once)
    assert invoke("run", tiny, "--out", "x.h5").exit_code == 0
    assert len(calls) == 4, "three runs, the first of them twice"


def test_a_crash_leaves_the_older_file(invoke, tiny, monkeypatch):
    Path("x.h5").write_text("older", encoding="utf-8")
    with monkeypatch.context() as patched:
        patched.setattr("fastmech.scan_types.equilibria.find_equilibria", out_of_luck)
        assert invoke("run", tiny, "--out", "x.h5", "--fresh").exit_code == 1
    assert Path("x.h5").read_text(encoding="utf-8") == "older"
    result = invoke("run", tiny, "--out", "x.h5")
    assert result.exit_code == 0, "what was begun with --fresh goes on without"
    assert "4 of 5 tiles are kept from before" in result.stderr
    with open_results("x.h5") as results:
        assert results.sections == ("swing", "rest")


def test_interruption_is_one_line_and_writes_nothing(invoke, tiny, monkeypatch):
    monkeypatch.setattr("fastmech.tiles.parts.Parts.store", interrupt)
    result = invoke("run", tiny, "--out", "x.h5")
    assert result.exit_code == 130
    assert result.stderr == "fastmech: interrupted\n"
    assert result.stdout == ""
    assert files() == {"tiny.toml"}


def test_an_interrupt_after_the_last_moment_says_that_the_file_is_complete(invoke, tiny, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr("fastmech.cli.run._show", interrupt)
        result = invoke("run", tiny, "--out", "x.h5")
    assert result.exit_code == 130
    assert result.stderr == "fastmech: interrupted; x.h5 is complete\n"
    assert json.loads(invoke("run", tiny, "--out", "x.h5", "--json").stdout)["was_complete"] is True


@pytest.mark.parametrize(
    ("arguments", "fragment"),
    [
        (["--out", "z" * 300], "z...: cannot be written: File name too long"),
        (["--out", "z." + "z" * 300], "a result file is HDF5: must end in .h5"),
        (["--tile", "rest:0", "--keep", "z" * 300], "cannot be written: File name too long"),
        (["--threads", "9" * 5000], "'--threads': '99999"),
        (["--tile", "z" * 5000], "--tile zzz"),
        (["--tile", "rest:" + "9" * 5000], "--tile rest:999"),
        (["z" * 5000], "Got unexpected extra argument (zzz"),
        (["--" + "z" * 5000], "No such option"),
    ],
    ids=["out", "ending", "keep", "integer", "section", "index", "argument", "option"],
)
def test_what_is_huge_is_told_in_a_short_line(invoke, tiny, arguments, fragment):
    result = invoke("run", tiny, *arguments)
    assert_refused(result, fragment)
    assert len(result.stderr) < 300


def test_the_same_run_again_has_nothing_to_do(invoke, tiny, monkeypatch):
    assert invoke("run", tiny, "--out", "x.h5").exit_code == 0
    before = Path("x.h5").read_bytes()
    result = invoke("run", tiny, "--out", "x.h5", "--json")
    assert result.exit_code == 0
    summary = json.loads(result.stdout)
    assert summary["was_complete"] is True
    assert (summary["tiles"], summary["computed"]) == (5, 0)
    assert Path("x.h5").read_bytes() == before
    tiny.write_text("# a remark\n" + tiny.read_text(encoding="utf-8"), encoding="utf-8")
    assert "holds this result already" in invoke("run", tiny, "--out", "x.h5").stdout


def test_a_changed_request_is_refused_with_what_differs(invoke, tiny):
    assert invoke("run", tiny, "--out", "x.h5").exit_code == 0
    tiny.write_text(tiny.read_text(encoding="utf-8").replace("t_end = 0.1", "t_end = 0.2"), encoding="utf-8")
    assert_refused(
        invoke("run", tiny, "--out", "x.h5"),
        "x.h5: exists already and differs: scan.swing.t_end = 0.1 there, 0.2 here",
        "--fresh",
    )


@pytest.mark.parametrize("tile", ["swing", "swing:4", "swing:-1", "swing:x", "none:0", "swing:0:0", ":"])
def test_a_tile_that_is_none(invoke, tiny, tile):
    assert_refused(invoke("run", tiny, "--tile", tile), f"--tile {tile}")


def test_one_tile_alone(invoke, tiny):
    result = invoke("run", tiny, "--tile", "rest:0", "--keep", "tile.h5")
    assert result.exit_code == 0
    assert "Content: " in result.stdout
    assert invoke("run", tiny, "--out", "x.h5").exit_code == 0
    with open_results("tile.h5") as tile, open_results("x.h5") as whole:
        assert set(tile["rest"]) == set(whole["rest"])
        for name in tile["rest"]:
            if tile["rest"][name].data.dtype == object:
                assert tile["rest"][name].data.tolist() == whole["rest"][name].data.tolist()
            else:
                assert tile["rest"][name].data.tobytes() == whole["rest"][name].data.tobytes()


MANY = """
[scene]
alpha = 0.0
[scan.shocks]
kind = "disturbed"
trajectories = 600
t_end = 0.5
linear_directions = 2
"""


def test_the_command_of_a_crash_report_makes_that_tile(invoke, monkeypatch):
    """One tile of many crashes; the command in the message crashes too, and when it can, makes its bits."""
    monkeypatch.setattr("fastmech.scan_types.disturbed.EVALUATIONS", 1)
    request = Path("my scan.toml")
    request.write_text(MANY, encoding="utf-8")
    compute = DisturbedTiling.compute

    def crash(self, index, context):
        return out_of_luck(self, index) if index == 6 else compute(self, index, context)

    with monkeypatch.context() as patched:
        patched.setattr(DisturbedTiling, "compute", crash)
        crashed = invoke("run", request, "--out", "deep/x.h5")
        assert crashed.exit_code == 1
        command = shlex.split(re.search(r"\(alone: (.*)\)", crashed.stderr)[1])
        assert command[:2] == ["fastmech", "run"]
        with pytest.raises(RuntimeError, match="out of luck"):
            invoke(*command[1:])
    alone = invoke(*command[1:])
    assert alone.exit_code == 0
    with monkeypatch.context() as patched:
        patched.setattr("fastmech.tiles.run.write_results", interrupt)
        assert invoke("run", request, "--out", "deep/x.h5").exit_code == 130
    again = invoke(*command[1:-2])
    assert "The tile kept beside the result is the same." in again.stdout
    digest = re.search(r"Content: (\w{64})", alone.stdout)[1]
    assert digest in again.stdout
    with open_results("tile.h5") as results:
        assert results["shocks"].attrs["tile"] == 6
        assert results["shocks"]["start"].data.shape == (256, 4)


def test_workers_and_scheduler_exclude_each_other(invoke, tiny):
    assert_refused(invoke("run", tiny, "--workers", "2", "--scheduler", "tcp://a:1"), "exclude")


@pytest.mark.filterwarnings("always::fastmech.errors.StepWarning")
def test_a_step_too_long_is_told_before_and_failures_after(invoke):
    """One line each, on the terminal and in the file."""
    request = (
        MOTION.replace("0.1", "200.0")
        + 'dt = 1.0\nmethod = "rk4"\nstart = { phi = 0.97, theta = 0.45, phi_dot = 20.0 }\n'
    )
    Path("hard.toml").write_text(request, encoding="utf-8")
    result = invoke("run", "hard.toml", "--quiet")
    assert result.exit_code == 0
    told = [line for line in result.stderr.splitlines() if line]
    assert told[0].startswith("fastmech: scan.a: dt = 1 s: too long for rk4 here, ")
    assert told[0].endswith(" s would do")
    assert told[1].startswith(
        "fastmech: a: 1 of 1 trajectories failed: 1 not_finite; use a smaller dt, unless"
    )
    assert len(told) == 2
    with open_results("results/hard.h5") as results:
        assert f"fastmech: scan.a: {results['a'].attrs['step_warning']}" == told[0]
        assert f"fastmech: a: {results['a'].attrs['failures']}" == told[1]
