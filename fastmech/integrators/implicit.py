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

from fastmech.integrators.batch import ROUNDED_TIME
from fastmech.integrators.driver import BlockRHS, Floats, Integers, Observer
from fastmech.integrators.newton import combine, newton_inverses
from fastmech.integrators.stages import solve_stages
from fastmech.jit import CUBE, INTEGERS, JACOBIAN, MATRIX, OBSERVER, RHS, VECTOR, kernel


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
        MATRIX,
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
    memory: Floats,
    phase: Floats,
) -> None:
    """Take a block through all output times.

    ``kind`` says where the Jacobian comes from. Stages are solved in groups of ``back.shape[0]``: with A_g
    the group's part of ``a``, ``back`` is T and ``forth`` T^-1 A_g^-1, where T^-1 A_g^-1 T holds the real
    eigenvalue ``eigenvalues[0]`` (0: none) and then the block [[re, -im], [im, re]] of
    ``eigenvalues[1:]`` (im = 0: none). ``final`` = b A^-1 makes the step of the stages' increments,
    ``extrapolation`` (empty: none) the next step's first guess of this step's increments. ``remainder`` is
    what an accepted iteration may leave, relative to the lane's largest state.

    ``failed`` (lanes,) is NaN or, for a lane that has been given up, the time of its last state, which it
    keeps. ``memory`` holds the last step's increments and what compensates for rounding, ``phase`` the last
    step's length. The other arguments are the fields of :class:`fastmech.integrators.batch.Batch`, without
    the blocks' axis.
    """
    stages, group = nodes.shape[0], back.shape[0]
    dim, lanes = Y.shape
    n, rows = dim * lanes, dim * dim
    # Each array once as rows for right-hand side and solves, once flat for the stage sums.
    Z, comp = memory[: stages * dim].reshape((stages, dim, lanes)), memory[stages * dim :]
    K, E = np.zeros((stages, dim, lanes)), np.zeros((stages, dim, lanes))
    guess, point, work = np.empty((stages, n)), np.empty((dim, lanes)), np.empty((3, dim, lanes))
    J, X, U, V = (
        np.empty((rows, lanes)),
        np.empty((rows, lanes)),
        np.empty((rows, lanes)),
        np.empty((rows, lanes)),
    )
    G = np.empty((8 * rows + 1, lanes))
    z, e, slopes = Z.reshape(stages, n), E.reshape(stages, n), K.reshape(stages, n)
    alive, active = np.empty(lanes), np.empty(lanes)
    last, base = np.empty(lanes), np.empty(lanes)
    for i in range(lanes):
        alive[i] = 1.0 if np.isnan(failed[i]) else 0.0
    pair = 1 if eigenvalues[0] != 0.0 else 0  # first row of the complex pair
    previous = phase[0]
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
            if extrapolation.shape[0] and abs(h - previous) <= ROUNDED_TIME * max(abs(t), abs(t + h)):
                combine(guess, extrapolation, z)
                z[:] = guess
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
                for i in range(lanes):
                    active[i], last[i] = alive[i], np.inf
                end = first + group
                left = solve_stages(
                    rhs, jacobian, kind, t, h, h * nodes[first:end], Y, Z[first:end], E[first:end], params,
                    eigenvalues, X, U, V, within, scaled, back, pair, remainder, active, last, base,
                )  # fmt: skip
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
            if record.size:
                observe(times[j] + (step + 1) * h, Y, observer_params, record)
        out[j] = Y
    phase[0] = previous
