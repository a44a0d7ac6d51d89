"""The observers that stop a lane as soon as its capture is proved.

Energy is looked at for all lanes at once; the position only for lanes whose energy has fallen below the
highest level at which any well captures, which happens about once a lane. A captured lane runs on to the next
multiple of an interval, so that computations with different steps stop it at the same time.

Which well a position belongs to: a table of proved cells, and the proved way down where that is silent.
Everything an observer needs lies in one vector, because observers take one: see ``pack``.
"""

from __future__ import annotations

import math

import numpy as np
from numba import types

from fastmech.arrays import Floats
from fastmech.capture.observe import is_stop
from fastmech.ensembles.ends import STOP_CODE, note_stop
from fastmech.jit import OBSERVER_SIGNATURE, VECTOR, inlined, kernel
from fastmech.kernels.sincos import REDUCTION_LIMIT, sincos
from fastmech.slider.descent import (
    MOST_STEPS,
    TURN,
    curvature_bound,
    minimum_at,
    slope,
    step_down,
    third_bound,
)
from fastmech.slider.reduced import metric_11, potential, slider_ratio

#: Places in the vector: reduced coefficients of the potential, amplitude and rate of the decaying force,
#: time between stops [s], number of wells, cells along a turn; then four numbers a well; then the cells.
AMPLITUDE, RATE, INTERVAL, WELLS, CELLS, FIRST_WELL = 8, 9, 10, 11, 12, 13

#: Cells along one turn: a table of 16,384 numbers stays in the second-level cache.
SIDE = 128

#: What a cell's number holds: 0 nothing is proved, else 1 + well + 8 (turns of phi + 4) + 64 (turns of theta
#: + 4), the turns being those of the well that the cell with both angles in [-pi, pi) belongs to.
PHI_DIGIT, THETA_DIGIT, TABLED_TURNS = 8, 64, 3

#: Cells are taken this much larger than they are: positions are assigned to them with rounding.
ENLARGED = 1.0 + 1e-9


def pack(
    coefficients: Floats,
    amplitude: float,
    rate: float,
    phi: Floats,
    theta: Floats,
    radius: Floats,
    level: Floats,
) -> Floats:
    """The vector of an observer; its interval and its cells are still empty.

    Args:
        coefficients: of the potential that holds the wells (8,), its constant force among them.
        amplitude, rate: of the decaying force over m2 l [1/s^2] and [1/s], 0 where there is none.
        phi, theta, radius: of every minimum [rad], with its radius of convexity.
        level: energy over m2 l^2 below which a motion in a well's component is captured by it [1/s^2].
    """
    head = [amplitude, rate, 0.0, float(len(phi)), float(SIDE)]
    return np.concatenate([coefficients, head, phi, theta, radius, level, np.zeros(SIDE * SIDE)])


@inlined
def cell_of(params: Floats, phi: float, theta: float) -> tuple[int, float, float]:
    """Index in the vector of the cell of a position, and the turns of its angles from [-pi, pi)."""
    wells, side = int(params[WELLS]), int(params[CELLS])
    turns1, turns2 = np.floor((phi + np.pi) / TURN), np.floor((theta + np.pi) / TURN)
    row = min(max(int((phi - turns1 * TURN + np.pi) / TURN * side), 0), side - 1)
    column = min(max(int((theta - turns2 * TURN + np.pi) / TURN * side), 0), side - 1)
    return FIRST_WELL + 4 * wells + row * side + column, turns1, turns2


@inlined
def locate(params: Floats, phi: float, theta: float) -> tuple[int, float, float]:
    """The well to which a falling path leads from a position, and the well's turns; -1: none is proved.

    A path ends where a cell of the table is entered, too: all of such a cell lies in its well's component.
    """
    wells = int(params[WELLS])
    a, b = FIRST_WELL, FIRST_WELL + wells
    phis, thetas, radii = params[a:b], params[b : b + wells], params[b + wells : b + 2 * wells]
    third = third_bound(params)
    for _ in range(MOST_STEPS):
        cell, turns1, turns2 = cell_of(params, phi, theta)
        code = int(params[cell])
        if code > 0:
            code -= 1
            turns1 += code // PHI_DIGIT % PHI_DIGIT - 4
            turns2 += code // THETA_DIGIT - 4
            return code % PHI_DIGIT, turns1, turns2
        well, turns1, turns2 = minimum_at(phi, theta, phis, thetas, radii, wells)
        if well >= 0:
            return well, turns1, turns2
        phi, theta, length = step_down(params, third, phi, theta)
        if length == 0.0:
            break
    return -1, 0.0, 0.0


