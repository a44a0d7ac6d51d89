"""Who ends at which attractor: motions run until they have arrived, each with two lengths of steps.

A label counts where both runs arrive at the same attractor and have stayed together on the way. Where they
have not, a disturbance as small as the steps' error has grown, and the motions run again with finer steps, as
do those that escaped, once: steps that are too long send a motion away. Cells of the second run are twice as
wide. Motions that still come apart are unsure, unless every run of every such motion of the starts that were
searched arrives at one and the same attractor: chaos that passes has but this one end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Flags, Floats, Integers
from fastmech.attractors.arrival import owners
from fastmech.attractors.flow import COARSER, statuses
from fastmech.attractors.search import FEWEST, HELD, Search
from fastmech.ensembles.run import Progress
from fastmech.ensembles.status import Status
from fastmech.jit import working

#: How much finer the steps of both runs are in each repetition.
REPEATED = (1.0, 2.0, 4.0)

#: Statuses of motions that run again, once.
LOST = (Status.ESCAPED, Status.OUT_OF_RANGE, Status.NOT_FINITE)

#: Distance over the scale that the two runs may have before they arrive: in chaos the true error may be
#: several times as large, and has to stay small.
TOGETHER = 0.002

#: Visits of a cloud's cells in a row after which a motion has arrived there.
VISITS = 24

#: Motions that come apart at least, before it is believed that all such end at one attractor; how far beside
#: few such starts, over the scale, others are asked too.
MANY, BESIDE = 16, 0.02

#: Motions followed together at most: the states of a piece are all that is held of them.
CHUNK = 1 << 15

#: Periods of a piece at most, and share of those passed.
PIECE, SHARE = 64, 8


class Ends(NamedTuple):
    """Where n motions end."""

    label: Integers  #: number of the attractor (orbits, then clouds), -1: none
    status: NDArray[np.int8]  #: CAPTURED, UNSURE, UNDECIDED, START_NOT_FINITE or one of :data:`LOST`
    time: Floats  #: of arrival, a look's [s], of the finer run if they come apart; NaN: not arrived
    last: Floats  #: states of some that are undecided (m, dim)
    steps: int  #: of all motions together
    agreed: Integers  #: where all runs arrive of those that come apart, -1: at several (n,)

    @property
    def well(self) -> Integers:
        """The labels, as measures of basins take them."""
        return self.label


class _Run:
    """One of the two runs of some motions."""

    def __init__(self, search: Search, y: Floats, finer: float, wider: float) -> None:
        self.search, self.finer, self.y = search, finer, y
        self.cells = search.cells(wider)
        n = len(y)
        self.label = np.full(n, -1, dtype=np.int64)
        self.status = np.full(n, Status.OK, dtype=np.int8)
        self.visits, self.owner = np.zeros(n, dtype=np.int64), np.full(n, -1, dtype=np.int64)

    def advance(self, active: Integers, periods: int) -> Floats:
        """Take motions on by so many periods, label those that arrive or end.

        Their states after each period (periods, n, dim).
        """
        flow = self.search.flow
        reached = flow.run(self.y[active], np.arange(1.0, periods + 1.0), self.finer)
        self.y[active] = reached.y[-1]
        self.status[active] = np.where(self.label[active] < 0, statuses(flow, reached), self.status[active])
        if self.cells is not None:
            orbits = len(self.search.orbits)
            for states in reached.y:
                now = owners(flow, self.cells, states)
                same = (now >= 0) & (now == self.owner[active])
                self.visits[active] = np.where(same, self.visits[active] + 1, (now >= 0).astype(np.int64))
                self.owner[active] = now
                done = (self.visits[active] >= VISITS) & (self.label[active] < 0)
                self.label[active[done]] = orbits + now[done]
        ball = self.search.arrived(reached.y[-1])
        new = (ball >= 0) & (self.label[active] < 0)
        self.label[active[new]] = ball[new]
        return reached.y

    @property
    def ended(self) -> Flags:
        """Who has arrived, escaped or failed."""
        return (self.label >= 0) | (self.status != Status.OK)


def settle(search: Search, starts: Floats, periods: int, progress: Progress | None = None) -> Ends:
    """Follow starts (n, dim) for so many periods at most."""
    flow, n = search.flow, len(starts)
    label, status = np.full(n, -1, dtype=np.int64), np.full(n, Status.UNDECIDED, dtype=np.int8)
    time, last, steps = np.full(n, np.nan), [np.empty((0, starts.shape[1]))], 0
    agreed = np.full(n, -1, dtype=np.int64)
    chunk = max(FEWEST, min(CHUNK, HELD // (2 * PIECE * starts.shape[1])))
    with working(f"following {n:,} starts") as say:
        for first in range(0, n, chunk):
            members = np.arange(first, min(n, first + chunk))
            done, told = members.size, 0

            def tell(count: int) -> None:
                nonlocal told
                told += count
                if progress is not None and count:
                    progress(count)

            for finer in REPEATED:
                if not members.size:
                    break
                found, apart, undecided = _together(search, starts[members], periods, finer, tell)
                for own, new in ((label, found.label), (status, found.status), (time, found.time)):
                    own[members] = new
                every = finer == REPEATED[0]
                agreed[members] = np.where(every | (agreed[members] == found.agreed), found.agreed, -1)
                steps += found.steps
                last.append(undecided[: max(0, 256 - sum(map(len, last)))])
                lost = np.isin(found.status, LOST) & every
                members = members[apart | lost]
            tell(done - told)
            say(f"following {n:,} starts, {first + done:,} done")
    return Ends(label, status, time * flow.period, np.concatenate(last), steps, agreed=agreed)


def only_end(search: Search, starts: Floats, ends: Ends, periods: int) -> int:
    """The one attractor at which all runs of motions that come apart arrive, -1: there is no such one.

    If few starts (n, dim) come apart, others beside them are asked as well.
    """
    apart = ends.status == Status.UNSURE
    unsure = ends.agreed[apart]
    if 0 < unsure.size < MANY:
        beside = np.random.default_rng(0).uniform(-1.0, 1.0, (4 * MANY, starts.shape[1]))
        more = np.resize(starts[apart], beside.shape) + BESIDE * search.flow.scale * beside
        found = settle(search, more, periods)
        unsure = np.concatenate([unsure, found.agreed[found.status == Status.UNSURE]])
    return int(unsure[0]) if unsure.size >= MANY and (unsure == unsure[0]).all() else -1


def by_only_end(search: Search, ends: Ends) -> Ends:
    """Motions that come apart labelled by the only end that such motions have, if there is one."""
    known = (ends.status == Status.UNSURE) & (ends.agreed == search.only_end) & (ends.agreed >= 0)
    return ends._replace(
        label=np.where(known, ends.agreed, ends.label),
        status=np.where(known, Status.CAPTURED, ends.status).astype(np.int8),
        time=np.where(known | (ends.label >= 0), ends.time, np.nan),
    )


def _together(
    search: Search, starts: Floats, periods: int, finer: float, tell: Progress
) -> tuple[Ends, Flags, Floats]:
    """Two runs side by side; also who came apart (n,), and states of those that are undecided.

    ``tell`` is called with how many have arrived since the last call.
    """
    flow, n = search.flow, len(starts)
    ok = np.isfinite(starts).all(axis=1)
    fine, coarse = _Run(search, starts.copy(), finer, 1.0), _Run(search, starts.copy(), COARSER * finer, 2.0)
    active, passed, steps = np.flatnonzero(ok), 0, 0
    distance, begun, farthest = np.zeros(n), np.zeros(n), np.zeros(n)
    apart = np.zeros(n, dtype=np.bool_)
    time = np.full(n, np.nan)
    while active.size and passed < periods:
        piece = min(max(1, passed // SHARE), PIECE, periods - passed)
        visiting = fine.visits[active] > 0
        pair = [run.advance(active, piece) for run in (fine, coarse)]
        passed += piece
        steps += int(active.size * piece * flow.steps * finer * (1.0 + COARSER))
        with np.errstate(invalid="ignore"):
            gaps = np.nan_to_num(flow.distance(*pair), nan=0.0)
        now, farthest[active] = gaps[-1], np.maximum(farthest[active], gaps.max(axis=0))
        counts = ~fine.ended[active] | np.isnan(time[active])
        distance[active] = np.where(counts, np.maximum(distance[active], now), distance[active])
        begun[active] = np.where(visiting & (fine.visits[active] > 0), begun[active], distance[active])
        time[active] = np.where(fine.ended[active] & np.isnan(time[active]), passed, time[active])
        both = fine.ended[active] & coarse.ended[active]
        cloud = fine.label[active] >= len(search.orbits)
        grown = np.where(cloud, begun[active], farthest[active])
        differ = (fine.label[active] != coarse.label[active]) | (grown > TOGETHER)
        differ |= fine.status[active] != coarse.status[active]
        gone = both & (fine.label[active] < 0) & (fine.status[active] == coarse.status[active])
        apart[active] = both & differ & ~gone
        tell(int(np.count_nonzero(both & ~differ & ~gone)))
        active = active[~both]
    fine.label[active] = -1
    label, agreed = np.where(apart, -1, fine.label), np.where(fine.label == coarse.label, fine.label, -1)
    status = np.where(label >= 0, Status.CAPTURED, fine.status)
    status = np.where(apart, Status.UNSURE, np.where(status == Status.OK, Status.UNDECIDED, status))
    status[active] = Status.UNDECIDED
    status[~ok] = Status.START_NOT_FINITE
    time[fine.label < 0] = np.nan
    ends = Ends(label, status.astype(np.int8), time, starts[:0], steps, agreed=agreed)
    return ends, apart, fine.y[active]
