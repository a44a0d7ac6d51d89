"""Radau IIA on the heavily damped mechanism with every call of the right-hand side counted."""

from __future__ import annotations

import numpy as np

from fastmech.hardcases.references import Motion
from fastmech.integrators.batch import Batch
from fastmech.integrators.explicit import Floats, observe_nothing
from fastmech.integrators.implicit_method import ImplicitRungeKutta
from fastmech.integrators.tableaus.implicit import IMPLICIT_TABLEAUS
from fastmech.jit import RHS_SIGNATURE, kernel
from fastmech.kernels.blocks import DAMPING, DECAY, FORCE, lagrange_block
from fastmech.kernels.jacobians import lagrange_jacobian
from fastmech.mechanism.coefficients import reduce


@kernel(RHS_SIGNATURE)
def counting_lagrange(t: float, Y: Floats, dY: Floats, p: Floats) -> None:
    """Lagrange's equations; a ninth parameter counts the calls."""
    p[8, 0] += 1.0
    lagrange_block(t, Y, dY, p, FORCE, DAMPING, DECAY)


def counted_radau5(m: Motion, steps: int) -> tuple[float, int, Floats]:
    """Error at the end, calls, and the Jacobian's eigenvalues (steps + 1, 4) along the motion."""
    batch = Batch(
        times=np.linspace(0.0, m.t, steps + 1),
        steps=np.ones(steps, dtype=np.int64),
        params=np.append(np.array(reduce(m.scene)), 0.0)[None, :, None],
        observer_params=np.zeros(0),
        Y=m.start[None, :, None].copy(),
        record=np.zeros((1, 0, 1)),
        out=np.empty((1, steps, 4, 1)),
    )
    method = ImplicitRungeKutta(IMPLICIT_TABLEAUS["radau5"], lagrange_jacobian, True)
    method.run(counting_lagrange, observe_nothing, batch)
    calls, out = int(batch.params[0, 8, 0]), batch.out[0]
    path = np.ascontiguousarray(np.concatenate([m.start[None], out[:, :, 0]]).T)
    J = np.empty((16, steps + 1))
    own = np.repeat(np.array(reduce(m.scene))[:, None], steps + 1, axis=1)
    lagrange_jacobian(0.0, path, J, own)
    values = np.linalg.eigvals(J.T.reshape(-1, 4, 4))
    return float(np.abs(out[-1, :, 0] - m.state).max()), calls, values
