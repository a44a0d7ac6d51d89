"""What a result file holds: for `fastmech info FILE`.

A file may come from anywhere, so its texts are cut and their control characters escaped.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from fastmech.errors import printable
from fastmech.objects import spaced
from fastmech.results import FILL, Variable
from fastmech.store.read import Results, Section

_MAX_TEXTS = 4

#: Characters of a text that are shown.
_LONGEST = 1000


def summarize(results: Results, section: str | None = None) -> RenderableType:
    """Origin, the scene's parameters, and what each section holds, in 100 columns.

    Or a table of the variables of one ``section`` or ``SECTION/GROUP``, which reads them.

    Raises:
        InputError: there is no such section, or a variable's data are damaged.
    """
    if section is not None:
        return _in_full(results, section)
    scene = [
        (n, repr(results.scene[n]), spaced(v.units).strip(), v.long_name)
        for n, v in results.parameters.items()
    ]
    parts: list[RenderableType] = [
        _attributes(_origin(results.attrs), str(results.path)), "",
        _table("scene", ("parameter", "value", "units", "meaning"), scene), "",
    ]  # fmt: skip
    for name in results.groups:
        parts += [_table(name, ("", ""), _overview(results[name])), ""]
    command = f"fastmech info {results.path} --section NAME"
    return Group(*parts, _text(f"Values and meaning of a section's variables: {command}"))


def _in_full(results: Results, section: str) -> RenderableType:
    """Every variable of a section and of its groups: size, unit, values and meaning."""
    results[section]  # says what there is
    parts: list[RenderableType] = []
    for name in results.groups:
        if name == section or name.startswith(f"{section}/"):
            head = ("variable", "dimensions", "units", "values", "meaning")
            parts.append(_table(name, head, map(_variable, results[name].items())))
            if results[name].attrs:
                parts.append(_attributes(results[name].attrs))
            parts.append("")
    return Group(*parts[:-1])


def _origin(attrs: dict[str, Any]) -> dict[str, Any]:
    """Attributes of a file that a reader asks for, versions in one line."""
    ends = "_version"
    versions = [f"{name.removesuffix(ends)} {v}" for name, v in attrs.items() if name.endswith(ends)]
    others = {n: v for n, v in attrs.items() if not n.endswith(ends) and n != "asked_for"}
    return others | ({"versions": ", ".join(versions)} if versions else {})


def _overview(held: Section) -> Iterator[tuple[str, str]]:
    """Attributes of a section, and names and units of its variables by their dimensions."""
    yield from ((name, str(value)) for name, value in held.attrs.items())
    together: dict[str, dict[str, list[tuple[str, str]]]] = {}
    for name, variable in held.items():
        stem, _, number = name.rpartition("_")
        family = stem if stem and number.isdecimal() else name
        of_size = together.setdefault(_sizes(variable) or "single", {})
        of_size.setdefault(family, []).append((name, variable.units))
    for sizes, families in together.items():
        yield sizes, ", ".join(map(_family, families.values()))


def _family(members: list[tuple[str, str]]) -> str:
    """Names and units of variables that only a number tells apart."""
    (first, unit), (last, _) = members[0], members[-1]
    name = first if first == last else f"{first} to {last.rpartition('_')[2]}"
    same = len({own for _, own in members}) == 1 and unit not in ("", "1")
    return f"{name} [{unit}]" if same else name


def _sizes(variable: Variable) -> str:
    return ", ".join(f"{dim} {size}" for dim, size in variable.sizes.items())


def _variable(named: tuple[str, Variable]) -> tuple[str, ...]:
    """The row of a variable."""
    name, v = named
    return name, _sizes(v), spaced(v.units).strip(), describe_values(v), v.long_name


def describe_values(variable: Variable) -> str:
    """The values in a few words: counts of flags, a single value, distinct texts, or the range."""
    data = variable.data
    if data.size == 0:
        return "empty"
    if variable.codes:
        return _flag_counts(variable)
    if data.dtype == object:
        distinct = list(dict.fromkeys(data.flat))
        shown = ", ".join(distinct[:_MAX_TEXTS])
        return shown if len(distinct) <= _MAX_TEXTS else f"{shown}, ... ({len(distinct)} distinct)"
    none = np.isnan(data) if data.dtype.kind == "f" else data == variable.attrs.get(FILL)
    known = data[~none]
    missing = f"{data.size - known.size} {'nan' if data.dtype.kind == 'f' else 'none'}"
    if known.size == 0:
        return missing
    low, high = known.min(), known.max()
    text = f"{low:.6g}" if low == high else f"{low:.6g} .. {high:.6g}"
    return f"{text}, {missing}" if none.any() else text


def _flag_counts(variable: Variable) -> str:
    fill = {"none": variable.attrs[FILL]} if FILL in variable.attrs else {}
    every = (fill | variable.codes).items()
    counts = [(meaning, int(np.count_nonzero(variable.data == value))) for meaning, value in every]
    counts.append(("unexplained", variable.data.size - sum(count for _, count in counts)))
    return ", ".join(f"{meaning} {count}" for meaning, count in counts if count)


def _attributes(attrs: dict[str, Any], title: str = "") -> Table:
    rows = []
    for name, value in attrs.items():
        lines = value.strip().count("\n") + 1 if isinstance(value, str) else 1
        rows.append((name, f"{lines} lines of text" if lines > 1 else value))
    return _table(title, ("", ""), rows)


def _table(title: str, head: Sequence[str], rows: Iterable[Sequence[Any]]) -> Table:
    look: dict[str, Any] = {"title_justify": "left", "title_style": "bold", "box": box.SIMPLE_HEAD}
    table = Table(title=_text(title) if title else None, show_header=any(head), pad_edge=False, **look)
    for k, name in enumerate(head):
        table.add_column(name, overflow="fold", min_width=None if k else 8, style="" if k else "bold")
    for row in rows:
        table.add_row(*map(_text, row))
    return table


def _text(value: Any) -> Text:
    """A value as plain text: brackets are no markup, control characters no commands to a terminal."""
    text = str(value)
    return Text(printable(text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."))
