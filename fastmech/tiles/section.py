"""One section of a request: its tiles, computed by any process, its assembly, and what decides its bits."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

from fastmech.ensembles.system import System
from fastmech.errors import InputError, shown, shown_name
from fastmech.kernel_cache import COMPILED, source_files, source_hash
from fastmech.models.mechanism import Mechanism
from fastmech.results import Dataset
from fastmech.scan_types.request import Request, RunContext, Scan, Tiles, Tiling
from fastmech.scene import Scene, parse_toml
from fastmech.store.read import open_results
from fastmech.store.schema import CHANGE
from fastmech.store.write import Stream, in_memory
from fastmech.tiles.tile_file import DamagedTileError, Tile, TileHead, dataset_image

#: Raised when finished tiles of an older version can no longer be assembled.
TILE_SCHEMA = 2

#: Sources besides the compiled ones that decide a section's values.
_SOURCES = (
    *COMPILED, "mechanisms", "samplers.py", "attractors", "basins", "scene.py", "results.py", "scan_types",
)  # fmt: skip

_LIBRARIES = ("numba", "llvmlite", "numpy", "scipy", "sympy")

_MOST_TOLD = 3


@cache
def code_in_use() -> dict[str, str]:
    """The sources and the versions of the libraries that compute values here."""
    versions = {name: metadata.version(name) for name in _LIBRARIES}
    return {"fastmech's sources": source_hash(source_files(_SOURCES)), **versions}


def asked_for(request: Request) -> str:
    """Everything that decides the values of a result, as canonical JSON."""
    scans = {
        name: {"kind": scan.kind, **scan.model_dump(mode="json")} for name, scan in request.scans.items()
    }
    content = {"tile schema": TILE_SCHEMA, "code": code_in_use(), "scene": _told(request.scene)}
    return json.dumps({**content, "scan": scans}, sort_keys=True)


def _told(scene: Scene | Mechanism | System) -> dict[str, Any]:
    """What tells a scene, a mechanism or a system apart."""
    if isinstance(scene, Scene):
        return dict(scene.parameters)
    if isinstance(scene, System):
        about = {"state": list(scene.state), "angles": list(scene.angles)}
        return {"system": scene.name, "equations": scene.prints, **about, **scene.parameters}
    ranges = {str(c.symbol): [c.low, c.high, c.periodic] for c in scene.coordinates}
    return {"mechanism": scene.name, "equations": scene.prints, "ranges": ranges, **scene.parameters}


def differences(there: str, here: str) -> str:
    """What differs between two values of `asked_for`, the first few in words."""
    old, new = dict(_flat(json.loads(there))), dict(_flat(json.loads(here)))
    told = []
    for name in sorted(old.keys() | new.keys()):
        was, now = old.get(name, "nothing"), new.get(name, "nothing")
        if was != now:
            told.append(f"{name.removeprefix('code.')} = {shown_name(was)} there, {shown_name(now)} here")
    more = f" and {len(told) - _MOST_TOLD} more" if len(told) > _MOST_TOLD else ""
    return "; ".join(told[:_MOST_TOLD]) + more


def asked_of_result(path: Path) -> str | None:
    """What a result file was asked for; None if it does not say."""
    try:
        with open_results(path) as results:
            asked = results.attrs.get("asked_for")
            return asked if isinstance(asked, str) and isinstance(json.loads(asked), dict) else None
    except (ValueError, RecursionError):
        return None


def require_named(asked: str | None, text: str, source: Path) -> None:
    """Refuse what was asked for of a mechanism or system of the user's own, which its request does not name.

    Raises:
        InputError: it is of one.
    """
    scene = json.loads(asked or "{}").get("scene")
    own = [what for what in ("mechanism", "system") if isinstance(scene, dict) and what in scene]
    if own and "mechanism" not in parse_toml(text, source):
        told = f"is of the {own[0]} {shown(scene[own[0]])}, which the file does not hold"
        raise InputError(f"{source}: {told}; give --mechanism FILE.py:NAME")


def _flat(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping) and value:
        for key, part in value.items():
            yield from _flat(part, f"{name}.{key}" if name else str(key))
    else:
        yield name, value


class RefusedScanError(InputError):
    """A scan refuses its scene, as it would again."""


@dataclass(frozen=True)
class TiledSection:
    """A section: its name, its scan, the scene with the scan's changes and the identity of the request."""

    name: str
    scan: Scan = field(compare=False)
    scene: Scene = field(compare=False)
    identity: str  #: 32 hexadecimal digits: the digest of `asked_for`

    @property
    def tiling(self) -> Tiling:
        """How the section is divided; found once in a process."""
        return _tiling(self)

    def compute(self, index: int, context: RunContext, share: float = 1.0) -> Tile:
        """Compute a tile; ``share`` of the machine is its own, for the account of the wall time.

        Raises:
            InputError: the scan refuses.
        """
        started = time.perf_counter()
        try:
            dataset = self.tiling.compute(index, context)
        except RefusedScanError:
            raise
        except InputError as error:
            raise RefusedScanError(f"scan.{self.name}: {error}") from None
        seconds = (time.perf_counter() - started) * share
        return Tile(TileHead(self.identity, self.name, index, round(seconds, 4)), dataset_image(dataset))


@lru_cache(maxsize=64)
def _tiling(section: TiledSection) -> Tiling:
    try:
        return section.scan.tiling(section.scene)
    except InputError as error:
        raise RefusedScanError(f"scan.{section.name}: {error}") from None


def sections_of(request: Request) -> list[TiledSection]:
    """The sections of a request, in its order."""
    identity = hashlib.blake2b(asked_for(request).encode(), digest_size=16).hexdigest()
    return [
        TiledSection(name, scan, request.scene_of(name), identity) for name, scan in request.scans.items()
    ]


#: Bytes of streamed variables up to which a section is made in memory.
IN_MEMORY_BYTES = 64 << 20


def assembled(
    section: TiledSection, tile: Tiles, seconds: float, notes: Mapping[str, str] | None = None
) -> Dataset | Stream:
    """A section of its tiles, which took so many seconds, with the attributes that every section has.

    Raises:
        DamagedTileError: a tile is damaged.
        RefusedScanError: the tiles make no section.
    """
    tiling = section.tiling
    try:
        result = tiling.assemble(tile)
    except DamagedTileError:
        raise
    except InputError as error:
        raise RefusedScanError(f"scan.{section.name}: {error}") from None
    if isinstance(result, Stream) and result.nbytes <= IN_MEMORY_BYTES:
        result = in_memory(result)
    changes = {f"{CHANGE}{key}": float(value) for key, value in section.scan.scene.items()}
    own = {"kind": section.scan.kind, **changes, **(notes or {})}
    told = section.scan.step_warning(section.scene)
    if told is not None:
        own["step_warning"] = told
    dataset = result.fixed if isinstance(result, Stream) else result
    dataset = replace(dataset, attrs={**own, **dataset.attrs, "wall_time_s": seconds})
    return replace(result, fixed=dataset) if isinstance(result, Stream) else dataset
