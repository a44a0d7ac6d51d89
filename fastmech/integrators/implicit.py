"""Driver of implicit Runge-Kutta methods with a fixed step over blocks of lanes.

The stages' increments Z solve Z_i = h sum_j a_ij f(y + Z_j) by a simplified Newton iteration (Hairer, Wanner,
*Solving ODEs II*, section IV.8): one Jacobian a step, the system of all stages split by the eigenvalues of
A^-1 into one real and one complex system of the size of the state. The Jacobian is that of the stages' mean
as the last step foretells it. Stages of a diagonally implicit method are solved one after another by the
same code. The iteration ends, lane by lane, when rounding is all that is left, so that a lane's result never
depends on its neighbours.

Most lanes of a block have converged after a few iterations; a lane that will fail takes them all. So when
few are left they go on by themselves, in a block just wide enough. Which lanes those are changes no lane's
arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import types

from fastmech.arrays import Floats, Integers
from fastmech.integrators.explicit import ROUNDED_TIME, Batch, BlockRHS, Observer, batch_type
from fastmech.integrators.tableau import Scheme
from fastmech.jit import (
    INVERSE,
    INVERSE_SIGNATURE,
    MATRIX,
    OBSERVER,
    RHS,
    VECTOR,
    called,
    inlined,
    kernel,
    named_tuple,
)

#: Width of the narrowest block, and the share of a block's lanes that is worth a block of its own.
NARROWEST, FEW = 16, 0.125

#: Iterations before a lane is started again, without extrapolation and with the Jacobian at the step's
#: start, and before it is given up.
FIRST_ATTEMPT, MOST_ITERATIONS = 16, 40

#: What rounding may leave where nothing improves any more, relative to the lane's largest state or increment.
ROUNDED = 1e-9

#: Iterations after which convergence is slow, the step being long for its Jacobian, and what then may remain.
PATIENCE, SLOW_REMAINDER = 8, 1e-14

#: Relative increment of forward differences: root of the rounding unit.
INCREMENT = 2.0**-26


class ImplicitCalls(NamedTuple):
    """What the driver calls."""

    rhs: BlockRHS
    inverse: Callable[[Floats, complex, Floats, Floats, Floats], None]  #: as :func:`inverse_by_elimination`
    observe: Observer


class Block(NamedTuple):
    """Lanes that take a step, and memory."""

    Y: Floats  #: states (dim, lanes)
    params: Floats  #: (count, lanes)
    Z: Floats  #: increments of the stages, then what compensates for rounding (stages + 1, dim, lanes)
    E: Floats  #: what the stages before a group add to its own (stages, dim, lanes)
    ahead: Floats  #: times of the stages after the step's begin [s]
    within: Floats  #: h times the group's part of ``a``
    scaled: Floats  #: ``forth`` over h
    J: Floats  #: Jacobian (dim * dim, lanes)
    X: Floats  #: solves the real system (dim * dim, lanes)
    U: Floats  #: U + i V solves the complex one
    V: Floats
    G: Floats  #: scratch (8 dim * dim + 1, lanes)
    active: Floats  #: 1: the lane's iteration has not ended (lanes,)
    last: Floats  #: its last correction
    base: Floats  #: its largest state
    alive: Floats  #: 0: it has been given up


class ImplicitMoment(NamedTuple):
    """When a block takes a step, and which of its stages it solves for."""

    t: float  #: begin [s]
    h: float  #: step [s]
    first: int  #: of the group of stages
    known: bool  #: the increments of a last step as long are there, from which these are guessed


CALLS = named_tuple([RHS, INVERSE, OBSERVER], ImplicitCalls)
SCHEME = named_tuple([MATRIX, VECTOR, VECTOR, MATRIX, MATRIX, VECTOR, MATRIX, types.float64], Scheme)


@kernel(types.void(RHS, types.float64, MATRIX, MATRIX, MATRIX))
def difference_jacobian(rhs: BlockRHS, t: float, Y: Floats, J: Floats, params: Floats) -> None:
    """Jacobian of a right-hand side by forward differences."""
    dim, lanes = Y.shape
    shifted, base, ahead = np.empty((dim, lanes)), np.empty((dim, lanes)), np.empty((dim, lanes))
    rhs(t, Y, base, params)
    for r in range(dim):
        for i in range(lanes):
            shifted[r, i] = Y[r, i]
    for c in range(dim):
        for i in range(lanes):
            largest = 0.0
            for r in range(dim):
                largest = max(largest, abs(Y[r, i]))
            # Small states move on the scale of the large ones; 1e-3 keeps a state that is zero off rounding.
            shifted[c, i] = Y[c, i] + INCREMENT * max(abs(Y[c, i]), 1e-3 * max(largest, 1.0))
        rhs(t, shifted, ahead, params)
        for r in range(dim):
            for i in range(lanes):
                J[r * dim + c, i] = (ahead[r, i] - base[r, i]) / (shifted[c, i] - Y[c, i])
        for i in range(lanes):
            shifted[c, i] = Y[c, i]


@called
def eliminate(G: Floats, n: int) -> None:
    """Gauss-Jordan on rows ``r * 2n + c`` of [matrix, identity] in place: leaves [identity, inverse].

    Rows are exchanged with each later row that has the larger pivot, by selection, so that lanes need not
    agree on their pivots.
    """
    lanes, wide = G.shape[1], 2 * n
    for k in range(n):
        for r in range(k + 1, n):
            for i in range(lanes):
                swap = abs(G[r * wide + k, i]) > abs(G[k * wide + k, i])
                G[(n * wide), i] = 1.0 if swap else 0.0
            for c in range(k, wide):
                for i in range(lanes):
                    upper, lower = G[k * wide + c, i], G[r * wide + c, i]
                    swap = G[n * wide, i] > 0.5
                    G[k * wide + c, i] = lower if swap else upper
                    G[r * wide + c, i] = upper if swap else lower
        for i in range(lanes):
            G[n * wide, i] = 1.0 / G[k * wide + k, i]
        for c in range(k, wide):
            for i in range(lanes):
                G[k * wide + c, i] *= G[n * wide, i]
        for r in range(n):
            if r != k:
                for i in range(lanes):
                    G[n * wide, i] = G[r * wide + k, i]
                for c in range(k, wide):
                    for i in range(lanes):
                        G[r * wide + c, i] -= G[n * wide, i] * G[k * wide + c, i]


@kernel(INVERSE_SIGNATURE)
def inverse_by_elimination(J: Floats, mu: complex, G: Floats, X: Floats, V: Floats) -> None:
    """X + i V = (mu - J)^-1, from the real matrix of twice the size; ``V`` is left if mu is real."""
    dim = round(J.shape[0] ** 0.5)
    parts = 2 if mu.imag != 0.0 else 1
    n = parts * dim
    for row in range(2 * n * n):
        for i in range(J.shape[1]):
            G[row, i] = 0.0
    for i in range(J.shape[1]):
        for r in range(n):
            row, part = 2 * n * r, r // dim * dim
            for c in range(dim):
                G[row + part + c, i] = -J[(r - part) * dim + c, i]
            G[row + r, i] += mu.real
            G[row + n + r, i] = 1.0
            if parts == 2:
                G[row + (r + dim) % n, i] = mu.imag if part else -mu.imag
    eliminate(G, n)
    for r in range(dim):
        for c in range(dim):
            for i in range(J.shape[1]):
                X[r * dim + c, i] = G[2 * n * r + n + c, i]
                if parts == 2:
                    V[r * dim + c, i] = G[2 * n * (dim + r) + n + c, i]


@called
def linearize(call: ImplicitCalls, scheme: Scheme, block: Block, point: Floats, at: ImplicitMoment) -> None:
    """The Jacobian J at a point (dim, lanes), and what solves the systems of the eigenvalues over h."""
    difference_jacobian(call.rhs, at.t, point, block.J, block.params)
    real, re, im = scheme.eigenvalues[0] / at.h, scheme.eigenvalues[1] / at.h, scheme.eigenvalues[2] / at.h
    if real != 0.0:
        call.inverse(block.J, complex(real, 0.0), block.G, block.X, block.V)
    if im != 0.0:
        call.inverse(block.J, complex(re, im), block.G, block.U, block.V)


@called
def solve_systems(scheme: Scheme, block: Block, R: Floats, W: Floats) -> None:
    """Solutions W (group, dim, lanes) of the real and the complex system for right sides R."""
    dim, lanes = block.Y.shape
    if scheme.eigenvalues[0] != 0.0:
        for r in range(dim):
            for i in range(lanes):
                total = 0.0
                for c in range(dim):
                    total += block.X[r * dim + c, i] * R[0, c, i]
                W[0, r, i] = total
    if scheme.eigenvalues[2] != 0.0:
        pair = R.shape[0] - 2
        for r in range(dim):
            for i in range(lanes):
                real = imaginary = 0.0
                for c in range(dim):
                    u, v = block.U[r * dim + c, i], block.V[r * dim + c, i]
                    a, b = R[pair, c, i], R[pair + 1, c, i]
                    real += u * a - v * b
                    imaginary += v * a + u * b
                W[pair, r, i], W[pair + 1, r, i] = real, imaginary


@called
def combine(out: Floats, weights: Floats, X: Floats, first: int) -> None:
    """out[k] = sum_j weights[k, j] X[first + j] over flat rows; at most three terms."""
    count = weights.shape[0]
    for k in range(count):
        w0 = weights[k, 0]
        if count == 1:
            for x in range(out.shape[1]):
                out[k, x] = w0 * X[first, x]
        elif count == 2:
            w1 = weights[k, 1]
            for x in range(out.shape[1]):
                out[k, x] = w0 * X[first, x] + w1 * X[first + 1, x]
        else:
            w1, w2 = weights[k, 1], weights[k, 2]
            for x in range(out.shape[1]):
                out[k, x] = w0 * X[first, x] + w1 * X[first + 1, x] + w2 * X[first + 2, x]


@inlined
def accept(block: Block, step: Floats, scale: Floats, iteration: int, remainder: float) -> int:
    """End the iteration of lanes that have converged; how many are left. ``step`` is the last correction.

    With the contraction q = step/last, what is left is q/(1-q) step.
    """
    left = 0
    remainder = remainder if iteration < PATIENCE else SLOW_REMAINDER
    for i in range(step.shape[0]):
        size = remainder * (block.base[i] + scale[i])
        q = step[i] / block.last[i]
        small = (step[i] <= size) | ((iteration > 0) & (q < 1.0) & (q * step[i] <= (1.0 - q) * size))
        rounded = (iteration > 1) & (q > 0.5) & (step[i] <= ROUNDED * (block.base[i] + scale[i]))
        block.active[i] = 0.0 if small | rounded else block.active[i]
        block.last[i] = step[i]
        left += block.active[i] > 0.0
    return left


@called
def iterate(
    call: ImplicitCalls, scheme: Scheme, block: Block, at: ImplicitMoment, begun: tuple[int, int]
) -> tuple[int, int]:
    """Iterate on a group of stages until few lanes are left; how many are, and iterations.

    ``begun`` are the iterations that have been, and how many lanes are few.
    """
    (dim, lanes), group, first = block.Y.shape, scheme.back.shape[0], at.first
    n, (iteration, few), left = dim * lanes, begun, 0
    F, R = np.empty((group, dim, lanes)), np.empty((group, dim, lanes))
    W, D = np.empty((group, dim, lanes)), np.empty((group, dim, lanes))
    point, change, scale = np.empty((dim, lanes)), np.empty(lanes), np.empty(lanes)
    f, r, w, d = F.reshape(group, n), R.reshape(group, n), W.reshape(group, n), D.reshape(group, n)
    z, e = block.Z.reshape(block.Z.shape[0], n), block.E.reshape(block.E.shape[0], n)
    for i in range(lanes):
        left += block.active[i] > 0.0
    while left > few and iteration < MOST_ITERATIONS:
        if iteration == FIRST_ATTEMPT:
            for k in range(first, first + group):
                for x in range(dim):
                    for i in range(lanes):
                        block.Z[k, x, i] = block.E[k, x, i] if block.active[i] > 0.0 else block.Z[k, x, i]
            for i in range(lanes):
                block.last[i] = np.inf
            linearize(call, scheme, block, block.Y, at)
        for k in range(group):
            for x in range(dim):
                for i in range(lanes):
                    point[x, i] = block.Y[x, i] + block.Z[first + k, x, i]
            call.rhs(at.t + block.ahead[first + k], point, F[k], block.params)
        combine(d, block.within, f, 0)
        for k in range(group):
            for x in range(n):
                d[k, x] += e[first + k, x] - z[first + k, x]
        combine(r, block.scaled, d, 0)
        solve_systems(scheme, block, R, W)
        combine(d, scheme.back, w, 0)
        for i in range(lanes):
            change[i], scale[i] = 0.0, 0.0
        for k in range(group):
            for x in range(dim):
                for i in range(lanes):
                    move = D[k, x, i]
                    block.Z[first + k, x, i] += move if block.active[i] > 0.0 else 0.0
                    # NaN stays: a sum keeps it where a maximum may not.
                    change[i] = change[i] + move - move if move != move else max(change[i], abs(move))
                    scale[i] = max(scale[i], abs(block.Z[first + k, x, i]))
        left = accept(block, change, scale, iteration % FIRST_ATTEMPT, scheme.remainder)
        iteration += 1
    return left, iteration


@called
def chosen(rows: Floats, which: Integers) -> Floats:
    """Some lanes of rows (count, lanes)."""
    found = np.empty((rows.shape[0], which.shape[0]))
    for x in range(rows.shape[0]):
        for i in range(which.shape[0]):
            found[x, i] = rows[x, which[i]]
    return found


@called
def solve_stages(call: ImplicitCalls, scheme: Scheme, block: Block, at: ImplicitMoment) -> int:
    """Solve for a group of stages, first of a whole block and then of its last lanes; how many fail."""
    (stages, dim, lanes), group = block.E.shape, scheme.back.shape[0]
    left, iteration = iterate(call, scheme, block, at, (0, int(FEW * lanes) if lanes > NARROWEST else 0))
    if left == 0 or iteration == MOST_ITERATIONS:
        return left
    which = np.empty((left + NARROWEST - 1) // NARROWEST * NARROWEST, dtype=np.int64)
    found, width = 0, which.shape[0]
    for i in range(lanes):
        if block.active[i] > 0.0:
            which[found] = i
            found += 1
    for i in range(found, width):
        which[i] = which[found - 1]
    z = block.Z.reshape((stages + 1) * dim, lanes)
    own_z = chosen(z, which)
    own = Block(
        Y=chosen(block.Y, which),
        params=chosen(block.params, which),
        Z=own_z.reshape((stages + 1, dim, width)),
        E=chosen(block.E.reshape(stages * dim, lanes), which).reshape((stages, dim, width)),
        ahead=block.ahead,
        within=block.within,
        scaled=block.scaled,
        J=np.empty((dim * dim, width)),
        X=chosen(block.X, which),
        U=chosen(block.U, which),
        V=chosen(block.V, which),
        G=np.empty((8 * dim * dim + 1, width)),
        active=np.ones(width),
        last=chosen(block.last.reshape(1, lanes), which).reshape(width),
        base=chosen(block.base.reshape(1, lanes), which).reshape(width),
        alive=block.alive,
    )
    left, iteration = iterate(call, scheme, own, at, (iteration, 0))
    for i in range(found):
        block.active[which[i]] = own.active[i]
        for x in range(at.first * dim, (at.first + group) * dim):
            z[x, which[i]] = own_z[x, i]
    return left


@called
def step_implicitly(call: ImplicitCalls, scheme: Scheme, block: Block, at: ImplicitMoment) -> bool:
    """A step of a block in place; whether lanes fail, which keep their states and are not alive then."""
    (stages, dim, lanes), group, failing = block.E.shape, scheme.back.shape[0], False
    n = dim * lanes
    z, e = block.Z.reshape(stages + 1, n), block.E.reshape(stages, n)
    guess, slopes, point = np.zeros((stages, n)), np.zeros((stages, n)), np.empty((dim, lanes))
    for i in range(lanes):
        block.base[i] = 0.0
    for x in range(dim):
        for i in range(lanes):
            block.base[i] = max(block.base[i], abs(block.Y[x, i]))
            point[x, i] = block.Y[x, i]
    if at.known:
        combine(guess, scheme.extrapolation, z, 0)
    # The Jacobian of the mean of the guessed stages errs by half of what that of the start does.
    middle = 0.0
    for k in range(stages):
        for x in range(n):
            z[k, x] = guess[k, x]
        if group == stages:
            middle += scheme.nodes[k] * at.h / stages
            for x in range(dim):
                for i in range(lanes):
                    point[x, i] += block.Z[k, x, i] / stages
    linearize(call, scheme, block, point, ImplicitMoment(at.t + middle, at.h, 0, False))
    for first in range(0, stages, group):
        for k in range(first, first + group):
            for x in range(n):
                e[k, x] = 0.0
            for m in range(first):
                weight = at.h * scheme.a[k, m]
                for x in range(n):
                    e[k, x] += weight * slopes[m, x]
        if group < stages:
            for x in range(n):
                z[first, x] = e[first, x]
        for i in range(lanes):
            block.active[i], block.last[i] = block.alive[i], np.inf
        if solve_stages(call, scheme, block, ImplicitMoment(at.t, at.h, first, False)):
            failing = True
            for i in range(lanes):
                if block.active[i] > 0.0:
                    block.alive[i] = 0.0
        if group < stages:
            weight = at.h * scheme.a[first, first]
            for x in range(n):
                slopes[first, x] = (z[first, x] - e[first, x]) / weight
    for x in range(dim):
        for i in range(lanes):
            total = block.Z[stages, x, i]
            for k in range(stages):
                total += scheme.final[k] * block.Z[k, x, i]
            moved = block.Y[x, i] + total
            block.Z[stages, x, i] = total - (moved - block.Y[x, i])
            block.Y[x, i] = moved if block.alive[i] > 0.0 else block.Y[x, i]
    return failing


@called
def block_of(scheme: Scheme, run: Batch, b: int) -> Block:
    """A block of a batch, with memory of its own."""
    (_, dim, lanes), stages, group = run.Y.shape, scheme.nodes.shape[0], scheme.back.shape[0]
    rows = dim * dim
    return Block(
        Y=run.Y[b],
        params=run.params[min(b, run.params.shape[0] - 1)],
        Z=run.memory[b].reshape((stages + 1, dim, lanes)),
        E=np.empty((stages, dim, lanes)),
        ahead=np.empty(stages),
        within=np.empty((group, group)),
        scaled=np.empty((group, group)),
        J=np.empty((rows, lanes)),
        X=np.empty((rows, lanes)),
        U=np.empty((rows, lanes)),
        V=np.empty((rows, lanes)),
        G=np.empty((8 * rows + 1, lanes)),
        active=np.empty(lanes),
        last=np.empty(lanes),
        base=np.empty(lanes),
        alive=np.empty(lanes),
    )


@kernel(types.void(CALLS, SCHEME, batch_type(types.float64), MATRIX))
def drive_implicit(call: ImplicitCalls, scheme: Scheme, run: Batch, failed: Floats) -> None:
    """Take blocks of lanes through all times, one after the other.

    ``failed`` (blocks, lanes) is NaN or, for a lane that has been given up, the time of its last state, which
    it keeps. The batch's memory holds the last step's increments and what compensates for rounding, its phase
    the last step's length.
    """
    previous, width = 0.0, run.Y.shape[2]
    for b in range(run.Y.shape[0]):
        block, previous = block_of(scheme, run, b), run.phase[0]
        for i in range(width):
            block.alive[i] = 1.0 if np.isnan(failed[b, i]) else 0.0
        for j in range(run.steps.shape[0]):
            h = (run.times[j + 1] - run.times[j]) / max(run.steps[j], 1)
            for k in range(scheme.nodes.shape[0]):
                block.ahead[k] = h * scheme.nodes[k]
            stages = scheme.back.shape[0] if run.steps[j] else 0  # a piece may have no steps
            for k in range(stages):
                for m in range(stages):
                    block.within[k, m], block.scaled[k, m] = h * scheme.a[k, m], scheme.forth[k, m] / h
            for step in range(run.steps[j]):
                t = run.times[j] + step * h
                equal = abs(h - previous) <= ROUNDED_TIME * max(abs(t), abs(t + h))
                known, previous = equal and scheme.extrapolation.shape[0] > 0, h
                if step_implicitly(call, scheme, block, ImplicitMoment(t, h, 0, known)):
                    for i in range(width):
                        if block.alive[i] == 0.0 and np.isnan(failed[b, i]):
                            failed[b, i] = t
                if run.record.size:
                    call.observe(run.times[j] + (step + 1) * h, block.Y, run.observer_params, run.record[b])
            for x in range(block.Y.shape[0]):
                for i in range(width):
                    run.out[b, j, x, i] = block.Y[x, i]
    run.phase[0] = previous
