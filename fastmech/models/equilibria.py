"""All equilibria of a mechanism, proved to be there, to be alone, and to be all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Codes, Floats
from fastmech.callee import callee
from fastmech.errors import InputError, shown
from fastmech.intervals.search import AT_END, BENT, LIMIT, TWO_PI, UNCLEAR, UNDEFINED, Found, search, work
from fastmech.loads import held_at
from fastmech.models.mechanism import Mechanism
from fastmech.models.statics import Statics
from fastmech.objects import Printed, counted
from fastmech.outcome import Outcome
from fastmech.scene import Scene
from fastmech.slider import equilibria as of_scene

#: Boxes that are treated at most, by the number of coordinates; a chain of four pendulums takes 9,600.
LIMITS = {1: 10_000, 2: 50_000, 3: 300_000, 4: 1_000_000}

#: Times as many are treated of a list alone along a stiff spring's force and across it, if need be: a second
#: or two. Of the many lists of a map, as many.
BESIDE = 8

MOST = 128  #: zeros at most
TOGETHER = 2000  #: boxes not decided that are compared with one another; of more, neighbours are one before

#: An angle's first box begins so far from -pi: symmetric mechanisms have equilibria there.
SEAM = 0.3217

#: Boxes not decided that touch are taken for one degenerate equilibrium if they span less of the domain.
SMALL_PLACE = 1e-4

#: Parts of the domain, along every coordinate, in which a place that spans more than one of them is told.
PIECES = 8.0

#: For a curve of equilibria if they span more of their own widths.
CURVE = 20.0

#: Digits of energies, over the largest, and of positions by which equilibria are put in order.
DIGITS = 9

#: Length of a spring that is zero, over how long it may be.
ZERO = 1e-6

#: Boxes that are tried to show the sign of a force on one end of a range.
FACES = 1000


@dataclass(frozen=True, eq=False, repr=False)
class RestingPlace(Printed):
    """One equilibrium of a mechanism; the forces Q - dU/dq vanish there."""

    position: Floats  #: coordinates (n,) [rad or m], periodic angles in (-pi, pi]
    radius: float  #: the one equilibrium here is proved to be within so many rad or m, by each coordinate
    stiffness: Floats  #: minus the forces' derivatives (n, n); the Hessian of U if there is a potential
    orientation: int  #: sign of the stiffness matrix' determinant, proved; 0 if it is not
    morse_index: int | None  #: directions in which U falls, proved; -2 not proved; None without a potential
    energy: float = math.nan  #: U [J], loads at their means; NaN where forces are not known to have one

    def told(self) -> str:
        """Kind, place and energy."""
        place = ", ".join(f"{value:.6g}" for value in self.position)
        energy = "" if math.isnan(self.energy) else f"; {self.energy:.6g} J"
        return f"equilibrium: {self.kind} at ({place}), each within {self.radius:.2g}{energy}"

    @property
    def kind(self) -> str:
        """``minimum``, ``saddle``, ``maximum``, ``degenerate``; without a potential by ``orientation``."""
        if self.morse_index is None:
            return {1: "positive", -1: "negative", 0: "degenerate"}[self.orientation]
        extremes = {-2: "degenerate", 0: "minimum", len(self.position): "maximum"}
        return extremes.get(self.morse_index, "saddle")


@dataclass(frozen=True, eq=False, repr=False)
class Place(Printed):
    """A part of the domain of which it is not proved what equilibria it holds."""

    low: Floats  #: (n,)
    high: Floats  #: (n,)
    boxes: int  #: how many boxes it consists of
    reason: str


@dataclass(frozen=True, repr=False)
class Proof(of_scene.Proved):
    """What is proved about the equilibria of a mechanism."""

    outcome: Outcome
    places: tuple[Place, ...]  #: not decided; outside of them the list is complete and correct
    peaks: tuple[Place, ...]  #: maxima of U where a spring has length zero, and stiffness no value
    index_sum: int | None  #: sum of the orientations, peaks included; None where one is not proved
    expected_sum: int | None  #: what it must be; None where forces on the ends of a range do not decide it
    boxes: int  #: that were treated
    sentence: str


@dataclass(frozen=True, eq=False, repr=False)
class RestingPlaces(of_scene.Listed[RestingPlace]):
    """Equilibria of a mechanism: the deepest first, or without a potential by orientation and position."""

    items: tuple[RestingPlace, ...]
    names: tuple[str, ...]  #: of the coordinates
    certificate: Proof

    def index_of(self, equilibrium: RestingPlace) -> int:
        """Which of these an equilibrium is.

        Raises:
            InputError: it is none of them, for example one of another mechanism.
        """
        of_scene.require_one(equilibrium, RestingPlace)
        for k, item in enumerate(self.items):
            if item.position.shape == equilibrium.position.shape:
                away = np.abs(item.position - equilibrium.position)
                stiffness = np.abs(item.stiffness - equilibrium.stiffness)
                if (away <= 1e-9).all() and (stiffness <= 1e-9 * np.abs(item.stiffness).max()).all():
                    return k
        told = shown(equilibrium.position.tolist())
        raise InputError(f"equilibrium = {told}: must be one of this mechanism's equilibria")

    def held(self) -> str:
        """Under which loads they are."""
        return held_at(self.system.loads) if self.system is not None else ""

    def place(self, k: int) -> str:
        """Where an equilibrium is, in words."""
        named = zip(self.names, self.items[k].position, strict=True)
        return ", ".join(f"{name} = {round(value, 9) + 0.0:.6g}" for name, value in named)


@overload
def find_equilibria(system: Scene, at: float = ...) -> of_scene.Equilibria: ...
@overload
def find_equilibria(system: Mechanism) -> RestingPlaces: ...
@overload
def find_equilibria(system: Scene | Mechanism, at: float = ...) -> of_scene.Equilibria | RestingPlaces: ...
def find_equilibria(system: Any, at: float = math.inf) -> of_scene.Equilibria | RestingPlaces:
    """All equilibria of a scene or a mechanism, with a proof that none is missing.

    Args:
        system: of a ``Scene`` the force is frozen at a time; of a ``Mechanism`` loads are at their means.
        at: that time [s], for a scene. A constant force is the same at every time. A decaying one is
            zero at the default ``inf``, so Table 2 of the paper needs ``alpha = 0`` or ``at=0``.

    Where rounding hides how many equilibria there are, near a fold, or where they are not isolated, the
    certificate says so and where. It tells of dry friction, which holds a mechanism at other places too.

    Raises:
        InputError: ``at`` is not a number >= 0; a coordinate's range is not finite; a force has a function of
            which no bounds are known.
    """
    if not isinstance(system, Mechanism):
        return of_scene.find_equilibria(system, at)
    if at != math.inf:
        raise InputError(f"at = {shown(at)}: is for a Scene; equilibria of a mechanism hold for mean loads")
    found = prove_equilibria(system.statics(), list(system.parameters.values()))
    if "bounding" in system.derived.functions and len(found):
        still = np.zeros((2 * len(found.names), len(found)))
        still[: len(found.names)] = found.position.T
        energies = system.evaluate("bounding", still)[0]
        items = [replace(item, energy=float(u)) for item, u in zip(found, energies, strict=True)]
        order = np.argsort(alike(energies), kind="stable")  # the deepest first, equal ones in their order
        found = replace(found, items=tuple(items[k] for k in order))
    told = "; ".join(filter(None, (found.certificate.sentence, held_at(system.loads))))
    if system.dry:
        told = f"without its dry friction, which holds it at other places too: {told}"
    return replace(found, certificate=replace(found.certificate, sentence=told)).of(system)


def prove_equilibria(
    statics: Statics, values: Sequence[float] = (), limit: int | None = None
) -> RestingPlaces:
    """All equilibria for one set of parameters' values, in the order of ``statics.parameters``.

    At most ``limit`` boxes are treated. Raises as :func:`find_equilibria`.
    """
    limit = limit or LIMITS[len(statics.coordinates)]
    found = search_rows(statics, np.array([values], dtype=np.float64), limit, limit + 2, beside=BESIDE)
    n, count = len(statics.coordinates), int(found.count[0, 0])
    p = np.repeat(np.array(values, dtype=np.float64)[:, None], 2, 1)
    f, J, items, forces = np.empty((n, 2)), np.empty((n, n, 2)), [], _balance(statics)
    each = zip(*known_of(statics, found, 0, np.arange(count)), strict=True)
    for zero, (position, radius, orientation, index) in zip(found.zeros[0], each, strict=False):
        forces(zero, p, f, J)
        own = int(index) if statics.conservative else None
        items.append(RestingPlace(position, float(radius), -J.mean(2), int(orientation), own))
    items.sort(key=lambda item: (item.morse_index or 0, -item.orientation, *item.position.round(DIGITS)))
    names = tuple(str(coordinate.symbol) for coordinate in statics.coordinates)
    return RestingPlaces(tuple(items), names, _proof(statics, p, found, items))


def alike(energies: Floats) -> Floats:
    """Energies (..., count) without the digits that rounding and positions' errors may change."""
    scale = np.abs(energies).max(axis=-1, keepdims=True, initial=np.finfo(float).tiny)
    return np.asarray(np.round(energies / scale, DIGITS))


