"""Disturbances of an equilibrium: their size, motions beside the linearized ones, how far both agree."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from fastmech.arrays import Codes, Floats
from fastmech.ensembles import checks
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.status import Status
from fastmech.errors import InputError
from fastmech.integrators.methods import ImplicitRungeKutta, find_method
from fastmech.jit import OBSERVER_SIGNATURE, kernel
from fastmech.models.equilibria import RestingPlace, find_equilibria
from fastmech.models.mechanism import Mechanism
from fastmech.models.stability import linear_of, require_own, state_matrix
from fastmech.objects import Drawn, Field, Result, coordinate_units, counted, state_units
from fastmech.samplers import Starts
from fastmech.scene import Scene, require_scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.equilibria import Equilibrium, degenerate_sentence, held
from fastmech.slider.lagrange import kinetic_energy, potential_energy
from fastmech.slider.linearize import require_rest
from fastmech.slider.theorem import pulls, vanishing

#: Rows of the record, which begins with zeros and ends with the state that the step began with; the
#: excursions' rows go on with the other coordinates, and SWUNG is when the last of them was reached.
LAST_OUTSIDE, BEGUN, SWUNG, EXCURSION = range(4)


@kernel(OBSERVER_SIGNATURE)
def observe_departure(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Keep the last time outside the ball of return and the largest departures of the coordinates.

    A coordinate that turns round within a step departs there by Hermite's cubic through both ends.
    ``params``: place of the equilibrium (n,); the norm's metric (n, n); 1/omega^2; square of the ball's
    radius (see :class:`fastmech.disturbance.motion.Size`).
    """
    n = Y.shape[0] // 2
    before = EXCURSION + n
    inverse_square, radius_square = params[n + n * n], params[n + n * n + 1]
    for i in range(Y.shape[1]):
        square, h = 0.0, t - record[BEGUN, i]
        for j in range(n):
            away = Y[j, i] - params[j]
            for k in range(n):
                a = params[n + n * j + k]
                square += a * (away * (Y[k, i] - params[k]) + inverse_square * Y[n + j, i] * Y[n + k, i])
            most = max(abs(away), record[EXCURSION + j, i])
            first, last = h * record[before + n + j, i], h * Y[n + j, i]
            # The cubic's slope is first + b s + (last - first - b) s^2, s from 0 to 1.
            if first * last < 0.0:
                moved = Y[j, i] - record[before + j, i]
                b = 6.0 * moved - 4.0 * first - 2.0 * last
                root = math.sqrt(b * b - 4.0 * first * (last - first - b))
                s = 2.0 * first / (-b + math.copysign(root, first))
                turned = away - moved + s * (first + s * (0.5 * b + s * (last - first - b) / 3.0))
                most = max(most, abs(turned))
            record[SWUNG, i] = t if most > record[EXCURSION + j, i] else record[SWUNG, i]
            record[EXCURSION + j, i] = most
        record[LAST_OUTSIDE, i] = t if square > radius_square else record[LAST_OUTSIDE, i]
        record[BEGUN, i] = t
    for d in range(2 * n):
        for i in range(Y.shape[1]):
            record[before + d, i] = Y[d, i]


@dataclass(frozen=True)
class Size:
    """The norm of :func:`fastmech.kinetic_norm`, in radians of theta, or in the last coordinate's unit.

    ``omega`` is the square root of the largest generalized eigenvalue, in magnitude, of the Hessian and the
    metric. A departure of theta alone has its own angle as its size. Of a ``Mechanism`` the metric's last
    entry takes the place of m2 l^2, which it is for the paper's.
    """

    metric: Floats  #: a / (m2 l^2), shape (n, n)
    omega: float  #: highest natural frequency at a minimum [rad/s]

    @cached_property
    def to_ball(self) -> Floats:
        """Matrix (2 n, 2 n): ``disturbance @ to_ball`` is a point whose length is the disturbance's size."""
        lower = np.linalg.cholesky(self.metric)
        return scipy.linalg.block_diag(lower, lower / self.omega)

    def __call__(self, disturbance: Floats) -> Floats:
        """Sizes [rad] of disturbances (..., 2 n)."""
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite has no finite size
            return np.asarray(np.linalg.norm(disturbance @ self.to_ball, axis=-1))

    def from_ball(self, points: Floats) -> Floats:
        """Disturbances (..., 2 n) whose sizes are the lengths of ``points`` (..., 2 n)."""
        return np.asarray(points @ np.linalg.inv(self.to_ball))


