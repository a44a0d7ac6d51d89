"""Basin entropy: how uncertain the end of a start is that is known to a box only.

Daza, Wagemakers, Georgeot, Guery-Odelin, Sanjuan, Sci. Rep. 6 (2016) 31416: the map is covered by boxes; with
p_ij the share of label j in box i its entropy is ``S_i = sum_j p_ij ln(1/p_ij)``. The basin entropy is the
mean of S_i over all boxes, the boundary basin entropy over those with more than one label.

Two tests tell a fractal boundary from a smooth one by the boundary basin entropy:

- the ln 2 criterion of that paper: almost all boxes on a smooth boundary hold two labels, so S_i <= ln 2, and
  a mean above ln 2 shows a fractal boundary. With two labels on the whole map no box can exceed ln 2, and the
  criterion says nothing. Smooth boundaries so near to each other that boxes hold several of them, or corners
  where they meet in many boxes, exceed ln 2 too: it is believed only where the boundary's box-counting
  dimension is that of no smooth one.
- that of Puy, Daza, Wagemakers, Sanjuan, Commun. Nonlinear Sci. Numer. Simul. 95 (2021) 105588, which works
  for two labels too: over balls at random places that meet a smooth boundary the mean has a known value,
  0.4395093 for discs. :func:`fractal_boundary_test` takes it at several sizes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike
from scipy.special import entr

from fastmech.arrays import Floats, Integers
from fastmech.basins.measures.labels import LabelsLike, check_map, check_point, known_labels, numbered
from fastmech.basins.measures.slopes import (
    PARTS,
    BoundaryDimension,
    boundary_dimension,
    half_width,
    not_smooth,
    part_of,
)
from fastmech.disturbance.motion import unit_directions
from fastmech.ensembles import checks
from fastmech.errors import InputError
from fastmech.objects import Printed, counted

LN2 = float(np.log(2.0))


@dataclass(frozen=True, repr=False)
class BasinEntropy(Printed):
    """Basin entropy of a map, natural logarithms."""

    basin: float  #: S_b: mean over all boxes
    boundary: float  #: S_bb: mean over the boxes with more than one label; NaN: there are none
    boxes: int  #: boxes with a label
    boundary_boxes: int  #: boxes with more than one label
    most_labels: int  #: labels in the richest box
    fractal: Literal[True] | None  #: the ln 2 criterion, which shows fractal ones alone; None: it does not

    def told(self) -> str:
        """Both entropies, and what the second shows."""
        text = f"basin entropy {self.basin:.4g}, the mean over {counted(self.boxes, 'box')}\n"
        if not self.boundary_boxes:
            return f"{text}  no box holds more than one label"
        which = counted(self.boundary_boxes, "box")
        shown = "this does not show whether the boundary is fractal: fm.fractal_boundary_test may"
        if self.fractal:
            shown = "above ln 2 = 0.693: the boundary is fractal"
        return f"{text}  {self.boundary:.4g} over the {which} with more than one label\n  {shown}"


def basin_entropy(labels: LabelsLike, edge: int = 5) -> BasinEntropy:
    """Basin entropy and boundary basin entropy of a map, by boxes that do not overlap.

    Args:
        labels: on a grid of any number of axes; negative: no label. Shares are those of a box's known labels,
            and a box without any is left out.
        edge: points of a box along every axis (the paper takes 5); points left over at an axis's end are not
            used.

    Returns:
        Entropies and the ln 2 criterion: ``fractal`` is True where the boundary exceeds it and
        :func:`boundary_dimension` says too that it is not smooth, else None:
        :func:`fractal_boundary_test` or a finer map can tell.

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
    # The criterion can fire where boxes hold more than two labels, and the dimension has to bear it out.
    fractal = bool(kinds.max() > 2 and boundary > LN2 and not_smooth(array))
    return BasinEntropy(
        basin=float(entropy.mean()),
        boundary=boundary,
        boxes=entropy.size,
        boundary_boxes=int(np.count_nonzero(mixed)),
        most_labels=int(kinds.max()),
        fractal=True if fractal else None,
    )


