"""The paper's misprints: for each the print and what must stand there, both evaluated.

Nothing here is believed: a candidate counts as a misprint only if every measure of the print exceeds its
tolerance while the corrected one stays below it. With a right print the same code reports none.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.paper.compare import CASES, Printed, agrees_legibly, half_unit
from fastmech.paper.compute import PAPER_SCENE, Case, Computed
from fastmech.paper.formulas import MEASURES, Terms, hamiltonian_16, printed_kinetic


class Evidence(NamedTuple):
    """One measure of how wrong a print is, and the correction."""

    measure: str
    unit: str
    printed: float
    corrected: float
    tolerance: float  #: what rounding explains

    @property
    def confirmed(self) -> bool:
        """Whether it speaks against the print and for the correction."""
        return self.printed > self.tolerance >= self.corrected


class Misprint(NamedTuple):
    """A candidate for a misprint with its evidence."""

    key: str
    place: str
    error: str  #: in words, Markdown
    printed: str
    corrected: str
    evidence: tuple[Evidence, ...]

    @property
    def confirmed(self) -> bool:
        """Whether all evidence confirms it."""
        return all(item.confirmed for item in self.evidence)


def candidates(printed: Printed, computed: Computed) -> list[Misprint]:
    """Every place of the paper that was found suspect, in the paper's order, with evidence computed now."""
    formulas = []
    for key, formula in printed["formula"].items():
        wrong, right = formula["printed"], formula["corrected"]
        evidence = [
            Evidence(about, unit, of(wrong, computed.motion), of(right, computed.motion), tolerance)
            for about, unit, tolerance, of in MEASURES[key]
        ]
        formulas.append(Misprint(key, formula["place"], formula["error"], wrong, right, tuple(evidence)))
    return [
        *formulas,
        _bracket_16(printed, computed),
        _coefficient_16(printed),
        _copied_hessian(printed, computed.cases),
        *_elements_case_4(printed, computed.cases[3]),
        _sign_of_polynomials(printed),
        _copied_polynomial(printed, computed.cases),
    ]


def _bracket_16(printed: Printed, computed: Computed) -> Misprint:
    equation = printed["equation_16"]
    exact = hamiltonian_16(PAPER_SCENE, equation)
    q, p = computed.motion.y[:, :2], computed.momenta
    kinetic = computed.motion.kinetic

    def kinetic_error(corrected: bool) -> float:
        difference = printed_kinetic(equation, q, p, corrected=corrected) - kinetic
        return float(np.max(np.abs(difference)) / np.max(kinetic))

    fitted = Evidence(
        "remainder of the denominator that no coefficients in this shape remove, over its largest value",
        "1",
        exact.residual_as_printed,
        exact.residual_corrected,
        1e-12,
    )
    # The coefficients have two or three digits: 0.03 stands for 0.0267.
    along = Evidence(
        "largest error of the kinetic energy along the motion, over its largest value",
        "1",
        kinetic_error(False),
        kinetic_error(True),
        0.02,
    )
    error = "the bracket that `sin(phi)**2` multiplies is closed too early"
    both = _denominator(equation, False), _denominator(equation, True)
    return Misprint("equation_16_bracket", "Equation (16), denominator", error, *both, (fitted, along))


def _denominator(equation: Printed, corrected: bool) -> str:
    shape = equation["denominator"]
    inside, after = list(shape["inside"]), list(shape["after"])
    if corrected:
        inside, after = inside + after, []
    text = f"{_sum(shape['outside'])} + sin(phi)**2*({_sum(inside)})" + " + " * bool(after) + _sum(after)
    return text.replace("+ -", "- ").replace("+ 1*", "+ ")


def _sum(terms: Terms) -> str:
    return " + ".join(f"{term['value']}*{term['factor']}".removesuffix("*1") for term in terms)


