"""Truth in extended precision: Gragg-Bulirsch-Stoer extrapolation, which shares nothing with the engine.

Chaotic motions and those that graze a saddle magnify rounding by 1e6 to 1e12: in double nobody knows where
they end. NumPy's longdouble (80 bits on x86) starts 2000 times below. The modified midpoint rule with 2, 4,
6, ... steps, extrapolated in the square of the step (Hairer, Norsett, Wanner, *Solving ODEs I*, section
II.9), with the equations of :mod:`fastmech.bench.plain`: one array operation for all trajectories, each
with its own steps. What is extrapolated is the change within a step: it rounds less than the state. Where
longdouble is no more than double (Windows, ARM Macs) nothing is gained, and the two runs say so.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.bench.plain import accelerations
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene

Extended = NDArray[np.longdouble]

#: Times (n,) and states (dim, n) to derivatives (dim, n).
Rates = Callable[[Extended, Extended], Extended]

#: Columns of the extrapolation: its order is twice as many.
COLUMNS = 9

#: Errors a step, relative to 1 and the largest state, in longdouble's rounding, of the two runs.
ROUNDINGS = (10.0, 1000.0)

#: How a step may change from one to the next, the share of the step that the error allows, and the share of
#: the run from which steps are taken whatever their error.
LEAST, MOST, SAFETY, SHORTEST = 0.2, 2.0, 0.8, 1e-5

_plain = getattr(accelerations, "py_func", accelerations)


def scene_rates(scene: Scene) -> Rates:
    """Derivatives (4, n) of a scene's states (4, n) at their times (n,)."""
    p = np.array(reduce(scene), dtype=np.float64).astype(np.longdouble)

    def rates(t: Extended, y: Extended) -> Extended:
        now = list(p)
        now[5] = p[5] * np.exp(-p[7] * t) if p[5] * p[7] != 0.0 else p[5]
        return np.stack([y[2], y[3], *_plain(*y, now)])

    return rates


def _step(t: Extended, y: Extended, h: Extended, rates: Rates) -> tuple[Extended, Extended]:
    """Changes (dim, n) over steps h (n,) and their errors (n,)."""
    table: list[Extended] = []
    begin, last = rates(t, y), np.zeros_like(y)
    for j in range(COLUMNS):
        n = 2 * (j + 1)
        part = h / n
        before, middle = np.zeros_like(y), part * begin
        for k in range(1, n):
            before, middle = middle, before + 2.0 * part * rates(t + k * part, y + middle)
        table.append(middle)
        for m in range(j - 1, -1, -1):
            last = table[m + 1]
            ratio = np.longdouble(n * n) / (4 * (m + 1) ** 2) - 1
            table[m] = last + (last - table[m]) / ratio
    return table[0], np.abs(table[0] - last).max(axis=0)


def extended(rates: Rates, starts: Floats, t_end: float, roundings: float) -> Extended:
    """Final states (n, dim) from starts (n, dim)."""
    end, tolerance = np.longdouble(t_end), np.longdouble(roundings) * np.finfo(np.longdouble).eps
    y = starts.T.astype(np.longdouble)
    t, h = np.zeros(len(starts), np.longdouble), np.full(len(starts), end / 128)
    final, who = np.empty_like(y), np.arange(len(starts))
    while who.size:
        last = t + h >= end
        h = np.where(last, end - t, h)
        with np.errstate(invalid="ignore", over="ignore"):
            change, error = _step(t, y, h, rates)
            error = error / np.maximum(np.abs(y).max(axis=0), 1)
            wanted = SAFETY * (tolerance / np.maximum(error, np.finfo(np.longdouble).tiny)) ** (
                np.longdouble(1) / (2 * COLUMNS - 1)
            )
        taken = (error <= tolerance) | (h <= SHORTEST * end)
        y = np.where(taken, y + change, y)
        t = np.where(taken, np.where(last, end, t + h), t)
        h = np.maximum(h * np.clip(np.nan_to_num(wanted, nan=LEAST), LEAST, MOST), SHORTEST * end)
        done = t >= end
        final[:, who[done]] = y[:, done]
        who, t, h, y = who[~done], t[~done], h[~done], y[:, ~done]
    return np.ascontiguousarray(final.T)


def extended_truth(rates: Rates, starts: Floats, t_end: float) -> tuple[Floats, Floats]:
    """Final states (n, dim) and their uncertainties (n,): the largest difference of two runs."""
    fine, coarse = (extended(rates, starts, t_end, roundings) for roundings in ROUNDINGS)
    return fine.astype(np.float64), np.abs(fine - coarse).max(axis=1).astype(np.float64)
