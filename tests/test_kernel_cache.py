"""Compiled kernels on disk: found again by every later process, never stale, out of the user's way."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from numba import types

from fastmech import jit, kernel_cache
from fastmech.slider.kernels.select import with_terms

pytestmark = pytest.mark.skipif(
    numba.config.DISABLE_JIT, reason="nothing is compiled where the just-in-time compiler is off"
)

#: Makes every kernel of the package; tells what each kernel's disk cache did.
LOAD_ALL = """
import importlib, json, pkgutil
import fastmech
from fastmech.kernel_cache import COMPILED
from fastmech.jit import Kernel
found = {}
for place in COMPILED:
    if place.endswith(".py"):
        continue
    package = importlib.import_module(f"fastmech.{place}")
    for info in pkgutil.walk_packages(package.__path__, f"fastmech.{place}."):
        for name, value in vars(importlib.import_module(info.name)).items():
            if isinstance(value, Kernel) and value.__module__ == info.name:
                value.make()
                stats = value.stats
                found[f"{info.name}.{name}"] = [
                    stats.cache_path, sum(stats.cache_hits.values()), sum(stats.cache_misses.values())
                ]
print(json.dumps(found))
"""

#: One kernel's answer, where it is kept and whether it was loaded; and where the user's own kernel is kept.
ONE_KERNEL = """
import json, sys
import numba, numpy as np
before = numba.config.CACHE_DIR
import fastmech
from fastmech.kernel_cache import cache_directory
from fastmech.slider.kernels.select import with_terms
rhs = with_terms("lagrange", "free")
sys.path.insert(0, sys.argv[1])
import users_module
Y = np.array([[0.7], [0.3], [0.0], [0.0]])
dY = np.zeros((4, 1))
rhs(0.0, Y, dY, np.array([[0.8], [0.6], [-9.0], [13.0], [8.0], [0.0], [0.0], [0.0]]))
print(json.dumps({
    "package": fastmech.__file__, "answer": dY[:, 0].tolist(), "directory": str(cache_directory()),
    "path": rhs.stats.cache_path, "hits": sum(rhs.stats.cache_hits.values()),
    "before": before, "after": numba.config.CACHE_DIR, "user": users_module.twice.stats.cache_path,
}))
"""

#: The same kernel's answer, after the first argument has been loaded and the file of the second been given
#: the text of the third. Tells too whether the cache has kept the kernel.
EDITED_MEANWHILE = """
import importlib, json, shutil, sys
import numpy as np
import fastmech
from fastmech import kernel_cache
kernel_cache.cache_directory()
importlib.import_module(sys.argv[1])
shutil.copyfile(sys.argv[3], sys.argv[2])
from fastmech.slider.kernels.select import with_terms
rhs = with_terms("lagrange", "free")
Y = np.array([[0.7], [0.3], [0.0], [0.0]])
dY = np.zeros((4, 1))
rhs(0.0, Y, dY, np.array([[0.8], [0.6], [-9.0], [13.0], [8.0], [0.0], [0.0], [0.0]]))
kept = [str(file) for file in kernel_cache.cache_directory().parent.rglob("*.nbc")]
print(json.dumps({"answer": dY[:, 0].tolist(), "kept": kept}))
"""

USERS_MODULE = """
import numba
from fastmech.slider.kernels import select

@numba.njit(cache=True)
def twice(x):
    return 2.0 * x

