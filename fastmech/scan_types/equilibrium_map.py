"""Equilibria over one to three parameters: how many, how many stable, where, how deep, how fast they settle.

Layout: a point has four or six equilibria, and six slots along ``root``, the deepest equilibrium first;
slots beyond ``count`` hold NaN in numbers and -1 in codes. So reductions over ``root`` that skip NaN need no
mask, and ``map.phi.where(map.morse_index == 0)`` leaves the stable ones. ``sheet`` says which slots of
different points are one equilibrium, continued: ``map.phi.where(map.sheet == 3).max("root")`` is one of them
over the whole map; ``sheet_branch`` which sheets continue one another round a cusp; ``sheet_break`` where a
sheet is torn. Coordinates: the axes in their units, ``root`` (rank by energy), ``mode`` (rank by real part)
and ``entry`` (which second derivative). A map over two parameters also holds its fold curves, cusps and
vanishing-damping curves, point after point, ``fold_curve`` and ``unreached_curve`` numbering them; a map over
one its folds.

A fold curve is found where it separates points of the grid: an island of six equilibria (or of four) that
lies between the points, parting no two neighbours, is not seen. A finer grid sees it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from fastmech.atlas.axes import refuse_decaying_load
from fastmech.atlas.map import Slab, map_equilibria, solve_in_slabs
from fastmech.atlas.sheets import SheetBuilder
from fastmech.errors import InputError
from fastmech.results import Dataset, Variable
from fastmech.scan_types.map_curves import curve_variables
from fastmech.scan_types.map_layout import point_variables, sheet_table, sheet_variables, slot_variables
from fastmech.scan_types.request import RunContext, Scan
from fastmech.scene import Scene, nearest
from fastmech.store.stream import Piece, Stream

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fastmech.store.read import Section

#: Points above which a map is written as it is computed instead of being held in memory.
IN_MEMORY = 1_500_000

#: Points of the largest map: its sheets take 24 bytes a point in memory, its file about 100.
MOST_POINTS = 50_000_000


class Axis(BaseModel):
    """Evenly spaced values of a parameter, ends included."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    start: float
    stop: float
    num: Annotated[int, Field(ge=1, le=100_000)]


def _known_parameters(axes: dict[str, Axis]) -> dict[str, Axis]:
    for name in axes:
        if name not in Scene.model_fields:
            raise ValueError(f"unknown parameter {name!r}; {nearest(name, list(Scene.model_fields))}")
    return axes


def _known_variables(names: list[str]) -> list[str]:
    known = list(point_variables(("x",), Slab.empty(1)))
    for name in names:
        if name not in known:
            raise ValueError(f"unknown variable {name!r}; {nearest(name, known)}")
    return names


class EquilibriumMap(Scan):
    """Every equilibrium at every point of a grid of parameters, with the proof that none is missing."""

    kind: ClassVar[str] = "equilibrium_map"

    axes: Annotated[dict[str, Axis], Field(min_length=1, max_length=3), AfterValidator(_known_parameters)]
    variables: Annotated[list[str], AfterValidator(_known_variables)] | None = Field(
        None, description="what to keep of every point (all by default); large maps are smaller with less"
    )

    def check(self, scene: Scene) -> None:
        """Every value of every axis must be one the scene accepts, and every axis must matter."""
        refuse_decaying_load(scene, self.axes)
        total = math.prod(axis.num for axis in self.axes.values())
        if total > MOST_POINTS:
            raise InputError(f"axes: ask for {total:.3g} points, at most {MOST_POINTS:.0e} are allowed")
        for name, axis in self.axes.items():
            for value in (axis.start, axis.stop):
                scene.replace(**{name: value})

    def run(self, scene: Scene, context: RunContext) -> Dataset | Stream:
        """Search the grid; the force is the one at rest (F0 where alpha = 0)."""
        axes = {name: np.linspace(axis.start, axis.stop, axis.num) for name, axis in self.axes.items()}
        total = int(np.prod([values.size for values in axes.values()]))
        fixed = {
            name: Variable((name,), values, *scene.described()[name][1:]) for name, values in axes.items()
        }
        fixed |= curve_variables(scene, axes, context.threads)
        fixed |= slot_variables(self.variables)
        attrs = {
            "axes": tuple(axes),
            "layout": "six slots along root, the deepest first; beyond count NaN, codes -1",
            "curves": "all fold curves that part neighbouring points; islands between them are not seen",
        }
        if total > IN_MEMORY:
            return self._stream(scene, axes, total, context, Dataset(fixed, attrs))
        advance = context.stage("equilibrium map", total)
        found = map_equilibria(scene, axes, wells=self._wells, threads=context.threads, progress=advance)
        variables = self._kept(point_variables(tuple(axes), found))
        variables |= sheet_variables(tuple(axes), found.sheet)
        variables |= sheet_table(found.sheet_morse_index, found.sheet_branch, found.sheet_breaks)
        return Dataset({**fixed, **variables}, attrs)

    @property
    def _wells(self) -> bool:
        return self.variables is None or bool({"depth", "escape_speed"} & set(self.variables))

    def _kept(self, variables: dict[str, Variable]) -> dict[str, Variable]:
        if self.variables is None:
            return variables
        return {name: variable for name, variable in variables.items() if name in self.variables}

    def _stream(
        self, scene: Scene, axes: dict[str, np.ndarray], total: int, context: RunContext, fixed: Dataset
    ) -> Stream:
        grid = tuple(len(values) for values in axes.values())
        names = tuple(axes)

        def shaped(slab: Slab, planes: int) -> dict[str, Variable]:
            arrays = {name: a.reshape(planes, *grid[1:], *a.shape[1:]) for name, a in vars(slab).items()}
            return self._kept(point_variables(names, Slab(**arrays)))

        def pieces() -> Iterator[Piece]:
            advance = context.stage("equilibrium map", total)
            builder = SheetBuilder(scene, axes)

            def place(rows: slice) -> Slab:
                return Slab.empty(rows.stop - rows.start)

            for planes, slab in solve_in_slabs(
                scene, axes, builder, place, self._wells, context.threads, advance
            ):
                variables = shaped(slab, planes.stop - planes.start)
                yield planes, {name: variable.data for name, variable in variables.items()}
            sheets = builder.finish()
            start = 0
            for sheet in sheets.labels:
                piece = sheet.reshape(-1, *grid[1:], sheet.shape[-1])
                yield slice(start, start + len(piece)), {"sheet": piece}
                start += len(piece)
            yield Dataset(sheet_table(sheets.morse_index, sheets.branch, sheets.breaks))

        one = shaped(Slab.empty(int(np.prod(grid[1:]))), 1)
        one |= sheet_variables(names, np.zeros((1, *grid[1:], 6), dtype=np.int32))
        return Stream(fixed, one, names[0], pieces)

    @staticmethod
    def read(section: Section, scene: Mapping[str, float]) -> Dataset:
        """What is drawn of the map, whatever its size."""
        from fastmech.plots.map_view import load_drawn

        return load_drawn(section, scene)

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Counts, positions, barriers and slowest decay over the parameters, with the curves on top."""
        from fastmech.plots.equilibrium_map import draw_equilibrium_map

        return draw_equilibrium_map(dataset, scene)
