"""A scene: the mechanism's parameters, validated once. Every user error about a scene arises here."""

from __future__ import annotations

import difflib
import os
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self, cast

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

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

_UNITS: dict[str, str] = {
    "m1": "kg",
    "m2": "kg",
    "m3": "kg",
    "l": "m",
    "c1": "N/m",
    "c2": "N/m",
    "beta": "N s/m",
    "g": "m/s2",
    "F0": "N",
    "alpha": "1/s",
}


class Scene(BaseModel):
    """Parameters of the mechanism in SI units; the defaults are the paper's Table 1 as printed.

    Frozen; a wrong name, type or value raises :class:`fastmech.errors.InputError` with one line that names
    the field, the value and what is allowed. The standard gravity 9.80665 m/s^2 is what the paper computed
    with. Masses m1 and m2 must be positive: without either the metric is singular.

    ``Scene(load=...)`` gives the same device under another load on M2 along +x, one of :mod:`fastmech.loads`,
    in place of F0 exp(-alpha t): a :class:`fastmech.Mechanism`, :func:`fastmech.mechanisms.slider_pendulum`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    m1: Positive = Field(10.0, description="mass of material point M1")
    m2: Positive = Field(12.0, description="mass of material point M2")
    m3: NonNegative = Field(8.0, description="mass of slider M3")
    l: Positive = Field(1.25, description="length of the rods OM1 and M1M2; M1M3 is twice as long")
    c1: NonNegative = Field(162.5, description="stiffness of the spring from M2 to O")
    c2: NonNegative = Field(366.67, description="stiffness of the spring from M1 to A = (0, l)")
    beta: NonNegative = Field(121.0, description="coefficient of the damper on the slider")
    g: NonNegative = Field(9.80665, description="acceleration of gravity")
    F0: Number = Field(100.0, description="force on M2 along +x at t = 0")
    alpha: NonNegative = Field(0.7, description="decay rate of the force F0 exp(-alpha t)")

    def __new__(cls, *, load: Any = None, **parameters: Any) -> Self:
        """The scene; under a load of ``fm.loads`` the mechanism that it stands for."""
        if load is None:
            return super().__new__(cls)
        from fastmech.mechanisms.slider_pendulum import slider_pendulum  # what is general knows the scene

        for name in {"F0", "alpha"} & set(parameters):
            raise InputError(f"scene.{name}: the load acts in place of F0 exp(-alpha t); give one of them")
        made: Any = slider_pendulum(load).replace(**cls(**parameters).model_dump(exclude={"F0", "alpha"}))
        return cast(Self, made)

    def __init__(self, **parameters: Any) -> None:
        try:
            super().__init__(**parameters)
        except ValidationError as error:
            raise InputError(explain(error, "scene", type(self))) from None

    def replace(self, **changes: Any) -> Self:
        """A scene with some parameters changed, validated again."""
        return type(self)(**(self.model_dump() | changes))

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse it, with the call that gives another scene."""
        if name not in type(self).model_fields:
            raise InputError(
                f"scene.{shown_name(name)}: unknown name; {nearest(name, list(type(self).model_fields))}"
            )
        raise InputError(
            f"scene.{name}: a scene does not change; write scene = scene.replace({name}={shown(value)})"
        )

    def __delattr__(self, name: str) -> None:
        """Refuse it."""
        raise InputError(f"scene.{shown_name(name)}: a scene does not change; its parameters stay")

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """The scene of a TOML file: its table ``[scene]``.

        Raises:
            InputError: no such file, not TOML, no table ``[scene]``, or a wrong parameter.
        """
        table = read_toml(path).get("scene")
        if not isinstance(table, Mapping):
            raise InputError(f"{path}: has no table [scene]")
        return cls(**table)

    def described(self) -> dict[str, tuple[float, str, str]]:
        """Value, unit and description of every parameter."""
        return {
            name: (getattr(self, name), _UNITS[name], str(field.description))
            for name, field in type(self).model_fields.items()
        }


def require_scene(scene: Any, hint: str = "") -> None:
    """Refuse what is no scene; the hint ends the message.

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


def nearest(name: str, valid: Mapping[str, Any] | list[str]) -> str:
    """Hint for a name that is not valid: the nearest valid one, or all of them."""
    close = difflib.get_close_matches(name, list(valid), n=1, cutoff=0.5)
    return f"did you mean {close[0]!r}?" if close else f"allowed: {', '.join(valid)}"


def explain(error: ValidationError, where: str, model: type[BaseModel]) -> str:
    """One line for the first thing wrong: field, value, what is allowed."""
    first = error.errors(include_url=False)[0]
    path = ".".join([where, *(shown_name(part) for part in first["loc"])])
    if first["type"] == "extra_forbidden":
        return f"{path}: unknown name; {nearest(str(first['loc'][-1]), list(model.model_fields))}"
    if first["type"] == "missing":
        return f"{path}: missing"
    message = first["msg"].removeprefix("Value error, ")
    limits = first.get("ctx", {})
    if first["type"] == "too_long":
        message = f"at most {limits['max_length']:,} entries are allowed"
    elif first["type"] == "too_short":
        message = f"at least {limits['min_length']} must be given"
    return f"{path} = {shown(first['input'])}: {message[0].lower() + message[1:]}"
