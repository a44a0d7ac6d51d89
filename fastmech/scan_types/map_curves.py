"""The curves of an equilibrium map as variables: folds, cusps and vanishing damping, point after point."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.damping import trace_unreached
from fastmech.atlas.fold_points import find_folds
from fastmech.atlas.folds import trace_folds
from fastmech.results import Variable, flags
from fastmech.scene import Scene
from fastmech.stability.modes import SIN_PHI, SIN_PSI, UNLOADED

Floats = NDArray[np.float64]

#: Values of an axis that seed the vanishing-damping curves.
SEED_VALUES = 151

#: What is told of folds of which none can be missing.
COMPLETE = "complete"

#: Dimension of what is told of all curves together.
TALLY = "total_unexplained_and_unfinished"


class Merging(IntEnum):
    """What merges with a saddle on a fold."""

    MINIMUM = 0
    MAXIMUM = 1


class Kind(IntEnum):
    """What happens on a fold."""

    FOLD = 0
    PITCHFORK = 1
    CUSP = 2
    TRANSCRITICAL = 3


class Vanishing(IntEnum):
    """What vanishes where the damper misses a mode."""

    SIN_PHI = 0
    SIN_PHI_THETA = 1
    UNLOADED_ROD = 2


_VANISHING = {SIN_PHI: Vanishing.SIN_PHI, SIN_PSI: Vanishing.SIN_PHI_THETA, UNLOADED: Vanishing.UNLOADED_ROD}


def curve_variables(scene: Scene, axes: dict[str, Floats], threads: int | None) -> dict[str, Variable]:
    """Folds over one parameter, curves over two; nothing over three or where values turn back."""
    steps = [np.diff(values) for values in axes.values()]
    if "alpha" in axes or not all(d.size and ((d > 0.0).all() or (d < 0.0).all()) for d in steps):
        return {}
    if len(axes) == 1:
        return _fold_points(scene, axes)
    if len(axes) == 2:
        x, y = axes.items()
        return _fold_curves(scene, x, y) | _unreached_curves(scene, x, y, threads)
    return {}


def _fold_points(scene: Scene, axes: dict[str, Floats]) -> dict[str, Variable]:
    ((name, values),) = axes.items()
    unit = scene.described()[name][1]
    found = find_folds(scene, name, values)
    each = ("fold",)
    return {
        f"fold_{name}": _numbers(each, [f.value for f in found], unit, f"{name} at the fold"),
        "fold_phi": _numbers(each, [f.phi for f in found], "rad", "phi where two equilibria merge"),
        "fold_theta": _numbers(each, [f.theta for f in found], "rad", "theta where two equilibria merge"),
        "fold_merges": _codes(
            each, [Merging[f.merges.upper()] for f in found], "merges with a saddle", Merging
        ),
        "fold_kind": _codes(each, [Kind[f.kind.upper()] for f in found], "kind of the fold", Kind),
        "fold_proof": _proof(found.reason),
    }


def _fold_curves(scene: Scene, x: tuple[str, Floats], y: tuple[str, Floats]) -> dict[str, Variable]:
    found = trace_folds(scene, x, y)
    curves = found.curves
    units = [scene.described()[name][1] for name, _ in (x, y)]
    each, cusp = ("fold_point",), ("cusp",)
    variables = {
        f"fold_{x[0]}": _joined(each, [c.x for c in curves], units[0], f"{x[0]} along the fold curves"),
        f"fold_{y[0]}": _joined(each, [c.y for c in curves], units[1], f"{y[0]} along the fold curves"),
        "fold_phi": _joined(each, [c.phi for c in curves], "rad", "phi where two equilibria merge"),
        "fold_theta": _joined(each, [c.theta for c in curves], "rad", "theta where two equilibria merge"),
        "fold_curve": _numbering(each, [c.x.size for c in curves], "number of the fold curve"),
        "fold_merges": _codes(
            each,
            [m for c in curves for m in [Merging[c.merges.upper()]] * c.x.size],
            "merges with a saddle",
            Merging,
        ),
        "fold_kind": _codes(
            each, [k for c in curves for k in [Kind[c.kind.upper()]] * c.x.size], "kind of the curve", Kind
        ),
        "fold_proof": _proof(found.reason),
        f"cusp_{x[0]}": _numbers(cusp, [c.x for c in found.cusps], units[0], f"{x[0]} at the cusp"),
        f"cusp_{y[0]}": _numbers(cusp, [c.y for c in found.cusps], units[1], f"{y[0]} at the cusp"),
        "cusp_phi": _numbers(cusp, [c.phi for c in found.cusps], "rad", "phi where three equilibria merge"),
        "cusp_theta": _numbers(cusp, [c.theta for c in found.cusps], "rad", "theta where three merge"),
    }
    about = "edges between whose ends the count changes, those that no fold curve crosses, curves cut short"
    counts = np.array([found.crossings, found.unexplained, found.unfinished])
    variables["fold_crossings"] = Variable((TALLY,), counts, "1", about)
    return variables


def _unreached_curves(
    scene: Scene, x: tuple[str, Floats], y: tuple[str, Floats], threads: int | None
) -> dict[str, Variable]:
    thin = [
        (name, np.linspace(values[0], values[-1], min(values.size, SEED_VALUES))) for name, values in (x, y)
    ]
    found = trace_unreached(scene, *thin, threads=threads)
    curves, sheets = found.curves, found.everywhere
    one = ("unreached_sheet",)
    told = "of one of the points of a sheet on which the damper misses a mode everywhere"
    units = [scene.described()[name][1] for name, _ in (x, y)]
    each = ("unreached_point",)
    what = "where the damper misses a mode"
    return {
        f"unreached_{x[0]}": _joined(each, [c.x for c in curves], units[0], f"{x[0]} {what}"),
        f"unreached_{y[0]}": _joined(each, [c.y for c in curves], units[1], f"{y[0]} {what}"),
        "unreached_phi": _joined(each, [c.phi for c in curves], "rad", f"phi {what}"),
        "unreached_theta": _joined(each, [c.theta for c in curves], "rad", f"theta {what}"),
        "unreached_curve": _numbering(each, [c.x.size for c in curves], "number of the curve"),
        "unreached_vanishes": _codes(
            each,
            [v for c in curves for v in [_VANISHING[c.vanishes]] * c.x.size],
            "what vanishes there",
            Vanishing,
        ),
        f"unreached_sheet_{x[0]}": _numbers(one, [s.x for s in sheets], units[0], f"{x[0]} {told}"),
        f"unreached_sheet_{y[0]}": _numbers(one, [s.y for s in sheets], units[1], f"{y[0]} {told}"),
        "unreached_sheet_phi": _numbers(one, [s.phi for s in sheets], "rad", f"phi {told}"),
        "unreached_sheet_theta": _numbers(one, [s.theta for s in sheets], "rad", f"theta {told}"),
        "unreached_sheet_share": _numbers(
            one, [s.share for s in sheets], "1", "share of the map's points at which that sheet has it"
        ),
        "unreached_sheet_vanishes": _codes(
            one, [_VANISHING[s.vanishes] for s in sheets], "what vanishes all over the sheet", Vanishing
        ),
        "unreached_crossings": Variable(
            (TALLY,),
            np.array([found.crossings, found.unexplained, found.unfinished]),
            "1",
            "edges of the seeding grid that such a curve crosses, those without a curve, curves cut short",
        ),
    }


def _proof(reason: str) -> Variable:
    words = np.array([reason or COMPLETE], dtype=object)
    return Variable(("statement",), words, "1", "whether it is proved that no other fold is in the map")


def _numbers(dims: tuple[str, ...], values: Sequence[float], unit: str, about: str) -> Variable:
    return Variable(dims, np.array(values, dtype=np.float64), unit, about)


def _joined(dims: tuple[str, ...], pieces: Sequence[Floats], unit: str, about: str) -> Variable:
    return Variable(dims, np.concatenate([np.zeros(0), *pieces]), unit, about)


def _numbering(dims: tuple[str, ...], sizes: Sequence[int], about: str) -> Variable:
    return Variable(dims, np.repeat(np.arange(len(sizes), dtype=np.int32), sizes), "1", about)


def _codes(dims: tuple[str, ...], codes: Sequence[Any], about: str, members: type[IntEnum]) -> Variable:
    return Variable(dims, np.array(codes, dtype=np.int8), "1", about, flags(members))
