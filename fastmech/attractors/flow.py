"""The map that takes states through one period, on lanes: what attractors are looked for in.

Of a system whose right-hand side repeats after a period it is the stroboscopic map. Of one that knows no time
it is the flow over a time of its own, in which a typical state changes by about its size.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import compress
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Flags, Floats
from fastmech.capture.observe import observe_ranges
from fastmech.ensembles import checks
from fastmech.ensembles.ends import STOP_CODE, STOP_STATE, STOP_TIME
from fastmech.ensembles.problem import Case, Problem, motion_problem, system_problem
from fastmech.ensembles.run import NOTHING, Observation
from fastmech.ensembles.solve import Settings, Solution, solve
from fastmech.ensembles.status import Status
from fastmech.ensembles.system import System
from fastmech.errors import InputError, shown
from fastmech.generated import new_module, run_module
from fastmech.integrators.methods import ImplicitRungeKutta, Method, find_method
from fastmech.jit import FLAGS
from fastmech.kernels.rebuilding import fingerprint, rebuilt
from fastmech.models.mechanism import Mechanism
from fastmech.scene import Scene, nearest

#: Steps of a period at least and at most, and the share of the scale that a period's error may have; above
#: so many steps it grows with their number, as right-hand sides that ask for them have kinks.
FEWEST, MOST, ERROR, ROUGH = 8, 1 << 14, 1e-6, 128

#: Steps of a period for orbits, times those of motions: the eighth power is below rounding of differences.
FINER = 4

#: Steps of systems that stop, times those of others: they are asked after each, and motions that turn round
#: just beyond are missed. Of a Duffing oscillator's 4,386 ends at x > 1.4 they were 37, with eight times as
#: many steps none.
WATCHFUL = 8

#: Steps of a period in the second of two runs, times those of the first.
COARSER = 2.0 / 3.0

#: Relative difference of rates a period apart that is rounding.
REPEATS = 1e-6

#: States of a sample that choose steps, and the share of them that must keep the error.
CHOOSING, MOSTLY = 64, 0.9

#: Periods after which motions that are on the way to infinity have gone there.
LATER = np.array([8.0])

#: Differences for derivatives, as a share of the scale: truncation and rounding are alike, about 1e-9.
DIFFERENCE = 2e-6

#: By how much looks at motions of a system without time may be further apart than their starts suggest.
SLOWER = 8.0

#: Loads' periods that fit into a common one at most so often.
MULTIPLES = 64

#: Times in which states change by about their size that a motion has to come back to a section.
WAITED = 64.0

#: A motion that does not come back rests, if at its rates it goes less far in a period, over the scale.
SLOW = 1e-2

#: The scale of a state at least, as a share of the starts': where all motions rest it would be rounding.
LEAST = 1e-3

#: Motions beyond so many times what a sample went through have escaped.
FAR = 1e3

#: Unless they stay there: so many times a sample is chosen anew beyond, in windows of so many periods and
#: twice as many each time, in whose later half they go so many times as far at most as in the earlier one.
OUTWARD, WATCHED, STAYS = 4, 16, 1.1


class Reached(NamedTuple):
    """States after some periods."""

    y: Floats  #: (outputs, n, dim); NaN from an output on at which a motion is not finite, or has stopped
    stopped: Flags  #: by the system's stopping condition, or the range of a mechanism's coordinate (n,)
    far: Flags  #: beyond :data:`FAR` times the reach, or on the way to infinity, when last finite (n,)
    away: Flags | None = None  #: moves on, but not back to the section (n,); None: there is no section

    @property
    def goes_on(self) -> Flags:
        """Which motions are there after the last period (n,)."""
        return np.asarray(np.isfinite(self.y[-1]).all(axis=1) & ~self.far & ~self.stopped)


@dataclass(frozen=True)
class Flow:
    """A system with its parameters, its period, and how it is integrated."""

    scene: System | Mechanism
    problem: Problem
    period: float  #: s
    forced: bool  #: whether the right-hand side depends on the time
    angles: Flags  #: which states count modulo a turn (dim,)
    scale: Floats  #: typical size of each state (dim,)
    middle: Floats  #: about where motions are (dim,)
    method: Method
    reach: Floats  #: half the range of all that a sample went through (dim,)
    steps: int = FEWEST  #: of a period
    threads: int | None = None

    def run(self, y: Floats, times: Floats, finer: float = 1.0) -> Reached:
        """States at rising times [periods], from the states y (n, dim) at time zero."""
        dt = self.period / math.ceil(self.steps * finer) * (1.0 + 1e-12)
        solution = solve(Case(self.problem, y, times * self.period, self.threads), Settings(self.method, dt))
        last = solution.y[-1] if solution.last is None else solution.last
        far = self.is_far(last)
        lost = np.flatnonzero(~np.isfinite(solution.y[-1]).all(axis=1) & ~far & ~self.angles.all())
        if lost.size:  # a motion that grows by more than itself in a step goes to infinity
            with np.errstate(invalid="ignore", over="ignore"):
                outward = (last[lost] - self.middle) * self.rates(last[lost]) * dt
                grows = (outward > (last[lost] - self.middle) ** 2) & np.isfinite(outward)
            far[lost] = grows[:, ~self.angles].any(axis=1)
        return Reached(solution.y, take_ended(solution, times * self.period), far)

    @property
    def planar(self) -> bool:
        """Whether motions know no time and have two states at most."""
        return not self.forced and self.scale.size <= 2

    def after(self, y: Floats, periods: float = 1.0, finer: float = 1.0) -> Floats:
        """States (n, dim) after so many periods."""
        return self.run(y, np.array([float(periods)]), finer).y[-1]

    def is_far(self, y: Floats) -> Flags:
        """Which states (n, dim) lie far out."""
        with np.errstate(invalid="ignore"):
            return np.asarray((np.abs(y - self.middle) > FAR * self.reach)[:, ~self.angles].any(axis=1))

    def away(self, a: Floats, b: Floats) -> Floats:
        """a - b with turns taken off angles."""
        difference = a - b
        if self.angles.any():
            turns = difference[..., self.angles] / (2.0 * np.pi)
            difference[..., self.angles] = 2.0 * np.pi * (turns - np.round(turns))
        return np.asarray(difference)

    def distance(self, a: Floats, b: Floats) -> Floats:
        """Largest component of a - b over the scale, without the last axis."""
        return np.asarray(np.abs(self.away(a, b) / self.scale).max(axis=-1))

    def rates(self, y: Floats, t: float = 0.0) -> Floats:
        """Rates (n, dim) of states at a time [s]."""
        Y = np.ascontiguousarray(y.T)
        found = np.zeros_like(Y)
        self.problem.rhs(t, Y, found, self.problem.params.block(len(y)))
        return found.T

    def slopes(self, y: Floats, t: float = 0.0) -> Floats:
        """Jacobians (n, dim, dim) of the rates of states (n, dim) at a time [s], by differences."""
        n, dim = y.shape
        h = DIFFERENCE * self.scale
        shifts = np.concatenate([np.diag(h), np.diag(-h)])
        rates = self.rates((y[:, None] + shifts).reshape(-1, dim), t).reshape(n, 2, dim, dim)
        with np.errstate(invalid="ignore"):  # of motions that have left
            return np.asarray(np.swapaxes((rates[:, 0] - rates[:, 1]) / (2.0 * h[:, None]), 1, 2))

    def derivative(self, y: Floats, periods: float) -> tuple[Floats, Floats]:
        """The map of states (n, dim) over so many periods, and its Jacobian (n, dim, dim).

        It is the product of those of single periods by differences, which lie where the map is linear.
        """
        (n, dim), parts = y.shape, math.ceil(periods)
        h, begin = DIFFERENCE * self.scale, y[None]
        if parts > 1:
            path = self.run(y, periods / parts * np.arange(1.0, parts), FINER).y
            begin = np.concatenate([begin, path])
        shifts = np.concatenate([np.zeros((1, dim)), np.diag(h), np.diag(-h)])
        lanes = (begin[:, :, None] + shifts).reshape(-1, dim)
        image = self.after(lanes, periods / parts, FINER).reshape(parts, n, 1 + 2 * dim, dim)
        J = np.broadcast_to(np.eye(dim), (n, dim, dim))
        with np.errstate(over="ignore", invalid="ignore"):  # of motions that have left
            slopes = self.away(image[:, :, 1 : 1 + dim], image[:, :, 1 + dim :]) / (2.0 * h[:, None])
            for part in np.swapaxes(slopes, 2, 3):
                J = part @ J
        return image[-1, :, 0], J


@dataclass(frozen=True)
class SectionFlow(Flow):
    """The map from one passage of a section to the next; its period is the time that one takes, about."""

    sides: tuple[Problem, ...] = field(kw_only=True)  #: that stop below the section, and above it
    longest: float = field(kw_only=True)  #: what does not come back for so long never does [s]

    def run(self, y: Floats, times: Floats, finer: float = 1.0) -> Reached:
        """States at so many passages; a motion that comes to rest instead stays there."""
        return self.passages(y, times, finer)[0]

    def speed(self, y: Floats) -> Floats:
        """How far states (n, dim) go in a period at their rates, over the scale (n,)."""
        return np.asarray(np.abs(self.rates(y) * self.period / self.scale).max(axis=1))

    def passages(self, y: Floats, times: Floats, finer: float = 1.0) -> tuple[Reached, Floats]:
        """The same, and how long all of them took [s] (n,), NaN: one did not come."""
        n, now, dt = len(y), y.copy(), self.period / math.ceil(self.steps * finer)
        out, last, took = np.full((len(times), *y.shape), np.nan), y.copy(), np.zeros(n)
        took[~np.isfinite(y).all(axis=1)] = np.nan
        missed = np.full(n, np.inf)  # the first passage that did not come
        active = np.flatnonzero(np.isfinite(y).all(axis=1))
        for k in range(1, round(float(times[-1])) + 1):
            for problem in self.sides:
                case = Case(problem, now[active], np.array([self.longest]), self.threads)
                found = solve(case, Settings(self.method, dt))
                passed = found.records[0] != 0.0
                final = found.y[-1] if found.last is None else found.last
                last[active] = np.where(passed[:, None], found.records[2:].T, final)
                took[active] += np.where(passed, found.records[1], np.nan)
                missed[active[~passed]] = k
                active = active[passed]
                now[active] = last[active]
            out[times == k] = np.where(np.isin(np.arange(n), active)[:, None], now, np.nan)
        far = self.is_far(last) | ~np.isfinite(last).all(axis=1)
        rests = np.isfinite(missed) & ~far & (self.speed(last) < SLOW)
        out = np.where((rests & (times[:, None] >= missed))[..., None], last, out)
        return Reached(out, np.zeros_like(far), far, np.isfinite(missed) & ~far & ~rests), took


def calling(name: str, function: Any, text: str) -> Any:
    """The module of a text that calls a function by its name."""
    module = new_module("system", text, [fingerprint(function)])
    vars(module)[name] = numba.njit(**FLAGS)(rebuilt(function, module.__name__, {}))
    return run_module(module, text)


def _sides(system: System, n: int) -> tuple[Problem, ...]:
    """The system with a stopping condition below its section, and one where it passes, which is located."""
    names, made = ", ".join(system.state), []
    section: Any = system.section
    for sign in ("<", ">"):
        text = f"def stop(t, {names}):\n    return 1.0 if section({names}) {sign} 0.0 else 0.0\n"
        stop = calling("section", section, text).stop
        own = System(system.rhs, system.state, system.parameters, stop)
        problem = system_problem(own, n, {})
        made.append(replace(problem, observation=replace(problem.observation, locate=sign == ">")))
    return tuple(made)


def _section_flow(system: System, flow: Flow, sample: Floats) -> SectionFlow:
    """The flow's map from passage to passage of the system's section; refused if hardly any motion passes."""
    given = vars(flow) | {"forced": True}
    first = SectionFlow(**given, sides=_sides(system, len(sample)), longest=WAITED * flow.period)
    took = first.passages(first.after(sample[:CHOOSING]), np.array([1.0]))[1]
    if np.isnan(took).all():
        raise InputError("section: no start of a sample comes to it twice")
    period = float(np.nanmedian(took))
    steps = max(FEWEST, math.ceil(flow.steps * period / flow.period))
    return replace(first, period=period, steps=steps)


def flow_of(
    scene: System | Mechanism,
    sample: Floats,
    values: Mapping[str, float],
    method: str = "dop853",
    threads: int | None = None,
) -> Flow:
    """The flow of a system with ``values`` of some of its parameters, in steps that suit a sample (n, dim).

    Raises:
        InputError: it depends on the time and has no period, or its motions need too many steps.
    """
    scene = scene.replace(**values)
    problem, period = _problem(scene, len(sample)), period_of(scene, {})
    angles = np.isin(scene.state, angles_of(scene))
    one = np.ones(angles.size)
    flow = Flow(
        scene, problem, period or 1.0, period is not None, angles, scale=one, middle=0.0 * one,
        method=find_method(method), reach=one, threads=threads,
    )  # fmt: skip
    flow = _suiting(flow, sample, sample[:CHOOSING])
    for _ in range(OUTWARD):
        beyond, most = _beyond(flow, sample[:CHOOSING])
        if not most:  # what is known of the others stays
            size = np.abs(beyond - flow.middle).max(axis=0, initial=0.0)
            flow = replace(flow, reach=np.maximum(flow.reach, size))
            break
        both = np.concatenate([sample[: CHOOSING // 2], beyond[: CHOOSING // 2]])
        flow = _suiting(replace(flow, steps=FEWEST, period=period or 1.0), both, both)
    if flow.problem.observation.stops:
        flow = replace(flow, steps=min(WATCHFUL * flow.steps, MOST))
    if isinstance(scene, System) and scene.section is not None:
        return _section_flow(scene, flow, sample)
    return flow


def _suiting(flow: Flow, sample: Floats, few: Floats) -> Flow:
    """The same with scale, period and steps that suit a sample (n, dim), as a few of its motions tell."""
    scale = spread(sample, flow.angles)
    flow = replace(flow, scale=scale, reach=scale, middle=np.median(sample, axis=0))
    if flow.forced:
        _require_repeats(flow, few)
    else:
        still = flow.rates(few)
        later = (flow.rates(few, t) for t in (0.7320508, 5.1961524, 31.4159))
        if not all(np.array_equal(still, rates, equal_nan=True) for rates in later):
            if isinstance(flow.scene, System) and flow.scene.section is not None:
                raise InputError(
                    "section: is for systems that do not depend on the time, rhs does; give a period instead"
                )
            raise InputError(
                "period: missing; the right-hand side depends on the time, System(period=...) tells after "
                "how many seconds it repeats"
            )
        flow = replace(flow, period=_time_of_change(flow, few))
    return _settled(_with_steps(flow, few), few)


def _beyond(flow: Flow, sample: Floats) -> tuple[Floats, bool]:
    """States (m, dim) of motions that go far beyond the reach and stay there; whether most of a sample do."""
    free, y, window = replace(flow, reach=np.full_like(flow.reach, np.inf)), sample, WATCHED
    straight, found, number = ~flow.angles, [sample[:0]], 0
    while len(y) and straight.any() and window <= 16 * WATCHED:
        reached = free.run(y, np.arange(1.0, window + 1.0), FINER)
        paths = reached.y[:, reached.goes_on]
        size = (np.abs(paths - flow.middle) / flow.reach)[..., straight].max(axis=2, initial=0.0)
        early, late = size[: window // 2].max(axis=0), size[window // 2 :].max(axis=0)
        stays = late <= STAYS * early
        outside = stays & (late > FAR) & (late < FAR**OUTWARD)
        number += int(np.count_nonzero(outside))
        found.append(paths[window // 2 :, outside].reshape(-1, sample.shape[1])[::-1])
        y, window = paths[-1, ~stays], 2 * window
    return np.concatenate(found), 2 * number > len(sample)


def flow_at(flow: Flow, values: Mapping[str, float]) -> Flow:
    """The same with other values of parameters, in steps as long, over its own period."""
    scene = flow.scene.replace(**values)
    moved = replace(flow, scene=scene, problem=_problem(scene), period=period_of(scene, {}) or flow.period)
    if isinstance(moved, SectionFlow) and isinstance(scene, System):
        return replace(moved, sides=_sides(scene, 1))
    return moved


def _problem(scene: System | Mechanism, n: int = 1) -> Problem:
    """Its motions, which end at the range of a mechanism's coordinate as by a stopping condition."""
    if isinstance(scene, Mechanism):
        problem = motion_problem(scene, n, {}, "lagrange")
        return replace(problem, observation=range_observation(scene))
    return system_problem(scene, n, {})


