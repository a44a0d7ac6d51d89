"""What is proved of small matrices of intervals: sign of the determinant, signs of eigenvalues."""

from __future__ import annotations

from typing import Any

import numpy as np

from fastmech.intervals.arithmetic import add, div, magnitude, mul, sub
from fastmech.jit import called


@called
def invert(J: Any, A: Any, C: Any) -> bool:
    """``C`` (n, n): approximate inverse of the midpoint of ``J`` (n, n, 2); ``A`` (n, n) is scratch.

    False where it is singular within rounding or not finite.
    """
    n = len(C)
    for i in range(n):
        for j in range(n):
            A[i, j] = 0.5 * J[i, j, 0] + 0.5 * J[i, j, 1]
            C[i, j] = 1.0 if i == j else 0.0
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if not (abs(A[best, k]) > 1e-300 and abs(A[best, k]) < np.inf):
            return False
        for j in range(n):
            A[k, j], A[best, j] = A[best, j], A[k, j]
            C[k, j], C[best, j] = C[best, j], C[k, j]
        pivot = A[k, k]
        for j in range(n):
            A[k, j] /= pivot
            C[k, j] /= pivot
        for i in range(n):
            factor = A[i, k]
            if i != k:
                for j in range(n):
                    A[i, j] -= factor * A[k, j]
                    C[i, j] -= factor * C[k, j]
    return True


@called
def orientation(J: Any, A: Any) -> int:
    """Sign of the determinant of every matrix in ``J`` (n, n, 2), 0 if not proved.

    Gaussian elimination in ``A``, of J's shape; a pivot is the entry that is proved farthest from zero.
    """
    n = len(J)
    sign = 1
    for i in range(n):
        for j in range(n):
            A[i, j, 0], A[i, j, 1] = J[i, j, 0], J[i, j, 1]
    for k in range(n):
        best, most = k, 0.0
        for i in range(k, n):
            least = max(A[i, k, 0], -A[i, k, 1])
            if least > most:
                best, most = i, least
        if most == 0.0:
            return 0
        if best != k:
            sign = -sign
            for j in range(n):
                for e in range(2):
                    A[k, j, e], A[best, j, e] = A[best, j, e], A[k, j, e]
        if A[k, k, 1] < 0.0:
            sign = -sign
        for i in range(k + 1, n):
            factor = div((A[i, k, 0], A[i, k, 1]), (A[k, k, 0], A[k, k, 1]))
            for j in range(k + 1, n):
                less = mul(factor, (A[k, j, 0], A[k, j, 1]))
                A[i, j, 0], A[i, j, 1] = sub((A[i, j, 0], A[i, j, 1]), less)
    return sign


@called
def positive_eigenvalues(J: Any, A: Any, V: Any) -> int:
    """How many eigenvalues of every symmetric matrix in ``J`` (n, n, 2) are positive and all others negative.

    -1 if not proved; ``A`` and ``V`` (n, n) are scratch. The matrix of approximate eigenvectors V (Jacobi's
    method) makes V^T J V nearly diagonal: where each of its Gershgorin discs lies on one side of zero it is
    regular, hence V is, and by Sylvester's law of inertia the discs' sides are the eigenvalues' signs.
    """
    n = len(J)
    for i in range(n):
        for j in range(n):
            A[i, j] = 0.25 * (J[i, j, 0] + J[i, j, 1] + J[j, i, 0] + J[j, i, 1])
            V[i, j] = 1.0 if i == j else 0.0
    for _ in range(12):
        for i in range(n):
            for j in range(i + 1, n):
                if A[i, j] != 0.0:
                    t = (A[j, j] - A[i, i]) / (2.0 * A[i, j])
                    t = (1.0 if t >= 0.0 else -1.0) / (abs(t) + np.sqrt(t * t + 1.0))
                    c = 1.0 / np.sqrt(t * t + 1.0)
                    s = t * c
                    for k in range(n):
                        A[k, i], A[k, j] = c * A[k, i] - s * A[k, j], s * A[k, i] + c * A[k, j]
                        V[k, i], V[k, j] = c * V[k, i] - s * V[k, j], s * V[k, i] + c * V[k, j]
                    for k in range(n):
                        A[i, k], A[j, k] = c * A[i, k] - s * A[j, k], s * A[i, k] + c * A[j, k]
    positive = 0
    for i in range(n):
        disc, around = (0.0, 0.0), (0.0, 0.0)
        for j in range(n):
            entry = (0.0, 0.0)
            for k in range(n):
                row = (0.0, 0.0)
                for m in range(n):
                    row = add(row, mul((J[k, m, 0], J[k, m, 1]), (V[m, j], V[m, j])))
                entry = add(entry, mul(row, (V[k, i], V[k, i])))
            if i == j:
                disc = entry
            else:
                radius = magnitude(entry)
                around = add(around, (radius, radius))
        if sub(disc, around)[0] > 0.0:
            positive += 1
        elif not add(disc, around)[1] < 0.0:
            return -1
    return positive
