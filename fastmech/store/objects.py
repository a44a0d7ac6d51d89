"""What public functions return as datasets, by their tables of fields, and as result files."""

from __future__ import annotations

import os
from itertools import islice
from typing import Any

import numpy as np

from fastmech.ensembles.threads import thread_count
from fastmech.errors import InputError
from fastmech.objects import Field, Result, state_units
from fastmech.results import Dataset, Variable, flags, parts, scene_parameters, told
from fastmech.scene import path_of
from fastmech.store.provenance import provenance
from fastmech.store.write import write_results


def dataset_of(found: Result) -> Dataset:
    """The fields of an object with their units; what it does not have is left out."""
    variables: dict[str, Variable] = {}
    for name, field in found.FIELDS.items():
        value = found.value_of(name)
        if value is not None:
            variables |= _variables(found, name, field, value)
    return Dataset(variables, told(found.system) | {name: getattr(found, name) for name in found.TOLD})


def _variables(found: Result, name: str, field: Field, value: Any) -> dict[str, Variable]:
    dims: list[str] = []
    own: dict[str, Variable] = {}
    units = state_units(found.system)
    for dim in field.dims.split():
        if dim.startswith("*"):
            axes = getattr(found, dim[1:])
            dims += axes
            own |= {n: Variable((n,), v, units.get(n, "1"), f"{n} at the start") for n, v in axes.items()}
        else:
            dims.append(dim)
    data = np.asarray(
        value, dtype=object if field.unit == "1" and np.asarray(value).dtype.kind in "UO" else None
    )
    if name.endswith("*"):
        entries = dict(islice(units.items(), data.shape[-1]))
        return own | parts(name[:-1].rstrip("_"), tuple(dims[:-1]), data, entries, f"{field.about} {{}}")
    if field.codes is None:
        attrs: dict[str, Any] = {}
    else:
        attrs = {"_FillValue": field.codes} if isinstance(field.codes, int) else flags(field.codes)
    return own | {name: Variable(tuple(dims), data, _unit(found, field.unit), field.about, attrs)}


def _unit(found: Result, unit: str) -> str:
    """A unit, or that of what an attribute names: ``@parameter``, ``@names.0``, ``@last`` coordinate."""
    if not unit.startswith("@"):
        return unit
    attribute, _, place = unit[1:].partition(".")
    named: Any = getattr(found, attribute)
    parameter = named[int(place)] if place else named
    described: Any = getattr(found.system, "described", dict)()
    return (
        described[parameter][1] if parameter in described else state_units(found.system).get(parameter, "1")
    )


def save(found: Result, path: str | os.PathLike[str], replace: bool) -> None:
    """Write a result file with an object as its one section, named by its kind."""
    if not os.path.exists(folder := path_of(path).parent):
        raise InputError(f"{path}: there is no folder {folder}")
    write_results(
        path_of(path),
        scene_parameters=scene_parameters(found.system),
        sections={found.KIND: found.dataset()},
        attrs=provenance(thread_count(None)) | {"title": repr(found).splitlines()[0]},
        replace=replace,
    )
