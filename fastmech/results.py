"""Labelled arrays: what every computation hands on to the store, the plots and the user.

A `Variable` is an array with named dimensions, a unit and a description; a `Dataset` is a set of variables
that agree on the sizes of their dimensions. A variable named like its only dimension is the coordinate of it.
What would multiply the rows of a table by dimensions of its own is a group: a dataset within a dataset.

Conventions are those of CF 1.11: one unit a variable, which UDUNITS reads (`parts` makes several variables of
an array of several units); booleans become int8 with the flags "false true"; statuses and kinds are int8 with
the attributes that `flags` makes; what stands for no value among integers is the attribute `_FillValue`;
complex numbers are two variables, `NAME_re` and `NAME_im`; strings are object arrays of `str`.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from fastmech.errors import InputError, shown
from fastmech.objects import coordinate_units

if TYPE_CHECKING:
    import xarray


Attribute: TypeAlias = "str | int | float | tuple[str, ...] | npt.NDArray[Any]"

_INTEGERS = {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
DTYPES = frozenset({"float64", "float32"} | _INTEGERS)

RESERVED_ATTRS = frozenset(
    # what HDF5 keeps about dimension scales
    {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "DIMENSION_LABELS"}
    # what would make a netCDF reader change the values
    | {"missing_value", "scale_factor", "add_offset", "coordinates", "dtype", "calendar"}
)

FILL = "_FillValue"
"""Attribute of integers: the one that stands for no value. Of floats that is NaN."""

NO_CODE: Mapping[str, int] = {FILL: -1}
"""The attributes of integers of which -1 stands for none."""

STATE_UNITS: Mapping[str, str] = {"phi": "rad", "theta": "rad", "phi_dot": "rad/s", "theta_dot": "rad/s"}
"""Components of a state and their units."""

MAX_ATTR_BYTES = 8192
"""Larger arrays belong in a variable: an HDF5 object keeps its attributes in a header of at most 64 KiB."""

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_FALSE_TRUE: dict[str, Attribute] = {
    "flag_values": np.array([0, 1], dtype=np.int8),
    "flag_meanings": "false true",
}


@dataclass(frozen=True, eq=False)
class Variable:
    """An array with named dimensions.

    Raises:
        InputError: the dimensions do not match the shape, or a type or a name that result files cannot hold.
    """

    dims: tuple[str, ...]  #: one name for each axis of `data`
    #: the values, anything that `numpy.asarray` takes: floats of 32 or 64 bits, integers, booleans, strings
    data: npt.NDArray[Any]
    units: str = "1"  #: unit of the values, "1" for a pure number
    long_name: str = ""  #: what the values are, in a few words
    #: further attributes: strings, numbers, short 1-D arrays of numbers, tuples of strings; of integers also
    #: `_FillValue`
    attrs: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        dims = _checked_dims(self.dims)
        data = np.asarray(self.data)
        if len(dims) != data.ndim:
            raise InputError(f"variable.dims = {dims}: must name the axes of the shape {data.shape}")
        if not isinstance(self.units, str) or not self.units.strip():
            raise InputError(f'variable.units = {self.units!r}: must be a unit, "1" for a pure number')
        check_text(self.units, "variable.units")
        check_text(self.long_name, "variable.long_name")
        given = dict(self.attrs)
        fill = given.pop(FILL, None)
        attrs = checked_attrs(given, "variable.attrs", reserved={"units", "long_name"})
        if data.dtype == np.bool_:
            data, attrs = data.astype(np.int8), {**_FALSE_TRUE, **attrs}
        if fill is not None:
            limits = np.iinfo(data.dtype) if data.dtype.kind in "iu" else None
            if limits is None or not isinstance(fill, int) or not limits.min <= fill <= limits.max:
                raise InputError(f"variable.attrs.{FILL} = {shown(fill)}: must be an integer of {data.dtype}")
            attrs[FILL] = int(fill)
        object.__setattr__(self, "dims", dims)
        object.__setattr__(self, "data", _checked_data(data))
        object.__setattr__(self, "attrs", attrs)

    @property
    def sizes(self) -> dict[str, int]:
        """Length of each dimension."""
        return dict(zip(self.dims, self.data.shape, strict=True))

    @property
    def codes(self) -> Codes:
        """Meanings and values of flags, as the variable itself explains them; none of other variables.

        Raises:
            InputError: the explanation does not fit together.
        """
        return codes_of(self.attrs)

    def meaning(self, k: int) -> str:
        """What the flag at a place along the only dimension means, in words."""
        found = (meaning for meaning, code in self.codes.items() if code == self.data[k])
        return next(found, "unknown").replace("_", " ")


@dataclass(frozen=True, eq=False)
class Dataset:
    """Variables that share dimensions, with attributes of the whole.

    Raises:
        InputError: two variables disagree on the length of a dimension, a variable is named like a dimension
            without being its coordinate, or a name or attribute that result files cannot hold.
    """

    variables: Mapping[str, Variable]  #: by name
    attrs: Mapping[str, Any] = field(default_factory=dict)  #: of the whole
    #: further datasets by name, with dimensions of their own
    groups: Mapping[str, Dataset] = field(default_factory=dict)

    def __post_init__(self) -> None:
        variables = dict(self.variables)
        for name in self.groups:
            check_name(name, "dataset.groups")
            if name in variables:
                raise InputError(f"dataset.groups.{name}: is the name of a variable too")
        for name in variables:
            check_name(name, "dataset.variables")
        sizes = _shared_sizes(variables)
        for name in sizes.keys() & variables.keys():
            if variables[name].dims != (name,):
                raise InputError(
                    f"dataset.variables.{name}: named like a dimension, so its dims must be ('{name}',),"
                    f" not {variables[name].dims}"
                )
        object.__setattr__(self, "variables", variables)
        object.__setattr__(self, "attrs", checked_attrs(self.attrs, "dataset.attrs"))

    @property
    def sizes(self) -> dict[str, int]:
        """Length of each dimension."""
        return _shared_sizes(self.variables)

    def __getitem__(self, name: str) -> Variable:
        if name not in self.variables:
            raise InputError(
                f"variable {name!r}: is not in this dataset; it has {', '.join(self.variables) or 'none'}"
            )
        return self.variables[name]

    def __contains__(self, name: object) -> bool:
        return name in self.variables

    def __iter__(self) -> Iterator[str]:
        return iter(self.variables)

    def __len__(self) -> int:
        return len(self.variables)

    @property
    def merged(self) -> Dataset:
        """With the variables of its groups among its own, as pictures want them and older files have them."""
        among = [self.variables, *(group.variables for group in self.groups.values())]
        return Dataset({name: variable for part in among for name, variable in part.items()}, self.attrs)

    def to_xarray(self) -> xarray.Dataset:
        """The same as an `xarray.Dataset` (no copy of the data), groups left out unless they hold all data.

        Codes stay integers: ``xarray.decode_cf`` puts NaN where `_FillValue` stands for none.

        Raises:
            InputError: xarray is not installed.
        """
        try:
            import xarray
        except ImportError:
            raise no_xarray() from None
        arrays = {
            name: (v.dims, v.data, cf_attrs(v.units, v.long_name, v.attrs, v.data.dtype))
            for name, v in (self.merged if only_labels(self) else self).variables.items()
        }
        return xarray.Dataset(arrays, attrs=dict(self.attrs))


def only_labels(section: Any) -> bool:
    """Whether a dataset, or a section of a file, has its data in groups and no more than labels itself."""
    return set(section) <= set(section.sizes)


def no_xarray() -> InputError:
    """What is raised where xarray is asked for and not there."""
    return InputError("to_xarray: needs xarray; install it with: pip install 'fastmech[xarray]'")


def cf_attrs(units: str, long_name: str, attrs: Mapping[str, Any], dtype: np.dtype[Any]) -> dict[str, Any]:
    """All attributes of a variable as netCDF has them: `_FillValue` is of the variable's type."""
    own = {FILL: dtype.type(attrs[FILL])} if FILL in attrs else {}
    return {"units": units, "long_name": long_name, **attrs, **own}


