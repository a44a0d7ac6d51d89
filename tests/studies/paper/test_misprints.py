from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles import TABLE_1, oracle

from fastmech.studies.paper.compare import Agreement, evaluate
from fastmech.studies.paper.compute import PAPER_SCENE, STATIC_SCENE, Computed
from fastmech.studies.paper.misprints import Misprint, candidates, kinetic_16, total
from fastmech.studies.paper.rows import all_rows

KEYS = (
    "text_rod",
    "equation_2",
    "equation_9",
    "equation_10",
    "equation_12",
    "equation_14",
    "equation_16_bracket",
    "equation_16_coefficient",
    "table_3_case_1",
    "table_3_case_4_c12",
    "table_3_case_4_c22",
    "table_4_sign",
    "table_4_case_1",
)
STATES = np.random.default_rng(2).uniform(-2.0, 2.0, (5, 4))


@pytest.fixture(scope="module")
def found(print_: dict[str, Any], computed: Computed) -> list[Misprint]:
    return candidates(print_, computed)


def test_every_known_misprint_is_proved(found: list[Misprint]) -> None:
    assert tuple(item.key for item in found if item.confirmed) == KEYS
    assert len(found) == len(KEYS)


def mend(printed: dict[str, Any], key: str, computed: Computed) -> None:
    """Print what is right, from the correction or from the oracle."""
    if key in printed["formula"]:
        printed["formula"][key]["printed"] = printed["formula"][key]["corrected"]
        return
    q = [(case.equilibrium.phi, case.equilibrium.theta) for case in computed.cases]
    if key == "equation_16_bracket":
        shape = printed["equation_16"]["denominator"]
        shape["inside"], shape["after"] = shape["inside"] + shape["after"], []
    elif key == "equation_16_coefficient":
        printed["equation_16"]["potential"][2]["value"] = "-303.23"
    elif key == "table_3_case_1":
        rows = oracle().hessian(TABLE_1, q[0], F=100)
        printed["table_3"]["case_1"]["hessian"] = [[f"{float(x):.2f}" for x in row] for row in rows]
    elif key == "table_3_case_4_c12":
        printed["table_3"]["case_4"]["hessian"][0][1] = "-202.67"
    elif key == "table_3_case_4_c22":
        printed["table_3"]["case_4"]["hessian"][1][1] = "-320.44"
    elif key == "table_4_sign":
        for number in range(4):
            falling = oracle().characteristic_polynomial(TABLE_1, q[number], F=100)
            rising = [f"{float(x):.4f}" for x in falling[:0:-1]]
            printed["table_4"][f"case_{number + 1}"]["coefficients"] = [*rising, "1"]
    elif key == "table_4_case_1":
        falling = oracle().characteristic_polynomial(TABLE_1, q[0], F=100)
        rising = [f"{-float(x):.3f}" for x in falling[:0:-1]]
        printed["table_4"]["case_1"]["coefficients"] = [*rising, "-1"]


@pytest.mark.parametrize("key", KEYS)
def test_a_right_print_is_no_misprint(changed: dict[str, Any], computed: Computed, key: str) -> None:
    mend(changed, key, computed)
    confirmed = {item.key for item in candidates(changed, computed) if item.confirmed}
    # The polynomials with the right sign include the right one of Case 1.
    gone = {"table_4_sign", "table_4_case_1"} if key == "table_4_sign" else {key}
    assert confirmed == set(KEYS) - gone
    rows = all_rows(changed, computed, confirmed)
    assert [row for row in rows if row.verdict == Agreement.DIFFERS or row.see in gone] == []


def test_with_all_mended_everything_agrees(changed: dict[str, Any], computed: Computed) -> None:
    for key in KEYS:
        mend(changed, key, computed)
    assert [item.key for item in candidates(changed, computed) if item.confirmed] == []
    assert all(row.verdict.good for row in all_rows(changed, computed, set()))


def test_a_wrong_correction_proves_nothing(changed: dict[str, Any], computed: Computed) -> None:
    formula = changed["formula"]["equation_12"]
    formula["corrected"] = formula["corrected"].replace("-4*cos", "-3*cos")
    item = next(item for item in candidates(changed, computed) if item.key == "equation_12")
    assert not item.confirmed


def test_corrected_christoffel_symbol_is_the_oracles(print_: dict[str, Any]) -> None:
    for phi, theta, *_ in STATES:
        true = float(oracle().christoffel(TABLE_1, (phi, theta))[0][0][0])
        names = {**PAPER_SCENE.parameters, "phi": phi}
        formula = print_["formula"]["equation_12"]
        assert evaluate(formula["corrected"], **names) == pytest.approx(true, rel=1e-12)
        assert evaluate(formula["printed"], **names) != pytest.approx(true, rel=1e-2)


def test_corrected_energies_are_the_oracles(print_: dict[str, Any]) -> None:
    points = ("x1", "y1", "x2", "y2", "x3", "y3")
    for y in STATES:
        places = (float(x) for x in oracle().positions(TABLE_1, y[:2]))
        angles = dict(zip(("phi", "theta", "phi_dot", "theta_dot"), y, strict=True))
        names = {**PAPER_SCENE.parameters, **dict(zip(points, places, strict=True)), **angles}
        kinetic, potential = print_["formula"]["equation_9"], print_["formula"]["equation_10"]
        T, Pi = float(oracle().kinetic_energy(TABLE_1, y)), float(oracle().potential(TABLE_1, y[:2]))
        assert evaluate(kinetic["corrected"], **names) == pytest.approx(T, rel=1e-12)
        assert evaluate(potential["corrected"], **names) == pytest.approx(Pi, rel=1e-12)


def test_numbers_in_closed_form_are_the_oracles(print_: dict[str, Any], computed: Computed) -> None:
    """(16) is the Hamiltonian and (20) the gradient of U, but for roundings, at any state."""
    equation, scene = print_["equation_16"], PAPER_SCENE
    q, v = STATES[:, :2], STATES[:, 2:]
    a = np.array([oracle().metric(TABLE_1, angles) for angles in q], dtype=float)
    p = np.einsum("nij,nj->ni", a, v)
    kinetic = [float(oracle().kinetic_energy(TABLE_1, y)) for y in STATES]
    potential = [float(oracle().potential(TABLE_1, angles)) for angles in q]
    np.testing.assert_allclose(kinetic_16(equation, q, p, True, scene), kinetic, rtol=1e-12)
    np.testing.assert_allclose(total(equation["potential"], q, scene), potential, rtol=1e-12)
    gradient = np.array([oracle().gradient(TABLE_1, angles, F=100) for angles in q], dtype=float)
    for k, conditions in enumerate(print_["equation_20"].values()):
        np.testing.assert_allclose(total(conditions, q, STATIC_SCENE), gradient[:, k], rtol=1e-11)
