"""The variables of an equilibrium map and of its curves: names, dimensions, units and meanings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.atlas.resting_map import RestingMap
from fastmech.models.drawing import Element, drawing
from fastmech.models.mechanism import Mechanism
from fastmech.outcome import Outcome
from fastmech.results import NO_CODE, Dataset, Variable, coordinate_units, flags, numbers, parts, told
from fastmech.scan_types.request import axis_variables
from fastmech.scene import Scene
from fastmech.slider.atlas.damping import UndampedSet, trace_undamped
from fastmech.slider.atlas.folds import FoldPoints, FoldSet, find_folds, trace_folds
from fastmech.slider.atlas.map import Coincidence, Slab
from fastmech.slider.impulse import POINTS
from fastmech.slider.linearize import SIN_PHI, SIN_PSI, UNLOADED
from fastmech.slider.stability import Verdict

CRITERIA = {
    "verdict_sylvester": "verdict: Lagrange-Dirichlet",
    "verdict_hurwitz": "verdict: Hurwitz",
    "verdict_eigenvalues": "verdict: eigenvalues",
    "verdict": "verdict: joint",
}


#: Entries of a Hessian and their unit.
HESSIAN = dict.fromkeys(("phi_phi", "phi_theta", "theta_theta"), "J")


def point_variables(grid: tuple[str, ...], found: Slab) -> dict[str, Variable]:
    """Everything known at every point; the arrays have the grid's dimensions ``grid`` in front."""
    roots = (*grid, "root")
    return {
        "count": Variable(grid, found.count, "1", "number of equilibria"),
        "count_stable": Variable(grid, found.count_stable, "1", "number of stable equilibria (minima)"),
        "outcome": Variable(grid, found.outcome, "1", "what is proved of the count", flags(Outcome)),
        "coincidence": Variable(
            grid, found.coincidence, "1", "what meets here within rounding", flags(Coincidence)
        ),
        "fold_margin": Variable(
            grid, found.fold_margin, "rad", "distance to the fold, positive with six equilibria"
        ),
        "phi": Variable(roots, found.phi, "rad", "angle phi"),
        "theta": Variable(roots, found.theta, "rad", "angle theta"),
        "radius": Variable(
            roots, found.radius, "rad", "the true equilibrium is proved to be within; inf: not proved"
        ),
        "energy": Variable(roots, found.energy, "J", "potential energy Pi - F x2"),
        "morse_index": Variable(
            roots,
            found.morse_index,
            "1",
            "negative eigenvalues of the Hessian, -2: Hessian singular",
            NO_CODE,
        ),
        **parts("hessian", roots, found.hessian, HESSIAN, "Hessian, paper (19): {}"),
        **eigenvalue_variables(roots, found.eigenvalues),
        **{
            name: Variable(roots, found.verdict[..., k], "1", about, flags(Verdict, fill=Verdict.NONE))
            for k, (name, about) in enumerate(CRITERIA.items())
        },
        "frequency": Variable(
            roots, found.frequency, "rad/s", "lowest undamped natural frequency, NaN: a direction grows"
        ),
        "decay_time": Variable(
            roots, found.decay_time, "s", "slowest linear mode falls to 1/e; inf: never, NaN: no minimum"
        ),
        "depth": Variable(roots, found.depth, "J", "energy from a minimum to the lowest way out of its well"),
        **{
            f"shock_limit_{on.lower()}": Variable(
                roots,
                getattr(found, f"shock_limit_{on.lower()}"),
                "N s",
                f"proved: no smaller impulse on {on} of the resting mechanism leaves the well, in whatever "
                f"direction{'; NaN: no minimum, or M3 at a dead centre' if on == 'M3' else ''}",
            )
            for on in POINTS
        },
    }


def eigenvalue_variables(dims: tuple[str, ...], values: NDArray[np.complex128]) -> dict[str, Variable]:
    """All eigenvalues of the motion, ranked by real part, each in two variables."""
    about = "eigenvalue {} of the motion by real part"
    ranks = "12345678"[: values.shape[-1]]
    real, imaginary = (dict.fromkeys(ranks, unit) for unit in ("1/s", "rad/s"))
    return parts("eigenvalue_re", dims, values.real, real, f"real part of {about}") | parts(
        "eigenvalue_im", dims, values.imag, imaginary, f"imaginary part of {about}"
    )


#: Names of what a mechanism's map knows of every point beside positions and eigenvalues.
RESTING = ("count", "count_stable", "outcome", "radius", "energy", "morse_index", "verdict", "decay_time")


