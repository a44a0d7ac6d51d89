"""Modules whose source the package writes itself, kept on disk so that their kernels are too."""

from __future__ import annotations

import hashlib
import os
import sys
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType

from fastmech.errors import InputError
from fastmech.kernel_cache import cache_directory


def new_module(kind: str, source: str, prints: Iterable[str] = ()) -> ModuleType:
    """A module for ``source``, not run yet: what the source needs to know is put in first.

    Numba keeps on disk only what comes from a file, so the source is written into the cache directory under
    a name made from it and from ``prints``, the fingerprints of what it will be given.

    Raises:
        InputError: the file cannot be written.
    """
    digest = hashlib.sha256("\0".join([source, *prints]).encode()).hexdigest()[:16]
    path = cache_directory() / f"{kind}s" / f"{kind}_{digest}.py"
    _write_once(path, source)
    module = ModuleType(f"fastmech_{path.stem}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # where numba looks when it loads a kernel from the disk
    return module


def kept_text(kind: str, name: str, make: Callable[[], str]) -> str:
    """A text that takes long to make, from the cache directory where it has been put there under its name.

    Raises:
        InputError: the file cannot be written.
    """
    path = cache_directory() / f"{kind}s" / f"{kind}_{name}.txt"
    if path.exists():
        return path.read_text(encoding="utf-8")
    text = make()
    _write_once(path, text)
    return text


def run_module(module: ModuleType, source: str) -> ModuleType:
    """Run the source of a module; whatever that raises passes."""
    exec(compile(source, str(module.__file__), "exec"), vars(module))
    return module


def _write_once(path: Path, source: str) -> None:
    """The file keeps its first time stamp: numba takes a newer one for a changed source."""
    if path.exists():
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        aside = path.with_suffix(f".{os.getpid()}.{threading.get_ident()}.tmp")
        aside.write_text(source, encoding="utf-8")
        os.replace(aside, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
