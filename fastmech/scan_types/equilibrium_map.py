"""Equilibria over one to three parameters: how many, how many stable, where, how deep, how fast they settle.

Layout: a point has four or six equilibria, and six slots along ``root``, the deepest equilibrium first;
slots beyond ``count`` hold NaN in numbers and -1 in codes, which is their ``_FillValue``. So reductions over
``root`` that skip NaN need no mask, and ``map.phi.where(map.morse_index == 0)`` leaves the stable ones.
``sheet`` says which slots of different points are one equilibrium, continued:
``map.phi.where(map.sheet == 3).max("root")`` is one of them over the whole map. Coordinates: the axes in
their units and ``root`` (rank by energy), so that a table of the map has a row for each slot of each point.
What has other dimensions is a group. ``sheets``: ``sheet_branch`` says which sheets continue one another
round a cusp, ``sheet_break`` where a sheet is torn. ``curves``, of a map over two parameters: its fold
curves, cusps and vanishing-damping curves, point after point, ``fold_curve`` and ``unreached_curve``
numbering them; of a map over one its folds.

Folds do not depend on the grid: ``fold_proof`` tells that none is missing, or where that is not proved;
``fold_kind`` names folds and the pitchforks of symmetric scenes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar

from pydantic import AfterValidator, Field

from fastmech.atlas.axes import refuse_decaying_load
from fastmech.atlas.map import Slab
from fastmech.errors import shown
from fastmech.results import Dataset, Variable
from fastmech.scan_types.axis import Axis, arrays, check_parameters, check_size
from fastmech.scan_types.map_layout import TOGETHER, point_variables
from fastmech.scan_types.map_tiling import MapTiling
from fastmech.scan_types.request import TiledScan
from fastmech.scan_types.tiling import Tiling
from fastmech.scene import Scene, nearest

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fastmech.store.read import Section

#: Points of the largest map: its sheets take 24 bytes a point in memory, its file about 100.
MOST_POINTS = 50_000_000

#: Numbers of 8 bytes that memory holds of every point of a map, and of every point that is being solved.
SHEET_NUMBERS, POINT_NUMBERS = 3, 250


def known_parameters(axes: dict[str, Axis]) -> dict[str, Axis]:
    """Refuse axes that are no parameters of a scene, or too many."""
    if len(axes) > 3:
        raise ValueError("must be three axes at most")
    for name in axes:
        if name not in Scene.model_fields:
            raise ValueError(f"unknown parameter {shown(name)}; {nearest(name, list(Scene.model_fields))}")
    return axes


def _known_variables(names: list[str]) -> list[str]:
    known = [*point_variables(("x",), Slab.empty(1)), *TOGETHER]
    for name in names:
        if name not in known:
            raise ValueError(f"unknown variable {shown(name)}; {nearest(name, known)}")
    return names


class EquilibriumMap(TiledScan):
    """Every equilibrium at every point of a grid of parameters, with the proof that none is missing."""

    kind: ClassVar[str] = "equilibrium_map"

    axes: Annotated[dict[str, Axis], Field(min_length=1), AfterValidator(known_parameters)]
    variables: Annotated[list[str], AfterValidator(_known_variables)] | None = Field(
        None, description="what to keep of every point (all by default); large maps are smaller with less"
    )

    def check(self, scene: Scene) -> None:
        """Every value of every axis must be one the scene accepts, and every axis must matter."""
        refuse_decaying_load(scene, self.axes)
        check_parameters(scene, self.axes, "axes")
        check_size("axes", self.axes, "points", MOST_POINTS, SHEET_NUMBERS)
        first, *others = self.axes
        plane = {name: self.axes[name] for name in others} or {first: self.axes[first]}
        if others:
            check_size("axes", plane, f"points in a plane of {first}", MOST_POINTS, POINT_NUMBERS)

    def tiling(self, scene: Scene) -> Tiling:
        """Planes of the first axis, and the curves as a tile of their own."""
        return MapTiling(self, scene, arrays(self.axes))

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
        wanted = {one for name in self.variables for one in TOGETHER.get(name, (name,))}
        return {name: variable for name, variable in variables.items() if name in wanted}

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
