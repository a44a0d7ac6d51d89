"""The gallery: every case of ``cases.toml`` with the function that goes through it.

To add a case, write its table there, and here a function of the name that it gives as ``walk``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.basins.label import label_starts
from fastmech.ensembles.integrate import Trajectories, integrate
from fastmech.ensembles.status import Status
from fastmech.errors import InputError
from fastmech.integrators.methods import ImplicitRungeKutta, find_method
from fastmech.scene import Scene
from fastmech.slider.atlas.folds import find_folds
from fastmech.slider.balance import lowest_potential
from fastmech.slider.equilibria import find_equilibria
from fastmech.slider.linearize import jacobian
from fastmech.step_limits.warning import (
    beyond_stability,
    impulse_ratio,
    largest_stable_step,
    step_limit,
    step_warning,
)
from fastmech.studies.hardcases import walk
from fastmech.studies.hardcases.limits import amplification
from fastmech.studies.hardcases.walk import HardCase
from fastmech.studies.reporting import content
from fastmech.transients.lyapunov import largest_lyapunov

Rows = Iterator[walk.CaseRow]

#: Why a method claims nothing of an undamped motion; why it claims what it does.
DRIVEN, HALVED = "undamped motions grow with every step", "twice what halving the step tells"

#: Error that lanes of float32 claim: fm.integrate's documentation.
SINGLE = 1e-4

PAPER = Scene(c2=1100 / 3, alpha=0.0)
UNDAMPED = Scene(c2=1100 / 3, beta=0.0, F0=0.0)
BISTABLE = Scene(c1=294.9, c2=92.85, alpha=0.0)


def motions(
    quick: bool,
    name: str,
    refused: float,
    step: float = 0.0,
    claims: Sequence[tuple[str, float, float]] = (),
    all_refuse: bool = True,
    why: str = "a step far too long",
    single: bool = False,
    rounded: float = walk.ROUNDED,
    stiff: bool = False,
    counted: Sequence[tuple[str, float, float, float]] = (),
) -> Rows:
    """A reference motion by every method, or few if ``quick``.

    Args:
        quick, name: which methods, and which reference.
        refused: step [s] that is far too long: what claims nothing is run with it.
        step: step [s] of methods without memory; 0: none claims anything.
        claims: method, step [s], error that it must keep.
        all_refuse, why: whether no method may give a number with the step ``refused``, and the reason.
        single: whether lanes of float32 claim it.
        rounded: relative error that rounding explains.
        stiff: whether explicit methods whose limit the step exceeds end with a status.
        counted: method, step [s], error that it must keep, how many times fewer calls than RK4's it takes.
    """
    goal = walk.motion(name, rounded)
    for count in counted:
        yield _counted_row(goal, *count)
    for claim in claims:
        yield walk.fixed_row(goal, *claim, "declared")
    for method in walk.walked(quick) if step else ():
        explicit = stiff and not isinstance(find_method(method), ImplicitRungeKutta)
        if explicit and step_warning(goal.scene, step, method, goal.start) is not None:
            yield walk.status_row(goal, method, step, "beyond its stability limit")
        else:
            yield walk.claimed_row(goal, method, step, refused)
    if single:
        for method in ("rk4", "dop853"):
            yield walk.fixed_row(
                goal, method, step, SINGLE, "what fm.integrate says of float32", dtype="float32"
            )
        yield walk.status_row(goal, "radau5", step, "float32 is not offered", "float32")
    for method in walk.walked(quick) if all_refuse else ():
        yield walk.status_row(goal, method, refused, why)


def _counted_row(goal: walk.Goal, method: str, dt: float, allowed: float, fewer: float) -> walk.CaseRow:
    """A declared claim with every right-hand side counted; too many of them fail the row."""
    row = walk.fixed_row(goal, method, dt, allowed, "L-stable")
    calls, path = walk.counted(goal, method, round(goal.t_end / dt))
    least = walk.explicit_calls(goal, path)
    times = f"{least / calls:.0f} times as many"
    remark = f"{calls:,} right-hand sides; RK4 at its limit {least:,.0f}, {times}"
    error = max(row.error, goal.error(path[-1])) if least >= fewer * calls else np.inf
    return row._replace(error=error, remark=remark)


#: Step [s] and steps of long undamped motions, full and quick; steps of the runs of all methods.
DT, STEPS, QUICK_STEPS, WALK_STEPS, QUICK_WALK_STEPS = 0.01, 1_000_000, 10_000, 50_000, 5_000


def energy_history(
    start: Sequence[float], method: str, formulation: str, steps: int, dt: float = DT
) -> tuple[Floats, Floats, Trajectories]:
    """Times [s], relative energy error at each, and the run, of a long conservative motion."""
    times = np.linspace(0.0, steps * dt, 201)[1:]
    run = integrate(UNDAMPED, start, t_eval=times, dt=dt, method=method, formulation=formulation)
    begin = walk.energy(UNDAMPED, np.array(start))
    size = float(begin) - lowest_potential(UNDAMPED)
    return times, (walk.energy(UNDAMPED, run.y[:, 0]) - begin) / size, run


def undamped(quick: bool, start: Sequence[float], claims: Sequence[tuple[str, str, float, float]]) -> Rows:
    """No damper, no force, a million steps: what happens to the energy.

    The methods that the case is about claim a trend and a drift beforehand (``claims``: method, formulation,
    allowed trend, allowed drift). The trend is the slope of a straight line through the energy error times
    the length of the run, without its oscillation. Any method's shorter run claims what halving its step
    tells of the largest energy error.
    """
    for method, formulation, allowed, most in claims:
        times, error, run = energy_history(start, method, formulation, QUICK_STEPS if quick else STEPS)
        trend = abs(float(np.polyfit(times, error, 1)[0])) * times[-1]
        drift = float(np.abs(error).max())
        kept, why = trend if drift <= most else np.inf, f"declared; drift to {most:.0e}"
        yield walk.row_of(run, kept, allowed, drift, remark=formulation, why=why)
    steps = QUICK_WALK_STEPS if quick else WALK_STEPS
    for method in walk.walked(quick):
        dt = walk.admitted_step(UNDAMPED, method, DT, np.array([start]))
        count = round(steps * DT / (dt or DT))
        fitted = steps * DT / count
        _, error, run = energy_history(start, method, "lagrange", count, fitted)
        drift = float(np.abs(error).max())
        if dt == 0.0:
            yield walk.row_of(run, drift, why=DRIVEN)
        else:
            half = energy_history(start, method, "lagrange", 2 * count, 0.5 * fitted)
            allowed = 2.0 * walk.halving_tells(method, error, half[1]) + 1e-11
            yield walk.row_of(run, drift, allowed, drift, remark="lagrange, largest error", why=HALVED)


#: Length of slowly decaying runs [s] and steps that are too many, full and quick; the longest step [s], and
#: one that no method without a claim survives.
FULL, QUICK = (4000.0, 2_000_000), (500.0, 200_000)
SLOW_DT, TOO_LONG = 0.05, 0.5

#: Exponent by which a method itself may change the energy of an undamped mode, and error of the power.
KEPT, POWER_ALLOWED = 0.05, 0.1

#: Outputs of a run, and bins of its last three quarters.
OUTPUTS, BINS = 4000, 10


class _Slow(NamedTuple):
    """A motion whose energy above a level falls like a power of time."""

    scene: Scene
    start: Sequence[float]
    level: float  #: J
    frequency: float  #: of the mode that nothing damps [rad/s]

    def run(self, method: str, dt: float, length: float) -> tuple[Trajectories, float]:
        """A run, and the p of E = C (t + t0)^-p over its last three quarters; NaN: below the level.

        E / -E' = (t + t0) / p is a straight line in t whatever the unknown t0; rates come from means over
        bins, which are long against the oscillation.
        """
        t = np.linspace(0.0, length, OUTPUTS + 1)[1:]
        run = integrate(self.scene, self.start, t_eval=t, dt=dt, method=method)
        above = walk.energy(self.scene, run.y[:, 0]) - self.level
        if not (above > 0.0).all():
            return run, np.nan
        late = slice(t.size // 4, None)
        bins, logs = (part.reshape(BINS, -1).mean(axis=1) for part in (t[late], np.log(above[late])))
        middle, rate = 0.5 * (bins[1:] + bins[:-1]), -np.diff(logs) / np.diff(bins)
        return run, 1.0 / float(np.polyfit(middle, 1.0 / rate, 1)[0])

    def kept_step(self, method: str, length: float, most: int) -> float:
        """Longest step [s] with which the energy's own exponent, 2 ln|R(i omega h)| / h, is small, or 0."""
        for dt in walk.halved(SLOW_DT, length, most):
            own = abs(np.log(amplification(find_method(method), 1j * self.frequency * dt))) / dt
            if 2.0 * float(own) * length <= KEPT:
                if beyond_stability(self.scene, dt, method):
                    dt = walk.WITHIN * step_limit(self.scene, method)
                return dt if length <= most * dt else 0.0
        return 0.0

    def unclaimed(self, method: str, length: float, why: str) -> walk.CaseRow:
        """The row of a method that claims nothing."""
        return walk.row_of(integrate(self.scene, self.start, length, TOO_LONG, method), np.nan, why=why)


