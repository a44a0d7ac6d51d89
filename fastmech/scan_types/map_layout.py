"""The variables of an equilibrium map and of its curves: names, dimensions, units and meanings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech import results
from fastmech.arrays import Floats
from fastmech.atlas.resting_map import RestingMap
from fastmech.models.drawing import Element, drawing
from fastmech.models.mechanism import Mechanism
from fastmech.objects import coordinate_units
from fastmech.outcome import Outcome
from fastmech.results import Dataset, Variable, columns, numbers, told
from fastmech.scan_types.request import axis_variables
from fastmech.scene import Scene
from fastmech.slider.atlas.damping import UndampedSet, trace_undamped
from fastmech.slider.atlas.folds import FoldPoints, FoldSet, find_folds, trace_folds
from fastmech.slider.atlas.map import Coincidence, Slab
from fastmech.slider.impulse import POINTS
from fastmech.slider.linearize import SIN_PHI, SIN_PSI, UNLOADED
from fastmech.slider.stability import Verdict

#: What is known of a point of a map, and of each of its equilibria, named as in
#: :class:`fastmech.slider.atlas.map.Slab`.
_POINT: dict[str, tuple[Any, ...]] = {
    "count": ("1", "number of equilibria"),
    "count_stable": ("1", "number of stable equilibria (minima)"),
    "outcome": ("1", "what is proved of the count", results.flags(Outcome)),
    "coincidence": ("1", "what meets here within rounding", results.flags(Coincidence)),
    "fold_margin": ("rad", "distance to the fold, positive with six equilibria"),
}
_ROOT: dict[str, tuple[Any, ...]] = {
    "phi": ("rad", "angle phi"),
    "theta": ("rad", "angle theta"),
    "radius": ("rad", "the true equilibrium is proved to be within; inf: not proved"),
    "energy": ("J", "potential energy Pi - F x2"),
    "morse_index": ("1", "negative eigenvalues of the Hessian, -2: Hessian singular", results.NO_CODE),
}
CRITERIA = {
    "verdict_sylvester": "verdict: Lagrange-Dirichlet",
    "verdict_hurwitz": "verdict: Hurwitz",
    "verdict_eigenvalues": "verdict: eigenvalues",
    "verdict": "verdict: joint",
}
_MOTION: dict[str, tuple[Any, ...]] = {
    "frequency": ("rad/s", "lowest undamped natural frequency, NaN: a direction grows"),
    "decay_time": ("s", "slowest linear mode falls to 1/e; inf: never, NaN: no minimum"),
    "depth": ("J", "energy from a minimum to the lowest way out of its well"),
} | {
    f"shock_limit_{on.lower()}": (
        "N s",
        f"proved: no smaller impulse on {on} of the resting mechanism leaves the well, in whatever "
        f"direction{'; NaN: no minimum, or M3 at a dead centre' if on == 'M3' else ''}",
    )
    for on in POINTS
}

#: Entries of a Hessian and their unit.
HESSIAN = dict.fromkeys(("phi_phi", "phi_theta", "theta_theta"), "J")

#: Attributes of verdicts.
VERDICTS = results.flags(Verdict, fill=Verdict.NONE)


def point_variables(grid: tuple[str, ...], found: Slab) -> dict[str, Variable]:
    """Everything known at every point; the arrays have the grid's dimensions ``grid`` in front."""
    verdicts = enumerate(CRITERIA.items())
    rows = {
        **results.rows_of(found, _ROOT),
        "hessian": (found.hessian, HESSIAN, "Hessian, paper (19): {}"),
        **eigenvalue_rows(found.eigenvalues),
        **{name: (found.verdict[..., k], "1", about, VERDICTS) for k, (name, about) in verdicts},
        **results.rows_of(found, _MOTION),
    }
    return columns(grid, results.rows_of(found, _POINT)) | columns((*grid, "root"), rows)


def eigenvalue_rows(values: NDArray[np.complex128]) -> dict[str, tuple[Any, ...]]:
    """All eigenvalues of the motion, ranked by real part, each in two variables."""
    about = "eigenvalue {} of the motion by real part"
    ranks = "12345678"[: values.shape[-1]]
    return {
        "eigenvalue_re": (values.real, dict.fromkeys(ranks, "1/s"), f"real part of {about}"),
        "eigenvalue_im": (values.imag, dict.fromkeys(ranks, "rad/s"), f"imaginary part of {about}"),
    }


#: Names of what a mechanism's map knows of every point beside positions and eigenvalues.
RESTING = (
    "count", "count_stable", "outcome", "radius", "energy", "morse_index", "verdict", "decay_time", "depth",
)  # fmt: skip