def known_of(statics: Statics, found: Found, row: Any, slot: Any) -> tuple[Floats, Floats, Codes, Codes]:
    """Positions, radii, orientations and Morse indices (-2: not proved) of zeros, by row and slot."""
    zeros = found.zeros[row, slot]
    low, high = np.moveaxis(zeros, -1, 0)
    size = np.abs(zeros).max((1, 2), initial=0.0)
    radius = (high - low).max(axis=1, initial=0.0) + 1e-15 * (1.0 + size)
    orientation = found.orientation[row, slot] * (-1) ** len(statics.coordinates)
    positive = found.positive[row, slot]
    index = np.where(positive >= 0, positive, -2)
    return placed(zeros, statics), radius, orientation.astype(np.int8), index.astype(np.int8)


def placed(zeros: Floats, statics: Statics) -> Floats:
    """Positions (..., n) in enclosures (..., n, 2): the middle, or 0 if it is one; angles in (-pi, pi]."""
    low, high = np.moveaxis(zeros, -1, 0)
    positions = np.where((low <= 0.0) & (high >= 0.0), 0.0, zeros.mean(-1))
    turning = np.array([coordinate.periodic for coordinate in statics.coordinates])
    return np.asarray(positions - TWO_PI * np.ceil((positions - math.pi) / TWO_PI) * turning)