#: What a quantity of a unit is.
KINDS = {"rad": "angle", "m": "length"}


def parts(
    name: str, dims: tuple[str, ...], data: npt.NDArray[Any], units: Mapping[str, str], about: str
) -> dict[str, Variable]:
    """An array along whose last axis the unit changes as one variable for each of its entries, `NAME_ENTRY`.

    Args:
        name: what the variables' names begin with; empty: they are the entries' names.
        dims: dimensions of all axes but the last.
        data: shape (..., entries).
        units: names of the entries, with their units.
        about: the variables' long name, with `{}` for the entry's name or `{1} {0}` for its kind and name.
    """
    return {
        f"{name}_{entry}" if name else entry: Variable(
            dims, data[..., k], unit, about.format(entry, KINDS.get(unit, "rate"))
        )
        for k, (entry, unit) in enumerate(units.items())
    }


def columns(dims: tuple[str, ...], rows: Mapping[str, tuple[Any, ...]]) -> dict[str, Variable]:
    """Variables over the same dimensions; a row is values, unit, meaning and attributes if there are any.

    Units by the names of entries, in place of one, make a row the variables of `parts`.
    """
    variables: dict[str, Variable] = {}
    for name, row in rows.items():
        several = isinstance(row[1], Mapping)
        variables |= parts(name, dims, *row) if several else {name: Variable(dims, *row)}
    return variables


