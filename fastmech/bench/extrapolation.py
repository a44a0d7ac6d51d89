"""Truth for random scenes: Gragg-Bulirsch-Stoer extrapolation, one trajectory at a time.

Nothing of it is the package's engine: own stepping (Hairer, Norsett, Wanner, *Solving ODEs I*, section II.9,
modified midpoint rule, sequence 2, 4, 6, ..., 14, extrapolated in the square of the step), steps that adapt
to each trajectory alone, and the equations of :mod:`fastmech.bench.plain`. How far it can be trusted tell a
run with a larger tolerance, hence other steps, and one that starts a rounding aside: one of them alone may
end near the truth by luck. What is not known so is left to :mod:`fastmech.bench.extended`.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fastmech.bench.plain import accelerations
from fastmech.jit import FLAGS
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene

Floats = NDArray[np.float64]

#: Columns of the extrapolation: its order is twice as many.
COLUMNS = 7

#: Errors a step, relative to 1 and the largest state, of the two runs.
TOLERANCES = (5e-15, 1e-13)

#: The start of the third run over that of the others.
ASIDE = 1.0 + 2.0 * np.finfo(np.float64).eps

#: How a step may change from one to the next, and the share of the step that the error allows.
LEAST, MOST, SAFETY = 0.2, 2.0, 0.8

#: Steps of this share of the run are taken whatever their error: rounding is all that is left.
SHORTEST = 1e-4


@njit(nogil=True, **FLAGS)  # type: ignore[untyped-decorator]
def _rates(t: float, y: Floats, p: Floats, now: Floats, dy: Floats) -> None:
    """Derivatives ``dy`` of one state; ``now`` is overwritten by the coefficients at t."""
    now[:] = p
    now[5] = p[5] * np.exp(-p[7] * t)
    dy[0], dy[1] = y[2], y[3]
    dy[2], dy[3] = accelerations(y[0], y[1], y[2], y[3], now)


@njit(nogil=True, **FLAGS)  # type: ignore[untyped-decorator]
def extrapolated(starts: Floats, p: Floats, t_end: float, tolerance: float) -> Floats:
    """Final states (n, 4) from starts (n, 4) and reduced coefficients (8,)."""
    final, table = np.empty_like(starts), np.empty((COLUMNS, 4))
    begin, slope, now = np.empty(4), np.empty(4), np.empty_like(p)
    before, middle, there = np.empty(4), np.empty(4), np.empty(4)
    for i in range(len(starts)):
        y, t, h = starts[i].copy(), 0.0, t_end / 128.0
        while t < t_end:
            last = t + h >= t_end * (1.0 - 1e-14)
            h = t_end - t if last else h
            _rates(t, y, p, now, begin)
            error = 0.0
            for j in range(COLUMNS):
                n = 2 * (j + 1)
                part = h / n
                # The change within the step rounds less than the state.
                for d in range(4):
                    before[d], middle[d] = 0.0, part * begin[d]
                for k in range(1, n):
                    for d in range(4):
                        there[d] = y[d] + middle[d]
                    _rates(t + k * part, there, p, now, slope)
                    for d in range(4):
                        before[d], middle[d] = middle[d], before[d] + 2.0 * part * slope[d]
                table[j] = middle
                for m in range(j - 1, -1, -1):
                    ratio = (n / (2.0 * (m + 1))) ** 2 - 1.0
                    for d in range(4):
                        table[m, d] = table[m + 1, d] + (table[m + 1, d] - table[m, d]) / ratio
            size = 1.0
            for d in range(4):
                size = max(size, abs(y[d]))
                error = max(error, abs(table[0, d] - table[1, d]))
            error = error / size
            wanted = SAFETY * (tolerance / max(error, 1e-300)) ** (1.0 / (2 * COLUMNS - 1))
            wanted = min(max(wanted, LEAST), MOST) if np.isfinite(wanted) else LEAST
            if error <= tolerance or h <= SHORTEST * t_end:
                for d in range(4):
                    y[d] += table[0, d]
                t = t_end if last else t + h
            h = max(h * wanted, SHORTEST * t_end)
        final[i] = y
    return final


def truth(scene: Scene, starts: Floats, t_end: float) -> tuple[Floats, Floats]:
    """Final states (n, 4) and their uncertainties (n,): the largest difference to the two other runs."""
    p = np.array(reduce(scene), dtype=np.float64)
    fine, coarse = (extrapolated(starts, p, t_end, tolerance) for tolerance in TOLERANCES)
    aside = extrapolated(starts * ASIDE, p, t_end, TOLERANCES[0])
    return fine, np.maximum(np.abs(fine - coarse), np.abs(fine - aside)).max(axis=1)