@dataclass(frozen=True, repr=False)
class FractalTest(Printed):
    """What balls and boxes of several sizes see of a map's boundaries."""

    fractal: bool | None  #: None: the map cannot tell
    reason: str  #: why, one line
    radius: Floats  #: of the balls [steps of the grid], rising (radii,)
    entropy: Floats  #: boundary basin entropy over the balls (radii,); NaN: in one part of the map at most
    error: Floats  #: half widths of its 95 % intervals (radii,)
    smooth_value: Floats  #: that of flat boundaries in random directions, over the same points (radii,)
    balls: Integers  #: balls with more than one label (radii,)
    boxes: BoundaryDimension  #: how many boxes of rising size hold a boundary

    def told(self) -> str:
        """The answer, and why."""
        answers = {True: "is fractal", False: "is smooth", None: "may be fractal or not: the map cannot tell"}
        return f"the boundary {answers[self.fractal]}\n  {self.reason}"


def fractal_boundary_test(
    labels: LabelsLike, radii: ArrayLike | None = None, *, balls: int = 20_000, seed: int = 0
) -> FractalTest:
    """Test whether a map's boundaries are fractal, for any number of labels from two on.

    Two witnesses are heard at several scales. The *share* of boxes that hold a boundary grows like e^1 where
    it is smooth and its pieces lie apart, and by one lesser power at all scales where it is fractal
    (:func:`fastmech.boundary_dimension`). The *boundary basin entropy* over balls round random points, that
    of Puy et al., is the same for balls of all sizes where boundaries are similar to themselves, and changes
    with the size where they have a scale of their own. Its value for flat boundaries, by which Puy et al.
    tell at one size, is given for comparison: stripes narrower than the ball and corners where three basins
    meet differ from it too, and boundaries of two labels on a Cantor set do not.

    - False: boxes up to 4 steps see smooth boundaries (powers of 0.95 and 0.9 at least).
    - True: all powers are less than 0.95 by more than their errors and alike within a factor of 2.5,
      entropies within one of 1.25, at most half of the finest boxes hold a boundary, and the dimension's
      error bar leaves a smooth boundary out.
    - None: neither; a finer map, or one of a smaller window, can tell.

    Stripes whose spacing shrinks geometrically, as beside a saddle, have the share e ln(1/e): their powers
    rise towards 1 as boxes shrink, so slowly that small maps (below some 500 points an axis) may show the
    same powers as a fractal. Stripes of sin(1/x) have the dimension 1.5 though each is smooth, and come out
    True.

    The errors are found by leaving out each of 5 parts of the map along every axis in turn, so that balls
    that overlap do not feign certainty.

    Args:
        labels: on a grid of two or more axes with 36 points or more and equal steps in one metric; negative:
            no label, and a ball with such points is not used.
        radii: of the balls [steps of the grid], rising, 2 or more; by default 4, 8 and 16, as far as they are
            at most an eighth of the shortest axis.
        balls: places to try at every radius.
        seed: of NumPy's ``default_rng``.

    Raises:
        InputError: the labels are no map, a ball does not fit, or a number is wrong.
    """
    array = check_map(labels)
    if array.ndim < 2 or min(array.shape) < 36:
        raise InputError(f"labels: has shape {array.shape}, must have two or more axes of 36 or more points")
    usual = np.array([4.0, 8.0, 16.0])
    sizes = usual[8 * usual <= max(min(array.shape), 32)] if radii is None else check_point("radii", radii)
    if sizes[0] < 2.0 or (np.diff(sizes) <= 0.0).any() or 2 * int(sizes[-1]) + 1 > min(array.shape):
        raise InputError(f"radii: must rise from 2 or more, and the balls fit the map {array.shape}")
    balls = checks.whole_number("balls", balls, least=1)
    rng = np.random.default_rng(checks.whole_number("seed", seed, least=0))
    numbers = numbered(array)
    found = [_over_balls(numbers, float(radius), balls, rng) for radius in sizes]
    entropy, error, number = (np.array(column) for column in zip(*found, strict=True))
    boxes = boundary_dimension(array)
    fractal, reason = _judge(boxes, entropy)
    smooth_value = np.array([smooth_boundary_entropy(array.ndim, float(radius)) for radius in sizes])
    return FractalTest(
        fractal, reason, sizes, entropy, error, smooth_value=smooth_value, balls=number, boxes=boxes
    )


