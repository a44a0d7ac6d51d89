"""A tolerance in place of a step: method, step and precision from a calibration, and the error estimated.

The error of a run is estimated by step doubling in its finer form: a second run with steps longer by
sqrt(2) differs from it by (2^(p/2) - 1) times its error, for a method of order p (Hairer, Norsett, Wanner,
*Solving ODEs I*, section II.4). A sample of trajectories settles method, step and precision. For a quantile
of the errors the sample's quantile is the estimate; for the largest error every trajectory runs twice, and
those whose own estimate is above the tolerance run again with shorter steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.fitting import speed_bound, vibration_frequency
from fastmech.ensembles.problem import Problem
from fastmech.ensembles.run import Progress
from fastmech.ensembles.solve import Settings, Solution, solve
from fastmech.integrators.method import Method
from fastmech.integrators.methods import find_method

Floats = NDArray[np.float64]

#: Methods that lead down to a tolerance, least first: one of one or two right-hand sides a step, and one for
#: outputs so close that starting the former anew costs more. Measured by ``fastmech bench``.
FRONTIER = (
    (1e-8, "abm12", "dop853"),
    (3e-6, "ab7", "dop853"),
    (1e-4, "ab6", "dop853"),
    (math.inf, "ab6", "tsit5"),
)

#: Step times vibration frequency at which a method's error on the mechanism is about 1e-6: the first guess.
FIRST_GUESS = {"ab6": 0.07, "ab7": 0.077, "abm12": 0.14, "dop853": 0.45, "tsit5": 0.15}
GUESSED_ERROR, GUESS = 1e-6, 0.05

#: The coarser of two runs has steps longer by this, and fewer of them where the finer has so many between
#: outputs: two equal runs would tell of no error.
RATIO, FEWEST = math.sqrt(2.0), 4

#: Trajectories of the sample for the largest error, and for a quantile.
SAMPLE_MAXIMUM, SAMPLE_QUANTILE = 64, 256

#: The calibration aims at this share of the tolerance; for the largest error at this quantile of the sample,
#: because single trajectories run again.
AIM, TYPICAL = 0.5, 0.9

#: Runs of the sample, and repetitions of trajectories, at most.
CALIBRATIONS, ROUNDS = 10, 6

#: Trajectories of the largest estimates whose errors are measured by runs of half the step, at the end.
AUDITED = 64

#: Errors [rad, rad/s] below this may be rounding, magnified by the motion.
ROUNDING = 1e-9

#: Share of the sample's errors that the ratio used for the largest error covers.
COVERED = 0.95

#: Least tolerance for which lanes of float32 are tried, for quantiles: in the worst trajectories rounding is
#: magnified more than the distance of two runs tells.
SINGLE = 3e-5

#: Where fast motion slows down, steps are fitted again at these shares of the run.
AGAIN = (0.0, 0.125, 0.5)


@dataclass(frozen=True)
class Estimated:
    """A solution whose error is estimated."""

    solution: Solution
    settings: Settings
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
    usable = np.flatnonzero(np.isfinite(starts).all(axis=1))
    sample = _sample(problem, starts, usable, SAMPLE_MAXIMUM if quantile == 1.0 else SAMPLE_QUANTILE)
    aim = quantile if quantile < 1.0 else TYPICAL
    trial = _Trial(problem.part(sample), starts[sample], outputs, threads, aim)
    settings = trial.choose(method, tol)
    ratio = trial.ratio(settings, settings)
    if tol >= SINGLE and quantile < 1.0 and not problem.observation.stops:
        single = replace(settings, precision=np.float32)
        found = trial.ratio(single, settings)
        if found.error <= tol:
            settings, ratio = single, found
    if quantile < 1.0:
        solution = solve(problem, starts, outputs, settings, threads, progress)
        return Estimated(solution, settings, None, ratio.error)
    solution, errors = _double(problem, starts, outputs, settings, ratio, tol, threads, progress)
    return Estimated(solution, settings, errors, float(np.max(errors[usable], initial=0.0)))


def _sample(problem: Problem, starts: Floats, usable: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    """Evenly spaced ones of the trajectories, sorted by what bounds their speed."""
    if problem.coefficients is not None and usable.size:
        usable = usable[np.argsort(speed_bound(problem.coefficients, starts)[usable], kind="stable")]
    return usable[np.unique(np.linspace(0, max(usable.size - 1, 0), min(size, usable.size)).astype(np.int64))]


@dataclass(frozen=True)
class _Trial:
    """The sample, on which settings are tried."""

    problem: Problem
    starts: Floats
    outputs: Floats
    threads: int | None
    aim: float  #: the quantile of the sample's errors that is looked at

    def run(self, settings: Settings) -> Floats:
        return solve(self.problem, self.starts, self.outputs, settings, self.threads).y

    def choose(self, method: str | None, tol: float) -> Settings:
        """Method, step and fit for the tolerance, in float64."""
        if method is not None:
            return self.calibrate(find_method(method), tol)
        few, single_step = next(names for limit, *names in FRONTIER if tol < limit)
        settings = self.calibrate(find_method(few), tol)
        intervals = np.diff(self.outputs, prepend=0.0)
        started = [settings.method.evaluations(math.ceil(i / settings.dt)) for i in intervals if i > 0.0]
        at_once = settings.method.evaluations(math.ceil(self.outputs[-1] / settings.dt))
        if sum(started) < 2 * at_once:
            return settings
        return self.calibrate(find_method(single_step), tol)

    def fit(self) -> tuple[float, ...]:
        """When to fit steps: never for a user's system, again later where the motion begins fast."""
        c = self.problem.coefficients
        if c is None or not len(self.starts):
            return ()
        fast = np.median(speed_bound(c, self.starts) / vibration_frequency(c)) > 2.0
        return tuple(share * float(self.outputs[-1]) for share in (AGAIN if fast else AGAIN[:1]))

    def calibrate(self, method: Method, tol: float) -> Settings:
        """The longest step at which the sample's quantile of the errors is within the tolerance."""
        c, power = self.problem.coefficients, 1.0 / method.order
        longest = float(np.max(np.diff(self.outputs, prepend=0.0))) / FEWEST or 1.0  # s; any step ends at 0 s
        dt = float(self.outputs[-1]) / 64.0 or longest
        if c is not None:
            guess = FIRST_GUESS.get(method.name, GUESS) * (tol / GUESSED_ERROR) ** power
            dt = guess / float(np.max(vibration_frequency(c)))
        settings = Settings(method, min(dt, longest), self.fit())
        scale = 1.0 / (RATIO**method.order - 1.0)
        good, bad = 0.0, math.inf
        for _ in range(CALIBRATIONS):
            dt = float(settings.dt)
            coarse = self.run(replace(settings, dt=dt * RATIO))
            found = _quantile(_distance(self.run(settings), coarse) * scale, self.aim)
            if found <= tol:
                good = dt
            else:
                bad = dt
            wanted = (AIM * tol / max(found, 1e-300)) ** power if np.isfinite(found) else 0.5
            if good == dt and (wanted < 1.25 or bad < 1.25 * good or good >= longest):
                break
            step = dt * min(max(wanted, 0.25), 4.0)
            if good and step >= bad:
                step = math.sqrt(good * bad)
            if good and step <= good:
                break
            settings = replace(settings, dt=min(step, longest))
        return replace(settings, dt=good or min(bad, longest))

    def ratio(self, settings: Settings, exact: Settings) -> _Ratio:
        """Errors of these settings, seen by a finer run of ``exact`` ones, over the distance of two runs."""
        right = self.run(replace(exact, dt=exact.dt / 2.0))
        fine, coarse = self.run(settings), self.run(replace(settings, dt=settings.dt * RATIO))
        error, distance = _distance(fine, right), _distance(fine, coarse)
        known = (distance > 0.0) & np.isfinite(distance) & np.isfinite(error)
        if not known.any():
            return _Ratio(1.0, 1.0, math.inf if len(error) else 0.0)
        ratios = error[known] / distance[known]
        median, cover = float(np.median(ratios)), float(np.quantile(ratios, COVERED))
        return _Ratio(median, cover, _quantile(error, self.aim))


