"""The capture certificate of the paper's mechanism, whose wells and ways down are known in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.capture.cells import Cells
from fastmech.capture.certificate import MEASURING, PHASE, CaptureCertificate, Early
from fastmech.disturbance.motion import damped_times
from fastmech.integrators.methods import ImplicitRungeKutta, Method, find_method, with_inverse
from fastmech.scene import Scene
from fastmech.slider.atlas.map import ROUNDING
from fastmech.slider.capture.barriers import BarrierTree, barrier_tree, frozen_coefficients
from fastmech.slider.capture.observe import bounded_cells, observe_capture, observe_capture_decaying
from fastmech.slider.capture.steps import (
    FINEST,
    coarse_steps,
    gone_at_once,
    highest_frequency,
    method_for,
    step_of_fading,
)
from fastmech.slider.coefficients import Coefficients, reduce
from fastmech.slider.equilibria import held
from fastmech.slider.kernels.inverse import lagrange_inverse
from fastmech.slider.kernels.select import right_hand_side
from fastmech.slider.lagrange import unit
from fastmech.slider.motion import SceneMotion
from fastmech.slider.reduced import metric_11, slider_ratio
from fastmech.step_limits.warning import grows, step_limit, warn_of_step


@dataclass(frozen=True)
class SceneCertificate(CaptureCertificate):
    """The barrier tree of a scene, ready for observers; energies are over m2 l^2."""

    system: Scene
    tree: BarrierTree
    work, fades = np.zeros(1), 1.0  # the observer knows what the force can still do

    @property
    def decays(self) -> bool:  # type: ignore[override]
        """Whether the force decays."""
        return self.system.F0 != 0.0 and self.system.alpha != 0.0

    @property
    def held(self) -> Scene:
        """The scene with the force that its equilibria hold for."""
        return held(self.system, self.tree.equilibria)

    @property
    def joule(self) -> float:  # type: ignore[override]
        """m2 l^2."""
        return unit(self.system)

    @property
    def amplitudes(self) -> float:  # type: ignore[override]
        """Sum of the potential's amplitudes over m2 l^2 [1/s^2]: the scale of its rounding."""
        c = reduce(self.system)
        return abs(c.lift) + c.spring + c.gravity + 2.0 * abs(c.force)

    @property
    def levels(self) -> Floats:
        """Energy over m2 l^2, less the springs' constant, below which each well captures [1/s^2]."""
        return self.reduced(self.tree.barrier) - ROUNDING * self.amplitudes

    def reduced(self, energy: Floats) -> Floats:
        """Energies [J] as kernels count them [1/s^2]."""
        scene = self.system
        return np.asarray((energy - (scene.c1 + scene.c2) * scene.l**2) / unit(scene))

    @property
    def energies(self) -> Floats:
        """Less the springs' constant."""
        return self.reduced(self.tree.equilibria.energy)

    @cached_property
    def cells(self) -> Cells:
        """In closed form."""
        return bounded_cells(self.coefficients)

    @property
    def half_widths(self) -> Floats:
        """Radii of balls."""
        return np.repeat(self.tree.radius[:, None], 2, axis=1)

    @property
    def coefficients(self) -> Floats:
        """Of the potential, and of the force where it decays."""
        decaying = (reduce(self.system).force, self.system.alpha) if self.decays else (0.0, 0.0)
        return np.append(frozen_coefficients(self.system, self.tree.equilibria), decaying)

    @property
    def observer(self) -> Any:
        """By whether the force decays."""
        return observe_capture_decaying if self.decays else observe_capture

    @property
    def motion(self) -> tuple[Any, Floats]:
        """Lagrange's equations."""
        c = reduce(self.system)
        return right_hand_side(c), np.array(c, dtype=np.float64)

    def method(self, name: str | None) -> str:
        """By default ``dop853``, or ``radau5`` where the damper would set its steps."""
        return method_for(self.system, name)

    def warn_of_step(self, dt: float, method: str) -> None:
        """See the base class."""
        warn_of_step([self.system], dt, method, stacklevel=3)

    def is_beyond(self, dt: float, steps: float, method: str) -> bool:
        """By linear theory."""
        return grows(self.system, dt, steps, method)

    def coarse_steps(self, starts: Floats) -> Floats:
        """From frequencies and energies."""
        return coarse_steps(reduce(self.system), starts)

    def early(self, method: Method) -> Early | None:
        """A force that dies out at once, and what a strong damper stops."""
        scene, rest, c = self.system, self, reduce(self.system)
        span, step = 0.0, np.inf
        if self.decays and gone_at_once(c):  # once all work that it can still do is less than rounding
            rest = SceneCertificate(scene.replace(F0=0.0, alpha=0.0), self.tree)
            span = float(np.log(40.0 * abs(c.force) / (ROUNDING * rest.amplitudes)) / c.decay)
            step = step_of_fading(c)
        stopped = PHASE / highest_frequency(reduce(rest.system))
        if damped_times(scene, method.name, stopped).size:
            span = max(span, stopped)
        return Early(rest, span, step) if span > 0.0 else None

    def impossible(self, starts: Floats, states: Floats, threads: int | None = 1) -> NDArray[np.bool_]:
        """By the energy bounds."""
        return SceneMotion(reduce(self.system)).impossible(starts, states, threads)

    def change(self, states: Floats, apart: Floats, push: Floats | None = None) -> Floats:
        """See :func:`energy_change`; ``push`` is the decaying force over m2 l, by default the whole."""
        c = reduce(self.system)
        most = (c.force if self.decays else 0.0) if push is None else push
        return energy_change(c, np.abs(most), states, apart)

    def measuring_steps(self, starts: Floats, method: str) -> Floats:
        """A share of the coarse step, and no longer than is stable, as far down as labels go."""
        coarse = self.coarse_steps(starts)
        implicit = isinstance(find_method(method), ImplicitRungeKutta)
        share = 0.5 * MEASURING if implicit else MEASURING
        stable = 0.9 * step_limit(self.system, method)
        return np.asarray(np.clip(stable, FINEST * coarse, share * coarse))

    @property
    def slow_step(self) -> float:
        """See the base class."""
        return PHASE / highest_frequency(reduce(self.system))

    def formula(self, method: str) -> Method:
        """With what solves Lagrange's systems."""
        return with_inverse(find_method(method), lagrange_inverse)

    def drives_rest(self, dt: float, steps: float, method: str) -> bool:
        """By linear theory."""
        return grows(self.system, dt, steps, method, damped=False)


