"""Work against precision on a sample: what a right-hand side costs, and which method and steps need least.

A method of order p has errors e(h) ~ h^p (Hairer, Norsett, Wanner, *Solving ODEs I*, section II.4): two runs
with different steps tell the error of the shorter, and how long the steps for another error must be. So a
method of high order runs with shorter and shorter steps until its error is far below the tolerance: that is
the reference. Other methods are compared with it, each with steps that its own error asks for. A few
trajectories choose the method, the whole sample its steps.

Work is counted, not timed. By a clock two runs of one call might choose different methods, and their results
would differ in every bit, with the load of the machine if not with the number of threads. So the operations
of the right-hand side at hand are counted; what a clock alone can tell of the engine is in few constants:
:data:`HISTORY` and :data:`EACH_PAIR`, and the short lists :data:`TRIED` and :data:`TRIED_ON_SYSTEMS`.
``fastmech bench --problem`` measures the rates that they stand for, ``--only stiff`` those of implicit steps.
"""

from __future__ import annotations

import math
import types
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from fastmech.arrays import Flags, Floats
from fastmech.ensembles.fitting import explicit_limit, fading_load, initial_layer
from fastmech.ensembles.problem import Case
from fastmech.ensembles.run import Sample, run_ensemble
from fastmech.ensembles.solve import (
    STEPS_BETWEEN,
    Settings,
    Solution,
    are_short,
    distances,
    divided,
    nothing,
    solve,
    solve_at,
)
from fastmech.ensembles.status import Status
from fastmech.integrators.methods import Adams, Explicit, ImplicitRungeKutta, Method, find_method
from fastmech.kernels.rebuilding import rebuilt
from fastmech.kernels.sincos import cos, sin

#: Operations of a right-hand side that takes arrays, for each state: they are not counted.
VECTOR_RHS = 10.0

#: Operations that a product with a row of an Adams method's history takes the time of: it lies in memory. Of
#: ``fm.work_precision``'s rates on Henon and Heiles' system and on the mechanism, beside ``dop853``'s.
HISTORY = 1.7

#: The same of a division, and of a function such as sine or root.
DIVISION, FUNCTION = 5.0, 20.0

#: Time of a step of ``radau5``: right-hand sides of its iterations and their Jacobian; operations for each
#: square of the number of states, of what is done a lane at a time; and for each cube those of its two
#: inverses, the complex one as a real one of twice the size (elimination of n rows of twice as many columns
#: takes 3 n^3). Measured beside ``dop853`` on linear systems of 1, 2, 4 and 6 states, the mechanism and a
#: double pendulum, of which it gives 0.6 to 1.4 times the ratios.
IMPLICIT_SIDES, EACH_PAIR, ELIMINATION = 20.0, 700.0, 3.0 + 3.0 * 2.0**3

#: Time of operations by NumPy's names; what has another name is a function.
COSTS = {
    **dict.fromkeys(
        ["add", "subtract", "multiply", "negative", "positive", "absolute", "maximum", "minimum"], 1.0
    ),
    **dict.fromkeys(["less", "less_equal", "greater", "greater_equal", "equal", "not_equal"], 1.0),
    **dict.fromkeys(["divide", "remainder", "floor_divide"], DIVISION),
    "power": 2.0,
}


class Counted(NDArrayOperatorsMixin):
    """A number that counts what is done with it."""

    def __init__(self, value: Any, count: list[float]) -> None:
        self.value, self.count = value, count

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *given: Any) -> Any:
        """Operators and NumPy's functions come here."""
        self.count[0] += COSTS.get(ufunc.__name__, FUNCTION)
        return Counted(ufunc(*(x.value if isinstance(x, Counted) else x for x in given)), self.count)

    def __float__(self) -> float:
        """Asked for by the functions of :mod:`math`."""
        self.count[0] += FUNCTION
        return float(self.value)

    def __bool__(self) -> bool:
        return bool(self.value)


def operations_of(rhs: types.FunctionType, arguments: list[float]) -> float:
    """Operations of one call of a user's right-hand side with these arguments, where they can be counted.

    Else (it calls what takes only floats) ten for each argument.
    """
    count = [0.0]
    given = [Counted(value, count) for value in arguments]
    try:
        with np.errstate(all="ignore"):
            rebuilt(rhs, __name__, {sin: np.sin, cos: np.cos})(*given)
    except Exception:  # whatever a user's function may raise: then nothing is known
        return VECTOR_RHS * len(arguments)
    return max(count[0], 1.0)


