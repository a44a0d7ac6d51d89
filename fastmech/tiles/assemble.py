"""The result file of all tiles."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from fastmech.results import Dataset, Variable
from fastmech.scan_types.tiling import Tiles
from fastmech.store.schema import CHANGE
from fastmech.store.stream import Stream, in_memory, write_stream
from fastmech.store.write import write_results
from fastmech.tiles.section import TiledSection

#: Bytes of streamed variables up to which a section is made in memory.
IN_MEMORY_BYTES = 64 << 20


def assembled(
    section: TiledSection, tile: Tiles, seconds: float, notes: Mapping[str, str] | None = None
) -> Dataset | Stream:
    """A section of its tiles, with the attributes that every section has.

    Args:
        section: which.
        tile: gives its tiles.
        seconds: wall time that they took [s].
        notes: further attributes.
    """
    result = section.tiling.assemble(tile)
    if isinstance(result, Stream) and result.nbytes <= IN_MEMORY_BYTES:
        result = in_memory(result)
    changes = {f"{CHANGE}{key}": float(value) for key, value in section.scan.scene.items()}
    own = {"kind": section.scan.kind, **changes, **(notes or {})}
    told = section.scan.step_warning(section.scene)
    if told is not None:
        own["step_warning"] = told
    if isinstance(result, Stream):
        attrs = {**own, **result.fixed.attrs, "wall_time_s": seconds}
        return replace(result, fixed=replace(result.fixed, attrs=attrs))
    return replace(result, attrs={**own, **result.attrs, "wall_time_s": seconds})


def write_assembled(
    target: Path,
    sections: Mapping[str, Dataset | Stream],
    *,
    parameters: Mapping[str, Variable],
    attrs: Callable[[], Mapping[str, Any]],
    replace: bool,
    aside: Path | None = None,
    threads: int = 1,
    deflate: bool = True,
) -> None:
    """Write a result file of sections, of which large ones are streams.

    Raises:
        InputError: it cannot be written.
    """
    whole = {name: section for name, section in sections.items() if isinstance(section, Dataset)}
    if len(whole) < len(sections):
        write_stream(
            target,
            scene_parameters=parameters,
            sections=sections,
            attrs=attrs,
            replace=replace,
            aside=aside,
            threads=threads,
            deflate=deflate,
        )
    else:
        write_results(
            target, scene_parameters=parameters, sections=whole, attrs=attrs(), replace=replace, aside=aside
        )
