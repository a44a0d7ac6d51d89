"""``fm.frequency_response``: branches of periodic motion over a parameter, stable and unstable.

A motion of period p T is a fixed point x of the map over p periods: G(x, lambda) = Phi(x, lambda) - x = 0;
the period T may depend on the parameter. Branches are followed by pseudo-arclength continuation (Keller;
Allgower and Georg, *Numerical Continuation Methods*, chapter 10). Derivatives are products of those of parts
of a period: differences over the whole of it would lie where the map is no longer linear. All run side by
side on lanes, each in its own time over its own period. Multipliers tell stability: +1 at a fold, where the
parameter turns, and at a branch point, where another branch crosses and the determinant of G's derivatives
and the tangent changes its sign (Allgower and Georg, chapter 8), -1 where the period doubles, a pair on the
unit circle at a Neimark-Sacker point (Guckenheimer, Holmes, section 3.5). They are known to an error: a sign
within it tells nothing, as on branches of undamped motion, whose multipliers stay on the circle. Branches
begin at what Newton's method finds at several values of the parameter from many starts, so that isolated ones
are found where a start comes near. They end where motions meet a stopping condition or leave a range.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, root

from fastmech.arrays import Flags, Floats
from fastmech.attractors.flow import (
    DIFFERENCE,
    FINER,
    Flow,
    calling,
    flow_of,
    period_of,
    range_observation,
    require_flow,
    require_parameter,
    take_ended,
)
from fastmech.attractors.orbits import RESIDUAL, about_rests, eigenvalues, newton
from fastmech.ensembles import checks
from fastmech.ensembles.lanes import Parameters
from fastmech.ensembles.problem import Case, Problem
from fastmech.ensembles.run import NOTHING, Observation
from fastmech.ensembles.solve import Settings, solve
from fastmech.ensembles.system import System
from fastmech.errors import InputError, shown
from fastmech.jit import working
from fastmech.models.mechanism import Mechanism
from fastmech.models.motion import system_of
from fastmech.objects import Drawn, Printed, counted, state_units
from fastmech.samplers import Starts

#: Values of the parameter at which branches are looked for, the outer ones so much of the range inside it,
#: and starts at each; periods that they run first.
VALUES, BESIDE, STARTS, RUN_IN = 11, 0.01, 64, 48

#: Lengths of continuation steps: first, shortest and longest, in scales of state and range of the parameter;
#: the longest grows with the distance from where motions are.
FIRST, SHORTEST, LONGEST = 0.01, 1e-7, 0.03

#: How far beyond the end of a branch it is asked whether motions stop, in the same: differences stop sooner.
BEYOND = 1e-3

#: Newton's iterations of a step, and points of a branch, at most; cosine between tangents at least.
CORRECTIONS, POINTS, BEND = 6, 1000, 0.95

#: Distance over the scale of a motion after half its period to where it began, that is twice a shorter one.
HALVED = 0.02

#: Values of the parameter, over its range, at which special points of both halves of a branch are one.
ONCE = 1e-5

#: Kinds of points where the stability of a branch may change.
KINDS = ("fold", "branch point", "period doubling", "Neimark-Sacker")

#: Parts of a period of the forcing whose derivatives are taken.
PARTS = 8

#: Outputs over a period for amplitudes.
OUTPUTS = 256


class Special(NamedTuple):
    """A point where the stability of a branch may change."""

    kind: str  #: one of :data:`KINDS`
    value: float  #: of the parameter
    place: Floats  #: state at the begin of a period (dim,)
    amplitude: Floats  #: of each state (dim,)


@dataclass(frozen=True, repr=False)
class Branch(Printed):
    """Periodic motions along a branch."""

    values: Floats  #: of the parameter (m,)
    places: Floats  #: states at the begin of a period (m, dim)
    multipliers: NDArray[np.complex128]  #: (m, dim)
    errors: Floats  #: of these (m,)
    amplitudes: Floats  #: half of the range of each state over the period (m, dim)
    turns: Floats  #: full turns of each state over the period: not zero of an angle that rotates (dim,)
    special: tuple[Special, ...]
    closed: bool  #: whether it comes back to where it began: an isola
    cut: bool  #: whether it goes on inside the range beyond an end: it is too long, or turns too sharply
    far: bool  #: whether it goes to infinity inside the range: a thousand times as far as motions go
    #: Whether motions beyond its first one, and beyond its last, meet a stopping condition or leave a range
    stops: tuple[bool, bool]

    def told(self) -> str:
        """Where it leads, how much of it is stable or neutral, and how it ends."""
        low, high = self.values.min(), self.values.max()
        how = ", closed" * self.closed + ", cut off" * self.cut + ", to infinity" * self.far
        how += ", up to where motions stop" * any(self.stops)
        neutral = f", {self.neutral.mean():.0%} neutral" if self.neutral.any() else ""
        special = ", ".join(f"{one.kind} at {one.value:.6g}" for one in self.special)
        head = f"{counted(len(self.values), 'periodic motion')} from {low:.6g} to {high:.6g}{how}"
        return f"{head}, {self.stable.mean():.0%} stable{neutral}" + (f"\n  {special}" if special else "")

    @property
    def stable(self) -> Flags:
        """Whether all multipliers lie inside the unit circle (m,)."""
        return np.asarray(np.abs(self.multipliers).max(axis=1) < 1.0 - self.errors)

    @property
    def neutral(self) -> Flags:
        """Whether the largest multiplier lies on the unit circle, within the error (m,)."""
        return np.asarray(np.abs(np.abs(self.multipliers).max(axis=1) - 1.0) <= self.errors)


@dataclass(frozen=True, repr=False)
class FrequencyResponse(Drawn):
    """Branches of periodic motion over a parameter; printed, where stability changes."""

    parameter: str
    names: tuple[str, ...]  #: of the states
    units: Mapping[str, str]  #: of states and the parameter, where they are known
    periods: int  #: of the forcing, that a motion takes
    branches: tuple[Branch, ...]
    #: Folds, branch points, doublings and Neimark-Sacker points, by the parameter; each once, also where
    #: branches meet there, and of mirror images one
    special: tuple[Special, ...]

    KIND = "frequency_response"
    PICTURE = "plots.response:draw_response"
    LAYOUT = "scan_types.frequency_response:response_dataset"

    def told(self) -> str:
        """How many branches, and where stability changes."""
        closed, cut, far = (sum(getattr(b, h) for b in self.branches) for h in ("closed", "cut", "far"))
        stops = sum(any(b.stops) for b in self.branches)
        neutral = sum(bool(b.neutral.any()) for b in self.branches)
        lines = [
            f"{counted(len(self.branches), 'branch')} of period {self.periods} over {self.parameter}"
            + (f", {closed} closed" if closed else "")
            + (f", {neutral} neutral at least in part: neither stable nor unstable" if neutral else "")
            + (f", {far} to infinity" if far else "")
            + (f", {stops} up to where motions stop" if stops else "")
            + (f", {cut} cut off: too long or turning too sharply; take a narrower range" if cut else "")
        ]
        for kind in KINDS:
            values = [f"{s.value:.6g}" for s in self.special if s.kind == kind]
            more = f" and {len(values) - 6} more" if len(values) > 6 else ""
            if values:
                lines.append(f"  {kind} at {self.parameter} = {', '.join(values[:6])}{more}")
        return "\n".join(lines)


def frequency_response(
    system: System | Mechanism,
    parameter: str,
    between: tuple[float, float],
    starts: Starts,
    *,
    periods: int = 1,
    seed: int | None = None,
    threads: int | None = None,
) -> FrequencyResponse:
    """Periodic motions over a range of a parameter, such as the frequency or amplitude of a load.

    Args:
        system: a system of your own with a ``period`` whose ``rhs`` gives a tuple, or a mechanism under loads
            that repeat.
        parameter: its name.
        between: least and greatest value.
        starts: ranges by name, a sampler or states (n, dim), as for :func:`fastmech.find_attractors`.
            Newton's method begins at 64 of them, at where these are after 48 periods, and at small swings
            about places of rest, at eleven values.
        periods: how many periods of the forcing a motion takes; motions that take a part of them are branches
            too.
        seed, threads: as for :func:`fastmech.find_attractors`.

    Returns:
        branches with multipliers, amplitudes, and folds, branch points (pitchforks, exchanges), period
        doublings and Neimark-Sacker points located to rounding of the map. A branch that no start leads to is
        not found. One ends a thousand times as far as motions go: it goes to infinity. One ends where its
        motions begin to meet a stopping condition or to leave a coordinate's range. One is cut off that
        goes on after 1,000 motions each way, or turns too sharply for any step: a narrower range of the
        parameter follows it more finely. Without damping motions are neutral where they do not repel.

    Raises:
        InputError: an argument is wrong, or the system does not depend on the time.
    """
    require_flow(system)
    require_parameter(system, parameter)
    if np.ndim(between) != 1 or len(between) != 2:
        raise InputError(f"between = {shown(between)}: must be the least and the greatest value")
    low, high = (checks.number("between", value, "") for value in between)
    if not low < high:
        raise InputError(f"between = {shown(between)}: must rise")
    periods = checks.whole_number("periods", periods, least=1, most=1024)
    y = checks.starts("starts", starts, system.state, n=STARTS, seed=seed)
    branches: list[Branch] = []
    with working("looking for periodic motions") as say:
        family = OrbitFamily(system, parameter, (low, high), y, periods, threads=threads)
        for value, flow in family.flows.items():
            guesses = np.concatenate([about_rests(flow, y), y, flow.after(y, RUN_IN)])
            guesses = guesses[np.isfinite(guesses).all(axis=1) & ~flow.is_far(guesses)]
            places, residual, _ = newton(flow, guesses, periods)
            known = [place for branch in branches for place in _at(family, branch, value)]
            for place in places[residual < RESIDUAL]:
                if not any(family.distance(place, other) <= 1e-4 for other in known):
                    at = f"at {parameter} = {value:.6g}"
                    say(f"following a branch of periodic motions from one {at}, {len(branches)} done")
                    branch = _branch(family, place, value)
                    known.append(place)
                    if branch is not None:
                        branches.append(branch)
                        known += _at(family, branch, value)
    special = _each_once(family, sorted((s for b in branches for s in b.special), key=lambda s: s.value))
    return FrequencyResponse(
        parameter, tuple(system.state), _units(system), periods, tuple(branches), special=special
    ).of(system)


def _units(system: System | Mechanism) -> dict[str, str]:
    return {} if isinstance(system, System) else state_units(system) | dict(system.units)


class OrbitFamily:
    """The map over some periods and its derivatives, for any value of a parameter."""

    def __init__(
        self,
        scene: System | Mechanism,
        parameter: str,
        between: tuple[float, float],
        starts: Floats,
        periods: int,
        threads: int | None,
    ) -> None:
        self.scene, self.parameter, self.between, self.periods = scene, parameter, between, periods
        self.threads = threads
        #: Values at which branches begin, inside the range.
        edge = BESIDE * (between[1] - between[0])
        inside = np.linspace(between[0] + edge, between[1] - edge, VALUES)
        tried = [*between, 0.0] if between[0] < 0.0 < between[1] else [*between]

        def without_period(value: float) -> InputError:
            told = f"between = {shown(between)}: at {parameter} = {value:g} the system has no period"
            return InputError(f"{told}; take a range in which it has one, such as of frequencies above zero")

        known: list[float | None] = []
        for value in tried:
            try:
                known.append(period_of(scene, {parameter: value}))  # None: no amplitude or frequency there
            except (InputError, ArithmeticError):
                raise without_period(value) from None
        self.flows = {
            float(v): flow_of(scene, starts, {parameter: float(v)}, threads=threads) for v in inside
        }
        if not any(flow.forced for flow in self.flows.values()):
            raise InputError("system: does not depend on the time; give it a period, or a load that repeats")
        if None in known and np.ptp([flow.period for flow in self.flows.values()]) > 0.0:
            raise without_period(tried[known.index(None)])
        first: Flow = next(iter(self.flows.values()))
        self.angles, self.away = first.angles, first.away
        self.scale = np.max([flow.scale for flow in self.flows.values()], axis=0)
        reach = np.max([flow.reach for flow in self.flows.values()], axis=0)
        self.flow = replace(first, scale=self.scale, reach=reach)
        self.method = first.method
        self.steps = FINER * periods * max(flow.steps for flow in self.flows.values())
        self.dim = len(self.scale)

    def unscaled(self, u: Floats) -> tuple[Floats, Any]:
        """State and value of the parameter at points in scales (..., dim + 1)."""
        low, high = self.between
        return u[..., :-1] * self.scale, low + u[..., -1] * (high - low)

    def distance(self, a: Floats, b: Floats) -> float:
        """Largest component of a - b over the scale."""
        return float(np.abs(self.away(a, b) / self.scale).max())

    @cached_property
    def _of_period(self) -> tuple[System, Observation, Callable[[float], tuple[float, list[float]]]]:
        """The system in which a period is a unit of time, what ends it; period and parameters for a value."""
        if isinstance(self.scene, Mechanism):
            mechanism = self.scene.with_terms({self.parameter})
            own: System = system_of(mechanism, "lagrange")
            values_at: Any = mechanism.coefficients
        else:
            own = self.scene
            values_at = dict(own.parameters).__or__

        def known(value: float) -> tuple[float, list[float]]:
            found = values_at({self.parameter: value})
            period = period_of(self.scene, {self.parameter: value})
            if period is None:
                raise InputError(f"parameter: at {self.parameter} = {value:g} the system has no period")
            return period * self.periods, [float(found[name]) for name in own.parameters]

        system = _over_periods(own)
        ends = range_observation(self.scene) if isinstance(self.scene, Mechanism) else system.observation
        return system, ends, known

    def run(
        self, y: Floats, values: Floats, times: Floats, begin: Floats | None = None, *, ending: bool = True
    ) -> Floats:
        """States (outputs, n, dim) at times in units of the orbits' periods, each with its own value (n,).

        They begin at the shares ``begin`` (n,) of the period, by default at 0. Motions that end have NaN from
        then on, unless they are not ``ending``.
        """
        system, ends, known = self._of_period
        each = {value: known(value) for value in np.unique(values).tolist()}
        starts = np.zeros(len(y)) if begin is None else begin
        rows = np.array([[*each[v][1], each[v][0], b] for v, b in zip(values.tolist(), starts, strict=True)])
        params = Parameters(tuple(np.ascontiguousarray(c) for c in rows.T))
        problem = Problem(system.kernel, params, ends if ending else NOTHING, system=system)
        settings = Settings(self.method, (1.0 + 1e-12) / self.steps)
        solution = solve(Case(problem, y, times, self.threads), settings)
        take_ended(solution, times)
        return solution.y

    def stops(self, u: Floats) -> bool:
        """Whether the motion that begins at a point in scales (dim + 1,) ends within its period."""
        given = *self.unscaled(u[None]), np.ones(1)
        try:
            ended, whole = (self.run(*given, ending=ending) for ending in (True, False))
        except InputError:
            return False
        return bool(np.isnan(ended).any() and np.isfinite(whole).all())

    def derivative(self, x: Floats, value: float) -> tuple[Floats, Floats, Floats]:
        """G (dim,) and its derivatives (dim, dim + 1), in scales, and the map's Jacobian (dim, dim)."""
        d, m, h = self.dim, PARTS * self.periods, DIFFERENCE * self.scale
        hv = DIFFERENCE * (self.between[1] - self.between[0])
        path = self.run(x[None], np.array([value]), np.arange(1.0, m + 1.0) / m)[:, 0]
        shifts = np.concatenate([np.diag(h), np.diag(-h), np.zeros((2, d))])
        values = np.full(len(shifts), value)
        values[-2:] += hv, -hv
        lanes = (np.concatenate([x[None], path[:-1]])[:, None] + shifts).reshape(-1, d)
        begin = np.repeat(np.arange(m) / m, len(shifts))
        image = self.run(lanes, np.tile(values, m), np.array([1.0 / m]), begin)[0].reshape(m, -1, d)
        J, by_value = np.eye(d), np.zeros(d)
        with np.errstate(over="ignore", invalid="ignore"):  # of motions that have left
            parts = np.swapaxes(self.away(image[:, :d], image[:, d : 2 * d]) / (2.0 * h[:, None]), 1, 2)
            by_values = self.away(image[:, -2], image[:, -1]) / (2.0 * DIFFERENCE)
            for part, own in zip(parts, by_values, strict=True):
                J, by_value = part @ J, part @ by_value + own
            slopes = np.column_stack([(J - np.eye(d)) * self.scale, by_value]) / self.scale[:, None]
        return self.away(path[-1], x) / self.scale, slopes, J

    def multipliers(self, u: Floats, J: Floats) -> tuple[NDArray[np.complex128], float]:
        """Of a motion in scales (dim + 1,), and their error: differences lose digits far out."""
        values, error = eigenvalues(self.flow, J)
        return values, error * float(np.abs(u[:-1]).max(initial=1.0))


