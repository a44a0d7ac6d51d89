"""What decides the bits of a result: the request with all defaults, the sources and the libraries beneath."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from fastmech.errors import shown_name
from fastmech.kernel_cache import COMPILED, PACKAGE, source_hash
from fastmech.models.mechanism import Mechanism
from fastmech.scan_types.request import Request
from fastmech.scene import Scene
from fastmech.store.read import open_results

#: Raised when finished tiles of an older version can no longer be assembled.
TILE_SCHEMA = 1

#: Sources besides the compiled ones that decide a section's values.
_SOURCES = (
    *COMPILED,
    "mechanisms",
    "samplers.py",
    "attractors",
    "basins",
    "scene.py",
    "results.py",
    "scan_types",
)

_LIBRARIES = ("numba", "llvmlite", "numpy", "scipy", "sympy")

_MOST_TOLD = 3


@cache
def code_in_use() -> dict[str, str]:
    """The sources and the versions of the libraries that compute values here."""
    places = [PACKAGE / name for name in _SOURCES]
    files = sorted(f for place in places for f in ([place] if place.is_file() else place.rglob("*.py")))
    return {
        "fastmech's sources": source_hash(files),
        **{name: metadata.version(name) for name in _LIBRARIES},
    }


def asked_for(request: Request) -> str:
    """Everything that decides the values of a result, as canonical JSON."""
    scans = {
        name: {"kind": scan.kind, **scan.model_dump(mode="json")} for name, scan in request.scans.items()
    }
    content = {
        "tile schema": TILE_SCHEMA,
        "code": code_in_use(),
        "scene": _told(request.scene),
        "scan": scans,
    }
    return json.dumps(content, sort_keys=True)


def _told(scene: Scene | Mechanism) -> dict[str, Any]:
    """What tells a scene or a mechanism apart."""
    if isinstance(scene, Scene):
        return scene.model_dump(mode="json")
    ranges = {str(c.symbol): [c.low, c.high, c.periodic] for c in scene.coordinates}
    return {"mechanism": scene.name, "equations": scene.prints, "ranges": ranges, **scene.parameters}


def identity_of(asked: str) -> str:
    """Digest of `asked_for`: 32 hexadecimal digits."""
    return hashlib.blake2b(asked.encode(), digest_size=16).hexdigest()


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


def _flat(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping) and value:
        for key, part in value.items():
            yield from _flat(part, f"{name}.{key}" if name else str(key))
    else:
        yield name, value
