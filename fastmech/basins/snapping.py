"""Dynamic snapping: from rest without force, what a suddenly switched on, decaying force does.

The mechanism rests in a well of Pi, then F0 exp(-alpha t) acts on M2 along +x. It has left if it ends in
another well, or in the same one with another number of full turns. The force's limit is none, so wells, start
and end are those of the force-free scene for every alpha > 0.

Two limits. alpha -> infinity at a fixed impulse F0/alpha is a blow on M2, see
:func:`fastmech.basins.shock_limit.shock_limit`. alpha = 0 stands apart: a constant force has another
potential, whose wells are other ones, and no end to compare; it is refused here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.arrays import Floats, Integers
from fastmech.basins.convergence import SUBSTEPS, Computations, Indices, Paths, near_saddle, tell_the_same
from fastmech.basins.label import default_end as end_after
from fastmech.basins.measures.labels import check_point
from fastmech.capture.certificate import CaptureCertificate
from fastmech.capture.select import require_damper
from fastmech.ensembles import checks
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.run import Progress
from fastmech.ensembles.status import LABELS, Status, counts
from fastmech.errors import InputError, shown
from fastmech.integrators.methods import find_method
from fastmech.objects import Drawn
from fastmech.scene import Scene
from fastmech.slider.capture.certificate import scene_certificate
from fastmech.slider.capture.steps import coarse_steps, method_for
from fastmech.slider.coefficients import reduce
from fastmech.slider.equilibria import Equilibria, Equilibrium, find_equilibria
from fastmech.slider.motion import SceneMotion

#: Time between looks at what is captured [s].
PIECE = 1.0

#: A force may fall by this share of itself in a coarse step, until so many of its time constants have passed.
FALL, GONE = 0.5, 30.0

#: Motions followed together.
TOGETHER = 1 << 12


@dataclass
class Switched(Computations):
    """Motions (n,) from one state under F0 exp(-alpha t).

    Where ``dt`` [s] does not say them, steps follow from the forces, in octaves.
    """

    certificate: CaptureCertificate  #: of the force-free scene, see :func:`map_snapping`
    start: Floats
    F0: Floats
    alpha: Floats
    end: Floats  #: s
    dt: float | None
    method: str
    threads: int | None

    def __post_init__(self) -> None:
        scene, start = self.certificate.system, self.start[None]
        free, unit = reduce(scene), scene.m2 * scene.l
        slowest = float(coarse_steps(free, start)[0])
        self.step = np.full(self.F0.size, slowest if self.dt is None else self.dt)  # the coarsest
        if self.dt is None:
            for force in np.unique(self.F0):
                needed = float(coarse_steps(free._replace(force=force / unit), start)[0])
                octaves = np.ceil(np.log2(slowest / needed) - 1e-9)
                self.step[force == self.F0] = slowest * 0.5 ** max(octaves, 0.0)
        #: Which have been seen at an unstable equilibrium, with the finest step.
        self.near = np.zeros(self.F0.size, dtype=np.bool_)

    def label(self, progress: Progress | None) -> tuple[Paths, NDArray[np.int8]]:
        """Ends and statuses of all of them."""
        found = Paths.empty(self.F0.size)
        status = np.full(self.F0.size, Status.UNDECIDED, dtype=np.int8)
        pieces = -(-self.F0.size // TOGETHER)
        for first in range(pieces):
            # Each piece takes something of everywhere, so that all take about as long.
            members = np.arange(first, self.F0.size, pieces)
            self.climb(members, found, status)
            if progress is not None:
                progress(members.size)
        return found, status

    def push(self, members: Indices, t: Floats) -> Floats:
        """F(t)/(m2 l) [1/s^2]."""
        scene = self.certificate.system
        return np.asarray(
            self.F0[members] * np.exp(-self.alpha[members] * t) / (scene.m2 * scene.l), dtype=np.float64
        )

    def follow(self, members: Indices, substeps: int) -> Paths:
        """One computation, with a look at every end of a piece."""
        paths = Paths.empty(members.size)
        paths.state[:] = self.start
        clock, running = np.zeros(members.size), np.arange(members.size)
        while running.size:
            lanes = members[running]
            acting = self.alpha[lanes] * clock[running] < GONE
            needed = np.where(acting, FALL / self.alpha[lanes], np.inf)
            with np.errstate(divide="ignore"):
                octaves = np.maximum(np.ceil(np.log2(self.step[lanes] / needed) - 1e-9), 0.0)
            step = self.step[lanes] * 0.5**octaves * SUBSTEPS[0] / substeps
            span = np.where(acting, np.minimum(PIECE, GONE / self.alpha[lanes]), PIECE)
            span = np.minimum(span, self.end[lanes] - clock[running])
            for h, length in np.unique(np.column_stack([step, span]), axis=0):
                group = running[(step == h) & (span == length)]
                some = members[group]
                # A force that decays is at any time the start of one that is smaller by then.
                now = self.F0[some] * np.exp(-self.alpha[some] * clock[group])
                run = integrate(
                    self.certificate.system,
                    paths.state[group],
                    float(length),
                    float(h),
                    self.method,
                    parameters={"F0": now, "alpha": self.alpha[some]},
                    threads=self.threads,
                )
                paths.state[group], paths.status[group] = run.y[-1], run.status
                clock[group] += float(length)
                paths.stop[group] = clock[group]
            self._look(paths, clock, members, running)
            if substeps == SUBSTEPS[-1]:
                self.near[members[running]] |= near_saddle(self.certificate, paths.state[running])
            alive = (paths.code[running] == 0) & np.isfinite(paths.state[running]).all(axis=1)
            running = running[alive & (clock[running] < self.end[members[running]])]
        return paths

    def _look(self, paths: Paths, clock: Floats, members: Indices, running: Indices) -> None:
        state = paths.state[running]
        captured = self.certificate.captured(state)
        place = np.zeros(len(self.certificate.tree.equilibria) + 1, dtype=np.int8)
        place[list(self.certificate.tree.wells)] = np.arange(1, len(self.certificate.tree.wells) + 1)
        code = place[captured.well]
        bound = SceneMotion(reduce(self.certificate.system)._replace(force=0.0)).energies(state)[0]
        push = self.push(members[running], clock[running])
        bound = bound + 2.0 * np.abs(push) - push * (np.cos(state[:, 0]) - np.sin(state[:, 1]))
        held = (code > 0) & (bound < np.append(-np.inf, self.certificate.levels)[code])
        paths.energy[running] = bound
        there = running[held]
        paths.code[there], paths.turns[there] = code[held], captured.turns[held]
        paths.time[there] = clock[there]

    def agree(self, members: Indices, coarse: Paths, fine: Paths) -> NDArray[np.bool_]:
        """Which tell the same with both steps."""
        push = self.push(members, fine.stop)
        return tell_the_same(self.certificate, coarse, fine, 0.5 * PIECE, push)

    def impossible(self, members: Indices, states: Floats) -> NDArray[np.bool_]:
        """Which have energies that the force cannot have given."""
        scene = self.certificate.system
        own = reduce(scene)._replace(
            force=self.F0[members] / (scene.m2 * scene.l),
            decay=self.alpha[members],  # type: ignore[arg-type]
        )
        return SceneMotion(own).impossible(np.tile(self.start, (members.size, 1)), states)

    def lingers(self, members: Indices) -> NDArray[np.bool_]:
        """Which came to an unstable equilibrium of the force-free scene in the finest computation."""
        return self.near[members]


#: Numbers of 8 bytes that memory holds of every motion on the way.
MOTION_NUMBERS = 40

#: Forces between two known ones that are tried at once.
BETWEEN = 32

#: How long motions are followed by default after the force has fallen to a millionth [s].
AFTER = 200.0

#: Tolerance of critical forces by default, over the first force of the map that leaves.
CLOSE = 1e-4


class Window(NamedTuple):
    """Neighbouring forces of one map that end alike."""

    first: float  #: F0 [N], the first of them
    last: float  #: F0 [N], the last
    label: int  #: where they end; -1: not proved
    turns: tuple[int, int]  #: of phi and theta
    left: bool  #: whether that is elsewhere


@dataclass(frozen=True, eq=False, repr=False)
class SnappingMap(Drawn):
    """Ends over F0 and alpha; arrays (alphas, forces)."""

    F0: Floats  #: N (forces,)
    alpha: Floats  #: 1/s (alphas,)
    equilibria: Equilibria  #: of the force-free scene: what ``label`` counts
    start: int  #: index of the well that all start from
    label: Integers  #: index of the well that captures the motion; -1: none is proved to
    turns: Integers  #: full turns of phi and theta, (alphas, forces, 2); 0 without a label
    time: Floats  #: when its capture was found [s], looked for every second; NaN: it was not
    status: NDArray[np.int8]  #: :class:`fastmech.ensembles.status.Status`

    KIND = "snapping"
    LAYOUT = "scan_types.snapping:snapping_dataset"
    PICTURE = "plots.objects:draw_snapping_map"

    def told(self) -> str:
        """How many motions leave, and which force is the least to."""
        ends = ", ".join(f"{count:,} {name}" for name, count in self.counts.items() if count)
        least = self.smallest[np.isfinite(self.smallest)]
        force = f"; the least force that leaves: {np.abs(least).min():.4g} N" if least.size else ""
        return (
            f"dynamic snapping over alpha ({self.alpha.size:,}) x F0 ({self.F0.size:,}): {ends}\n"
            f"  {np.count_nonzero(self.left):,} leave their well{force}"
        )

    @property
    def left(self) -> NDArray[np.bool_]:
        """Whether each ends in another well or with another number of turns."""
        return (self.label >= 0) & ((self.label != self.start) | (self.turns != 0).any(axis=-1))

    @property
    def counts(self) -> dict[str, int]:
        """How many have each status."""
        return counts(self.status, LABELS)

    @property
    def smallest(self) -> Floats:
        """The force of least magnitude that provably leaves, for every alpha [N] (alphas,); NaN: none."""
        first = np.where(self.left, np.abs(self.F0), np.inf).argmin(axis=1)
        return np.where(self.left.any(axis=1), self.F0[first], np.nan)

    def windows(self, k: int) -> list[Window]:
        """Runs of neighbouring forces that end alike at the k-th alpha; later ones that stay came back."""
        ends = np.column_stack([self.label[k], self.turns[k]])
        changes = np.flatnonzero((np.diff(ends, axis=0) != 0).any(axis=1)) + 1
        bounds = [0, *changes.tolist(), len(self.F0)]
        force, left = self.F0.tolist(), self.left[k].tolist()
        return [
            Window(force[a], force[b - 1], label, (phi, theta), left[a])
            for (a, b), (label, phi, theta) in zip(pairwise(bounds), ends[bounds[:-1]].tolist(), strict=True)
        ]


def map_snapping(
    scene: Scene,
    F0: ArrayLike,
    alpha: ArrayLike,
    *,
    start: Equilibrium | None = None,
    t_end: float | None = None,
    dt: float | None = None,
    method: str | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> SnappingMap:
    """The (F0, alpha) map of dynamic snapping, each end proved by capture.

    As for :func:`fastmech.label_starts`: a label is that of the well w, and its turn, in whose
    component of {Pi < B(w)} the motion is while ``T + Pi + |F(t)| (2 l - sgn(F) x2(t))``, which no later
    T + Pi exceeds, is below B(w); and it counts only if computations with different steps agree.

    Args:
        scene: the mechanism with a damper; its own F0 and alpha are not used.
        F0: forces [N], rising, of one sign, not 0.
        alpha: decay rates [1/s], greater than 0, rising.
        start: a minimum of the force-free scene, the deepest by default.
        t_end: end of every run [s]; by default when the force has fallen to a millionth of F0, and 200 s, or
            longer as for :func:`fastmech.label_starts`.
        dt: coarsest step [s]; by default it follows from the scene and the force. While a quickly falling
            force acts, steps are shorter by themselves.
        method: name of the method, by default as for labels.
        threads: threads to use; the result does not depend on it.
        progress: called with the number of motions that are done since the last call.

    Raises:
        InputError: an argument is wrong, alpha is 0, the scene has no damper, its force-free wells are not
            certain, or the start is none of them.
    """
    checks.progress_function(progress, "motions")
    force, rate = _forces(F0), _rates(alpha)
    free, equilibria, index = force_free(scene, start)
    method = find_method(method_for(free, method)).name
    if dt is not None:
        dt = checks.number("dt", dt, "s", above=0.0)
    certificate = scene_certificate(free)
    if t_end is None:
        end = default_end(rate, end_after(certificate, AFTER))
    else:
        end = np.asarray(checks.number("t_end", t_end, "s", above=0.0))
    rest = equilibria[index]
    shape, motions = (rate.size, force.size), rate.size * force.size
    fewer = 'fewer, or in parts for files: fastmech run, kind = "snapping"'
    checks.memory(motions, MOTION_NUMBERS, f"F0, alpha: {motions:.3g} motions", fewer)
    switched = Switched(
        certificate,
        np.array([rest.phi, rest.theta, 0.0, 0.0]),
        np.tile(force, rate.size),
        np.repeat(rate, force.size),
        np.repeat(np.broadcast_to(end, rate.size), force.size),
        dt=dt,
        method=method,
        threads=threads,
    )
    found, status = switched.label(progress)
    captured = status == Status.CAPTURED
    label = np.where(captured, np.append(-1, certificate.tree.wells)[found.code], -1)
    turns = np.where(captured[:, None], found.turns, 0).astype(np.int64)
    return SnappingMap(
        force,
        rate,
        equilibria,
        index,
        label.astype(np.int64).reshape(shape),
        turns=turns.reshape(*shape, 2),
        time=np.where(captured, found.time, np.nan).reshape(shape),
        status=status.reshape(shape),
    ).of(scene)


def default_end(alpha: ArrayLike, after: float = AFTER) -> Floats:
    """End of a run [s] by default: when the force has fallen to a millionth, and so many seconds later."""
    return after + np.log(1e6) / np.asarray(alpha, dtype=np.float64)


def critical_forces(
    snapping: SnappingMap,
    scene: Scene,
    *,
    tolerance: float | None = None,
    t_end: float | None = None,
    dt: float | None = None,
    method: str | None = None,
    threads: int | None = None,
) -> Floats:
    """The least force that leaves at every alpha of a map [N], narrowed down between its forces (alphas,).

    NaN where none of the map's forces leaves. A window narrower than the map's steps, below the first force
    that leaves, is not seen.

    Args:
        snapping: a map of the same scene.
        scene: the mechanism.
        tolerance: N; by default a ten-thousandth of the map's least force that leaves, for every alpha.
        t_end, dt, method, threads: as for :func:`map_snapping`.

    Raises:
        InputError: an argument is wrong.
    """
    if not isinstance(snapping, SnappingMap):
        raise InputError(f"snapping = {shown(snapping)}: must be what fastmech.map_snapping gives")
    if tolerance is not None:
        tolerance = checks.number("tolerance", tolerance, "N", above=0.0)
    start = snapping.equilibria[snapping.start]
    again = partial(map_snapping, scene, start=start, t_end=t_end, dt=dt, method=method, threads=threads)
    sign = float(np.sign(snapping.F0[0]))
    order = np.argsort(np.abs(snapping.F0))
    size = np.append(0.0, np.abs(snapping.F0)[order])
    found = np.full(snapping.alpha.size, np.nan)
    for k, rate in enumerate(snapping.alpha):
        leaves = np.flatnonzero(snapping.left[k, order])
        if not leaves.size:
            continue
        low, high = float(size[leaves[0]]), float(size[leaves[0] + 1])
        near = CLOSE * high if tolerance is None else tolerance
        while high - low > near:
            line = np.linspace(low, high, BETWEEN + 2)
            part = again(np.sort(sign * line[1:-1]), [rate])
            first = int(np.argmax([*part.left[0, :: int(sign)], True]))
            low, high = float(line[first]), float(line[first + 1])
        found[k] = sign * high
    return found


def force_free(scene: Scene, start: Equilibrium | None) -> tuple[Scene, Equilibria, int]:
    """The scene without force, its equilibria, and which one a motion starts from, the deepest by default.

    Raises:
        InputError: the scene has no damper or no well, or the start is none of its minima.
    """
    require_damper(scene)
    free = scene.replace(F0=0.0, alpha=0.0)
    equilibria = find_equilibria(free)
    minima = [i for i, e in enumerate(equilibria) if e.kind == "minimum"]
    if not minima:
        raise InputError(f"scene: has no well without force: {equilibria.certificate.sentence}")
    if not isinstance(start, Equilibrium | None):
        raise InputError(f"start = {shown(start)}: must be a minimum that find_equilibria gives")
    index = minima[0] if start is None else equilibria.index_of(start)
    if index not in minima:
        raise InputError(f"start: is a {equilibria[index].kind}, must be a minimum of the force-free scene")
    return free, equilibria, index


def _forces(F0: ArrayLike) -> Floats:
    force = check_point("F0", F0)
    checks.one_way("F0", F0, force)
    if force[-1] < force[0] or not (np.sign(force) == np.sign(force[-1])).all() or not force[0]:
        raise InputError("F0: must rise, be of one sign and nowhere be 0 N")
    return force


def _rates(alpha: ArrayLike) -> Floats:
    rate = check_point("alpha", alpha)
    if (rate == 0.0).any():
        raise InputError(
            "alpha = 0: must be greater than 0 1/s; a constant force has another potential with other wells, "
            "so that its ends cannot be compared"
        )
    checks.one_way("alpha", alpha, rate)
    if not (rate > 0.0).all() or rate[-1] < rate[0]:
        raise InputError("alpha: must be greater than 0 1/s and rise")
    return rate
