"""Parts of a section by coordinate, read without the rest."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from fastmech.errors import InputError
from fastmech.results import Dataset, Variable

if TYPE_CHECKING:
    from fastmech.store.read import Section


def parse_selections(texts: Iterable[str]) -> dict[str, float]:
    """``NAME=VALUE`` as names and numbers.

    Raises:
        InputError: not of this form, not a finite number, or a name twice.
    """
    selections: dict[str, float] = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise InputError(f"--select {text}: must be NAME=VALUE with a finite number")
        if name in selections:
            raise InputError(f"--select {text}: {name} is selected twice")
        selections[name] = number
    return selections


def select(section: Section, values: Mapping[str, float], names: Collection[str] | None = None) -> Dataset:
    """One place along some dimensions of a section; see `fastmech.store.read.Section.select`."""
    places = {dim: _place(section, dim, value) for dim, value in values.items()}
    chosen = list(section) if names is None else list(names)
    for name in chosen:
        if name not in section:
            section[name]  # says what there is
    dims = places.keys() | {dim for name in chosen for dim in section.dims(name)}
    wanted = {*chosen, *(dim for dim in dims if dim in section)}
    part = section.load(wanted, {dim: slice(place, place + 1) for dim, place in places.items()})
    return Dataset({name: _without(v, places) for name, v in part.variables.items()}, part.attrs)


def _without(variable: Variable, places: Collection[str]) -> Variable:
    """A variable that has one entry along some dimensions, without them."""
    axes = tuple(axis for axis, dim in enumerate(variable.dims) if dim in places)
    left = tuple(dim for dim in variable.dims if dim not in places)
    return Variable(left, variable.data.squeeze(axes), variable.units, variable.long_name, variable.attrs)


def _place(section: Section, name: str, value: float) -> int:
    if name not in section.sizes:
        known = ", ".join(section.sizes) or "none"
        raise InputError(f"{name}: is no dimension of {section.where}; it has {known}")
    if name in section and section[name].data.dtype.kind in "fiu":
        distance = np.abs(section[name].data.astype(np.float64) - value)
        return int(np.argmin(distance)) if distance.size else _no_place(section, name, value)
    if value != int(value) or not 0 <= value < section.sizes[name]:
        return _no_place(section, name, value)
    return int(value)


def _no_place(section: Section, name: str, value: float) -> int:
    raise InputError(
        f"{name} = {value:g}: must be one of the places 0 to {section.sizes[name] - 1} of {section.where}"
    )
