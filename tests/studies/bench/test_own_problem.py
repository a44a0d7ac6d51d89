"""Every method on a problem from a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fastmech as fm
from fastmech.studies.bench.own_problem import problem_named, run_problem

TEXT = """
import numpy as np
import fastmech as fm

def oscillate(t, x, v):
    return v, -x

def problem():
    starts = np.random.default_rng(0).normal(size=(40, 2))
    keywords = {"methods": ["rk4", "dop853"], "errors": [1e-3, 1e-6]}
    return fm.System(oscillate, ["x", "v"], {}), starts, 5.0, keywords

def two():
    return 1, 2

def wrong():
    return *problem()[:3], {"error": [1e-3]}

def unruly():
    return *problem()[:3], {"methods": 3}

number = 3
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "mine.py"
    path.write_text(TEXT)
    return path


def test_table_picture_and_call(file: Path, tmp_path: Path) -> None:
    told: list[int] = []

    def stage(name: str, total: int):
        assert (name, total) == ("methods", 2)
        return told.append

    lines, (table, picture) = run_problem(f"{file}:problem", tmp_path, stage)
    assert told == [1, 1]
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "\n".join(lines) in table.read_text()
    call = next(line for line in lines if line.startswith("    1e-06: ")).partition(": ")[2]
    problem, starts, t_end, _ = problem_named(f"{file}:problem")
    run = eval(call, {"fm": fm, "problem": problem, "starts": starts, "t_end": t_end})
    c, s = np.cos(5.0), np.sin(5.0)
    assert np.abs(run.y[-1] - starts @ np.array([[c, -s], [s, c]])).max() <= 1.1e-6


def test_the_scene_of_a_request() -> None:
    scene, starts, t_end, _ = problem_named("scans/paper.toml")
    assert scene.c2 == 1100 / 3
    assert starts.shape == (512, 4)
    assert not starts[:, 2:].any()
    assert 5.0 < t_end < 50.0


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("none", ": none: must be a function that returns"),
        ("number", ": number: must be a function that returns"),
        ("two", ": two: must be a function that returns problem, starts, t_end"),
        ("oscillate", ": oscillate: cannot be run: TypeError"),
        ("wrong", ": wrong: .*unexpected keyword argument 'error'"),
        ("unruly", "methods = 3: must be a list of names"),
    ],
)
def test_wrong_functions(file: Path, tmp_path: Path, name: str, message: str) -> None:
    with pytest.raises(fm.InputError, match=message):
        run_problem(f"{file}:{name}", tmp_path)


@pytest.mark.parametrize(
    ("where", "message"), [("mine.txt", "must be FILE.py:NAME"), ("no.py:x", "no.py: no such file")]
)
def test_no_problem(where: str, message: str) -> None:
    with pytest.raises(fm.InputError, match=message):
        problem_named(where)
