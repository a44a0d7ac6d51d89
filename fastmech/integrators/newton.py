"""Pieces of the simplified Newton iteration over lanes: Jacobians by differences, inverses, one correction.

All arrays have lanes as their last axis; matrices of a lane are stored as rows ``r * n + c``.
"""

from __future__ import annotations

from numba import types

from fastmech.integrators.driver import BlockRHS, Floats
from fastmech.jit import CUBE, JACOBIAN, MATRIX, RHS, VECTOR, kernel

#: Where the Jacobian comes from.
DIFFERENCES, GENERAL, SECOND_ORDER = 0, 1, 2

#: Relative increment of forward differences: root of the rounding unit.
INCREMENT = 2.0**-26


@kernel(types.void(RHS, types.float64, MATRIX, MATRIX, MATRIX, CUBE))
def difference_jacobian(rhs: BlockRHS, t: float, Y: Floats, J: Floats, params: Floats, work: Floats) -> None:
    """Jacobian of a right-hand side by forward differences; ``work`` is (3, dim, lanes)."""
    dim, lanes = Y.shape
    shifted, base, ahead = work[0], work[1], work[2]
    rhs(t, Y, base, params)
    shifted[:] = Y
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
        shifted[c] = Y[c]


@kernel(types.void(MATRIX, types.int64))
def invert(G: Floats, n: int) -> None:
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


@kernel(types.void(MATRIX, types.float64, MATRIX, MATRIX))
def general_real(J: Floats, mu: float, G: Floats, X: Floats) -> None:
    """X = (mu - J)^-1; ``G`` (2 dim^2 + 1 rows at least, lanes) is scratch."""
    dim = round(J.shape[0] ** 0.5)
    G[: 2 * dim * dim] = 0.0
    for r in range(dim):
        for c in range(dim):
            G[2 * dim * r + c] = -J[r * dim + c]
        G[2 * dim * r + r] += mu
        G[2 * dim * r + dim + r] = 1.0
    invert(G, dim)
    for r in range(dim):
        X[r * dim : (r + 1) * dim] = G[2 * dim * r + dim : 2 * dim * (r + 1)]


@kernel(types.void(MATRIX, types.float64, types.float64, MATRIX, MATRIX, MATRIX))
def general_complex(J: Floats, re: float, im: float, G: Floats, X: Floats, V: Floats) -> None:
    """X + i V = (re + i im - J)^-1, from the real matrix of twice the size; ``G`` has 8 dim^2 + 1 rows."""
    dim = round(J.shape[0] ** 0.5)
    n = 2 * dim
    G[: 2 * n * n] = 0.0
    for r in range(dim):
        for c in range(dim):
            G[2 * n * r + c] = -J[r * dim + c]
            G[2 * n * (dim + r) + dim + c] = -J[r * dim + c]
        G[2 * n * r + r] += re
        G[2 * n * (dim + r) + dim + r] += re
        G[2 * n * r + dim + r] = -im
        G[2 * n * (dim + r) + r] = im
    for r in range(n):
        G[2 * n * r + n + r] = 1.0
    invert(G, n)
    for r in range(dim):
        X[r * dim : (r + 1) * dim] = G[2 * n * r + n : 2 * n * r + n + dim]
        V[r * dim : (r + 1) * dim] = G[2 * n * (dim + r) + n : 2 * n * (dim + r) + n + dim]


@kernel(types.void(MATRIX, types.float64, types.float64, MATRIX, MATRIX))
def second_order_inverse(J: Floats, re: float, im: float, X: Floats, V: Floats) -> None:
    """X + i V = (mu - J)^-1, mu = re + i im, of two angles and their velocities; ``V`` is left if im = 0.

    With q' = v the four equations reduce to S dq = r_v + (mu - J_v) r_q with the 2 x 2 matrix
    S = mu^2 - mu J_v - J_q, and dv = mu dq - r_q.
    """
    for i in range(J.shape[1]):
        q00, q01, q10, q11 = J[8, i], J[9, i], J[12, i], J[13, i]
        v00, v01, v10, v11 = J[10, i], J[11, i], J[14, i], J[15, i]
        square, twice = re * re - im * im, 2.0 * re * im
        s00, s01, s10, s11 = (
            square - re * v00 - q00,
            -re * v01 - q01,
            -re * v10 - q10,
            square - re * v11 - q11,
        )
        z00, z01, z10, z11 = twice - im * v00, -im * v01, -im * v10, twice - im * v11
        d_re = s00 * s11 - z00 * z11 - (s01 * s10 - z01 * z10)
        d_im = s00 * z11 + z00 * s11 - (s01 * z10 + z01 * s10)
        size = d_re * d_re + d_im * d_im
        e_re, e_im = d_re / size, -d_im / size
        # The inverse of S, real and imaginary parts.
        a00, b00 = e_re * s11 - e_im * z11, e_re * z11 + e_im * s11
        a01, b01 = -(e_re * s01 - e_im * z01), -(e_re * z01 + e_im * s01)
        a10, b10 = -(e_re * s10 - e_im * z10), -(e_re * z10 + e_im * s10)
        a11, b11 = e_re * s00 - e_im * z00, e_re * z00 + e_im * s00
        # Its product with mu - J_v.
        c00 = a00 * (re - v00) - b00 * im - a01 * v10
        c01 = a01 * (re - v11) - b01 * im - a00 * v01
        c10 = a10 * (re - v00) - b10 * im - a11 * v10
        c11 = a11 * (re - v11) - b11 * im - a10 * v01
        X[0, i], X[1, i], X[2, i], X[3, i] = c00, c01, a00, a01
        X[4, i], X[5, i], X[6, i], X[7, i] = c10, c11, a10, a11
        f00 = b00 * (re - v00) + a00 * im - b01 * v10
        f01 = b01 * (re - v11) + a01 * im - b00 * v01
        f10 = b10 * (re - v00) + a10 * im - b11 * v10
        f11 = b11 * (re - v11) + a11 * im - b10 * v01
        X[8, i], X[9, i] = re * c00 - im * f00 - 1.0, re * c01 - im * f01
        X[10, i], X[11, i] = re * a00 - im * b00, re * a01 - im * b01
        X[12, i], X[13, i] = re * c10 - im * f10, re * c11 - im * f11 - 1.0
        X[14, i], X[15, i] = re * a10 - im * b10, re * a11 - im * b11
        if im != 0.0:
            V[0, i], V[1, i], V[2, i], V[3, i] = f00, f01, b00, b01
            V[4, i], V[5, i], V[6, i], V[7, i] = f10, f11, b10, b11
            V[8, i], V[9, i] = re * f00 + im * c00, re * f01 + im * c01
            V[10, i], V[11, i] = re * b00 + im * a00, re * b01 + im * a01
            V[12, i], V[13, i] = re * f10 + im * c10, re * f11 + im * c11
            V[14, i], V[15, i] = re * b10 + im * a10, re * b11 + im * a11


