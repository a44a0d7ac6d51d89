"""Equilibria over one to three parameters: how many, how many stable, where, how deep, how fast they settle.

Layout: a point has four or six equilibria, and six slots along ``root``, the deepest equilibrium first;
slots beyond ``count`` hold NaN in numbers and -1 in codes, which is their ``_FillValue``. So reductions over
``root`` that skip NaN need no mask, and ``map.phi.where(map.morse_index == 0)`` leaves the stable ones.
``sheet`` says which slots of different points are one equilibrium, continued:
``map.phi.where(map.sheet == 3).max("root")`` is one of them over the whole map. Coordinates: the axes in
their units and ``root`` (rank by energy), so that a table of the map has a row for each slot of each point.
What has other dimensions is a group. ``sheets``: ``sheet_branch`` says which sheets continue one another
round a cusp, ``sheet_discontinuity`` where a sheet is torn. ``curves``, of a map over two parameters: fold
curves, cusps and vanishing-damping curves, point after point, ``fold_curve`` and ``undamped_curve``
numbering them; of a map over one its folds.

Folds do not depend on the grid: ``fold_proof`` tells that none is missing, or where that is not proved;
``fold_kind`` names folds and the pitchforks of symmetric scenes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

import numpy as np
from pydantic import Field

from fastmech.atlas.resting_map import RestingMap, map_resting_places
from fastmech.errors import InputError, shown
from fastmech.models.mechanism import Mechanism
from fastmech.objects import coordinate_units
from fastmech.outcome import Outcome
from fastmech.plots.equilibrium_map import draw_equilibrium_map
from fastmech.plots.map_view import load_drawn
from fastmech.results import Dataset, Variable, numbers, told
from fastmech.scan_types import map_layout
from fastmech.scan_types import request as scans
from fastmech.scene import Scene, nearest
from fastmech.slider.atlas.axes import grid_coefficients, refuse_decaying_load
from fastmech.slider.atlas.map import Slab, solve_grid
from fastmech.slider.atlas.sheets import SheetBuilder, SheetPoints
from fastmech.slider.theorem import MOST
from fastmech.store.write import Piece, Stream

#: Points of the largest map: its sheets take some 55 bytes a point in memory, its file about 100.
MOST_POINTS = 50_000_000

#: Numbers of 8 bytes that memory holds of every point of a map, and of every point that is being solved.
SHEET_NUMBERS, POINT_NUMBERS = 7, 250


class EquilibriumMapScan(scans.Scan):
    """Every equilibrium at every point of a grid of parameters, with the proof that none is missing."""

    kind: ClassVar[str] = "equilibrium_map"
    draw = staticmethod(draw_equilibrium_map)
    read = staticmethod(load_drawn)
    of_mechanisms = True
    taken = frozenset({"root", *map_layout.RESTING})

    axes: dict[str, scans.Axis] = Field(min_length=1)
    variables: list[str] | None = Field(
        None, description="what to keep of every point (all by default); large maps are smaller with less"
    )

    def check(self, scene: Scene | Mechanism) -> None:
        """Every value of every axis must be one the scene accepts, and every axis must matter."""
        scans.check_axes(scene, self.axes)
        if isinstance(scene, Scene):
            refuse_decaying_load(scene, self.axes)
            known, most = [*map_layout.point_variables(("x",), Slab.empty(1))], MOST_POINTS
        else:
            known, most = [*coordinate_units(scene), *map_layout.RESTING], MOST_OF_MECHANISMS
            for name in self.taken & {*self.axes}:
                raise InputError(f"axes.{name}: is the name of a variable of the result too")
        known += map_layout.TOGETHER
        for name in self.variables or ():
            if name not in known:
                raise InputError(f"variables: unknown variable {shown(name)}; {nearest(name, known)}")
        scans.check_parameters(scene, self.axes, "axes")
        scans.check_size("axes", self.axes, "points", most, SHEET_NUMBERS)
        first, *others = self.axes
        if others:
            plane = {name: self.axes[name] for name in others}
            scans.check_size("axes", plane, f"points in a plane of {first}", most, POINT_NUMBERS)

    def tiling(self, scene: Scene | Mechanism) -> scans.Tiling:
        """Planes of the first axis, and of a scene the curves as a tile of their own."""
        return MapTiling(self, scene) if isinstance(scene, Scene) else RestingTiling(self, scene)

    @property
    def wells(self) -> bool:
        """Whether the depths of wells are asked for."""
        return self.variables is None or any(
            name == "depth" or name.startswith("shock_limit") for name in self.variables
        )

    def kept(self, variables: dict[str, Variable]) -> dict[str, Variable]:
        """Those of the variables that are asked for."""
        if self.variables is None:
            return variables
        wanted = {one for name in self.variables for one in map_layout.TOGETHER.get(name, (name,))}
        return {name: variable for name, variable in variables.items() if name in wanted}


#: Points of a mechanism's largest map, which is joined in memory, and of a tile of one; and of a tile where
#: wells, which take far longer, are asked for by name.
MOST_OF_MECHANISMS, RESTING_POINTS, WELL_POINTS = 1_000_000, 1 << 11, 1 << 6

#: Points of a tile, about: a second of one thread where all is asked for.
TILE_POINTS = 1 << 15

#: What the sheets are found from.
_FOR_SHEETS = ("phi", "theta", "morse_index", "count")


class MapTiling(scans.Planes):
    """Tile 0 holds the curves, every other some planes of the first axis."""

    what = "points of the map"

    def __init__(self, request: EquilibriumMapScan, scene: Scene) -> None:
        super().__init__(scans.values_of(request.axes), TILE_POINTS)
        self.request, self.scene, self.plane = request, scene, math.prod(self.others)
        self.count += 1

    def items(self, index: int) -> int:
        """Points."""
        return super().items(index - 1) if index else 0

    def compute(self, index: int, context: scans.RunContext) -> Dataset:
        """Solve some planes, or trace the curves."""
        if index == 0:
            return Dataset(map_layout.curve_variables(self.scene, self.axes, context.threads))
        slab = Slab.empty(self.items(index))
        axes = self.axes_of(index - 1)
        solve_grid(self.scene, axes, slab, wells=self.request.wells, **context.working)
        return Dataset(self._shaped(slab, for_sheets=True))

    def assemble(self, tile: scans.Tiles) -> Stream:
        """Join the planes and find which equilibria of different points are one, continued."""
        about = scans.axis_variables(self.scene, self.axes)
        attrs = {
            "axes": tuple(self.axes),
            "layout": "six slots along root, the deepest first; beyond count NaN, codes _FillValue",
            "curves": "fold curves, see fold_proof; of undamped ones those that neighbouring points show",
        }
        one = self._shaped(Slab.empty(self.plane))
        one |= map_layout.sheet_variables(tuple(self.axes), np.zeros((1, *self.others, 6), dtype=np.int32))
        about |= numbers("root", MOST, "rank of the equilibrium by energy")
        curves = tile(0)
        fixed = Dataset(about, attrs, {"curves": curves} if len(curves) else {})
        rows = min(8, self.parts[0].stop)
        return Stream(fixed, one, self.first, lambda: self._pieces(tile), rows)

    def missing(self, index: int) -> Dataset:
        """No curves; no equilibria at the points."""
        if index == 0:
            return Dataset({})
        slab = Slab.empty(self.items(index))
        for array in vars(slab).values():
            array[...] = -1 if array.dtype.kind == "i" else np.nan
        slab.count[:] = 0
        slab.count_stable[:] = 0
        return Dataset(self._shaped(slab, for_sheets=True))

    def _pieces(self, tile: scans.Tiles) -> Iterator[Piece]:
        builder = SheetBuilder(self.scene, self.axes)
        kept = set(self._shaped(Slab.empty(self.plane)))
        for index, part in enumerate(self.parts, start=1):
            variables = tile(index).variables
            known = (variables[name].data for name in _FOR_SHEETS)
            coefficients, *_ = grid_coefficients(self.scene, self.axes_of(index - 1))
            roots = (array.reshape(len(coefficients), *array.shape[len(self.axes) :]) for array in known)
            builder.add(SheetPoints(coefficients, *roots))
            yield part, {name: variables[name].data for name in variables if name in kept}
        sheets = builder.finish()
        for part, sheet in zip(self.parts, sheets.labels, strict=True):
            yield part, {"sheet": sheet.reshape(-1, *self.others, sheet.shape[-1])}
        table = map_layout.sheet_table(sheets.morse_index, sheets.branch, sheets.breaks)
        yield Dataset({}, groups={"sheets": Dataset(table)})

    def _shaped(self, slab: Slab, for_sheets: bool = False) -> dict[str, Variable]:
        arrays = {name: a.reshape(-1, *self.others, *a.shape[1:]) for name, a in vars(slab).items()}
        variables = map_layout.point_variables(tuple(self.axes), Slab(**arrays))
        kept = self.request.kept(variables)
        return kept | {name: variables[name] for name in _FOR_SHEETS} if for_sheets else kept


class RestingTiling(scans.Planes):
    """Some planes of the first axis of a mechanism's map; slots are as many as the most equilibria."""

    what = "points of the map"

    def __init__(self, request: EquilibriumMapScan, scene: Mechanism) -> None:
        self.wells = "depth" in (request.variables or ())
        super().__init__(scans.values_of(request.axes), WELL_POINTS if self.wells else RESTING_POINTS)
        self.request, self.scene = request, scene

    def compute(self, index: int, context: scans.RunContext) -> Dataset:
        """Prove some planes."""
        found = map_resting_places(self.scene, self.axes_of(index), wells=self.wells, **context.working)
        return self._tile(found)

    def assemble(self, tile: scans.Tiles) -> Dataset:
        """Join the planes."""
        tiles = [dict(tile(index).variables) for index in range(self.count)]
        slots = max(one["count"].data.max(initial=0) for one in tiles)
        variables = scans.axis_variables(self.scene, self.axes)
        variables |= numbers("root", int(slots), "rank of the equilibrium by energy")
        for name, like in self.request.kept(tiles[0]).items():
            arrays = [one[name].data for one in tiles]
            if "root" in like.dims:
                none, before = -1 if like.data.dtype.kind == "i" else np.nan, [(0, 0)] * (like.data.ndim - 1)
                missing = ([*before, (0, int(slots) - array.shape[-1])] for array in arrays)
                arrays = [np.pad(a, m, constant_values=none) for a, m in zip(arrays, missing, strict=True)]
            variables[name] = replace(like, data=np.concatenate(arrays))
        layout = "slots along root, the deepest first; beyond count NaN, codes _FillValue"
        return Dataset(variables, told(self.scene) | {"axes": tuple(self.axes), "layout": layout})

    def missing(self, index: int) -> Dataset:
        """No equilibria at the points."""
        grid, n, axes = self.grid(index), len(self.scene.coordinates), self.axes_of(index)
        real, code = np.zeros((*grid, 0)), np.zeros((*grid, 0), dtype=np.int8)
        none = np.zeros(grid, dtype=np.int16)
        position, roots = np.zeros((*grid, 0, n)), np.zeros((*grid, 0, 2 * n), dtype=np.complex128)
        names = tuple(coordinate_units(self.scene))
        outcome, hidden = np.full(grid, Outcome.UNPROVED, dtype=np.int8), np.ones(grid, dtype=np.bool_)
        growth = np.zeros((*grid, 0, 2), dtype=np.int8)
        known = axes, names, none, outcome, position, real, real, code, code, code, roots, growth
        return self._tile(RestingMap(*known, hidden, real))

    def _tile(self, found: RestingMap) -> Dataset:
        return Dataset(map_layout.resting_variables(self.scene, tuple(self.axes), found))
