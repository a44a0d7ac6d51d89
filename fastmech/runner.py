"""From a request file to a result file, and from a result file to pictures."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from fastmech.ensembles.run import Progress
from fastmech.ensembles.system import System
from fastmech.errors import InputError, StepWarning, shown
from fastmech.models.mechanism import Mechanism
from fastmech.plots.objects import SAVED, UNDRAWN, draw_saved
from fastmech.plots.style import save
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import RunContext, read_request
from fastmech.store.read import as_today, open_results
from fastmech.store.write import readable_reasons
from fastmech.tiles.run import RunReport, ScanRun, default_output
from fastmech.tiles.work import ThreadWorkers, Workers


def run_request(
    path: str | Path,
    out: str | Path | None = None,
    *,
    fresh: bool = False,
    context: RunContext | None = None,
    workers: Workers | None = None,
    tell: Callable[[str], None] = lambda line: None,
    text: str | None = None,
    mechanism: Mechanism | System | None = None,
) -> RunReport:
    """Run every scan of a request file (TOML) and write one result file; an interrupted run goes on.

    Everything is validated, and the place of the result tried, before the first scan runs. The result file is
    written when all scans have succeeded; until then finished tiles are kept in ``FILE.parts`` beside it.
    Each section of the file is one scan's dataset with the attributes ``kind``, ``wall_time_s`` and, for
    every parameter that the scan changes, ``scene_NAME``.

    Args:
        path: request file; its name alone where ``text``, the request itself, is given.
        out: result file, :func:`default_output` by default; missing folders are made.
        fresh: whether to start anew and replace an existing result file.
        context: threads to use and where progress is told.
        workers: who computes, threads of this process by default; see :mod:`fastmech.tiles.cluster`.
        tell: is given lines for the user.
        mechanism: one of your own, or a system, that the request is about.

    Raises:
        InputError: the request is wrong, the result cannot be written, or it exists and ``fresh`` is False.
        CrashedTilesError: some tiles could not be computed; the others are kept.
        Stopped: by Ctrl-C or SIGTERM; finished tiles are kept.
    """
    request = read_request(path, scan_kinds(), text, mechanism)
    target = Path(out) if out is not None else default_output(path)
    run = ScanRun(request, Path(path), target, context or RunContext(), workers or ThreadWorkers(), tell=tell)
    for name, scan in request.scans.items():
        line = scan.step_warning(request.scene_of(name))
        if line is not None:
            warnings.warn(f"scan.{name}: {line}", StepWarning, stacklevel=2)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StepWarning)  # told above, once a scan
        return run.run(fresh)


def draw_results(
    path: str | Path,
    out: str | Path | None = None,
    stage: Callable[[str, int], Progress] = lambda name, total: lambda finished: None,
    *,
    section: str | None = None,
    form: str = "png",
    tell: Callable[[str], None] = lambda line: None,
) -> Iterator[Path]:
    """Draw every section of a result file and yield the pictures as they are written.

    Names and meanings of codes are those that the file itself tells, whatever version wrote it.

    Args:
        path: result file.
        out: folder for the pictures, made if it is missing; by default the file's name without its ending.
        stage: is told how many pictures have been drawn, ``tell`` a line for each section without any.
        section: draw only this one.
        form: "png", "pdf" or "svg".

    Raises:
        InputError: the file cannot be read, has a section of unknown kind or a tile, or the folder is bad.
    """
    kinds = scan_kinds()
    with open_results(path) as results:
        names = list(results) if section is None else [section.partition("/")[0]]
        for name in names:
            if "tile" in results[name].attrs:
                raise InputError(
                    f"{path}: {name}: is a tile, which holds a piece of a section; plot the result, or a"
                    " snapshot of a scan in progress (fastmech status FILE.h5 --snapshot NOW.h5)"
                )
            kind = results[name].attrs.get("kind")
            if kind not in {*kinds, *SAVED, *UNDRAWN}:
                raise InputError(
                    f"{path}: {name}: kind = {shown(kind)} is unknown; known: {', '.join(kinds)}"
                )
        folder = Path(out) if out is not None else Path(path).with_suffix("")
        with readable_reasons(folder, "made"):
            folder.mkdir(parents=True, exist_ok=True)
        for name in names:
            kind, scene = str(results[name].attrs["kind"]), results.scene_of(name)
            if kind in kinds:
                dataset = kinds[kind].read(results[name], scene)
                draw, instead = kinds[kind].draw, kinds[kind].instead
            else:  # an object's own file
                dataset, draw, instead = results[name].load(), draw_saved, UNDRAWN.get(kind, "")
            dataset = as_today(dataset, int(results.attrs["schema_version"]))
            units = {f"unit_{key}": one.units for key, one in results.parameters.items()}
            dataset = replace(dataset, attrs={**dataset.attrs, **units})
            figures = {} if kind in UNDRAWN else draw(dataset, scene)
            if not figures:
                line = f"{path}: {name}: nothing is drawn of this section of kind {kind}{instead}"
                if section is not None:
                    raise InputError(line)
                tell(line)
            advance = stage(f"{name}: pictures", len(figures))
            for what, figure in figures.items():
                picture = folder / f"{name}_{what}.{form}"
                with readable_reasons(picture):
                    save(figure, picture)
                advance(1)
                yield picture
