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
    Attractor, Attractors, BarrierTree, BasinEntropy, BasinFractions, BasinMap, BasinsAlong,
    BasinsOver, BoundaryDimension, Captured, Certificate, Classification, CriticalCurves,
    CriticalValues, DisturbedEnsemble, DisturbedMotion, EdgeTrack, Energies, Equilibria, Equilibrium,
    EquilibriumMap, ErosionProfile, FeatureGroups, FoldPoints, FoldSet, FractalTest,
    FrequencyResponse, Integrity, Labels, LinearRange, LyapunovExponents, PeriodicOrbits, Place,
    Proof, ProvedWells, Reactions, RestingMap, RestingPlace, RestingPlaces, Results, Shares, Shock,
    ShockLimit, Snap, SnappingMap, Stability, Trajectories, TransientGrowth, UncertaintyExponent,
    UndampedSet, WadaTest, WellNumbers, WorkPrecision

Modules: ``fm.loads`` (forces over time), ``fm.mechanisms`` (shipped ones), ``fm.samplers`` (starts).
"""

from __future__ import annotations

from functools import cache
from importlib import import_module, metadata
from pathlib import Path
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
    from fastmech.attractors.features import FeatureGroups, group_by_features
    from fastmech.attractors.find import Attractor, Attractors, find_attractors
    from fastmech.attractors.follow import BasinsAlong, BasinsOver, follow_basins, tipping_probabilities
    from fastmech.attractors.periodic import PeriodicOrbits, periodic_orbits
    from fastmech.basins.disturbed import DisturbedEnsemble, disturb
    from fastmech.basins.edge import EdgeTrack, nearest_saddle, track_edge
    from fastmech.basins.erosion import ErosionProfile, erosion
    from fastmech.basins.label import Labels, WellNumbers, label_starts, well_numbers, well_of_number
    from fastmech.basins.map import BasinMap, map_basins
    from fastmech.basins.measures.entropy import (
        BasinEntropy,
        FractalTest,
        basin_entropy,
        fractal_boundary_test,
    )
    from fastmech.basins.measures.fractions import (
        BasinFractions,
        Shares,
        basin_fractions,
        basin_stability,
        finite_time_basin_stability,
        wilson,
    )
    from fastmech.basins.measures.integrity import Integrity, integrity
    from fastmech.basins.measures.labels import number_turns
    from fastmech.basins.measures.slopes import (
        BoundaryDimension,
        UncertaintyExponent,
        boundary_dimension,
        uncertainty_exponent,
    )
    from fastmech.basins.measures.wada import WadaTest, wada_merge_test
    from fastmech.basins.shock import Shock, brute_force_shock, minimal_shock
    from fastmech.basins.shock_limit import ShockLimit, impulse_start, shock_limit
    from fastmech.basins.snapping import SnappingMap, critical_forces, map_snapping
    from fastmech.capture.certificate import Captured
    from fastmech.capture.select import barrier_tree, trapped
    from fastmech.capture.wells import ProvedWells
    from fastmech.device_report import report
    from fastmech.disturbance.motion import (
        DisturbedMotion,
        LinearRange,
        disturbed_motion,
        kinetic_norm,
        linear_range,
    )
    from fastmech.ensembles.integrate import Trajectories, integrate, memory
    from fastmech.ensembles.status import Status
    from fastmech.ensembles.system import System
    from fastmech.errors import InputError, StepWarning
    from fastmech.frontier import WorkPrecision, work_precision
    from fastmech.kernels.sincos import cos, sin
    from fastmech.models.coordinates import angles, lengths
    from fastmech.models.elements import Body, Damper, Force, Spring, Torque, TorsionDamper, TorsionSpring
    from fastmech.models.equilibria import Place, Proof, RestingPlace, RestingPlaces, find_equilibria
    from fastmech.models.mechanism import Energies, Mechanism
    from fastmech.models.stability import Stability, classify
    from fastmech.plots.animation import animate
    from fastmech.scene import Scene
    from fastmech.slider.atlas.damping import UndampedSet, trace_undamped
    from fastmech.slider.atlas.folds import FoldPoints, FoldSet, find_folds, trace_folds
    from fastmech.slider.atlas.map import EquilibriumMap, map_equilibria
    from fastmech.slider.capture.certificate import BarrierTree
    from fastmech.slider.equilibria import Certificate, Equilibria, Equilibrium
    from fastmech.slider.geometry import Reactions, reactions
    from fastmech.slider.stability import Classification
    from fastmech.step_limits.warning import largest_stable_step, step_warning
    from fastmech.store.read import Results, open_results
    from fastmech.system_info import system_info
    from fastmech.transients.lyapunov import (
        LyapunovExponents,
        TransientGrowth,
        largest_lyapunov,
        transient_growth,
    )

try:
    __version__ = metadata.version("fastmech")
except metadata.PackageNotFoundError:  # run from its sources, not installed
    __version__ = "unknown"

_PARTS = ("loads", "mechanisms", "samplers")

__all__ = [
    "Attractor", "Attractors", "BarrierTree", "BasinEntropy", "BasinFractions", "BasinMap",
    "BasinsAlong", "BasinsOver", "Body", "BoundaryDimension", "Captured", "Certificate",
    "Classification", "CriticalCurves", "CriticalValues", "Damper", "DisturbedEnsemble",
    "DisturbedMotion", "EdgeTrack", "Energies", "Equilibria", "Equilibrium", "EquilibriumMap",
    "ErosionProfile", "FeatureGroups", "FoldPoints", "FoldSet", "Force", "FractalTest",
    "FrequencyResponse", "InputError", "Integrity", "Labels", "LinearRange", "LyapunovExponents",
    "Mechanism", "PeriodicOrbits", "Place", "Proof", "ProvedWells", "Reactions", "RestingMap",
    "RestingPlace", "RestingPlaces", "Results", "Scene", "Shares", "Shock", "ShockLimit", "Snap",
    "SnappingMap", "Spring", "Stability", "Status", "StepWarning", "System", "Torque", "TorsionDamper",
    "TorsionSpring", "Trajectories", "TransientGrowth", "UncertaintyExponent", "UndampedSet",
    "WadaTest", "WellNumbers", "WorkPrecision", "angles", "animate", "barrier_tree", "basin_entropy",
    "basin_fractions", "basin_stability", "boundary_dimension", "brute_force_shock", "classify", "cos",
    "critical_curves", "critical_forces", "critical_values", "disturb", "disturbed_motion", "erosion",
    "find_attractors", "find_equilibria", "find_folds", "find_snap", "finite_time_basin_stability",
    "follow_basins", "fractal_boundary_test", "frequency_response", "group_by_features",
    "impulse_start", "integrate", "integrity", "kinetic_norm", "label_starts", "largest_lyapunov",
    "largest_stable_step", "lengths", "linear_range", "map_basins", "map_equilibria", "map_snapping",
    "memory", "minimal_shock", "nearest_saddle", "number_turns", "open_results", "periodic_orbits",
    "reactions", "report", "shock_limit", "sin", "step_warning", "system_info",
    "tipping_probabilities", "trace_folds", "trace_undamped", "track_edge", "transient_growth",
    "trapped", "uncertainty_exponent", "wada_merge_test", "well_numbers", "well_of_number", "wilson",
    "work_precision",
]  # fmt: skip


@cache
def _modules() -> dict[str, str]:
    """Public names with their modules: what the imports above tell type checkers alone."""
    import ast

    (block,) = (one for one in ast.parse(Path(__file__).read_bytes()).body if isinstance(one, ast.If))
    imports = [one for one in block.body if isinstance(one, ast.ImportFrom)]
    return {alias.name: str(one.module) for one in imports for alias in one.names}


def __getattr__(name: str) -> Any:
    if name in _PARTS:
        return import_module(f"fastmech.{name}")
    if name not in _modules():
        raise AttributeError(f"module 'fastmech' has no attribute {name!r}")
    value = getattr(import_module(_modules()[name]), name)
    if not isinstance(value, type):
        from fastmech.objects import tell_result

        tell_result(value)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, *_PARTS, "__version__"])
