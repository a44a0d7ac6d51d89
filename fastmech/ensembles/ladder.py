"""The longest step at which a method keeps a tolerance on a sample, searched on a ladder of steps.

Each rung is sqrt(2) shorter than the one before, so that every run serves several comparisons: with the rung
above it tells the error, and for a quantile the rung two below is the truth against which that is checked.

A method's order is what smooth right-hand sides have. Where two comparisons show less, errors are reckoned
with the order seen. Where shorter steps bring nothing (chaos, a singularity, rounding), the search ends as
soon as the next run would be long, and the estimate says what was reached.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.problem import Problem
from fastmech.ensembles.richardson import (
    RATIO,
    ROUNDING,
    SHARE,
    distances,
    error_of_shorter,
    order_seen,
    order_statistic,
)
from fastmech.ensembles.solve import Settings, mean_shares, solve
from fastmech.ensembles.stiffness import total_work
from fastmech.ensembles.stopping import STOP_CODE
from fastmech.integrators.method import Method

Floats = NDArray[np.float64]

#: The calibration aims at this share of the tolerance.
AIM = 0.5

#: Rungs tried at most, and passed at once.
CALIBRATIONS, LEAP = 10, 4

#: Rungs tried in vain (the error fell less than the order asks for) before the next one must cost less than
#: CHEAP right-hand sides, a second or two of one core; until then it may cost as much as the integration.
PATIENCE, CHEAP = 3, 1e7

#: Of the trajectories that need not keep the tolerance, the share that may differ in their stops.
UNSEEN = 0.25

#: Overshoot from which an explicit method's step is taken to be set by stability.
OVERSHOT = 1e-3


@dataclass(frozen=True)
class Sample:
    """Trajectories on which methods and steps are tried, and what is wanted of them."""

    problem: Problem
    starts: Floats
    outputs: Floats
    tol: float
    aim: float  #: the quantile of the sample's errors that is looked at
    threads: int | None
    many: float  #: trajectories that are to be integrated, to one of the sample


@dataclass
class Ladder:
    """Runs of the sample by rung; the higher its number, the shorter the step."""

    sample: Sample
    base: Settings
    longest: float  #: step [s] at most
    runs: dict[int, Floats] = field(default_factory=dict)
    tried: dict[int, float] = field(default_factory=dict)  #: estimates by rung
    codes: dict[int, NDArray[np.int64]] = field(default_factory=dict)  #: of stops, by rung
    shares: Floats = field(default_factory=lambda: np.ones(1))  #: mean fitted steps over the rung's, (n,)
    affordable: float = math.inf  #: right-hand sides of a run at most
    rung: int = 0  #: the one found
    good: bool = False  #: whether it keeps the tolerance

    @property
    def method(self) -> Method:
        """What steps."""
        return self.base.method

    def dt(self, rung: int) -> float:
        """Step [s] of a rung."""
        return float(self.base.dt) * RATIO**-rung

    def run(self, rung: int) -> Floats:
        """States (outputs, n, dim) by a rung's step."""
        if rung not in self.runs:
            t = self.sample
            settings = replace(self.base, dt=self.dt(rung))
            run = solve(t.problem, t.starts, t.outputs, settings, t.threads)
            self.runs[rung], self.shares = run.y, mean_shares(run, self.dt(rung), t.outputs)
            if t.problem.observation.stops:
                self.codes[rung] = run.records[STOP_CODE].astype(np.int64)
        return self.runs[rung]

    def errors(self, rung: int) -> Floats:
        """The sample's errors (n,) from two runs, reckoned with the order that earlier rungs show."""
        p = self.method.order
        found = distances(self.run(rung), self.run(rung - 1))
        above = [tried for tried in self.tried if tried < rung]
        if not above:
            return error_of_shorter(found, p)
        last = max(above)
        before = distances(self.run(last), self.run(last - 1))
        return error_of_shorter(found, order_seen(before, found, RATIO ** (rung - last), p))

    def estimate(self, rung: int) -> float:
        """The sample's quantile of the errors, from two runs."""
        found = order_statistic(self.errors(rung), self.sample.aim)
        if self.codes:
            # Where steps pass over stops unseen, some trajectories see them at one resolution only.
            differ = np.count_nonzero(self.codes[rung] != self.codes[rung - 1])
            if differ > UNSEEN * (1.0 - self.sample.aim) * len(self.sample.starts):
                found = math.inf
        self.tried[rung] = found
        return found

    def score(self, rung: int) -> tuple[int, float, int]:
        """Least for the rung that comes nearest to the tolerance: most trajectories, error, longest step."""
        kept = int(np.count_nonzero(self.errors(rung) <= self.sample.tol))
        return -kept, self.tried.get(rung, math.inf), rung

    def climb(self, leap: int) -> None:
        """Find the rung of the longest step that keeps the tolerance, up to ``leap`` rungs at once."""
        tol, rung = self.sample.tol, 0
        top = math.ceil(2.0 * math.log2(self.dt(0) / self.longest) - 1e-9)
        good: int | None = None
        bad: int | None = None
        last, above, vain = math.inf, 0, 0
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
                    asked = last * RATIO ** (SHARE * self.method.order * (above - rung))
                    vain = vain + 1 if not found < asked else 0
                    after, above, last = rung + min(max(math.ceil(wanted), 1), LEAP), rung, found
                    if self.right_hand_sides(after) > self.limit(vain, rung):
                        break
            rung = after
        self.good = good is not None
        self.rung = good if good is not None else min(self.tried, key=self.score)

    def limit(self, vain: int, rung: int) -> float:
        """Right-hand sides that the run after a rung may take: in vain no more than all trajectories once."""
        if not vain:
            return self.affordable
        if vain >= PATIENCE:
            return CHEAP
        return min(self.affordable, max(CHEAP, self.sample.many * self.right_hand_sides(rung)))

    @property
    def dearest(self) -> float:
        """Right-hand sides of the costliest run, at least CHEAP: those that a rival's runs may take."""
        return max(CHEAP, self.right_hand_sides(max(self.runs)))

    def right_hand_sides(self, rung: int) -> float:
        """Of all trajectories of the sample together, by the steps that earlier runs have fitted to them."""
        return total_work(self.method, self.dt(rung) * self.shares, self.sample.outputs)

    def unstable(self) -> bool:
        """Whether the step is set by stability: one rung less would fail, and the error is far too small."""
        if not self.good:
            return True
        return self.estimate(self.rung) < OVERSHOT * self.sample.tol and self.dt(self.rung - 1) < self.longest

    def calibrated(self, reason: str) -> Calibrated:
        """The rung found."""
        return Calibrated(replace(self.base, dt=self.dt(self.rung)), reason, self)


@dataclass(frozen=True)
class Calibrated:
    """Settings that suit a tolerance, and the sample's runs that have told so."""

    settings: Settings
    reason: str  #: why this method, one line
    ladder: Ladder

    @property
    def truth(self) -> Floats:
        """States of the sample (outputs, n, dim) by steps half as long."""
        return self.ladder.run(self.ladder.rung + 2)

    @property
    def distance(self) -> Floats:
        """Between the sample's run and the one with longer steps, shape (n,)."""
        return distances(self.ladder.run(self.ladder.rung), self.ladder.run(self.ladder.rung - 1))
