"""High-throughput stability explorer for a constrained mechanism.

``import fastmech as fm`` is cheap: a public name loads what it needs when it is first used.
"""

from __future__ import annotations

from importlib import import_module, metadata
from typing import TYPE_CHECKING, Any

from fastmech import kernel_cache as _kernel_cache  # noqa: F401  first: it notes what the sources are

if TYPE_CHECKING:
    from fastmech import loads as loads
    from fastmech import mechanisms as mechanisms
    from fastmech import samplers as samplers
    from fastmech.atlas.critical import critical_values
    from fastmech.atlas.critical_curves import critical_curves
    from fastmech.atlas.folds import find_folds, trace_folds
    from fastmech.atlas.map import map_equilibria
    from fastmech.atlas.snap import find_snap
    from fastmech.attractors.branches import frequency_response
    from fastmech.attractors.find import find_attractors
    from fastmech.attractors.follow import follow_basins, tipping_probabilities
    from fastmech.basins.copies import copy_labels, copy_of_label
    from fastmech.basins.disturbed import disturb
    from fastmech.basins.edge import saddle_at, track_edge
    from fastmech.basins.erosion import erosion
    from fastmech.basins.label import labels_of
    from fastmech.basins.map import map_basins
    from fastmech.basins.measures.entropy import basin_entropy, fractal_boundary_test
    from fastmech.basins.measures.fractions import (
        basin_fractions,
        basin_stability,
        finite_time_basin_stability,
        wilson,
    )
    from fastmech.basins.measures.integrity import integrity
    from fastmech.basins.measures.labels import number_turns
    from fastmech.basins.measures.norm import kinetic_norm
    from fastmech.basins.measures.slopes import boundary_dimension, uncertainty_exponent
    from fastmech.basins.measures.wada import wada_merge_test
    from fastmech.basins.shock import brute_force_shock, minimal_shock
    from fastmech.basins.shock_limit import impulse_start, shock_limit
    from fastmech.basins.snapping import critical_forces, map_snapping
    from fastmech.bench.frontier import work_precision
    from fastmech.capture.barriers import barrier_tree
    from fastmech.capture.select import trapped
    from fastmech.disturbance.motion import disturbed_motion, linear_range
    from fastmech.ensembles.integrate import integrate
    from fastmech.ensembles.status import Status
    from fastmech.ensembles.system import System
    from fastmech.errors import InputError
    from fastmech.kernels.sincos import cos, sin
    from fastmech.mechanism.geometry import reactions
    from fastmech.models.coordinates import angles, lengths
    from fastmech.models.elements import (
        Body,
        Damper,
        Force,
        Spring,
        Torque,
        TorsionDamper,
        TorsionSpring,
    )
    from fastmech.models.equilibria import find_equilibria
    from fastmech.models.mechanism import Mechanism
    from fastmech.models.stability import classify
    from fastmech.plots.animation import animate
    from fastmech.scene import Scene
    from fastmech.step_limits.predict import largest_stable_step
    from fastmech.step_limits.warning import step_warning
    from fastmech.store.read import open_results
    from fastmech.system_info import system_info
    from fastmech.transients.lyapunov import largest_lyapunov, transient_growth

try:
    __version__ = metadata.version("fastmech")
except metadata.PackageNotFoundError:  # run from its sources, not installed
    __version__ = "unknown"

