"""Where motions have arrived: balls about orbits in which the map contracts, and cells that chaos fills.

A ball is V(e) = e' P e < r^2 about a place of an orbit, e the distance from it, with P = J' P J + Q, J the
Jacobian of the map over the orbit's period (Stein's equation: V falls by e' Q e in the linear map). How large
the ball may be is measured: V must fall for points on shells in many directions, also in those alone that
decay most slowly, until these have halved, and on all smaller shells.
About a cycle e is the part that is no shift along it, w e = 0 with J' w = w.

About an orbit whose linear map hardly attracts V is the sum of squares of its eigenvectors' shares, and the
largest V in many periods must have fallen many periods later, as a power of time does.

Cells are those of a grid that motions have visited which keep visiting the same ones (Datseris and
Wagemakers, Chaos 32 (2022) 023104); a motion has arrived that has been in them so many times together.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.linalg import eig, solve_discrete_lyapunov

from fastmech.arrays import Flags, Floats, Integers
from fastmech.attractors.flow import FINER, Flow
from fastmech.attractors.orbits import ATTRACTS, Orbit, attracts
from fastmech.attractors.proof import RestProof, lyapunov_form, prove_rest
from fastmech.capture.levels import levels
from fastmech.ensembles.system import System

#: Shells of half the radius each, pairs of opposite directions in each dimension on the outermost so many on
#: which V falls, and places of a cycle that are tried; on the other shells few pairs are.
SHELLS, PAIRS, SURE, TRIED = 15, 6, 3, 16

#: Squares of a form's axes that are rounding beside the largest.
ROUNDING = 1e-14

#: Few pairs; about an orbit with a multiplier above SLOW they are all; places there, how many looks at V in
#: the beginning and at the end of so many periods, and those in one about a place of rest.
SLOW, FEW, PLACES, LOOKS, WAITED, DENSE = 0.999, 4, 8, 32, 128, 8

#: By how much V must fall there, on so many of the shells; may grow on the inner ones, where it is rounding;
#: and may be larger than in the beginning.
FALLS, OUTER, GROWS, NEAR = 1e-5, 10, 1e-6, 4.0

#: Multipliers of no less than this share of the largest are as slow: V is looked at until what is slowest has
#: halved, in directions of these alone too, as what decays faster hides that they grow.
SLOWEST = 0.5

#: States in a ball of which it is asked whether they stop, and periods after which: one step.
ASKED, MOMENT = 2048, 1e-9

#: Share of the greatest radius found that is taken: between shells, and between directions, nothing is tried.
SAFE = 0.5


class Balls(NamedTuple):
    """Balls about places; a state is in one where V there is below 1."""

    places: Floats  #: (m, dim)
    forms: Floats  #: (m, dim + 1, dim): V is the sum of squares of the first rows times e; the last row gives
    # how far along a cycle e goes, in distances to the next place
    slopes: Floats  #: (m, dim): rates of change from place to place along a cycle, else zero
    radius: float  #: the least distance to a ball's border, over the scale
    proof: RestProof | None = None  #: of a place of rest


def levels_of(flow: Flow, of: Balls, states: Floats) -> tuple[Integers, Floats]:
    """The place about which V is least for each state (n, dim), -1: none; and V (n,)."""
    found, level = np.empty(len(states), dtype=np.int64), np.empty(len(states))
    turning = flow.angles.astype(np.float64)
    given = np.ascontiguousarray(states), of.places, of.forms, of.slopes, turning
    levels(*given, found=found, level=level)
    return found, level


def balls(flow: Flow, orbit: Orbit) -> Balls | None:
    """The balls of an orbit that does not repel, in which nothing stops; None: it was not seen to attract."""
    own = _attracting(flow, orbit)
    return own if own is None or not flow.problem.observation.stops else _without_stops(flow, own)


def _attracting(flow: Flow, orbit: Orbit) -> Balls | None:
    """The same without a stopping condition.

    Of a place of rest it is the proved one, unless it attracts so slowly that the measured one is larger.
    """
    slow = bool(np.abs(orbit.multipliers).max(initial=0.0) > SLOW)
    own = _measured(flow, orbit, slow=True) if slow else None
    if not attracts(orbit):
        return own
    if orbit.periods == 0.0 and isinstance(flow.scene, System):
        proof = prove_rest(flow.scene, orbit.points[0], flow.scale)
        proved = None if proof is None else _proved(flow, orbit.points, proof)
        if proved is not None and (own is None or own.radius < proved.radius):
            return proved
        if own is not None:
            return own._replace(proof=proof)
    return own or _measured(flow, orbit)


def _measured(flow: Flow, orbit: Orbit, slow: bool = False) -> Balls | None:
    """Balls in which V falls in a period, or ``slow``: in the long run; None: it does not."""
    places, (m, dim) = np.ascontiguousarray(orbit.points), orbit.points.shape
    period = orbit.periods or 1.0
    some = PLACES if slow else TRIED
    tried = np.unique(np.linspace(0, m - 1, some).astype(int)) if orbit.cycle or slow else np.arange(m)
    forms, slopes, rng = np.zeros((m, dim + 1, dim)), np.zeros((m, dim)), np.random.default_rng(0)
    slowest = np.zeros((m, dim, dim))  # takes the part of a disturbance that hardly decays
    if orbit.cycle:
        slopes = np.ascontiguousarray(flow.rates(places) * (flow.period * period / m))
    for j in range(m):
        keep = np.eye(dim)
        if orbit.cycle:
            values, left = eig(orbit.jacobians[j].T)
            w = left[:, np.argmin(np.abs(values - 1.0))].real
            keep -= np.outer(slopes[j], w) / (w @ slopes[j])
            along = slopes[j] / flow.scale**2
            forms[j, dim] = along / (along @ slopes[j])
        J = keep @ orbit.jacobians[j] @ keep
        J *= min(1.0, ATTRACTS / max(float(np.abs(np.linalg.eigvals(J)).max()), 1e-300))
        # In units of the scale: states of very different sizes would lose digits.
        J = J * flow.scale / flow.scale[:, None]
        values, vectors = np.linalg.eig(J)
        shares, sizes = np.linalg.pinv(vectors), np.abs(values)
        part = (vectors * (sizes >= SLOWEST * sizes.max())) @ shares
        slowest[j] = part.real * flow.scale[:, None] / flow.scale
        if slow:
            P = (shares.conj().T @ shares).real
        else:
            P = lyapunov_form(partial(solve_discrete_lyapunov, J.T, np.eye(dim), method="bilinear"))
        P /= np.outer(flow.scale, flow.scale)
        squares, axes = np.linalg.eigh(0.5 * (P + P.T))
        if not squares[-1] > 0.0:
            return None  # the equation for P is singular to rounding
        forms[j, :dim] = np.sqrt(np.maximum(squares, ROUNDING * squares[-1]))[:, None] * axes.T @ keep
    own = Balls(places, forms, slopes, 1.0)
    if orbit.cycle and dim == 1:
        return own  # there is nothing beside a circle
    # Shells of the same V about all places.
    first = min(float(np.linalg.norm(forms[j, :dim] * flow.scale, 2)) for j in tried.tolist())
    sizes = first * 0.5 ** np.arange(SHELLS)
    free = dim - orbit.cycle
    number = 1 if free == 1 else (FEW if slow else PAIRS) * min(free, 8)
    u = (np.array([1.0, -1.0])[:, None] * rng.standard_normal((number, 1, dim))).reshape(-1, dim)
    few = u[: 2 * FEW]
    limit, largest = np.ones(SHELLS), float(np.abs(orbit.multipliers).max(initial=0.0))
    times = math.ceil(min(math.log(0.5) / math.log(max(largest, 1e-300)), WAITED)) if largest < 1.0 else 1
    if slow:
        limit = np.where(np.arange(SHELLS) < OUTER, 1.0 - FALLS, 1.0 + GROWS)

    def falls(shells: slice, u: Floats) -> Flags:
        """Whether V falls on shells, in directions (k, dim) from all places that are tried."""
        lanes, size = [], sizes[shells, None, None]
        for j in tried.tolist():
            e = u @ np.linalg.pinv(forms[j, :dim]).T
            e = np.concatenate([e, e[: 2 * FEW] @ slowest[j].T])
            e /= np.linalg.norm(e @ forms[j, :dim].T, axis=1)[:, None]
            lanes.append(places[j] + size * e)
        starts = np.stack(lanes).reshape(-1, dim)
        if slow:
            looks = np.arange(1.0, LOOKS + 1.0) / (DENSE if orbit.periods == 0.0 and not flow.forced else 1.0)
            paths = flow.run(starts, period * np.append(looks, WAITED - looks[-1] + looks), FINER).y
            V = levels_of(flow, own, paths.reshape(-1, dim))[1].reshape(2, LOOKS, len(tried), len(size), -1)
            before, after = V.max(axis=1)
            after = np.where(before < NEAR * size[..., 0] ** 2, after, np.inf)
        else:
            before, after = (
                levels_of(flow, own, y)[1].reshape(len(tried), len(size), -1)
                for y in (starts, flow.after(starts, times * period, FINER))
            )
        return np.asarray((after < limit[shells, None] * before).all(axis=(0, 2)))

    if slow and not falls(slice(OUTER - 1, OUTER), few).all():
        return None  # most often, and seen at a small part of the cost
    seen = falls(slice(None), few)
    good = SHELLS - int(np.argmin(np.append(seen[::-1], False)))
    while len(few) < len(u) and good < SHELLS and not (seen := falls(slice(good, good + SURE), u)).all():
        good += seen.size - int(np.argmin(seen[::-1]))
    if slow and good >= OUTER:
        return None
    radius = float(SAFE * sizes[good] if good < SHELLS else sizes[-1])
    forms[:, :dim] /= radius
    widest = max(float(np.linalg.norm(forms[j, :dim] * flow.scale, 2)) for j in tried.tolist())
    return own._replace(radius=1.0 / widest)


def _proved(flow: Flow, place: Floats, proof: RestProof) -> Balls:
    """The ball of a proof."""
    root = np.linalg.cholesky(proof.form).T
    forms = np.zeros((1, len(root) + 1, len(root)))
    forms[0, :-1] = root
    radius = 1.0 / float(np.linalg.norm(root * flow.scale, 2))
    return Balls(np.ascontiguousarray(place), forms, np.zeros_like(place), radius, proof)


def _without_stops(flow: Flow, own: Balls) -> Balls | None:
    """Balls so much smaller that no state of a sample in them stops; None: their places do.

    Motions that a ball attracts may else stop on the way to its place.
    """
    dim, rng = own.places.shape[1], np.random.default_rng(0)
    j = np.resize(np.linspace(0, len(own.places) - 1, TRIED).astype(int), ASKED)
    u = rng.standard_normal((ASKED, dim))
    u *= (rng.random(ASKED) ** (1.0 / dim) / np.linalg.norm(u, axis=1))[:, None]
    for _ in range(SHELLS):
        away = np.einsum("nij,nj->ni", np.linalg.pinv(own.forms[:, :dim])[j], u)
        if not flow.run(own.places[j] + away, np.array([MOMENT])).stopped.any():
            return own
        forms = own.forms.copy()
        forms[:, :dim] *= 2.0
        own = own._replace(forms=forms, radius=0.5 * own.radius)
    return None


def keys_of(flow: Flow, size: Floats, states: Floats) -> Integers:
    """One number for the cell of each state (..., dim)."""
    place = states - flow.middle
    if flow.angles.any():
        place[..., flow.angles] %= 2.0 * np.pi
    with np.errstate(invalid="ignore"):
        index = np.floor(place / size)
        index = np.where(np.abs(index) < 2.0**53, index, -(2.0**53)).astype(np.int64)
    key = np.zeros(states.shape[:-1], dtype=np.uint64)
    for d in range(states.shape[-1]):  # a hash of 64 bit: among a million cells no two share one
        key = (key ^ index[..., d].view(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    return key.view(np.int64)


class Cloud(NamedTuple):
    """Cells that motions keep visiting, and where they were."""

    points: Floats  #: (m, dim)
    size: Floats  #: of a cell (dim,)
    still: bool = False  #: each motion stays in one cell: it comes to rest more slowly than any exponent
    exponent: float = 0.0  #: largest Lyapunov exponent [1/s]
    error: float = 0.0  #: its standard error, and what a linear growth of disturbances would give
    continuum: bool = False  #: whether fixed points of the map, or cycles, lie side by side
    period: float | None = None  #: of the neutral cycles that fill it, in the flow's


class ArrivalCells(NamedTuple):
    """Cells of several clouds by their numbers, rising; those of two clouds are nobody's."""

    size: Floats  #: (dim,)
    keys: Integers  #: (cells,)
    owner: Integers  #: whose (cells,)


def cells_of(flow: Flow, clouds: list[Cloud], wider: float) -> ArrivalCells:
    """Cells of clouds, ``wider`` by a factor than the widest of theirs."""
    size = wider * np.max([cloud.size for cloud in clouds], axis=0)
    each = [np.unique(keys_of(flow, size, cloud.points)) for cloud in clouds]
    keys, first, count = np.unique(np.concatenate(each), return_index=True, return_counts=True)
    owner = np.repeat(np.arange(len(clouds)), [k.size for k in each])[first]
    return ArrivalCells(size, keys, np.where(count == 1, owner, -1))


def owners(flow: Flow, cells: ArrivalCells, states: Floats) -> Integers:
    """In whose cell each state (..., dim) is, -1: nobody's."""
    keys = keys_of(flow, cells.size, states)
    place = np.minimum(np.searchsorted(cells.keys, keys), cells.keys.size - 1)
    return np.where(cells.keys[place] == keys, cells.owner[place], -1)