def rows_of(found: Any, rows: Mapping[str, tuple[Any, ...]], name: str = "{}") -> dict[str, tuple[Any, ...]]:
    """Rows for `columns` of what an object has under these names; ``name`` makes the variable's of it."""
    return {name.format(key): (getattr(found, key), *row) for key, row in rows.items()}


def scene_parameters(system: Any) -> dict[str, Variable]:
    """Parameters of a scene, a mechanism or a system (None: none) as a result file holds them."""
    described = system.described().items() if system is not None else ()
    return {name: Variable((), np.array(value), unit, about) for name, (value, unit, about) in described}


def told(system: Any) -> dict[str, Any]:
    """What a section says of a mechanism that is not the paper's, or of a system."""
    if not hasattr(system, "coordinates"):
        return {"system": system.name} if hasattr(system, "rhs") else {}
    built = getattr(system, "built_with", {})
    changed = tuple(name for name, (value, *_) in system.described().items() if value != built.get(name))
    about: dict[str, Any] = {"changed_parameters": changed} if changed else {}
    return {"mechanism": system.name, "coordinate_names": tuple(coordinate_units(system))} | about


def numbers(dim: str, count: int, about: str) -> dict[str, Variable]:
    """The coordinate that numbers the places of a dimension from 0."""
    return {dim: Variable((dim,), np.arange(count, dtype=np.int32), "1", about)}


class Codes(dict[str, int]):
    """Codes by their meanings; a meaning that the variable does not explain is a code that it has nowhere."""

    def __missing__(self, meaning: str) -> int:
        return 1 << 40

    def others(self, known: Container[str]) -> list[str]:
        """Meanings that the variable knows and this version does not: its file is older or newer."""
        return [meaning for meaning in self if meaning not in known]


def codes_of(attrs: Mapping[str, Any]) -> Codes:
    """Meanings and values of flags by the attributes that explain them.

    Raises:
        InputError: these do not fit together.
    """
    if "flag_values" not in attrs or "flag_meanings" not in attrs:
        return Codes()
    try:
        values = [int(value) for value in np.atleast_1d(attrs["flag_values"])]
        return Codes(zip(str(attrs["flag_meanings"]).split(), values, strict=True))
    except (TypeError, ValueError):
        raise InputError("flag_values, flag_meanings: do not fit together") from None


