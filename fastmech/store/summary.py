"""What a result file holds, on one page: for `fastmech info FILE`.

A file may come from anywhere, so its texts are cut and their control characters escaped.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fastmech.errors import printable
from fastmech.results import FILL, Variable

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table
    from rich.text import Text

    from fastmech.store.read import Results, Section

_MAX_TEXTS = 4

#: Characters of a text that are shown.
_LONGEST = 400


def summarize(results: Results, section: str | None = None) -> RenderableType:
    """Provenance, the scene's parameters and a table of the variables of each section, in 100 columns.

    Reads every variable, one at a time.

    Args:
        results: the file.
        section: show only this section (or ``SECTION/GROUP``), without provenance and parameters.

    Raises:
        InputError: there is no such section, or a variable's data are damaged.
    """
    from rich.console import Group

    parts: list[RenderableType] = []
    if section is None:
        parts = [_attributes(results.attrs, str(results.path)), "", _parameters(results), ""]
    else:
        results[section]  # says what there is
    for name in results.groups:
        if section is None or name == section or name.startswith(f"{section}/"):
            parts += [_section(name, results[name]), ""]
    return Group(*parts[:-1])


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
    missing = data.size - known.size
    if known.size == 0:
        return f"{missing} {'nan' if data.dtype.kind == 'f' else 'none'}"
    low, high = known.min(), known.max()
    text = f"{low:.6g}" if low == high else f"{low:.6g} .. {high:.6g}"
    return f"{text}, {missing} {'nan' if data.dtype.kind == 'f' else 'none'}" if missing else text


def _flag_counts(variable: Variable) -> str:
    data = variable.data
    counts = []
    unexplained = data.size
    fill = {"none": variable.attrs[FILL]} if FILL in variable.attrs else {}
    for meaning, value in (fill | variable.codes).items():
        count = int(np.count_nonzero(data == value))
        unexplained -= count
        if count:
            counts.append(f"{meaning} {count}")
    if unexplained:
        counts.append(f"unexplained {unexplained}")
    return ", ".join(counts)


def _attributes(attrs: dict[str, Any], title: str) -> Table:
    table = _table(title, {"": {"no_wrap": True, "style": "bold"}, " ": {"overflow": "fold"}}, False)
    for name, value in attrs.items():
        lines = value.strip().count("\n") + 1 if isinstance(value, str) else 1
        table.add_row(_text(name), _text(f"{lines} lines of text" if lines > 1 else value))
    return table


def _parameters(results: Results) -> Table:
    columns: dict[str, dict[str, Any]] = {
        "parameter": {"no_wrap": True, "style": "bold"},
        "value": {"justify": "right", "no_wrap": True},
        "units": {"no_wrap": True},
        "meaning": {"overflow": "fold"},
    }
    table = _table("scene", columns)
    for name, parameter in results.parameters.items():
        value = f"{results.scene[name]!r}"
        table.add_row(_text(name), value, _text(parameter.units), _text(parameter.long_name))
    return table


def _section(name: str, section: Section) -> RenderableType:
    from rich.console import Group

    columns: dict[str, dict[str, Any]] = {"variable": {"style": "bold", "min_width": 8}}
    columns |= {title: {} for title in ("dimensions", "units", "values", "meaning")}
    table = _table(name, {title: {"overflow": "fold", **how} for title, how in columns.items()})
    for variable_name, variable in section.items():
        sizes = ", ".join(f"{dim} {size}" for dim, size in variable.sizes.items())
        cells = (variable_name, sizes, variable.units, describe_values(variable), variable.long_name)
        table.add_row(*map(_text, cells))
    return Group(table, _attributes(section.attrs, "")) if section.attrs else table


def _table(title: str, columns: dict[str, dict[str, Any]], show_header: bool = True) -> Table:
    from rich import box
    from rich.table import Table

    look: dict[str, Any] = {"title_justify": "left", "title_style": "bold", "box": box.SIMPLE_HEAD}
    table = Table(title=_text(title) if title else None, show_header=show_header, pad_edge=False, **look)
    for head, how in columns.items():
        table.add_column(head, **how)
    return table


def _text(value: Any) -> Text:
    """A value as plain text: brackets are no markup, control characters no commands to a terminal."""
    from rich.text import Text

    text = str(value)
    return Text(printable(text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."))
