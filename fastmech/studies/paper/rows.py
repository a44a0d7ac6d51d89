"""A row for every number and verdict that the paper prints."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.equilibria.find import find_equilibria
from fastmech.mechanism.geometry import Points, constraints, positions
from fastmech.scene import Scene
from fastmech.studies.paper.compare import CASES, Judge, Printed, Row, Verdict, agrees
from fastmech.studies.paper.compute import (
    DISTURBANCE,
    METHOD,
    MOTION_SPAN,
    PAPER_SCENE,
    START,
    STATIC_SCENE,
    STEP,
    Case,
    Computed,
    nearest,
)
from fastmech.studies.paper.misprints import Terms, equilibrium_20, hamiltonian_16, printed_polynomial


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


def all_checks(computed: Computed) -> list[Check]:
    """The promises about the motion and the equilibria, with the values found now."""
    motion = computed.motion
    angles, rates = computed.formulations_differ[:2], computed.formulations_differ[2:]
    residual = np.abs(constraints(PAPER_SCENE, positions(PAPER_SCENE, motion.y)))
    certificate = computed.certificate
    run = f"over {MOTION_SPAN:g} s ({METHOD}, step {STEP:g} s)"
    missing = abs((certificate.expected or 0) - computed.count) if certificate.complete else float("nan")
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


class Guess(NamedTuple):
    """A parameter set that might be the paper's, and how many of Table 2's angles it gives."""

    c2: str
    g: str
    agreeing: int
    total: int


def parameters_used(printed: Printed) -> list[Guess]:
    """Which c2 and g the paper computed with: how many angles of Table 2 each choice gives."""
    stiffnesses = {"1100/3": STATIC_SCENE.c2, printed["table_1"]["c2"]: float(printed["table_1"]["c2"])}
    gravities = {"9.80665": STATIC_SCENE.g, "9.81": 9.81}
    return [
        Guess(c2, g, _agreeing(printed, STATIC_SCENE.replace(c2=stiffness, g=gravity)), 2 * len(CASES))
        for c2, stiffness in stiffnesses.items()
        for g, gravity in gravities.items()
    ]


def _agreeing(printed: Printed, scene: Scene) -> int:
    found = find_equilibria(scene)
    count = 0
    for name in CASES:
        entry = printed["table_2"][name]
        equilibrium = nearest(found, entry)
        count += agrees(entry["phi"], equilibrium.phi) + agrees(entry["theta"], equilibrium.theta)
    return count


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
    values = {**PAPER_SCENE.parameters, **start}
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
