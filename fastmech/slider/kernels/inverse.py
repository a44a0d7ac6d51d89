"""What solves the systems of implicit methods for Lagrange's equations, in two unknowns in place of four."""

from __future__ import annotations

from fastmech.jit import INVERSE_SIGNATURE, kernel
from fastmech.kernels.blocks import Block


@kernel(INVERSE_SIGNATURE)
def lagrange_inverse(J: Block, mu: complex, G: Block, X: Block, V: Block) -> None:
    """X + i V = (mu - J)^-1 of two angles and their velocities, see :data:`fastmech.jit.INVERSE_SIGNATURE`.

    With q' = v the four equations reduce to S dq = r_v + (mu - J_v) r_q with the 2 x 2 matrix
    S = mu^2 - mu J_v - J_q, and dv = mu dq - r_q.
    """
    re, im = mu.real, mu.imag
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
