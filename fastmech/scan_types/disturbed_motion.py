"""One disturbance of every equilibrium: nonlinear and linearized motion side by side, paper (21)."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from fastmech.arrays import Floats
from fastmech.basins.disturbed import MOST_RADIUS
from fastmech.disturbance.motion import (
    PHASE,
    default_method,
    default_step,
    disturbed_motion,
    equilibria_to_disturb,
    require_isolated,
)
from fastmech.ensembles import checks
from fastmech.ensembles.lanes import output_steps
from fastmech.ensembles.status import FAILURES
from fastmech.plots.disturbed import draw_disturbed_motion
from fastmech.results import ANGLE_UNITS, STATE_UNITS, Dataset, Variable, numbers, parts
from fastmech.scan_types import request as scans
from fastmech.scene import Scene
from fastmech.slider.capture.steps import highest_frequency
from fastmech.slider.coefficients import reduce
from fastmech.slider.equilibria import Equilibria, Equilibrium
from fastmech.slider.theorem import MOST
from fastmech.step_limits.warning import step_warning

Size = Annotated[float, Field(ge=-MOST_RADIUS, le=MOST_RADIUS)]


class DisturbedMotionScan(scans.Scan):
    """The same disturbance of every equilibrium; the default is the paper's: xi1 = 0.1, eta1 = 0.1."""

    kind: ClassVar[str] = "disturbed_motion"
    draw = staticmethod(draw_disturbed_motion)

    xi_phi: Size = Field(default=0.1, description="disturbance of phi [rad]")
    xi_theta: Size = Field(default=0.0, description="disturbance of theta [rad]")
    eta_phi: Size = Field(default=0.1, description="disturbance of phi' [rad/s]")
    eta_theta: Size = Field(default=0.0, description="disturbance of theta' [rad/s]")
    t_end: Annotated[float, Field(gt=0)] = 20.0
    outputs: Annotated[int, Field(ge=2, le=10_000_000)] = 1001
    dt: Annotated[float | None, Field(gt=0)] = Field(
        None, description="longest step [s]; by default 0.05 rad of each equilibrium's highest frequency"
    )
    method: scans.UsualMethod = None

    def check(self, scene: Scene) -> None:
        """The force must be constant, so many steps possible, and the outputs fit into memory."""
        require_isolated(scene)
        scans.check_steps("t_end", self.t_end, self.dt or PHASE / highest_frequency(reduce(scene)))
        checks.memory(
            self.outputs * 2 * 4 * MOST, 3, "outputs: the motions about equilibria", "fewer outputs"
        )

    def step_warning(self, scene: Scene) -> str | None:
        """By the scene's limit; without ``dt`` each equilibrium's step is chosen."""
        if self.dt is None:
            return None
        return step_warning(scene, self.dt, self.method or default_method(scene, self.dt))

    def tiling(self, scene: Scene) -> scans.Tiling:
        """The equilibria one by one."""
        equilibria = equilibria_to_disturb(scene)
        method = self.method or default_method(scene, self.dt or PHASE / highest_frequency(reduce(scene)))
        return scans.Each(
            "disturbed motions",
            len(equilibria),
            lambda index: self._one(scene, equilibria[index], method),
            lambda tiles: self._joined(equilibria, tiles, method),
        )

    @property
    def _times(self) -> Floats:
        return np.linspace(0.0, self.t_end, self.outputs)

    def _one(self, scene: Scene, equilibrium: Equilibrium, method: str) -> Dataset:
        """Integrate one disturbance; the linearized motion is a matrix exponential."""
        t = self._times
        disturbance = [self.xi_phi, self.xi_theta, self.eta_phi, self.eta_theta]
        # The step taken: what divides the intervals between outputs.
        step = t[1] / output_steps(t[:2], self.dt or default_step(scene, equilibrium))[0]
        motion, halved = (
            disturbed_motion(scene, equilibrium, disturbance, t, dt=dt, method=method)
            for dt in (step, 0.5 * step)
        )
        difference = np.max(np.abs(halved.nonlinear - motion.nonlinear))
        arrays = {"nonlinear": motion.nonlinear[:, 0], "linearized": motion.linearized[:, 0]}
        return scans.tile_of(arrays | {"difference": difference, "step": step, "status": motion.status[0]})

    def _joined(self, equilibria: Equilibria, tiles: list[Dataset], method: str) -> Dataset:
        dims = ("equilibrium", "time")
        variables = {
            **numbers("equilibrium", len(equilibria), "number of the equilibrium"),
            "time": Variable(("time",), self._times, "s", "time"),
            **parts("", dims[:1], equilibria.position, ANGLE_UNITS, "{1} {0} of the equilibrium"),
        }
        for kind in ("nonlinear", "linearized"):
            motion = np.stack([tile[kind].data for tile in tiles])
            variables |= parts(kind, dims, motion, STATE_UNITS, f"disturbance of {{}}, {kind} motion")
        steps = [float(tile["step"].data) for tile in tiles]
        attrs = self.model_dump(exclude={"scene"}, exclude_none=True) | {
            "method": method,
            "shortest_step": min(steps),
            "longest_step": max(steps),
            "error_estimate": float(np.max([tile["difference"].data for tile in tiles])),
            "error_estimate_is": scans.HALVING,
        }
        return Dataset(variables, attrs | scans.failures([tile["status"].data for tile in tiles], FAILURES))