def _over_periods(system: System) -> System:
    """The same with its period as the unit of time, and the time at which it begins, as last parameters."""
    if system.vector:
        raise InputError("system: branches are followed of systems whose rhs gives a tuple, not of arrays")
    names = [*system.state, *system.parameter_order]
    rates = ", ".join(f"period_ * rate{k}" for k in range(len(system.state)))
    found = ", ".join(f"rate{k}" for k in range(len(system.state)))
    text = (
        f"def over_periods(t, {', '.join(names)}, period_, begin_):\n"
        f"    {found}, = rhs((t + begin_) * period_, {', '.join(names)})\n"
        f"    return {rates},\n"
    )
    function = calling("rhs", system.rhs, text).over_periods
    assert list(inspect.signature(function).parameters)[1:-2] == names
    parameters = dict.fromkeys(system.parameters, 0.0) | {"period_": 1.0, "begin_": 0.0}
    stop = system.stop
    if stop is not None:
        taken = ", ".join(list(inspect.signature(stop).parameters)[1:])
        text = (
            f"def over_periods(t, {taken}, period_, begin_):\n"
            f"    return stop((t + begin_) * period_, {taken})\n"
        )
        stop = calling("stop", stop, text).over_periods
    return System(function, list(system.state), parameters, stop)


class _Point(NamedTuple):
    """A point of a branch, in scales of state and range of the parameter."""

    u: Floats  #: (dim + 1,)
    tangent: Floats
    J: Floats
    slopes: Floats  #: derivatives of G by u (dim, dim + 1)
    multipliers: NDArray[np.complex128]
    error: float  #: of these


