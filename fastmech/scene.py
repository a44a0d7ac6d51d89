"""A scene: the mechanism's parameters, validated once. Every user error about a scene arises here."""

from __future__ import annotations

import difflib
import inspect
import os
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar, NamedTuple, Self, cast

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    create_model,
)

from fastmech.errors import InputError, shown, shown_name

#: Bounds within which ratios and products of parameters stay in double precision.
SMALLEST, LARGEST = 1e-30, 1e30


def _python_number(value: Any) -> Any:
    """NumPy scalars as the Python numbers that strict validation accepts; all else unchanged."""
    return value.item() if isinstance(value, np.generic) else value


def _not_huge(value: float) -> float:
    if abs(value) > LARGEST:
        raise ValueError(f"must not exceed {LARGEST:g} in magnitude")
    return value


def _not_tiny(value: float) -> float:
    if value < SMALLEST:
        raise ValueError(f"must not be less than {SMALLEST:g}")
    return value


_Float = Annotated[float, BeforeValidator(_python_number)]
Number = Annotated[_Float, AfterValidator(_not_huge)]
Positive = Annotated[Number, Field(gt=0), AfterValidator(_not_tiny)]
NonNegative = Annotated[Number, Field(ge=0)]

#: States of the mechanism by name.
STATE = ("phi", "theta", "phi_dot", "theta_dot")


class Parameter(NamedTuple):
    """One of the scene's parameters."""

    kind: Any  #: what is allowed
    default: float
    unit: str
    about: str


#: The mechanism's parameters; the defaults are the paper's Table 1 as printed.
PARAMETERS = {
    "m1": Parameter(Positive, 10.0, "kg", "mass of material point M1"),
    "m2": Parameter(Positive, 12.0, "kg", "mass of material point M2"),
    "m3": Parameter(NonNegative, 8.0, "kg", "mass of slider M3"),
    "l": Parameter(Positive, 1.25, "m", "length of the rods OM1 and M1M2; M1M3 is twice as long"),
    "c1": Parameter(NonNegative, 162.5, "N/m", "stiffness of the spring from M2 to O"),
    "c2": Parameter(NonNegative, 366.67, "N/m", "stiffness of the spring from M1 to A = (0, l)"),
    "beta": Parameter(NonNegative, 121.0, "N s/m", "coefficient of the damper on the slider"),
    "g": Parameter(NonNegative, 9.80665, "m/s2", "acceleration of gravity"),
    "F0": Parameter(Number, 100.0, "N", "force on M2 along +x at t = 0"),
    "alpha": Parameter(NonNegative, 0.7, "1/s", "decay rate of the force F0 exp(-alpha t)"),
}

_CONFIG = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
_FIELDS: Any = {name: (one.kind, one.default) for name, one in PARAMETERS.items()}
_Checked: Any = create_model("Scene", __config__=_CONFIG, **_FIELDS)


