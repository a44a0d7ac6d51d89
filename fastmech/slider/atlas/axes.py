"""The axes of a map, checked, with the reduced coefficients and the margin to the fold at their points."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
from numba import types
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.atlas.resting_map import axis_values
from fastmech.ensembles.checks import one_way
from fastmech.errors import InputError, shown
from fastmech.jit import MATRIX, VECTOR, kernel
from fastmech.models.mechanism import Mechanism
from fastmech.scene import Scene, require_scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.theorem import normal_form, pulls, vanishing


def check_axes(scene: Scene, axes: Mapping[str, ArrayLike]) -> dict[str, Floats]:
    """The axes as float64 vectors, every value one that the scene accepts.

    Raises:
        InputError: no scene or no mapping, none or more than three axes, an unknown name, values that are
            no numbers, that neither rise nor fall throughout or that the scene refuses, or F0 where the
            scene's force decays.
    """
    require_scene(scene)
    if not isinstance(axes, Mapping):
        raise InputError(f"axes = {shown(axes)}: must map parameter names to their values")
    if not 1 <= len(axes) <= 3:
        raise InputError(f"axes: {len(axes)} given; one to three parameters are allowed")
    checked = {name: _check_values(scene, name, values) for name, values in axes.items()}
    refuse_decaying_load(scene, checked)
    return checked


def refuse_decaying_load(scene: Scene, names: Collection[str]) -> None:
    """F0 is a load at rest only where it is constant.

    Raises:
        InputError: F0 is one of the parameters that vary, and the scene's force decays.
    """
    if "F0" in names and scene.alpha > 0.0 and "alpha" not in names:
        raise InputError(
            f"scene.alpha = {scene.alpha:g}: must be 0 1/s where F0 is an axis, or no force is left at rest"
        )


def check_axis(scene: Scene, name: str, values: ArrayLike) -> Floats:
    """One axis of a search for folds as a float64 vector.

    Raises:
        InputError: as ``check_axes``, the parameter is alpha, which moves no fold, or there is one value.
    """
    hint = "; fm.critical_values and fm.critical_curves are for a Mechanism"
    require_scene(scene, hint if isinstance(scene, Mechanism) else "")
    vector = _check_values(scene, name, list(values) if isinstance(values, tuple) else values)  # ends will do
    if name == "alpha":
        raise InputError("axes.alpha: equilibria do not depend on how fast a force decays; choose another")
    refuse_decaying_load(scene, (name,))
    if vector.size < 2:
        raise InputError(f"axes.{name} = {shown(values)}: must be two or more values")
    return vector


def _check_values(scene: Scene, name: str, values: ArrayLike) -> Floats:
    vector = axis_values(scene, name, values)
    for value in (vector.min(), vector.max()):
        # What a scene allows of a parameter is an interval of finite numbers.
        try:
            scene.replace(**{name: float(value)})
        except InputError as error:
            raise InputError(f"axes.{name}: {error}") from None
    one_way(f"axes.{name}", values, vector)
    return vector


def coefficient_columns(scene: Scene, values: Mapping[str, Any]) -> Any:
    """``Coefficients`` of arrays: ``values`` are parameters that differ from the scene's, in any shapes.

    The force is the one at rest: F0 where alpha = 0, else its limit 0. The formulas are plain arithmetic, so
    vectors, and complex numbers for derivatives, go through them as floats do.
    """
    fields: dict[str, Any] = {**scene.parameters, **values}
    fields["F0"] = fields["F0"] * np.where(np.real(fields["alpha"]) == 0.0, 1.0, 0.0)
    point: Any = SimpleNamespace(**fields)
    return reduce(point)


def rows_at(scene: Scene, values: Mapping[str, Floats]) -> Floats:
    """Reduced coefficients (n, 8) at n values of some parameters."""
    return np.stack(np.broadcast_arrays(*map(np.float64, coefficient_columns(scene, values))), axis=1)


def grid_coefficients(scene: Scene, axes: Mapping[str, Floats]) -> tuple[Floats, Floats, Floats, Floats]:
    """Of all points of a grid, in memory order: reduced coefficients (n, 8); m2 l^2 and (c1 + c2) l^2 (n,).

    The last array is m2 (n,) [kg].
    """
    columns = (column.ravel() for column in np.meshgrid(*axes.values(), indexing="ij"))
    values = dict(zip(axes, columns, strict=True))
    rows = rows_at(scene, values)
    p: dict[str, Any] = {**scene.parameters, **values}
    more = p["m2"] * p["l"] ** 2, (p["c1"] + p["c2"]) * p["l"] ** 2, p["m2"]
    weight, constant, mass = (np.broadcast_to(each, len(rows)) for each in more)
    return rows, weight, constant, mass


@kernel(types.void(MATRIX, VECTOR))
def fold_margins(coefficients: Floats, margin: Floats) -> None:
    """Write the margin to the fold [rad] (n,): positive with six equilibria; NaN if degenerate.

    ``coefficients`` are (n, 8) rows of ``fastmech.slider.coefficients.Coefficients``, the force frozen.
    """
    for row in range(coefficients.shape[0]):
        mass, _, lift, spring, gravity, force, _, _ = coefficients[row]
        p = pulls(mass, lift, spring, gravity, force)
        margin[row] = np.nan
        if vanishing(p) < 2:
            n = normal_form(p)
            margin[row] = n.peak - n.distance
