"""Every method of the registry shows its order, on a linear system of the user's own and on the mechanism."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from integrators.systems import driven_error, linear_error, mechanism_error

from fastmech.integrators.methods import METHODS

#: Fewest and most steps by order: errors fall as they should, and stay well above rounding.
LINEAR_STEPS = {1: (2560, 10240), 2: (160, 640), 3: (160, 640), 4: (160, 640), 5: (320, 1280), 6: (28, 80),
                7: (80, 200), 8: (56, 160), 10: (28, 80)}  # fmt: skip
MECHANISM_STEPS = {1: (1280, 5120), 2: (80, 320), 3: (40, 160), 4: (40, 160), 5: (80, 226), 6: (7, 20),
                   7: (20, 56), 8: (14, 26), 10: (8, 20)}  # fmt: skip

#: The Adams methods need smaller steps: on the linear system, or where that is unstable on the driven one.
ADAMS_LINEAR_STEPS = {
    "ab5": (226, 905),
    "ab6": (320, 1280),
    "ab7": (452, 1280),
    "abm8": (113, 640),
    "abm10": (160, 400),
}
ADAMS_DRIVEN_STEPS = {"ab8": (905, 1810), "abm12": (905, 1280)}
ADAMS_MECHANISM_STEPS = {"ab5": (80, 320), "ab6": (113, 452), "ab7": (113, 452), "ab8": (160, 320),
                         "abm8": (40, 113), "abm10": (56, 113), "abm12": (80, 113)}  # fmt: skip

#: Methods whose leading error term is so small that the next one rules down to rounding (and, on the
#: mechanism, those whose error is down to rounding soon after the order begins to show): their error falls as
#: fast as their order says or faster. That the order is not higher is a matter of trees.
FASTER = {"verner6", "hairer10"}
FASTER_ON_THE_MECHANISM = FASTER | {"abm8", "abm10", "abm12"}


def slope(error: Callable[[str, int], float], method: str, fewest: int, most: int) -> float:
    """Order by a straight line through five points of log error against log steps."""
    steps = np.unique(np.geomspace(fewest, most, 5).round().astype(int))
    errors = [error(method, int(n)) for n in steps]
    assert max(errors) < 0.05
    return float(-np.polyfit(np.log(steps), np.log(errors), 1)[0])


def check(found: float, order: int, faster: bool) -> None:
    if faster:
        assert order - 0.15 <= found <= order + 2
    else:
        assert found == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("method", METHODS)
def test_order_on_a_linear_system(method: str) -> None:
    """Forced, so that the nodes matter too."""
    order = METHODS[method].order
    if method in ADAMS_DRIVEN_STEPS:
        found = slope(driven_error, method, *ADAMS_DRIVEN_STEPS[method])
    else:
        found = slope(linear_error, method, *ADAMS_LINEAR_STEPS.get(method, LINEAR_STEPS.get(order, (0, 0))))
    check(found, order, method in FASTER)


@pytest.mark.parametrize("method", METHODS)
def test_order_on_the_mechanism(method: str) -> None:
    order = METHODS[method].order
    steps = ADAMS_MECHANISM_STEPS.get(method, MECHANISM_STEPS.get(order, (0, 0)))
    check(slope(mechanism_error, method, *steps), order, method in FASTER_ON_THE_MECHANISM)