def _correct(family: OrbitFamily, guess: Floats, tangent: Floats) -> _Point | None:
    """The branch's point in the plane through a guess across a direction."""
    u, size = guess.copy(), np.inf
    for _ in range(CORRECTIONS):
        try:
            G, slopes, J = family.derivative(*family.unscaled(u))
        except InputError:  # no period there: a frequency of zero or less
            return None
        if not (np.isfinite(G).all() and np.isfinite(J).all()):
            return None
        A = np.vstack([slopes, tangent])
        right = np.append(G, tangent @ (u - guess))
        before, size = size, float(np.abs(right).max())
        try:
            if size < RESIDUAL:
                own = np.linalg.solve(A, np.eye(len(u))[-1])
                return _Point(u, own / np.linalg.norm(own), J, slopes, *family.multipliers(u, J))
            if size > 2.0 * before:
                return None
            u = u - np.linalg.solve(A, right)
        except np.linalg.LinAlgError:
            return None
    return None


def _branch(family: OrbitFamily, place: Floats, value: float) -> Branch | None:
    """The whole branch through a periodic motion; None: it stops, if only with shorter steps."""
    u = np.append(place / family.scale, (value - family.between[0]) / (family.between[1] - family.between[0]))
    start = _correct(family, u, np.eye(len(u))[-1])
    if start is None:  # too near to a fold for the plane of constant parameter
        _, slopes, J = family.derivative(place, value)
        if not np.isfinite(slopes).all():
            return None
        start = _Point(u, np.eye(len(u))[-1], J, slopes, *family.multipliers(u, J))
    forth, end = _follow(family, start)
    back, begin = ([], end) if end == "closed" else _follow(family, start._replace(tangent=-start.tangent))
    points = [p._replace(tangent=-p.tangent) for p in back[::-1]] + [start, *forth]
    special, before = [], np.zeros(len(KINDS))
    for one, two in pairwise(points):
        before = np.where(_told(one), _tests(one), before)
        special += _between(family, one, two, before)
    places, values = family.unscaled(np.array([p.u for p in points]))
    amplitudes, turns = _amplitudes(family, places, values)
    return Branch(
        values,
        places,
        np.array([p.multipliers for p in points]),
        np.array([p.error for p in points]),
        amplitudes,
        turns=turns[0],  # the same all along
        special=tuple(special) if family.periods % 2 else _each_once(family, special),
        closed=end == "closed",
        cut="cut" in (begin, end),
        far="far" in (begin, end),
        stops=(begin == "stops", end == "stops"),
    )


