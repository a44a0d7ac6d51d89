"""Branches of periodic motion over a parameter, such as the frequency of a load.

Layout: in the group ``points`` one row for each point of each branch, in order along it; in ``special`` the
folds, period doublings and Neimark-Sacker points.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from fastmech.attractors.branches import Branch, FrequencyResponse, Special, frequency_response
from fastmech.ensembles.system import System
from fastmech.errors import InputError
from fastmech.models.mechanism import Mechanism
from fastmech.results import Dataset, Variable, numbers, parts, state_units, told
from fastmech.scan_types.attractors import Starts, lines_over, shared_axes
from fastmech.scan_types.request import Axis, Tiling
from fastmech.scene import nearest

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = ("fold", "period doubling", "Neimark-Sacker")


class FrequencyResponseScan(Starts):
    """Periodic motions, stable and unstable, over a range of a parameter."""

    kind: ClassVar[str] = "frequency_response"
    taken = frozenset({"point", "special", "branch", "line"})

    parameter: str
    between: Annotated[list[float], Field(min_length=2, max_length=2)] = Field(
        description="least and greatest value [the parameter's unit]"
    )
    each: Annotated[dict[str, Axis], Field(max_length=1)] = Field(
        default={}, description="a second parameter: the same at each of its values"
    )
    periods: Annotated[int, Field(ge=1, le=1024)] = Field(1, description="of the load, of a motion")
    n: Annotated[int, Field(ge=1, le=100_000)] = Field(64, description="starts that look for branches")

    @model_validator(mode="after")
    def _rises(self) -> FrequencyResponseScan:
        if not self.between[0] < self.between[1]:
            raise ValueError(f"between = {self.between}: must rise")
        return self

    def check(self, scene: Mechanism | System) -> None:  # type: ignore[override]
        """Parameters must be known."""
        super().check(scene)
        if self.parameter not in scene.parameters:
            raise InputError(f"parameter: {nearest(self.parameter, list(scene.parameters))}")
        shared_axes(scene, {}, self.each)

    def tiling(self, scene: Mechanism | System) -> Tiling:  # type: ignore[override]
        """A tile for each value of the second parameter."""
        between, starts = (self.between[0], self.between[1]), self.drawn(scene, self.n)

        def line(changed: Mechanism | System) -> Dataset:
            found = frequency_response(changed, self.parameter, between, starts, periods=self.periods)
            return _table(found)

        return lines_over(scene, self.each, "values of the second parameter", line, self._joined)

    def _joined(self, scene: Mechanism | System, tiles: list[Dataset]) -> Dataset:
        _, where = shared_axes(scene, {}, self.each)
        units, dim = state_units(scene), len(scene.state)
        unit = scene.described()[self.parameter][1]

        def joined(name: str) -> NDArray[np.float64]:
            rows = [np.insert(tile[name].data, 0, k, axis=1) for k, tile in enumerate(tiles)]
            return np.concatenate(rows)

        points, special = joined("points"), joined("special")
        groups = {}
        for name, rows in (("points", points), ("special", special)):
            own = name.removesuffix("s")
            each = (own,)
            groups[name] = {
                **numbers(own, len(rows), "number"),
                f"{own}_line": Variable(
                    each, rows[:, 0].astype(np.int32), "1", "index of the second parameter's value"
                ),
                f"{own}_branch": Variable(each, rows[:, 1].astype(np.int32), "1", "number of the branch"),
                f"{own}_value": Variable(each, rows[:, 2], unit, f"value of {self.parameter}"),
                **parts(f"{own}_place", each, rows[:, 3 : 3 + dim], units, "{} when a period begins"),
                **parts(
                    f"{own}_amplitude",
                    each,
                    rows[:, 3 + dim : 3 + 2 * dim],
                    units,
                    "half of the range of {} over a period",
                ),
            }
        rest = points[:, 3 + 2 * dim :]
        each = ("point",)
        multipliers = rest[:, 2:].reshape(-1, dim, 2)
        groups["points"] |= {
            "point_closed": Variable(each, rest[:, 0] == 1.0, "1", "its branch is an isola"),
            "point_cut": Variable(each, rest[:, 1] == 1.0, "1", "its branch goes on beyond an end"),
            "point_multiplier_re": Variable(
                (*each, "multiplier"), multipliers[..., 0], "1", "real part of multipliers"
            ),
            "point_multiplier_im": Variable(
                (*each, "multiplier"), multipliers[..., 1], "1", "imaginary part"
            ),
        }
        kinds = np.array([KINDS[int(k)] for k in special[:, -1]], dtype=object)
        groups["special"]["special_kind"] = Variable(("special",), kinds, "1", "what happens there")
        attrs = {"parameter": self.parameter, "periods": self.periods, **told(scene)}
        return Dataset(where, attrs, {name: Dataset(group) for name, group in groups.items()})

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Amplitudes of the first coordinate over the parameter; stable solid, unstable dashed."""
        from fastmech.plots.response import draw_lines

        points, special = dataset.groups["points"], dataset.groups["special"]
        names = [n.removeprefix("point_place_") for n in points if n.startswith("point_place_")]
        units = {n: points[f"point_place_{n}"].units for n in names}
        parameter = str(dataset.attrs["parameter"])
        units = {k: u for k, u in {**units, parameter: points["point_value"].units}.items() if u != "1"}
        lines = max(1, *(v.data.size for v in dataset.variables.values()), 1)

        def line(k: int) -> FrequencyResponse:
            mine = np.flatnonzero(points["point_line"].data == k)
            own = points["point_branch"].data[mine]
            branches = []
            for b in np.unique(own):
                at = mine[own == b]
                here = np.flatnonzero(
                    (special["special_line"].data == k) & (special["special_branch"].data == b)
                )
                branches.append(
                    Branch(
                        points["point_value"].data[at],
                        _columns(points, "point_place", names, at),
                        points["point_multiplier_re"].data[at] + 1j * points["point_multiplier_im"].data[at],
                        _columns(points, "point_amplitude", names, at),
                        tuple(
                            Special(
                                str(special["special_kind"].data[i]),
                                float(special["special_value"].data[i]),
                                _columns(special, "special_place", names, np.array([i]))[0],
                                _columns(special, "special_amplitude", names, np.array([i]))[0],
                            )
                            for i in here
                        ),
                        bool(points["point_closed"].data[at[0]]),
                        bool(points["point_cut"].data[at[0]]),
                    )
                )
            periods = int(dataset.attrs["periods"])
            return FrequencyResponse(parameter, tuple(names), units, periods, tuple(branches))

        return {"response": draw_lines(dataset, scene, line, lines)}