def range_observation(mechanism: Mechanism) -> Observation:
    """What ends motions that leave the range of a coordinate, if one has a range."""
    if not np.isfinite(mechanism.ranges).any():
        return NOTHING
    record = np.zeros(STOP_STATE + len(mechanism.state))
    return Observation(observe_ranges, mechanism.ranges.T.ravel(), record, stops=True)


def take_ended(solution: Solution, times: Floats) -> Flags:
    """Who has stopped (n,), with NaN in place of its states from then on, at output times [s]."""
    if not len(solution.records):
        return np.zeros(len(solution.status), dtype=np.bool_)
    stopped = solution.records[STOP_CODE] != 0.0
    over = stopped & (solution.records[STOP_TIME] <= times[:, None])
    over[-1] = stopped
    solution.y[over] = np.nan
    return np.asarray(stopped)


def spread(sample: Floats, angles: Flags) -> Floats:
    """Half the range of a sample in each state; where it has none the others', a turn of angles is pi."""
    scale = np.where(angles, np.pi, 0.5 * np.ptp(sample, axis=0))
    sizes = np.abs(sample[:, ~angles]).max(initial=1e-300)
    scale[~(scale > 0.0)] = max(float(scale.max()), float(sizes))
    return np.where(scale > 1e-250, scale, 1.0)


