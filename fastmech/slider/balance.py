"""Energy balance of a motion: what energy it has lost must be what damper and force have done."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.ensembles import checks
from fastmech.ensembles.run import run_ensemble
from fastmech.errors import InputError
from fastmech.integrators.methods import find_method
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.equilibria import find_equilibria
from fastmech.slider.lagrange import kinetic_energy, potential_energy, unit


@dataclass(frozen=True)
class EnergyBalance:
    """Energies and works of one motion at its output times, each of shape (times,)."""

    t: Floats  #: s
    y: Floats  #: states phi, theta [rad], phi', theta' [rad/s], shape (times, 4)
    kinetic: Floats  #: T [J]
    potential: Floats  #: Pi [J], without the force
    work_damper: Floats  #: J since t = 0, never positive
    work_force: Floats  #: J since t = 0
    residual: Floats  #: T + Pi at t, less that at t = 0, less both works [J]: the integration's error
    largest_energy: float  #: largest T + Pi - min Pi [J]: what the residual is to be compared with

    @property
    def relative_residual(self) -> float:
        """Largest residual over the largest energy above the lowest possible one."""
        return float(np.max(np.abs(self.residual)) / self.largest_energy)


def energy_balance(
    scene: Scene, y0: ArrayLike, t_eval: ArrayLike, dt: float = 0.01, method: str = "dop853"
) -> EnergyBalance:
    """Integrate one motion together with the works of damper and force, paper (8), (10) and (13).

    Args:
        scene: the mechanism, with any terms.
        y0: start, shape (4,): phi, theta [rad], phi', theta' [rad/s].
        t_eval: output times [s], rising, not negative.
        dt: longest step [s].
        method: a name from :data:`fastmech.integrators.methods.METHODS`.

    Raises:
        InputError: an argument is wrong.
    """
    # Its kernel's source is written when the module is imported, which checking a request must not do.
    from fastmech.slider.kernels.work import lagrange_work

    start = checks.states("y0", y0, 4)
    if len(start) != 1:
        raise InputError(f"y0: holds {len(start)} states, must be one")
    outputs = checks.rising_times("t_eval", t_eval)
    times = np.concatenate([[0.0], outputs])
    with_works = np.concatenate([start, np.zeros((1, 2))], axis=1)
    params = np.array(reduce(scene), dtype=np.float64)
    dt = checks.number("dt", dt, "s", above=0.0)
    run = run_ensemble(lagrange_work, params, with_works, times, dt, method=find_method(method), threads=1)
    y = run.states[:, 0, :4]
    works = unit(scene) * run.states[:, 0, 4:]
    kinetic, potential = kinetic_energy(scene, y), potential_energy(scene, y[:, :2])
    at_start = float(kinetic_energy(scene, start[0]) + potential_energy(scene, start[0, :2]))
    energy = kinetic + potential
    highest = max(at_start, float(np.max(energy)))
    return EnergyBalance(
        t=outputs,
        y=y,
        kinetic=kinetic,
        potential=potential,
        work_damper=works[:, 0],
        work_force=works[:, 1],
        residual=energy - at_start - works.sum(axis=1),
        # A motion at rest in the minimum has no energy but rounding to compare with.
        largest_energy=max(highest - lowest_potential(scene), float(np.spacing(abs(highest)))),
    )


def lowest_potential(scene: Scene) -> float:
    """Least potential energy Pi over both angles [J]."""
    found = find_equilibria(scene.replace(F0=0.0))
    if found:
        return float(found.energy[0])
    c = reduce(scene)  # Pi is a single sinusoid
    return (scene.c1 + scene.c2) * scene.l**2 - unit(scene) * (abs(c.lift) + c.gravity + c.spring)
