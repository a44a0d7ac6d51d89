"""What public functions return: objects that print in six lines, draw, and save themselves as scans do.

A class says what it holds as data: ``FIELDS``, a unit and a meaning for each of its arrays and numbers. From
this follow what is printed, what notebooks show, the xarray dataset and the result file. Where a kind of scan
has a layout for the same thing, ``LAYOUT`` names the function that makes it; ``PICTURE`` names the function
that draws it into axes. Both lie in layers above and are loaded by name when they are asked for, here alone.
"""

from __future__ import annotations

import inspect
import sys
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from enum import IntEnum
from functools import cache
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np

from fastmech.errors import InputError, shown

if TYPE_CHECKING:
    import os

    import xarray
    from matplotlib.axes import Axes

    from fastmech.results import Dataset

#: Lines that an object prints, their width, and up to how many values it prints one by one.
LINES, WIDTH, EACH = 6, 110, 6


ANGLE_UNITS: Mapping[str, str] = {"phi": "rad", "theta": "rad"}
"""The angles and their units."""


class Field(NamedTuple):
    """What an object holds, as files tell it."""

    dims: str  #: names of dimensions, with blanks between; ``*name``: the keys of that attribute
    unit: str  #: ``@name``: that of the parameter which that attribute names
    about: str  #: what it is, in a few words
    source: str = ""  #: the attribute, by default the variable's name; ``items.x``: that of each of the items
    codes: type[IntEnum] | int | None = None  #: of integers what they mean, or which of them stands for none


@cache
def _load(where: str) -> Any:
    """A function of a layer above, ``module:name``."""
    module, _, name = where.partition(":")
    return getattr(import_module(f"fastmech.{module}"), name)


class Printed:
    """What prints a summary in at most six lines, and says the same in notebooks."""

    FIELDS: ClassVar[Mapping[str, Field]] = {}

    def told(self) -> str:
        """What is printed, before it is cut: by default the numbers among the fields."""
        name = "".join(f" {c.lower()}" if c.isupper() else c for c in type(self).__name__).strip()
        own: Any = self
        known = self.FIELDS or {f.name: Field("", "1", f.name.replace("_", " ")) for f in fields(own)}
        each = "; ".join(filter(None, (_told(field, self.value_of(key)) for key, field in known.items())))
        return f"{name}: {each}" if each else name

    def __dir__(self) -> list[str]:
        return [name for name in super().__dir__() if name not in _UNTOLD]

    def __repr__(self) -> str:
        lines = [
            part
            for line in self.told().splitlines()
            for part in textwrap.wrap(line, WIDTH, subsequent_indent="  ", drop_whitespace=True)
        ]
        if len(lines) > LINES:
            lines[LINES - 1 :] = [f"  ... and {len(lines) - LINES + 1} more lines; see its attributes"]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        first, *others = repr(self).splitlines()
        return f"<div><b>{escape(first)}</b><br>{'<br>'.join(map(escape, others))}</div>"

    def value_of(self, key: str) -> Any:
        """What a field says: an attribute, or that of each of some items, one after the other."""
        field = self.FIELDS.get(key)
        items, _, name = ((field and field.source) or key).rpartition(".")
        if not items:
            return getattr(self, name)
        each = [getattr(item, name) for item in getattr(self, items)]
        return np.concatenate(each) if each and np.ndim(each[0]) else np.array(each)


class Result(Printed):
    """What also becomes an xarray dataset and saves itself."""

    KIND: ClassVar[str] = ""  #: what files call it, as ``kind`` of a request
    LAYOUT: ClassVar[str] = ""
    TOLD: ClassVar[tuple[str, ...]] = ()  #: attributes that files have as attributes
    system: Any = None  #: the scene, mechanism or system that it is about

    def of(self, system: Any) -> Self:
        """The same, which knows what it is about."""
        object.__setattr__(self, "system", system)
        return self

    def dataset(self) -> Dataset:
        """What files hold of it, with units."""
        made = _load(self.LAYOUT)(self) if self.LAYOUT else _load("store.objects:dataset_of")(self)
        return replace(made, attrs={**made.attrs, "kind": self.KIND})

    def to_xarray(self) -> xarray.Dataset:
        """As an xarray dataset, a unit and a meaning on every variable.

        Tables that a file keeps in groups are among it; read back they are
        ``fm.open_results(path)[kind].groups[name].to_xarray()``.

        Raises:
            InputError: xarray is not installed.
        """
        return self.dataset().merged.to_xarray()

    def save(self, path: str | os.PathLike[str], *, replace: bool = False) -> None:
        """Write a result file with one section, as scans do: ``fm.open_results(path)`` reads it.

        Raises:
            InputError: the file exists and ``replace`` is False, it ends in anything but .h5, .hdf5 or .nc,
                its folder does not exist, or it cannot be written.
        """
        _load("store.objects:save")(self, path, replace)


