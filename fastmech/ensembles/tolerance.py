"""A tolerance in place of a step: method, step and precision from a calibration, and the error estimated.

The error of a run is estimated by step doubling in its finer form: a second run with steps that differ by
sqrt(2), see :mod:`fastmech.ensembles.richardson`. A sample of trajectories settles method, step and
precision. For a quantile of the errors the sample's quantile is the estimate; for the largest error every
trajectory runs twice, see :mod:`fastmech.ensembles.doubling`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.calibration import CALM, calibrate
from fastmech.ensembles.doubling import SMOOTH, Doubling
from fastmech.ensembles.fitting import speed_bound
from fastmech.ensembles.ladder import Calibrated
from fastmech.ensembles.lanes import finite_rows
from fastmech.ensembles.piecewise import METHOD, follow_to_tolerance
from fastmech.ensembles.problem import Problem
from fastmech.ensembles.repeatable import usable_starts
from fastmech.ensembles.richardson import RATIO, ROUNDING, distances, half_over, order_statistic, unseen
from fastmech.ensembles.run import Progress
from fastmech.ensembles.solve import Settings, Solution, solve, tell_aside
from fastmech.ensembles.switches import UnclearError
from fastmech.integrators.implicit_method import ImplicitRungeKutta
from fastmech.integrators.methods import find_method

Floats = NDArray[np.float64]

#: Trajectories of the sample for the largest error, and for a quantile; and neighbours in speed that it takes
#: together, because trajectories of equal steps share a block.
SAMPLE_MAXIMUM, SAMPLE_QUANTILE, NEIGHBOURS = 64, 256, 16

#: Trajectories of the sample that tell a quantile have larger errors, so many at least; and how many it may
#: have for that.
BEYOND, SAMPLE_MOST = 16, 4096

#: For the largest error the calibration looks at this quantile of the sample: single trajectories run again.
TYPICAL = 0.9

#: Steps of :data:`fastmech.ensembles.calibration.CALM` in an Adams method's, of a run that tells rounding.
CALM_STEPS = 2.0

#: Least tolerance for which lanes of float32 are tried, for quantiles: in the worst trajectories rounding is
#: magnified more than the distance of two runs tells.
SINGLE = 3e-5


#: What is said of systems whose right-hand sides have branches.
LOCATED = "the right-hand side has branches: steps end where they are passed"
UNKNOWN = "; the right-hand side may have branches: errors of single trajectories are not known"


@dataclass(frozen=True)
class Estimated:
    """A solution whose error is estimated."""

    solution: Solution
    settings: Settings
    reason: str  #: why this method, one line
    error: Floats | None  #: of each trajectory (n,), where every one has run at least twice
    estimate: float  #: the quantile of the errors that was asked for


@dataclass(frozen=True)
class _Wanted:
    """What is to be integrated, and whose error counts."""

    problem: Problem
    starts: Floats
    outputs: Floats
    usable: NDArray[np.int64]  #: starts that are finite and not too fast
    quantile: float
    threads: int | None


def solve_to_tolerance(
    problem: Problem,
    starts: Floats,
    outputs: Floats,
    tol: float,
    quantile: float,
    method: str | None,
    threads: int | None,
    progress: Progress | None,
) -> Estimated:
    """Integrate so that the quantile (1.0: the largest) of the trajectories' errors is at most ``tol``.

    A trajectory's error is that of its worst component at its worst output time, in the units of the state.
    The estimate says what was reached: rounding may keep it above the tolerance.
    """
    if problem.observation.stops:
        problem = replace(problem, observation=replace(problem.observation, locate=True))
    switches, unclear = _switches(problem)
    if switches is not None and quantile == 1.0 and method is None:
        solution, error, remark = follow_to_tolerance(
            problem, switches, starts, outputs, tol, threads, progress
        )
        largest = float(np.max(error[finite_rows(starts)], initial=0.0))
        return Estimated(solution, Settings(find_method(METHOD), 0.0), LOCATED + remark, error, largest)
    usable = usable_starts(problem, starts, float(outputs[-1]), threads)
    # None of the runs that follow, whatever their steps, asks again who can be followed.
    begins = starts if usable.all() else np.where(usable[:, None], starts, np.nan)
    wanted = _Wanted(problem, begins, outputs, np.flatnonzero(usable), quantile, threads)
    estimated = _solve(wanted, tol, method, progress)
    tell_aside(estimated.solution, starts, outputs, finite_rows(starts) & ~usable)
    if switches is None and not unclear:
        return estimated
    if quantile < 1.0:
        return replace(estimated, reason=estimated.reason + UNKNOWN)
    if switches is None:
        return replace(
            estimated,
            reason=f"{estimated.reason}; no error is known: {unclear}",
            error=np.full(len(starts), np.inf),
            estimate=np.inf if usable.any() else 0.0,
        )
    other, error, remark = follow_to_tolerance(problem, switches, starts, outputs, tol, threads, None)
    error += distances(other.y, estimated.solution.y)
    largest = float(np.max(error[usable], initial=0.0))
    return replace(estimated, reason=estimated.reason + remark, error=error, estimate=largest)


def _switches(problem: Problem) -> tuple[Any, str]:
    """The kernel that notes the branches of a user's system, if it has any, or why they are not known."""
    if problem.system is None:
        return None, ""
    try:
        return problem.system.switches, ""
    except UnclearError as why:
        return None, str(why)