def resting_variables(mechanism: Mechanism, grid: tuple[str, ...], found: RestingMap) -> dict[str, Variable]:
    """Everything known of a mechanism's equilibria at every point."""
    units = coordinate_units(mechanism)
    eigenvalues = np.where(np.isnan(found.eigenvalues), complex(np.nan, np.nan), found.eigenvalues)
    falling, stays = (found.verdict == v for v in (Verdict.ASYMPTOTICALLY_STABLE, Verdict.STABLE))
    slowest = np.where(falling, -found.eigenvalues[..., 0].real, 1.0)
    time = np.where(falling, 1.0 / slowest, np.where(stays, np.inf, np.nan))
    stable = (falling | stays).sum(axis=-1).astype(np.int16)
    about_time = "slowest linear mode falls to 1/e; inf: never, NaN: not stable"
    about_index = "directions in which the energy falls, -2: not proved"
    unit = one_of(units.values())
    points = {
        "count": (found.count, *_POINT["count"]),
        "count_stable": (stable, "1", "number of stable equilibria"),
        "outcome": (found.outcome, *_POINT["outcome"]),
    }
    roots = {
        "": (found.position, units, "{1} {0}"),
        "radius": (found.radius, unit, "by each coordinate the equilibrium is proved to be within"),
        "energy": (found.energy, "J", "potential energy, loads at their means"),
        "morse_index": (found.morse_index, "1", about_index, results.NO_CODE),
        "verdict": (found.verdict, "1", "stability", VERDICTS),
        **eigenvalue_rows(eigenvalues),
        "decay_time": (time, "s", about_time),
    }
    if found.depth is not None:
        roots["depth"] = (found.depth, *_MOTION["depth"])
    return columns(grid, points) | columns((*grid, "root"), roots)


def one_of(units: Iterable[str]) -> str:
    """The unit that all have, or none."""
    different = set(units)
    return different.pop() if len(different) == 1 else "1"


def drawing_group(mechanism: Mechanism, q: Floats) -> dict[str, Dataset]:
    """What is drawn of a mechanism at its equilibria (n, coordinates), as a group of a section."""
    drawn = drawing(mechanism, q)
    if not drawn.kind.size or not len(q):
        return {}
    rows = {
        "element_kind": (drawn.kind, "1", "what is drawn", results.flags(Element)),
        "element_name": (np.array(drawn.name, dtype=object), "1", "name of a point"),
        "element_mass": (drawn.mass, "kg", "mass, NaN of what is no mass"),
    }
    dims, axes = ("equilibrium", "element", "end"), {"x": "m", "y": "m"}
    ends = results.parts("element", dims, drawn.ends, axes, "{} of both ends of an element")
    return {"drawing": Dataset(columns(("element",), rows) | ends)}


def equilibria_table(equilibria: Any, units: Mapping[str, str], which: str = "") -> dict[str, Variable]:
    """The equilibria that labels refer to, by their numbers; ``units`` of the coordinates."""
    index = np.array([e.morse_index for e in equilibria], dtype=np.int8)
    rows = {
        "equilibrium": (equilibria.position, units, f"{{1}} {{0}} of the {which}equilibrium"),
        "equilibrium_energy": (equilibria.energy, "J", f"potential energy of the {which}equilibrium"),
        "equilibrium_morse_index": (index, "1", "unstable directions, 0: a well"),
    }
    number = numbers("equilibrium", len(equilibria), f"number of the {which}equilibrium")
    return number | columns(("equilibrium",), rows)


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
    return {"sheet": Variable((*grid, "root"), sheet, "1", about, results.NO_CODE)}


def sheet_table(
    morse_index: NDArray[np.int8], branch: NDArray[np.int32], breaks: NDArray[np.int32]
) -> dict[str, Variable]:
    """What is known of every sheet, and where a sheet is torn."""
    torn = (
        "where a sheet does not continue between neighbours: index along every axis of the second of them, "
        "the axis along which the first is before it (0: first axis), the sheet"
    )
    joined = "sheets with equal numbers continue one another round a cusp or across a fold"
    rows = {
        "sheet_morse_index": (morse_index, "1", "negative eigenvalues of the Hessian all over a sheet"),
        "sheet_branch": (branch, "1", joined),
    }
    return {
        **numbers("sheet", len(branch), "number of the sheet"),
        **columns(("sheet",), rows),
        "sheet_discontinuity": Variable(("break", "break_entry"), breaks, "1", torn),
    }


#: Values of an axis that seed the vanishing-damping curves.
SEED_VALUES = 151

#: What is told of folds of which none can be missing.
COMPLETE = "complete"


