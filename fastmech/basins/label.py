"""``fm.label_starts``: the well, and its turn, in which every start ends, proved by capture.

The certificate is about the path as it was computed, so every path is computed twice, with one step and with
two thirds of it, and a label counts only if both are captured by the same copy of the same well at the same
time, so near to each other that what lies between them is captured too. Paths that run apart (they passed
nearer to the stable manifold of a saddle than their error) are computed again with ever smaller steps.

Angles are reduced to one turn first, exactly. As long as a force acts that dies out before the mechanism has
moved, steps follow its decay; once its work is less than rounding, the motion goes on without it. A strong
damper stops part of a motion as quickly: steps are as short at first, and then those of what remains.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from fastmech.arrays import Floats, Integers
from fastmech.attractors.find import Attractors, find_attractors
from fastmech.attractors.flow import angles_of, keeps_moving
from fastmech.attractors.settle import Ends
from fastmech.basins.convergence import (
    SUBSTEPS,
    Computations,
    Indices,
    Paths,
    follow,
    near_saddle,
    rounds_until,
    tell_the_same,
)
from fastmech.basins.measures.labels import GONE, LabelOf, check_labels
from fastmech.capture.certificate import CaptureCertificate, Early
from fastmech.capture.observe import OUT
from fastmech.capture.select import certificate_of, require_damper
from fastmech.ensembles import checks
from fastmech.ensembles.integrate import Trajectories, integrate
from fastmech.ensembles.lanes import finite_rows
from fastmech.ensembles.run import Progress
from fastmech.ensembles.status import FAILURES, LABELS, Status, counts
from fastmech.ensembles.system import System
from fastmech.ensembles.threads import thread_count
from fastmech.errors import InputError, StepWarning
from fastmech.integrators.methods import Method, find_method
from fastmech.models.mechanism import Mechanism
from fastmech.models.stability import classify, linear_of, state_matrix
from fastmech.objects import Field, Result, counted
from fastmech.samplers import Starts
from fastmech.scene import Scene

#: Most full turns from which a start is brought back, and 2 pi in parts of 24 bits and a rest.
MOST_TURNS = 2.0**29 - 1.0
_FIRST = float(np.float32(2.0 * np.pi))
_SECOND = float(np.float32(2.0 * np.pi - _FIRST))
TURN = (_FIRST, _SECOND, 2.0 * np.pi - _FIRST - _SECOND + 2.4492935982947064e-16)

#: Least growth from step to step while a strong damper stops part of a motion.
FINEST_GROWTH = 0.2

#: End of runs by default [s]; the slowest vibration [s] from which on runs are longer, a twelfth of that end;
#: at most so many coarse steps long; and so many of the slowest decay times, at least and at most.
LONG, SLOW, STEPS, DECAYS, ALL_OVER = 60.0, 5.0, 20_000.0, 6.0, 100.0

#: How often motions are looked at before the time from which on the certificate holds.
LOOKS = 64

#: Seconds between looks at whether a motion is at a saddle, and how many are kept at a time.
LOOK, MOST_LOOKS = 0.25, 1 << 20

#: Bits for the well (there are at most 128 equilibria), and for the turns of all coordinates together.
WELL_BITS, TURN_BITS = 7, 56

#: Numbers of 8 bytes that memory holds of every start on the way.
START_NUMBERS = 20

#: Starts that are followed together, at most; and so many pieces, if they are not smaller than the least.
#: Every piece takes something of everywhere, so that all take about as long and progress tells the time left.
BATCH, PIECES, LEAST = 1 << 16, 16, 1 << 11

#: Wells that have a line of their own where ends are printed.
MOST_LINES = 3


@dataclass(frozen=True, repr=False)
class Labels(Result):
    """Where n starts end; printed, how many end where, and when."""

    tree: Any  #: wells, barriers and equilibria; of what keeps moving :class:`~.find.Attractors`
    well: NDArray[np.int8]  #: index of the well among the equilibria or attractors, -1: no label; shape (n,)
    turns: NDArray[np.int32]  #: full turns of each coordinate of that well from its listed place, (n, coords)
    time: Floats  #: of capture [s], NaN: not captured; the end of a step; (n,)
    settle_time: Floats | None  #: s, from then on within the settling ball; NaN: not by t_end; (n,)
    status: NDArray[np.int8]  #: :class:`Status`, (n,)
    steps: int  #: integration steps of all computations of all starts
    t_end: float = np.nan  #: end of the runs [s]
    parted: int = 0  #: undecided ones that the finest steps capture, but that others do not confirm

    @property
    def counts(self) -> dict[str, int]:
        """How many starts have each status."""
        return counts(self.status, LABELS)

    KIND = "labels"
    FIELDS = {
        "well": Field("start", "1", "well or attractor at the end, -1: no label", codes=-1),
        "turns": Field("start coordinate_number", "1", "full turns of each coordinate of that well"),
        "time": Field("start", "s", "when it is known, NaN: it is not"),
        "settle_time": Field("start", "s", "from then on near its well, NaN: not by the end"),
        "status": Field("start", "1", "what is known of the start", codes=Status),
        "steps": Field("", "1", "integration steps of all computations"),
        "t_end": Field("", "s", "end of the runs"),
    }

    def told(self) -> str:
        """How many starts end where, and when."""
        return told_ends(counted(self.status.size, "start"), self)


def told_ends(what: str, found: Any) -> str:
    """At most six lines on ``what`` has the wells, statuses and times of :class:`Labels`, and its tree."""
    n, well = found.status.size, found.well.ravel()
    known, number = np.unique(well[well >= 0], return_counts=True)
    order = np.argsort(-number, kind="stable")
    statuses = ", ".join(f"{count:,} {name}" for name, count in found.counts.items() if count)
    lines = [f"{what}: {statuses}"]
    # A line that says how many more there are might as well name the only one.
    named = order.size if order.size == MOST_LINES + 1 else MOST_LINES
    for k in order[:named]:
        text = f"  {_named(found.tree, int(known[k]))}: {number[k]:,} ({number[k] / n:.1%})"
        lines.append(text + "; a mode is not damped to first order" * _misses(found, int(known[k])))
    if order.size > named:
        lines.append(f"  {order.size - named} more: {number[order[named:]].sum():,}")
    times = found.time[np.isfinite(found.time)]
    what = "captured" if hasattr(found.tree, "barrier") else "known"
    took = (
        f"  {what} after {np.median(times):.3g} s (median), {times.max():.3g} s at most" if times.size else ""
    )
    lines.append(f"{took}{';' if took else ' '} followed for {found.t_end:g} s{advice(found)}")
    return "\n".join(lines)


def advice(found: Any) -> str:
    """What may decide the starts of :class:`Labels` that are undecided; empty without any."""
    late = found.counts[Status.UNDECIDED.name.lower()] - found.parted
    helps = f"; a longer t_end may decide {late:,}" * (late > 0)
    return helps + f"; steps part for {found.parted:,}, which a smaller dt may decide" * (found.parted > 0)


def _misses(found: Any, k: int) -> bool:
    """Whether motions captured by a well stay, but may swing on there."""
    if found.system is None or not hasattr(found.tree, "equilibria"):
        return False
    return classify(found.system, found.tree.equilibria[k]).verdict == "stable"


def _named(tree: Any, k: int) -> str:
    """A stop's code, an attractor, or a well by its number among wells, as pictures have it."""
    if tree is None:
        return f"code {k}"
    if isinstance(tree, Attractors):
        return tree[k].name
    return str(tree.named(k))