def step_operations(method: Method, operations: float, dim: int) -> float:
    """Operations of a step: its right-hand sides, and its sums over stages or history."""
    if isinstance(method, ImplicitRungeKutta):
        return IMPLICIT_SIDES * operations + EACH_PAIR * dim**2 + ELIMINATION * dim**3
    if isinstance(method, Adams):
        sums = 2 if method.corrects else 1
        return sums * (operations + HISTORY * method.rows * dim)
    tableau: Any = getattr(method, "tableau")  # noqa: B009
    weights = sum(1 for row in (*tableau.a, tableau.b) for weight in row if weight)
    return float(tableau.stages * operations + weights * dim)


def start_operations(method: Method, operations: float, dim: int) -> float:
    """Operations of an Adams method's start beside the steps that it replaces; 0 of others."""
    if not isinstance(method, Adams):
        return 0.0
    per_step = method.starter.stages * (operations + 0.5 * method.starter.stages * dim)
    return float(method.start_steps * per_step)


#: What gives the reference, and where stability and not accuracy would set its steps.
REFERENCE, IMPLICIT = "abm10", "radau5"

#: The explicit method with the longest stable steps of high order: a user's system has its reference from it.
SINGLE_STEP = "dop853"

#: Methods that are tried beside the reference's, by the tolerance over the starts' size below which they are:
#: high orders pay where errors are to be small (Hairer, Norsett, Wanner, section II.10).
TRIED = (
    (1e-8, ("abm12", "dop853")),
    (1e-5, ("abm8", "dop853")),
    (3e-4, ("ab6", "dop853")),
    (math.inf, ("ab6", "tsit5")),
)
#: The same of systems: where a right-hand side costs little, Adams methods' histories cost more than stages.
TRIED_ON_SYSTEMS = (
    (1e-8, ("verner7", "abm12")),
    (1e-5, ("verner7", "abm10")),
    (3e-4, ("verner7", "ab6")),
    (math.inf, ("tsit5", "ab6")),
)

#: Lengths of the steps of two runs that tell an error.
RATIO = math.sqrt(2.0)

#: Intervals between outputs have as many steps as one of so many steps of the shorter of two runs: then the
#: longer run has fewer in each.
SHORTEST = STEPS_BETWEEN * RATIO

#: Shares of the tolerance: what steps aim at, what is near enough, the reference's error, and its distance to
#: one more run that confirms it.
AIM, NEAR, REFERRED, CONFIRMED = 0.5, 0.25, 1.0 / 16.0, 0.25

#: By how much steps change at most from run to run, and to what is believed without a run.
LEAP, BELIEVED = 4.0, 1.5

#: Steps of a run at least.
FEWEST = 8.0

#: Trajectories that choose the method: whole vectors.
PROBE = 16

#: Runs to a step that suits, and runs in vain (infinite, or an error not halved) before that is given up.
RUNS, VAIN = 6, 3

#: Operations of a run that may be in vain: about a second.
CHEAP_RUN = 1e9

#: Differences, in the starts' size, that may be rounding, magnified by the motion.
ROUNDING = 1e-9

#: An explicit method's steps are set by stability where its error is below this share of the tolerance, and
#: so is it from the begin where its stable step is so many times below what accuracy may allow.
OVERSHOT, STIFF = 1e-3, 4.0

#: Step of the reference's method, times the vibrations' frequency, with an error of about 1e-6 on the
#: mechanism: the first guess.
GUESS, GUESSED = 0.14, 1e-6

#: Steps of the first guess for a user's system, at least and at most.
FEW_STEPS, MANY_STEPS = 32.0, 2.0**14

#: Steps that grow from the start until they are as long as one that is asked about: how often their times
#: double until that time, and steps in each. So exp(-k t) errs by less than 1e-7 by ``radau5``, whatever k up
#: to 1e10 over the step; there are more where a smaller share of the starts' size is asked for.
DOUBLINGS, STEPS_A_DOUBLING, GROWN = 34.0, 8.0, 1e-7

#: Steps from the start that are taken for the first ones.
FIRST_STEPS = 8.0

#: A motion that goes to infinity by itself is not finite after times that are alike by this share, whatever
#: the steps. Steps that are not stable bring it there sooner or later where they are shorter. And by how much
#: those of an implicit method are shorter that is to go on.
SAME_TIME, SHORTER = 0.9, 8.0

#: Where fast motion slows down, steps are fitted again at these shares of the run.
AGAIN = (0.0, 0.125, 0.5)

LEAST_WORK = "least work at this tolerance and these output times"
NEAREST = "nearest to a tolerance that no method tried has kept"


def order_statistic(errors: Floats, level: float) -> float:
    """The error that a share ``level`` of the trajectories does not exceed; NaN: there are none."""
    return float(np.sort(errors)[math.ceil(level * errors.size) - 1]) if errors.size else math.nan


