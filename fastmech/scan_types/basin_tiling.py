"""A basin map in tiles: planes of its first axis from all over, or the whole of it where it is refined."""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fastmech.basins.map import STATE, BasinMap, map_basins
from fastmech.basins.status import FAILURES, BasinStatus
from fastmech.basins.steps import method_for
from fastmech.capture.certificate import certificate_of
from fastmech.results import Dataset, Variable
from fastmech.scan_types.basin_layout import basin_variables
from fastmech.scan_types.request import failures
from fastmech.scan_types.tiling import RunContext, Tiles, Tiling
from fastmech.scene import Scene

#: Starts of a tile, about, and of one whose motions may be longer the fewer: a second or two of one thread.
TILE_POINTS = 1 << 14
USUAL_END = 60.0

#: What a tile knows of every start, by the names in `fastmech.basins.map.BasinMap`.
_ARRAYS = ("well", "turns", "time", "settle_time", "status", "computed")


class _Request(Protocol):
    @property
    def fixed(self) -> dict[str, float]: ...
    @property
    def t_end(self) -> float: ...
    @property
    def refine(self) -> int | None: ...
    @property
    def settle_radius(self) -> float | None: ...
    @property
    def dt(self) -> float | None: ...
    @property
    def method(self) -> str | None: ...


class BasinTiling(Tiling):
    """Every tile holds some planes of the first axis, each so many apart.

    Args:
        request: how to compute.
        scene: the mechanism.
        axes: coordinates of the starts with their values.
    """

    what = "starts of the basin map"

    def __init__(self, request: _Request, scene: Scene, axes: dict[str, NDArray[np.float64]]) -> None:
        self.request, self.scene, self.axes = request, scene, axes
        self.first, *others = axes
        self.others = tuple(len(axes[other]) for other in others)
        length = len(axes[self.first])
        points = int(TILE_POINTS * min(1.0, USUAL_END / request.t_end))
        planes = max(1, points // math.prod(self.others)) if request.refine is None else length
        self.count = -(-length // planes)
        # Planes from all over: tiles take about as long as each other, so that progress tells the time left.
        self.parts = [slice(k, length, self.count) for k in range(self.count)]

    def items(self, index: int) -> int:
        """Starts."""
        return math.prod(self._grid(index))

    def compute(self, index: int, context: RunContext) -> Dataset:
        """Label some planes."""
        advance = context.stage(self.what, self.items(index)) if self.count == 1 else None

        def told(finished: int) -> None:
            context.check()
            if advance is not None:
                advance(finished)

        found = map_basins(
            self.scene,
            {**self.axes, self.first: self.axes[self.first][self.parts[index]]},
            self.request.t_end,
            fixed=self.request.fixed,
            refine=self.request.refine,
            dt=self.request.dt,
            method=self.request.method,
            settle_radius=self.request.settle_radius,
            threads=context.threads,
            progress=told,
        )
        return self._tile({name: getattr(found, name) for name in _ARRAYS}, found.steps)

    def assemble(self, tile: Tiles) -> Dataset:
        """Join the planes and number the basins."""
        tiles = [tile(index) for index in range(self.count)]
        found = BasinMap(
            axes=self.axes,
            fixed={name: self.request.fixed.get(name, 0.0) for name in STATE if name not in self.axes},
            tree=certificate_of(self.scene).tree,
            t_end=self.request.t_end,
            steps=sum(int(part.attrs["steps"]) for part in tiles),
            **{name: self._joined(tiles, name) for name in _ARRAYS},
        )
        attrs: dict[str, Any] = {
            "axes": tuple(self.axes),
            "t_end": found.t_end,
            "method": method_for(self.scene, self.request.method),
        }
        attrs |= {"steps": found.steps, "refine": self.request.refine or 0}
        attrs |= {f"fixed_{name}": value for name, value in found.fixed.items()}
        return Dataset(basin_variables(found), attrs | found.counts | failures(found.status, FAILURES))

    def missing(self, index: int) -> Dataset:
        """Starts that have not been computed."""
        grid = self._grid(index)
        nothing = np.full(grid, np.nan)
        arrays: dict[str, NDArray[Any] | None] = {
            "well": np.full(grid, -1, dtype=np.int8),
            "turns": np.zeros((*grid, 2), dtype=np.int32),
            "time": nothing,
            "status": np.full(grid, BasinStatus.UNDECIDED, dtype=np.int8),
            "computed": np.zeros(grid, dtype=np.bool_),
            "settle_time": None if self.request.settle_radius is None else nothing,
        }
        return self._tile(arrays, 0)

    def _grid(self, index: int) -> tuple[int, ...]:
        part = self.parts[index]
        return (len(range(part.start, part.stop, part.step)), *self.others)

    def _joined(self, tiles: list[Dataset], name: str) -> Any:
        """An array of all tiles, every plane in its place; None where they have none."""
        if name not in tiles[0]:
            return None
        first = tiles[0][name].data
        length = len(self.axes[self.first])
        array = np.empty((length, *first.shape[1:]), np.bool_ if name == "computed" else first.dtype)
        for part, tile in zip(self.parts, tiles, strict=True):
            array[part] = tile[name].data
        return array

    def _tile(self, arrays: dict[str, NDArray[Any] | None], steps: int) -> Dataset:
        dims = (*self.axes, "angle")
        there = {name: array for name, array in arrays.items() if array is not None}
        return Dataset(
            {name: Variable(dims[: array.ndim], array) for name, array in there.items()}, {"steps": steps}
        )
