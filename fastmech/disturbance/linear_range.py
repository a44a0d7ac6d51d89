"""Up to which size of disturbance the linearized motion may stand for the nonlinear one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastmech.arrays import Floats
from fastmech.disturbance.motion import (
    Size,
    disturbed_motion,
    equilibria_to_disturb,
    size_of,
    unit_directions,
)
from fastmech.ensembles import checks
from fastmech.equilibria.find import Equilibrium
from fastmech.models.equilibria import RestingPlace
from fastmech.models.mechanism import Mechanism
from fastmech.scene import Scene

SMALLEST, LARGEST, GRID = 1e-6, np.pi, 24
BISECTIONS = 13
OUTPUTS = 200


@dataclass(frozen=True)
class LinearRange:
    """Largest sizes at which the linearized motion is within the tolerance, direction by direction."""

    directions: Floats  #: disturbances of size 1 rad, shape (directions, states)
    limit: Floats  #: rad, shape (directions,); 0: not even the smallest size tried, inf: every one
    size: Size  #: the norm
    horizon: float  #: s
    tolerance: float


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
    :class:`fastmech.disturbance.motion.Size`. Along every direction (uniform on the sphere) sizes from
    1e-6 rad to pi rad are tried upwards, and the first crossing of the tolerance is refined by bisection to
    one part in 10,000. ``dt`` is the longest step [s], by default that of
    :func:`fastmech.disturbance.motion.disturbed_motion`. ``part`` says which of the directions to try, all by
    default.

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
    rays = size.from_ball(unit_directions(rng, count, dim))[part or slice(None)]
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
    return LinearRange(rays, np.where(exceeded[:, 0], 0.0, limit), size, horizon, tolerance)