def error_of_finer(distance: Floats, ratio: float, order: int) -> Floats:
    """Errors of runs from their distances to those with steps longer by ``ratio``: Richardson.

    The order is trusted up to a ratio of 2.
    """
    return np.asarray(distance / (min(ratio, 2.0) ** order - 1.0))


def first_step_errors(case: Case, settings: Settings, tol: float) -> Floats:
    """Errors of the first step of a system's trajectories (n,): its distance to two half steps.

    Zero of scenes, whose vibrations are known beforehand, and where the run is over before. What dies out
    within an implicit step is no vibration: where the error is above ``tol``, that of steps that grow counts.
    """
    found = np.zeros(len(case.starts))
    steps = np.broadcast_to(settings.dt, found.shape)
    if case.problem.bounds is not None:
        return found
    for dt in np.unique(steps[steps < case.outputs[-1]]):
        who, own = np.flatnonzero(steps == dt), replace(settings, dt=dt)
        part = case.part(who)._replace(outputs=np.array([dt]))
        found[who] = distances(*(solve(part, replace(own, dt=dt / number, early=())) for number in (1, 2)))
        late = who[found[who] > tol]
        if late.size and isinstance(settings.method, ImplicitRungeKutta):
            found[late] = np.fmin(found[late], _growing_step_errors(case.part(late), own, tol))
    return found


def escaping(case: Case, settings: Settings, dt: float) -> Flags:
    """Whose motions (n,) go to infinity by themselves: at nearly the same time, whatever the steps.

    Where a motion turns stiff at once, steps that are not stable fail then too. There an implicit method goes
    on, with steps that are shorter than ``dt`` [s]; before infinity it finds no solution of a step.
    """
    n = len(case.starts)
    failed, steps = np.full((3, n), np.nan), np.broadcast_to(settings.dt, n)
    for k in range(3):  # in two runs unstable steps may fail at the same time by chance
        who = np.flatnonzero(np.isfinite(failed[:k]).all(axis=0))
        if who.size:
            failed[k, who] = solve_at(case.part(who), replace(settings, dt=steps[who] / 2.0**k)).failed
    found = np.asarray(failed.min(axis=0) > SAME_TIME * failed.max(axis=0))
    dim, method, dt = case.starts.shape[1], find_method(IMPLICIT), dt / SHORTER
    own = PROBE * step_operations(method, VECTOR_RHS * dim, dim)
    for who in np.split(np.flatnonzero(found), [PROBE]):  # the others only where some of the first go on
        later = np.fmin(case.outputs[-1:], failed[:, who].max(initial=0.0) / SAME_TIME)
        if who.size and own * later[0] / dt <= LEAP * CHEAP_RUN:
            stopped = solve_at(case.part(who)._replace(outputs=later), Settings(method, dt)).failed
            found[who] = stopped <= failed[:, who].max(axis=0)
        if found[who].all():
            break
    return found


def steps_a_doubling(method: Method, tol: float) -> float:
    """Steps of each doubling of the time, where they grow with it; ``tol`` is over the starts' size."""
    return STEPS_A_DOUBLING * max(1.0, (GROWN / tol) ** (1.0 / method.order))


def _growing_step_errors(case: Case, settings: Settings, tol: float) -> Floats:
    """Largest errors (n,) of steps that grow with the time, from tiny ones to ``settings.dt``.

    What dies out is gone before steps are long for it; a vibration is still there (Hairer, Wanner, *Solving
    ODEs II*, section IV.8).
    """
    problem, dt, begin = case.problem, float(settings.dt), 0.0
    now, method = problem.inward(case.starts), problem.method(settings.method)
    number = steps_a_doubling(method, tol / case.size)
    worst = np.zeros(len(now))
    for end in dt * 2.0 ** np.arange(-DOUBLINGS, math.ceil(math.log2(number)) + 2.0):
        end = min(end, float(case.outputs[-1]))
        if end == begin:
            break
        steps = (end - begin) / number
        times = np.array([begin, end])
        whole, halves = (
            run_ensemble(
                problem.rhs, problem.params, now, times, step, method=method, threads=case.threads
            ).states[-1]
            for step in (steps, 0.5 * steps)
        )
        with np.errstate(invalid="ignore", over="ignore"):
            apart = np.abs(problem.outward(whole) - problem.outward(halves)).max(axis=1)
        worst = np.fmax(worst, np.where(np.isnan(apart), np.inf, apart))
        begin, now = end, halves
    return worst


