"""Dynamic snapping: from rest without force, what a suddenly switched on, decaying force does.

The mechanism rests in a well of Pi, then F0 exp(-alpha t) acts on M2 along +x. It has left if it ends in
another well, or in the same one with another number of full turns. The force's limit is none, so wells, start
and end are those of the force-free scene for every alpha > 0.

Two limits. alpha -> infinity at a fixed impulse F0/alpha is a kick: :func:`impulse_start`. alpha = 0 stands
apart: a constant force has another potential, whose wells are other ones, and no end to compare; it is
refused here.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.basins.measures.labels import Floats, Integers, check_point
from fastmech.disturbance.outcome import confining_energy, excess_energy, resting_place
from fastmech.ensembles import checks
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.status import Status
from fastmech.equilibria.find import Equilibria, Equilibrium, find_equilibria
from fastmech.errors import InputError
from fastmech.mechanism.lagrange import metric
from fastmech.scene import Scene

#: Radius [rad] of the ball round a well in which a motion has come to rest, if it cannot leave it any more.
REST = 0.05

#: Time between looks at what has come to rest [s].
PIECE = 5.0

#: A force that falls faster than this share of itself in a step gets shorter steps while it acts.
FALL = 0.1


class Window(NamedTuple):
    """Neighbouring forces of one map that end alike."""

    first: float  #: F0 [N], the first of them
    last: float  #: F0 [N], the last
    label: int  #: where they end; negative: not at rest by the end of the run
    turns: tuple[int, int]  #: of phi and theta
    left: bool  #: whether that is elsewhere


@dataclass(frozen=True, eq=False)
class SnappingMap:
    """Ends over F0 and alpha; arrays (alphas, forces)."""

    F0: Floats  #: N (forces,)
    alpha: Floats  #: 1/s (alphas,)
    equilibria: Equilibria  #: of the force-free scene: what ``label`` counts
    start: int  #: index of the well that all start from
    label: Integers  #: index of the well; -1: not at rest by the end; -2: the step is too large
    turns: Integers  #: full turns of phi and theta, (alphas, forces, 2); 0 without a label
    time: Floats  #: when it was found at rest [s]; NaN: it was not

    @property
    def left(self) -> NDArray[np.bool_]:
        """Whether each ends in another well or with another number of turns."""
        return (self.label >= 0) & ((self.label != self.start) | (self.turns != 0).any(axis=-1))

    @property
    def undecided(self) -> int:
        """How many have no label."""
        return int(np.count_nonzero(self.label < 0))

    @property
    def smallest(self) -> Floats:
        """The force of least magnitude that leaves, for every alpha [N] (alphas,); NaN: none of them does."""
        first = np.where(self.left, np.abs(self.F0), np.inf).argmin(axis=1)
        return np.where(self.left.any(axis=1), self.F0[first], np.nan)

    def windows(self, k: int) -> list[Window]:
        """Runs of neighbouring forces that end alike at the k-th alpha; later ones that stay came back."""
        ends = np.column_stack([self.label[k], self.turns[k]])
        changes = np.flatnonzero((np.diff(ends, axis=0) != 0).any(axis=1)) + 1
        bounds = [0, *changes.tolist(), len(self.F0)]
        return [
            Window(
                float(self.F0[a]),
                float(self.F0[b - 1]),
                int(self.label[k, a]),
                (int(self.turns[k, a, 0]), int(self.turns[k, a, 1])),
                bool(self.left[k, a]),
            )
            for a, b in pairwise(bounds)
        ]


def map_snapping(
    scene: Scene,
    F0: ArrayLike,
    alpha: ArrayLike,
    *,
    start: Equilibrium | None = None,
    t_end: float | None = None,
    dt: float = 0.01,
    method: str = "dop853",
    threads: int | None = None,
) -> SnappingMap:
    """The (F0, alpha) map of dynamic snapping: one trajectory for every pair, all in one ensemble.

    A motion has come to rest in a well w when it is in a small ball round it and the bound
    ``T + Pi(t') <= T + Pi(t) + |F(t)| (2 l - sgn(F) x2(t))`` for all later t' is below the energy that is
    needed to leave that ball: the force cannot do more work than by pushing M2 to the end of its reach.

    Args:
        scene: the mechanism with a damper; its own F0 and alpha are not used.
        F0: forces [N], rising, of one sign, not 0.
        alpha: decay rates [1/s], greater than 0, rising.
        start: a minimum of the force-free scene, the deepest by default.
        t_end: end of every run [s]; by default when the force has fallen to a millionth of F0, and 200 s.
        dt: longest step [s]; while a quickly falling force acts, steps are shorter by themselves.
        method: name of the method.
        threads: threads to use; the result does not depend on it.

    Raises:
        InputError: an argument is wrong, alpha is 0, the scene has no damper, or the start is no minimum of
            the force-free scene.
    """
    force, rate = _forces(F0), _rates(alpha)
    free, equilibria, index = _force_free(scene, start)
    dt = checks.number("dt", dt, "s", above=0.0)
    end = 200.0 + np.log(1e6) / rate if t_end is None else checks.number("t_end", t_end, "s", above=0.0)
    rest = equilibria[index]
    shape = (rate.size, force.size)
    label, turns, time = _run_to_rest(
        free,
        equilibria,
        np.tile([rest.phi, rest.theta, 0.0, 0.0], (rate.size * force.size, 1)),
        np.tile(force, rate.size),
        np.repeat(rate, force.size),
        np.broadcast_to(np.repeat(np.broadcast_to(end, rate.size), force.size), rate.size * force.size),
        dt,
        method,
        threads,
    )
    return SnappingMap(
        force, rate, equilibria, index, label.reshape(shape), turns.reshape(*shape, 2), time.reshape(shape)
    )


def critical_forces(
    snapping: SnappingMap,
    scene: Scene,
    *,
    tolerance: float = 0.1,
    t_end: float | None = None,
    dt: float = 0.01,
    method: str = "dop853",
    threads: int | None = None,
) -> Floats:
    """The least force that leaves at every alpha of a map [N], narrowed down between its forces (alphas,).

    NaN where none of the map's forces leaves. A window narrower than the map's steps, below the first force
    that leaves, is not seen.

    Args:
        snapping: a map of the same scene.
        scene: the mechanism.
        tolerance: N.
        t_end, dt, method, threads: as for :func:`map_snapping`.

    Raises:
        InputError: an argument is wrong.
    """
    tolerance = checks.number("tolerance", tolerance, "N", above=0.0)
    start = snapping.equilibria[snapping.start]
    sign = np.sign(snapping.F0[0])
    size, order = np.sort(np.abs(snapping.F0)), np.argsort(np.abs(snapping.F0))
    found = np.full(snapping.alpha.size, np.nan)
    for k, rate in enumerate(snapping.alpha):
        leaves = np.flatnonzero(snapping.left[k, order])
        if not leaves.size:
            continue
        low, high = float(np.append(0.0, size)[leaves[0]]), float(size[leaves[0]])
        while high - low > tolerance:
            between = np.linspace(low, high, 34)[1:-1]
            forces = np.sort(sign * between)
            part = map_snapping(
                scene, forces, [rate], start=start, t_end=t_end, dt=dt, method=method, threads=threads
            )
            line = np.concatenate([[low], between, [high]])
            left = part.left[0, np.argsort(np.abs(forces))]
            first = int(np.argmax([*left, True])) + 1
            low, high = float(line[first - 1]), float(line[first])
        found[k] = sign * high
    return found


def impulse_start(scene: Scene, rest: Equilibrium, impulse: float) -> Floats:
    """State (4,) after a kick on M2 along +x at rest: the limit of F0 exp(-alpha t) at impulse = F0/alpha.

    The generalized momenta are impulse dx2/dq, the rates a^-1 of them, paper (11).

    Args:
        scene: the mechanism.
        rest: where it rests.
        impulse: N s.

    Raises:
        InputError: the impulse is no finite number.
    """
    impulse = checks.number("impulse", impulse, "N s")
    lever = scene.l * np.array([-np.sin(rest.phi), -np.cos(rest.theta)])
    rates = np.linalg.solve(metric(scene, (rest.phi, rest.theta)), impulse * lever)
    return np.array([rest.phi, rest.theta, *rates])


def _run_to_rest(
    free: Scene,
    equilibria: Equilibria,
    y: Floats,
    force: Floats,
    rate: Floats,
    end: Floats,
    dt: float,
    method: str,
    threads: int | None,
) -> tuple[Integers, Integers, Floats]:
    """Label, turns and time of rest of motions from y (n, 4) under F(0) = ``force``, decaying at ``rate``."""
    n = len(y)
    label, turns, time = np.full(n, -1), np.zeros((n, 2), dtype=np.int64), np.full(n, np.nan)
    y, clock, running = y.copy(), np.zeros(n), np.arange(n)

    def advance(members: Integers, span: float, step: float) -> None:
        # A force that decays is at any time the start of one that is smaller by then.
        now = force[members] * np.exp(-rate[members] * clock[members])
        own = {"F0": now, "alpha": rate[members]}
        run = integrate(free, y[members], span, step, method, parameters=own, threads=threads)
        y[members] = run.y[-1]
        clock[members] += span
        label[members[run.status != Status.OK]] = -2

    for fast in np.unique(rate[rate * dt > FALL]):
        # Until a last e^-30 of the force is left.
        advance(np.flatnonzero(rate == fast), 30.0 / fast, FALL / fast)
    while True:
        running = running[label[running] == -1]
        index, made = resting_place(free, equilibria, y[running], REST)
        now = np.abs(force[running]) * np.exp(-rate[running] * clock[running])
        x2 = free.l * (np.cos(y[running, 0]) - np.sin(y[running, 1]))
        work = now * (2.0 * free.l - np.sign(force[running]) * x2)
        for i, e in enumerate(equilibria):
            if e.kind == "minimum":
                highest = excess_energy(free, e, y[running]) + work
                held = (index == i) & (highest <= confining_energy(free, e, REST))
                label[running[held]], turns[running[held]] = i, made[held]
                time[running[held]] = clock[running[held]]
        running = running[(label[running] == -1) & (clock[running] < end[running])]
        if not running.size:
            return label, turns, time
        advance(running, PIECE, dt)


def _forces(F0: ArrayLike) -> Floats:
    force = check_point("F0", F0)
    if not (np.diff(force) > 0.0).all() or not (np.sign(force) == np.sign(force[-1])).all() or not force[0]:
        raise InputError("F0: must rise, be of one sign and nowhere be 0 N")
    return force


def _rates(alpha: ArrayLike) -> Floats:
    rate = check_point("alpha", alpha)
    if (rate == 0.0).any():
        raise InputError(
            "alpha = 0: must be greater than 0 1/s; a constant force has another potential with other wells, "
            "so that its ends cannot be compared"
        )
    if not (rate > 0.0).all() or not (np.diff(rate) > 0.0).all():
        raise InputError("alpha: must be greater than 0 1/s and rise")
    return rate


def _force_free(scene: Scene, start: Equilibrium | None) -> tuple[Scene, Equilibria, int]:
    if scene.beta == 0.0:
        raise InputError("scene.beta = 0: must be greater than 0 N s/m, or nothing comes to rest")
    free = scene.replace(F0=0.0, alpha=0.0)
    equilibria = find_equilibria(free)
    minima = [i for i, e in enumerate(equilibria) if e.kind == "minimum"]
    if not minima:
        raise InputError(f"scene: has no well without force: {equilibria.certificate.sentence}")
    index = minima[0] if start is None else equilibria.index_of(start)
    if index not in minima:
        raise InputError(f"start: is a {equilibria[index].kind}, must be a minimum of the force-free scene")
    return free, equilibria, index
