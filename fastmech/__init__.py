"""High-throughput stability explorer for mechanisms: where they rest, what they survive, how they move.

``import fastmech as fm`` is cheap: a public name loads what it needs when it is first used.

The device and its loads:
    Scene, Mechanism, System, Body, Spring, TorsionSpring, Damper, TorsionDamper, Force, Torque,
    angles, lengths, sin, cos

Where it rests, and when that ends:
    find_equilibria, classify, find_snap, find_folds, trace_folds, map_equilibria, critical_values,
    critical_curves, trace_undamped, barrier_tree, reactions

How it moves:
    integrate, disturbed_motion, disturb, linear_range, transient_growth, largest_lyapunov, animate,
    work_precision, step_warning, largest_stable_step, memory

Which shock it survives:
    shock_limit, impulse_start, minimal_shock, brute_force_shock, map_snapping, critical_forces,
    kinetic_norm, nearest_saddle, track_edge

Where motions end:
    map_basins, label_starts, trapped, erosion, find_attractors, frequency_response, follow_basins,
    periodic_orbits, group_by_features, tipping_probabilities, well_numbers, well_of_number

What a map of basins tells:
    basin_fractions, basin_stability, finite_time_basin_stability, wilson, integrity, basin_entropy,
    fractal_boundary_test, boundary_dimension, uncertainty_exponent, wada_merge_test, number_turns

Files, reports and this installation:
    open_results, report, system_info, Status, InputError, StepWarning

What functions return:
    Attractor, Attractors, BarrierTree, BasinFractions, BasinMap, BasinsAlong, BasinsOver, Captured,
    Classification, CriticalCurves, CriticalValues, DisturbedEnsemble, DisturbedMotion, EdgeTrack,
    Equilibria, Equilibrium, EquilibriumMap, ErosionProfile, FoldPoints, FoldSet, FrequencyResponse,
    Labels, LinearRange, LyapunovExponents, RestingMap, RestingPlace, RestingPlaces, Results, Shares,
    Shock, ShockLimit, Snap, SnappingMap, Stability, Trajectories, UndampedSet, WorkPrecision

Modules: ``fm.loads`` (forces over time), ``fm.mechanisms`` (shipped ones), ``fm.samplers`` (starts).
"""

from __future__ import annotations

from importlib import import_module, metadata
from typing import TYPE_CHECKING, Any

from fastmech import kernel_cache as _kernel_cache  # noqa: F401  first: it notes what the sources are

