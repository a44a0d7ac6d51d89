"""``fm.map_basins``: where every start of a slice of state space ends, after how many turns, and when."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.arrays import Floats
from fastmech.attractors.flow import angles_of, keeps_moving
from fastmech.basins.label import How, Labeller, Labels, number_wells, told_ends
from fastmech.basins.measures.labels import check_angles, number_turns, state_index
from fastmech.basins.refine import LevelProgress, refine_grid
from fastmech.ensembles import checks
from fastmech.ensembles.run import Progress
from fastmech.ensembles.status import Status
from fastmech.ensembles.system import System
from fastmech.errors import InputError, shown
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Drawn, Field
from fastmech.scene import Scene, nearest

#: Points of the largest map, and the numbers of 8 bytes that its arrays take of each in memory.
MOST_POINTS, POINT_NUMBERS = 50_000_000, 20


@dataclass(frozen=True, repr=False, kw_only=True)
class BasinMap(Labels, Drawn):
    """Labels over a grid of starts; arrays have one axis for each of ``axes``, in their order.

    Of points that were not computed times are NaN. Printed, it says how many starts end where, and when.
    ``.plot(turns=False)`` colours wells whatever the full turns on the way there, ``True`` tells these apart;
    by default that is chosen by whether the turns have colours enough.
    """

    axes: dict[str, Floats]  #: values along each axis [rad, rad/s]
    fixed: dict[str, float]  #: the other coordinates of the starts
    computed: NDArray[np.bool_]  #: which points were computed; the others have their surroundings' label

    @property
    def labels(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """One integer for each (well, turns), -1 without label, and the table they point into.

        The table (labels, 1 + coordinates) is sorted by well, then by turns of each coordinate.
        """
        return number_turns(self.well, self.turns)

    KIND = "basins"
    LAYOUT = "scan_types.basins:basin_dataset"
    PICTURE = "plots.objects:draw_basin_map"
    FIELDS = {
        "well": Field("*axes", "1", "attractor or stop code at the end, -1: no label", codes=-1),
        "time": Field("*axes", "s", "when it is known, NaN: it is not"),
        "status": Field("*axes", "1", "what is known of the start", codes=Status),
        "computed": Field("*axes", "1", "computed, not filled in between equal labels"),
    }

    def told(self) -> str:
        """How many starts end where, and when."""
        grid = " x ".join(f"{name} ({values.size:,})" for name, values in self.axes.items())
        return told_ends(f"map over {grid}", self)


def map_basins(
    scene: Scene | Mechanism | System,
    axes: Mapping[str, ArrayLike],
    t_end: float | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    refine: int | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    dt: float | None = None,
    method: str | None = None,
    settle_radius: float | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> BasinMap:
    """Label every start of a grid by where it ends: in which copy of a well, proved, or at which attractor.

    Attractors and arrival there are measured, as :func:`fastmech.find_attractors` tells.

    Args:
        scene: the mechanism, with a damper; or a system of your own with a stopping condition, whose stop
            code is the label. Without one, and of a mechanism under loads that repeat, starts are labelled
            by the attractors that a sample of the grid finds, see :func:`fastmech.find_attractors`: they are
            in ``tree``.
        axes: values along two, three or four of the states that ``scene.state`` names [rad or m, and per s],
            rising (of a system one or more).
        t_end: end of the run [s], by default as for :func:`fastmech.label_starts` (for attractors see there);
            what is not captured by then is undecided.
        fixed: values of the other coordinates, 0 by default.
        refine: compute a coarse grid with so many points between neighbours (a power of two) and then only
            what is near boundaries, see :mod:`fastmech.basins.refine`. This is a heuristic: a part of a
            basin thinner than that which touches no boundary seen otherwise is missed. Points that were not
            computed have no times.
        parameters: of a system with a stopping condition, values of parameters by name that differ between
            starts, each of a shape that broadcasts to the map's: ``values[:, None]`` changes along the first
            of two axes. Attractors belong to one set of values: :func:`fastmech.follow_basins`.
        dt, method, settle_radius, threads: as for :func:`fastmech.label_starts`; a system with a stopping
            condition needs ``dt``.
        progress: called with the number of starts that are done since the last call; of a refined
            map its share of the work, as far as that can be foreseen, as so many starts.

    Raises:
        InputError: an argument is wrong, the scene has no damper, or its wells are not certain.
    """
    if not isinstance(scene, Scene | Mechanism | System):
        raise InputError(f"scene = {shown(scene)}: must be a Scene, a Mechanism or a System")
    names, angles = tuple(scene.state), angles_of(scene)
    values = _checked_axes(axes, names, angles, least=2 if isinstance(scene, Scene) else 1)
    checks.progress_function(progress, "starts")
    held = _checked_fixed({} if fixed is None else fixed, values, names, angles)
    shape = tuple(v.size for v in values.values())
    size = math.prod(shape)
    if size > MOST_POINTS:
        raise InputError(
            f"axes: ask for {size:.3g} starts, at most {MOST_POINTS:.0e} are allowed; take fewer, "
            'or in parts for files: fastmech run, kind = "basins"'
        )
    checks.memory(size, POINT_NUMBERS, f"axes: {size:.3g} starts", "fewer")
    own = _checked_parameters(scene, {} if parameters is None else parameters, shape)
    if own and keeps_moving(scene):
        raise InputError("parameters: may differ between starts only with a stopping condition")
    label = Labeller(scene, t_end, How(dt, method, settle_radius, threads))
    parts: list[tuple[NDArray[np.intp], Labels]] = []

    def compute(points: NDArray[np.intp], tell: Progress | None) -> NDArray[np.int64]:
        """One integer for each point that tells labels apart, negative without a label."""
        given = {name: value.ravel()[points] for name, value in own.items()}
        part = label(grid_starts(values, held, names, points), tell, given)
        parts.append((points, part))
        return number_wells(part)

    if refine is None:
        source = np.arange(size)
        compute(source, progress)
    else:
        refine = checks.whole_number("refine", refine, least=2, most=1 << 20)
        if refine & (refine - 1):
            raise InputError(f"refine = {refine}: must be a power of two")
        levels = LevelProgress(shape, refine, progress)

        def level(points: NDArray[np.intp], stride: int) -> NDArray[np.int64]:
            labels = compute(points, None)
            levels.computed(parts[-1][1].steps, stride)
            return labels

        source = refine_grid(shape, refine, level)
        levels.finish()
    place = np.empty(size, dtype=np.intp)
    place[np.concatenate([points for points, _ in parts])] = np.arange(sum(p.size for p, _ in parts))
    place, computed = place[source], source == np.arange(size)

    def whole(name: str) -> NDArray[Any]:
        """An array of the parts at every point."""
        return np.concatenate([getattr(part, name) for _, part in parts])[place]

    def at_computed(name: str) -> Floats:
        return np.where(computed, whole(name), np.nan).reshape(shape)

    well, last = whole("well"), parts[-1][1]
    tree = last.tree
    if label.attractors is not None:  # by shares of the whole map, not of a coarse one
        shares = np.bincount(well[well >= 0], minlength=len(label.attractors))
        tree, number = label.attractors.ranked(shares)
        well = number[well].astype(np.int8)
    return BasinMap(
        axes=values,
        fixed=held,
        tree=tree,
        well=well.reshape(shape),
        turns=whole("turns").reshape(*shape, -1),
        time=at_computed("time"),
        settle_time=None if last.settle_time is None else at_computed("settle_time"),
        status=whole("status").reshape(shape),
        computed=computed.reshape(shape),
        t_end=last.t_end,
        steps=sum(part.steps for _, part in parts),
        parted=sum(part.parted for _, part in parts),
    ).of(scene)


def grid_starts(
    axes: Mapping[str, Floats], fixed: Mapping[str, float], names: tuple[str, ...], points: NDArray[np.intp]
) -> Floats:
    """States (n, dim) of grid points by their flat indices, the last axis fastest."""
    places = dict(zip(axes, np.unravel_index(points, tuple(v.size for v in axes.values())), strict=True))
    columns = [
        axes[name][places[name]] if name in axes else np.full(points.size, fixed[name]) for name in names
    ]
    return np.stack(columns, axis=-1)


def _checked_axes(
    axes: Mapping[str, ArrayLike], names: tuple[str, ...], angles: tuple[str, ...], least: int
) -> dict[str, Floats]:
    """Axes as rising arrays."""
    if not isinstance(axes, Mapping):
        raise InputError(f"axes = {shown(axes)}: must map coordinates to their values")
    if not least <= len(axes) <= len(names):
        raise InputError(f"axes = {shown(list(axes))}: must be {least} to {len(names)} of {', '.join(names)}")
    checked = {}
    for name, values in axes.items():
        state_index(name, names)
        array = checks.reals(f"axes.{name}", values, "numbers").copy()
        if array.ndim != 1 or not array.size or not np.isfinite(array).all():
            raise InputError(f"axes.{name}: must be a row of finite, strictly rising values")
        checks.one_way(f"axes.{name}", values, array)
        if array[-1] < array[0]:
            raise InputError(f"axes.{name}: falls from {array[0]:g} to {array[-1]:g}, must rise")
        check_angles(f"axes.{name}", name, array, angles)
        checked[name] = array
    return checked


def _checked_parameters(
    scene: Scene | Mechanism | System, parameters: Mapping[str, ArrayLike], shape: tuple[int, ...]
) -> dict[str, Floats]:
    """Values of parameters at every point of a map."""
    checked = {}
    for name, values in checks.mapping("parameters", parameters, "their values").items():
        if not isinstance(scene, System):
            raise InputError("parameters: only a system's may differ between starts; a map is of one scene")
        if name not in scene.parameters:
            raise InputError(f"parameters.{name}: unknown name; {nearest(name, list(scene.parameters))}")
        try:
            checked[name] = np.broadcast_to(np.asarray(values, dtype=np.float64), shape)
        except (TypeError, ValueError):
            raise InputError(
                f"parameters.{name}: must be numbers of a shape that broadcasts to the map's, {shape}"
            ) from None
    return checked


def _checked_fixed(
    fixed: Mapping[str, float], axes: Mapping[str, Floats], names: tuple[str, ...], angles: tuple[str, ...]
) -> dict[str, float]:
    """Values of the coordinates that are no axes."""
    if not isinstance(fixed, Mapping):
        raise InputError(f"fixed = {shown(fixed)}: must map coordinates to their values")
    others = [name for name in names if name not in axes]
    for name in fixed:
        if name not in others:
            told = "must be one of the coordinates without an axis"
            raise InputError(f"fixed.{name}: {told}: {', '.join(others)}")
    held = {}
    for name in others:
        held[name] = checks.number(f"fixed.{name}", fixed.get(name, 0.0), "rad or rad/s")
        check_angles(f"fixed.{name}", name, held[name], angles)
    return held
