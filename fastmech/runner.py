"""From a request file to a result file, and from a result file to pictures."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from fastmech.ensembles.run import Progress
from fastmech.ensembles.threads import thread_count
from fastmech.errors import InputError
from fastmech.plots.style import save
from fastmech.results import Dataset, Variable
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import Request, RunContext, read_request
from fastmech.scene import Scene
from fastmech.store.provenance import provenance
from fastmech.store.read import Results, open_results
from fastmech.store.stream import Stream, write_stream
from fastmech.store.write import check_writable, write_results

#: Prefix of the attributes of a section that hold its changes of the scene.
CHANGE = "scene_"


def default_output(path: str | Path) -> Path:
    """Where the results of a request file go unless told otherwise."""
    return Path("results") / f"{Path(path).stem}.h5"


def run_request(
    path: str | Path,
    out: str | Path | None = None,
    *,
    fresh: bool = False,
    context: RunContext | None = None,
) -> Path:
    """Run every scan of a request file and write one result file.

    Everything is validated, and the place of the result tried, before the first scan runs. Nothing is
    written unless all scans succeed. Each section of the file is one scan's dataset with the attributes
    ``kind``, ``wall_time_s`` and, for every parameter that the scan changes, ``scene_NAME``.

    Args:
        path: request file (TOML).
        out: result file, :func:`default_output` by default; missing folders are made.
        fresh: whether an existing result file may be replaced.
        context: threads to use and where progress is told.

    Returns:
        the result file.

    Raises:
        InputError: the request is wrong, the result cannot be written, or it exists and ``fresh`` is False.
    """
    context = context or RunContext()
    request = read_request(path, scan_kinds())
    target = Path(out) if out is not None else default_output(path)
    check_writable(target, replace=fresh)
    started = time.perf_counter()
    sections = {name: _run_scan(request, name, context) for name in request.scans}
    parameters = _parameters(request.scene)

    def attrs() -> dict[str, str | int | float]:
        return {
            **provenance(thread_count(context.threads)),
            "title": request.title,
            "request_file": Path(path).name,
            "request": request.text,
            "wall_time_s": time.perf_counter() - started,
        }

    whole = {name: section for name, section in sections.items() if isinstance(section, Dataset)}
    if len(whole) < len(sections):
        write_stream(target, scene_parameters=parameters, sections=sections, attrs=attrs, replace=fresh)
    else:
        write_results(target, scene_parameters=parameters, sections=whole, attrs=attrs(), replace=fresh)
    return target


def scene_of_section(results: Results, name: str) -> dict[str, float]:
    """Parameters of the scene of one section: the file's with the section's changes."""
    attrs = results[name].attrs
    return {key: float(attrs.get(f"{CHANGE}{key}", value)) for key, value in results.scene.items()}


def draw_results(path: str | Path, out: str | Path | None = None) -> Iterator[Path]:
    """Draw every section of a result file and yield the pictures (PNG) as they are written.

    Args:
        path: result file.
        out: folder for the pictures, made if it is missing; by default the file's name without its ending.

    Raises:
        InputError: the file cannot be read, holds a section of unknown kind, or the folder is unwritable.
    """
    kinds = scan_kinds()
    with open_results(path) as results:
        for name in results:
            if results[name].attrs.get("kind") not in kinds:
                kind = results[name].attrs.get("kind")
                raise InputError(f"{path}: {name}: kind = {kind!r} is unknown; known: {', '.join(kinds)}")
        folder = Path(out) if out is not None else Path(path).with_suffix("")
        _make_folder(folder)
        for name in results:
            kind, scene = kinds[results[name].attrs["kind"]], scene_of_section(results, name)
            figures = kind.draw(kind.read(results[name], scene), scene)
            for what, figure in figures.items():
                picture = folder / f"{name}_{what}.png"
                try:
                    save(figure, picture)
                except OSError as error:
                    raise InputError(f"{picture}: cannot be written: {error.strerror}") from None
                yield picture


def _run_scan(request: Request, name: str, context: RunContext) -> Dataset | Stream:
    def stage(what: str, total: int) -> Progress:
        return context.stage(f"{name}: {what}", total)

    scan = request.scans[name]
    started = time.perf_counter()
    try:
        dataset = scan.run(request.scene_of(name), replace(context, stage=stage))
    except InputError as error:
        raise InputError(f"scan.{name}: {error}") from None
    seconds = time.perf_counter() - started
    changes = {f"{CHANGE}{key}": float(value) for key, value in scan.scene.items()}
    if isinstance(dataset, Stream):
        fixed = Dataset(dataset.fixed.variables, {"kind": scan.kind, **changes, **dataset.fixed.attrs})
        return replace(dataset, fixed=fixed)
    return Dataset(dataset.variables, {"kind": scan.kind, **changes, **dataset.attrs, "wall_time_s": seconds})


def _parameters(scene: Scene) -> dict[str, Variable]:
    return {
        name: Variable((), np.array(value), unit, about)
        for name, (value, unit, about) in scene.described().items()
    }


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror}") from None
