"""The folder of a scan in progress: ``FILE.parts`` beside the result file.

::

    FILE.parts/
      lock               held by the process that works on it
      manifest.json      what was asked for, with its own checksum; written when a run begins
      run.json           which process works on it since when; for `fastmech status`
      000_SECTION/       one folder a section
        000042.tile      one file a finished tile
      *.tmp              what is being written

Whatever ends in ``.tile`` is whole; its own checksums say so.
"""

from __future__ import annotations

import contextlib
import json
import shutil
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from fastmech.errors import InputError
from fastmech.results import Dataset
from fastmech.store.write import readable_reasons
from fastmech.tiles.section import TiledSection
from fastmech.tiles.tile_file import DamagedTileError, Tile, TileHead, read_tile, write_durably

#: Seconds to wait for a lock that `fastmech status` may hold for a moment.
PATIENCE = 0.5


@dataclass(frozen=True)
class Manifest:
    """What was asked for."""

    asked: str  #: see `fastmech.tiles.section.asked_for`
    request_file: str  #: name of the request file
    request: str  #: its text
    replace: bool  #: whether the result may replace an older file
    #: of each section what the items of work are, and how many of them each tile has
    sections: dict[str, tuple[str, list[int]]]


def _clear(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


class DamagedManifestError(InputError):
    """A manifest is not what was written."""


def _checksum(fields: Mapping[str, Any]) -> int:
    return zlib.crc32(json.dumps(fields, sort_keys=True).encode())


class Parts:
    """The folder of a scan in progress."""

    def __init__(self, target: Path) -> None:
        self.target = target
        self.folder = target.with_name(target.name + ".parts")
        self._lock, self._places = self.folder / "lock", dict[str, str]()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Work on the folder, which is made, alone.

        Raises:
            InputError: another process works on it, or the folder cannot be made.
        """
        lock = FileLock(self._lock, timeout=PATIENCE)
        while not lock.is_locked:
            self._make(self.folder)
            try:
                lock.acquire()
            except Timeout:
                raise InputError(
                    f"{self.target}: {self.worker()} is working on it; wait for it or stop it"
                ) from None
            except (OSError, NotImplementedError) as error:
                raise InputError(f"{self.folder}: cannot be locked: {error}") from None
            if not self._lock.exists():  # who held it before has finished and removed the folder
                lock.release()
        try:
            for leftover in self.folder.rglob("*.tmp"):
                leftover.unlink(missing_ok=True)
            yield
        finally:
            with contextlib.suppress(OSError):
                (self.folder / "run.json").unlink(missing_ok=True)
                if not any(self.folder.rglob("*.tile")):  # it keeps nothing
                    shutil.rmtree(self.folder, ignore_errors=True)
            lock.release()

    @property
    def is_held(self) -> bool:
        """Whether a process works on the folder."""
        if not self._lock.exists():
            return False
        try:
            with FileLock(self._lock, timeout=0):
                return False
        except (Timeout, OSError, NotImplementedError):
            return True

    def worker(self) -> str:
        """Which process works on it, in words."""
        run = self.run_notes()
        return (
            f"process {run['pid']} on {run['host']}" if {"pid", "host"} <= run.keys() else "another process"
        )

    def run_notes(self) -> dict[str, Any]:
        """What the process that works on the folder has said about itself; nothing if there is none."""
        try:
            notes = json.loads((self.folder / "run.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return notes if isinstance(notes, dict) else {}

    def note_run(self, notes: dict[str, Any]) -> None:
        """Say for `fastmech status` who works on the folder."""
        (self.folder / "run.json").write_text(json.dumps(notes), encoding="utf-8")

    def manifest(self) -> Manifest | None:
        """What was asked for, or None where there is no scan in progress.

        Raises:
            DamagedManifestError: its checksum says so.
            InputError: it cannot be read.
        """
        path = self.folder / "manifest.json"
        try:
            fields = json.loads(path.read_bytes())
            if fields.pop("crc32") != _checksum(fields):
                raise ValueError("its checksum is another")
            return Manifest(**fields)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}") from None
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            raise DamagedManifestError(f"{path}: is damaged; run the scan again, which goes on") from None

    def begin(self, manifest: Manifest) -> None:
        """Write the manifest, and make the sections' folders."""
        self.look(manifest.sections)
        for place in self._places.values():
            self._make(self.folder / place)
        fields = asdict(manifest)
        text = json.dumps({**fields, "crc32": _checksum(fields)}, indent=1) + "\n"
        write_durably(self.folder / "manifest.json", [text.encode()])

    def look(self, names: Iterable[str]) -> None:
        """Know where the tiles of sections are, given in the order of the request; nothing is changed."""
        self._places = {name: f"{k:03d}_{name}" for k, name in enumerate(names)}

    def path(self, name: str, index: int) -> Path:
        """The file of a section's tile."""
        return self.folder / self._places[name] / f"{index:06d}.tile"

    def names(self, name: str, count: int) -> list[Path]:
        """The files of finished tiles of a section that has so many."""
        each = (self.path(name, index) for index in range(count))
        return [path for path in each if path.is_file()]

    def store(self, section: TiledSection, tile: Tile) -> None:
        """Keep a finished tile for good."""
        write_durably(self.path(section.name, tile.head.index), tile.chunks)

    def load(self, section: TiledSection, index: int) -> tuple[TileHead, Dataset]:
        """Read a tile.

        Raises:
            DamagedTileError: it is damaged or gone.
        """
        path = self.path(section.name, index)
        try:
            return read_tile(path.read_bytes(), section.identity, section.name, index)
        except OSError as error:
            raise DamagedTileError(f"{path}: cannot be read: {error.strerror}") from None
        except DamagedTileError as error:
            raise DamagedTileError(f"{path}: {error}") from None

    def drop(self, section: TiledSection, index: int) -> None:
        """Forget a tile, or whatever stands in its place."""
        _clear(self.path(section.name, index))

    def remove(self) -> None:
        """Remove everything but the lock, the manifest last."""
        for entry in sorted(self.folder.iterdir(), key=lambda entry: entry.name == "manifest.json"):
            if entry.name != "lock":
                _clear(entry)

    def _make(self, folder: Path) -> None:
        with readable_reasons(self.target):
            folder.mkdir(parents=True, exist_ok=True)
