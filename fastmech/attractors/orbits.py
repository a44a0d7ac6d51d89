"""Fixed points and periodic orbits by Newton's method on the period map, many guesses on lanes at once.

Multipliers are eigenvalues of the map's Jacobian; a fixed point of the map over p periods whose multipliers
lie inside the unit circle attracts (Guckenheimer, Holmes, *Nonlinear Oscillations*, section 1.5).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from fastmech.arrays import Flags, Floats
from fastmech.attractors.flow import FINER, Flow, SectionFlow

#: Newton's iterations at most, and the residual over the scale of what counts as found: rounding of a run.
ITERATIONS, RESIDUAL = 16, 1e-9

#: Multipliers below this attract: beyond it a motion needs a million periods.
ATTRACTS = 1.0 - 1e-5

#: Share of a Jacobian's size that differences do not tell; multipliers of a period that those of the map do,
#: and from which on to a percent; steps of the linear equation in a forcing period at least.
ROUNDING, LEAST, TOLD, STEPS = 1e-9, 1e-8, 1e-6, 64

#: Iterations for places of rest, the shares of a step of which the best is taken, and times of a period over
#: which rates are averaged.
REST_ITERATIONS, SHARES, TIMES = 30, 0.5 ** np.arange(8.0), 16

#: A place of rest is one of the map over a part of the period as well, which costs so many times less.
SHORTER = 32

#: Places of the same orbit are nearer than this share of the scale.
SAME = 1e-5

#: Times at most that what was found may go around a cycle.
WOUND = 64

#: Places along a cycle that are kept in so many periods of the flow, and at most so many times these.
ALONG, TURNS, LONGER = 256, 4.0, 8


@dataclass(frozen=True)
class Orbit:
    """A periodic motion, or a place of rest."""

    points: Floats  #: places (m, dim): after each forcing period, or all along a cycle
    periods: float  #: its period in the flow's periods; of a place of rest 0
    jacobians: Floats  #: of the map over its period at each place (m, dim, dim)
    multipliers: NDArray[np.complex128]  #: of the map; of a cycle without the one along it
    residual: float  #: of the map, over the scale
    cycle: bool = False  #: of a system that knows no time


def newton(flow: Flow, guesses: Floats, periods: int) -> tuple[Floats, Floats, Floats]:
    """Fixed points of the map over so many periods: places (n, dim), residuals (n,), Jacobians.

    The residual is infinite where the iteration ends elsewhere than it began or nowhere.
    """
    parts = SHORTER if periods == 1 and not flow.forced else 1
    y, best = guesses.copy(), np.full(len(guesses), np.inf)
    J = np.zeros((*y.shape, y.shape[1]))
    identity, active = np.eye(y.shape[1]), np.arange(len(y))
    step = np.zeros_like(y)
    for _ in range(ITERATIONS):
        if not active.size:
            break
        image, jacobian = flow.derivative(y[active], periods / parts)
        error = parts * flow.away(image, y[active])
        residual = np.abs(error / flow.scale).max(axis=1)
        usable = np.isfinite(residual) & np.isfinite(jacobian).all(axis=(1, 2))
        better = usable & (residual < best[active])
        J[active[better]], best[active[better]] = jacobian[better], residual[better]
        # A step that did not help is halved.
        worse = active[~better]
        step[worse] *= 0.5
        y[worse] -= step[worse]
        for k in np.flatnonzero(better):
            i = active[k]
            step[i] = _solution(parts * (jacobian[k] - identity), -error[k], flow.scale)
            step[i] *= 0.5 / max(0.5, np.abs(step[i] / flow.scale).max())
            y[i] += step[i]
        rounded = ~better & (best[active] < RESIDUAL)
        y[active[rounded]] -= step[active[rounded]]  # back to the best: rounding is all that is left
        small = np.abs(step[active] / flow.scale).max(axis=1) < 1e-14
        done = (best[active] < 1e-13) | small | rounded
        active = active[~done]
    found = flow.distance(y, guesses) < 2.0
    return y, np.where(found, best, np.inf), np.linalg.matrix_power(J, parts)


def _solution(matrix: Floats, right: Floats, scale: Floats) -> Floats:
    """The step of least size; what is below the differences' rounding, along a multiple zero, tells none."""
    matrix, right = matrix * scale / scale[:, None], right / scale
    finite = np.isfinite(matrix).all() and np.isfinite(right).all()
    largest = float(np.linalg.norm(matrix, 2)) if finite else 0.0
    if largest <= ROUNDING:
        return np.zeros_like(right)
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=max(ROUNDING / largest, 1e-13))[0] * scale)


