"""Equilibria, their stability and their certificates over grids of one to three parameters."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.equilibria.search import MOST, FloatArray
from fastmech.equilibria.solution import solve_rows
from fastmech.errors import InputError
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene, nearest
from fastmech.stability.linearize import state_matrices

#: Scenes that one task solves: a few milliseconds, so threads share the work evenly and progress is smooth.
BLOCK = 512


@dataclass(frozen=True, eq=False)
class EquilibriumMap:
    """Equilibria over a grid; the deepest first at every point, then padding.

    ``grid`` stands for the axes' lengths. Angles, energies and eigenvalues are NaN where there is no
    equilibrium; Morse indices are -1 there and -2 where the Hessian is singular within rounding.
    """

    axes: dict[str, FloatArray]
    count: NDArray[np.int8]  #: equilibria, shape grid
    count_stable: NDArray[np.int8]  #: minima of U, shape grid
    phi: FloatArray  #: [rad], grid + (6,)
    theta: FloatArray  #: [rad], grid + (6,)
    energy: FloatArray  #: U = Pi - F x2 [J], grid + (6,)
    morse_index: NDArray[np.int8]  #: grid + (6,)
    eigenvalues: NDArray[np.complex128]  #: [1/s], grid + (6, 4), largest real part first
    outcome: NDArray[np.int8]  #: ``Outcome``, shape grid
    fold_margin: FloatArray  #: signed distance to the fold [rad], shape grid: six equilibria where positive


def map_equilibria(
    scene: Scene,
    axes: Mapping[str, ArrayLike],
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> EquilibriumMap:
    """All equilibria of ``scene`` at every point of a grid over one to three of its parameters.

    The force is F0 where alpha = 0 and its limit 0 where alpha > 0, as in ``find_equilibria``. The result
    has the same bits for any number of threads.

    Args:
        scene: gives every parameter that is no axis.
        axes: parameter names with their values, in the order of the result's dimensions.
        threads: None: as many as the process may use.
        progress: called in the calling thread with the number of points finished since its last call.

    Raises:
        InputError: wrong number of axes, an unknown name, or a value that the scene refuses.
    """
    checked = check_axes(scene, axes)
    grid = tuple(len(values) for values in checked.values())
    coefficients, weight, constant = grid_coefficients(scene, checked, grid)
    n = math.prod(grid)
    result = EquilibriumMap(
        axes=checked,
        count=np.empty(n, dtype=np.int8),
        count_stable=np.empty(n, dtype=np.int8),
        phi=np.empty((n, MOST)),
        theta=np.empty((n, MOST)),
        energy=np.empty((n, MOST)),
        morse_index=np.empty((n, MOST), dtype=np.int8),
        eigenvalues=np.empty((n, MOST, 4), dtype=np.complex128),
        outcome=np.empty(n, dtype=np.int8),
        fold_margin=np.empty(n),
    )

    def task(rows: slice) -> int:
        solve_block(coefficients[rows], weight[rows], constant[rows], result, rows)
        return len(coefficients[rows])

    with ThreadPoolExecutor(thread_count(threads)) as pool:
        for future in as_completed([pool.submit(task, rows) for rows in blocks(n)]):
            finished = future.result()
            if progress is not None:
                progress(finished)
    arrays = {name: value for name, value in vars(result).items() if name != "axes"}
    return EquilibriumMap(checked, **{k: v.reshape(grid + v.shape[1:]) for k, v in arrays.items()})


def check_axes(scene: Scene, axes: Mapping[str, ArrayLike]) -> dict[str, FloatArray]:
    """The axes as float64 vectors, every value one that the scene accepts.

    Raises:
        InputError: see ``map_equilibria``.
    """
    if not 1 <= len(axes) <= 3:
        raise InputError(f"axes: {len(axes)} given; one to three parameters are allowed")
    names = list(Scene.model_fields)
    checked = {}
    for name, values in axes.items():
        if name not in names:
            raise InputError(f"axes.{name}: unknown parameter; {nearest(name, names)}")
        try:
            vector = np.ascontiguousarray(values, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(f"axes.{name}: must be a sequence of numbers") from None
        if vector.ndim != 1 or vector.size == 0:
            raise InputError(f"axes.{name}: shape {vector.shape}: must be one-dimensional and not empty")
        for value in vector:
            try:
                scene.replace(**{name: float(value)})
            except InputError as error:
                raise InputError(f"axes.{name}: {error}") from None
        checked[name] = vector
    return checked


def grid_coefficients(
    scene: Scene, axes: Mapping[str, FloatArray], grid: tuple[int, ...]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Reduced coefficients (n, 8) of all points; m2 l^2 and (c1 + c2) l^2 (n,) turn energies to J."""
    fields = {name: np.full(grid, float(value)) for name, value in scene.model_dump().items()}
    for dimension, (name, values) in enumerate(axes.items()):
        shape = [1] * len(grid)
        shape[dimension] = -1
        fields[name] = np.broadcast_to(values.reshape(shape), grid)
    # The formulas are plain arithmetic, so a scene of vectors gives vectors.
    point: Any = SimpleNamespace(**{name: np.ravel(value) for name, value in fields.items()})
    point.F0 = np.where(point.alpha == 0.0, point.F0, 0.0)
    columns: Any = reduce(point)
    return (
        np.ascontiguousarray(np.stack(columns, axis=1)),
        point.m2 * point.l**2,
        (point.c1 + point.c2) * point.l**2,
    )


def blocks(n: int) -> Iterator[slice]:
    """Slices of ``BLOCK`` points that cover n."""
    return (slice(start, start + BLOCK) for start in range(0, n, BLOCK))


def thread_count(threads: int | None) -> int:
    """Checked number of threads.

    Raises:
        InputError: not a whole number >= 1.
    """
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
        raise InputError(f"threads = {threads!r}: must be a whole number >= 1")
    return threads


def solve_block(
    coefficients: FloatArray, weight: FloatArray, constant: FloatArray, result: EquilibriumMap, rows: slice
) -> None:
    """Solve some points and write them into the flat arrays of ``result``."""
    solution = solve_rows(coefficients)
    matrices = np.empty((len(coefficients), MOST, 4, 4))
    state_matrices(coefficients, solution.phi, solution.theta, solution.count, matrices)
    filled = np.arange(MOST) < solution.count[:, None]
    values = np.linalg.eigvals(matrices[filled]).astype(np.complex128)
    # Largest real part first; of a conjugate pair, whose real parts agree, the positive imaginary one.
    order = np.lexsort((-values.imag, -values.real), axis=1)
    result.eigenvalues[rows] = complex(np.nan, np.nan)
    result.eigenvalues[rows][filled] = np.take_along_axis(values, order, axis=1)
    result.count[rows] = solution.count
    result.count_stable[rows] = np.count_nonzero(solution.index == 0, axis=1)
    result.phi[rows] = solution.phi
    result.theta[rows] = solution.theta
    result.energy[rows] = solution.energy * weight[:, None] + constant[:, None]
    result.morse_index[rows] = solution.index
    result.outcome[rows] = solution.outcome
    result.fold_margin[rows] = solution.margin