def _columns(of: Dataset, name: str, names: list[str], at: NDArray[np.intp]) -> NDArray[np.float64]:
    return np.stack([of[f"{name}_{state}"].data[at] for state in names], axis=1)


def response_dataset(found: FrequencyResponse) -> Dataset:
    """The section of branches over a parameter."""
    request = FrequencyResponseScan.model_construct(parameter=found.parameter, periods=found.periods, each={})
    return request._joined(found.system, [_table(found)])


def _table(found: FrequencyResponse) -> Dataset:
    """Rows: branch, value, place, amplitude, closed, cut and multipliers of points; those of special ones."""
    dim = len(found.names)
    points, special = [np.empty((0, 4 + 4 * dim))], [np.empty((0, 3 + 2 * dim))]
    for k, b in enumerate(found.branches):
        m = len(b.values)
        own = np.tile([float(b.closed), float(b.cut)], (m, 1))
        multipliers = np.stack([b.multipliers.real, b.multipliers.imag], axis=2).reshape(m, -1)
        number = np.full((m, 1), float(k))
        points.append(np.hstack([number, b.values[:, None], b.places, b.amplitudes, own, multipliers]))
        special += [
            np.hstack([k, s.value, s.place, s.amplitude, KINDS.index(s.kind)])[None] for s in b.special
        ]
    return Dataset(
        {
            "points": Variable(("row", "column"), np.concatenate(points)),
            "special": Variable(("change", "of_change"), np.concatenate(special)),
        }
    )