def missed(quick: bool, scene: dict[str, float], near: tuple[float, float], power: float) -> Rows:
    """Motions that decay like a power of time because the damping misses a mode."""
    here = Scene(alpha=0.0).replace(**scene)
    rest = min(find_equilibria(here), key=lambda e: abs(e.phi - near[0]) + abs(e.theta - near[1]))
    values = np.linalg.eigvals(jacobian(here, rest))
    at, frequency = np.array([*rest.position, 0.0, 0.0]), np.abs(values[np.argmin(np.abs(values.real))].imag)
    slow = _Slow(here, at + np.array([0.0, 0.4, 0.0, 0.0]), float(walk.energy(here, at)), float(frequency))
    for method in walk.walked(quick):
        length, most = QUICK if quick else FULL
        dt = slow.kept_step(method, length, most)
        if dt == 0.0 and not quick:  # the shorter run asks for less
            length = QUICK[0]
            dt = slow.kept_step(method, length, most)
        if dt == 0.0:
            yield slow.unclaimed(method, length, "drives the mode that nothing damps")
        else:
            run, found = slow.run(method, dt, length)
            remark, why = f"E ~ t^-{found:.3f}", "its own damping of the mode is far less"
            yield walk.row_of(run, abs(found - power), POWER_ALLOWED, remark=remark, why=why)


