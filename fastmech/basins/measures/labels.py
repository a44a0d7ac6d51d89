"""What measures are given: labels of starts, coordinates of maps, and a norm of departures.

Labels are numbers >= 0, in any order and with gaps, of what starts end at; a negative one is no label.
Undecided and failed starts have negative ones: they are counted in every total and never taken for a basin.
Starts whose status says that they escape, or leave the range of a coordinate, have the label :data:`GONE`:
where they end is known, and it is no attractor.

Angles [rad] and rates [rad/s] have no common length by themselves. For the mechanism it is given by the
kinetic-energy norm at the equilibrium (:class:`fastmech.disturbance.motion.Size`); for a system of your own
it is a matrix that you state, the identity if all its states have one unit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import minimum_filter

from fastmech.arrays import Floats, Integers
from fastmech.ensembles import checks
from fastmech.ensembles.status import Status
from fastmech.errors import InputError, shown, shown_name
from fastmech.scene import STATE, nearest

#: Label of starts that are gone for good: beyond all numbers of attractors, wells and their copies.
GONE = 2**63 - 1

#: Points by which a basin is wide where it is resolved: two on either side of one.
WHOLE = 5


class Labelled(Protocol):
    """Where starts end: what :func:`fastmech.map_basins` and :func:`fastmech.label_starts` give."""

    @property
    def well(self) -> NDArray[np.integer[Any]]:
        """Index of the well (of a system of your own its stop code), negative: none."""


#: Labels, or what holds them: then its wells, whatever the turns on the way to them. ``map.labels[0]`` tells
#: the copies of a well apart.
LabelsLike: TypeAlias = ArrayLike | Labelled

#: Labels (n,) of starts (n, dim), or what holds them.
LabelOf = Callable[[Floats], LabelsLike]


def check_labels(labels: LabelsLike, name: str = "labels") -> Integers:
    """Labels of any shape as integers; what has no label and is gone for good gets :data:`GONE`."""
    array = np.asarray(getattr(labels, "well", labels))
    if not array.size or not np.issubdtype(array.dtype, np.integer):
        raise InputError(f"{name}: must be integers, at least one; is {array.dtype} of shape {array.shape}")
    found, status = array.astype(np.int64), getattr(labels, "status", None)
    if status is not None:
        found[(found < 0) & np.isin(status, (Status.ESCAPED, Status.OUT_OF_RANGE))] = GONE
    return found


def check_map(labels: LabelsLike) -> Integers:
    """Labels on a grid, at least two points along every axis."""
    array = check_labels(labels)
    if array.ndim < 1 or min(array.shape) < 2:
        raise InputError(f"labels: has shape {array.shape}, must be a grid of two or more points an axis")
    return array


def known_labels(labels: Integers) -> Integers:
    """The labels that occur, rising, without the negative ones."""
    found = np.unique(labels)
    return found[found >= 0]


def numbered(labels: Integers) -> Integers:
    """The same as 0, 1, ... in their order, -1: none; SciPy's filters count in doubles."""
    found, known = np.full(labels.shape, -1, dtype=np.int64), labels >= 0
    found[known] = np.unique(labels[known], return_inverse=True)[1]
    return found


def too_thin(labels: Integers) -> str:
    """Why a map cannot tell what its boundaries are like: most are of basins nowhere ``WHOLE`` points wide.

    Empty where most boundaries are those of wider basins.
    """
    thin = [
        label
        for label in known_labels(labels)
        if not minimum_filter(labels == label, size=WHOLE, mode="nearest").any()
    ]
    narrow, boundaries, of_thin = np.isin(labels, thin), 0, 0
    for axis in range(labels.ndim):
        differ = np.diff(labels, axis=axis) != 0
        beside = np.diff(narrow.astype(np.int8), axis=axis) != 0
        boundaries += int(differ.sum())
        of_thin += int((differ & beside).sum())
    if 2 * of_thin <= boundaries:
        return ""
    return f"most boundaries are those of basins nowhere {WHOLE} points wide: a finer map can tell"


def ask(label_of: LabelOf, starts: Floats) -> Integers:
    """Labels (n,) of starts (n, dim) by ``label_of``."""
    if not len(starts):
        return np.zeros(0, dtype=np.int64)
    told = check_labels(label_of(starts), "label_of(starts)")
    if told.shape != (len(starts),):
        raise InputError(f"label_of(starts): has shape {told.shape}, must be ({len(starts)},)")
    return told


