"""The minimal critical shock: the smallest disturbance of a resting state that makes it end elsewhere.

Halekotte and Feudel, Sci. Rep. 10 (2020) 11783 (minimal fatal shocks). In the norm it is the radius of the
largest ball round the attractor within its basin: LIM, with the point of the boundary where that ball
touches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats, Integers
from fastmech.attractors.find import Attractor
from fastmech.basins.label import label_name, well_numbers
from fastmech.basins.measures.labels import LabelOf, ask, check_point, norm_on
from fastmech.disturbance.motion import kinetic_norm, unit_directions
from fastmech.ensembles import checks
from fastmech.errors import InputError, necessary, shown
from fastmech.models.equilibria import RestingPlace
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Printed, counted
from fastmech.scene import Scene
from fastmech.slider.equilibria import Equilibrium

#: Radii at which a ray is looked at before its first way out is narrowed down: at first, and once turned.
LEVELS, TURNED_LEVELS = 24, 8

#: Radii, of all those, at which rays are looked at together, more of them where there are fewer starts.
TOGETHER, STARTS = 4, 64

#: Directions of the largest search: some hundred bytes of memory each.
MOST_DIRECTIONS = 10_000_000

#: Points between two radii at which a way out is narrowed down.
SECTIONS = 7

#: What calls must give.
NECESSARY = {
    "attractor": "a resting state, one of fm.find_equilibria(...), such as E[0], or an attractor",
    "most": "the largest size to look at, a number greater than 0",
}

#: Candidates that the search refines, and directions tried round each in a round, for each way to turn.
CANDIDATES, TRIALS = 6, 8


@dataclass(frozen=True, eq=False, repr=False)
class Shock(Printed):
    """The smallest shock found."""

    size: float  #: in the norm; NaN: nothing left the basin up to ``most``
    shock: Floats  #: disturbance of the state (dim,); NaN likewise
    label: int  #: where it ends; -1: nowhere else; 2^63 - 1: it escapes, or leaves its range
    undecided_from: float  #: size of the smallest disturbance tried whose end is not known; NaN: none
    trajectories: int  #: starts that were labelled
    end: str = ""  #: what the label means, in words

    def told(self) -> str:
        """The size, and whether smaller shocks were tried whose ends are not known."""
        if np.isfinite(self.size):
            found = f"smallest shock found: {self.size:.6g}, to {self.end or f'the label {self.label}'}"
        else:
            found = "no shock found that leaves the basin"
        line = f"{found}; {counted(self.trajectories, 'start')} labelled"
        if not self.undecided_from < (self.size if np.isfinite(self.size) else np.inf):
            return line
        return (
            f"{line}\n  not all ends are known from size {self.undecided_from:.6g} on: "
            "smaller ones may leave; a longer t_end may tell"
        )


@necessary(**NECESSARY)
def minimal_shock(
    label_of: LabelOf | Scene | Mechanism,
    attractor: ArrayLike | Equilibrium | RestingPlace | Attractor,
    norm: ArrayLike | None = None,
    *,
    most: float,
    coordinates: Sequence[int] | None = None,
    guess: ArrayLike | None = None,
    directions: int = 128,
    tolerance: float = 1e-4,
    t_end: float | None = None,
    seed: int = 0,
) -> Shock:
    """Search for the minimal critical shock of an attractor.

    Random directions and the guesses are followed outwards to their first way out of the basin; the best are
    turned a little at random again and again, less each time that nothing improves. No gradients are used.
    The result lies outside the basin, so the true minimum is not larger; that nothing smaller was missed is
    not proved: compare with :func:`brute_force_shock`.

    Args:
        label_of: labels (n,) of starts (n, dim), negative: none. A start without a label is not taken to have
            left the basin; ``undecided_from`` tells of it. Of a scene: which copy of which well captures
            them by ``t_end``, see :func:`fastmech.well_numbers`.
        attractor: the resting state (dim,), a scene's equilibrium, or an attractor that was found, of which
            the first of its ``points`` is disturbed; its own label must be known.
        norm: matrix N (dim, dim): ``|d @ N|`` is the size of a disturbance d. By default, for a scene's
            equilibrium, the kinetic-energy norm there (:func:`fastmech.kinetic_norm`).
        most: largest size to look at.
        coordinates: states that the shock may change, all by default; (2, 3) is a velocity kick.
        guess: disturbances (n, dim) whose directions are tried too.
        directions: random directions to begin with.
        tolerance: relative, of the size along a direction.
        t_end: of a scene or mechanism, end of the runs [s], by default as for :func:`fastmech.label_starts`.
        seed: of NumPy's ``default_rng``.

    Raises:
        InputError: an argument is wrong or missing, or the attractor itself has no label.
    """
    rays = Rays(label_of, attractor, norm, coordinates, tolerance=tolerance, t_end=t_end)
    units, rng = rays.random_units(directions, seed)
    if guess is not None:
        given = checks.states("guess", guess, rays.place.size) @ np.linalg.pinv(rays.to_state)
        length = np.linalg.norm(given, axis=1, keepdims=True)
        if not (np.isfinite(length) & (length > 0.0)).all():
            raise InputError("guess: must be finite and differ from 0 in the chosen coordinates")
        units = np.concatenate([given / length, units])
    return rays.result(*rays.turned(units, checks.number("most", most, "", above=0.0), rng))


@necessary(**NECESSARY)
def brute_force_shock(
    label_of: LabelOf | Scene | Mechanism,
    attractor: ArrayLike | Equilibrium | RestingPlace | Attractor,
    norm: ArrayLike | None = None,
    *,
    most: float,
    coordinates: Sequence[int] | None = None,
    directions: int = 4096,
    tolerance: float = 1e-4,
    t_end: float | None = None,
    seed: int = 0,
) -> Shock:
    """The smallest shock over many random directions, each followed to its first way out: a check.

    Arguments, result and errors as :func:`minimal_shock`. It approaches the minimum from above as the number
    of directions grows.
    """
    rays = Rays(label_of, attractor, norm, coordinates, tolerance=tolerance, t_end=t_end)
    units, _ = rays.random_units(directions, seed)
    limit = np.array([checks.number("most", most, "", above=0.0)])
    sizes, labels = rays.first_exits(units[None], limit, LEVELS, 1)
    return rays.result(units, sizes[0], labels[0])


class Rays:
    """Rays of disturbances from a resting state, the labels along them, and where they leave its basin.

    They are all disturbances of some coordinates in a norm, see :func:`minimal_shock`.
    """

    def __init__(
        self,
        label_of: Any,
        attractor: Any,
        norm: Any,
        coordinates: Sequence[int] | None,
        *,
        tolerance: float,
        t_end: float | None,
    ) -> None:
        scene = label_of if isinstance(label_of, Scene | Mechanism) else None
        if isinstance(attractor, Equilibrium | RestingPlace):
            place = np.append(attractor.position, np.zeros(len(attractor.position)))
            norm = kinetic_norm(scene, attractor) if norm is None and scene is not None else norm
        else:
            point = attractor.points[0] if isinstance(attractor, Attractor) else attractor
            place = check_point("attractor", point)
        if norm is None:
            raise InputError(
                "norm: missing; only an equilibrium of a scene or mechanism has one by default, the "
                "kinetic-energy norm"
            )
        if scene is not None:
            label_of = well_numbers(scene, t_end)
        elif t_end is not None:
            raise InputError(f"t_end = {shown(t_end)}: is for a scene or mechanism; label_of has its own")
        matrix = norm_on(norm, place.size, coordinates)
        #: (k, dim): ``point @ to_state`` is the disturbance whose size is the point's length.
        self.to_state = np.zeros((len(matrix), place.size))
        self.to_state[:, slice(None) if coordinates is None else list(coordinates)] = np.linalg.inv(matrix)
        self.tolerance = checks.number("tolerance", tolerance, "", above=0.0)
        self.label_of, self.place = label_of, place
        self.label = int(ask(label_of, place[None])[0])  #: of its own basin
        if self.label < 0:
            raise InputError("attractor: has no label itself; it must be in a basin")
        self.trajectories, self.undecided = 1, np.inf  #: smallest size tried whose end is not known

    def random_units(self, n: int, seed: int) -> tuple[Floats, np.random.Generator]:
        """Random directions (n, k), and what drew them."""
        rng = np.random.default_rng(checks.whole_number("seed", seed, least=0))
        n = checks.whole_number("directions", n, least=1, most=MOST_DIRECTIONS)
        return unit_directions(rng, n, len(self.to_state)), rng

    def turned(self, units: Floats, most: float, rng: np.random.Generator) -> tuple[Floats, Floats, Integers]:
        """The rays that leave first, turned for as long as it helps; their sizes and labels."""
        found, ends = self.first_exits(units[None], np.array([most]), LEVELS, CANDIDATES)
        best = np.argsort(found[0], kind="stable")[:CANDIDATES]
        units, sizes, labels = units[best], found[0, best], ends[0, best]
        spread, rows = np.full(len(units), 0.5), np.arange(len(units))
        trials = TRIALS * max(1, units.shape[1] - 1)
        # A turn by the angle s changes the size by s^2 at a smooth minimum.
        while np.isfinite(sizes).any() and (spread > 0.5 * np.sqrt(self.tolerance)).any():
            random = rng.standard_normal((len(units), trials, units.shape[1]))
            turned = units[:, None] + spread[:, None, None] * random
            turned /= np.linalg.norm(turned, axis=2, keepdims=True)
            found, ends = self.first_exits(turned, np.minimum(sizes, most), TURNED_LEVELS, 1)
            column = found.argmin(axis=1)
            better = found[rows, column] < sizes * (1.0 - self.tolerance)
            units[better] = turned[rows, column][better]
            labels[better] = ends[rows, column][better]
            sizes[better] = found[rows, column][better]
            spread[~better] *= 0.5
        return units, sizes, labels

    def labels(self, units: Floats, radii: Floats) -> Integers:
        """Labels (n,) of the starts at ``radii`` along ``units``."""
        found = ask(self.label_of, self.place + (units * radii[:, None]) @ self.to_state)
        self.trajectories += len(units)
        self.undecided = min(self.undecided, float(radii[found < 0].min(initial=np.inf)))
        return found

    def first_exits(self, units: Floats, limit: Floats, levels: int, keep: int) -> tuple[Floats, Integers]:
        """Sizes at which rays first have another label, and these labels; inf and -1: not up to ``limit``.

        Args:
            units: directions of rays in groups (groups, rays, k).
            limit: largest size to look at (groups,).
            levels: radii to look at, evenly spaced.
            keep: so many of each group's shortest rays are narrowed down to the tolerance; the others only
                until they are known not to be among them.

        Returns:
            Arrays (groups, rays).
        """
        shape = units.shape[:2]
        units = units.reshape(-1, units.shape[2])
        top = np.repeat(limit, shape[1])[:, None]
        ladder = top * (np.arange(levels + 1) / levels)
        lower, upper = np.zeros(len(units)), np.full(len(units), np.inf)
        label = np.full(len(units), -1, dtype=np.int64)

        def promising() -> Floats:
            """Of the rays, which might still be among the shortest."""
            last = min(keep, shape[1]) - 1
            worst = np.partition(upper.reshape(shape), last, axis=1)[:, last]
            return np.asarray(lower < np.minimum(np.repeat(worst, shape[1]), top[:, 0]))

        def look(rays: Integers, radii: Floats) -> None:
            """Narrow down where rays leave by their labels at rising radii (rays, m)."""
            m = radii.shape[1]
            seen = self.labels(np.repeat(units[rays], m, axis=0), radii.ravel()).reshape(-1, m)
            out = (seen >= 0) & (seen != self.label)
            first, leaves = out.argmax(axis=1), out.any(axis=1)
            row = np.arange(len(rays))
            upper[rays[leaves]] = radii[row, first][leaves]
            label[rays[leaves]] = seen[row, first][leaves]
            inner = np.where(leaves, first, m) - 1
            lower[rays[inner >= 0]] = radii[row, inner][inner >= 0]

        together = max(TOGETHER, STARTS // len(units))
        for level in range(0, levels, together):
            rays = np.flatnonzero(np.isinf(upper) & promising())
            look(rays, ladder[rays, level + 1 : level + together + 1])
        while True:
            wide = np.isfinite(upper) & (upper - lower > self.tolerance * upper)
            rays = np.flatnonzero(wide & promising())
            if not rays.size:
                return upper.reshape(shape), label.reshape(shape)
            share = np.arange(1, SECTIONS + 1) / (SECTIONS + 1)
            look(rays, lower[rays, None] + (upper - lower)[rays, None] * share)

    def result(self, units: Floats, sizes: Floats, labels: Integers) -> Shock:
        """The smallest of shocks along ``units``."""
        best = int(np.argmin(sizes))
        size = float(sizes[best]) if np.isfinite(sizes[best]) else np.nan
        return Shock(
            size=size,
            shock=(size * units[best : best + 1] @ self.to_state)[0],
            label=int(labels[best]),
            undecided_from=self.undecided if np.isfinite(self.undecided) else np.nan,
            trajectories=self.trajectories,
            end=label_name(self.label_of, int(labels[best])),
        )
