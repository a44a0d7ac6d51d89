"""Every quantity of the mechanism against the independent derivation, at random scenes and states."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from oracles import oracle
from slider import draws
from slider.draws import Draw, doubles

from fastmech.slider import coefficients, geometry, lagrange
from fastmech.slider.geometry import reactions

pytestmark = pytest.mark.nojit

TOLERANCE = 1e-12  # of the natural scale, see draws.py


def _oracle_accelerations(d: Draw) -> Any:
    """Of the points: central difference of the oracle's velocities along the motion, 25 digits."""
    from mpmath import mpf, workdps

    with workdps(40):
        h = mpf(10) ** -13
        qdd = oracle().accelerations(d.params, d.y, d.t)
        y = [mpf(float(x)) for x in d.y]

        def velocities(s: Any) -> Any:
            q = [y[i] + s * y[i + 2] + s**2 * qdd[i] / 2 for i in range(2)]
            return oracle().velocities(d.params, (*q, *(y[i + 2] + s * qdd[i] for i in range(2))))

        return [(a - b) / (2 * h) for a, b in zip(velocities(h), velocities(-h), strict=True)]


def _accelerations(d: Draw) -> Any:
    return geometry.accelerations(d.scene, d.y, lagrange.angular_accelerations(d.scene, d.y, d.t))


def _oracle_reactions(d: Draw) -> Any:
    r = oracle().reactions(d.params, d.y, d.t)
    return r.OM1, r.M1M2, r.M1M3, r.N


def _length(d: Draw) -> float:
    return d.scene.l


def _speed(d: Draw) -> float:
    return d.scene.l * float(np.abs(d.rates).sum())


def _inertia(d: Draw) -> float:
    return (d.scene.m2 + d.scene.m3) * d.scene.l**2


def _momentum(d: Draw) -> Any:
    return draws.metric_scale(d) @ np.abs(d.rates)


def _point_acceleration(d: Draw) -> float:
    return d.scene.l * float(draws.acceleration_scale(d).sum() + np.abs(d.rates).sum() ** 2)


#: name: (fastmech, oracle, natural scale)
QUANTITIES: dict[str, tuple[Callable[[Draw], Any], Callable[[Draw], Any], Callable[[Draw], Any]]] = {
    "positions (6)": (
        lambda d: geometry.positions(d.scene, d.y),
        lambda d: oracle().positions(d.params, d.q),
        _length,
    ),
    "velocities (7)": (
        lambda d: geometry.velocities(d.scene, d.y),
        lambda d: oracle().velocities(d.params, d.y),
        _speed,
    ),
    "accelerations of points": (_accelerations, _oracle_accelerations, _point_acceleration),
    "kinetic energy (8), (9)": (
        lambda d: lagrange.kinetic_energy(d.scene, d.y),
        lambda d: oracle().kinetic_energy(d.params, d.y),
        draws.kinetic_scale,
    ),
    "potential energy (10)": (
        lambda d: lagrange.potential_energy(d.scene, d.q),
        lambda d: oracle().potential(d.params, d.q),
        draws.energy_scale,
    ),
    "potential of spring, weight and force": (
        lambda d: lagrange.potential_energy(d.scene, d.q, d.scene.F0),
        lambda d: oracle().potential(d.params, d.q, d.scene.F0),
        draws.energy_scale,
    ),
    "gradient (17)": (
        lambda d: lagrange.potential_gradient(d.scene, d.q),
        lambda d: oracle().gradient(d.params, d.q),
        draws.energy_scale,
    ),
    "gradient with force (20)": (
        lambda d: lagrange.potential_gradient(d.scene, d.q, d.scene.F0),
        lambda d: oracle().gradient(d.params, d.q, d.scene.F0),
        draws.energy_scale,
    ),
    "hessian (19)": (
        lambda d: lagrange.potential_hessian(d.scene, d.q),
        lambda d: oracle().hessian(d.params, d.q),
        draws.energy_scale,
    ),
    "hessian with force (19)": (
        lambda d: lagrange.potential_hessian(d.scene, d.q, d.scene.F0),
        lambda d: oracle().hessian(d.params, d.q, d.scene.F0),
        draws.energy_scale,
    ),
    "metric (11)": (
        lambda d: lagrange.metric(d.scene, d.q),
        lambda d: oracle().metric(d.params, d.q),
        lambda d: draws.metric_scale(d).max(),
    ),
    "christoffel (12)": (
        lambda d: lagrange.christoffel(d.scene, d.q),
        lambda d: oracle().christoffel(d.params, d.q),
        _inertia,
    ),
    "force": (
        lambda d: coefficients.force(d.scene, d.t),
        lambda d: oracle().force(d.params, d.t),
        lambda d: abs(float(oracle().force(d.params, d.t))),
    ),
    "generalized forces": (
        lambda d: lagrange.generalized_forces(d.scene, d.y, d.t),
        lambda d: oracle().generalized_forces(d.params, d.q, d.rates, d.t),
        draws.force_scale,
    ),
    "angular accelerations (13)": (
        lambda d: lagrange.angular_accelerations(d.scene, d.y, d.t),
        lambda d: oracle().accelerations(d.params, d.y, d.t),
        draws.acceleration_scale,
    ),
    "momenta": (
        lambda d: lagrange.momenta(d.scene, d.y),
        lambda d: oracle().momenta(d.params, d.q, d.rates),
        _momentum,
    ),
    "canonical equations (14)": (
        lambda d: draws.canonical_equations(d.scene, d.q, d.p, d.t),
        lambda d: oracle().hamilton_rhs(d.params, d.q, d.p, d.t),
        draws.canonical_scale,
    ),
    "reactions": (lambda d: reactions(d.scene, d.y, d.t), _oracle_reactions, draws.reaction_scale),
}


@pytest.mark.parametrize("name", QUANTITIES)
def test_quantity(name: str) -> None:
    ours, theirs, scale = QUANTITIES[name]
    for number, d in enumerate(draws.draws()):
        actual, expected = doubles(ours(d)), doubles(theirs(d))
        assert actual.shape == expected.shape
        error = np.abs(actual - expected)
        assert np.all(error <= TOLERANCE * np.asarray(scale(d))), f"draw {number}: {d}, error {error}"


def test_draws_lack_every_combination_of_optional_terms() -> None:
    lacking = {
        tuple(getattr(d.scene, key) == 0 for key in ("m3", "beta", "F0", "alpha")) for d in draws.draws()
    }
    assert len(lacking) == 16
    assert any(d.scene.F0 < 0 for d in draws.draws())
    assert any(d.scene.F0 > 0 for d in draws.draws())
