"""What a request file holds: a scene and named scans of it, validated as a whole before anything runs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from fastmech.ensembles.run import Progress
from fastmech.errors import InputError
from fastmech.integrators.methods import find_method
from fastmech.results import Dataset, check_name
from fastmech.scene import Scene, explain, nearest, read_toml
from fastmech.store.stream import Stream

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fastmech.store.read import Section


@dataclass(frozen=True)
class RunContext:
    """What a scan may use while it runs."""

    threads: int | None = None  #: threads to use, all processors by default
    stage: Callable[[str, int], Progress] = lambda name, total: lambda finished: None
    """``stage(name, total)`` announces a piece of work; its result is told what has been finished since."""


def _known_method(name: str) -> str:
    find_method(name)
    return name


#: A field that names an integration method.
MethodName = Annotated[str, AfterValidator(_known_method)]


class Scan(BaseModel, ABC):
    """A kind of scan: its request (the fields), how it runs and how its result is drawn.

    To add one, write a module in :mod:`fastmech.scan_types` with a sub-class: the fields of its request with
    defaults and limits, ``kind`` (the name in request files), ``run`` and ``draw``. It is found by itself.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    kind: ClassVar[str]

    scene: dict[str, Any] = Field(default={}, description="parameters that differ from the file's scene")

    def check(self, scene: Scene) -> None:
        """Refuse a scene that this scan cannot work with, before any scan of the file runs.

        Raises:
            InputError: the scene is none for this scan.
        """

    @abstractmethod
    def run(self, scene: Scene, context: RunContext) -> Dataset | Stream:
        """Compute the result, or say how it is computed while it is written. ``scene`` has the changes."""

    @staticmethod
    def read(section: Section, scene: Mapping[str, float]) -> Dataset:
        """What ``draw`` needs of a result file's section; all of it, unless less will do."""
        return section.load()

    @staticmethod
    @abstractmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Pictures of a result, by name. ``scene`` are the scene's parameters with this scan's changes."""


#: What ``error_estimate`` of a section is.
HALVING = "largest difference of a state [rad or rad/s] from the same run with half the step"


def failures(failed: NDArray[np.bool_]) -> dict[str, int]:
    """The attribute of a section that tells how many of its trajectories have failed."""
    return {"failed": int(np.count_nonzero(failed))}


@dataclass(frozen=True)
class Request:
    """A request file: title, scene and scans by name, with the text it was read from."""

    title: str
    scene: Scene
    scans: Mapping[str, Scan]
    text: str

    def scene_of(self, name: str) -> Scene:
        """The scene of one scan: the file's with the scan's own changes."""
        return self.scene.replace(**self.scans[name].scene)


def read_request(path: str | Path, kinds: Mapping[str, type[Scan]]) -> Request:
    """Read and validate a request file.

    Raises:
        InputError: the file cannot be read, or anything in it is unknown, of a wrong type or out of range.
    """
    table = read_toml(path)
    allowed = ["title", "scene", "scan"]
    for name in table:
        if name not in allowed:
            raise InputError(f"{name}: unknown name; {nearest(name, allowed)}")
    title = table.get("title", Path(path).stem)
    if not isinstance(title, str):
        raise InputError(f"title = {title!r}: must be a text")
    scene = Scene(**_table(table.get("scene", {}), "scene"))
    scans = _table(table.get("scan", {}), "scan")
    if not scans:
        raise InputError(
            f"{path}: asks for no scan; write a table [scan.NAME] with kind = one of {list(kinds)}"
        )
    request = Request(
        title=title,
        scene=scene,
        scans={name: _scan(name, entry, kinds) for name, entry in scans.items()},
        text=Path(path).read_text(encoding="utf-8"),
    )
    for name, scan in request.scans.items():
        try:
            scan.check(request.scene_of(name))
        except InputError as error:
            raise InputError(f"scan.{name}.{error}") from None
    return request


def _table(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{where} = {value!r}: must be a table")
    return value


def _scan(name: str, value: Any, kinds: Mapping[str, type[Scan]]) -> Scan:
    where = f"scan.{name}"
    check_name(name, where)
    if name in Scene.model_fields:
        raise InputError(f"{where}: is the name of a parameter of the scene; choose another")
    entry = dict(_table(value, where))
    kind = entry.pop("kind", None)
    if kind is None:
        raise InputError(f"{where}.kind: missing; allowed: {', '.join(kinds)}")
    if not isinstance(kind, str) or kind not in kinds:
        raise InputError(f"{where}.kind = {kind!r}: unknown; {nearest(str(kind), list(kinds))}")
    try:
        return kinds[kind](**entry)
    except ValidationError as error:
        raise InputError(explain(error, where, kinds[kind])) from None