def _follow(family: OrbitFamily, start: _Point) -> tuple[list[_Point], str]:
    """Points along a branch, and how it ends: at an end of the "range", "closed", "far", "stops" or "cut"."""
    points: list[_Point] = []
    last, length = start, FIRST
    while len(points) < POINTS and length > SHORTEST:
        new = _correct(family, last.u + length * last.tangent, last.tangent)
        if new is None or new.tangent @ last.tangent < BEND:
            length *= 0.5
            continue
        if not 0.0 <= new.u[-1] <= 1.0:
            bound = 0.0 if new.u[-1] < 0.0 else 1.0
            share = (bound - last.u[-1]) / (new.u[-1] - last.u[-1])
            edge = last.u + share * (new.u - last.u)
            edge[-1] = bound
            end = _correct(family, edge, np.eye(len(edge))[-1])
            if end is not None:
                sign = 1.0 if end.tangent @ last.tangent > 0.0 else -1.0
                points.append(end._replace(tangent=sign * end.tangent))
            return points, "range"
        points.append(new)
        gap = new.u - start.u
        gap[:-1] = family.away(gap[:-1] * family.scale, np.zeros(family.dim)) / family.scale
        if len(points) > 8 and np.linalg.norm(gap) < 1.5 * length and new.tangent @ start.tangent > 0.5:
            points.append(start)
            return points, "closed"
        place, _ = family.unscaled(new.u)
        if family.flow.is_far(place[None])[0]:
            return points, "far"
        size = max(1.0, float(family.flow.distance(place, family.flow.middle)))
        last, length = new, min(1.4 * length, LONGEST * size)
    stops = length <= SHORTEST and family.stops(last.u + BEYOND * last.tangent)
    return points, "stops" if stops else "cut"