@dataclass(frozen=True)
class Point:
    """A method with its steps, on a sample."""

    method: Method
    dt: float  #: step [s]
    error: float  #: the quantile of the sample's errors
    work: float  #: operations of a trajectory
    good: bool  #: whether the tolerance is kept
    limited: bool = False  #: stability, not accuracy, sets the step


@dataclass
class Trial:
    """Runs of a sample by several methods, and their errors against a reference."""

    case: Case
    tol: float
    level: float  #: the quantile of the errors that counts
    fit: tuple[float, ...]
    truth: Solution | None = None
    doubt: Floats = field(default_factory=lambda: np.zeros(0))  #: errors of the reference
    apart: Floats | None = None  #: its distances from the run before
    refers: tuple[Method, float] | None = None  #: its method and step [s]
    fitted: float = 1.0  #: steps of a trajectory, on average, in those of slow motion
    grows: bool = False  #: an implicit method's steps grow from tiny ones: longer ones fail at the start
    _runs: dict[tuple[Any, ...], Solution] = field(default_factory=dict)

    @cached_property
    def _sample(self) -> Sample | None:
        """For small runs of a system without arrays, all with the same steps."""
        problem, starts, outputs, _ = self.case
        system = problem.system
        if system is None or system.vector or problem.observation.record.size or not outputs[0] > 0.0:
            return None
        return Sample(problem.rhs, problem.params, problem.inward(starts))

    @property
    def until(self) -> float:
        """End of the run [s]."""
        return float(self.case.outputs[-1])

    @property
    def intervals(self) -> Floats:
        """Times between outputs [s]."""
        return np.diff(self.case.outputs, prepend=0.0)

    @property
    def steps_end(self) -> bool:
        """Whether steps must end at all outputs."""
        return self.case.steps_end or self.grows

    @property
    def longest(self) -> float:
        """Step [s] at most."""
        most = self.until / FEWEST or 1.0
        if not self.steps_end:
            return most
        # Then nothing is interpolated: longer steps between two outputs would be the same ones.
        return min(most, float(self.intervals.max()) / (STEPS_BETWEEN * RATIO))

    def ends_at_outputs(self, dt: float) -> bool:
        """Whether whole steps lie between outputs."""
        return self.steps_end or self.case.outputs.size * STEPS_BETWEEN * dt <= self.until

    def taken(self, dt: float, shortest: float) -> float:
        """The longest of the steps [s] that runs with steps of at most ``dt`` take.

        Errors of two runs are told apart by these.
        """
        if not self.ends_at_outputs(dt) or not self.until:
            return dt
        return float((self.intervals / np.maximum(self._steps(dt, shortest), 1.0)).max())

    def _steps(self, dt: float, shortest: float) -> Floats:
        """Steps in each interval between outputs."""
        counted = np.where(self.intervals > 0.0, np.maximum(self.intervals, shortest), 0.0)
        return np.ceil(counted / dt * (1.0 - 1e-12))

    @cached_property
    def operations(self) -> float:
        """Operations of a right-hand side."""
        problem, starts = self.case.problem, self.case.starts
        if problem.system is None or not len(starts):
            return problem.bounds.operations if problem.bounds is not None else VECTOR_RHS
        if problem.system.vector:
            return VECTOR_RHS * starts.shape[1]
        values = [float(column.flat[0]) for column in problem.params.columns]
        named = dict(zip(problem.system.parameters, values, strict=True))
        own = [named[name] for name in problem.system.parameter_order]
        return operations_of(problem.system.rhs, [0.0, *starts[0].tolist(), *own])  # type: ignore[arg-type]

    def settings(self, method: Method, dt: float, shortest: float | None = None) -> Settings:
        """How a method runs with steps of dt [s]; ``shortest`` as in :meth:`run`."""
        bounds, implicit = self.case.problem.bounds, isinstance(method, ImplicitRungeKutta)
        shortest = self.shortest(dt) if shortest is None else shortest
        early: tuple[tuple[float, float], ...] = ()
        if bounds is not None:
            early = fading_load(bounds, self.until)
            if implicit:
                early += initial_layer(bounds, self.case.starts)
        elif implicit and self.grows:
            # All runs that are compared have their steps grow until the same time.
            number = steps_a_doubling(method, self.tol / self.case.size)
            until = 2.0 * number * shortest / SHORTEST
            doublings = np.arange(DOUBLINGS + math.log2(number))
            early = tuple((until * 2.0**-k, 2.0**-k) for k in doublings)
        return Settings(method, dt, self.fit, early=early, bounded=False, shortest=shortest)

    def shortest(self, dt: float) -> float:
        """Intervals between outputs have as many steps as one so long [s].

        So runs with steps of ``dt`` and longer ones differ in each.
        """
        if self.steps_end or self.case.problem.bounds is not None:
            return SHORTEST * dt
        # Where steps end at outputs, there are enough of them in an interval of mean length.
        return min(SHORTEST * dt, self.until / self.case.outputs.size)

    def run(self, method: Method, dt: float, shortest: float | None = None) -> Solution:
        """The sample's run; ``shortest`` [s] is that of runs with which it is compared step by step."""
        settings = self.settings(method, dt, shortest)
        short = self.ends_at_outputs(dt) and are_short(self.case.outputs, settings.shortest).any()
        settings = replace(settings, shortest=settings.shortest if short else 0.0)
        key = method.name, dt, settings.shortest, settings.early[:1]
        if key not in self._runs:
            # The bookkeeping of few steps would take longer than they do.
            run = None
            if self.ends_at_outputs(dt):
                times, outputs = divided(self.case.outputs, dt, settings.shortest)
                run = self._by_sample(method, times, dt)
                if run is not None:
                    run.y = run.y[outputs]
            run = run or solve_at(self.case, settings)
            self._runs[key] = run
            if self.fit and self.until and len(self.case.starts):
                self.fitted = max(float(run.steps.mean()) * dt / self.until, 1.0)
        return self._runs[key]

    def _look_at_start(self, method: Method, dt: float) -> None:
        """Let steps grow of an implicit method that finds no solution of some first steps of dt [s]."""
        problem, dt = self.case.problem, min(dt, self.longest)
        own = problem.bounds is None and not problem.observation.stops
        if own and isinstance(method, ImplicitRungeKutta):
            self.grows = self.grows or bool((self.run(method, dt).failed < FIRST_STEPS * dt).any())

    @property
    def unsolved(self) -> bool:
        """Whether an implicit method has found no solution of some steps."""
        return any((run.status == Status.NOT_CONVERGED).any() for run in self._runs.values())

    def _by_sample(self, method: Method, outputs: Floats, dt: float) -> Solution | None:
        """A run through output times [s] that keeps no books, where there is one."""
        (problem, starts, _, _), sample = self.case, self._sample
        if sample is None or not isinstance(method, Explicit):
            return None
        y = sample.run(method, np.concatenate([[0.0], outputs]), dt)
        return None if y is None else replace(nothing(problem, 0, *starts.shape), y=problem.outward(y))

    def first_step_errors(self, method: Method, dt: float) -> Floats:
        """See :func:`first_step_errors`."""
        if dt < self.until:
            whole, halves = (self._by_sample(method, np.array([dt]), dt / number) for number in (1, 2))
            if whole is not None and halves is not None:
                found = distances(whole, halves)
                if (found <= self.tol).all():
                    return found
        return first_step_errors(self.case, self.settings(method, dt), self.tol)

    def work(self, method: Method, dt: float) -> float:
        """Operations of a trajectory with steps of dt [s]."""
        operations, dim = self.operations, self.case.starts.shape[1]
        taken, starts_anew = float(math.ceil(self.until / dt * (1.0 - 1e-12))), 1.0
        if not self.ends_at_outputs(dt):
            taken = self.until / dt
        elif self.case.outputs.size > 1:
            intervals, steps = self.intervals, np.maximum(self._steps(dt, self.shortest(dt)), 1.0)
            taken, lengths = float(steps[intervals > 0.0].sum()), intervals / steps
            starts_anew += np.count_nonzero(~np.isclose(lengths[1:], lengths[:-1], rtol=1e-9))
        own = step_operations(method, operations, dim)
        return taken * self.fitted * own + starts_anew * start_operations(method, operations, dim)

    def price(self, method: Method, dt: float) -> float:
        """The same, with the steps that grow, which show of an implicit method that it damps no vibration."""
        work = self.work(method, dt)
        if self.case.problem.bounds is None and isinstance(method, ImplicitRungeKutta):
            steps = 3.0 * DOUBLINGS * steps_a_doubling(method, self.tol / self.case.size)
            work += steps * step_operations(method, self.operations, self.case.starts.shape[1])
        return work

    def typical(self, errors: Floats) -> float:
        """The quantile that counts; of those that have a reference where it is not known of all."""
        found = order_statistic(errors, self.level)
        known = self.doubt <= self.tol
        if self.truth is not None:
            known = known & np.isfinite(self.truth.y).all(axis=(0, 2))
        return found if np.isfinite(found) or not known.any() else order_statistic(errors[known], self.level)

    def errors(self, method: Method, dt: float) -> Floats:
        """Against the reference (n,)."""
        assert self.truth is not None
        found = distances(self.run(method, dt), self.truth)
        return np.where(self.doubt <= self.tol, found, np.inf)

    def refer(self, method: Method, dt: float) -> bool:
        """Find a reference with steps from dt [s] on; whether it is good enough for the sample's quantile.

        Where nothing converges no run of more than :data:`CHEAP_RUN` operations begins. Where another method
        has been tried, steps begin so long that the first run is none: a layer at the start may ask for short
        ones that accuracy does not need. What is kept is the run in which most trajectories have converged.
        """
        goal, p, n = REFERRED * self.tol, method.order, max(len(self.case.starts), PROBE)
        rounding = ROUNDING * self.case.size
        kept = int(np.count_nonzero(self.doubt <= goal)) if self.refers else -1
        while self.refers is not None and dt < self.longest and n * self.work(method, dt) > CHEAP_RUN:
            dt *= LEAP
        self._look_at_start(method, self.taken(dt, 0.0))
        shortest = self.shortest(min(dt, self.longest) / RATIO)
        dt = self.taken(min(dt, self.longest), shortest)
        before, fell, vain, ratio = math.inf, 0.0, 0, RATIO
        last, finite = self.run(method, dt, shortest), np.zeros(len(self.case.starts), dtype=np.bool_)
        while not vain or n * self.work(method, dt / ratio) <= CHEAP_RUN:
            dt = self.taken(dt / ratio, shortest)
            finer = self.run(method, dt, shortest)
            distance = distances(last, finer)
            doubt, ended = error_of_finer(distance, ratio, p), np.isfinite(distance)
            # Who is infinite again, though steps are shorter, is so by its motion.
            counts = ended if ended.any() and np.array_equal(ended, finite) else np.ones_like(ended)
            finite = ended
            if order_statistic(doubt[counts], self.level) <= goal:
                # Steps that are long for a vibration damp it, and agree on the rest that is not there.
                damped = self.first_step_errors(method, dt) > self.tol
                doubt = np.where(damped, np.inf, doubt)
                kept = -1 if damped.any() else kept
            found, apart = (order_statistic(values[counts], self.level) for values in (doubt, distance))
            settled = int(np.count_nonzero(doubt <= goal))
            if settled > kept or (settled == kept and apart < before):
                self.truth, self.doubt, self.apart = finer, doubt, distance
                self.refers, kept = (method, dt), settled
            if apart < rounding and apart > 0.5 * before:
                return True
            if found <= goal:
                # Where steps are longer than what they pass over, two runs agree on what neither has seen:
                # a third has shown the order, or one more confirms.
                if apart <= before * fell:
                    return True
                again = distances(finer, self.run(method, dt / RATIO, shortest))
                if order_statistic(again[counts], self.level) <= max(CONFIRMED * self.tol, rounding):
                    return True
                if self.truth is finer:
                    self.doubt = np.fmax(doubt, again)
                    kept = int(np.count_nonzero(self.doubt <= goal))
                before, last, ratio, vain = math.inf, finer, LEAP, vain + 1
                continue
            vain = vain + 1 if not apart <= 0.5 * before else 0
            if vain >= (VAIN if np.isfinite(found) else 2 * VAIN):
                break
            # Whether steps are short enough at last for some.
            begins = apart == math.inf and bool(np.isfinite(finer.y).all(axis=(0, 2)).any())
            if apart == math.inf and not begins and n * self.work(method, dt / LEAP) > LEAP**2 * CHEAP_RUN:
                break  # all may go to infinity, whatever the steps
            fell = min(ratio, 2.0) ** (-0.5 * p)  # at least, of distances that fall as the order says
            before, last, ratio = apart, finer, RATIO if begins else LEAP
            if np.isfinite(found):
                # More than 2 cannot show what it brings.
                ratio = LEAP if vain else min(max((found / goal) ** (1.0 / p) * 1.05, RATIO), 2.0)
        return False

    def tune(self, method: Method, dt: float, least: float = math.inf, near: float = NEAR) -> Point:
        """The step with which a method's error is between ``near`` times the tolerance and it.

        On the trajectories that choose a method, ``least`` is the work of the best one so far: an error near
        enough tells the step by the method's order, and a method that needs more work is given up. With
        another ``near`` than by default every step is run.
        """
        self._look_at_start(method, dt)
        good: tuple[float, float] | None = None
        bad, best, dt = math.inf, (math.inf, dt), min(dt, self.longest)
        before, vain = math.inf, 0
        for _ in range(RUNS):
            found = self.typical(self.errors(method, dt))
            best = min(best, (found, dt))
            wanted = 1.0 / LEAP
            if found < math.inf:
                wanted = (AIM * self.tol / max(found, 1e-300)) ** (1.0 / method.order)
                believed = near == NEAR and self.refers is not None and 1.0 / BELIEVED <= wanted <= BELIEVED
                wanted = min(max(wanted, 1.0 / LEAP), LEAP)
                asked = min(dt * wanted, self.longest)
                price = self.price(method, asked)
                if believed or (found > self.tol and price > least):
                    return Point(method, asked, AIM * self.tol, price, price <= least)
            if found <= self.tol:
                good = (dt, found) if good is None or dt > good[0] else good
                if found >= near * self.tol or dt >= self.longest or bad <= 1.2 * dt:
                    break
                dt = min(dt * wanted, self.longest, math.sqrt(dt * bad))
            else:
                vain = vain + 1 if good is None and bad < math.inf and found > 0.5 * before else 0
                before, bad = found, min(bad, dt)
                dear = max(len(self.case.starts), PROBE) * self.work(method, dt) > CHEAP_RUN
                if vain > (not dear) or (good is not None and bad <= 1.2 * good[0]):
                    break
                dt *= 1.0 / RATIO if vain else min(wanted, 0.9)
                dt = dt if good is None else max(dt, math.sqrt(good[0] * bad))
        error, dt = best if good is None else (good[1], good[0])
        limited = good is not None and error < OVERSHOT * self.tol and bad < math.inf
        return Point(method, dt, error, self.price(method, dt), good is not None, limited=limited)

    def nearest(self) -> float:
        """Step [s] of the reference's method with the error that is nearest to what is aimed at."""
        assert self.refers is not None
        method, dt = self.refers
        steps = [step for name, step, *_ in self._runs if name == method.name and step > dt]
        errors = {step: self.typical(self.errors(method, step)) for step in steps}
        known = {step: error for step, error in errors.items() if 0.0 < error < math.inf}
        if not known:
            return dt * (AIM / REFERRED) ** (1.0 / method.order)
        return min(known, key=lambda step: abs(math.log(known[step] / (AIM * self.tol))))


