"""Tableaus: trees, order conditions, refusals, packing; coefficients against independent ones."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from scipy.integrate import DOP853, RK45

from fastmech.errors import InputError
from fastmech.integrators.tableau import Tableau, rooted_trees
from fastmech.integrators.tableaus import METHODS, find_method

pytestmark = pytest.mark.nojit

EVERY_METHOD = pytest.mark.parametrize("name", METHODS)


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
    assert [len(rooted_trees(order)) for order in range(1, 9)] == [1, 1, 2, 4, 9, 20, 48, 115]


def test_rooted_trees_differ() -> None:
    for order in range(1, 9):
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


@EVERY_METHOD
def test_order_is_neither_less_nor_more(name: str) -> None:
    tableau = METHODS[name]
    for order in range(1, tableau.order + 1):
        assert tableau.order_residual(order) <= 1e-12
    assert tableau.order_residual(tableau.order + 1) > 1e-7


@EVERY_METHOD
def test_packed_tableau_is_the_tableau(name: str) -> None:
    tableau = METHODS[name]
    packed = tableau.packed
    assert packed.start[0] == 0
    assert packed.start[-1] == packed.stage.size == packed.weight.size
    assert np.all(packed.weight != 0)
    for row, coefficients in enumerate([*tableau.a, tableau.b]):
        part = slice(packed.start[row], packed.start[row + 1])
        full = np.zeros(len(coefficients))
        full[packed.stage[part]] = packed.weight[part]
        np.testing.assert_array_equal(full, coefficients)


@EVERY_METHOD
def test_names_and_sources(name: str) -> None:
    tableau = METHODS[name]
    assert name == tableau.name == name.lower()
    assert tableau.source
    assert find_method(name) is tableau
    assert tableau.stages == len(tableau.b)


def test_unknown_method_lists_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"^method = 'rk5': unknown; known: euler, .*dop853$"):
        find_method("rk5")


def rows(a: Any) -> list[list[float]]:
    return [[float(x) for x in row[:i]] for i, row in enumerate(a)]


@pytest.mark.parametrize(("name", "solver"), [("dopri5", RK45), ("dop853", DOP853)])
def test_coefficients_equal_scipy_s(name: str, solver: Any) -> None:
    """Each to one unit in the last place: SciPy divides the same fractions in its own order."""
    tableau, n = METHODS[name], solver.n_stages
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
    tableau = METHODS[name]
    assert [list(row) for row in tableau.a] == [fractions(*row) for row in a]
    assert list(tableau.b) == fractions(*b)
    assert list(tableau.c) == fractions(*c)


def test_coefficients_of_tsit5() -> None:
    """Tsitouras (2011): c2 to c6 and b2 as chosen there, the row sums, the order, and the assumption on which
    the method is built, sum_i b_i a_ij = b_j (1 - c_j), all to 1e-14. A coefficient off by 1e-13 breaks one.
    """
    t = METHODS["tsit5"]
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
    assert max(t.order_residual(order) for order in range(1, 6)) <= 3e-14


def test_every_method_has_independent_coefficients() -> None:
    """A new method needs its own check here."""
    assert set(METHODS) == set(CLOSED_FORMS) | {"dopri5", "tsit5", "dop853"}
