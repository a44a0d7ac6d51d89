"""Every method of the registry shows its order, on a linear system of the user's own and on the mechanism."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from integrators.systems import linear_error, mechanism_error

from fastmech.integrators.tableaus import METHODS

#: Fewest and most steps by order: errors fall as they should, and stay well above rounding.
LINEAR_STEPS = {1: (2560, 10240), 2: (160, 640), 3: (160, 640), 4: (160, 640), 5: (320, 1280), 8: (56, 160)}
MECHANISM_STEPS = {1: (1280, 5120), 2: (80, 320), 3: (40, 160), 4: (40, 160), 5: (80, 226), 8: (14, 26)}


def slope(error: Callable[[str, int], float], method: str, fewest: int, most: int) -> float:
    """Order by a straight line through five points of log error against log steps."""
    steps = np.unique(np.geomspace(fewest, most, 5).round().astype(int))
    errors = [error(method, int(n)) for n in steps]
    assert max(errors) < 0.05
    return float(-np.polyfit(np.log(steps), np.log(errors), 1)[0])


@pytest.mark.parametrize("method", METHODS)
def test_order_on_a_linear_system(method: str) -> None:
    """Forced, so that the nodes matter too."""
    order = METHODS[method].order
    assert slope(linear_error, method, *LINEAR_STEPS[order]) == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("method", METHODS)
def test_order_on_the_mechanism(method: str) -> None:
    order = METHODS[method].order
    assert slope(mechanism_error, method, *MECHANISM_STEPS[order]) == pytest.approx(order, abs=0.15)
