from __future__ import annotations

import numpy as np
import pytest
from ensembles.starts import random_starts
from integrators.systems import paper_motion
from oracles import oracle
from scipy.integrate import quad

from fastmech.ensembles.integrate import integrate
from fastmech.errors import InputError
from fastmech.scene import Scene
from fastmech.slider.balance import energy_balance, lowest_potential
from fastmech.slider.coefficients import force
from fastmech.slider.geometry import velocities

#: Terms in every combination, and the sign of the force.
SCENES = [
    Scene(),
    Scene(F0=-150.0, alpha=0.0),
    Scene(beta=0.0),
    Scene(F0=0.0),
    Scene(beta=0.0, F0=0.0, m3=0.0),
]


@pytest.mark.parametrize("scene", SCENES)
def test_energy_lost_is_work_done(scene: Scene) -> None:
    """To 1e-9 of the energy above the lowest possible one, from wild starts."""
    for start in random_starts(8, seed=3):
        balance = energy_balance(scene, start, [0.5, 1.0, 3.0], dt=0.005)
        assert balance.relative_residual < 1e-9
        assert np.all(balance.work_damper < 0) if scene.beta > 0 else np.all(balance.work_damper == 0)
        assert scene.F0 != 0 or np.all(balance.work_force == 0)


def test_works_are_integrals_of_powers_along_the_motion() -> None:
    """Gauss-Kronrod quadrature of -beta x3'^2 and F x2' over a dense motion, paper's scene and start."""
    scene, start, _, _ = paper_motion()

    def powers(t: float) -> tuple[float, float]:
        y = integrate(scene, start, t_eval=[t], method="dop853").y[0, 0] if t > 0 else start
        v = velocities(scene, y)
        return -scene.beta * float(v.x3) ** 2, float(force(scene, t) * v.x2)

    balance = energy_balance(scene, start, [1.0])
    for which, work in enumerate((balance.work_damper, balance.work_force)):
        right = quad(lambda t, which=which: powers(t)[which], 0.0, 1.0, epsabs=1e-9, epsrel=1e-9)[0]
        assert work[0] == pytest.approx(right, abs=1e-7)


@pytest.mark.nojit
def test_parts_of_the_balance() -> None:
    """Energies by the oracle at the states given; the residual is what the parts leave over."""
    scene, start, _, _ = paper_motion()
    params = scene.parameters
    balance = energy_balance(scene, start, [0.0, 0.1], dt=0.05)
    for i, y in enumerate(balance.y):
        assert balance.kinetic[i] == pytest.approx(float(oracle().kinetic_energy(params, y)), abs=1e-11)
        assert balance.potential[i] == pytest.approx(float(oracle().potential(params, y[:2])), abs=1e-10)
    energy = balance.kinetic + balance.potential
    works = balance.work_damper + balance.work_force
    np.testing.assert_allclose(balance.residual, energy - energy[0] - works, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(balance.y[0], start)
    assert balance.work_damper[0] == balance.work_force[0] == 0.0
    assert balance.relative_residual == np.abs(balance.residual).max() / balance.largest_energy


def test_the_residual_is_the_integration_s_error() -> None:
    """Halving the step divides it by about 2^4 with rk4."""
    scene, start, _, _ = paper_motion()
    coarse, fine = (
        np.abs(energy_balance(scene, start, [2.0], dt=dt, method="rk4").residual[0]) for dt in (0.02, 0.01)
    )
    assert np.log2(coarse / fine) == pytest.approx(4.0, abs=0.5)


@pytest.mark.nojit
def test_lowest_potential_of_table_1() -> None:
    """The unforced minimum stands upright: phi = pi/2, theta = 0 (reference data table_1_unforced)."""
    scene = paper_motion()[0]
    assert lowest_potential(scene) == pytest.approx(
        float(oracle().potential(scene.parameters, (np.pi / 2, 0.0))), abs=1e-9
    )


@pytest.mark.nojit
def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(InputError, match=r"^y0: has shape \(3,\), must be \(n, 4\)"):
        energy_balance(Scene(), [0.0, 0.0, 0.0], [1.0])
    with pytest.raises(InputError, match=r"^t_eval\[0\] = -1: must be finite"):
        energy_balance(Scene(), [0.0] * 4, [-1.0])
    with pytest.raises(InputError, match=r"^dt = 0: must be a finite number of s greater than 0"):
        energy_balance(Scene(), [0.0] * 4, [1.0], dt=0)
    with pytest.raises(InputError, match=r"^method = 'rk5': unknown"):
        energy_balance(Scene(), [0.0] * 4, [1.0], method="rk5")