class Chosen(NamedTuple):
    """A method and its steps for a tolerance."""

    settings: Settings
    reason: str  #: why, one line
    trial: Trial  #: the whole sample's runs


def choose(
    case: Case, tol: float, level: float, method: str | None, truth: Solution | None, pilot: bool
) -> Chosen:
    """The method and the step with which the quantile ``level`` of a sample's errors is within ``tol``.

    ``method`` is kept if given; ``truth`` is the sample's, if it is known from elsewhere. With a
    ``pilot``, whose runs follow, the few that choose a method suffice.
    """
    fit = times_to_fit(case)
    few = np.unique(np.linspace(0, len(case.starts) - 1, PROBE).astype(np.int64))
    small = len(case.starts) <= 2 * PROBE
    probe = Trial(case if small else case.part(few), tol, level, fit)
    points = _points(probe, None if method is None else find_method(method))
    best = min(points, key=lambda point: (not point.good, point.work if point.good else point.error))
    reason, whole = "as asked for" if method is not None else _reason(best, points, tol), probe
    if pilot and truth is None:
        return Chosen(probe.settings(best.method, best.dt), reason, probe)
    if not small:
        whole = Trial(case, tol, level, fit, grows=probe.grows)
        finer = min((REFERRED / AIM) ** (1.0 / best.method.order), 1.0 / RATIO)
        truth_run = whole.run(best.method, finer * best.dt, whole.shortest(best.dt))
        whole.truth, whole.doubt = truth_run, np.zeros(len(case.starts))
    if truth is not None:
        whole.truth, whole.doubt = truth, np.zeros(len(case.starts))
    if best.error < math.inf and not best.limited and not (small and NEAR * tol <= best.error <= tol):
        best = whole.tune(best.method, best.dt)
    return Chosen(whole.settings(best.method, best.dt), reason, whole)


