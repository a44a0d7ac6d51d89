"""The variables of an equilibrium map: names, dimensions, units and meanings, in one place."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.coincidence import Coincidence
from fastmech.atlas.map import Slab
from fastmech.atlas.resting_map import RestingMap
from fastmech.equilibria.outcome import Outcome
from fastmech.mechanism.impulse import POINTS
from fastmech.models.drawing import Element, drawing
from fastmech.models.mechanism import Mechanism
from fastmech.results import NO_CODE, Dataset, Variable, flags, numbers, parts
from fastmech.scan_types.axis import coordinate_units
from fastmech.stability.criteria import Verdict

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


def drawing_group(mechanism: Mechanism, q: NDArray[np.float64]) -> dict[str, Dataset]:
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


def sheet_variables(grid: tuple[str, ...], sheet: NDArray[np.int32]) -> dict[str, Variable]:
    """The sheet of every slot."""
    about = "equal numbers at neighbours: one equilibrium, continued, but for sheet_break"
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
        "sheet_break": Variable(("break", "break_entry"), breaks, "1", torn),
    }
