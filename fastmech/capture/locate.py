"""Which well a position belongs to: a table of proved cells, and the proved way down where that is silent.

Everything an observer needs lies in one vector, because observers take one: see ``pack``.
"""

from __future__ import annotations

import math

import numpy as np
from numba import types

from fastmech.arrays import Floats
from fastmech.equilibria.descent import (
    MOST_STEPS,
    TURN,
    curvature_bound,
    minimum_at,
    slope,
    step_down,
    third_bound,
)
from fastmech.jit import VECTOR, inlined, kernel
from fastmech.mechanism.reduced import potential

#: Places in the vector: reduced coefficients of the potential, amplitude and rate of the decaying force,
#: time between stops [s], number of wells, cells along a turn; then four numbers a well; then the cells.
AMPLITUDE, RATE, INTERVAL, WELLS, CELLS, FIRST_WELL = 8, 9, 10, 11, 12, 13

#: Cells along one turn: a table of 16,384 numbers stays in the second-level cache.
SIDE = 128

#: What a cell's number holds: 0 nothing is proved, else 1 + well + 8 (turns of phi + 4) + 64 (turns of theta
#: + 4), the turns being those of the well that the cell with both angles in [-pi, pi) belongs to.
PHI_DIGIT, THETA_DIGIT, MOST_TURNS = 8, 64, 3

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
            s1, s2 = np.sin(phi), np.sin(theta)
            u = potential(
                s1,
                np.cos(phi),
                s2,
                np.cos(theta),
                np.sin(phi + theta),
                params[2],
                params[3],
                params[4],
                params[5],
            )
            top = u + np.hypot(g1, g2) * reach + 0.5 * bound * reach * reach
            if not top < highest:
                continue
            well, turns1, turns2 = locate(params, phi, theta)
            if well < 0 or not top < params[first + well] or max(abs(turns1), abs(turns2)) > MOST_TURNS:
                continue
            code = 1 + well + PHI_DIGIT * (turns1 + 4) + THETA_DIGIT * (turns2 + 4)
            params[FIRST_WELL + 4 * wells + row * side + column] = code