class Drawn(Result):
    """What also draws itself."""

    PICTURE: ClassVar[str] = ""

    def plot(self, ax: Axes | None = None, **how: Any) -> Axes:
        """Draw it into axes, by default those of a new figure; ``matplotlib.rcParams`` are respected.

        In a figure with ``layout="constrained"`` titles and legends have room. In one without a layout a
        legend comes into the axes, if it has at most six entries.

        Raises:
            InputError: ``ax`` are no axes, or there is nothing to draw.
        """
        own = ax is None
        if ax is None:
            from matplotlib import pyplot

            ax = pyplot.subplots(layout="constrained")[1]
        elif not callable(getattr(ax, "plot", None)):
            raise InputError(f"ax = {shown(ax)}: must be the axes of a matplotlib figure")
        _load(self.PICTURE)(self, ax, **how)
        _load("plots.style:make_room" if own else "plots.style:keep_inside")(ax)
        return ax


def tell_result(function: Any) -> None:
    """Say in a function's docstring what the objects that it returns hold: attributes and methods."""
    told, module = "", vars(sys.modules[function.__module__])
    for name in str(function.__annotations__["return"]).split(" | "):
        first, _, last = name.partition(".")
        kind: Any = getattr(module.get(first), last, None) if last else module.get(first)
        if isinstance(kind, type) and kind.__module__.startswith("fastmech."):
            own = [*getattr(kind, "__dataclass_fields__", getattr(kind, "_fields", ())), *dir(kind)]
            own = [one for one in dict.fromkeys(own) if one[0] != "_" and one not in _UNTOLD]
            own = [one for one in own if not (issubclass(kind, Sequence) and hasattr(Sequence, one))]
            each = (f"{one}()" if callable(getattr(kind, one, None)) else one for one in own)
            line = textwrap.fill(f"{kind.__name__}: {', '.join(each)}.", WIDTH - 10)
            told += textwrap.indent(line, "    ") + "\n"
    about = inspect.getdoc(function) or ""
    if told in about:
        return
    if "Returns:\n" not in about:
        before, raises, errors = about.partition("Raises:\n")
        function.__doc__ = f"{before.rstrip()}\n\nReturns:\n{told}\n{raises}{errors}".rstrip()
    else:  # what it says itself comes first
        before, _, after = about.partition("Returns:\n")
        text, _, others = after.partition("\n\n")
        function.__doc__ = f"{before}Returns:\n{text}\n\n{told}\n{others}".rstrip()


#: What objects have for the rest of this package.
_UNTOLD = {"FIELDS", "KIND", "LAYOUT", "PICTURE", "TOLD", "told", "of", "value_of", "dataset", "system"}


def counted(number: int, noun: str) -> str:
    """A number and its noun, in the plural but for one."""
    if number != 1:
        ending = "es" if noun.endswith(("ch", "x")) else "s"
        noun = f"{noun[:-1]}ies" if noun.endswith("ry") else noun + ending
    return f"{number:,} {noun}"


def spaced(unit: str) -> str:
    """A unit to stand behind a value; nothing of a pure number, or of what is given without units."""
    return "" if unit in ("1", "") else f" {unit}"


def coordinate_units(system: Any) -> dict[str, str]:
    """Names of a scene's or a mechanism's coordinates with their units."""
    if not hasattr(system, "coordinates"):
        return dict(ANGLE_UNITS)
    names = system.state[: len(system.coordinates)]
    return {name: "m" if name in system.lengths else "rad" for name in names}


def state_units(system: Any) -> dict[str, str]:
    """Names of coordinates, then of rates, with their units; a system's are pure numbers."""
    if hasattr(system, "rhs"):
        return {name: "rad" if name in system.angles else "1" for name in system.state}
    units = coordinate_units(system)
    return units | {f"{name}_dot": f"{unit}/s" for name, unit in units.items()}


def _told(field: Field, value: Any) -> str:
    """A field in words; nothing of an empty text."""
    unit = "" if field.unit.startswith("@") else spaced(field.unit)
    if value is None:
        return f"{field.about}: not known"
    if isinstance(value, str | bool | np.bool_):
        return f"{field.about}: {value}" if value != "" else ""
    array = np.asarray(value)
    if array.dtype.kind not in "iuf":
        number = len(value) if isinstance(value, Sequence) else array.size
        return f"{field.about}: {value if array.size == 1 else counted(number, 'value')}"
    if 1 <= array.size <= EACH:
        return f"{field.about}: {', '.join(f'{x:.6g}' for x in array.ravel())}{unit}"
    if not np.isfinite(array).any():
        return f"{field.about}: {array.size:,} values"
    span = f"from {np.nanmin(array):.4g} to {np.nanmax(array):.4g}{unit}"
    return f"{field.about}: {span}, {array.size:,} values"
