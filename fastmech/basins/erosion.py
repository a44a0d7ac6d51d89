"""Erosion profiles: how basins lose stability, integrity and the shock that they survive along a parameter.

After Soliman and Thompson, J. Sound Vib. 135 (1989) 453, and Rega and Lenci, Nonlinear Analysis 63 (2005)
902. A well keeps its identity along the parameter: its sheet in :func:`fastmech.atlas.map.map_equilibria`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.atlas.map import map_equilibria
from fastmech.basins.measures.fractions import basin_stability
from fastmech.basins.measures.integrity import integrity
from fastmech.basins.measures.labels import Floats, Integers, check_point
from fastmech.basins.measures.norm import kinetic_norm, norm_on
from fastmech.basins.shock import minimal_shock
from fastmech.disturbance.ensemble import require_constant_force
from fastmech.ensembles import checks
from fastmech.equilibria.find import Equilibria, find_equilibria
from fastmech.errors import InputError
from fastmech.scene import Scene, nearest

#: States of the mechanism by the names of a map's axes.
STATES = ("phi", "theta", "phi_dot", "theta_dot")


class Ends(Protocol):
    """Where n starts end."""

    @property
    def well(self) -> NDArray[np.integer[Any]]:
        """Index of the well in ``find_equilibria(scene)``, negative where it is not known; shape (n,)."""

    @property
    def turns(self) -> NDArray[np.integer[Any]]:
        """Full turns of phi and theta of that well from its listed place, shape (n, 2)."""


#: Where starts (n, 4) of a scene end.
LabelsOf = Callable[[Scene, Floats], Ends]


@dataclass(frozen=True, eq=False)
class ErosionProfile:
    """Measures of every well along a parameter, arrays (values, wells); NaN where a well does not exist.

    Stability counts a start for the well whatever turns it makes on the way. Integrity and shocks are those
    of one copy of the well: another number of turns is elsewhere.
    """

    parameter: str
    values: Floats  #: (values,)
    sheet: Integers  #: identity of every well in the atlas of these values (wells,)
    phi: Floats  #: where the well is [rad]
    theta: Floats  #: rad
    stability: Floats  #: basin stability: share of random starts in the window that end in the well
    lower: Floats  #: lower end of its 95 % Wilson interval
    upper: Floats  #: upper end
    gim: Floats  #: global integrity measure: share of the map
    lim: Floats  #: local integrity measure on the map [rad]; NaN also where the well is outside the window
    lim_at_window: NDArray[np.bool_]  #: the window's edge limits it, not the basin
    factor: Floats  #: integrity factor on the map [rad]
    factor_at_window: NDArray[np.bool_]  #: the same for the factor
    shock: Floats  #: minimal critical shock of all four states [rad]; NaN also: none up to the largest
    kick: Floats  #: the same for a kick of the rates alone [rad]
    undecided: Floats  #: share of the random starts without a label


def erosion(
    scene: Scene,
    parameter: str,
    values: ArrayLike,
    labels_of: LabelsOf,
    axes: Mapping[str, ArrayLike],
    *,
    most_shock: float,
    n: int = 2048,
    directions: int = 64,
    seed: int = 0,
) -> ErosionProfile:
    """Erosion profiles of all wells along one parameter, in the kinetic-energy norm at each well.

    Args:
        scene: with a constant force; gives every other parameter.
        parameter: name of a parameter, such as "F0", "c1" or "c2".
        values: of it, rising.
        labels_of: where starts of a scene end.
        axes: the map and its window: names among phi, theta [rad], phi_dot, theta_dot [rad/s] with their
            coordinates, rising in equal steps. States that are no axis are the well's own.
        most_shock: largest shock to look for [rad].
        n: random starts, uniform in the window, the same for all values.
        directions: random directions of the search for a shock. It also begins with those to the saddles,
            with the smallest kick, and with the shock found at the value before.
        seed: of the starts and the search.

    Raises:
        InputError: an argument is wrong, or the force decays.
    """
    require_constant_force(scene)
    along = check_point("values", values)
    window = _window(axes, n, seed)
    atlas = map_equilibria(scene, {parameter: along})
    wells = np.flatnonzero(atlas.sheet_morse_index == 0)
    arrays = [field.name for field in fields(ErosionProfile)][3:]
    flags = ("lim_at_window", "factor_at_window")
    shape = along.size, wells.size
    profile: dict[str, Any] = {
        name: np.zeros(shape, dtype=bool) if name in flags else np.full(shape, np.nan) for name in arrays
    }
    guesses: list[dict[str, Floats]] = [{} for _ in wells]
    for v, value in enumerate(along):
        now = scene.replace(**{parameter: float(value)})
        equilibria = find_equilibria(now)
        for w, sheet in enumerate(wells):
            for slot in np.flatnonzero(atlas.sheet[v] == sheet):
                own = _index_at(equilibria, float(atlas.phi[v, slot]), float(atlas.theta[v, slot]))
                shocks, measured = _measure(
                    now, equilibria, own, labels_of, window, guesses[w], most_shock, directions, seed
                )
                guesses[w] |= shocks
                for name, number in measured.items():
                    profile[name][v, w] = number
    return ErosionProfile(parameter, along, wells.astype(np.int64), **profile)


@dataclass(frozen=True, eq=False)
class _Window:
    """A slice of the state space."""

    states: list[int]  #: its axes
    lines: list[Floats]  #: coordinates along them
    random: Floats  #: random points in it (n, axes)

    def grid(self) -> Floats:
        """All points of the map (points, axes)."""
        return np.stack(np.meshgrid(*self.lines, indexing="ij"), axis=-1).reshape(-1, len(self.lines))

    def starts(self, points: Floats, place: Floats) -> Floats:
        """States (n, 4) at points (n, axes), the other ones those of ``place`` (4,)."""
        full = np.tile(place, (len(points), 1))
        full[:, self.states] = points
        return full


def _window(axes: Mapping[str, ArrayLike], n: int, seed: int) -> _Window:
    states = [_state(name) for name in axes]
    if not states:
        raise InputError("axes: must name at least one state")
    lines = [check_point(f"axes.{name}", line) for name, line in axes.items()]
    rng = np.random.default_rng(checks.whole_number("seed", seed, least=0))
    low, high = np.array([[line.min(), line.max()] for line in lines]).T
    n = checks.whole_number("n", n, least=1)
    return _Window(states, lines, low + (high - low) * rng.random((n, len(lines))))


def _measure(
    scene: Scene,
    equilibria: Equilibria,
    own: int,
    labels_of: LabelsOf,
    window: _Window,
    guesses: Mapping[str, Floats],
    most_shock: float,
    directions: int,
    seed: int,
) -> tuple[dict[str, Floats], dict[str, float]]:
    """Shocks found and all measures of one well of one scene."""
    e = equilibria[own]
    place = np.array([e.phi, e.theta, 0.0, 0.0])

    def copy_of(y: Floats) -> Integers:
        """0: this copy of the well, 1: elsewhere, -1: not known."""
        ends = labels_of(scene, y)
        elsewhere = (ends.well != own) | (ends.turns != 0).any(axis=1)
        return np.where(ends.well < 0, -1, elsewhere).astype(np.int64)

    share = basin_stability(labels_of(scene, window.starts(window.random, place)).well, own)
    norm = kinetic_norm(scene, e)
    labels = copy_of(window.starts(window.grid(), place)).reshape([line.size for line in window.lines])
    measured = {
        "phi": e.phi,
        "theta": e.theta,
        "stability": float(share.fraction),
        "lower": float(share.lower),
        "upper": float(share.upper),
        "undecided": share.missing / share.n,
        **_integrity(labels, window.lines, place[window.states], norm_on(norm, 4, window.states)),
    }
    search = partial(minimal_shock, copy_of, place, norm, most=most_shock, directions=directions, seed=seed)
    kick = search(coordinates=(2, 3), guess=guesses.get("kick"))
    # A kick of the rates is a shock too, and so is a push onto a saddle.
    known = [guesses.get("shock", np.zeros((0, 4))), kick.shock[None], _saddles_from(equilibria, place)]
    guess = np.concatenate(known)
    shocks = {"kick": kick, "shock": search(guess=guess[np.isfinite(guess).all(axis=1)])}
    measured |= {name: result.size for name, result in shocks.items()}
    found = {name: result.shock[None] for name, result in shocks.items() if np.isfinite(result.size)}
    return found, measured


def _saddles_from(equilibria: Equilibria, place: Floats) -> Floats:
    """Disturbances (n, 4) that lead from a state onto the nearest copies of the saddles."""
    saddles = equilibria.morse_index == 1
    angles = np.column_stack([equilibria.phi, equilibria.theta])[saddles] - place[:2]
    angles -= 2.0 * np.pi * np.round(angles / (2.0 * np.pi))
    return np.concatenate([angles, np.zeros_like(angles)], axis=1)


def _integrity(labels: Integers, lines: Sequence[Floats], place: Floats, norm: Floats) -> dict[str, float]:
    window = np.array([[line[0], line[-1]] for line in lines])
    within = bool(((place >= window[:, 0]) & (place <= window[:, 1])).all())
    # Outside the window there is no largest ball round the well; the other measures need no centre.
    centre = place if within else window.mean(axis=1)
    result = integrity(labels, lines, 0, centre, norm)
    return {
        "gim": result.gim,
        "lim": result.lim if within else np.nan,
        "lim_at_window": within and result.lim_at_window,
        "factor": result.factor,
        "factor_at_window": result.factor_at_window,
    }


def _index_at(equilibria: Equilibria, phi: float, theta: float) -> int:
    apart = np.hypot(np.sin((equilibria.phi - phi) / 2.0), np.sin((equilibria.theta - theta) / 2.0))
    return int(apart.argmin())


def _state(name: str) -> int:
    if name not in STATES:
        raise InputError(f"axes.{name}: unknown name; {nearest(name, list(STATES))}")
    return STATES.index(name)
