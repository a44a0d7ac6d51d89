"""``fm.follow_basins``: attractors and their shares of the starts along one parameter or over two.

An attractor goes on at the next value in the one that lies next to it. One that has none is followed there in
steps, by Newton's method and by motions that begin on it, each as short as it takes to find it again: it has
moved, no start ends there any more, or steps become ever shorter before a value where it is gone.

Over two parameters lines along the first are joined in the same way along the second. Two attractors of lines
next to each other become one at the values of the first parameter where one goes on in the other; what has
most such values is joined first, and never two that are there together: around a cusp one goes on in both.
Where one is there on a line and not on the next, it is followed towards it along the second parameter.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from fastmech.arrays import Floats
from fastmech.attractors.arrival import SLOW
from fastmech.attractors.find import Attractor, find_attractors
from fastmech.attractors.flow import Flow, flow_at, flow_of, require_flow, require_parameter, spread
from fastmech.attractors.orbits import Orbit
from fastmech.attractors.search import LEFT, Search
from fastmech.ensembles import checks
from fastmech.ensembles.run import Progress
from fastmech.ensembles.system import System
from fastmech.errors import InputError, shown
from fastmech.jit import working
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Drawn, counted
from fastmech.samplers import Starts

#: Starts by default.
STARTS = 1000

#: Points of an attractor from which motions begin, distance over the scale within which it is the same,
#: and halvings of the step to where it comes or goes.
SEEDS, NEAR, HALVINGS = 16, 0.05, 12

#: Attractors that lie nearer, over the scale, have become one.
ONE = 1e-3

#: How far from an orbit that has begun to repel motions begin, over the scale.
ASIDE = 0.005

#: The same where lines are joined, which does not ask where it comes or goes.
JOINING = 7


class Tipping(NamedTuple):
    """An attractor that comes or goes."""

    attractor: int  #: its number
    kind: str  #: "born" or "dies", in the order of the values
    low: float  #: of the parameter: it happens between low and high
    high: float


class AttractorPlace(NamedTuple):
    """What an attractor is followed by."""

    points: Floats  #: (m, dim)
    period: float | None  #: s; None: it rests, or is no orbit


#: What is followed: as it was found, or from value to value without a look at where starts end.
There: TypeAlias = Attractor | AttractorPlace


@dataclass(frozen=True, repr=False)
class BasinsAlong(Drawn):
    """Attractors along a parameter; printed, which come and go where."""

    parameter: str
    values: Floats  #: of the parameter (m,)
    fractions: Floats  #: share of the starts at each attractor (m, attractors), NaN: it is not there
    unlabelled: Floats  #: share that escapes, is unsure, undecided or not finite (m,)
    attractors: tuple[Mapping[int, There], ...]  #: at each value, by number
    tipping: tuple[Tipping, ...]
    starts: int  #: at each value

    KIND = "follow_basins"
    PICTURE = "plots.response:draw_fractions"
    LAYOUT = "scan_types.follow_basins:basins_dataset"

    def told(self) -> str:
        """Which attractors come and go where."""
        first, last, n = self.values[0], self.values[-1], self.fractions.shape[1]
        lines = [
            f"{counted(n, 'attractor')} along {self.parameter} = {first:g} ... {last:g} "
            f"({self.values.size} values)"
        ]
        shown = 5 - min(3, len(self.changes))
        for t in self.tipping[:shown]:
            lines.append(f"  {t.attractor} {t.kind} between {self.parameter} = {t.low:.6g} and {t.high:.6g}")
        if len(self.tipping) > shown:
            lines[-1] = f"  and {len(self.tipping) - shown + 1} more that come or go"
        lines += [
            f"  {k} from {before} to {after} between {self.parameter} = {low:.6g} and {high:.6g}"
            for k, before, after, low, high in self.changes[:3]
        ]
        if len(self.changes) > 3:
            lines[-1] = f"  and {len(self.changes) - 2} more that go on as another kind"
        return "\n".join(lines)

    @property
    def changes(self) -> list[tuple[int, str, str, float, float]]:
        """Attractors that go on as another kind, or with another period: number, before, after, between."""
        found = []
        for k, (one, two) in enumerate(pairwise(self.attractors)):
            for number in sorted(set(one) & set(two)):
                before, after = (_kind(there[number]) for there in (one, two))
                if before != after:
                    found.append((number, before, after, float(self.values[k]), float(self.values[k + 1])))
        return found


def _kind(one: There) -> str:
    if isinstance(one, AttractorPlace):
        return "no periodic motion" if one.period is None else "periodic"
    periods = one.forcing_periods
    return one.kind if periods is None else f"period {periods} of the forcing"


@dataclass(frozen=True, repr=False)
class BasinsOver(Drawn):
    """Attractors over two parameters, which keep their numbers over both; printed, how many come and go."""

    second: str  #: the second parameter
    values: Floats  #: of it (lines,)
    lines: tuple[BasinsAlong, ...]  #: along the first one, at each value of the second
    tipping: tuple[tuple[Tipping, ...], ...]  #: along the second one, at each value of the first

    @property
    def fractions(self) -> Floats:
        """Share of the starts that ends at each attractor (lines, m, attractors), NaN: it is not there."""
        return np.stack([line.fractions for line in self.lines])

    KIND = "follow_basins"
    PICTURE = "plots.response:draw_numbers"
    LAYOUT = "scan_types.follow_basins:basins_dataset"

    def told(self) -> str:
        """How many attractors there are, and how many come and go."""
        lines, m, number = self.fractions.shape
        first, tips = self.lines[0].parameter, [len(line.tipping) for line in self.lines]
        return (
            f"{counted(number, 'attractor')} over {first} and {self.second} ({m} x {lines} values)\n"
            f"  one comes or goes {sum(tips)} times along {first}, {sum(map(len, self.tipping))} times"
            f" along {self.second}"
        )


def follow_basins(
    system: System | Mechanism,
    parameter: str,
    values: ArrayLike,
    starts: Starts,
    n: int | None = None,
    *,
    each: Mapping[str, ArrayLike] | None = None,
    t_end: float | None = None,
    seed: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> BasinsAlong | BasinsOver:
    """Attractors and basin fractions along a parameter, or over two.

    Where an attractor splits into two, as at a pitchfork, one of them goes on under its number.
    Chaos counts as there while 64 motions on it stay for 1,024 periods: before a crisis it comes earlier.

    Args:
        system: a system of your own or a mechanism.
        parameter: its name.
        values: of it, rising or falling.
        starts: as for :func:`fastmech.find_attractors`, the same at every value.
        n: how many starts, by default the sampler's, or 1,000; of states given all.
        each: a second parameter and its values: the same at each of them, and attractors have the same
            numbers where they go on in each other.
        t_end, seed, threads: as for :func:`fastmech.find_attractors`.
        progress: called with 1 after each value.

    Raises:
        InputError: an argument is wrong.
    """
    require_flow(system)
    require_parameter(system, parameter)
    along = _rising("values", values)
    checks.progress_function(progress, "values")
    y = checks.starts("starts", starts, system.state, n=n, seed=seed, default=STARTS)
    followed = partial(
        _followed, parameter=parameter, along=along, y=y, t_end=t_end, threads=threads, progress=progress
    )
    if each is None:
        with working(f"following attractors along {parameter}"):
            return followed(system)
    if not isinstance(each, Mapping) or len(each) != 1 or {parameter} & set(each):
        raise InputError(f"each = {shown(each)}: must map one other parameter to its values")
    ((second, others),) = each.items()
    checks.one_of("each", second, system.parameters)
    across = _rising(f"each.{second}", others)
    with working(f"following attractors over {parameter} and {second}"):
        lines = [followed(system.replace(**{second: value})) for value in across.tolist()]
        return joined(system, second, across, lines, y, threads=threads).of(system)


def _rising(name: str, values: ArrayLike) -> Floats:
    along = checks.reals(name, values, "real numbers")
    if along.ndim != 1 or along.size < 2:
        raise InputError(f"{name}: must be two or more rising or falling numbers")
    checks.one_way(name, values, along)
    return along


def _followed(
    system: System | Mechanism,
    parameter: str,
    along: Floats,
    y: Floats,
    t_end: float | None,
    threads: int | None,
    progress: Progress | None,
) -> BasinsAlong:
    """Along one parameter, from starts (n, dim)."""
    tracer = _Tracer(system, parameter, y, threads)
    numbered: list[dict[int, Attractor]] = []
    shares: list[dict[int, float]] = []
    tipping, count = [], 0
    for k, value in enumerate(along.tolist()):
        found = find_attractors(system.replace(**{parameter: value}), y, t_end=t_end, threads=threads)
        before = numbered[-1] if numbered else {}
        names = matched(found.search.flow, dict(enumerate(found)), before)
        now = {names[j]: found[j] for j in names}
        share = {names[j]: float(found.fractions[j]) for j in names}
        for number in sorted(set(before) - set(now)):
            there, gone, place = tracer.follow(before[number], along[k - 1], value)
            joins = None if gone is not None else _which(found.search.flow, now, place.points, ONE)
            if joins is not None and joins in before:
                there, gone = tracer.parting(before[number], before[joins], along[k - 1], value)
            if gone is None:  # it has moved, or no start ends there
                now[number], share[number] = replace(before[number], **place._asdict()), 0.0
                left = {j: found[j] for j in sorted(set(range(len(found))) - set(names))}
                j = _which(found.search.flow, left, place.points, NEAR)
                if j is not None:
                    names[j], now[number], share[number] = number, found[j], float(found.fractions[j])
            else:
                tipping.append(Tipping(number, "dies", *sorted((there, gone))))
        for j in sorted(set(range(len(found))) - set(names)):
            now[count], share[count] = found[j], float(found.fractions[j])
            last = found[j]
            for kk in range(k - 1, -1, -1):
                there, gone, place = tracer.follow(last, along[kk + 1], along[kk])
                joins = (
                    None if gone is not None else _which(found.search.flow, numbered[kk], place.points, ONE)
                )
                if joins is not None:
                    other = (numbered[kk + 1] if kk + 1 < k else now).get(joins)
                    there, gone = along[kk + 1], along[kk]
                    if other is not None:
                        there, gone = tracer.parting(last, other, there, gone)
                if gone is not None:
                    tipping.append(Tipping(count, "born", *sorted((there, gone))))
                    break
                last = replace(last, **place._asdict())
                numbered[kk][count], shares[kk][count] = last, 0.0
            count += 1
        numbered.append(now)
        shares.append(share)
        if progress is not None:
            progress(1)
    table = np.array([[share.get(j, np.nan) for j in range(count)] for share in shares])
    missing = 1.0 - np.nansum(table, axis=1)
    followed = BasinsAlong(
        parameter, along, table, missing, tuple(numbered), tipping=tuple(tipping), starts=len(y)
    )
    return followed.of(system)


def joined(
    system: System | Mechanism,
    second: str,
    across: Floats,
    lines: Sequence[BasinsAlong],
    y: Floats,
    threads: int | None = None,
) -> BasinsOver:
    """Lines at each value of a second parameter with numbers in common; y (n, dim) are their starts."""
    along, votes = lines[0].values, Counter[tuple[tuple[int, int], tuple[int, int]]]()
    for k in range(1, len(lines)):
        middle = {second: float(across[k]), lines[0].parameter: float(along[along.size // 2])}
        flow = flow_of(system, y, middle, threads=threads)
        for before, now in zip(lines[k - 1].attractors, lines[k].attractors, strict=True):
            for number, old in matched(flow, now, before).items():
                votes[(k - 1, old), (k, number)] += 1
        alone = _where(lines[k - 1]).keys() - {one[1] for one, two in votes if two[0] == k}
        for number in sorted(alone):  # it moves further than matching sees
            both = [i for i in _where(lines[k - 1])[number] if lines[k].attractors[i]]
            for i in dict.fromkeys(both[m] for m in (len(both) // 2, 0, -1)[: len(both)]):
                if any(one == (k - 1, number) for one, _ in votes):
                    break
                moved_to = system.replace(**{lines[0].parameter: float(along[i])})
                tracer = _Tracer(moved_to, second, y, threads, JOINING)
                last = lines[k - 1].attractors[i][number]
                _, gone, place = tracer.follow(last, float(across[k - 1]), float(across[k]))
                moved = {number: place} if gone is None else {}
                for found in matched(flow, lines[k].attractors[i], moved):
                    votes[(k - 1, number), (k, found)] += 1
    group = {
        (k, j): {(k, j, i) for i in places}
        for k in range(len(lines))
        for j, places in _where(lines[k]).items()
    }
    members = {one: [one] for one in group}
    for (one, two), _ in sorted(votes.items(), key=lambda vote: (-vote[1], vote[0])):
        first, other = members[one], members[two]
        taken = {(k, i) for node in first for k, _, i in group[node]}
        if first is not other and not taken & {(k, i) for node in other for k, _, i in group[node]}:
            first += other
            members |= dict.fromkeys(other, first)
    number_of: dict[int, int] = {}
    for node in sorted(group):
        number_of.setdefault(id(members[node]), len(number_of))
    renumbered = [
        _renumbered(line, {j: number_of[id(members[k, j])] for j in _where(line)}, len(number_of))
        for k, line in enumerate(lines)
    ]
    tipping = tuple(
        _tipping(
            _Tracer(system.replace(**{lines[0].parameter: value}), second, y, threads),
            across,
            [line.attractors[i] for line in renumbered],
        )
        for i, value in enumerate(along.tolist())
    )
    return BasinsOver(second, across, tuple(renumbered), tipping)


def _tipping(tracer: _Tracer, values: Floats, there: Sequence[Mapping[int, There]]) -> tuple[Tipping, ...]:
    """Where attractors with numbers come and go between values at which they are there."""
    found = []
    for k in range(1, len(there)):
        for kind, at, other in (("dies", k - 1, k), ("born", k, k - 1)):
            for number in sorted(set(there[at]) - set(there[other])):
                last, gone, _ = tracer.follow(there[at][number], float(values[at]), float(values[other]))
                if gone is not None:  # else it goes on in one with another number
                    found.append(Tipping(number, kind, *sorted((last, gone))))
    return tuple(found)


def _where(line: BasinsAlong) -> dict[int, list[int]]:
    """At which values of the first parameter each attractor is there."""
    numbers = sorted({j for there in line.attractors for j in there})
    return {j: [i for i, there in enumerate(line.attractors) if j in there] for j in numbers}


def _renumbered(line: BasinsAlong, numbers: Mapping[int, int], count: int) -> BasinsAlong:
    fractions = np.full((line.values.size, count), np.nan)
    for old, new in numbers.items():
        there = np.isfinite(line.fractions[:, old])
        fractions[there, new] = line.fractions[there, old]
    attractors: Any = tuple({numbers[j]: one for j, one in there.items()} for there in line.attractors)
    tipping = tuple(t._replace(attractor=numbers[t.attractor]) for t in line.tipping)
    return replace(line, fractions=fractions, attractors=attractors, tipping=tipping)


def matched(flow: Flow, found: Mapping[int, There], before: Mapping[int, There]) -> dict[int, int]:
    """Numbers of earlier attractors by those of attractors found now that lie next to them."""
    if not before or not found:
        return {}
    new, old = list(found), list(before)
    away = np.array([[_apart(flow, found[j].points, before[k].points) for k in old] for j in new])
    rows, columns = linear_sum_assignment(away)
    return {new[j]: old[k] for j, k in zip(rows, columns, strict=True) if away[j, k] < NEAR}


class _Tracer(NamedTuple):
    """Follows an attractor over the parameter; the sample (n, dim) of starts tells the scale."""

    system: System | Mechanism
    parameter: str
    sample: Floats
    threads: int | None
    halvings: int = HALVINGS

    def follow(
        self, attractor: There, there: float, end: float
    ) -> tuple[float, float | None, AttractorPlace]:
        """From where it is there towards an end: the last value where it is, the first where not, the place.

        None in place of the first where not: it is there at the end.
        """
        step, last = end - there, AttractorPlace(attractor.points, attractor.period)
        least = abs(step) / 2.0**self.halvings
        flow = flow_of(self.system, self.sample, {self.parameter: there}, threads=self.threads)
        flow = replace(flow, scale=np.maximum(flow.scale, spread(self.sample, flow.angles)))
        while abs(step) > least:
            value = there + step if abs(end - there) > 1.5 * abs(step) else end
            places, flow = self._at(last, flow_at(flow, {self.parameter: value}))
            away = [_apart(flow, one.points, last.points) for one in places]
            if away and min(away) < NEAR:
                there, last = value, places[int(np.argmin(away))]
                if value == end:
                    return there, None, last
            else:
                step *= 0.5  # gone, or too far for Newton's method
        return there, there + 2.0 * step, last

    def parting(self, one: There, other: There, there: float, end: float) -> tuple[float, float]:
        """Between which values two attractors become one that are apart at the first, as at a pitchfork."""
        for _ in range(self.halvings):
            middle = 0.5 * (there + end)
            (_, gone, first), (_, lost, second) = (self.follow(x, there, middle) for x in (one, other))
            flow = flow_of(self.system, self.sample, {self.parameter: middle}, threads=self.threads)
            if gone is None and lost is None and _apart(flow, first.points, second.points) > ONE:
                one, other, there = first, second, middle
            else:
                end = middle
        return there, end

    @staticmethod
    def _at(last: AttractorPlace, flow: Flow) -> tuple[list[AttractorPlace], Flow]:
        """A flow's attractors that are found from one at another value of the parameter."""
        points = last.points
        seeds = points[np.unique(np.linspace(0, len(points) - 1, SEEDS).astype(np.int64))]
        search = Search(flow)
        near = search.orbits_near(seeds[:1], last.period)
        plain = [o for o in near if np.abs(o.multipliers).max(initial=0.0) < SLOW]
        if plain:  # nobody arrives here, so that balls are not asked for
            return [_place(flow, o) for o in plain], flow
        for orbit in near:
            search.add(orbit)
        if not search.count and not search.neutral:  # from which motions would leave hardly
            if search.repelling:  # from beside it, as motions may take long to leave
                seeds = seeds + ASIDE * flow.scale * np.random.default_rng(0).uniform(-1.0, 1.0, seeds.shape)
            search.look(seeds)
        clouds = [c.points for c in search.clouds]
        if not flow.forced:  # what still circles a place of rest that repels has not left yet
            rests = [o.points for o in search.repelling if not o.cycle]
            clouds = [one for one in clouds if all(flow.distance(one, rest).max() > LEFT for rest in rests)]
        found = [_place(flow, o) for o, _ in search.orbits]
        return found + [AttractorPlace(one, last.period) for one in clouds], search.flow


