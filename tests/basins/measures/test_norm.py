from __future__ import annotations

import numpy as np
import pytest
from oracles import oracle

import fastmech as fm
from fastmech.basins.measures.labels import norm_on
from fastmech.disturbance.motion import kinetic_norm
from fastmech.slider.lagrange import kinetic_energy


def test_the_kinetic_norm_is_the_oracle_s() -> None:
    scene = fm.Scene(alpha=0.0)
    e = fm.find_equilibria(scene)[0]
    params, q = scene.parameters, (e.phi, e.theta)
    a = np.array(oracle().metric(params, q), dtype=np.float64)
    hessian = np.array(oracle().hessian(params, q, scene.F0), dtype=np.float64)
    square = np.linalg.eigvals(np.linalg.solve(a, hessian)).real.max()
    norm = kinetic_norm(scene, e)
    departures = np.random.default_rng(0).standard_normal((20, 4))
    xi, eta = departures[:, :2], departures[:, 2:]
    energy = np.einsum("ni,ij,nj->n", xi, a, xi) + np.einsum("ni,ij,nj->n", eta, a, eta) / square
    sizes = np.linalg.norm(departures @ norm, axis=1)
    np.testing.assert_allclose(sizes, np.sqrt(energy / (scene.m2 * scene.l**2)), rtol=1e-9)

    kicked = np.concatenate([np.tile(q, (20, 1)), eta], axis=1)
    kick = np.linalg.norm(eta @ norm_on(norm, 4, (2, 3)), axis=1)
    np.testing.assert_allclose(
        kinetic_energy(scene, kicked), kick**2 * square * scene.m2 * scene.l**2 / 2, rtol=1e-9
    )


def test_a_decaying_force_has_the_norm_of_the_equilibrium_s_frozen_one() -> None:
    decaying, free = fm.Scene(), fm.Scene(F0=0.0)
    e = fm.find_equilibria(decaying)[0]
    np.testing.assert_array_equal(kinetic_norm(decaying, e), kinetic_norm(free, e))


def test_a_norm_on_some_coordinates_is_that_of_departures_along_them() -> None:
    norm = np.random.default_rng(1).standard_normal((4, 4))
    departure = np.array([0.0, 0.3, 0.0, -1.2])
    part = norm_on(norm, 4, (3, 1))
    assert np.linalg.norm(np.array([-1.2, 0.3]) @ part) == pytest.approx(np.linalg.norm(departure @ norm))


def test_wrong_norms_are_refused() -> None:
    with pytest.raises(fm.InputError, match=r"^norm: is singular"):
        norm_on([[1.0, 1.0], [1.0, 1.0]], 2)
    with pytest.raises(fm.InputError, match=r"^coordinates = \[0, 0\]: must be different"):
        norm_on(np.eye(2), 2, (0, 0))
    with pytest.raises(fm.InputError, match=r"^norm: has shape \(1, 2\)"):
        norm_on([1.0, 1.0], 2)