def _points(probe: Trial, asked: Method | None) -> list[Point]:
    """Methods and their steps on the trajectories that choose."""
    explicit, implicit = find_method(REFERENCE), find_method(IMPLICIT)
    bounds, dt, limit = probe.case.problem.bounds, first_guess(probe.case, probe.tol), math.inf
    tried, single_step = TRIED, find_method(SINGLE_STEP)
    if bounds is None:
        explicit, tried = single_step, TRIED_ON_SYSTEMS
    if bounds is not None and len(probe.case.starts):
        limit = explicit_limit(explicit, bounds) / RATIO
    if isinstance(asked, ImplicitRungeKutta):
        implicit = asked
    stiff = STIFF * limit < dt or implicit is asked
    base = implicit if stiff else explicit
    referred = probe.refer(base, dt if stiff else min(dt, limit))
    assert probe.refers is not None
    lost = not referred and not stiff and bool(np.isinf(probe.doubt).all())
    if lost and not escaping(probe.case, probe.settings(*probe.refers), probe.refers[1]).all():
        probe.refer(implicit, dt)
    if not (probe.doubt <= probe.tol).any():  # nothing converges
        base, dt = probe.refers if asked is None else (asked, probe.refers[1])
        return [Point(base, dt, math.inf, probe.work(base, dt), False)]
    base, step = probe.refers[0], probe.nearest()
    if asked is not None:
        equal = 1.0 if base is asked else probe.work(asked, step) / max(probe.work(base, step), 1.0)
        return [probe.tune(asked, step * equal)]
    best = probe.tune(base, step)
    points = [best]
    if base is implicit:
        limit = math.inf if bounds is None else explicit_limit(single_step, bounds) / RATIO
        cheap = limit < math.inf and probe.work(single_step, limit) < best.work
        return [*points, probe.tune(single_step, limit)] if cheap else points
    if best.limited:
        others = (implicit,) if base is single_step else (single_step, implicit)
        cheaper = (method for method in others if probe.price(method, probe.longest) < best.work)
        return [best, *(probe.tune(method, LEAP * best.dt) for method in cheaper)]
    share = probe.tol / probe.case.size
    for name in next(names for above, names in tried if share < above) if best.good else ():
        method = find_method(name)
        # With as much work as the reference's method, to begin with.
        equal = probe.work(method, best.dt) / max(best.work, 1.0)
        points.append(probe.tune(method, best.dt * equal, min(p.work for p in points)))
    return points


