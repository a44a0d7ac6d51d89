"""Method, step and fit for a tolerance, from runs of a sample.

Steps are tried on a ladder, each rung sqrt(2) shorter than the one before, so that every run serves several
comparisons: with the rung above it tells the error, the rung two below is the truth against which that is
checked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.fitting import fading_force, speed_bound, vibration_frequency
from fastmech.ensembles.problem import Problem
from fastmech.ensembles.solve import Settings, solve
from fastmech.ensembles.stiffness import damping_rate, explicit_limit, explicit_reason, work
from fastmech.integrators.method import Method
from fastmech.integrators.methods import find_method

Floats = NDArray[np.float64]

#: Methods of which two runs with fitted steps cost least at a tolerance, by largest errors: for few outputs,
#: and for outputs so close that starting a multistep method anew costs more. Measured on ensembles from rest
#: and with rates up to 10 rad/s.
FRONTIER = (
    (3e-10, "abm12", "dop853"),
    (1e-7, "ab7", "dop853"),
    (3e-4, "ab6", "verner6"),
    (3e-3, "verner6", "verner6"),
    (math.inf, "tsit5", "tsit5"),
)

#: What steps in where stability and not accuracy would set an explicit method's step.
IMPLICIT = "radau5"

#: An explicit method is not calibrated where its stable step is this many times below what accuracy allows
#: and the implicit one is cheaper at its own step.
STIFF = 4.0

#: Step times vibration frequency at which a method's error on the mechanism is about 1e-6: the first guess.
FIRST_GUESS = {
    "ab6": 0.07,
    "ab7": 0.077,
    "abm12": 0.14,
    "dop853": 0.45,
    "verner6": 0.25,
    "tsit5": 0.15,
    "radau5": 0.15,
}
GUESSED_ERROR, GUESS = 1e-6, 0.05

#: One rung of the ladder: the coarser of two runs has steps longer by this, and fewer of them where the finer
#: has FEWEST between outputs: two equal runs would tell of no error.
RATIO, FEWEST = math.sqrt(2.0), 4

#: The calibration aims at this share of the tolerance.
AIM = 0.5

#: Rungs tried at most, and passed at once.
CALIBRATIONS, LEAP = 10, 4

#: Errors [rad, rad/s] below this may be rounding, magnified by the motion.
ROUNDING = 1e-9

#: Share of the sample's errors that the ratio used for the largest error covers.
COVERED = 0.95

#: Overshoot from which an explicit method's step is taken to be set by stability.
OVERSHOT = 1e-3

#: Where fast motion slows down, steps are fitted again at these shares of the run.
AGAIN = (0.0, 0.125, 0.5)


@dataclass(frozen=True)
class Calibrated:
    """Settings that suit a tolerance, and what the sample's errors were."""

    settings: Settings
    reason: str  #: why this method, one line
    median: float  #: error of the finer of two runs over their distance
    cover: float  #: the same for most trajectories
    truth: Floats  #: states of the sample (outputs, n, dim) by steps half as long
    distance: Floats  #: between the sample's run and the one with longer steps, shape (n,)
    error: float  #: the sample's quantile of the errors


def calibrate(
    problem: Problem,
    starts: Floats,
    outputs: Floats,
    tol: float,
    aim: float,
    method: str | None,
    threads: int | None,
) -> Calibrated:
    """The longest step at which the quantile ``aim`` of a sample's errors is within the tolerance.

    ``method`` is kept if given. Else it is one of :data:`FRONTIER`, or :data:`IMPLICIT` where that costs less
    because an explicit method's step would be set by stability.
    """
    trial = _Trial(problem, starts, outputs, tol, aim, threads)
    if method is not None:
        return trial.ladder(find_method(method)).calibrated("as asked for")
    return trial.choose()


