"""Method, step and fit for a tolerance, from runs of a sample.

Each method that may suit climbs its ladder of steps (:mod:`fastmech.ensembles.ladder`); the one that keeps
the tolerance with the least work is taken, or the one that comes nearest where none does.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.fitting import fading_force, speed_bound, vibration_frequency
from fastmech.ensembles.ladder import CHEAP, LEAP, Calibrated, Ladder, Sample
from fastmech.ensembles.problem import Problem
from fastmech.ensembles.richardson import RATIO
from fastmech.ensembles.solve import Settings
from fastmech.ensembles.stiffness import damping_rate, explicit_limit, explicit_reason, initial_layer, work
from fastmech.integrators.implicit_method import ImplicitRungeKutta
from fastmech.integrators.method import Method
from fastmech.integrators.methods import find_method

Floats = NDArray[np.float64]

#: Methods of which two runs with fitted steps cost least at a tolerance, by largest errors: for few outputs,
#: and for outputs so close that starting a multistep method anew costs more. Measured on ensembles from rest
#: and with rates up to 10 rad/s.
FRONTIER = (
    (3e-10, "abm12", "dop853"),
    (1e-7, "abm10", "dop853"),
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
    "abm10": 0.14,
    "abm12": 0.14,
    "dop853": 0.45,
    "verner6": 0.25,
    "tsit5": 0.15,
    "radau5": 0.15,
}
GUESSED_ERROR, GUESS = 1e-6, 0.05

#: Steps of the first guess for a user's system, at least and at most.
FEW_STEPS, MANY_STEPS = 64.0, 2.0**14

#: Steps between outputs at least: with fewer, two runs on neighbouring rungs could be equal and tell of no
#: error.
FEWEST = 4

#: What steps in where rounding stops an Adams method, whose sums round more at the same accuracy.
CALM = "dop853"

#: Where fast motion slows down, steps are fitted again at these shares of the run.
AGAIN = (0.0, 0.125, 0.5)


def calibrate(
    problem: Problem,
    starts: Floats,
    outputs: Floats,
    tol: float,
    aim: float,
    method: str | None,
    threads: int | None,
    many: float = 1.0,
) -> Calibrated:
    """The longest step at which the quantile ``aim`` of a sample's errors is within the tolerance.

    ``many`` trajectories are to be integrated to one of the sample. ``method`` is kept if given. Else it is
    one of :data:`FRONTIER`, or :data:`IMPLICIT` where that costs less because an explicit method's step would
    be set by stability.
    """
    trial = _Trial(problem, starts, outputs, tol, aim, threads, many)
    if method is not None:
        return trial.ladder(find_method(method)).calibrated("as asked for")
    return trial.choose()


class _Trial(Sample):
    """The sample, on which methods and steps are tried."""

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
        ladder = self.calmed(self.ladder(explicit))
        if refused is None and ladder.unstable():
            refused = self.ladder(implicit, ladder.dearest)
        return self.cheaper(ladder, refused)

    def choose_blindly(self, few: Method, single_step: Method, implicit: Method) -> Calibrated:
        """The cheapest method for a user's system, of which only runs tell."""
        calm = find_method(CALM)
        ladder = self.ladder(few, CHEAP)
        if ladder.good and ladder.right_hand_sides(ladder.rung) > CHEAP / 4.0 and few is not calm:
            # Of how fast it is nothing is known: perhaps too fast for so low an order.
            rival = self.ladder(calm, ladder.right_hand_sides(ladder.rung))
            ladder = rival if rival.good and self.cost(rival) < self.cost(ladder) else ladder
        at_once = few.evaluations(math.ceil(self.outputs[-1] / ladder.dt(ladder.rung)))
        if ladder.method is few and few is not single_step and self.cost(ladder) >= 2 * at_once:
            ladder = self.ladder(single_step)
        ladder = self.calmed(ladder)
        return self.cheaper(ladder, self.ladder(implicit, ladder.dearest) if ladder.unstable() else None)

    def calmed(self, ladder: Ladder) -> Ladder:
        """The ladder, or that of :data:`CALM` where another method misses the tolerance by more."""
        if ladder.good or ladder.method.name == CALM:
            return ladder
        other = self.ladder(find_method(CALM), ladder.dearest)
        return other if other.score(other.rung) < ladder.score(ladder.rung) else ladder

    def cheaper(self, ladder: Ladder, implicit: Ladder | None) -> Calibrated:
        """An explicit method, or the implicit one that was tried beside it."""
        beside = None
        if implicit is not None and implicit.good:
            if not ladder.good:
                return implicit.calibrated(f"keeps a tolerance that {ladder.method.name} misses")
            if self.cost(implicit) < self.cost(ladder):
                return implicit.calibrated(
                    f"stability keeps {ladder.method.name} to {ladder.dt(ladder.rung):.1g} s, "
                    f"accuracy allows {implicit.dt(implicit.rung):.1g} s"
                )
            if self.cost(ladder) > 0.0:  # else the only output is the start
                ratio = self.cost(implicit) / self.cost(ladder)
                beside = implicit.method.name, implicit.dt(implicit.rung), ratio
        if not ladder.good:
            return ladder.calibrated("nearest to a tolerance that no method tried has kept")
        dt, share = ladder.dt(ladder.rung), ladder.estimate(ladder.rung) / self.tol
        return ladder.calibrated(
            explicit_reason(ladder.method, dt, share, RATIO, self.problem.coefficients, beside)
        )

    def cost(self, ladder: Ladder) -> float:
        """Work of a trajectory with the step found."""
        return work(ladder.method, ladder.dt(ladder.rung), self.outputs)

    def guess(self, method: Method) -> float:
        """Step [s] that accuracy may allow."""
        c = self.problem.coefficients
        if c is None:
            return self.guess_blindly()
        guess = FIRST_GUESS.get(method.name, GUESS) * (self.tol / GUESSED_ERROR) ** (1.0 / method.order)
        return guess / float(np.max(vibration_frequency(c)))

    def guess_blindly(self) -> float:
        """The time [s] in which a user's system would move as far as its starts are from zero, or less."""
        t_end = float(self.outputs[-1])
        Y = self.starts.T.copy()
        rates = np.zeros_like(Y)
        self.problem.rhs(0.0, Y, rates, self.problem.params.block(Y.shape[1]))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            times = np.abs(Y).max(axis=0) / np.abs(rates).max(axis=0)
        times = times[np.isfinite(times) & (times > 0.0)]
        longest, shortest = t_end / FEW_STEPS, t_end / MANY_STEPS
        return float(np.clip(np.median(times), shortest, longest)) if times.size else longest

    def fit(self) -> tuple[float, ...]:
        """When to fit steps: never for a user's system, again later where the motion begins fast."""
        c = self.problem.coefficients
        if c is None or not len(self.starts):
            return ()
        fast = np.median(speed_bound(c, self.starts) / vibration_frequency(c)) > 2.0
        return tuple(share * float(self.outputs[-1]) for share in (AGAIN if fast else AGAIN[:1]))

    def ladder(self, method: Method, affordable: float = math.inf) -> Ladder:
        """Steps of a method, climbed to the one that suits."""
        c = self.problem.coefficients
        longest = float(np.max(np.diff(self.outputs, prepend=0.0))) / FEWEST or 1.0  # s; any step ends at 0 s
        dt, stable = min(self.guess(method) or longest, longest), False
        if c is not None and len(self.starts):
            limit = explicit_limit(method, c) / RATIO
            dt, stable = min(dt, limit), limit < dt
        early = fading_force(c, float(self.outputs[-1])) if c is not None else ()
        if c is not None and isinstance(method, ImplicitRungeKutta):
            early += initial_layer(c, self.starts)
        ladder = Ladder(self, Settings(method, dt, self.fit(), early=early, bounded=False), longest)
        ladder.affordable = affordable
        ladder.climb(1 if stable else LEAP)
        return ladder