def outcome_of_row(statics: Statics, found: Found, row: int) -> tuple[Outcome, bool]:
    """What is proved about the list of one row, and whether ones that merge may be missing."""
    left, count = int(found.count[row, 1]), int(found.count[row, 0])
    if left:
        kept = int(np.count_nonzero(found.reason[row]))
        places = _places(found.left[row, :kept], found.reason[row, :kept], domain_of(statics))
        reasons = {place.reason for place in places}
        known = {_REASONS[UNDEFINED], _ALONG_LINE, _REASONS[AT_END], _REASONS[BENT]}
        return _outcome(reasons) if kept == left else Outcome.UNPROVED, not reasons <= known
    signs = found.orientation[row, :count].astype(int) * (-1) ** len(statics.coordinates)
    wrong = all(c.periodic for c in statics.coordinates) and bool(signs.all()) and signs.sum() != 0
    return Outcome.UNPROVED if wrong else Outcome.COMPLETE, wrong


def _outcome(reasons: set[str]) -> Outcome:
    """Of a list that leaves places for these reasons."""
    if reasons <= {_FOLD, _CURVE, _LONG}:
        return Outcome.AT_FOLD if reasons <= {_FOLD} else Outcome.DEGENERATE
    return Outcome.UNPROVED


def search_rows(
    statics: Statics, rows: Floats, limit: int | None = None, most_left: int = 64, *, beside: int = 1
) -> Found:
    """What :func:`fastmech.intervals.search.search` finds for each row (rows, parameters) of values.

    Beside a stiff spring ``beside`` times the ``limit`` of boxes are treated. More than ``most_left`` boxes
    that are left are kept as fewer and wider ones.

    Raises:
        InputError: as :func:`find_equilibria`, or rows have another number of parameters.
    """
    n, count = len(statics.coordinates), len(rows)
    if rows.shape != (count, len(statics.parameters)):
        raise InputError(f"parameters: {rows.shape[-1]} values, must be {len(statics.parameters)}")
    signs, positive = np.zeros((2, count, MOST), dtype=np.int8)
    left, reason = np.empty((count, most_left, n, 2)), np.zeros((count, most_left), dtype=np.int8)
    counts = np.zeros((count, 3), dtype=np.int64)
    found = Found(np.empty((count, MOST, n, 2)), signs, positive, left, reason, count=counts)
    limit = limit or LIMITS[n]
    boxes, w = np.empty((2 * beside * limit + 2, n, 2)), work(n, MOST)
    forces, domain, p = callee(_balance(statics)), domain_of(statics), np.repeat(rows[:, :, None], 2, 2)
    every_left, why = np.empty((1, 2 * len(boxes), n, 2)), np.zeros((1, 2 * len(boxes)), dtype=np.int8)
    for row in range(count):
        alone = Found(*(column[row : row + 1] for column in found))._replace(left=every_left, reason=why)
        search(forces, forces, domain, p[row : row + 1], boxes[: 2 * limit + 2], w=w, found=alone)
        if _stalled(alone):
            _search_beside_spring(statics, p[row : row + 1], boxes, w, alone)
        number = int(alone.count[0, 1])
        kept, reasons, _ = _fewer(every_left[0, :number], why[0, :number], domain, most_left)
        left[row, : len(kept)], reason[row, : len(kept)] = kept, reasons
    return found


