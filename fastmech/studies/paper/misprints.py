"""The paper's misprints: for each the print and what must stand there, both evaluated.

Nothing here is believed: a candidate counts as a misprint only if every measure of the print exceeds its
tolerance while the corrected one stays below it. With a right print the same code reports none. The numbers
of (16) and (20) stand in ``printed.toml`` in closed form too.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.scene import Scene
from fastmech.slider import lagrange
from fastmech.slider.balance import EnergyBalance
from fastmech.slider.geometry import positions, velocities
from fastmech.studies.paper.compare import CASES, Printed, agrees_legibly, evaluate, half_unit
from fastmech.studies.paper.compute import PAPER_SCENE, Computed, PaperCase

Terms = list[dict[str, str]]


def coefficient(term: Mapping[str, str], scene: Scene | None = None) -> float:
    """The number before a term as printed; in closed form for a scene."""
    return float(term["value"]) if scene is None else float(evaluate(term["exact"], **scene.parameters))


def total(terms: Terms, q: Floats, scene: Scene | None = None) -> Floats:
    """Sum of ``terms`` at the angles ``q`` (n, 2), with their printed numbers or those of a scene."""
    phi, theta = q.T
    each = [coefficient(term, scene) * evaluate(term["factor"], phi=phi, theta=theta) for term in terms]
    return np.asarray(sum(each, 0.0 * phi))


def kinetic_16(
    equation: Printed, q: Floats, p: Floats, corrected: bool, scene: Scene | None = None
) -> Floats:
    """Kinetic part of (16) at ``q``, ``p`` (n, 2) [J], with its printed numbers or those of a scene.

    Numerators and denominator are determined up to a common factor; the paper's makes the denominator
    ``-(4 - sin^2 phi) det(a)/(m2 l^4)``. As cos 4 phi is a polynomial in sin^2 phi, its number is free: it is
    that of the print. ``corrected`` closes the inner bracket of the denominator after the last term.
    """
    shape, square = equation["denominator"], np.sin(q[:, 0]) ** 2
    inside, after = total(shape["inside"], q, scene), total(shape["after"], q, scene)
    inner = square * (inside + after) if corrected else square * inside + after
    products = {"p_phi_2": p[:, 0] ** 2, "p_theta_2": p[:, 1] ** 2, "p_phi_p_theta": p[:, 0] * p[:, 1]}
    numerator = sum(product * total(equation[part], q, scene) for part, product in products.items())
    return np.asarray(numerator / (total(shape["outside"], q, scene) + inner))


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values)))


class Measures:
    """How wrong expressions of ``printed.toml`` are along the paper's motion, by what is measured."""

    def __init__(self, motion: EnergyBalance) -> None:
        scene, y, self.kinetic = PAPER_SCENE, motion.y, motion.kinetic
        q, u, v = y[:, :2], y[:, 2:], velocities(scene, y)
        symbols = lagrange.christoffel(scene, q)
        gradient = lagrange.potential_gradient(scene, q)
        # The symbols (12) give d/dt (a q') along a motion from Lagrange's accelerations.
        change = np.einsum("nijk,nj,nk->ni", symbols + symbols.swapaxes(1, 2), u, u)
        accelerations = lagrange.angular_accelerations(scene, y, motion.t)
        self.true: dict[str, Any] = {
            "residual": 0.0,
            "kinetic": 0.5
            * (scene.m1 * (v.x1**2 + v.y1**2) + scene.m2 * (v.x2**2 + v.y2**2) + scene.m3 * v.x3**2),
            "imbalance": motion.work_damper + motion.work_force,
            "christoffel": symbols[:, 0, 0, 0],
            "canonical": np.einsum("nij,nj->ni", lagrange.metric(scene, q), accelerations) + change,
        }
        angles = dict(zip(("phi", "theta", "phi_dot", "theta_dot"), y.T, strict=True))
        self.names: dict[str, Any] = {
            **scene.parameters,
            **positions(scene, y)._asdict(),
            **angles,
            "dH_dp": u,
            # At fixed momenta dT/dq = -(1/2) q' (da/dq) q', and the symbols give da/dq.
            "dH_dq": gradient - np.einsum("njik,nj,nk->ni", symbols, u, u),
            "Q": lagrange.generalized_forces(scene, y, motion.t) + gradient,
        }

    def error(self, of: str, expression: str) -> float:
        """Largest difference from the truth."""
        value = evaluate(expression, **self.names)
        if of == "imbalance":  # a potential energy, of which the sum with T changes by the works
            energy = self.kinetic + value
            value = energy - energy[0]
        return _largest(value - self.true[of])


#: One measure of how wrong a print is, and the correction: what, unit, of the print, of the correction, and
#: what rounding explains.
Evidence = tuple[str, str, float, float, float]


class Misprint(NamedTuple):
    """A candidate for a misprint with its evidence."""

    key: str
    place: str
    error: str  #: in words, Markdown
    printed: str
    corrected: str
    evidence: list[Evidence]

    @property
    def confirmed(self) -> bool:
        """Whether all evidence speaks against the print and for the correction."""
        return all(wrong > tolerance >= right for _, _, wrong, right, tolerance in self.evidence)


