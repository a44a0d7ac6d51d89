"""Butcher tableaus, explicit and implicit: a method is data, checked when it is built."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from fastmech.arrays import Floats

#: A rooted tree as the sorted tuple of its root's sub-trees; ``()`` is a single node.
Tree = tuple["Tree", ...]

#: Largest residual that rounding explains, relative to the sum of the magnitudes of the terms.
ROUNDING = 4 * np.finfo(np.float64).eps

#: Conditions up to this order are checked when a tableau is built, 200 of them, the rest (286 of order 9, 719
#: of order 10) by the tests alone: a few milliseconds at import for all methods together.
CHECKED_ORDER = 8


@cache
def rooted_trees(order: int) -> tuple[Tree, ...]:
    """All rooted trees with ``order`` nodes (Hairer, Norsett, Wanner, *Solving ODEs I*, section II.2)."""
    if order == 1:
        return ((),)
    return tuple(sorted({tree for smaller in rooted_trees(order - 1) for tree in _grown(smaller)}))


def _grown(tree: Tree) -> Iterator[Tree]:
    """The tree with one node more, at any of its nodes."""
    yield tuple(sorted((*tree, ())))
    for i, child in enumerate(tree):
        yield from (tuple(sorted((*tree[:i], grown, *tree[i + 1 :]))) for grown in _grown(child))


@cache
def _size_and_density(tree: Tree) -> tuple[int, int]:
    size, density = 1, 1
    for child in tree:
        child_size, child_density = _size_and_density(child)
        size += child_size
        density *= child_density
    return size, density * size


@dataclass(frozen=True, eq=False)
class Tableau:
    """An explicit Runge-Kutta method.

    ``a`` holds the rows of the strictly lower triangle (the first stage's row is empty), ``b`` the weights,
    ``c`` the nodes. Building one checks shapes, row sums and every order condition up to ``order``.

    Raises:
        ValueError: a shape is wrong, a row does not sum to its node, or an order condition fails.
    """

    name: str
    order: int
    a: Sequence[Sequence[float]]
    b: Sequence[float]
    c: Sequence[float]
    source: str = field(repr=False)

    def __post_init__(self) -> None:
        stages = len(self.b)
        if len(self.a) != stages or len(self.c) != stages:
            raise ValueError(f"{self.name}: a, b and c disagree on the number of stages")
        for i, row in enumerate(self.a):
            if len(row) != self.row_length(i):
                raise ValueError(
                    f"{self.name}: row {i} of a has {len(row)} entries, must have {self.row_length(i)}"
                )
            if abs(sum(row) - self.c[i]) > ROUNDING * sum(map(abs, row)):
                raise ValueError(f"{self.name}: row {i} of a sums to {sum(row)}, its node is {self.c[i]}")
        for order in range(1, min(self.order, CHECKED_ORDER) + 1):
            residuals, rounding = self.order_residuals(order)
            if (residuals > rounding).any():
                raise ValueError(f"{self.name}: a condition of order {order} fails by {residuals.max():.1e}")

    def row_length(self, i: int) -> int:
        """Entries of row ``i`` of ``a``."""
        return i

    @property
    def stages(self) -> int:
        """Right-hand sides a step."""
        return len(self.b)

    @cached_property
    def matrix(self) -> Floats:
        """Coefficients as a full square matrix, shape (stages, stages)."""
        full = np.zeros((self.stages, self.stages))
        for i, row in enumerate(self.a):
            full[i, : len(row)] = row
        return full

    def order_residuals(self, order: int) -> tuple[Floats, Floats]:
        """Residuals of the conditions of exactly this order, and what rounding explains of each.

        One condition a tree: b . Phi(tree) = 1/density(tree).
        """
        trees = rooted_trees(order)
        weights = np.array([self._elementary_weights(tree) for tree in trees])
        sums, magnitudes = weights[:, 0] @ np.array(self.b), weights[:, 1] @ np.abs(self.b)
        exact = np.array([1.0 / _size_and_density(tree)[1] for tree in trees])
        return np.abs(sums - exact), ROUNDING * magnitudes

    @cached_property
    def _branches(self) -> dict[Tree, Floats]:
        return {}

    def _branch(self, tree: Tree) -> Floats:
        """A Phi(tree), and the same with the magnitudes of all terms: shape (2, stages)."""
        if tree not in self._branches:
            signed, magnitudes = self._elementary_weights(tree)
            self._branches[tree] = np.array([self.matrix @ signed, np.abs(self.matrix) @ magnitudes])
        return self._branches[tree]

    def _elementary_weights(self, tree: Tree) -> Floats:
        """Phi(tree) of every stage, and the same with the magnitudes of all terms: shape (2, stages)."""
        weights = np.ones((2, self.stages))
        for child in tree:
            weights *= self._branch(child)
        return weights


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


@dataclass(frozen=True, eq=False)
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
