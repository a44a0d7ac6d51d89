"""What a fresh machine compiles for a call: what it needs, and no more of it than there is to do."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import numba
import pytest

pytestmark = pytest.mark.skipif(
    numba.config.DISABLE_JIT, reason="nothing is compiled where the just-in-time compiler is off"
)

#: Runs a call where nothing is kept; tells the kernels, and every function that numba compiled for them.
SCRIPT = """
import json, sys
import numpy as np
import fastmech as fm
from fastmech import jit
from numba.core import event
asked, made = [], []
class Listener(event.Listener):
    def on_start(self, happened):
        function, types = happened.data["dispatcher"].py_func, happened.data["args"]
        made.append([function.__module__, function.__qualname__, str(types)])
    def on_end(self, happened):
        pass
jit.listeners.append(lambda name: name and asked.append(name))
event.register("numba:compile", Listener())
scene = fm.Scene(alpha=0.0)
exec(sys.argv[1])
print(json.dumps([asked, made]))
"""

MAP = 'fm.map_equilibria(scene, {"F0": np.linspace(0.0, 50.0, 4), "c1": np.linspace(100.0, 200.0, 4)})'


@cache
def compiled_for(call: str, folder: Path) -> tuple[list[str], list[list[str]]]:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder)}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, call], env=environment, capture_output=True, text=True, check=True
    )
    asked, made = json.loads(done.stdout)
    return asked, made


@pytest.fixture(scope="module")
def nothing_kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("kernels")


@pytest.mark.parametrize(
    "call", ["fm.find_equilibria(scene)", "fm.classify(scene, fm.find_equilibria(scene)[0])"]
)
def test_one_scene_is_no_work_for_kernels(call: str, nothing_kept: Path) -> None:
    assert compiled_for(call, nothing_kept) == ([], [])


def test_a_map_compiles_its_kernels_only(nothing_kept: Path) -> None:
    asked, _ = compiled_for(MAP, nothing_kept)
    assert sorted(asked) == ["assess", "coincidences", "flood", "match_points", "solve"]


def test_no_kernel_of_a_map_compiles_the_formatting_of_text(nothing_kept: Path) -> None:
    """What an array expression or a slice brings with it, for the text of its error."""
    _, made = compiled_for(MAP, nothing_kept)
    assert not [name for name in made if name[0] == "numba.cpython.unicode"]


def test_inlined_functions_are_compiled_once(nothing_kept: Path) -> None:
    """Whoever calls them: kernels, other inlined functions."""
    _, made = compiled_for(MAP, nothing_kept)
    ours = [tuple(name) for name in made if name[0].startswith("fastmech")]
    assert len(ours) > 40
    assert len(ours) == len(set(ours))


@pytest.mark.parametrize("method", ["abm8", "radau5"])
@pytest.mark.slow
def test_functions_of_a_driver_are_compiled_once(method: str, nothing_kept: Path) -> None:
    """Not anew for every literal that they are given."""
    _, made = compiled_for(
        f"fm.integrate(scene, np.zeros((4, 4)), 0.1, dt=0.02, method={method!r})", nothing_kept
    )
    ours = [(module, name) for module, name, _ in made if module.startswith("fastmech.integrators")]
    assert len(ours) > 8
    assert len(ours) == len(set(ours))
