"""Tableaus: trees, order conditions, refusals, packing; coefficients against independent ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from fractions import Fraction
from math import factorial, prod
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.integrate import DOP853, RK45

from fastmech.integrators.explicit import TERMS, formula_of, weights_of
from fastmech.integrators.tableau import Tableau, Tree, rooted_trees
from fastmech.integrators.tableaus import TABLEAUS

pytestmark = pytest.mark.nojit

EVERY_TABLEAU = pytest.mark.parametrize("name", TABLEAUS)


def kutta(**changes: Any) -> Tableau:
    """The classical method with something changed."""
    data: dict[str, Any] = {
        "name": "kutta",
        "order": 4,
        "a": [[], [0.5], [0.0, 0.5], [0.0, 0.0, 1.0]],
        "b": [1 / 6, 1 / 3, 1 / 3, 1 / 6],
        "c": [0.0, 0.5, 0.5, 1.0],
        "source": "test",
    }
    return Tableau(**(data | changes))


def test_number_of_rooted_trees() -> None:
    """Hairer, Norsett, Wanner, table II.2.1 (OEIS A000081)."""
    known = [1, 1, 2, 4, 9, 20, 48, 115, 286, 719, 1842]
    assert [len(rooted_trees(order)) for order in range(1, 12)] == known


def test_rooted_trees_differ() -> None:
    for order in range(1, 12):
        assert len(set(rooted_trees(order))) == len(rooted_trees(order))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"a": [[], [0.5], [0.0, 0.5 + 1e-11], [0.0, 0.0, 1.0]]}, "row 2 of a sums to 0.5"),
        ({"c": [0.0, 0.5, 0.25, 1.0]}, "row 2 of a sums to 0.5, its node is 0.25"),
        ({"a": [[], [0.5], [0.5], [0.0, 0.0, 1.0]]}, "row 2 of a has 1 entries, must have 2"),
        ({"a": [[0.0], [0.5], [0.0, 0.5], [0.0, 0.0, 1.0]]}, "row 0 of a has 1 entries, must have 0"),
        ({"a": [[], [0.5], [0.0, 0.5]]}, "disagree on the number of stages"),
        ({"b": [1 / 6, 2 / 3, 1 / 6]}, "disagree on the number of stages"),
        ({"c": [0.0, 0.5, 1.0]}, "disagree on the number of stages"),
        ({"b": [1 / 6, 1 / 3, 1 / 3, 1 / 6 + 1e-10]}, "condition of order 1 fails by 1.0e-10"),
        ({"b": [0.25, 0.25, 0.25, 0.25]}, "condition of order 3 fails"),
        ({"a": [[], [0.5], [0.5, 0.0], [0.0, 0.0, 1.0]]}, "condition of order 3 fails"),
        ({"order": 5}, "condition of order 5 fails"),
    ],
)
def test_a_wrong_tableau_is_refused(changes: dict[str, Any], message: str) -> None:
    kutta()
    with pytest.raises(ValueError, match=f"^kutta: .*{message}"):
        kutta(**changes)


@EVERY_TABLEAU
def test_order_is_neither_less_nor_more(name: str) -> None:
    """All conditions, also those that are not checked at import."""
    tableau = TABLEAUS[name]
    for order in range(1, tableau.order + 1):
        residuals, rounding = tableau.order_residuals(order)
        assert (residuals <= rounding).all()
        assert residuals.max() <= (1e-13 if name != "verner6" else 4e-11)
    assert tableau.order_residuals(tableau.order + 1)[0].max() > 1e-7


@EVERY_TABLEAU
def test_weights_as_arrays_are_the_tableau(name: str) -> None:
    tableau = TABLEAUS[name]
    weights = weights_of(formula_of(tableau))
    assert weights.start[0] == 0
    assert weights.start[-1] == weights.row.size == weights.weight.size
    for row, coefficients in enumerate([*tableau.a, tableau.b]):
        part = slice(weights.start[row], weights.start[row + 1])
        assert (part.stop - part.start) % TERMS == 0
        full = np.zeros(max(len(coefficients), 1))
        np.add.at(full, weights.row[part], weights.weight[part])
        np.testing.assert_array_equal(full[: len(coefficients)], coefficients)


@EVERY_TABLEAU
def test_names_and_sources(name: str) -> None:
    tableau = TABLEAUS[name]
    assert name == tableau.name == name.lower()
    assert tableau.source
    assert tableau.stages == len(tableau.b)


def rows(a: Any) -> list[list[float]]:
    return [[float(x) for x in row[:i]] for i, row in enumerate(a)]


@pytest.mark.parametrize(("name", "solver"), [("dopri5", RK45), ("dop853", DOP853)])
def test_coefficients_equal_scipy_s(name: str, solver: Any) -> None:
    """Each to one unit in the last place: SciPy divides the same fractions in its own order."""
    tableau, n = TABLEAUS[name], solver.n_stages
    for mine, theirs in zip(tableau.a, rows(solver.A[:n, :n]), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=3e-16, atol=0)
    np.testing.assert_allclose(tableau.b, solver.B[:n], rtol=3e-16, atol=0)
    np.testing.assert_allclose(tableau.c, solver.C[:n], rtol=3e-16, atol=0)


def fractions(*values: str) -> list[float]:
    return [float(Fraction(value)) for value in values]


#: Closed forms as printed by Hairer, Norsett, Wanner (tables II.1.1, II.1.2) and Ralston (1962): a, b, c.
CLOSED_FORMS: dict[str, tuple[Sequence[Sequence[str]], Sequence[str], Sequence[str]]] = {
    "euler": ([[]], ["1"], ["0"]),
    "midpoint": ([[], ["1/2"]], ["0", "1"], ["0", "1/2"]),
    "heun2": ([[], ["1"]], ["1/2", "1/2"], ["0", "1"]),
    "ralston2": ([[], ["2/3"]], ["1/4", "3/4"], ["0", "2/3"]),
    "heun3": ([[], ["1/3"], ["0", "2/3"]], ["1/4", "0", "3/4"], ["0", "1/3", "2/3"]),
    "rk4": (
        [[], ["1/2"], ["0", "1/2"], ["0", "0", "1"]],
        ["1/6", "2/6", "2/6", "1/6"],
        ["0", "1/2", "1/2", "1"],
    ),
    "rk38": (
        [[], ["1/3"], ["-1/3", "1"], ["1", "-1", "1"]],
        ["1/8", "3/8", "3/8", "1/8"],
        ["0", "1/3", "2/3", "1"],
    ),
}


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_coefficients_equal_the_closed_forms(name: str) -> None:
    a, b, c = CLOSED_FORMS[name]
    tableau = TABLEAUS[name]
    assert [list(row) for row in tableau.a] == [fractions(*row) for row in a]
    assert list(tableau.b) == fractions(*b)
    assert list(tableau.c) == fractions(*c)


def test_coefficients_of_tsit5() -> None:
    """Tsitouras (2011): c2 to c6 and b2 as chosen there, the row sums, the order, and the assumption on which
    the method is built, sum_i b_i a_ij = b_j (1 - c_j), all to 1e-14. A coefficient off by 1e-13 breaks one.
    """
    t = TABLEAUS["tsit5"]
    assert (t.c[1], t.c[2], t.c[3], t.c[4], t.c[5], t.b[1]) == (
        0.161,
        0.327,
        0.9,
        0.9800255409045097,
        1.0,
        0.01,
    )
    b, c = np.array(t.b), np.array(t.c)
    assert np.abs(t.matrix.sum(axis=1) - c).max() <= 2e-15
    assert np.abs(b @ t.matrix - b * (1 - c)).max() <= 5e-15
    assert max(t.order_residuals(order)[0].max() for order in range(1, 6)) <= 3e-14


def symmetry(tree: Tree) -> int:
    """Number of automorphisms of a rooted tree."""
    return prod(factorial(n) * symmetry(child) ** n for child, n in Counter(tree).items())


@pytest.mark.parametrize(("name", "printed"), [("verner6", 1.44617e-6), ("verner7", 1.675585e-5)])
def test_principal_errors_of_verner_s_pairs(name: str, printed: float) -> None:
    """Norm of the error coefficients of the first order not reached; J. Verner names the pairs by it."""
    tableau = TABLEAUS[name]
    residuals, _ = tableau.order_residuals(tableau.order + 1)
    weights = [symmetry(tree) for tree in rooted_trees(tableau.order + 1)]
    assert np.linalg.norm(residuals / weights) == pytest.approx(printed, rel=5e-6)


@pytest.mark.parametrize(("name", "interior"), [("cooper_verner8", 3), ("hairer10", 4)])
def test_weights_are_lobatto_s(name: str, interior: int) -> None:
    """Cooper, Verner and Hairer build on Lobatto quadrature; stages that cancel carry opposite weights."""
    tableau = TABLEAUS[name]
    legendre = np.polynomial.legendre.Legendre.basis(interior + 1)
    inner = legendre.deriv().roots()
    nodes = (np.concatenate([[-1.0], inner, [1.0]]) + 1) / 2
    weights = 1.0 / ((interior + 1) * (interior + 2) * legendre(2 * nodes - 1) ** 2)
    found = [sum(b for b, c in zip(tableau.b, tableau.c, strict=True) if abs(c - x) < 1e-12) for x in nodes]
    np.testing.assert_allclose(found, weights, rtol=1e-13)


def test_coefficients_of_cooper_verner8() -> None:
    """A row of the closed form (Cooper and Verner, 1972), which the module computes by conjugates."""
    with mpmath.workdps(30):
        root = mpmath.sqrt(21)
        row = [(10 - root) / 42, 0, (-432 + 92 * root) / 315, (633 - 145 * root) / 90,
               (-504 + 115 * root) / 70, (63 - 13 * root) / 35]  # fmt: skip
    np.testing.assert_allclose(TABLEAUS["cooper_verner8"].a[6], np.array(row, dtype=float), rtol=5e-16)


def test_every_method_has_independent_coefficients() -> None:
    """A new method needs its own check here."""
    others = {"dopri5", "tsit5", "dop853", "verner6", "verner7", "cooper_verner8", "hairer10"}
    assert set(TABLEAUS) == set(CLOSED_FORMS) | others
