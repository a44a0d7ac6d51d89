"""One disturbance of an equilibrium: the nonlinear motion and the linearized one side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from fastmech.arrays import Floats
from fastmech.disturbance.size import size_of
from fastmech.ensembles import checks
from fastmech.ensembles.fitting import damping_rate
from fastmech.ensembles.integrate import integrate
from fastmech.equilibria.find import Equilibrium, degenerate_sentence
from fastmech.equilibria.search import pulls, vanishing
from fastmech.errors import InputError
from fastmech.integrators.methods import ImplicitRungeKutta, find_method
from fastmech.mechanism.coefficients import reduce
from fastmech.models.equilibria import RestingPlace, find_equilibria
from fastmech.models.mechanism import Mechanism
from fastmech.scene import Scene, require_scene
from fastmech.stability.linearize import jacobian

#: Default step times the highest frequency [rad].
PHASE = 0.05

#: An explicit step times the damper's rate above which damped motion grows by the default method (its region
#: of stability ends at -6.1), and the damper's rate times the first step of a motion that is damped at once.
STABLE, LAYER = 6.0, 1.0

#: Condition of the eigenvectors beyond which their errors would show beside those of the integration.
_ILL_CONDITIONED = 1e4


@dataclass(frozen=True)
class DisturbedMotion:
    """Disturbances xi_phi, xi_theta [rad], eta_phi, eta_theta [rad/s] over time, paper (21)."""

    t: Floats  #: s, shape (times,)
    nonlinear: Floats  #: shape (times, n, states)
    linearized: Floats  #: shape (times, n, states)
    status: NDArray[
        np.int8
    ]  #: :class:`fastmech.ensembles.status.Status` of the nonlinear motions, shape (n,)


def disturbed_motion(
    scene: Scene | Mechanism,
    equilibrium: Equilibrium | RestingPlace,
    disturbance: ArrayLike,
    times: ArrayLike,
    *,
    dt: float | None = None,
    method: str | None = None,
    threads: int | None = None,
) -> DisturbedMotion:
    """Motion after disturbances (n, states) or (states,) of an equilibrium, at ``times`` [s].

    The nonlinear motion is integrated with a fixed step of at most ``dt`` [s], by default
    :func:`default_step`, and by default with the method of :func:`default_method`; the linearized one is
    exact: the matrix exponential of the Jacobian at the equilibrium.

    Raises:
        InputError: an argument is wrong, a load changes, or the equilibrium is not the scene's.
    """
    equilibria_to_disturb(scene).index_of(equilibrium)
    center = np.concatenate([equilibrium.position, np.zeros(len(equilibrium.position))])
    start = checks.states("disturbance", disturbance, center.size)
    t = checks.rising_times("times", times)
    dt = default_step(scene, equilibrium) if dt is None else dt
    dt = checks.number("dt", dt, "s", above=0.0)
    method = method or default_method(scene, dt)
    passed = np.union1d(t, damped_times(scene, method, min(dt, float(t[-1]))))
    run = integrate(scene, center + start, dt=dt, method=method, t_eval=passed, threads=threads)
    linearized = start @ propagators(state_jacobian(scene, equilibrium), t).mT
    return DisturbedMotion(t, run.y[np.searchsorted(passed, t)] - center, linearized, run.status)


def state_jacobian(system: Scene | Mechanism, equilibrium: Equilibrium | RestingPlace) -> Floats:
    """Of the rates of states, by states, at an equilibrium (states, states)."""
    if isinstance(equilibrium, Equilibrium) and isinstance(system, Scene):
        return jacobian(system, equilibrium)
    assert isinstance(system, Mechanism)
    mass, damping, stiffness = system.linear(equilibrium.position)
    rates = np.linalg.solve(mass, np.concatenate([-stiffness, -damping], axis=1))
    return np.concatenate([np.eye(len(mass), 2 * len(mass), len(mass)), rates])


def default_step(scene: Scene | Mechanism, equilibrium: Equilibrium | RestingPlace) -> float:
    """Longest step [s] of motion about an equilibrium: 0.05 rad of its highest frequency."""
    return PHASE / size_of(scene, equilibrium).omega


def default_method(scene: Scene | Mechanism, step: float) -> str:
    """``dop853``, or ``radau5`` where the damper makes damped motion grow with explicit steps [s] so long."""
    if isinstance(scene, Mechanism):
        return "dop853"
    return "radau5" if float(damping_rate(reduce(scene))) * step > STABLE else "dop853"


def damped_times(scene: Scene | Mechanism, method: str, until: float, ratio: float = 2.0) -> Floats:
    """Times [s] before ``until`` at which an implicit method's first steps end: later ones can be long.

    The damper stops part of a motion at once, and Newton's iteration cannot leap over that. Steps begin with
    the time that it takes and grow by ``ratio`` at most (Hairer, Wanner, *Solving ODEs II*, section VI.1).
    Nothing of an explicit method, whose steps are that short in any case, nor of a ``Mechanism``.
    """
    if isinstance(scene, Mechanism):
        return np.zeros(0)
    rate = float(damping_rate(reduce(scene)))
    if not isinstance(find_method(method), ImplicitRungeKutta) or not rate * until > LAYER:
        return np.zeros(0)
    first = (ratio - 1.0) * LAYER / rate
    number = int(np.ceil(np.log1p((ratio - 1.0) * until / first) / np.log(ratio)))
    return np.asarray(first * (ratio ** np.arange(1, number) - 1.0) / (ratio - 1.0), dtype=np.float64)


def require_constant_force(scene: Scene | Mechanism) -> None:
    """Refuse what is under a load that changes: nothing rests while it does.

    Raises:
        InputError: it is.
    """
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
    """The equilibria of a scene or a mechanism in which disturbed motion makes sense.

    Raises:
        InputError: a load changes, or no equilibrium is isolated.
    """
    require_isolated(scene)
    equilibria = find_equilibria(scene)
    if not equilibria:
        raise InputError(f"scene: has no equilibrium to disturb: {equilibria.certificate.sentence}")
    return equilibria


def require_isolated(scene: Scene | Mechanism) -> None:
    """Refuse, before equilibria are looked for, loads that change, and a scene that rests all along a line.

    Raises:
        InputError: it does.
    """
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
    growth = np.exp(times[:, None] * values)
    return np.asarray((vectors * growth[:, None, :] @ np.linalg.inv(vectors)).real)