def _stalled(found: Found) -> int:
    """How many boxes of a row ended as small ones, or were too many."""
    count = int(found.count[0, 1])
    return count - int((found.reason[0, :count] >= UNDEFINED).sum())


def _search_beside_spring(statics: Statics, p: Floats, boxes: Floats, w: Any, found: Found) -> None:
    """Search a row again along a stiff spring's force and across it, and what is left by the forces."""
    from fastmech.models.stiff import beside_stiffest  # SymPy, as below

    beside = beside_stiffest(statics, tuple(p[0, :, 0]))
    if beside is None:
        return
    forces, domain = callee(_balance(statics)), domain_of(statics)
    again = Found(*map(np.zeros_like, found._replace(left=found.left[:0])))
    again = again._replace(left=np.empty_like(found.left))
    search(callee(_balance(beside)), forces, domain, p, boxes, w=w, found=again)
    count = int(again.count[0, 1])
    open_ = np.flatnonzero(again.reason[0, :count] <= UNDEFINED)
    closed = np.setdiff1d(np.arange(count), open_)
    boxes[: len(open_)] = again.left[0, open_]
    for column in (again.left, again.reason):
        column[0, : len(closed)] = column[0, closed]
    w.known[1], again.count[0, 1] = len(open_), len(closed)
    if len(open_):
        search(forces, forces, domain, p, boxes, w=w, found=again)
    w.known[1] = 0
    if _stalled(again) < _stalled(found):
        again.count[0, 2] += found.count[0, 2]
        number = int(again.count[0, 1])
        parts = (
            one._replace(left=one.left[:, :number], reason=one.reason[:, :number]) for one in (found, again)
        )
        for old, new in zip(*parts, strict=True):
            old[...] = new


@lru_cache(maxsize=64)
def _balance(statics: Statics) -> Any:
    from fastmech.models.balance import balance_kernel  # SymPy: only where a mechanism is there

    return balance_kernel(statics)


def domain_of(statics: Statics) -> Floats:
    """Lowest and highest values and periods (n, 3); a turn is taken a little larger than it is."""
    rows = []
    for symbol, low, high, periodic in statics.coordinates:
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InputError(
                f"{symbol}: {low:g} .. {high:g} must be a finite range: what lies outside is not searched"
            )
        half = math.pi + 1e-14
        rows.append((SEAM - half, SEAM + half, TWO_PI) if periodic else (low, high, 0.0))
    return np.array(rows)


