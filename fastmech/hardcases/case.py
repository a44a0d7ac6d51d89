"""What a hard case is: a description, and a run that gives one row a method."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.ensembles.integrate import Trajectories, integrate
from fastmech.ensembles.status import Status
from fastmech.mechanism.lagrange import kinetic_energy, potential_energy
from fastmech.scene import Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Row:
    """What one method did in a case."""

    method: str
    dt: float  #: step [s]
    steps: int
    error: float  #: against the oracle, see the case; NaN where there is none
    allowed: float  #: largest error at which the case passes
    drift: float  #: largest change of energy over the energy above the lowest; NaN where energy is not kept
    status: str  #: worst status of the trajectories
    claimed: bool  #: whether the method claims the case; one that does not must end with a status
    remark: str = ""

    @property
    def passed(self) -> bool:
        """A claimed case within its error and without failures; a case not claimed with a status."""
        fine = self.status == Status.OK.name.lower()
        return fine and self.error <= self.allowed if self.claimed else not fine


@dataclass(frozen=True)
class HardCase:
    """A case of the gallery; ``run(quick)`` gives its rows, ``quick`` in about a second."""

    name: str
    hard: str  #: what makes it hard
    oracle: str  #: where the expected value comes from, and what the error is
    must: str  #: what must happen
    run: Callable[[bool], Sequence[Row]]


def worst(status: ArrayLike) -> str:
    """Name of the gravest status among trajectories: any failure before OK."""
    values = np.unique(np.asarray(status))
    return Status(int(values.max())).name.lower()


def energy(scene: Scene, y: Floats) -> Floats:
    """T + U [J] of states (..., 4) under a constant force, or none."""
    force = scene.F0 if scene.alpha == 0.0 else 0.0
    return kinetic_energy(scene, y) + potential_energy(scene, y[..., :2], force)


def final_row(
    scene: Scene,
    start: ArrayLike,
    t_end: float,
    expected: Floats,
    method: str,
    dt: float,
    allowed: float,
    *,
    formulation: str = "lagrange",
    claimed: bool = True,
) -> Row:
    """One trajectory whose final state is known; the error is relative to the largest entry, 1 at least."""
    run = integrate(scene, start, t_end, dt, method, formulation=formulation)
    scale = np.maximum(1.0, np.abs(expected).max())
    error = float(np.abs(run.y[-1, 0] - expected).max() / scale)
    return row_of(run, error, allowed, claimed=claimed)


def row_of(
    run: Trajectories,
    error: float,
    allowed: float,
    drift: float = np.nan,
    *,
    claimed: bool = True,
    remark: str = "",
) -> Row:
    """A row of what ``integrate`` gave."""
    return Row(run.method, run.dt, run.steps, error, allowed, drift, worst(run.status), claimed, remark)
