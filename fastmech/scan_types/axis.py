"""Axes of requests: values one by one, or evenly spaced ones, and what may not be asked of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from fastmech.arrays import Floats
from fastmech.basins.ladder import SUBSTEPS
from fastmech.basins.measures.norm import check_angles
from fastmech.basins.runs import rounds_until
from fastmech.capture.steps import fastest_followed, shortest_step
from fastmech.ensembles import checks
from fastmech.ensembles.lanes import MOST_STEPS
from fastmech.errors import InputError, shown
from fastmech.mechanism.coefficients import reduce
from fastmech.models.mechanism import Mechanism
from fastmech.results import ANGLE_UNITS, Variable
from fastmech.scene import STATE, Number, Scene, nearest

#: Values of the longest axis.
MOST_VALUES = 100_000

Value = Annotated[Number, Field(strict=True, allow_inf_nan=False)]


class Axis(BaseModel):
    """Values that rise or fall throughout: ``values``, or ``num`` from ``start`` to ``stop``."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    start: Value | None = None
    stop: Value | None = None
    num: Annotated[int, Field(ge=1, le=MOST_VALUES)] | None = None
    spacing: Literal["linear", "log"] = "linear"
    values: Annotated[list[Value], Field(min_length=1, max_length=MOST_VALUES)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _one_of_both(cls, given: Any) -> Any:
        if not isinstance(given, Mapping):
            raise ValueError("must be a table { start, stop, num } or { values = [...] }")
        if "values" in given:
            beside = [name for name in ("start", "stop", "num", "spacing") if name in given]
            if beside:
                raise ValueError(f"values say all; leave out {', '.join(beside)}")
        else:
            missing = [name for name in ("start", "stop", "num") if name not in given]
            if missing:
                raise ValueError(f"{missing[0]} is missing; give start, stop and num, or values")
        return given

    @model_validator(mode="after")
    def _rise_or_fall(self) -> Axis:
        if self.values is None and self.spacing == "log":
            assert self.start is not None
            assert self.stop is not None
            if not (min(self.start, self.stop) > 0.0 or max(self.start, self.stop) < 0.0):
                raise ValueError("start and stop must have one sign and not be 0 where spacing is log")
        steps = np.diff(self.array)
        if not ((steps > 0.0).all() or (steps < 0.0).all()):
            raise ValueError("must rise or fall throughout, no value twice")
        return self

    @property
    def array(self) -> Floats:
        """The values."""
        if self.values is not None:
            return np.array(self.values, dtype=np.float64)
        spaced: Any = np.geomspace if self.spacing == "log" else np.linspace
        return np.asarray(spaced(self.start, self.stop, self.num), dtype=np.float64)

    @property
    def rises(self) -> bool:
        """Whether the values rise."""
        values = self.array
        return bool(values[-1] >= values[0])

    @property
    def size(self) -> int:
        """How many they are."""
        return self.num or len(self.values or ())


def arrays(axes: Mapping[str, Axis]) -> dict[str, Floats]:
    """The values of axes by their names."""
    return {name: axis.array for name, axis in axes.items()}


def axis_variables(system: Scene | Mechanism, axes: Mapping[str, Floats]) -> dict[str, Variable]:
    """Axes over parameters as the coordinates of a section."""
    described = system.described()
    return {name: Variable((name,), values, *described[name][1:]) for name, values in axes.items()}


def coordinate_units(system: Scene | Mechanism) -> dict[str, str]:
    """Names of coordinates with their units."""
    if isinstance(system, Scene):
        return dict(ANGLE_UNITS)
    names = system.state[: len(system.coordinates)]
    return {name: "m" if name in system.lengths else "rad" for name in names}


def state_units(system: Scene | Mechanism) -> dict[str, str]:
    """Names of coordinates, then of rates, with their units."""
    units = coordinate_units(system)
    return units | {f"{name}_dot": f"{unit}/s" for name, unit in units.items()}


def told(system: Scene | Mechanism) -> dict[str, Any]:
    """What a section says of a mechanism that is not the paper's."""
    if isinstance(system, Scene):
        return {}
    return {"mechanism": system.name, "coordinate_names": tuple(coordinate_units(system))}


def known_parameters(system: Scene | Mechanism, axes: Mapping[str, Axis]) -> None:
    """Refuse axes that are no parameters, or too many.

    Raises:
        InputError: they are.
    """
    known = list(system.described())
    if len(axes) > 3:
        raise InputError("axes: must be three axes at most")
    for name in axes:
        if name not in known:
            raise InputError(f"axes.{name}: unknown parameter {shown(name)}; {nearest(name, known)}")


def check_size(where: str, axes: Mapping[str, Axis], what: str, most: int, numbers: int) -> None:
    """Refuse grids of more points than can be, or than fit into memory at so many ``numbers`` a point.

    Raises:
        InputError: there are too many.
    """
    total = math.prod(axis.size for axis in axes.values())
    if total > most:
        raise InputError(f"{where}: ask for {total:.3g} {what}, at most {most:.0e} are allowed")
    checks.memory(total * numbers, 1, f"{where}: {total:.3g} {what}", f"fewer {what}")


def check_steps(where: str, t_end: float, dt: float) -> None:
    """Refuse runs of more fixed steps than are possible, with half the step too.

    Raises:
        InputError: they take more.
    """
    if not 2.0 * t_end <= MOST_STEPS * dt:
        raise InputError(
            f"{where} = {t_end:g} s: takes {t_end / dt:.3g} steps of {dt:g} s, at most {MOST_STEPS / 2:.0e} "
            "are possible"
        )


def check_duration(scene: Scene, t_end: float, dt: float | None) -> None:
    """Refuse runs of basins whose finest computation would take more steps than are possible.

    Raises:
        InputError: it would.
    """
    coarse = shortest_step(reduce(scene)) if dt is None else dt
    rounds_until(t_end, coarse * SUBSTEPS[0] / SUBSTEPS[-1])


def check_rising(name: str, axis: Axis) -> None:
    """Refuse an axis whose values fall.

    Raises:
        InputError: they do.
    """
    if not axis.rises:
        raise InputError(
            f"{name}: falls from {axis.array[0]:g} to {axis.array[-1]:g}, must rise; "
            "give its values the other way round"
        )


def check_parameters(scene: Scene | Mechanism, axes: Mapping[str, Axis], where: str) -> None:
    """Refuse values that the scene does not accept: what it allows of a parameter is an interval.

    Raises:
        InputError: it does not.
    """
    for name, axis in axes.items():
        for value in (axis.array.min(), axis.array.max()):
            try:
                scene.replace(**{name: float(value)})
            except InputError as error:
                raise InputError(f"{where}.{name}: {error}") from None


def check_starts(scene: Scene, starts: Mapping[str, Floats]) -> None:
    """Refuse angles that must be degrees, and rates that no step of a basin map can follow.

    Args:
        scene: the mechanism.
        starts: values of coordinates [rad, rad/s] by where the request has them, such as ``axes.phi``.

    Raises:
        InputError: an angle or a rate is too large.
    """
    fastest = fastest_followed(reduce(scene))
    for where, values in starts.items():
        largest, name = float(np.abs(values).max()), where.rpartition(".")[2]
        check_angles(where, name, values)
        if name in STATE[2:] and largest > fastest:
            raise InputError(f"{where} = {largest:g} rad/s: steps follow {fastest:.3g} rad/s here at most")
