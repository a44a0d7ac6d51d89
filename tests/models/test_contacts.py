"""Devices with stops: energies over arrays, and motions and their ends against SciPy's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import bisect

import fastmech as fm
from fastmech.ensembles.status import Status

Array = NDArray[np.float64]

GAP, WALL, DAMPING = 1.2, 50.0, 0.4
FLOOR, SOLID, DRAG = -0.5, 500.0, 0.2

x, y = fm.lengths("x", -2.0, 2.0), fm.lengths("y", -2.0, 2.0)
k, gap = sympy.symbols("k gap")


def bumper() -> fm.Mechanism:
    """A mass of 1 kg in the double well (x^2 - 1)^2 / 4, whose right side has a stop."""
    return fm.Mechanism(
        x,
        {"k": WALL, "gap": GAP},
        points={"O": (0, 0), "P": (x, 0)},
        masses={"P": 1.0},
        dampers=[fm.Damper("O", "P", DAMPING, along=(1, 0))],
        potential=(x**2 - 1) ** 2 / 4 + k * sympy.Max(0, x - gap) ** 2 / 2,
    )


def floored() -> fm.Mechanism:
    """A mass of 1 kg in the plane, in two wells above a floor."""
    return fm.Mechanism(
        (x, y),
        {"k": SOLID, "gap": FLOOR},
        kinetic=(x.dot**2 + y.dot**2) / 2,
        potential=(x**2 - 1) ** 2 / 2 + y**2 + x * y / 9 + k * sympy.Max(0, gap - y) ** 2 / 2,
        dissipation=DRAG * (x.dot**2 + y.dot**2) / 2,
    )


def of_bumper(_: float, s: Array) -> list[float]:
    q, v = s
    return [v, -q * (q**2 - 1.0) - WALL * max(0.0, q - GAP) - DAMPING * v]


def of_floored(_: float, s: Array) -> list[float]:
    q, h, v, w = s
    across = -2.0 * q * (q**2 - 1.0) - h / 9.0 - DRAG * v
    return [v, w, across, -2.0 * h - q / 9.0 + SOLID * max(0.0, FLOOR - h) - DRAG * w]


def ends(rates: Callable[..., Any], starts: Array, t_end: float) -> Array:
    """Last states, by SciPy."""
    runs = [solve_ivp(rates, (0.0, t_end), s, "DOP853", rtol=1e-10, atol=1e-12) for s in starts]
    return np.array([run.y[:, -1] for run in runs])


BOTH = pytest.mark.parametrize(
    ("made", "rates", "most", "away"),
    [
        (bumper, of_bumper, [1.4, 1.4], [0.4, 1.4]),
        (floored, of_floored, [1.2, 0.6, 1.0, 1.0], [0.8, 0.45, 1.0, 1.0]),
    ],
)


@BOTH
def test_motions_and_their_ends_are_scipy_s(
    made: Any, rates: Any, most: list[float], away: list[float]
) -> None:
    mechanism, n = made(), len(most) // 2
    starts = np.random.default_rng(3).uniform(-1.0, 1.0, (40, len(most))) * most
    run = fm.integrate(mechanism, starts, 3.0, dt=1e-3)
    assert not run.status.any()
    np.testing.assert_allclose(run.y[-1], ends(rates, starts, 3.0), atol=1e-5)
    labels, rest = fm.label_starts(mechanism, starts), ends(rates, starts, 100.0)
    assert (labels.well >= 0).all()
    places = np.array([e.position for e in labels.tree.equilibria])
    np.testing.assert_allclose(places[labels.well], rest[:, :n], atol=1e-3)
    assert np.unique(labels.well).size == 2


@BOTH
def test_disturbed_rest_ends_where_scipy_s_does(
    made: Any, rates: Any, most: list[float], away: list[float]
) -> None:
    mechanism = made()
    right = next(e for e in fm.find_equilibria(mechanism) if e.position[0] > 0.5)
    changes = np.random.default_rng(4).uniform(-1.0, 1.0, (30, len(away))) * away
    told = fm.disturb(mechanism, right, disturbances=changes)
    still = np.zeros_like(right.position)
    rest = ends(rates, changes + np.concatenate([right.position, still]), 100.0)
    returned, elsewhere = (told.outcome == status for status in (Status.RETURNED, Status.ELSEWHERE))
    assert (rest[returned, 0] > 0.0).all()
    assert (rest[elsewhere, 0] < 0.0).all()
    assert min(returned.sum(), elsewhere.sum()) > 3
    assert (returned | elsewhere).sum() > 27  # the others pass very near a saddle


def test_the_least_blow_that_leaves_rebounds_from_the_stop() -> None:
    """To the right, where only the way back leads out."""
    mechanism = bumper()
    right = next(e for e in fm.find_equilibria(mechanism) if e.position[0] > 0.5)
    told = fm.shock_limit(mechanism, right, "P", 0.0)
    least = bisect(lambda v: ends(of_bumper, np.array([[1.0, v]]), 60.0)[0, 0], 0.72, 2.0, xtol=1e-6)
    assert told.proved.impulse == pytest.approx(np.sqrt(0.5))
    assert least < told.found.impulse < 1.01 * least
    assert not told.undecided_from > least


def depth(u: Any) -> list[Any]:
    """How deep, squared, in several forms, and branches with several conditions."""
    return [
        sympy.Max(0, u) ** 2,
        sympy.Min(0, -u) ** 2,
        sympy.Heaviside(u) * u**2,
        sympy.Piecewise((0, u < 0), (u**2, True)),
        sympy.Piecewise((u**2, (u > 0) & ((u < 9) | (k < gap))), (0, True)),
    ]


@pytest.mark.parametrize("form", range(5))
def test_energies_of_arrays_are_those_of_single_states(form: int) -> None:
    """Of none too; parameters alone may decide, and have a value for each state."""
    potential = (1 + sympy.Max(k, gap)) * depth(x - gap)[form] + sympy.Piecewise((x, k > 1), (x**2, True))
    mechanism = fm.Mechanism(x, {"k": 0.4, "gap": 0.3}, kinetic=x.dot**2, potential=potential)
    rng = np.random.default_rng(5)
    states, stiff, gaps = rng.uniform(-1, 1, (7, 3, 2)), rng.uniform(0, 2, (7, 3)), rng.uniform(-1, 1, (7, 3))
    potentials = mechanism.energies(states, {"k": stiff, "gap": gaps}).potential
    deep = np.maximum(0.0, states[..., 0] - gaps) ** 2
    first = np.where(stiff > 1.0, states[..., 0], states[..., 0] ** 2)
    np.testing.assert_allclose(potentials, (1.0 + np.maximum(stiff, gaps)) * deep + first, rtol=1e-13)
    assert mechanism.energies(np.zeros((0, 2))).potential.shape == (0,)
    assert mechanism.energies([-0.5, 0.0]).potential == pytest.approx(0.25)


def test_a_branch_that_is_not_taken_may_divide_by_zero() -> None:
    sinc = sympy.Piecewise((1, sympy.Eq(x, 0)), (sympy.sin(x) / x, True))
    mechanism = fm.Mechanism(x, kinetic=x.dot**2, potential=sinc)
    assert mechanism.evaluate("energies", [0.0, 0.0])[1] == 1.0
    np.testing.assert_allclose(
        mechanism.energies([[0.0, 0.0], [0.5, 0.0]]).potential, [1.0, np.sin(0.5) / 0.5]
    )
