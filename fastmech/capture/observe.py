"""What observers of any mechanism share: positions to wells, capture, ranges, stops.

``params`` are the energy's coefficients, then from ``first`` on: time between stops [s], coordinates, wells,
time [s] by which loads have faded, number of works, time of the run's begin [s]; by coordinate the domain's
low end, cells by unit, number of cells, period, high end; by well places, half widths of convex boxes (both
wells x coordinates), levels; works [J]; cells; then the step's length [s] and whether such steps are short.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fastmech.arrays import Floats
from fastmech.capture.cells import MOST_TURNS, WELL_DIGITS
from fastmech.ensembles.ends import STOP_CODE, note_stop
from fastmech.jit import OBSERVER_SIGNATURE, called, inlined, kernel

#: Code of a motion that has left the range of a coordinate, beside wells' numbers from 1.
OUT = 127

#: Share of the time between stops that rounding of a step's time may take.
ROUNDED = 1e-6


@inlined
def is_stop(t: float, interval: float) -> bool:
    """Whether a step's end is one of the times at which captured lanes stop."""
    stops = t / interval
    return bool(abs(stops - np.floor(stops + 0.5)) < ROUNDED)


@kernel(OBSERVER_SIGNATURE)
def observe_ranges(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Stop lanes beyond the range of a coordinate; ``params`` are all low ends, then all high ones."""
    n = params.size // 2
    for j in range(n):
        for i in range(Y.shape[1]):
            if Y[j, i] < params[j] or Y[j, i] > params[n + j]:
                note_stop(1.0 * OUT, t, Y, record, i)


#: Numbers behind the coefficients, before those of coordinates.
HEAD = 6

#: Rows of numbers, one a coordinate, in front of the wells'.
TABLE_ROWS = 5

#: Rows of the record behind code, time and state of a stop: the energy below which the position is looked at
#: next, the energy; of a captured lane the well's number, the time, and the energy where it stops; its turns.
#: Where a coordinate has a range, the state at the step's begin follows.
RECORD = 5


@called
def work_left(t: float, params: Any, first: int) -> float:
    """The most work that loads can still do at a time."""
    count = int(params[first + 4])
    k = int(t / params[first + 3] * (count - 1)) if t < params[first + 3] else count - 1
    begin = first + HEAD + TABLE_ROWS * int(params[first + 1])
    begin += int(params[first + 2]) * (2 * int(params[first + 1]) + 1)
    return float(params[begin + min(max(k, 0), count - 1)])


@inlined
def rise(d: float, begin: float, end: float) -> float:
    """How far a cubic turns above where it begins, 0 if it does not, and ends ``d`` above.

    ``begin`` and ``end`` are its rates there times the step.
    """
    second, third = 3.0 * d - 2.0 * begin - end, begin + end - 2.0 * d
    root = np.sqrt(max(second * second - 3.0 * third * begin, 0.0)) - second
    u = begin / root if 0.0 < begin < root else 0.0
    return float(((third * u + second) * u + begin) * u)


@called
def leave(t: float, Y: Any, params: Any, record: Any, first: int) -> None:
    """Mark lanes that have left the range of a coordinate; a time that is NaN: they may have, in a step.

    While a coordinate's path bends one way, it comes no further in a step than the rate at one of its ends
    leads in half of it. Whom that leads out shorter steps decide, by a cubic where they are short.
    """
    n, row, at = int(params[first + 1]), first + HEAD, t - params[first + 5]
    level, well, last = 2 + 2 * n, 4 + 2 * n, 2 + 2 * n + RECORD + n
    h, short = params[params.size - 2], params[params.size - 1]
    for j in range(n):
        low, high, some = params[row + j], params[row + 4 * n + j], 0
        if params[row + 3 * n + j] > 0.0:
            continue
        q, v, before, rate = Y[j], Y[n + j], record[last + j], record[last + n + j]
        for i in range(Y.shape[1]):
            a, b = before[i] + 0.5 * h * rate[i], q[i] - 0.5 * h * v[i]
            some |= (a < low) | (b < low) | (q[i] < low) | (a > high) | (b > high) | (q[i] > high)
        for i in range(Y.shape[1] if some else 0):
            a, b = before[i] + 0.5 * h * rate[i], q[i] - 0.5 * h * v[i]
            beyond = q[i] < low or q[i] > high
            known = at if beyond or short > 0.0 else np.nan
            if short > 0.0:
                d, begin, end = q[i] - before[i], h * rate[i], h * v[i]
                a, b = before[i] + rise(d, begin, end), before[i] - rise(-d, -begin, -end)
            if (beyond or min(a, b) < low or max(a, b) > high) and record[well, i] == 0.0:
                record[well, i], record[well + 1, i], record[level, i] = OUT, known, -np.inf
    for d in range(2 * n):
        for i in range(Y.shape[1]):
            record[last + d, i] = Y[d, i]


@called
def finish(t: float, Y: Any, params: Any, record: Any, first: int, low: int) -> None:
    """Mark lanes that are captured, and at times of stopping stop those marked.

    What bounds the work of a load need not fall as fast as the load works: a captured lane runs on until its
    bounding energy is below its well's level at a stop too, where computations are compared.
    """
    n, row, at = int(params[first + 1]), first + HEAD, t - params[first + 5]
    level, energy, well = 2 + 2 * n, 3 + 2 * n, 4 + 2 * n
    levels = row + (TABLE_ROWS + 2 * int(params[first + 2])) * n - 1  # of wells by their numbers
    if low:
        for i in range(Y.shape[1]):
            if record[energy, i] < record[level, i]:
                _capture(at, Y, params, record, first, i=i)
    if is_stop(at, params[first]):
        for i in range(Y.shape[1]):
            code = int(record[well, i])
            below = code == OUT or (code != 0 and record[energy, i] < params[levels + code])
            if below and record[STOP_CODE, i] == 0.0:
                record[well + 2, i] = record[energy, i]
                note_stop(record[well, i], t, Y, record, i)


@called
def mark(t: float, params: Any, record: Any, first: int, i: int, well: int) -> bool:
    """Mark lane ``i`` if it is below its well's level, else set the energy of its next look.

    Above the level of the well w that its position leads to, a lane is in a component that holds other
    minima with w, and only wells of that component whose level is no higher can still take it.
    """
    n, wells = int(params[first + 1]), int(params[first + 2])
    levels = first + HEAD + TABLE_ROWS * n + 2 * wells * n
    energy, following = record[3 + 2 * n, i], -np.inf
    captured = energy < params[levels + well]
    if captured:
        record[4 + 2 * n, i], record[5 + 2 * n, i] = well + 1.0, t
    else:
        for w in range(wells):
            if params[levels + w] <= energy:
                following = max(following, params[levels + w])
    record[2 + 2 * n, i] = following
    return bool(captured)


@called
def _capture(t: float, Y: Any, params: Any, record: Any, first: int, i: int) -> None:
    """Find the well that the position of lane ``i`` leads to, and mark it."""
    n, wells = int(params[first + 1]), int(params[first + 2])
    row, turns = first + HEAD, 2 + 2 * n + RECORD
    places = row + TABLE_ROWS * n
    levels = places + 2 * wells * n
    table = levels + wells + int(params[first + 4])
    cell = 0
    for j in range(n):
        period, turned = params[row + 3 * n + j], 0.0
        if period > 0.0:
            turned = np.floor((Y[j, i] - params[row + j]) / period)
        k = np.floor((Y[j, i] - turned * period - params[row + j]) * params[row + n + j])
        count = params[row + 2 * n + j]
        if not (k >= 0.0 and k < count):
            if period == 0.0 or not abs(turned) < 1e9:
                return
            k = min(max(k, 0.0), count - 1.0)
        cell = cell * int(count) + int(k)
        record[turns + j, i] = turned
    code, found = int(params[table + cell]), -1
    if code > 0:
        found, code = (code - 1) % WELL_DIGITS, (code - 1) // WELL_DIGITS
        for j in range(n - 1, -1, -1):
            record[turns + j, i] += code % (2 * MOST_TURNS + 1) - MOST_TURNS
            code //= 2 * MOST_TURNS + 1
    else:
        for w in range(wells):
            inside = True
            for j in range(n):
                period, away = params[row + 3 * n + j], Y[j, i] - params[places + w * n + j]
                turned = np.floor(away / period + 0.5) if period > 0.0 else 0.0
                inside &= abs(away - turned * period) < params[places + (wells + w) * n + j]
            if inside:
                found = w
                for j in range(n):
                    period, away = params[row + 3 * n + j], Y[j, i] - params[places + w * n + j]
                    record[turns + j, i] = np.floor(away / period + 0.5) if period > 0.0 else 0.0
                break
    if found < 0:
        return
    mark(t, params, record, first, i, well=found)
