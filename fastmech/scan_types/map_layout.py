"""The variables of an equilibrium map: names, dimensions, units and meanings, in one place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.coincidence import Coincidence
from fastmech.atlas.map import Slab
from fastmech.equilibria.outcome import Outcome
from fastmech.mechanism.impulse import POINTS
from fastmech.results import NO_CODE, Variable, flags, numbers, parts
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
    """The four eigenvalues of the motion, ranked by real part, each in two variables."""
    about = "eigenvalue {} of the motion by real part"
    real, imaginary = (dict.fromkeys("1234", unit) for unit in ("1/s", "rad/s"))
    return parts("eigenvalue_re", dims, values.real, real, f"real part of {about}") | parts(
        "eigenvalue_im", dims, values.imag, imaginary, f"imaginary part of {about}"
    )


#: Names in requests that stand for several variables.
TOGETHER = {
    "hessian": tuple(f"hessian_{entry}" for entry in HESSIAN),
    **{name: tuple(f"{name}_{k}" for k in "1234") for name in ("eigenvalue_re", "eigenvalue_im")},
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