def _coefficient_16(printed: Printed) -> Misprint:
    equation = printed["equation_16"]
    index = next(i for i, term in enumerate(equation["potential"]) if term["factor"] == "sin(phi)")
    other = next(term["value"] for term in printed["equation_20"]["phi"] if term["factor"] == "cos(phi)")
    return _wrong_digits(
        "equation_16_coefficient",
        "Equation (16), sin(phi)",
        f"no rounding of the same number that (20) prints as {other}",
        equation["potential"][index]["value"],
        float(hamiltonian_16(PAPER_SCENE, equation).potential.coefficients[index]),
    )


def _wrong_digits(key: str, place: str, error: str, value: str, exact: float) -> Misprint:
    """A number [J] that misses the computed one by more than half a unit in its last place."""
    places = len(value.partition(".")[2])
    right = f"{exact:.{places}f}"
    evidence = Evidence(
        f"difference from the computed {exact:.{places + 3}f}",
        "J",
        abs(float(value) - exact),
        abs(float(right) - exact),
        half_unit(value) * (1.0 + 1e-9),
    )
    return Misprint(key, place, error, value, right, (evidence,))


def _copied_hessian(printed: Printed, cases: tuple[Case, ...]) -> Misprint:
    entries = printed["table_3"]["case_1"]["hessian"]
    matrix, true = np.array(entries, dtype=np.float64), cases[0].equilibrium.hessian
    evidence = Evidence(
        "largest difference of the printed matrix from the Hessian at Case 1 (as printed) and at Case 3",
        "J",
        float(np.abs(matrix - true).max()),
        float(np.abs(matrix - cases[2].equilibrium.hessian).max()),
        half_unit(entries[0][0]) * (1.0 + 1e-9),
    )
    both = _matrix(entries), _matrix([[f"{value:.3f}" for value in row] for row in true])
    return Misprint("table_3_case_1", "Table 3, Case 1", "the matrix is a copy of Case 3", *both, (evidence,))


def _matrix(rows: list[list[str]]) -> str:
    return "[" + ", ".join("[" + ", ".join(row) + "]" for row in rows) + "]"


def _elements_case_4(printed: Printed, case: Case) -> list[Misprint]:
    entries = printed["table_3"]["case_4"]["hessian"]
    hessian = case.equilibrium.hessian
    upper = f"the matrix is symmetric, and the equal element is printed as {entries[1][0]}"
    places = (("c12", upper, 0, 1), ("c22", "the last digits are wrong", 1, 1))
    return [
        _wrong_digits(
            f"table_3_case_4_{c}", f"Table 3, Case 4, {c}", error, entries[i][j], float(hessian[i, j])
        )
        for c, error, i, j in places
    ]


def _sign_of_polynomials(printed: Printed) -> Misprint:
    leading = [float(printed["table_4"][name]["coefficients"][4]) for name in CASES]
    evidence = Evidence(
        "difference of the leading coefficient from 1, that of det(lambda - J)",
        "1",
        max(abs(value - 1.0) for value in leading),
        max(abs(-value - 1.0) for value in leading),
        0.0,
    )
    error = "the polynomials are printed with the opposite sign (their roots are the same)"
    return Misprint("table_4_sign", "Table 4", error, "... - lambda**4", "... + lambda**4", (evidence,))


def _copied_polynomial(printed: Printed, cases: tuple[Case, ...]) -> Misprint:
    patterns = printed["table_4"]["case_1"]["coefficients"]

    def contradictions(case: Case) -> float:
        values = printed_polynomial(patterns, case)
        return float(sum(not agrees_legibly(p, v) for p, v in zip(patterns, values, strict=True)))

    evidence = Evidence(
        "coefficients whose legible digits contradict the polynomial of Case 1 (as printed) and of Case 3",
        "1",
        contradictions(cases[0]),
        contradictions(cases[2]),
        0.0,
    )
    error = "a copy of Case 3, from which follows the remark that both cases have the same graphs"
    right = ", ".join(f"{value:.6g}" for value in printed_polynomial(patterns, cases[0]))
    return Misprint("table_4_case_1", "Table 4, Case 1", error, ", ".join(patterns), right, (evidence,))


def printed_polynomial(patterns: list[str], case: Case) -> Floats:
    """Coefficients of lambda^0 to lambda^4 with the sign that the print's leading coefficient has."""
    return case.classification.polynomial[::-1] * float(patterns[4])