def stiff_line(dt: float) -> str:
    """Why an implicit method was chosen whose steps are of dt [s], where no explicit one was tried beside."""
    return f"stability would set an explicit method's step, accuracy allows {dt:.1g} s"


def _reason(best: Point, points: list[Point], tol: float) -> str:
    """Why a method was chosen, in one line; where stability sets its step, that too."""
    name, dt = best.method.name, best.dt
    if not best.good:
        return NEAREST
    others = {isinstance(p.method, ImplicitRungeKutta): p for p in points if p.method is not best.method}
    implicit = isinstance(best.method, ImplicitRungeKutta)
    beside = others.get(not implicit)
    if implicit and beside is None:
        return stiff_line(dt)
    if implicit and beside and beside.dt < dt:
        return f"stability keeps {beside.method.name} to {beside.dt:.1g} s, accuracy allows {dt:.1g} s"
    if implicit or not best.limited:
        return LEAST_WORK
    kept = f"least work, though stability keeps {name} to {dt:.2g} s"
    if beside:
        times = f"{beside.work / best.work:.2g} times the work"
        return f"{kept}: accuracy allows {beside.method.name} {beside.dt:.2g} s, at {times}"
    allowed = dt * (tol / max(best.error, 1e-30)) ** (1.0 / best.method.order)
    return f"{kept}: accuracy would allow {allowed:.2g} s"


