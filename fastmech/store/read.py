"""Reading a result file for analysis offline: sections or parts by coordinate, when they are asked for."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import h5py
import numpy as np
from numpy.typing import NDArray

from fastmech.errors import InputError, printable, shown
from fastmech.objects import ANGLE_UNITS, Printed, spaced
from fastmech.results import STATE_UNITS, Dataset, Variable, no_xarray, parts
from fastmech.scene import path_of
from fastmech.store import decode
from fastmech.store.schema import CHANGE, DIM_NUMBERS, FORMAT, SCHEMA_VERSION

if TYPE_CHECKING:
    import xarray

#: What may be asked for along a coordinate: a value, or the values from one to another.
Wanted: TypeAlias = "float | slice"

#: How far beyond an end of an axis a value may lie, in spacings there (rounding allowed for).
BEYOND = 0.5 * (1.0 + 1e-9)


@dataclass(frozen=True)
class ChosenPart:
    """What a selection takes along one dimension."""

    places: NDArray[np.int64]  #: one place, or all those of a range, rising
    is_range: bool  #: whether a range was asked for, which keeps the dimension
    told: str  #: what is taken, for the user: ``k = 96 N/m (nearest to 100)``

    @property
    def hull(self) -> slice:
        """What is read: all from the first place to the last."""
        return slice(int(self.places[0]), int(self.places[-1]) + 1)

    @property
    def within(self) -> Any:
        """Index of the places in what was read; one place is no dimension any more."""
        if not self.is_range:
            return 0
        inside = self.places - self.places[0]
        return slice(None) if inside[-1] + 1 == inside.size else inside


def parse_selections(texts: Iterable[str]) -> dict[str, Wanted]:
    """``NAME=VALUE`` and ``NAME=LOW:HIGH`` as names and what is wanted of them; an end may be left open.

    Raises:
        InputError: not of this form, not a finite number, or a name twice.
    """
    selections: dict[str, Wanted] = {}
    for text in texts:
        name, _, value = text.partition("=")
        low, colon, high = value.partition(":")
        if name in selections:
            raise InputError(f"--select {text}: {name} is selected twice")
        if colon:
            selections[name] = slice(*(_parsed(end, text) if end.strip() else None for end in (low, high)))
        else:
            selections[name] = _parsed(value, text)
    return selections


def _parsed(value: str, text: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"--select {text}: must be NAME=VALUE or NAME=LOW:HIGH with finite numbers")
    return number


def choose(section: Section, wanted: Mapping[str, Any]) -> dict[str, ChosenPart]:
    """What a selection takes along each dimension; of the section only coordinates are read.

    Raises:
        InputError: an unknown dimension, or a value or range that is none or holds nothing.
    """
    return {dim: _choose(section, dim, value) for dim, value in wanted.items()}


def take(section: Section, chosen: Mapping[str, ChosenPart], names: Collection[str] | None = None) -> Dataset:
    """The variables of these names, all by default, at what was chosen."""
    variables = list(section) if names is None else list(names)
    dims = chosen.keys() | {dim for name in variables for dim in section.dims(name)}
    read = {*variables, *(dim for dim in dims if dim in section)}
    part = section.load(read, {dim: one.hull for dim, one in chosen.items()})
    taken = {}
    for name, v in part.variables.items():
        data = v.data
        for axis, dim in reversed([*enumerate(v.dims)]):
            if dim in chosen:
                data = data[(*[slice(None)] * axis, chosen[dim].within)]
        left = tuple(dim for dim in v.dims if dim not in chosen or chosen[dim].is_range)
        taken[name] = replace(v, dims=left, data=data)
    return Dataset(taken, part.attrs)


def _choose(section: Section, name: str, wanted: object) -> ChosenPart:
    if name not in section.sizes:
        known = ", ".join(section.sizes) or "none"
        raise InputError(f"{name}: is no dimension of {section.where}; it has {known}")
    axis, unit = np.arange(section.sizes[name], dtype=np.float64), ""
    has_values = name in section and section[name].data.dtype.kind in "fiu"
    if has_values:
        axis, unit = section[name].data.astype(np.float64), spaced(section[name].units)
    finite = np.unique(axis[np.isfinite(axis)])
    if isinstance(wanted, slice):
        if wanted.step is not None:
            raise InputError(f"{name} = {wanted!r}: a range must be slice(low, high) without a step")
        low = -math.inf if wanted.start is None else _number(name, wanted.start)
        high = math.inf if wanted.stop is None else _number(name, wanted.stop)
        asked, further = f"{low:.10g} to {high:.10g}", " and hold at least one value"
        if low > high:
            raise InputError(f"{name} = {asked}: the low end of a range must not be above the high end")
        places = np.flatnonzero((axis >= low) & (axis <= high))
    else:
        value = _number(name, wanted)
        if not has_values and (value != math.floor(value) or not 0 <= value < len(axis)):
            last = len(axis) - 1
            raise InputError(f"{name} = {value:g}: must be one of the places 0 to {last} of {section.where}")
        asked, further = f"{value:.10g}", ", or at most half a spacing beyond"
        beyond = BEYOND * np.diff(finite) if finite.size > 1 else 1e-9 * np.abs(finite)
        is_within = finite.size and finite[0] - beyond[0] <= value <= finite[-1] + beyond[-1]
        nearest = [np.nanargmin(np.abs(axis - value))] if is_within else []
        places = np.array(nearest, dtype=np.int64)
    if not places.size:
        if not finite.size:
            raise InputError(f"{name} = {asked}: {section.where} has no values along it")
        span = f"{finite[0]:.10g} to {finite[-1]:.10g}{unit}"
        raise InputError(f"{name} = {asked}: must be within {span}{further}; these are in {section.where}")
    taken = axis[places]
    if isinstance(wanted, slice):
        told = f"{taken.min():.10g} to {taken.max():.10g}{unit} ({len(places)} of {len(axis)} values)"
    else:
        told = f"{taken[0]:.10g}"
        told += unit if told == asked else f"{unit} (nearest to {asked})"
    return ChosenPart(places, isinstance(wanted, slice), f"{name} = {told}")


def _number(name: str, value: object) -> float:
    """A finite number; a NumPy scalar is one, a truth value is none."""
    plain = value.item() if isinstance(value, np.generic | np.ndarray) and value.ndim == 0 else value
    try:
        number = float(plain) if isinstance(plain, Real) and not isinstance(plain, bool) else math.nan
    except OverflowError:
        number = math.nan
    if not math.isfinite(number):
        asked = f"{name} = {shown(value)}"
        raise InputError(f"{asked}: must be a finite number or a range slice(low, high) of such")
    return number


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


def open_results(path: str | Path) -> Results:
    """Open a result file; use it in a `with` statement or close it when done.

    Raises:
        InputError: it is no path, there is no such file, it is not a result file of fastmech, its schema is
            newer than this version knows, or it is damaged.
    """
    return Results(path)


class Results(AbstractContextManager["Results"]):
    """An open result file.

    `results["equilibria"]` is the `Section` of that name, `results["map/curves"]` the group `curves` within
    the section `map`; iterating gives the names of the sections.

    Attributes:
        path: the file.
        attrs: the root's attributes: title, request, versions, machine, time (see `fastmech.store.schema`).
        parameters: the scene's parameters with their units.
        scene: the same as plain numbers in SI units: `fastmech.Scene(**results.scene)` is the scene again.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = path_of(path)
        self._file = _open_file(self.path)
        try:
            with decode.named_damage(str(path)):
                self.attrs = decode.get_attrs(self._file)
            _check_schema(self.attrs, path)
            left = decode.Allowance(self.path)
            with decode.named_damage(str(path)):
                root = decode.members(self._file, str(path), left)
            self.parameters = {
                name: decode.get_variable(member, {}, f"{path}: parameter {name!r}")
                for name, member in root.items()
                if isinstance(member, h5py.Dataset)
            }
            with decode.named_damage(f"{path}: the scene's parameters"):
                self.scene = {name: float(parameter.data) for name, parameter in self.parameters.items()}
            self._sections = {
                name: Section(member, f"{path}: {name}", left)
                for name, member in root.items()
                if isinstance(member, h5py.Group)
            }
            if not self._sections:
                raise InputError(f"{path}: holds no section")
        except BaseException:
            self.close()
            raise

    def __repr__(self) -> str:
        sections = ", ".join(f"{name} ({one.attrs.get('kind')})" for name, one in self._sections.items())
        return f"results of {shown(self.attrs.get('title', ''))} in {self.path}\n  sections: {sections}"

    @property
    def sections(self) -> tuple[str, ...]:
        """Names of the sections, in the order of the request."""
        return tuple(self._sections)

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the sections and, after each, of the groups in it: ``SECTION/GROUP``."""
        return tuple(
            place
            for name, one in self._sections.items()
            for place in (name, *(f"{name}/{g}" for g in one.groups))
        )

    def __getitem__(self, name: str) -> Section:
        found = self._find(name)
        if found is None:
            raise InputError(
                f"section {shown(name)}: is not in {self.path}; it has {', '.join(self.groups) or 'none'}"
            )
        return found

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._find(name) is not None

    def _find(self, name: str) -> Section | None:
        section, slash, group = name.partition("/")
        found = self._sections.get(section)
        return found if found is None or not slash else found.groups.get(group)

    def __iter__(self) -> Iterator[str]:
        return iter(self._sections)

    def __len__(self) -> int:
        return len(self._sections)

    @property
    def request(self) -> str:
        """The text of the request file that the file was made from.

        Raises:
            InputError: the file does not hold it.
        """
        text = self.attrs.get("request")
        if not isinstance(text, str):
            raise InputError(f"{self.path}: does not hold the request that it was made from")
        return text

    def scene_of(self, name: str) -> dict[str, float]:
        """The scene of a section, or of a group in it: the file's with the section's changes."""
        attrs = self[name.partition("/")[0]].attrs
        with decode.named_damage(f"{self.path}: {name}: its scene"):
            return {key: float(attrs.get(f"{CHANGE}{key}", value)) for key, value in self.scene.items()}

    def close(self) -> None:
        """Close the file; what was read stays usable."""
        self._file.close()

    def __exit__(self, *_: object) -> None:
        self.close()


class Section(Printed, Mapping[str, Variable]):
    """One section of a result file, used like a `fastmech.results.Dataset`: `section["q"]` is a `Variable`.

    Attributes:
        where: the file and the section's name, for messages.
        attrs: the section's attributes.
        sizes: length of each dimension.
        groups: sections within this one, with dimensions of their own.
    """

    def __init__(self, group: h5py.Group, where: str, left: decode.Allowance, inner: bool = False) -> None:
        self.where = where
        with decode.named_damage(where):
            all_members = decode.members(group, where, left)
            stored = {n: member for n, member in all_members.items() if isinstance(member, h5py.Dataset)}
            variables = {
                name: member for name, member in stored.items() if not decode.is_dimension_only(member)
            }
            dims = decode.dimensions(stored.values())
            letters = {dims[m.attrs[DIM_NUMBERS][-1]] for m in variables.values() if decode.is_characters(m)}
            self.sizes = {dim: int(stored[dim].shape[0]) for dim in dims.values() if dim not in letters}
            self.attrs: dict[str, Any] = decode.get_attrs(group)
        self.groups = {
            name: Section(member, f"{where}/{name}", left, inner=True)
            for name, member in all_members.items()
            if isinstance(member, h5py.Group) and not inner
        }
        self._stored, self._dims = variables, dims

    def told(self) -> str:
        """Its kind, its dimensions with their ranges, and the names of what it holds."""
        along = ", ".join(map(self._told, self.sizes)) or "nothing"
        groups = f"\n  groups: {', '.join(self.groups)}" if self.groups else ""
        about = f"{self.attrs.get('kind', 'group')} in {self.where}\n  over {along}"
        return printable(f"{about}\n  variables: {', '.join(self)}{groups}", kept="\n")

    def _told(self, dim: str) -> str:
        """A dimension with the range of its values, if it has some and the file is open."""
        values = self[dim].data if dim in self and self._stored[dim] else np.zeros(0)
        known = values[np.isfinite(values)] if values.dtype.kind in "fiu" else np.zeros(0)
        ends = f" from {known.min():.6g} to {known.max():.6g}" if known.size else ""
        return f"{dim}{ends} ({self.sizes[dim]:,})"

    @property
    def variables(self) -> Mapping[str, Variable]:
        """The variables by name, each read anew whenever it is asked for."""
        return self

    def __getitem__(self, name: str) -> Variable:
        stored, called = self._open(name)
        return decode.get_variable(stored, self._dims, called)

    def __contains__(self, name: object) -> bool:
        return name in self._stored

    def __iter__(self) -> Iterator[str]:
        return iter(self._stored)

    def __len__(self) -> int:
        return len(self._stored)

    def dims(self, name: str) -> tuple[str, ...]:
        """Dimensions of a variable, which is not read."""
        return tuple(self.about(name).sizes)

    def about(self, name: str) -> decode.About:
        """What is said of a variable; its values are not read.

        Raises:
            InputError: there is no such variable, or it is damaged.
        """
        stored, called = self._open(name)
        return decode.about_variable(stored, self._dims, called)

    def _open(self, name: str) -> tuple[h5py.Dataset, str]:
        """A stored variable, and what messages call it."""
        if name not in self._stored:
            known = ", ".join(self._stored) or "none"
            raise InputError(f"variable {shown(name)}: is not in {self.where}; it has {known}")
        called = f"{self.where}: variable {name!r}"
        if not self._stored[name]:
            raise InputError(f"{called}: the file is closed; read it before")
        return self._stored[name], called

    def load(self, names: Collection[str] | None = None, part: Mapping[str, slice] | None = None) -> Dataset:
        """Read variables.

        Args:
            names: which; None: all, and the groups too.
            part: what to take along some dimensions, with steps of 1 or more; nothing else is kept in memory.

        Raises:
            InputError: a variable's data are damaged; the message names it.
        """
        chosen = [name for name in self if names is None or name in names]
        groups = {name: group.load() for name, group in self.groups.items()} if names is None else {}
        opened = {name: self._open(name) for name in chosen}
        read = {
            name: decode.get_variable(one, self._dims, where, part) for name, (one, where) in opened.items()
        }
        return Dataset(read, self.attrs, groups)

    def select(self, names: Collection[str] | None = None, **values: Wanted) -> Dataset:
        """The section at one value, or in a range, of some coordinates: ``results["map"].select(k=100.0)``.

        Args:
            names: variables to read; None: all. The coordinates of their dimensions come too.
            values: a number: the nearest point along the coordinate, in its unit; it may lie beyond either
                end by at most half the spacing there (of a coordinate with one value: not at all). The
                dimension is dropped; its coordinate stays as a scalar. Or ``slice(low, high)``: all points
                from low to high, both included, None for an open end; the dimension stays. Along a dimension
                without coordinate these are places counted from 0.

        Raises:
            InputError: an unknown dimension or variable, a value beyond the coordinate's range, a range that
                holds no point, what is neither a finite number nor a range, or damaged data.
        """
        return take(self, choose(self, values), names)

    def to_xarray(self) -> xarray.Dataset:
        """The section as an `xarray.Dataset` that reads values when they are used, while the file is open.

        ``to_xarray().load()`` reads all; of ``to_xarray().q.sel(k=100, method="nearest")`` and the like
        nothing else is read. A damaged variable is told when it is read. Groups have rows of another kind and
        are asked themselves, ``groups["points"].to_xarray()``; where all data lie in them they are among it.

        Raises:
            InputError: xarray is not installed, or a coordinate is damaged.
        """
        try:
            from fastmech.store.lazy import lazy_dataset
        except ImportError:
            raise no_xarray() from None
        return lazy_dataset(self)


def _open_file(path: Path) -> h5py.File:
    if path.exists() and not path.is_file() and not path.is_dir():  # reading a pipe would wait for ever
        raise InputError(f"{path}: is not a regular file")
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # a null character, or one that the file system's encoding lacks
        raise InputError(f"{str(path)!r}: cannot be the path of a file: {error}") from None
    if empty:
        raise InputError(f"{path}: is empty")
    if not h5py.is_hdf5(path):
        raise InputError(f"{path}: is not an HDF5 file")
    with decode.named_damage(str(path)):
        return h5py.File(path, "r")


def _check_schema(attrs: Mapping[str, Any], path: str | Path) -> None:
    if not isinstance(attrs.get("format"), str) or attrs["format"] != FORMAT:
        raise InputError(f"{path}: is an HDF5 file, but not a result file of fastmech")
    version = attrs.get("schema_version")
    if not isinstance(version, int) or not 1 <= version <= SCHEMA_VERSION:
        raise InputError(
            f"{path}: has schema version {shown(version)}, but this fastmech reads versions 1 to"
            f" {SCHEMA_VERSION}; open it with the fastmech that wrote it or a newer one"
        )
