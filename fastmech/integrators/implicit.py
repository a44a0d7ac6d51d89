"""Driver of implicit Runge-Kutta methods with a fixed step over one block of lanes.

The stages' increments Z solve Z_i = h sum_j a_ij f(y + Z_j) by a simplified Newton iteration (Hairer, Wanner,
*Solving ODEs II*, section IV.8): one Jacobian a step, the system of all stages split by the eigenvalues of
A^-1 into one real and one complex system of the size of the state. The Jacobian is that of the stages' mean
as the last step foretells it. Stages of a diagonally implicit method are solved one after another by the
same code. The iteration ends, lane by lane, when rounding is all that is left, so that a lane's result never
depends on its neighbours.
"""

from __future__ import annotations

import numpy as np
from numba import types

from fastmech.integrators.explicit import BlockRHS, Floats, Integers, Observer
from fastmech.integrators.newton import apply_complex, apply_real, combine, newton_inverses
from fastmech.jit import CUBE, INTEGERS, JACOBIAN, MATRIX, OBSERVER, RHS, VECTOR, inlined, kernel

#: Iterations before a lane is started again, without extrapolation and with the Jacobian at the step's
#: start, and before it is given up.
FIRST_ATTEMPT, MOST_ITERATIONS = 16, 40

#: What rounding may leave where nothing improves any more, relative to the lane's largest state or increment.
ROUNDED = 1e-9

#: Iterations after which convergence is slow, the step being long for its Jacobian, and what then may remain.
PATIENCE, SLOW_REMAINDER = 8, 1e-14


@inlined
def accept(
    step: Floats, last: Floats, scale: Floats, active: Floats, iteration: int, base: Floats, remainder: float
) -> int:
    """Take converged lanes out of ``active``; returns how many are left. ``step`` is the last correction.

    With the contraction q = step/last, what is left is q/(1-q) step.
    """
    left = 0
    remainder = remainder if iteration < PATIENCE else SLOW_REMAINDER
    for i in range(step.shape[0]):
        size = remainder * (base[i] + scale[i])
        q = step[i] / last[i]
        small = (step[i] <= size) | ((iteration > 0) & (q < 1.0) & (q * step[i] <= (1.0 - q) * size))
        rounded = (iteration > 1) & (q > 0.5) & (step[i] <= ROUNDED * (base[i] + scale[i]))
        active[i] = 0.0 if small | rounded else active[i]
        last[i] = step[i]
        left += active[i] > 0.0
    return left


