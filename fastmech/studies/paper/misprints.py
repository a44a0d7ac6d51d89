"""The paper's misprints: for each the print and what must stand there, both evaluated.

Nothing here is believed: a candidate counts as a misprint only if every measure of the print exceeds its
tolerance while the corrected one stays below it. With a right print the same code reports none.

Coefficients of the printed formulas (16) and (20), found from the mechanism's functions. A formula that is a
sum of known functions of the angles times unknown numbers is fitted at many angles; if the functions are the
right ones nothing is left over, and the numbers are exact to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from fastmech.arrays import Floats
from fastmech.ensembles.balance import EnergyBalance
from fastmech.scene import Scene
from fastmech.slider.geometry import positions, velocities
from fastmech.slider.lagrange import (
    angular_accelerations,
    christoffel,
    generalized_forces,
    hamiltonian,
    metric,
    momenta,
    potential_energy,
    potential_gradient,
    rates,
)
from fastmech.studies.paper.compare import CASES, Printed, agrees_legibly, evaluate, half_unit
from fastmech.studies.paper.compute import PAPER_SCENE, START, Computed, PaperCase

Terms = list[dict[str, str]]

#: The term of the denominator of (16) whose coefficient is free.
FREE = "cos(4*phi)"


class Fit(NamedTuple):
    """Coefficients of a sum of terms and what it cannot represent."""

    coefficients: Floats
    residual: float  #: largest remainder over the largest value


def sample_angles(count: int = 400) -> Floats:
    """Angles spread over the torus, shape (count, 2)."""
    return np.random.default_rng(16).uniform(-np.pi, np.pi, (count, 2))


def term_values(terms: Terms, q: Floats) -> Floats:
    """The factors of ``terms`` at the angles ``q`` (n, 2), shape (n, terms)."""
    values = np.empty((len(q), len(terms)))
    for i, term in enumerate(terms):
        values[:, i] = evaluate(term["factor"], phi=q[:, 0], theta=q[:, 1])
    return values


def printed_sum(terms: Terms, q: Floats) -> Floats:
    """Sum of ``terms`` with their printed values."""
    return np.asarray(term_values(terms, q) @ np.array([float(term["value"]) for term in terms]))


def fit(terms: Terms, q: Floats, values: Floats) -> Fit:
    """Least-squares coefficients of ``terms`` for ``values`` (n,) at ``q`` (n, 2)."""
    return _fit(term_values(terms, q), values)


def _fit(basis: Floats, values: Floats) -> Fit:
    coefficients = np.asarray(np.linalg.lstsq(basis, values, rcond=None)[0], dtype=np.float64)
    remainder = np.max(np.abs(basis @ coefficients - values))
    return Fit(coefficients, float(remainder / np.max(np.abs(values))))


class Hamiltonian(NamedTuple):
    """(16) in its parts: each a fit in the order of the printed terms."""

    potential: Fit
    p_phi_2: Fit
    p_theta_2: Fit
    p_phi_p_theta: Fit
    outside: Floats  #: the denominator's coefficients
    inside: Floats
    residual_as_printed: float  #: what a denominator of the printed shape leaves over, at best
    residual_corrected: float  #: the same with the bracket closed after the last term


def hamiltonian_16(scene: Scene, equation: Printed) -> Hamiltonian:
    """Exact coefficients of (16) once the inner bracket of its denominator is closed after the last term.

    Numerators and denominator are determined up to a common factor; the paper's makes the denominator
    ``-(4 - sin^2 phi) det(a)/(m2 l^4)``. As cos 4 phi is a polynomial in sin^2 phi, its coefficient is free:
    it is taken as printed, and then all others are unique.
    """
    q = sample_angles()
    a = metric(scene, q)
    scale = -(4.0 - np.sin(q[:, 0]) ** 2) / (scene.m2 * scene.l**4)
    shape = equation["denominator"]
    outside: Terms = shape["outside"]
    taken = np.array([term["factor"] == FREE for term in outside])
    values = np.array([float(term["value"]) if term["factor"] == FREE else 0.0 for term in outside])
    functions = term_values(outside, q)
    rest = scale * np.linalg.det(a) - functions @ values
    square = np.sin(q[:, 0, None]) ** 2
    first = [functions[:, ~taken], square * term_values(shape["inside"], q)]
    after = term_values(shape["after"], q)
    corrected = _fit(np.hstack([*first, square * after]), rest)
    count = int(np.sum(~taken))
    values[~taken] = corrected.coefficients[:count]
    return Hamiltonian(
        potential=fit(equation["potential"], q, potential_energy(scene, q)),
        p_phi_2=fit(equation["p_phi_2"], q, scale * a[:, 1, 1] / 2.0),
        p_theta_2=fit(equation["p_theta_2"], q, scale * a[:, 0, 0] / 2.0),
        p_phi_p_theta=fit(equation["p_phi_p_theta"], q, -scale * a[:, 0, 1]),
        outside=values,
        inside=corrected.coefficients[count:],
        residual_as_printed=_fit(np.hstack([*first, after]), rest).residual,
        residual_corrected=corrected.residual,
    )


def printed_kinetic(equation: Printed, q: Floats, p: Floats, *, corrected: bool) -> Floats:
    """Kinetic part of (16) with its printed coefficients at ``q``, ``p`` (n, 2) [J].

    ``corrected`` closes the inner bracket of the denominator after the last term.
    """
    shape = equation["denominator"]
    square = np.sin(q[:, 0]) ** 2
    inside, after = printed_sum(shape["inside"], q), printed_sum(shape["after"], q)
    inner = square * (inside + after) if corrected else square * inside + after
    numerator = (
        p[:, 0] ** 2 * printed_sum(equation["p_phi_2"], q)
        + p[:, 1] ** 2 * printed_sum(equation["p_theta_2"], q)
        + p[:, 0] * p[:, 1] * printed_sum(equation["p_phi_p_theta"], q)
    )
    return np.asarray(numerator / (printed_sum(shape["outside"], q) + inner))


def equilibrium_20(scene: Scene, equation: Printed) -> dict[str, Fit]:
    """Exact coefficients of both conditions (20), by angle; the scene has the constant force."""
    q = sample_angles()
    gradient = potential_gradient(scene, q, scene.F0)
    return {angle: fit(equation[angle], q, gradient[:, i]) for i, angle in enumerate(("phi", "theta"))}


#: Angles over a turn, and time [s] of the deviation.
ANGLES, FIRST = 256, 1.0


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values)))


def _names(y: Floats, scale: float = 1.0) -> dict[str, Any]:
    """The paper's quantities at states ``y`` (n, 4), with lengths in units of 1/scale m."""
    scene = PAPER_SCENE.parameters
    scene["l"], scene["g"] = scene["l"] * scale, scene["g"] * scale
    points = {name: value * scale for name, value in positions(PAPER_SCENE, y)._asdict().items()}
    angles = dict(zip(("phi", "theta", "phi_dot", "theta_dot"), y.T, strict=True))
    return {**scene, **points, **angles}


