"""``fm.find_attractors``: where motions of a system settle, found without knowing it beforehand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from fastmech.arrays import Floats, Integers
from fastmech.attractors.arrival import Balls, Cloud
from fastmech.attractors.flow import FINER, Flow, SectionFlow, angles_of, flow_of, require_flow
from fastmech.attractors.orbits import Orbit, exponent, is_rest
from fastmech.attractors.proof import RestProof
from fastmech.attractors.search import DENSE, Search
from fastmech.attractors.settle import Ends, by_only_end, only_end, settle
from fastmech.ensembles import checks
from fastmech.ensembles.run import Progress
from fastmech.ensembles.status import LABELS, counts
from fastmech.ensembles.system import System
from fastmech.errors import InputError, shown
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Drawn, Printed, counted
from fastmech.samplers import Starts

#: Starts by default, those of a sample that is searched, and searches of what arrives nowhere.
STARTS, SAMPLE, ROUNDS = 10_000, 256, 4

#: States at which the map is looked at, whether it preserves volume, over so many periods, and the share of
#: all growth and shrinking of volume that is none: what a conservative motion gains it loses again.
PRESERVING, OVER, BALANCE = 16, 32, 0.05

#: Divergence over a period that is rounding.
ROUNDING = 1e-6

#: Periods that motions have to arrive: so many times those of the sample's last, and at least and at most.
LATER, FEWEST, MOST = 8, 256, 1 << 14

#: States of a place that are printed.
SHOWN = 6

#: Lines of attractors that are printed.
LINES = 5


def place_of(point: Floats, digits: int) -> str:
    """A state (dim,) in words, of many states the first ones."""
    where = ", ".join(f"{x:.{digits}g}" for x in np.round(point[:SHOWN], 9) + 0.0)
    return where + ", ..." * (point.size > SHOWN)


@dataclass(frozen=True, repr=False, eq=False)
class Attractor(Printed):
    """A place of rest, a periodic motion, a torus or chaos that motions come to."""

    #: "fixed point", "periodic", "torus", "chaos", "continuum" of the first two side by side, or "saddle
    #: cycle": saddles and ways between them, along which each turn takes longer than the last; a torus that
    #: has a period is filled with cycles of that period, none of which attracts alone
    kind: str
    points: Floats  #: (m, dim): the place; after each forcing period, or all along; a sample
    period: float | None  #: of a periodic motion, or of the cycles that lie side by side [s]
    forcing_periods: int | None  #: the same in periods of the forcing, where there is one
    multipliers: NDArray[np.complex128] | None  #: of the map over its period, of a place of rest over
    # ``looks``; None of a torus and of chaos
    exponent: float  #: largest Lyapunov exponent [1/s], of a saddle cycle over the time looked at
    exponent_error: float  #: its error
    residual: float | None = None  #: of the map over its period, as a share of the scale
    radius: float | None = None  #: of the ball about it that it attracts, over the scale: measured, or proved
    proof: RestProof | None = None  #: of a place of rest, if the right-hand side can be called with symbols
    found: int = 0  #: how many starts end there

    def told(self) -> str:
        """Kind, place, and the largest Lyapunov exponent."""
        how = " over the time looked at" if self.kind == "saddle cycle" else ""
        growth = f"Lyapunov exponent {self.exponent:.3g} 1/s{how}"
        return f"{self.name}; {growth}, {counted(self.found, 'start')}"

    @property
    def name(self) -> str:
        """Kind, period and place in a few words."""
        where = place_of(self.points[0], 4)
        period = "" if self.period is None else f", period {self.period:.6g} s"
        if self.period is not None and self.kind != "periodic":
            period = f" of cycles{period}"
        if self.forcing_periods is not None:
            period = f", period {self.forcing_periods} of the forcing"
        place = f"at ({where})" if self.kind in ("fixed point", "periodic") else f"about ({where})"
        return f"{self.kind}{period} {place}{', proved' if self.proof else ''}"


@dataclass(frozen=True, repr=False)
class Attractors(Drawn, Sequence[Attractor]):
    """Attractors, the most frequent first, and where each start ends; printed, the shares."""

    attractors: tuple[Attractor, ...]
    label: Integers  #: index of the attractor of each start, -1: none (n,)
    status: NDArray[np.int8]  #: :class:`fastmech.ensembles.status.Status` (n,)
    time: Floats  #: when each had arrived [s], NaN: it had not (n,)
    names: tuple[str, ...]  #: of the states
    t_end: float  #: how long motions had [s]
    looks: float  #: time between looks at them: the forcing's period, or one that suits [s]
    dt: float  #: longest step [s]
    scale: Floats  #: typical size of each state
    cell: Floats | None  #: size of the cells of tori and chaos; None where there are none
    steps: int  #: of all motions together
    search: Search = field(repr=False)  #: what they were found with
    rank: Integers = field(repr=False)  #: place among the attractors of what the search has found

    KIND = "attractors"
    PICTURE = "plots.objects:draw_attractors"
    LAYOUT = "scan_types.attractors:attractor_dataset"

    def __len__(self) -> int:
        return len(self.attractors)

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        return self.attractors[index]

    def index(self, value: Any, *limits: int) -> int:
        """The number of one of these attractors.

        Raises:
            InputError: it is none of them.
        """
        try:
            return self.attractors.index(value, *limits)
        except ValueError:
            raise InputError(
                f"value = {shown(value)}: is none of these attractors; label_starts tells where a state ends"
            ) from None

    def label_starts(
        self,
        starts: Starts,
        n: int | None = None,
        *,
        seed: int | None = None,
        progress: Progress | None = None,
    ) -> Ends:
        """Labels, statuses and times of other starts by these attractors.

        Starts, ``n``, ``seed`` and ``progress`` are as for :func:`fastmech.find_attractors`.

        Raises:
            InputError: an argument is wrong.
        """
        y = checks.starts("starts", starts, self.names, n=n, seed=seed, default=STARTS)
        checks.progress_function(progress, "starts")
        periods = max(1, round(self.t_end / self.looks))
        ends = by_only_end(self.search, settle(self.search, y, periods, progress))
        return ends._replace(label=self.rank[ends.label])

    def __call__(self, starts: Floats) -> Ends:
        """Labels and statuses of starts (n, dim), as measures of basins ask for them."""
        return self.label_starts(starts)

    @property
    def well(self) -> Integers:
        """The labels, as measures of basins take them."""
        return self.label

    def ranked(self, count: Integers) -> tuple[Attractors, Integers]:
        """The same by other counts of starts at each (attractors,), and new numbers by old ones, -1 last."""
        order = np.argsort(-count, kind="stable")
        number = np.append(np.argsort(order), -1)
        by_count = tuple(self.attractors[k] for k in order)
        ranked = replace(self, attractors=by_count, label=number[self.label], rank=number[self.rank])
        return ranked.of(self.search.flow.scene), number

    @property
    def counts(self) -> dict[str, int]:
        """How many starts have each status."""
        return counts(self.status, LABELS)

    @property
    def fractions(self) -> Floats:
        """Share of the starts that ends at each."""
        return np.array([one.found for one in self.attractors]) / max(self.status.size, 1)

    def told(self) -> str:
        """The shares of the attractors, the most frequent first.

        The 95 % Wilson interval of a share counts unsure and undecided starts as none, and as all.
        """
        n = self.status.size
        told = ", ".join(f"{count:,} {name}" for name, count in self.counts.items() if count)
        lines = [f"{counted(len(self), 'attractor')} of {counted(n, 'start')}: {told}"]
        open_ = sum(self.counts[name] for name in ("unsure", "undecided"))
        for one in self.attractors[: LINES if len(self) <= LINES else LINES - 1]:
            low = binomtest(one.found, n).proportion_ci(method="wilson").low
            high = binomtest(one.found + open_, n).proportion_ci(method="wilson").high
            lines.append(f"  {one.found / n:.4f} ({low:.4f} to {high:.4f}): {one.name}")
        if len(self) > LINES:
            rest = sum(one.found for one in self.attractors[LINES - 1 :])
            lines.append(f"  {rest / n:.4f}: {len(self) - LINES + 1} more")
        return "\n".join(lines)


def find_attractors(
    system: System | Mechanism,
    starts: Starts,
    n: int | None = None,
    *,
    t_end: float | None = None,
    seed: int | None = None,
    method: str = "dop853",
    threads: int | None = None,
    progress: Progress | None = None,
) -> Attractors:
    """Find the attractors of a system and the starts that end at each.

    Angles beyond four turns give a warning: they may be degrees.

    Args:
        system: a system of your own or a mechanism. One that depends on the time needs its ``period``; a
            mechanism's is that of its loads. States that count modulo a turn are its ``angles``.
        starts: ranges by name, ``{"x": (-1, 1), "x_dot": (-0.5, 1)}`` for uniform starts (what is not named
            is zero), a sampler of ``fm.samplers``, or states (n, dim).
        n: how many starts, by default the sampler's, or 10,000; of states given all.
        t_end: how long a motion has to arrive [s]; by default eight times as long as the last motion of the
            sample takes.
        seed: of the sampler, by default its own.
        method: of integration, with a fixed step that a sample chooses; "radau5" where motion is stiff.
        threads: threads to use, all processors by default. The result does not depend on it.
        progress: called with the number of starts that are done since the last call.

    Returns:
        attractors and labels. A start is captured when two runs with different steps stay together until both
        have come into a region about the same attractor in which the map over its period was measured to
        contract (of a system's place of rest a ball that it is proved to attract, where the function can be
        called with symbols and the measured one is not larger, as where it attracts hardly), or have visited
        the cells of a torus or of chaos 24 times in a row. It is
        ``unsure`` where they come apart with the finest steps too (captured, if all six runs of all such
        starts, at least 16, arrive at one attractor), ``escaped`` where it goes a thousand times
        as far as motions do or where the system's stopping condition ends it, ``out_of_range`` where it
        leaves the range of a mechanism's coordinate, ``undecided`` where it has not arrived by ``t_end``, or
        moves on without coming back to the system's section.

    Raises:
        InputError: an argument is wrong, the system depends on the time and has no period or another one, or
            it preserves volume, so that nothing attracts.
    """
    require_flow(system)
    y = checks.starts("starts", starts, system.state, n=n, seed=seed, default=STARTS)
    checks.progress_function(progress, "starts")
    checks.warn_of_turns("starts", y, [system.state.index(name) for name in angles_of(system)])
    if t_end is not None:
        t_end = checks.number("t_end", t_end, "s", above=0.0)
    return labelled(search_of(system, y, method, threads), y, t_end, progress)


def search_of(
    system: System | Mechanism, starts: Floats, method: str = "dop853", threads: int | None = None
) -> Search:
    """Attractors that a sample of starts (n, dim) comes to; errors as for :func:`find_attractors`."""
    usable = np.flatnonzero(np.isfinite(starts).all(axis=1))
    if not usable.size:
        raise InputError("starts: none is finite")
    sample = starts[usable[np.unique(np.linspace(0, usable.size - 1, SAMPLE).astype(np.int64))]]
    flow = flow_of(system, sample, {}, method, threads)
    if _preserves_volume(flow, sample[:PRESERVING]):
        raise InputError("system: preserves volume, so that nothing attracts; give it some damping")
    search = Search(flow)
    search.look(sample)
    return search


def _preserves_volume(flow: Flow, y: Floats) -> bool:
    """Whether volume about most motions from y (n, dim) neither grows nor shrinks in the long run.

    Where all states are angles motions stay in any case: only volume that never changes is then preserved.
    """
    times, n = np.arange(OVER * DENSE) / DENSE, len(y)
    total, size = np.zeros((2, n)), np.zeros((2, n))  # of the earlier half and the later one
    for k, states in enumerate(np.concatenate([y[None], flow.run(y, times[1:]).y])):
        slopes = flow.slopes(states, float(times[k] * flow.period))
        divergence = np.trace(slopes, axis1=1, axis2=2) * flow.period
        half = 2 * k // len(times)
        total[half], size[half] = total[half] + divergence, size[half] + np.abs(divergence)
    known = np.isfinite(total).all(axis=0)
    changes = size if flow.angles.all() else np.abs(total) - BALANCE * size
    balance = changes.max(axis=0)[known] / (len(times) / 2)
    return bool(np.median(balance) < ROUNDING) if known.any() else False


def labelled(
    search: Search, starts: Floats, t_end: float | None, progress: Progress | None = None
) -> Attractors:
    """Labels of starts by the attractors of a search, and by those that turn up on the way."""
    flow, search.only_end = search.flow, -1
    for attempt in range(ROUNDS):
        periods = min(max(LATER * search.latest, FEWEST), MOST)
        if t_end is not None:
            periods = max(1, math.ceil(t_end / flow.period))
        ends = settle(search, starts, periods, progress if attempt == 0 else None)
        if attempt == ROUNDS - 1:
            break
        before = search.changes
        if len(ends.last):
            search.look(ends.last)
        search.leave_transients()
        if search.changes == before:
            break
    search.only_end = only_end(search, starts, ends, periods)
    ends = by_only_end(search, ends)
    every = [_of_orbit(flow, orbit, ball) for orbit, ball in search.orbits]
    every += [_of_cloud(flow, cloud) for cloud in search.clouds]
    found = np.bincount(ends.label[ends.label >= 0], minlength=len(every))
    unranked = Attractors(
        attractors=tuple(replace(one, found=int(k)) for one, k in zip(every, found, strict=True)),
        label=ends.label,
        status=ends.status,
        time=ends.time,
        names=tuple(flow.scene.state),
        t_end=periods * flow.period,
        looks=flow.period,
        dt=search.flow.period / search.flow.steps,
        scale=flow.scale,
        cell=None if not search.clouds else np.max([cloud.size for cloud in search.clouds], axis=0),
        steps=ends.steps,
        search=search,
        rank=np.append(np.arange(len(every)), -1),
    )
    return unranked.ranked(found)[0]


def within_turn(flow: Flow, points: Floats) -> Floats:
    """The same with angles between -pi and pi."""
    return np.where(flow.angles, flow.away(points, np.zeros_like(points)), points)


def _of_cloud(flow: Flow, cloud: Cloud) -> Attractor:
    kind = "chaos" if cloud.exponent > 3.0 * cloud.error else "torus"
    if kind == "chaos" and flow.planar:
        kind = "saddle cycle"  # in a plane there is no chaos (Poincare, Bendixson)
    if cloud.continuum:
        kind = "continuum"
    elif cloud.still:
        kind = "fixed point" if is_rest(flow, cloud.points[0]) else "periodic"
    return Attractor(
        kind,
        within_turn(flow, cloud.points),
        None if cloud.period is None else cloud.period * flow.period,
        None,
        None,
        exponent=cloud.exponent,
        exponent_error=cloud.error,
    )


def _of_orbit(flow: Flow, orbit: Orbit, ball: Balls) -> Attractor:
    rest = orbit.periods == 0.0
    over = flow.period * (orbit.periods or 1.0)
    passages = isinstance(flow, SectionFlow)
    if isinstance(flow, SectionFlow):
        over = float(flow.passages(orbit.points[:1], np.array([orbit.periods]), FINER)[1][0])
    growth, error, multipliers = exponent(flow, orbit)
    return Attractor(
        kind="fixed point" if rest else "periodic",
        points=within_turn(flow, orbit.points),
        period=None if rest else over,
        forcing_periods=round(orbit.periods) if flow.forced and not passages else None,
        multipliers=multipliers,
        exponent=growth,
        exponent_error=error,
        residual=orbit.residual,
        radius=ball.radius,
        proof=ball.proof,
    )
