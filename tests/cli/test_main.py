"""The command as a whole: help, version, unknown names, what is loaded, interruption."""

from __future__ import annotations

import subprocess
import sys
from importlib import metadata

import pytest
from cli.refusal import assert_refused

from fastmech.cli import COMMANDS


def test_help_lists_every_command(invoke):
    result = invoke("--help")
    assert result.exit_code == 0
    for name in COMMANDS:
        assert f"  {name} " in result.stdout


def test_no_command_shows_the_help(invoke):
    result = invoke()
    assert result.exit_code == 0
    assert result.stdout == invoke("--help").stdout


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(invoke, name):
    result = invoke(name, "--help")
    assert result.exit_code == 0
    assert result.stdout.startswith(f"Usage: main {name}")


def test_version(invoke):
    result = invoke("--version")
    assert result.exit_code == 0
    assert result.stdout == f"fastmech {metadata.version('fastmech')}\n"


@pytest.mark.parametrize(
    ("name", "nearest"), [("rum", "run"), ("equilibrium", "equilibria"), ("plots", "plot")]
)
def test_unknown_command_suggests_the_nearest(invoke, name, nearest):
    assert_refused(invoke(name), f"{name!r}", f"did you mean {nearest!r}?")


def test_unknown_command_far_from_any_lists_them(invoke):
    assert_refused(invoke("zzzz"), *COMMANDS)


@pytest.mark.parametrize(
    ("arguments", "fragment"),
    [
        (["--verbos"], "--verbos"),
        (["run"], "SCAN.toml"),
        (["run", "a.toml", "--treads", "2"], "--threads"),
        (["run", "a.toml", "--threads", "0"], "--threads"),
        (["run", "a.toml", "--threads", "two"], "--threads"),
        (["run", "a.toml", "b.toml"], "b.toml"),
        (["info"], "FILE"),
        (["equilibria", "--m1", "heavy"], "--m1"),
    ],
)
def test_wrong_usage_is_one_line(invoke, arguments, fragment):
    assert_refused(invoke(*arguments), fragment, "--help")


def test_help_loads_no_numerical_library():
    program = (
        "import sys\n"
        "from fastmech.cli import main\n"
        "main(['--help'], standalone_mode=False)\n"
        "heavy = {'numba', 'numpy', 'scipy', 'matplotlib', 'pydantic', 'h5py', 'rich'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, capture_output=True)


def test_module_runs_as_the_command():
    done = subprocess.run(
        [sys.executable, "-m", "fastmech", "--version"], check=True, capture_output=True, text=True
    )
    assert done.stdout.startswith("fastmech ")
