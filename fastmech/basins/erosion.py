"""Erosion profiles: how basins lose stability, integrity and the shock that they survive along a parameter.

After Soliman and Thompson, J. Sound Vib. 135 (1989) 453, and Rega and Lenci, Nonlinear Analysis 63 (2005)
902. A well keeps its identity along the parameter: its sheet in :func:`fastmech.map_equilibria`.
Every value is measured by itself, so that it does not matter which others are asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.arrays import Floats, Integers
from fastmech.atlas.resting_map import follow_wells
from fastmech.attractors.flow import angles_of
from fastmech.basins.label import label_states
from fastmech.basins.measures.fractions import basin_stability
from fastmech.basins.measures.integrity import integrity
from fastmech.basins.measures.labels import (
    check_angles,
    check_axes,
    check_labels,
    check_point,
    norm_on,
    state_index,
)
from fastmech.basins.shock import minimal_shock
from fastmech.capture.select import require_damper
from fastmech.capture.wells import require_potential
from fastmech.disturbance.motion import kinetic_norm, require_constant_force
from fastmech.ensembles import checks
from fastmech.ensembles.run import Progress
from fastmech.errors import InputError, necessary, shown
from fastmech.models.equilibria import find_equilibria
from fastmech.models.mechanism import Mechanism, short_way
from fastmech.objects import Drawn, coordinate_units, counted, spaced
from fastmech.scene import Scene
from fastmech.slider.atlas.map import sheets_of_wells

#: Relative tolerance of shocks: what a profile shows.
TOLERANCE = 1e-3


#: Where starts (n, states) of a scene or a mechanism end, as :class:`fastmech.Labels` has it: ``well``, the
#: index in ``find_equilibria(scene)`` (n,), negative where not known, and its ``turns`` (n, coordinates).
LabelsOf = Callable[[Any, Floats], Any]


@dataclass(frozen=True, eq=False, repr=False)
class ErosionProfile(Drawn):
    """Measures of every well along a parameter, arrays (values, wells); NaN where a well does not exist.

    Stability counts a start for the well whatever turns it makes on the way. Integrity and shocks are those
    of one copy of the well: another number of turns is elsewhere. Wells keep their numbers along the
    parameter, so these are not those of ``find_equilibria`` at one value: ``position`` tells which they are.
    """

    parameter: str
    values: Floats  #: (values,)
    sheet: Integers  #: identity of every well in the atlas of these values (wells,)
    position: dict[str, Floats]  #: where the well is [rad or m], by coordinate
    stability: Floats  #: basin stability: share of random starts in the window that end in the well
    stability_at_most: Floats  #: the same if all random starts without a label ended in the well
    lower: Floats  #: lower end of the 95 % Wilson interval, with none of these
    upper: Floats  #: upper end, with all of them
    gim: Floats  #: global integrity measure: share of the map
    gim_at_most: Floats  #: the same if all starts of the map without a label ended in the well
    lim: Floats  #: local integrity measure on the map [rad]; NaN also where the well is outside the window
    lim_at_window: NDArray[np.bool_]  #: the window's edge limits it, not the basin
    lim_at_most: Floats  #: as for the GIM [rad]; greater than ``lim``: starts without a label limit it
    factor: Floats  #: integrity factor on the map [rad]
    factor_at_window: NDArray[np.bool_]  #: the same for the factor
    factor_at_most: Floats  #: the same for the factor [rad]
    shock: Floats  #: minimal critical shock of all states [rad]; NaN also: none up to the largest
    kick: Floats  #: the same for a kick of the rates alone [rad]
    shock_undecided: Floats  #: smallest shock tried whose end is not known [rad]; NaN: none
    kick_undecided: Floats  #: the same of the kicks
    undecided: Floats  #: share of the random starts without a label

    KIND = "erosion"
    LAYOUT = "scan_types.erosion:profile_dataset"
    PICTURE = "plots.objects:draw_erosion_profile"

    def told(self) -> str:
        """Over which values each well exists, and how its share and its smallest shock change."""
        unit = "" if self.system is None else spaced(self.system.described()[self.parameter][1])
        size = [*coordinate_units(self.system).values()][-1]  # the norm's
        wells, values = counted(self.sheet.size, "well"), counted(self.values.size, "value")
        lines = [f"erosion of {wells} along {self.parameter}, {values}"]
        for w in range(self.sheet.size):
            there = np.flatnonzero(np.isfinite(self.stability[:, w]))
            if there.size:
                at = [*dict.fromkeys((there[0], there[-1]))]
                values, shares = (
                    " to ".join(f"{x:{how}}" for x in of[at])
                    for of, how in ((self.values, "g"), (self.stability[:, w], ".1%"))
                )
                shocks = [f"{x:.3g}" if np.isfinite(x) else "none found" for x in self.shock[at, w]]
                shock = " to ".join(dict.fromkeys(shocks))
                shock += f" {size}" * bool(np.isfinite(self.shock[at, w]).any())
                lines.append(
                    f"  well {w}, {values}{unit}: share of the starts {shares}, smallest shock {shock}"
                )
        unknown = float(np.max(self.undecided, initial=0.0, where=np.isfinite(self.undecided)))
        if unknown > 0.0:
            lines.insert(1, f"  up to {unknown:.1%} of the starts have no label: a longer t_end may tell")
        return "\n".join(lines)


#: Names of an :class:`ErosionProfile`'s arrays over values and wells.
MEASURES = tuple(field.name for field in fields(ErosionProfile)[4:])

#: Those that maps of basins tell.
INTEGRITY = tuple(name for name in MEASURES if name.startswith(("gim", "lim", "factor")))

#: What coordinates' names are told by among these: a coordinate may be named as one of them is.
PLACE = "place_"

#: Those that are yes or no.
FLAGS = ("lim_at_window", "factor_at_window")


class Survey:
    """What is measured of every well, and how; arguments and errors as for :func:`erosion`."""

    def __init__(
        self,
        axes: Mapping[str, ArrayLike],
        scene: Scene | Mechanism,
        *,
        most_shock: float,
        t_end: float | None,
        label_starts: LabelsOf | None = None,
        n: int,
        directions: int,
        seed: int,
    ) -> None:
        if not isinstance(axes, Mapping) or not axes:
            raise InputError(f"axes = {shown(axes)}: must map at least one state to its values")
        self.states = tuple(state_index(name, scene.state) for name in axes)
        self.lines = check_axes(axes, tuple(np.size(line) for line in axes.values()))
        for name, line in zip(axes, self.lines, strict=True):
            checks.one_way(f"axes.{name}", axes[name], line)
            check_angles(f"axes.{name}", name, line, angles_of(scene))
        rng = np.random.default_rng(checks.whole_number("seed", seed, least=0))
        self.window = np.array([[line[0], line[-1]] for line in self.lines])
        low, high = self.window.T
        n = checks.whole_number("n", n, least=1)
        self.random = low + (high - low) * rng.random((n, len(self.lines)))  # points in it (n, axes)
        t_end = None if t_end is None else checks.number("t_end", t_end, "s", above=0.0)
        self.label_starts = label_starts or partial(label_states, t_end=t_end)
        self.search = partial(
            minimal_shock, most=most_shock, directions=directions, tolerance=TOLERANCE, seed=seed
        )

    def of_wells(self, scene: Scene | Mechanism, places: Floats) -> dict[str, NDArray[Any]]:
        """Every measure of wells at ``places`` (wells, n) [rad or m], arrays (wells,); NaN where that is NaN.

        Coordinates, by their names behind :data:`PLACE`, are among the measures.
        """
        measured: dict[str, NDArray[Any]] = {
            name: np.zeros(len(places), dtype=bool) if name in FLAGS else np.full(len(places), np.nan)
            for name in (*(PLACE + state for state in scene.state[: places.shape[1]]), *MEASURES)
        }
        equilibria = find_equilibria(scene)
        for w in np.flatnonzero(np.isfinite(places[:, 0])):
            apart = np.linalg.norm(short_way(equilibria.position - places[w], scene.turning), axis=1)
            for name, number in self._of_well(scene, equilibria, int(apart.argmin())).items():
                measured[name][w] = number
        return measured

    def _of_well(self, scene: Scene | Mechanism, equilibria: Any, own: int) -> dict[str, float]:
        e = equilibria[own]
        n = e.position.size
        place = np.concatenate([e.position, np.zeros(n)])

        def copy_of(y: Floats) -> Integers:
            """0: this copy of the well, 1: elsewhere, -1: not known."""
            ends = self.label_starts(scene, y)
            well = check_labels(ends)
            elsewhere = (well != own) | (ends.turns != 0).any(axis=1)
            return np.where(well < 0, -1, elsewhere).astype(np.int64)

        share = basin_stability(self.label_starts(scene, self._starts(self.random, place)), own)
        norm = kinetic_norm(scene, e)
        search = partial(self.search, copy_of, place, norm)
        kick = search(coordinates=tuple(range(n, 2 * n)))
        # A kick of the rates is a shock too, and so is a push onto a saddle.
        guess = np.concatenate([kick.shock[None], _saddles_from(scene, equilibria, place)])
        shock = search(guess=guess[np.isfinite(guess).all(axis=1)])
        return {
            **{PLACE + name: float(x) for name, x in zip(scene.state[:n], e.position, strict=True)},
            "stability": float(share.fraction),
            "stability_at_most": float(share.at_most),
            "lower": float(share.lower),
            "upper": float(share.upper),
            "undecided": share.missing / share.n,
            "shock": shock.size,
            "shock_undecided": shock.undecided_from,
            "kick": kick.size,
            "kick_undecided": kick.undecided_from,
            **self._integrity(copy_of, place, norm),
        }

    def _integrity(
        self, copy_of: Callable[[Floats], Integers], place: Floats, norm: Floats
    ) -> dict[str, float]:
        grid = np.stack(np.meshgrid(*self.lines, indexing="ij"), axis=-1).reshape(-1, len(self.lines))
        labels = copy_of(self._starts(grid, place)).reshape([line.size for line in self.lines])
        own, (low, high) = place[list(self.states)], self.window.T
        within = bool(((own >= low) & (own <= high)).all())
        # Outside the window there is no largest ball round the well; the other measures need no centre.
        centre = own if within else self.window.mean(axis=1)
        result = integrity(labels, self.lines, 0, centre, norm_on(norm, place.size, self.states))
        found: dict[str, float] = {name: getattr(result, name) for name in INTEGRITY}
        return found if within else found | {"lim": np.nan, "lim_at_window": False, "lim_at_most": np.nan}

    def _starts(self, points: Floats, place: Floats) -> Floats:
        """States (n, states) at points (n, axes), the other ones those of ``place`` (states,)."""
        full = np.tile(place, (len(points), 1))
        full[:, list(self.states)] = points
        return full


@necessary(
    parameter="the name of one of scene.described()",
    values="rising numbers of the parameter",
    axes="names of states with their rising values, the map and its window",
    most_shock="the largest shock to look for, greater than 0 [rad, or the last coordinate's unit]",
)
def erosion(
    scene: Scene | Mechanism,
    parameter: str,
    values: ArrayLike,
    axes: Mapping[str, ArrayLike],
    *,
    most_shock: float,
    t_end: float | None = None,
    label_starts: LabelsOf | None = None,
    n: int = 2048,
    directions: int = 64,
    seed: int = 0,
    progress: Progress | None = None,
) -> ErosionProfile:
    """Erosion profiles of all wells along one parameter, in the kinetic-energy norm at each well.

    Args:
        scene: with constant loads; gives every other parameter.
        parameter: its name.
        values: of it, rising.
        axes: the map and its window: names of states, as ``scene.state`` has them, with their values
            [rad or m, and per s], rising in equal steps. States that are no axis are the well's own.
        most_shock: largest shock to look for [rad, or the last coordinate's unit].
        t_end: end of the runs [s], by default at every value as for :func:`fastmech.label_starts`; what is
            not captured by then has no label, of which the result tells.
        label_starts: where starts of a scene end, if not :func:`fastmech.label_starts` shall tell.
        n: random starts, uniform in the window, the same for all values.
        directions: random directions of the search for a shock. It also begins with those to the saddles,
            and with the smallest kick.
        seed: of the starts and the search.
        progress: called with the number of values that are done since the last call.

    Raises:
        InputError: an argument is wrong, a load changes, there is no damper, forces are not known to have a
            potential, or wells are not certain.
    """
    require_constant_force(scene)
    checks.progress_function(progress, "values")
    checks.function("label_starts", label_starts, "a scene and its starts (n, states)")
    along = check_point("values", values)
    checks.one_way("values", values, along)
    survey = Survey(
        axes,
        scene,
        most_shock=most_shock,
        t_end=t_end,
        label_starts=label_starts,
        n=n,
        directions=directions,
        seed=seed,
    )
    sheets, places = wells_along(scene, parameter, along)
    rows = []
    for value, place in zip(along, places, strict=True):
        rows.append(survey.of_wells(scene.replace(**{parameter: float(value)}), place))
        if progress is not None:
            progress(1)
    profile: Any = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
    position = {name: profile.pop(PLACE + name) for name in scene.state[: places.shape[2]]}
    return ErosionProfile(parameter, along, sheets, position, **profile).of(scene)


def wells_along(scene: Scene | Mechanism, parameter: str, values: Floats) -> tuple[Integers, Floats]:
    """Sheets of all wells along a parameter (wells,), and where they are (values, wells, n), or NaN.

    They are in the order that they have in a map at the value nearest to the present one.

    Raises:
        InputError: the parameter or a value of it is none, the scene has no damper, or its forces are not
            known to have a potential.
    """
    require_damper(scene)
    checks.one_of("parameter", parameter, scene.described())
    if isinstance(scene, Mechanism):
        require_potential(scene)
        places = follow_wells(scene, parameter, values)
        sheets = np.arange(places.shape[1])
    else:
        sheets, places = sheets_of_wells(scene, parameter, values)
    near = int(np.abs(values - scene.described()[parameter][0]).argmin())
    known = find_equilibria(scene.replace(**{parameter: float(values[near])})).position
    apart = np.linalg.norm(short_way(known - places[near][:, None], scene.turning), axis=2)
    rank = np.where(np.isfinite(apart).all(axis=1), apart.argmin(axis=1), len(known))
    order = np.argsort(rank, kind="stable")
    return sheets[order], places[:, order]


def _saddles_from(scene: Scene | Mechanism, equilibria: Any, place: Floats) -> Floats:
    """Disturbances (k, states) that lead from a state onto the nearest copies of the saddles."""
    index = np.array([e.morse_index for e in equilibria])
    away = short_way(equilibria.position[index == 1] - place[: place.size // 2], scene.turning)
    return np.concatenate([away, np.zeros_like(away)], axis=1)
