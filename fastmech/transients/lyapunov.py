"""``fm.largest_lyapunov``: the largest Lyapunov exponent along motions, by the tangent flow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.ensembles import checks
from fastmech.ensembles.problem import scene_problem, system_problem
from fastmech.ensembles.system import System
from fastmech.errors import InputError
from fastmech.integrators.tableaus import TABLEAUS
from fastmech.scene import Scene
from fastmech.transients.tangent import advance_tangents

Floats = NDArray[np.float64]

#: Method of motion and tangents.
TABLEAU = TABLEAUS["dop853"]

#: Estimates kept along the way.
PIECES = 20


@dataclass(frozen=True)
class LyapunovExponents:
    """Estimates at :data:`PIECES` times: the mean growth rate of a disturbance from the start to each."""

    t: Floats  #: s, shape (times,)
    exponents: Floats  #: 1/s, shape (times, n)

    @property
    def largest(self) -> Floats:
        """The last estimates (n,) [1/s]; regular motion gives values that fall like log(t)/t."""
        return np.asarray(self.exponents[-1])


def largest_lyapunov(
    scene: Scene | System,
    y0: ArrayLike,
    t_end: float,
    dt: float = 0.01,
    *,
    parameters: Mapping[str, ArrayLike] | None = None,
) -> LyapunovExponents:
    """Largest Lyapunov exponent of motions (Benettin, Galgani, Giorgilli, Strelcyn, Meccanica 15 (1980)).

    Args:
        scene: the mechanism, whose Jacobian is known, or a system of your own (differences).
        y0: starts, shape (n, dim) or (dim,).
        t_end: length of the motion [s]; estimates converge like 1/t.
        dt: longest step [s] of ``dop853``.
        parameters: as in :func:`fastmech.ensembles.integrate.integrate`.

    Raises:
        InputError: an argument is wrong.
    """
    t_end = checks.number("t_end", t_end, "s", above=0.0)
    dt = checks.number("dt", dt, "s", above=0.0)
    if isinstance(scene, System):
        starts = checks.states("y0", y0, len(scene.state))
        problem = system_problem(scene, len(starts), parameters or {})
    elif isinstance(scene, Scene):
        starts = checks.states("y0", y0, 4)
        problem = scene_problem(scene, len(starts), parameters or {}, "lagrange")
    else:
        raise InputError(f"scene = {scene!r}: must be a Scene or a System")
    Y = np.array(starts.T, order="C")
    own = np.broadcast_to(problem.params, (len(starts), problem.params.shape[-1]))
    params = np.array(own.T, order="C")
    # A fixed direction with no special zeros: it turns to the fastest growing one within a few periods.
    D = np.repeat(1.0 / np.sqrt(np.arange(2.0, 2.0 + len(Y)))[:, None], Y.shape[1], axis=1)
    D /= np.linalg.norm(D, axis=0)
    growth = np.zeros(len(starts))
    steps = max(1, int(np.ceil(t_end / PIECES / dt)))
    h = t_end / PIECES / steps
    times = np.linspace(0.0, t_end, PIECES + 1)
    exponents = np.empty((PIECES, len(starts)))
    analytic = problem.jacobian is not None
    for piece in range(PIECES):
        advance_tangents(
            problem.rhs,
            problem.jacobian if analytic else problem.rhs,
            int(analytic),
            TABLEAU.matrix,
            np.array(TABLEAU.b),
            np.array(TABLEAU.c),
            float(times[piece]),
            h,
            steps,
            Y,
            D,
            params,
            growth,
        )
        exponents[piece] = growth / times[piece + 1]
    return LyapunovExponents(times[1:], exponents)