@dataclass(frozen=True)
class _Trial:
    """The sample, on which methods and steps are tried."""

    problem: Problem
    starts: Floats
    outputs: Floats
    tol: float
    aim: float  #: the quantile of the sample's errors that is looked at
    threads: int | None

    def choose(self) -> Calibrated:
        """The cheapest method."""
        few, single_step = (
            find_method(name) for name in next(names for limit, *names in FRONTIER if self.tol < limit)
        )
        c, implicit = self.problem.coefficients, find_method(IMPLICIT)
        if c is None or not len(self.starts):
            return self.choose_blindly(few, single_step, implicit)
        limits = {method.name: explicit_limit(method, c) for method in (few, single_step)}
        steps = {method.name: min(self.guess(method), limits[method.name]) for method in (few, single_step)}
        works = {name: work(find_method(name), dt, self.outputs) for name, dt in steps.items()}
        explicit = min((few, single_step), key=lambda method: works[method.name])
        limit, refused = limits[explicit.name], None
        if STIFF * limit < self.guess(explicit):
            stiff = self.ladder(implicit)
            if stiff.good and self.cost(stiff) < works[explicit.name]:
                rate = float(np.max(damping_rate(c)))
                return stiff.calibrated(
                    f"the damper stops motion at up to {rate:.2g} 1/s: {explicit.name} would be unstable "
                    f"above {limit:.1g} s, accuracy allows {stiff.dt(stiff.rung):.1g} s"
                )
            refused = stiff
        ladder = self.ladder(explicit)
        if refused is None and ladder.unstable():
            refused = self.ladder(implicit)
        return self.cheaper(ladder, refused)

    def choose_blindly(self, few: Method, single_step: Method, implicit: Method) -> Calibrated:
        """The cheapest method for a user's system, of which only runs tell."""
        ladder = self.ladder(few)
        at_once = few.evaluations(math.ceil(self.outputs[-1] / ladder.dt(ladder.rung)))
        if few is not single_step and self.cost(ladder) >= 2 * at_once:
            ladder = self.ladder(single_step)
        return self.cheaper(ladder, self.ladder(implicit) if ladder.unstable() else None)

    def cheaper(self, ladder: _Ladder, implicit: _Ladder | None) -> Calibrated:
        """An explicit method, or the implicit one that was tried beside it."""
        if implicit is not None and implicit.good and self.cost(implicit) < self.cost(ladder):
            return implicit.calibrated(
                f"stability keeps {ladder.method.name} to {ladder.dt(ladder.rung):.1g} s, accuracy allows "
                f"{implicit.dt(implicit.rung):.1g} s"
            )
        beside = None
        if implicit is not None and implicit.good:
            beside = implicit.method.name, implicit.dt(implicit.rung), self.cost(implicit) / self.cost(ladder)
        dt, share = ladder.dt(ladder.rung), ladder.estimate(ladder.rung) / self.tol
        return ladder.calibrated(
            explicit_reason(ladder.method, dt, share, RATIO, self.problem.coefficients, beside)
        )

    def cost(self, ladder: _Ladder) -> float:
        """Work of a trajectory with the step found."""
        return work(ladder.method, ladder.dt(ladder.rung), self.outputs)

    def guess(self, method: Method) -> float:
        """Step [s] that accuracy may allow."""
        c = self.problem.coefficients
        if c is None:
            return float(self.outputs[-1]) / 64.0
        guess = FIRST_GUESS.get(method.name, GUESS) * (self.tol / GUESSED_ERROR) ** (1.0 / method.order)
        return guess / float(np.max(vibration_frequency(c)))

    def fit(self) -> tuple[float, ...]:
        """When to fit steps: never for a user's system, again later where the motion begins fast."""
        c = self.problem.coefficients
        if c is None or not len(self.starts):
            return ()
        fast = np.median(speed_bound(c, self.starts) / vibration_frequency(c)) > 2.0
        return tuple(share * float(self.outputs[-1]) for share in (AGAIN if fast else AGAIN[:1]))

    def ladder(self, method: Method) -> _Ladder:
        """Steps of a method, climbed to the one that suits."""
        c = self.problem.coefficients
        longest = float(np.max(np.diff(self.outputs, prepend=0.0))) / FEWEST or 1.0  # s; any step ends at 0 s
        dt, stable = min(self.guess(method) or longest, longest), False
        if c is not None and len(self.starts):
            limit = explicit_limit(method, c) / RATIO
            dt, stable = min(dt, limit), limit < dt
        fade = fading_force(c, float(self.outputs[-1])) if c is not None else None
        ladder = _Ladder(self, Settings(method, dt, self.fit(), fade=fade), longest, {})
        ladder.climb(1 if stable else LEAP)
        return ladder