def resting_variables(mechanism: Mechanism, grid: tuple[str, ...], found: RestingMap) -> dict[str, Variable]:
    """Everything known of a mechanism's equilibria at every point."""
    roots = (*grid, "root")
    units = coordinate_units(mechanism)
    eigenvalues = np.where(np.isnan(found.eigenvalues), complex(np.nan, np.nan), found.eigenvalues)
    slowest = -found.eigenvalues[..., 0].real
    falling = found.verdict == Verdict.ASYMPTOTICALLY_STABLE
    time = np.where(
        falling,
        1.0 / np.where(falling, slowest, 1.0),
        np.where(found.verdict == Verdict.STABLE, np.inf, np.nan),
    )
    stable = np.isin(found.verdict, (Verdict.ASYMPTOTICALLY_STABLE, Verdict.STABLE)).sum(axis=-1)
    return {
        "count": Variable(grid, found.count, "1", "number of equilibria"),
        "count_stable": Variable(grid, stable.astype(np.int16), "1", "number of stable equilibria"),
        "outcome": Variable(grid, found.outcome, "1", "what is proved of the count", flags(Outcome)),
        **{
            name: Variable(roots, found.position[..., k], unit, f"{about_of(unit)} {name}")
            for k, (name, unit) in enumerate(units.items())
        },
        "radius": Variable(
            roots,
            found.radius,
            one_of(units.values()),
            "by each coordinate the equilibrium is proved to be within",
        ),
        "energy": Variable(roots, found.energy, "J", "potential energy, loads at their means"),
        "morse_index": Variable(
            roots, found.morse_index, "1", "directions in which the energy falls, -2: not proved", NO_CODE
        ),
        "verdict": Variable(roots, found.verdict, "1", "stability", flags(Verdict, fill=Verdict.NONE)),
        **eigenvalue_variables(roots, eigenvalues),
        "decay_time": Variable(
            roots, time, "s", "slowest linear mode falls to 1/e; inf: never, NaN: not stable"
        ),
    }


def one_of(units: Iterable[str]) -> str:
    """The unit that all have, or none."""
    different = set(units)
    return different.pop() if len(different) == 1 else "1"


def about_of(unit: str) -> str:
    """What a coordinate of this unit is."""
    return {"rad": "angle", "m": "length"}[unit]


def drawing_group(mechanism: Mechanism, q: Floats) -> dict[str, Dataset]:
    """What is drawn of a mechanism at its equilibria (n, coordinates), as a group of a section."""
    drawn = drawing(mechanism, q)
    if not drawn.kind.size or not len(q):
        return {}
    each = ("element",)
    variables = {
        "element_kind": Variable(each, drawn.kind, "1", "what is drawn", flags(Element)),
        "element_name": Variable(each, np.array(drawn.name, dtype=object), "1", "name of a point"),
        "element_mass": Variable(each, drawn.mass, "kg", "mass, NaN of what is no mass"),
    } | {
        f"element_{axis}": Variable(
            ("equilibrium", "element", "end"), drawn.ends[..., k], "m", f"{axis} of both ends of an element"
        )
        for k, axis in enumerate("xy")
    }
    return {"drawing": Dataset(variables)}


#: Names in requests that stand for several variables.
TOGETHER = {
    "hessian": tuple(f"hessian_{entry}" for entry in HESSIAN),
    **{name: tuple(f"{name}_{k}" for k in "12345678") for name in ("eigenvalue_re", "eigenvalue_im")},
}


def map_dataset(found: Any) -> Dataset:
    """The section of a map of a scene's or a mechanism's equilibria."""
    system, grid = found.system, tuple(found.axes)
    attrs = told(system) | {"axes": grid}
    slots = found.energy.shape[-1]
    own = axis_variables(system, found.axes) | numbers("root", slots, "rank of the equilibrium by energy")
    if isinstance(found, RestingMap):
        return Dataset(own | resting_variables(system, grid, found), attrs)
    own |= point_variables(grid, found) | sheet_variables(grid, found.sheet)
    table = sheet_table(found.sheet_morse_index, found.sheet_branch, found.sheet_discontinuities)
    return Dataset(own, attrs, {"sheets": Dataset(table)})


def sheet_variables(grid: tuple[str, ...], sheet: NDArray[np.int32]) -> dict[str, Variable]:
    """The sheet of every slot."""
    about = "equal numbers at neighbours: one equilibrium, continued, but for sheet_discontinuity"
    return {"sheet": Variable((*grid, "root"), sheet, "1", about, NO_CODE)}