def size_at(system: Scene | Mechanism, *position: float) -> Size:
    """The norm at a position [rad or m] of a scene with a constant force, or of a mechanism."""
    mass, _, stiffness = linear_of(system, position)
    curvature = np.max(np.abs(scipy.linalg.eigvalsh(0.5 * (stiffness + stiffness.T), mass)))
    # Without any stiffness (all curvature gone) there is no frequency; 1 rad/s keeps the norm defined.
    return Size(mass / mass[-1, -1], float(np.sqrt(curvature)) or 1.0)


def size_of(system: Scene | Mechanism, e: Equilibrium | RestingPlace) -> Size:
    """The norm at an equilibrium of a scene with a constant force, or of a mechanism."""
    return size_at(system, *e.position)


def kinetic_norm(scene: Scene | Mechanism, equilibrium: Equilibrium | RestingPlace) -> Floats:
    """Matrix N (states, states) of the kinetic-energy norm: ``|departure @ N|`` is a size [rad].

    ``size^2 = (xi' a xi + eta' a eta / omega^2) / (m2 l^2)`` for departures xi [rad] and eta [rad/s], with
    the metric ``a`` at the equilibrium, paper (11), and the highest natural frequency omega [rad/s]. The
    kinetic energy of a kick is ``size^2 omega^2 m2 l^2 / 2``. The force is the equilibrium's frozen one. Of a
    mechanism the last entry of ``a`` takes the place of m2 l^2, and sizes have the last coordinate's unit.

    Raises:
        InputError: an argument is wrong, or the scene does not rest there.
    """
    if isinstance(scene, Mechanism):
        require_own(scene, equilibrium)
        return size_of(scene, equilibrium).to_ball
    require_rest(scene, equilibrium)
    assert isinstance(equilibrium, Equilibrium)
    return size_of(held(scene, equilibrium), equilibrium).to_ball


def excess_energy(system: Scene | Mechanism, e: Equilibrium | RestingPlace, y: Floats) -> Floats:
    """T + U of states (n, states) above U at an equilibrium [J], loads at what they come to."""
    with np.errstate(all="ignore"):  # states that are not finite are nowhere at rest
        if isinstance(system, Mechanism):
            return np.asarray(system.evaluate("bounding", y.T)[0] - e.energy)
        return kinetic_energy(system, y) + potential_energy(system, y[:, :2], system.F0) - e.energy


def confining_energy(system: Scene | Mechanism, e: Equilibrium | RestingPlace, radius: float) -> float:
    """Energy [J] with which a motion about a minimum stays in the ball of the given radius [rad].

    With the lowest squared frequency s the energy is at least s m2 l^2 size^2 / 2 (the norm's omega is the
    highest frequency), to second order.
    """
    mass, _, stiffness = linear_of(system, e.position)
    lowest = float(scipy.linalg.eigvalsh(0.5 * (stiffness + stiffness.T), mass)[0])
    return 0.5 * lowest * float(mass[-1, -1]) * radius * radius


def uniform_ball(rng: np.random.Generator, n: int, dim: int = 4) -> Floats:
    """Points uniform in the unit ball of ``dim`` dimensions, shape (n, dim)."""
    directions = unit_directions(rng, n, dim)
    return directions * rng.random((n, 1)) ** (1.0 / dim)


def unit_directions(rng: np.random.Generator, n: int, dim: int = 4) -> Floats:
    """Points uniform on the unit sphere of ``dim`` dimensions, shape (n, dim)."""
    normal = rng.standard_normal((n, dim))
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


#: Default step times the highest frequency [rad].
PHASE = 0.05

#: An explicit step times the damper's rate above which damped motion grows by the default method (its region
#: of stability ends at -6.1), and the damper's rate times the first step of a motion that is damped at once.
STABLE, LAYER = 6.0, 1.0