#: What merges with a saddle on a fold; what happens there; what vanishes where the damper misses a mode.
Merging = IntEnum("Merging", "MINIMUM MAXIMUM", start=0)
CurveKind = IntEnum("CurveKind", "FOLD PITCHFORK CUSP TRANSCRITICAL", start=0)
Vanishing = IntEnum("Vanishing", "SIN_PHI SIN_PHI_THETA UNLOADED_ROD", start=0)

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
    name, folds = found.parameter, list(found)
    about = "{} at the fold", "{} where two equilibria merge"
    rows = _points("fold", found, {"value": name}, folds, about)
    rows["fold_merges"] = _codes("merges", folds, "merges with a saddle", Merging)
    rows["fold_kind"] = _codes("kind", folds, "kind of the fold", CurveKind)
    return Dataset(columns(("fold",), rows) | _proof(found.reason), {"axes": (name,)})


def fold_curves(found: FoldSet) -> Dataset:
    """What files hold of fold curves over two parameters."""
    axes, curves = dict(zip("xy", found.names, strict=True)), found.curves
    about = "{} along the fold curves", "{} where two equilibria merge"
    rows = _points("fold", found, axes, curves, about)
    rows["fold_curve"] = _numbering(curves, "number of the fold curve")
    rows["fold_merges"] = _codes("merges", curves, "merges with a saddle", Merging)
    rows["fold_kind"] = _codes("kind", curves, "kind of the curve", CurveKind)
    cusps = _points("cusp", found, axes, found.cusps, ("{} at the cusp", "{} where three equilibria merge"))
    variables = columns(("fold_point",), rows) | _proof(found.reason) | columns(("cusp",), cusps)
    return Dataset(variables, {"axes": found.names})


def undamped_curves(found: UndampedSet) -> Dataset:
    """What files hold of where damping misses a mode, over two parameters."""
    axes, curves, sheets = dict(zip("xy", found.names, strict=True)), found.curves, found.everywhere
    rows = _points("undamped", found, axes, curves, ("{} where the damper misses a mode",) * 2)
    rows["undamped_curve"] = _numbering(curves, "number of the curve")
    rows["undamped_vanishes"] = _codes("vanishes", curves, "what vanishes there", Vanishing)
    about = "{} of one of the points of a sheet on which the damper misses a mode everywhere"
    each = _points("undamped_sheet", found, axes, sheets, (about, about))
    share = np.array([s.share for s in sheets], dtype=np.float64)
    each["undamped_sheet_share"] = (share, "1", "share of the map's points at which that sheet has it")
    words = "what vanishes all over the sheet"
    each["undamped_sheet_vanishes"] = _codes("vanishes", sheets, words, Vanishing)
    counts = {
        "crossings": (found.crossings, "edges of the seeding grid that such a curve crosses"),
        "off_curves": (found.unexplained, "those of them that lie on no curve found"),
        "cut_short": (found.unfinished, "curves that could not be followed to their ends"),
    }
    told = {f"undamped_{k}": Variable((), np.array(n), "1", about) for k, (n, about) in counts.items()}
    variables = columns(("undamped_point",), rows) | columns(("undamped_sheet",), each) | told
    return Dataset(variables, {"axes": found.names})


def _points(
    prefix: str, found: Any, axes: Mapping[str, str], items: Sequence[Any], about: tuple[str, str]
) -> dict[str, tuple[Any, ...]]:
    """Parameters and angles of curves, or of single points, one after the other."""
    described = found.system.described()
    rows: dict[str, tuple[Any, ...]] = {}
    for attribute, name in {**axes, "phi": "phi", "theta": "theta"}.items():
        values = np.concatenate([np.zeros(0), *(np.atleast_1d(getattr(one, attribute)) for one in items)])
        unit, text = (described[name][1], about[0]) if attribute in axes else ("rad", about[1])
        rows[f"{prefix}_{name}"] = (values, unit, text.format(name))
    return rows


def _numbering(curves: Sequence[Any], about: str) -> tuple[Any, ...]:
    """Of each point of curves the number of its curve."""
    return np.repeat(np.arange(len(curves), dtype=np.int32), [c.x.size for c in curves]), "1", about


def _codes(attribute: str, items: Sequence[Any], about: str, members: type[IntEnum]) -> tuple[Any, ...]:
    """A word of each point, or of each point of curves, as a code."""
    said = [getattr(one, attribute) for one in items]
    words = [_VANISHING[word] if word in _VANISHING else members[word.upper()] for word in said]
    sizes = [np.size(getattr(one, "x", 0.0)) for one in items]
    return np.repeat(np.array(words, dtype=np.int8), sizes), "1", about, results.flags(members)


def _proof(reason: str) -> dict[str, Variable]:
    words = np.array([reason or COMPLETE], dtype=object)
    about = "whether it is proved that no other fold is in the map"
    return {"fold_proof": Variable(("statement",), words, "1", about)}