if TYPE_CHECKING:
    from fastmech import loads as loads
    from fastmech import mechanisms as mechanisms
    from fastmech import samplers as samplers
    from fastmech.atlas.critical import CriticalValues, critical_values
    from fastmech.atlas.critical_curves import CriticalCurves, critical_curves
    from fastmech.atlas.resting_map import RestingMap
    from fastmech.atlas.snap import Snap, find_snap
    from fastmech.attractors.branches import FrequencyResponse, frequency_response
    from fastmech.attractors.features import group_by_features
    from fastmech.attractors.find import Attractor, Attractors, find_attractors
    from fastmech.attractors.follow import BasinsAlong, BasinsOver, follow_basins, tipping_probabilities
    from fastmech.attractors.periodic import periodic_orbits
    from fastmech.basins.disturbed import DisturbedEnsemble, disturb
    from fastmech.basins.edge import EdgeTrack, nearest_saddle, track_edge
    from fastmech.basins.erosion import ErosionProfile, erosion
    from fastmech.basins.label import label_starts
    from fastmech.basins.labels import Labels
    from fastmech.basins.map import BasinMap, map_basins
    from fastmech.basins.measures.entropy import basin_entropy, fractal_boundary_test
    from fastmech.basins.measures.fractions import (
        BasinFractions,
        Shares,
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
    from fastmech.basins.shock import Shock, brute_force_shock, minimal_shock
    from fastmech.basins.shock_limit import ShockLimit, impulse_start, shock_limit
    from fastmech.basins.snapping import SnappingMap, critical_forces, map_snapping
    from fastmech.basins.well_numbers import well_numbers, well_of_number
    from fastmech.capture.certificate import Captured
    from fastmech.capture.select import barrier_tree, trapped
    from fastmech.device_report import report
    from fastmech.disturbance.motion import DisturbedMotion, LinearRange, disturbed_motion, linear_range
    from fastmech.ensembles.integrate import Trajectories, integrate, memory
    from fastmech.ensembles.status import Status
    from fastmech.ensembles.system import System
    from fastmech.errors import InputError, StepWarning
    from fastmech.frontier import WorkPrecision, work_precision
    from fastmech.kernels.sincos import cos, sin
    from fastmech.models.coordinates import angles, lengths
    from fastmech.models.elements import Body, Damper, Force, Spring, Torque, TorsionDamper, TorsionSpring
    from fastmech.models.equilibria import RestingPlace, RestingPlaces, find_equilibria
    from fastmech.models.mechanism import Mechanism
    from fastmech.models.stability import Stability, classify
    from fastmech.plots.animation import animate
    from fastmech.scene import Scene
    from fastmech.slider.atlas.damping import UndampedSet, trace_undamped
    from fastmech.slider.atlas.folds import FoldPoints, FoldSet, find_folds, trace_folds
    from fastmech.slider.atlas.map import EquilibriumMap, map_equilibria
    from fastmech.slider.capture.certificate import BarrierTree
    from fastmech.slider.equilibria import Equilibria, Equilibrium
    from fastmech.slider.geometry import reactions
    from fastmech.slider.stability import Classification
    from fastmech.step_limits.warning import largest_stable_step, step_warning
    from fastmech.store.read import Results, open_results
    from fastmech.system_info import system_info
    from fastmech.transients.lyapunov import LyapunovExponents, largest_lyapunov, transient_growth

try:
    __version__ = metadata.version("fastmech")
except metadata.PackageNotFoundError:  # run from its sources, not installed
    __version__ = "unknown"

#: Public names by the module that they come from.
_NAMES = {
    "atlas.critical": "CriticalValues critical_values",
    "atlas.critical_curves": "CriticalCurves critical_curves",
    "slider.atlas.damping": "UndampedSet trace_undamped",
    "slider.atlas.folds": "FoldPoints FoldSet find_folds trace_folds",
    "slider.atlas.map": "EquilibriumMap map_equilibria",
    "atlas.resting_map": "RestingMap",
    "atlas.snap": "Snap find_snap",
    "attractors.branches": "FrequencyResponse frequency_response",
    "attractors.features": "group_by_features",
    "attractors.find": "Attractor Attractors find_attractors",
    "attractors.follow": "BasinsAlong BasinsOver follow_basins tipping_probabilities",
    "attractors.periodic": "periodic_orbits",
    "basins.disturbed": "DisturbedEnsemble disturb",
    "basins.edge": "EdgeTrack nearest_saddle track_edge",
    "basins.erosion": "ErosionProfile erosion",
    "basins.label": "label_starts",
    "basins.labels": "Labels",
    "basins.map": "BasinMap map_basins",
    "basins.measures.entropy": "basin_entropy fractal_boundary_test",
    "basins.measures.fractions": "BasinFractions Shares basin_fractions basin_stability "
    "finite_time_basin_stability wilson",
    "basins.measures.integrity": "integrity",
    "basins.measures.labels": "number_turns",
    "basins.measures.norm": "kinetic_norm",
    "basins.measures.slopes": "boundary_dimension uncertainty_exponent",
    "basins.measures.wada": "wada_merge_test",
    "basins.shock": "Shock brute_force_shock minimal_shock",
    "basins.shock_limit": "ShockLimit impulse_start shock_limit",
    "basins.snapping": "SnappingMap critical_forces map_snapping",
    "basins.well_numbers": "well_numbers well_of_number",
    "frontier": "WorkPrecision work_precision",
    "slider.capture.certificate": "BarrierTree",
    "capture.certificate": "Captured",
    "capture.select": "barrier_tree trapped",
    "device_report": "report",
    "disturbance.motion": "DisturbedMotion LinearRange disturbed_motion linear_range",
    "ensembles.integrate": "Trajectories integrate memory",
    "ensembles.status": "Status",
    "ensembles.system": "System",
    "slider.equilibria": "Equilibria Equilibrium",
    "errors": "InputError StepWarning",
    "kernels.sincos": "cos sin",
    "slider.geometry": "reactions",
    "models.coordinates": "angles lengths",
    "models.elements": "Body Damper Force Spring Torque TorsionDamper TorsionSpring",
    "models.equilibria": "RestingPlace RestingPlaces find_equilibria",
    "models.mechanism": "Mechanism",
    "models.stability": "Stability classify",
    "plots.animation": "animate",
    "scene": "Scene",
    "slider.stability": "Classification",
    "step_limits.warning": "largest_stable_step step_warning",
    "store.read": "Results open_results",
    "system_info": "system_info",
    "transients.lyapunov": "LyapunovExponents largest_lyapunov transient_growth",
}
_MODULES = {name: f"fastmech.{module}" for module, names in _NAMES.items() for name in names.split()}
_PARTS = ("loads", "mechanisms", "samplers")

__all__ = [
    "Attractor", "Attractors", "BarrierTree", "BasinFractions", "BasinMap", "BasinsAlong", "BasinsOver",
    "Body", "Captured", "Classification",
    "CriticalCurves", "CriticalValues", "Damper", "DisturbedEnsemble", "DisturbedMotion", "EdgeTrack",
    "Equilibria", "Equilibrium", "EquilibriumMap", "ErosionProfile", "FoldPoints", "FoldSet", "Force",
    "FrequencyResponse", "InputError", "Labels", "LinearRange", "LyapunovExponents", "Mechanism",
    "RestingMap", "RestingPlace", "RestingPlaces", "Results", "Scene", "Shares", "Shock", "ShockLimit",
    "Snap", "SnappingMap", "Spring", "Stability", "Status", "StepWarning", "System", "Torque",
    "TorsionDamper", "TorsionSpring", "Trajectories", "UndampedSet", "WorkPrecision", "angles", "animate",
    "barrier_tree", "basin_entropy", "basin_fractions", "basin_stability", "boundary_dimension",
    "brute_force_shock", "classify", "cos", "critical_curves", "critical_forces", "critical_values",
    "disturb", "disturbed_motion", "erosion", "find_attractors", "find_equilibria", "find_folds",
    "find_snap", "finite_time_basin_stability", "follow_basins", "fractal_boundary_test",
    "frequency_response", "group_by_features", "impulse_start", "integrate", "integrity", "kinetic_norm",
    "label_starts", "largest_lyapunov", "largest_stable_step", "lengths", "linear_range", "map_basins",
    "map_equilibria", "map_snapping", "memory", "minimal_shock", "nearest_saddle", "number_turns",
    "open_results", "periodic_orbits", "reactions", "report", "shock_limit", "sin", "step_warning",
    "system_info", "tipping_probabilities", "trace_folds", "trace_undamped", "track_edge",
    "transient_growth", "trapped", "uncertainty_exponent", "wada_merge_test", "well_numbers",
    "well_of_number", "wilson", "work_precision",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name in _PARTS:
        return import_module(f"fastmech.{name}")
    if name not in _MODULES:
        raise AttributeError(f"module 'fastmech' has no attribute {name!r}")
    value = getattr(import_module(_MODULES[name]), name)
    if not isinstance(value, type):
        from fastmech.objects import tell_result

        tell_result(value)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, *_PARTS, "__version__"])
