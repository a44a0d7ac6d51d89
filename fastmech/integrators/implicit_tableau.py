"""Butcher tableaus of implicit methods, checked like the explicit ones, and what their driver reads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.integrators.tableau import Tableau

Floats = NDArray[np.float64]


#: What Newton's iteration may leave of the equations, relative to the states, in methods that forget errors
#: and in symplectic ones. A remainder is no random rounding, it points the same way step after step: 1e-16
#: would cost 1e-10 of the energy in a million steps.
FORGETTING, SYMPLECTIC = 1e-15, 1e-20


class Scheme(NamedTuple):
    """A tableau as :func:`fastmech.integrators.implicit.drive_implicit` reads it.

    Stages are solved in groups of ``back.shape[0]``: with A_g the group's part of ``a``, ``back`` is T and
    ``forth`` T^-1 A_g^-1, where T^-1 A_g^-1 T holds the real eigenvalue ``eigenvalues[0]`` (0: none) and then
    the block [[re, -im], [im, re]] of ``eigenvalues[1:]`` (im = 0: none).
    """

    a: Floats
    nodes: Floats
    final: Floats  #: b A^-1 makes the step of the stages' increments
    back: Floats
    forth: Floats
    eigenvalues: Floats
    extrapolation: Floats  #: makes the next step's first guess of this step's increments; empty: none
    remainder: float  #: what an accepted iteration may leave, relative to the lane's largest state
    differences: bool = False  #: the Jacobian is that of differences of the right-hand side


@dataclass(frozen=True)
class ImplicitTableau(Tableau):
    """An implicit Runge-Kutta method of at most three coupled stages, or a diagonally implicit one.

    ``a`` holds full rows: the whole square matrix, or the lower triangle with equal diagonal.

    Raises:
        ValueError: as :class:`Tableau`.
    """

    def row_length(self, i: int) -> int:
        """Entries of row ``i``."""
        return i + 1 if self.diagonal else self.stages

    @property
    def diagonal(self) -> bool:
        """Whether stages are solved one after another."""
        return len(self.a[0]) == 1 < self.stages

    @property
    def symplectic(self) -> bool:
        """Whether b_i a_ij + b_j a_ji = b_i b_j (Sanz-Serna, BIT 28 (1988))."""
        b = np.array(self.b)
        products = b[:, None] * self.matrix
        return bool(np.allclose(products + products.T, np.outer(b, b), rtol=0.0, atol=1e-14))

    @cached_property
    def final(self) -> Floats:
        """b A^-1: the step as a combination of the stages' increments; the last alone if stiffly accurate."""
        weights = np.linalg.solve(self.matrix.T, np.array(self.b))
        if np.allclose(self.matrix[-1], self.b, rtol=1e-14, atol=0.0):
            weights = np.eye(self.stages)[-1]
        return np.asarray(weights)

    @cached_property
    def scheme(self) -> Scheme:
        """The tableau with its eigenvalues, see the driver."""
        nodes, matrix = np.array(self.c), self.matrix
        group = matrix[:1, :1] if self.diagonal else matrix
        inverse = np.asarray(np.linalg.inv(group), dtype=np.float64)
        back, eigenvalues = _real_form(inverse)
        extrapolation = np.empty((0, 0))
        if not self.diagonal:
            # The polynomial through 0 and the increments, one step further on, less the step.
            powers = np.arange(1, self.stages + 1)
            through = nodes[:, None] ** powers
            extrapolation = (1.0 + nodes[:, None]) ** powers @ np.linalg.inv(through) - self.final
        return Scheme(
            a=matrix,
            nodes=nodes,
            final=self.final,
            back=back,
            forth=np.linalg.inv(back) @ inverse,
            eigenvalues=eigenvalues,
            extrapolation=extrapolation,
            remainder=SYMPLECTIC if self.symplectic else FORGETTING,
        )


def _real_form(matrix: Floats) -> tuple[Floats, Floats]:
    """T and (real, re, im) such that T^-1 matrix T holds at most one real eigenvalue and one pair."""
    values, vectors = np.linalg.eig(matrix)
    columns: list[Floats] = []
    eigenvalues = np.zeros(3)
    for value, vector in zip(values, vectors.T, strict=True):
        if abs(value.imag) < 1e-10 * abs(value):
            eigenvalues[0] = value.real
            columns.insert(0, vector.real)
        elif value.imag > 0.0:
            eigenvalues[1:] = value.real, value.imag
            # matrix (x + iy) = (re + i im)(x + iy): the basis (y, x) gives [[re, im], [-im, re]] transposed.
            columns += [vector.real, -vector.imag]
    return np.ascontiguousarray(np.array(columns).T), eigenvalues
