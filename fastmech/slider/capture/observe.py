"""The observers that stop a lane as soon as its capture is proved.

Energy is looked at for all lanes at once; the position only for lanes whose energy has fallen below the
highest level at which any well captures, which happens about once a lane. A captured lane runs on to the next
multiple of an interval, so that computations with different steps stop it at the same time.

Which well a position belongs to is told by the proved cells of :mod:`fastmech.capture.observe`, and by the
proved way down where these are silent.
"""

from __future__ import annotations

import math

import numpy as np

from fastmech.arrays import Floats
from fastmech.capture.cells import ENLARGED, MOST_TURNS, WELL_DIGITS, Cells
from fastmech.capture.observe import HEAD, TABLE_ROWS, finish, mark
from fastmech.jit import OBSERVER_SIGNATURE, inlined, kernel
from fastmech.kernels.sincos import REDUCTION_LIMIT, sincos
from fastmech.slider.descent import MOST_STEPS, TURN, curvature_bound, in_ball, step_down, third_bound
from fastmech.slider.reduced import metric_11, potential, potential_gradient, slider_ratio

#: Places in the observers' vector: behind the coefficients of the potential that holds the wells, with its
#: constant force, those of the decaying force over m2 l [1/s^2] and [1/s]; then what all observers share.
AMPLITUDE, RATE, FIRST = 8, 9, 10
PLACES = FIRST + HEAD + 2 * TABLE_ROWS

#: Cells along one turn: a table of 16,384 numbers stays in the second-level cache.
SIDE = 128


def bounded_cells(c: Floats) -> Cells:
    """Bounds of U over m2 l^2 on cells: at distance r from a middle it is U within |g| r + L r^2/2."""
    width = TURN / SIDE
    reach = (1.0 + ENLARGED) * width / math.sqrt(2.0)
    middles = -np.pi + (np.arange(SIDE) + 0.5) * width
    phi, theta = (angle.ravel() for angle in np.meshgrid(middles, middles, indexing="ij"))
    trig = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    slope = np.hypot(*potential_gradient(trig, np.cos(phi + theta), c[2:5], c[5]))
    middle = potential(trig, np.sin(phi + theta), c[2:5], c[5])
    away = slope * reach + 0.5 * curvature_bound(c) * reach * reach
    domain = np.array([[-np.pi, np.pi, TURN]] * 2)
    return Cells(domain, np.array([SIDE, SIDE]), np.stack([middle - away, middle + away], axis=1))


@inlined
def locate(params: Floats, phi: float, theta: float) -> tuple[int, float, float]:
    """The well to which a falling path leads from a position, and the well's turns; -1: none is proved.

    A path ends where a cell of the table is entered, too: all of such a cell lies in its well's component.
    """
    wells = int(params[FIRST + 2])
    radius = PLACES + 2 * wells
    level = radius + 2 * wells
    third = third_bound(params)
    for _ in range(MOST_STEPS):
        turns1, turns2 = np.floor((phi + np.pi) / TURN), np.floor((theta + np.pi) / TURN)
        row = min(max(int((phi - turns1 * TURN + np.pi) / TURN * SIDE), 0), SIDE - 1)
        column = min(max(int((theta - turns2 * TURN + np.pi) / TURN * SIDE), 0), SIDE - 1)
        code = int(params[level + wells + 1 + row * SIDE + column]) - 1
        if code >= 0:
            turned, base = code // WELL_DIGITS, 2 * MOST_TURNS + 1
            turns1 += turned // base - MOST_TURNS
            turns2 += turned % base - MOST_TURNS
            return code % WELL_DIGITS, turns1, turns2
        for well in range(wells):
            middle = params[PLACES + 2 * well], params[PLACES + 2 * well + 1]
            inside, turns1, turns2 = in_ball(phi, theta, middle, params[radius + 2 * well])
            if inside:
                return well, turns1, turns2
        phi, theta, length = step_down(params, third, phi, theta)
        if length == 0.0:
            break
    return -1, 0.0, 0.0


#: Rows of the record of the energy below which the lane's position is looked at next (minus infinity once
#: captured), of its energy at the last look, and of the turns of a captured lane's well.
LEVEL, ENERGY, TURNS_PHI, TURNS_THETA = 6, 7, 11, 12


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
                well, turns1, turns2 = locate(params, Y[0, i], Y[1, i])
                if well >= 0 and mark(t, params, record, FIRST, i, well=well):
                    record[TURNS_PHI, i], record[TURNS_THETA, i] = turns1, turns2
    finish(t, Y, params, record, FIRST, low=0)


@kernel(OBSERVER_SIGNATURE)
def observe_capture(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Capture under a constant force, or none."""
    look(t, Y, params, record, None)


@kernel(OBSERVER_SIGNATURE)
def observe_capture_decaying(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Capture while the force decays."""
    look(t, Y, params, record, params[AMPLITUDE] * math.exp(-params[RATE] * t))