class Scene:
    """Parameters of the mechanism in SI units; the defaults are the paper's Table 1 as printed.

    PARAMETERS

    A scene does not change; a wrong name, type or value raises :class:`fastmech.errors.InputError` with one
    line that names the field, the value and what is allowed. The standard gravity 9.80665 m/s^2 is what the
    paper computed with. Masses m1 and m2 must be positive: without either the metric is singular.

    ``Scene(load=...)`` gives the same device under another load on M2 along +x, one of :mod:`fastmech.loads`,
    in place of F0 exp(-alpha t): a :class:`fastmech.Mechanism`, :func:`fastmech.mechanisms.slider_pendulum`.
    """

    m1: float
    m2: float
    m3: float
    l: float
    c1: float
    c2: float
    beta: float
    g: float
    F0: float
    alpha: float

    state: ClassVar[tuple[str, ...]] = STATE  #: names of the states: coordinates, then rates
    turning: ClassVar[tuple[bool, ...]] = (True, True)  #: whether each coordinate turns fully
    lengths: ClassVar[frozenset[str]] = frozenset()  #: coordinates that are no angles

    def __new__(cls, *unnamed: Any, load: Any = None, **parameters: Any) -> Self:
        """The scene; under a load of ``fm.loads`` the mechanism that it stands for."""
        if unnamed:
            raise InputError(f"scene: {shown(unnamed[0])} has no name; write Scene(m1=..., c1=...)")
        if load is None:
            return super().__new__(cls)
        from fastmech.mechanisms.slider_pendulum import slider_pendulum  # what is general knows the scene

        for name in {"F0", "alpha"} & set(parameters):
            raise InputError(f"scene.{name}: the load acts in place of F0 exp(-alpha t); give one of them")
        own = {n: v for n, v in cls(**parameters).parameters.items() if n not in ("F0", "alpha")}
        made: Any = slider_pendulum(load).replace(**own)
        return cast(Self, made)

    def __init__(self, **parameters: Any) -> None:
        try:
            checked = _Checked(**parameters)
        except ValidationError as error:
            line = explain(error, "scene", _Checked)
            name = str(error.errors()[0]["loc"][0])
            unit = f" in {PARAMETERS[name].unit}" if line.endswith(NO_NUMBER) else ""
            raise InputError(line + unit) from None
        self.__dict__.update({name: getattr(checked, name) for name in PARAMETERS})

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters by name."""
        return {name: getattr(self, name) for name in PARAMETERS}

    @property
    def damped(self) -> bool:
        """Whether the damper takes energy."""
        return self.beta > 0.0

    @property
    def fading(self) -> float:
        """Rate [1/s] at which its force decays; 0: it has none, or a constant one."""
        return self.alpha if self.F0 != 0.0 else 0.0

    def _motion(self, own: Mapping[str, Any]) -> Any:
        """What the engine is told of its motions; of parameters ``own`` each trajectory has one (n,)."""
        from fastmech.slider.coefficients import reduce
        from fastmech.slider.motion import SceneMotion

        scenes: Any = SimpleNamespace(**(self.parameters | dict(own)))
        return SceneMotion(reduce(scenes))

    def replace(self, **changes: Any) -> Self:
        """A scene with some parameters changed, validated again."""
        return type(self)(**(self.parameters | changes))

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """The scene of a TOML file: its table ``[scene]``, whose tolerances are left out.

        Raises:
            InputError: no such file, not TOML, no table ``[scene]``, or a wrong parameter.
        """
        table = read_toml(path).get("scene")
        if not isinstance(table, Mapping):
            raise InputError(f"{path}: has no table [scene]")
        return cls(**spread(table)[0])

    def described(self) -> dict[str, tuple[float, str, str]]:
        """Value, unit and description of every parameter."""
        return {name: (getattr(self, name), one.unit, one.about) for name, one in PARAMETERS.items()}

    def __repr__(self) -> str:
        own = {n: v for n, v in self.parameters.items() if v != PARAMETERS[n].default}
        lines = [f"Scene({', '.join(f'{name}={value!r}' for name, value in own.items())})"]
        lines += [f"  {name} = {v:g} {unit}: {about}" for name, (v, unit, about) in self.described().items()]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        told = self.described().items()
        rows = (f"<tr><td>{n}</td><td>{v:g} {u}</td><td>{about}</td></tr>" for n, (v, u, about) in told)
        return f"<b>Scene</b><table>{''.join(rows)}</table>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and self.parameters == other.parameters

    def __hash__(self) -> int:
        return hash(tuple(self.parameters.values()))

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse it, with the call that gives another scene."""
        if name not in PARAMETERS:
            raise InputError(f"scene.{shown_name(name)}: unknown name; {nearest(name, list(PARAMETERS))}")
        raise InputError(
            f"scene.{name}: a scene does not change; write scene = scene.replace({name}={shown(value)})"
        )

    def __delattr__(self, name: str) -> None:
        """Refuse it."""
        raise InputError(f"scene.{shown_name(name)}: a scene does not change; its parameters stay")


_table = [f"- ``{name}`` = {one.default:g} {one.unit}: {one.about}" for name, one in PARAMETERS.items()]
Scene.__doc__ = str(Scene.__doc__).replace("PARAMETERS", "\n    ".join(_table))
_names = [
    inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=one.default, annotation=float)
    for name, one in PARAMETERS.items()
]
Scene.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
    [*_names, inspect.Parameter("load", inspect.Parameter.KEYWORD_ONLY, default=None)]
)


