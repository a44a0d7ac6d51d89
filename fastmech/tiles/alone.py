"""One tile of a request computed alone, to look into what failed."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from fastmech.errors import InputError, shown, shown_name
from fastmech.models.mechanism import Mechanism
from fastmech.results import Dataset
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import Request, RunContext, read_request
from fastmech.store.image import dataset_image, dataset_of_image
from fastmech.store.provenance import provenance
from fastmech.store.write import write_results
from fastmech.tiles.identity import asked_for, identity_of
from fastmech.tiles.parts import Parts
from fastmech.tiles.section import TiledSection, sections_of
from fastmech.tiles.tile_file import DamagedTileError


@dataclass(frozen=True)
class LoneTile:
    """A tile that was computed alone.

    Attributes:
        request, section, index: which it is.
        dataset: its content.
        content: SHA-256 of the content, equal for equal bits.
        seconds: wall time [s].
        same: whether the tile that a run has kept has the same content; None: there is none.
    """

    request: Request
    section: TiledSection
    index: int
    dataset: Dataset
    content: str
    seconds: float
    same: bool | None

    @property
    def items(self) -> int:
        """Items of work."""
        return self.section.tiling.items(self.index)

    @property
    def what(self) -> str:
        """What the items are."""
        return self.section.tiling.what

    def write(self, path: Path) -> None:
        """Write it as a result file.

        Raises:
            InputError: it cannot be written or exists.
        """
        attrs = {"kind": self.section.scan.kind, "tile": self.index, **self.dataset.attrs}
        write_results(
            path,
            scene_parameters=self.request.parameters,
            sections={self.section.name: Dataset(self.dataset.variables, attrs)},
            attrs={**provenance(1), "title": f"tile {self.index} of {self.section.name}"},
        )


def compute_alone(
    path: Path,
    tile: str,
    context: RunContext,
    target: Path,
    text: str | None = None,
    mechanism: Mechanism | None = None,
) -> LoneTile:
    """Compute one tile.

    Args:
        path: request file.
        tile: ``SECTION:INDEX``.
        context: threads to use.
        target: the request's result file, whose finished tiles it is compared with.
        text: of the request, by default that of the file.
        mechanism: one of the user's own that the request is about.

    Raises:
        InputError: the request is wrong or has no such tile.
    """
    request = read_request(path, scan_kinds(), text, mechanism)
    sections = {s.name: s for s in sections_of(request, identity_of(asked_for(request)))}
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
    image = b"".join(chunk.data for chunk in made.image)
    parts = Parts(target)
    parts.look(list(sections.values()))
    try:
        kept = b"".join(chunk.data for chunk in dataset_image(parts.load(section, index)))
    except DamagedTileError:
        kept = None
    return LoneTile(
        request=request,
        section=section,
        index=index,
        dataset=dataset_of_image(memoryview(image)),
        content=hashlib.sha256(image).hexdigest(),
        seconds=made.head.seconds,
        same=None if kept is None else kept == image,
    )