def endless_circling(quick: bool) -> Rows:
    """M2 circles M1 for ever: no label, and the energy above the orbit falls like 1/t."""
    length, most = QUICK if quick else FULL
    scene, start = Scene(F0=0.0, c1=94.14384, c2=50.0, alpha=0.0), [-np.pi / 2 + 0.02, 0.3, 0.0, 3.081045]
    turning = float(np.sqrt(scene.c1 / scene.m2))
    orbit = float(walk.energy(scene, np.array([-np.pi / 2, 0.0, 0.0, turning])))
    slow = _Slow(scene, start, orbit, turning)
    for method in walk.walked(quick):
        finer = None
        for dt in walk.halved(slow.kept_step(method, length, most), 2.0 * length, most):
            run, power = finer or slow.run(method, dt, length)
            finer = slow.run(method, 0.5 * dt, length)
            if abs(power - finer[1]) <= 0.5 * POWER_ALLOWED:
                # M2 has turned at the orbit's rate all the time.
                turns = float(run.y[-1, 0, 1]) / (2.0 * np.pi)
                still = abs(turns * 2.0 * np.pi / length / turning - 1.0) < 0.02
                error = abs(power - 1.0) if still else np.inf
                remark, why = f"E ~ t^-{power:.3f}, {turns:.0f} turns", "half the step tells the same"
                yield walk.row_of(run, error, POWER_ALLOWED, remark=remark, why=why)
                break
        else:
            why = f"drives the turning, or half the step tells otherwise, to {most:,} steps"
            yield slow.unclaimed(method, length, why)
    for method in walk.labellers(quick):
        labels = label_starts(scene, start, 60.0, method=method)
        yield walk.labels_row(method, labels, int((labels.status == Status.CAPTURED).sum()))


