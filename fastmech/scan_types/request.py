"""What a request file holds: a scene, scans with their axes, and how each scan is divided into tiles."""

from __future__ import annotations

import math
import runpy
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from fastmech.arrays import Floats
from fastmech.basins.convergence import SUBSTEPS, rounds_until
from fastmech.basins.measures.labels import check_angles
from fastmech.ensembles import checks
from fastmech.ensembles.lanes import MOST_STEPS
from fastmech.ensembles.status import failure_counts, failure_line
from fastmech.ensembles.system import System
from fastmech.errors import InputError, one_line, shown, shown_name
from fastmech.integrators.methods import find_method
from fastmech.models.checks import check_values
from fastmech.models.mechanism import Mechanism
from fastmech.results import Dataset, Variable, check_name
from fastmech.scene import PARAMETERS, STATE, Number, Scene, explain, nearest, parse_toml, read_text, spread
from fastmech.slider.capture.steps import fastest_followed, shortest_step
from fastmech.slider.coefficients import reduce
from fastmech.store.write import Stream

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fastmech.ensembles.run import Progress
    from fastmech.store.read import Section

#: Values of the longest axis.
MOST_VALUES = 100_000

Value = Annotated[Number, Field(strict=True, allow_inf_nan=False)]


class Axis(BaseModel):
    """Values that rise or fall throughout: ``values``, or ``num`` from ``start`` to ``stop``."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    start: Value | None = None
    stop: Value | None = None
    num: int | None = Field(None, ge=1, le=MOST_VALUES)
    spacing: Literal["linear", "log"] = "linear"
    values: list[Value] | None = Field(None, min_length=1, max_length=MOST_VALUES)

    @model_validator(mode="before")
    @classmethod
    def _one_of_both(cls, given: Any) -> Any:
        if not isinstance(given, Mapping):
            raise ValueError("must be a table { start, stop, num } or { values = [...] }")
        spaced = ("start", "stop", "num")
        beside = [name for name in (*spaced, "spacing") if name in given]
        if "values" in given and beside:
            raise ValueError(f"values say all; leave out {', '.join(beside)}")
        for name in spaced:
            if not {name, "values"} & given.keys():
                raise ValueError(f"{name} is missing; give start, stop and num, or values")
        return given

    @model_validator(mode="after")
    def _rise_or_fall(self) -> Axis:
        if self.values is None and self.spacing == "log":
            assert self.start is not None
            assert self.stop is not None
            if not (min(self.start, self.stop) > 0.0 or max(self.start, self.stop) < 0.0):
                raise ValueError("start and stop must have one sign and not be 0 where spacing is log")
        steps = np.diff(self.array)
        if not ((steps > 0.0).all() or (steps < 0.0).all()):
            raise ValueError("must rise or fall throughout, no value twice")
        return self

    @property
    def array(self) -> Floats:
        """The values."""
        if self.values is not None:
            return np.array(self.values, dtype=np.float64)
        spaced: Any = np.geomspace if self.spacing == "log" else np.linspace
        return np.asarray(spaced(self.start, self.stop, self.num), dtype=np.float64)

    @property
    def rises(self) -> bool:
        """Whether the values rise."""
        values = self.array
        return bool(values[-1] >= values[0])

    @property
    def size(self) -> int:
        """How many they are."""
        return self.num or len(self.values or ())


def values_of(axes: Mapping[str, Axis]) -> dict[str, Floats]:
    """The values of axes by their names."""
    return {name: axis.array for name, axis in axes.items()}


def axis_variables(system: Scene | Mechanism | System, axes: Mapping[str, Floats]) -> dict[str, Variable]:
    """Axes over parameters as the coordinates of a section."""
    described = system.described()
    return {name: Variable((name,), values, *described[name][1:]) for name, values in axes.items()}


# Checks of requests: each raises an InputError that names the field, the value and what is allowed.


def check_axes(scene: Scene | Mechanism, axes: Mapping[str, Axis]) -> None:
    """Refuse axes of a map that are no parameters, or too many."""
    if len(axes) > 3:
        raise InputError("axes: must be three axes at most")
    check_names("axes.", axes, scene.described(), "unknown parameter")


def check_size(where: str, axes: Mapping[str, Axis], what: str, most: int, numbers: int) -> None:
    """Refuse grids of more points than can be, or than fit into memory at so many ``numbers`` a point."""
    total = math.prod(axis.size for axis in axes.values())
    if total > most:
        raise InputError(f"{where}: ask for {total:.3g} {what}, at most {most:.0e} are allowed")
    checks.memory(total * numbers, 1, f"{where}: {total:.3g} {what}", f"fewer {what}")


def check_steps(where: str, t_end: float, dt: float) -> None:
    """Refuse runs of more fixed steps than are possible, with half the step too."""
    if not 2.0 * t_end <= MOST_STEPS * dt:
        raise InputError(
            f"{where} = {t_end:g} s: takes {t_end / dt:.3g} steps of {dt:g} s, at most {MOST_STEPS / 2:.0e} "
            "are possible"
        )


def check_duration(scene: Scene, t_end: float, dt: float | None) -> None:
    """Refuse runs of basins whose finest computation would take more steps than are possible."""
    coarse = shortest_step(reduce(scene)) if dt is None else dt
    rounds_until(t_end, coarse * SUBSTEPS[0] / SUBSTEPS[-1])


def check_rising(where: str, axes: Mapping[str, Axis]) -> None:
    """Refuse axes whose values fall."""
    for name, axis in axes.items():
        if not axis.rises:
            raise InputError(
                f"{where}{name}: falls from {axis.array[0]:g} to {axis.array[-1]:g}, must rise; "
                "give its values the other way round"
            )


def check_parameters(scene: Scene | Mechanism, axes: Mapping[str, Axis], where: str) -> None:
    """Refuse values that the scene does not accept: what it allows of a parameter is an interval.

    A mechanism is checked on the grid of all axes.
    """
    if isinstance(scene, Mechanism) and axes:
        grid = np.meshgrid(*(axis.array for axis in axes.values()))
        check_values(scene, dict(zip(axes, grid, strict=True)), f"{where}.")
        return
    for name, axis in axes.items():
        for value in (axis.array.min(), axis.array.max()):
            try:
                scene.replace(**{name: float(value)})
            except InputError as error:
                raise InputError(f"{where}.{name}: {error}") from None


def check_starts(where: str, scene: Scene, starts: Mapping[str, ArrayLike]) -> None:
    """Refuse angles [rad] that must be degrees, and rates [rad/s] that no step of a basin map can follow."""
    fastest = fastest_followed(reduce(scene))
    for name, values in starts.items():
        largest = float(np.abs(values).max())
        check_angles(where + name, name, values)
        if name in STATE[2:] and largest > fastest:
            raise InputError(
                f"{where}{name} = {largest:g} rad/s: steps follow {fastest:.3g} rad/s here at most"
            )


def check_names(where: str, names: Iterable[str], known: Iterable[str], what: str) -> None:
    """Refuse names that are none of the known ones; ``what`` they are, such as "unknown parameter"."""
    for name in names:
        if name not in known:
            raise InputError(f"{where}{name}: {what} {shown(name)}; {nearest(name, list(known))}")


#: Gives a finished tile by its index.
Tiles: TypeAlias = "Callable[[int], Dataset]"


def tile_of(arrays: Mapping[str, Any], attrs: Mapping[str, Any] | None = None) -> Dataset:
    """Arrays as a tile holds them, without units and meanings; those that are None are left out."""
    there = {name: np.asarray(array) for name, array in arrays.items() if array is not None}
    return Dataset(
        {n: Variable(tuple(f"{n}_{k}" for k in range(a.ndim)), a) for n, a in there.items()}, attrs or {}
    )


@dataclass(frozen=True)
class RunContext:
    """What a scan may use while it runs."""

    threads: int | None = None  #: threads to use, all processors by default
    stage: Callable[[str, int], Progress] = lambda name, total: lambda finished: None
    """``stage(name, total)`` announces a piece of work; its result is told what has been finished since."""
    check: Callable[[], None] = lambda: None
    """Called now and then within a tile: raises KeyboardInterrupt where the work is to end."""

    @property
    def working(self) -> dict[str, Any]:
        """The same as keywords of what computes: threads, and whom it tells of its progress."""
        return {"threads": self.threads, "progress": lambda finished: self.check()}


class Tiling(ABC):
    """A section as tiles: pieces of work that need nothing of each other and give the same bits anywhere.

    How a scan is divided depends on its request alone, never on threads or workers. A tile should take
    seconds: it is what an interruption costs, and its result (some 100 MB at most) is held in memory.

    Attributes:
        what: what the items of work are, for progress, such as ``"disturbed trajectories"``.
        count: number of tiles.
    """

    what: str
    count: int

    def items(self, index: int) -> int:
        """How many items of work (points, trajectories) a tile has."""
        return 1

    @abstractmethod
    def compute(self, index: int, context: RunContext) -> Dataset:
        """Compute a tile."""

    @abstractmethod
    def assemble(self, tile: Tiles) -> Dataset | Stream:
        """The section of all its tiles; a stream takes one tile at a time into memory."""

    def missing(self, index: int) -> Dataset | None:
        """What stands for a tile that is not there yet in a look at a running scan, if that can be."""
        return None


@dataclass
class Each(Tiling):
    """Some pieces of work, one a tile."""

    what: str
    count: int
    piece: Callable[[int], Dataset]  #: gives a piece by its number
    join: Callable[[list[Dataset]], Dataset]  #: makes the section of all pieces

    def compute(self, index: int, context: RunContext) -> Dataset:
        """Compute a piece."""
        return self.piece(index)

    def assemble(self, tile: Tiles) -> Dataset:
        """Join the pieces."""
        return self.join([tile(index) for index in range(self.count)])


def blocks(total: int, length: int) -> list[slice]:
    """Neighbours of ``total`` items, so many a block."""
    return [slice(k, min(k + length, total)) for k in range(0, total, length)]


class Planes(Tiling):
    """Tiles that hold some planes of the first axis of a grid.

    Args:
        axes: the grid's values by name.
        points: of a tile, about.
        spread: whether the planes of a tile lie all over the axis: tiles then take about as long as others,
            so that progress tells the time left. Else they are neighbours.

    Attributes:
        nothing: what stands at a point that is not computed yet, by the names of the tiles' arrays.
        of_planes: those of them that have one entry a plane.
    """

    nothing: Mapping[str, ArrayLike]
    of_planes: tuple[str, ...] = ()

    def __init__(self, axes: dict[str, NDArray[Any]], points: int, spread: bool = False) -> None:
        self.axes = axes
        self.first, *others = axes
        self.others = tuple(len(axes[other]) for other in others)
        length, planes = len(axes[self.first]), max(1, points // math.prod(self.others))
        self.count = -(-length // planes)
        apart = [slice(k, length, self.count) for k in range(self.count)]
        self.parts = apart if spread else blocks(length, planes)

    def grid(self, index: int) -> tuple[int, ...]:
        """Shape of a tile's part of the grid."""
        return (len(range(len(self.axes[self.first]))[self.parts[index]]), *self.others)

    def axes_of(self, index: int) -> dict[str, NDArray[Any]]:
        """The axes of that part."""
        return {**self.axes, self.first: self.axes[self.first][self.parts[index]]}

    def items(self, index: int) -> int:
        """Points."""
        return math.prod(self.grid(index))

    def assemble(self, tile: Tiles) -> Dataset | Stream:
        """Put every plane in its place."""
        tiles = [tile(index) for index in range(self.count)]
        arrays = self._empty((len(self.axes[self.first]), *self.others))
        for name, array in arrays.items():
            for part, one in zip(self.parts, tiles, strict=True):
                array[part] = one[name].data
        return self.section(arrays, tiles)

    def section(self, arrays: dict[str, Any], tiles: list[Dataset]) -> Dataset:
        """The section of the arrays over the whole grid; the tiles' attributes tell more."""
        raise NotImplementedError

    def missing(self, index: int) -> Dataset | None:
        """Points that have not been computed."""
        return tile_of(self._empty(self.grid(index)), {"steps": 0})

    def _empty(self, grid: tuple[int, ...]) -> dict[str, NDArray[Any]]:
        shapes = {name: grid[:1] if name in self.of_planes else grid for name in self.nothing}
        return {n: np.full((*shapes[n], *np.shape(one)), one) for n, one in self.nothing.items()}