def _solve(wanted: _Wanted, tol: float, method: str | None, progress: Progress | None) -> Estimated:
    """The same of starts of which all that are finite have motions that steps can follow."""
    problem, starts, outputs, threads = wanted.problem, wanted.starts, wanted.outputs, wanted.threads
    usable, quantile = wanted.usable, wanted.quantile
    if not usable.size:
        settings = Settings(find_method(method or CALM), float(outputs[-1]) or 1.0)
        solution = solve(problem, starts, outputs, settings, threads, progress)
        none = np.full(len(starts), np.inf) if quantile == 1.0 else None
        return Estimated(solution, settings, "no start has a motion that steps can follow", none, 0.0)
    sample = _sample(wanted, SAMPLE_MAXIMUM if quantile == 1.0 else SAMPLE_QUANTILE)
    aim = quantile if quantile < 1.0 else TYPICAL
    part, begun = problem.part(sample), starts[sample]
    many = usable.size / max(sample.size, 1)
    found = calibrate(part, begun, outputs, tol, aim, method, threads, many)
    if quantile == 1.0:
        settings, reason = found.settings, found.reason
        del found  # and with it the sample's runs
        doubling = Doubling(problem, starts, outputs, settings, tol, threads)
        solution, errors, remark = doubling.run(progress)
        largest = float(np.max(errors[usable], initial=0.0))
        return Estimated(solution, settings, reason + remark, errors, largest)
    settings = found.settings
    implicit = isinstance(settings.method, ImplicitRungeKutta)
    if tol >= SINGLE and not implicit and not problem.observation.stops:
        single = replace(settings, precision=np.float32)
        if (
            order_statistic(distances(solve(part, begun, outputs, single, threads).y, found.truth), aim)
            <= tol
        ):
            settings = single
    solution = solve(problem, starts, outputs, settings, threads, progress)
    error = _sampled_errors(wanted, sample, solution, settings, found)
    estimate = order_statistic(error, aim)
    remark = "" if estimate <= tol else f"; the {quantile:.3g} quantile misses it"
    return Estimated(solution, settings, found.reason + remark, None, estimate)


def _sampled_errors(
    wanted: _Wanted, sample: NDArray[np.int64], solution: Solution, settings: Settings, found: Calibrated
) -> Floats:
    """Errors of a sample that is large enough for the quantile, by a run of half the step."""
    w = wanted
    size = min(math.ceil(BEYOND / (1.0 - w.quantile)), SAMPLE_MOST)
    if size > sample.size and sample.size < w.usable.size:
        sample = _sample(w, size)
        part, begun = w.problem.part(sample), w.starts[sample]
        dt = np.asarray(found.settings.dt)
        truth = solve(part, begun, w.outputs, replace(found.settings, dt=dt / 2.0), w.threads).y
        longer = solve(part, begun, w.outputs, replace(found.settings, dt=dt * RATIO), w.threads).y
        distance = distances(solution.y[:, sample], longer)
    else:
        truth, distance = found.truth, found.distance
    error = distances(solution.y[:, sample], truth)
    if settings.precision is np.float64:
        # Where rounding rules, the run with longer steps is the nearer one: it rounds less.
        rounded = np.minimum(error, distance)
        half, order = error, settings.method.order
        error = np.where(half < ROUNDING, rounded, unseen(half, distance, order))
        noisy = np.flatnonzero(half > half_over(SMOOTH * order) * distance)
        if settings.method.start_steps and noisy.size:
            # Half the step rounds as much or more: a method that rounds less is nearer to the truth.
            calm = replace(settings, method=find_method(CALM), dt=CALM_STEPS * np.asarray(settings.dt))
            who = sample[noisy]
            right = solve(w.problem.part(who), w.starts[who], w.outputs, calm, w.threads).y
            error[noisy] = distances(solution.y[:, who], right)
    return error


def _sample(wanted: _Wanted, size: int) -> NDArray[np.int64]:
    """Evenly spaced groups of the trajectories, sorted by what bounds their speed."""
    usable, coefficients = wanted.usable, wanted.problem.coefficients
    if usable.size <= size:
        return usable
    if coefficients is not None:
        usable = usable[np.argsort(speed_bound(coefficients, wanted.starts)[usable], kind="stable")]
    groups = size // NEIGHBOURS
    # Each group is from the middle of its share of them: the fastest count no more than the others.
    middle = (np.arange(groups) + 0.5) * usable.size / groups
    first = np.floor(middle).astype(np.int64) - NEIGHBOURS // 2
    return usable[(first[:, None] + np.arange(NEIGHBOURS)).ravel()]
