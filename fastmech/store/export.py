"""Result files in other formats: CSV, netCDF and npz.

Each file says all that the result file says of its section: title, request, scene, versions, command line,
settings, and of every variable unit, meaning and codes. In netCDF these are attributes, in CSV comments
before the table (``pandas.read_csv(FILE, comment="#")``), in npz a member of JSON, ``attributes.json``.
"""

from __future__ import annotations

import csv
import json
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace as replaced
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from fastmech.errors import InputError, printable
from fastmech.results import FILL, Dataset, Variable
from fastmech.store.provenance import history_line
from fastmech.store.read import Results, choose, open_results, parse_selections, take
from fastmech.store.schema import CHANGE, CONVENTIONS
from fastmech.store.write import published, readable_reasons

#: Announces a piece of work with its items and gives who is told of finished ones.
Stages: TypeAlias = "Callable[[str, int], Callable[[int], None]]"

#: Member of an npz file that explains the others.
ATTRIBUTES = "attributes.json"

#: Rows of a table that are turned into text at a time.
ROWS = 65536


def export_results(
    path: Path,
    folder: Path,
    form: str,
    *,
    section: str | None = None,
    variables: Sequence[str] = (),
    selections: Sequence[str] = (),
    replace: bool = False,
    stage: Stages = lambda name, total: lambda done: None,
    tell: Callable[[str], None] = lambda line: None,
) -> Iterator[Path]:
    """Write sections of a result file into a folder and yield the files as they are written.

    Args:
        path: result file.
        folder: for the files, made if it is missing.
        form: "csv", "nc" or "npz".
        section: only this one, with its groups; or one group, ``SECTION/GROUP``.
        variables: only these.
        selections: ``NAME=VALUE`` or ``NAME=LOW:HIGH``, see `fastmech.store.read.Section.select`.
        replace: whether files of these names may be replaced.
        stage: is told how many rows or files have been written, see `fastmech.cli.progress`.
        tell: is given a line for each coordinate of a section on what was selected.

    Raises:
        InputError: the file or a name in it is wrong, or something cannot be written.
    """
    wanted = parse_selections(selections)
    with open_results(path) as results:
        names = list(results) if section is None else [section]
        if not (wanted or variables):
            names = [
                g for g in results.groups if section is None or f"{g}/".startswith(f"{section}/")
            ] or names
        # All before the first file is written: what one section refuses leaves no other behind.
        chosen = {name: choose(results[name], wanted) for name in names}
        for name in names:
            selected = tuple(one.told for one in chosen[name].values())
            for one in selected:
                tell(f"{name}: {one}")
            dataset = take(results[name], chosen[name], variables or None)
            dataset = replaced(dataset, attrs=_told(results, name, selected))
            for target, write in _files(dataset, folder / name, form, stage):
                _publish(target, write, replace)
                yield target


def _told(results: Results, name: str, selected: tuple[str, ...]) -> dict[str, Any]:
    """All that a result file says of a section or of a group in it, the file's own attributes included."""
    scene = results.scene_of(name)
    units = ", ".join(f"{key}: {parameter.units}" for key, parameter in results.parameters.items())
    own = "format", "schema_version"
    attrs: dict[str, Any] = {key: value for key, value in results.attrs.items() if key not in own}
    attrs |= {"section": name, **{f"{CHANGE}{key}": value for key, value in scene.items()}}
    attrs |= {"scene_units": units} | results[name.partition("/")[0]].attrs | results[name].attrs
    if selected:
        attrs["selected"] = selected
    before = str(results.attrs.get("history", f"{results.attrs.get('created')}: written"))
    return attrs | {"Conventions": CONVENTIONS, "history": f"{before}\n{history_line()}"}


Writer = Callable[[Path], None]


