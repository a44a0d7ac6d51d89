"""``--quiet`` and ``--json`` of every long command."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click
import pytest

import fastmech as fm
from fastmech.cli import COMMANDS, main
from fastmech.cli.reporting import account
from fastmech.jit import listeners

#: Commands that end at once whatever they are given, and the one that ends when it is interrupted.
SHORT = {"status", "info", "explore"}


def test_every_long_command_has_both_options():
    for name in set(COMMANDS) - SHORT:
        command = main.get_command(click.Context(main), name)
        options = {option for parameter in command.params for option in parameter.opts}
        assert {"--quiet", "--json"} <= options, name


def test_run_plot_and_export_end_with_json(invoke, tiny):
    told = json.loads(invoke("run", tiny, "--out", "x.h5", "--json").stdout)
    assert (told["command"], told["result"], told["computed"]) == ("run", "x.h5", 5)
    stages = {stage["name"]: stage for stage in told["stages"]}
    assert stages["swing: integrations of the motion"]["done"] == 4
    assert stages["assembling"]["done"] == stages["assembling"]["total"] == 5
    told = json.loads(invoke("export", "x.h5", "--to", "npz", "--json").stdout)
    assert told["files"] == ["x/swing.npz", "x/rest.npz"]
    assert all(Path(path).is_file() for path in told["files"])
    told = json.loads(invoke("plot", "x.h5", "--json", "--quiet").stdout)
    assert told["files"]
    assert all(Path(path).is_file() for path in told["files"])
    assert sum(stage["done"] for stage in told["stages"]) == len(told["files"])


def test_equilibria_end_with_json(invoke):
    told = json.loads(invoke("equilibria", "--alpha", "0", "--json").stdout)
    assert [e["kind"] for e in told["equilibria"]] == ["minimum", "saddle", "saddle", "maximum"]
    assert told["force"] == 100.0
    assert told["equilibria"][0]["snap_above"] is None


def test_the_json_comes_also_where_a_command_ends_with_a_code(capsys: pytest.CaptureFixture[str]):
    def command():
        with account("try", quiet=True, as_json=True) as told:
            told.say("not shown")
            told.wrote(Path("a.png"))
            told.facts["passed"] = False
            told.bars.stage("work", 3)(2)
            raise click.exceptions.Exit(1)

    with pytest.raises(click.exceptions.Exit) as end:
        command()
    assert end.value.exit_code == 1
    summary = json.loads(capsys.readouterr().out)
    assert (summary["passed"], summary["files"]) == (False, ["a.png"])
    assert summary["exit_code"] == 1
    (stage,) = summary["stages"]
    assert (stage["name"], stage["done"], stage["total"]) == ("work", 2, 3)


def test_lines_stand_above_the_bars(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """On a terminal the bars' own console writes them; what is piped gets plain lines."""
    monkeypatch.setenv("TERM", "xterm")  # one that can draw bars, wherever the tests run
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with account("try", quiet=False, as_json=False) as told:
        told.say("piped")
        monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
        told.say("on the terminal")
    shown = capsys.readouterr()
    assert shown.out == "piped\n"
    assert "on the terminal" in shown.err


@pytest.mark.parametrize("name", sorted(set(COMMANDS) - SHORT))
def test_a_wrong_option_is_json_too(invoke, name):
    result = invoke(name, "--no-such-option", "--json")
    assert result.exit_code == 2
    told = json.loads(result.stdout)
    assert (told["command"], told["exit_code"]) == (name, 2)
    assert result.stderr == f"fastmech: {told['error']}\n"
    assert "--no-such-option" in told["error"]


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "none.toml"],
        ["plot", "none.h5"],
        ["export", "none.h5", "--to", "npz"],
        ["equilibria", "--m1", "-3"],
        ["equilibria", "none.toml"],
        ["bench", "--scenes", "3"],
        ["equilibrium"],
    ],
)
def test_every_error_is_json_too(invoke, arguments):
    result = invoke(*arguments, "--json")
    assert result.exit_code == 2
    told = json.loads(result.stdout)
    assert (told["command"], told["exit_code"]) == (arguments[0], 2)
    assert result.stderr == f"fastmech: {told['error']}\n"


def test_an_interrupt_is_json_with_what_was_done(invoke, tiny, monkeypatch):
    def interrupt(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("fastmech.tiles.run.write_results", interrupt)
    result = invoke("run", tiny, "--out", "x.h5", "--json")
    assert result.exit_code == 130
    told = json.loads(result.stdout)
    assert (told["command"], told["exit_code"]) == ("run", 130)
    assert told["error"] == "interrupted; 5 of 5 tiles are kept in x.h5.parts; the same command goes on"
    assert {stage["name"] for stage in told["stages"]} >= {"swing: integrations of the motion"}


def test_seconds_count_loading_and_compiling(invoke, tiny, monkeypatch):
    """A kernel that is made while the first tile is computed."""
    calls = []

    def make_a_kernel(*arguments, **options):
        for name in ("integrate_blocks", None):
            for tell in listeners:
                tell(name)
            now[0] += 0.0 if calls else 20.0
        calls.append(arguments)
        return fm.integrate(*arguments, **options)

    now = [0.0]
    monkeypatch.setattr("fastmech.cli.reporting.time.perf_counter", lambda: now[0])
    monkeypatch.setattr("fastmech.scan_types.motion.integrate", make_a_kernel)
    told = json.loads(invoke("run", tiny, "--out", "x.h5", "--json").stdout)
    assert (told["seconds_preparing"], told["seconds"]) == (20.0, 40.0)
    assert told["exit_code"] == 0