def sheet_table(
    morse_index: NDArray[np.int8], branch: NDArray[np.int32], breaks: NDArray[np.int32]
) -> dict[str, Variable]:
    """What is known of every sheet, and where a sheet is torn."""
    each = ("sheet",)
    torn = (
        "where a sheet does not continue between neighbours: index along every axis of the second of them, "
        "the axis along which the first is before it (0: first axis), the sheet"
    )
    return {
        **numbers("sheet", len(branch), "number of the sheet"),
        "sheet_morse_index": Variable(
            each, morse_index, "1", "negative eigenvalues of the Hessian all over a sheet"
        ),
        "sheet_branch": Variable(
            each, branch, "1", "sheets with equal numbers continue one another round a cusp or across a fold"
        ),
        "sheet_discontinuity": Variable(("break", "break_entry"), breaks, "1", torn),
    }


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
        return dict(fold_points(find_folds(scene, *next(iter(axes.items())))).variables)
    if len(axes) == 2:
        x, y = axes.items()
        thin = [(n, np.linspace(v[0], v[-1], min(v.size, SEED_VALUES))) for n, v in (x, y)]
        undamped = undamped_curves(trace_undamped(scene, *thin, threads=threads))
        return {**fold_curves(trace_folds(scene, x, y)).variables, **undamped.variables}
    return {}


def fold_points(found: FoldPoints) -> Dataset:
    """What files hold of folds over a parameter."""
    name, each = found.parameter, ("fold",)
    unit = found.system.described()[name][1]
    variables = {
        f"fold_{name}": _numbers(each, [f.value for f in found], unit, f"{name} at the fold"),
        "fold_phi": _numbers(each, [f.phi for f in found], "rad", "phi where two equilibria merge"),
        "fold_theta": _numbers(each, [f.theta for f in found], "rad", "theta where two equilibria merge"),
        "fold_merges": _codes(
            each, [Merging[f.merges.upper()] for f in found], "merges with a saddle", Merging
        ),
        "fold_kind": _codes(each, [Kind[f.kind.upper()] for f in found], "kind of the fold", Kind),
        "fold_proof": _proof(found.reason),
    }
    return Dataset(variables, {"axes": (name,)})


def fold_curves(found: FoldSet) -> Dataset:
    """What files hold of fold curves over two parameters."""
    x, y, curves = *found.names, found.curves
    units = [found.system.described()[name][1] for name in (x, y)]
    each, cusp = ("fold_point",), ("cusp",)
    variables = {
        f"fold_{x}": _joined(each, [c.x for c in curves], units[0], f"{x} along the fold curves"),
        f"fold_{y}": _joined(each, [c.y for c in curves], units[1], f"{y} along the fold curves"),
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
        f"cusp_{x}": _numbers(cusp, [c.x for c in found.cusps], units[0], f"{x} at the cusp"),
        f"cusp_{y}": _numbers(cusp, [c.y for c in found.cusps], units[1], f"{y} at the cusp"),
        "cusp_phi": _numbers(cusp, [c.phi for c in found.cusps], "rad", "phi where three equilibria merge"),
        "cusp_theta": _numbers(cusp, [c.theta for c in found.cusps], "rad", "theta where three merge"),
    }
    about = "edges between whose ends the count changes, those that no fold curve crosses, curves cut short"
    counts = np.array([found.crossings, found.unexplained, found.unfinished])
    variables["fold_crossings"] = Variable((TALLY,), counts, "1", about)
    return Dataset(variables, {"axes": found.names})


def undamped_curves(found: UndampedSet) -> Dataset:
    """What files hold of where damping misses a mode, over two parameters."""
    x, y, curves, sheets = *found.names, found.curves, found.everywhere
    one = ("unreached_sheet",)
    about = "of one of the points of a sheet on which the damper misses a mode everywhere"
    units = [found.system.described()[name][1] for name in (x, y)]
    each = ("unreached_point",)
    what = "where the damper misses a mode"
    variables = {
        f"unreached_{x}": _joined(each, [c.x for c in curves], units[0], f"{x} {what}"),
        f"unreached_{y}": _joined(each, [c.y for c in curves], units[1], f"{y} {what}"),
        "unreached_phi": _joined(each, [c.phi for c in curves], "rad", f"phi {what}"),
        "unreached_theta": _joined(each, [c.theta for c in curves], "rad", f"theta {what}"),
        "unreached_curve": _numbering(each, [c.x.size for c in curves], "number of the curve"),
        "unreached_vanishes": _codes(
            each,
            [v for c in curves for v in [_VANISHING[c.vanishes]] * c.x.size],
            "what vanishes there",
            Vanishing,
        ),
        f"unreached_sheet_{x}": _numbers(one, [s.x for s in sheets], units[0], f"{x} {about}"),
        f"unreached_sheet_{y}": _numbers(one, [s.y for s in sheets], units[1], f"{y} {about}"),
        "unreached_sheet_phi": _numbers(one, [s.phi for s in sheets], "rad", f"phi {about}"),
        "unreached_sheet_theta": _numbers(one, [s.theta for s in sheets], "rad", f"theta {about}"),
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
    return Dataset(variables, {"axes": found.names})


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
