"""High-throughput stability explorer for a constrained mechanism.

``import fastmech as fm`` is cheap: a public name loads what it needs when it is first used.
"""

from __future__ import annotations

from importlib import import_module, metadata
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fastmech.atlas.fold_points import find_folds
    from fastmech.atlas.folds import trace_folds
    from fastmech.atlas.map import map_equilibria
    from fastmech.atlas.snap import find_snap
    from fastmech.basins.label import labels_of
    from fastmech.basins.map import map_basins
    from fastmech.basins.status import BasinStatus
    from fastmech.capture.barriers import barrier_tree
    from fastmech.capture.certificate import trapped
    from fastmech.disturbance.ensemble import disturb
    from fastmech.disturbance.linear_range import linear_range
    from fastmech.disturbance.motion import disturbed_motion
    from fastmech.disturbance.outcome import Outcome
    from fastmech.ensembles.integrate import integrate
    from fastmech.ensembles.status import Status
    from fastmech.ensembles.system import System
    from fastmech.equilibria.find import find_equilibria
    from fastmech.errors import InputError
    from fastmech.kernels.sincos import cos, sin
    from fastmech.mechanism.reactions import reactions
    from fastmech.scene import Scene
    from fastmech.stability.classify import classify
    from fastmech.step_limits.predict import largest_stable_step
    from fastmech.step_limits.warning import step_warning
    from fastmech.store.read import open_results
    from fastmech.transients.growth import transient_growth
    from fastmech.transients.lyapunov import largest_lyapunov

try:
    __version__ = metadata.version("fastmech")
except metadata.PackageNotFoundError:  # run from its sources, not installed
    __version__ = "unknown"

_MODULES = {
    "BasinStatus": "fastmech.basins.status",
    "InputError": "fastmech.errors",
    "Outcome": "fastmech.disturbance.outcome",
    "Scene": "fastmech.scene",
    "Status": "fastmech.ensembles.status",
    "StepWarning": "fastmech.errors",
    "System": "fastmech.ensembles.system",
    "barrier_tree": "fastmech.capture.barriers",
    "classify": "fastmech.stability.classify",
    "cos": "fastmech.kernels.sincos",
    "disturb": "fastmech.disturbance.ensemble",
    "disturbed_motion": "fastmech.disturbance.motion",
    "find_equilibria": "fastmech.equilibria.find",
    "find_folds": "fastmech.atlas.fold_points",
    "find_snap": "fastmech.atlas.snap",
    "integrate": "fastmech.ensembles.integrate",
    "labels_of": "fastmech.basins.label",
    "largest_lyapunov": "fastmech.transients.lyapunov",
    "largest_stable_step": "fastmech.step_limits.predict",
    "linear_range": "fastmech.disturbance.linear_range",
    "map_basins": "fastmech.basins.map",
    "map_equilibria": "fastmech.atlas.map",
    "open_results": "fastmech.store.read",
    "reactions": "fastmech.mechanism.reactions",
    "sin": "fastmech.kernels.sincos",
    "step_warning": "fastmech.step_limits.warning",
    "trace_folds": "fastmech.atlas.folds",
    "trace_unreached": "fastmech.atlas.damping",
    "transient_growth": "fastmech.transients.growth",
    "trapped": "fastmech.capture.certificate",
}

__all__ = [
    "BasinStatus",
    "InputError",
    "Outcome",
    "Scene",
    "Status",
    "StepWarning",
    "System",
    "barrier_tree",
    "classify",
    "cos",
    "disturb",
    "disturbed_motion",
    "find_equilibria",
    "find_folds",
    "find_snap",
    "integrate",
    "labels_of",
    "largest_lyapunov",
    "largest_stable_step",
    "linear_range",
    "map_basins",
    "map_equilibria",
    "open_results",
    "reactions",
    "sin",
    "step_warning",
    "trace_folds",
    "trace_unreached",
    "transient_growth",
    "trapped",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'fastmech' has no attribute {name!r}")
    value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
