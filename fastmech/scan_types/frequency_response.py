"""Branches of periodic motion over a parameter, such as the frequency of a load.

Layout: in the group ``points`` one row for each point of each branch, in order along it; in ``special`` the
folds, branch points, period doublings and Neimark-Sacker points.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from fastmech.attractors.branches import KINDS, FrequencyResponse, frequency_response
from fastmech.ensembles import checks
from fastmech.ensembles.system import System
from fastmech.models.mechanism import Mechanism
from fastmech.objects import state_units
from fastmech.plots.response import draw_frequency_response
from fastmech.results import Dataset, Variable, columns, numbers, told
from fastmech.scan_types.attractors import Lines, Range
from fastmech.scan_types.request import Tiling, tile_of


class FrequencyResponseScan(Lines):
    """Periodic motions, stable and unstable, over a range of a parameter."""

    kind: ClassVar[str] = "frequency_response"
    draw = staticmethod(draw_frequency_response)
    taken = frozenset({"point", "special", "branch", "line"})

    parameter: str
    between: Range = Field(description="least and greatest value [the parameter's unit]")
    periods: int = Field(1, ge=1, le=1024, description="of the load, of a motion")
    n: int = Field(64, ge=1, le=100_000, description="starts that look for branches")

    @model_validator(mode="after")
    def _rises(self) -> FrequencyResponseScan:
        if not self.between[0] < self.between[1]:
            raise ValueError(f"between = {self.between}: must rise")
        return self

    def check(self, scene: Mechanism | System) -> None:  # type: ignore[override]
        """Parameters must be known."""
        super().check(scene)
        checks.one_of("parameter", self.parameter, scene.parameters)
        self.over(scene, {})

    def tiling(self, scene: Mechanism | System) -> Tiling:  # type: ignore[override]
        """A tile for each value of the second parameter."""
        between, starts = (self.between[0], self.between[1]), self.drawn(scene, self.n)

        def line(changed: Mechanism | System) -> Dataset:
            return _table(frequency_response(changed, self.parameter, between, starts, periods=self.periods))

        return self.lines(scene, line, lambda tiles: self._joined(scene, tiles))

    def _joined(self, scene: Mechanism | System, tiles: list[Dataset]) -> Dataset:
        units, dim = state_units(scene), len(scene.state)
        unit = scene.described()[self.parameter][1]

        def joined(name: str) -> NDArray[np.float64]:
            rows = [np.insert(tile[name].data, 0, k, axis=1) for k, tile in enumerate(tiles)]
            return np.concatenate(rows)

        points, special = joined("points"), joined("special")
        groups = {}
        for name, rows in (("points", points), ("special", special)):
            own = name.removesuffix("s")
            about = "half of the range of {} over a period"
            line, branch = rows[:, :2].T.astype(np.int32)
            table = {
                f"{own}_line": (line, "1", "index of the second parameter's value"),
                f"{own}_branch": (branch, "1", "number of the branch"),
                f"{own}_value": (rows[:, 2], unit, f"value of {self.parameter}"),
                f"{own}_place": (rows[:, 3 : 3 + dim], units, "{} when a period begins"),
                f"{own}_amplitude": (rows[:, 3 + dim : 3 + 2 * dim], units, about),
            }
            groups[name] = numbers(own, len(rows), "number") | columns((own,), table)
        rest = points[:, 3 + 2 * dim :]
        turns, multipliers = rest[:, 5 : 5 + dim], rest[:, 5 + dim :].reshape(-1, dim, 2)
        looks = {
            "point_turns": (turns, dict.fromkeys(units, "1"), "full turns of {} over a period"),
            "point_closed": (rest[:, 0] == 1.0, "1", "its branch is an isola"),
            "point_cut": (rest[:, 1] == 1.0, "1", "its branch goes on beyond an end"),
            "point_far": (rest[:, 2] == 1.0, "1", "its branch goes to infinity"),
            "point_stops": (rest[:, 3] == 1.0, "1", "motions beyond it stop"),
            "point_neutral": (rest[:, 4] == 1.0, "1", "it neither attracts nor repels, within the error"),
        }
        both = {
            "point_multiplier_re": (multipliers[..., 0], "1", "real part of multipliers"),
            "point_multiplier_im": (multipliers[..., 1], "1", "imaginary part"),
        }
        groups["points"] |= columns(("point",), looks) | columns(("point", "multiplier"), both)
        kinds = np.array([KINDS[int(k)] for k in special[:, -1]], dtype=object)
        groups["special"]["special_kind"] = Variable(("special",), kinds, "1", "what happens there")
        attrs = {"parameter": self.parameter, "periods": self.periods, **told(scene)}
        return Dataset(self.over(scene, {}), attrs, {name: Dataset(group) for name, group in groups.items()})


def response_dataset(found: FrequencyResponse) -> Dataset:
    """The section of branches over a parameter."""
    request = FrequencyResponseScan.model_construct(parameter=found.parameter, periods=found.periods, each={})
    return request._joined(found.system, [_table(found)])


def _table(found: FrequencyResponse) -> Dataset:
    """Rows: branch, value, place, amplitude, how it ends, neutral, turns, multipliers; special ones."""
    dim = len(found.names)
    points, special = [np.empty((0, 7 + 5 * dim))], [np.empty((0, 3 + 2 * dim))]
    for k, b in enumerate(found.branches):
        m = len(b.values)
        own = np.tile([float(b.closed), float(b.cut), float(b.far), 0.0, 0.0, *b.turns], (m, 1))
        own[[0, -1], 3] = b.stops
        own[:, 4] = b.neutral
        multipliers = np.stack([b.multipliers.real, b.multipliers.imag], axis=2).reshape(m, -1)
        number = np.full((m, 1), float(k))
        points.append(np.hstack([number, b.values[:, None], b.places, b.amplitudes, own, multipliers]))
        special += [
            np.hstack([k, s.value, s.place, s.amplitude, KINDS.index(s.kind)])[None] for s in b.special
        ]
    return tile_of({"points": np.concatenate(points), "special": np.concatenate(special)})
