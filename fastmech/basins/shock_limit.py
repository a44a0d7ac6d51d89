"""``fm.shock_limit``: how hard a point of the resting mechanism may be struck before it leaves its well.

A blow is an impulse on M1, M2 or the slider M3. It leaves the position as it is and gives kinetic energy.
Under a constant force energy never grows: a blow that gives less than the well's depth does not leave, which
is proved. How much it takes indeed, damping included, is searched for with certified labels: blows from the
bound upwards on a grid of impulses and directions, whose least one that leaves is followed down to the edge
of its window, and again on finer and finer grids, for windows in which motions leave can be narrow.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count
from typing import Literal, TypeAlias

import numpy as np

from fastmech.arrays import Floats, Integers
from fastmech.basins.convergence import SUBSTEPS
from fastmech.basins.label import STEPS, How, label_states, number_wells, well_of_number
from fastmech.basins.measures.labels import GONE
from fastmech.capture.certificate import CaptureCertificate
from fastmech.capture.select import certificate_of
from fastmech.disturbance.motion import equilibria_to_disturb, require_constant_force
from fastmech.ensembles import checks
from fastmech.ensembles.run import Progress
from fastmech.errors import InputError, necessary, shown
from fastmech.jit import working
from fastmech.models.equilibria import RestingPlace
from fastmech.models.mechanism import Mechanism
from fastmech.models.stability import require_own, state_matrix
from fastmech.objects import Printed, counted
from fastmech.scene import Scene
from fastmech.slider.atlas.map import ROUNDING
from fastmech.slider.coefficients import reduce
from fastmech.slider.equilibria import Equilibrium
from fastmech.slider.impulse import POINTS, Mobility, impulse_for, mobility, rates_after
from fastmech.slider.linearize import require_rest

#: The first grid: directions all around, and by how much an impulse is larger than the one before, where
#: directions are searched and where there is one alone. Each further grid is twice as fine, or four times.
DIRECTIONS, APART, ALONE = 64, 0.04, 0.004

#: Grids at least; the search ends with one that finds nothing less.
GRIDS = 4

#: Where a grid's impulses begin above the bound, in parts of their distance: golden section.
SHIFT = 0.6180339887498949

#: Blows of the finest grid, and integration steps of them all: where motions creep, grids stay coarser. The
#: search ends where it has taken so many steps.
MOST_BLOWS, MOST_STEPS = 1 << 18, 200_000_000

#: Blows that are followed together, in the order of their impulses.
TOGETHER = 1 << 12

#: Blows of a grid that are followed together with all substeps where the first ones do not tell their end,
#: from the least upwards, until that has taken so many steps.
UNCERTAIN, FURTHER = 32, 50_000_000

#: Blows are tried up to so many times the sum of the potential's amplitudes: beyond, motions turn and turn.
ENERGY = 30.0

#: A blow is followed for so many times the slowest decay about wells and saddles: until it is captured, slow
#: modes may have to lose most of their energy. And for ``STEPS`` of the coarsest steps at most.
LONG = 5.0

#: Share of the greatest mobility below which the least one is rounding.
NO_MOBILITY = 1e-12

#: Relative, of the impulse found, where directions are searched and where there is one alone.
TOLERANCE, ALONE_TOLERANCE = 1e-4, 1e-5

#: Directions to either side and impulses at which a window's edge is looked for at once, and along one alone.
SIDES, SIZES, LINE = 4, 8, 32

#: Part of the impulse over which that is at most, where all that are looked at leave.
WIDEST = 0.25


@dataclass(frozen=True, repr=False)
class Blow(Printed):
    """An impulse on a point of the resting mechanism; NaN where there is none."""

    impulse: float  #: N s
    direction: float  #: of the impulse, anticlockwise from +x [rad]
    velocity: float  #: jump of that point's velocity [m/s]; along the impulse or not
    energy: float  #: kinetic energy that it gives [J]

    def told(self, impulse: str = "") -> str:
        """Impulse, as it is written here or with five digits, direction, jump of velocity and energy."""
        size = impulse or f"{self.impulse:.5g}"
        across = " (at an angle to the blow)" * (self.energy < 0.4999 * self.impulse * self.velocity)
        return (
            f"{size} N s at {self.direction:.3g} rad ({math.degrees(self.direction):.1f}°) from +x, "
            f"giving it {self.velocity:.4g} m/s{across}, the mechanism {self.energy:.4g} J"
        )


#: Where a blow leads: to which equilibrium, with how many turns of coordinates; None where there is none.
End: TypeAlias = tuple[int, tuple[int, ...]] | Literal["out of range"] | None


@dataclass(frozen=True, repr=False)
class ShockLimit(Printed):
    """How hard a point may be struck; see :func:`shock_limit`."""

    on: str
    proved: Blow  #: no smaller one leaves, in whatever direction, or in the one given
    found: Blow  #: the least that was found to leave; NaN: none was found
    end: End  #: where that ends
    undecided_from: float = math.nan  #: least impulse tried whose end is not known [N s]; NaN: none
    tried_to: float = math.nan  #: largest impulse of the search [N s], beyond it nothing is known; NaN: none
    trajectories: int = 0  #: blows that were followed
    #: Relative, of impulses on the finest grid on which nothing less was found; NaN: none.
    impulses_apart: float = math.nan
    directions_apart: float = math.nan  #: the same of directions [rad], 0 along one alone
    limited: bool = False  #: whether the search ended because it had taken as many steps as it may
    bounded: bool = False  #: whether the well's barrier may be higher than is proved, and so harder ones stay

    def told(self) -> str:
        """What is proved, what was found, and how hard was searched."""
        proved, found = "none", "none was found"
        if not math.isnan(self.proved.impulse):
            proved = self.proved.told(_digits(self.proved.impulse, math.floor))
            proved += "; the well's barrier is at least so high: harder ones may stay" * self.bounded
        if not math.isnan(self.found.impulse):  # rounded down it may not leave
            found = self.found.told(_digits(self.found.impulse, math.ceil))
            found += f"; {self.end}" if isinstance(self.end, str) else ""
        known, least = "", self.undecided_from
        if self.found.impulse < least:
            known = f"; not all ends are known from {least:.4g} N s on"
        elif not math.isnan(least):
            known = (
                f"; quote {least:.4g} N s: lighter ones all came back; some harder ones are open "
                "(follow single ones by fm.label_starts with a smaller dt=)"
            )
        limit = "; the search ended at its limit of work" * self.limited
        return (
            f"blows on {self.on}: no smaller one leaves (proved): {proved}\n"
            f"  least found to leave (also by a full turn): {found}\n"
            f"  {counted(self.trajectories, 'blow')} followed, up to {self.tried_to:.4g} N s{known}{limit}"
        )


def _digits(impulse: float, whole: Callable[[float], int]) -> str:
    """Five digits of an impulse, rounded up or down."""
    unit = 10.0 ** (math.floor(math.log10(impulse)) - 4)
    return f"{whole(impulse / unit) * unit:.5g}"


@necessary(equilibrium="one of fm.find_equilibria(...), such as E[0]")
def shock_limit(
    scene: Scene | Mechanism,
    equilibrium: Equilibrium | RestingPlace,
    on: str | None = None,
    direction: float | None = None,
    *,
    t_end: float | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> ShockLimit:
    """The least impulse on a point of the resting mechanism that makes it leave its well.

    An impulse J gives the energy J.W J / 2 with the point's mobility W = B a^-1 B^T (B: the point's Jacobian,
    a: the metric, paper (11)). While that is less than the well's depth, the mechanism does not leave. So the
    bound ``sqrt(2 depth / w)`` is proved for every damper, with w = u.W u in the direction u, or W's largest
    eigenvalue over all directions. Above it, directions and sizes are searched for blows that leave, as
    :func:`fastmech.label_starts` proves: that end in another well, or in the same one some full turns away,
    or leave the range of a coordinate. Grids are made finer until nothing less is found; a window between the
    blows of the finest one, as the result tells how far they are apart, may have been missed. The search ends
    after 200,000,000 integration steps, and the result tells if that was so. A
    terminal is told how many blows have been followed.

    All is NaN where the point cannot be struck so: M3 across its rail or at a dead centre, M1 along OM1, M2
    along M1M2 where crank and rod are in line. ``found`` is NaN too without damper, for nothing comes to rest
    then, and where no blow up to ``tried_to`` was found to leave. That one gives, where the mechanism yields
    most, 30 times the sum of the potential's amplitudes; heavier blows may leave.

    Args:
        scene: the mechanism with a constant force, or none.
        equilibrium: one of its minima.
        on: the point that is struck, ``"M1"``, ``"M2"`` (by default) or ``"M3"``; of a ``Mechanism`` one of
            its points in a plane, by default the only one that moves.
        direction: of the impulse, anticlockwise from +x [rad], and no other; all directions by default.
        t_end: end of every run [s]; what is not captured by then is not taken to have left. By default it
            follows from the slowest decay about wells and saddles.
        threads: threads to use; the result does not depend on it.
        progress: called with the number of blows that are done since the last call.

    Raises:
        InputError: the force decays, the equilibrium is no minimum of this scene, an argument is wrong, or
            the scene's wells are not certain.
    """
    checks.progress_function(progress, "blows")
    on = _struck(scene, on)
    place, moves, depth = _well(scene, equilibrium, on)
    angle = None if direction is None else _direction(direction)
    certificate = certificate_of(scene)
    if t_end is None:
        t_end = _long_enough(certificate, place)
    easiest = math.remainder(moves.direction, 2.0 * math.pi) if angle is None else angle

    proved = _blow(moves, float(impulse_for(depth, moves.along(easiest))), easiest)
    nothing = Blow(math.nan, math.nan if angle is None else angle, math.nan, math.nan)
    bounded = certificate.tree.bounded(certificate.tree.equilibria.index_of(equilibrium))
    alone = ShockLimit(on, proved, nothing, None, bounded=bounded)
    if math.isnan(proved.impulse):
        return replace(alone, proved=nothing)
    if not scene.damped:
        return alone
    amplitudes = certificate.amplitudes * certificate.joule
    # Where rounding leaves nothing of the depth, the search begins where rounding ends.
    low, high = max(depth, ROUNDING * amplitudes), ENERGY * amplitudes
    everywhere = angle is None and bool(moves.least > 0.0)
    rates = _rates_after(scene, place[: place.size // 2], on)
    search = _Search(scene, place, rates, t_end, threads, everywhere=everywhere, progress=progress)
    if search.own < 0:
        return replace(alone, undecided_from=proved.impulse, trajectories=1)
    lines = [easiest] if angle is not None else [easiest, math.remainder(easiest + math.pi, 2.0 * math.pi)]
    most = float(impulse_for(high, moves.along(easiest)))
    with working(f"blows on {on}") as search.say:
        search.run(
            lambda angles: np.nan_to_num(impulse_for(low, moves.along(angles)), nan=np.inf),
            most,
            np.array(lines),
        )
    found = nothing
    end: End = None
    if np.isfinite(search.size):
        found = _blow(moves, search.size, search.angle if angle is None else angle)
        number = search.label
        end = "out of range" if number == GONE else well_of_number(number, len(certificate.names))
    return replace(
        alone,
        found=found,
        end=end,
        undecided_from=search.unknown if np.isfinite(search.unknown) else math.nan,
        tried_to=most,
        trajectories=search.blows,
        impulses_apart=search.apart[0],
        directions_apart=search.apart[1],
        limited=search.spent,
    )


def _direction(given: float) -> float:
    """A direction of an impulse [rad], within a turn: more of them are most often degrees."""
    angle = checks.number("direction", given, "rad")
    if abs(angle) > 2.0 * math.pi:
        raise InputError(
            f"direction = {shown(given)}: must lie within -2 pi and 2 pi rad; {angle:g} degrees?"
        )
    return angle


@dataclass
class _Search:
    """The least blow found to leave, and what was done to find it."""

    scene: Scene | Mechanism
    place: Floats  #: state of rest (states,)
    rates: Floats  #: rates after 1 N s along x and along y, (2, coordinates)
    t_end: float
    threads: int | None
    everywhere: bool  #: whether directions are searched
    progress: Progress | None = None
    say: Callable[[str], None] = lambda words: None  #: on a terminal
    size: float = math.inf  #: N s
    angle: float = math.nan
    label: int = -1
    unknown: float = math.inf  #: least impulse whose end is not known [N s]
    apart: tuple[float, float] = (math.nan, math.nan)
    blows: int = 0
    steps: int = 0

    def __post_init__(self) -> None:
        self.own = int(self.ends(np.zeros(1), np.zeros(1), SUBSTEPS)[0])

    @property
    def spent(self) -> bool:
        """Whether the search has taken as many steps as it may."""
        return self.steps > MOST_STEPS

    def ends(self, angles: Floats, sizes: Floats, sequence: tuple[int, ...]) -> Integers:
        """Labels (n,) after blows; the least one that leaves is kept."""
        starts = np.tile(self.place, (sizes.size, 1))
        blows = sizes * np.stack([np.cos(angles), np.sin(angles)])
        starts[:, self.place.size // 2 :] = blows.T @ self.rates
        found = label_states(self.scene, starts, self.t_end, How(threads=self.threads, sequence=sequence))
        labels = number_wells(found)
        self.blows, self.steps = self.blows + sizes.size, self.steps + found.steps
        self.say(f"{self.blows:,} blows followed")
        if self.progress is not None:
            self.progress(sizes.size)
        if self.blows > 1:
            out = np.where((labels >= 0) & (labels != self.own), sizes, np.inf)
            least = int(out.argmin())
            if out[least] < self.size:
                self.size, self.label = float(out[least]), int(labels[least])
                self.angle = math.remainder(float(angles[least]), 2.0 * math.pi)
        return labels

    def run(self, bound: Callable[[Floats], Floats], most: float, lines: Floats) -> None:
        """Search grid after grid; ``bound`` gives what is proved along directions [N s]."""
        for level in count():
            finer = 2.0**level if self.everywhere else 4.0**level
            apart, between = (APART if self.everywhere else ALONE) / finer, 0.0
            angles = lines
            if self.everywhere:
                between = 2.0 * math.pi / (DIRECTIONS * finer)
                angles = lines[0] + between * np.arange(round(DIRECTIONS * finer))
            before = self.size
            if not self.look(angles, bound(angles), min(most, before), apart, level):
                return
            self.apart = apart, between
            if self.size < before:
                self.follow_down(apart, between)
            elif self.spent or level + 1 >= GRIDS or not np.isfinite(self.size):
                return

    def look(self, angles: Floats, least: Floats, most: float, apart: float, level: int) -> bool:
        """Try blows of a grid in the order of their impulses until one leaves; none if they are too many."""
        with np.errstate(divide="ignore", invalid="ignore"):
            each = np.maximum(np.ceil(np.log(most / least) / math.log1p(apart)), 0.0)
        number = float(each.sum())
        if level and (number > MOST_BLOWS or self.steps * (1.0 + number / self.blows) > MOST_STEPS):
            return False
        times = each.astype(np.int64)
        which = np.repeat(np.arange(angles.size), times)
        rung = np.arange(which.size) - np.repeat(np.cumsum(times) - times, times)
        sizes = least[which] * (1.0 + apart) ** (rung + math.modf(SHIFT * level)[0])
        order = np.argsort(sizes, kind="stable")
        uncertain = []
        for first in range(0, order.size, TOGETHER):
            some = order[first : first + TOGETHER]
            if sizes[some[0]] >= self.size:
                break
            if self.spent:
                uncertain.append(order[first:])
                break
            labels = self.ends(angles[which[some]], sizes[some], SUBSTEPS[:2])
            uncertain.append(some[labels < 0])
        left = np.concatenate([*uncertain, order[:0]])
        left, first = left[sizes[left] < self.size], True
        self.unknown = math.inf
        until = self.steps + FURTHER
        while left.size and (first or self.steps < until) and not self.spent:
            some, left, first = left[:UNCERTAIN], left[UNCERTAIN:], False
            labels = self.ends(angles[which[some]], sizes[some], SUBSTEPS)
            self.unknown = min(self.unknown, float(sizes[some[labels < 0]].min(initial=np.inf)))
            left = left[sizes[left] < self.size]
        self.unknown = min(self.unknown, float(sizes[left].min(initial=np.inf)))
        return True

    def follow_down(self, apart: float, between: float) -> None:
        """From a blow that leaves to the least one at the edge of its window."""
        while between and apart > TOLERANCE and not self.spent:
            sides = between * np.arange(-SIDES, SIDES + 1) / SIDES
            shares = 1.0 - apart * np.arange(1, SIZES + 1) / SIZES
            size, angle = self.size, self.angle
            grid = np.meshgrid(self.angle + sides, self.size * shares)
            self.ends(grid[0].ravel(), grid[1].ravel(), SUBSTEPS)
            if self.size > (1.0 - 0.9 * apart) * size:
                apart /= 3.0
            elif apart < WIDEST:  # it goes on down
                apart *= 2.0
            if abs(math.remainder(self.angle - angle, 2.0 * math.pi)) < 0.9 * between:
                between /= 2.0
        apart = max(apart, 10.0 * TOLERANCE)
        while apart > (TOLERANCE if self.everywhere else ALONE_TOLERANCE) and not self.spent:
            sizes, size = self.size * (1.0 - apart * np.arange(1, LINE + 1) / LINE), self.size
            self.ends(np.full(LINE, self.angle), sizes, SUBSTEPS)
            if self.size > (1.0 - 0.9 * apart) * size:
                apart *= 2.0 / LINE
            elif apart < WIDEST:
                apart *= 2.0


def _blow(moves: Mobility, impulse: float, direction: float) -> Blow:
    along, speed = moves.along(direction), moves.speed(direction)
    return Blow(impulse, direction, float(speed * impulse), float(0.5 * along * impulse**2))


def proved_limit(scene: Scene | Mechanism, equilibrium: Equilibrium | RestingPlace, on: str) -> Blow:
    """What is proved of :func:`shock_limit`, with arguments and errors as there, in whatever direction."""
    _, moves, depth = _well(scene, equilibrium, on)
    easiest = math.remainder(moves.direction, 2.0 * math.pi)
    return _blow(moves, float(impulse_for(depth, moves.along(easiest))), easiest)


def _well(
    scene: Scene | Mechanism, equilibrium: Equilibrium | RestingPlace, on: str
) -> tuple[Floats, Mobility, float]:
    """State of rest (states,), mobility of the point there, and the well's depth less rounding [J]."""
    if isinstance(scene, Mechanism):
        equilibria_to_disturb(scene)
    else:
        require_rest(scene, equilibrium)
        require_constant_force(scene)
    certificate = certificate_of(scene)
    equilibria, wells = certificate.tree.equilibria, certificate.tree.wells
    index = equilibria.index_of(equilibrium)
    if index not in wells:
        raise InputError(f"equilibrium: is a {equilibria[index].kind}, must be a minimum")
    place = certificate.places[index]
    room = (certificate.levels[wells.index(index)] - certificate.energies[index]) * certificate.joule
    return place, _mobility(scene, place[: place.size // 2], on), max(float(room), 0.0)


def _mobility(scene: Scene | Mechanism, q: Floats, on: str) -> Mobility:
    """Of a point at a position (coordinates,)."""
    if isinstance(scene, Scene):
        c = reduce(scene)
        return mobility(scene.m2, c.mass, c.slider, q[0], q[1], on=on)
    B = scene.moved(on, q)
    if len(B) != 2:
        raise InputError(f"on = {shown(on)}: must be a point in a plane")
    values, vectors = np.linalg.eigh(B @ np.linalg.solve(scene.metric(q), B.T))
    least = values[0] if values[0] > NO_MOBILITY * values[1] else 0.0
    return Mobility(values[1], np.asarray(least), np.arctan2(vectors[1, 1], vectors[0, 1]))


def _rates_after(scene: Scene | Mechanism, q: Floats, on: str) -> Floats:
    """Rates after 1 N s along x and along y on a point of the resting mechanism, (2, coordinates)."""
    if isinstance(scene, Scene):
        return rates_after(scene, q, on, np.eye(2))
    return np.asarray(np.linalg.solve(scene.metric(q), scene.moved(on, q).T).T)


def _struck(scene: Scene | Mechanism, on: str | None) -> str:
    """The point that is struck: by default M2, or the only one of a mechanism that moves."""
    if isinstance(scene, Mechanism):
        moving = scene.moving_points
        if not moving:
            raise InputError(
                "on: no point of the mechanism moves; name one to strike, as points={'P': (x, y)}"
            )
        if on is None and len(moving) != 1:
            raise InputError(f"on: missing; must be a point that moves: {', '.join(moving)}")
        return moving[0] if on is None else on
    if on is not None and on not in POINTS:
        raise InputError(f"on = {shown(on)}: must be one of {', '.join(POINTS)}")
    return on or "M2"


def _long_enough(certificate: CaptureCertificate, place: Floats) -> float:
    """For how long a blow is followed [s]."""
    equilibria = certificate.tree.equilibria
    states = [state_matrix(certificate.system, e) for e in equilibria if e.morse_index < 2]
    slowest = float(np.abs(np.linalg.eigvals(states).real).min())
    longest = STEPS * float(certificate.coarse_steps(place[None])[0])
    return LONG / max(slowest, LONG / longest)


def impulse_start(
    scene: Scene | Mechanism,
    rest: Equilibrium | RestingPlace,
    impulse: float,
    on: str | None = None,
    direction: float = 0.0,
) -> Floats:
    """State (states,) after a blow at rest; on M2 along +x that of a force, the faster it decays.

    The generalized momenta are B^T J, the rates a^-1 of them, paper (11).

    Args:
        scene: the mechanism.
        rest: where it rests.
        impulse: N s.
        on, direction: the point that is struck, and where the impulse points, as for :func:`shock_limit`.

    Raises:
        InputError: an argument is wrong, or the scene does not rest there.
    """
    if isinstance(scene, Mechanism):
        require_own(scene, rest)
    else:
        require_rest(scene, rest)
    on = _struck(scene, on)
    impulse, direction = checks.number("impulse", impulse, "N s"), _direction(direction)
    along = np.array([np.cos(direction), np.sin(direction)])
    return np.concatenate([rest.position, impulse * along @ _rates_after(scene, rest.position, on)])