def times_to_fit(case: Case) -> tuple[float, ...]:
    """When to fit steps [s]: never for a user's system, again later where the motion begins fast."""
    bounds = case.problem.bounds
    if bounds is None or not len(case.starts):
        return ()
    fast = np.median(bounds.speed(case.starts) / bounds.frequency) > 2.0
    return tuple(share * float(case.outputs[-1]) for share in (AGAIN if fast else AGAIN[:1]))


def first_guess(case: Case, tol: float) -> float:
    """Step [s] of the reference's method that accuracy may allow.

    For a user's system the time in which it would move as far as its starts are from zero.
    """
    problem, starts, outputs, _ = case
    bounds, t_end = problem.bounds, float(outputs[-1])
    order = find_method(REFERENCE if bounds is not None else SINGLE_STEP).order
    if bounds is not None:
        return GUESS * (tol / GUESSED) ** (1.0 / order) / float(np.max(bounds.frequency))
    Y = starts.T.copy()
    rates = np.zeros_like(Y)
    problem.rhs(0.0, Y, rates, problem.params.block(Y.shape[1]))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        times = np.abs(Y).max(axis=0) / np.abs(rates).max(axis=0)
    times = times[np.isfinite(times) & (times > 0.0)]
    longest, shortest = t_end / FEW_STEPS, t_end / MANY_STEPS
    guess = float(np.clip(np.median(times), shortest, longest)) if times.size else longest
    return guess * (tol / (GUESSED * case.size)) ** (1.0 / order)
