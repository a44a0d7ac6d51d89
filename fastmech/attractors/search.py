"""Where motions of a sample settle: on orbits that Newton's method finds, or in cells that they fill.

The sample is followed over windows of periods, each twice as long as the one before. Motions that come back
near to where they were give guesses of orbits. What keeps visiting the same cells of a grid (Datseris and
Wagemakers, Chaos 32 (2022) 023104) and is no orbit is a torus or chaos: the largest Lyapunov exponent tells
which. An orbit may be found from any guess: who ends there is found out later, by running until arrival.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

from fastmech.arrays import Flags, Floats, Integers
from fastmech.attractors.arrival import (
    ArrivalCells,
    Balls,
    Cloud,
    balls,
    cells_of,
    keys_of,
    levels_of,
    owners,
)
from fastmech.attractors.flow import COARSER, Flow, statuses
from fastmech.attractors.flow import MOST as MOST_STEPS
from fastmech.attractors.orbits import (
    ALONG,
    RESIDUAL,
    SAME,
    SHORTER,
    Orbit,
    attracts,
    cycle,
    newton,
    periodic,
    returns,
    same,
    visits,
)
from fastmech.ensembles.status import Status
from fastmech.jit import working
from fastmech.transients.lyapunov import largest_lyapunov

#: Periods of the first window, and of all together; strobes in a period of a system that knows no time.
WINDOW, PATIENCE, DENSE = 64, 4096, 8

#: Returns of a path, each nearer than the one before, from which a cycle is looked for.
RECORDS = 6

#: How near to its end a path comes that is back, as a share of how far it had gone.
NEAR = 0.15

#: How far from an orbit that repels motions have to be, over the scale, to have left it.
LEFT = 0.05

#: Longest period looked for on the way, in forcing periods; guesses for Newton's method in a window, and of
#: cycles.
LONGEST, GUESSES, CYCLES = 32, 32, 16

#: Multipliers beyond this are no rounding of 1: motions leave. Orbits nearer to 1 that are looked at closely.
REPELS, NEUTRALS = 1.0 + 1e-7, 4

#: Numbers that paths may have: half a gigabyte. Of many states fewer motions are followed, not below so many.
HELD, FEWEST = 1 << 26, 16

#: Windows before cells are looked at; motions that must stay in them, and for how many periods.
WINDOWS, STAYING, STAYS = 3, 64, 1024

#: Sizes of cells as shares of the scale: the smallest that motions fill is taken.
SIZES = (1 / 128, 1 / 64, 1 / 32, 1 / 16, 1 / 8)

#: Share of a motion's later strobes that lie in cells of its earlier ones, of one that fills cells; and share
#: of cells in common of two motions on the same attractor.
FILLED, SHARED = 0.95, 0.3

#: Spread over the last quarter of a window, as a share of that over the first, of motions that draw in: what
#: falls as the eighth root of time has 0.94 left. Spreads, over the scale, that count, and share of motions.
SHRUNK, LARGE, MOSTLY = 0.97, 1e-3, 0.9

#: Cells that a motion's own range has in each state, and share of each half of its time that it is in cells
#: of the other half, if it has come back: one that drifts has few in common, however large cells are.
PARTS, BACK = 8, 0.5

#: Points of an attractor's cells that are kept.
MOST_POINTS = 1 << 18

#: Multipliers nearer to 1 than this, and shares of the scale: how far beside a fixed point another is looked
#: for; cells of such a continuum; places of it by which it goes on.
NEUTRAL, BESIDE, CONTINUUM, KNOWN = 1e-5, 1 / 32, 1 / 16, 512

#: How far from motions that creep the place that they come to is, over the scale.
NEARBY = 0.25

#: Fixed points about which steps are tried, and periods for which.
TRIED, WAITED = 16, 8.0

#: Motions of one attractor that are followed for its exponent, and periods.
FOLLOWED, EXPONENT_PERIODS = 8, 512

#: Neutral cycles of one period, to so much of it, that are a family; motions that look for more, and how
#: near these come back; spread of how far they go, over the scale, where all go equally far.
FAMILY, ONE_PERIOD, MEMBERS, CLOSED, EQUAL = 4, 1e-6, 1024, 1e-3, 0.05

#: V about an orbit's places that motions on it may have, after a period with the longest steps used.
INSIDE = 0.1

#: How far beside it they begin, as a share of the ball's radius: exactly on it nothing can grow.
ASIDE = 1e-3

#: Attractors at most: a system without damping has a continuum of motions that stay.
MOST = 100


class Search:
    """Attractors found so far: orbits with their balls first, then clouds."""

    def __init__(self, flow: Flow) -> None:
        self.flow = flow
        self.orbits: list[tuple[Orbit, Balls]] = []
        self.clouds: list[Cloud] = []
        self.repelling: list[Orbit] = []  #: orbits that motions leave, seen on the way
        self.neutral: list[Orbit] = []  #: that were not seen to attract, nor to repel
        self.changes = 0  #: times that one was found, or more of one
        self.only_end = -1  #: the attractor at which all chaos that passes ends, if there is one
        self.latest = 0  #: periods after which the last motion of a sample had arrived

    @property
    def count(self) -> int:
        """How many attractors."""
        return len(self.orbits) + len(self.clouds)

    def arrived(self, states: Floats) -> Integers:
        """The orbit in whose balls each state (n, dim) is, -1: in none."""
        found = np.full(len(states), -1, dtype=np.int64)
        for k, (_, own) in enumerate(self.orbits):
            left = np.flatnonzero(found < 0)
            found[left[levels_of(self.flow, own, states[left])[1] < 1.0]] = k
        return found

    def cells(self, wider: float) -> ArrivalCells | None:
        """Cells of the clouds."""
        return cells_of(self.flow, self.clouds, wider) if self.clouds else None

    def look(self, sample: Floats) -> None:
        """Follow a sample (n, dim) until all have arrived somewhere, or for :data:`PATIENCE` periods."""
        y, window, passed, number = sample, WINDOW, 0, 0
        with working("looking for attractors") as say:
            while len(y) and passed < PATIENCE and self.count < MOST:
                passed, number = passed + window, number + 1
                y = self._look_on(y, window, passed, number)
                window *= 2
                say(f"looking for attractors, {self.count} found in {passed:,} periods")

    def _look_on(self, y: Floats, window: int, passed: int, number: int) -> Floats:
        """Follow motions (n, dim) over one window more; where those are that have not arrived."""
        flow, dense = self.flow, 1 if self.flow.forced else DENSE
        y = y[: max(FEWEST, HELD // (window * dense * y.shape[1]))]
        reached = flow.run(y, np.arange(1, window * dense + 1) / dense)
        paths = reached.y[:, statuses(flow, reached) == Status.OK]
        paths = self._leave_out(paths, passed)
        self._find_orbits(paths)
        paths = self._leave_out(paths, passed)
        if number >= WINDOWS and paths.shape[1]:
            self._find_clouds(paths, dense)
            paths = self._leave_out(paths, passed)
        return np.asarray(paths[-1])

    def _leave_out(self, paths: Floats, passed: int) -> Floats:
        """Paths (k, n, dim) that have not arrived."""
        done = self.arrived(paths[-1]) >= 0
        cells = self.cells(1.0)
        if cells is not None and paths.shape[1]:
            late = owners(self.flow, cells, paths[len(paths) // 2 :])
            done |= (late == late[-1]).mean(axis=0) * (late[-1] >= 0) > FILLED
        if done.any():
            self.latest = max(self.latest, passed)
        return paths[:, ~done]

    def _find_orbits(self, paths: Floats) -> None:
        """Look for orbits that paths (k, n, dim) come near to."""
        flow, forced = self.flow, self.flow.forced
        if not paths.shape[1]:
            return
        strobes = paths if forced else paths[DENSE - 1 :: DENSE]
        period, known = returns(flow, strobes, LONGEST if forced else 1)
        for p in np.unique(period[known]):
            self._try(strobes[-1][known & (period == p)], int(p))
        if not flow.angles.any():  # a slow spiral goes around it
            self._try(strobes[len(strobes) // 2 :].mean(axis=0), 1)
        moves = flow.distance(paths[len(paths) // 2 :], paths[-1]).max(axis=0) > SAME
        tried, moving = 0, (self.arrived(paths[-1]) < 0) & moves
        for i in np.flatnonzero(moving) if not forced else ():
            place = paths[-1, i : i + 1]
            if tried >= CYCLES or self._known(place[0]) or self._beside_neutral(place):
                continue
            if np.isfinite(self._in_families(place)[0]):
                continue
            for back in times_back(flow, paths[:, i]):
                tried += 1
                found = cycle(flow, paths[-1, i], back / DENSE)
                if found is not None:
                    self.add(found)
                    if self._known(found.points[0]):
                        break

    def orbits_near(self, places: Floats, period: float | None) -> list[Orbit]:
        """Orbits near places (n, dim), of a period [s] that a cycle has; None: places of rest."""
        periods = 1.0 if period is None else period / self.flow.period
        if self.flow.forced or period is None:
            return self._orbits_from(places, max(1, round(periods)))
        found = cycle(self.flow, places[0], periods)
        return [] if found is None else [found]

    def _try(self, guesses: Floats, periods: int) -> None:
        """Add orbits that Newton's method finds from guesses (n, dim)."""
        for orbit in self._orbits_from(guesses, periods):
            self.add(orbit)

    def _orbits_from(self, guesses: Floats, periods: int) -> list[Orbit]:
        """Orbits by Newton's method from guesses (n, dim) that are not near one another."""
        chosen: list[Floats] = []
        for guess in guesses:
            near = any(self.flow.distance(guess, other) < 0.02 for other in chosen)
            if len(chosen) < GUESSES and not near and not self._known(guess):
                chosen.append(guess)
        return periodic(self.flow, np.array(chosen), periods) if chosen else []

    def _known(self, place: Floats) -> bool:
        return any(visits(self.flow, orbit, place) for orbit, _ in self.orbits)

    def _beside_neutral(self, states: Floats) -> bool:
        """Whether all states (n, dim) lie near an orbit that was not seen to attract, nor to repel."""
        near = (self.flow.distance(states[:, None], orbit.points).min(axis=1) for orbit in self.neutral)
        return any((distance < LEFT).all() for distance in near)

    def add(self, orbit: Orbit) -> None:
        """Add an orbit to those that attract, repel, or do neither, unless it is known."""
        if np.abs(orbit.multipliers).max(initial=0.0) > REPELS:
            self.repelling.append(orbit)
            return
        seen = [known for known, _ in self.orbits] + self.neutral
        if any(same(self.flow, known, orbit) for known in seen):
            return
        if not attracts(orbit) and (self.arrived(orbit.points) >= 0).all():
            return  # the same multiple zero, to which Newton's method creeps
        closely = attracts(orbit) or len(self.neutral) < NEUTRALS
        if closely and not attracts(orbit) and len(orbit.points) == 1:
            closely = not self._have_neighbours(orbit.points)[0]
        own = balls(self.flow, orbit) if closely else None
        if own is None:
            self.neutral.append(orbit)
            return
        self.changes += 1
        self.orbits.append((orbit, own))
        # Steps must be short enough for motions on the orbit to stay in its balls, where that is due to them.
        beside = orbit.points + ASIDE * own.radius * self.flow.scale
        before = np.full_like(beside, np.nan)
        while self.flow.steps < MOST_STEPS:
            after = self.flow.after(beside, orbit.periods or 1.0, COARSER)
            outside = ~(levels_of(self.flow, own, after)[1] < INSIDE)
            if (self.flow.distance(after, before)[outside] < INSIDE * own.radius).all():
                break
            beside, before = beside[outside], after[outside]
            self.flow = replace(self.flow, steps=2 * self.flow.steps)

    def _in_families(self, states: Floats) -> Floats:
        """Period of the neutral cycles side by side of which each state (n, dim) is on one, NaN: on none."""
        period = np.full(len(states), np.nan)
        found = np.sort([orbit.periods for orbit in self.neutral if orbit.cycle])
        first, count = np.unique(np.searchsorted(found, found * (1.0 - ONE_PERIOD)), return_counts=True)
        for one in found[first[count >= FAMILY]]:
            again = self.flow.distance(self.flow.after(states, one), states) < CLOSED
            period[again] = one
        return period

    def _add_family(self, ends: Floats, period: float) -> None:
        """Add what neutral cycles of one period fill on which motions are (n, dim).

        If all go as far in each state, as oscillators do that know nothing of each other, it is a torus.
        """
        flow = self.flow
        beside = np.random.default_rng(0).uniform(-1.0, 1.0, (MEMBERS, flow.scale.size))
        beside = flow.after(np.resize(ends, beside.shape) + SIZES[-1] * flow.scale * beside, WINDOW)
        y = np.concatenate([ends, beside[self._in_families(beside) == period]])
        paths = flow.run(y, period * np.arange(1.0, ALONG + 1.0) / ALONG).y
        far = np.where(flow.angles, 0.0, np.ptp(paths, axis=0) / flow.scale)
        points = paths.reshape(-1, y.shape[1])
        points = points[:: -(-len(points) // MOST_POINTS)]
        differ = bool((far.std(axis=0) > EQUAL).any())
        self._add_cloud(Cloud(points, SIZES[-1] * flow.scale, continuum=differ, period=period), ends, False)

    def _find_clouds(self, paths: Floats, dense: int) -> None:
        """Look for cells that paths (k, n, dim) fill: the later halves find what the earlier ones have."""
        flow, half = self.flow, len(paths) // 2
        period = self._in_families(paths[-1])
        for one in np.unique(period[np.isfinite(period)]):
            self._add_family(paths[-1, period == one], float(one))
        paths = paths[:, np.isnan(period)]
        if not paths.shape[1]:
            return
        for share in SIZES:
            size = share * flow.scale
            keys = keys_of(flow, size, paths)
            again = [np.isin(own[half:], own[:half]).mean() for own in keys.T]
            filling = np.flatnonzero(np.array(again) > FILLED)
            if 2 * filling.size >= keys.shape[1]:
                break
        else:
            return
        resting: Flags = (np.ptp(paths[half:, filling], axis=0) < size).all(axis=1)
        resting[resting] = self._have_neighbours(paths[-1, filling[resting]])
        if resting.any():
            self._add_continua(paths[-1, filling[resting]], size)
            filling = filling[~resting]
        if not filling.size:
            return
        for group in _groups([np.unique(own) for own in keys[:, filling].T]):
            members = filling[group]
            dim = paths.shape[2]
            seen = paths[half:, members].reshape(-1, dim)
            stays = self._later(seen, np.arange(1, STAYS * dense + 1) / dense)
            points = np.concatenate([seen, stays.reshape(-1, dim)])
            points = points[:: -(-len(points) // MOST_POINTS)]
            if flow.forced:
                self._find_long_orbits(stays)
            left = ~np.isin(keys_of(flow, size, stays), np.unique(keys[:, members]))
            still = bool((np.ptp(stays, axis=0) < size).all())
            if left.mean() < 0.2 and self._stay(stays[-1]) and (still or recur(flow, stays)):
                self._add_cloud(Cloud(points, size, still), stays[-1], shrink(flow, paths[:, members]))

    def _find_long_orbits(self, paths: Floats) -> None:
        """Look for orbits on which motions (k, n, dim) have settled, of any period that they show twice."""
        distance, longest = self.flow.distance, len(paths) // 2
        back = distance(paths[-1], paths[-2 : -2 - longest : -1]) < SAME
        for i in np.flatnonzero(back.any(axis=0)):
            for p in 1 + np.flatnonzero(back[:, i]):
                if distance(paths[-longest:, i], paths[-longest - p : -p, i]).max() < SAME:
                    self._try(paths[-1, i : i + 1], int(p))
                    break

    def _later(self, points: Floats, times: Floats) -> Floats:
        """Where motions from some of the points (n, dim) are at times [periods] (k, m, dim)."""
        some = points[np.unique(np.linspace(0, len(points) - 1, STAYING).astype(np.int64))]
        return self.flow.run(some, times).y

    def _stay(self, states: Floats) -> bool:
        """Whether none of such motions has gone to an orbit or to infinity by now (n, dim)."""
        return bool(np.isfinite(states).all() and (self.arrived(states) < 0).all())

    def leave_transients(self) -> None:
        """Take clouds away that motions leave for an orbit, which may have been found later."""
        times = np.array([float(STAYS)])
        kept = [
            c
            for c in self.clouds
            if not self._holds_orbit(c) and (c.still or self._stay(self._later(c.points, times)[-1]))
        ]
        self.changes += len(self.clouds) - len(kept)
        self.clouds = kept

    def _holds_orbit(self, cloud: Cloud) -> bool:
        """Whether an orbit that attracts lies in the cell of motions that creep: they go there."""
        places = [orbit.points for orbit, _ in self.orbits if cloud.still and not cloud.continuum]
        return any((np.abs(self.flow.away(p, cloud.points[0])) < cloud.size).all(1).any() for p in places)

    def _have_neighbours(self, places: Floats) -> Flags:
        """Which fixed points of the map, near places (n, dim), have others beside them."""
        flow, n = self.flow, len(places)
        parts = 1 if flow.forced else SHORTER
        jacobians = np.linalg.matrix_power(flow.derivative(places, 1.0 / parts)[1], parts)
        jacobians *= flow.scale / flow.scale[:, None]
        beside = np.stack([places, places, places])
        neutral: Flags = np.asarray(np.isfinite(jacobians).all(axis=(1, 2)))
        for k in np.flatnonzero(neutral):
            values, vectors = np.linalg.eig(jacobians[k])
            j = int(np.argmin(np.abs(values - 1.0)))
            neutral[k] = abs(values[j] - 1.0) < NEUTRAL
            along = vectors[:, j].real
            step = BESIDE * flow.scale * along / max(float(np.abs(along).max()), 1e-300)
            beside[:, k] += np.array([0.0, 1.0, -1.0])[:, None] * step
        if neutral.any():
            y, residual, _ = newton(flow, beside.reshape(3 * n, -1), 1)
            # Towards a multiple zero Newton's method creeps from both sides.
            stays = flow.distance(y, beside.reshape(3 * n, -1)) < 0.5 * BESIDE
            neutral &= ((residual < RESIDUAL) & stays).reshape(3, n).all(axis=0)
        return neutral

    def _add_continua(self, places: Floats, size: Floats) -> None:
        """Add fixed points (n, dim) that have others beside them: those between which others lie are one."""
        flow = self.flow
        known = [cloud.points for cloud in self.clouds if cloud.continuum and cloud.still]
        y = np.concatenate([*(points[:: -(-len(points) // KNOWN)] for points in known), places])
        tree = minimum_spanning_tree(flow.distance(y[:, None], y) + 1e-12).tocoo()
        gaps = flow.away(y[tree.col], y[tree.row])
        middle = y[tree.row] + 0.5 * gaps
        between, residual, jacobians = newton(flow, middle, 1)
        residual[np.abs(np.linalg.eigvals(jacobians)).max(axis=1) > 1.0 + NEUTRAL] = np.inf  # unstable
        joined = (residual < RESIDUAL) & (flow.distance(between, middle) < 0.25 * tree.data)
        joined |= tree.data < BESIDE
        links = csr_matrix((tree.data[joined], (tree.row[joined], tree.col[joined])), shape=tree.shape)
        _, group = connected_components(links, directed=False)
        self._shorten_steps(places[:TRIED], size)
        self.clouds = [cloud for cloud in self.clouds if not (cloud.continuum and cloud.still)]
        for k in np.unique(group):
            some = flow.derivative(y[group == k][:FOLLOWED], 1.0)[1]
            rates = np.log(np.abs(np.linalg.eigvals(some)).max(axis=1)) / flow.period
            exponent, error = float(rates.mean()), float(np.ptp(rates)) + NEUTRAL / flow.period
            wide = np.maximum(size, CONTINUUM * flow.scale)
            self.clouds.append(Cloud(y[group == k], wide, True, exponent, error, continuum=True))
        self.changes += 1

    def _shorten_steps(self, places: Floats, size: Floats) -> None:
        """Take steps so short that motions near places of rest (n, dim) stay there."""
        nearby = places + 0.25 * size * np.random.default_rng(0).uniform(-1.0, 1.0, places.shape)
        while self.flow.steps < MOST_STEPS:
            away = self.flow.away(self.flow.after(nearby, WAITED, COARSER), places)
            if (np.abs(away / size) < 1.0).all():
                break
            self.flow = replace(self.flow, steps=2 * self.flow.steps)

    def _add_cloud(self, new: Cloud, last: Floats, shrinks: bool) -> None:
        """Add a cloud, or its points to the one with which it has many cells in common.

        Without an exponent, what shrinks, or lies along a neutral orbit or in a plane (Poincare,
        Bendixson) is no torus, but on its way.
        """
        if new.still:  # where the place is that they come to, be it a multiple zero
            place, residual, _ = newton(self.flow, last[:1], 1)
            if residual[0] > RESIDUAL or self.flow.distance(place, last[:1])[0] > NEARBY:
                return  # there is none: motions pass slowly
            if any(np.abs(o.multipliers).max() > REPELS for o in periodic(self.flow, place, 1)):
                return  # or leave more slowly than was waited for
            new = new._replace(points=np.concatenate([place, new.points]))
        if self._holds_orbit(new):
            return
        cells = np.unique(keys_of(self.flow, new.size, new.points))
        for k, cloud in enumerate(self.clouds):
            own = np.unique(keys_of(self.flow, new.size, cloud.points))
            gap = np.abs(self.flow.away(new.points[0], cloud.points[0]) / new.size).max()
            near = new.still and cloud.still and gap < 2.0
            if near or np.isin(cells, own).sum() > SHARED * min(cells.size, own.size):
                points = np.concatenate([cloud.points, new.points])
                self.changes += 1
                self.clouds[k] = cloud._replace(points=points, size=np.maximum(cloud.size, new.size))
                return
        near = [o for o in self.repelling if self.flow.distance(o.points, new.points[-1]).min() < LEFT]
        if new.still and near:
            return  # motions are about to leave
        exponent, error = _exponent(self.flow, last)
        if new.still and exponent > 3.0 * error:
            return  # a saddle, beside which each turn of a heteroclinic cycle takes longer than the last
        flat = self.flow.planar and not self.flow.angles.all()
        on_its_way = not new.still and new.period is None and (shrinks or flat or self._beside_neutral(last))
        if on_its_way and exponent <= 3.0 * error:
            return
        if new.still:
            self._shorten_steps(last[:1], new.size)
        self.changes += 1
        self.clouds.append(new._replace(exponent=exponent, error=error))


def shrink(flow: Flow, paths: Floats) -> bool:
    """Whether nearly all motions (k, n, dim) go less far in some state at the end than in the beginning."""
    part = len(paths) // 4
    early, late = (some.std(axis=0) / flow.scale for some in (paths[:part], paths[-part:]))
    return bool((((late < SHRUNK * early) & (early > LARGE)).mean(axis=0) > MOSTLY).any())


def recur(flow: Flow, paths: Floats) -> bool:
    """Whether most motions (k, n, dim) come back to where they were, each seen in its own range."""
    half, came = len(paths) // 2, 0
    for path in np.swapaxes(paths, 0, 1):
        size = np.maximum(np.ptp(path, axis=0) / PARTS, SAME * flow.scale)
        keys = keys_of(flow, np.where(flow.angles, np.minimum(size, 2.0 * np.pi / PARTS), size), path)
        early, late = keys[:half], keys[half:]
        came += min(np.isin(early, late).mean(), np.isin(late, early).mean()) > BACK
    return bool(2 * came > paths.shape[1])


def _groups(cells: list[Integers]) -> list[Flags]:
    """Motions that share cells (rising numbers of each): which belong together."""
    every, place = np.unique(np.concatenate(cells), return_inverse=True)
    rows = np.repeat(np.arange(len(cells)), [c.size for c in cells])
    visits = csr_matrix((np.ones(place.size), (rows, place)), shape=(len(cells), every.size))
    common = (visits @ visits.T).toarray()
    number = common.diagonal()
    _, group = connected_components(common > SHARED * np.minimum(number, number[:, None]))
    return [group == k for k in np.unique(group)]


def times_back(flow: Flow, path: Floats) -> list[int]:
    """Strobes back to where a path (k, dim) came near to its end, each nearer than all after it."""
    distance = flow.distance(path[::-1][1:], path[-1])
    inner = distance[1:-1]
    near = 1 + np.flatnonzero((inner <= distance[:-2]) & (inner <= distance[2:]))
    farthest = np.maximum.accumulate(distance)
    near = near[distance[near] < NEAR * farthest[near]]
    nearer = distance[near] <= np.minimum.accumulate(distance[near])
    return [int(back) + 1 for back in near[nearer][:RECORDS]]


def _exponent(flow: Flow, starts: Floats) -> tuple[float, float]:
    """Largest Lyapunov exponent [1/s] of motions on an attractor from starts (n, dim), and its error.

    The growth over the later half of the run counts, its mean over the motions; what grows linearly, as on a
    torus, shows as log 2 over that time.
    """
    lanes, t_end = starts[:FOLLOWED], EXPONENT_PERIODS * flow.period
    found = largest_lyapunov(flow.scene, lanes, t_end, flow.period / flow.steps)
    grown = found.exponents * found.t[:, None]
    half = len(grown) // 2
    rates = (grown[-1] - grown[half - 1]) / (found.t[-1] - found.t[half - 1])
    spread = float(rates.std(ddof=1)) / np.sqrt(rates.size) if rates.size > 1 else 0.0
    return float(rates.mean()), float(spread + np.log(2.0) / (found.t[-1] - found.t[half - 1]))