def _tests(p: _Point) -> Floats:
    """What changes its sign at a turn, a branch point, a period doubling, and a pair on the unit circle."""
    i, j = np.tril_indices(p.multipliers.size, -1)
    pairs = p.multipliers[i] * p.multipliers[j] - 1.0
    doubling = np.linalg.det(p.J + np.eye(len(p.J)))
    crossing = np.linalg.det(np.vstack([p.slopes, p.tangent]))
    return np.array([p.tangent[-1], crossing, doubling, np.prod(pairs).real])


def _told(p: _Point) -> Flags:
    """Of which tests the sign is known: what vanishes there does not within the error of multipliers.

    Of a turn where the tangent is: not where all directions of a plane lead on.
    """
    m, (i, j) = p.multipliers, np.tril_indices(p.multipliers.size, -1)
    beyond = np.abs(m[i] * m[j] - 1.0) > p.error * (np.abs(m[i]) + np.abs(m[j]))
    alone = np.linalg.svd(p.slopes, compute_uv=False)[-1] > p.error
    return np.array([alone, *(np.abs(m - one).min() > p.error for one in (1.0, -1.0)), beyond.all()])


def _between(family: OrbitFamily, one: _Point, two: _Point, before: Floats) -> list[Special]:
    """Special points between neighbours of a branch, from what tests last told for sure up to the first."""
    found = []
    direction = two.u - one.u
    gap = float(np.linalg.norm(direction))
    after = np.where(_told(two), _tests(two), 0.0)
    changes = before * after < 0.0
    if changes[0]:  # a branch that begins at another one turns there
        changes[1], begins = False, bool(changes[1])
    for k, kind in enumerate(KINDS):
        if not changes[k] or not gap:
            continue

        def point(share: float) -> _Point | None:
            return _correct(family, one.u + share * direction, direction / gap)

        def test(share: float, k: int = k) -> float:
            p = two if share == 1.0 else point(share) if share else None
            return float(before[k] + share * (after[k] - before[k])) if p is None else float(_tests(p)[k])

        u = _branch_point(family, one, two) if KINDS[k] == "branch point" or (k == 0 and begins) else None
        if u is None:
            share = brentq(test, 0.0, 1.0, xtol=1e-9)
            p = point(share) or one
            u = p.u
            values = p.multipliers
        if k == 3 and np.abs(values[np.argmin(np.abs(np.abs(values) - 1.0))].imag) < 1e-4:
            continue  # two real multipliers with the product 1: a neutral saddle
        place, value = family.unscaled(u)
        if k == 1 or (k == 0 and begins):
            kind = "period doubling" if _doubles(family, place, value) else "branch point"
        found.append(Special(kind, value, place, _amplitudes(family, place[None], np.array([value]))[0][0]))
    return found


