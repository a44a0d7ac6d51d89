"""Attractors and their shares of the starts along a parameter, and where they come and go.

Layout: ``share`` over the parameter and ``attractor``; with a second parameter over that first, and
attractors keep their numbers along the first one only. In a group of its own: ``tipping``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import Field

from fastmech.attractors.follow import BasinsAlong, Tipping, follow_basins
from fastmech.ensembles.system import System
from fastmech.models.mechanism import Mechanism
from fastmech.results import Dataset, Variable, numbers, told
from fastmech.scan_types.attractors import Starts, lines_over, parameter_of, shared_axes
from fastmech.scan_types.request import Axis, Tiling

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The dimension of rows in a tile.
ROW = ("row",)


class FollowBasins(Starts):
    """Attractors along a parameter, matched from value to value."""

    kind: ClassVar[str] = "follow_basins"
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
        most = max(tile.sizes["attractor"] for tile in tiles)
        share = np.full((len(tiles), values.size, most), np.nan)
        for k, tile in enumerate(tiles):
            share[k, :, : tile.sizes["attractor"]] = tile["share"].data
        rows = np.concatenate([tile["tipping"].data for tile in tiles])
        line = np.repeat(np.arange(len(tiles), dtype=np.int32), [tile.sizes["row"] for tile in tiles])
        unlabelled = np.stack([tile["unlabelled"].data for tile in tiles])
        shape = tuple(len(where[d].data) for d in dims)
        each, unit = ("tipping",), where[name].units
        kinds = np.where(rows[:, 1] == 1.0, "born", "dies").astype(object)
        return Dataset(
            {
                **where,
                **numbers("attractor", most, f"number of the attractor, the same along {name}"),
                "share": Variable(
                    (*dims, "attractor"),
                    share.reshape(*shape, most),
                    "1",
                    "share of the starts that end there, NaN: it is not there",
                ),
                "unlabelled": Variable(
                    dims, unlabelled.reshape(shape), "1", "share of the starts without a label"
                ),
            },
            {"along": name, "starts": self.n, **told(scene)},
            {
                "tipping": Dataset(
                    {
                        **numbers("tipping", len(rows), "number of the change"),
                        "tipping_line": Variable(each, line, "1", "index of the second parameter's value"),
                        "tipping_attractor": Variable(
                            each, rows[:, 0].astype(np.int32), "1", "number of the attractor"
                        ),
                        "tipping_kind": Variable(each, kinds, "1", f"born or dies as {name} rises"),
                        "tipping_low": Variable(each, rows[:, 2], unit, "it happens above"),
                        "tipping_high": Variable(each, rows[:, 3], unit, "it happens below"),
                    }
                )
            },
        )

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Shares stacked over the parameter; of a second one's first, middle and last values."""
        from fastmech.plots.response import draw_lines

        name = str(dataset.attrs["along"])
        share, unlabelled = dataset["share"].data, dataset["unlabelled"].data
        if share.ndim == 2:
            share, unlabelled = share[None], unlabelled[None]
        tips, owner = dataset.groups["tipping"], dataset.groups["tipping"]["tipping_line"].data

        def line(k: int) -> BasinsAlong:
            rows = np.flatnonzero(owner == k)
            tipping = [
                Tipping(
                    int(tips["tipping_attractor"].data[i]),
                    str(tips["tipping_kind"].data[i]),
                    float(tips["tipping_low"].data[i]),
                    float(tips["tipping_high"].data[i]),
                )
                for i in rows
            ]
            there = np.isfinite(share[k]).any(axis=0)
            return BasinsAlong(
                name, dataset[name].data, share[k][:, there], unlabelled[k], (), tuple(tipping)
            )

        return {"shares": draw_lines(dataset, scene, line, len(share))}


def along_dataset(found: BasinsAlong) -> Dataset:
    """The section of attractors along a parameter."""
    along = {found.parameter: Axis(values=found.values.tolist())}
    made = FollowBasins.model_construct(along=along, each={})._joined(found.system, [_line(found)])
    attrs = {name: value for name, value in made.attrs.items() if name != "starts"}  # it does not know them
    return Dataset(made.variables, attrs, made.groups)


def _line(found: BasinsAlong) -> Dataset:
    tipping = np.array([[t.attractor, t.kind == "born", t.low, t.high] for t in found.tipping])
    return Dataset(
        {
            "share": Variable((found.parameter, "attractor"), found.fractions),
            "unlabelled": Variable((found.parameter,), found.unlabelled),
            "tipping": Variable((*ROW, "column"), tipping.reshape(-1, 4)),
        }
    )
