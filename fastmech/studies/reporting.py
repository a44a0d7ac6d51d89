"""What the studies share: timing in turns, tables that are read, texts and data that are written."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from fastmech.ensembles.run import Progress
from fastmech.ensembles.threads import thread_count
from fastmech.reports import Line, table
from fastmech.results import Dataset, Variable, scene_parameters
from fastmech.scene import Scene
from fastmech.store.provenance import provenance
from fastmech.store.write import write_results

Name = TypeVar("Name")
Result = TypeVar("Result")

#: Measured turns of :func:`in_turns` after one that warms up.
TURNS = 7


@cache
def content(package: str, name: str) -> dict[str, Any]:
    """A TOML file that lies beside the modules of a package; not to be changed."""
    return tomllib.loads(resources.files(package).joinpath(name).read_text(encoding="utf-8"))


def section(
    title: str, about: str, head: Line, rows: Iterable[Line], left: Collection[int] = (0,)
) -> list[str]:
    """A heading, a paragraph (either may be empty) and a table, as Markdown; see :func:`table`."""
    return [line for text in (title, about) if text for line in (text, "")] + table(head, rows, left)


def columns(dim: str, rows: Sequence[Any], section: str) -> dict[str, Variable]:
    """Attributes of rows as variables along ``dim``, those that ``columns.toml`` has for a section."""
    found = {}
    for name, told in content(__package__, "columns.toml")[section].items():
        values = [getattr(row, name) for row in rows]
        data = np.array(values, dtype=object if values and isinstance(values[0], str) else None)
        found[name] = Variable((dim,), data, *told)
    return found


def in_turns(
    works: Mapping[Name, Callable[[], Result]],
    turns: int = TURNS,
    advance: Progress = lambda done: None,
    clock: Callable[[], float] = time.process_time,
) -> tuple[dict[Name, list[float]], dict[Name, Result]]:
    """Seconds of each turn's call, after a turn that is not counted, and what the last calls have returned.

    ``advance`` is told 1 for each call.
    """
    seconds: dict[Name, list[float]] = {name: [] for name in works}
    results: dict[Name, Result] = {}
    for turn in range(turns + 1):
        for name, work in works.items():
            began = clock()
            results[name] = work()
            if turn:
                seconds[name].append(clock() - began)
            advance(1)
    return seconds, results


def write_text(path: Path, lines: Sequence[str]) -> Path:
    """Markdown in a folder that is made where it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines).rstrip("\n") + "\n", encoding="utf-8")
    return path


def write_data(path: Path, scene: Scene, sections: Mapping[str, Dataset], began: float, **attrs: Any) -> Path:
    """A study's result file; ``began``: its first moment by ``time.perf_counter`` [s]."""
    write_results(
        path,
        scene_parameters=scene_parameters(scene),
        sections=sections,
        attrs=provenance(thread_count(None)) | attrs | {"wall_time_s": time.perf_counter() - began},
        replace=True,
    )
    return path
