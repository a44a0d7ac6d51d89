"""Thousands of random disturbances of every equilibrium, and how far the linearized motion can be trusted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fastmech.disturbance.ensemble import DisturbedEnsemble, disturb, equilibria_to_disturb
from fastmech.disturbance.linear_range import linear_range
from fastmech.disturbance.outcome import FAILURES, Outcome
from fastmech.ensembles.integrate import integrate
from fastmech.results import Dataset, Variable, flags
from fastmech.scan_types.request import HALVING, MethodName, RunContext, Scan, failures
from fastmech.scene import Scene
from fastmech.step_limits.warning import step_warning

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Trajectories of each ensemble that are integrated again with half the step.
SAMPLE = 256

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0)


class Disturbed(Scan):
    """Ensembles about every equilibrium, uniform in a ball of the kinetic-energy norm."""

    kind: ClassVar[str] = "disturbed"

    trajectories: Annotated[int, Field(ge=1, le=100_000_000)] = 4096
    radius: Annotated[float, Field(gt=0, description="largest size of a disturbance [rad]")] = 0.5
    return_radius: Annotated[float, Field(gt=0, description="radius of the ball of return [rad]")] = 0.01
    seed: Annotated[int, Field(ge=0)] = 0
    t_end: Annotated[float, Field(gt=0)] = 120.0
    dt: Annotated[float, Field(gt=0)] = 0.05
    method: MethodName = "dop853"
    linear_horizon: Annotated[float, Field(gt=0, description="horizon of the comparison [s]")] = 1.0
    linear_tolerance: Annotated[float, Field(gt=0, description="deviation allowed, relative")] = 0.05
    linear_directions: Annotated[int, Field(ge=1, le=1_000_000)] = 256

    def check(self, scene: Scene) -> None:
        """There must be something to disturb, and a constant force."""
        equilibria_to_disturb(scene)

    def step_warning(self, scene: Scene) -> str | None:
        """By the scene's limit and the decaying force."""
        return step_warning(scene, self.dt, self.method)

    def run(self, scene: Scene, context: RunContext) -> Dataset:
        """Disturb one equilibrium after the other; each has its own stream of random numbers."""
        equilibria = equilibria_to_disturb(scene)
        advance = context.stage("disturbed trajectories", self.trajectories * len(equilibria))
        ensembles = [
            disturb(
                scene,
                equilibrium,
                self.trajectories,
                radius=self.radius,
                return_radius=self.return_radius,
                seed=self.seed,
                t_end=self.t_end,
                dt=self.dt,
                method=self.method,
                threads=context.threads,
                progress=advance,
            )
            for equilibrium in equilibria
        ]
        advance = context.stage("range of the linearized motion", len(equilibria))
        ranges = []
        for equilibrium in equilibria:
            ranges.append(
                linear_range(
                    scene,
                    equilibrium,
                    horizon=self.linear_horizon,
                    tolerance=self.linear_tolerance,
                    directions=self.linear_directions,
                    seed=self.seed,
                    threads=context.threads,
                )
            )
            advance(1)
        errors = np.array([sampled_errors(scene, e, 0.5 * e.dt, self.method) for e in ensembles])
        each, every = ("equilibrium",), ("equilibrium", "trajectory")
        state = "phi, theta, phi', theta'"
        variables = {
            "phi": Variable(each, equilibria.phi, "rad", "angle phi of the disturbed equilibrium"),
            "theta": Variable(each, equilibria.theta, "rad", "angle theta of the disturbed equilibrium"),
            "omega": Variable(
                each, np.array([e.size.omega for e in ensembles]), "rad/s", "frequency in the norm"
            ),
            "start": Variable(
                (*every, "component"), _stack(ensembles, "starts"), "rad, rad/s", f"start: {state}"
            ),
            "final": Variable(
                (*every, "component"),
                _stack(ensembles, "final"),
                "rad, rad/s",
                f"end, or last finite state: {state}",
            ),
            "failed": Variable(
                every,
                _stack(ensembles, "failed"),
                "s",
                "time of the last finite state where it failed on the way",
            ),
            "outcome": Variable(
                every, _stack(ensembles, "outcome"), "1", "where it is at the end", flags(Outcome)
            ),
            "end_equilibrium": Variable(
                every,
                _stack(ensembles, "end_index"),
                "1",
                "equilibrium at which it rests at the end, -1: none",
            ),
            "turns": Variable(
                (*every, "angle"),
                _stack(ensembles, "turns"),
                "1",
                "full turns of phi and theta made until then",
            ),
            "time_to_return": Variable(
                every,
                _stack(ensembles, "time_to_return"),
                "s",
                "end of the first step from which on every step ended in the ball of return",
            ),
            "excursion": Variable(
                (*every, "angle"),
                _stack(ensembles, "excursion"),
                "rad",
                "largest departures of phi and theta at the ends of steps",
            ),
            "share_returned": Variable(
                each, np.array([e.share_returned for e in ensembles]), "1", "share that returned"
            ),
            "halving_difference": Variable(
                ("equilibrium", "sample"),
                errors,
                "rad or rad/s",
                "difference of a final state from that with half the step, first trajectories; NaN: failed",
            ),
            "quantile": Variable(("quantile",), np.array(QUANTILES), "1", "quantile"),
            "time_to_return_quantile": Variable(
                ("equilibrium", "quantile"),
                np.array([return_quantiles(e) for e in ensembles]).reshape(-1, len(QUANTILES)),
                "s",
                "quantiles of the time to return over those that returned",
            ),
            "linear_direction": Variable(
                ("equilibrium", "direction", "component"),
                np.array([r.directions for r in ranges]).reshape(-1, self.linear_directions, 4),
                "rad, rad/s",
                "disturbance of size 1 rad",
            ),
            "linear_limit": Variable(
                ("equilibrium", "direction"),
                np.array([r.limit for r in ranges]).reshape(-1, self.linear_directions),
                "rad",
                "size up to which the linearized motion keeps the tolerance, inf: beyond all tried, 0: below",
            ),
        }
        attrs = self.model_dump(exclude={"scene"}) | {
            "distribution": "uniform in the ball of the given radius, kinetic-energy norm at the equilibrium"
        }
        attrs |= {
            "error_estimate": float(errors.max()),
            "error_estimate_median": float(np.median(errors)),
            "error_estimate_is": f"{HALVING}; final states of the first {errors.shape[1]} of each",
        }
        attrs |= failures(variables["outcome"].data, FAILURES)
        return Dataset(variables, attrs)

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Outcomes, times to return, excursions and the linearized motion's range."""
        from fastmech.plots.disturbed import draw_disturbed

        return draw_disturbed(dataset)


def sampled_errors(scene: Scene, e: DisturbedEnsemble, dt: float, method: str) -> NDArray[np.float64]:
    """Differences of the first final states from those of the step ``dt`` [s], shape (sample,)."""
    final = e.final[:SAMPLE]
    finer = integrate(scene, e.starts[: len(final)], e.t_end, dt, method).y[-1]
    return np.where(np.isnan(e.failed[:SAMPLE]), np.abs(finer - final).max(axis=1), np.nan)


def return_quantiles(ensemble: DisturbedEnsemble) -> NDArray[np.float64]:
    """Quantiles of the time to return [s] over the trajectories that returned; NaN where none did."""
    times = ensemble.time_to_return[np.isfinite(ensemble.time_to_return)]
    return np.quantile(times, QUANTILES) if times.size else np.full(len(QUANTILES), np.nan)


def _stack(ensembles: list[DisturbedEnsemble], name: str) -> NDArray[np.generic]:
    return np.stack([getattr(ensemble, name) for ensemble in ensembles])
