"""The command as a whole: help, version, unknown names, what is loaded, interruption."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
from cli.refusal import assert_refused

from fastmech.cli import COMMANDS

SCAN = '[scan.a]\nkind = "motion"\n'


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


@pytest.mark.parametrize(
    ("arguments", "fragments"),
    [
        (["run", "none.toml"], ["none.toml: cannot be read"]),
        (["run", "none.toml", "--tile", "a:0"], ["none.toml: cannot be read"]),
        (["run", "broken.toml"], ["broken.toml: is not valid TOML"]),
        (["run", "wrong.toml"], ["scene.m1 = -1", "greater than 0"]),
        (["run", "right.toml", "--out", "folder"], ["--out", "folder"]),
        (["plot", "none.h5"], ["none.h5: cannot be read"]),
        (["plot", "right.toml"], ["right.toml"]),
        (["plot", "none.h5", "--out", "right.toml"], ["--out", "right.toml"]),
        (["info", "none.h5"], ["none.h5: cannot be read"]),
        (["export", "none.h5", "--to", "csv"], ["none.h5: cannot be read"]),
        (["status", "none.h5"], ["none.h5"]),
        (["equilibria", "none.toml"], ["none.toml: cannot be read"]),
        (["equilibria", "--at", "-1"], ["--at", "-1"]),
        (["equilibria", "--m1", "-1"], ["scene.m1 = -1", "greater than 0"]),
        (["paper", "--out", "right.toml"], ["--out", "right.toml"]),
        (["hardcases", "--out", "right.toml"], ["--out", "right.toml"]),
        (["bench", "--out", "right.toml"], ["--out", "right.toml"]),
    ],
)
def test_wrong_input_is_told_before_kernels_are_compiled(arguments, fragments):
    """A process of its own, in which Numba is not loaded, with a cache that stays empty."""
    Path("folder").mkdir()
    Path("broken.toml").write_text("[scan.a", encoding="utf-8")
    Path("wrong.toml").write_text("[scene]\nm1 = -1.0\n" + SCAN, encoding="utf-8")
    Path("right.toml").write_text(SCAN, encoding="utf-8")
    cache = Path("cache")
    cache.mkdir()
    program = (
        "import sys\n"
        "from fastmech.cli import main\n"
        "try:\n"
        "    main(sys.argv[1:])\n"
        "finally:\n"
        "    assert 'numba' not in sys.modules\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
        check=False,
    )
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    for fragment in fragments:
        assert fragment in done.stderr
    assert not list(cache.iterdir())


def test_module_runs_as_the_command():
    done = subprocess.run(
        [sys.executable, "-m", "fastmech", "--version"], check=True, capture_output=True, text=True
    )
    assert done.stdout.startswith("fastmech ")
