"""One disturbance of every equilibrium: nonlinear and linearized motion side by side, paper (21)."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

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
from fastmech.errors import InputError
from fastmech.models.mechanism import Mechanism
from fastmech.objects import coordinate_units, state_units
from fastmech.plots.disturbed import draw_disturbed_motion
from fastmech.results import Dataset, Variable, numbers, parts, told
from fastmech.scan_types import request as scans
from fastmech.scan_types.motion import OneMotion
from fastmech.scene import Scene
from fastmech.slider.capture.steps import highest_frequency
from fastmech.slider.coefficients import reduce
from fastmech.slider.theorem import MOST
from fastmech.step_limits.warning import step_warning

Size = Annotated[float, Field(ge=-MOST_RADIUS, le=MOST_RADIUS)]


class DisturbedMotionScan(OneMotion):
    """The same disturbance of every equilibrium; by default the paper's of its own: xi1 = 0.1, eta1 = 0.1."""

    kind: ClassVar[str] = "disturbed_motion"
    draw = staticmethod(draw_disturbed_motion)
    taken = frozenset({"equilibrium", "time"})
    own = "disturbance"
    of_paper = {"phi": 0.1, "phi_dot": 0.1}

    disturbance: dict[str, Size] = Field(
        default={}, description="disturbances of coordinates [rad or m] and rates, 0 by default"
    )
    outputs: int = Field(1001, ge=2, le=10_000_000)
    dt: float | None = Field(
        None,
        gt=0,
        description="longest step [s]; by default 0.05 rad of each equilibrium's highest frequency",
    )
    method: scans.UsualMethod = None

    def check(self, scene: Scene | Mechanism) -> None:
        """The force must be constant, so many steps possible, and the outputs fit into memory."""
        require_isolated(scene)
        disturbance, longest = self.state(scene), self.dt
        if not any(disturbance.values()):
            hint = f"give it a value, such as {next(iter(disturbance))} = 0.1"
            raise InputError(f"disturbance: disturbs nothing; {hint}")
        if isinstance(scene, Scene):
            longest = self.dt or PHASE / highest_frequency(reduce(scene))
        if longest is not None:
            scans.check_steps("t_end", self.t_end, longest)
        held = self.outputs * 2 * len(disturbance) * MOST
        checks.memory(held, 3, "outputs: the motions about equilibria", "fewer outputs")

    def step_warning(self, scene: Scene | Mechanism) -> str | None:
        """By the scene's limit; without ``dt`` each equilibrium's step is chosen."""
        if self.dt is None or isinstance(scene, Mechanism):
            return None
        return step_warning(scene, self.dt, self.method or default_method(scene, self.dt))

    def tiling(self, scene: Scene | Mechanism) -> scans.Tiling:
        """The equilibria one by one."""
        equilibria = equilibria_to_disturb(scene)
        longest = self.dt or min(default_step(scene, e) for e in equilibria)
        method = self.method or default_method(scene, longest)
        return scans.Each(
            "disturbed motions",
            len(equilibria),
            lambda index: self._one(scene, equilibria[index], method),
            lambda tiles: self._joined(scene, equilibria, tiles, method),
        )

    def _one(self, scene: Scene | Mechanism, equilibrium: Any, method: str) -> Dataset:
        """Integrate one disturbance; the linearized motion is a matrix exponential."""
        t, disturbance = self.times, [*self.state(scene).values()]
        # The step taken: what divides the intervals between outputs.
        step = t[1] / output_steps(t[:2], self.dt or default_step(scene, equilibrium))[0]
        motion, halved = (
            disturbed_motion(scene, equilibrium, disturbance, t, dt=dt, method=method)
            for dt in (step, 0.5 * step)
        )
        difference = np.max(np.abs(halved.nonlinear - motion.nonlinear))
        arrays = {"nonlinear": motion.nonlinear[:, 0], "linearized": motion.linearized[:, 0]}
        return scans.tile_of(arrays | {"difference": difference, "step": step, "status": motion.status[0]})

    def _joined(
        self, scene: Scene | Mechanism, equilibria: Any, tiles: list[Dataset], method: str
    ) -> Dataset:
        dims = ("equilibrium", "time")
        variables = {
            **numbers("equilibrium", len(equilibria), "number of the equilibrium"),
            "time": Variable(("time",), self.times, "s", "time"),
            **parts("", dims[:1], equilibria.position, coordinate_units(scene), "{1} {0} of the equilibrium"),
        }
        for kind in ("nonlinear", "linearized"):
            motion = np.stack([tile[kind].data for tile in tiles])
            variables |= parts(kind, dims, motion, state_units(scene), f"disturbance of {{}}, {kind} motion")
        steps = [float(tile["step"].data) for tile in tiles]
        attrs = {
            **told(scene),
            **self.settings(scene),
            "method": method,
            "shortest_step": min(steps),
            "longest_step": max(steps),
            "error_estimate": float(np.max([tile["difference"].data for tile in tiles])),
            "error_estimate_is": scans.HALVING,
        }
        return Dataset(variables, attrs | scans.failures([tile["status"].data for tile in tiles]))
