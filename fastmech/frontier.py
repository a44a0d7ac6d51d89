"""Speed against error of methods and steps on a problem of your own: which one to take for which error."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.ensembles import checks
from fastmech.ensembles.integrate import integrate, problem_of
from fastmech.ensembles.problem import Case
from fastmech.ensembles.run import Progress
from fastmech.ensembles.solve import solve_at
from fastmech.ensembles.status import Status
from fastmech.ensembles.system import System
from fastmech.ensembles.tolerance import SAMPLE, sample_of, usable_starts
from fastmech.ensembles.work_precision import (
    IMPLICIT,
    REFERENCE,
    SINGLE_STEP,
    Trial,
    first_guess,
    order_statistic,
    times_to_fit,
)
from fastmech.errors import InputError, StepWarning, called_here, shown
from fastmech.integrators.methods import METHODS, ImplicitRungeKutta, Method, find_method
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Drawn, Field, counted
from fastmech.samplers import Starts
from fastmech.scene import Scene

#: Runs of which the median time counts, after one that is not counted: so many, and so long [s].
TIMED, LONG = 3, 0.1

#: Shares of a step that are tried where a run calls it too large.
SHORTER = (1.0, 0.7, 0.5, 0.35, 0.25)

#: Methods that are tried by default.
EXPLICIT = tuple(m.name for m in METHODS.values() if m.order >= 4 and not isinstance(m, ImplicitRungeKutta))

#: Errors that are asked for by default, in the state's units.
ERRORS = (1e-3, 1e-5, 1e-7, 1e-9)


@dataclass(frozen=True)
class WorkPoint:
    """A method with its steps."""

    method: str
    dt: float  #: step [s]
    largest: float  #: error of the worst trajectory of the sample, in the state's units
    error_99: float  #: the 99 % quantile
    rate: float  #: trajectories a second


@dataclass(frozen=True, repr=False)
class WorkPrecision(Drawn):
    """Methods and steps on one problem; printed, it names the frontier."""

    points: tuple[WorkPoint, ...]
    errors: tuple[float, ...]  #: that were asked for, falling
    fit: tuple[float, ...]  #: times [s] at which steps were fitted to the energy; (): they were not
    number: int  #: trajectories
    t_end: float  #: end of the runs [s]
    own: bool = False  #: whether trajectories have ``parameters`` of their own
    least: float = np.inf  #: error that runs of the sample have come to

    @property
    def frontier(self) -> tuple[WorkPoint, ...]:
        """For each of the errors that any method keeps, the fastest that does."""
        kept = ([p for p in self.points if p.largest <= error] for error in self.errors)
        return tuple(dict.fromkeys(max(points, key=lambda p: p.rate) for points in kept if points))

    @property
    def fastest(self) -> list[bool]:
        """Which points are on the frontier."""
        return [point in self.frontier for point in self.points]

    def call(self, error: float) -> str:
        """The call to copy, with the fastest of the frontier whose largest error is at most ``error``.

        Raises:
            InputError: no point keeps it.
        """
        kept = [p for p in self.frontier if p.largest <= checks.number("error", error, "", above=0.0)]
        if not kept:
            raise InputError(
                f"error = {shown(error)}: no method and step tried keeps it{self._come_to(error)}"
            )
        best = max(kept, key=lambda p: p.rate)
        more = f", fit={list(self.fit)}" if self.fit else ""
        more += ", parameters=parameters" if self.own else ""
        return f'fm.integrate(problem, starts, t_end, dt={best.dt:.4g}, method="{best.method}"{more})'

    def _come_to(self, error: float) -> str:
        """To what runs come that do not keep an error."""
        least = min([self.least, *(p.largest for p in self.points)])
        return f"; runs come to {least:.2g}" if least > error else "; some starts converge at no step tried"

    KIND = "work_precision"
    PICTURE = "plots.objects:draw_frontier"
    FIELDS = {
        "method": Field("point", "1", "method", "points.method"),
        "dt": Field("point", "s", "step", "points.dt"),
        "largest": Field(
            "point", "1", "error of the worst trajectory, in the states' units", "points.largest"
        ),
        "error_99": Field("point", "1", "99 % quantile of the errors", "points.error_99"),
        "rate": Field("point", "s-1", "trajectories a second", "points.rate"),
        "fastest": Field("point", "1", "the fastest that keeps one of the errors asked for"),
        "number": Field("", "1", "trajectories of each run"),
        "t_end": Field("", "s", "end of the runs"),
    }

    def told(self) -> str:
        """The frontier."""
        each = [
            f"  error {p.largest:.0e}: {p.method}, dt = {p.dt:.3g} s, {p.rate:,.0f} trajectories/s"
            for p in self.frontier
        ]
        heading = f"{counted(len(self.points), 'pair')} of method and step; the fastest for each error:"
        unkept = [e for e in self.errors if not any(p.largest <= e for p in self.points)]
        if unkept:
            come_to = self._come_to(unkept[0])
            each.append(f"  error {unkept[0]:.0e}: no method and step tried keeps it{come_to}")
        return "\n".join([heading, *each])


@called_here(t_span="t_end", tol="errors", tolerance="errors")
def work_precision(
    scene: Scene | Mechanism | System,
    y0: Starts,
    t_end: float,
    *,
    errors: Sequence[float] = ERRORS,
    methods: Sequence[str] | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    threads: int | None = 1,
    progress: Progress | None = None,
) -> WorkPrecision:
    """Measure speed against error on your problem.

    Every method runs with steps that bring its largest error, on a sample of at most 128 trajectories, to
    each of ``errors``; all trajectories are timed with them. The reference is a run with shorter and shorter
    steps until it is right to a sixteenth of the least error.

    Args:
        scene: the mechanism, or a system of your own.
        y0: starts, a sampler or of shape (n, dim) or (dim,).
        t_end: end of the run [s].
        errors: largest errors to look at, in the state's units.
        methods: names from :data:`fastmech.integrators.methods.METHODS`; all explicit ones of order 4 and
            more by default.
        parameters: values of parameters that differ between trajectories, each of shape (n,).
        threads: threads to use, one by default, so that rates are those of a core.
        progress: called with 1 after each method.

    Returns:
        a point for each method and each error that it keeps; on the frontier none whose step
        :func:`fastmech.integrate` calls too large.

    Raises:
        InputError: an argument is wrong.
    """
    own = {} if parameters is None else dict(parameters)
    starts, problem, _ = problem_of(scene, y0, own, None)
    outputs = np.array([checks.number("t_end", t_end, "s", above=0.0)])
    wanted = sorted(
        (checks.number("errors", e, "", above=0.0) for e in checks.listed("errors", errors, "numbers")),
        reverse=True,
    )
    checks.progress_function(progress, "methods")
    names = EXPLICIT if methods is None else checks.listed("methods", methods, "their names")
    tried = [find_method(name) for name in names]
    usable = np.flatnonzero(usable_starts(problem, starts, float(outputs[-1]), threads))
    if not usable.size:
        raise InputError("y0: holds no start that steps can follow")
    case = Case(problem, starts, outputs, threads)
    sample = case.part(sample_of(case, usable, SAMPLE))
    trial = Trial(sample, wanted[-1], 1.0, times_to_fit(sample))
    guess = first_guess(sample, wanted[-1])
    explicit = SINGLE_STEP if problem.bounds is None else REFERENCE
    base = find_method(IMPLICIT if isinstance(tried[0], ImplicitRungeKutta) else explicit)
    trial.refer(base, guess)
    least = np.inf if trial.apart is None else float(trial.apart.max())
    points: list[WorkPoint] = []
    for method in tried:
        dt = guess * method.evaluations(1000) / base.evaluations(1000)
        for error in wanted:
            trial.tol = error
            found = trial.tune(method, dt, near=0.5)
            least = min(least, found.error)
            if found.good and not (points and (points[-1].method, points[-1].dt) == (method.name, found.dt)):
                dt = found.dt
                point = _timed(case, trial, method, dt)
                points += [point] if np.isfinite(point.largest) else []
        if progress is not None:
            progress(1)
    about = tuple(wanted), trial.fit, len(starts), float(outputs[-1])
    whole = WorkPrecision(tuple(points), *about, own=bool(own), least=least).of(scene)
    if isinstance(scene, Scene):
        columns = {name: np.broadcast_to(values, len(starts))[usable] for name, values in own.items()}
        sure: set[WorkPoint] = set()
        while doubtful := [point for point in whole.frontier if point not in sure]:
            points = [point for point in whole.points if point not in doubtful]
            for point in doubtful:
                for share in SHORTER:
                    shorter = point
                    if share < 1.0:
                        shorter = _timed(case, trial, find_method(point.method), share * point.dt)
                    if _is_fine((scene, starts[usable], columns), whole, shorter):
                        sure.add(shorter)
                        points.append(shorter)
                        break
            whole = replace(whole, points=tuple(points)).of(scene)
    return whole


def _is_fine(
    run: tuple[Scene, Floats, Mapping[str, ArrayLike]], found: WorkPrecision, point: WorkPoint
) -> bool:
    """Whether no step of a run of a scene is called too large, before or after it."""
    scene, starts, own = run
    with warnings.catch_warnings():
        warnings.simplefilter("error", StepWarning)
        try:
            made = integrate(
                scene, starts, found.t_end, dt=point.dt, method=point.method, fit=found.fit or False,
                parameters=own,
            )  # fmt: skip
        except StepWarning:
            return False
    return bool((made.status == Status.OK).all())


def _timed(case: Case, trial: Trial, method: Method, dt: float) -> WorkPoint:
    """A point: the sample's errors, and the time of all."""
    settings = trial.settings(method, dt)
    taken: list[float] = []
    while len(taken) < 1 + TIMED or sum(taken[1:]) < LONG:
        began = time.perf_counter()
        solve_at(case, settings)
        taken.append(time.perf_counter() - began)
    found = trial.errors(method, dt)
    rate = len(case.starts) / float(np.median(taken[1:]))
    return WorkPoint(method.name, dt, float(found.max()), order_statistic(found, 0.99), rate)
