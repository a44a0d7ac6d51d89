"""``fm.shock_limit``: how hard a point of the resting mechanism may be struck before it leaves its well.

A blow is an impulse on M1, M2 or the slider M3. It leaves the position as it is and gives kinetic energy.
Under a constant force energy never grows: a blow that gives less than the well's depth does not leave, which
is proved. How much it takes indeed, damping included, is searched for with certified labels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fastmech.atlas.wells import ROUNDING
from fastmech.basins.copies import copy_labels, copy_of_label
from fastmech.basins.measures.labels import Floats
from fastmech.basins.shock import Rays
from fastmech.basins.steps import coarse_steps
from fastmech.capture.certificate import certificate_of
from fastmech.disturbance.motion import require_constant_force
from fastmech.ensembles import checks
from fastmech.equilibria.find import Equilibria, Equilibrium
from fastmech.errors import InputError, shown
from fastmech.mechanism.coefficients import reduce
from fastmech.mechanism.impulse import POINTS, Mobility, impulse_for, mobility, rates_after
from fastmech.mechanism.lagrange import unit
from fastmech.scene import Scene
from fastmech.stability.arguments import require_rest
from fastmech.stability.linearize import jacobian

#: Directions that are tried at first, of M2, and by how much one impulse is larger than the one before, where
#: directions are searched and where there is one alone.
DIRECTIONS, APART, ALONE = 32, 1.04, 1.004

#: Blows are tried up to so many times the sum of the potential's amplitudes: beyond, motions turn and turn.
ENERGY = 30.0

#: A blow is followed for so many times the slowest decay about wells and saddles: until it is captured, slow
#: modes may have to lose most of their energy. And for so many of the coarsest steps at most.
LONG, STEPS = 5.0, 20_000.0

#: Relative, of the impulse found, where directions are searched and where there is one alone.
TOLERANCE, ALONE_TOLERANCE = 1e-4, 1e-5


@dataclass(frozen=True)
class Blow:
    """An impulse on a point of the resting mechanism; NaN where there is none."""

    impulse: float  #: N s
    direction: float  #: of the impulse from +x [rad]
    velocity: float  #: jump of that point's velocity [m/s]; along the impulse or not
    energy: float  #: kinetic energy that it gives [J]


@dataclass(frozen=True)
class ShockLimit:
    """How hard a point may be struck; see :func:`shock_limit`."""

    on: str
    proved: Blow  #: no smaller one leaves, in whatever direction, or in the one given
    found: Blow  #: the least that was found to leave; NaN: none was found
    end: (
        tuple[int, tuple[int, int]] | None
    )  #: equilibrium and turns of phi and theta where the found one ends
    undecided_from: float  #: least impulse tried whose end is not known [N s]; NaN: none
    trajectories: int  #: blows that were followed


def shock_limit(
    scene: Scene,
    equilibrium: Equilibrium,
    on: str = "M2",
    direction: float | None = None,
    *,
    t_end: float | None = None,
    threads: int | None = None,
) -> ShockLimit:
    """The least impulse on a point of the resting mechanism that makes it leave its well.

    An impulse J gives the energy J.W J / 2 with the point's mobility W = B a^-1 B^T (B: the point's Jacobian,
    a: the metric, paper (11)). While that is less than the well's depth, the mechanism does not leave. So the
    bound ``sqrt(2 depth / w)`` is proved for every damper, with w = u.W u in the direction u, or W's largest
    eigenvalue over all directions. Above it, directions and sizes are searched for blows that end elsewhere,
    in another well or some turns further, as :func:`fastmech.basins.label.labels_of` proves. A smaller one
    may have been missed.

    All is NaN where the point cannot be struck so: M3 across its rail or at a dead centre, M1 along OM1, M2
    along M1M2 where crank and rod are in line. ``found`` is NaN too without damper: nothing comes to rest.

    Args:
        scene: the mechanism with a constant force, or none.
        equilibrium: one of its minima.
        on: the point that is struck, ``"M1"``, ``"M2"`` or ``"M3"``.
        direction: of the impulse, from +x [rad]; all directions by default.
        t_end: end of every run [s]; what is not captured by then is not taken to have left. By default it
            follows from the slowest decay about wells and saddles.
        threads: threads to use; the result does not depend on it.

    Raises:
        InputError: the force decays, the equilibrium is no minimum of this scene, an argument is wrong, or
            the scene's wells are not certain.
    """
    place, moves, depth = _well(scene, equilibrium, on)
    angle = None if direction is None else checks.number("direction", direction, "rad")
    certificate = certificate_of(scene)
    if t_end is None:
        t_end = _long_enough(scene, certificate.tree.equilibria, place)
    easiest = math.remainder(moves.direction, 2.0 * math.pi) if angle is None else angle

    def blow(impulse: float, direction: float) -> Blow:
        along, speed = moves.along(direction), moves.speed(direction)
        return Blow(impulse, direction, float(speed * impulse), float(0.5 * along * impulse**2))

    proved = blow(float(impulse_for(depth, moves.along(easiest))), easiest)
    nothing = Blow(math.nan, math.nan if angle is None else angle, math.nan, math.nan)
    if math.isnan(proved.impulse):
        return ShockLimit(on, nothing, nothing, None, math.nan, 0)
    if scene.beta == 0.0:
        return ShockLimit(on, proved, nothing, None, math.nan, 0)

    amplitudes = certificate.amplitudes * unit(scene)
    # Where rounding leaves nothing of the depth, the search begins where rounding ends.
    low, high = max(depth, ROUNDING * amplitudes), ENERGY * amplitudes
    everywhere = angle is None and moves.least > 0.0
    turned = np.array([0.0, 0.5 * math.pi]) if everywhere else np.array([easiest])
    axes = np.stack([np.cos(turned), np.sin(turned)], axis=1)

    def directions(units: Floats) -> Floats:
        return np.asarray(np.arctan2(*(units @ axes)[:, ::-1].T))

    def least(units: Floats) -> Floats:
        return np.nan_to_num(impulse_for(low, moves.along(directions(units))), nan=np.inf)

    to_state = np.zeros((len(axes), 4))
    to_state[:, 2:] = rates_after(scene, place[:2], on, axes)
    label_of = copy_labels(scene, t_end, threads=threads)
    tolerance = TOLERANCE if everywhere else ALONE_TOLERANCE
    rays = Rays(label_of, place, int(label_of(place[None])[0]), to_state, tolerance, least)
    if rays.label < 0:
        return ShockLimit(on, proved, nothing, None, proved.impulse, 1)
    most = float(impulse_for(high, moves.along(easiest)))
    levels = math.ceil(0.5 * math.log(high / low) / math.log(APART if everywhere else ALONE))
    if everywhere:
        round_about = 2.0 * math.pi * np.arange(DIRECTIONS) / DIRECTIONS
        units = np.stack([np.cos(round_about), np.sin(round_about)], axis=1)
        units, sizes, labels = rays.turned(units, most, levels, np.random.default_rng(0))
    else:
        units = np.array([[1.0], [-1.0]] if angle is None else [[1.0]])
        first, ends = rays.first_exits(units[None], np.array([most]), levels, 1)
        sizes, labels = first[0], ends[0]
    shock, best = rays.result(units, sizes, labels), int(np.argmin(sizes))
    found, end = nothing, None
    if shock.label >= 0:
        found = blow(shock.size, float(directions(units[[best]])[0]) if angle is None else angle)
        end = copy_of_label(shock.label)
    return ShockLimit(on, proved, found, end, shock.undecided_from, shock.trajectories)


def proved_limits(scene: Scene, equilibrium: Equilibrium) -> dict[str, float]:
    """Of every point the impulse [N s] below which no blow leaves, in whatever direction: the bounds alone.

    Arguments and errors as :func:`shock_limit`.
    """
    wells = {on: _well(scene, equilibrium, on) for on in POINTS}
    return {on: float(impulse_for(depth, moves.greatest)) for on, (_, moves, depth) in wells.items()}


def _well(scene: Scene, equilibrium: Equilibrium, on: str) -> tuple[Floats, Mobility, float]:
    """State of rest (4,), mobility of the point there, and the well's depth less rounding [J]."""
    require_rest(scene, equilibrium)
    require_constant_force(scene)
    _require_point(on)
    certificate = certificate_of(scene)
    equilibria, wells = certificate.tree.equilibria, certificate.tree.wells
    index = equilibria.index_of(equilibrium)
    e = equilibria[index]
    if index not in wells:
        raise InputError(f"equilibrium: is a {e.kind}, must be a minimum")
    c = reduce(scene)
    room = certificate.levels[wells.index(index)] - float(certificate.reduced(np.array(e.energy)))
    place = np.array([e.phi, e.theta, 0.0, 0.0])
    return place, mobility(scene.m2, c.mass, c.slider, e.phi, e.theta, on), max(room, 0.0) * unit(scene)