#: Distance from the fold [N]; longest step, length of the creeping part that every method runs, and of the
#: whole passage [s]; methods with steps as long as the last run the whole passage in the full version.
DISTANCE, CREEPING, WHOLE, AFFORDABLE = 1e-6, 3000.0, 20_000.0, 0.04

#: Relative error of the place on the way, or of the time of leaving: the normal form's own.
FOLD_ALLOWED = 0.01

#: Starts for labels: distances [rad] from the saddle, or its ghost, along the way; positive: outwards.
OUTWARDS = np.array([-1e-3, -1e-4, -1e-5, 0.0, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1])


def beside_fold(quick: bool, side: float) -> Rows:
    """One part in a million from a fold, before (-1) or behind it (1): a passage that looks like rest.

    Near a fold the motion follows one direction, x' = b (x^2 - d^2) with the minimum and the saddle at -d and
    d before it, x' = b (x^2 + d^2) behind it (the normal form: Strogatz, *Nonlinear Dynamics and Chaos*,
    sections 3.1 and 4.3). The saddle's growing eigenvalue before the fold is r = 2 b d, so that from the
    middle x = -d tanh(r t / 2) before and d tan(r t / 2) behind it: the ghost is left after pi / r, some
    5000 s.
    """
    fold = find_folds(BISTABLE, "F0", np.linspace(600.0, 750.0, 16))[0]
    before, here = (BISTABLE.replace(F0=fold.value + s * DISTANCE) for s in (-1.0, side))
    places = [e for e in find_equilibria(before) if np.hypot(e.phi - fold.phi, e.theta - fold.theta) < 0.02]
    minimum, saddle = (next(e for e in places if e.morse_index == index) for index in (0, 1))
    middle = np.mean([minimum.position, saddle.position], axis=0)
    away = np.subtract(saddle.position, minimum.position)
    d, rate = 0.5 * float(np.linalg.norm(away)), float(np.linalg.eigvals(jacobian(before, saddle)).real.max())
    way, start, equilibria = 0.5 * away / d, [*middle, 0.0, 0.0], find_equilibria(here)

    def row(run: Trajectories, error: float, remark: str) -> walk.CaseRow:
        return walk.row_of(run, error, FOLD_ALLOWED, remark=remark, why="resolves the slow rate")

    def creeping(method: str) -> walk.CaseRow:
        """How far the motion has crept, by its phase r t / 2, against the normal form's."""
        dt = walk.admitted_step(here, method, SLOW_DT)
        run = integrate(here, start, CREEPING, dt or SLOW_DT, method)
        x = float((run.y[-1, 0, :2] - middle) @ way) / d
        with np.errstate(invalid="ignore"):
            phase = np.arctan(x) if side > 0.0 else -np.arctanh(x)
        error = abs(float(phase) / (0.5 * rate * CREEPING) - 1.0)
        return row(run, error, f"{x * d:.2e} rad on") if dt else walk.row_of(run, error, why=DRIVEN)

    def whole(method: str) -> walk.CaseRow:
        """The minimum that is reached in the end, and when the ghost is left."""
        times = np.arange(10.0, WHOLE + 5.0, 10.0)
        run = integrate(here, start, dt=SLOW_DT, method=method, t_eval=times)
        gone = np.linalg.norm(run.y[:, 0, :2] - middle, axis=1)
        if side < 0.0:
            return row(run, abs(float(gone[-1]) / d - 1.0), "at the shallow minimum")
        left = float(times[np.argmax(gone > 0.1)]) if (gone > 0.1).any() else np.inf
        end = next(e for e in equilibria if e.morse_index == 0)
        off = float(np.abs(np.exp(1j * (run.y[-1, 0, :2] - end.position)) - 1.0).max())
        error = abs(left * rate / np.pi - 1.0) if off < 1e-3 else np.inf
        return row(run, error, f"left after {left:g} s, {off:.0e} rad from the minimum in the end")

    rows = [creeping(method) for method in walk.walked(quick)]
    yield from rows
    for one in rows:
        if not quick and one.claimed and one.dt >= AFFORDABLE:
            yield whole(one.method)
    # No start may be given to a well that it does not end in, and none be settled on the way.
    wells = [k for k, e in enumerate(equilibria) if e.morse_index == 0]
    near = [np.hypot(*np.subtract(equilibria[k].position, middle)) < 0.02 for k in wells]
    shallow, deep = [k for k, is_near in zip(wells, near, strict=True) if is_near], wells[near.index(False)]
    starts = np.zeros((OUTWARDS.size, 4))
    starts[:, :2] = middle + ((d if side < 0.0 else 0.0) + OUTWARDS[:, None]) * way
    # Before the fold starts on the saddle, and inwards of it, are not the deep well's.
    inside = (OUTWARDS <= 0.0) & (side < 0.0)
    for method in walk.labellers(quick):
        found = label_starts(here, starts, 60.0, method=method, settle_radius=0.05)
        assert found.settle_time is not None
        right = np.where(inside, np.isin(found.well, shallow) & (OUTWARDS < 0.0), found.well == deep)
        captured = found.status == Status.CAPTURED
        wrong = int((captured & ~right).sum() + np.isfinite(found.settle_time).sum())
        yield walk.labels_row(method, found, wrong, "; none settled")


