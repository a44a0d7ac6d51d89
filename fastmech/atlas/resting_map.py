"""Equilibria of any mechanism over a grid of parameters, each point proved; its wells along a parameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.arrays import Codes, Flags, Floats
from fastmech.atlas.continuation import newton
from fastmech.atlas.defining import Balance
from fastmech.capture.wells import prove_wells, require_potential
from fastmech.ensembles import checks
from fastmech.ensembles.threads import in_parts
from fastmech.errors import InputError, shown, shown_name
from fastmech.intervals.search import Found
from fastmech.loads import held_at
from fastmech.models.checks import check_values
from fastmech.models.equilibria import DIGITS, alike, known_of, outcome_of_row, search_rows
from fastmech.models.mechanism import Mechanism, short_way
from fastmech.models.stability import growth, spectra, verdicts
from fastmech.objects import Drawn
from fastmech.outcome import Outcome
from fastmech.scene import nearest
from fastmech.slider.stability import VERDICTS

#: Points that a thread proves at a time, and the numbers of 8 bytes that each takes meanwhile.
BLOCK, POINT_NUMBERS = 64, 1200


def told_map(found: Any, names: Iterable[str], more: str) -> str:
    """What a map of equilibria holds, in words."""
    grid = " x ".join(f"{name} ({values.size:,})" for name, values in found.axes.items())
    counts, number = np.unique(found.count, return_counts=True)
    complete = np.count_nonzero(found.outcome == Outcome.COMPLETE)
    lines = [
        f"equilibria of {', '.join(names)} over {grid}",
        f"  proved complete at {complete:,} of {found.count.size:,} points",
        "  equilibria: " + ", ".join(f"{k} at {n:,}" for k, n in zip(counts, number, strict=True)),
    ]
    return "\n".join([*lines, more])


@dataclass(frozen=True, eq=False, repr=False)
class RestingMap(Drawn):
    """Equilibria over a grid of parameters; arrays have the grid's shape first, then a slot an equilibrium.

    Equilibria come the deepest first. Numbers are NaN in slots without one, codes -1.
    """

    axes: dict[str, Floats]
    names: tuple[str, ...]  #: of the coordinates
    count: NDArray[np.int16]  #: equilibria, proved each
    outcome: Codes  #: :class:`fastmech.outcome.Outcome`: COMPLETE where there are no others
    position: Floats  #: [rad or m], (..., slots, n); angles in (-pi, pi]
    radius: Floats  #: each is proved to be within so many rad or m
    energy: Floats  #: U [J], loads at their means; NaN where forces are not known to have a potential
    orientation: Codes  #: sign of the stiffness' determinant, 0: not proved
    morse_index: Codes  #: directions in which U falls, -2 not proved, -1 also without a potential
    verdict: Codes  #: stability, a number of :data:`fastmech.slider.stability.VERDICTS`
    eigenvalues: NDArray[np.complex128]  #: [1/s], (..., slots, 2 n), largest real part first
    growth: Codes  #: eigenvalues with a positive real part, and those of them that swing, (..., slots, 2)
    hidden: Flags  #: whether equilibria may be missing that merge within rounding, or are too many
    depth: Floats | None = None  #: energy from a minimum to the lowest way out of its well, proved [J];
    # NaN: none is proved; None: not asked for

    KIND = "equilibrium_map"
    LAYOUT = "scan_types.map_layout:map_dataset"
    PICTURE = "plots.objects:draw_map"

    @property
    def count_stable(self) -> Codes:
        """Equilibria that are stable, of the grid's shape."""
        stable = [VERDICTS.index(verdict) for verdict in ("asymptotically stable", "stable")]
        return np.isin(self.verdict, stable).sum(axis=-1).astype(np.int8)

    def told(self) -> str:
        """The grid, how many equilibria where, and what is proved."""
        there = self.verdict[self.verdict >= 0]
        each = (f"{np.count_nonzero(there == k):,} {v}" for k, v in enumerate(VERDICTS) if (there == k).any())
        held = held_at(self.system.loads) if self.system is not None else ""
        return told_map(self, self.names, f"  {', '.join(each)}" + f"\n  {held}" * bool(held))


