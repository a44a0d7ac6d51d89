"""One motion of the mechanism in full: both formulations, points, constraints, energies, reactions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fastmech.ensembles import checks
from fastmech.ensembles.balance import energy_balance
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.spans import output_steps
from fastmech.ensembles.status import FAILURES
from fastmech.mechanism.coefficients import force
from fastmech.mechanism.geometry import constraints, positions
from fastmech.mechanism.hamilton import momenta
from fastmech.mechanism.reactions import reactions
from fastmech.results import STATE_UNITS, Dataset, Variable, parts
from fastmech.scan_types.axis import check_steps
from fastmech.scan_types.request import HALVING, MethodName, TiledScan, failures
from fastmech.scan_types.tiling import Each, Tiling
from fastmech.scene import Scene
from fastmech.step_limits.warning import step_warning

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Numbers of a section for every output.
OUTPUT_NUMBERS = 30

_STATE = {"phi": "angle phi", "theta": "angle theta", "phi_dot": "rate of phi", "theta_dot": "rate of theta"}
_REACTIONS = {
    "rod_om1": "axial force in rod O-M1, tension positive",
    "rod_m1m2": "axial force in rod M1-M2, tension positive",
    "rod_m1m3": "axial force in rod M1-M3, tension positive",
    "slider_normal": "force of the guide on the slider, upwards positive",
}
_BALANCE = {
    "kinetic_energy": "kinetic energy T",
    "potential_energy": "potential energy Pi",
    "work_damper": "work of the damper since t = 0",
    "work_force": "work of the force since t = 0",
    "energy_residual": "change of T + Pi less the work of damper and force",
}


class Motion(TiledScan):
    """Motion from one start; the default start is the paper's (Table 1)."""

    kind: ClassVar[str] = "motion"

    phi: float = Field(default=4.0 * np.pi / 13.0, description="start of phi [rad]")
    theta: float = Field(default=np.pi / 7.0, description="start of theta [rad]")
    phi_dot: float = Field(default=0.0, description="start of phi' [rad/s]")
    theta_dot: float = Field(default=0.0, description="start of theta' [rad/s]")
    t_end: Annotated[float, Field(gt=0)] = 20.0
    outputs: Annotated[int, Field(ge=2, le=10_000_000)] = 2001
    dt: Annotated[float, Field(gt=0)] = 0.01
    method: MethodName = "dop853"

    def check(self, scene: Scene) -> None:
        """So many steps must be possible, and what is kept of every output fit into memory."""
        check_steps("t_end", self.t_end, self.dt)
        checks.memory(self.outputs * OUTPUT_NUMBERS, 3, "outputs: the motion", "fewer outputs")

    def step_warning(self, scene: Scene) -> str | None:
        """By the scene's limit, the decaying force and the rates of the start."""
        return step_warning(scene, self.dt, self.method, self._start)

    def tiling(self, scene: Scene) -> Tiling:
        """Four integrations of the same motion, none of which needs another."""
        parts = (self._lagrangian, self._canonical, self._balance, self._halved)
        return Each(
            "integrations of the motion",
            len(parts),
            lambda index: parts[index](scene),
            lambda tiles: self._joined(scene, tiles),
        )

    @property
    def _start(self) -> list[float]:
        return [self.phi, self.theta, self.phi_dot, self.theta_dot]

    @property
    def _times(self) -> NDArray[np.float64]:
        return np.linspace(0.0, self.t_end, self.outputs)

    def _lagrangian(self, scene: Scene) -> Dataset:
        run = integrate(scene, self._start, dt=self.dt, method=self.method, t_eval=self._times)
        return Dataset(_states(run.y), {"steps": run.steps} | failures(run.status, FAILURES))

    def _canonical(self, scene: Scene) -> Dataset:
        settings: dict[str, Any] = {"dt": self.dt, "method": self.method, "formulation": "hamilton"}
        return Dataset(_states(integrate(scene, self._start, t_eval=self._times, **settings).y))

    def _balance(self, scene: Scene) -> Dataset:
        balance = energy_balance(scene, self._start, self._times, dt=self.dt, method=self.method)
        values = (
            balance.kinetic,
            balance.potential,
            balance.work_damper,
            balance.work_force,
            balance.residual,
        )
        return Dataset({n: Variable(("time",), v) for n, v in zip(_BALANCE, values, strict=True)})

    def _halved(self, scene: Scene) -> Dataset:
        t = self._times
        step = float(np.max(np.diff(t) / output_steps(t, self.dt)))  # the step that the others take
        return Dataset(_states(integrate(scene, self._start, dt=0.5 * step, method=self.method, t_eval=t).y))

    def _joined(self, scene: Scene, tiles: list[Dataset]) -> Dataset:
        """Derive everything else from the Lagrangian motion."""
        lagrangian, _, balance, _ = tiles
        t, y, canonical, halved = self._times, *(tiles[k]["y"].data for k in (0, 1, 3))
        p = momenta(scene, canonical)
        points = positions(scene, y)
        along = ("time",)
        variables = {
            "time": Variable(along, t, "s", "time"),
            **{
                name: Variable(along, y[:, i], STATE_UNITS[name], about)
                for i, (name, about) in enumerate(_STATE.items())
            },
            "p_phi": Variable(along, p[:, 0], "kg m2/s", "generalized momentum of phi, canonical equations"),
            "p_theta": Variable(
                along, p[:, 1], "kg m2/s", "generalized momentum of theta, canonical equations"
            ),
            **parts(
                "formulation_difference", along, canonical - y, STATE_UNITS, "{}, canonical less Lagrangian"
            ),
            **{
                name: Variable(along, value, "m", f"coordinate {name[0]} of M{name[1]}")
                for name, value in points._asdict().items()
            },
            **parts(
                "constraint_residual",
                along,
                np.moveaxis(constraints(scene, points), 0, -1),
                {"2": "m2", "3": "m2", "4": "m", "5": "m2"},
                "left side of the constraint ({})",
            ),
            "force": Variable(along, force(scene, t), "N", "force on M2 along +x"),
            **{
                name: Variable(along, value, "N", _REACTIONS[name])
                for name, value in reactions(scene, y, t)._asdict().items()
            },
            **{name: Variable(along, balance[name].data, "J", about) for name, about in _BALANCE.items()},
        }
        attrs = self.model_dump(exclude={"scene"}) | {
            **lagrangian.attrs,
            "error_estimate": float(np.max(np.abs(halved - y))),
            "error_estimate_is": HALVING,
        }
        return Dataset(variables, attrs)

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Angles, reactions and energies over time."""
        from fastmech.plots.motion import draw_motion

        return draw_motion(dataset)


def _states(y: NDArray[np.float64]) -> dict[str, Variable]:
    """States of one motion (time, 1, 4) as a tile keeps them."""
    return {"y": Variable(("time", "component"), y[:, 0])}