def _require_repeats(flow: Flow, sample: Floats) -> None:
    """Refuse a period after which the right-hand side is another one."""
    t, period = 0.7320508 * flow.period, flow.period
    one, two = (np.nan_to_num(flow.rates(sample, at)) for at in (t, t + period))
    size = np.abs(one) + np.abs(flow.rates(sample, 0.0) - one)
    differ = np.abs(two - one) > REPEATS * np.nan_to_num(size)
    if np.median(differ.any(axis=1)) > 0.5:
        raise InputError(f"period = {period:.6g}: the right-hand side does not repeat after so many seconds")


def _settled(flow: Flow, sample: Floats) -> Flow:
    """The same with the scale of where the sample's motions are after some periods, if they are there."""
    reached = flow.run(sample, SLOWER * np.arange(1.0, 33.0) / 32.0)
    paths, y, kept = reached.y, reached.y[-1], reached.goes_on
    if np.count_nonzero(kept) < 2:
        return flow
    both = np.concatenate([sample, paths[:, kept].reshape(-1, sample.shape[1])])
    low, high = np.quantile(both, [0.02, 0.98], axis=0)
    scale = np.where(flow.angles, np.pi, np.maximum(0.5 * (high - low), LEAST * flow.scale))
    reach = np.maximum(flow.reach, 0.5 * np.ptp(both, axis=0))
    now = replace(flow, scale=scale, middle=0.5 * (low + high), reach=reach)
    if not flow.forced:  # at least as long as motions took to get there
        now = replace(now, period=max(flow.period, min(_time_of_change(now, y[kept]), SLOWER * flow.period)))
    return _with_steps(now, np.concatenate([sample[kept], y[kept]]), int(np.count_nonzero(kept)))