#: A saddle's scene, steps [s], and how near the manifold is found [rad].
SADDLE, SADDLE_DT, CLOSEST = BISTABLE.replace(F0=85.3), 0.02, 1e-12


def saddle_manifold(quick: bool) -> Rows:
    """A start on a saddle's stable manifold to 1e-12: the smallest difference decides where it ends."""
    saddle = next(e for e in find_equilibria(SADDLE) if e.morse_index == 1)
    values, vectors = np.linalg.eig(jacobian(SADDLE, saddle))
    fast = int(np.argmax(values.real))
    slow = min((k for k in range(4) if values[k].real < 0.0), key=lambda k: abs(values[k].imag))
    # The growing mode, its largest angle 1, and the slowest decaying one, its largest entry 1.
    out, along = vectors[:, fast].real, vectors[:, slow].real
    out, along = out / np.abs(out[:2]).max(), along / np.abs(along).max()
    # Columns of [real, imaginary] that form a basis, the fastest growing direction first.
    chosen = [int(k) if values[k].imag >= 0.0 else 4 + int(k) for k in np.argsort(-values.real)]
    basis = np.column_stack([vectors.real, vectors.imag])[:, chosen]
    basis[:, 0] = out
    place, share = np.array([*saddle.position, 0.0, 0.0]), np.linalg.inv(basis)[0]

    def starts(offset: Floats) -> Floats:
        """Starts at offsets [rad] along the growing mode."""
        return np.asarray(place + 0.1 * along + np.atleast_1d(offset)[:, None] * out)

    def leave(offset: Floats, method: str, dt: float) -> tuple[Floats, Floats, Trajectories]:
        """Sides on which starts at these offsets [rad] leave, and when [s]."""
        times = np.arange(SADDLE_DT, 40.0, 10 * SADDLE_DT)
        run = integrate(SADDLE, starts(offset), t_eval=times, dt=dt, method=method)
        aside = (run.y - place) @ share
        far = np.abs(aside) > 0.3
        first = np.argmax(far, axis=0)
        when = np.where(far.any(axis=0), times[first], np.inf)
        return np.sign(aside[first, np.arange(offset.size)]), when, run

    def root(method: str, dt: float) -> float:
        """Offset [rad] of the start on the stable manifold, by bisection."""
        low, high = -0.1, 0.1
        while high - low > CLOSEST:
            middle = np.linspace(low, high, 18)
            side, _, _ = leave(middle, method, dt)
            change = int(np.argmax(side != side[0]))
            low, high = middle[change - 1], middle[change]
        return 0.5 * (low + high)

    for method in walk.walked(quick, euler=False):
        dt = walk.admitted_step(SADDLE, method, SADDLE_DT)
        side, when, run = leave(root(method, dt) + np.array([-CLOSEST, CLOSEST, 1e-10, 1e-3]), method, dt)
        # Each factor of ten nearer stays longer by ln(10)/growth.
        measured = float(np.log(1e-3 / 1e-10) / (when[2] - when[3]))
        error = abs(measured / float(values[fast].real) - 1.0) if side[0] != side[1] else np.inf
        remark = f"growth {measured:.4f} 1/s; 1e-12 on either side leave apart after {when[:2].min():.0f} s"
        yield walk.row_of(run, error, 0.05, remark=remark, why="its own manifold")
    # Labels of starts on either side: the side's well, or none.
    manifold, distance = root("dop853", 0.25 * SADDLE_DT), 10.0 ** -np.arange(2.0, 13.0)
    far = label_starts(SADDLE, starts(manifold + np.array([-1.0, 1.0]) * distance[0]), 100.0)
    assert (far.status == Status.CAPTURED).all()
    offsets = np.concatenate([-distance, [0.0], distance])
    right = (offsets > 0.0).astype(int)
    for method in walk.labellers(quick):
        found = label_starts(SADDLE, starts(manifold + offsets), 100.0, method=method)
        captured = found.status == Status.CAPTURED
        wrong = captured & (
            (found.well != far.well[right]) | (found.turns != far.turns[right]).any(axis=1) | (offsets == 0.0)
        )
        nearest = np.abs(offsets[captured]).min(initial=np.inf)
        told = f", to {nearest:.0e} rad" if captured.any() else ""
        yield walk.labels_row(method, found, wrong.sum(), told)


