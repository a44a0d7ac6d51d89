"""Writing a small file so that after any interruption it is there whole, as it was before, or not at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable
from pathlib import Path

#: Ending of what is not whole yet.
UNFINISHED = ".tmp"


def write_durably(path: Path, chunks: Iterable[bytes | memoryview]) -> None:
    """Write aside, flush to the disk, take the name, flush the folder.

    There must be one writer of ``path``.

    Raises:
        OSError: as the system says; the older file is then as it was.
    """
    aside = path.with_name(path.name + UNFINISHED)
    try:
        with aside.open("wb") as file:
            file.writelines(chunks)
            file.flush()
            os.fsync(file.fileno())
        os.replace(aside, path)
    except BaseException:
        with contextlib.suppress(OSError):
            aside.unlink(missing_ok=True)
        raise
    flush_folder(path.parent)


def flush_folder(folder: Path) -> None:
    """Make new names in a folder durable, where the system can."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