@kernel(
    types.void(
        RHS,
        JACOBIAN,
        OBSERVER,
        types.int64,
        MATRIX,
        VECTOR,
        VECTOR,
        MATRIX,
        MATRIX,
        VECTOR,
        MATRIX,
        types.float64,
        VECTOR,
        INTEGERS,
        MATRIX,
        MATRIX,
        VECTOR,
        MATRIX,
        CUBE,
        VECTOR,
    )
)
def integrate_implicit_block(
    rhs: BlockRHS,
    jacobian: BlockRHS,
    observe: Observer,
    kind: int,
    a: Floats,
    nodes: Floats,
    final: Floats,
    back: Floats,
    forth: Floats,
    eigenvalues: Floats,
    extrapolation: Floats,
    remainder: float,
    times: Floats,
    steps: Integers,
    Y: Floats,
    params: Floats,
    observer_params: Floats,
    record: Floats,
    out: Floats,
    failed: Floats,
) -> None:
    """Take a block through all output times.

    ``kind`` says where the Jacobian comes from. Stages are solved in groups of ``back.shape[0]``: with A_g
    the group's part of ``a``, ``back`` is T and ``forth`` T^-1 A_g^-1, where T^-1 A_g^-1 T holds the real
    eigenvalue ``eigenvalues[0]`` (0: none) and then the block [[re, -im], [im, re]] of
    ``eigenvalues[1:]`` (im = 0: none). ``final`` = b A^-1 makes the step of the stages' increments,
    ``extrapolation`` (empty: none) the next step's first guess of this step's increments. ``remainder`` is
    what an accepted iteration may leave, relative to the lane's largest state.

    ``failed`` (lanes,) is NaN or, for a lane that has been given up, the time of its last state, which it
    keeps. The other arguments are the fields of
    :class:`fastmech.integrators.batch.Batch`, without the blocks' axis.
    """
    stages, group = nodes.shape[0], back.shape[0]
    dim, lanes = Y.shape
    n, rows = dim * lanes, dim * dim
    # Each array once as rows for right-hand side and solves, once flat for the stage sums.
    Z, F = np.zeros((stages, dim, lanes)), np.zeros((stages, dim, lanes))
    K, E = np.zeros((stages, dim, lanes)), np.zeros((stages, dim, lanes))
    R, W, D = np.empty((group, dim, lanes)), np.empty((group, dim, lanes)), np.empty((group, dim, lanes))
    point, comp, work = np.empty((dim, lanes)), np.zeros((dim, lanes)), np.empty((3, dim, lanes))
    J, X, U, V = (
        np.empty((rows, lanes)),
        np.empty((rows, lanes)),
        np.empty((rows, lanes)),
        np.empty((rows, lanes)),
    )
    G = np.empty((8 * rows + 1, lanes))
    z, f = Z.reshape(stages, n), F.reshape(stages, n)
    e, slopes = E.reshape(stages, n), K.reshape(stages, n)
    r, w, d = R.reshape(group, n), W.reshape(group, n), D.reshape(group, n)
    alive, active = np.empty(lanes), np.empty(lanes)
    change, last, base, scale = np.empty(lanes), np.empty(lanes), np.empty(lanes), np.empty(lanes)
    for i in range(lanes):
        alive[i] = 1.0 if np.isnan(failed[i]) else 0.0
    pair = 1 if eigenvalues[0] != 0.0 else 0  # first row of the complex pair
    previous = 0.0
    for j in range(steps.shape[0]):
        h = (times[j + 1] - times[j]) / max(steps[j], 1)
        own, within, scaled = h * a, h * a[:group, :group], forth / h
        for step in range(steps[j]):
            t = times[j] + step * h
            for i in range(lanes):
                base[i] = 0.0
            for x in range(dim):
                for i in range(lanes):
                    base[i] = max(base[i], abs(Y[x, i]))
            if extrapolation.shape[0] and abs(h - previous) <= 1e-12 * abs(h):
                combine(d, extrapolation, z)
                z[:] = d
            else:
                z[:] = 0.0
            previous = h
            # The Jacobian of the mean of the guessed stages errs by half of what that of the start does.
            middle = 0.0
            point[:] = Y
            if group == stages:
                for k in range(stages):
                    middle += nodes[k] * h / stages
                    for x in range(dim):
                        for i in range(lanes):
                            point[x, i] += Z[k, x, i] / stages
            newton_inverses(
                rhs, jacobian, kind, t + middle, point, params, eigenvalues, h, J, X, U, V, G, work
            )
            for first in range(0, stages, group):
                for k in range(first, first + group):
                    e[k] = 0.0
                    for m in range(first):
                        e[k] += own[k, m] * slopes[m]
                if group < stages:
                    z[first] = e[first]
                left = 0
                for i in range(lanes):
                    active[i], last[i] = alive[i], np.inf
                    left += alive[i] > 0.0
                for iteration in range(MOST_ITERATIONS):
                    if left == 0:
                        break
                    if iteration == FIRST_ATTEMPT:
                        for k in range(first, first + group):
                            for x in range(dim):
                                for i in range(lanes):
                                    Z[k, x, i] = E[k, x, i] if active[i] > 0.0 else Z[k, x, i]
                        for i in range(lanes):
                            last[i] = np.inf
                        newton_inverses(
                            rhs, jacobian, kind, t, Y, params, eigenvalues, h, J, X, U, V, G, work
                        )
                    for k in range(first, first + group):
                        for x in range(dim):
                            for i in range(lanes):
                                point[x, i] = Y[x, i] + Z[k, x, i]
                        rhs(t + nodes[k] * h, point, F[k], params)
                    combine(d, within, f[first : first + group])
                    for k in range(group):
                        for x in range(n):
                            d[k, x] += e[first + k, x] - z[first + k, x]
                    combine(r, scaled, d)
                    if pair:
                        apply_real(X, R[0], W[0])
                    if eigenvalues[2] != 0.0:
                        apply_complex(U, V, R[pair], R[pair + 1], W[pair], W[pair + 1])
                    combine(d, back, w)
                    for i in range(lanes):
                        change[i], scale[i] = 0.0, 0.0
                    for k in range(group):
                        for x in range(dim):
                            for i in range(lanes):
                                move = D[k, x, i]
                                Z[first + k, x, i] += move if active[i] > 0.0 else 0.0
                                # NaN stays: a sum keeps it where a maximum may not.
                                change[i] = (
                                    change[i] + move - move if move != move else max(change[i], abs(move))
                                )
                                scale[i] = max(scale[i], abs(Z[first + k, x, i]))
                    left = accept(change, last, scale, active, iteration % FIRST_ATTEMPT, base, remainder)
                if left:
                    for i in range(lanes):
                        if active[i] > 0.0:
                            alive[i], failed[i] = 0.0, t
                if group < stages:
                    for x in range(n):
                        slopes[first, x] = (z[first, x] - e[first, x]) / own[first, first]
            for x in range(dim):
                for i in range(lanes):
                    total = comp[x, i]
                    for k in range(stages):
                        total += final[k] * Z[k, x, i]
                    moved = Y[x, i] + total
                    comp[x, i] = total - (moved - Y[x, i])
                    Y[x, i] = moved if alive[i] > 0.0 else Y[x, i]
            observe(times[j] + (step + 1) * h, Y, observer_params, record)
        out[j] = Y