def flags(members: Iterable[IntEnum], fill: int | None = None) -> dict[str, Any]:
    """The attributes that explain codes of one or more members by the CF conventions.

    Values are int8, meanings the members' names in lower case. ``fill`` is the code that stands for none,
    whether or not it is a member: `_FillValue` then, and no flag.
    """
    codes = {member.name.lower(): int(member) for member in members if member != fill}
    none = {} if fill is None else {FILL: fill}
    values = np.array([*codes.values()], dtype=np.int8)
    return {"flag_values": values, "flag_meanings": " ".join(codes), **none}


def check_name(name: object, where: str) -> None:
    """Refuse what is not a plain name: a letter or underscore, then letters, digits and underscores."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise InputError(
            f"{where}: the name {shown(name)} must be ASCII letters, digits and underscores, no digit first"
        )


def check_text(text: object, where: str) -> None:
    """Refuse what HDF5 cannot hold as UTF-8 text without loss."""
    if not isinstance(text, str):
        raise InputError(f"{where} = {text!r}: must be text")
    if "\0" in text or text.encode(errors="ignore").decode() != text:
        raise InputError(f"{where} = {text!r}: must be UTF-8 text without null characters")


def checked_attrs(
    attrs: Mapping[str, Any], where: str, reserved: set[str] | None = None
) -> dict[str, Attribute]:
    """Attributes in the form in which result files give them back.

    Booleans become 0 or 1, NumPy scalars Python numbers, sequences of strings tuples and of numbers arrays.

    Raises:
        InputError: a name or value that result files cannot hold.
    """
    checked = {}
    for name, value in attrs.items():
        check_name(name, where)
        if name in RESERVED_ATTRS | (reserved or set()) or name.startswith("_"):
            raise InputError(f"{where}.{name}: the name is reserved")
        checked[name] = _checked_attr(value, f"{where}.{name}")
    return checked


def _checked_attr(value: Any, where: str) -> Attribute:
    if isinstance(value, str):
        check_text(value, where)
        return str(value)
    array = np.asarray(value)
    if array.dtype.kind in "UTO" and array.ndim == 1 and all(isinstance(item, str) for item in value):
        for item in value:
            check_text(item, where)
        return tuple(str(item) for item in value)
    if array.dtype == np.bool_:
        array = array.astype(np.int8)
    if array.dtype.name not in DTYPES or array.ndim > 1:
        kind = f"{type(value).__name__} of {array.dtype.name}"
        raise InputError(
            f"{where}: must be text, a number or a 1-D sequence of either, not {kind}, {array.ndim}-D"
        )
    if array.ndim == 0:
        number: int | float = array.item()
        return number
    if array.nbytes > MAX_ATTR_BYTES:
        raise InputError(
            f"{where}: has {array.nbytes} bytes, at most {MAX_ATTR_BYTES} fit; make it a variable"
        )
    return array


def _checked_dims(dims: Iterable[str]) -> tuple[str, ...]:
    for name in dims:
        check_name(name, "variable.dims")
    named = tuple(dims)
    if len(set(named)) != len(named):
        raise InputError(f"variable.dims = {named}: must not name a dimension twice")
    return named


def _checked_data(data: npt.NDArray[Any]) -> npt.NDArray[Any]:
    if data.dtype.kind in "UTO":
        data = data.astype(object)
        for text in data.flat:
            check_text(text, "variable.data")
        return data
    if data.dtype.kind == "c":
        raise InputError(
            f"variable.data of {data.dtype}: store complex numbers as two variables, NAME_re and NAME_im"
        )
    if data.dtype.name not in DTYPES:
        raise InputError(
            f"variable.data of {data.dtype}: must be floats of 32 or 64 bits, integers, booleans or strings"
        )
    return data


def _shared_sizes(variables: Mapping[str, Variable]) -> dict[str, int]:
    sizes: dict[str, int] = {}
    for name, variable in variables.items():
        for dim, size in variable.sizes.items():
            if sizes.setdefault(dim, size) != size:
                raise InputError(
                    f"dataset.variables.{name}: has {size} points along {dim}, the others have {sizes[dim]}"
                )
    return sizes
