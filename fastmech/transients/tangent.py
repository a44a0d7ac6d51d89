"""Driver of the tangent flow: trajectories and one disturbance of each, by an explicit Runge-Kutta method."""

from __future__ import annotations

import numpy as np
from numba import types

from fastmech.integrators.batch import BlockRHS, Floats
from fastmech.integrators.implicit import difference_jacobian
from fastmech.jit import JACOBIAN, MATRIX, RHS, VECTOR, kernel


@kernel(
    types.void(
        RHS,
        JACOBIAN,
        types.int64,
        MATRIX,
        VECTOR,
        VECTOR,
        types.float64,
        types.float64,
        types.int64,
        MATRIX,
        MATRIX,
        MATRIX,
        VECTOR,
    )
)
def advance_tangents(
    rhs: BlockRHS,
    jacobian: BlockRHS,
    analytic: int,
    a: Floats,
    b: Floats,
    c: Floats,
    begin: float,
    h: float,
    steps: int,
    Y: Floats,
    D: Floats,
    params: Floats,
    growth: Floats,
) -> None:
    """Take states ``Y`` and disturbances ``D`` (dim, lanes) so many steps on from time ``begin`` [s].

    D' = J(y) D along the motion, by the same stages as y. After every step each disturbance is scaled to
    length 1 and the logarithm of its length added to ``growth`` (lanes,). ``analytic`` = 0 takes the Jacobian
    from differences of ``rhs``.
    """
    stages = b.shape[0]
    dim, lanes = Y.shape
    K, L = np.empty((stages, dim, lanes)), np.empty((stages, dim, lanes))
    Z, W = np.empty((dim, lanes)), np.empty((dim, lanes))
    J = np.empty((dim * dim, lanes))
    for step in range(steps):
        t = begin + step * h
        for s in range(stages):
            Z[:] = Y
            W[:] = D
            for m in range(s):
                weight = h * a[s, m]
                for x in range(dim):
                    for i in range(lanes):
                        Z[x, i] += weight * K[m, x, i]
                        W[x, i] += weight * L[m, x, i]
            rhs(t + c[s] * h, Z, K[s], params)
            if analytic:
                jacobian(t + c[s] * h, Z, J, params)
            else:
                difference_jacobian(rhs, t + c[s] * h, Z, J, params)
            for x in range(dim):
                for i in range(lanes):
                    total = 0.0
                    for y in range(dim):
                        total += J[x * dim + y, i] * W[y, i]
                    L[s, x, i] = total
        for s in range(stages):
            weight = h * b[s]
            for x in range(dim):
                for i in range(lanes):
                    Y[x, i] += weight * K[s, x, i]
                    D[x, i] += weight * L[s, x, i]
        for i in range(lanes):
            square = 0.0
            for x in range(dim):
                square += D[x, i] * D[x, i]
            length = np.sqrt(square)
            growth[i] += np.log(length)
            for x in range(dim):
                D[x, i] /= length