@dataclass
class _Ladder:
    """Runs of the sample by rung; the higher its number, the shorter the step."""

    trial: _Trial
    base: Settings
    longest: float  #: step [s] at most
    runs: dict[int, Floats]
    rung: int = 0  #: the one found
    good: bool = False  #: whether it keeps the tolerance

    @property
    def method(self) -> Method:
        return self.base.method

    def dt(self, rung: int) -> float:
        return float(self.base.dt) * RATIO**-rung

    def run(self, rung: int) -> Floats:
        if rung not in self.runs:
            t = self.trial
            settings = replace(self.base, dt=self.dt(rung))
            self.runs[rung] = solve(t.problem, t.starts, t.outputs, settings, t.threads).y
        return self.runs[rung]

    def estimate(self, rung: int) -> float:
        """The sample's quantile of the errors, from two runs."""
        distance = distances(self.run(rung), self.run(rung - 1))
        return order_statistic(distance / (RATIO**self.method.order - 1.0), self.trial.aim)

    def climb(self, leap: int) -> None:
        """Find the rung of the longest step that keeps the tolerance, up to ``leap`` rungs at once."""
        tol, rung = self.trial.tol, 0
        top = math.ceil(2.0 * math.log2(self.dt(0) / self.longest) - 1e-9)
        good: int | None = None
        bad: int | None = None
        last = math.inf
        for _ in range(CALIBRATIONS):
            found = self.estimate(rung)
            wanted = 2.0  # rungs down
            if np.isfinite(found):
                wanted = -2.0 * math.log2(max(AIM * tol / max(found, 1e-300), 1e-300)) / self.method.order
            if found <= tol:
                good = rung
                after = max(rung - min(math.floor(-wanted), leap), top)
                after = after if bad is None else max(after, bad + 1)
                if after >= rung:
                    break
            else:
                bad = rung
                if good is not None:
                    if good - bad <= 1:
                        break
                    after = (good + bad) // 2
                else:
                    if last < ROUNDING and found > 0.5 * last:
                        break  # rounding rules: shorter steps bring nothing
                    after, last = rung + min(max(math.ceil(wanted), 1), LEAP), found
            rung = after
        self.rung, self.good = (bad or 0, False) if good is None else (good, True)

    def unstable(self) -> bool:
        """Whether the step is set by stability: one rung less would fail, and the error is far too small."""
        if not self.good:
            return True
        return self.estimate(self.rung) < OVERSHOT * self.trial.tol and self.dt(self.rung - 1) < self.longest

    def calibrated(self, reason: str) -> Calibrated:
        """Errors of the rung, seen by one of half its step, over the distance of two runs."""
        k = self.rung
        truth, fine, coarse = self.run(k + 2), self.run(k), self.run(k - 1)
        error, distance = distances(fine, truth), distances(fine, coarse)
        settings = replace(self.base, dt=self.dt(k))
        known = (distance > 0.0) & np.isfinite(distance) & np.isfinite(error)
        if not known.any():
            return Calibrated(settings, reason, 1.0, 1.0, truth, distance, math.inf if len(error) else 0.0)
        ratios = error[known] / distance[known]
        median, cover = float(np.median(ratios)), float(np.quantile(ratios, COVERED))
        return Calibrated(
            settings, reason, median, cover, truth, distance, order_statistic(error, self.trial.aim)
        )


def distances(a: Floats, b: Floats) -> Floats:
    """Largest difference of two runs (outputs, n, dim), shape (n,); infinite where one is not finite."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.nan_to_num(np.abs(a - b).max(axis=(0, 2)), nan=np.inf, posinf=np.inf)


def order_statistic(errors: Floats, level: float) -> float:
    """The error that a share ``level`` of the trajectories does not exceed."""
    return float(np.sort(errors)[math.ceil(level * errors.size) - 1]) if errors.size else 0.0
