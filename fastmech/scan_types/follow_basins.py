"""Attractors and their shares of the starts along a parameter, and where they come and go.

Layout: ``share`` over the parameter and ``attractor``; with a second parameter over that first. In a group of
its own: ``tipping``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from pydantic import Field

from fastmech.arrays import Floats
from fastmech.attractors.follow import AttractorPlace, BasinsAlong, BasinsOver, Tipping, follow_basins, joined
from fastmech.ensembles.system import System
from fastmech.errors import InputError
from fastmech.models.mechanism import Mechanism
from fastmech.plots.response import draw_shares
from fastmech.results import Dataset, Variable, columns, numbers, told
from fastmech.scan_types import request as scans
from fastmech.scan_types.attractors import Lines
from fastmech.scan_types.map_layout import one_of

#: Points of an attractor that lines are joined by, at most.
POINTS = 512


class FollowBasins(Lines):
    """Attractors along a parameter, matched from value to value."""

    kind: ClassVar[str] = "follow_basins"
    draw = staticmethod(draw_shares)
    taken = frozenset({"share", "attractor", "tipping"})

    along: dict[str, scans.Axis] = Field(
        min_length=1, max_length=1, description="the parameter and its values"
    )
    n: int = Field(1000, ge=1, le=1_000_000, description="how many starts")

    def check(self, scene: Mechanism | System) -> None:  # type: ignore[override]
        """Parameters must be known."""
        super().check(scene)
        scans.check_names("along.", self.along, scene.parameters, "unknown parameter")
        scans.check_rising("along.", self.along)
        ((name, axis),) = self.along.items()
        if axis.size < 2:
            raise InputError(f"along.{name}: must have two values or more")
        self.over(scene, self.along)

    def tiling(self, scene: Mechanism | System) -> scans.Tiling:  # type: ignore[override]
        """A tile for each value of the second parameter."""
        ((name, values),) = scans.values_of(self.along).items()
        starts = self.drawn(scene, self.n)

        def line(changed: Mechanism | System) -> Dataset:
            found = follow_basins(changed, name, values, starts, t_end=self.t_end)
            assert isinstance(found, BasinsAlong)
            return _tile(found)

        def join(tiles: list[Dataset]) -> Dataset:
            lines = [_read(tile, name, values, len(starts)) for tile in tiles]
            for second, axis in self.each.items():
                return basins_dataset(joined(scene, second, axis.array, lines, starts).of(scene))
            return basins_dataset(lines[0].of(scene))

        return self.lines(scene, line, join)


def basins_dataset(found: BasinsAlong | BasinsOver) -> Dataset:
    """The section of attractors along a parameter, or over two."""
    lines: Sequence[BasinsAlong] = [found] if isinstance(found, BasinsAlong) else found.lines
    name, axes = lines[0].parameter, {lines[0].parameter: lines[0].values}
    tips: dict[str, Sequence[Sequence[Tipping]]] = {name: [one.tipping for one in lines]}
    if isinstance(found, BasinsOver):
        axes = {found.second: found.values, **axes}
        tips[found.second] = found.tipping
    where = scans.axis_variables(found.system, axes)
    dims = tuple(where)
    share = np.stack([one.fractions for one in lines])
    most = share.shape[2]
    rows = _tipping([t for own in tips.values() for line in own for t in line])
    line = [np.repeat(np.arange(len(own)), [len(one) for one in own]) for own in tips.values()]
    along = np.repeat(np.array(list(tips), dtype=object), [len(one) for one in line])
    unlabelled = np.stack([one.unlabelled for one in lines])
    shape = tuple(len(where[d].data) for d in dims)
    unit = one_of(where[one].units for one in tips)
    kinds = np.where(rows[:, 1] == 1.0, "born", "dies").astype(object)
    changes = {
        "tipping_along": (along, "1", "parameter along which it happens"),
        "tipping_line": (np.concatenate(line).astype(np.int32), "1", "index of the other one's value"),
        "tipping_attractor": (rows[:, 0].astype(np.int32), "1", "number of the attractor"),
        "tipping_kind": (kinds, "1", "born or dies in the order of the values"),
        "tipping_low": (rows[:, 2], unit, "it happens above, in its parameter's unit"),
        "tipping_high": (rows[:, 3], unit, "it happens below, in its parameter's unit"),
    }
    tipping = numbers("tipping", len(rows), "number of the change") | columns(("tipping",), changes)
    ends, about = share.reshape(*shape, most), "share of the starts that end there, NaN: it is not there"
    none = unlabelled.reshape(shape)
    variables = {
        **where,
        **numbers("attractor", most, "number of the attractor, the same where it goes on"),
        "share": Variable((*dims, "attractor"), ends, "1", about),
        "unlabelled": Variable(dims, none, "1", "share of the starts without a label"),
    }
    attrs = {"along": name, "starts": lines[0].starts, **told(found.system)}
    return Dataset(variables, attrs, {"tipping": Dataset(tipping)})


def _tipping(tipping: Sequence[Tipping]) -> Floats:
    rows = [[t.attractor, t.kind == "born", t.low, t.high] for t in tipping]
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def _tile(found: BasinsAlong) -> Dataset:
    """A line; of each attractor at most so many points as it is recognised by."""
    places = [(i, j, one) for i, there in enumerate(found.attractors) for j, one in there.items()]
    points = [one.points[:: -(-len(one.points) // POINTS)] for *_, one in places]
    rows = [(i, j, one.period or 0.0, len(own)) for (i, j, one), own in zip(places, points, strict=True)]
    arrays = {"share": found.fractions, "unlabelled": found.unlabelled, "tipping": _tipping(found.tipping)}
    every = np.concatenate([np.empty((0, len(found.system.state))), *points])
    return scans.tile_of(
        arrays | {"places": np.array(rows, dtype=np.float64).reshape(-1, 4), "points": every}
    )


def _read(tile: Dataset, name: str, values: Floats, n: int) -> BasinsAlong:
    """The same from a tile."""
    there: tuple[dict[int, AttractorPlace], ...] = tuple({} for _ in values)
    rows = tile["places"].data
    ends = np.cumsum(rows[:, 3].astype(np.int64))
    for (i, j, period, count), end in zip(rows.tolist(), ends.tolist(), strict=True):
        there[int(i)][int(j)] = AttractorPlace(tile["points"].data[end - int(count) : end], period or None)
    tipping = tuple(
        Tipping(int(j), "born" if born else "dies", low, high) for j, born, low, high in tile["tipping"].data
    )
    shares, rest = tile["share"].data, tile["unlabelled"].data
    return BasinsAlong(name, values, shares, rest, there, tipping=tipping, starts=n)