#: Condition of the eigenvectors beyond which their errors would show beside those of the integration.
_ILL_CONDITIONED = 1e4


@dataclass(frozen=True, repr=False)
class DisturbedMotion(Drawn):
    """Disturbances xi_phi, xi_theta [rad], eta_phi, eta_theta [rad/s] over time, paper (21)."""

    t: Floats  #: s, shape (times,)
    nonlinear: Floats  #: shape (times, n, states)
    linearized: Floats  #: shape (times, n, states)
    status: Codes  #: :class:`fastmech.ensembles.status.Status` of the nonlinear motions, shape (n,)

    KIND = "disturbances_over_time"
    PICTURE = "plots.objects:draw_departures"
    FIELDS = {
        "time": Field("time", "s", "output times", "t"),
        "nonlinear_*": Field("time trajectory state", "", "nonlinear departure of", "nonlinear"),
        "linearized_*": Field("time trajectory state", "", "linearized departure of", "linearized"),
        "status": Field("trajectory", "1", "what became of the nonlinear motion", codes=Status),
    }

    def told(self) -> str:
        """How many motions, and how far the linearized ones are from them."""
        apart, told = np.abs(self.nonlinear - self.linearized), []
        for k, (name, unit) in enumerate(state_units(self.system).items()):
            far, off = (one[..., k].max(initial=0.0) for one in (np.abs(self.nonlinear), apart))
            told.append(f"{far:.3g} {unit} of {name} ({off:.2g})")
        return (
            f"{counted(self.status.size, 'disturbed motion')} to t = {self.t[-1]:g} s at "
            f"{counted(self.t.size, 'time')}\n"
            f"  largest departures (and how far the linearized motion is off): {', '.join(told)}"
        )


def disturbed_motion(
    scene: Scene | Mechanism,
    equilibrium: Equilibrium | RestingPlace,
    disturbance: Starts,
    times: ArrayLike,
    *,
    dt: float | None = None,
    method: str | None = None,
    threads: int | None = None,
) -> DisturbedMotion:
    """Motion after disturbances (n, states) or (states,) of an equilibrium, at ``times`` [s].

    A sampler draws them too. The nonlinear motion is integrated with a fixed step of at most ``dt`` [s], by
    default :func:`default_step`, and by default with the method of :func:`default_method`; the linearized
    one is exact: the matrix exponential of the Jacobian at the equilibrium.

    Raises:
        InputError: an argument is wrong, a load changes, or the equilibrium is not the scene's.
    """
    equilibria_to_disturb(scene).index_of(equilibrium)
    center = np.concatenate([equilibrium.position, np.zeros(len(equilibrium.position))])
    start = checks.starts("disturbance", disturbance, scene.state)
    t = checks.rising_times("times", times)
    dt = default_step(scene, equilibrium) if dt is None else dt
    dt = checks.number("dt", dt, "s", above=0.0)
    method = method or default_method(scene, dt)
    passed = np.union1d(t, damped_times(scene, method, min(dt, float(t[-1]))))
    run = integrate(scene, center + start, dt=dt, method=method, t_eval=passed, threads=threads)
    linearized = start @ propagators(state_matrix(scene, equilibrium), t).mT
    away = run.y[np.searchsorted(passed, t)] - center
    return DisturbedMotion(t, away, linearized, run.status).of(scene)


def default_step(scene: Scene | Mechanism, equilibrium: Equilibrium | RestingPlace) -> float:
    """Longest step [s] of motion about an equilibrium: 0.05 rad of its highest frequency."""
    return PHASE / size_of(scene, equilibrium).omega


def damping_rate(system: Scene | Mechanism) -> float:
    """How fast the damper stops motion [1/s]; 0 for a ``Mechanism``, whose steps are short enough."""
    return 0.0 if isinstance(system, Mechanism) else float(system._motion({}).damping)


def default_method(scene: Scene | Mechanism, step: float) -> str:
    """``dop853``, or ``radau5`` where the damper makes damped motion grow with explicit steps [s] so long."""
    return "radau5" if damping_rate(scene) * step > STABLE else "dop853"


