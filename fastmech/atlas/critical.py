"""``fm.critical_values``: where equilibria of a mechanism appear, vanish or change stability in a parameter.

Proved lists of equilibria at the values of a grid are compared by what they hold: how many of which Morse
index and verdict. Between neighbours that differ, values are proved in the middle again and again until
rounding ends it. What changes twice between neighbours that do not differ is not seen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.atlas.resting_map import RestingMap, map_resting_places
from fastmech.equilibria.outcome import Outcome
from fastmech.errors import InputError, shown
from fastmech.models.mechanism import Mechanism
from fastmech.models.stability import VERDICTS

Floats = NDArray[np.float64]

#: Relative width at which a value is located, and halvings at most.
WIDTH, HALVINGS = 4.0 * 2.0**-52, 120

#: Relative distance of located values that are one.
SAME = 1e-9

#: Where between two values the next one lies: where rounding hides the list in the middle, beside it.
BETWEEN = (0.5, 0.38, 0.62, 0.46, 0.54)

#: A pitchfork's pair lies so evenly about the equilibrium that it comes from, in its own distance.
EVENLY = 0.1

#: A damping rate below this share of the frequencies is none: two frequencies coalesce.
NO_DAMPING = 1e-6


@dataclass(frozen=True)
class CriticalValue:
    """A value of a parameter at which something changes."""

    value: float
    width: float  #: of the interval in which the lists differ, about the value
    kind: Literal["fold", "pitchfork", "Hopf", "coalescence", "divergence", "exchange", "several"]
    position: tuple[float, ...]  #: of the equilibrium at which it happens, NaN where there are several

    def __str__(self) -> str:
        place = ", ".join(f"{x:.6g}" for x in self.position)
        return f"{self.value:.12g}: {self.kind} at ({place})"


def critical_values(
    mechanism: Mechanism,
    parameter: str,
    values: ArrayLike,
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> list[CriticalValue]:
    """Values of a parameter at which equilibria appear, vanish or change their stability, rising.

    Folds and pitchforks change how many there are; at a Hopf point a pair of eigenvalues crosses the
    imaginary axis; where nothing damps two frequencies coalesce instead; a divergence is an eigenvalue
    through zero. An exchange changes Morse indices and no number. ``several`` at once are not told apart.

    Args:
        mechanism: gives the other parameters; loads are at their means.
        parameter: its name.
        values: of it, two or more, rising; what changes twice between two of them is missed.
        threads: threads to use; the result does not depend on it.
        progress: is told how many of the values are done since its last call.

    Raises:
        InputError: an argument is wrong, or as :func:`fastmech.find_equilibria`.
    """
    if not isinstance(mechanism, Mechanism):
        raise InputError(f"mechanism = {shown(mechanism)}: must be a Mechanism; fm.find_folds is for a Scene")

    def lists(at: ArrayLike) -> RestingMap:
        return map_resting_places(mechanism, {parameter: at}, threads=threads)

    first = map_resting_places(mechanism, {parameter: values}, threads=threads, progress=progress)
    grid = first.axes[parameter]
    if grid.size < 2 or grid[-1] < grid[0]:
        raise InputError(f"values = {shown(values)}: must be two or more rising values")
    known = [_Known(float(x), first, k) for k, x in enumerate(grid) if first.outcome[k] == Outcome.COMPLETE]
    todo = [(a, b) for a, b in pairwise(known) if a.holds != b.holds]
    located = []
    for _ in range(HALVINGS):
        if not todo:
            break
        middles = [a.value + share * (b.value - a.value) for a, b in todo for share in BETWEEN]
        order = np.argsort(middles)
        rising, place = np.unique(np.array(middles)[order], return_inverse=True)
        found, where = lists(rising), np.empty(len(middles), dtype=np.int64)
        where[order] = place
        following = []
        for k, (a, b) in enumerate(todo):
            own = where[k * len(BETWEEN) : (k + 1) * len(BETWEEN)]
            between = [_Known(float(rising[i]), found, i) for i in own]
            usable = [one for one in between if one.complete and a.value < one.value < b.value]
            if not usable or b.value - a.value <= WIDTH * max(abs(a.value), abs(b.value)):
                located.append((a, b))
                continue
            chain = sorted([a, *usable, b], key=lambda one: one.value)
            following += [(c, d) for c, d in pairwise(chain) if c.holds != d.holds]
        todo = following
    merged: list[tuple[_Known, _Known]] = []
    for a, b in sorted(located + todo, key=lambda pair: pair[0].value):
        # Within rounding of one value lists may change more than once.
        if merged and a.value - merged[-1][1].value <= SAME * max(abs(a.value), abs(b.value)):
            a = merged.pop()[0]
        merged.append((a, b))
    return [_named(mechanism, a, b) for a, b in merged if a.holds != b.holds]


class _Known:
    """The list at one value."""

    def __init__(self, value: float, found: RestingMap, k: int) -> None:
        self.value, self.complete = value, found.outcome[k] == Outcome.COMPLETE
        n = int(found.count[k])
        self.position, self.eigenvalues = found.position[k, :n], found.eigenvalues[k, :n]
        self.index, self.verdict = found.morse_index[k, :n], found.verdict[k, :n]
        self.orientation = found.orientation[k, :n]

    @property
    def holds(self) -> tuple[Any, ...]:
        """How many equilibria of which index, orientation and verdict."""
        return tuple(
            sorted(zip(self.index.tolist(), self.orientation.tolist(), self.verdict.tolist(), strict=True))
        )


def _named(mechanism: Mechanism, a: _Known, b: _Known) -> CriticalValue:
    """What changes between two lists that are next to each other."""
    less, more = (a, b) if len(a.position) <= len(b.position) else (b, a)
    turning = np.array([c.periodic for c in mechanism.coordinates])

    def apart(one: Floats, other: Floats) -> Floats:
        away = one[:, None] - other
        return np.asarray(
            np.abs(np.where(turning, np.remainder(away + np.pi, 2 * np.pi) - np.pi, away)).max(2)
        )

    def told(kind: Any, position: Floats) -> CriticalValue:
        value = 0.5 * a.value + 0.5 * b.value
        return CriticalValue(value, b.value - a.value, kind, tuple(map(float, position)))

    unknown = np.full(len(mechanism.coordinates), np.nan)
    left = list(range(len(more.position)))
    pairs = []
    distance = apart(less.position, more.position) if left and len(less.position) else np.zeros((0, 0))
    for i in np.argsort(distance.min(axis=1)) if len(distance) else []:
        j = left[int(np.argmin(distance[i, left]))]
        left.remove(j)
        pairs.append((int(i), j))
    if len(left) == 2:
        one, other = more.position[left]
        size = float(apart(one[None], other[None])[0, 0])
        middle = one + 0.5 * np.where(
            turning, np.remainder(other - one + np.pi, 2 * np.pi) - np.pi, other - one
        )
        beside = apart(middle[None], less.position).min(initial=np.inf)
        changed = [(i, j) for i, j in pairs if less.index[i] != more.index[j]]
        return told("pitchfork" if beside < EVENLY * size and changed else "fold", middle)
    if left:
        return told("several", unknown)
    indices = [
        (i, j)
        for i, j in pairs
        if less.orientation[i] != more.orientation[j] or less.index[i] != more.index[j]
    ]
    if indices:
        return told("exchange" if len(indices) == 2 else "several", more.position[indices[0][1]])
    verdicts = [(i, j) for i, j in pairs if less.verdict[i] != more.verdict[j]]
    i, j = verdicts[0]
    roots = more.eigenvalues[j] if VERDICTS[more.verdict[j]] == "unstable" else less.eigenvalues[i]
    fast = float(np.abs(roots).max()) or 1.0
    steady = np.abs(roots[0].imag) < NO_DAMPING * fast
    undamped = np.abs(roots.real).max() < 1e3 * NO_DAMPING * fast
    kind = "divergence" if steady else ("coalescence" if undamped else "Hopf")
    return told(kind if len(verdicts) == 1 else "several", more.position[j])
