"""Every trajectory twice, and those above the tolerance again with their own shorter steps, on a budget.

The second run has steps shorter by sqrt(2), and its distance from the first is the first one's error. (The
distance to a run with *longer* steps would cost less, but says little of a single trajectory: it is many
times its error, so where the longer steps are right by luck the error is taken for many times too small.)
Where a run of twice the step tells of a larger error, one of half the step measures it.

A trajectory is given up where three shorter steps did not halve its error (chaos, a singularity, a start on a
basin's border), where two resolutions disagree about whether it stops, or where the budget is spent. It keeps
the best run that it has had, or a typical one where rounding rules (:mod:`fastmech.ensembles.rounding`), and
an error that says so.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field

import numpy as np

from fastmech.ensembles.ladder import AIM, CHEAP
from fastmech.ensembles.lanes import finite_rows
from fastmech.ensembles.missed import missed_line
from fastmech.ensembles.places import part_of, put_into
from fastmech.ensembles.repeatable import Flags, Floats, Members, Repeatable
from fastmech.ensembles.richardson import (
    LEAST_ORDER,
    RATIO,
    ROUNDING,
    error_of_longer,
    order_seen,
)
from fastmech.ensembles.rounding import typical_runs, typical_work
from fastmech.ensembles.run import Progress
from fastmech.ensembles.solve import Solution, mean_shares, solve
from fastmech.ensembles.stiffness import explicit_limit
from fastmech.integrators.implicit_method import ImplicitRungeKutta

#: Repetitions of trajectories at most.
ROUNDS = 6

#: Shorter steps that may bring nothing before a trajectory is given up.
PATIENCE = 3

#: Errors below this that a shorter step does not halve are rounding, magnified by the motion.
MAGNIFIED = 1e-3

#: Trajectories are run again from this share of the tolerance: what two runs tell is not exact.
KEPT = 0.75

#: Two runs are rarely nearer to each other by luck than by this factor.
LUCK = 100.0

#: Share of the method's order that a trajectory must show to be taken for smooth again.
SMOOTH = 2.0 / 3.0

#: Right-hand sides that repetitions may take in those of the two first runs; CHEAP more are always allowed.
BUDGET = 4.0


@dataclass
class Doubling(Repeatable):
    """Trajectories that run to a tolerance, each with the best run that it has had."""

    best: Solution = field(init=False)  #: each trajectory's best run
    finer: Solution = field(init=False)  #: its last run with steps shorter by RATIO
    dt: Floats = field(init=False)  #: the steps of the last run but that one [s], (n,) like all that follow
    distance: Floats = field(init=False)  #: of the last two runs
    error: Floats = field(init=False)  #: estimate for the best run
    left: float = field(init=False)  #: right-hand sides that may still be taken
    usable: Flags = field(init=False)  #: the start is
    rough: Flags = field(init=False)  #: shows less than the method's order
    rounded: Flags = field(init=False)  #: rounding rules
    given_up: Flags = field(init=False)
    unpaid: Flags = field(init=False)  #: its shorter steps would exceed the budget
    vain: Members = field(init=False)  #: shorter steps that have not halved the error

    def run(self, progress: Progress | None) -> tuple[Solution, Floats, str]:
        """The solution, errors (n,), and what is to be said about those beyond the tolerance."""
        settings, n = self.settings, len(self.starts)
        self.usable = finite_rows(self.starts)
        self.dt = np.full(n, float(settings.dt))
        self.best = solve(self.problem, self.starts, self.outputs, settings, self.threads, progress)
        everyone = np.arange(n)
        self.shares = mean_shares(self.best, float(settings.dt), self.outputs)
        self.finer = self.solve(everyone, self.dt / RATIO)
        self.distance = self.apart(self.best, self.finer)
        self.error = error_of_longer(self.distance, settings.method.order)
        self.rough = np.zeros(n, dtype=np.bool_)
        self.left = CHEAP + BUDGET * self.work(everyone, self.dt / 2.0)
        self.vain = np.zeros(n, dtype=np.int64)
        self.given_up, self.rounded = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
        self.unpaid = np.zeros(n, dtype=np.bool_)
        self._repeat_missing()
        self._measure_doubtful()
        self._repeat_missing()
        self._resettle(np.flatnonzero(self.rounded | (self.given_up & ~self.unpaid)))
        return self.best, self.error, self.remark()

    def affordable(self, who: Members, finer: float) -> Members:
        """As many of the trajectories, longest steps first, as the budget allows with steps so much finer."""
        who = who[np.argsort(-self.dt[who] * self.shares[who], kind="stable")]
        if self.work(who, self.dt[who] / finer) <= self.left:  # as a rule
            return np.sort(who)
        number = bisect_right(
            range(1, who.size + 1), self.left, key=lambda n: self.work(who[:n], self.dt[who[:n]] / finer)
        )
        self.unpaid[who[number:]] = self.given_up[who[number:]] = True
        return np.sort(who[:number])

    def _reckon(self, who: Members, before: Floats, after: Floats, shorter: Floats) -> None:
        """Errors from the last two distances, with the order that they show where it is not the method's.

        Where a jump lies in its step is a matter of luck, and so is a single distance: from then on a rough
        trajectory's error is the largest that its distances tell at order 1.
        """
        p = self.settings.method.order
        seen = order_seen(before, after, shorter, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            smooth = np.log(before / after) / np.log(shorter) >= SMOOTH * p
        # Steps that were too long to show any order may become short enough.
        self.rough[who] = (self.rough[who] & ~smooth) | (seen < p)
        rough = self.rough[who]
        lasting = np.fmax(after, np.where(np.isfinite(before), before / shorter, 0.0))
        after = np.where(rough, lasting, after)
        self.distance[who] = after
        self.error[who] = error_of_longer(
            after, np.where(rough, np.where(seen < LEAST_ORDER, 0.0, 1.0), float(p))
        )

    def _repeat_missing(self) -> None:
        """Run those again that miss the tolerance, while that may help and the budget allows."""
        for _ in range(ROUNDS):
            missing = self.usable & ~(self.error <= KEPT * self.tol)
            again = self.affordable(np.flatnonzero(missing & ~self.given_up & ~self.rounded), 4.0)
            if not again.size:
                break
            self._repeat(again)

    def _repeat(self, again: Members) -> None:
        """Run trajectories with the shorter steps that their errors ask for."""
        order, error = self.settings.method.order, self.error[again]
        known = np.isfinite(error)
        with np.errstate(divide="ignore", invalid="ignore"):
            wanted = (AIM * self.tol / error) ** (1.0 / order)
        wanted = np.clip(np.where(known, wanted, 0.25), 0.25, 1.0 / RATIO)
        rungs = np.ceil(-2.0 * np.log2(wanted) - 1e-9)  # each shorter by RATIO
        own = self.dt[again] / RATIO**rungs
        run, far = part_of(self.finer, again), np.flatnonzero(rungs > 1.0)  # one rung down there is a run
        if far.size:
            self.left -= self.work(again[far], own[far])
            put_into(run, far, self.solve(again[far], own[far]), np.ones(far.size, dtype=np.bool_))
        self.left -= self.work(again, own / RATIO)
        finer = self.solve(again, own / RATIO)
        put_into(self.finer, again, finer, np.ones(again.size, dtype=np.bool_))
        apart = self.apart(run, finer)
        self._reckon(again, self.distance[again], apart, self.dt[again] / own)
        after = self.error[again]
        in_vain = ~(after <= 0.5 * error) | np.isinf(after)
        self.vain[again[in_vain]] += 1
        # Where shorter steps bring nothing to a small error, rounding rules, magnified by the motion.
        implicit = isinstance(self.settings.method, ImplicitRungeKutta)  # of reduced order, where it is stiff
        rounded = in_vain & (after < (ROUNDING if implicit else MAGNIFIED))
        # A rough one's earlier error may have been small by luck: the finer run has the better odds.
        better = ~(after > error) | (self.rough[again] & np.isfinite(run.y[-1]).all(axis=1))
        put_into(self.best, again[better], run, better)
        self.dt[again] = own
        self.rounded[again[rounded]] = True
        self.given_up[again[(self.vain[again] >= PATIENCE) & ~rounded]] = True

    def _resettle(self, which: Members) -> None:
        """Give trajectories that shorter steps do not help a typical one of several runs, see `rounding`.

        These have a budget of their own, which is spent on the largest errors first.
        """
        if isinstance(self.settings.method, ImplicitRungeKutta):
            return
        which = which[np.argsort(-self.error[which], kind="stable")]
        budget = CHEAP + BUDGET * self.work(np.arange(len(self.starts)), self.dt / 2.0)
        number = bisect_right(range(1, which.size + 1), budget, key=lambda n: typical_work(self, which[:n]))
        for typical in typical_runs(self, np.sort(which[:number])):
            kept = np.isfinite(typical.error)
            put_into(self.best, typical.who[kept], typical.run, kept)
            self.error[typical.who[kept]] = typical.error[kept]

    def _measure_doubtful(self) -> None:
        """Measure errors by runs of half the step where a run of twice the step tells of larger ones.

        Rarely the runs with shorter steps are wrong by as much as the others, and in the same direction.
        Steps that would be unstable tell nothing.
        """
        order, c = self.settings.method.order, self.problem.coefficients
        open_ = self.usable & ~self.rounded & ~self.given_up & (self.error > self.tol / LUCK)
        if c is not None:
            open_ &= 2.0 * self.dt * self.shares <= explicit_limit(self.settings.method, c)
        who = np.flatnonzero(open_)
        self.left -= self.work(who, 2.0 * self.dt[who])
        apart = self.apart(self.solve(who, 2.0 * self.dt[who]), part_of(self.best, who))
        told = np.isfinite(apart) & (apart > (2.0**order - 1.0) * KEPT * self.tol)
        who = self.affordable(who[told], 2.0)
        self.left -= self.work(who, self.dt[who] / 2.0)
        apart = self.apart(self.solve(who, self.dt[who] / 2.0), part_of(self.best, who))
        self.error[who] = apart / (1.0 - 0.5**order)

    def remark(self) -> str:
        """Why trajectories have missed the tolerance; empty where none has."""
        missed = self.usable & ~(self.error <= self.tol)
        ended = np.isfinite(self.best.y[-1]).all(axis=1)
        grazing = missed & ended & ~np.isfinite(self.error) & self.problem.observation.stops
        unpaid = missed & self.unpaid & ended & ~grazing
        causes = {
            "two resolutions disagree about their stop": grazing,
            "not finite at any step tried": missed & ~ended,
            "shorter steps would cost too much": unpaid,
            "shorter steps do not reduce their errors as the order says (chaos, a singularity of the "
            "right-hand side, rounding)": missed & ended & ~grazing & ~unpaid,
        }
        return missed_line(missed, causes)
