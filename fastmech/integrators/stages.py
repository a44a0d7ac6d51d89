"""Newton's iteration for the stages of one implicit step, first of a whole block and then of its last lanes.

Most lanes of a block have converged after a few iterations; a lane that will fail takes them all. So when
few are left they go on by themselves, in a block just wide enough. Which lanes those are changes no lane's
arithmetic.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.integrators.driver import BlockRHS, Floats
from fastmech.integrators.newton import apply_complex, apply_real, combine, newton_inverses
from fastmech.jit import inlined

#: Width of the narrowest block, and the share of a block's lanes that is worth a block of its own.
NARROWEST, FEW = 16, 0.125

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


@inlined
def iterate(
    rhs: BlockRHS,
    jacobian: BlockRHS,
    kind: int,
    t: float,
    h: float,
    ahead: Floats,
    Y: Floats,
    Z: Floats,
    E: Floats,
    params: Floats,
    eigenvalues: Floats,
    X: Floats,
    U: Floats,
    V: Floats,
    within: Floats,
    scaled: Floats,
    back: Floats,
    pair: int,
    remainder: float,
    active: Floats,
    last: Floats,
    base: Floats,
    iteration: int,
    few: int,
) -> tuple[int, int]:
    """Iterate on a group of stages until no more than ``few`` lanes are left; how many are, and iterations.

    ``Z`` (group, dim, lanes) are the stages' increments, ``E`` what the stages before the group add to them,
    ``ahead`` their times after ``t``; ``X`` and ``U + i V`` solve the real and the complex system, if there
    are such, and change where lanes start again. ``active``, ``last`` and ``base`` (lanes,) are those of
    :func:`accept`. The other arguments are explained at
    :func:`fastmech.integrators.implicit.integrate_implicit_block`.
    """
    group, dim, lanes = Z.shape
    n = dim * lanes
    F, R = np.empty((group, dim, lanes)), np.empty((group, dim, lanes))
    W, D = np.empty((group, dim, lanes)), np.empty((group, dim, lanes))
    point, change, scale = np.empty((dim, lanes)), np.empty(lanes), np.empty(lanes)
    z, e, f = Z.reshape(group, n), E.reshape(group, n), F.reshape(group, n)
    r, w, d = R.reshape(group, n), W.reshape(group, n), D.reshape(group, n)
    left = 0
    for i in range(lanes):
        left += active[i] > 0.0
    while left > few and iteration < MOST_ITERATIONS:
        if iteration == FIRST_ATTEMPT:
            for k in range(group):
                for x in range(dim):
                    for i in range(lanes):
                        Z[k, x, i] = E[k, x, i] if active[i] > 0.0 else Z[k, x, i]
            for i in range(lanes):
                last[i] = np.inf
            J, G = np.empty((dim * dim, lanes)), np.empty((8 * dim * dim + 1, lanes))
            work = np.empty((3, dim, lanes))
            newton_inverses(rhs, jacobian, kind, t, Y, params, eigenvalues, h, J, X, U, V, G, work)
        for k in range(group):
            for x in range(dim):
                for i in range(lanes):
                    point[x, i] = Y[x, i] + Z[k, x, i]
            rhs(t + ahead[k], point, F[k], params)
        combine(d, within, f)
        for k in range(group):
            for x in range(n):
                d[k, x] += e[k, x] - z[k, x]
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
                    Z[k, x, i] += move if active[i] > 0.0 else 0.0
                    # NaN stays: a sum keeps it where a maximum may not.
                    change[i] = change[i] + move - move if move != move else max(change[i], abs(move))
                    scale[i] = max(scale[i], abs(Z[k, x, i]))
        left = accept(change, last, scale, active, iteration % FIRST_ATTEMPT, base, remainder)
        iteration += 1
    return left, iteration


@inlined
def columns(rows: Floats, which: NDArray[np.int64]) -> Floats:
    """Some lanes of rows (count, lanes)."""
    chosen = np.empty((rows.shape[0], which.shape[0]))
    for x in range(rows.shape[0]):
        for i in range(which.shape[0]):
            chosen[x, i] = rows[x, which[i]]
    return chosen


@inlined
def solve_stages(
    rhs: BlockRHS,
    jacobian: BlockRHS,
    kind: int,
    t: float,
    h: float,
    ahead: Floats,
    Y: Floats,
    Z: Floats,
    E: Floats,
    params: Floats,
    eigenvalues: Floats,
    X: Floats,
    U: Floats,
    V: Floats,
    within: Floats,
    scaled: Floats,
    back: Floats,
    pair: int,
    remainder: float,
    active: Floats,
    last: Floats,
    base: Floats,
) -> int:
    """Solve for a group of stages; arguments as those of :func:`iterate`. Returns how many have failed."""
    group, dim, lanes = Z.shape
    few = int(FEW * lanes) if lanes > NARROWEST else 0
    left, iteration = iterate(
        rhs, jacobian, kind, t, h, ahead, Y, Z, E, params, eigenvalues, X, U, V, within, scaled, back, pair,
        remainder, active, last, base, 0, few,
    )  # fmt: skip
    if left == 0 or iteration == MOST_ITERATIONS:
        return left
    which = np.empty((left + NARROWEST - 1) // NARROWEST * NARROWEST, dtype=np.int64)
    found = 0
    for i in range(lanes):
        if active[i] > 0.0:
            which[found] = i
            found += 1
    which[found:] = which[found - 1]
    z, e = Z.reshape(group * dim, lanes), E.reshape(group * dim, lanes)
    own_z, own_active = columns(z, which), np.ones(which.shape[0])
    left, iteration = iterate(
        rhs, jacobian, kind, t, h, ahead, columns(Y, which), own_z.reshape((group, dim, which.shape[0])),
        columns(e, which).reshape((group, dim, which.shape[0])), columns(params, which), eigenvalues,
        columns(X, which), columns(U, which), columns(V, which), within, scaled, back, pair,
        remainder, own_active, last[which], base[which], iteration, 0,
    )  # fmt: skip
    for i in range(found):
        active[which[i]] = own_active[i]
        for x in range(group * dim):
            z[x, which[i]] = own_z[x, i]
    return left
