"""``fm.integrate``: trajectories of a scene, or of a system of your own, from given starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Codes, Floats, Integers
from fastmech.ensembles import checks
from fastmech.ensembles.ends import STOP_TIME
from fastmech.ensembles.problem import (
    FORMULATIONS,
    Case,
    Problem,
    extreme_scenes,
    motion_problem,
    own_values,
    system_problem,
)
from fastmech.ensembles.run import Progress
from fastmech.ensembles.solve import Precision, Settings, Solution, has_turned, solve, watched
from fastmech.ensembles.status import Status, failure_counts, failure_line
from fastmech.ensembles.system import System, stop_codes
from fastmech.ensembles.tolerance import EACH, solve_to_tolerance
from fastmech.errors import InputError, called_here, shown
from fastmech.integrators.methods import ImplicitRungeKutta, Method, find_method
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Drawn, Field, counted
from fastmech.samplers import Starts
from fastmech.scene import Scene, nearest
from fastmech.step_limits.warning import too_long, warn_of_step

#: Longest step [s] where neither a step nor a tolerance is given.
DEFAULT_DT = 0.01

#: Times at most at which steps of runs to a tolerance end beside the outputs: states at them are kept.
MOST_ENDS = 128

#: Last term of an Adams method's predictor in an angle [rad] that is let pass: the polynomial through its
#: history does not describe the motion beyond, or a spurious root of the method has grown until it shows.
LAST_TERM = 0.01

#: Numbers beside the states that a run holds of each trajectory, and of each coefficient of its own.
BESIDE, OWN = 9, 2


@dataclass(frozen=True, repr=False)
class Trajectories(Drawn):
    """States of an ensemble at its output times; printed, it says how many trajectories have failed."""

    t: Floats  #: output times [s], shape (times,)
    y: Floats  #: states, shape (times, n, dim); a scene's: phi, theta [rad], phi', theta' [rad/s]
    status: Codes  #: :class:`fastmech.ensembles.status.Status` of each trajectory, shape (n,)
    steps: int  #: most steps of a trajectory that runs to the end
    dt: float  #: longest step taken [s]
    method: str  #: name of the method
    trajectory_steps: Integers  #: steps of each trajectory that runs to the end, shape (n,)
    trajectory_dt: Floats  #: longest step of each [s], shape (pieces, n); one piece, or one for each fit
    precision: str = "float64"  #: of the lanes
    stop_code: Integers | None = None  #: why each stopped, 0: it did not; only where it could; (n,)
    stop_time: Floats | None = None  #: when [s], NaN: it did not; (n,)
    failed: Floats | None = None  #: when each that failed was last finite [s], NaN: did not; (n,)
    last: Floats | None = None  #: last finite state of each, whether it failed or not; (n, dim)
    error: Floats | None = None  #: estimate for each trajectory (n,), of runs to a tolerance
    #: Estimate of the quantile asked for, of runs to a tolerance; NaN: no start can be followed.
    error_estimate: float | None = None
    reason: str | None = None  #: why this method, one line, of runs to a tolerance
    names: tuple[str, ...] = ()  #: of the states

    @property
    def failures(self) -> str:
        """One line: how many trajectories have failed, and with which status; empty where none has."""
        why = self.reason
        advice = "" if why is None else EACH if EACH in why else "see reason and fm.Status"
        return failure_line(failure_counts(self.status), self.status.size, advice)

    KIND = "trajectories"
    PICTURE = "plots.objects:draw_trajectories"
    FIELDS = {
        "time": Field("time", "s", "output times", "t"),
        "*": Field("time trajectory state", "", "state", "y"),
        "status": Field("trajectory", "1", "what became of it", codes=Status),
        "steps": Field("trajectory", "1", "steps to the end", "trajectory_steps"),
        "stop_code": Field("trajectory", "1", "why it stopped, 0: it did not"),
        "stop_time": Field("trajectory", "s", "when it stopped, NaN: it did not"),
        "failed": Field("trajectory", "s", "when it was last finite, NaN: it did not fail"),
        "error": Field("trajectory", "1", "estimate of the error, in the states' units"),
        "dt": Field("", "s", "longest step taken"),
    }

    def told(self) -> str:
        """How many, by which method, with which error, and how many have failed."""
        n, dim = self.y.shape[1:]
        about = np.nan if self.error_estimate is None else self.error_estimate
        error = "" if np.isnan(about) else ", error not known" if np.isinf(about) else f", error {about:.2g}"
        left = np.count_nonzero(self.status == Status.OUT_OF_RANGE)
        beyond = f"; {left:,} out of range" if left else ""
        return (
            f"{counted(n, 'trajectory')} of {counted(dim, 'state')} at {counted(self.t.size, 'time')}\n"
            f"  {self.method}, dt = {self.dt:g} s{error}; {self.failures or 'none failed'}{beyond}"
        )


@called_here(
    rtol="tol", atol="tol", tolerance="tol", t_span="t_end", max_step="dt", h="dt", step="dt",
    args="parameters", t_start="is always 0: y0 are the states at t = 0",
)  # fmt: skip
def integrate(
    scene: Scene | Mechanism | System,
    y0: Starts,
    t_end: float | None = None,
    dt: float | None = None,
    method: str | None = None,
    *,
    tol: float | None = None,
    quantile: float | None = None,
    fit: bool | ArrayLike = False,
    t_eval: ArrayLike | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    formulation: str | None = None,
    dtype: str = "float64",
    threads: int | None = None,
    progress: Progress | None = None,
) -> Trajectories:
    """Integrate an ensemble with steps ``dt``, or so that errors stay below ``tol``.

    Args:
        scene: the paper's mechanism, a :class:`fastmech.Mechanism`, or a system of your own.
        y0: starts at t = 0: a sampler of ``fm.samplers``, or states of shape (n, dim) or (dim,); a scene's:
            phi, theta [rad], phi', theta' [rad/s], a mechanism's: coordinates, then rates. Angles are not
            wrapped.
        t_end: end of the run [s]; the last of ``t_eval`` by default.
        dt: longest step [s], 0.01 by default. Each interval between outputs is divided into equal steps not
            longer than it.
        method: a name from :data:`fastmech.integrators.methods.METHODS`; "rk4" by default, or the tolerance's
            choice.
        tol: in place of ``dt``: the error to be kept, absolute, in the state's units, of the worst component
            at the worst output time. A sample chooses method, step and precision: an implicit method where
            stability, not accuracy, would set an explicit one's step.
        quantile: whose error ``tol`` is: 1.0, the default, the largest of all trajectories, for which every
            one runs twice or three times and bad ones again; less: that quantile, estimated from a
            sample of 512. Where a system's right-hand side has branches, of the largest each error is within
            ``tol`` or infinite, see :mod:`fastmech.ensembles.piecewise`; of a quantile none is known.
        fit: whether each trajectory's step is fitted to its energy: ``dt`` then belongs to slow motions, and
            the faster a trajectory can become, the shorter its own step, see
            :mod:`fastmech.ensembles.fitting`. True: once, so that a trajectory's step is the same all along;
            times [s], none behind the end: at the start and at each of them, which pays where a damper slows
            fast motion down. Scenes only.
        t_eval: output times [s], rising, not negative; only ``t_end`` by default.
        parameters: values of parameters, by name, that differ between trajectories, each of shape (n,); of
            times at which loads jump or bend with ``tol`` only.
        formulation: of a scene or a mechanism: "lagrange", the default, integrates angles and rates (paper
            (13)), "hamilton" those and generalized momenta (paper (14)); both take and give angles and rates.
        dtype: precision of the lanes, "float64" or "float32": about twice as fast, for errors down to 1e-4.
        threads: threads to use, all processors by default. The result does not depend on it.
        progress: called with the number of trajectories that have finished since the last call.

    Returns:
        states at the output times and the status of every trajectory: a start that is not finite, a motion
        that became so, and a step too large for a scene or a mechanism are told apart and leave the others as
        they are. A step is too large where the motion comes to an energy it cannot have, and of a scene where
        a body turns by more than 1 rad in it, and where an Adams method's history does not describe the
        motion (see :mod:`fastmech.step_limits.warning`): it keeps its states, but they are not to be trusted.
        That others have no status does not say that they are accurate. With ``fit`` or ``tol`` a start too
        fast for any steps has that status too, does not run, and has NaN after t = 0. A mechanism's motion
        that is beyond a coordinate's range at an output time is out of range. Of a system nothing is known
        beforehand. One that fails on the way has NaN from the next output on, and its last finite state and
        time in ``last`` and ``failed``. With ``tol`` also an estimate of the error; with ``dt`` there is
        none. A trajectory that a system's stopping condition ends keeps the state in which it stopped.

    Raises:
        InputError: an argument is wrong, or the states would not fit into memory.
    """
    outputs = _output_times(t_end, t_eval)
    checks.progress_function(progress, "trajectories")
    starts, problem, own = problem_of(scene, y0, {} if parameters is None else parameters, formulation)
    fitted_at = _fit_times(fit, scene, outputs[-1])
    kept = starts.shape[1] * (outputs.size + max(len(fitted_at) - 1, 0) + problem.canonical)
    own_columns = sum(column.ndim for column in problem.params.columns)
    checks.memory(*_needed(len(starts), kept, own_columns, tol))
    if tol is not None:
        if dt is not None or fit is not False or dtype != "float64":
            raise InputError(
                "tol: chooses the step and the precision itself; give no dt, fit or dtype with it"
            )
        tol = checks.number("tol", tol, "", above=0.0)
        quantile = checks.number("quantile", 1.0 if quantile is None else quantile, "", above=0.0)
        if quantile > 1.0:
            raise InputError(f"quantile = {quantile:g}: must not be greater than 1")
        if method is not None:
            find_method(method)
        passed = outputs
        if isinstance(scene, Mechanism) and not own.keys() & scene.timing:
            ends = _ends_of_steps(scene, outputs, "float64")
            # Else every trajectory finds its branches itself, where these can be told.
            unclear = problem.system is not None and problem.system.told_switches[1]
            if (quantile < 1.0 or method is not None or unclear) and ends.size - outputs.size <= MOST_ENDS:
                passed = ends
                kept += starts.shape[1] * (ends.size - outputs.size)
                checks.memory(*_needed(len(starts), kept, own_columns, tol))
        case = Case(problem, starts, passed, threads)
        found = solve_to_tolerance(case, tol, quantile, method, progress)
        solution = replace(found.solution, y=found.solution.y[np.searchsorted(passed, outputs)])
        return replace(
            _trajectories(scene, problem, outputs, solution, found.settings),
            error=found.error,
            error_estimate=found.estimate,
            reason=found.reason,
        ).of(scene)
    if quantile is not None:
        raise InputError(f"quantile = {shown(quantile)}: tells whose error tol is; give tol with it")
    formula = find_method("rk4" if method is None else method)
    step = checks.number("dt", DEFAULT_DT if dt is None else dt, "s", above=0.0)
    settings = Settings(formula, step, fitted_at, _precision(dtype, problem, formula))
    if not isinstance(scene, Scene):
        passed = outputs
        if isinstance(scene, Mechanism):
            for name in sorted(own.keys() & scene.timing):
                raise InputError(
                    f"parameters.{name}: sets when a load jumps or bends, where steps dt must end for all; "
                    "give tol in place of dt, or the same time to all by replace"
                )
            passed = _ends_of_steps(scene, outputs, dtype)
        solution = solve(Case(problem, starts, passed, threads), settings, progress)
        solution = replace(solution, y=solution.y[np.searchsorted(passed, outputs)])
        return _trajectories(scene, problem, outputs, solution, settings)
    warn_of_step(extreme_scenes(scene, own, problem), step, formula.name, starts)
    problem = watched(problem, starts, step, threads)
    solution = solve(Case(problem, starts, outputs, threads), settings, progress)
    longest = solution.dt[0] if len(solution.dt) == 1 else solution.dt.max(axis=0)
    assert problem.bounds is not None
    beyond = too_long(formula, problem.bounds.fading, starts, solution.dt[0])
    beyond |= has_turned(problem, starts, longest, solution.records, threads)
    if solution.last_term.size:
        beyond |= solution.last_term > LAST_TERM
    solution.status[beyond & (solution.status == Status.OK)] = Status.STEP_TOO_LARGE
    return _trajectories(scene, problem, outputs, solution, settings)


def _ends_of_steps(scene: Mechanism, outputs: Floats, dtype: str) -> Floats:
    """Output times [s] and those at which loads jump or bend, these twice: Adams methods start anew."""
    kinks = scene.kinks(float(outputs[-1]), dtype)
    return np.sort(np.concatenate([outputs, kinks, kinks]))


def _needed(n: int, kept: int, own: int, tol: float | None) -> tuple[int, int]:
    """Numbers of n trajectories with so many states each and coefficients of its own, and copies of them."""
    runs = 1 if tol is None else 2
    return n * (kept + runs * (BESIDE + OWN * own)), 2 * runs


def memory(scene: Scene | Mechanism | System, n: int, times: int = 1, *, tol: float | None = None) -> int:
    """Memory [bytes] that :func:`integrate` takes on the way, as it is checked before a run.

    Args:
        scene: what would be integrated.
        n: number of trajectories.
        times: number of output times.
        tol: the tolerance, where one is given: then every trajectory runs twice.

    Returns:
        bytes of states and of what is known of each trajectory; the interpreter, compiled kernels and
        parameters of each trajectory's own come on top.

    Raises:
        InputError: an argument is wrong.
    """
    if not isinstance(scene, Scene | Mechanism | System):
        raise InputError(f"scene = {shown(scene)}: must be a Scene, a Mechanism or a System")
    n, times = checks.whole_number("n", n, least=1), checks.whole_number("times", times, least=1)
    numbers, copies = _needed(n, len(scene.state) * times, 0, tol)
    return 8 * numbers * copies


def _trajectories(
    scene: Scene | Mechanism | System,
    problem: Problem,
    outputs: Floats,
    solution: Solution,
    settings: Settings,
) -> Trajectories:
    code = time = None
    if isinstance(scene, Mechanism):
        left = scene.outside(solution.y).any(axis=0) & (solution.status == Status.OK)
        solution.status[left] = Status.OUT_OF_RANGE
    if problem.observation.stops:
        code = stop_codes(solution.records)
        time = np.where(code != 0, solution.records[STOP_TIME], np.nan)
    return Trajectories(
        t=outputs,
        y=solution.y,
        status=solution.status,
        steps=int(solution.steps.max(initial=0)),
        dt=float(solution.dt.max(initial=0.0)),
        method=settings.method.name,
        trajectory_steps=solution.steps,
        trajectory_dt=solution.dt,
        precision=np.dtype(settings.precision).name,
        stop_code=code,
        stop_time=time,
        failed=solution.failed,
        last=solution.y[-1] if solution.last is None else solution.last,
        names=tuple(scene.state),
    ).of(scene)


def _fit_times(fit: bool | ArrayLike, scene: Scene | Mechanism | System, until: float) -> tuple[float, ...]:
    if isinstance(fit, bool | np.bool_) and not fit:
        return ()
    if not isinstance(scene, Scene):
        raise InputError("fit: only for a scene, whose energy bounds its speed")
    if isinstance(fit, bool | np.bool_):
        return (0.0,)
    times = checks.rising_times("fit", fit)
    if times[-1] > until:
        last = f"fit[{times.size - 1}] = {times[-1]:g}"
        raise InputError(f"{last}: must not lie behind the run's end, {until:g} s")
    return tuple(times.tolist())


def _precision(dtype: str, problem: Problem, method: Method) -> Precision:
    known: dict[str, Precision] = {"float64": np.float64, "float32": np.float32}
    if not isinstance(dtype, str) or dtype not in known:
        raise InputError(f"dtype = {shown(dtype)}: must be one of {', '.join(known)}")
    if dtype == "float32" and problem.observation.stops:
        raise InputError("dtype = 'float32': not with a stopping condition")
    if dtype == "float32" and isinstance(method, ImplicitRungeKutta):
        raise InputError(f"dtype = 'float32': not with the implicit method {method.name}")
    return known[dtype]


def _output_times(t_end: float | None, t_eval: ArrayLike | None) -> Floats:
    if t_end is not None:
        if isinstance(t_end, Real) and t_end < 0.0:
            raise InputError(
                f"t_end = {shown(t_end)}: must be a finite number of s greater than 0; backwards in time "
                "runs a System whose right-hand side is negated, also its t"
            )
        t_end = checks.number("t_end", t_end, "s", above=0.0)
    if t_eval is None:
        if t_end is None:
            raise InputError("t_end: missing; give the end of the run in s, or output times t_eval")
        return np.array([t_end])
    outputs = checks.rising_times("t_eval", t_eval)
    if t_end is not None and outputs[-1] > t_end:
        raise InputError(f"t_eval: its last time {outputs[-1]:g} s lies behind t_end = {t_end:g} s")
    return outputs


def problem_of(
    scene: Scene | Mechanism | System,
    y0: Starts,
    parameters: Mapping[str, ArrayLike],
    formulation: str | None,
) -> tuple[Floats, Problem, dict[str, Floats]]:
    """Checked starts, what to integrate from them, and a scene's parameters that differ between them."""
    if isinstance(scene, System) and formulation is not None:
        raise InputError(f"formulation = {shown(formulation)}: only for a scene or a mechanism")
    formulation = "lagrange" if formulation is None else formulation
    if not isinstance(formulation, str) or formulation not in FORMULATIONS:
        raise InputError(
            f"formulation = {shown(formulation)}: unknown; {nearest(str(formulation), list(FORMULATIONS))}"
        )
    if isinstance(scene, System):
        starts = checks.starts("y0", y0, scene.state)
        return starts, system_problem(scene, len(starts), parameters), {}
    if not isinstance(scene, Scene | Mechanism):
        raise InputError(f"scene = {shown(scene)}: must be a Scene, a Mechanism or a System")
    starts = checks.starts("y0", y0, scene.state)
    own = own_values(parameters, scene.parameters, len(starts))
    return starts, motion_problem(scene, len(starts), own, formulation), own