#: Start of a chaotic motion; its difference to its neighbours, and what counts as lost, of the largest state.
CHAOTIC_START, SEED, LOST = np.array([0.3, 2.5, 3.0, -4.0]), 1e-12, 1e-2


def chaos_predictability(quick: bool) -> Rows:
    """How long chaotic motion can be predicted."""
    found = largest_lyapunov(UNDAMPED, CHAOTIC_START, 500.0 if quick else 5000.0, 0.01)
    exponent = float(found.largest[0])
    expected = np.log(LOST / SEED) / exponent
    times = np.arange(0.1, 4.0 * expected, 0.1)
    shifts = SEED * np.random.default_rng(1).normal(size=(16 if quick else 64, 4))
    starts = np.concatenate([[CHAOTIC_START], CHAOTIC_START + shifts])
    for method in walk.walked(quick):
        dt = walk.admitted_step(UNDAMPED, method, 0.01, starts)
        run = integrate(UNDAMPED, starts, t_eval=times, dt=dt or 0.01, method=method)
        if dt == 0.0:
            yield walk.row_of(run, np.nan, why=DRIVEN)
            continue
        lost = np.linalg.norm(run.y[:, 1:] - run.y[:, :1], axis=2) > LOST
        when = float(np.median(np.where(lost.any(axis=0), times[np.argmax(lost, axis=0)], np.inf)))
        remark = f"exponent {exponent:.3f} 1/s, lost after {when:.1f} s, expected {expected:.1f} s"
        yield walk.row_of(run, abs(np.log2(when / expected)), 1.0, remark=remark, why="neighbours part alike")


#: Time of the way out [s]; step that no chaotic motion survives [s]; steps that are too many to get a number.
REVERSE, CHAOS_TOO_LONG, CHAOS_STEPS = 20.0, 1.0, 100_000


def _there_and_back(method: str, dt: float) -> tuple[Trajectories, Floats, float]:
    """The way back, the state in which it ends, rates turned again, and the energy error of the way out."""
    back = np.array([1.0, 1.0, -1.0, -1.0])
    there = integrate(UNDAMPED, CHAOTIC_START, REVERSE, dt, method)
    begin = float(walk.energy(UNDAMPED, CHAOTIC_START))
    drift = abs(float(walk.energy(UNDAMPED, there.y[-1, 0])) - begin) / abs(begin)
    again = integrate(UNDAMPED, there.y[-1, 0] * back, REVERSE, dt, method)
    return again, again.y[-1, 0] * back, drift