@kernel(types.void(VECTOR))
def fill_cells(params: Floats) -> None:
    """Prove what can be proved of every cell and write it into the table.

    A cell is a disc's part of a convex set: if U < B(w) all over it and the way down from its centre ends in
    w, the whole cell lies in w's component of {U < B(w)}. U at distance r is at most U + |g| r + L r^2/2.
    """
    wells, side = int(params[WELLS]), int(params[CELLS])
    first = FIRST_WELL + 3 * wells
    highest = -np.inf
    for w in range(wells):
        highest = max(highest, params[first + w])
    bound = curvature_bound(params)
    width = TURN / side
    reach = ENLARGED * width / math.sqrt(2.0)
    for row in range(side):
        for column in range(side):
            phi, theta = -np.pi + (row + 0.5) * width, -np.pi + (column + 0.5) * width
            g1, g2, _, _, _ = slope(params, phi, theta)
            trig = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
            u = potential(trig, np.sin(phi + theta), (params[2], params[3], params[4]), params[5])
            top = u + np.hypot(g1, g2) * reach + 0.5 * bound * reach * reach
            if not top < highest:
                continue
            well, turns1, turns2 = locate(params, phi, theta)
            if well < 0 or not top < params[first + well] or max(abs(turns1), abs(turns2)) > TABLED_TURNS:
                continue
            code = 1 + well + PHI_DIGIT * (turns1 + 4) + THETA_DIGIT * (turns2 + 4)
            params[FIRST_WELL + 4 * wells + row * side + column] = code


#: Rows of the record behind those of ``stopping`` (code: the well's number, from 1; time; state): the energy
#: below which the lane's position is looked at next (minus infinity once captured), its energy at the last
#: look; of a captured lane the well's number, its turns, the time of capture, and the energy where it stops.
LEVEL, ENERGY, WELL, TURNS_PHI, TURNS_THETA, CAPTURE_TIME, STOP_ENERGY, ROWS = 6, 7, 8, 9, 10, 11, 12, 13


@inlined
def bounding_energy(
    c: tuple[float, float, float, float, float, float], push: float | None, y: Floats, i: int
) -> float:
    """Energy over m2 l^2 that lane ``i`` never exceeds again [1/s^2]; ``c``: mass, slider, ..., force.

    T + U for a force that is constant or absent: the damper only takes. For a force F that decays from now
    on, T + Pi + |F| (2 l - sgn(F) x2) with the potential Pi of springs and weights: by parts, its future work
    is F(t') x2(t') - F x2 - integral of F' x2, and |x2| <= 2 l. ``push`` is F/(m2 l), ``None`` where no
    force decays. Infinite where the fast trigonometry does not reach.
    """
    s1, c1 = sincos(y[0, i])
    s2, c2 = sincos(y[1, i])
    s12 = s1 * c2 + c1 * s2
    k, _ = slider_ratio(s1, c1)
    u, v = y[2, i], y[3, i]
    energy = 0.5 * (metric_11(c[0], c[1], k) * u * u + v * v) + s12 * u * v
    energy = energy + potential((s1, c1, s2, c2), s12, (c[2], c[3], c[4]), c[5])
    if push is not None:
        energy = energy + 2.0 * abs(push) - push * (c1 - s2)
    far = (abs(y[0, i]) > REDUCTION_LIMIT) | (abs(y[1, i]) > REDUCTION_LIMIT)
    return np.inf if far else energy


@inlined
def look(t: float, Y: Floats, params: Floats, record: Floats, push: float | None) -> None:
    """Update energies, mark lanes that are captured now, and at times of stopping stop those marked."""
    c = (params[0], params[1], params[2], params[3], params[4], params[5])
    level, energies = record[LEVEL], record[ENERGY]
    low = 0
    for i in range(Y.shape[1]):
        energy = bounding_energy(c, push, Y, i)
        energies[i] = energy
        low |= energy < level[i]
    if low:
        for i in range(Y.shape[1]):
            if energies[i] < level[i]:
                capture(t, Y, params, record, i)
    if is_stop(t, params[INTERVAL]):
        for i in range(Y.shape[1]):
            if record[WELL, i] != 0.0 and record[STOP_CODE, i] == 0.0:
                record[STOP_ENERGY, i] = energies[i]
                note_stop(record[WELL, i], t, Y, record, i)


@inlined
def capture(t: float, Y: Floats, params: Floats, record: Floats, i: int) -> None:
    """Mark lane ``i`` if it is below its well's level, else set the energy of its next look.

    Above the level of the well w that its position leads to, a lane is in a component that holds other
    minima with w, and only wells of that component whose level is no higher can still take it.
    """
    wells = int(params[WELLS])
    first = FIRST_WELL + 3 * wells
    well, turns1, turns2 = locate(params, Y[0, i], Y[1, i])
    if well < 0:
        return
    energy, following = record[ENERGY, i], -np.inf
    if energy < params[first + well]:
        record[WELL, i], record[CAPTURE_TIME, i] = well + 1.0, t
        record[TURNS_PHI, i], record[TURNS_THETA, i] = turns1, turns2
    else:
        for w in range(wells):
            if params[first + w] <= energy:
                following = max(following, params[first + w])
    record[LEVEL, i] = following


@kernel(OBSERVER_SIGNATURE)
def observe_capture(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Capture under a constant force, or none; ``params`` as ``locate.pack`` makes them."""
    look(t, Y, params, record, None)


@kernel(OBSERVER_SIGNATURE)
def observe_capture_decaying(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Capture while the force decays."""
    look(t, Y, params, record, params[AMPLITUDE] * math.exp(-params[RATE] * t))