def _proof(statics: Statics, p: Floats, found: Found, items: list[RestingPlace]) -> Proof:
    """The certificate of one row."""
    domain = domain_of(statics)
    left = int(np.count_nonzero(found.reason[0]))
    places, peaks = _at_length_zero(
        statics, p, domain, _places(found.left[0, :left], found.reason[0, :left], domain)
    )
    expected = expected_sum(statics, p)
    signs = [item.orientation for item in items] + [(-1) ** len(domain)] * len(peaks)
    total = sum(signs) if all(signs) else None
    boxes = int(found.count[0, 2])
    listed = "1 equilibrium is" if len(items) == 1 else f"{len(items)} equilibria are"
    if places:
        outcome = _outcome({place.reason for place in places})
        reasons = dict.fromkeys(place.reason for place in places)
        told = [_where(statics, [x for x in places if x.reason == reason], domain) for reason in reasons]
        sentence = f"{listed} proved; not decided {'; '.join(told)}"
    elif total is not None and expected is not None and total != expected:
        outcome = Outcome.UNPROVED
        sentence = f"{listed} found, whose indices sum to {total} and not to {expected}: please report this"
    else:
        outcome = Outcome.COMPLETE
        sentence = f"{listed} proved to exist; there are no others ({counted(boxes, 'box')})"
        if peaks:
            sentence += f" but {_where(statics, list(peaks), domain)}"
        if expected is not None and total is not None:
            sentence += f"; their indices sum to {total}, as they must"
    return Proof(outcome, places, peaks, total, expected, boxes=boxes, sentence=sentence)


def _at_length_zero(
    statics: Statics, p: Floats, domain: Floats, places: tuple[Place, ...]
) -> tuple[tuple[Place, ...], tuple[Place, ...]]:
    """Places that stay undecided, and peaks; those in which nothing is at rest are in neither."""
    from fastmech.models.cones import AtZero, at_length_zero  # SymPy, as below

    undecided, peaks = list[Place](), list[Place]()
    for place in places:
        proved, reason = None, place.reason
        if reason in (_REASONS[UNDEFINED], _ALONG_LINE):
            box = np.stack([place.low, place.high], axis=1)
            proved = at_length_zero(statics, p, domain, box)
            if proved is None and _without_length(statics, p, place):
                reason += ": a spring has length zero"
        if proved is None:
            undecided.append(replace(place, reason=reason))
        elif proved is AtZero.PEAK:
            peaks.append(replace(place, reason=_PEAK))
    return tuple(undecided), tuple(peaks)


def _without_length(statics: Statics, p: Floats, place: Place) -> bool:
    """Whether a search within a place finds a spring of length zero."""
    from scipy.optimize import least_squares

    low, high = domain_of(statics)[:, :2].T
    tried = np.random.default_rng(0).uniform(low, high, (16, len(low)))
    middle, half = 0.5 * place.low + 0.5 * place.high, 0.51 * (place.high - place.low)  # its rim included
    within = (np.nextafter(middle - half, -np.inf), np.nextafter(middle + half, np.inf))
    for way in _springs(statics):
        long = max(float(np.linalg.norm(way(q, p[:, 0]))) for q in tried)
        ended = least_squares(way, middle, bounds=within, args=(p[:, 0],), method="dogbox")
        if np.linalg.norm(ended.fun) <= ZERO * long:
            return True
    return False


@lru_cache(maxsize=64)
def _springs(statics: Statics) -> list[Any]:
    """Functions of coordinates and parameters for the way from end to end of each spring."""
    import sympy

    symbols = [coordinate.symbol for coordinate in statics.coordinates]
    return [sympy.lambdify([symbols, statics.parameters], spring) for spring in statics.springs]


def _where(statics: Statics, places: list[Place], domain: Floats) -> str:
    """Places that are not decided for the same reason: the widest, how many more, and why."""
    size = domain[:, 1] - domain[:, 0]
    widest = max(places, key=lambda place: float(((place.high - place.low) / size).max()))

    def told(low: float, high: float) -> str:
        return f"= {low:.6g}" if high - low < 1e-5 * abs(low) else f"in [{low:.6g}, {high:.6g}]"

    ends = zip(statics.coordinates, widest.low, widest.high, strict=True)
    where = ", ".join(f"{c.symbol} {told(low, high)}" for c, low, high in ends)
    others = f" and {len(places) - 1} more" if len(places) > 1 else ""
    return f"at {where}{others}: {widest.reason}"


