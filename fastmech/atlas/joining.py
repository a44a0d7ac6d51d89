"""From labels of regions to branches and sheets: what is joined, and where a branch has to be cut."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fastmech.atlas.borders import Borders, region_of
from fastmech.atlas.channels import REACH, Ground, continued
from fastmech.atlas.regions import RANKS, Forest
from fastmech.equilibria.search import MOST

Integers = NDArray[np.int64]
Floats = NDArray[np.float64]

#: Ways that are tried between two islands, and pairs of islands that are tried in all.
WAYS, PAIRS = 4, 1000


def branches(nodes: Integers, links: Integers) -> Integers:
    """Connected component of every node."""
    one, two = np.searchsorted(nodes, links).T
    graph = coo_array((np.ones(len(links)), (one, two)), shape=(nodes.size, nodes.size))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def separate(nodes: Integers, links: Integers, size: Integers) -> Integers:
    """Components without the links that would put two equilibria of a point into one.

    Where a component is twice over a region these two nodes lose all their links. Regions with most nodes
    come first, the smallest of them first: between two folds that meet in a cusp.
    """
    region = nodes // RANKS
    links = links[links[:, 0] // RANKS != links[:, 1] // RANKS]
    while True:
        group = branches(nodes, links)
        keys, inverse, times = np.unique(
            np.stack([region, group], axis=1), axis=0, return_inverse=True, return_counts=True
        )
        twice = times > 1
        if not twice.any():
            return group
        regions = np.unique(keys[twice, 0])
        many = np.array([np.count_nonzero(region == r) for r in regions])
        area = np.array([size[nodes[region == r]].max() for r in regions])
        worst = regions[np.lexsort((regions, area, -many))[0]]
        alone = nodes[twice[inverse.ravel()] & (region == worst)]
        links = links[~np.isin(links, alone).any(axis=1)]


def join_islands(ground: Ground, forest: Forest, borders: Borders) -> None:
    """Join regions with equally many equilibria that are one through a channel narrower than the grid."""
    point, label, angles = borders.ends()
    if len(ground.axes) < 2 or not point.size:
        return
    grid = tuple(len(values) for values in ground.axes.values())
    place = np.stack(np.unravel_index(point, grid), axis=1).astype(np.float64)
    known = np.count_nonzero(label >= 0, axis=1)
    for count in (MOST, 4):
        here = np.flatnonzero((known == count) & ~np.isnan(angles[:, 0, :count]).any(axis=1))
        if np.unique(region_of(label[here])).size < 2:
            continue
        pairs = here[cKDTree(place[here]).query_pairs(REACH, p=np.inf, output_type="ndarray")]
        regions = np.sort(region_of(label)[pairs], axis=1)
        apart = regions[:, 0] != regions[:, 1]
        pairs, regions = pairs[apart], regions[apart]
        far = np.abs(np.diff(place[pairs], axis=1)[:, 0]).max(axis=1)
        order = np.lexsort((pairs[:, 1], pairs[:, 0], far))
        tried: dict[tuple[int, int], int] = {}
        for one, two in pairs[order]:
            low, high = sorted(forest.root(int(label[k].max())) // RANKS for k in (one, two))
            roots = (low, high)
            if low == high or tried.get(roots, 0) >= WAYS or len(tried) >= PAIRS:
                continue
            tried[roots] = tried.get(roots, 0) + 1
            found = continued(ground, place[one], place[two], count)
            if found is not None:
                solution, labels = found
                start = slots(solution.phi[0], solution.theta[0], angles[one], count)
                end = slots(solution.phi[-1], solution.theta[-1], angles[two], count)
                mine, other = np.empty(RANKS, dtype=np.int64), np.empty(RANKS, dtype=np.int64)
                mine[labels[0, :count]] = label[one, start]
                other[labels[-1, :count]] = label[two, end]
                forest.unite(mine[:count], other[:count])


def slots(phi: Floats, theta: Floats, angles: Floats, count: int) -> Integers:
    """Slot of the stored equilibria (2, 6) for each of the ones found again at the same point."""
    gap = np.abs(np.exp(1j * phi[:count, None]) - np.exp(1j * angles[0, None, :count]))
    gap += np.abs(np.exp(1j * theta[:count, None]) - np.exp(1j * angles[1, None, :count]))
    return np.argmin(gap, axis=1)