def chaos_reversed(quick: bool) -> Rows:
    """Whether chaotic motion comes back in reverse; claimed to what halving tells and rounding that grew."""
    for method, dt in (("dop853", 0.005), ("abm12", 0.002), ("gauss6", 0.002)):
        again, end, drift = _there_and_back(method, dt)
        yield walk.row_of(again, float(np.abs(end - CHAOTIC_START).max()), 1e-4, drift, why="declared")
    for method in walk.walked(quick):
        longest = walk.admitted_step(UNDAMPED, method, 0.01, np.array([CHAOTIC_START]))
        for dt in walk.halved(longest, REVERSE, CHAOS_STEPS):
            again, end, drift = _there_and_back(method, dt)
            estimate = walk.halving_tells(method, end, _there_and_back(method, 0.5 * dt)[1])
            if estimate <= 0.05:
                error, claim = float(np.abs(end - CHAOTIC_START).max()), 2.0 * estimate + 1e-4
                yield walk.row_of(again, error, claim, drift, why=HALVED)
                break
        else:
            run = integrate(UNDAMPED, CHAOTIC_START, REVERSE, CHAOS_TOO_LONG, method)
            why = f"errors grow e^{0.634 * 2 * REVERSE:.0f} times: no claim with {CHAOS_STEPS:,} steps"
            yield walk.row_of(run, np.nan, why=why)


#: Time in which motions come to the saddle [s]: the error that a method makes until then moves its boundary.
NEAR = 5.0

#: Distance from which on every end must be right: a thousand roundings of phi, which is near 1; they grow on
#: the way to the saddle.
RIGHT_FROM = {"float64": 1e-12, "float32": 1e-4}


def float32_at_a_boundary(quick: bool) -> Rows:
    """Lanes of float32 beside lanes of float64: rounding decides where a motion ends."""
    scene, phi, below, above = walk.boundary()
    distances = 10.0 ** -np.arange(3.0, 15.0)
    shift = np.concatenate([-distances, distances])
    starts = np.zeros((shift.size, 4))
    starts[:, 0] = phi + shift

    def ends(method: str, dtype: str) -> walk.CaseRow:
        """Where motions end in one precision; the boundary that a method sees moves by its own error, too."""
        dt = walk.admitted_step(scene, method, DT)
        try:
            run = integrate(scene, starts, 60.0, dt, method, dtype=dtype)
        except InputError as refusal:
            return walk.refused_row(method, dt, refusal, "float32 is not offered")
        to_above, to_below = (np.abs(run.y[-1, :, :2] - end).max(axis=1) for end in (above, below))
        error = float(np.abs(shift)[(to_above < to_below) != (shift > 0.0)].max(initial=0.0))
        near, half = (integrate(scene, starts, NEAR, h, method).y[-1] for h in (dt, 0.5 * dt))
        allowed = RIGHT_FROM[dtype] + 2.0 * walk.halving_tells(method, near, half)
        farthest = f"farthest wrong end {error:.0e} rad from the boundary" if error else "every end is right"
        remark, why = f"{dtype}: {farthest}", "rounding, and what halving the step tells"
        return walk.row_of(run, error, allowed, remark=remark, why=why)

    for method in walk.walked(quick, euler=False):
        for dtype in RIGHT_FROM:
            yield ends(method, dtype)
    # Of labels with a proof none may be wrong, and near the boundary there must be none but a status.
    right = np.where(shift[:, None] > 0.0, above, below)
    for method in walk.labellers(quick):
        found = label_starts(scene, starts, 60.0, method=method)
        assert found.tree is not None
        places = np.array([found.tree.equilibria[w].position for w in found.well])
        proved = found.status == Status.CAPTURED
        wrong = proved & (np.abs(places + 2.0 * np.pi * found.turns - right).max(axis=1) > 0.1)
        nearest = float(np.abs(shift)[proved].min(initial=np.inf))
        others = ", ".join(sorted({Status(s).name.lower() for s in found.status[~proved]}))
        remark = f"labels: {proved.sum()} of {shift.size} proved, to {nearest:.0e} rad; nearer: {others}"
        yield walk.labels_row(method, found, wrong.sum())._replace(remark=remark)