def rests(flow: Flow, y: Floats) -> Floats:
    """Zeros of the rates, or of their mean over a period, that Newton's method finds from states (n, dim)."""
    times = flow.period * np.arange(TIMES) / TIMES if flow.forced else np.zeros(1)

    def mean(of: Callable[[Floats, float], Floats], y: Floats) -> Floats:
        return np.mean([of(y, t) for t in times.tolist()], axis=0)

    for _ in range(REST_ITERATIONS):
        J = mean(flow.slopes, y)
        usable = np.isfinite(J).all(axis=(1, 2))
        y, J = y[usable], J[usable]
        step = -np.einsum("nij,nj->ni", np.linalg.pinv(J), mean(flow.rates, y))
        largest = np.abs(step / flow.scale).max(axis=1, initial=0.0)
        step *= np.minimum(1.0, 0.5 / np.maximum(largest, 1e-300))[:, None]
        tried = y + step * SHARES[:, None, None]
        rates = mean(flow.rates, tried.reshape(-1, y.shape[1])).reshape(tried.shape) / flow.scale
        best = np.argmin(np.nan_to_num((rates**2).sum(axis=2), nan=np.inf), axis=0)
        y = tried[best, np.arange(len(y))]
    return y[~flow.is_far(y) & (largest < SAME)]


