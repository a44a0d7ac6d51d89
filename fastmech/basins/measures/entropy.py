"""Basin entropy: how uncertain the end of a start is that is known to a box only.

Daza, Wagemakers, Georgeot, Guery-Odelin, Sanjuan, Sci. Rep. 6 (2016) 31416: the map is covered by boxes; with
p_ij the share of label j in box i its entropy is ``S_i = sum_j p_ij ln(1/p_ij)``. The basin entropy is the
mean of S_i over all boxes, the boundary basin entropy over those with more than one label.

Two tests tell a fractal boundary from a smooth one by the boundary basin entropy:

- the ln 2 criterion of that paper: almost all boxes on a smooth boundary hold two labels, so S_i <= ln 2, and
  a mean above ln 2 shows a fractal boundary. With two labels on the whole map no box can exceed ln 2: then
  the criterion can never fire, and says nothing.
- that of Puy, Daza, Wagemakers, Sanjuan, Commun. Nonlinear Sci. Numer. Simul. 95 (2021) 105588, which works
  for two labels too: over balls at random places that meet a smooth boundary the mean has a known value,
  0.4395093 for discs; a mean that differs from it speaks for a fractal boundary.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import entr

from fastmech.basins.measures.jackknife import PARTS, half_width, part_of
from fastmech.basins.measures.labels import Floats, Integers, check_map, known_labels
from fastmech.ensembles import checks
from fastmech.errors import InputError

LN2 = float(np.log(2.0))


@dataclass(frozen=True)
class BasinEntropy:
    """Basin entropy of a map, natural logarithms."""

    basin: float  #: S_b: mean over all boxes
    boundary: float  #: S_bb: mean over the boxes with more than one label; NaN: there are none
    boxes: int  #: boxes with a label
    boundary_boxes: int  #: boxes with more than one label
    most_labels: int  #: labels in the richest box
    fractal: bool | None  #: the ln 2 criterion; None: it cannot tell, no box has more than two labels


def basin_entropy(labels: ArrayLike, edge: int = 5) -> BasinEntropy:
    """Basin entropy and boundary basin entropy of a map, by boxes that do not overlap.

    Args:
        labels: on a grid of any number of axes; negative: no label. Shares are those of a box's known labels,
            and a box without any is left out.
        edge: points of a box along every axis (the paper takes 5); points left over at an axis's end are not
            used.

    Returns:
        Entropies and the ln 2 criterion: ``fractal`` is True where it shows a fractal boundary, False where
        it could have and did not, None where no box holds more than two labels, in which case
        :func:`fractal_boundary_test` can tell.

    Raises:
        InputError: the labels are no map, or a box is larger than it.
    """
    array = check_map(labels)
    edge = checks.whole_number("edge", edge, least=2, most=min(array.shape))
    boxes = _boxes(array, edge)
    known = known_labels(boxes)
    if not known.size:
        raise InputError("labels: no label is known")
    counts = np.stack([(boxes == label).sum(axis=1) for label in known])
    counts = counts[:, counts.sum(axis=0) > 0]
    entropy = entropies(counts)
    kinds = (counts > 0).sum(axis=0)
    mixed = kinds > 1
    boundary = float(entropy[mixed].mean()) if mixed.any() else np.nan
    return BasinEntropy(
        basin=float(entropy.mean()),
        boundary=boundary,
        boxes=entropy.size,
        boundary_boxes=int(np.count_nonzero(mixed)),
        most_labels=int(kinds.max()),
        fractal=bool(boundary > LN2) if kinds.max() > 2 else None,
    )


@dataclass(frozen=True)
class FractalTest:
    """Boundary basin entropy over balls against its value for smooth boundaries."""

    entropy: float  #: mean over the balls that hold more than one label; NaN: in one part of the map at most
    error: float  #: half width of its 95 % interval
    smooth_value: float  #: of flat boundaries at random, over the same points of the grid
    balls: int  #: balls with more than one label

    @property
    def fractal(self) -> bool:
        """Whether the entropy differs from that of a smooth boundary by more than its error."""
        return bool(abs(self.entropy - self.smooth_value) > self.error)


def fractal_boundary_test(
    labels: ArrayLike, radius: float = 8.0, *, balls: int = 20_000, seed: int = 0
) -> FractalTest:
    """Test of Puy et al. whether a map's boundaries are fractal, for any number of labels from two on.

    Balls are put round random points of the map, wholly on it, and the entropies of those with more than one
    label are averaged. The value to compare with is that of flat boundaries with all directions and distances
    alike, cut by the very points of the ball on the grid, so that a coarse ball is no disadvantage. A
    boundary that is curved on the scale of the ball, or two that meet in one, change the mean too: take the
    ball small.

    The error is found by leaving out each of 4 parts of the map along every axis in turn, so that balls that
    overlap do not feign certainty.

    Args:
        labels: on a grid of two or more axes with equal steps in one metric; negative: no label, and a ball
            with such points is not used.
        radius: of the balls [steps of the grid], 2 or more.
        balls: places to try.
        seed: of NumPy's ``default_rng``.

    Raises:
        InputError: the labels are no map, a ball does not fit, or a number is wrong.
    """
    array = check_map(labels)
    radius = checks.number("radius", radius, "steps of the grid", least=2.0)
    balls = checks.whole_number("balls", balls, least=1)
    rng = np.random.default_rng(checks.whole_number("seed", seed, least=0))
    reach = int(radius)
    if array.ndim < 2 or 2 * reach + 1 > min(array.shape):
        raise InputError(f"radius = {radius:g}: a ball must fit the map, of two or more axes: {array.shape}")
    points = _ball(array.ndim, radius)
    centres = rng.integers(reach, np.array(array.shape) - reach, (balls, array.ndim))
    which, numbers = known_labels(array), np.full(array.shape, -1)
    numbers[array >= 0] = np.searchsorted(which, array[array >= 0])
    counts = np.zeros((max(which.size, 1), balls), dtype=np.int64)
    missing = np.zeros(balls, dtype=bool)
    lanes = np.arange(balls)
    for point in points:
        found = numbers[tuple((centres + point).T)]
        missing |= found < 0
        counts[found, lanes] += found >= 0
    counts = counts[:, ~missing]
    centres = centres[~missing]
    mixed = (counts > 0).sum(axis=0) > 1
    values, part = entropies(counts[:, mixed]), part_of(centres[mixed].T, array.shape)
    sums = np.bincount(part, values, PARTS**array.ndim)
    number = np.bincount(part, minlength=PARTS**array.ndim)
    used = number > 0
    mean, error = np.nan, np.nan
    if np.count_nonzero(used) > 1:
        mean = float(values.mean())
        error = half_width(((sums.sum() - sums) / (number.sum() - number))[used])
    return FractalTest(mean, error, smooth_boundary_entropy(array.ndim, radius), int(values.size))


def entropies(counts: Integers) -> Floats:
    """Entropies of boxes from how often each label occurs, shape (labels, boxes) to (boxes,)."""
    return np.asarray(entr(counts / counts.sum(axis=0)).sum(axis=0))


@cache
def smooth_boundary_entropy(dim: int, radius: float) -> float:
    """Mean entropy of a ball of grid points that a flat boundary cuts, all directions and distances alike.

    For large radii it tends to the integral over s from 0 to 1 of the entropy of the share that a plane at
    the distance s from the centre cuts off: 0.4395093 for discs, 0.3960918 for spheres.
    """
    points = _ball(dim, radius)
    rng = np.random.default_rng(0)
    directions = rng.standard_normal((256, dim))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    total = weight = 0.0
    for direction in directions:
        heights = np.sort(points @ direction)
        # A plane between the k-th and the next point cuts off k points; its chance is their difference.
        gap = np.diff(heights)
        share = np.arange(1, len(heights)) / len(heights)
        total += float(np.sum(gap * (entr(share) + entr(1.0 - share))))
        weight += float(np.sum(gap))
    return total / weight


def _ball(dim: int, radius: float) -> Integers:
    reach = int(radius)
    cube = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * dim, indexing="ij"), axis=-1)
    points = cube.reshape(-1, dim)
    return np.asarray(points[(points**2).sum(axis=1) <= radius**2])


def _boxes(array: Integers, edge: int) -> Integers:
    """Points of every box, shape (boxes, edge^axes)."""
    whole = [length // edge for length in array.shape]
    cut = array[tuple(slice(0, number * edge) for number in whole)]
    split = cut.reshape([size for number in whole for size in (number, edge)])
    order = [*range(0, 2 * array.ndim, 2), *range(1, 2 * array.ndim, 2)]
    return split.transpose(order).reshape(-1, edge**array.ndim)
