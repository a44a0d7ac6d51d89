"""One compiled call from equilibria to all that stability asks of them, for many scenes in a row."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.equilibria.solve import INDICES
from fastmech.jit import CUBE, MATRIX, STATUSES, kernel
from fastmech.stability.criteria import assess_one

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]

ROOTS = types.Array(types.complex128, 3, "C")
VERDICTS = types.Array(types.int8, 3, "C")


@kernel(types.void(MATRIX, MATRIX, MATRIX, MATRIX, INDICES, STATUSES, CUBE, ROOTS, MATRIX, MATRIX, VERDICTS))
def assess(
    coefficients: Floats,
    phi: Floats,
    theta: Floats,
    radius: Floats,
    index: Codes,
    count: Codes,
    hessian: Floats,
    eigenvalues: NDArray[np.complex128],
    frequency: Floats,
    decay: Floats,
    verdict: Codes,
) -> None:
    """Stability of the first ``count`` equilibria of every row; the other slots get NaN and -1.

    Args:
        coefficients: (n, 8) rows of ``fastmech.mechanism.coefficients.Coefficients``, the force frozen.
        phi, theta, radius, index: (n, slots) from ``fastmech.equilibria.solve.solve``.
        count: (n,).
        hessian: (n, slots, 3) second derivatives of U over m2 l^2 (phi phi, phi theta, theta theta); written.
        eigenvalues: (n, slots, 4) [1/s], largest real part first; written.
        frequency: (n, slots) lowest undamped natural frequency [rad/s], NaN where U falls; written.
        decay: (n, slots) decay rate of the slowest mode [1/s], NaN unless U has a minimum; written.
        verdict: (n, slots, 4) Sylvester's, Hurwitz's, the eigenvalues' and the joint ``Verdict``; written.
    """
    for row in range(coefficients.shape[0]):
        for i in range(phi.shape[1]):
            if i >= count[row]:
                frequency[row, i], decay[row, i] = np.nan, np.nan
                for k in range(3):
                    hessian[row, i, k] = np.nan
                for k in range(4):
                    eigenvalues[row, i, k], verdict[row, i, k] = complex(np.nan, np.nan), -1
                continue
            place = (phi[row, i], theta[row, i], radius[row, i], int(index[row, i]))
            a = assess_one(coefficients[row], place, eigenvalues[row, i])
            hessian[row, i, 0], hessian[row, i, 1], hessian[row, i, 2] = a.s.k11, a.s.k12, a.s.k22
            low = a.squares[0]
            frequency[row, i] = np.sqrt(low) if low >= 0.0 else np.nan
            decay[row, i] = a.decay
            verdict[row, i, 0], verdict[row, i, 1] = a.sylvester, a.hurwitz
            verdict[row, i, 2], verdict[row, i, 3] = a.spectrum, a.joint
