"""Parts of a section by coordinate, read without the rest."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fastmech.errors import InputError
from fastmech.results import Dataset, Variable

if TYPE_CHECKING:
    from fastmech.store.read import Section

#: What may be asked for along a coordinate: a value, or the values from one to another.
Wanted: TypeAlias = "float | slice"

#: How far beyond an end of an axis a value may lie, in spacings there (rounding allowed for).
BEYOND = 0.5 * (1.0 + 1e-9)


@dataclass(frozen=True)
class Chosen:
    """What a selection takes along one dimension.

    Attributes:
        places: one place, or all those of a range.
        is_range: whether a range was asked for, which keeps the dimension.
        told: what is taken, for the user: ``F0 = 96 N (nearest to 100)``.
    """

    places: NDArray[np.int64]
    is_range: bool
    told: str

    @property
    def hull(self) -> slice:
        """What is read: all from the first place to the last."""
        return slice(int(self.places.min()), int(self.places.max()) + 1)

    def of(self, data: NDArray[Any], axis: int) -> NDArray[Any]:
        """The places themselves of what was read."""
        inside = self.places - self.hull.start
        return data if len(inside) == data.shape[axis] else data.take(inside, axis)


def parse_selections(texts: Iterable[str]) -> dict[str, Wanted]:
    """``NAME=VALUE`` and ``NAME=LOW:HIGH`` as names and what is wanted of them; an end may be left open.

    Raises:
        InputError: not of this form, not a finite number, or a name twice.
    """
    selections: dict[str, Wanted] = {}
    for text in texts:
        name, _, value = text.partition("=")
        low, colon, high = value.partition(":")
        if colon:
            wanted: Wanted = slice(*(_parsed(end, text) if end.strip() else None for end in (low, high)))
        else:
            wanted = _parsed(value, text)
        if name in selections:
            raise InputError(f"--select {text}: {name} is selected twice")
        selections[name] = wanted
    return selections


def _parsed(value: str, text: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"--select {text}: must be NAME=VALUE or NAME=LOW:HIGH with finite numbers")
    return number


def choose(section: Section, wanted: Mapping[str, Any]) -> dict[str, Chosen]:
    """What a selection takes along each dimension; of the section only coordinates are read.

    Raises:
        InputError: an unknown dimension, or a value or range that is none or holds nothing.
    """
    return {dim: _choose(section, dim, value) for dim, value in wanted.items()}


def take(section: Section, chosen: Mapping[str, Chosen], names: Collection[str] | None = None) -> Dataset:
    """The variables of these names, all by default, at what was chosen."""
    variables = list(section) if names is None else list(names)
    for name in variables:
        if name not in section:
            section[name]  # says what there is
    dims = chosen.keys() | {dim for name in variables for dim in section.dims(name)}
    read = {*variables, *(dim for dim in dims if dim in section)}
    part = section.load(read, {dim: one.hull for dim, one in chosen.items()})
    return Dataset({name: _narrowed(v, chosen) for name, v in part.variables.items()}, part.attrs)


def _narrowed(variable: Variable, chosen: Mapping[str, Chosen]) -> Variable:
    """A variable at what was chosen, without the dimensions along which that is one value."""
    data = variable.data
    for axis, dim in enumerate(variable.dims):
        if dim in chosen:
            data = chosen[dim].of(data, axis)
    left = tuple(dim for dim in variable.dims if dim not in chosen or chosen[dim].is_range)
    data = data.squeeze(tuple(axis for axis, dim in enumerate(variable.dims) if dim not in left))
    return Variable(left, data, variable.units, variable.long_name, variable.attrs)


def _choose(section: Section, name: str, wanted: object) -> Chosen:
    if name not in section.sizes:
        known = ", ".join(section.sizes) or "none"
        raise InputError(f"{name}: is no dimension of {section.where}; it has {known}")
    has_values = name in section and section[name].data.dtype.kind in "fiu"
    axis = (
        section[name].data.astype(np.float64) if has_values else np.arange(section.sizes[name], dtype=float)
    )
    units = section[name].units if has_values else "1"
    unit = "" if units == "1" else f" {units}"
    if isinstance(wanted, slice):
        return _within(section, name, axis, unit, wanted)
    value = _number(name, wanted)
    if not has_values and (value != math.floor(value) or not 0 <= value < len(axis)):
        last = len(axis) - 1
        raise InputError(f"{name} = {value:g}: must be one of the places 0 to {last} of {section.where}")
    finite = axis[np.isfinite(axis)]
    reach = _reach(finite)
    if not finite.size or not finite.min() - reach[0] <= value <= finite.max() + reach[1]:
        _refuse(section, name, f"{value:.10g}", finite, unit, ", or at most half a spacing beyond")
    place = int(np.nanargmin(np.abs(axis - value)))
    shown, asked = f"{axis[place]:.10g}", f"{value:.10g}"
    told = f"{name} = {shown}{unit}" + ("" if shown == asked else f" (nearest to {asked})")
    return Chosen(np.array([place]), False, told)


def _within(section: Section, name: str, axis: NDArray[np.float64], unit: str, wanted: slice) -> Chosen:
    """The places whose values lie in a range."""
    if wanted.step is not None:
        raise InputError(f"{name} = {wanted!r}: a range must be slice(low, high) without a step")
    low = -math.inf if wanted.start is None else _number(name, wanted.start)
    high = math.inf if wanted.stop is None else _number(name, wanted.stop)
    places = np.flatnonzero((axis >= low) & (axis <= high))
    if not places.size:
        asked = f"{low:.10g} to {high:.10g}"
        if low > high:
            raise InputError(f"{name} = {asked}: the low end of a range must not be above the high end")
        _refuse(section, name, asked, axis[np.isfinite(axis)], unit, " and hold at least one value")
    values = axis[places]
    told = f"{name} = {values.min():.10g} to {values.max():.10g}{unit} ({len(places)} of {len(axis)} values)"
    return Chosen(places, True, told)


def _number(name: str, value: object) -> float:
    """A finite number; a NumPy scalar is one, a truth value is none."""
    plain = value.item() if isinstance(value, np.generic | np.ndarray) and value.ndim == 0 else value
    try:
        number = float(plain) if isinstance(plain, Real) and not isinstance(plain, bool) else math.nan
    except OverflowError:
        number = math.nan
    if not math.isfinite(number):
        shown = " ".join(repr(value).split())
        shown = shown if len(shown) <= 60 else f"{shown[:57]}..."
        raise InputError(f"{name} = {shown}: must be a finite number or a range slice(low, high) of such")
    return number


def _reach(values: NDArray[np.float64]) -> tuple[float, float]:
    """How far below the lowest and above the highest value of an axis a value may lie."""
    ordered = np.unique(values)
    if ordered.size < 2:
        rounding = 1e-9 * float(np.abs(ordered).sum())
        return rounding, rounding
    return BEYOND * float(ordered[1] - ordered[0]), BEYOND * float(ordered[-1] - ordered[-2])


def _refuse(
    section: Section, name: str, asked: str, values: NDArray[np.float64], unit: str, further: str
) -> NoReturn:
    if not values.size:
        raise InputError(f"{name} = {asked}: {section.where} has no values along it")
    span = f"{values.min():.10g} to {values.max():.10g}{unit}"
    raise InputError(f"{name} = {asked}: must be within {span}{further}; these are in {section.where}")