#: Starts that are not finite, or nearly so, by the trajectory that has one.
BAD = {3: np.nan, 17: np.inf, 18: -np.inf, 40: 1e200, 41: 5e-324, 42: -1e-310}


def bad_neighbours(quick: bool) -> Rows:
    """One block with and without unusual starts."""
    n = 64 if quick else 256
    starts = np.random.default_rng(1).uniform([-2, -2, -3, -3], [2, 2, 3, 3], (n, 4))
    mixed, healthy = starts.copy(), np.delete(np.arange(n), list(BAD))
    for lane, value in BAD.items():
        mixed[lane, lane % 4] = value
    kinds = [(method, "float64") for method in walk.walked(quick)]
    for method, dtype in [*kinds, *((name, "float32") for name in ("rk4", "dop853", "abm8"))]:
        with np.errstate(over="ignore"):  # 1e200 has no float32
            alone, together = (integrate(PAPER, y, 0.5, 0.002, method, dtype=dtype) for y in (starts, mixed))
        status = together.status
        same = np.array_equal(alone.y[:, healthy], together.y[:, healthy])
        told = (status[[3, 17, 18]] == Status.START_NOT_FINITE).all() and status[40] != Status.OK
        fine = (status[healthy] == Status.OK).all() and (status[[41, 42]] == Status.OK).all()
        remark = f"{dtype}; unusual starts: {', '.join(walk.worst([status[lane]]) for lane in BAD)}"
        error = 0.0 if same and told and fine else np.inf
        row = walk.row_of(together, error, 0.0, remark=remark, why="lanes do not know each other")
        yield row._replace(status=walk.worst(status[healthy]))


#: Step [s] for methods that claim nothing of a force that is gone at once.
FAR_TOO_LONG = 2.0


def sudden_decay(quick: bool) -> Rows:
    """A force gone within a step."""
    m = walk.motion("sudden_decay")
    gone = 50.0 / m.scene.alpha
    after = m._replace(scene=m.scene.replace(F0=0.0), t_end=m.t_end - gone)
    for method in walk.walked(quick):
        # Short steps while the force lasts, then those of the motion.
        first = integrate(m.scene, m.start, gone, 0.01 / m.scene.alpha, method)
        row = walk.claimed_row(after._replace(start=first.y[-1, 0]), method, 0.005, FAR_TOO_LONG)
        warned = step_warning(m.scene, row.dt, method)
        wrong = "" if warned and "impulse" in warned else "; NOT warned"
        times = impulse_ratio(find_method(method), row.dt * m.scene.alpha)
        remark = f"at dt = {row.dt:.3g} s from the start the impulse would be {times:.3g} times itself{wrong}"
        yield row._replace(error=row.error if not wrong else np.inf, remark=remark)


def steps_ten_times_too_long(quick: bool) -> Rows:
    """Steps ten times too long: a warning before, and a status for every single trajectory."""
    minimum = next(e for e in find_equilibria(PAPER) if e.morse_index == 0)
    starts = np.random.default_rng(2).uniform([0.5, -1, 0, 0], [2.5, 1, 0, 0], (32 if quick else 256, 4))
    for method in walk.walked(quick):
        dt = 10.0 * largest_stable_step(PAPER, minimum, method)
        if np.isfinite(dt):  # else A-stable: no step is too long for stability
            told = step_warning(PAPER, dt, method) is not None
            run = integrate(PAPER, starts, 400.0 * dt, dt, method)
            share = float((run.status != Status.OK).mean())
            remark = f"{share:.0%} flagged{', warned before' if told else ', NOT warned before'}"
            row = walk.row_of(run, np.nan, remark=remark, why="beyond its limit")
            yield row._replace(status=walk.worst(run.status) if share == 1.0 and told else "ok")


def _case(name: str, hard: str, oracle: str, must: str, walk: str = "", **given: Any) -> HardCase:
    function = globals()[walk or name]
    own = given | ({"name": name} if function is motions else {})
    return HardCase(name, hard, oracle, must, lambda quick: list(function(quick, **own)))


#: Every case by its name.
CASES = {name: _case(name, **about) for name, about in content(__package__, "cases.toml").items()}
