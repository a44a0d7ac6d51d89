"""A file for HDF5 on a disk that may fill up.

HDF5 may crash the process when a write fails, at the latest when it closes the file. So it never learns of
it: after the first failure nothing is written any more, and whoever writes asks for the failure.
"""

from __future__ import annotations

import io
from typing import IO


class GuardedFile(io.RawIOBase):
    """A binary file that keeps the first failure of the system to itself until `check` is called.

    Args:
        disk: the file, open for reading and writing without a buffer.
    """

    def __init__(self, disk: IO[bytes]) -> None:
        self._disk = disk
        self._failure: OSError | None = None

    def check(self) -> None:
        """Raise the failure, if there was one."""
        if self._failure is not None:
            raise self._failure

    def write(self, data: object) -> int:
        """Write all of the data, or nothing any more after a failure."""
        view = memoryview(data).cast("B")  # type: ignore[arg-type]
        done = 0
        try:
            while self._failure is None and done < len(view):
                done += self._disk.write(view[done:])
        except OSError as error:
            self._failure = error
        return len(view)

    def readinto(self, buffer: object) -> int:
        """Read as much as there is; what was never written reads as zeros."""
        view = memoryview(buffer).cast("B")  # type: ignore[arg-type]
        filled = 0
        try:
            while filled < len(view):
                part = self._disk.read(len(view) - filled)
                if not part:
                    break
                view[filled : filled + len(part)] = part
                filled += len(part)
        except OSError as error:
            self._failure = self._failure or error
        view[filled:] = bytes(len(view) - filled)
        return len(view)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a place."""
        return self._disk.seek(offset, whence)

    def tell(self) -> int:
        """The place."""
        return self._disk.tell()

    def truncate(self, size: int | None = None) -> int:
        """Change the length."""
        length = self._disk.tell() if size is None else size
        try:
            if self._failure is None:
                self._disk.truncate(length)
        except OSError as error:
            self._failure = error
        return length

    def flush(self) -> None:
        """Nothing waits here."""

    def readable(self) -> bool:
        """Yes."""
        return True

    def writable(self) -> bool:
        """Yes."""
        return True

    def seekable(self) -> bool:
        """Yes."""
        return True
