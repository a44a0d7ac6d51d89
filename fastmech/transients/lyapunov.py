"""How small disturbances grow: ``fm.largest_lyapunov`` by the tangent flow, and growth before decay.

Growth of small disturbances of an equilibrium before the eigenvalues rule, measured in energy. The norm of
(xi, eta) is xi |K| xi + eta M eta with the small motion's matrices: twice the energy at a minimum; elsewhere
the directions in which U falls count as if it rose, so that the norm stays one. Reactivity and amplification:
Neubert, Caswell, Ecology 78 (1997); Trefethen, Embree, *Spectra and Pseudospectra*, chapter 14.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numba import types
from numpy.typing import ArrayLike

from fastmech.arrays import Codes, Floats
from fastmech.callee import callee
from fastmech.ensembles import checks
from fastmech.ensembles.integrate import problem_of
from fastmech.ensembles.lanes import finite_rows
from fastmech.ensembles.problem import Problem, extreme_scenes
from fastmech.ensembles.status import Status, failure_counts, failure_line
from fastmech.ensembles.system import System
from fastmech.errors import InputError
from fastmech.integrators.explicit import BlockRHS
from fastmech.integrators.implicit import difference_jacobian
from fastmech.integrators.methods import find_method
from fastmech.integrators.tableaus import TABLEAUS
from fastmech.jit import CUBE, MATRIX, RHS, VECTOR, kernel, named_tuple
from fastmech.models.equilibria import RestingPlace
from fastmech.models.mechanism import Mechanism
from fastmech.models.stability import state_matrix
from fastmech.objects import Drawn, Field, Printed, counted
from fastmech.samplers import Starts
from fastmech.scene import Scene
from fastmech.slider.equilibria import Equilibrium
from fastmech.slider.linearize import linearized
from fastmech.step_limits.warning import too_long, warn_of_step


class Stages(NamedTuple):
    """An explicit Runge-Kutta method."""

    a: Floats
    b: Floats
    c: Floats


class Disturbed(NamedTuple):
    """Trajectories and a disturbance of each, advanced in place."""

    Y: Floats  #: states, then disturbances (2, dim, lanes)
    params: Floats  #: (count, lanes)
    growth: Floats  #: (lanes,) is added the logarithm of what a disturbance has grown by


STAGES = named_tuple([MATRIX, VECTOR, VECTOR], Stages)
DISTURBED = named_tuple([CUBE, MATRIX, VECTOR], Disturbed)


@kernel(types.void(RHS, STAGES, DISTURBED, types.float64, types.float64, types.int64))
def advance_tangents(
    rhs: BlockRHS, method: Stages, lanes: Disturbed, begin: float, h: float, steps: int
) -> None:
    """Take states and disturbances so many steps of ``h`` on from time ``begin`` [s].

    D' = J(y) D along the motion, by the same stages as y, J by differences. After every step each disturbance
    is scaled to length 1.
    """
    (_, dim, count), stages = lanes.Y.shape, method.b.shape[0]
    K, Z, J = np.empty((stages, 2, dim, count)), np.empty((2, dim, count)), np.empty((dim * dim, count))
    y, z, k = lanes.Y.reshape(2 * dim * count), Z.reshape(2 * dim * count), K.reshape(stages, 2 * dim * count)
    for step in range(steps):
        for s in range(stages):
            t = begin + step * h + method.c[s] * h
            for x in range(y.size):
                z[x] = y[x]
            for m in range(s):
                weight = h * method.a[s, m]
                for x in range(y.size):
                    z[x] += weight * k[m, x]
            rhs(t, Z[0], K[s, 0], lanes.params)
            difference_jacobian(rhs, t, Z[0], J, lanes.params)
            for r in range(dim):
                for i in range(count):
                    total = 0.0
                    for c in range(dim):
                        total += J[r * dim + c, i] * Z[1, c, i]
                    K[s, 1, r, i] = total
        for s in range(stages):
            weight = h * method.b[s]
            for x in range(y.size):
                y[x] += weight * k[s, x]
        for i in range(count):
            square = 0.0
            for d in range(dim):
                square += lanes.Y[1, d, i] * lanes.Y[1, d, i]
            length = np.sqrt(square)
            lanes.growth[i] += np.log(length)
            for d in range(dim):
                lanes.Y[1, d, i] /= length


#: Method of motion and tangents.
METHOD = "dop853"
TABLEAU = TABLEAUS[METHOD]

#: Steps that a run may take: a year's.
MOST_STEPS = 1e13

#: Estimates kept along the way.
PIECES = 20

#: Default step times the fastest rate, which is of starts at most so many times faster than a scene's own
#: rates; and starts whose Jacobians are asked for it.
STEP, MOST_TIMES, LOOKED_AT = 0.2, 1000.0, 1024


@dataclass(frozen=True, repr=False)
class LyapunovExponents(Drawn):
    """Estimates at :data:`PIECES` times: the mean growth rate of a disturbance from the start to each."""

    t: Floats  #: s, shape (times,)
    exponents: Floats  #: 1/s, shape (times, n); NaN once a motion is not finite
    status: Codes  #: :class:`fastmech.ensembles.status.Status` of each motion, shape (n,)

    @property
    def largest(self) -> Floats:
        """The last estimates (n,) [1/s]; regular motion gives values that fall like log(t)/t."""
        return np.asarray(self.exponents[-1])

    @property
    def failures(self) -> str:
        """One line: how many motions have failed, and with which status; empty where none has."""
        return failure_line(failure_counts(self.status), self.status.size)

    KIND = "lyapunov_exponents"
    PICTURE = "plots.objects:draw_exponents"
    FIELDS = {
        "time": Field("time", "s", "time of an estimate", "t"),
        "exponents": Field("time trajectory", "s-1", "mean growth rate of a disturbance from the start"),
        "status": Field("trajectory", "1", "what became of the motion", codes=Status),
    }

    def told(self) -> str:
        """How many motions, the last estimates, and how many have failed."""
        known = self.largest[np.isfinite(self.largest)]
        last = f"largest exponents {known.min():.4g} to {known.max():.4g} 1/s; " if known.size else ""
        motions = counted(self.status.size, "motion")
        return f"{motions} to t = {self.t[-1]:g} s: {last}{self.failures or 'none failed'}"


def largest_lyapunov(
    scene: Scene | Mechanism | System,
    y0: Starts,
    t_end: float,
    dt: float | None = None,
    *,
    parameters: Mapping[str, ArrayLike] | None = None,
) -> LyapunovExponents:
    """Largest Lyapunov exponent of motions (Benettin, Galgani, Giorgilli, Strelcyn, Meccanica 15 (1980)).

    Args:
        scene: the mechanism, or a system of your own.
        y0: starts, a sampler or of shape (n, dim) or (dim,).
        t_end: length of the motion [s]; estimates converge like 1/t.
        dt: longest step [s] of ``dop853``; by default a fifth of the time in which the fastest start's motion
            turns or dies out by one radian or factor e: of a scene for all time, by its energy; of others by
            the Jacobian at the starts, so that motion which becomes faster on its way needs a step.
        parameters: as in :func:`fastmech.ensembles.integrate.integrate`.

    Returns:
        estimates, and the status of every motion as ``integrate`` gives it, save that nobody looks at turns
        on the way: exponents of one that failed are none of the mechanism's. A step beyond a limit is warned
        of before the run.

    Raises:
        InputError: an argument is wrong.
    """
    t_end = checks.number("t_end", t_end, "s", above=0.0)
    parameters = {} if parameters is None else parameters
    starts, problem, own = problem_of(scene, y0, parameters, None)
    dt = default_step(problem, starts, t_end) if dt is None else checks.number("dt", dt, "s", above=0.0)
    if isinstance(scene, Scene):
        warn_of_step(extreme_scenes(scene, own, problem), dt, METHOD, starts)
    # A fixed direction with no special zeros: it turns to the fastest growing one within a few periods.
    direction = 1.0 / np.sqrt(np.arange(2.0, 2.0 + starts.shape[1]))[:, None]
    Y = np.array([starts.T, np.broadcast_to(direction / np.linalg.norm(direction, axis=0), starts.T.shape)])
    growth = np.zeros(len(starts))
    if t_end / dt > MOST_STEPS:
        raise InputError(f"dt = {dt:g}: t_end = {t_end:g} s would take more than {MOST_STEPS:g} steps")
    steps = max(1, int(np.ceil(t_end / PIECES / dt)))
    h = t_end / PIECES / steps
    times = np.linspace(0.0, t_end, PIECES + 1)
    exponents = np.empty((PIECES, len(starts)))
    rhs, lanes = callee(problem.rhs), Disturbed(Y, problem.params.block(len(starts)), growth)
    method = Stages(TABLEAU.matrix, np.array(TABLEAU.b), np.array(TABLEAU.c))
    for piece in range(PIECES):
        advance_tangents(rhs, method, lanes, float(times[piece]), h, steps=steps)
        exponents[piece] = growth / times[piece + 1]
    reached = np.where(finite_rows(Y[0].T) & np.isfinite(growth), Status.OK, Status.NOT_FINITE)
    status = np.where(finite_rows(starts), reached, Status.START_NOT_FINITE).astype(np.int8)
    if isinstance(scene, Scene):
        assert problem.bounds is not None
        beyond = too_long(find_method(METHOD), problem.bounds.fading, starts, np.full(len(starts), h))
        status[beyond & (status == Status.OK)] = Status.STEP_TOO_LARGE
    if problem.motion is not None and problem.motion.rests == 0.0:
        broken = problem.motion.impossible(starts, Y[0].T)
        status[broken & (status == Status.OK)] = Status.STEP_TOO_LARGE
    return LyapunovExponents(times[1:], exponents, status).of(scene)


def default_step(problem: Problem, starts: Floats, t_end: float) -> float:
    """Step [s] that follows from how fast starts (n, dim) move, see :func:`largest_lyapunov`."""
    if problem.bounds is not None:
        own = np.maximum(problem.bounds.frequency, problem.bounds.damping)
        speed = problem.bounds.speed(starts)
        # What moves so fast needs a step of its own.
        slow = speed <= MOST_TIMES * own
        fastest = float(max(np.max(own), np.max(speed, initial=0.0, where=slow)))
    else:
        some = np.array(starts[finite_rows(starts)][:LOOKED_AT].T, order="C")
        J = np.zeros((len(some) ** 2, some.shape[1]))
        params = problem.params.block(some.shape[1])
        difference_jacobian(callee(problem.rhs), 0.0, some, J, params)
        matrices = J.T.reshape(-1, len(some), len(some))
        usable = matrices[np.isfinite(matrices).all(axis=(1, 2))]
        fastest = float(np.abs(np.linalg.eigvals(usable)).max(initial=0.0))
    return min(t_end / PIECES, STEP / fastest) if fastest > 0.0 else t_end / PIECES


#: Times looked at between 0 and the end.
TIMES = 400


@dataclass(frozen=True, repr=False)
class TransientGrowth(Printed):
    """What disturbances of an equilibrium do first."""

    reactivity: float  #: largest initial growth rate of the norm [1/s]; 0 at a minimum: power only leaves
    amplification: float  #: largest growth of the norm up to ``until``; 1 at a minimum
    time: float  #: when that is reached [s]
    until: float  #: [s]

    def told(self) -> str:
        """How fast the norm grows at first, and how far."""
        if not self.time:
            return f"small disturbances do not grow within {self.until:g} s, in the energy norm"
        return (
            f"small disturbances grow at first by {self.reactivity:.4g} 1/s at most, in the energy norm\n"
            f"  within {self.until:g} s to at most {self.amplification:.4g} times their size, at "
            f"{self.time:.4g} s"
        )


def transient_growth(
    scene: Scene | Mechanism, equilibrium: Equilibrium | RestingPlace, until: float = 10.0
) -> TransientGrowth:
    """Reactivity and largest amplification of small disturbances in the energy norm.

    The force is the equilibrium's, frozen. At a saddle or maximum disturbances grow for ever, so that the
    amplification is that at ``until`` [s].

    Raises:
        InputError: an argument is wrong, or a mechanism's potential, if it has one, is flat in a direction.
    """
    until = checks.number("until", until, "s", above=0.0)
    jacobian = state_matrix(scene, equilibrium)
    if isinstance(scene, Mechanism):
        if equilibrium.morse_index is None or equilibrium.morse_index < 0:
            told = "that takes a potential that is curved in every direction"
            raise InputError(f"{scene.name}: disturbances have no energy norm here; {told}")
        M, _, K = scene.linear(equilibrium.position)
    else:
        assert isinstance(equilibrium, Equilibrium)
        _, s = linearized(scene, equilibrium)
        M = np.array([[s.m11, s.s12], [s.s12, 1.0]])
        K = np.array([[s.k11, s.k12], [s.k12, s.k22]])
    # |K| in the normal coordinates of M, where both are symmetric.
    squares, modes = scipy.linalg.eigh(K, M)
    back = modes.T @ M
    norm = scipy.linalg.block_diag(back.T @ np.diag(np.abs(squares)) @ back, M)
    root = np.linalg.cholesky(norm).T
    A = root @ jacobian @ np.linalg.inv(root)
    reactivity = float(np.linalg.eigvalsh((A + A.T) / 2.0)[-1])
    times = np.linspace(0.0, until, TIMES + 1)
    sizes, flow = [1.0], np.eye(len(A))
    with np.errstate(over="ignore", invalid="ignore"):
        step = scipy.linalg.expm(A * times[1])
    for _ in times[1:]:
        with np.errstate(over="ignore", invalid="ignore"):
            flow = step @ flow
        if not np.isfinite(flow).all():
            raise InputError(f"until = {until:g} s: by then disturbances are beyond doubles")
        sizes.append(float(np.linalg.norm(flow, 2)))
    best = int(np.argmax(np.round(sizes, 9)))  # where nothing damps or grows all are 1 but for rounding
    return TransientGrowth(reactivity, sizes[best], float(times[best]), until)