def _time_of_change(flow: Flow, states: Floats) -> float:
    """In which most states (n, dim) change by about their size [s]: 2 pi times size over rate."""
    speed = np.abs(flow.rates(states) / flow.scale).max(axis=1)
    speed = speed[np.isfinite(speed)]
    speed = speed[speed > REPEATS * speed.max(initial=0.0)]  # the others rest
    return 2.0 * math.pi / float(np.median(speed)) if speed.size else flow.period


def _with_steps(flow: Flow, sample: Floats, stay: int = 0) -> Flow:
    """The same with as many steps of a period as keep :data:`ERROR` for nearly all of a sample.

    The first ``stay`` states are known to go on, or to stop. Steps that are too long for it send a motion to
    infinity too: what is lost is lost with the shortest ones as well, if later, as motions on the way there
    turn ever faster. What comes back from where it is known to be was not lost: the reach of starts that lie
    close together is too small.

    Raises:
        InputError: no number of steps does.
    """
    one = np.array([1.0])
    before = flow.run(sample, one)
    while flow.steps < MOST:
        finer = replace(flow, steps=2 * flow.steps)
        now = finer.run(sample, one)
        kept = before.goes_on & ~now.stopped
        with np.errstate(over="ignore"):  # of motions on the way to infinity
            away = np.nan_to_num(flow.distance(before.y[-1], now.y[-1]), nan=np.inf)
        error = np.sort(away[kept])
        allowed = ERROR * max(1.0, flow.steps / ROUGH)
        stays = (now.goes_on | now.stopped)[:stay].all()
        if stays and (not error.size or error[int(MOSTLY * (error.size - 1))] <= allowed):
            lost = np.flatnonzero(~kept & ~now.stopped)
            back = lost[replace(flow, steps=MOST).run(sample[lost], LATER).goes_on] if lost.size else lost
            if not back.size:
                return flow
            known = np.abs(before.y[-1, back[away[back] <= allowed]] - flow.middle)
            if len(known):
                flow = replace(flow, reach=np.maximum(flow.reach, known.max(axis=0)))
                before = flow.run(sample, one)
                continue
        flow, before = finer, now
    implicit = isinstance(flow.method, ImplicitRungeKutta)
    stiff = "" if implicit else "where motion is stiff find_attractors alone takes method='radau5', "
    raise InputError(
        f"dt: even steps of {flow.period / MOST:.3g} s leave errors above {ERROR:g} of the states' size in a "
        f"period of {flow.period:.3g} s; {stiff}smooth a right-hand side that jumps (tanh for sign), "
        "of one that is infinite somewhere end motions before by System(stop=...)"
    )


