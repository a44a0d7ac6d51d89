"""The registry: names, sources, what a step costs."""

from __future__ import annotations

import numpy as np
import pytest
from integrators.driving import counting, drive

from fastmech.errors import InputError
from fastmech.integrators.methods import METHODS, ImplicitRungeKutta, find_method
from fastmech.integrators.tableaus import TABLEAUS

pytestmark = pytest.mark.nojit

EVERY_METHOD = pytest.mark.parametrize("name", METHODS)


@EVERY_METHOD
def test_names_and_sources(name: str) -> None:
    method = METHODS[name]
    assert name == method.name == name.lower()
    assert method.source
    assert find_method(name) is method


def test_every_tableau_is_a_method() -> None:
    assert set(TABLEAUS) <= set(METHODS)
    for name, tableau in TABLEAUS.items():
        assert (METHODS[name].order, METHODS[name].start_steps) == (tableau.order, 0)


@pytest.mark.parametrize("steps", [0, 1, 5, 40])
@EVERY_METHOD
def test_right_hand_sides_a_run(name: str, steps: int) -> None:
    """Counted by the right-hand side itself; an implicit method's count is what it usually takes at most."""
    *_, calls = drive(counting, name, np.zeros((1, 1)), np.array([0.0, 2.0]), [steps], np.zeros(1))
    expected = METHODS[name].evaluations(steps)
    if isinstance(METHODS[name], ImplicitRungeKutta):
        assert steps * METHODS[name].tableau.stages <= calls[0, 0] <= expected
    else:
        assert calls[0, 0] == expected


def test_unknown_method_lists_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"^method = 'rk5': unknown; known: euler, .*dop853.*abm12.*sdirk4$"):
        find_method("rk5")
