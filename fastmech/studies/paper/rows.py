"""A row for every number and verdict that the paper prints, and the promises about the computation."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from fastmech.slider.geometry import Points, constraints, positions
from fastmech.studies.paper import compute as paper
from fastmech.studies.paper.compare import CASES, Agreement, PaperRow, Printed, judged
from fastmech.studies.paper.misprints import coefficient, printed_polynomial


class Check(NamedTuple):
    """One promise, kept if the value does not exceed the limit."""

    name: str
    value: float
    unit: str
    limit: float

    @property
    def passed(self) -> bool:
        """Whether the promise is kept."""
        return bool(self.value <= self.limit)


def all_checks(computed: paper.Computed) -> list[Check]:
    """The promises about the motion and the equilibria, with the values found now."""
    motion, proof = computed.motion, computed.equilibria.certificate
    angles, rates = computed.formulations_differ[:2], computed.formulations_differ[2:]
    residual = np.abs(constraints(paper.PAPER_SCENE, positions(paper.PAPER_SCENE, motion.y)))
    run = f"over {paper.MOTION_SPAN:g} s ({paper.METHOD}, step {paper.STEP:g} s)"
    missing = abs((proof.expected or 0) - len(computed.equilibria)) if proof.complete else float("nan")
    balance = "energy balance: change of T + Π less the works of damper and force, over max(T + Π) − min Π"
    both, along = "Lagrange's and Hamilton's equations", "largest residual along the motion"
    return [
        Check(f"{both}: largest difference of the angles {run}", angles.max(), "rad", 1e-10),
        Check("the same, rates", rates.max(), "rad/s", 1e-10),
        Check(f"constraints (2), (3), (5): {along}", residual[[0, 1, 3]].max(), "m²", 1e-13),
        Check(f"constraint (4): {along}", residual[2].max(), "m", 1e-13),
        Check(balance, motion.relative_residual, "1", 1e-10),
        Check("equilibria missing from the list, by the counting theorem", missing, "1", 0.0),
    ]


#: What is judged: section, place, symbol, unit; print, computed value, keys of misprints.
Number = tuple[Any, ...]


def all_rows(printed: Printed, computed: paper.Computed, misprints: Collection[str]) -> list[PaperRow]:
    """Rows in the paper's order; ``misprints`` are the keys of those that the evidence confirms."""
    numbers = chain(
        _table_1(printed), _text(printed, computed), _equations(printed), _tables(printed, computed.cases)
    )
    # The paper's order has Table 2 between its equations.
    order = ("Table 1", "Text", "Equation (16)", "Table 2", "Equation (20)", "Table 3", "Table 4")
    rows = [judged(misprints, *number) for number in sorted(numbers, key=lambda n: order.index(n[0][0]))]
    # The one parameter of which the paper used more digits than it prints.
    return [
        row._replace(verdict=Agreement.ROUNDING)
        if (row.section, row.symbol) == ("Table 1", "c2") and row.difference
        else row
        for row in rows
    ]


def _table_1(printed: Printed) -> Iterator[Number]:
    known = {name: (unit, value) for name, (value, unit, _) in paper.PAPER_SCENE.described().items()}
    names, units = ("phi_0", "theta_0", "phi_dot_0", "theta_dot_0"), ("rad", "rad", "rad/s", "rad/s")
    known |= dict(zip(names, zip(units, paper.START, strict=True), strict=True))
    for symbol, value in printed["table_1"].items():
        if symbol in known:
            unit, computed = known[symbol]
            yield ("Table 1", "", symbol, unit), value, computed


