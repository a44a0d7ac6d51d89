"""A tolerance in place of a step: method, step and precision from a calibration, and the error estimated.

The error of a run is estimated by step doubling in its finer form: a second run with steps longer by
sqrt(2) differs from it by (2^(p/2) - 1) times its error, for a method of order p (Hairer, Norsett, Wanner,
*Solving ODEs I*, section II.4). A sample of trajectories settles method, step and precision. For a quantile
of the errors the sample's quantile is the estimate; for the largest error every trajectory runs twice, and
those whose own estimate is above the tolerance run again with shorter steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.calibration import (
    AIM,
    RATIO,
    ROUNDING,
    Calibrated,
    calibrate,
    distances,
    order_statistic,
)
from fastmech.ensembles.fitting import speed_bound
from fastmech.ensembles.problem import Problem
from fastmech.ensembles.run import Progress
from fastmech.ensembles.solve import Settings, Solution, solve
from fastmech.integrators.implicit_method import ImplicitRungeKutta
from fastmech.integrators.methods import find_method

Floats = NDArray[np.float64]

#: Trajectories of the sample for the largest error, and for a quantile; and neighbours in speed that it takes
#: together, because trajectories of equal steps share a block.
SAMPLE_MAXIMUM, SAMPLE_QUANTILE, NEIGHBOURS = 64, 256, 16

#: For the largest error the calibration looks at this quantile of the sample: single trajectories run again.
TYPICAL = 0.9

#: Repetitions of trajectories at most.
ROUNDS = 6

#: Errors below this that two shorter steps do not halve are rounding, magnified by the motion.
MAGNIFIED = 1e-3

#: What such trajectories run with in the end, and its steps in those of a multistep method.
CALM, LONGER = "dop853", 4.0

#: Trajectories of the largest estimates whose errors are measured by runs of half the step, at the end.
AUDITED = 64

#: Least tolerance for which lanes of float32 are tried, for quantiles: in the worst trajectories rounding is
#: magnified more than the distance of two runs tells.
SINGLE = 3e-5


@dataclass(frozen=True)
class Estimated:
    """A solution whose error is estimated."""

    solution: Solution
    settings: Settings
    reason: str  #: why this method, one line
    error: Floats | None  #: of each trajectory (n,), where every one has run twice
    estimate: float  #: the quantile of the errors that was asked for


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
    usable = np.flatnonzero(np.isfinite(starts).all(axis=1))
    sample = _sample(problem, starts, usable, SAMPLE_MAXIMUM if quantile == 1.0 else SAMPLE_QUANTILE)
    aim = quantile if quantile < 1.0 else TYPICAL
    part, begun = problem.part(sample), starts[sample]
    found = calibrate(part, begun, outputs, tol, aim, method, threads)
    if quantile == 1.0:
        solution, errors = _double(problem, starts, outputs, found, tol, threads, progress)
        largest = float(np.max(errors[usable], initial=0.0))
        return Estimated(solution, found.settings, found.reason, errors, largest)
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
    error = distances(solution.y[:, sample], found.truth)
    if settings.precision is np.float64:
        # Where rounding rules, the run with longer steps is the nearer one: it rounds less.
        error = np.minimum(error, found.distance)
    return Estimated(solution, settings, found.reason, None, order_statistic(error, aim))


def _sample(problem: Problem, starts: Floats, usable: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    """Evenly spaced groups of the trajectories, sorted by what bounds their speed."""
    if usable.size <= size:
        return usable
    if problem.coefficients is not None:
        usable = usable[np.argsort(speed_bound(problem.coefficients, starts)[usable], kind="stable")]
    groups = size // NEIGHBOURS
    first = np.linspace(0, usable.size - NEIGHBOURS, groups).astype(np.int64)
    return usable[np.unique(first[:, None] + np.arange(NEIGHBOURS))]


def _double(
    problem: Problem,
    starts: Floats,
    outputs: Floats,
    found: Calibrated,
    tol: float,
    threads: int | None,
    progress: Progress | None,
) -> tuple[Solution, Floats]:
    """Every trajectory twice; those above the tolerance again, with their own shorter steps.

    Errors are estimated by the sample's median ratio; a trajectory is done where even the ratio that covers
    most of the sample keeps it within the tolerance.
    """
    settings = found.settings
    best = solve(problem, starts, outputs, settings, threads, progress)
    coarse = solve(problem, starts, outputs, replace(settings, dt=settings.dt * RATIO), threads)
    error, margin = distances(best.y, coarse.y) * found.median, found.cover / found.median
    order, dt = settings.method.order, np.full(len(starts), float(settings.dt))
    again = np.flatnonzero(~(margin * error <= tol) & np.isfinite(starts).all(axis=1))
    vain, settled = np.zeros(len(starts), dtype=np.int64), np.zeros(len(starts), dtype=np.bool_)
    for _ in range(ROUNDS):
        if not again.size:
            break
        with np.errstate(divide="ignore", invalid="ignore"):
            wanted = (AIM * tol / (margin * error[again])) ** (1.0 / order)
        known = np.isfinite(error[again])
        wanted = np.clip(np.where(known, wanted, 0.25), 0.25, 1.0 / RATIO)
        rungs = np.ceil(-2.0 * np.log2(wanted) - 1e-9)  # each shorter by RATIO
        part, own = problem.part(again), dt[again] / RATIO**rungs
        run = solve(part, starts[again], outputs, replace(settings, dt=own), threads)
        before = best.y[:, again]  # one step of the ladder up already
        far = np.flatnonzero(rungs > 1.0)
        if far.size:
            coarser = replace(settings, dt=own[far] * RATIO)
            before[:, far] = solve(part.part(far), starts[again[far]], outputs, coarser, threads).y
        after = distances(run.y, before) * found.median
        # Where shorter steps bring nothing to a small error, rounding rules, magnified by the motion, and
        # none will: see _resettle.
        in_vain = known & (after > 0.5 * error[again])
        vain[again[in_vain]] += 1
        rounded = in_vain & ((after < ROUNDING) | ((vain[again] > 1) & (after < MAGNIFIED)))
        better = ~(after > error[again])
        _replace(best, again[better], run, better)
        dt[again[better]] = own[better]
        error[again] = after
        settled[again[rounded]] = True
        again = again[~(margin * after <= tol) & ~rounded]
    _resettle(problem, starts, outputs, settings, dt, best, error, np.flatnonzero(settled), threads)
    _audit(problem, starts, outputs, settings, dt, best, error, settled, tol, threads)
    return best, error


def _resettle(
    problem: Problem,
    starts: Floats,
    outputs: Floats,
    settings: Settings,
    dt: Floats,
    best: Solution,
    error: Floats,
    which: NDArray[np.int64],
    threads: int | None,
) -> None:
    """Run trajectories that rounding rules with the longer steps of a one-step method, which round less.

    A run of a shorter step tells the error: where rounding rules, the two differ by about as much as each
    does from the truth.
    """
    if not which.size or isinstance(settings.method, ImplicitRungeKutta):
        return
    part, longer = problem.part(which), LONGER if settings.method.start_steps else 1.0
    calm = replace(settings, method=find_method(CALM), dt=dt[which] * longer)
    run = solve(part, starts[which], outputs, calm, threads)
    finer = solve(part, starts[which], outputs, replace(calm, dt=dt[which] * longer / RATIO), threads)
    error[which] = distances(run.y, finer.y)
    _replace(best, which, run, np.ones(which.size, dtype=np.bool_))


def _audit(
    problem: Problem,
    starts: Floats,
    outputs: Floats,
    settings: Settings,
    dt: Floats,
    best: Solution,
    error: Floats,
    settled: NDArray[np.bool_],
    tol: float,
    threads: int | None,
) -> None:
    """Measure the errors of the worst trajectories by runs of half the step, but of settled ones.

    Where one is above the tolerance the finer run is kept, and measured in its turn while that helps.
    """
    finite = np.flatnonzero(np.isfinite(starts).all(axis=1) & ~settled)
    worst = finite[np.argsort(-error[finite], kind="stable")[:AUDITED]]
    last = np.full(worst.size, np.inf)
    for _ in range(ROUNDS):
        if not worst.size:
            return
        dt[worst] = dt[worst] / 2.0
        run = solve(problem.part(worst), starts[worst], outputs, replace(settings, dt=dt[worst]), threads)
        error[worst] = distances(run.y, best.y[:, worst])
        bad = ~(error[worst] <= tol) & ~((error[worst] > 0.5 * last) & (error[worst] < MAGNIFIED))
        worst, last = worst[bad], error[worst[bad]]
        _replace(best, worst, run, bad)


def _replace(best: Solution, which: NDArray[np.int64], run: Solution, part: NDArray[np.bool_]) -> None:
    """Put some trajectories of a run into the places ``which`` of the solution."""
    for old, new in ((best.y, run.y), (best.records, run.records), (best.dt, run.dt)):
        old[:, which] = new[:, part]
    best.status[which], best.steps[which] = run.status[part], run.steps[part]
    best.failed[which] = run.failed[part]
    if best.last is not None or run.last is not None:
        best.last = best.y[-1].copy() if best.last is None else best.last
        best.last[which] = (run.y[-1] if run.last is None else run.last)[part]
