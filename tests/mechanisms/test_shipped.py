"""Shipped mechanisms against closed forms from outside."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy
from scipy.optimize import brentq

import fastmech as fm
from fastmech import mechanisms
from fastmech.models.statics import Statics

pytestmark = pytest.mark.nojit


@pytest.mark.parametrize("name", mechanisms.__all__)
def test_every_one_is_built_described_and_named(name: str) -> None:
    make = getattr(fm.mechanisms, name)
    found = make(2) if name == "pendulum_chain" else make()
    assert make.__doc__
    assert found.name.startswith(name)
    assert set(found.units) == set(found.parameters)


def symbols(found: Statics) -> dict[str, sympy.Symbol]:
    return {str(s): s for s in (*found.parameters, *(c.symbol for c in found.coordinates))}


@pytest.mark.parametrize("rise", [0.05, 0.3, 1.0])
def test_the_truss_snaps_at_the_known_load(rise: float) -> None:
    """2 k L (1 - cos^(2/3) a)^(3/2): the greatest load on the symmetric path."""
    truss = mechanisms.von_mises_truss()
    half, k = truss.parameters["span"] / 2.0, truss.parameters["k"]
    L, cosine = math.hypot(half, rise), half / math.hypot(half, rise)
    wanted = 2.0 * k * L * (1.0 - cosine ** (2.0 / 3.0)) ** 1.5
    found = truss.statics()
    named = symbols(found)
    values = {named[name]: value for name, value in (truss.parameters | {"rise": rise, "P": 0.0}).items()}
    push = -found.forces[1].subs(values).subs(named["x"], 0)  # what holds the joint at a height
    y = named["y"]
    slope = sympy.lambdify(y, push.diff(y))
    height = brentq(slope, 1e-3 * rise, rise, xtol=1e-14)
    assert abs(float(push.subs(y, height))) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize(("kt", "stable"), [(9.8099, False), (9.8101, True)])
def test_the_cart_s_pendulum_stands_from_the_critical_stiffness_on(kt: float, stable: bool) -> None:
    """m g l = 9.81 N m."""
    _, _, K = mechanisms.cart_pendulum().replace(kt=kt).linear([0.0, 0.0])
    assert bool(np.linalg.eigvalsh(K)[0] > 0.0) == stable


def frequencies(P: float) -> np.ndarray:
    M, _, K = mechanisms.ziegler_column().replace(P=P).linear([0.0, 0.0])
    return np.sort_complex(np.linalg.eigvals(np.linalg.solve(M, K)))


def test_ziegler_s_column_coalesces_at_the_known_load() -> None:
    """P l / k = 7/2 - sqrt 2: the two squared frequencies become a complex pair."""
    critical = 3.5 - math.sqrt(2.0)
    assert np.isreal(frequencies(critical - 1e-9)).all()
    assert not np.isreal(frequencies(critical + 1e-9)).any()


@pytest.mark.parametrize("b", [0.05, 0.5, 1.0])
def test_dashpots_destabilize_ziegler_s_column_at_the_known_load(b: float) -> None:
    """41/28 + b^2/(2 k m l^2)."""

    def growth(P: float) -> float:
        M, C, K = mechanisms.ziegler_column().replace(P=P, b=b).linear([0.0, 0.0])
        A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
        return float(np.linalg.eigvals(A).real.max())

    wanted = 41.0 / 28.0 + b * b / 2.0
    assert brentq(growth, wanted - 0.1, wanted + 0.1, xtol=1e-13) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_the_chain_has_the_potential_that_is_written_down(n: int) -> None:
    chain = mechanisms.pendulum_chain(n)
    q = np.random.default_rng(n).uniform(-3.0, 3.0, (50, n))
    weights = np.arange(n, 0, -1.0)
    U = -(weights * (9.81 * np.cos(q) + 3.0 * np.sin(q))).sum(axis=1)
    U -= 12.0 * np.cos(np.diff(q, axis=1)).sum(axis=1)
    potential = chain.energies(np.concatenate([q, 0.0 * q], axis=1)).potential
    forces = chain.statics().forces
    named = symbols(chain.statics())
    values = {named[name]: value for name, value in chain.parameters.items()}
    at = [named[f"q{i + 1}"] for i in range(n)]
    gradient = sympy.lambdify(at, [-f.subs(values) for f in forces])
    h = 1e-6
    for place, level in zip(q, U, strict=True):
        for k, step in enumerate(h * np.eye(n)):
            w = place + step
            up = -(weights * (9.81 * np.cos(w) + 3.0 * np.sin(w))).sum() - 12.0 * np.cos(np.diff(w)).sum()
            assert gradient(*place)[k] == pytest.approx((up - level) / h, abs=1e-3)
    pushed = 3.0 * (weights * np.sin(q)).sum(axis=1)  # a load is no part of the potential energy
    np.testing.assert_allclose(potential - pushed, U, rtol=1e-12)


def test_a_chain_of_five_is_refused() -> None:
    with pytest.raises(fm.InputError, match="n = 5: must be a whole number from 1 to 4"):
        mechanisms.pendulum_chain(5)
