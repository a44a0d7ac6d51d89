"""Grids computed near boundaries only: from coarse to fine, following every boundary that has been seen.

At each level, grid points a stride apart bound blocks. A block whose corners differ, and every block beside
one, is marked; all corners of marked blocks are computed, which may mark more, until nothing is new. Marked
blocks are divided at the next level; any other block takes the label of its corners. So a boundary that is
seen anywhere is followed to its end. What no corner of the first level sees is missed: an island or a tongue
thinner than the first stride that does not touch a boundary that has been seen. The result is no proof.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Indices = NDArray[np.intp]


def refine_grid(
    shape: tuple[int, ...], stride: int, compute: Callable[[Indices], NDArray[np.int64]]
) -> Indices:
    """Compute what is needed of a grid.

    Args:
        shape: points along each axis.
        stride: points between neighbours at the first level, a power of two.
        compute: gives labels of points by their flat indices.

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
                labels[todo] = compute(todo)
                computed[todo], source[todo] = True, todo
            marked = _marked(labels[nodes])
            corners = _corners(marked, nodes.shape)
            todo = nodes[corners]
            if computed[todo].all():
                break
        if stride == 1:
            return source
        # Until the next level, every point takes after the first corner of its block.
        place = [
            np.searchsorted(tick, np.arange(n), side="right") - 1
            for tick, n in zip(ticks, shape, strict=True)
        ]
        block = [np.minimum(p, max(len(tick) - 2, 0)) for p, tick in zip(place, ticks, strict=True)]
        after = nodes[np.ix_(*block)].ravel()
        other = ~computed
        source[other] = source[after[other]]
        labels[other] = labels[after[other]]
        wanted = marked[np.ix_(*[np.minimum(b, m - 1) for b, m in zip(block, marked.shape, strict=True)])]
        # Closed blocks: the far faces of marked blocks belong to them.
        wanted = ndimage.binary_dilation(wanted, np.ones((3,) * len(shape))).ravel()
        stride //= 2


def _marked(corner: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Blocks whose corners differ and all blocks beside one; ``corner`` are the labels of the nodes."""
    differs = np.zeros(tuple(max(n - 1, 1) for n in corner.shape), dtype=np.bool_)
    for axis in range(corner.ndim):
        if corner.shape[axis] > 1:
            step = np.diff(corner, axis=axis) != 0  # along the edges of this direction
            for other in range(corner.ndim):
                if other != axis and corner.shape[other] > 1:
                    low = step.take(range(step.shape[other] - 1), axis=other)
                    step = low | step.take(range(1, step.shape[other]), axis=other)
            differs |= step
    return np.asarray(ndimage.binary_dilation(differs, np.ones((3,) * corner.ndim)))


def _corners(blocks: NDArray[np.bool_], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Which nodes are corners of these blocks."""
    corners = np.zeros(shape, dtype=np.bool_)
    for offset in np.ndindex(*(min(2, n) for n in shape)):
        corners[tuple(slice(o, o + n) for o, n in zip(offset, blocks.shape, strict=True))] |= blocks
    return corners