def _doubles(family: OrbitFamily, place: Floats, value: float) -> bool:
    """Whether a branch point is where a motion of half the period doubles it: its multiplier is -1."""
    if family.periods % 2:
        return False
    shorter = copy(family)
    shorter.periods, shorter.steps = family.periods // 2, family.steps // 2
    vars(shorter).pop("_of_period", None)
    G, _, J = shorter.derivative(place, value)
    if not np.isfinite(J).all():
        return False
    values = np.linalg.eigvals(J)
    twice = bool(np.abs(values + 1.0).min() < np.abs(values - 1.0).min())
    return twice and float(np.abs(G).max()) < HALVED


def _branch_point(family: OrbitFamily, one: _Point, two: _Point) -> Floats | None:
    """Where branches cross between two points, in scales (dim + 1,); None: not found.

    Beside it two branches are near to each other, and the plane across one cuts both. So it is a root of its
    own equations, which are regular there: G(u) + b w = 0, w G' = 0, w w = 1 (Allgower and Georg, chapter 8).
    """
    d = family.dim

    def equations(z: Floats) -> Floats:
        u, b, w = z[: d + 1], z[d + 1], z[d + 2 :]
        try:
            G, slopes, _ = family.derivative(*family.unscaled(u))
        except InputError:
            return np.full(len(z), np.nan)
        return np.concatenate([G + b * w, w @ slopes, [w @ w - 1.0]])

    crossing = [abs(_tests(p)[1]) for p in (one, two)]
    share = crossing[0] / max(sum(crossing), 1e-300)
    guess = one.u + share * (two.u - one.u)
    w = np.linalg.svd(one.slopes + share * (two.slopes - one.slopes))[0][:, -1]
    found = root(equations, np.concatenate([guess, [0.0], w]), options={"eps": 1e-6, "xtol": 1e-13})
    u, gap = found.x[: d + 1], float(np.linalg.norm(two.u - one.u))
    good = np.abs(found.fun).max() < 1e-7 and np.linalg.norm(u - guess) < gap
    return u if good and abs(found.x[d + 1]) < RESIDUAL else None