def energy_change(c: Coefficients, push: Floats | float, states: Floats, apart: Floats) -> Floats:
    """Bound on how much the bounding energy of states (n, 4) changes over the box of half-widths ``apart``.

    Over m2 l^2 [1/s^2]. The change of U is at most its largest slope times the way; T is quadratic in the
    rates with coefficients whose slopes are at most ``slider max|k k'|`` and 1.
    """
    dphi, dtheta, du, dv = apart.T
    slope = (
        np.hypot(c.lift, c.force) * dphi + np.hypot(c.gravity, c.force) * dtheta + c.spring * (dphi + dtheta)
    )
    slope = slope + push * (dphi + dtheta)
    angles = np.linspace(-np.pi, np.pi, 721)
    k, dk = slider_ratio(np.sin(angles), np.cos(angles))
    a11 = metric_11(c.mass, c.slider, float(np.abs(k).max()))
    u, v = np.abs(states[:, 2]) + du, np.abs(states[:, 3]) + dv
    kinetic = (c.slider * float(np.abs(k * dk).max()) * u * u + u * v) * dphi + u * v * dtheta
    return np.asarray(slope + kinetic + (a11 * u + v) * du + (u + v) * dv)


@lru_cache(maxsize=16)
def scene_certificate(scene: Scene) -> SceneCertificate:
    """The capture certificate of a scene, kept for the next starts of the same scene.

    Raises:
        InputError: the scene's wells are not certain (see :func:`fastmech.barrier_tree`).
    """
    return SceneCertificate(scene, barrier_tree(scene))
