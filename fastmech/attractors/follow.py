"""``fm.follow_basins``: attractors and their shares of the starts along a parameter.

An attractor goes on at the next value in the one that lies next to it. One that has none is followed there in
steps, by Newton's method and by motions that begin on it, each as short as it takes to find it again: it has
moved, no start ends there any more, or steps become ever shorter before a value where it is gone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from fastmech.attractors.find import Attractor, Attractors, find_attractors
from fastmech.attractors.flow import Floats, Flow, flow_of
from fastmech.attractors.search import Search
from fastmech.ensembles import checks
from fastmech.ensembles.run import Progress
from fastmech.ensembles.system import System
from fastmech.errors import InputError, shown
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Drawn
from fastmech.samplers import Starts
from fastmech.scene import nearest

Integers = NDArray[np.int64]

#: Starts by default.
STARTS = 1000

#: Points of an attractor from which motions begin, distance over the scale within which it is the same,
#: and halvings of the step to where it comes or goes.
SEEDS, NEAR, HALVINGS = 16, 0.05, 12


class Tipping(NamedTuple):
    """An attractor that comes or goes."""

    attractor: int  #: its number
    kind: str  #: "born" or "dies", in the order of the values
    low: float  #: of the parameter: it happens between low and high
    high: float


@dataclass(frozen=True, repr=False)
class BasinsAlong(Drawn):
    """Attractors along a parameter; printed, which come and go where."""

    parameter: str
    values: Floats  #: of the parameter (m,)
    fractions: (
        Floats  #: share of the starts that ends at each attractor (m, attractors), NaN: it is not there
    )
    unlabelled: Floats  #: share that escapes, is unsure, undecided or not finite (m,)
    attractors: tuple[dict[int, Attractor], ...]  #: at each value, by number
    tipping: tuple[Tipping, ...]

    KIND = "follow_basins"
    PICTURE = "plots.response:draw_fractions"
    LAYOUT = "scan_types.follow_basins:along_dataset"

    def told(self) -> str:
        """Which attractors come and go where."""
        first, last, n = self.values[0], self.values[-1], self.fractions.shape[1]
        lines = [
            f"{n} attractors along {self.parameter} = {first:g} ... {last:g} ({self.values.size} values)"
        ]
        for t in self.tipping[:5]:
            lines.append(f"  {t.attractor} {t.kind} between {self.parameter} = {t.low:.6g} and {t.high:.6g}")
        if len(self.tipping) > 5:
            lines[-1] = f"  and {len(self.tipping) - 4} more"
        return "\n".join(lines)


def follow_basins(
    system: System | Mechanism,
    parameter: str,
    values: ArrayLike,
    starts: Starts,
    n: int | None = None,
    *,
    t_end: float | None = None,
    seed: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> BasinsAlong:
    """Attractors and basin fractions along a parameter.

    Args:
        system: a system of your own or a mechanism.
        parameter: its name.
        values: of it, rising or falling.
        starts: as for :func:`fastmech.find_attractors`, the same at every value.
        n: how many starts, by default the sampler's, or 1,000; of states given all.
        t_end: how long a motion has to arrive [s].
        seed: of the sampler, by default its own.
        threads: threads to use, all processors by default.
        progress: is told 1 after each value.

    Raises:
        InputError: an argument is wrong.
    """
    if not isinstance(system, System | Mechanism):
        raise InputError(f"system = {shown(system)}: must be a System or a Mechanism")
    if parameter not in system.parameters:
        raise InputError(f"parameter: {nearest(str(parameter), list(system.parameters))}")
    along = checks.reals("values", values, "real numbers")
    steps = np.diff(along)
    if along.ndim != 1 or along.size < 2 or not (np.all(steps > 0.0) or np.all(steps < 0.0)):
        raise InputError("values: must be two or more rising or falling numbers")
    checks.progress_function(progress, "values")
    y = checks.starts("starts", starts, system.state, n=n, seed=seed, default=STARTS)
    tracer = _Tracer(system, parameter, y, threads)
    numbered: list[dict[int, Attractor]] = []
    shares: list[dict[int, float]] = []
    tipping, count = [], 0
    for k, value in enumerate(along.tolist()):
        found = find_attractors(system.replace(**{parameter: value}), y, t_end=t_end, threads=threads)
        before = numbered[-1] if numbered else {}
        names = matched(found, before)
        now = {names[j]: found[j] for j in names}
        share = {names[j]: float(found.fractions[j]) for j in names}
        for number in set(before) - set(now):
            there, gone, last = tracer.follow(before[number], along[k - 1], value)
            if gone is None:  # it has moved, or no start ends there
                now[number], share[number] = last, 0.0
                for j in set(range(len(found))) - set(names):
                    if _apart(found.search.flow, found[j].points, last.points) < NEAR:
                        names[j], now[number], share[number] = number, found[j], float(found.fractions[j])
            else:
                tipping.append(Tipping(number, "dies", *sorted((there, gone))))
        for j in sorted(set(range(len(found))) - set(names)):
            now[count], share[count] = found[j], float(found.fractions[j])
            last = found[j]
            for kk in range(k - 1, -1, -1):
                there, gone, last = tracer.follow(last, along[kk + 1], along[kk])
                if gone is not None:
                    tipping.append(Tipping(count, "born", *sorted((there, gone))))
                    break
                numbered[kk][count], shares[kk][count] = last, 0.0
            count += 1
        numbered.append(now)
        shares.append(share)
        if progress is not None:
            progress(1)
    table = np.array([[share.get(j, np.nan) for j in range(count)] for share in shares])
    missing = 1.0 - np.nansum(table, axis=1)
    followed = BasinsAlong(parameter, along, table, missing, tuple(numbered), tuple(tipping))
    return followed.of(system)


def matched(found: Attractors, before: Mapping[int, Attractor]) -> dict[int, int]:
    """Numbers of earlier attractors by index of those found now that lie next to them."""
    if not before or not len(found):
        return {}
    flow, numbers = found.search.flow, list(before)
    away = np.array([[_apart(flow, new.points, before[k].points) for k in numbers] for new in found])
    rows, columns = linear_sum_assignment(away)
    return {int(j): numbers[k] for j, k in zip(rows, columns, strict=True) if away[j, k] < NEAR}


class _Tracer(NamedTuple):
    """Follows an attractor over the parameter; the sample (n, dim) of starts tells the scale."""

    system: System | Mechanism
    parameter: str
    sample: Floats
    threads: int | None

    def follow(self, attractor: Attractor, there: float, end: float) -> tuple[float, float | None, Attractor]:
        """From where it is there towards an end: the last value where it is, the first where not, and it.

        None in place of the first where not: it is there at the end.
        """
        step = end - there
        least = abs(step) / 2.0**HALVINGS
        while abs(step) > least:
            value = there + step if abs(end - there) > 1.5 * abs(step) else end
            places, flow = self._at(attractor, value)
            away = [_apart(flow, points, attractor.points) for points in places]
            if away and min(away) < NEAR:
                there, attractor = value, replace(attractor, points=places[int(np.argmin(away))])
                if value == end:
                    return there, None, attractor
            else:
                step *= 0.5  # gone, or too far for Newton's method
        return there, there + 2.0 * step, attractor

    def _at(self, attractor: Attractor, value: float) -> tuple[list[Floats], Flow]:
        """Points of the attractors that are found from it at a value."""
        system, seeds = self.system.replace(**{self.parameter: value}), _seeds(attractor)
        search = Search(flow_of(system, self.sample, {}, threads=self.threads))
        search.seek(seeds[:1], attractor.period)
        if not search.count:
            search.look(seeds)
        return [o.points for o, _ in search.orbits] + [c.points for c in search.clouds], search.flow


def _seeds(attractor: Attractor) -> Floats:
    points = attractor.points
    return points[np.unique(np.linspace(0, len(points) - 1, SEEDS).astype(np.int64))]


def _apart(flow: Flow, a: Floats, b: Floats) -> float:
    """How far points of two attractors lie from the other's nearest ones, over the scale, on average."""
    one, two = (points[:: max(1, len(points) // 512)] for points in (a, b))
    distance = flow.distance(one[:, None], two)
    return float(max(distance.min(axis=0).mean(), distance.min(axis=1).mean()))


def tipping_probabilities(before: ArrayLike, after: ArrayLike) -> Floats:
    """Share (i, j) of the starts with label i before that have label j after a sudden change.

    Labels are whole numbers from 0 on of the same starts, of any one shape, negative without a label. The
    last column is the share without one after (Kaszas, Feudel, Tel, Scientific Reports 9 (2019) 8654).

    Raises:
        InputError: labels are no whole numbers, or of different shapes.
    """
    one, two = np.asarray(before), np.asarray(after)
    for name, labels in (("before", one), ("after", two)):
        if not np.issubdtype(labels.dtype, np.integer) or labels.shape != one.shape:
            raise InputError(f"{name}: must be whole numbers, both of the same shape")
    rows, columns = int(one.max(initial=-1)) + 1, int(two.max(initial=-1)) + 1
    known = one >= 0
    table = np.zeros((rows, columns + 1))
    np.add.at(table, (one[known], np.where(two[known] < 0, columns, two[known])), 1.0)
    with np.errstate(invalid="ignore"):
        return np.asarray(table / table.sum(axis=1, keepdims=True))
