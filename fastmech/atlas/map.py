"""Equilibria, their stability, their certificates and their sheets over grids of one to three parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.atlas.assess import Assessed, assess
from fastmech.atlas.axes import Floats, check_axes, grid_coefficients
from fastmech.atlas.coincidence import coincidences
from fastmech.atlas.resting_map import map_resting_places
from fastmech.atlas.sheets import SheetBuilder
from fastmech.atlas.wells import barriers, least_impulses
from fastmech.ensembles import checks
from fastmech.ensembles.threads import thread_count
from fastmech.equilibria.search import MOST
from fastmech.equilibria.solve import Solution, solve
from fastmech.errors import InputError
from fastmech.mechanism.impulse import POINTS
from fastmech.models.mechanism import Mechanism
from fastmech.scene import Scene

#: Points that one task solves; each but the first of them starts from the one before.
BLOCK = 4096

#: Points that are labelled at a time while the next ones are solved.
SLAB = 65536

#: Numbers of 8 bytes that a map holds of every point, its sheets joined.
POINT_NUMBERS = 132

Codes = NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class Slab:
    """Equilibria at some points of a map in memory order, the deepest first at every point, then padding.

    Every array has six slots a point. Numbers are NaN in slots without an equilibrium, codes -1.
    """

    count: Codes  #: equilibria, (n,)
    count_stable: Codes  #: minima of U, (n,)
    outcome: Codes  #: ``Outcome``, (n,)
    coincidence: Codes  #: ``Coincidence``, (n,)
    fold_margin: Floats  #: signed distance to the fold [rad], (n,): six equilibria where positive
    phi: Floats  #: [rad], (n, 6)
    theta: Floats  #: [rad], (n, 6)
    radius: Floats  #: the true equilibrium is proved to be within [rad], (n, 6); inf: not proved
    energy: Floats  #: U = Pi - F x2 [J], (n, 6)
    morse_index: Codes  #: (n, 6); -2 where the Hessian is singular within rounding
    hessian: Floats  #: phi phi, phi theta, theta theta [J], paper (19), (n, 6, 3)
    eigenvalues: NDArray[np.complex128]  #: [1/s], (n, 6, 4), largest real part first
    verdict: Codes  #: ``Verdict`` by Sylvester, Hurwitz, eigenvalues, jointly, (n, 6, 4)
    frequency: Floats  #: lowest undamped natural frequency [rad/s], (n, 6); NaN where U falls
    decay_time: Floats  #: slowest linear mode falls to 1/e [s], (n, 6), inf: it does not; NaN: no minimum
    depth: Floats  #: energy from a minimum to the lowest way out of its well [J], (n, 6)
    shock_limit_m1: (
        Floats  #: impulse on M1 below which no blow leaves the well [N s], (n, 6); NaN: cannot be struck
    )
    shock_limit_m2: Floats  #: the same of M2, in whatever direction it is struck
    shock_limit_m3: Floats  #: the same of the slider M3

    @classmethod
    def empty(cls, n: int) -> Slab:
        """Arrays for n points, not filled."""
        shapes: dict[str, tuple[tuple[int, ...], type]] = {
            **dict.fromkeys(("count", "count_stable", "outcome", "coincidence"), ((), np.int8)),
            "fold_margin": ((), np.float64),
            "hessian": ((MOST, 3), np.float64),
            "eigenvalues": ((MOST, 4), np.complex128),
            "morse_index": ((MOST,), np.int8),
            "verdict": ((MOST, 4), np.int8),
        }
        every = {field.name: shapes.get(field.name, ((MOST,), np.float64)) for field in fields(Slab)}
        return Slab(**{name: np.empty((n, *shape), dtype) for name, (shape, dtype) in every.items()})

    def rows(self, rows: slice) -> Slab:
        """Some of the points; the arrays are views."""
        return Slab(**{field.name: getattr(self, field.name)[rows] for field in fields(Slab)})


@dataclass(frozen=True, eq=False)
class EquilibriumMap(Slab):
    """Equilibria over a grid; the arrays of ``Slab`` with the axes' lengths in place of n.

    ``sheet`` keeps the identity of an equilibrium across the map (see ``fastmech.atlas.sheets``).
    """

    axes: dict[str, Floats]
    sheet: NDArray[np.int32]  #: grid + (6,), -1 where there is none
    sheet_morse_index: Codes  #: (sheets,)
    sheet_branch: NDArray[np.int32]  #: (sheets,): sheets of one branch continue one another round a cusp
    sheet_breaks: NDArray[np.int32]  #: (breaks, axes + 2): see ``fastmech.atlas.sheets``


Progress = Callable[[int], None]


def map_equilibria(
    scene: Scene | Mechanism,
    axes: Mapping[str, ArrayLike],
    *,
    wells: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Any:
    """All equilibria of ``scene`` at every point of a grid over one to three of its parameters.

    Of a ``Mechanism`` over any number of its parameters: see
    :func:`fastmech.atlas.resting_map.map_resting_places`, which gives a ``RestingMap``.

    The force is F0 where alpha = 0 and its limit 0 where alpha > 0, as in ``find_equilibria``. The result
    has the same bits for any number of threads.

    Args:
        scene: gives every parameter that is no axis.
        axes: parameter names with their values, in the order of the result's dimensions.
        wells: whether to find the depth of every well too; it takes most time where six equilibria exist.
        threads: None: as many as the process may use.
        progress: called in the calling thread with the number of points finished since its last call.

    Raises:
        InputError: wrong number of axes, an unknown name, values that neither rise nor fall throughout or
            that the scene refuses, or more points than memory holds.
    """
    if isinstance(scene, Mechanism):
        if wells:
            raise InputError("wells = True: is for a Scene; fastmech.trapped and labels tell a mechanism's")
        return map_resting_places(scene, axes, threads=threads, progress=progress)
    checks.progress_function(progress, "points")
    checked = check_axes(scene, axes)
    grid = tuple(len(values) for values in checked.values())
    checks.memory(
        math.prod(grid) * POINT_NUMBERS,
        1,
        f"axes: {math.prod(grid):.3g} points",
        'fewer, or in parts for files: fastmech run, kind = "equilibrium_map"',
    )
    builder = SheetBuilder(scene, checked)
    whole = Slab.empty(math.prod(grid))
    for _ in solve_in_slabs(scene, checked, builder, whole.rows, wells, threads, progress):
        pass
    sheets = builder.finish()
    shaped = {name: array.reshape(grid + array.shape[1:]) for name, array in vars(whole).items()}
    return EquilibriumMap(
        **shaped,
        axes=checked,
        sheet=np.concatenate(sheets.labels).reshape(*grid, MOST),
        sheet_morse_index=sheets.morse_index,
        sheet_branch=sheets.branch,
        sheet_breaks=sheets.breaks,
    )


def solve_in_slabs(
    scene: Scene,
    axes: Mapping[str, Floats],
    builder: SheetBuilder,
    place: Callable[[slice], Slab],
    wells: bool,
    threads: int | None,
    progress: Progress | None,
) -> Iterator[tuple[slice, Slab]]:
    """Solve a grid some planes of the first axis at a time, the next ones already at work.

    Args:
        scene, axes, wells, threads, progress: as ``map_equilibria`` takes them, the axes checked.
        builder: is given every slab to label.
        place: gives the arrays that the points of a slice are to be written into.

    Yields:
        Planes of the first axis, and their points.
    """
    name, *others = axes
    plane = math.prod(len(axes[other]) for other in others)
    planes = max(1, SLAB // plane)
    parts = [slice(k, min(k + planes, len(axes[name]))) for k in range(0, len(axes[name]), planes)]
    with ThreadPoolExecutor(thread_count(threads)) as pool:

        def submit(part: slice) -> tuple[Floats, Slab, list[Future[None]]]:
            coefficients, weight, constant, mass = grid_coefficients(scene, {**axes, name: axes[name][part]})
            slab = place(slice(part.start * plane, part.stop * plane))
            blocks = [slice(k, k + BLOCK) for k in range(0, len(coefficients), BLOCK)]
            return (
                coefficients,
                slab,
                [
                    pool.submit(
                        solve_block,
                        coefficients[rows],
                        weight[rows],
                        constant[rows],
                        mass[rows],
                        wells,
                        slab.rows(rows),
                    )
                    for rows in blocks
                ],
            )

        ahead = submit(parts[0])
        for number, part in enumerate(parts):
            coefficients, slab, tasks = ahead
            if number + 1 < len(parts):
                ahead = submit(parts[number + 1])
            for task in tasks:
                task.result()
            builder.add(coefficients, slab.phi, slab.theta, slab.morse_index, slab.count)
            yield part, slab
            if progress is not None:
                progress(len(coefficients))


def solve_block(
    coefficients: Floats, weight: Floats, constant: Floats, mass: Floats, wells: bool, out: Slab
) -> None:
    """Solve and assess some points; ``weight`` [kg m2] and ``constant`` [J] turn energies into joules.

    ``mass`` is m2 [kg].
    """
    places = (coefficients, out.phi, out.theta)
    expected = np.empty(len(coefficients), dtype=np.int8)
    found = Solution(
        out.phi, out.theta, out.energy, out.radius, out.morse_index, out.count, expected, out.outcome,
        out.fold_margin,
    )  # fmt: skip
    solve(coefficients, True, found)
    out.count_stable[:] = np.count_nonzero(out.morse_index == 0, axis=1)
    own = out.hessian, out.eigenvalues, out.frequency, out.decay_time, out.verdict
    assess(coefficients, found, Assessed(*own))
    coincidences(*places, out.radius, out.morse_index, out.count, out.outcome, out.coincidence)
    limits = out.shock_limit_m1, out.shock_limit_m2, out.shock_limit_m3
    for array in (out.depth, *limits):
        array[:] = np.nan
    if wells:
        barriers(*places, out.energy, out.morse_index, out.count, out.outcome, out.depth)
        out.depth[:] = out.depth - out.energy
        known = np.nonzero(np.isfinite(out.depth))
        wells_at = coefficients[known[0]], out.phi[known], out.theta[known], out.depth[known]
        masses = mass[known[0]], weight[known[0]]
        for on, limit in zip(POINTS, limits, strict=True):
            limit[known] = least_impulses(*wells_at, masses, on)
        out.depth[:] = out.depth * weight[:, None]
    with np.errstate(divide="ignore"):
        np.divide(1.0, out.decay_time, out=out.decay_time)
    out.energy[:] = out.energy * weight[:, None] + constant[:, None]
    out.hessian[:] = out.hessian * weight[:, None, None]
