"""A row for every number and verdict that the paper prints."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from fastmech.arrays import Floats
from fastmech.mechanism.geometry import Points, constraints, positions
from fastmech.paper.compare import CASES, Judge, Printed, Row, Verdict
from fastmech.paper.compute import DISTURBANCE, PAPER_SCENE, START, STATIC_SCENE, Case, Computed
from fastmech.paper.formulas import Terms, equilibrium_20, hamiltonian_16
from fastmech.paper.misprints import printed_polynomial


def all_rows(printed: Printed, computed: Computed, misprints: Collection[str]) -> list[Row]:
    """Rows in the paper's order; ``misprints`` are the keys of those that the evidence confirms."""
    judge = Judge(misprints)
    return [
        *_table_1(judge, printed),
        *_text(judge, printed, computed),
        *_equation_16(judge, printed),
        *_table_2(judge, printed, computed.cases),
        *_equation_20(judge, printed),
        *_table_3(judge, printed, computed.cases),
        *_table_4(judge, printed, computed.cases),
    ]


def _table_1(judge: Judge, printed: Printed) -> Iterator[Row]:
    units = {name: unit for name, (_, unit, _) in PAPER_SCENE.described().items()}
    start = dict(zip(("phi_0", "theta_0", "phi_dot_0", "theta_dot_0"), START, strict=True))
    values = {**PAPER_SCENE.model_dump(), **start}
    units |= {"phi_0": "rad", "theta_0": "rad", "phi_dot_0": "rad/s", "theta_dot_0": "rad/s"}
    for symbol, value in printed["table_1"].items():
        if symbol in values:
            row = judge.row("Table 1", "", symbol, units[symbol], value, values[symbol])
            # The one parameter of which the paper used more digits than it prints.
            yield row._replace(verdict=Verdict.ROUNDING) if symbol == "c2" and row.difference else row


def _text(judge: Judge, printed: Printed, computed: Computed) -> Iterator[Row]:
    text = printed["text"]
    rank = _constraint_rank(np.array(START))
    stable = [CASES[case.number - 1] for case in computed.cases if case.verdict == "stable"]
    numbers: list[tuple[str, str, str, float]] = [
        ("degrees_of_freedom", "degrees of freedom", "1", 6 - rank),
        ("geometric_constraints", "geometric constraints", "1", rank),
        ("static_force", "constant force", "N", STATIC_SCENE.F0),
        ("equilibria", "equilibria", "1", computed.count),
        ("xi_1", "ξ1", "rad", DISTURBANCE[0]),
        ("xi_2", "ξ2", "rad", DISTURBANCE[1]),
        ("eta_1", "η1", "rad/s", DISTURBANCE[2]),
        ("eta_2", "η2", "rad/s", DISTURBANCE[3]),
    ]
    for key, symbol, unit, value in numbers:
        yield judge.row("Text", "", symbol, unit, text[key], float(value))
    yield judge.row("Text", "", "stable cases", "", _words(text["stable_cases"]), _words(stable))


def _words(names: list[str]) -> str:
    return ", ".join(name.replace("_", " ").capitalize() for name in names)


def _constraint_rank(state: Floats) -> int:
    """Number of independent constraints (2)-(5) on the six coordinates."""
    points = np.array(positions(PAPER_SCENE, state))
    # The constraints are of second degree: central differences are exact.
    steps = np.eye(6)
    columns = [
        constraints(PAPER_SCENE, Points(*(points + s))) - constraints(PAPER_SCENE, Points(*(points - s)))
        for s in steps
    ]
    return int(np.linalg.matrix_rank(np.array(columns) / 2.0))


def _equation_16(judge: Judge, printed: Printed) -> Iterator[Row]:
    equation = printed["equation_16"]
    exact = hamiltonian_16(PAPER_SCENE, equation)
    shape = equation["denominator"]
    parts: list[tuple[str, str, Terms, Floats]] = [
        ("potential", "J", equation["potential"], exact.potential.coefficients),
        ("times p_phi**2", "1/(kg m²)", equation["p_phi_2"], exact.p_phi_2.coefficients),
        ("times p_theta**2", "1/(kg m²)", equation["p_theta_2"], exact.p_theta_2.coefficients),
        ("times p_phi p_theta", "1/(kg m²)", equation["p_phi_p_theta"], exact.p_phi_p_theta.coefficients),
        ("denominator, outside", "1", shape["outside"], exact.outside),
        ("denominator, inner bracket", "1", [*shape["inside"], *shape["after"]], exact.inside),
    ]
    for place, unit, terms, values in parts:
        for term, value in zip(terms, values, strict=True):
            symbol = "constant" if term["factor"] == "1" else term["factor"]
            keys = ("equation_16_coefficient",) if symbol == "sin(phi)" else ()
            yield judge.row("Equation (16)", place, symbol, unit, term["value"], float(value), *keys)


def _equation_20(judge: Judge, printed: Printed) -> Iterator[Row]:
    for angle, exact in equilibrium_20(STATIC_SCENE, printed["equation_20"]).items():
        for term, value in zip(printed["equation_20"][angle], exact.coefficients, strict=True):
            place = f"condition of {angle}"
            yield judge.row("Equation (20)", place, term["factor"], "N m", term["value"], float(value))


def _table_2(judge: Judge, printed: Printed, cases: tuple[Case, ...]) -> Iterator[Row]:
    for name, case in zip(CASES, cases, strict=True):
        entry = printed["table_2"][name]
        for symbol, value in (("φ", case.equilibrium.phi), ("θ", case.equilibrium.theta)):
            key = {"φ": "phi", "θ": "theta"}[symbol]
            yield judge.row("Table 2", f"Case {case.number}", symbol, "rad", entry[key], value)


def _table_3(judge: Judge, printed: Printed, cases: tuple[Case, ...]) -> Iterator[Row]:
    for name, case in zip(CASES, cases, strict=True):
        entry, place = printed["table_3"][name], f"Case {case.number}"
        for i in range(2):
            for j in range(2):
                symbol, value = f"c{i + 1}{j + 1}", float(case.equilibrium.hessian[i, j])
                # A whole matrix may be wrong, or one element.
                keys = (f"table_3_{name}", f"table_3_{name}_{symbol}")
                yield judge.row("Table 3", place, symbol, "J", entry["hessian"][i][j], value, *keys)
        yield judge.row("Table 3", place, "stability", "", entry["verdict"], case.verdict)


def _table_4(judge: Judge, printed: Printed, cases: tuple[Case, ...]) -> Iterator[Row]:
    powers = ("constant", "λ", "λ²", "λ³", "λ⁴")
    for name, case in zip(CASES, cases, strict=True):
        entry, place = printed["table_4"][name], f"Case {case.number}"
        values = printed_polynomial(entry["coefficients"], case)
        for power, (symbol, pattern) in enumerate(zip(powers, entry["coefficients"], strict=True)):
            unit = "1" if power == 4 else f"1/s{'⁴³²¹'[power].replace('¹', '')}"
            yield judge.row("Table 4", place, symbol, unit, pattern, float(values[power]), f"table_4_{name}")
        by_hurwitz = "stable" if "stable" in case.classification.hurwitz.verdict.split() else "unstable"
        yield judge.row("Table 4", place, "stability", "", entry["verdict"], by_hurwitz)
