"""Thousands of random disturbances of every equilibrium, and how far the linearized motion can be trusted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import AfterValidator, Field

from fastmech.disturbance.ensemble import require_constant_force
from fastmech.errors import InputError, shown
from fastmech.integrators.methods import find_method
from fastmech.results import Dataset
from fastmech.scan_types.axis import check_steps
from fastmech.scan_types.disturbed_layout import TRAJECTORY_VARIABLES
from fastmech.scan_types.disturbed_tiling import DisturbedTiling
from fastmech.scan_types.request import MethodName, Seed, TiledScan
from fastmech.scan_types.tiling import Tiling
from fastmech.scene import Scene, nearest
from fastmech.step_limits.warning import step_warning

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fastmech.store.read import Section

#: Right-hand sides of the largest ensemble: a year of a hundred cores.
MOST_WORK = 1e17

#: Step of the linearized motion's comparison [s], as `fastmech.disturbance.linear_range` has it by default.
LINEAR_DT = 0.02

#: Trajectories of each equilibrium that are drawn at most: they are random, so some stand for all.
DRAWN = 1 << 20


def _known_variables(names: list[str]) -> list[str]:
    for name in names:
        if name not in TRAJECTORY_VARIABLES:
            raise ValueError(f"unknown variable {shown(name)}; {nearest(name, list(TRAJECTORY_VARIABLES))}")
    return names


class Disturbed(TiledScan):
    """Ensembles about every equilibrium, uniform in a ball of the kinetic-energy norm."""

    kind: ClassVar[str] = "disturbed"

    trajectories: Annotated[int, Field(ge=1, le=100_000_000)] = 4096
    radius: Annotated[float, Field(gt=0, description="largest size of a disturbance [rad]")] = 0.5
    return_radius: Annotated[float, Field(gt=0, description="radius of the ball of return [rad]")] = 0.01
    seed: Seed = 0
    t_end: Annotated[float, Field(gt=0)] = 120.0
    dt: Annotated[float, Field(gt=0)] = 0.05
    method: MethodName = "dop853"
    linear_horizon: Annotated[float, Field(gt=0, description="horizon of the comparison [s]")] = 1.0
    linear_tolerance: Annotated[float, Field(gt=0, description="deviation allowed, relative")] = 0.05
    linear_directions: Annotated[int, Field(ge=1, le=1_000_000)] = 256
    variables: Annotated[list[str], AfterValidator(_known_variables)] | None = Field(
        None,
        description="what to keep of every trajectory (all by default); large scans are smaller with less",
    )

    def check(self, scene: Scene) -> None:
        """The force must be constant, and so much work possible."""
        require_constant_force(scene)
        check_steps("t_end", self.t_end, self.dt)
        check_steps("linear_horizon", self.linear_horizon, LINEAR_DT)
        steps = math.ceil(self.t_end / self.dt)
        work = self.trajectories * find_method(self.method).evaluations(steps)
        if work > MOST_WORK:
            raise InputError(
                f"trajectories, t_end, dt: ask for {work:.3g} right-hand sides about every equilibrium, "
                f"at most {MOST_WORK:.0e} are possible"
            )

    def step_warning(self, scene: Scene) -> str | None:
        """By the scene's limit and the decaying force."""
        return step_warning(scene, self.dt, self.method)

    def tiling(self, scene: Scene) -> Tiling:
        """Blocks of directions and of trajectories."""
        return DisturbedTiling(self, scene)

    @property
    def kept(self) -> list[str]:
        """Names of what is kept of every trajectory."""
        wanted = TRAJECTORY_VARIABLES if self.variables is None else self.variables
        return [name for name in TRAJECTORY_VARIABLES if name in wanted]

    @property
    def settings(self) -> dict[str, Any]:
        """What a section says of its request."""
        settings = self.model_dump(exclude={"scene", "variables"})
        return settings | {"seed": self.seed if self.seed < 2**64 else str(self.seed)}  # no integer of HDF5's

    @staticmethod
    def read(section: Section, scene: Mapping[str, float]) -> Dataset:
        """What is drawn, of very many trajectories evenly spaced ones."""
        step = -(-section.sizes.get("trajectory", 1) // DRAWN)
        drawn = [name for name in section if name not in ("start", "final", "linear_direction")]
        return section.load(drawn, {"trajectory": slice(None, None, step)})

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Outcomes, times to return, excursions and the linearized motion's range."""
        from fastmech.plots.disturbed import draw_disturbed

        return draw_disturbed(dataset)