def _each_once(family: OrbitFamily, special: list[Special]) -> tuple[Special, ...]:
    """Special points without those of the same amplitude and value of the parameter.

    They are of the same motion, on two branches or begun half a period later, or of its mirror image.
    """
    kept: list[Special] = []
    for one in special:
        again = (
            one.kind == other.kind
            and abs(one.value - other.value) < ONCE * (family.between[1] - family.between[0])
            and float(np.abs((one.amplitude - other.amplitude) / family.scale).max()) < HALVED
            for other in kept
        )
        if not any(again):
            kept.append(one)
    return tuple(kept)


def _amplitudes(family: OrbitFamily, places: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Half of the range of each state over a period and its full turns (m, dim), outputs joined by parabolas.

    Of an angle that makes full turns it is the range over one period, in which it does not come back.
    """
    times = np.arange(1.0, OUTPUTS + 1.0) / OUTPUTS
    path = np.concatenate([places[None], family.run(places, values, times, ending=False)])
    turns = path[-1:] - path[:1]
    path = np.concatenate([path[-2:-1] - turns, path, path[1:2] + turns])
    ends = []
    for sign in (1.0, -1.0):
        y = sign * path
        k = np.argmax(y[1:-1], axis=0)[None] + 1
        low, top, high = (np.take_along_axis(y, k + s, axis=0)[0] for s in (-1, 0, 1))
        bend = low - 2.0 * top + high
        with np.errstate(divide="ignore", invalid="ignore"):
            beyond = -((high - low) ** 2) / (8.0 * bend)
        ends.append(top + np.where((top >= low) & (top >= high) & (bend < 0.0), beyond, 0.0))
    return 0.5 * (ends[0] + ends[1]), np.where(family.angles, np.round(turns[0] / (2.0 * np.pi)), 0.0) + 0.0


def _at(family: OrbitFamily, branch: Branch, value: float) -> list[Floats]:
    """Where a branch passes a value of the parameter (dim,)."""
    found = []
    crossing = np.flatnonzero((branch.values[1:] - value) * (branch.values[:-1] - value) <= 0.0)
    for k in crossing:
        rise = branch.values[k + 1] - branch.values[k]
        share = (value - branch.values[k]) / rise if rise else 0.0
        guess = branch.places[k] + share * (branch.places[k + 1] - branch.places[k])
        place, residual, _ = newton(family.flows[value], guess[None], family.periods)
        begin = place if residual[0] < RESIDUAL else guess[None]
        found.append(begin[0])
        if family.periods > 1:  # the same motion begins at its other strobes too
            strobes = family.flows[value].run(begin, np.arange(1.0, family.periods), FINER).y[:, 0]
            found += list(strobes)
    return found