_PEAK = "a spring has length zero, a peak of the potential, where nothing stays at rest"
_FOLD = "equilibria merge here within rounding, or come as close"
_CURVE = "equilibria may not be isolated here: a curve of them, or nearly"
_REASONS = {
    UNDEFINED: "forces or stiffness may not be defined everywhere here",
    LIMIT: "the limit on the number of boxes was reached",
    AT_END: "an equilibrium lies on the end of a range within rounding",
    UNCLEAR: f"equilibria lie too close together, or are more than the {MOST} that are kept",
    BENT: "an equilibrium is here, and stiffness jumps here, as where a contact begins",
}


_LONG = f"{_REASONS[LIMIT]}, along a curve: of equilibria, or on which stiff forces are nearly in balance"
_ALONG_LINE = f"{_REASONS[UNDEFINED]}, along a line"


def _places(boxes: Floats, reasons: NDArray[np.int8], domain: Floats) -> tuple[Place, ...]:
    """Boxes nearer to each other than they are wide, modulo turns, as one place."""
    from scipy.sparse.csgraph import connected_components

    size, turns = domain[:, 1] - domain[:, 0], domain[:, 2]
    width = float((np.diff(boxes)[:, :, 0] / size).max()) if len(boxes) else 0.0
    boxes, reasons, counts = _fewer(boxes, reasons, domain, TOGETHER)
    near = np.ones((len(boxes), len(boxes)), dtype=bool)
    for k, period in enumerate(turns):
        middle, extent = boxes[:, k].mean(1), np.diff(boxes[:, k])[:, 0]
        away = middle[:, None] - middle
        away -= period * np.round(away / period) if period else 0.0
        near &= np.abs(away) <= 1.5 * (extent[:, None] + extent) + 1e-14 * size[k]
    number, group = connected_components(near, directed=False)
    first = boxes[np.unique(group, return_index=True)[1]][group]
    turned = np.round((boxes.mean(2) - first.mean(2)) / TWO_PI) * turns
    boxes = boxes - turned[:, :, None]
    hulls, gravest, _ = _merged(boxes, reasons, counts, group, number)
    spans = (np.diff(hulls)[:, :, 0] / size).max(axis=1, initial=0.0)
    # The hull of a curve may be the whole domain: it is told in pieces.
    part = np.floor((boxes.mean(2) - domain[:, 0]) / size * PIECES) * (spans[group] > 1.0 / PIECES)[:, None]
    pieces, piece = np.unique(np.column_stack([group, part]), axis=0, return_inverse=True)
    merged = _merged(boxes, reasons, counts, piece.reshape(-1), len(pieces))
    places = []
    ends = merged[0].transpose(0, 2, 1)
    for (low, high), of, count in zip(ends, pieces[:, 0].astype(int), merged[2], strict=True):
        span, code = spans[of], gravest[of]
        if code == UNDEFINED and span > SMALL_PLACE:
            reason = _ALONG_LINE
        elif code in _REASONS and code != LIMIT:
            reason = _REASONS[code]
        elif span < SMALL_PLACE:
            reason = _FOLD
        elif span > CURVE * width:
            reason = _LONG if code == LIMIT else _CURVE
        else:
            reason = _REASONS[LIMIT]
        places.append(Place(low, high, int(count), reason))
    return tuple(places)


def _fewer(
    boxes: Floats, reasons: NDArray[np.int8], domain: Floats, most: int
) -> tuple[Floats, NDArray[np.int8], NDArray[np.int64]]:
    """Boxes, merged in cells of the domain while there are more, their reasons and how many each was."""
    cells, counts = 1024.0, np.ones(len(boxes), dtype=np.int64)
    while len(boxes) > most:
        cell = np.floor((boxes.mean(2) - domain[:, 0]) / (domain[:, 1] - domain[:, 0]) * cells)
        _, group, number = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
        boxes, reasons, counts = _merged(boxes, reasons, counts, group.reshape(-1), len(number))
        cells /= 2.0
    return boxes, reasons, counts


def _merged(
    boxes: Floats, reasons: NDArray[np.int8], counts: NDArray[np.int64], group: Any, number: int
) -> tuple[Floats, NDArray[np.int8], NDArray[np.int64]]:
    """Hulls of groups of boxes, the gravest reason of each and how many boxes it has."""
    hulls = np.empty((number, *boxes.shape[1:]))
    hulls[:, :, 0], hulls[:, :, 1] = np.inf, -np.inf
    np.minimum.at(hulls[:, :, 0], group, boxes[:, :, 0])
    np.maximum.at(hulls[:, :, 1], group, boxes[:, :, 1])
    gravest = np.zeros(number, dtype=np.int8)
    np.maximum.at(gravest, group, reasons)
    return hulls, gravest, np.bincount(group, counts, number).astype(np.int64)


