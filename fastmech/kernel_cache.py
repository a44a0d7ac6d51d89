"""Where compiled kernels are kept, and why they cannot go stale.

Numba re-uses a kernel's disk entry as long as the kernel's *own* file is unchanged; an edit of a file
that the kernel imports goes unnoticed and the old machine code answers (numba's documented limitation).
fastmech therefore keeps its entries in a directory whose name is a hash of every source file that a
kernel can reach: a changed source means another directory, hence a fresh compilation.

Python reads a module's source when it is first imported, which may be long after the process began. The hash
is therefore taken as the package is imported, before any of those modules, and once more before a kernel is
saved: where the two differ, nobody knows which text the kernel was made from, and it is not kept.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent

#: Modules and sub-packages that hold compiled code or decide its flags. No kernel reaches another source of
#: the package (``tests/test_layout.py`` keeps it so), hence these decide every kernel.
COMPILED = (
    "arrays.py",
    "callee.py",
    "jit.py",
    "generated.py",
    "loads.py",
    "models",
    "outcome.py",
    "slider",
    "kernels",
    "intervals",
    "integrators",
    "ensembles",
    "step_limits",
    "transients",
    "disturbance",
    "atlas",
    "capture",
)


def source_files(names: Iterable[str] = COMPILED) -> list[Path]:
    """Source files of modules and sub-packages, sorted; by default all that a kernel can depend on."""
    places = [PACKAGE / name for name in names]
    return sorted(file for place in places for file in ([place] if place.is_file() else place.rglob("*.py")))


def source_hash(files: list[Path]) -> str:
    """Sixteen hexadecimal digits that change with any name or byte of ``files``."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(f"{file.relative_to(PACKAGE)}\0".encode() + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


#: Hash of the sources as this process began to read them: the package imports this module before any other.
SOURCES = source_hash(source_files())


def sources_unchanged() -> bool:
    """Whether the sources still are what this process began with, so that its kernels are theirs."""
    try:
        return source_hash(source_files()) == SOURCES
    except OSError:  # a file vanished between listing and reading: somebody is at work
        return False


@cache
def cache_directory() -> Path:
    """Directory of this version's compiled kernels.

    Below ``NUMBA_CACHE_DIR`` where the user has set it, else in the user's cache folder. Kernels that check
    their array bounds have a directory of their own. Where the folder cannot be written, a temporary one
    serves this process: numba's own fallback beside the sources is not named by their hash.
    """
    import platformdirs  # only here: this module is imported with the package

    root = os.environ.get("NUMBA_CACHE_DIR")
    base = Path(root) if root else platformdirs.user_cache_path("fastmech", appauthor=False)
    checked = "-boundscheck" if os.environ.get("NUMBA_BOUNDSCHECK", "0") not in ("", "0") else ""
    directory = base / f"fastmech-{SOURCES}{checked}"
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            return directory
    except OSError:
        temporary = tempfile.mkdtemp(prefix="fastmech-")
        atexit.register(shutil.rmtree, temporary, ignore_errors=True)
        return Path(temporary)


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Hold a file against other processes; nothing is held where the system or the folder has no locks.

    Whoever holds it may wait for the kernels that its own kernel calls, never the other way round, and a
    process that ends holds nothing more.
    """
    with ExitStack() as held:
        with suppress(ImportError, OSError):
            import fcntl  # not on Windows

            path.parent.mkdir(parents=True, exist_ok=True)
            file = held.enter_context(path.open("ab"))
            fcntl.flock(file, fcntl.LOCK_EX)
            held.callback(fcntl.flock, file, fcntl.LOCK_UN)  # also for a forked process that has the file
        yield