def _residual(expression: str, motion: EnergyBalance) -> float:
    return _largest(evaluate(expression, **_names(motion.y)))


def _kinetic(expression: str, motion: EnergyBalance) -> float:
    scene, v = PAPER_SCENE, velocities(PAPER_SCENE, motion.y)
    true = 0.5 * (scene.m1 * (v.x1**2 + v.y1**2) + scene.m2 * (v.x2**2 + v.y2**2) + scene.m3 * v.x3**2)
    return _largest(evaluate(expression, **_names(motion.y)) - true)


def _imbalance(expression: str, motion: EnergyBalance) -> float:
    energy = motion.kinetic + evaluate(expression, **_names(motion.y))
    return _largest(energy - energy[0] - (motion.work_damper + motion.work_force))


def _change_of_units(expression: str, motion: EnergyBalance) -> float:
    metres, centimetres = (evaluate(expression, **_names(motion.y, scale)) for scale in (1.0, 100.0))
    return _largest(centimetres / 100.0**2 - metres)


def _christoffel(expression: str, motion: EnergyBalance) -> float:
    phi = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
    a11 = metric(PAPER_SCENE, np.stack([phi, np.zeros(ANGLES)], axis=-1))[:, 0, 0]
    # a11 is analytic and periodic: its Fourier series differentiates it to rounding.
    waves = np.fft.rfft(a11) * 1j * np.arange(ANGLES // 2 + 1)
    return _largest(
        evaluate(expression, **PAPER_SCENE.parameters, phi=phi) - 0.5 * np.fft.irfft(waves, ANGLES)
    )


def _canonical(expression: str, motion: EnergyBalance) -> float:
    q, p = motion.y[:, :2], momenta(PAPER_SCENE, motion.y)
    return _largest(_evaluated_rates(expression, q, p, motion.t) - _momentum_rates(motion.y, motion.t))


def _deviation(expression: str, motion: EnergyBalance) -> float:
    inside = motion.t[motion.t <= FIRST]

    def rhs(t: float, state: Floats) -> Floats:
        now, momentum = state[None, :2], state[None, 2:]
        slope = _evaluated_rates(expression, now, momentum, np.array([t]))
        return np.concatenate([rates(PAPER_SCENE, now, momentum)[0], slope[0]])

    start = np.concatenate([START[:2], momenta(PAPER_SCENE, START)])
    run = solve_ivp(rhs, (0.0, inside[-1]), start, "DOP853", inside, rtol=1e-9, atol=1e-9)
    return _largest(run.y[:2].T - motion.y[: inside.size, :2])


def _momentum_rates(y: Floats, t: Floats) -> Floats:
    """d/dt (a q') along a motion (n, 4) from Lagrange's accelerations; the symbols (12) give da/dq [N m]."""
    gamma = christoffel(PAPER_SCENE, y[:, :2])
    change = gamma + gamma.swapaxes(1, 2)
    inertia = np.einsum("nij,nj->ni", metric(PAPER_SCENE, y[:, :2]), angular_accelerations(PAPER_SCENE, y, t))
    return np.asarray(inertia + np.einsum("nijk,nj,nk->ni", change, y[:, 2:], y[:, 2:]))


def _evaluated_rates(expression: str, q: Floats, p: Floats, t: Floats) -> Floats:
    """Rates of the momenta by the printed or the corrected second half of (14), shape (n, 2)."""
    q_dot = rates(PAPER_SCENE, q, p)
    y = np.concatenate([q, q_dot], axis=1)
    nonpotential = generalized_forces(PAPER_SCENE, y, t) + potential_gradient(PAPER_SCENE, q)
    names: dict[str, Any] = {"dH_dp": q_dot, "Q": nonpotential}
    if "dH_dq" in expression:
        names["dH_dq"] = _gradient_of_hamiltonian(q, p)
    return np.asarray(evaluate(expression, **names))


def _gradient_of_hamiltonian(q: Floats, p: Floats) -> Floats:
    """dH/dq at fixed momenta by central differences of order six [N m], shape (n, 2)."""
    step = 4e-3
    gradient = np.zeros_like(q)
    for place, weight in ((1, 45.0), (2, -9.0), (3, 1.0)):
        for i in range(2):
            shift = np.zeros(2)
            shift[i] = place * step
            change = hamiltonian(PAPER_SCENE, q + shift, p) - hamiltonian(PAPER_SCENE, q - shift, p)
            gradient[:, i] += weight * change / (60.0 * step)
    return gradient


#: How wrong an expression is, along the paper's motion: what the measures of ``printed.toml`` name.
MEASURES: dict[str, Callable[[str, EnergyBalance], float]] = {
    "residual": _residual,
    "kinetic": _kinetic,
    "imbalance": _imbalance,
    "change_of_units": _change_of_units,
    "christoffel": _christoffel,
    "canonical": _canonical,
    "deviation": _deviation,
}


class MisprintEvidence(NamedTuple):
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
    evidence: tuple[MisprintEvidence, ...]

    @property
    def confirmed(self) -> bool:
        """Whether all evidence confirms it."""
        return all(item.confirmed for item in self.evidence)


def candidates(printed: Printed, computed: Computed) -> list[Misprint]:
    """Every place of the paper that was found suspect, in the paper's order, with evidence computed now."""
    formulas, motion = [], computed.motion
    for key, formula in printed["formula"].items():
        wrong, right = formula["printed"], formula["corrected"]
        evidence = [
            MisprintEvidence(about, unit, MEASURES[of](wrong, motion), MEASURES[of](right, motion), tolerance)
            for about, unit, tolerance, of in formula["measures"]
        ]
        formulas.append(Misprint(key, formula["place"], formula["error"], wrong, right, tuple(evidence)))
    equation, cases = printed["equation_16"], computed.cases
    index = next(i for i, term in enumerate(equation["potential"]) if term["factor"] == "sin(phi)")
    other = next(term["value"] for term in printed["equation_20"]["phi"] if term["factor"] == "cos(phi)")
    exact = float(hamiltonian_16(PAPER_SCENE, equation).potential.coefficients[index])
    case_4, hessian = printed["table_3"]["case_4"]["hessian"], cases[3].equilibrium.hessian
    return [
        *formulas,
        _bracket_16(printed, computed),
        _wrong_digits(
            printed, "equation_16_coefficient", equation["potential"][index]["value"], exact, other
        ),
        _copied_hessian(printed, cases),
        _wrong_digits(printed, "table_3_case_4_c12", case_4[0][1], float(hessian[0, 1]), case_4[1][0]),
        _wrong_digits(printed, "table_3_case_4_c22", case_4[1][1], float(hessian[1, 1])),
        _sign_of_polynomials(printed),
        _copied_polynomial(printed, cases),
    ]


def _misprint(
    printed: Printed, key: str, both: tuple[str, str], *evidence: MisprintEvidence, other: str = ""
) -> Misprint:
    about = printed["misprint"][key]
    return Misprint(key, about["place"], about["error"].format(other=other), *both, evidence)


def _bracket_16(printed: Printed, computed: Computed) -> Misprint:
    equation = printed["equation_16"]
    exact = hamiltonian_16(PAPER_SCENE, equation)
    q, p, kinetic = computed.motion.y[:, :2], computed.momenta, computed.motion.kinetic
    wrong, right = (
        _largest(printed_kinetic(equation, q, p, corrected=corrected) - kinetic) / float(np.max(kinetic))
        for corrected in (False, True)
    )
    fitted = "remainder of the denominator that no coefficients in this shape remove, over its largest value"
    along = "largest error of the kinetic energy along the motion, over its largest value"
    return _misprint(
        printed,
        "equation_16_bracket",
        (_denominator(equation, False), _denominator(equation, True)),
        MisprintEvidence(fitted, "1", exact.residual_as_printed, exact.residual_corrected, 1e-12),
        # The coefficients have two or three digits: 0.03 stands for 0.0267.
        MisprintEvidence(along, "1", wrong, right, 0.02),
    )


def _denominator(equation: Printed, corrected: bool) -> str:
    shape = equation["denominator"]
    parts = shape["outside"], shape["inside"], shape["after"]
    if corrected:
        parts = shape["outside"], shape["inside"] + shape["after"], []
    outside, inside, after = (
        " + ".join(f"{term['value']}*{term['factor']}".removesuffix("*1") for term in terms)
        for terms in parts
    )
    text = f"{outside} + sin(phi)**2*({inside})" + " + " * bool(after) + after
    return text.replace("+ -", "- ").replace("+ 1*", "+ ")


def _wrong_digits(printed: Printed, key: str, value: str, exact: float, other: str = "") -> Misprint:
    """A number [J] that misses the computed one by more than half a unit in its last place."""
    places = len(value.partition(".")[2])
    right, about = f"{exact:.{places}f}", f"difference from the computed {exact:.{places + 3}f}"
    errors = abs(float(value) - exact), abs(float(right) - exact)
    evidence = MisprintEvidence(about, "J", *errors, half_unit(value) * (1.0 + 1e-9))
    return _misprint(printed, key, (value, right), evidence, other=other)


def _copied_hessian(printed: Printed, cases: tuple[PaperCase, ...]) -> Misprint:
    entries = printed["table_3"]["case_1"]["hessian"]
    hessians = [case.equilibrium.hessian for case in cases]
    evidence = MisprintEvidence(
        "largest difference of the printed matrix from the Hessian at Case 1 (as printed) and at Case 3",
        "J",
        _largest(np.array(entries, dtype=np.float64) - hessians[0]),
        _largest(np.array(entries, dtype=np.float64) - hessians[2]),
        half_unit(entries[0][0]) * (1.0 + 1e-9),
    )
    true = [[f"{value:.3f}" for value in row] for row in hessians[0]]
    wrong, right = (str([list(row) for row in rows]).replace("'", "") for rows in (entries, true))
    return _misprint(printed, "table_3_case_1", (wrong, right), evidence)


def _sign_of_polynomials(printed: Printed) -> Misprint:
    leading = [float(printed["table_4"][name]["coefficients"][4]) for name in CASES]
    wrong, right = (max(abs(sign * value - 1.0) for value in leading) for sign in (1.0, -1.0))
    about = "difference of the leading coefficient from 1, that of det(lambda - J)"
    both = "... - lambda**4", "... + lambda**4"
    return _misprint(printed, "table_4_sign", both, MisprintEvidence(about, "1", wrong, right, 0.0))


def _copied_polynomial(printed: Printed, cases: tuple[PaperCase, ...]) -> Misprint:
    patterns = printed["table_4"]["case_1"]["coefficients"]
    values = [printed_polynomial(patterns, cases[k]) for k in (0, 2)]
    wrong, right = (
        float(sum(not agrees_legibly(p, v) for p, v in zip(patterns, of_case, strict=True)))
        for of_case in values
    )
    about = "coefficients whose legible digits contradict the polynomial of Case 1 (as printed) and of Case 3"
    both = ", ".join(patterns), ", ".join(f"{value:.6g}" for value in values[0])
    return _misprint(printed, "table_4_case_1", both, MisprintEvidence(about, "1", wrong, right, 0.0))


def printed_polynomial(patterns: list[str], case: PaperCase) -> Floats:
    """Coefficients of lambda^0 to lambda^4 with the sign that the print's leading coefficient has."""
    return case.classification.polynomial[::-1] * float(patterns[4])
