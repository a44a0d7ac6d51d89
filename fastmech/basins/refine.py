"""Grids computed near boundaries only: from coarse to fine, following every boundary that has been seen.

At each level, grid points a stride apart bound blocks. A block whose corners differ, or one of which has no
label (which tells nothing of its surroundings), and every block beside such a one, is marked; all corners of
marked blocks are computed, which may mark more, until nothing is new. Marked blocks are divided at the next
level; any other block takes the label of its corners. So a boundary that is seen anywhere is followed to its
end. What no corner of the first level sees is missed: an island or a tongue thinner than the first stride
that does not touch a boundary that has been seen. The result is no proof.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fastmech.ensembles.run import Progress

Indices = NDArray[np.intp]


def refine_grid(
    shape: tuple[int, ...], stride: int, compute: Callable[[Indices, int], NDArray[np.int64]]
) -> Indices:
    """Compute what is needed of a grid.

    Args:
        shape: points along each axis.
        stride: points between neighbours at the first level, a power of two.
        compute: gives labels of points by their flat indices and their level's stride; negative: no label.

    Returns:
        for every point the flat index of the computed point whose label it has, its own where computed.
    """
    size = int(np.prod(shape))
    labels, computed = np.zeros(size, dtype=np.int64), np.zeros(size, dtype=np.bool_)
    source = np.arange(size)
    wanted: NDArray[np.bool_] | None = None
    while True:
        ticks = [np.unique(np.append(np.arange(0, n, stride), n - 1)) for n in shape]
        nodes = np.ravel_multi_index(np.ix_(*ticks), shape)
        todo = nodes if wanted is None else nodes[wanted.reshape(shape)[np.ix_(*ticks)]]
        while True:
            todo = todo.ravel()[~computed[todo.ravel()]]
            if todo.size:
                labels[todo] = compute(todo, stride)
                computed[todo], source[todo] = True, todo
            marked = _marked(labels[nodes])
            corners = _corners(marked, nodes.shape)
            todo = nodes[corners]
            if computed[todo].all():
                break
        if stride == 1:
            return source
        # Until the next level, every point takes after the first corner of its block.
        block = [np.minimum(np.arange(n) // stride, m - 1) for n, m in zip(shape, marked.shape, strict=True)]
        after = nodes[np.ix_(*block)].ravel()
        other = ~computed
        source[other] = source[after[other]]
        labels[other] = labels[after[other]]
        # Closed blocks: the far faces of marked blocks belong to them.
        wanted = ndimage.binary_dilation(marked[np.ix_(*block)], np.ones((3,) * len(shape))).ravel()
        stride //= 2


#: How much longer a point takes at a level than at the one before.
LONGER = 1.25


class LevelProgress:
    """How much of a refined grid's work is done, told as so many of all points.

    What is computed follows boundaries, which have one dimension less than the grid: a level has about
    2^(d - 1) times as many points as the one before, each of which takes somewhat longer, being nearer to a
    boundary. Nothing is told of the first level alone, which has seen no boundary yet.
    """

    def __init__(self, shape: tuple[int, ...], stride: int, progress: Progress | None) -> None:
        self.size, self.first, self.progress = math.prod(shape), stride, progress
        self.growth = LONGER * 2.0 ** (sum(n > 1 for n in shape) - 1)
        self.done, self.told, self.level, self.stride = 0, 0, 0, stride

    def computed(self, steps: int, stride: int) -> None:
        """Count integration steps of the level with this stride."""
        if stride != self.stride:
            self.level, self.stride = 0, stride
        self.level, self.done = self.level + steps, self.done + steps
        if stride != self.first:
            levels = stride.bit_length() - 1  # still to come
            ahead = self.level * sum(self.growth**k for k in range(1, levels + 1))
            self._tell(int(self.size * self.done / (self.done + ahead)))

    def finish(self) -> None:
        """All is done."""
        self._tell(self.size)

    def _tell(self, points: int) -> None:
        if self.progress is not None and points > self.told:
            self.progress(points - self.told)
            self.told = points


def _marked(corner: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Blocks whose corners differ or lack a label, and all beside one; ``corner``: labels of the nodes."""
    low = high = corner  # of the corners of each block, one axis after the other
    for axis in range(corner.ndim):
        if corner.shape[axis] > 1:
            low, high = low.swapaxes(0, axis), high.swapaxes(0, axis)
            low = np.minimum(low[:-1], low[1:]).swapaxes(0, axis)
            high = np.maximum(high[:-1], high[1:]).swapaxes(0, axis)
    return np.asarray(ndimage.binary_dilation((low != high) | (low < 0), np.ones((3,) * corner.ndim)))


def _corners(blocks: NDArray[np.bool_], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Which nodes are corners of these blocks."""
    corners = np.zeros(shape, dtype=np.bool_)
    for offset in np.ndindex(*(min(2, n) for n in shape)):
        corners[tuple(slice(o, o + n) for o, n in zip(offset, blocks.shape, strict=True))] |= blocks
    return corners