def about_rests(flow: Flow, y: Floats) -> Floats:
    """Where small swings about zeros of the mean rates begin a period, by linear theory (m, dim).

    Newton's method on the map leads hardly from afar to motions about a place that repels.
    """
    found: list[Floats] = []
    for place in rests(flow, y):
        if all(flow.distance(place, other) > SAME for other in found):
            found.append(place)
    times = (flow.period * np.arange(TIMES) / TIMES).tolist()
    begin, rate = np.array(found).reshape(-1, y.shape[1]), 2j * np.pi / flow.period
    for k, place in enumerate(found):
        J = np.mean([flow.slopes(place[None], t)[0] for t in times], axis=0)
        pushes = np.fft.fft([flow.rates(place[None], t)[0] for t in times], axis=0) / TIMES
        for j in range(1, TIMES // 2):  # the other half are their conjugates
            swing = np.linalg.lstsq(j * rate * np.eye(place.size) - J, pushes[j], rcond=None)[0]
            begin[k] += 2.0 * swing.real
    return begin


def is_rest(flow: Flow, place: Floats) -> bool:
    """Whether a fixed point (dim,) of the map is a place of rest."""
    return not flow.forced or (isinstance(flow, SectionFlow) and bool(flow.speed(place[None])[0] < SAME))


def periodic(flow: Flow, guesses: Floats, periods: int) -> list[Orbit]:
    """Orbits of a system that repeats itself, or places of rest (periods = 1 of one that knows no time)."""
    found: list[Orbit] = []
    y, residual, _ = newton(flow, guesses, periods)
    for k in np.flatnonzero(residual < RESIDUAL):
        place = y[k]
        if any(visits(flow, orbit, place) for orbit in found):
            continue
        points = place[None]
        if periods > 1:
            after = flow.run(place[None], np.arange(1.0, periods), FINER).y[:, 0]
            points = np.concatenate([points, after])
            again = np.flatnonzero(flow.distance(points[1:], place) < SAME)
            points = points[: again[0] + 1] if again.size else points
        length = len(points)
        parts = 1 if flow.forced else SHORTER
        images, jacobians = flow.derivative(points, length / parts)
        if not np.isfinite(jacobians).all():
            continue  # beside it motions end
        error = flow.away(images[0], place)
        step = _solution(jacobians[0] - np.eye(place.size), -error, flow.scale)
        if np.abs(step / flow.scale).max() > SAME:
            continue  # Newton's method creeps towards a multiple zero
        rest, jacobians = is_rest(flow, place), np.linalg.matrix_power(jacobians, parts)
        multipliers = np.linalg.eigvals(jacobians[0])
        if rest:  # differences over a period would lose those of fast decay
            multipliers = np.exp(np.linalg.eigvals(flow.slopes(points)[0]) * flow.period)
        found.append(Orbit(points, 0.0 if rest else float(length), jacobians, multipliers, residual[k]))
    return found


def eigenvalues(flow: Flow, J: Floats) -> tuple[NDArray[np.complex128], float]:
    """Eigenvalues of a Jacobian (dim, dim) by differences, and their error: a multiple one is known less."""
    scaled = J * flow.scale / flow.scale[:, None]
    values, vectors = np.linalg.eig(scaled)
    share = min(np.linalg.cond(vectors) * ROUNDING, ROUNDING ** (1.0 / len(J)))
    return values.astype(np.complex128), float(share * np.linalg.norm(scaled))


def exponent(flow: Flow, orbit: Orbit) -> tuple[float, float, NDArray[np.complex128]]:
    """Largest Lyapunov exponent of an orbit [1/s], its error, and the multipliers of the map over its period.

    Along a cycle nothing grows or falls. Multipliers that differences of the map do not tell, of strongly
    damped motion, come from the linear equation along it, by Magnus's method of fourth order (Hairer, Lubich,
    Wanner, *Geometric Numerical Integration*, section IV.7) with two numbers of steps.
    """
    multipliers, span = orbit.multipliers, flow.period * (orbit.periods or 1.0)
    if orbit.periods == 0.0:
        values, error = eigenvalues(flow, flow.slopes(orbit.points)[0])
        return float(values.real.max()), error, multipliers
    if orbit.cycle or isinstance(flow, SectionFlow):
        return 0.0, 0.0, multipliers
    largest = float(np.abs(multipliers).max()) ** (1.0 / orbit.periods)
    if largest > TOLD:
        return math.log(largest) / flow.period, LEAST / (largest * flow.period), multipliers
    number = round(orbit.periods) * max(STEPS, flow.steps)
    (coarse, _), (fine, multipliers) = (_carried(flow, orbit, each * number) for each in (1, 2))
    return fine / span, (abs(fine - coarse) + ROUNDING * abs(fine)) / span, multipliers


def _carried(flow: Flow, orbit: Orbit, steps: int) -> tuple[float, NDArray[np.complex128]]:
    """Logarithm of the largest multiplier in size, and all, by the linear equation in so many steps."""
    h = orbit.periods / steps
    times = h * (np.arange(steps)[:, None] + 0.5 + np.array([-1.0, 1.0]) * math.sqrt(3.0) / 6.0)
    path = flow.run(orbit.points[:1], times.ravel(), FINER).y[:, 0]
    product, log, h = np.eye(path.shape[1]), 0.0, h * flow.period
    for t, pair in zip(times * flow.period, path.reshape(steps, 2, -1), strict=True):
        A, B = (flow.slopes(y[None], float(s))[0] for s, y in zip(t, pair, strict=True))
        product = expm(0.5 * h * (A + B) + math.sqrt(3.0) / 12.0 * h**2 * (B @ A - A @ B)) @ product
        size = float(np.abs(product).max())
        if not size > 0.0:
            break
        product, log = product / size, log + math.log(size)
    values = np.linalg.eigvals(product)
    with np.errstate(divide="ignore"):
        return log + float(np.log(np.abs(values).max())), values * np.exp(log)


def visits(flow: Flow, orbit: Orbit, place: Floats) -> bool:
    """Whether an orbit comes to a place, to within :data:`SAME`, or a tenth of a step along a cycle."""
    if not orbit.cycle:
        return bool(flow.distance(orbit.points, place).min() < SAME)
    steps = flow.away(np.roll(orbit.points, -1, axis=0), orbit.points) / flow.scale
    e = flow.away(place, orbit.points) / flow.scale
    squares = (steps**2).sum(axis=1)
    share = np.clip((e * steps).sum(axis=1) / squares, 0.0, 1.0)
    beside = np.linalg.norm(e - share[:, None] * steps, axis=1)
    return bool((beside < np.maximum(0.1 * np.sqrt(squares), SAME)).any())


def cycle(flow: Flow, guess: Floats, periods: float) -> Orbit | None:
    """The periodic orbit of a system that knows no time near a place (dim,), with a period near ``periods``.

    Newton's method for place and period, the place staying in the plane through the guess across the flow.
    """
    y, T, dim = guess.copy(), float(periods), guess.size
    direction = flow.rates(guess[None])[0] / flow.scale**2
    best, moved = np.inf, np.inf
    for k in range(2 * ITERATIONS):
        if k == ITERATIONS and best > RESIDUAL:  # else it creeps towards a multiple zero
            return None
        image, J = flow.derivative(y[None], T)
        error = flow.away(image[0], y)
        residual = float(np.abs(error / flow.scale).max())
        if not (np.isfinite(residual) and np.isfinite(J).all()):
            return None
        if np.abs(np.linalg.eigvals(J[0])).max() * np.finfo(np.float64).eps > RESIDUAL:
            return None  # in chaos: a rounding of the place grows beyond the residual
        if residual >= best and residual < RESIDUAL:
            break
        best = residual
        rate = flow.rates(image)[0] * flow.period
        matrix = np.block([[J[0] - np.eye(dim), rate[:, None]], [direction[None], np.zeros((1, 1))]])
        right = -np.append(error, direction @ flow.away(y, guess))
        step = _solution(matrix, right, np.append(flow.scale, 1.0))
        limit = max(np.abs(step[:dim] / flow.scale).max(), abs(step[dim]) / (0.25 * T))
        step *= 0.5 / max(0.5, limit)
        y, T = y + step[:dim], T + step[dim]
        moved = float(np.abs(step[:dim] / flow.scale).max())
        if not 0.25 * periods < T < 4.0 * periods:
            return None
    if not best < RESIDUAL:
        return None
    parts = T / np.arange(WOUND, 1.0, -1.0)  # it may have gone around several times
    back = flow.distance(flow.run(y[None], parts, FINER).y[:, 0], y) < SAME
    T = float(parts[np.argmax(back)]) if back.any() else T
    along = ALONG * min(LONGER, math.ceil(T / TURNS))
    times = T * np.arange(1, along) / along
    points = np.concatenate([y[None], flow.run(y[None], times, FINER).y[:, 0]])
    extent = np.abs(flow.away(points, y) / flow.scale).max()
    if moved > SAME or not extent >= max(SAME, 20.0 * moved):
        return None  # a place of rest, still on the way to one, or it ends
    steps = flow.derivative(points, T / along)[1]
    if not np.isfinite(steps).all():
        return None
    jacobians = _around(steps)
    values = np.linalg.eigvals(jacobians[0])
    multipliers = np.delete(values, np.argmin(np.abs(values - 1.0)))
    return Orbit(points, T, jacobians, multipliers, best, cycle=True)


def _around(parts: Floats) -> Floats:
    """Jacobians once around from each place, from those to the next (m, dim, dim).

    Differences over the whole way would lie where the map is no longer linear.
    """
    whole, done, block, size = np.broadcast_to(np.eye(parts.shape[1]), parts.shape), 0, parts, 1
    while True:  # products of twice as many parts from each place
        if len(parts) & size:
            whole, done = np.roll(block, -done, axis=0) @ whole, done + size
        if 2 * size > len(parts):
            return whole
        block, size = np.roll(block, -size, axis=0) @ block, 2 * size


def same(flow: Flow, one: Orbit, two: Orbit) -> bool:
    """Whether two orbits are one: most of some places along a cycle lie on the other."""
    if one.cycle != two.cycle:
        return False
    some = two.points[:: len(two.points) // 16] if two.cycle else two.points[:1]
    return sum(visits(flow, one, place) for place in some) > len(some) // 2


def attracts(orbit: Orbit) -> bool:
    """Whether all multipliers lie inside the unit circle."""
    return bool(np.all(np.abs(orbit.multipliers) < ATTRACTS))


def returns(flow: Flow, paths: Floats, places: int) -> tuple[NDArray[np.int64], Flags]:
    """First p up to ``places`` after which strobes (k, n, dim) are back: (n,), and whether there is one.

    Back is: nearer than a twentieth of the scale over the last 2 p strobes, and not further than before.
    """
    n = paths.shape[1]
    period, known = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.bool_)
    for p in range(1, places + 1):
        if 3 * p + 1 > len(paths):
            break
        late = flow.distance(paths[-2 * p :], paths[-3 * p : -p]).max(axis=0)
        fits = ~known & (late < 0.05)
        period[fits], known[fits] = p, True
    return period, known
