"""``fm.disturb``: what becomes of thousands of random disturbances of one equilibrium."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastmech.disturbance.observe import EXCURSION_PHI, EXCURSION_THETA, LAST_OUTSIDE, observe_departure
from fastmech.disturbance.outcome import FAILURES, Outcome, resting_place
from fastmech.disturbance.size import Size, size_at
from fastmech.ensembles import checks
from fastmech.ensembles.plausible import judge
from fastmech.ensembles.run import Observation, Progress, run_ensemble
from fastmech.ensembles.spans import output_steps
from fastmech.ensembles.status import Status, failure_counts, failure_line
from fastmech.equilibria.find import Equilibria, Equilibrium, find_equilibria
from fastmech.errors import InputError
from fastmech.integrators.implicit_method import with_jacobian
from fastmech.integrators.methods import find_method
from fastmech.kernels.jacobians import lagrange_jacobian
from fastmech.kernels.select import right_hand_side
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene
from fastmech.step_limits.beyond import drives_rest, is_beyond
from fastmech.step_limits.warning import warn_of_step

Floats = NDArray[np.float64]

#: Starts that one stream of random numbers gives; the next ones have a stream of their own.
STREAM = 65_536

#: Trajectories of the largest ensemble: its results take about 150 bytes each in memory.
MOST_TRAJECTORIES = 100_000_000


@dataclass(frozen=True)
class DisturbedEnsemble:
    """Random disturbances of one equilibrium and what became of them; arrays over n trajectories."""

    equilibria: Equilibria  #: all equilibria of the scene
    index: int  #: which of them was disturbed
    size: Size  #: the norm in which radius and ball are measured
    t_end: float  #: s
    dt: float  #: step taken [s]
    starts: Floats  #: states at t = 0, shape (n, 4)
    final: Floats  #: states at t_end, of those that failed the last finite ones, shape (n, 4)
    failed: Floats  #: time of the last finite state of those that failed on the way [s], else NaN; shape (n,)
    outcome: NDArray[np.int8]  #: :class:`Outcome`, shape (n,)
    end_index: NDArray[np.int8]  #: equilibrium in whose ball it ended, -1: none; shape (n,)
    turns: NDArray[np.int64]  #: full turns of phi and theta on the way there, 0 where none; shape (n, 2)
    time_to_return: Floats  #: s, first step from which on it was in the ball; NaN unless returned; (n,)
    excursion: Floats  #: largest departures of phi and theta from the equilibrium [rad], shape (n, 2)

    @property
    def failures(self) -> str:
        """One line: how many trajectories have failed, and how; empty where none has."""
        return failure_line(failure_counts(self.outcome, FAILURES), self.outcome.size)

    @property
    def share_returned(self) -> float:
        """Share of the trajectories that returned."""
        return float(np.mean(self.outcome == Outcome.RETURNED))


def disturb(
    scene: Scene,
    equilibrium: Equilibrium,
    n: int = 4096,
    *,
    radius: float = 0.5,
    seed: int = 0,
    t_end: float = 120.0,
    dt: float = 0.05,
    method: str = "dop853",
    return_radius: float = 0.01,
    part: slice | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> DisturbedEnsemble:
    """Disturb an equilibrium at random and follow every disturbance.

    Starts are uniform in the ball of the given ``radius`` about the equilibrium, in the norm of
    :class:`fastmech.disturbance.size.Size`; the k-th 65,536 of them (k = 0, 1, ...) are drawn by NumPy's
    ``default_rng([seed, index, 0, k])``, so any part of an ensemble can be had without the rest. Rest is
    being within ``return_radius`` of a minimum, in its norm, without the energy to leave; see
    :func:`fastmech.disturbance.outcome.resting_place`.

    Args:
        scene: a scene with a constant force (``alpha = 0`` or ``F0 = 0``).
        equilibrium: one of ``find_equilibria(scene)``.
        n: number of disturbances.
        radius: size of the largest disturbance [rad].
        seed: seed of the starts.
        t_end: end of the run [s].
        dt: longest step [s].
        method: name of the method.
        return_radius: radius of the ball of return [rad].
        part: which of the n disturbances to follow, with a step of 1; all by default.
        threads: threads to use; the result does not depend on it.
        progress: is told how many trajectories have finished since its last call.

    Raises:
        InputError: an argument is wrong, or the scene's force decays.
    """
    checks.progress_function(progress, "trajectories")
    equilibria = equilibria_to_disturb(scene)
    n = checks.whole_number("n", n, least=1, most=MOST_TRAJECTORIES)
    seed = checks.whole_number("seed", seed, least=0)
    radius = checks.number("radius", radius, "rad", above=0.0)
    return_radius = checks.number("return_radius", return_radius, "rad", above=0.0)
    times = np.array([0.0, checks.number("t_end", t_end, "s", above=0.0)])
    dt = checks.number("dt", dt, "s", above=0.0)
    warn_of_step([scene], dt, method)
    index = equilibria.index_of(equilibrium)
    center = np.array([equilibrium.phi, equilibrium.theta, 0.0, 0.0])
    size = size_at(scene, equilibrium.phi, equilibrium.theta)
    chosen = range(*(part or slice(None)).indices(n))
    starts = center + size.from_ball(radius * _starts_in_ball(seed, index, n, chosen))

    departure = np.abs(starts - center)
    run = run_ensemble(
        right_hand_side(reduce(scene)),
        reduce(scene),
        starts,
        times,
        dt,
        with_jacobian(find_method(method), lagrange_jacobian, True),
        _observation(center, size, return_radius),
        threads=threads,
        progress=progress,
    )
    final, step = run.states[-1], float(times[-1] / output_steps(times, dt)[0])
    end_index, turns = resting_place(scene, equilibria, final, return_radius)
    turned = (turns != 0).any(axis=1)
    stable = np.array([e.kind == "minimum" for e in equilibria])
    outcome = np.full(len(starts), Outcome.UNDECIDED, dtype=np.int8)
    outcome[(end_index >= 0) & stable[end_index]] = Outcome.ELSEWHERE
    outcome[(end_index >= 0) & ~stable[end_index]] = Outcome.AT_UNSTABLE
    outcome[(end_index == index) & ~turned & stable[end_index]] = Outcome.RETURNED
    status = judge(run.status, starts, final, reduce(scene), threads)
    steps = float(times[-1]) / step
    if drives_rest(scene, step, steps, method):  # where it came to rest is no matter of the mechanism
        wrong = (outcome != Outcome.UNDECIDED) | is_beyond(scene, step, steps, method)
        outcome[wrong] = Outcome.STEP_TOO_LARGE
    outcome[status == Status.STEP_TOO_LARGE] = Outcome.STEP_TOO_LARGE
    outcome[status == Status.NOT_FINITE] = Outcome.NOT_FINITE
    outcome[status == Status.NOT_CONVERGED] = Outcome.NOT_CONVERGED
    failing = np.isin(outcome, FAILURES)
    end_index[failing], turns[failing] = -1, 0
    last_outside = run.records[LAST_OUTSIDE]
    left = (size(starts - center) > return_radius) | (last_outside > 0.0)
    inside_since = np.where(left, last_outside + step, 0.0)
    return DisturbedEnsemble(
        equilibria=equilibria,
        index=index,
        size=size,
        t_end=float(times[-1]),
        dt=step,
        starts=starts,
        final=run.last,
        failed=run.failed,
        outcome=outcome,
        end_index=end_index,
        turns=turns,
        time_to_return=np.where(outcome == Outcome.RETURNED, inside_since, np.nan),
        excursion=np.maximum(departure[:, :2], run.records[[EXCURSION_PHI, EXCURSION_THETA]].T),
    )


def require_constant_force(scene: Scene) -> None:
    """Refuse a scene whose force changes: nothing rests while it decays.

    Raises:
        InputError: the force decays.
    """
    if scene.F0 != 0 and scene.alpha != 0:
        raise InputError(
            f"scene.alpha = {scene.alpha:g}: must be 0 1/s for motion about an equilibrium (or F0 = 0 N); "
            "use scene.replace(alpha=0.0) and find its equilibria anew"
        )


def equilibria_to_disturb(scene: Scene) -> Equilibria:
    """The equilibria of a scene in which disturbed motion makes sense.

    Raises:
        InputError: the force decays, or no equilibrium is isolated.
    """
    require_constant_force(scene)
    equilibria = find_equilibria(scene)
    if not equilibria:
        raise InputError(f"scene: has no equilibrium to disturb: {equilibria.certificate.sentence}")
    return equilibria


def _starts_in_ball(seed: int, index: int, n: int, chosen: range) -> Floats:
    """Points ``chosen`` of n in the unit ball, from streams that no other seed or equilibrium has."""
    first, last = chosen.start // STREAM, max(chosen.start, chosen.stop - 1) // STREAM
    streams = [
        uniform_ball(np.random.default_rng([seed, index, 0, k]), min(STREAM, n - k * STREAM))
        for k in range(first, last + 1)
    ]
    offset = first * STREAM
    return np.concatenate(streams)[chosen.start - offset : chosen.stop - offset]


def uniform_ball(rng: np.random.Generator, n: int) -> Floats:
    """Points uniform in the unit ball of four dimensions, shape (n, 4)."""
    directions = unit_directions(rng, n)
    return directions * rng.random((n, 1)) ** 0.25


def unit_directions(rng: np.random.Generator, n: int) -> Floats:
    """Points uniform on the unit sphere of four dimensions, shape (n, 4)."""
    normal = rng.standard_normal((n, 4))
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def _observation(center: Floats, size: Size, return_radius: float) -> Observation:
    a = size.metric
    params = [center[0], center[1], a[0, 0], a[0, 1], a[1, 1], 1.0 / size.omega**2, return_radius**2]
    return Observation(observe_departure, np.array(params), np.zeros(3))