assert twice(2.0) == 4.0
"""


def run(script: str, *arguments: Path | str, **environment: str) -> Any:
    """What a script prints as JSON, in a process of its own; an empty value removes a variable."""
    given = {**os.environ, **environment}
    result = subprocess.run(
        [sys.executable, "-P", "-c", script, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env={name: value for name, value in given.items() if value},
    )
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


@pytest.fixture
def users_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "user"
    folder.mkdir()
    (folder / "users_module.py").write_text(USERS_MODULE)
    return folder


def copied(folder: Path) -> tuple[Path, dict[str, str]]:
    """A copy of the package's sources, and the environment of a process that works with it."""
    copy = folder / "copy"
    shutil.copytree(kernel_cache.PACKAGE, copy / "fastmech", ignore=shutil.ignore_patterns("__pycache__"))
    return copy, {
        "PYTHONPATH": str(copy),
        "NUMBA_CACHE_DIR": str(folder / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }


def reduced(copy: Path) -> tuple[Path, str]:
    """A file that kernels reach through imports, and its text with the potential's gradient doubled."""
    source = copy / "fastmech" / "slider" / "reduced.py"
    text = source.read_text()
    old = "    return u1, u2\n"  # of potential_gradient
    assert text.count(old) == 1
    return source, text.replace(old, "    return 2.0 * u1, 2.0 * u2\n")


@pytest.mark.slow
def test_a_second_process_loads_every_kernel() -> None:
    """The first one may have to compile; the second finds all, those that take functions as arguments too."""
    run(LOAD_ALL)
    second = run(LOAD_ALL)
    assert len(second) >= 15
    assert "fastmech.integrators.explicit.drive" in second
    for name, (path, hits, misses) in second.items():
        assert (hits, misses) == (1, 0), name
        assert Path(path).is_relative_to(kernel_cache.cache_directory()), name


def test_an_edited_source_gives_a_new_directory_and_the_new_answer(
    tmp_path: Path, users_folder: Path
) -> None:
    """The edit is in a file that the kernel's module imports: numba alone would not notice it."""
    copy, place = copied(tmp_path)
    first = run(ONE_KERNEL, users_folder, **place)
    assert Path(first["package"]).is_relative_to(copy)
    again = run(ONE_KERNEL, users_folder, **place)
    assert (first["hits"], again["hits"]) == (0, 1)
    assert again["answer"] == first["answer"]

    source, changed = reduced(copy)
    source.write_text(changed)
    edited = run(ONE_KERNEL, users_folder, **place)
    assert edited["directory"] != first["directory"]
    assert edited["hits"] == 0
    # From rest the accelerations are linear in the gradient, which is now twice as large.
    assert edited["answer"][2] == pytest.approx(2 * first["answer"][2], rel=1e-14)


@pytest.mark.parametrize("loaded", ["fastmech.slider.reduced", "fastmech.jit"])
def test_an_edit_while_a_process_compiles_spoils_nothing(loaded: str, tmp_path: Path) -> None:
    """Whether the process has read the edited file before the edit or reads it after it.

    Its kernel is made from the old text in the first case and from the new one in the second. It works, and
    is kept in neither: under the new text's name the first would be wrong, under the old one's the second.
    """
    copy, place = copied(tmp_path)
    source, changed = reduced(copy)
    (tmp_path / "new.py").write_text(changed)
    seen = run(EDITED_MEANWHILE, loaded, source, tmp_path / "new.py", **place)
    Y, dY = np.array([[0.7], [0.3], [0.0], [0.0]]), np.zeros((4, 1))
    with_terms("lagrange", "free")(
        0.0, Y, dY, np.array([[0.8], [0.6], [-9.0], [13.0], [8.0], [0.0], [0.0], [0.0]])
    )
    made_from = 1.0 if loaded.endswith("reduced") else 2.0
    assert seen["answer"][2] == pytest.approx(made_from * dY[2, 0], rel=1e-14)
    assert seen["kept"] == []


def test_the_user_s_cache_directory_is_respected(tmp_path: Path, users_folder: Path) -> None:
    """Ours lies below it, the user's kernels stay where numba puts them, and the setting is unchanged."""
    chosen = tmp_path / "chosen"
    seen = run(ONE_KERNEL, users_folder, NUMBA_CACHE_DIR=str(chosen))
    assert seen["before"] == seen["after"] == str(chosen)
    assert Path(seen["directory"]).parent == chosen
    assert Path(seen["path"]).parent == Path(seen["directory"])
    assert Path(seen["user"]).parent == chosen
    assert any(Path(seen["path"]).glob("*.nbc"))


def test_without_a_setting_the_user_s_kernels_stay_beside_their_source(users_folder: Path) -> None:
    seen = run(ONE_KERNEL, users_folder, NUMBA_CACHE_DIR="")
    assert seen["before"] == seen["after"] == ""
    assert Path(seen["user"]) == users_folder / "__pycache__"
    assert Path(seen["directory"]).name.startswith("fastmech-")


def test_the_directory_s_name_is_a_hash_of_names_and_contents(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernel_cache, "PACKAGE", tmp_path)
    a, b = tmp_path / "a.py", tmp_path / "b.py"
    a.write_text("x = 1\n")
    b.write_text("y = 2\n")
    original = kernel_cache.source_hash([a, b])
    assert len(original) == 16
    assert kernel_cache.source_hash([a, b]) == original
    assert kernel_cache.source_hash([a]) != original
    b.write_text("y = 3\n")
    changed = kernel_cache.source_hash([a, b])
    c = b.rename(tmp_path / "c.py")
    assert len({original, changed, kernel_cache.source_hash([a, c])}) == 3


def test_an_unchanged_touched_source_keeps_the_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Contents decide, not dates: a fresh checkout finds the kernels of the last one."""
    monkeypatch.setattr(kernel_cache, "PACKAGE", tmp_path)
    source = tmp_path / "a.py"
    source.write_text("x = 1\n")
    before = kernel_cache.source_hash([source])
    os.utime(source, (1.0, 1.0))
    assert kernel_cache.source_hash([source]) == before


def test_threads_that_compile_at_once_leave_the_setting_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(jit, "cache_directory", lambda: tmp_path)
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    together = threading.Barrier(4)

    def compiled(_: int) -> Any:
        def twice(x: float) -> float:
            return 2.0 * x

        together.wait()
        return jit.kernel(types.float64(types.float64))(twice)

    with ThreadPoolExecutor(4) as pool:
        kernels = list(pool.map(compiled, range(8)))
    after = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    assert after == before
    for kernel in kernels:
        assert kernel(2.0) == 4.0
        assert Path(kernel.stats.cache_path).parent == tmp_path