def damped_times(scene: Scene | Mechanism, method: str, until: float, ratio: float = 2.0) -> Floats:
    """Times [s] before ``until`` at which an implicit method's first steps end: later ones can be long.

    The damper stops part of a motion at once, and Newton's iteration cannot leap over that. Steps begin with
    the time that it takes and grow by ``ratio`` at most (Hairer, Wanner, *Solving ODEs II*, section VI.1).
    Nothing of an explicit method, whose steps are that short in any case, nor of a ``Mechanism``.
    """
    rate = damping_rate(scene)
    if not isinstance(find_method(method), ImplicitRungeKutta) or not rate * until > LAYER:
        return np.zeros(0)
    first = (ratio - 1.0) * LAYER / rate
    number = int(np.ceil(np.log1p((ratio - 1.0) * until / first) / np.log(ratio)))
    return np.asarray(first * (ratio ** np.arange(1, number) - 1.0) / (ratio - 1.0), dtype=np.float64)


def require_constant_force(scene: Scene | Mechanism) -> None:
    """Refuse what is under a load that changes: nothing rests while it does."""
    if isinstance(scene, Mechanism):
        for load in scene.loads:
            if load.to_come(0.0) != (0.0, 0.0):
                raise InputError(f"{scene.name}: {load!r} changes; nothing rests while it does")
        return
    require_scene(scene)
    if scene.F0 != 0 and scene.alpha != 0:
        raise InputError(
            f"scene.alpha = {scene.alpha:g}: must be 0 1/s for motion about an equilibrium (or F0 = 0 N); "
            "use scene.replace(alpha=0.0) and find its equilibria anew"
        )


def equilibria_to_disturb(scene: Scene | Mechanism) -> Any:
    """The equilibria of a scene or a mechanism in which disturbed motion makes sense."""
    require_isolated(scene)
    equilibria = find_equilibria(scene)
    if not equilibria:
        raise InputError(f"scene: has no equilibrium to disturb: {equilibria.certificate.sentence}")
    return equilibria


def require_isolated(scene: Scene | Mechanism) -> None:
    """Refuse, before equilibria are found, loads that change, and a scene that rests all along a line."""
    require_constant_force(scene)
    if isinstance(scene, Mechanism):
        return
    c = reduce(scene)
    if vanishing(pulls(c.mass, c.lift, c.spring, c.gravity, c.force)) >= 2:
        raise InputError(f"scene: has no equilibrium to disturb: {degenerate_sentence(scene, scene.F0)}")


def propagators(matrix: Floats, times: Floats) -> Floats:
    """Matrix exponentials exp(t matrix) at the given times, shape (times, n, n).

    By the eigenvectors where these are well conditioned (the error grows with their condition number), else
    one by one.
    """
    values, vectors = np.linalg.eig(matrix)
    if np.linalg.cond(vectors) > _ILL_CONDITIONED:
        return np.asarray(scipy.linalg.expm(times[:, None, None] * matrix))
    with np.errstate(over="ignore", invalid="ignore"):  # a saddle's for a long time are not finite
        growth = np.exp(times[:, None] * values)
        return np.asarray((vectors * growth[:, None, :] @ np.linalg.inv(vectors)).real)


SMALLEST, LARGEST, GRID = 1e-6, np.pi, 24
BISECTIONS = 13
OUTPUTS = 200


