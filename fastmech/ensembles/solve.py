"""One run of a problem with given settings: a method, a step that may fit each trajectory, a precision."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.fitting import EXPONENT_AGAIN, EXPONENT_ONCE, MOST_FITTED, fitted_steps, is_too_fast
from fastmech.ensembles.plausible import judge
from fastmech.ensembles.problem import Problem
from fastmech.ensembles.run import Ensemble, Observation, Progress, run_ensemble
from fastmech.ensembles.spans import output_steps
from fastmech.ensembles.status import Status
from fastmech.ensembles.turning import TURNED, TURNS
from fastmech.integrators.implicit_method import ImplicitRungeKutta, with_jacobian
from fastmech.integrators.method import Method

Floats = NDArray[np.float64]
Precision = type[np.floating[Any]]


@dataclass(frozen=True)
class Settings:
    """How a problem is integrated."""

    method: Method
    dt: float | Floats  #: longest step [s], of all trajectories or of each (n,)
    fit: tuple[float, ...] = ()  #: times [s] at which the steps are fitted to the energy; () for never
    precision: Precision = np.float64
    early: tuple[tuple[float, float], ...] = ()  #: until these times [s] steps are shorter by a factor


@dataclass
class Solution:
    """What a run gives."""

    y: Floats  #: states, shape (outputs, n, dim)
    records: Floats  #: what was observed, shape (rows, n)
    status: NDArray[np.int8]  #: shape (n,)
    steps: NDArray[np.int64]  #: steps of each trajectory that runs to the end, shape (n,)
    dt: Floats  #: longest step of each [s], shape (pieces, n): a piece ends where steps are fitted again
    failed: Floats  #: time of the last finite state of a trajectory that failed [s], else NaN, shape (n,)
    turned: Floats  #: what an angle did in a step, see :func:`turned_in`; shape (n,)
    last: Floats | None  #: last finite states, shape (n, dim); None: none failed, they are the final ones


def turned_in(run: Ensemble, observation: Observation) -> Floats:
    """What the angles of each trajectory (n,) did at most in a step of a run [rad].

    That is a turn, where turns were observed, and the last term of an Adams method's predictor; else 0.
    """
    return run.records[TURNED] if observation is TURNS else run.last_term


def mean_shares(solution: Solution, dt: float, outputs: Floats) -> Floats:
    """The part (n,) of the step ``dt`` [s] of a run's settings that each trajectory's steps were, on average.

    Less than 1 where steps were fitted: what a trajectory costs is known from any run of it.
    """
    number = output_steps(np.concatenate([[0.0], outputs]), dt).sum()
    return np.asarray(number / np.maximum(solution.steps, 1)) if number else np.ones(solution.steps.size)


def solve(
    problem: Problem,
    starts: Floats,
    outputs: Floats,
    settings: Settings,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Integrate from t = 0 through the output times [s].

    Where steps are fitted again, the times at which that is done end a piece of the run. Starts to whose
    motions no steps can be fitted do not run: any step is too large for them.

    Raises:
        InputError: the step or the number of threads are wrong.
    """
    n = len(starts)
    again = {t for t in settings.fit if 0.0 < t < outputs[-1]}
    exponent = EXPONENT_AGAIN if again else EXPONENT_ONCE
    sooner = {t for t, _ in settings.early if 0.0 < t < outputs[-1]}
    ends = sorted(again | sooner | {float(outputs[-1])})
    pieces: list[Floats] = []
    status, failed = np.full(n, Status.OK, dtype=np.int8), np.full(n, np.nan)
    lost: list[tuple[NDArray[np.bool_], Floats]] = []
    steps, taken, turned = np.zeros(n, dtype=np.int64), np.empty((len(ends), n)), np.zeros(n)
    begin, now, shares = 0.0, problem.inward(starts), np.ones(n)
    method = settings.method
    if isinstance(method, ImplicitRungeKutta):
        method = with_jacobian(method, problem.jacobian, problem.second_order)
    aside = np.zeros(n, dtype=np.bool_)
    if settings.fit and problem.coefficients is not None:
        aside = is_too_fast(problem.coefficients, starts, float(outputs[-1]), threads)
        shares = fitted_steps(problem.coefficients, starts, 1.0, exponent, threads)
        number = outputs[-1] / np.asarray(settings.dt, dtype=np.float64)
        aside |= (number / shares > MOST_FITTED) & (number <= MOST_FITTED) & np.isfinite(starts).all(axis=1)
        now = np.where(aside[:, None], np.nan, now) if aside.any() else now  # they never enter a block
    for piece, end in enumerate(ends):
        inside = (outputs <= end) & ((outputs > begin) | (piece == 0))
        times = np.concatenate([[begin], outputs[inside]])
        times = times if times[-1] == end and times.size > 1 else np.append(times, end)
        dt = np.broadcast_to(np.asarray(settings.dt, dtype=np.float64), n)
        if piece and settings.fit and problem.coefficients is not None:
            # No motion becomes faster than its start allows: a step never shrinks where one has blown up.
            fitted = fitted_steps(problem.coefficients, problem.outward(now), 1.0, exponent, threads)
            shares = np.maximum(fitted, shares)
        dt = np.where(aside, dt, dt * shares) * min(
            (share for until, share in settings.early if end <= until), default=1.0
        )
        run = run_ensemble(
            problem.rhs,
            problem.params,
            now,
            times,
            dt,
            method,
            problem.observation,
            threads=threads,
            precision=settings.precision,
            progress=progress if end == ends[-1] else None,
        )
        turned = np.maximum(turned, turned_in(run, problem.observation))
        pieces.append(run.states[: np.count_nonzero(inside)])
        worse = run.status != Status.OK
        status[worse & (status == Status.OK)] = run.status[worse & (status == Status.OK)]
        first = np.isnan(failed) & ~np.isnan(run.failed)
        failed[first] = run.failed[first]
        if first.any():
            lost.append((first, problem.outward(run.last)[first]))
        lengths = np.unique(dt)  # a search in these few is quicker than their inverse
        of = np.searchsorted(lengths, dt)
        numbers = [output_steps(times, float(length)) for length in lengths]
        steps += np.array([number.sum() for number in numbers], dtype=np.int64)[of]
        longest = [np.max(np.diff(times) / np.maximum(number, 1)) for number in numbers]
        taken[piece] = np.array(longest, dtype=np.float64)[of]
        begin, now = end, run.states[-1]
    y = pieces[0] if len(pieces) == 1 else np.concatenate(pieces)
    if problem.canonical:
        for output in y:  # one at a time: what is computed on the way takes little memory
            output[:] = problem.outward(output)
    status[aside] = Status.STEP_TOO_LARGE
    y[: 1 if outputs[0] == 0.0 else 0, aside] = starts[aside]
    judged = judge(status, starts, y[-1], problem.coefficients, threads)
    last = None
    if lost:
        last = y[-1].copy()
        for members, states in lost:
            last[members] = states
        last[aside] = starts[aside]
    return Solution(y, run.records, judged, steps, taken, failed, turned, last)
