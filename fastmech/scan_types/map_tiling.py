"""An equilibrium map in tiles: planes of its first axis, and its curves; the sheets are found in the end."""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.axes import grid_coefficients
from fastmech.atlas.map import BLOCK, Slab, solve_block
from fastmech.atlas.sheets import SheetBuilder
from fastmech.ensembles.threads import thread_count
from fastmech.equilibria.search import MOST
from fastmech.results import Dataset, Variable, numbers
from fastmech.scan_types.map_curves import curve_variables
from fastmech.scan_types.map_layout import point_variables, sheet_table, sheet_variables
from fastmech.scan_types.tiling import RunContext, Tiles, Tiling
from fastmech.scene import Scene
from fastmech.store.stream import Piece, Stream

if TYPE_CHECKING:
    from fastmech.scan_types.equilibrium_map import EquilibriumMap

#: Points of a tile, about: a second of one thread where all is asked for.
TILE_POINTS = 1 << 15

#: What the sheets are found from.
_FOR_SHEETS = ("phi", "theta", "morse_index", "count")


class MapTiling(Tiling):
    """Tile 0 holds the curves, every other some planes of the first axis.

    Args:
        request: what to keep.
        scene: gives every parameter that is no axis.
        axes: parameter names with their values.
    """

    what = "points of the map"

    def __init__(self, request: EquilibriumMap, scene: Scene, axes: dict[str, NDArray[np.float64]]) -> None:
        self.request, self.scene, self.axes = request, scene, axes
        self.first, *others = axes
        self.plane = math.prod(len(axes[other]) for other in others)
        self.others = tuple(len(axes[other]) for other in others)
        planes, length = max(1, TILE_POINTS // self.plane), len(axes[self.first])
        self.parts = [slice(k, min(k + planes, length)) for k in range(0, length, planes)]
        self.count = 1 + len(self.parts)

    def items(self, index: int) -> int:
        """Points."""
        if index == 0:
            return 0
        part = self.parts[index - 1]
        return (part.stop - part.start) * self.plane

    def compute(self, index: int, context: RunContext) -> Dataset:
        """Solve some planes, or trace the curves."""
        if index == 0:
            return Dataset(curve_variables(self.scene, self.axes, context.threads))
        coefficients, weight, constant, mass = self._coefficients(index)
        slab = Slab.empty(len(coefficients))

        def solve(start: int) -> None:
            context.check()
            rows = slice(start, start + BLOCK)
            solve_block(
                coefficients[rows],
                weight[rows],
                constant[rows],
                mass[rows],
                self.request.wells,
                slab.rows(rows),
            )

        with ThreadPoolExecutor(thread_count(context.threads)) as pool:
            list(pool.map(solve, range(0, len(coefficients), BLOCK)))
        return Dataset(self._shaped(slab, for_sheets=True))

    def assemble(self, tile: Tiles) -> Stream:
        """Join the planes and find which equilibria of different points are one, continued."""
        about = {
            name: Variable((name,), values, *self.scene.described()[name][1:])
            for name, values in self.axes.items()
        }
        attrs = {
            "axes": tuple(self.axes),
            "layout": "six slots along root, the deepest first; beyond count NaN, codes _FillValue",
            "curves": "all fold curves that part neighbouring points; islands between them are not seen",
        }
        one = self._shaped(Slab.empty(self.plane))
        one |= sheet_variables(tuple(self.axes), np.zeros((1, *self.others, 6), dtype=np.int32))
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

    def _pieces(self, tile: Tiles) -> Iterator[Piece]:
        builder = SheetBuilder(self.scene, self.axes)
        kept = set(self._shaped(Slab.empty(self.plane)))
        for index, part in enumerate(self.parts, start=1):
            variables = tile(index).variables
            phi, theta, morse_index, count = (variables[name].data for name in _FOR_SHEETS)
            builder.add(
                self._coefficients(index)[0],
                phi.reshape(-1, phi.shape[-1]),
                theta.reshape(-1, theta.shape[-1]),
                morse_index.reshape(-1, morse_index.shape[-1]),
                count.reshape(-1),
            )
            yield part, {name: variables[name].data for name in variables if name in kept}
        sheets = builder.finish()
        for part, sheet in zip(self.parts, sheets.labels, strict=True):
            yield part, {"sheet": sheet.reshape(-1, *self.others, sheet.shape[-1])}
        table = sheet_table(sheets.morse_index, sheets.branch, sheets.breaks)
        yield Dataset({}, groups={"sheets": Dataset(table)})

    def _coefficients(self, index: int) -> tuple[NDArray[np.float64], ...]:
        values = self.axes[self.first][self.parts[index - 1]]
        return grid_coefficients(self.scene, {**self.axes, self.first: values})

    def _shaped(self, slab: Slab, for_sheets: bool = False) -> dict[str, Variable]:
        arrays = {name: a.reshape(-1, *self.others, *a.shape[1:]) for name, a in vars(slab).items()}
        variables = point_variables(tuple(self.axes), Slab(**arrays))
        kept = self.request.kept(variables)
        return kept | {name: variables[name] for name in _FOR_SHEETS} if for_sheets else kept
