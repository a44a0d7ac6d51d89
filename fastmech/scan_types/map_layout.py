"""The variables of an equilibrium map: names, dimensions, units and meanings, in one place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.coincidence import Coincidence
from fastmech.atlas.map import Slab
from fastmech.equilibria.outcome import Outcome
from fastmech.equilibria.search import MOST
from fastmech.results import Variable, flags
from fastmech.stability.criteria import Verdict

CRITERIA = {
    "verdict_sylvester": "verdict: Lagrange-Dirichlet",
    "verdict_hurwitz": "verdict: Hurwitz",
    "verdict_eigenvalues": "verdict: eigenvalues",
    "verdict": "verdict: joint",
}


def point_variables(grid: tuple[str, ...], found: Slab) -> dict[str, Variable]:
    """Everything known at every point; the arrays have the grid's dimensions ``grid`` in front."""
    roots = (*grid, "root")
    modes = (*roots, "mode")
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
            "negative eigenvalues of the Hessian, -1: no equilibrium, -2: Hessian singular",
        ),
        "hessian": Variable(
            (*roots, "entry"), found.hessian, "J", "Hessian: phi phi, phi theta, theta theta, paper (19)"
        ),
        "eigenvalue_re": Variable(
            modes, found.eigenvalues.real, "1/s", "eigenvalues of the motion, real part"
        ),
        "eigenvalue_im": Variable(
            modes, found.eigenvalues.imag, "rad/s", "eigenvalues of the motion, imaginary part"
        ),
        **{
            name: Variable(roots, found.verdict[..., k], "1", about, flags(Verdict))
            for k, (name, about) in enumerate(CRITERIA.items())
        },
        "frequency": Variable(
            roots, found.frequency, "rad/s", "lowest undamped natural frequency, NaN: a direction grows"
        ),
        "decay_time": Variable(
            roots, found.decay_time, "s", "slowest linear mode falls to 1/e; inf: never, NaN: no minimum"
        ),
        "depth": Variable(roots, found.depth, "J", "energy from a minimum to the lowest way out of its well"),
        "escape_speed": Variable(
            roots,
            found.escape_speed,
            "m/s",
            "least speed of M2 at which the kinetic energy is the depth: no slower kick leaves the well",
        ),
    }


def slot_variables(kept: list[str] | None) -> dict[str, Variable]:
    """Coordinates of the dimensions that are no parameters and that the variables kept (None: all) have."""
    variables = {
        "root": Variable(("root",), np.arange(MOST, dtype=np.int8), "1", "rank of the equilibrium by energy")
    }
    if kept is None or {"eigenvalue_re", "eigenvalue_im"} & set(kept):
        modes = np.arange(4, dtype=np.int8)
        variables["mode"] = Variable(("mode",), modes, "1", "rank of the eigenvalue by real part")
    if kept is None or "hessian" in kept:
        entries = np.array(["phi phi", "phi theta", "theta theta"], dtype=object)
        variables["entry"] = Variable(("entry",), entries, "1", "which second derivative")
    return variables


def sheet_variables(grid: tuple[str, ...], sheet: NDArray[np.int32]) -> dict[str, Variable]:
    """The sheet of every slot."""
    about = "equal numbers at neighbours: one equilibrium, continued, but for sheet_break; -1: none"
    return {"sheet": Variable((*grid, "root"), sheet, "1", about)}


def sheet_table(
    morse_index: NDArray[np.int8], branch: NDArray[np.int32], breaks: NDArray[np.int32]
) -> dict[str, Variable]:
    """What is known of every sheet, and where a sheet is torn."""
    each = ("sheet_number",)
    torn = (
        "where a sheet does not continue between neighbours: index along every axis of the second of them, "
        "the axis along which the first is before it (0: first axis), the sheet"
    )
    return {
        "sheet_morse_index": Variable(
            each, morse_index, "1", "negative eigenvalues of the Hessian all over a sheet"
        ),
        "sheet_branch": Variable(
            each, branch, "1", "sheets with equal numbers continue one another round a cusp or across a fold"
        ),
        "sheet_break": Variable(("break", "break_entry"), breaks, "1", torn),
    }