@kernel(
    types.void(
        RHS,
        JACOBIAN,
        types.int64,
        types.float64,
        MATRIX,
        MATRIX,
        VECTOR,
        types.float64,
        MATRIX,
        MATRIX,
        MATRIX,
        MATRIX,
        MATRIX,
        CUBE,
    )
)
def newton_inverses(
    rhs: BlockRHS,
    jacobian: BlockRHS,
    kind: int,
    t: float,
    Y: Floats,
    params: Floats,
    eigenvalues: Floats,
    h: float,
    J: Floats,
    X: Floats,
    U: Floats,
    V: Floats,
    G: Floats,
    work: Floats,
) -> None:
    """The Jacobian J at (t, Y), X = (mu - J)^-1 for the real mu h of ``eigenvalues``, U + i V for the pair's.

    ``kind`` says where the Jacobian comes from; ``G`` (8 dim^2 + 1 rows) and ``work`` (3, dim, lanes) are
    scratch.
    """
    if kind == DIFFERENCES:
        difference_jacobian(rhs, t, Y, J, params, work)
    else:
        jacobian(t, Y, J, params)
    real, re, im = eigenvalues[0] / h, eigenvalues[1] / h, eigenvalues[2] / h
    if kind == SECOND_ORDER:
        if real != 0.0:
            second_order_inverse(J, real, 0.0, X, V)
        if im != 0.0:
            second_order_inverse(J, re, im, U, V)
    else:
        if real != 0.0:
            general_real(J, real, G, X)
        if im != 0.0:
            general_complex(J, re, im, G, U, V)


@kernel(types.void(MATRIX, MATRIX, MATRIX))
def apply_real(X: Floats, R: Floats, W: Floats) -> None:
    """W = X R; ``R`` and ``W`` (dim, lanes)."""
    dim, lanes = R.shape
    for r in range(dim):
        for i in range(lanes):
            total = 0.0
            for c in range(dim):
                total += X[r * dim + c, i] * R[c, i]
            W[r, i] = total


@kernel(types.void(MATRIX, MATRIX, MATRIX, MATRIX, MATRIX, MATRIX))
def apply_complex(X: Floats, V: Floats, R: Floats, Q: Floats, W: Floats, U: Floats) -> None:
    """W + i U = (X + i V) (R + i Q)."""
    dim, lanes = R.shape
    for r in range(dim):
        for i in range(lanes):
            real = imaginary = 0.0
            for c in range(dim):
                x, v, a, b = X[r * dim + c, i], V[r * dim + c, i], R[c, i], Q[c, i]
                real += x * a - v * b
                imaginary += v * a + x * b
            W[r, i], U[r, i] = real, imaginary


@kernel(types.void(MATRIX, MATRIX, MATRIX))
def combine(out: Floats, weights: Floats, X: Floats) -> None:
    """out[k] = sum_j weights[k, j] X[j] over flat rows; at most three terms."""
    count, n = weights.shape[0], out.shape[1]
    for k in range(count):
        if count == 1:
            w0 = weights[k, 0]
            for x in range(n):
                out[k, x] = w0 * X[0, x]
        elif count == 2:
            w0, w1 = weights[k, 0], weights[k, 1]
            for x in range(n):
                out[k, x] = w0 * X[0, x] + w1 * X[1, x]
        else:
            w0, w1, w2 = weights[k, 0], weights[k, 1], weights[k, 2]
            for x in range(n):
                out[k, x] = w0 * X[0, x] + w1 * X[1, x] + w2 * X[2, x]
