"""Where compiled kernels are kept, and why they cannot go stale.

Numba re-uses a kernel's disk entry as long as the kernel's *own* file is unchanged; an edit of a file
that the kernel imports goes unnoticed and the old machine code answers (numba's documented limitation).
fastmech therefore keeps its entries in a directory whose name is a hash of every source file that a
kernel can reach: a changed source means another directory, hence a fresh compilation.
"""

from __future__ import annotations

import hashlib
import os
from functools import cache
from pathlib import Path

import platformdirs

PACKAGE = Path(__file__).resolve().parent

#: Sub-packages that hold compiled code. They import nothing from the rest of the package
#: (``tests/test_layout.py`` keeps it so), hence their sources decide every kernel.
COMPILED = ("mechanism", "kernels", "integrators", "ensembles", "equilibria", "stability")


def compiled_sources() -> list[Path]:
    """All source files that a compiled kernel of the package can depend on, sorted."""
    return sorted(file for folder in COMPILED for file in (PACKAGE / folder).rglob("*.py"))


def source_hash(files: list[Path]) -> str:
    """Sixteen hexadecimal digits that change with any name or byte of ``files``."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(f"{file.relative_to(PACKAGE)}\0".encode() + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@cache
def cache_directory() -> Path:
    """Directory of this version's compiled kernels.

    Below ``NUMBA_CACHE_DIR`` where the user has set it, else in the user's cache folder.
    """
    root = os.environ.get("NUMBA_CACHE_DIR")
    base = Path(root) if root else platformdirs.user_cache_path("fastmech", appauthor=False)
    return base / f"fastmech-{source_hash(compiled_sources())}"