def _over_balls(
    numbers: Integers, radius: float, balls: int, rng: np.random.Generator
) -> tuple[float, float, int]:
    """Boundary basin entropy over balls, half width of its interval, and how many hold a boundary."""
    shape, reach = numbers.shape, int(radius)
    centres = rng.integers(reach, np.array(shape) - reach, (balls, len(shape)))
    counts = np.zeros((max(int(numbers.max()) + 1, 1), balls), dtype=np.int64)
    missing = np.zeros(balls, dtype=bool)
    lanes = np.arange(balls)
    for point in _ball(len(shape), radius):
        found = numbers[tuple((centres + point).T)]
        missing |= found < 0
        counts[found, lanes] += found >= 0
    mixed = ~missing & ((counts > 0).sum(axis=0) > 1)
    values, part = entropies(counts[:, mixed]), part_of(centres[mixed].T, shape)
    sums = np.bincount(part, values, PARTS ** len(shape))
    number = np.bincount(part, minlength=PARTS ** len(shape))
    used = number > 0
    if np.count_nonzero(used) < 2:
        return np.nan, np.nan, int(values.size)
    without = ((sums.sum() - sums) / (number.sum() - number))[used]
    return float(values.mean()), half_width(without), int(values.size)


def _judge(boxes: BoundaryDimension, entropy: Floats) -> tuple[bool | None, str]:
    """Whether a boundary is fractal, and why; see :func:`fractal_boundary_test`."""
    power, error = boxes.mixed_powers, boxes.local_errors
    told = ", ".join(f"{p:.2f} +- {e:.2f}" for p, e in zip(power, error, strict=True))
    grows = f"the share of boxes with a boundary grows from {boxes.edge[0]} to {boxes.edge[-1]} steps"
    powers = f"{grows} by the powers {told}"
    if not np.isfinite(entropy).all() or not np.isfinite(error).all():
        return None, "there is no boundary, or in too small a part of the map"
    if power[0] >= 0.95 and power[1] >= 0.9:
        if max(error[:2]) > 0.15:
            return None, f"too few places have a boundary: {powers}"
        return False, f"smooth at the finest scales: {powers}"
    if (share := boxes.mixed[0]) > 0.5:
        return None, f"a boundary is in {100.0 * share:.0f} % of the finest boxes: a finer map can tell"
    steady = power.min() >= 0.4 * power.max() and entropy.max() <= 1.25 * entropy.min()
    sizes = f"{powers}, the entropy over balls is {entropy.min():.2f} to {entropy.max():.2f}"
    if entropy.size > 1 and steady and (power + error < 0.95).all():
        if boxes.smooth is False:
            return True, f"the same at all scales: {sizes}"
        return None, boxes.thin or f"not settled at these scales, powers drift towards 1: {sizes}"
    return None, f"neither smooth at the finest scales nor the same at all, a finer map can tell: {sizes}"


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
    total = weight = 0.0
    for direction in unit_directions(np.random.default_rng(0), 256, dim):
        heights = np.sort(points @ direction)
        # A plane between the k-th and the next point cuts off k points; its chance is their difference.
        gap = np.diff(heights)
        share = np.arange(1, len(heights)) / len(heights)
        total += float(np.sum(gap * (entr(share) + entr(1.0 - share))))
        weight += float(np.sum(gap))
    return total / weight


def _ball(dim: int, radius: float) -> Integers:
    reach = int(radius)
    points = np.indices((2 * reach + 1,) * dim).reshape(dim, -1).T - reach
    return np.asarray(points[(points**2).sum(axis=1) <= radius**2])


def _boxes(array: Integers, edge: int) -> Integers:
    """Points of every box, shape (boxes, edge^axes)."""
    places = sliding_window_view(array, (edge,) * array.ndim)
    return places[(slice(None, None, edge),) * array.ndim].reshape(-1, edge**array.ndim)