@dataclass(frozen=True, repr=False)
class LinearRange(Result):
    """Largest sizes at which the linearized motion is within the tolerance, direction by direction."""

    directions: Floats  #: disturbances of size 1, shape (directions, states)
    #: Sizes, shape (directions,) [rad, or the last coordinate's unit]; 0: not even the smallest tried, inf:
    #: every one.
    limit: Floats
    size: Size  #: the norm
    horizon: float  #: s
    tolerance: float

    KIND = "linear_range"
    FIELDS = {
        "limit": Field(
            "direction", "@last", "largest size at which the linearized motion is within tolerance"
        ),
        "directions": Field("direction state_number", "1", "disturbances of size 1"),
        "horizon": Field("", "s", "time looked at"),
        "tolerance": Field("", "1", "relative deviation allowed"),
    }

    @property
    def last(self) -> str:
        """The last coordinate, whose unit sizes have."""
        return [*coordinate_units(self.system)][-1]

    def told(self) -> str:
        """The least and the largest limit, and whether the horizon is too short for small motion to turn."""
        unit = coordinate_units(self.system)[self.last]
        ends = {0.0: "no size tried", math.inf: f"{LARGEST:.4g} {unit} (the largest tried)"}
        share = f"{100.0 * self.tolerance:g} %"
        text = f"for {self.horizon:g} s the linearized motion is within {share} of the true one"
        if self.limit.size:
            least, most = (ends.get(s, f"{s:.4g} {unit}") for s in np.sort(self.limit)[[0, -1]].tolist())
            number = counted(self.limit.size, "direction")
            text += f":\n  disturbed by up to {least} in the worst of {number}, {most} in the best"
        if self.horizon * self.size.omega < 1.0:
            turn = f"{1.0 / self.size.omega:.3g} s a radian"
            text += f"\n  the fastest small motion takes {turn}: a longer horizon tells"
        return text


def linear_range(
    scene: Scene | Mechanism,
    equilibrium: Equilibrium | RestingPlace,
    *,
    horizon: float = 1.0,
    tolerance: float = 0.05,
    directions: int = 256,
    seed: int = 0,
    dt: float | None = None,
    part: slice | None = None,
    threads: int | None = None,
) -> LinearRange:
    """Size of disturbance up to which the linearized motion stays within ``tolerance`` of the nonlinear one.

    The deviation of a disturbance is the maximum of size(nonlinear - linearized) divided by that of
    size(nonlinear), both over 201 evenly spaced times of [0, horizon], in the norm of
    :func:`fastmech.kinetic_norm`. Along every direction (uniform on the sphere) sizes from 1e-6 to pi [rad,
    or the last coordinate's unit] are tried upwards, and the first crossing of the tolerance is refined by
    bisection to one part in 10,000. ``dt`` is the longest step [s], by default that of
    :func:`fastmech.disturbed_motion`, ``part`` which of the directions to try, all by default. In a
    ``horizon`` [s] in which the fastest small motion turns by less than a radian the linearized one has no
    time to go astray, and the result says so.

    Raises:
        InputError: an argument is wrong, the scene's force decays, or the equilibrium is not the scene's.
    """
    horizon = checks.number("horizon", horizon, "s", above=0.0)
    tolerance = checks.number("tolerance", tolerance, "", above=0.0)
    count = checks.whole_number("directions", directions, least=1)
    seed = checks.whole_number("seed", seed, least=0)
    index = equilibria_to_disturb(scene).index_of(equilibrium)
    size, dim = size_of(scene, equilibrium), 2 * len(equilibrium.position)
    rng = np.random.default_rng([seed, index, 1])
    rays = size.from_ball(unit_directions(rng, count, dim))[checks.part_of(part)]
    times = np.linspace(0.0, horizon, OUTPUTS + 1)

    def deviation(sizes: Floats) -> Floats:
        """Deviations at sizes (directions, k), one ray a row."""
        starts = (sizes[..., None] * rays[:, None, :]).reshape(-1, dim)
        motion = disturbed_motion(scene, equilibrium, starts, times, dt=dt, threads=threads)
        apart = size(motion.nonlinear - motion.linearized).max(axis=0)
        with np.errstate(invalid="ignore"):
            return np.asarray((apart / size(motion.nonlinear).max(axis=0)).reshape(sizes.shape))

    grid = np.geomspace(SMALLEST, LARGEST, GRID)
    # What is not finite deviates: the comparison is written so that NaN counts as exceeding.
    exceeded = ~(deviation(np.broadcast_to(grid, (len(rays), GRID))) <= tolerance)
    first = np.argmax(exceeded, axis=1)
    low, high = grid[np.maximum(first - 1, 0)], grid[first]
    for _ in range(BISECTIONS):
        middle = np.sqrt(low * high)
        above = ~(deviation(middle[:, None])[:, 0] <= tolerance)
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    limit = np.where(exceeded.any(axis=1), low, np.inf)
    return LinearRange(rays, np.where(exceeded[:, 0], 0.0, limit), size, horizon, tolerance).of(scene)