def require_scene(scene: Any, hint: str = " or a Mechanism") -> None:
    """Refuse what is no scene; the hint, what else would do, ends the message.

    Raises:
        InputError: it is something else.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"scene = {shown(scene)}: must be a Scene{hint}")


#: How HDF5 files begin.
HDF5 = b"\x89HDF\r\n\x1a\n"


def read_toml(path: str | Path) -> dict[str, Any]:
    """Content of a TOML file.

    Raises:
        InputError: the file is missing, unreadable or not TOML.
    """
    return parse_toml(read_text(path), path)


def read_text(path: str | Path) -> str:
    """Text of a file in UTF-8.

    Raises:
        InputError: the file is missing, unreadable or not UTF-8.
    """
    try:
        content = path_of(path).read_bytes()
        if content.startswith(HDF5):
            raise InputError(
                f"{path}: is an HDF5 file, not TOML; fastmech run --from FILE.h5 computes a result again"
            )
        return content.decode("utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not valid TOML: {error}") from None


def path_of(path: Any) -> Path:
    """The path of a file.

    Raises:
        InputError: it is none.
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"path = {shown(path)}: must be the path of a file")
    return Path(path)


def parse_toml(text: str, path: str | Path) -> dict[str, Any]:
    """Content of the text of a TOML file.

    Raises:
        InputError: it is not TOML.
    """
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{path}: is not valid TOML: {shown_name(error)}") from None
    except ValueError:
        most = f"{sys.get_int_max_str_digits():,}"
        raise InputError(f"{path}: is not valid TOML: an integer has more than {most} digits") from None


#: What is said of a text in place of a number.
NO_NUMBER = "must be a number"


def spread(table: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Values of parameters, and half widths of those given as ``{ value = 900.0, plus_minus = 20.0 }``."""
    wide = {name: entry for name, entry in table.items() if isinstance(entry, dict)}
    keys = ["value", "plus_minus"]
    for name, entry in wide.items():
        where = f"scene.{shown_name(name)}"
        for key in entry:
            if key not in keys:
                raise InputError(f"{where}.{shown_name(key)}: unknown name; {nearest(key, keys)}")
        for key in keys:
            if key not in entry:
                raise InputError(f"{where}.{key}: missing")
    centres = {name: entry["value"] for name, entry in wide.items()}
    return {**table, **centres}, {name: entry["plus_minus"] for name, entry in wide.items()}


#: How alike a name must be to one that begins otherwise, for that to be meant.
NEAR = 0.6


def nearest(name: Any, valid: Mapping[str, Any] | list[str]) -> str:
    """Hint for a name that is not valid: the nearest valid one or ones, or all of them."""
    if not valid:  # as only parameters may be
        return "the system has no parameters"
    if not isinstance(name, str):
        return f"must be a text and no {type(name).__name__}: {', '.join(map(repr, valid))}"
    close = [one for one in valid if one.lower() == name.lower()]
    if not close and (near := difflib.get_close_matches(name, list(valid), n=1, cutoff=0.5)):
        like = {one: difflib.SequenceMatcher(None, one, name).ratio() for one in valid}
        close = [one for one in valid if like[one] == like[near[0]] and one[:1] == name[:1]]
        close = close or [one for one in near if like[one] >= NEAR]
    return f"did you mean {' or '.join(map(repr, close))}?" if close else f"allowed: {', '.join(valid)}"


def explain(error: ValidationError, where: str, model: type[BaseModel]) -> str:
    """One line for the first thing wrong: field, value, what is allowed."""
    first = error.errors(include_url=False)[0]
    path = ".".join([where, *(shown_name(part) for part in first["loc"])])
    if first["type"] == "extra_forbidden":
        return f"{path}: unknown name; {nearest(str(first['loc'][-1]), list(model.model_fields))}"
    if first["type"] == "missing":
        return f"{path}: missing"
    message = first["msg"].removeprefix("Value error, ")
    if first["type"] == "float_type":
        message = NO_NUMBER
    limits = first.get("ctx", {})
    if first["type"] == "too_long":
        message = f"at most {limits['max_length']:,} entries are allowed"
    elif first["type"] == "too_short":
        message = f"at least {limits['min_length']} must be given"
    return f"{path} = {shown(first['input'])}: {message[0].lower() + message[1:]}"
