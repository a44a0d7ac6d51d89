"""Attractors and their shares of the starts along a parameter, and where they come and go.

Layout: ``share`` over the parameter and ``attractor``; with a second parameter over that first, and
attractors keep their numbers along the first one only. In a group of its own: ``tipping``.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from fastmech.attractors.follow import BasinsAlong, follow_basins
from fastmech.ensembles.system import System
from fastmech.models.mechanism import Mechanism
from fastmech.plots.response import draw_shares
from fastmech.results import Dataset, Variable, columns, numbers, told
from fastmech.scan_types.attractors import Starts, lines_over, parameter_of, shared_axes
from fastmech.scan_types.request import Axis, Tiling, tile_of


class FollowBasins(Starts):
    """Attractors along a parameter, matched from value to value."""

    kind: ClassVar[str] = "follow_basins"
    draw = staticmethod(draw_shares)
    taken = frozenset({"share", "attractor", "tipping"})

    along: Annotated[dict[str, Axis], Field(min_length=1, max_length=1)] = Field(
        description="the parameter and its values"
    )
    each: Annotated[dict[str, Axis], Field(max_length=1)] = Field(
        default={}, description="a second parameter: the same at each of its values"
    )
    n: Annotated[int, Field(ge=1, le=1_000_000)] = Field(1000, description="how many starts")

    def check(self, scene: Mechanism | System) -> None:  # type: ignore[override]
        """Parameters must be known."""
        super().check(scene)
        parameter_of(scene, self.along)
        shared_axes(scene, self.along, self.each)

    def tiling(self, scene: Mechanism | System) -> Tiling:  # type: ignore[override]
        """A tile for each value of the second parameter."""
        name, values = parameter_of(scene, self.along)
        starts = self.drawn(scene, self.n)

        def line(changed: Mechanism | System) -> Dataset:
            return _line(follow_basins(changed, name, values, starts, t_end=self.t_end))

        return lines_over(scene, self.each, "values of the second parameter", line, self._joined)

    def _joined(self, scene: Mechanism | System, tiles: list[Dataset]) -> Dataset:
        ((name, axis),) = self.along.items()
        values = axis.array
        dims, where = shared_axes(scene, self.along, self.each)
        most = max(tile["share"].data.shape[1] for tile in tiles)
        share = np.full((len(tiles), values.size, most), np.nan)
        for k, tile in enumerate(tiles):
            share[k, :, : tile["share"].data.shape[1]] = tile["share"].data
        rows = np.concatenate([tile["tipping"].data for tile in tiles])
        line = np.repeat(np.arange(len(tiles), dtype=np.int32), [len(t["tipping"].data) for t in tiles])
        unlabelled = np.stack([tile["unlabelled"].data for tile in tiles])
        shape = tuple(len(where[d].data) for d in dims)
        each, unit = ("tipping",), where[name].units
        kinds = np.where(rows[:, 1] == 1.0, "born", "dies").astype(object)
        changes = {
            "tipping_line": (line, "1", "index of the second parameter's value"),
            "tipping_attractor": (rows[:, 0].astype(np.int32), "1", "number of the attractor"),
            "tipping_kind": (kinds, "1", f"born or dies as {name} rises"),
            "tipping_low": (rows[:, 2], unit, "it happens above"),
            "tipping_high": (rows[:, 3], unit, "it happens below"),
        }
        tipping = numbers("tipping", len(rows), "number of the change") | columns(each, changes)
        ends, about = share.reshape(*shape, most), "share of the starts that end there, NaN: it is not there"
        none = unlabelled.reshape(shape)
        variables = {
            **where,
            **numbers("attractor", most, f"number of the attractor, the same along {name}"),
            "share": Variable((*dims, "attractor"), ends, "1", about),
            "unlabelled": Variable(dims, none, "1", "share of the starts without a label"),
        }
        attrs = {"along": name, "starts": self.n, **told(scene)}
        return Dataset(variables, attrs, {"tipping": Dataset(tipping)})


def along_dataset(found: BasinsAlong) -> Dataset:
    """The section of attractors along a parameter."""
    along = {found.parameter: Axis(values=found.values.tolist())}
    made = FollowBasins.model_construct(along=along, each={})._joined(found.system, [_line(found)])
    attrs = {name: value for name, value in made.attrs.items() if name != "starts"}  # it does not know them
    return Dataset(made.variables, attrs, made.groups)


def _line(found: BasinsAlong) -> Dataset:
    tipping = np.array([[t.attractor, t.kind == "born", t.low, t.high] for t in found.tipping])
    arrays = {"share": found.fractions, "unlabelled": found.unlabelled, "tipping": tipping.reshape(-1, 4)}
    return tile_of(arrays)
