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


@pytest.mark.parametrize("name", ["zzzz", "nosuch"])
def test_unknown_command_far_from_any_lists_them(invoke, name):
    assert_refused(invoke(name), *COMMANDS)


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
        (["run", "right.toml", "--out", "folder"], ["--out", "folder"]),
        (["plot", "none.h5"], ["none.h5: cannot be read"]),
        (["plot", "right.toml"], ["right.toml"]),
        (["plot", "none.h5", "--out", "right.toml"], ["--out", "right.toml"]),
        (["info", "none.h5"], ["none.h5: cannot be read"]),
        (["export", "none.h5", "--to", "csv"], ["none.h5: cannot be read"]),
        (["export", "none.h5"], ["Choose from: csv, nc, npz"]),
        (["equilibria", "none.toml"], ["none.toml: cannot be read"]),
        (["equilibria", "--at", "-1"], ["--at", "-1"]),
        (["equilibria", "--m1", "-1"], ["scene.m1 = -1", "greater than 0"]),
        (["paper", "--out", "right.toml"], ["--out", "right.toml"]),
        (["hardcases", "--out", "right.toml"], ["--out", "right.toml"]),
        (["bench", "--out", "right.toml"], ["--out", "right.toml"]),
    ],
)
def test_wrong_input_is_told_before_numba_is_loaded(arguments, fragments):
    refused_without_kernels(arguments, fragments, "    assert 'numba' not in sys.modules\n")


AXES = "axes.F0 = { start = 0.0, stop = 1.0, num = 2 }\n"


@pytest.mark.parametrize(
    ("text", "fragment"),
    [
        ("[scan.a", "is not valid TOML"),
        ("[scene]\nm1 = -1.0\n" + SCAN, "scene.m1 = -1.0"),
        ('[scan.a]\nkind = "moton"', "scan.a.kind = 'moton': unknown; did you mean 'motion'?"),
        ('[scan.a]\nkind = "equilibrium_map"\naxes.F0 = { start = 0.0, num = 2 }', "stop is missing"),
        (
            '[scan.a]\nkind = "erosion"\naxes.phi = { start = 0.0, stop = 1.0, num = 3 }',
            "scan.a.along: missing",
        ),
        (SCAN + "[scan.b]\nkind = 'disturbed'\nseed = -1", "scan.b.seed = -1"),
        (SCAN + f"seed = {'9' * 5000}", "an integer has more than 4,300 digits"),
    ],
)
def test_a_wrong_request_is_refused_before_any_kernel_is_made(text, fragment):
    Path("a.toml").write_text(text, encoding="utf-8")
    refused_without_kernels(["run", "a.toml"], [fragment])


@pytest.mark.parametrize("arguments", [["run", "none.toml", "--tile", "a:0"], ["status", "none.h5"]])
def test_a_missing_file_is_told_before_any_kernel_is_made(arguments):
    refused_without_kernels(arguments, ["none."])


def refused_without_kernels(arguments, fragments, after=""):
    """A process of its own, with a cache of kernels that stays empty."""
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
        f"{after or '    pass'}\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
        check=False,
    )
    assert done.returncode == 2
    # A loaded machine may need so long to import that the command says so first.
    said = [line for line in done.stderr.splitlines() if not line.startswith("fastmech: loading, ")]
    assert len(said) == 1
    for fragment in fragments:
        assert fragment in done.stderr
    assert not list(cache.iterdir())


def test_module_runs_as_the_command():
    done = subprocess.run(
        [sys.executable, "-m", "fastmech", "--version"], check=True, capture_output=True, text=True
    )
    assert done.stdout.startswith("fastmech ")
