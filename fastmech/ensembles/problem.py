"""What an ensemble integrates: a scene or a mechanism in one of two formulations, or a user's own system.

Either is a block right-hand side, the parameters of every trajectory, and how public states turn into the
integrated ones and back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats, Integers
from fastmech.ensembles import checks
from fastmech.ensembles.fitting import Bounds, Moving
from fastmech.ensembles.lanes import Parameters
from fastmech.ensembles.run import NOTHING, Observation
from fastmech.ensembles.system import System
from fastmech.errors import InputError
from fastmech.integrators.methods import Method, with_inverse
from fastmech.models.checks import check_values
from fastmech.models.mechanism import Mechanism
from fastmech.scene import Scene, nearest

#: Of angles and rates, or of angles and momenta.
FORMULATIONS = ("lagrange", "hamilton")


@dataclass(frozen=True)
class Problem:
    """A right-hand side with the parameters of n trajectories."""

    rhs: Any
    params: Parameters
    observation: Observation = NOTHING
    motion: Moving | None = None  #: of a scene or a mechanism
    canonical: bool = False  #: momenta are integrated in place of rates
    system: System | None = None  #: of the user's own, or of a mechanism

    @property
    def bounds(self) -> Bounds | None:
        """What is known of the motions beforehand."""
        return None if self.motion is None else self.motion.bounds

    def method(self, method: Method) -> Method:
        """A method that knows how to solve its systems, if it has any and the motion tells how."""
        own = self.motion is not None and not self.canonical
        return with_inverse(method, self.motion.inverse) if own and self.motion else method

    def inward(self, y: Floats) -> Floats:
        """Integrated states from public ones (..., n, dim)."""
        return self.motion.to_momenta(y) if self.canonical and self.motion else y

    def outward(self, y: Floats) -> Floats:
        """Public states from integrated ones (..., n, dim)."""
        return self.motion.to_rates(y) if self.canonical and self.motion else y

    @property
    def public(self) -> Problem:
        """The same with public states."""
        return _of_motion(self.motion, "lagrange") if self.canonical and self.motion else self

    def part(self, members: Integers) -> Problem:
        """The same for some of the trajectories."""
        if self.params.shared:
            return self
        motion = None if self.motion is None else self.motion.part(members)
        return replace(self, params=self.params.part(members), motion=motion)


class Case(NamedTuple):
    """A problem, from where its trajectories start, and when they are asked for."""

    problem: Problem
    starts: Floats  #: public states at t = 0, shape (n, dim)
    outputs: Floats  #: times [s], rising, not negative
    threads: int | None = None  #: to use; None: all processors

    @property
    def steps_end(self) -> bool:
        """Whether steps must end at all outputs: where a run may stop, and where one is repeated.

        There loads jump or bend.
        """
        return self.problem.observation.stops or bool((np.diff(self.outputs) == 0.0).any())

    @property
    def size(self) -> float:
        """Median size of a system's starts, whose unit is free; 1 where they are zero, and of scenes."""
        sizes = np.abs(self.starts).max(axis=1, initial=0.0)
        sizes = sizes[np.isfinite(sizes) & (sizes > 0.0)]
        return float(np.median(sizes)) if self.problem.bounds is None and sizes.size else 1.0

    def part(self, members: Integers) -> Case:
        """Some of the trajectories."""
        return self._replace(problem=self.problem.part(members), starts=self.starts[members])


def motion_problem(model: Scene | Mechanism, n: int, own: Mapping[str, Floats], formulation: str) -> Problem:
    """What has parameters of which ``own`` differ between the n trajectories, see :func:`own_values`.

    Raises:
        InputError: values that it may not have.
    """
    if isinstance(model, Mechanism) and n and own:
        check_values(model, own, "parameters.")
    # What is allowed of one parameter of a scene depends on no other.
    for extreme in (np.min, np.max) if isinstance(model, Scene) and n and own else ():
        model.replace(**{name: float(extreme(column)) for name, column in own.items()})
    return _of_motion(model._motion(own), formulation)


def _of_motion(motion: Moving, formulation: str) -> Problem:
    rhs, columns, system = motion.equations(formulation)
    params, canonical = Parameters(columns), formulation == "hamilton"
    return Problem(rhs, params, motion=motion, canonical=canonical, system=system)


def extreme_scenes(scene: Scene, own: Mapping[str, Floats], problem: Problem) -> list[Scene]:
    """The scene, or those of the trajectories that a damper stops soonest and latest, and of the stiffest.

    ``own`` are the parameters that differ, (n,), of the scene's ``problem``. These three are what limits a
    step by parameters; a look at a scene takes as long as hundreds of trajectories.
    """
    bounds = problem.bounds
    if not own or bounds is None or not min(bounds.damping.size, bounds.frequency.size):
        return [scene]
    rows = {int(np.argmax(bounds.damping)), int(np.argmin(bounds.damping)), int(np.argmax(bounds.frequency))}
    # The values have been checked, all of them.
    return [
        scene.replace(**{name: float(column[row]) for name, column in own.items()}) for row in sorted(rows)
    ]


def system_problem(system: System, n: int, parameters: Mapping[str, ArrayLike]) -> Problem:
    """A system whose ``parameters`` differ between the n trajectories.

    Raises:
        InputError: an unknown parameter or wrong values.
    """
    own = own_values(parameters, system.parameters, n)
    columns = (np.asarray(own.get(k, v), dtype=np.float64) for k, v in system.parameters.items())
    return Problem(system.kernel, Parameters(tuple(columns)), system.observation, system=system)


def own_values(parameters: Mapping[str, ArrayLike], known: Mapping[str, float], n: int) -> dict[str, Floats]:
    """Values of each trajectory (n,) by parameter.

    Raises:
        InputError: an unknown name, not n values, or values that are not finite.
    """
    own = {}
    for name, values in checks.mapping("parameters", parameters, "values, one a start").items():
        if name not in known:
            raise InputError(f"parameters.{name}: unknown name; {nearest(str(name), list(known))}")
        array = checks.reals(f"parameters.{name}", values, "real numbers")
        if array.shape != (n,):
            raise InputError(f"parameters.{name}: has shape {array.shape}, must be ({n},), one value a start")
        if not np.isfinite(array).all():
            raise InputError(f"parameters.{name}: must be finite")
        own[name] = array
    return own
