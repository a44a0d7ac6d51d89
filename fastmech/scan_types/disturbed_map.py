"""Disturbed ensembles of every equilibrium at every point of a grid of parameters, one tile an equilibrium.

Layout: arrays over the grid and ``sheet``, NaN where the sheet has no equilibrium; a sheet is one
equilibrium, continued, as the atlas of these axes numbers them (:mod:`fastmech.atlas.sheets`). Each ensemble
is that of ``fm.disturb`` with the scene of its point. The group ``quantiles`` holds those of times to return.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.map import map_equilibria
from fastmech.ensembles.status import FAILURES, failure_counts
from fastmech.equilibria.find import Equilibrium, find_equilibria
from fastmech.errors import InputError
from fastmech.results import Dataset, Variable, numbers
from fastmech.scan_types.disturbed_tiling import ABOUT_QUANTILES, ABOUT_SHARES, QUANTILE, QUANTILES
from fastmech.scan_types.request import counted_failures
from fastmech.scan_types.tally import Tally
from fastmech.scan_types.tiling import RunContext, Tiles, Tiling
from fastmech.scene import Scene

if TYPE_CHECKING:
    from fastmech.scan_types.disturbed import Disturbed

Floats = NDArray[np.float64]

#: Points of the largest map, and trajectories of each equilibrium there at most: a tile takes seconds.
MOST_POINTS, MOST_TRAJECTORIES = 100_000, 65_536

#: What a tile holds: length, unit and meaning. What has not been computed is NaN.
_MEASURED: dict[str, tuple[tuple[str, ...], str, str]] = {
    **{name: ((), "1", about) for name, about in ABOUT_SHARES.items()},
    "time_to_return_quantile": (("quantile",), "s", ABOUT_QUANTILES),
    "largest_excursion_phi": ((), "rad", "largest departure of phi of all trajectories"),
    "largest_excursion_theta": ((), "rad", "largest departure of theta of all trajectories"),
    "share_failed": ((), "1", "share whose motion could not be computed"),
}
_LENGTHS = {"quantile": len(QUANTILES)}


class DisturbedMap(Tiling):
    """A tile is one equilibrium at one point; those of a point follow each other.

    Args:
        request: how to compute.
        scene: gives every parameter that is no axis.
        axes: parameter names with their values.
    """

    what = "disturbed trajectories"

    def __init__(self, request: Disturbed, scene: Scene, axes: Mapping[str, Floats]) -> None:
        self.request, self.scene, self.axes = request, scene, dict(axes)
        self.atlas = map_equilibria(scene, axes)
        self.entries = np.argwhere(self.atlas.sheet >= 0)
        self.count = len(self.entries)

    def items(self, index: int) -> int:
        """Trajectories."""
        return self.request.trajectories

    def compute(self, index: int, context: RunContext) -> Dataset:
        """Disturb one equilibrium; where its scene is refused, all that is kept is the reason."""
        request, (scene, equilibrium) = self.request, self._place(index)
        try:
            found = request.ensemble(scene, equilibrium, context)
        except InputError as refused:
            return self._tile({}, {"refused": str(refused)})
        tally, failed = Tally.of(found.outcome, found.time_to_return), np.isin(found.outcome, FAILURES)
        farthest = np.full(2, np.nan) if failed.all() else found.excursion[~failed].max(axis=0)
        measured: dict[str, Any] = {
            **tally.shares(),
            "time_to_return_quantile": tally.quantiles(QUANTILES),
            "largest_excursion_phi": farthest[0],
            "largest_excursion_theta": farthest[1],
            "share_failed": failed.mean(),
        }
        return self._tile(measured, failure_counts(found.outcome, FAILURES))

    def assemble(self, tile: Tiles) -> Dataset:
        """Put every equilibrium in its sheet's place."""
        atlas, names = self.atlas, tuple(self.axes)
        grid = (*atlas.sheet.shape[:-1], atlas.sheet_morse_index.size)
        at = tuple(self.entries[:, :-1].T)
        slot = (*at, self.entries[:, -1])
        place = (*at, atlas.sheet[slot])
        tiles = [tile(index) for index in range(self.count)]

        def over_map(values: Any, dims: tuple[str, ...], unit: str, about: str) -> Variable:
            array = np.full((*grid, *(_LENGTHS[dim] for dim in dims)), np.nan)
            array[place] = values
            return Variable((*names, "sheet", *dims), array, unit, about)

        described = self.scene.described()
        variables = {name: Variable((name,), line, *described[name][1:]) for name, line in self.axes.items()}
        about = "equilibrium, continued, as the atlas of these axes numbers them"
        variables |= numbers("sheet", grid[-1], about)
        about = "negative eigenvalues of the Hessian all over a sheet, 0: stable"
        sheet_index = Variable(("sheet",), atlas.sheet_morse_index, "1", about)
        quantiles = {**variables, "quantile": QUANTILE}
        variables["sheet_morse_index"] = sheet_index
        for angle in ("phi", "theta"):
            about = f"angle {angle} of the disturbed equilibrium"
            variables[angle] = over_map(getattr(atlas, angle)[slot], (), "rad", about)
        for name, (dims, unit, about) in _MEASURED.items():
            values = np.array([one[name].data for one in tiles]).reshape(len(tiles), *map(_LENGTHS.get, dims))
            (quantiles if dims else variables)[name] = over_map(values, dims, unit, about)
        refused = [str(one.attrs["refused"]) for one in tiles if "refused" in one.attrs]
        counts = {
            k.name.lower(): sum(int(one.attrs.get(k.name.lower(), 0)) for one in tiles) for k in FAILURES
        }
        attrs = {**self.request.settings, "axes": names, "refused": len(refused)}
        attrs |= {"refused_first": refused[0]} if refused else {}
        followed = self.request.trajectories * (len(tiles) - len(refused))
        attrs |= counted_failures({k: n for k, n in counts.items() if n}, followed)
        return Dataset(variables, attrs, {"quantiles": Dataset(quantiles)})

    def missing(self, index: int) -> Dataset:
        """An equilibrium that has not been disturbed."""
        return self._tile({}, {})

    def _place(self, index: int) -> tuple[Scene, Equilibrium]:
        """The scene of a tile's point, and which of its equilibria is the tile's."""
        *at, _ = entry = tuple(self.entries[index])
        values = {name: float(line[k]) for (name, line), k in zip(self.axes.items(), at, strict=True)}
        scene = self.scene.replace(**values)
        equilibria = find_equilibria(scene)
        apart = np.hypot(
            np.sin(0.5 * (equilibria.phi - self.atlas.phi[entry])),
            np.sin(0.5 * (equilibria.theta - self.atlas.theta[entry])),
        )
        return scene, equilibria[int(apart.argmin())]

    @staticmethod
    def _tile(measured: Mapping[str, Any], attrs: Mapping[str, Any]) -> Dataset:
        return Dataset(
            {
                name: Variable(
                    dims, np.broadcast_to(measured.get(name, np.nan), [_LENGTHS[dim] for dim in dims])
                )
                for name, (dims, _, _) in _MEASURED.items()
            },
            attrs,
        )
