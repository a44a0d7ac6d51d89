"""Wells of a mechanism along a parameter, each with one identity as long as it lasts."""

from __future__ import annotations

import numpy as np

from fastmech.arrays import Floats
from fastmech.atlas.continuation import newton
from fastmech.atlas.defining import Balance
from fastmech.atlas.resting_map import map_resting_places
from fastmech.models.mechanism import Mechanism

#: Longest and shortest step of a position [rad, lengths over their ranges by 2 pi].
LONGEST, SHORTEST = 0.05, 1e-9

#: Part of a step by which Newton's method may correct where its tangent leads.
CORRECTION = 0.3

#: A followed position is that of a proved list's well within so much.
SAME = 1e-6


def follow_wells(mechanism: Mechanism, parameter: str, values: Floats) -> Floats:
    """Where each well is [rad or m] (values, wells, n), NaN where it is not.

    A well is followed from each value to the next by small steps; where it disappears in between, one that is
    there afterwards is another.
    """
    found = map_resting_places(mechanism, {parameter: values})
    lists = [found.position[k][found.morse_index[k] == 0] for k in range(values.size)]
    wells: list[dict[int, Floats]] = [{0: place} for place in lists[0]]
    if values.size > 1:
        balance = Balance(mechanism, {parameter: float(values[0])}, {parameter: float(values[-1])})
    for k in range(1, values.size):
        left = list(range(len(lists[k])))
        for well in wells:
            if k - 1 in well:
                end = _carried(balance, well[k - 1], values[k - 1], values[k])
                if end is None:
                    continue
                for j in left:
                    away = balance.apart(end, balance.point(lists[k][j], values[k : k + 1]))
                    if np.abs(away).max() < SAME:
                        well[k] = lists[k][j]
                        left.remove(j)
                        break
        wells += [{k: lists[k][j]} for j in left]
    places = np.full((values.size, len(wells), len(mechanism.coordinates)), np.nan)
    for w, well in enumerate(wells):
        for k, place in well.items():
            places[k, w] = place
    return places


def _carried(balance: Balance, position: Floats, start: float, end: float) -> Floats | None:
    """The point to which an equilibrium moves as the parameter changes; None where it disappears."""
    z = balance.point(position, np.array([start]))
    last = balance.point(position, np.array([end]))[-1]
    balance.rescale(z)
    side, along = np.sign(balance.determinant(z)), np.eye(z.size)[-1]
    part = last - z[-1]
    while abs(last - z[-1]) > 0.0:
        part = np.clip(part, -abs(last - z[-1]), abs(last - z[-1]))
        slopes = balance.forces(z)[1]
        move = np.append(-np.linalg.solve(slopes[:, :-1], slopes[:, -1]), 1.0) * part
        size = float(np.linalg.norm(move))
        guess = z + move
        guess[-1] = last if abs(part) == abs(last - z[-1]) else guess[-1]
        there = newton(balance.rest, guess, CORRECTION * size, along) if size <= LONGEST else None
        if there is not None and side * balance.determinant(there) > 0.0:
            there[-1] = guess[-1]
            z, part = there, 2.0 * part
        elif size < SHORTEST:
            return None
        else:
            part *= 0.5
    return z
