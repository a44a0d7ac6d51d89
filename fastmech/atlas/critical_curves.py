"""``fm.critical_curves``: folds, pitchforks, Hopf points and where frequencies or growths coalesce, over two.

Proved lists on a grid of both parameters tell between which neighbours something changes. From there Newton's
method on the critical point's defining system gives a point of a curve, and continuation the curve. A curve
that passes between all points of the grid is not seen, nor where two equilibria only exchange their
stability: lists hold the same then.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from fastmech.arrays import Floats
from fastmech.atlas.continuation import LONGEST, Curve, distance, finish_on_edge, newton, trace
from fastmech.atlas.critical import (
    Change,
    Known,
    Pairs,
    changes,
    hold_different,
    named,
    narrowed,
    told_incomplete,
)
from fastmech.atlas.defining import Balance
from fastmech.atlas.resting_map import map_resting_places
from fastmech.ensembles.checks import check_pair
from fastmech.errors import InputError, shown
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Drawn, Field, counted
from fastmech.outcome import Outcome

#: Halvings of an edge of the grid before Newton's method is tried.
HALVINGS = 10

#: How far Newton's method may go from there, and how near to a curve is on it [rad, parts of the ranges].
REACH, ON = 0.1, 2.0 * LONGEST

#: Curves of one kind after which none is begun.
MOST_CURVES = 100

#: A fold at which the forces change by the parameters along the null vector by less is none: a pitchfork.
SYMMETRIC = 1e-6

#: A swing that grows where damping is less, in its own units, is one where nothing damps.
UNDAMPED = 1e-6

#: A branch point at which the forces' second derivative along the null vector is larger is no pitchfork.
EVEN = 1e-5

#: Which power of a curve's further unknown is the frequency of the swing that grows.
SWINGS = {"Hopf": 1.0, "coalescence": 0.5}

Kind = Literal["fold", "pitchfork", "Hopf", "coalescence", "flutter-divergence"]


@dataclass(frozen=True, eq=False)
class CriticalCurve:
    """A curve of critical points; arrays over its points, in order."""

    kind: Kind
    x: Floats  #: values of the first parameter
    y: Floats  #: values of the second one
    position: Floats  #: of the equilibrium (points, n) [rad or m]
    frequency: Floats  #: of the swing that grows [rad/s]; 0 where none swings
    closed: bool  #: the last point is the first one
    finished: bool  #: it ends where it leaves the ranges, closes, or meets another curve


@dataclass(frozen=True, eq=False, repr=False)
class CriticalCurves(Drawn):
    """The critical curves that a grid shows."""

    names: tuple[str, str]  #: of the parameters
    coordinates: tuple[str, ...]
    curves: tuple[CriticalCurve, ...]
    cusps: Floats  #: (cusps, 2 + n): values of both parameters, position
    changes: int  #: edges of the grid between whose ends the equilibria change
    unexplained: Floats  #: (k, 2): changes on no curve
    points_of_grid: int  #: at which equilibria were proved
    incomplete: int  #: of them: points at which the list of equilibria is not proved complete
    unclear: int  #: of these: points at which too little is proved to compare them

    KIND = "critical_curves"
    PICTURE = "plots.objects:draw_critical_curves"
    TOLD = ("names",)
    FIELDS = {
        "x": Field("point", "@names.0", "value of the first parameter", "curves.x"),
        "y": Field("point", "@names.1", "value of the second parameter", "curves.y"),
        "*": Field("point coordinate", "", "equilibrium at which it happens,", "curves.position"),
        "frequency": Field("point", "rad/s", "of the swing that grows, 0: none swings", "curves.frequency"),
        "points": Field("curve", "1", "points of the curve"),
        "kind": Field("curve", "1", "kind of the curve", "curves.kind"),
        "closed": Field("curve", "1", "whether its last point is its first one", "curves.closed"),
        "finished": Field("curve", "1", "whether it ends where a curve may end", "curves.finished"),
        "cusps": Field("cusp cusp_entry", "1", "cusps: values of both parameters, then the position"),
        "unexplained": Field("change parameter", "1", "changes between points of the grid on no curve"),
    }

    @property
    def points(self) -> list[int]:
        """Points of each curve."""
        return [curve.x.size for curve in self.curves]

    def told(self) -> str:
        """Curves by their kinds, and changes that none explains."""
        kinds = [curve.kind for curve in self.curves]
        told = ", ".join(counted(kinds.count(k), f"{k} curve") for k in dict.fromkeys(kinds)) or "none"
        if self.points_of_grid - self.unclear < 2:
            told = "nothing could be compared"
        open_ones = told_incomplete(self.incomplete, self.unclear, self.points_of_grid)
        return (
            f"critical curves over {self.names[0]} and {self.names[1]}: {told}{open_ones}\n"
            f"  {counted(len(self.cusps), 'cusp')}; of {self.changes:,} changes on the grid "
            f"{len(self.unexplained):,} lie on no curve"
        )


def critical_curves(
    mechanism: Mechanism,
    x: tuple[str, ArrayLike],
    y: tuple[str, ArrayLike],
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> CriticalCurves:
    """Curves over two parameters on which equilibria appear, vanish or change their stability.

    Frequencies coalesce on a curve only where nothing damps all along it; where gyroscopic forces act they
    are among the changes on no curve, ``unexplained``. From points without damping to those with some an
    equilibrium becomes asymptotically stable, or unstable: that is no change here.

    Args:
        mechanism: gives the other parameters; loads are at their means.
        x, y: name and rising values of a parameter; what passes between all points of the grid is missed.
        threads: threads to use; the result does not depend on it.
        progress: called with the number of points of the grid that are done since the last call.

    Raises:
        InputError: an argument is wrong, or as :func:`fastmech.find_equilibria`.
    """
    if not isinstance(mechanism, Mechanism):
        raise InputError(
            f"mechanism = {shown(mechanism)}: must be a Mechanism; fm.trace_folds is for a Scene"
        )
    check_pair(x, y)
    found = map_resting_places(mechanism, dict((x, y)), threads=threads, progress=progress)
    for name, values in found.axes.items():
        if values.size < 2 or values[-1] < values[0]:
            raise InputError(f"{name}: must have two or more rising values")

    def damped(known: Known) -> bool:
        values = dict(zip(found.axes, known.at, strict=True))
        return bool(mechanism.linear(known.position, values).damping.any())

    def differ(a: Known, b: Known) -> bool:
        """Whether lists hold different things, and not only since damping begins between them."""
        same = [one[:2] for one in a.holds] == [one[:2] for one in b.holds]  # but for verdicts
        return hold_different(a, b) and not (same and damped(a) != damped(b))

    pairs = _changes(found, differ)
    balance = Balance(mechanism, found.axes)
    search = _CurveSearch(balance)
    for a, b in narrowed(mechanism, found.axes, pairs, HALVINGS, threads=threads, differ=differ):
        for change in named(mechanism, found.axes, a, b):
            search.begin(change, 0.5 * (a.at + b.at))
    lost = [at for at in search.lost if not search.explains(at)]
    names: Any = tuple(found.axes)
    cusps = [search.cusps(curve) for kind, curve in search.curves if kind == "fold"]
    return CriticalCurves(
        names,
        found.names,
        tuple(search.told(kind, curve) for kind, curve in search.curves),
        np.concatenate([np.empty((0, 2 + balance.n)), *cusps]),
        len(pairs),
        unexplained=np.array(lost).reshape(-1, 2),
        points_of_grid=found.outcome.size,
        incomplete=int(np.count_nonzero(found.outcome != Outcome.COMPLETE)),
        unclear=int(np.count_nonzero(found.hidden)),
    ).of(mechanism)


def _changes(found: Any, differ: Callable[[Known, Known], bool]) -> Pairs:
    """Neighbours on the grid whose lists differ."""
    first, second = found.axes.values()
    pairs: Pairs = []
    for turned in (False, True):
        outer, inner = (second, first) if turned else (first, second)
        for i in range(outer.size):
            line = []
            for j in range(inner.size):
                k = (j, i) if turned else (i, j)
                if not found.hidden[k]:
                    line.append(Known(np.array([first[k[0]], second[k[1]]]), found, k))
            pairs += changes(line, differ)
    return pairs


class _CurveSearch:
    """The curves that are known so far."""

    def __init__(self, balance: Balance) -> None:
        self._balance, self.curves, self.lost = balance, list[tuple[Kind, Curve]](), list[Floats]()

    def begin(self, change: Change, at: Floats) -> None:
        """Trace the curve through a critical point that is about here, unless it is known."""
        balance, n, (kind, position, rate, *_) = self._balance, self._balance.n, change
        if kind == "end of range":
            return
        if not np.isfinite(position).all():
            self.lost.append(at)
            return
        place = balance.point(position, at)
        if len(self.curves) >= MOST_CURVES or any(self._near(curve, place) for _, curve in self.curves):
            return
        if kind == "coalescence" and balance.linear(place[None]).damping.any():
            self.lost.append(at)  # gyroscopic forces: K - s M, of which curves are traced, is without them
            return
        balance.rescale(place)
        ways: dict[str, tuple[Kind, ...]] = {"fold": ("fold", "pitchfork")}
        ways |= {one: (one,) for one in ("Hopf", "coalescence", "flutter-divergence")}
        for name in ways.get(kind, ("pitchfork", "fold")):
            equations, more = balance.defining(name, rate)
            z = newton(equations, np.insert(place, n, more), REACH)
            if z is None or not self._inside(z):
                continue
            own = self._kind(z, name)
            if own is None:
                continue
            if not any(one == own and self._near(curve, z) for one, curve in self.curves):
                finish = finish_on_edge(equations, self._inside)
                curve = trace(equations, z, self._inside, finish, balance.apart)
                if own == "coalescence" and balance.linear(curve.points).damping.any():
                    break  # at a point of it, if at all
                if own in SWINGS:  # the units of the next curve are others
                    curve.points[:, n] = balance.rate * np.abs(curve.points[:, n]) ** SWINGS[own]
                self.curves.append((own, curve))
            return
        self.lost.append(at)

    def _kind(self, z: Floats, name: Any) -> Kind | None:
        """What a critical point is; None if other equations than its name's are its own."""
        if name == "Hopf" and np.abs(self._balance.motion(z)[0][1]).max() < UNDAMPED:
            return None
        if name in ("Hopf", "coalescence", "flutter-divergence"):
            return cast(Kind, name)
        flat = np.delete(z, self._balance.n) if name == "pitchfork" else z
        bent, moved, _ = self._balance.bend(flat)
        if name == "fold":
            return "fold" if moved > SYMMETRIC else None
        even = max(abs(z[self._balance.n]), moved) < SYMMETRIC and abs(bent) < EVEN
        return "pitchfork" if even else None

    def _inside(self, z: Floats) -> bool:
        swings = len(z) == self._balance.n + 2 or z[self._balance.n] >= -SYMMETRIC
        return bool(swings and self._balance.in_range(z))

    def _near(self, curve: Curve, z: Floats) -> bool:
        points = self._flat(curve.points)
        return distance(points, self._flat(z), self._balance.apart)[0] < ON

    def _flat(self, z: Floats) -> Floats:
        """Without the further unknown."""
        n = self._balance.n
        return np.concatenate([z[..., :n], z[..., -2:]], axis=-1)

    def explains(self, at: Floats) -> bool:
        """Whether a curve passes these values of the parameters."""
        here = (at - self._balance.low) / self._balance.span
        return any(
            distance(curve.points[:, -2:], here, lambda a, b: a - b)[0] < ON for _, curve in self.curves
        )

    def cusps(self, curve: Curve) -> Floats:
        """Values and position of the cusps of a fold curve (k, 2 + n)."""
        balance, places = self._balance, []
        _, _, left = balance.bend(curve.points[0])

        def bent(share: float, a: Floats, b: Floats, left: Floats) -> float:
            z = newton(balance.singular, a + share * balance.apart(b, a), REACH, balance.apart(b, a))
            value, _, own = balance.bend(a if z is None else z)
            return value * float(np.sign(own @ left))

        for a, b in zip(curve.points[:-1], curve.points[1:], strict=True):
            if bent(0.0, a, b, left) * bent(1.0, a, b, left) < 0.0:
                share = brentq(bent, 0.0, 1.0, (a, b, left), xtol=1e-14)
                z = newton(balance.singular, a + share * balance.apart(b, a), REACH, balance.apart(b, a))
                if z is not None:
                    places.append(np.concatenate([balance.values(z), balance.position(z)]))
            _, _, own = balance.bend(b)
            left = own * np.sign(own @ left)
        return np.array(places).reshape(-1, 2 + balance.n)

    def told(self, kind: Kind, curve: Curve) -> CriticalCurve:
        """In the parameters' and coordinates' units."""
        balance, z = self._balance, curve.points
        x, y = balance.values(z).T
        fast = z[:, balance.n] if kind in SWINGS else np.zeros(len(z))
        return CriticalCurve(
            kind, x, y, balance.position(z), fast, closed=curve.closed, finished=curve.finished
        )