def expected_sum(statics: Statics, p: Floats) -> int | None:
    """The sum over all equilibria of the signs of the stiffness' determinants: the degree of the forces.

    Without ranges it is 0, the Euler characteristic of a torus. Of two coordinates it is how often the force
    turns round on the way along the ends of their ranges, if it is proved that it vanishes nowhere there. Of
    others it is known where on each end the force along the coordinate keeps one sign, which is proved by
    boxes: then forces can be deformed, without a zero on the boundary, into ones that depend on that
    coordinate alone, and are constant along a periodic angle if there is one. Else None.
    """
    domain = domain_of(statics)
    turning = [coordinate.periodic for coordinate in statics.coordinates]
    if len(turning) == 2 and not all(turning):
        return _turns_on_ends(statics, p, domain, turning)
    degree = 0 if any(turning) else 1
    for k in range(len(turning)):
        if not turning[k]:
            signs = [_sign_on_end(statics, p, domain, k, end) for end in (0, 1)]
            if 0 in signs:
                return None
            degree *= (signs[0] - signs[1]) // 2
    return degree


def _turns_on_ends(statics: Statics, p: Floats, domain: Floats, turning: list[bool]) -> int | None:
    """Turns of two forces on the way round their domain, None where they may vanish on it.

    The sides of a periodic angle are passed in both directions and leave nothing.
    """
    low, high = domain[:, 0], domain[:, 1]
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
    total = 0.0
    for loop in ([0, 1, 2, 3],) if not any(turning) else ([0], [2]) if turning[0] else ([1], [3]):
        quarters: list[int] = []
        for side in loop:
            found = _quarters(statics, p, corners[side], corners[(side + 1) % 4])
            if found is None:
                return None
            quarters += found
        steps = np.diff([*quarters, quarters[0]])
        total += float((np.remainder(steps + 1, 4) - 1).sum()) / 4.0
    return round(total)


def _quarters(statics: Statics, p: Floats, start: Floats, end: Floats) -> list[int] | None:
    """Directions in which the force points along a side: 0 to 3 for +x, +y, -x, -y, one a piece of it."""
    f, J, forces = np.empty((2, 2)), np.empty((2, 2, 2)), _balance(statics)
    found: list[int] = []
    todo = [(0.0, 1.0)]
    for _ in range(FACES):
        if not todo:
            return found
        first, last = todo.pop()
        ends = np.stack([(1.0 - share) * start + share * end for share in (first, last)])
        forces(np.stack([ends.min(0), ends.max(0)], axis=1), p, f, J)
        ways = [k + 2 * (f[k, 1] < 0.0) for k in (0, 1) if not f[k, 0] <= 0.0 <= f[k, 1]]
        if not ways:
            middle = 0.5 * (first + last)
            todo += [(middle, last), (first, middle)]
        else:
            found.append(next((way for way in ways if found and way == found[-1]), ways[0]))
    return None


def _sign_on_end(statics: Statics, p: Floats, domain: Floats, k: int, end: int) -> int:
    """Sign of the force along coordinate ``k`` on one end of its range; 0 if it is not proved to have one."""
    face = domain[:, :2].copy()
    face[k] = domain[k, end]
    n, todo, signs = len(face), [face], set[int]()
    f, J, forces = np.empty((n, 2)), np.empty((n, n, 2)), _balance(statics)
    for _ in range(FACES):
        if not todo:
            return signs.pop()
        box = todo.pop()
        forces(box, p, f, J)
        if not f[k, 0] <= 0.0 <= f[k, 1]:
            signs.add(1 if f[k, 0] > 0.0 else -1)
        elif n > 1:
            j = int(np.argmax(np.diff(box)[:, 0] / (domain[:, 1] - domain[:, 0])))
            todo += [box.copy(), box.copy()]
            todo[-1][j, 0] = todo[-2][j, 1] = box[j].mean()
        elif not signs:
            return 0
        if len(signs) > 1:
            return 0
    return 0