def of_attractors(found: Attractors, ends: Attractors | Ends) -> Labels:
    """Labels of starts by attractors."""
    n = len(ends.label)
    turns = np.zeros((n, max(len(found.names) // 2, 1)), dtype=np.int32)
    own = found, ends.label.astype(np.int8), turns, ends.time, None
    return Labels(*own, status=ends.status, steps=ends.steps, t_end=found.t_end)


def pieces_of(n: int) -> Iterator[NDArray[np.intp]]:
    """Indices of n starts, piece by piece."""
    pieces = max(-(-n // BATCH), min(PIECES, n // LEAST), 1)
    for piece in range(pieces):
        yield np.arange(piece, n, pieces)


def label_starts(
    scene: Scene | Mechanism | System,
    starts: Starts,
    t_end: float | None = None,
    *,
    dt: float | None = None,
    method: str | None = None,
    settle_radius: float | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Labels:
    """Label starts by the well that captures them, or by the attractor at which they arrive.

    Args:
        scene: the mechanism, with a damper. A decaying force leads to the wells of springs and weights. Under
            a load that repeats, and of a system of your own without a stopping condition, labels are those
            of :func:`fastmech.find_attractors`, the attractors are in ``tree``, and ``dt`` and
            ``settle_radius`` do not apply; with a stopping condition the label is its code.
        starts: a sampler of ``fm.samplers``, or coordinates [rad or m], then rates, as ``scene.state`` names
            them, shape (n, states) or (states,); angles count their turns, and more than four give a
            warning, if they may be degrees.
        t_end: end of the run [s], by default 60 or, if that is shorter, a hundred of the slowest decay times
            to 1/e about a well; or twelve periods of the slowest vibration about one, or six decay times, if
            that is longer, see :func:`capture_end` (for attractors see there); what is not captured by then
            is undecided.
        dt: coarsest step [s]: each path is computed with it and with two thirds of it, and with less where
            these differ. By default it follows from the scene's frequencies and the start's energy; paths
            that fail with it are computed again with a 16th of it, and so on.
        method: name of the integration method; by default ``dop853``, or ``radau5`` (implicit) where the
            damper stops motion so quickly that explicit steps would have to be far shorter than the rest of
            the motion asks for.
        settle_radius: if given, also the time from which on a captured motion stays within so many rad of
            its well in the kinetic-energy norm (by its energy, to second order about the well).
        threads: threads to use, all processors by default. The result does not depend on it.
        progress: called with the number of starts that are done since the last call.

    Raises:
        InputError: an argument is wrong, the scene has no damper, or its wells are not certain.
    """
    label = Labeller(scene, t_end, How(dt, method, settle_radius, threads))
    if keeps_moving(scene):
        return label(starts, progress)
    if not isinstance(scene, System):
        require_damper(scene)
    states = checks.starts("starts", starts, scene.state)
    checks.warn_of_turns("starts", states, [scene.state.index(name) for name in angles_of(scene)])
    return label(states, progress)


class How(NamedTuple):
    """How starts are labelled: see :func:`label_starts`."""

    dt: float | None = None
    method: str | None = None
    settle_radius: float | None = None
    threads: int | None = None
    sequence: tuple[int, ...] = SUBSTEPS  #: numbers of substeps, one computation after the other


@dataclass
class Labeller:
    """Labels of starts of one system, part by part."""

    system: Any
    t_end: float | None
    how: How
    attractors: Attractors | None = None  #: of a system that keeps moving: what its first starts find

    def __call__(
        self, starts: Any, progress: Progress | None = None, parameters: Mapping[str, Floats] | None = None
    ) -> Labels:
        """Labels of starts (n, states), a system's with values (n,) of its parameters."""
        if keeps_moving(self.system):
            ends: Attractors | Ends
            if self.attractors is None:
                ends = self.attractors = find_attractors(
                    self.system,
                    starts,
                    t_end=self.t_end,
                    method=self.how.method or "dop853",
                    threads=self.how.threads,
                    progress=progress,
                )
            else:
                ends = self.attractors.label_starts(starts, progress=progress)
            return of_attractors(self.attractors, ends)
        if not isinstance(self.system, System):
            return label_states(self.system, starts, self.t_end, self.how, progress)
        return self._by_stop_codes(starts, progress, parameters or {})

    def _by_stop_codes(self, starts: Floats, progress: Progress | None, own: Mapping[str, Floats]) -> Labels:
        """Labels of a system's starts (n, dim) by stop codes, with values (n,) of ``own`` parameters.

        Each trajectory is computed with the step ``dt`` and with two thirds of it; where codes differ, or
        times of stopping by more than a step, with ever smaller ones. What a code means, and whether it is
        final, is the stopping condition's matter.
        """
        system = self.system
        if system.stop is None:
            raise InputError(
                "stop: missing; basins of a system need a stopping condition that tells them apart"
            )
        if self.how.dt is None:
            raise InputError("dt: missing; a system needs its longest step in s")
        dt, n = checks.number("dt", self.how.dt, "s", above=0.0), len(starts)
        t_end = checks.number("t_end", LONG if self.t_end is None else self.t_end, "s", above=0.0)
        status = np.full(n, Status.UNDECIDED, dtype=np.int8)
        code, time, steps = np.zeros(n, dtype=np.int64), np.full(n, np.nan), 0
        for piece in pieces_of(n):
            members, before, last = piece, code[piece], time[piece]  # of the computation before: none yet
            for substeps in SUBSTEPS:
                run = integrate(
                    system,
                    starts[members],
                    t_end,
                    dt * SUBSTEPS[0] / substeps,
                    self.how.method or "dop853",
                    parameters={name: values[members] for name, values in own.items()},
                    threads=self.how.threads,
                )
                now, failed = run.stop_code, run.status != Status.OK
                assert now is not None  # the system has a stopping condition
                assert run.stop_time is not None
                code[members], time[members] = now, run.stop_time
                ended = np.where(now != 0, run.stop_time, t_end)
                steps += int(np.nansum(ended / run.dt))
                agrees = (before == now) & (np.abs(last - ended) <= dt)
                status[members] = np.where(agrees & (now != 0), Status.CAPTURED, Status.UNDECIDED)
                status[members[failed]] = run.status[failed]
                if substeps == SUBSTEPS[-1]:
                    split = (before != now) & (before != 0) & (now != 0)
                    status[members[split]] = Status.AT_SADDLE
                rest = np.flatnonzero(~agrees | failed)
                members, before, last = members[rest], now[rest], ended[rest]
                if not members.size:
                    break
            if (code < 0).any() or (code > 127).any():
                raise InputError(
                    f"stop: gave the code {code[(code < 0) | (code > 127)][0]}, must be 0 to 127"
                )
            if progress is not None:
                progress(piece.size)
        captured = status == Status.CAPTURED
        return Labels(
            None,
            np.where(captured, code, -1).astype(np.int8),
            np.zeros((n, 2), dtype=np.int32),
            np.where(captured, time, np.nan),
            None,
            status=status,
            steps=steps,
            t_end=t_end,
        ).of(system)


def default_end(certificate: CaptureCertificate, end: float = LONG) -> float:
    """End of runs by default [s]: ``end``, longer in proportion where the slowest vibration takes above 5 s.

    That is the slowest one about a stable equilibrium, not damped. Beside a fold, where it takes ever longer,
    runs end after 20,000 coarse steps. Quickly damped motion is over after a hundred decay times.
    """
    squares = []
    for well in certificate.tree.wells:
        mass, _, stiffness = linear_of(certificate.held, certificate.tree.equilibria[well].position)
        squares.append(float(scipy.linalg.eigvalsh(0.5 * (stiffness + stiffness.T), mass)[0]))
    period = 2.0 * np.pi / np.sqrt(max(min(squares), np.finfo(float).tiny))
    longest = max(end, min(end * float(period) / SLOW, STEPS * certificate.slow_step))
    return min(longest, ALL_OVER * _slowest_decay(certificate))


def _slowest_decay(certificate: CaptureCertificate) -> float:
    """The longest time in which small swings about a well fall to 1/e [s]."""
    states = [state_matrix(certificate.held, certificate.tree.equilibria[w]) for w in certificate.tree.wells]
    return 1.0 / max(-float(np.linalg.eigvals(states).real.max(axis=1).max()), 1e-12)


def capture_end(certificate: CaptureCertificate) -> float:
    """End of runs of labels by default [s]: motions stop when they are captured, so it may be late.

    As :func:`default_end`, and six of the slowest decay times about a well, at most 20,000 coarse steps.
    """
    late = min(DECAYS * _slowest_decay(certificate), STEPS * certificate.slow_step)
    return max(default_end(certificate), late)


def label_states(
    scene: Scene | Mechanism,
    states: Floats,
    t_end: float | None = None,
    how: How | None = None,
    progress: Progress | None = None,
) -> Labels:
    """As :func:`label_starts`, of states (n, states)."""
    dt, method, settle_radius, threads, sequence = How() if how is None else how
    require_damper(scene)
    checks.progress_function(progress, "starts")
    checks.memory(len(states), START_NUMBERS, f"starts: labels of {len(states):.3g}", "fewer")
    thread_count(threads)
    first = certificate_of(scene)
    until = t_end = capture_end(first) if t_end is None else checks.number("t_end", t_end, "s", above=0.0)
    begin, turned = _unwound(states, first.periods)
    method = first.method(method)
    formula = find_method(method)
    early = first.early(formula)
    if early is None or early.span >= t_end:
        early = Early(first, 0.0, np.inf)
    certificate, t_end = early.rest, t_end - early.span
    if dt is not None:
        dt = checks.number("dt", dt, "s", above=0.0)
        certificate.warn_of_step(dt, method)
    if settle_radius is not None:
        settle_radius = checks.number("settle_radius", settle_radius, "rad", above=0.0)
    outside = first.outside(begin)
    finite = finite_rows(begin) & ~outside
    coarse = first.coarse_steps(begin) if dt is None else np.full(len(begin), dt)
    found = Paths.empty(len(begin), len(first.names))
    status = np.where(finite, Status.UNDECIDED, Status.START_NOT_FINITE).astype(np.int8)
    status[outside] = Status.OUT_OF_RANGE
    settle = None if settle_radius is None else np.full(len(begin), np.nan)
    shortest = np.inf if dt is not None else certificate.shortest_step
    for some in pieces_of(len(begin)):
        again = some[finite[some]]
        while again.size:
            for step in np.unique(coarse[again]):
                members = again[coarse[again] == step]
                own = first, early, begin, t_end, float(step)
                followed = StartRuns(*own, method=formula, threads=threads, sequence=sequence)
                followed.climb(members, found, status)
                if settle is not None and settle_radius is not None:
                    settle[members] = followed.settle_times(members, found, status, settle_radius)
                found.steps += followed.steps
            again = again[np.isin(status[again], FAILURES) & (coarse[again] > shortest)]
            coarse[again] *= 0.0625
        if progress is not None:
            progress(some.size)
    captured = status == Status.CAPTURED
    return Labels(
        certificate.tree,
        np.append(-1, certificate.tree.wells)[np.where(captured, found.code, 0)].astype(np.int8),
        np.where(captured[:, None], found.turns + turned, 0).astype(np.int32),
        np.where(captured, found.time, np.nan),
        settle,
        status=status,
        steps=found.steps,
        t_end=until,
        parted=int(((status == Status.UNDECIDED) & (found.code > 0)).sum()),
    ).of(scene)


@dataclass(frozen=True)
class WellNumbers:
    """Labels starts (n, states) with one number for each copy of each well, -1 where not proved."""

    scene: Scene | Mechanism
    t_end: float | None  #: s
    threads: int | None

    def __call__(self, starts: Floats) -> Integers:
        """Labels (n,) of starts (n, states)."""
        return number_wells(label_states(self.scene, starts, self.t_end, How(threads=self.threads)))


def well_numbers(
    scene: Scene | Mechanism, t_end: float | None = None, *, threads: int | None = None
) -> WellNumbers:
    """A function that labels starts (n, states) with a number for each copy of each well, -1: not proved.

    It is what :func:`fastmech.minimal_shock`, :func:`fastmech.track_edge` and
    :func:`fastmech.uncertainty_exponent` ask; :func:`fastmech.well_of_number` reads its numbers. Arguments
    are as for :func:`fastmech.label_starts`.

    Raises:
        InputError: the scene has no damper, or ``t_end`` is wrong.
    """
    require_damper(scene)
    t_end = None if t_end is None else checks.number("t_end", t_end, "s", above=0.0)
    return WellNumbers(scene, t_end, threads)


def number_wells(ends: Labels) -> Integers:
    """One number for each copy of each well (n,), ``GONE``, or -1: no label, or too many turns to count."""
    coordinates = ends.turns.shape[1]
    bits = TURN_BITS // coordinates
    turns = ends.turns.astype(np.int64) + (1 << (bits - 1))
    number = np.zeros(len(turns), dtype=np.int64)
    for column in turns.T:
        number = (number << bits) + column
    counted = ((turns >= 0) & (turns < 1 << bits)).all(axis=1)
    labels = check_labels(ends)
    return np.where(
        (ends.well >= 0) & counted, (number << WELL_BITS) + ends.well, np.where(labels == GONE, GONE, -1)
    )


def well_of_number(label: int, coordinates: int = 2) -> tuple[int, tuple[int, ...]]:
    """The equilibrium's index and its full turns of each coordinate that a number of ``well_numbers`` means.

    Raises:
        InputError: the label is negative, or that of what is gone for good: it means no copy.
    """
    label = checks.whole_number("label", label, least=0, most=GONE - 1)
    coordinates = checks.whole_number("coordinates", coordinates, least=1)
    turns, bits, each = label >> WELL_BITS, TURN_BITS // coordinates, []
    for _ in range(coordinates):
        each.append(turns % (1 << bits) - (1 << (bits - 1)))
        turns >>= bits
    return label % (1 << WELL_BITS), tuple(reversed(each))


def label_name(label_of: LabelOf, label: int) -> str:
    """What a label means, in words: of ``well_numbers`` the well and its turns, else the number itself."""
    if label < 0:
        return "no label"
    if label == GONE:
        return "no attractor: gone for good, or out of a range"
    if not isinstance(label_of, WellNumbers):
        return f"the label {label}"
    names = certificate_of(label_of.scene).names
    well, turns = well_of_number(label, len(names))
    made = [f"{t:+d} turn{'s' * (abs(t) > 1)} of {name}" for t, name in zip(turns, names, strict=True) if t]
    return ", ".join([f"well {well}", *made])


def _unwound(starts: Floats, periods: Floats) -> tuple[Floats, Integers]:
    """Starts (n, states) with their angles in one turn, and the full turns taken away (n, coordinates).

    Too many turns to count make a start NaN.
    """
    angles = starts[:, : len(periods)]
    with np.errstate(invalid="ignore"):
        turns = np.where((np.abs(angles) > np.pi) & (periods > 0.0), np.rint(angles / (2.0 * np.pi)), 0.0)
    turns = np.where(np.abs(turns) <= MOST_TURNS, turns, np.nan)
    begin = starts.copy()
    for part in TURN:  # their products with the number of turns are exact
        begin[:, : len(periods)] -= turns * part
    return begin, np.nan_to_num(turns).astype(np.int64)


@dataclass
class StartRuns(Computations):
    """Computations of starts (n, states), from when a quick beginning, if there is one, is over."""

    first: CaptureCertificate  #: of the motion from its start
    early: Early  #: what is over at once, and the certificate of what follows; no span: nothing is
    starts: Floats
    t_end: float  #: of what follows [s]
    coarse: float  #: s
    method: Method
    threads: int | None
    sequence: tuple[int, ...] = SUBSTEPS
    steps: int = 0

    def __post_init__(self) -> None:
        self.certificate = self.early.rest
        self.rounds = rounds_until(self.t_end, SUBSTEPS[0] * self.coarse)

    def grows(self, substeps: int) -> bool:
        """Whether so many substeps let damped motion grow."""
        step = SUBSTEPS[0] * self.coarse / substeps
        return self.certificate.grows(step, self.t_end / step, self.method.name)

    def follow(self, members: Indices, substeps: int, observer: Floats | None = None) -> Paths:
        """One computation; none where its step lets damped motion grow."""
        if self.grows(substeps):
            paths = Paths.empty(len(members), len(self.certificate.names))
            paths.status[:] = Status.STEP_TOO_LARGE
            return paths
        begin, status = self.begin(members, substeps)
        own = self.certificate.packed if observer is None else observer
        course = self.certificate, own, begin, self.t_end, self.rounds
        paths = follow(*course, substeps=substeps, method=self.method, threads=self.threads)
        paths.time += self.early.span
        failed, left = np.isin(status, FAILURES), status == Status.OUT_OF_RANGE
        paths.code[failed], paths.status[failed] = 0, status[failed]
        paths.code[left], paths.turns[left], paths.stop[left] = OUT, 0, 0.0
        self.steps += paths.steps
        return paths

    def begin(self, members: Indices, substeps: int) -> tuple[Floats, NDArray[np.int8]]:
        """States from which on the certificate holds, and the statuses of the motions until then."""
        starts, span = self.starts[members], self.early.span
        if not span:
            return starts, np.zeros(len(members), dtype=np.int8)
        longest = min(self.coarse, self.early.step) * SUBSTEPS[0] / substeps
        ratio = 1.0 + max(2.0 / substeps, FINEST_GROWTH)
        times = np.append(self.first.damped_times(self.method.name, span, ratio), span)
        if not all(self.first.periods):  # it may leave a range and come back
            times = np.union1d(times, np.linspace(0.0, span, LOOKS + 1)[1:])
        run = self._integrate(self.first.system, starts, longest, times)
        return run.y[-1], run.status

    def _integrate(self, system: Any, starts: Floats, dt: float, times: Floats) -> Trajectories:
        """States at times [s] without a warning of the step, which has been told."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", StepWarning)
            method, threads = self.method.name, self.threads
            return integrate(system, starts, dt=dt, method=method, t_eval=times, threads=threads)

    def agree(self, members: Indices, coarse: Paths, fine: Paths) -> NDArray[np.bool_]:
        """Which tell the same with both steps."""
        return tell_the_same(self.certificate, coarse, fine, 0.5 * self.coarse)

    def impossible(self, members: Indices, states: Floats) -> NDArray[np.bool_]:
        """Which have more energy than they can have."""
        return self.first.impossible(self.starts[members], states)

    def lingers(self, members: Indices) -> NDArray[np.bool_]:
        """Which motions come to an unstable equilibrium by the end, with the finest step."""
        finest, found = self.coarse * SUBSTEPS[0] / self.sequence[-1], np.zeros(len(members), dtype=np.bool_)
        if self.sequence != SUBSTEPS or self.grows(self.sequence[-1]):  # few substeps leave it undecided
            return found
        begin, _ = self.begin(members, self.sequence[-1])
        times = np.linspace(0.0, self.t_end, math.ceil(self.t_end / LOOK) + 1)
        together = max(1, MOST_LOOKS // times.size)
        for first in range(0, len(begin), together):
            some = slice(first, first + together)
            states = self._integrate(self.certificate.system, begin[some], finest, times).y
            near = near_saddle(self.certificate, states.reshape(-1, begin.shape[1])).reshape(times.size, -1)
            found[some] = near.any(axis=0)
        return found

    def settle_times(self, members: Indices, found: Paths, status: NDArray[np.int8], radius: float) -> Floats:
        """Times [s] from which on captured starts have no energy to leave the ball about their well."""
        levels = np.minimum(self.certificate.confining(radius), self.certificate.levels)
        times = np.full(members.size, np.nan)
        left, params = np.flatnonzero(status[members] == Status.CAPTURED), self.certificate.params(levels)
        for substeps in (SUBSTEPS[1], SUBSTEPS[-1]):
            paths = self.follow(members[left], substeps, params)
            same = paths.code == found.code[members[left]]
            times[left[same]] = paths.time[same]
            left = left[(paths.code > 0) & ~same]  # shorter steps tell whether they stay in their range
        return times