def _known_method(name: str) -> str:
    try:
        return find_method(name).name
    except InputError as error:
        raise ValueError(str(error).removeprefix(f"method = {shown(name)}: ")) from None


#: A field that names an integration method.
MethodName = Annotated[str, AfterValidator(_known_method)]

#: The same; by default ``dop853``, or ``radau5`` where the damper would set the steps of explicit methods.
UsualMethod = MethodName | None

#: Seed of random numbers, as long as those that NumPy recommends.
Seed = Annotated[int, Field(ge=0, lt=2**128)]

#: Characters of the longest name of a scan, which is part of file names.
LONGEST_NAME = 100


class Scan(BaseModel, ABC):
    """A kind of scan: its request (the fields), how its work is divided and how its result is drawn.

    To add one, write a module in :mod:`fastmech.scan_types` with a sub-class: the fields of its request with
    defaults and limits, ``kind`` (the name in request files), ``tiling`` and ``draw``. It is found by itself.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    kind: ClassVar[str]

    of_mechanisms: ClassVar[bool] = False  #: whether it works for any mechanism, not for the paper's alone
    of_systems: ClassVar[bool] = False  #: whether it works for systems of one's own
    instead: ClassVar[str] = ""  #: of a kind without pictures, behind that line: what shows the same
    taken: ClassVar[frozenset[str]] = frozenset()  #: names of results that no coordinate may have

    scene: dict[str, Any] = Field(default={}, description="parameters that differ from the file's scene")

    def check(self, scene: Scene) -> None:
        """Refuse, by an InputError, a scene that this scan cannot work with, before any scan runs."""

    def step_warning(self, scene: Scene) -> str | None:
        """One line if the step that is asked for cannot be right for the scene; see ``fm.step_warning``."""
        return None

    def asked(self, *names: str) -> dict[str, Any]:
        """Some fields of the request, as what computes takes them."""
        return {name: getattr(self, name) for name in names}

    @abstractmethod
    def tiling(self, scene: Scene) -> Tiling:
        """How the work is divided; must be cheap."""

    @staticmethod
    def read(section: Section, scene: Mapping[str, float]) -> Dataset:
        """What ``draw`` needs of a result file's section; all of it, unless less will do."""
        return section.load()

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Pictures of a result, by name. ``scene`` are the scene's parameters with this scan's changes."""
        return {}


#: What ``error_estimate`` of a section is.
HALVING = "largest difference of a state [SI units] from the same run with half the step"


def failures(status: ArrayLike) -> dict[str, int | str]:
    """The attributes of a section that tell how many of its trajectories have failed, and how."""
    return counted_failures(failure_counts(status), np.size(status))


def counted_failures(counts: Mapping[str, int], total: int) -> dict[str, int | str]:
    """The same where failures have been counted by name."""
    line = failure_line(counts, total)
    return {"failed": sum(counts.values())} | ({"failures": line} if line else {})


@dataclass(frozen=True)
class Request:
    """A request file: title, scene and scans by name, with the text it was read from."""

    title: str
    scene: Any  #: a ``Scene``; a ``Mechanism`` or ``System`` for scans that are of those
    scans: Mapping[str, Scan]
    text: str

    def scene_of(self, name: str) -> Any:
        """The scene of one scan: the file's with the scan's own changes."""
        return self.scene.replace(**self.scans[name].scene)


def read_request(
    path: str | Path,
    kinds: Mapping[str, type[Scan]],
    text: str | None = None,
    mechanism: Mechanism | System | None = None,
) -> Request:
    """Read and validate a request file, or the text that is given as its own.

    ``mechanism`` is one of the user's own, or a system: the file does not name it, nothing in it is executed.

    Raises:
        InputError: the file cannot be read, or anything in it is unknown, of a wrong type or out of range.
    """
    text = read_text(path) if text is None else text
    table = parse_toml(text, path)
    title = title_of({"title": Path(path).stem, **table})
    scene = device_of(table, mechanism)
    scans = _table(table.get("scan", {}), "scan")
    if not scans:
        raise InputError(
            f"{path}: asks for no scan; write a table [scan.NAME] with kind = one of {list(kinds)}"
        )
    request = Request(title, scene, {name: _scan(name, scans[name], kinds, scene) for name in scans}, text)
    for name, scan in request.scans.items():
        if not isinstance(scene, Scene):
            for taken in scan.taken & {*scene.state}:
                raise InputError(
                    f"scan.{name}.mechanism: {taken} is the name of a coordinate and of a variable of"
                    " the result"
                )
            if name in scene.parameters:
                raise InputError(f"scan.{name}: is the name of a parameter; choose another")
        try:
            scan.check(request.scene_of(name))
        except InputError as error:
            raise InputError(f"scan.{name}.{error}") from None
    return request


def title_of(table: Mapping[str, Any]) -> str:
    """The title that a file gives; empty: it gives none.

    Raises:
        InputError: it is no text.
    """
    title = table.get("title", "")
    if not isinstance(title, str) or "\0" in title:
        raise InputError(f"title = {shown(title)}: must be a text without null characters")
    return title


def tolerances_of(table: Mapping[str, Any]) -> dict[str, Any]:
    """Half widths of parameters that a file gives as ``{ value = 900.0, plus_minus = 20.0 }``."""
    return spread(_table(table.get("scene", {}), "scene"))[1]


def device_of(table: Mapping[str, Any], mechanism: Mechanism | System | None = None) -> Any:
    """The scene, or the mechanism or system with the file's parameters.

    Raises:
        InputError: a name or a value is wrong.
    """
    allowed = ["title", "mechanism", "scene", "scan"]
    for key in table:
        if key not in allowed:
            raise InputError(f"{shown_name(key)}: unknown name; {nearest(key, allowed)}")
    values, name = spread(_table(table.get("scene", {}), "scene"))[0], table.get("mechanism")
    if name is None and mechanism is None:
        try:
            return Scene(**values)
        except InputError as error:
            other = ' (of a mechanism: by mechanism = "NAME" or --mechanism FILE.py:NAME)'
            raise InputError(f"{error}{other * ('unknown name' in str(error))}") from None
    if name is not None:
        from fastmech.mechanisms import shipped  # with SymPy, which other requests do without

        known = shipped()
        if mechanism is not None:
            raise InputError(f"mechanism = {shown(name)}: another one is given on the command line")
        if name not in known:
            hint = nearest(name if isinstance(name, str) else "", known)
            raise InputError(f"mechanism = {shown(name)}: unknown; {hint}")
        mechanism = known[name]()
    for key, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"scene.{key} = {shown(value)}: must be a number")
    assert mechanism is not None
    return mechanism.replace(**values)


def named_in_file(where: str, option: str) -> Any:
    """What ``FILE.py:NAME`` stands for, given by a command's option; of a function what it returns.

    Raises:
        InputError: there is no such file, or it cannot be run.
    """
    file, _, name = where.rpartition(":")
    if not file.endswith(".py") or not name.isidentifier():
        raise InputError(f"{option} {shown(where)}: must be FILE.py:NAME")
    if not Path(file).is_file():
        raise InputError(f"{shown_name(file)}: no such file")
    try:
        found = runpy.run_path(file).get(name)
        return found() if callable(found) else found
    except InputError:
        raise
    except Exception as error:
        told = one_line(f"{type(error).__name__}: {error}")
        raise InputError(f"{shown_name(file)}: {shown_name(name)}: cannot be run: {told}") from None


def _table(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{where} = {shown(value)}: must be a table")
    return value


def _scan(name: str, value: Any, kinds: Mapping[str, type[Scan]], scene: Any) -> Scan:
    where = f"scan.{shown_name(name)}"
    check_name(name, where)
    if len(name) > LONGEST_NAME:
        raise InputError(f"{where}: has {len(name):,} characters, at most {LONGEST_NAME} are allowed")
    if name in PARAMETERS:
        raise InputError(f"{where}: is the name of a parameter of the scene; choose another")
    entry = dict(_table(value, where))
    kind = entry.pop("kind", None)
    if kind is None:
        raise InputError(f"{where}.kind: missing; allowed: {', '.join(kinds)}")
    if not isinstance(kind, str) or kind not in kinds:
        hint = nearest(kind if isinstance(kind, str) else "", list(kinds))
        raise InputError(f"{where}.kind = {shown(kind)}: unknown; {hint}")
    what = "systems" if isinstance(scene, System) else "mechanisms"
    if not isinstance(scene, Scene) and not getattr(kinds[kind], f"of_{what}"):
        usable = ", ".join(one for one, made in kinds.items() if getattr(made, f"of_{what}"))
        told = "is not for systems" if what == "systems" else "is for the paper's mechanism alone"
        raise InputError(f"{where}.kind = {kind}: {told}; for {what} are: {usable}")
    try:
        return kinds[kind](**entry)
    except ValidationError as error:
        raise InputError(explain(error, where, kinds[kind])) from None