def _text(printed: Printed, computed: paper.Computed) -> Iterator[Number]:
    text, rank = printed["text"], _constraint_rank()
    numbers = {
        "degrees_of_freedom": ("degrees of freedom", "1", 6 - rank),
        "geometric_constraints": ("geometric constraints", "1", rank),
        "static_force": ("constant force", "N", paper.STATIC_SCENE.F0),
        "equilibria": ("equilibria", "1", len(computed.equilibria)),
        "xi_1": ("ξ1", "rad", paper.DISTURBANCE[0]),
        "xi_2": ("ξ2", "rad", paper.DISTURBANCE[1]),
        "eta_1": ("η1", "rad/s", paper.DISTURBANCE[2]),
        "eta_2": ("η2", "rad/s", paper.DISTURBANCE[3]),
    }
    for key, (symbol, unit, value) in numbers.items():
        yield ("Text", "", symbol, unit), text[key], float(value)
    stable = [CASES[case.number - 1] for case in computed.cases if case.verdict == "stable"]
    words = (", ".join(names).replace("_", " ").title() for names in (text["stable_cases"], stable))
    yield ("Text", "", "stable cases", ""), *words


def _constraint_rank() -> int:
    """Number of independent constraints (2)-(5) on the six coordinates."""
    points = np.array(positions(paper.PAPER_SCENE, np.array(paper.START)))
    # The constraints are of second degree: central differences are exact.
    ahead, behind = (
        [constraints(paper.PAPER_SCENE, Points(*(points + h * s))) for s in np.eye(6)] for h in (1, -1)
    )
    return int(np.linalg.matrix_rank((np.array(ahead) - np.array(behind)) / 2.0))


def _equations(printed: Printed) -> Iterator[Number]:
    equation = printed["equation_16"]
    shape = equation["denominator"]
    terms = equation | {"outside": shape["outside"], "inside": [*shape["inside"], *shape["after"]]}
    parts = {
        "potential": ("potential", "J"),
        "p_phi_2": ("times p_phi**2", "1/(kg m²)"),
        "p_theta_2": ("times p_theta**2", "1/(kg m²)"),
        "p_phi_p_theta": ("times p_phi p_theta", "1/(kg m²)"),
        "outside": ("denominator, outside", "1"),
        "inside": ("denominator, inner bracket", "1"),
    }
    for part, (place, unit) in parts.items():
        for term in terms[part]:
            symbol = "constant" if term["factor"] == "1" else term["factor"]
            keys = ("equation_16_coefficient",) if symbol == "sin(phi)" else ()
            about = "Equation (16)", place, symbol, unit
            yield about, term["value"], coefficient(term, paper.PAPER_SCENE), *keys
    for angle, conditions in printed["equation_20"].items():
        for term in conditions:
            about = "Equation (20)", f"condition of {angle}", term["factor"], "N m"
            yield about, term["value"], coefficient(term, paper.STATIC_SCENE)


def _tables(printed: Printed, cases: tuple[paper.PaperCase, ...]) -> Iterator[Number]:
    """Tables 2 to 4, case by case."""
    for name, case in zip(CASES, cases, strict=True):
        place, e = f"Case {case.number}", case.equilibrium
        second, third, fourth = (printed[f"table_{number}"][name] for number in (2, 3, 4))
        yield ("Table 2", place, "φ", "rad"), second["phi"], e.phi
        yield ("Table 2", place, "θ", "rad"), second["theta"], e.theta
        for i, j in np.ndindex(2, 2):
            symbol = f"c{i + 1}{j + 1}"
            # A whole matrix may be wrong, or one element.
            keys = (f"table_3_{name}", f"table_3_{name}_{symbol}")
            yield ("Table 3", place, symbol, "J"), third["hessian"][i][j], float(e.hessian[i, j]), *keys
        yield ("Table 3", place, "stability", ""), third["verdict"], case.verdict
        values = printed_polynomial(fourth["coefficients"], case)
        units = zip(("constant", "λ", "λ²", "λ³", "λ⁴"), ("1/s⁴", "1/s³", "1/s²", "1/s", "1"), strict=True)
        for (symbol, unit), pattern, value in zip(units, fourth["coefficients"], values, strict=True):
            yield ("Table 4", place, symbol, unit), pattern, float(value), f"table_4_{name}"
        by_hurwitz = "stable" if "stable" in case.classification.hurwitz.verdict.split() else "unstable"
        yield ("Table 4", place, "stability", ""), fourth["verdict"], by_hurwitz
