"""Butcher tableaus: a method is data, checked when it is built."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

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
    return tuple(tree for partition in _partitions(order - 1, order - 1) for tree in _forests(partition))


def _partitions(n: int, largest: int) -> list[tuple[int, ...]]:
    if n == 0:
        return [()]
    return [(k, *rest) for k in range(min(n, largest), 0, -1) for rest in _partitions(n - k, k)]


def _forests(sizes: tuple[int, ...]) -> list[Tree]:
    forests: list[Tree] = [()]
    for size in sorted(set(sizes)):
        choices = list(combinations_with_replacement(rooted_trees(size), sizes.count(size)))
        forests = [forest + choice for forest in forests for choice in choices]
    return forests


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
    def matrix(self) -> NDArray[np.float64]:
        """Coefficients as a full square matrix, shape (stages, stages)."""
        full = np.zeros((self.stages, self.stages))
        for i, row in enumerate(self.a):
            full[i, : len(row)] = row
        return full

    def order_residuals(self, order: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Residuals of the conditions of exactly this order, and what rounding explains of each.

        One condition a tree: b . Phi(tree) = 1/density(tree).
        """
        trees = rooted_trees(order)
        weights = np.array([self._elementary_weights(tree) for tree in trees])
        sums, magnitudes = weights[:, 0] @ np.array(self.b), weights[:, 1] @ np.abs(self.b)
        exact = np.array([1.0 / _size_and_density(tree)[1] for tree in trees])
        return np.abs(sums - exact), ROUNDING * magnitudes

    @cached_property
    def _branches(self) -> dict[Tree, NDArray[np.float64]]:
        return {}

    def _branch(self, tree: Tree) -> NDArray[np.float64]:
        """A Phi(tree), and the same with the magnitudes of all terms: shape (2, stages)."""
        if tree not in self._branches:
            signed, magnitudes = self._elementary_weights(tree)
            self._branches[tree] = np.array([self.matrix @ signed, np.abs(self.matrix) @ magnitudes])
        return self._branches[tree]

    def _elementary_weights(self, tree: Tree) -> NDArray[np.float64]:
        """Phi(tree) of every stage, and the same with the magnitudes of all terms: shape (2, stages)."""
        weights = np.ones((2, self.stages))
        for child in tree:
            weights *= self._branch(child)
        return weights