def check_point(name: str, values: ArrayLike, dim: int | None = None) -> Floats:
    """A finite point (dim,)."""
    point = checks.reals(name, values, "numbers").copy()
    if point.ndim != 1 or not point.size or (dim is not None and point.size != dim):
        wanted = "(dim,)" if dim is None else f"({dim},)"
        raise InputError(f"{name}: has shape {point.shape}, must be {wanted}")
    if not np.isfinite(point).all():
        raise InputError(f"{name}: must be finite")
    return point


def check_axes(axes: Mapping[str, ArrayLike] | Sequence[ArrayLike], shape: tuple[int, ...]) -> list[Floats]:
    """Coordinates along every axis of a grid, finite, rising in equal steps."""
    if len(axes) != len(shape):
        raise InputError(f"axes: has {len(axes)} axes, the labels have {len(shape)}")
    if isinstance(axes, Mapping):
        named = [(f"axes.{name}", axis) for name, axis in axes.items()]
    else:
        named = [(f"axes[{k}]", axis) for k, axis in enumerate(axes)]
    checked = []
    for (name, axis), length in zip(named, shape, strict=True):
        values = check_point(name, axis, length)
        step = (values[-1] - values[0]) / max(length - 1, 1)
        if not step > 0.0 or np.abs(np.diff(values) - step).max() > 1e-6 * step:
            raise InputError(f"{name}: must rise in equal steps")
        checked.append(values)
    return checked


def number_turns(label: ArrayLike, turns: ArrayLike) -> tuple[Integers, Integers]:
    """One label for every copy of an attractor: attractor and turns numbered together.

    Args:
        label: attractors, any shape; negative: none.
        turns: full turns of every angle, the shape of ``label`` and the number of angles behind it.

    Returns:
        Labels 0, 1, ... of the same shape (-1 where ``label`` is negative), and the attractor and the turns
        that each of them stands for, shape (labels, 1 + angles), in rising order.

    Raises:
        InputError: not integers, or the shapes do not fit.
    """
    attractor, made = check_labels(label, "label"), check_labels(turns, "turns")
    if made.ndim != attractor.ndim + 1 or made.shape[:-1] != attractor.shape:
        raise InputError(f"turns: has shape {made.shape}, must be {attractor.shape} and the angles")
    known = attractor >= 0
    rows = np.column_stack([attractor[known], made[known]])
    table, place = np.unique(rows, axis=0, return_inverse=True)
    numbered = np.full(attractor.shape, -1, dtype=np.int64)
    numbered[known] = place.ravel()
    return numbered, table


def check_angles(field: str, name: str, values: ArrayLike, angles: Sequence[str] = STATE[:2]) -> None:
    """Refuse angles that must be degrees, beyond ``FEW_TURNS`` turns, of a state among ``angles``."""
    largest = float(np.abs(values).max())
    if name in angles and largest > 2.0 * np.pi * checks.FEW_TURNS:
        raise InputError(f"{field}: {checks.beyond_turns(largest)}")


def state_index(name: str, names: Sequence[str] = STATE) -> int:
    """Which of the states an axis of this name is."""
    if name not in names:
        raise InputError(f"axes.{shown_name(name)}: unknown name; {nearest(name, list(names))}")
    return names.index(name)


def norm_on(norm: ArrayLike, dim: int, coordinates: Sequence[int] | None = None) -> Floats:
    """Lower triangular matrix L (k, k) of a norm (dim, dim) on k of ``dim`` states, the others not departed.

    ``|d @ L|`` is the length of a departure d (k,) along ``coordinates``, indices of states (all by default).

    Raises:
        InputError: the norm is no such matrix or singular, or the coordinates are not different indices.
    """
    matrix = checks.states("norm", norm, dim)
    if matrix.shape != (dim, dim) or not np.isfinite(matrix).all():
        raise InputError(f"norm: has shape {matrix.shape}, must be a finite matrix ({dim}, {dim})")
    if coordinates is not None:
        if not isinstance(coordinates, Sequence | np.ndarray):
            raise InputError(f"coordinates = {shown(coordinates)}: must be indices of states")
        chosen = [checks.whole_number("coordinates", k, least=0, most=dim - 1) for k in coordinates]
        if not chosen or len(set(chosen)) != len(chosen):
            raise InputError(f"coordinates = {list(coordinates)}: must be different indices, at least one")
        matrix = matrix[chosen]
    if np.linalg.matrix_rank(matrix) < len(matrix):
        raise InputError("norm: is singular; every departure needs a length greater than 0")
    return np.asarray(np.linalg.cholesky(matrix @ matrix.T))
