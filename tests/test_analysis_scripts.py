"""The worked analyses run on the shipped result file and on others, and say something."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from fastmech.runner import run_request

SCRIPTS = sorted((Path(__file__).parents[1] / "scans" / "analysis").glob("*.py"))

REQUEST = """
[scene]
alpha = 0.0
[scan.motion]
kind = "motion"
t_end = 2.0
outputs = 201
[scan.disturbed]
kind = "disturbed"
trajectories = 64
t_end = 5.0
linear_directions = 4
[scan.map_F0_c1]
kind = "equilibrium_map"
axes.F0 = { start = -300.0, stop = 300.0, num = 9 }
axes.c1 = { start = 0.0, stop = 400.0, num = 9 }
"""


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("analysis")
    (folder / "scan.toml").write_text(REQUEST, encoding="utf-8")
    return run_request(folder / "scan.toml", folder / "scan.h5").path


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_it_runs(script: Path, result: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main = runpy.run_path(str(script))["main"]
    for arguments in ([str(result)], []):
        main(*arguments)
        lines = capsys.readouterr().out.splitlines()
        assert len(lines) >= 4
        assert not any("nan" in line for line in lines)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_a_missing_file_is_one_line_with_the_command_that_makes_it(script: Path, tmp_path: Path) -> None:
    command = [sys.executable, str(script), "none.h5"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=120, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("none.h5: ")
    assert "fastmech run scans/paper.toml makes" in line
