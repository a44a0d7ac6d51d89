"""``fm.critical_values``: where equilibria of a mechanism appear, vanish or change stability in a parameter.

Proved lists of equilibria at the values of a grid are compared by what they hold: how many of which Morse
index, and how many of their eigenvalues grow and swing. Between neighbours that differ, values are proved in
the middle again and again until rounding ends it; there the defining system of what happens gives the value.
Where two equilibria only exchange their stability lists
hold the same; then equilibria are followed from one list to the next by their tangents, and differ where they
come to a place of another kind.
What changes twice between neighbours that do not differ is not seen. Lists that are not proved complete hold
proved equilibria and are compared too; one that is only lost from them changes the sum of orientations, which
meeting equilibria do not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from fastmech.arrays import Floats
from fastmech.atlas.defining import Balance
from fastmech.atlas.placing import EQUATIONS, Located, placed
from fastmech.atlas.resting_map import RestingMap, map_resting_places, resting_places_at
from fastmech.ensembles import checks
from fastmech.errors import InputError, shown
from fastmech.models.mechanism import Mechanism, short_way
from fastmech.objects import Field, Printed, Result, counted
from fastmech.outcome import Outcome

#: Width at which a value is located, over the larger of the neighbours on the grid: a value may be zero; and
#: halvings at most.
WIDTH, HALVINGS = 4.0 * 2.0**-52, 120

#: Distance of located values that are one, over the same.
SAME = 1e-9

#: Width over the value that its twelve digits do not tell.
TOLD = 1e-12

#: How near to an end of its coordinate's range an equilibrium is on it, over the range.
AT_END = 1e-6

#: Where between two values the next one lies: where rounding hides the list in the middle, beside it.
BETWEEN = (0.5, 0.38, 0.62, 0.46, 0.54)

Kind = Literal[
    "fold", "pitchfork", "Hopf", "coalescence", "flutter-divergence", "divergence", "exchange",
    "end of range", "several",
]  # fmt: skip


@dataclass(frozen=True, repr=False)
class CriticalValue(Printed):
    """A value of a parameter at which something changes."""

    value: float
    width: float  #: of the interval about the value in which rounding may leave it
    kind: Kind
    position: tuple[float, ...]  #: of the equilibrium at which it happens, NaN where there are several
    growing: tuple[int, int] | None = None  #: its eigenvalues with a positive real part below and above
    #: Those of them that swing; None: equilibria meet or cross an end.
    swinging: tuple[int, int] | None = None
    direction: tuple[float, ...] | None = None  #: in which the stiffness is zero there, largest part 1

    def told(self) -> str:
        """Value, kind and place, and how many eigenvalues grow."""
        place = ", ".join(f"{x:.6g}" for x in self.position)
        about = f" +- {0.5 * self.width:.2g}" if self.width > TOLD * abs(self.value) else ""
        told = f"{self.value:.12g}{about}: {self.kind} at ({place})"
        if self.direction is not None and len(self.direction) > 1:
            told += f" along ({', '.join(f'{x:.3g}' for x in self.direction)})"
        if self.growing is None or self.swinging is None:
            return told
        grow, swing = (f"{below} -> {above}" for below, above in (self.growing, self.swinging))
        return f"{told}, eigenvalues that grow {grow}, that swing {swing}"


def told_incomplete(incomplete: int, unclear: int, total: int) -> str:
    """At how many points of a grid lists are not proved complete, or not compared; empty where all are."""
    told = f"; at {incomplete:,} of {total:,} points of the grid equilibria are not proved complete"
    told += f", at {unclear:,} of these they are too unclear to be compared" if unclear else ""
    return f"{told}: more may change" if incomplete else ""


class CriticalValues(Result, tuple[CriticalValue, ...]):
    """Critical values of a parameter, rising."""

    KIND = "critical_values"
    FIELDS = {
        "value": Field("change", "@parameter", "value at which something changes", "changes.value"),
        "width": Field("change", "@parameter", "width of the interval about it", "changes.width"),
        "kind": Field("change", "1", "what happens", "changes.kind"),
    }
    parameter = ""
    points_of_grid = incomplete = 0  #: of the grid, and those at which the list is not proved complete
    unclear = 0  #: of these: where too little is proved to compare them

    @property
    def changes(self) -> tuple[CriticalValue, ...]:
        """The values one by one."""
        return tuple(self)

    def told(self) -> str:
        """Each value, what happens there, and where."""
        head = f"{counted(len(self), 'critical value')} of {self.parameter}"
        head += f"; changes between two of the {self.points_of_grid} values that undo each other are not seen"
        if self.points_of_grid - self.unclear < 2:
            head = f"critical values of {self.parameter}: nothing could be compared"
        head += told_incomplete(self.incomplete, self.unclear, self.points_of_grid)
        return "\n".join([head, *(f"  {self.parameter} = {value.told()}" for value in self)])


def critical_values(
    mechanism: Mechanism,
    parameter: str,
    values: ArrayLike,
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> CriticalValues:
    """Values of a parameter at which equilibria appear, vanish or change how they are unstable, rising.

    Folds and pitchforks change how many there are; at a Hopf point a pair of eigenvalues crosses the
    imaginary axis; where nothing damps two frequencies coalesce there instead, or part again. At a
    ``flutter-divergence`` the pair of a growing swing meets on the real axis: on one side two motions grow
    without swinging. A divergence is an eigenvalue through zero where no equilibria are seen to meet. Each
    tells how many eigenvalues grow and how many of these swing, below and above. At an exchange two
    equilibria pass through each other and take over each other's stability (a transcritical point): it is
    seen where their tangents at neighbouring values tell which is which. At an ``end of range`` nothing
    happens but that equilibria cross an end of a coordinate's range. Mirror images change at one value;
    what cannot be told apart is ``several``.

    A value is a solution of the equations of what happens there, and its ``width`` is what rounding leaves
    of it; where these have none nearby, that of the interval in which lists differ. ``direction`` tells
    which way the mechanism gives.

    Args:
        mechanism: gives the other parameters; loads are at their means.
        parameter: its name.
        values: of it, two or more, rising; what changes twice between two of them is missed.
        threads: threads to use; the result does not depend on it.
        progress: called with the number of values that are done since the last call.

    Raises:
        InputError: an argument is wrong, or as :func:`fastmech.find_equilibria`.
    """
    if not isinstance(mechanism, Mechanism):
        raise InputError(f"mechanism = {shown(mechanism)}: must be a Mechanism; fm.find_folds is for a Scene")
    checks.one_of("parameter", parameter, mechanism.parameters)
    first = map_resting_places(mechanism, {parameter: values}, threads=threads, progress=progress)
    grid = first.axes[parameter]
    if grid.size < 2 or grid[-1] < grid[0]:
        raise InputError(f"values = {shown(values)}: must be two or more rising values")
    known = [Known(grid[[k]], first, k) for k in range(grid.size) if not first.hidden[k]]
    passed = Passed(mechanism, parameter, grid)
    located = narrowed(
        mechanism, first.axes, changes(known, passed.differ), HALVINGS, threads=threads, differ=passed.differ
    )
    merged: list[tuple[Known, Known]] = []
    for a, b in sorted(located, key=lambda pair: float(pair[0].at[0])):
        # Within rounding of one value lists may change more than once.
        right = min(int(np.searchsorted(grid, a.at[0], "right")), grid.size - 1)
        size = np.abs(grid[max(right - 1, 0) : right + 1]).max()
        if merged and a.at[0] - merged[-1][1].at[0] <= SAME * size:
            a = merged.pop()[0]
        merged.append((a, b))
    found: list[CriticalValue] = []
    for a, b in merged:
        if hold_different(a, b):
            here = named(mechanism, [parameter], a, b)
            if here[0].kind != "end of range" and only_lost(a, b):
                continue
        else:
            here = turned(mechanism, [parameter], (a, b), passed.exchanging(a, b))
        found += located_values(passed, here, (a, b))
    found.sort(key=lambda one: one.value)
    told = CriticalValues(found).of(mechanism)
    told.parameter, told.points_of_grid = parameter, grid.size
    told.incomplete = int(np.count_nonzero(first.outcome != Outcome.COMPLETE))
    told.unclear = int(np.count_nonzero(first.hidden))
    return told


def located_values(passed: Passed, here: list[Change], between: tuple[Known, Known]) -> list[CriticalValue]:
    """Of what happens between two lists, each by its own equations where these have a solution there."""
    a, b = between
    middle, width = float(0.5 * a.at[0] + 0.5 * b.at[0]), float(b.at[0] - a.at[0])
    found: list[CriticalValue] = []
    for one in here:
        place = Located(middle, width, one.position)
        if one.kind in EQUATIONS and np.isfinite(one.position).all():
            own = placed(passed.balance, one.kind, (one.position, middle), one.rate)
            near = 0.5 * width + SAME * float(passed.balance.span[0])
            if own is not None and max(abs(own.value - middle), 0.5 * own.width) <= near:
                place = own
        same = next((k for k in found if abs(k.value - place.value) <= 0.5 * (k.width + place.width)), place)
        position, flat = tuple(map(float, place.position)), place.direction
        direction = None if flat is None else tuple(map(float, flat))
        changed = one.growing, one.swinging, direction
        found.append(CriticalValue(same.value, max(same.width, place.width), one.kind, position, *changed))
    return found


class Known:
    """A list of proved equilibria and the values of parameters that it is for."""

    def __init__(self, at: Floats, found: RestingMap, k: Any) -> None:
        self.at = at
        n = int(found.count[k])
        self.position, self.eigenvalues = found.position[k][:n], found.eigenvalues[k][:n]
        each = found.morse_index[k][:n], found.orientation[k][:n], *found.growth[k][:n].T
        #: Index, orientation, and how many eigenvalues grow and swing, of each.
        self.each = list(zip(*(codes.tolist() for codes in each), strict=True))
        self.orientations = int(found.orientation[k][:n].sum(dtype=int))
        self.complete = bool(found.outcome[k] == Outcome.COMPLETE)

    @property
    def holds(self) -> tuple[Any, ...]:
        """How many equilibria there are of which kind."""
        return tuple(sorted(self.each))


Pairs = list[tuple[Known, Known]]


def hold_different(a: Known, b: Known) -> bool:
    """Whether lists differ by what they hold."""
    return bool(a.holds != b.holds)


def only_lost(a: Known, b: Known) -> bool:
    """Whether lists, of which one is not complete, differ by equilibria that cannot have met."""
    complete = a.complete and b.complete
    return not complete and bool(a.orientations != b.orientations)


def changes(known: list[Known], differ: Callable[[Known, Known], bool] = hold_different) -> Pairs:
    """Neighbours whose lists differ."""
    return [(a, b) for a, b in pairwise(known) if differ(a, b)]


class Passed:
    """Equilibria that pass through each other from one value of a parameter to another."""

    def __init__(self, mechanism: Mechanism, parameter: str, grid: Floats) -> None:
        self._of = mechanism, {parameter: grid}

    @cached_property
    def balance(self) -> Balance:
        """Made where lists hold the same at last."""
        return Balance(*self._of)

    def differ(self, a: Known, b: Known) -> bool:
        """Whether lists hold different things, or the same in places that have passed each other."""
        return hold_different(a, b) or bool(self.exchanging(a, b))

    def exchanging(self, a: Known, b: Known) -> list[tuple[int, int]]:
        """Numbers in two lists that hold the same of equilibria that lead to places of another kind."""
        if len(set(a.each)) < 2:
            return []
        balance, step = self.balance, float(b.at[0] - a.at[0]) / float(self.balance.span[0])
        ahead, back = (self._led(known, part * step) for known, part in ((a, 0.5), (b, -0.5)))
        if not (np.isfinite(ahead).all() and np.isfinite(back).all()):
            return []
        apart = np.linalg.norm(balance.apart(ahead[:, None], back), axis=2)
        pairs = ((int(i), int(j)) for i, j in zip(*linear_sum_assignment(apart), strict=True))
        return [(i, j) for i, j in pairs if a.each[i] != b.each[j]]

    def _led(self, known: Known, step: float) -> Floats:
        """Where their tangents lead equilibria (count, n)."""
        n, led = self.balance.n, np.full((len(known.position), self.balance.n), np.nan)
        for k, position in enumerate(known.position):
            z = self.balance.point(position, known.at)
            slopes = self.balance.forces(z)[1]
            with suppress(np.linalg.LinAlgError):
                led[k] = z[:n] - step * np.linalg.solve(slopes[:, :n], slopes[:, n])
        return led


def narrowed(
    mechanism: Mechanism,
    axes: dict[str, Floats],
    todo: Pairs,
    halvings: int,
    *,
    threads: int | None = None,
    differ: Callable[[Known, Known], bool] = hold_different,
) -> Pairs:
    """Pairs whose lists differ, nearer to each other by so many halvings, or within rounding."""
    located: Pairs = []
    sizes = [np.maximum(np.abs(a.at), np.abs(b.at)) for a, b in todo]
    for _ in range(halvings):
        between: list[Known | None] = [None] * len(todo)
        for share in BETWEEN:
            open_ones = [k for k, middle in enumerate(between) if middle is None]
            if not open_ones:
                break
            at = np.array([todo[k][0].at + share * (todo[k][1].at - todo[k][0].at) for k in open_ones])
            found = resting_places_at(mechanism, axes, list(at.T), threads=threads)
            for row, k in enumerate(open_ones):
                a, b = todo[k]
                inside = (at[row] != a.at).any() and (at[row] != b.at).any()
                if inside and not found.hidden[row]:
                    between[k] = Known(at[row], found, row)
        following, scales = Pairs(), list[Floats]()
        for (a, b), middle, size in zip(todo, between, sizes, strict=True):
            if middle is None or (np.abs(b.at - a.at) <= WIDTH * size).all():
                located.append((a, b))
            else:
                left = changes([a, middle, b], differ)
                following, scales = following + left, scales + [size] * len(left)
        todo, sizes = following, scales
        if not todo:
            break
    return located + todo


class Change(NamedTuple):
    """What happens to an equilibrium."""

    kind: Kind
    position: Floats
    rate: float = 0.0  #: of the swing [rad/s]; where flutter and divergence meet, their growth [1/s]
    growing: tuple[int, int] | None = None  #: eigenvalues with a positive real part before and after
    swinging: tuple[int, int] | None = None


def named(mechanism: Mechanism, names: Iterable[str], a: Known, b: Known) -> list[Change]:
    """What changes between two lists that are next to each other and hold different things."""
    less, more = (a, b) if len(a.position) <= len(b.position) else (b, a)

    def apart(one: Floats, other: Floats) -> Floats:
        return np.asarray(np.abs(short_way(one[:, None] - other, mechanism.turning)).max(2))

    unknown = np.full(len(mechanism.coordinates), np.nan)
    left = list(range(len(more.position)))
    pairs = []
    distance = apart(less.position, more.position) if left and len(less.position) else np.zeros((0, 0))
    for i in np.argsort(distance.min(axis=1)) if len(distance) else []:
        j = left[int(np.argmin(distance[i, left]))]
        left.remove(j)
        pairs.append((int(i), j))
    if left and all(at_end(mechanism, more.position[j]) for j in left):
        return [Change("end of range", more.position[left[0]])]
    between = apart(more.position[left], more.position[left])
    np.fill_diagonal(between, np.inf)
    nearest = between.argmin(axis=1) if len(left) > 1 else np.zeros(0, dtype=int)
    if left and not (len(left) == len(nearest) and (nearest[nearest] == np.arange(len(left))).all()):
        return [Change("several", unknown)]
    merging = []
    for k, other in enumerate(nearest.tolist()):
        if k > other:  # each pair once
            continue
        size = float(between[k, other])
        one = more.position[left[k]]
        middle = one + 0.5 * short_way(more.position[left[other]] - one, mechanism.turning)
        away = apart(middle[None], less.position)[0]
        # Within rounding any of the three may be the one that was there, or it may lie between them.
        near = int(away.argmin()) if len(away) and away.min() < 2.0 * size else None
        three = [] if near is None else [left[k], left[other], dict(pairs)[near]]
        same = near is not None and sum(more.each[j][:2] == less.each[near][:2] for j in three) == 2
        merging.append(Change("pitchfork", less.position[near]) if same else Change("fold", middle))
    if merging:
        return merging
    return turned(mechanism, names, (a, b), pairs)


def turned(
    mechanism: Mechanism, names: Iterable[str], lists: tuple[Known, Known], pairs: list[tuple[int, int]]
) -> list[Change]:
    """What changes of equilibria, given by their numbers in two lists next to each other."""
    (a, b), found = lists, list[Change]()
    passing = [j for i, j in pairs if a.each[i][:2] != b.each[j][:2]]
    if len(passing) == 2:
        return [Change("exchange", b.position[passing[0]])]
    if len(passing) > 2:
        return [Change("several", np.full_like(b.position[0], np.nan))]
    for i, j in pairs:
        if a.each[i] == b.each[j]:
            continue
        (*_, growing, swinging), (*_, grow, swing) = a.each[i], b.each[j]
        most = max((growing, swinging), (grow, swing))
        roots = (b.eigenvalues[j] if most == (grow, swing) else a.eigenvalues[i])[: most[0]]
        swings = roots[np.argsort(-np.abs(roots.imag))][: most[1]]
        steps, rate = (abs(grow - growing), abs(swing - swinging)), 0.0
        kind: Kind = "several"
        if steps == (2, 2):  # of swings the one on the imaginary axis, or nearest to the real one
            linear = mechanism.linear(b.position[j], dict(zip(names, b.at, strict=True)))
            kind = "Hopf" if linear.dissipates else "coalescence"
            rate = abs(float(swings[np.argmin(swings.real)].imag))
        elif steps == (0, 2):
            kind, rate = "flutter-divergence", float(swings[np.argmin(np.abs(swings.imag))].real)
        elif steps in ((1, 0), (2, 0)):
            kind = "divergence"
        found.append(Change(kind, b.position[j], rate, (growing, grow), (swinging, swing)))
    return found


def at_end(mechanism: Mechanism, position: Floats) -> bool:
    """Whether a position is at an end of a coordinate's range."""
    low, high = mechanism.ranges.T
    near = np.minimum(np.abs(position - low), np.abs(position - high)) <= AT_END * (high - low)
    return bool((near & ~np.array(mechanism.turning)).any())
