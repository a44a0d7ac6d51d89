"""A look at a scan in progress, how far it is and what there is; one tile computed alone."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator
from contextlib import suppress
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import NamedTuple

from fastmech.ensembles.system import System
from fastmech.errors import InputError, shown, shown_name
from fastmech.models.mechanism import Mechanism
from fastmech.results import Dataset, scene_parameters
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import RunContext, read_request
from fastmech.store.provenance import provenance
from fastmech.store.read import open_results
from fastmech.store.write import check_writable, write_results
from fastmech.tiles.parts import Manifest, Parts
from fastmech.tiles.section import (
    RefusedScanError,
    TiledSection,
    asked_for,
    assembled,
    differences,
    require_named,
    sections_of,
)
from fastmech.tiles.tile_file import DamagedTileError, dataset_image, dataset_of_image


class ScanLook:
    """A scan in progress, read by another process than the one that works on it.

    Raises:
        InputError: there is neither a result ``target`` nor a scan in progress that will be it.
    """

    def __init__(self, target: Path) -> None:
        self.parts = Parts(target)
        manifest = self.parts.manifest()
        self.manifest: Manifest | None = manifest
        if manifest is not None:
            self.parts.look(manifest.sections)
            return
        if not (target.exists() or target.is_symlink()):  # reading says what is wrong with a link
            raise InputError(f"{target}: there is neither a result nor a scan in progress")
        with open_results(target) as results:  # says what it is if it is no result
            for place in results.groups:
                for name in results[place]:
                    results[place].about(name)  # says what is damaged
            for note, what in {"partial": "a snapshot of a scan in progress", "tile": "one tile"}.items():
                if note in results.attrs or any(note in results[name].attrs for name in results):
                    raise InputError(f"{target}: is {what}, not the result of a scan")

    def told(self) -> Iterator[str]:
        """How far each section is, by the names of the finished tiles, who works on it, and what is left."""
        target = self.parts.target
        if self.manifest is None:
            yield f"{target}: complete"
            return
        held = self.parts.is_held
        begun = self.parts.run_notes().get("since") if held else None
        begun = float(begun) if isinstance(begun, int | float) else None
        done, every, since, work, left = 0, 0, 0, 0.0, 0.0
        for name, (what, items) in self.manifest.sections.items():
            tiles, names = len(items), self.parts.names(name, len(items))
            finished = sum(items[int(path.stem)] for path in names)
            more = f", {finished:,} of {sum(items):,} {what}" if tiles > 1 else ""
            yield f"{len(names):6,} of {tiles:,} tiles  {name}{more}"
            done, every, left = done + len(names), every + tiles, left + (tiles - len(names)) / tiles
            if begun is not None:
                new = sum(path.stat().st_mtime >= begun for path in names)
                since, work = since + new, work + new / tiles
        yield f"{done:6,} of {every:,} tiles  in all"
        if not held:
            yield f"{target}: nobody works on it; fastmech run goes on where it was"
            return
        how = ""
        if begun is not None:
            running = time.time() - begun
            how = f" for {timedelta(seconds=int(running))}"
            how += f", {since / running:.3g} tiles/s" if since and running else ""
            how += f", about {timedelta(seconds=int(left * running / work))} left" if work else ""
        yield f"{target}: {self.parts.worker()} works on it{how}"

    def write_snapshot(self, out: Path, mechanism: Mechanism | System | None = None) -> None:
        """Write what there is as a result file, with the attribute ``partial``.

        Sections that cannot be shown in part are left out until they are complete, and those of scans that
        refuse their scene. ``mechanism`` is the one of the user's own that the scan is about.

        Raises:
            InputError: nothing is there yet, other sources of fastmech or another mechanism are at work, or
                it cannot be written.
        """
        if self.manifest is None:
            raise InputError(f"{self.parts.target}: is complete; there is nothing in progress")
        asked, text = self.manifest.asked, self.manifest.request
        if mechanism is None:
            require_named(asked, text, self.parts.target)
        request = read_request(self.manifest.request_file, scan_kinds(), text, mechanism)
        if asked != asked_for(request):
            differing = differences(asked, asked_for(request))
            raise InputError(f"{self.parts.target}: the scan in progress differs: {differing}")
        shown = {}
        for section in sections_of(request):
            with suppress(RefusedScanError):
                there = {int(path.stem) for path in self.parts.names(section.name, section.tiling.count)}
                if len(there) == section.tiling.count or (there and section.tiling.missing(0) is not None):
                    note = {"partial": f"{len(there)} of {section.tiling.count} tiles"}
                    tile, seconds = partial(self._tile, section), self._seconds(section)
                    shown[section.name] = assembled(section, tile, seconds, note)
        if not shown:
            raise InputError(f"{self.parts.target}: no section can be shown yet")
        notes = {"title": request.title, "request": text}
        write_results(
            out,
            scene_parameters=scene_parameters(request.scene),
            sections=shown,
            attrs={**provenance(1), **notes, "partial": "a scan in progress"},
            deflate=False,  # which takes minutes where the rest takes seconds
        )

    def _seconds(self, section: TiledSection) -> float:
        """Wall time that the tiles have taken which are there [s]."""
        seconds = 0.0
        for path in self.parts.names(section.name, section.tiling.count):
            with suppress(DamagedTileError):
                seconds += self.parts.load(section, int(path.stem))[0].seconds
        return seconds

    def _tile(self, section: TiledSection, index: int) -> Dataset:
        """A tile, or what stands for one that is not there."""
        try:
            return self.parts.load(section, index)[1]
        except DamagedTileError:
            missing = section.tiling.missing(index)
            if missing is None:
                raise
            return missing


class LoneTile(NamedTuple):
    """A tile that was computed alone."""

    work: str  #: how many items of work it is, and what they are
    content: str  #: SHA-256 of the content, equal for equal bits
    seconds: float  #: wall time [s]
    same: bool | None  #: whether the tile that a run has kept has the same content; None: there is none


def compute_alone(
    path: Path,
    tile: str,
    context: RunContext,
    target: Path,
    *,
    text: str | None = None,
    mechanism: Mechanism | System | None = None,
    keep: Path | None = None,
) -> LoneTile:
    """Compute one tile, ``SECTION:INDEX``, and compare it with that of the result file ``target`` to be.

    ``text`` of the request is that of the file by default; ``mechanism`` is one of the user's own; ``keep``
    names a result file for the tile.

    Raises:
        InputError: the request is wrong or has no such tile, or ``keep`` cannot be written or exists.
    """
    if keep is not None:
        check_writable(keep)
    request = read_request(path, scan_kinds(), text, mechanism)
    sections = {s.name: s for s in sections_of(request)}
    name, _, number = tile.partition(":")
    where = f"--tile {shown_name(tile)}"
    if name not in sections:
        there = ", ".join(sections)
        raise InputError(f"{where}: the request has no section {shown(name)}; it has {there}")
    section = sections[name]
    count = section.tiling.count
    is_number = number.isascii() and number.isdigit() and len(number) <= len(str(count))
    if not is_number or int(number) >= count:
        raise InputError(f"{where}: {name} has the tiles 0 to {count - 1}")
    index = int(number)
    made = section.compute(index, context)
    parts = Parts(target)
    parts.look(sections)
    same = None
    with suppress(DamagedTileError):
        same = dataset_image(parts.load(section, index)[1]) == made.image
    if keep is not None:
        dataset = dataset_of_image(made.image)
        attrs = {"kind": section.scan.kind, "tile": index, **dataset.attrs}
        write_results(
            keep,
            scene_parameters=scene_parameters(request.scene),
            sections={name: Dataset(dataset.variables, attrs)},
            attrs={**provenance(1), "title": f"tile {index} of {name}"},
        )
    work = f"{section.tiling.items(index):,} {section.tiling.what}"
    return LoneTile(work, hashlib.sha256(made.image).hexdigest(), made.head.seconds, same)
