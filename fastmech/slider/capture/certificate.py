"""The capture certificate of the paper's mechanism, whose wells and ways down are known in closed form.

The wells: which saddles part them, or their copies, on the unwrapped plane. It repeats every 2 pi in both
directions, and a well's copies count their turns. Flooding it, every saddle joins the two sides below it, and
nothing else does (Morse): so a well first meets another one, or a copy of itself, at the lowest saddle that
leads down to it on one side only.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.capture.cells import Cells
from fastmech.capture.certificate import MEASURING, PHASE, CaptureCertificate, Early
from fastmech.capture.wells import Wells
from fastmech.disturbance.motion import damped_times
from fastmech.errors import InputError
from fastmech.integrators.methods import ImplicitRungeKutta, Method, find_method
from fastmech.jit import interpreted
from fastmech.scene import Scene
from fastmech.slider.atlas.map import ROUNDING, barriers
from fastmech.slider.capture.observe import bounded_cells, observe_capture, observe_capture_decaying
from fastmech.slider.capture.steps import (
    FALL,
    FINEST,
    coarse_steps,
    gone_at_once,
    highest_frequency,
    method_for,
)
from fastmech.slider.coefficients import reduce
from fastmech.slider.descent import convex_radius
from fastmech.slider.equilibria import find_equilibria, held
from fastmech.slider.lagrange import unit
from fastmech.slider.motion import SceneMotion
from fastmech.slider.reduced import metric_11, slider_ratio
from fastmech.slider.solve import solve_rows
from fastmech.slider.theorem import MOST
from fastmech.step_limits.warning import grows, step_limit, warn_of_step


@dataclass(frozen=True, eq=False, repr=False)
class BarrierTree(Wells):
    """How the wells of a scene are connected; the barriers count copies of a well as others."""

    radius: Floats  #: of every well [rad]: U is convex in a ball of this radius


def barrier_tree(scene: Scene) -> BarrierTree:
    """The barrier tree of U = Pi - F x2, or of Pi alone where the force decays.

    Raises:
        InputError: the scene's equilibria are not proved to be complete, or no ball about a minimum is
            proved to be convex (too near a fold).
    """
    equilibria = find_equilibria(scene)
    if not equilibria.certificate.complete:
        raise InputError(f"scene: its wells are not certain: {equilibria.certificate.sentence}")
    c, index, energy = np.array(reduce(scene, equilibria.force)), equilibria.morse_index, equilibria.energy
    wells = np.flatnonzero(index == 0).tolist()
    solution, opened = solve_rows(c[None], compiled=False), np.empty((1, MOST))
    with np.errstate(all="ignore"):
        radius = np.array([convex_radius(c, *equilibria[well].position) for well in wells])
        interpreted(barriers)(c[None], solution, opened)
    over = [
        np.flatnonzero((solution.energy[0] == opened[0, well]) & (solution.index[0] == 1)) for well in wells
    ]
    if not ((radius > 0.0).all() and all(map(len, over))):
        raise InputError("scene: a minimum and a saddle are too near to each other to tell their sides apart")
    passes = [int(saddles[0]) for saddles in over]
    return BarrierTree(equilibria, tuple(wells), energy[passes], tuple(passes), radius)


@dataclass(frozen=True)
class SceneCertificate(CaptureCertificate):
    """The barrier tree of a scene, ready for observers; energies are over m2 l^2."""

    system: Scene
    tree: BarrierTree
    work, fades = np.zeros(1), 1.0  # the observer knows what the force can still do
    rounding = ROUNDING

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
    def offset(self) -> float:  # type: ignore[override]
        """The springs' constant [J]."""
        return (self.system.c1 + self.system.c2) * self.system.l**2

    @cached_property
    def cells(self) -> Cells:
        """In closed form."""
        return bounded_cells(self.coefficients)

    @property
    def coefficients(self) -> Floats:
        """Of the potential, and of the force where it decays."""
        decaying = (reduce(self.system).force, self.system.alpha) if self.decays else (0.0, 0.0)
        return np.append(reduce(self.system, self.tree.equilibria.force), decaying)

    @property
    def observer(self) -> Any:
        """By whether the force decays."""
        return observe_capture_decaying if self.decays else observe_capture

    def method(self, name: str | None) -> str:
        """By default ``dop853``, or ``radau5`` where the damper would set its steps."""
        return method_for(self.system, name)

    def warn_of_step(self, dt: float, method: str) -> None:
        """See the base class."""
        warn_of_step([self.system], dt, method, stacklevel=3)

    def grows(self, dt: float, steps: float, method: str, damped: bool = True) -> bool:
        """By linear theory."""
        return grows(self.system, dt, steps, method, damped)

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
            step = min(FALL / c.decay, PHASE / highest_frequency(c))
        stopped = PHASE / highest_frequency(reduce(rest.system))
        if damped_times(scene, method.name, stopped).size:
            span = max(span, stopped)
        return Early(rest, span, step) if span > 0.0 else None

    def impossible(self, starts: Floats, states: Floats, threads: int | None = 1) -> NDArray[np.bool_]:
        """By the energy bounds."""
        return SceneMotion(reduce(self.system)).impossible(starts, states, threads)

    def change(self, states: Floats, apart: Floats, push: Floats | None = None) -> Floats:
        """``push`` is the decaying force over m2 l, by default the whole.

        The change of U is at most its largest slope times the way; T is quadratic in the rates with
        coefficients whose slopes are at most ``slider max|k k'|`` and 1.
        """
        c = reduce(self.system)
        most = np.abs((c.force if self.decays else 0.0) if push is None else push)
        dphi, dtheta, du, dv = apart.T
        slope = np.hypot(c.lift, c.force) * dphi + np.hypot(c.gravity, c.force) * dtheta
        slope = slope + c.spring * (dphi + dtheta)
        slope = slope + most * (dphi + dtheta)
        angles = np.linspace(-np.pi, np.pi, 721)
        k, dk = slider_ratio(np.sin(angles), np.cos(angles))
        a11 = metric_11(c.mass, c.slider, float(np.abs(k).max()))
        u, v = np.abs(states[:, 2]) + du, np.abs(states[:, 3]) + dv
        kinetic = (c.slider * float(np.abs(k * dk).max()) * u * u + u * v) * dphi + u * v * dtheta
        return np.asarray(slope + kinetic + (a11 * u + v) * du + (u + v) * dv)

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


@lru_cache(maxsize=16)
def scene_certificate(scene: Scene) -> SceneCertificate:
    """The capture certificate of a scene, kept for the next starts of the same scene.

    Raises:
        InputError: the scene's wells are not certain (see :func:`fastmech.barrier_tree`).
    """
    return SceneCertificate(scene, barrier_tree(scene))
