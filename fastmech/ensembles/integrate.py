"""``fm.integrate``: trajectories of a scene from given starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.ensembles import checks
from fastmech.ensembles.run import Progress, output_steps, run_ensemble
from fastmech.errors import InputError
from fastmech.integrators.tableaus import find_method
from fastmech.kernels.select import FORMULATIONS, right_hand_side
from fastmech.mechanism.coefficients import reduce
from fastmech.mechanism.hamilton import momenta, rates
from fastmech.mechanism.lagrange import unit
from fastmech.scene import Scene, nearest


@dataclass(frozen=True)
class Trajectories:
    """States of an ensemble at its output times."""

    t: NDArray[np.float64]  #: output times [s], shape (times,)
    y: NDArray[np.float64]  #: phi, theta [rad], phi', theta' [rad/s], shape (times, n, 4); angles unwrapped
    status: NDArray[np.int8]  #: :class:`fastmech.ensembles.status.Status` of each trajectory, shape (n,)
    steps: int  #: steps each trajectory took
    dt: float  #: longest step taken [s]
    method: str  #: name of the method
    formulation: str  #: "lagrange" or "hamilton"


def integrate(
    scene: Scene,
    y0: ArrayLike,
    t_end: float | None = None,
    dt: float = 0.01,
    method: str = "rk4",
    *,
    t_eval: ArrayLike | None = None,
    formulation: str = "lagrange",
    threads: int | None = None,
    progress: Progress | None = None,
) -> Trajectories:
    """Integrate an ensemble with a fixed step.

    Args:
        scene: the mechanism.
        y0: starts, shape (n, 4) or (4,): phi, theta [rad], phi', theta' [rad/s] at t = 0.
        t_end: end of the run [s]; the last of ``t_eval`` by default.
        dt: longest step [s]. Each interval between outputs is divided into equal steps not longer than it.
        method: a name from :data:`fastmech.integrators.tableaus.METHODS`.
        t_eval: output times [s], rising, not negative; only ``t_end`` by default.
        formulation: "lagrange" integrates angles and rates (paper (13)), "hamilton" angles and generalized
            momenta (paper (14)); both take and give angles and rates.
        threads: threads to use, all processors by default. The result does not depend on it.
        progress: is told how many trajectories have finished since its last call.

    Returns:
        states at the output times and the status of every trajectory. A start that is not finite gives a
        trajectory that is not finite and leaves the others as they are.

    Raises:
        InputError: an argument is wrong.
    """
    starts = checks.states("y0", y0, 4)
    dt = checks.number("dt", dt, "s", above=0.0)
    tableau = find_method(method)
    if formulation not in FORMULATIONS:
        raise InputError(
            f"formulation = {formulation!r}: unknown; {nearest(formulation, list(FORMULATIONS))}"
        )
    if t_end is not None:
        t_end = checks.number("t_end", t_end, "s", above=0.0)
    if t_eval is None:
        if t_end is None:
            raise InputError("t_end: missing; give the end of the run in s, or output times t_eval")
        outputs = np.array([t_end])
    else:
        outputs = checks.rising_times("t_eval", t_eval)
        if t_end is not None and outputs[-1] > t_end:
            raise InputError(f"t_eval: its last time {outputs[-1]:g} s lies behind t_end = {t_end:g} s")

    times = np.concatenate([[0.0], outputs])
    canonical = formulation == "hamilton"
    if canonical:
        with np.errstate(invalid="ignore", over="ignore"):  # starts that are not finite have a status
            starts = np.concatenate([starts[:, :2], momenta(scene, starts) / unit(scene)], axis=1)
    params = np.array(reduce(scene), dtype=np.float64)
    rhs = right_hand_side(scene, formulation)
    ensemble = run_ensemble(rhs, params, starts, times, dt, tableau, threads=threads, progress=progress)
    y = ensemble.states
    if canonical:
        with np.errstate(invalid="ignore", over="ignore"):
            y[..., 2:] = rates(scene, y[..., :2], y[..., 2:] * unit(scene))
    steps = output_steps(times, dt)
    longest = float(np.max(np.diff(times) / np.maximum(steps, 1)))
    return Trajectories(outputs, y, ensemble.status, int(steps.sum()), longest, method, formulation)
