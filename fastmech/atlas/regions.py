"""Compiled labelling of equilibria over a grid: equal labels are one equilibrium, continued.

Points whose equilibria continue one another completely, none appearing or vanishing, form a *region*. Within
a region an equilibrium is known by its rank there (0 to 5); its label is 8 times the region's number plus the
rank. Regions are found in one pass over the grid in the order of memory. Where two turn out to be one, the
second refers to the first together with how its ranks are permuted, so a label stands for one equilibrium at
every point, whatever the order. (Continuing round a hole of a region may permute the equilibria; there the
region has a cut, on which the pass happens to close.)
"""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.atlas.matching import match
from fastmech.equilibria.search import MOST
from fastmech.equilibria.solve import INDICES
from fastmech.jit import INTEGERS, MATRIX, STATUSES, inlined, kernel

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]
Labels = NDArray[np.int32]

#: Labels of a region: its number times this plus a rank.
RANKS = 8

#: Label of an empty slot and of an equilibrium whose Hessian is singular: there sheets meet.
NO_LABEL = -1

LABELS = types.Array(types.int32, 2, "C")
LABEL_LIST = types.Array(types.int32, 1, "C")


@inlined
def resolve(parent: Labels, rank: Codes, label: int) -> int:
    """The label at the root of its region's tree; the path to it is left as it is (trees stay flat)."""
    region, k = label // RANKS, label % RANKS
    while parent[region] != region:
        k = rank[region, k]
        region = parent[region]
    return region * RANKS + k


@inlined
def join(parent: Labels, rank: Codes, mine: Labels, other: Labels, partner: Codes, count: int) -> None:
    """Make two regions one: slot i of ``other`` continues to slot partner[i] of ``mine``."""
    root = resolve(parent, rank, other[0]) // RANKS
    attached = resolve(parent, rank, mine[0]) // RANKS
    if root == attached:
        return
    swap = root > attached
    if swap:
        root, attached = attached, root
    for i in range(count):
        a = resolve(parent, rank, mine[partner[i]]) % RANKS
        b = resolve(parent, rank, other[i]) % RANKS
        if swap:
            rank[attached, b] = a
        else:
            rank[attached, a] = b
    parent[attached] = root


@kernel(
    types.int64(
        MATRIX,
        MATRIX,
        MATRIX,
        INDICES,
        STATUSES,
        types.int64,
        types.int64,
        INTEGERS,
        INTEGERS,
        types.int64,
        LABEL_LIST,
        INDICES,
        LABELS,
        LABELS,
        INTEGERS,
    )
)
def label_points(
    coefficients: Floats,
    phi: Floats,
    theta: Floats,
    index: Codes,
    count: Codes,
    ghosts: int,
    offset: int,
    strides: NDArray[np.int64],
    lengths: NDArray[np.int64],
    regions: int,
    parent: Labels,
    rank: Codes,
    label: Labels,
    loose: Labels,
    loose_count: NDArray[np.int64],
) -> int:
    """Label the points after the first ``ghosts``, which have their labels already.

    Args:
        coefficients, phi, theta, index, count: rows as ``solve`` fills them, consecutive in memory order.
        ghosts: rows that are known from before.
        offset: position of row 0 in the whole grid.
        strides, lengths: of the grid's axes, in points.
        regions: number of regions so far.
        parent, rank: trees of regions, with room for one more region for every point; written.
        label: (n, 6); written.
        loose: (room, 2) receives pairs of labels that continue one another between regions.
        loose_count: (1,) how many pairs; written.

    Returns:
        The number of regions now.
    """
    axes = len(strides)
    partner = np.empty((axes, MOST), dtype=np.int8)
    pairs = np.empty(axes, dtype=np.int64)
    between = np.empty(coefficients.shape[1])
    filled = 0
    for p in range(ghosts, len(count)):
        n = int(count[p])
        label[p] = NO_LABEL
        settled = False
        for axis in range(axes):
            pairs[axis] = 0
            if ((offset + p) // strides[axis]) % lengths[axis] == 0:
                continue
            q = p - strides[axis]
            m = int(count[q])
            pairs[axis] = match(
                coefficients[q],
                coefficients[p],
                phi[q],
                theta[q],
                index[q],
                m,
                phi[p],
                theta[p],
                index[p],
                n,
                between,
                partner[axis],
            )
            if n > 0 and m == n and pairs[axis] == n:
                if settled:
                    join(parent, rank, label[p], label[q], partner[axis], n)
                else:
                    for i in range(n):
                        label[p, partner[axis, i]] = label[q, i]
                    settled = True
                pairs[axis] = 0
        if not settled and n > 0:
            parent[regions] = regions
            for i in range(n):
                if index[p, i] >= 0:
                    label[p, i] = regions * RANKS + i
            regions += 1
        for axis in range(axes):
            if pairs[axis] > 0:
                q = p - strides[axis]
                for i in range(count[q]):
                    if partner[axis, i] >= 0:
                        loose[filled, 0] = label[q, i]
                        loose[filled, 1] = label[p, partner[axis, i]]
                        filled += 1
    loose_count[0] = filled
    return regions


@kernel(types.void(LABEL_LIST, INDICES, LABELS))
def resolve_all(parent: Labels, rank: Codes, label: Labels) -> None:
    """Replace every label by the one at the root of its region's tree."""
    for p in range(label.shape[0]):
        for i in range(label.shape[1]):
            if label[p, i] >= 0:
                label[p, i] = resolve(parent, rank, label[p, i])
