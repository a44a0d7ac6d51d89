"""Driver of the tangent flow: trajectories and one disturbance of each, by an explicit Runge-Kutta method."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types

from fastmech.integrators.batch import BlockRHS, Floats
from fastmech.integrators.implicit import difference_jacobian
from fastmech.jit import JACOBIAN, MATRIX, RHS, VECTOR, kernel, named_tuple


class Flow(NamedTuple):
    """Derivatives of the states and of their disturbances."""

    rhs: BlockRHS
    jacobian: BlockRHS
    analytic: bool  #: else the Jacobian is taken from differences of ``rhs``


class Stages(NamedTuple):
    """An explicit Runge-Kutta method."""

    a: Floats
    b: Floats
    c: Floats


class Disturbed(NamedTuple):
    """Trajectories and a disturbance of each, advanced in place."""

    Y: Floats  #: states (dim, lanes)
    D: Floats  #: disturbances (dim, lanes)
    params: Floats  #: (count, lanes)
    growth: Floats  #: (lanes,) is added the logarithm of what a disturbance has grown by


FLOW = named_tuple([RHS, JACOBIAN, types.boolean], Flow)
STAGES = named_tuple([MATRIX, VECTOR, VECTOR], Stages)
DISTURBED = named_tuple([MATRIX, MATRIX, MATRIX, VECTOR], Disturbed)


@kernel(types.void(FLOW, STAGES, DISTURBED, types.float64, types.float64, types.int64))
def advance_tangents(
    flow: Flow, method: Stages, lanes: Disturbed, begin: float, h: float, steps: int
) -> None:
    """Take states and disturbances so many steps of ``h`` on from time ``begin`` [s].

    D' = J(y) D along the motion, by the same stages as y. After every step each disturbance is scaled to
    length 1.
    """
    Y, D, stages = lanes.Y, lanes.D, method.b.shape[0]
    dim, count = Y.shape
    K, L = np.empty((stages, dim, count)), np.empty((stages, dim, count))
    Z, W = np.empty((dim, count)), np.empty((dim, count))
    J = np.empty((dim * dim, count))
    for step in range(steps):
        for s in range(stages):
            t = begin + step * h + method.c[s] * h
            for x in range(dim):
                for i in range(count):
                    Z[x, i], W[x, i] = Y[x, i], D[x, i]
            for m in range(s):
                weight = h * method.a[s, m]
                for x in range(dim):
                    for i in range(count):
                        Z[x, i] += weight * K[m, x, i]
                        W[x, i] += weight * L[m, x, i]
            flow.rhs(t, Z, K[s], lanes.params)
            if flow.analytic:
                flow.jacobian(t, Z, J, lanes.params)
            else:
                difference_jacobian(flow.rhs, t, Z, J, lanes.params)
            for x in range(dim):
                for i in range(count):
                    total = 0.0
                    for y in range(dim):
                        total += J[x * dim + y, i] * W[y, i]
                    L[s, x, i] = total
        for s in range(stages):
            weight = h * method.b[s]
            for x in range(dim):
                for i in range(count):
                    Y[x, i] += weight * K[s, x, i]
                    D[x, i] += weight * L[s, x, i]
        for i in range(count):
            square = 0.0
            for x in range(dim):
                square += D[x, i] * D[x, i]
            length = np.sqrt(square)
            lanes.growth[i] += np.log(length)
            for x in range(dim):
                D[x, i] /= length
