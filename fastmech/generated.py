"""Modules whose source the package writes itself, kept on disk so that their kernels are too."""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from fastmech.errors import InputError
from fastmech.kernel_cache import cache_directory


def load_generated(kind: str, source: str, prints: tuple[str, ...] = (), **names: Any) -> ModuleType:
    """Run ``source`` as a module in which ``names`` are known.

    Numba keeps on disk only what comes from a file, so the source is written into the cache directory under
    a name made from it and from ``prints``, the fingerprints of what it is given.

    Raises:
        InputError: the file cannot be written.
    """
    digest = hashlib.sha256("\0".join([source, *prints]).encode()).hexdigest()[:16]
    path = cache_directory() / f"{kind}s" / f"{kind}_{digest}.py"
    _write_once(path, source)
    module = ModuleType(module_name(path.stem))
    vars(module).update(names, __file__=str(path))
    sys.modules[module.__name__] = module  # where numba looks when it loads a kernel from the disk
    exec(compile(source, path, "exec"), vars(module))
    return module


def module_name(stem: str) -> str:
    """Name of a generated module."""
    return f"fastmech_{stem}"


def _write_once(path: Path, source: str) -> None:
    """The file keeps its first time stamp: numba takes a newer one for a changed source."""
    if path.exists():
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        aside = path.with_suffix(f".{os.getpid()}.tmp")
        aside.write_text(source, encoding="utf-8")
        os.replace(aside, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