def _place(flow: Flow, orbit: Orbit) -> AttractorPlace:
    return AttractorPlace(orbit.points, orbit.periods * flow.period if orbit.periods else None)


def _which(flow: Flow, known: Mapping[int, There], points: Floats, within: float) -> int | None:
    """Number of the first attractor whose points lie so near to given ones, over the scale."""
    return next((j for j, one in known.items() if _apart(flow, one.points, points) < within), None)


def _apart(flow: Flow, a: Floats, b: Floats) -> float:
    """How far points of two attractors lie from the other's nearest ones, over the scale, on average."""
    one, two = (points[:: max(1, len(points) // 512)] for points in (a, b))
    distance = flow.distance(one[:, None], two)
    return float(max(distance.min(axis=0).mean(), distance.min(axis=1).mean()))


def tipping_probabilities(before: Any, after: Any) -> Floats:
    """Share (i, j) of the starts with label i before that have label j after a sudden change.

    Labels are whole numbers from 0 on of the same starts, of any one shape, negative without a label, or what
    :func:`fastmech.find_attractors` or :func:`fastmech.map_basins` gives. The last column is the share
    without one after (Kaszas, Feudel, Tel, Scientific Reports 9 (2019) 8654).

    Raises:
        InputError: labels are no whole numbers, or of different shapes.
    """
    one, two = (np.asarray(getattr(labels, "well", labels)) for labels in (before, after))
    for name, labels in (("before", one), ("after", two)):
        if not np.issubdtype(labels.dtype, np.integer) or labels.shape != one.shape:
            raise InputError(f"{name}: must be whole numbers, both of the same shape")
    rows, columns = int(one.max(initial=-1)) + 1, int(two.max(initial=-1)) + 1
    known = one >= 0
    table = np.zeros((rows, columns + 1))
    np.add.at(table, (one[known], np.where(two[known] < 0, columns, two[known])), 1.0)
    with np.errstate(invalid="ignore"):
        return np.asarray(table / table.sum(axis=1, keepdims=True))