def require_flow(system: Any) -> None:
    """Refuse what has no attractors to be looked for: what is neither a system nor a mechanism."""
    if not isinstance(system, System | Mechanism):
        instead = "; of a Scene give fm.mechanisms.slider_pendulum()" if isinstance(system, Scene) else ""
        raise InputError(f"system = {shown(system)}: must be a System or a Mechanism{instead}")


def angles_of(system: Scene | Mechanism | System) -> tuple[str, ...]:
    """Names of the coordinates that turn fully."""
    if isinstance(system, System):
        return tuple(system.angles)
    return tuple(compress(system.state, system.turning))


def require_parameter(system: System | Mechanism, name: str) -> None:
    """Refuse a name that is none of the parameters; a load's plain numbers have none."""
    if isinstance(system, Mechanism) and name not in system.parameters:
        raise InputError(
            f"parameter = {shown(name)}: {nearest(name, system.parameters)}; a load's own number has no "
            "name: write a symbol for it and give its value, as help(fm.mechanisms.slider_pendulum) shows"
        )
    checks.one_of("parameter", name, system.parameters)


def keeps_moving(scene: object) -> bool:
    """Whether motions settle on attractors to be looked for: nothing stops them, or loads that repeat."""
    if isinstance(scene, System):
        return scene.stop is None
    loads = scene.loads if isinstance(scene, Mechanism) else ()
    return any(math.isinf(sum(load.to_come(0.0))) and load.facts().period for load in loads)


