"""The paper's misprints: for each the print and what must stand there, both evaluated.

Nothing here is believed: a candidate counts as a misprint only if every measure of the print exceeds its
tolerance while the corrected one stays below it. With a right print the same code reports none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastmech.paper.coefficients import Floats, Terms, hamiltonian_16, printed_kinetic
from fastmech.paper.compute import Case, Computed
from fastmech.paper.formulas import formula_evidence
from fastmech.paper.printed import CASES, Printed, agrees_legibly, half_unit
from fastmech.paper.scene import PAPER_SCENE


@dataclass(frozen=True)
class Evidence:
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


@dataclass(frozen=True)
class Misprint:
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
    formulas = [
        Misprint(
            key=key,
            place=formula["place"],
            error=formula["error"],
            printed=formula["printed"],
            corrected=formula["corrected"],
            evidence=tuple(Evidence(*item) for item in formula_evidence(key, formula, computed.motion)),
        )
        for key, formula in printed["formula"].items()
    ]
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
    return Misprint(
        key="equation_16_bracket",
        place="Equation (16), denominator",
        error="the bracket that `sin(phi)**2` multiplies is closed too early",
        printed=_denominator(equation, False),
        corrected=_denominator(equation, True),
        evidence=(fitted, along),
    )


def _denominator(equation: Printed, corrected: bool) -> str:
    shape = equation["denominator"]
    inside, after = list(shape["inside"]), list(shape["after"])
    if corrected:
        inside, after = inside + after, []
    text = f"{_sum(shape['outside'])} + sin(phi)**2*({_sum(inside)})"
    return _signs(f"{text} + {_sum(after)}") if after else _signs(text)


def _sum(terms: Terms) -> str:
    return " + ".join(f"{term['value']}*{term['factor']}".removesuffix("*1") for term in terms)


def _signs(text: str) -> str:
    return text.replace("+ -", "- ").replace("+ 1*", "+ ")


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


def _hessian_distance(printed: Printed, name: str, case: Case) -> float:
    matrix = np.array(printed["table_3"][name]["hessian"], dtype=np.float64)
    return float(np.max(np.abs(matrix - case.equilibrium.hessian)))


def _copied_hessian(printed: Printed, cases: tuple[Case, ...]) -> Misprint:
    entries = printed["table_3"]["case_1"]["hessian"]
    true = cases[0].equilibrium.hessian
    evidence = Evidence(
        "largest difference of the printed matrix from the Hessian at Case 1 (as printed) and at Case 3",
        "J",
        _hessian_distance(printed, "case_1", cases[0]),
        _hessian_distance(printed, "case_1", cases[2]),
        half_unit(entries[0][0]) * (1.0 + 1e-9),
    )
    return Misprint(
        key="table_3_case_1",
        place="Table 3, Case 1",
        error="the matrix is a copy of Case 3",
        printed=_matrix(entries),
        corrected=_matrix([[f"{value:.3f}" for value in row] for row in true]),
        evidence=(evidence,),
    )


def _matrix(rows: list[list[str]]) -> str:
    return "[" + ", ".join("[" + ", ".join(row) + "]" for row in rows) + "]"


def _elements_case_4(printed: Printed, case: Case) -> list[Misprint]:
    entries = printed["table_3"]["case_4"]["hessian"]
    hessian = case.equilibrium.hessian
    upper = f"the matrix is symmetric, and the equal element is printed as {entries[1][0]}"
    lower = "the last digits are wrong"
    return [
        _wrong_digits(
            "table_3_case_4_c12", "Table 3, Case 4, c12", upper, entries[0][1], float(hessian[0, 1])
        ),
        _wrong_digits(
            "table_3_case_4_c22", "Table 3, Case 4, c22", lower, entries[1][1], float(hessian[1, 1])
        ),
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
    return Misprint(
        key="table_4_sign",
        place="Table 4",
        error="the polynomials are printed with the opposite sign (their roots are the same)",
        printed="... - lambda**4",
        corrected="... + lambda**4",
        evidence=(evidence,),
    )


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
    right = printed_polynomial(patterns, cases[0])
    return Misprint(
        key="table_4_case_1",
        place="Table 4, Case 1",
        error="a copy of Case 3, from which follows the remark that both cases have the same graphs",
        printed=", ".join(patterns),
        corrected=", ".join(f"{value:.6g}" for value in right),
        evidence=(evidence,),
    )


def printed_polynomial(patterns: list[str], case: Case) -> Floats:
    """Coefficients of lambda^0 to lambda^4 with the sign that the print's leading coefficient has."""
    return case.classification.polynomial[::-1] * float(patterns[4])