def _files(dataset: Dataset, stem: Path, form: str, stage: Stages) -> Iterator[tuple[Path, Writer]]:
    """The files of a section, and what writes each."""
    name, total = f"{stem.name}.{form}", len(dataset)
    if form == "npz":
        yield stem.with_name(name), partial(_write_npz, dataset, stage(name, total))
    elif form == "nc":
        yield stem.with_name(name), partial(_write_netcdf, dataset, stage(name, 1))
    else:
        tables: dict[tuple[str, ...], dict[str, Variable]] = {}
        for own, variable in dataset.variables.items():
            if variable.dims != (own,):  # coordinates are columns of every table
                tables.setdefault(variable.dims, {})[own] = variable
        for dims, table in tables.items():
            advance = stage(f"rows over {', '.join(dims) or 'nothing'}", next(iter(table.values())).data.size)
            target = stem.with_name("_".join((stem.name, *dims)) + ".csv")
            yield target, partial(_write_table, dataset, table, advance)


def _write_table(
    dataset: Dataset, table: dict[str, Variable], advance: Callable[[int], None], path: Path
) -> None:
    first = next(iter(table.values()))
    columns = {dim: dataset.variables.get(dim) for dim in first.dims} | table
    flat = [variable.data.reshape(-1) for variable in table.values()]
    with path.open("w", encoding="utf-8", newline="") as file:
        file.writelines(f"# {line}".rstrip() + "\n" for line in _comments(dataset, columns))
        writer = csv.writer(file)
        writer.writerow([printable(_head(name, variable)) for name, variable in columns.items()])
        for start in range(0, first.data.size, ROWS):
            rows = np.arange(start, min(start + ROWS, first.data.size))
            places = np.unravel_index(rows, first.data.shape) if first.dims else ()
            at = zip(first.dims, places, strict=True)
            where = [dataset[dim].data[place] if dim in dataset else place for dim, place in at]
            writer.writerows(zip(*(c.tolist() for c in (*where, *(f[rows] for f in flat))), strict=True))
            advance(rows.size)


def _comments(dataset: Dataset, columns: Mapping[str, Variable | None]) -> Iterator[str]:
    """What is said of the section and of the columns of a table, line by line."""
    for name, value in dataset.attrs.items():
        lines = [printable(line, "\t") for line in str(_plain(value)).splitlines()] or [""]
        yield from (
            [f"{name}: {lines[0]}"] if len(lines) == 1 else [f"{name}:", *(f"    {line}" for line in lines)]
        )
    for name, variable in columns.items():
        if variable is not None:
            codes = [f"{code}: {meaning}" for meaning, code in variable.codes.items()]
            codes += [f"{variable.attrs[FILL]}: none"] if FILL in variable.attrs else []
            explained = f" ({', '.join(codes)})" if codes else ""
            yield printable(f"{_head(name, variable)} = {variable.long_name}{explained}")


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _head(name: str, variable: Variable | None) -> str:
    return name if variable is None or variable.units == "1" else f"{name} [{variable.units}]"


def _write_npz(dataset: Dataset, advance: Callable[[int], None], path: Path) -> None:
    about = {
        name: {"dims": v.dims, "units": v.units, "long_name": v.long_name, **v.attrs}
        for name, v in dataset.variables.items()
    }
    # Not by NumPy's savez, which takes some names of variables for its own arguments.
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, v in dataset.variables.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                data = v.data.astype(str) if v.data.dtype == object else v.data
                np.lib.format.write_array(file, data, allow_pickle=False)
            advance(1)
        text = json.dumps({"attributes": dataset.attrs, "variables": about}, default=_plain, indent=1)
        archive.writestr(ATTRIBUTES, text)


def _write_netcdf(dataset: Dataset, advance: Callable[[int], None], path: Path) -> None:
    try:
        found = dataset.to_xarray()
        whole = {name: {"_FillValue": None} for name in found.coords}  # a coordinate lacks no value
        found.to_netcdf(path, engine="h5netcdf", encoding=whole)
    except ImportError:
        raise InputError("--to nc: needs h5netcdf; install it with: pip install 'fastmech[xarray]'") from None
    advance(1)


def _publish(target: Path, write: Writer, replace: bool) -> None:
    with readable_reasons(target):
        if target.exists() and not replace:
            raise InputError(f"{target}: exists already; --fresh replaces it, --out names another folder")
        target.parent.mkdir(parents=True, exist_ok=True)
        with published(target, True) as aside:
            write(aside)
