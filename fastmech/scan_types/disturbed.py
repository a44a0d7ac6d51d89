"""Thousands of random disturbances of every equilibrium, and how far the linearized motion can be trusted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import product
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import AfterValidator, Field

from fastmech.basins.disturbed import MOST_RADIUS, DisturbedEnsemble, disturb
from fastmech.capture.select import require_damper
from fastmech.capture.steps import method_for, shortest_step
from fastmech.disturbance.motion import require_constant_force, require_isolated
from fastmech.errors import InputError, shown
from fastmech.integrators.methods import find_method
from fastmech.mechanism.coefficients import reduce
from fastmech.models.mechanism import Mechanism
from fastmech.results import Dataset
from fastmech.scan_types.axis import (
    Axis,
    arrays,
    check_duration,
    check_parameters,
    check_size,
    check_steps,
    known_parameters,
)
from fastmech.scan_types.disturbed_map import MOST_POINTS, MOST_TRAJECTORIES, DisturbedMap
from fastmech.scan_types.disturbed_tiling import ABOUT_SHARES, TRAJECTORY_VARIABLES, DisturbedTiling
from fastmech.scan_types.request import Scan, Seed, UsualMethod
from fastmech.scan_types.tiling import RunContext, Tiling
from fastmech.scene import Scene, nearest
from fastmech.step_limits.warning import step_warning

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fastmech.store.read import Section

#: Right-hand sides of the largest ensemble: a year of a hundred cores.
MOST_WORK = 1e17

#: Numbers of 8 bytes that memory holds of every point of a map.
POINT_NUMBERS = 250

#: Trajectories of each equilibrium that are drawn at most: they are random, so some stand for all.
DRAWN = 1 << 20


def _known_variables(names: list[str]) -> list[str]:
    for name in names:
        if name not in TRAJECTORY_VARIABLES:
            raise ValueError(f"unknown variable {shown(name)}; {nearest(name, list(TRAJECTORY_VARIABLES))}")
    return names


#: Fields of what a map over parameters does not hold.
_NOT_OF_A_MAP = ("variables", "linear_horizon", "linear_tolerance", "linear_directions")


class Disturbed(Scan):
    """Ensembles about every equilibrium, uniform in a ball of the kinetic-energy norm."""

    kind: ClassVar[str] = "disturbed"
    of_mechanisms = True
    taken = frozenset({"equilibrium", "trajectory", "omega", *TRAJECTORY_VARIABLES, *ABOUT_SHARES})

    axes: dict[str, Axis] = Field(
        default={}, description="parameters over which all equilibria are disturbed; none: the scene's alone"
    )

    trajectories: Annotated[int, Field(ge=1, le=100_000_000)] = 4096
    radius: Annotated[
        float, Field(gt=0, le=MOST_RADIUS, description="largest size of a disturbance [rad]")
    ] = 0.5
    return_radius: Annotated[float, Field(gt=0, description="radius of the ball of return [rad]")] = 0.01
    seed: Seed = 0
    t_end: Annotated[float, Field(gt=0)] = 120.0
    dt: Annotated[float | None, Field(gt=0)] = Field(
        None, description="longest step [s]; by default each start's own, from the scene and its energy"
    )
    method: UsualMethod = None
    linear_horizon: Annotated[float, Field(gt=0, description="horizon of the comparison [s]")] = 1.0
    linear_tolerance: Annotated[float, Field(gt=0, description="deviation allowed, relative")] = 0.05
    linear_directions: Annotated[int, Field(ge=1, le=1_000_000)] = 256
    variables: Annotated[list[str], AfterValidator(_known_variables)] | None = Field(
        None,
        description="what to keep of every trajectory (all by default); large scans are smaller with less",
    )

    def check(self, scene: Scene | Mechanism) -> None:
        """A constant force and a damper all over a map, and no more work than is possible."""
        known_parameters(scene, self.axes)
        if isinstance(scene, Mechanism):
            if self.axes:
                raise InputError("axes: are for the paper's mechanism alone; give a value in [scene] instead")
            require_damper(scene)
            require_isolated(scene)
            if self.dt is not None:
                check_steps("t_end", self.t_end, self.dt)
            return
        check_parameters(scene, self.axes, "axes")
        for corner in self._corners(scene):
            require_damper(corner)
            (require_constant_force if self.axes else require_isolated)(corner)
            check_duration(corner, self.t_end, self.dt)
            check_steps("linear_horizon", self.linear_horizon, shortest_step(reduce(corner)))
        if not self.axes:
            steps = math.ceil(self.t_end / (self.dt or shortest_step(reduce(scene))))
            work = self.trajectories * find_method(method_for(scene, self.method)).evaluations(steps)
            if work > MOST_WORK:
                raise InputError(
                    f"trajectories, t_end, dt: ask for {work:.3g} right-hand sides about every equilibrium, "
                    f"at most {MOST_WORK:.0e} are possible"
                )
            return
        for name in _NOT_OF_A_MAP:
            if name in self.model_fields_set:
                raise InputError(f"{name}: is nothing of a map; leave it out, or the axes")
        check_size("axes", self.axes, "points", MOST_POINTS, POINT_NUMBERS)
        if self.trajectories > MOST_TRAJECTORIES:
            raise InputError(
                f"trajectories = {self.trajectories}: must be at most {MOST_TRAJECTORIES} on a map"
            )

    def step_warning(self, scene: Scene | Mechanism) -> str | None:
        """By the scene's limit; without ``dt`` each start's step is chosen."""
        if self.dt is None or isinstance(scene, Mechanism):
            return None
        told = [
            step_warning(corner, self.dt, method_for(corner, self.method)) for corner in self._corners(scene)
        ]
        return next((line for line in told if line is not None), None)

    def _corners(self, scene: Scene) -> list[Scene]:
        """The scene with the first and last values of all axes; itself where there are none."""
        ends = [axis.array[[0, -1]].tolist() for axis in self.axes.values()]
        return [scene.replace(**dict(zip(self.axes, values, strict=True))) for values in product(*ends)]

    def tiling(self, scene: Scene | Mechanism) -> Tiling:
        """Blocks of directions and of trajectories; of a map the equilibria one by one."""
        if self.axes:
            assert isinstance(scene, Scene)
            return DisturbedMap(self, scene, arrays(self.axes))
        return DisturbedTiling(self, scene)

    def ensemble(
        self, scene: Scene | Mechanism, equilibrium: Any, context: RunContext, part: slice | None = None
    ) -> DisturbedEnsemble:
        """Disturb one equilibrium, or a part of its trajectories."""
        return disturb(
            scene,
            equilibrium,
            self.trajectories,
            radius=self.radius,
            return_radius=self.return_radius,
            seed=self.seed,
            t_end=self.t_end,
            dt=self.dt,
            method=self.method,
            part=part,
            threads=context.threads,
            progress=lambda finished: context.check(),
        )

    @property
    def kept(self) -> list[str]:
        """Names of what is kept of every trajectory."""
        wanted = TRAJECTORY_VARIABLES if self.variables is None else self.variables
        return [name for name in TRAJECTORY_VARIABLES if name in wanted]

    @property
    def settings(self) -> dict[str, Any]:
        """What a section says of its request."""
        left_out = {"scene", "axes", *(_NOT_OF_A_MAP if self.axes else ["variables"])}
        settings = self.model_dump(exclude=left_out, exclude_none=True)
        return settings | {"seed": self.seed if self.seed < 2**64 else str(self.seed)}  # no integer of HDF5's

    @staticmethod
    def read(section: Section, scene: Mapping[str, float]) -> Dataset:
        """What is drawn, of very many trajectories evenly spaced ones."""
        if "axes" in section.attrs:
            return section.load()
        step = -(-section.sizes.get("trajectory", 1) // DRAWN)
        drawn = [name for name in section if not name.startswith(("start", "final", "linear_direction"))]
        found = section.load(drawn, {"trajectory": slice(None, None, step)})
        return Dataset(
            found.variables, found.attrs, {name: group.load() for name, group in section.groups.items()}
        )

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Outcomes, times to return, excursions and the linearized motion's range; those of a map over it."""
        if "axes" in dataset.attrs:
            from fastmech.plots.disturbed_map import draw_disturbed_map

            return draw_disturbed_map(dataset.merged, scene)
        from fastmech.plots.disturbed import draw_disturbed

        return draw_disturbed(dataset.merged)
