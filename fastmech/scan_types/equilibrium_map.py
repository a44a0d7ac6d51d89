"""Equilibria over one to three parameters: how many, how many stable, where, and how fast they settle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from fastmech.equilibria.atlas import map_equilibria
from fastmech.equilibria.outcome import Outcome
from fastmech.results import Dataset, Variable, flags
from fastmech.scan_types.request import RunContext, Scan
from fastmech.scene import Scene, nearest

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Axis(BaseModel):
    """Evenly spaced values of a parameter, ends included."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    start: float
    stop: float
    num: Annotated[int, Field(ge=1, le=100_000)]


def _known_parameters(axes: dict[str, Axis]) -> dict[str, Axis]:
    for name in axes:
        if name not in Scene.model_fields:
            raise ValueError(f"unknown parameter {name!r}; {nearest(name, list(Scene.model_fields))}")
    return axes


class EquilibriumMap(Scan):
    """Every equilibrium at every point of a grid of parameters, with the proof that none is missing."""

    kind: ClassVar[str] = "equilibrium_map"

    axes: Annotated[dict[str, Axis], Field(min_length=1, max_length=3), AfterValidator(_known_parameters)]

    def run(self, scene: Scene, context: RunContext) -> Dataset:
        """Search the grid; the force is the one at rest (F0 where alpha = 0)."""
        axes = {name: np.linspace(axis.start, axis.stop, axis.num) for name, axis in self.axes.items()}
        advance = context.stage("equilibrium map", int(np.prod([values.size for values in axes.values()])))
        found = map_equilibria(scene, axes, threads=context.threads, progress=advance)
        grid = tuple(axes)
        roots = (*grid, "root")
        modes = (*roots, "mode")
        described = scene.described()
        variables = {
            **{name: Variable((name,), values, *described[name][1:]) for name, values in axes.items()},
            "count": Variable(grid, found.count, "1", "number of equilibria"),
            "count_stable": Variable(grid, found.count_stable, "1", "number of stable equilibria (minima)"),
            "outcome": Variable(grid, found.outcome, "1", "what is proved of the count", flags(Outcome)),
            "phi": Variable(roots, found.phi, "rad", "angle phi"),
            "theta": Variable(roots, found.theta, "rad", "angle theta"),
            "energy": Variable(roots, found.energy, "J", "potential energy Pi - F x2"),
            "morse_index": Variable(
                roots, found.morse_index, "1", "negative eigenvalues of the Hessian, -1: no equilibrium"
            ),
            "eigenvalue_re": Variable(
                modes, found.eigenvalues.real, "1/s", "eigenvalues of the motion, real part"
            ),
            "eigenvalue_im": Variable(
                modes, found.eigenvalues.imag, "rad/s", "eigenvalues of the motion, imaginary part"
            ),
        }
        return Dataset(variables, {"axes": grid})

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Counts, positions and slowest decay of the stable equilibria over the parameters."""
        from fastmech.plots.equilibrium_map import draw_equilibrium_map

        return draw_equilibrium_map(dataset, scene)
