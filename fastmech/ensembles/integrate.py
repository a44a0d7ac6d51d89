"""``fm.integrate``: trajectories of a scene, or of a system of your own, from given starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.ensembles import checks
from fastmech.ensembles.plausible import judge
from fastmech.ensembles.problem import Problem, scene_problem, system_problem
from fastmech.ensembles.run import Progress, run_ensemble
from fastmech.ensembles.spans import output_steps
from fastmech.ensembles.stopping import STOP_CODE, STOP_TIME
from fastmech.ensembles.system import System
from fastmech.errors import InputError
from fastmech.integrators.implicit_method import with_jacobian
from fastmech.integrators.methods import find_method
from fastmech.kernels.select import FORMULATIONS
from fastmech.scene import Scene, nearest


@dataclass(frozen=True)
class Trajectories:
    """States of an ensemble at its output times."""

    t: NDArray[np.float64]  #: output times [s], shape (times,)
    y: NDArray[
        np.float64
    ]  #: states, shape (times, n, dim); a scene's: phi, theta [rad], phi', theta' [rad/s]
    status: NDArray[np.int8]  #: :class:`fastmech.ensembles.status.Status` of each trajectory, shape (n,)
    steps: int  #: steps of a trajectory that runs to the end
    dt: float  #: longest step taken [s]
    method: str  #: name of the method
    stop_code: NDArray[np.int64] | None = None  #: why each stopped, 0: it did not; only where it could; (n,)
    stop_time: NDArray[np.float64] | None = None  #: when [s], NaN: it did not; (n,)


def integrate(
    scene: Scene | System,
    y0: ArrayLike,
    t_end: float | None = None,
    dt: float = 0.01,
    method: str = "rk4",
    *,
    t_eval: ArrayLike | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    formulation: str = "lagrange",
    threads: int | None = None,
    progress: Progress | None = None,
) -> Trajectories:
    """Integrate an ensemble with a fixed step.

    Args:
        scene: the mechanism, or a system of your own.
        y0: starts, shape (n, dim) or (dim,) at t = 0; a scene's: phi, theta [rad], phi', theta' [rad/s].
            Angles are not wrapped.
        t_end: end of the run [s]; the last of ``t_eval`` by default.
        dt: longest step [s]. Each interval between outputs is divided into equal steps not longer than it.
        method: a name from :data:`fastmech.integrators.methods.METHODS`.
        t_eval: output times [s], rising, not negative; only ``t_end`` by default.
        parameters: values of parameters, by name, that differ between trajectories, each of shape (n,).
        formulation: of a scene: "lagrange" integrates angles and rates (paper (13)), "hamilton" angles and
            generalized momenta (paper (14)); both take and give angles and rates.
        threads: threads to use, all processors by default. The result does not depend on it.
        progress: is told how many trajectories have finished since its last call.

    Returns:
        states at the output times and the status of every trajectory: a start that is not finite, a motion
        that became so, and a scene's motion that ends with an energy it cannot have (the step is too large)
        are told apart and leave the others as they are. There is no error estimate: halve ``dt`` and
        compare. A trajectory that a system's stopping condition ends keeps the state in which it stopped.

    Raises:
        InputError: an argument is wrong.
    """
    dt = checks.number("dt", dt, "s", above=0.0)
    formula = find_method(method)
    outputs = _output_times(t_end, t_eval)
    starts, problem = _problem(scene, y0, parameters or {}, formulation)
    times = np.concatenate([[0.0], outputs])
    ensemble = run_ensemble(
        problem.rhs,
        problem.params,
        problem.inward(starts),
        times,
        dt,
        with_jacobian(formula, problem.jacobian, problem.second_order),
        problem.observation,
        threads=threads,
        progress=progress,
    )
    steps = output_steps(times, dt)
    longest = float(np.max(np.diff(times) / np.maximum(steps, 1)))
    y, total = problem.outward(ensemble.states), int(steps.sum())
    status = judge(ensemble.status, starts, y[-1], problem.coefficients)
    if not problem.observation.stops:
        return Trajectories(outputs, y, status, total, longest, method)
    code = ensemble.records[STOP_CODE]
    time = np.where(code != 0.0, ensemble.records[STOP_TIME], np.nan)
    return Trajectories(outputs, y, status, total, longest, method, code.astype(np.int64), time)


def _output_times(t_end: float | None, t_eval: ArrayLike | None) -> NDArray[np.float64]:
    if t_end is not None:
        t_end = checks.number("t_end", t_end, "s", above=0.0)
    if t_eval is None:
        if t_end is None:
            raise InputError("t_end: missing; give the end of the run in s, or output times t_eval")
        return np.array([t_end])
    outputs = checks.rising_times("t_eval", t_eval)
    if t_end is not None and outputs[-1] > t_end:
        raise InputError(f"t_eval: its last time {outputs[-1]:g} s lies behind t_end = {t_end:g} s")
    return outputs


def _problem(
    scene: Scene | System, y0: ArrayLike, parameters: Mapping[str, ArrayLike], formulation: str
) -> tuple[NDArray[np.float64], Problem]:
    """Checked starts, and what to integrate from them."""
    if formulation not in FORMULATIONS:
        raise InputError(
            f"formulation = {formulation!r}: unknown; {nearest(formulation, list(FORMULATIONS))}"
        )
    if isinstance(scene, System):
        starts = checks.states("y0", y0, len(scene.state))
        return starts, system_problem(scene, len(starts), parameters)
    if not isinstance(scene, Scene):
        raise InputError(f"scene = {scene!r}: must be a Scene or a System")
    starts = checks.states("y0", y0, 4)
    return starts, scene_problem(scene, len(starts), parameters, formulation)
