"""Equilibria, their stability, their certificates and their sheets over grids of one to three parameters.

How deep each well is: the energy at which its sublevel set first meets another minimum. Angles count their
turns here: a copy of the same minimum one turn further is another minimum.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from fastmech.arrays import Codes, Floats, Integers
from fastmech.atlas.resting_map import map_resting_places, told_map
from fastmech.ensembles import checks
from fastmech.ensembles.threads import in_parts
from fastmech.jit import CUBE, MATRIX, STATUSES, kernel
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Drawn, counted
from fastmech.scene import Scene
from fastmech.slider.atlas.axes import check_axes, grid_coefficients
from fastmech.slider.atlas.sheets import SheetBuilder, SheetPoints
from fastmech.slider.descent import convex_radius, descend, slope, step_off
from fastmech.slider.equilibria import told_force
from fastmech.slider.impulse import POINTS, impulse_for, mobility
from fastmech.slider.solve import AT_FOLD, COMPLETE, MERGE, SINGULAR, SOLUTION, Roots, solve
from fastmech.slider.stability import assess_one
from fastmech.slider.theorem import MOST, wrap


class Coincidence(IntEnum):
    """What is special about a point of a map within rounding."""

    NONE = 0
    FOLD = 1
    """Two equilibria merge; the outcome of the proof is ``AT_FOLD``."""

    CUSP = 2
    """Three equilibria merge (two folds meet); the outcome of the proof is ``AT_FOLD``."""

    DOUBLE_PROJECTION = 3
    """Two equilibria share phi, a double root of the degree-6 polynomial, and are proved to differ."""


NONE, FOLD, CUSP, DOUBLE_PROJECTION = (int(code) for code in Coincidence)


@kernel(types.void(MATRIX, SOLUTION, STATUSES))
def coincidences(coefficients: Floats, found: Roots, special: Codes) -> None:
    """Write the ``Coincidence`` of every row into ``special``.

    At a fold with null direction v of the Hessian the third derivative of U along v is 3 P v1 v2 (v1 + v2),
    where P is the common pull of paper (17); it vanishes at a cusp. Rounding leaves the merged equilibrium's
    place uncertain by ``MERGE`` rad, hence the third derivative by as much of the loads.
    """
    phi, theta, index, count = found.phi, found.theta, found.index, found.count
    for row in range(coefficients.shape[0]):
        special[row] = NONE
        _, _, lift, spring, gravity, force, _, _ = coefficients[row]
        if found.outcome[row] == AT_FOLD:
            special[row] = FOLD
            for i in range(count[row]):
                if index[row, i] != SINGULAR:
                    continue
                _, _, h11, h12, h22 = slope(coefficients[row], phi[row, i], theta[row, i])
                v1, v2 = (h12, -h11) if abs(h11) > abs(h22) else (h22, -h12)
                size = np.hypot(v1, v2)
                third = 3.0 * spring * np.cos(phi[row, i] + theta[row, i]) * v1 * v2 * (v1 + v2)
                loads = abs(lift) + gravity + 2.0 * spring + 2.0 * abs(force)
                if abs(third) <= MERGE * loads * size**3:
                    special[row] = CUSP
        elif found.outcome[row] == COMPLETE:
            for i in range(count[row]):
                for j in range(i):
                    if abs(wrap(phi[row, i] - phi[row, j])) <= found.radius[row, i] + found.radius[row, j]:
                        special[row] = DOUBLE_PROJECTION


ROOTS = types.Array(types.complex128, 3, "C")
VERDICTS = types.Array(types.int8, 3, "C")


@kernel(types.void(MATRIX, SOLUTION, CUBE, ROOTS, MATRIX, MATRIX, VERDICTS))
def assess(
    coefficients: Floats,
    found: Roots,
    hessian: Floats,
    eigenvalues: NDArray[np.complex128],
    frequency: Floats,
    decay: Floats,
    verdict: Codes,
) -> None:
    """Stability of the equilibria of every row of (n, 8) reduced coefficients, the force frozen.

    The arrays are written as ``Slab`` has them, but the Hessian over m2 l^2 and ``decay`` [1/s], the slowest
    mode's rate.
    """
    for row in range(coefficients.shape[0]):
        for i in range(found.phi.shape[1]):
            if i >= found.count[row]:
                frequency[row, i], decay[row, i] = np.nan, np.nan
                for k in range(3):
                    hessian[row, i, k] = np.nan
                for k in range(4):
                    eigenvalues[row, i, k], verdict[row, i, k] = complex(np.nan, np.nan), -1
                continue
            place = (found.phi[row, i], found.theta[row, i], found.radius[row, i], int(found.index[row, i]))
            a = assess_one(coefficients[row], place, eigenvalues[row, i])
            hessian[row, i, 0], hessian[row, i, 1], hessian[row, i, 2] = a.s.k11, a.s.k12, a.s.k22
            low = a.squares[0]
            frequency[row, i] = np.sqrt(low) if low >= 0.0 else np.nan
            decay[row, i] = a.decay
            verdict[row, i, 0], verdict[row, i, 1] = a.sylvester, a.hurwitz
            verdict[row, i, 2], verdict[row, i, 3] = a.spectrum, a.joint


#: Share of the potential's amplitudes by which what is proved lies below the barriers: far above rounding.
ROUNDING = 1e-12


@kernel(types.void(MATRIX, SOLUTION, MATRIX))
def barriers(coefficients: Floats, found: Roots, barrier: Floats) -> None:
    """Write the energy of the lowest way out of every minimum into ``barrier`` (n, 6), NaN elsewhere.

    Equilibria come deepest first, and energies and barriers are in the same unit. Saddles are taken in rising
    order. One whose two sides lead down to different minima (or to copies of one minimum, some turns apart)
    opens both wells. With four equilibria each saddle does: the torus has two independent turns, and two
    saddles for them.
    """
    phi, theta, energy, index, count = found.phi, found.theta, found.energy, found.index, found.count
    phis, thetas, radii, slot = np.empty(6), np.empty(6), np.empty(6), np.empty(6, dtype=np.int64)
    for row in range(coefficients.shape[0]):
        barrier[row] = np.nan
        if found.outcome[row] != COMPLETE:
            continue
        n, minima = int(count[row]), 0
        for i in range(n):
            if index[row, i] == 0:
                phis[minima], thetas[minima], slot[minima] = phi[row, i], theta[row, i], i
                radii[minima] = convex_radius(coefficients[row], phi[row, i], theta[row, i])
                minima += 1
        for i in range(n):
            if index[row, i] != 1:
                continue
            if n == 4:
                barrier[row, 0] = energy[row, i]
                break
            c = coefficients[row]
            p1, t1 = step_off(c, phi[row, i], theta[row, i], 1.0)
            p2, t2 = step_off(c, phi[row, i], theta[row, i], -1.0)
            first, a1, a2 = descend(c, p1, t1, phis, thetas, radii=radii, count=minima)
            second, b1, b2 = descend(c, p2, t2, phis, thetas, radii=radii, count=minima)
            if first < 0 or second < 0:
                break  # a way out that is not known may be lower than those that follow
            if first != second or a1 != b1 or a2 != b2:
                for well in (first, second):
                    if np.isnan(barrier[row, slot[well]]):
                        barrier[row, slot[well]] = energy[row, i]


def least_impulses(
    coefficients: Floats, phi: Floats, theta: Floats, depth: Floats, masses: tuple[Floats, Floats], on: str
) -> Floats:
    """Impulse on a point [N s] below which no blow on the resting mechanism leaves its well, (n,).

    Energy does not grow under a constant force. So no blow that gives less than the well's depth leaves, and
    none gives more than along the direction in which the point moves most easily. What rounding may make of
    the ``depth`` over m2 l^2 (n,) [1/s^2] is taken off. NaN for M3 at its dead centres. ``masses`` are m2
    [kg] and m2 l^2 [kg m2].
    """
    mass, slider, lift, spring, gravity, force, *_ = coefficients.T
    rounding = ROUNDING * (np.abs(lift) + spring + gravity + 2.0 * np.abs(force))
    easiest = mobility(masses[0], mass, slider, phi, theta, on=on).greatest
    return impulse_for(np.maximum(depth - rounding, 0.0) * masses[1], easiest)


#: Points that one task solves; each but the first of them starts from the one before.
BLOCK = 4096

#: Points that are solved at a time: what takes memory meanwhile is theirs alone.
SLAB = 65536

#: Numbers of 8 bytes that a map holds of every point, its sheets joined.
POINT_NUMBERS = 132


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
    #: Impulse on M1 below which no blow leaves the well [N s], (n, 6); NaN: it cannot be struck.
    shock_limit_m1: Floats
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


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumMap(Drawn, Slab):
    """Equilibria over a grid; the arrays of ``Slab`` with the axes' lengths in place of n.

    ``sheet`` keeps the identity of an equilibrium across the map (see ``fastmech.slider.atlas.sheets``).
    """

    axes: dict[str, Floats]
    sheet: NDArray[np.int32]  #: grid + (6,), -1 where there is none
    sheet_morse_index: Codes  #: (sheets,)
    sheet_branch: NDArray[np.int32]  #: (sheets,): sheets of one branch continue one another round a cusp
    sheet_discontinuities: NDArray[np.int32]  #: (breaks, axes + 2): see ``fastmech.slider.atlas.sheets``

    KIND = "equilibrium_map"
    LAYOUT = "scan_types.map_layout:map_dataset"
    PICTURE = "plots.objects:draw_map"

    def told(self) -> str:
        """The grid, how many equilibria where, and what is proved; of a force that decays, what is left."""
        scene, sheets = self.system, f"  {counted(len(self.sheet_morse_index), 'sheet')}"
        if scene is not None and scene.alpha * scene.F0 != 0.0 and not {"alpha", "F0"} & {*self.axes}:
            sheets += f"\n  {told_force(scene, 0.0)}"
        return told_map(self, ("phi", "theta"), sheets)


def map_equilibria(
    scene: Scene | Mechanism,
    axes: Mapping[str, ArrayLike],
    *,
    wells: bool = False,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Any:
    """All equilibria of ``scene`` at every point of a grid over one to three of its parameters.

    Of a ``Mechanism`` over any number of its parameters, see
    :func:`fastmech.atlas.resting_map.map_resting_places`.

    The force is F0 where alpha = 0 and its limit 0 where alpha > 0, as in ``find_equilibria``. The result
    has the same bits for any number of threads.

    Args:
        scene: gives every parameter that is no axis.
        axes: parameter names with their values, in the order of the result's dimensions.
        wells: whether to find the depth of every well too; it takes most time where six equilibria exist.
            Of a mechanism each point is proved on cells by :func:`fastmech.barrier_tree`.
        threads: None: as many as the process may use.
        progress: called in the calling thread with the number of points finished since its last call.

    Returns:
        EquilibriumMap or RestingMap: axes, count, outcome, energy, verdict, plot(), save(), to_xarray().

    Raises:
        InputError: wrong number of axes, an unknown name, values that neither rise nor fall throughout or
            that the scene refuses, or more points than memory holds.
    """
    if isinstance(scene, Mechanism):
        return map_resting_places(scene, axes, wells=wells, threads=threads, progress=progress)
    checks.progress_function(progress, "points")
    checked = check_axes(scene, axes)
    grid = tuple(len(values) for values in checked.values())
    points, hint = math.prod(grid), 'fewer, or in parts for files: fastmech run, kind = "equilibrium_map"'
    checks.memory(points * POINT_NUMBERS, 1, f"axes: {points:.3g} points", hint)
    builder, whole = SheetBuilder(scene, checked), Slab.empty(points)
    (name, values), plane = next(iter(checked.items())), math.prod(grid[1:])
    planes = max(1, SLAB // plane)
    for first in range(0, values.size, planes):
        some = {**checked, name: values[first : first + planes]}
        slab = whole.rows(slice(first * plane, (first + planes) * plane))
        coefficients = solve_grid(scene, some, slab, wells=wells, threads=threads, progress=progress)
        found = SheetPoints(coefficients, slab.phi, slab.theta, slab.morse_index, slab.count)
        builder.add(found, threads)
    sheets = builder.finish()
    shaped = {name: array.reshape(grid + array.shape[1:]) for name, array in vars(whole).items()}
    return EquilibriumMap(
        **shaped,
        axes=checked,
        sheet=np.concatenate(sheets.labels).reshape(*grid, MOST),
        sheet_morse_index=sheets.morse_index,
        sheet_branch=sheets.branch,
        sheet_discontinuities=sheets.breaks,
    ).of(scene)


def sheets_of_wells(scene: Scene, parameter: str, values: Floats) -> tuple[Integers, Floats]:
    """Sheets of all wells along a parameter (wells,), and where they are [rad] (values, wells, 2), or NaN."""
    atlas = map_equilibria(scene, {parameter: values})
    wells = np.flatnonzero(atlas.sheet_morse_index == 0)
    places = np.full((values.size, wells.size, 2), np.nan)
    for w, sheet in enumerate(wells):
        at, slot = np.nonzero(atlas.sheet == sheet)
        places[at, w] = np.column_stack([atlas.phi[at, slot], atlas.theta[at, slot]])
    return wells.astype(np.int64), places


def solve_grid(
    scene: Scene,
    axes: Mapping[str, Floats],
    out: Slab,
    *,
    wells: bool,
    threads: int | None,
    progress: Callable[[int], None] | None,
) -> Floats:
    """Write what is known of all points of a grid; their reduced coefficients (n, 8).

    ``weight`` [kg m2] and ``constant`` [J] turn energies into joules; ``mass`` is m2 [kg].
    """
    coefficients, weight, constant, mass = grid_coefficients(scene, axes)

    def solve_some(rows: slice) -> None:
        own, some = coefficients[rows], out.rows(rows)
        found = Roots(
            some.phi, some.theta, some.energy, some.radius, some.morse_index, count=some.count,
            expected=np.empty(len(own), dtype=np.int8), outcome=some.outcome, margin=some.fold_margin,
        )  # fmt: skip
        solve(own, True, found)
        some.count_stable[:] = np.count_nonzero(some.morse_index == 0, axis=1)
        told = some.hessian, some.eigenvalues, some.frequency, some.decay_time, some.verdict
        assess(own, found, *told)
        coincidences(own, found, some.coincidence)
        limits = some.shock_limit_m1, some.shock_limit_m2, some.shock_limit_m3
        for array in (some.depth, *limits):
            array[:] = np.nan
        if wells:
            barriers(own, found, some.depth)
            some.depth[:] = some.depth - some.energy
            known = np.nonzero(np.isfinite(some.depth))
            wells_at = own[known[0]], some.phi[known], some.theta[known], some.depth[known]
            masses = mass[rows][known[0]], weight[rows][known[0]]
            for on, limit in zip(POINTS, limits, strict=True):
                limit[known] = least_impulses(*wells_at, masses, on)
            some.depth[:] = some.depth * weight[rows, None]
        with np.errstate(divide="ignore"):
            np.divide(1.0, some.decay_time, out=some.decay_time)
        some.energy[:] = some.energy * weight[rows, None] + constant[rows, None]
        some.hessian[:] = some.hessian * weight[rows, None, None]

    in_parts(solve_some, len(coefficients), threads, BLOCK, progress)
    return coefficients