_MODULES = {
    "Body": "fastmech.models.elements",
    "Damper": "fastmech.models.elements",
    "Force": "fastmech.models.elements",
    "InputError": "fastmech.errors",
    "Mechanism": "fastmech.models.mechanism",
    "Scene": "fastmech.scene",
    "Spring": "fastmech.models.elements",
    "Status": "fastmech.ensembles.status",
    "StepWarning": "fastmech.errors",
    "System": "fastmech.ensembles.system",
    "Torque": "fastmech.models.elements",
    "TorsionDamper": "fastmech.models.elements",
    "TorsionSpring": "fastmech.models.elements",
    "animate": "fastmech.plots.animation",
    "angles": "fastmech.models.coordinates",
    "barrier_tree": "fastmech.capture.barriers",
    "basin_entropy": "fastmech.basins.measures.entropy",
    "basin_fractions": "fastmech.basins.measures.fractions",
    "basin_stability": "fastmech.basins.measures.fractions",
    "boundary_dimension": "fastmech.basins.measures.slopes",
    "brute_force_shock": "fastmech.basins.shock",
    "classify": "fastmech.models.stability",
    "copy_labels": "fastmech.basins.copies",
    "copy_of_label": "fastmech.basins.copies",
    "cos": "fastmech.kernels.sincos",
    "critical_curves": "fastmech.atlas.critical_curves",
    "critical_forces": "fastmech.basins.snapping",
    "critical_values": "fastmech.atlas.critical",
    "disturb": "fastmech.basins.disturbed",
    "disturbed_motion": "fastmech.disturbance.motion",
    "erosion": "fastmech.basins.erosion",
    "find_attractors": "fastmech.attractors.find",
    "find_equilibria": "fastmech.models.equilibria",
    "find_folds": "fastmech.atlas.folds",
    "follow_basins": "fastmech.attractors.follow",
    "find_snap": "fastmech.atlas.snap",
    "finite_time_basin_stability": "fastmech.basins.measures.fractions",
    "frequency_response": "fastmech.attractors.branches",
    "fractal_boundary_test": "fastmech.basins.measures.entropy",
    "impulse_start": "fastmech.basins.shock_limit",
    "integrate": "fastmech.ensembles.integrate",
    "integrity": "fastmech.basins.measures.integrity",
    "kinetic_norm": "fastmech.basins.measures.norm",
    "labels_of": "fastmech.basins.label",
    "largest_lyapunov": "fastmech.transients.lyapunov",
    "largest_stable_step": "fastmech.step_limits.predict",
    "lengths": "fastmech.models.coordinates",
    "linear_range": "fastmech.disturbance.motion",
    "map_basins": "fastmech.basins.map",
    "map_equilibria": "fastmech.atlas.map",
    "map_snapping": "fastmech.basins.snapping",
    "minimal_shock": "fastmech.basins.shock",
    "number_turns": "fastmech.basins.measures.labels",
    "open_results": "fastmech.store.read",
    "reactions": "fastmech.mechanism.geometry",
    "saddle_at": "fastmech.basins.edge",
    "shock_limit": "fastmech.basins.shock_limit",
    "sin": "fastmech.kernels.sincos",
    "step_warning": "fastmech.step_limits.warning",
    "tipping_probabilities": "fastmech.attractors.follow",
    "system_info": "fastmech.system_info",
    "trace_folds": "fastmech.atlas.folds",
    "trace_unreached": "fastmech.atlas.damping",
    "track_edge": "fastmech.basins.edge",
    "transient_growth": "fastmech.transients.lyapunov",
    "trapped": "fastmech.capture.select",
    "uncertainty_exponent": "fastmech.basins.measures.slopes",
    "wada_merge_test": "fastmech.basins.measures.wada",
    "wilson": "fastmech.basins.measures.fractions",
    "work_precision": "fastmech.bench.frontier",
}

__all__ = [
    "Body",
    "Damper",
    "Force",
    "InputError",
    "Mechanism",
    "Scene",
    "Spring",
    "Status",
    "StepWarning",
    "System",
    "Torque",
    "TorsionDamper",
    "TorsionSpring",
    "angles",
    "animate",
    "barrier_tree",
    "basin_entropy",
    "basin_fractions",
    "basin_stability",
    "boundary_dimension",
    "brute_force_shock",
    "classify",
    "copy_labels",
    "copy_of_label",
    "cos",
    "critical_curves",
    "critical_forces",
    "critical_values",
    "disturb",
    "disturbed_motion",
    "erosion",
    "find_attractors",
    "find_equilibria",
    "find_folds",
    "find_snap",
    "finite_time_basin_stability",
    "follow_basins",
    "fractal_boundary_test",
    "frequency_response",
    "impulse_start",
    "integrate",
    "integrity",
    "kinetic_norm",
    "labels_of",
    "largest_lyapunov",
    "largest_stable_step",
    "lengths",
    "linear_range",
    "map_basins",
    "map_equilibria",
    "map_snapping",
    "minimal_shock",
    "number_turns",
    "open_results",
    "reactions",
    "saddle_at",
    "shock_limit",
    "sin",
    "step_warning",
    "system_info",
    "tipping_probabilities",
    "trace_folds",
    "trace_unreached",
    "track_edge",
    "transient_growth",
    "trapped",
    "uncertainty_exponent",
    "wada_merge_test",
    "wilson",
    "work_precision",
]


def __getattr__(name: str) -> Any:
    if name in ("loads", "mechanisms", "samplers"):
        return import_module(f"fastmech.{name}")
    if name not in _MODULES:
        raise AttributeError(f"module 'fastmech' has no attribute {name!r}")
    value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
