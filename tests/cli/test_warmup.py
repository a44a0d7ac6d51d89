"""What is compiled beforehand is there afterwards, is compiled once, and leaves nothing behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from fastmech.cli import warming

pytestmark = pytest.mark.skipif(
    numba.config.DISABLE_JIT, reason="nothing is compiled where the just-in-time compiler is off"
)

LABELS = """
import numpy as np
import fastmech as fm
from fastmech import jit
scene = fm.Scene(alpha=0.0)
fm.map_equilibria(scene, {"F0": np.linspace(0.0, 50.0, 4), "c1": np.linspace(100.0, 200.0, 4)})
print(jit.compiled)
"""

#: Makes one kernel and says whether it had to compile.
ONE = """
from fastmech import jit
from fastmech.slider import coefficients
from fastmech.slider.atlas.sheets import flood
flood.make()
print(len(jit.compiled))
"""


def environment(folder: Path) -> dict[str, str]:
    path = os.pathsep.join(place for place in sys.path if place)
    return os.environ | {"NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": path}


def started(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, *arguments],
        env=environment(folder),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.slow
def test_a_map_compiles_nothing_afterwards(tmp_path: Path) -> None:
    command = ("-m", "fastmech", "warmup", "--for", "atlas", "--json")
    told = [json.loads(started(tmp_path, *command).communicate()[0]) for _ in range(2)]
    assert [one["exit_code"] for one in told] == [0, 0]
    assert told[0]["kernels"] >= 5
    assert told[1]["kernels"] == 0
    assert started(tmp_path, "-c", LABELS).communicate()[0].strip() == "[]"


def test_of_several_processes_one_compiles(tmp_path: Path) -> None:
    everyone = [started(tmp_path, "-c", ONE) for _ in range(3)]
    assert sorted(int(one.communicate()[0]) for one in everyone) == [0, 0, 1]


def test_a_kernel_is_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warming, "_PROCESS", "print('8.1 s  flood'); print('2.0 s  sheets')")
    lines: list[str] = []
    finished: list[int] = []
    assert warming.warm_up(("atlas",), lines.append, finished.append) == 4
    assert sorted(lines) == ["2.0 s  sheets"] * 2 + ["8.1 s  flood"] * 2
    assert sorted(finished)[:4] == [1, 1, 1, 1]  # each kernel moves the share
    assert sum(finished) == 2 * warming.PARTS


def test_a_process_that_ends_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warming, "_PROCESS", "import sys; sys.exit('no room')")
    with pytest.raises(RuntimeError, match=r"^map of equilibria: no room$|^folds: no room$"):
        warming.warm_up(("atlas",))


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="finds its processes in /proc")
def test_an_interrupt_leaves_no_process(tmp_path: Path) -> None:
    running = started(tmp_path, "-m", "fastmech", "warmup", "--for", "integrate")
    assert running.stdout is not None
    assert running.stdout.readline()
    threads = Path(f"/proc/{running.pid}/task").iterdir()
    children = [child for thread in threads for child in (thread / "children").read_text().split()]
    assert children
    running.send_signal(signal.SIGINT)
    assert "interrupted" in running.communicate(timeout=20)[1]
    assert running.returncode == 130
    assert not any(Path(f"/proc/{child}").exists() for child in children)
