"""Sections of older files as today's have them, for what draws them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fastmech.results import ANGLE_UNITS, STATE_UNITS, Dataset, Variable, parts

#: Dimensions of several units or angles of schema 1, with the names that their entries have now.
_ENTRIES = {
    "component": tuple(STATE_UNITS),
    "angle": tuple(ANGLE_UNITS),
    "mode": tuple("1234"),
    "constraint": tuple("2345"),
}

#: Dimensions of schema 1 whose variables are a group now.
_GROUPS = {
    "fold": "curves",
    "fold_point": "curves",
    "cusp": "curves",
    "unreached_point": "curves",
    "unreached_sheet": "curves",
    "total_unexplained_and_unfinished": "curves",
    "sheet_number": "sheets",
    "break": "sheets",
}


def as_today(dataset: Dataset, schema_version: int) -> Dataset:
    """A section of a file of some schema version in the layout of the newest."""
    if schema_version > 1:
        return dataset
    own: dict[str, Variable] = {}
    groups: dict[str, dict[str, Variable]] = {}
    for name, variable in dataset.variables.items():
        place = _GROUPS.get(variable.dims[0] if variable.dims else "")
        target = own if place is None else groups.setdefault(place, {})
        split = [dim for dim in variable.dims if dim in _ENTRIES and variable.dims != (dim,)]
        target |= _split(name, variable, split[0]) if split else {name: variable}
    return Dataset(own, dataset.attrs, {name: Dataset(inner) for name, inner in groups.items()})


def _split(name: str, variable: Variable, dim: str) -> Mapping[str, Variable]:
    dims = tuple(other for other in variable.dims if other != dim)
    data = np.moveaxis(variable.data, variable.dims.index(dim), -1)
    units = dict.fromkeys(_ENTRIES[dim][: data.shape[-1]], variable.units)
    return parts(name, dims, data, units, variable.long_name)