def map_resting_places(
    mechanism: Mechanism,
    axes: Mapping[str, ArrayLike],
    *,
    wells: bool = False,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> RestingMap:
    """All equilibria of a mechanism at every point of a grid over one or more of its parameters.

    Each point is proved as :func:`fastmech.find_equilibria` proves one, loads at their means. The result has
    the same bits for any number of threads.

    Args:
        mechanism: gives every parameter that is no axis.
        axes: parameters' names with their values, in the order of the result's dimensions.
        wells: whether to prove the depth of every well too, by :func:`fastmech.barrier_tree` at each point,
            which takes far longer.
        threads: threads to use, all processors by default.
        progress: called with the number of points that are done since the last call.

    Raises:
        InputError: an unknown name, values that the mechanism refuses, a load that they turn into another at
            rest, too many points, or as :func:`fastmech.find_equilibria`.
    """
    checks.progress_function(progress, "points")
    if not isinstance(wells, bool):
        raise InputError(f"wells = {shown(wells)}: must be True or False")
    checked = _checked(mechanism, axes)
    grid = tuple(values.size for values in checked.values())
    columns = np.meshgrid(*checked.values(), indexing="ij")
    if not wells:
        return resting_places_at(mechanism, checked, columns, threads=threads, progress=progress)
    require_potential(mechanism)
    found = resting_places_at(mechanism, checked, columns, threads=threads)
    depth = np.full(found.energy.shape, np.nan)
    for at in np.ndindex(grid):
        point = {name: float(column[at]) for name, column in zip(checked, columns, strict=True)}
        with suppress(InputError):  # no well is certain there
            tree = prove_wells(mechanism.replace(**point))
            for well, barrier in zip(tree.wells, tree.barrier, strict=True):
                place = tree.equilibria[well]
                away = short_way(found.position[at] - place.position, mechanism.turning)
                depth[at][np.nanargmin(np.abs(away).max(axis=-1))] = barrier - place.energy
        if progress is not None:
            progress(1)
    return replace(found, depth=depth).of(mechanism)


def resting_places_at(
    mechanism: Mechanism,
    axes: dict[str, Floats],
    columns: Sequence[Floats],
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> RestingMap:
    """The map at any points: ``columns`` are the values of the parameters ``axes``, arrays of one shape."""
    grid, total = columns[0].shape, columns[0].size
    rows = np.tile(np.array(list(mechanism.parameters.values())), (total, 1))
    order = list(mechanism.parameters)
    for name, column in zip(axes, columns, strict=True):
        rows[:, order.index(name)] = column.ravel()
    statics, blocks = mechanism.statics(), dict[int, Block]()

    def solve(part: slice) -> None:
        found = search_rows(statics, rows[part])
        blocks[part.start] = _assessed(mechanism, rows[part], found)

    in_parts(solve, total, threads, BLOCK, progress)
    return _joined(mechanism, axes, grid, [blocks[first] for first in sorted(blocks)])


def axis_values(system: Any, name: Any, values: ArrayLike) -> Floats:
    """One axis over a parameter of a scene or a mechanism, as a float64 vector.

    Raises:
        InputError: the name is none of them, or the values are no vector of numbers.
    """
    known = list(system.parameters)
    if isinstance(name, str) and name in system.state:
        raise InputError(f"axes.{name}: is a coordinate or rate; axes are parameters: {', '.join(known)}")
    if not isinstance(name, str) or name not in known:
        hint = nearest(name, known) if isinstance(name, str) else f"allowed: {', '.join(known)}"
        raise InputError(f"axes.{shown_name(name)}: unknown parameter; {hint}")
    vector = checks.reals(f"axes.{name} = {shown(values)}", values, "a sequence of numbers")
    if vector.ndim != 1 or vector.size == 0:
        raise InputError(f"axes.{name}: shape {vector.shape}: must be one-dimensional and not empty")
    return vector


#: Counts of points, outcomes and whether some are hidden, and arrays of all their equilibria by name.
Block = tuple[NDArray[np.int16], Codes, dict[str, Any]]


def _checked(mechanism: Mechanism, axes: Mapping[str, ArrayLike]) -> dict[str, Floats]:
    if not isinstance(axes, Mapping) or not axes:
        raise InputError(f"axes = {shown(axes)}: must map at least one parameter to its values")
    checked = {}
    for name, values in axes.items():
        vector = axis_values(mechanism, name, values)
        checks.one_way(f"axes.{name}", values, vector)
        checked[name] = vector
    total = math.prod(vector.size for vector in checked.values())
    checks.memory(total, POINT_NUMBERS, f"axes: {total:.3g} points", "fewer")
    check_values(mechanism, dict(zip(checked, np.meshgrid(*checked.values()), strict=True)), "axes.")
    for name, vector in checked.items():
        for value in (vector.min(), vector.max()):
            if mechanism.replace(**{name: float(value)}).prints != mechanism.prints:
                raise InputError(f"axes.{name} = {value:g}: turns a load into another at rest; map it apart")
    return checked


def _assessed(mechanism: Mechanism, rows: Floats, found: Found) -> Block:
    """Positions, energies and stability of all equilibria of some points."""
    statics = mechanism.statics()
    number = found.count[:, 0]
    point = np.repeat(np.arange(len(rows)), number)
    slot = np.concatenate([np.arange(k) for k in number]) if len(number) else number
    position, radius, orientation, index = known_of(statics, found, point, slot)
    index = index if statics.conservative else np.full_like(index, -1)
    values = dict(zip(mechanism.parameters, rows[point].T, strict=True))
    own, _, _ = spectra(mechanism.linear(position, values))
    energy = np.full(len(point), np.nan)
    if "bounding" in mechanism.derived.functions:
        still = np.concatenate([position, np.zeros_like(position)], axis=1)
        energy = mechanism.evaluate("bounding", still.T, values)[0]
    each = {
        "position": position, "radius": radius, "energy": energy, "orientation": orientation,
        "morse_index": index, "verdict": verdicts(own, index),
        "eigenvalues": own.roots * own.rate[:, None], "growth": growth(own, index),
    }  # fmt: skip
    level = np.concatenate([np.zeros(0), *(alike(part) for part in np.split(energy, np.cumsum(number)[:-1]))])
    keys = (*np.round(position, DIGITS).T[::-1], np.nan_to_num(level), point)
    order = np.lexsort(keys)
    each = {name: values[order] for name, values in each.items()}
    proved = np.array([outcome_of_row(statics, found, k) for k in range(len(rows))], dtype=np.int8)
    return number.astype(np.int16), proved.reshape(-1, 2), each


def _joined(
    mechanism: Mechanism, axes: dict[str, Floats], grid: tuple[int, ...], blocks: list[Block]
) -> RestingMap:
    """All points, each equilibrium in its slot."""
    counts, outcomes, lists = zip(*blocks, strict=True)
    count = np.concatenate(counts)
    first = np.concatenate([[0], np.cumsum(count)])[:-1]
    point = np.repeat(np.arange(count.size), count)
    slot = np.arange(point.size) - first[point]
    slots = int(count.max(initial=0))
    arrays: dict[str, Any] = {}
    for name in lists[0]:
        values = np.concatenate([each[name] for each in lists])
        nothing = -1 if values.dtype == np.int8 else np.nan
        whole = np.full((count.size, slots, *values.shape[1:]), nothing, dtype=values.dtype)
        whole[point, slot] = values
        arrays[name] = whole.reshape(*grid, slots, *values.shape[1:])
    outcome, hidden = np.concatenate(outcomes).T.reshape(2, *grid)
    names = mechanism.state[: len(mechanism.coordinates)]
    arrays["hidden"] = hidden.astype(np.bool_)
    return RestingMap(axes, names, count.reshape(grid), outcome, **arrays).of(mechanism)


#: Longest and shortest step of a position [rad, lengths over their ranges by 2 pi].
LONGEST, SHORTEST = 0.05, 1e-9

#: Part of a step by which Newton's method may correct where its tangent leads.
CORRECTION = 0.3

#: A followed position is that of a proved list's well within so much.
SAME = 1e-6


def follow_wells(mechanism: Mechanism, parameter: str, values: Floats) -> Floats:
    """Where each well is [rad or m] (values, wells, n), NaN where it is not.

    A well is followed from each value to the next by small steps; where it disappears in between, one that is
    there afterwards is another.
    """
    found = map_resting_places(mechanism, {parameter: values})
    lists = [found.position[k][found.morse_index[k] == 0] for k in range(values.size)]
    wells: list[dict[int, Floats]] = [{0: place} for place in lists[0]]
    if values.size > 1:
        balance = Balance(mechanism, {parameter: values})
    for k in range(1, values.size):
        left = list(range(len(lists[k])))
        for well in wells:
            if k - 1 in well:
                end = _carried(balance, well[k - 1], values[k - 1], values[k])
                if end is None:
                    continue
                for j in left:
                    away = balance.apart(end, balance.point(lists[k][j], values[k : k + 1]))
                    if np.abs(away).max() < SAME:
                        well[k] = lists[k][j]
                        left.remove(j)
                        break
        wells += [{k: lists[k][j]} for j in left]
    places = np.full((values.size, len(wells), len(mechanism.coordinates)), np.nan)
    for w, well in enumerate(wells):
        for k, place in well.items():
            places[k, w] = place
    return places


def _carried(balance: Balance, position: Floats, start: float, end: float) -> Floats | None:
    """The point to which an equilibrium moves as the parameter changes; None where it disappears."""
    z = balance.point(position, np.array([start]))
    last = balance.point(position, np.array([end]))[-1]
    balance.rescale(z)
    side, along = np.sign(balance.determinant(z)), np.eye(z.size)[-1]
    part = last - z[-1]
    while abs(last - z[-1]) > 0.0:
        part = np.clip(part, -abs(last - z[-1]), abs(last - z[-1]))
        slopes = balance.forces(z)[1]
        move = np.append(-np.linalg.solve(slopes[:, :-1], slopes[:, -1]), 1.0) * part
        size = float(np.linalg.norm(move))
        guess = z + move
        guess[-1] = last if abs(part) == abs(last - z[-1]) else guess[-1]
        there = newton(balance.rest, guess, CORRECTION * size, along) if size <= LONGEST else None
        if there is not None and side * balance.determinant(there) > 0.0:
            there[-1] = guess[-1]
            z, part = there, 2.0 * part
        elif size < SHORTEST:
            return None
        else:
            part *= 0.5
    return z
