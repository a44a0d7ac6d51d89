"""What a hard case is: a description, and a run that gives one row a method."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.basins.label import Labels
from fastmech.ensembles.integrate import Trajectories
from fastmech.ensembles.status import Status
from fastmech.mechanism.lagrange import kinetic_energy, potential_energy
from fastmech.scene import Scene

#: Why a method claims nothing of an undamped motion.
DRIVEN = "undamped motions grow with every step"

#: In place of a status: the request was refused before the run.
REFUSED = "refused"


class Row(NamedTuple):
    """What one method did in a case.

    A method claims a case to an error, at a step; one that claims nothing must end with a status (or be
    refused), not with a number.
    """

    method: str
    dt: float  #: step [s]
    steps: int
    error: float  #: against the oracle, see the case; NaN where there is none
    allowed: float  #: error to which the method claims the case; NaN where it does not
    drift: float  #: largest change of energy over the energy above the lowest; NaN where energy is not kept
    status: str  #: worst status of the trajectories, or REFUSED
    claimed: bool  #: whether the method claims the case
    remark: str = ""
    why: str = ""  #: why it claims the case so far and no further, or not

    @property
    def passed(self) -> bool:
        """A claimed case within its error and without failures; a case not claimed with a status."""
        fine = self.status == Status.OK.name.lower()
        return fine and self.error <= self.allowed if self.claimed else not fine

    @property
    def verdict(self) -> str:
        """What a reader must know: whether the number may be taken, and to how many digits."""
        if self.claimed:
            return "passed" if self.passed else f"FAILED: claimed to {self.allowed:.0e}"
        return "a status, as it must" if self.passed else f"FAILED: not claimed, error {self.error:.1e}"


class HardCase(NamedTuple):
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


def row_of(
    run: Trajectories,
    error: float,
    allowed: float,
    drift: float = np.nan,
    *,
    claimed: bool = True,
    remark: str = "",
    why: str = "",
) -> Row:
    """A row of what ``integrate`` gave."""
    return Row(run.method, run.dt, run.steps, error, allowed, drift, worst(run.status), claimed, remark, why)


def labels_row(method: str, found: Labels, wrong: int, told: str = "") -> Row:
    """A row of what ``fm.labels_of`` gave: the error is how many are wrong, and none may be."""
    remark = "labels: " + ", ".join(f"{n} {name}" for name, n in found.counts.items() if n) + told
    nan, why = float("nan"), "fm.labels_of"
    return Row(method, nan, found.steps, float(wrong), 0.0, nan, "ok", True, remark, why)