@dataclass(frozen=True)
class _Ratio:
    """Error of the finer of two runs over their distance, and the sample's error."""

    median: float
    cover: float  #: of most trajectories
    error: float  #: the sample's quantile


def _double(
    problem: Problem,
    starts: Floats,
    outputs: Floats,
    settings: Settings,
    ratio: _Ratio,
    tol: float,
    threads: int | None,
    progress: Progress | None,
) -> tuple[Solution, Floats]:
    """Every trajectory twice; those above the tolerance again, with their own shorter steps.

    Errors are estimated by the sample's median ratio; a trajectory is done where even the ratio that covers
    most of the sample keeps it within the tolerance.
    """
    best = solve(problem, starts, outputs, settings, threads, progress)
    coarse = solve(problem, starts, outputs, replace(settings, dt=settings.dt * RATIO), threads)
    error, margin = _distance(best.y, coarse.y) * ratio.median, ratio.cover / ratio.median
    order, dt = settings.method.order, np.full(len(starts), float(settings.dt))
    again = np.flatnonzero(~(margin * error <= tol) & np.isfinite(starts).all(axis=1))
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
        found = _distance(run.y, before) * ratio.median
        # Where a shorter step has brought nothing to a small error, rounding rules and none will.
        hopeless = known & (found > 0.5 * error[again]) & (found < ROUNDING)
        dt[again], error[again] = own, found
        _replace(best, again, run, np.ones(again.size, dtype=np.bool_))
        again = again[~(margin * found <= tol) & ~hopeless]
    _audit(problem, starts, outputs, settings, dt, best, error, tol, threads)
    return best, error


def _audit(
    problem: Problem,
    starts: Floats,
    outputs: Floats,
    settings: Settings,
    dt: Floats,
    best: Solution,
    error: Floats,
    tol: float,
    threads: int | None,
) -> None:
    """Measure the errors of the worst trajectories by runs of half the step.

    Where one is above the tolerance the finer run is kept, and measured in its turn.
    """
    finite = np.flatnonzero(np.isfinite(starts).all(axis=1))
    worst = finite[np.argsort(-error[finite], kind="stable")[:AUDITED]]
    for _ in range(ROUNDS):
        if not worst.size:
            return
        dt[worst] = dt[worst] / 2.0
        run = solve(problem.part(worst), starts[worst], outputs, replace(settings, dt=dt[worst]), threads)
        error[worst] = _distance(run.y, best.y[:, worst])
        bad = ~(error[worst] <= tol)
        worst = worst[bad]
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


def _distance(a: Floats, b: Floats) -> Floats:
    """Largest difference of two runs (outputs, n, dim), shape (n,); infinite where one is not finite."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.nan_to_num(np.abs(a - b).max(axis=(0, 2)), nan=np.inf, posinf=np.inf)


def _quantile(errors: Floats, level: float) -> float:
    """An order statistic."""
    return float(np.sort(errors)[math.ceil(level * errors.size) - 1]) if errors.size else 0.0
