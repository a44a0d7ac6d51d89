"""The axes of a map: checked, and the reduced coefficients at their points."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.errors import InputError
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene, nearest

Floats = NDArray[np.float64]


def check_axes(scene: Scene, axes: Mapping[str, ArrayLike], most: int = 3) -> dict[str, Floats]:
    """The axes as float64 vectors, every value one that the scene accepts.

    Raises:
        InputError: none or more than ``most`` axes, an unknown name, or a value that the scene refuses.
    """
    if not 1 <= len(axes) <= most:
        raise InputError(f"axes: {len(axes)} given; one to {_WORDS[most]} parameters are allowed")
    if "F0" in axes and scene.alpha > 0.0 and "alpha" not in axes:
        raise InputError(
            f"scene.alpha = {scene.alpha:g}: must be 0 1/s where F0 is an axis, or no force is left at rest"
        )
    return {name: check_axis(scene, name, values) for name, values in axes.items()}


_WORDS = {2: "two", 3: "three"}


def check_axis(scene: Scene, name: str, values: ArrayLike) -> Floats:
    """One axis as a float64 vector.

    Raises:
        InputError: see ``check_axes``.
    """
    names = list(Scene.model_fields)
    if name not in names:
        raise InputError(f"axes.{name}: unknown parameter; {nearest(name, names)}")
    try:
        vector = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"axes.{name}: must be a sequence of numbers") from None
    if vector.ndim != 1 or vector.size == 0:
        raise InputError(f"axes.{name}: shape {vector.shape}: must be one-dimensional and not empty")
    for value in (vector.min(), vector.max()):
        # What a scene allows of a parameter is an interval of finite numbers.
        try:
            scene.replace(**{name: float(value)})
        except InputError:
            _name_the_value(scene, name, vector)
    return vector


def _name_the_value(scene: Scene, name: str, vector: Floats) -> None:
    for value in vector:
        try:
            scene.replace(**{name: float(value)})
        except InputError as error:
            raise InputError(f"axes.{name}: {error}") from None


def coefficient_columns(scene: Scene, values: Mapping[str, Any]) -> Any:
    """``Coefficients`` of arrays: ``values`` are parameters that differ from the scene's, in any shapes.

    The force is the one at rest: F0 where alpha = 0, else its limit 0. The formulas are plain arithmetic, so
    vectors, and complex numbers for derivatives, go through them as floats do.
    """
    fields: dict[str, Any] = {**scene.model_dump(), **values}
    fields["F0"] = fields["F0"] * np.where(np.real(fields["alpha"]) == 0.0, 1.0, 0.0)
    point: Any = SimpleNamespace(**fields)
    return reduce(point)


def grid_coefficients(scene: Scene, axes: Mapping[str, Floats]) -> tuple[Floats, Floats, Floats, Floats]:
    """Of all points of a grid, in memory order: reduced coefficients (n, 8); m2 l^2 and (c1 + c2) l^2 (n,).

    The last array is m2 (n,) [kg].
    """
    grid = tuple(len(values) for values in axes.values())
    spread = {
        name: values.reshape([-1 if k == dimension else 1 for k in range(len(grid))])
        for dimension, (name, values) in enumerate(axes.items())
    }

    def full(value: Any) -> Floats:
        return np.ravel(np.broadcast_to(np.asarray(value, dtype=np.float64), grid))

    columns = [full(column) for column in coefficient_columns(scene, spread)]
    fields: Any = {**scene.model_dump(), **spread}
    return (
        np.ascontiguousarray(np.stack(columns, axis=1)),
        full(fields["m2"] * fields["l"] ** 2),
        full((fields["c1"] + fields["c2"]) * fields["l"] ** 2),
        full(fields["m2"]),
    )
