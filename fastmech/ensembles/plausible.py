"""Whether a scene's final states can be true: energy bounds that no motion breaks, only too large a step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.status import Status
from fastmech.mechanism.coefficients import Coefficients
from fastmech.mechanism.reduced import metric_11, potential, slider_ratio

Floats = NDArray[np.float64]

#: Share of the energy's scale by which a bound may be missed: integration errors are far below it as long as
#: the step resolves the motion.
SLACK = 1e-2

#: Trajectories judged at once: what is computed on the way stays in the caches.
AT_ONCE = 2**14


def judge(
    reached: NDArray[np.int8], start: Floats, final: Floats, c: Coefficients | None
) -> NDArray[np.int8]:
    """Status (n,) of trajectories from their starts and final states, shape (n, dim).

    ``reached`` is what the run itself saw; ``c`` are a scene's reduced coefficients, ``None`` for a system of
    which nothing is known.
    """
    status = reached.copy()
    if c is not None:
        for first in range(0, len(start), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            values: Any = (np.asarray(v)[part] if np.ndim(v) else v for v in c)
            own = Coefficients(*values)
            broken = breaks_energy_bounds(own, start[part], final[part])
            status[part][broken & (reached[part] == Status.OK)] = Status.STEP_TOO_LARGE
    status[~np.isfinite(start).all(axis=1)] = Status.START_NOT_FINITE
    return status


def breaks_energy_bounds(c: Coefficients, start: Floats, final: Floats) -> NDArray[np.bool_]:
    """Which trajectories (n, 4) end with an energy that they cannot have.

    Under a constant force T + U never grows, and without damper it is conserved; under the decaying force
    T + Pi grows by at most F0 (2 l - sgn(F0) x2(0)), the work done if M2 went to the far end of its reach
    at full force, and without damper falls by at most F0 (2 l + sgn(F0) x2(0)). ``c`` are reduced
    coefficients, numbers or one a trajectory.
    """
    constant = (np.asarray(c.decay) == 0.0) | (np.asarray(c.force) == 0.0)
    force = np.where(constant, c.force, 0.0)
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite has a status of its own
        reach = 2.0 - np.sign(c.force) * (np.cos(start[:, 0]) - np.sin(start[:, 1]))
        allowance = np.where(constant, 0.0, np.abs(c.force) * reach)
        back = np.where(constant, 0.0, np.abs(c.force) * (4.0 - reach))
        before, scale = energy(c, start, force)
        after, _ = energy(c, final, force)
        # An energy beyond a double's range is none that a motion can have.
        gained = ~np.isfinite(after) | (after - before - allowance > SLACK * scale)
        undamped = np.asarray(c.damping) == 0.0
        lost = undamped & (before - after - back > SLACK * scale)
    return np.asarray(gained | lost)


def energy(c: Coefficients, y: Floats, force: Floats) -> tuple[Floats, Floats]:
    """T + Pi - F x2 over m2 l^2 of states (n, 4), and the scale to compare it with: sum of its terms."""
    phi, theta, phi_dot, theta_dot = np.ascontiguousarray(y.T)
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite has a status of its own
        s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
        s12 = s1 * c2 + c1 * s2
        k, _ = slider_ratio(s1, c1)
        a11 = metric_11(c.mass, c.slider, k)
        kinetic = 0.5 * (a11 * phi_dot**2 + theta_dot**2) + s12 * phi_dot * theta_dot
        u = potential(s1, c1, s2, c2, s12, c.lift, c.spring, c.gravity, force)
    return kinetic + u, kinetic + np.abs(c.lift) + c.gravity + c.spring + 2.0 * np.abs(c.force)
