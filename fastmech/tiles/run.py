"""A scan from its request to its result file, in tiles that are kept; run again, it goes on."""

from __future__ import annotations

import os
import platform
import shlex
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from fastmech.ensembles.run import Progress
from fastmech.ensembles.threads import thread_count
from fastmech.errors import InputError
from fastmech.interrupts import CrashedTilesError, Stopped, signal_of
from fastmech.results import Dataset, scene_parameters
from fastmech.scan_types.request import Request, RunContext
from fastmech.store.provenance import provenance
from fastmech.store.write import check_ending, write_results
from fastmech.tiles.parts import DamagedManifestError, Manifest, Parts
from fastmech.tiles.section import (
    RefusedScanError,
    TiledSection,
    asked_for,
    asked_of_result,
    assembled,
    differences,
    sections_of,
)
from fastmech.tiles.tile_file import DamagedTileError, Tile
from fastmech.tiles.work import TileTask, Workers, compute_tiles, still_computing


@dataclass
class RunReport:
    """What a run has done."""

    path: Path  #: the result file
    tiles: int = 0  #: tiles in all
    computed: int = 0  #: tiles that this run has computed
    #: files of tiles that were found damaged and computed again
    damaged: list[Path] = field(default_factory=list)
    was_complete: bool = False  #: whether there was nothing to do
    seconds: float = 0.0  #: wall time of this run [s]

    def summary(self) -> dict[str, Any]:
        """The same as plain values, for other programs."""
        about = {"result": str(self.path), "tiles": self.tiles, "computed": self.computed}
        return about | {"damaged": [*map(str, self.damaged)], "was_complete": self.was_complete}


#: Seconds for tiles in hand to notice an interrupt before the user is told that they do not.
PATIENCE = 0.3

#: How often a result is assembled anew because a tile was damaged meanwhile.
ASSEMBLIES = 3


def default_output(path: str | Path) -> Path:
    """Where the results of a request file go unless told otherwise."""
    return Path("results") / f"{Path(path).stem}.h5"


