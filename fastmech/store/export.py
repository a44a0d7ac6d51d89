"""Result files in other formats: CSV, netCDF and npz."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from fastmech.errors import InputError
from fastmech.results import Dataset, Variable
from fastmech.store.read import open_results
from fastmech.store.select import choose, parse_selections, take
from fastmech.store.write import _aside, _readable_reasons

#: Announces a piece of work with its items and gives who is told of finished ones.
Stages: TypeAlias = "Callable[[str, int], Callable[[int], None]]"

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
        section: only this one.
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
        names = [section] if section is not None else list(results)
        # All before the first file is written: what one section refuses leaves no other behind.
        chosen = {name: choose(results[name], wanted) for name in names}
        for name in names:
            dataset = take(results[name], chosen[name], variables or None)
            for one in chosen[name].values():
                tell(f"{name}: {one.told}")
            for target, write in _WRITERS[form](dataset, folder / name, stage):
                _publish(target, write, replace)
                yield target


Writer = Callable[[Path], None]


def _as_csv(dataset: Dataset, stem: Path, stage: Stages) -> Iterator[tuple[Path, Writer]]:
    tables: dict[tuple[str, ...], dict[str, Variable]] = {}
    for name, variable in dataset.variables.items():
        if variable.dims != (name,):  # coordinates are columns of every table
            tables.setdefault(variable.dims, {})[name] = variable
    for dims, table in tables.items():
        target = stem.with_name("_".join((stem.name, *dims)) + ".csv")
        yield target, partial(_write_table, dataset, dims, table, stage)


def _write_table(
    dataset: Dataset, dims: tuple[str, ...], table: dict[str, Variable], stage: Stages, path: Path
) -> None:
    sizes = [dataset.sizes[dim] for dim in dims]
    heads = [_head(dim, dataset.variables.get(dim)) for dim in dims]
    flat = [variable.data.reshape(-1) for variable in table.values()]
    total = int(np.prod(sizes, dtype=np.int64))
    advance = stage(f"rows over {', '.join(dims) or 'nothing'}", total)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*heads, *(_head(name, variable) for name, variable in table.items())])
        for start in range(0, total, ROWS):
            rows = slice(start, min(start + ROWS, total))
            places = np.unravel_index(np.arange(rows.start, rows.stop), sizes) if dims else ()
            columns = [
                dataset.variables[dim].data[place] if dim in dataset.variables else place
                for dim, place in zip(dims, places, strict=True)
            ]
            writer.writerows(zip(*(c.tolist() for c in (*columns, *(f[rows] for f in flat))), strict=True))
            advance(rows.stop - rows.start)
        file.flush()
        os.fsync(file.fileno())


def _head(name: str, variable: Variable | None) -> str:
    return name if variable is None or variable.units == "1" else f"{name} [{variable.units}]"


def _as_npz(dataset: Dataset, stem: Path, stage: Stages) -> Iterator[tuple[Path, Writer]]:
    def write(path: Path) -> None:
        arrays: dict[str, Any] = {
            name: v.data.astype(str) if v.data.dtype == object else v.data
            for name, v in dataset.variables.items()
        }
        advance = stage(f"{stem.name}.npz", 1)
        with path.open("wb") as file:
            np.savez_compressed(file, **arrays)
        advance(1)

    yield stem.with_name(f"{stem.name}.npz"), write


def _as_netcdf(dataset: Dataset, stem: Path, stage: Stages) -> Iterator[tuple[Path, Writer]]:
    def write(path: Path) -> None:
        advance = stage(f"{stem.name}.nc", 1)
        try:
            dataset.to_xarray().to_netcdf(path, engine="h5netcdf")
            advance(1)
        except ImportError:
            raise InputError(
                "--to nc: needs h5netcdf; install it with: pip install 'fastmech[xarray]'"
            ) from None

    yield stem.with_name(f"{stem.name}.nc"), write


_WRITERS: dict[str, Callable[[Dataset, Path, Stages], Iterator[tuple[Path, Writer]]]] = {
    "csv": _as_csv,
    "nc": _as_netcdf,
    "npz": _as_npz,
}


def _publish(target: Path, write: Writer, replace: bool) -> None:
    with _readable_reasons(target):
        if target.exists() and not replace:
            raise InputError(f"{target}: exists already; --fresh replaces it, --out names another folder")
        target.parent.mkdir(parents=True, exist_ok=True)
        aside = _aside(target)
        try:
            write(aside)
            os.replace(aside, target)
        finally:
            aside.unlink(missing_ok=True)