def _require_point(on: str) -> None:
    if on not in POINTS:
        raise InputError(f"on = {shown(on)}: must be one of {', '.join(POINTS)}")


def _long_enough(scene: Scene, equilibria: Equilibria, place: Floats) -> float:
    """For how long a blow is followed [s]."""
    states = [jacobian(scene, e) for e in equilibria if e.morse_index < 2]
    slowest = float(np.abs(np.linalg.eigvals(states).real).min())
    longest = STEPS * float(coarse_steps(reduce(scene), place[None])[0])
    return LONG / max(slowest, LONG / longest)


def impulse_start(
    scene: Scene, rest: Equilibrium, impulse: float, on: str = "M2", direction: float = 0.0
) -> Floats:
    """State (4,) after a blow at rest; on M2 along +x the limit of F0 exp(-alpha t) at impulse = F0/alpha.

    The generalized momenta are B^T J, the rates a^-1 of them, paper (11).

    Args:
        scene: the mechanism.
        rest: where it rests.
        impulse: N s.
        on: the point that is struck, ``"M1"``, ``"M2"`` or ``"M3"``.
        direction: of the impulse, from +x [rad].

    Raises:
        InputError: an argument is wrong, or the scene does not rest there.
    """
    require_rest(scene, rest)
    _require_point(on)
    impulse = checks.number("impulse", impulse, "N s")
    direction = checks.number("direction", direction, "rad")
    place = (rest.phi, rest.theta)
    along = np.array([np.cos(direction), np.sin(direction)])
    return np.array([*place, *rates_after(scene, place, on, impulse * along)])
