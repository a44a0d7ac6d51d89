"""Whether a scene's final states can be true: energy bounds that no motion breaks, only too large a step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.energies import energy_at, energy_scale, tell_broken
from fastmech.ensembles.lanes import finite_rows
from fastmech.ensembles.status import Status
from fastmech.ensembles.threads import in_parts
from fastmech.kernels.passes import columns
from fastmech.mechanism.coefficients import Coefficients

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Share of the energy's scale by which a bound may be missed: integration errors are far below it as long as
#: the step resolves the motion.
SLACK = 1e-2


def judge(
    reached: NDArray[np.int8],
    start: Floats,
    final: Floats,
    c: Coefficients | None,
    threads: int | None = None,
) -> NDArray[np.int8]:
    """Status (n,) of trajectories from their starts and final states, shape (n, dim).

    ``reached`` is what the run itself saw; ``c`` are a scene's reduced coefficients, ``None`` for a system of
    which nothing is known.

    Raises:
        InputError: the number of threads is wrong.
    """
    status = reached.copy()
    if c is None:
        finite = finite_rows(start)
    else:
        broken, finite = _told(c, start, final, threads)
        status[broken & (reached == Status.OK)] = Status.STEP_TOO_LARGE
    status[~finite] = Status.START_NOT_FINITE
    return status


def breaks_energy_bounds(c: Coefficients, start: Floats, final: Floats) -> NDArray[np.bool_]:
    """Which trajectories (n, 4) end with an energy that they cannot have.

    Under a constant force T + U never grows, and without damper it is conserved; under the decaying force
    T + Pi grows by at most F0 (2 l - sgn(F0) x2(0)), the work done if M2 went to the far end of its reach
    at full force, and without damper falls by at most F0 (2 l + sgn(F0) x2(0)). ``c`` are reduced
    coefficients, numbers or one a trajectory.
    """
    return _told(c, start, final, 1)[0]


def _told(c: Coefficients, start: Floats, final: Floats, threads: int | None) -> tuple[Bools, Bools]:
    """Which trajectories end with an energy that they cannot have, and whose starts are finite."""
    start, final = (np.ascontiguousarray(states, dtype=np.float64) for states in (start, final))
    broken, finite = np.empty(len(start), dtype=np.bool_), np.empty(len(start), dtype=np.bool_)

    def tell(part: slice) -> None:
        tell_broken(start[part], final[part], columns(c, part), SLACK, broken[part], finite[part])

    in_parts(tell, len(start), threads)
    return broken, finite


def energy(c: Coefficients, y: Floats, force: Floats) -> tuple[Floats, Floats]:
    """T + Pi - F x2 over m2 l^2 of states (n, 4), and the scale to compare it with: sum of its terms."""
    phi, theta, phi_dot, theta_dot = np.ascontiguousarray(y.T)
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite has a status of its own
        s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
        T, u = energy_at(
            s1, c1, s2, c2, phi_dot, theta_dot, c.mass, c.slider, c.lift, c.spring, c.gravity, force
        )
        return T + u, energy_scale(T, c.lift, c.spring, c.gravity, c.force)
