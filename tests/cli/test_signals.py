"""Ctrl-C and SIGTERM end every command in one line, with the signal's exit code and nothing half done."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

#: Runs the command line in a process of its own and sends it a signal when a function is called.
PROGRAM = """
import os, signal, sys
from importlib import import_module

number, target, *arguments = sys.argv[1:]
module, name = target.split(":")
place = import_module(module)
original, calls = getattr(place, name), []

def patched(*args, **kwargs):
    calls.append(name)
    if len(calls) == 1:
        os.kill(os.getpid(), int(number))
    return original(*args, **kwargs)

patched.__globals__["__name__"] = module
setattr(place, name, patched)
sys.argv = ["fastmech", *arguments]
try:
    from fastmech.cli import main
    main()
finally:
    print(len(calls), file=open("calls", "w"))
"""


def stopped(number: int, target: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", PROGRAM, str(int(number)), target, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


BOTH = pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])


@BOTH
@pytest.mark.parametrize(
    "arguments", [["run", "tiny.toml", "--out", "x.h5"], ["equilibria"], ["paper"], ["bench", "--quick"]]
)
def test_while_kernels_are_compiled(tiny, number, arguments):
    """The compilation in hand is finished, the next is not begun; every one looks for its place first."""
    done = stopped(number, "fastmech.jit:cache_directory", *arguments, "--json")
    assert done.returncode == 128 + number
    *waits, last = done.stderr.splitlines()
    assert last.partition(";")[0] == "fastmech: interrupted"
    for line in waits:  # of a slow machine
        assert "stops when the kernel in hand is compiled" in line or line.endswith(" s so far")
    told = json.loads(done.stdout)
    assert (told["command"], told["exit_code"]) == (arguments[0], 128 + number)
    assert f"fastmech: {told['error']}" == last
    assert Path("calls").read_text() == "1\n"
    assert not Path("x.h5.parts").exists()


@BOTH
@pytest.mark.parametrize(
    ("target", "arguments"),
    [
        ("numpy.lib.format:write_array", ["export", "x.h5", "--to", "npz", "--out", "out"]),
        ("csv:writer", ["export", "x.h5", "--to", "csv", "--out", "out"]),
        ("fastmech.plots.style:save", ["plot", "x.h5", "--out", "out"]),
    ],
)
def test_while_files_are_written(invoke, tiny, number, target, arguments):
    assert invoke("run", tiny, "--out", "x.h5").exit_code == 0
    done = stopped(number, target, *arguments)
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "", "fastmech: interrupted\n")
    assert list(Path("out").iterdir()) == []


@BOTH
def test_between_tiles(tiny, number):
    done = stopped(number, "os:fsync", "run", "tiny.toml", "--out", "x.h5", "--json")
    assert done.returncode == 128 + number
    *waits, last = done.stderr.splitlines()
    assert all(line.endswith(" s so far") for line in waits)  # of a slow machine
    assert last.startswith("fastmech: interrupted")
    assert json.loads(done.stdout)["error"] == last.removeprefix("fastmech: ")
    assert not Path("x.h5").exists()
    assert not list(Path().rglob("*.tmp"))


def test_who_calls_the_command_as_a_function_keeps_his_handlers(invoke):
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    assert invoke("equilibria").exit_code == 0
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