def candidates(printed: Printed, computed: Computed) -> list[Misprint]:
    """Every place of the paper that was found suspect, in the paper's order, with evidence computed now."""
    found, cases, equation = [], computed.cases, printed["equation_16"]
    measures = Measures(computed.motion)
    for key, formula in printed["formula"].items():
        wrong, right = formula["printed"], formula["corrected"]
        about, unit, tolerance, of = formula["measure"]
        evidence = (about, unit, measures.error(of, wrong), measures.error(of, right), tolerance)
        found.append(Misprint(key, formula["place"], formula["error"], wrong, right, evidence=[evidence]))

    def add(key: str, both: Iterable[str], *evidence: Evidence, other: str = "") -> None:
        about = printed["misprint"][key]
        wrong, right = both
        told = about["error"].format(other=other)
        found.append(Misprint(key, about["place"], told, wrong, right, evidence=[*evidence]))

    def add_digits(key: str, value: str, exact: float, other: str = "") -> None:
        """A number [J] that misses the computed one by more than half a unit in its last place."""
        places = len(value.partition(".")[2])
        right, about = f"{exact:.{places}f}", f"difference from the computed {exact:.{places + 3}f}"
        errors = abs(float(value) - exact), abs(float(right) - exact)
        rounding = half_unit(value) * (1.0 + 1e-9)
        add(key, (value, right), (about, "J", *errors, rounding), other=other)

    add("equation_16_bracket", _denominators(equation), *_bracket_16(printed, computed))
    index = next(i for i, term in enumerate(equation["potential"]) if term["factor"] == "sin(phi)")
    other = next(term["value"] for term in printed["equation_20"]["phi"] if term["factor"] == "cos(phi)")
    exact = coefficient(equation["potential"][index], PAPER_SCENE)
    add_digits("equation_16_coefficient", equation["potential"][index]["value"], exact, other)

    entries, true = printed["table_3"]["case_1"]["hessian"], cases[0].equilibrium.hessian
    wrong, right = (_largest(np.array(entries, dtype=float) - cases[k].equilibrium.hessian) for k in (0, 2))
    about = "largest difference of the printed matrix from the Hessian at Case 1 (as printed) and at Case 3"
    texts = (
        str(list(map(list, rows))).replace("'", "") for rows in (entries, np.char.mod("%.3f", true).tolist())
    )
    evidence_1 = (about, "J", wrong, right, half_unit(entries[0][0]) * (1.0 + 1e-9))
    add("table_3_case_1", texts, evidence_1)
    case_4, hessian = printed["table_3"]["case_4"]["hessian"], cases[3].equilibrium.hessian
    add_digits("table_3_case_4_c12", case_4[0][1], float(hessian[0, 1]), case_4[1][0])
    add_digits("table_3_case_4_c22", case_4[1][1], float(hessian[1, 1]))

    leading = [float(printed["table_4"][name]["coefficients"][4]) for name in CASES]
    wrong, right = (max(abs(sign * value - 1.0) for value in leading) for sign in (1.0, -1.0))
    about = "difference of the leading coefficient from 1, that of det(lambda - J)"
    sign = (about, "1", wrong, right, 0.0)
    add("table_4_sign", ("... - lambda**4", "... + lambda**4"), sign)
    patterns = printed["table_4"]["case_1"]["coefficients"]
    values = [printed_polynomial(patterns, cases[k]) for k in (0, 2)]
    wrong, right = (
        float(sum(not agrees_legibly(p, v) for p, v in zip(patterns, each, strict=True))) for each in values
    )
    about = "coefficients whose legible digits contradict the polynomial of Case 1 (as printed) and of Case 3"
    both = ", ".join(patterns), ", ".join(f"{value:.6g}" for value in values[0])
    add("table_4_case_1", both, (about, "1", wrong, right, 0.0))
    return found


def _bracket_16(printed: Printed, computed: Computed) -> Iterator[Evidence]:
    motion, about = computed.motion, "largest error of the kinetic energy along the motion, over its largest"
    # The printed numbers have two or three digits: 0.03 stands for 0.0267.
    for numbers, scene, tolerance in (("as printed", None, 0.02), ("in closed form", PAPER_SCENE, 1e-12)):
        errors = (
            kinetic_16(printed["equation_16"], motion.y[:, :2], computed.momenta, corrected, scene)
            - motion.kinetic
            for corrected in (False, True)
        )
        wrong, right = (_largest(error) / _largest(motion.kinetic) for error in errors)
        yield f"{about}, numbers {numbers}", "1", wrong, right, tolerance


def _denominators(equation: Printed) -> list[str]:
    """The denominator of (16) as printed and as corrected."""
    texts, shape = list[str](), equation["denominator"]
    both: list[tuple[Terms, Terms]] = [
        (shape["inside"], shape["after"]),
        (shape["inside"] + shape["after"], []),
    ]
    for inner, last in both:
        outside, inside, after = (
            " + ".join(f"{term['value']}*{term['factor']}".removesuffix("*1") for term in terms)
            for terms in (shape["outside"], inner, last)
        )
        text = f"{outside} + sin(phi)**2*({inside})" + " + " * bool(after) + after
        texts.append(text.replace("+ -", "- ").replace("+ 1*", "+ "))
    return texts


def printed_polynomial(patterns: list[str], case: PaperCase) -> Floats:
    """Coefficients of lambda^0 to lambda^4 with the sign that the print's leading coefficient has."""
    return case.classification.polynomial[::-1] * float(patterns[4])
