"""One compiled call from equilibria to all that stability asks of them, for many scenes in a row."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.equilibria.solve import SOLUTION, Solution
from fastmech.jit import CUBE, MATRIX, kernel, named_tuple
from fastmech.stability.criteria import assess_one

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]

ROOTS = types.Array(types.complex128, 3, "C")
VERDICTS = types.Array(types.int8, 3, "C")


class Assessed(NamedTuple):
    """What :func:`assess` writes for n scenes; slots without an equilibrium hold NaN and -1."""

    hessian: Floats  #: (n, slots, 3) derivatives of U over m2 l^2 (phi phi, phi theta, theta theta)
    eigenvalues: NDArray[np.complex128]  #: (n, slots, 4) [1/s], largest real part first
    frequency: Floats  #: (n, slots) lowest undamped natural frequency [rad/s], NaN where U falls
    decay: Floats  #: (n, slots) decay rate of the slowest mode [1/s], NaN unless U has a minimum
    verdict: Codes  #: (n, slots, 4) Sylvester's, Hurwitz's, the eigenvalues' and the joint ``Verdict``


ASSESSED: Any = named_tuple([CUBE, ROOTS, MATRIX, MATRIX, VERDICTS], Assessed)


@kernel(types.void(MATRIX, SOLUTION, ASSESSED))
def assess(coefficients: Floats, found: Solution, out: Assessed) -> None:
    """Stability of the equilibria of every row of (n, 8) reduced coefficients, the force frozen."""
    hessian, eigenvalues, verdict = out.hessian, out.eigenvalues, out.verdict
    frequency, decay = out.frequency, out.decay
    for row in range(coefficients.shape[0]):
        for i in range(found.phi.shape[1]):
            if i >= found.count[row]:
                frequency[row, i], decay[row, i] = np.nan, np.nan
                for k in range(3):
                    hessian[row, i, k] = np.nan
                for k in range(4):
                    eigenvalues[row, i, k], verdict[row, i, k] = complex(np.nan, np.nan), -1
                continue
            place = (found.phi[row, i], found.theta[row, i], found.radius[row, i], int(found.index[row, i]))
            a = assess_one(coefficients[row], place, eigenvalues[row, i])
            hessian[row, i, 0], hessian[row, i, 1], hessian[row, i, 2] = a.s.k11, a.s.k12, a.s.k22
            low = a.squares[0]
            frequency[row, i] = np.sqrt(low) if low >= 0.0 else np.nan
            decay[row, i] = a.decay
            verdict[row, i, 0], verdict[row, i, 1] = a.sylvester, a.hurwitz
            verdict[row, i, 2], verdict[row, i, 3] = a.spectrum, a.joint