def _inode(path: Path) -> tuple[int, int] | None:
    """Which file has this name; None: none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns


class ScanRun:
    """One run of a request."""

    def __init__(
        self,
        request: Request,
        request_file: Path,
        target: Path,
        context: RunContext,
        workers: Workers,
        tell: Callable[[str], None] = lambda line: None,
    ) -> None:
        self.request, self.request_file, self.target = request, request_file, target
        check_ending(target)
        if not target.parent.exists():  # of what is not there `..` is its name less one, whatever is made yet
            self.target = target = Path(os.path.normpath(target))
        self.context, self.workers, self.tell = context, workers, tell
        self.asked = asked_for(request)
        self.sections = sections_of(request)
        self.parts = Parts(Path(os.path.realpath(target)))
        for path in (target, self.parts.folder):  # links in a circle, or a name that the system refuses
            try:
                with suppress(FileNotFoundError):
                    path.stat()
            except OSError as error:
                raise InputError(f"{path}: cannot be written: {error.strerror}") from None
        self.tiles: dict[str, tuple[str, list[int]]] = {}  # what the manifest says of the sections
        self.seconds: dict[TileTask, float] = {}
        self.crashes: list[tuple[TileTask, str]] = []  # with the reasons
        self.replace = False
        self.started = time.perf_counter()
        self.before = _inode(self.parts.target)
        self.report = RunReport(target)

    @cached_property
    def tasks(self) -> list[TileTask]:
        """All tiles; what they are may take kernels to find out."""
        return [TileTask(s, index) for s in self.sections for index in range(s.tiling.count)]

    def run(self, fresh: bool) -> RunReport:
        """Compute what is missing and assemble the result file; ``fresh``: anew, in place of an older one.

        Raises:
            InputError: the request differs from the one in progress or done, something cannot be written, or
                a scan refuses.
            CrashedTilesError: tiles have failed.
            Stopped: the user stopped it.
        """
        if self._is_complete(fresh):
            self.report.was_complete, self.report.tiles = True, len(self.tasks)
            return self.report
        with self.parts.held():
            try:
                begun = self._begin(fresh)
                self.report.tiles = len(self.tasks)
                if not begun:
                    self.report.was_complete = True
                    return self.report
                self._check_tiles()
                for _ in range(ASSEMBLIES):
                    self._compute()
                    if self._assemble():
                        break
                else:
                    raise InputError(f"{self.parts.folder}: tiles are damaged time and again; check the disk")
                self.parts.remove()
            except KeyboardInterrupt as interrupt:
                if _inode(self.parts.target) not in (None, self.before):  # a file of that name is complete
                    raise Stopped(f"interrupted; {self.target} is complete", signal_of(interrupt)) from None
                message = self._kept("interrupted")
                if still_computing(PATIENCE):
                    message += "; this process ends with the tiles in hand, which are not kept"
                raise Stopped(message, signal_of(interrupt)) from None
            except RefusedScanError as error:
                others = f"fastmech status {self.target} --snapshot OTHER.h5 writes what other scans have"
                alone = len(self.sections) == 1
                raise InputError(self._kept(str(error), "" if alone else others)) from None
            except InputError as error:
                raise InputError(self._kept(str(error))) from None
            except OSError as error:
                place = error.filename or self.target
                raise InputError(
                    self._kept(f"{place}: cannot be written: {error.strerror or error}")
                ) from None
        self.report.seconds = time.perf_counter() - self.started
        return self.report

    def _is_complete(self, fresh: bool) -> bool:
        """Whether the result is there and nothing of it is in progress."""
        target = self.parts.target
        if target.is_dir():
            raise InputError(f"{self.target}: is a folder; give the name of a file in it")
        if fresh or not target.exists() or self.parts.folder.is_dir():
            return False
        there = asked_of_result(target)
        if there != self.asked:
            raise InputError(self._other_result(there))
        return True

    def _begin(self, fresh: bool) -> bool:
        """Make the folder ready; False where the result is there already."""
        target, manifest = self.parts.target, None
        if fresh:
            self.parts.remove()
        else:
            try:
                manifest = self.parts.manifest()
            except DamagedManifestError:  # every tile says itself what it belongs to
                self.tell(f"{self.parts.folder}: its manifest is damaged and written anew")
        if not fresh and target.exists():
            there = asked_of_result(target)
            if there == self.asked:
                self.parts.remove()
                return False
            if manifest is None or not manifest.replace:
                raise InputError(self._other_result(there))
        if manifest is not None and manifest.asked != self.asked:
            raise InputError(
                f"{self.target}: a scan in progress differs: {differences(manifest.asked, self.asked)};"
                " --fresh starts anew, --out names another file"
            )
        self.replace = fresh or (manifest is not None and manifest.replace)
        self.tiles = {  # all or none: a scan may refuse here
            s.name: (s.tiling.what, [*map(s.tiling.items, range(s.tiling.count))]) for s in self.sections
        }
        text = self.request.text
        self.parts.begin(Manifest(self.asked, self.request_file.name, text, self.replace, self.tiles))
        self.parts.note_run({"pid": os.getpid(), "host": platform.node(), "since": time.time()})
        return True

    def _other_result(self, there: str | None) -> str:
        why = f" and differs: {differences(there, self.asked)}" if there else ""
        return f"{self.target}: exists already{why}; --fresh replaces it, --out names another file"

    def _check_tiles(self) -> None:
        """Find out which tiles are there."""
        present = [task for task in self.tasks if self.parts.path(task.section.name, task.index).exists()]
        if not present:
            return
        advance = self.context.stage("checking finished tiles", len(present))
        for task in present:
            try:
                self.seconds[task] = self.parts.load(task.section, task.index)[0].seconds
            except DamagedTileError as error:
                self._damaged(task, error)
            advance(1)
        self.tell(f"{len(self.seconds)} of {len(self.tasks)} tiles are kept from before")

    def _damaged(self, task: TileTask, error: DamagedTileError) -> None:
        self.tell(f"{error}; it is computed again")
        self.report.damaged.append(self.parts.path(task.section.name, task.index))
        self.seconds.pop(task, None)
        self.parts.drop(task.section, task.index)

    def _compute(self) -> None:
        missing = [task for task in self.tasks if task not in self.seconds]
        stages: dict[str, Progress] = {}
        for section in self.sections:
            total = sum(section.tiling.items(task.index) for task in missing if task.section == section)
            if total and (section.tiling.count > 1 or self.workers.together):
                stages[section.name] = self.context.stage(f"{section.name}: {section.tiling.what}", total)

        def keep(task: TileTask, tile: Tile) -> None:
            self.parts.store(task.section, tile)
            self.seconds[task] = tile.head.seconds
            self.report.computed += 1
            if task.section.name in stages:
                stages[task.section.name](task.section.tiling.items(task.index))

        groups = [missing]
        if not self.workers.together:
            groups = [[task for task in missing if task.section == section] for section in self.sections]
        for group in filter(None, groups):
            with self.workers.hired(group, self.context):
                self.crashes += compute_tiles(group, self.workers, keep)
        if self.crashes:
            raise CrashedTilesError(self._crash_report())

    def _assemble(self) -> bool:
        """Write the result file; False where a tile turned out to be damaged."""
        advance, reading = self.context.stage("assembling", len(self.tasks)), list[TileTask]()

        def tile(section: TiledSection, index: int) -> Dataset:
            reading[:] = [TileTask(section, index)]
            _, dataset = self.parts.load(section, index)
            advance(1)
            return dataset

        try:
            parts = {}
            for section in self.sections:
                seconds = sum(s for task, s in self.seconds.items() if task.section == section)
                parts[section.name] = assembled(section, partial(tile, section), seconds)
            write_results(
                self.parts.target,
                scene_parameters=scene_parameters(self.request.scene),
                sections=parts,
                attrs=self._attrs,
                replace=self.replace,
                aside=self.parts.folder,
                threads=thread_count(self.context.threads),
            )
        except DamagedTileError as error:
            self._damaged(reading[0], error)
            return False
        return True

    def _attrs(self) -> dict[str, str | int | float]:
        return {
            **provenance(thread_count(self.context.threads)),
            "title": self.request.title,
            "request_file": self.request_file.name,
            "request": self.request.text,
            "asked_for": self.asked,
            "wall_time_s": time.perf_counter() - self.started,
        }

    def _kept(self, what: str, then: str = "the same command goes on") -> str:
        count = len(self.seconds)
        with suppress(OSError):  # an interrupt may come between a tile and its being counted
            there = (self.parts.names(name, len(items)) for name, (_, items) in self.tiles.items())
            count = max(count, sum(map(len, there)))
        if not count:
            return what
        kept = f"{count} of {len(self.tasks)} tiles are kept in {self.parts.folder.name}"
        return "; ".join(filter(None, (what, kept, then)))

    def _crash_report(self) -> str:
        first, reason = self.crashes[0]
        command = ["fastmech", "run", str(self.request_file)]
        if self.target != default_output(self.request_file):
            command += ["--out", str(self.target)]
        command += ["--tile", f"{first.section.name}:{first.index}", "--keep", "tile.h5"]
        return self._kept(
            f"{len(self.crashes)} of {len(self.tasks)} tiles failed twice, the first with {reason}"
            f" (alone: {shlex.join(command)})"
        )