def period_of(scene: System | Mechanism, values: Mapping[str, float]) -> float | None:
    """The period [s] of a system, or the common one of a mechanism's loads, with ``values`` of parameters.

    None: it has none, loads are constant.

    Raises:
        InputError: a load is not periodic, or they have none in common.
    """
    if isinstance(scene, System):
        return scene.period_at(values)
    periods: list[float] = []
    for load in (acting.at({**scene.parameters, **values}) for acting, *_ in scene.acting):
        if sum(load.to_come(0.0)) == 0.0:
            continue
        period = load.facts().period
        if period is None:
            raise InputError(
                f"loads: {type(load).__name__} is not periodic; motions settle under loads that all "
                "repeat or stay, or that all fade"
            )
        periods.append(period)
    if not periods:
        return None
    for k in range(1, MULTIPLES + 1):
        common = k * max(periods)
        if all(abs(common / p - round(common / p)) < 1e-9 * common / p for p in periods):
            return common
    raise InputError(
        f"loads: their periods {', '.join(f'{p:g}' for p in periods)} s have no common multiple of "
        f"{MULTIPLES} or fewer of the longest"
    )


def statuses(flow: Flow, reached: Reached) -> NDArray[np.int8]:
    """What became of motions: OK, ESCAPED, OUT_OF_RANGE, UNDECIDED or NOT_FINITE (n,)."""
    lost = ~np.isfinite(reached.y[-1]).all(axis=1)
    status = np.where(lost, Status.NOT_FINITE, Status.OK)
    if reached.away is not None:
        status[reached.away] = Status.UNDECIDED
    status[reached.far] = Status.ESCAPED
    ended = Status.OUT_OF_RANGE if isinstance(flow.scene, Mechanism) else Status.ESCAPED
    return np.where(reached.stopped, ended, status).astype(np.int8)
