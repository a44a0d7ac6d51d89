"""High-throughput stability explorer for a constrained mechanism.

``import fastmech as fm`` is cheap: a public name loads what it needs when it is first used.
"""

from __future__ import annotations

from importlib import import_module, metadata
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fastmech.disturbance.ensemble import disturb
    from fastmech.ensembles.integrate import integrate
    from fastmech.equilibria.atlas import map_equilibria
    from fastmech.equilibria.find import find_equilibria
    from fastmech.errors import InputError
    from fastmech.mechanism.reactions import reactions
    from fastmech.scene import Scene
    from fastmech.stability.classify import classify
    from fastmech.store.read import open_results

__version__ = metadata.version("fastmech")

_MODULES = {
    "InputError": "fastmech.errors",
    "Scene": "fastmech.scene",
    "classify": "fastmech.stability.classify",
    "disturb": "fastmech.disturbance.ensemble",
    "find_equilibria": "fastmech.equilibria.find",
    "integrate": "fastmech.ensembles.integrate",
    "map_equilibria": "fastmech.equilibria.atlas",
    "open_results": "fastmech.store.read",
    "reactions": "fastmech.mechanism.reactions",
}

__all__ = [
    "InputError",
    "Scene",
    "classify",
    "disturb",
    "find_equilibria",
    "integrate",
    "map_equilibria",
    "open_results",
    "reactions",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'fastmech' has no attribute {name!r}")
    value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
