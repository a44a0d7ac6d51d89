"""How deep each well is: the energy at which its sublevel set first meets another minimum.

Angles count their turns here: a copy of the same minimum one turn further is another minimum.
"""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.equilibria.descent import convex_radius, descend, step_off
from fastmech.equilibria.outcome import Outcome
from fastmech.equilibria.solve import INDICES
from fastmech.jit import MATRIX, STATUSES, kernel
from fastmech.mechanism.impulse import impulse_for, mobility

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]

COMPLETE = int(Outcome.COMPLETE)

#: Share of the potential's amplitudes by which what is proved lies below the barriers: far above rounding.
ROUNDING = 1e-12


@kernel(types.void(MATRIX, MATRIX, MATRIX, MATRIX, INDICES, STATUSES, STATUSES, MATRIX))
def barriers(
    coefficients: Floats,
    phi: Floats,
    theta: Floats,
    energy: Floats,
    index: Codes,
    count: Codes,
    outcome: Codes,
    barrier: Floats,
) -> None:
    """Write the energy of the lowest way out of every minimum into ``barrier`` (n, 6), NaN elsewhere.

    Equilibria come deepest first, and energies and barriers are in the same unit; other arguments as in
    ``solve``. Saddles are taken in rising order. One whose two sides lead down to different minima (or to
    copies of one minimum, some turns apart) opens both wells. With four equilibria each saddle does: the
    torus has two independent turns, and two saddles for them.
    """
    phis, thetas, radii, slot = np.empty(6), np.empty(6), np.empty(6), np.empty(6, dtype=np.int64)
    for row in range(coefficients.shape[0]):
        barrier[row] = np.nan
        if outcome[row] != COMPLETE:
            continue
        n, minima = int(count[row]), 0
        for i in range(n):
            if index[row, i] == 0:
                phis[minima], thetas[minima], slot[minima] = phi[row, i], theta[row, i], i
                radii[minima] = convex_radius(coefficients[row], phi[row, i], theta[row, i])
                minima += 1
        for i in range(n):
            if index[row, i] != 1:
                continue
            if n == 4:
                barrier[row, 0] = energy[row, i]
                break
            c = coefficients[row]
            p1, t1 = step_off(c, phi[row, i], theta[row, i], 1.0)
            p2, t2 = step_off(c, phi[row, i], theta[row, i], -1.0)
            first, a1, a2 = descend(c, p1, t1, phis, thetas, radii, minima)
            second, b1, b2 = descend(c, p2, t2, phis, thetas, radii, minima)
            if first < 0 or second < 0:
                break  # a way out that is not known may be lower than those that follow
            if first != second or a1 != b1 or a2 != b2:
                for well in (first, second):
                    if np.isnan(barrier[row, slot[well]]):
                        barrier[row, slot[well]] = energy[row, i]


def least_impulses(
    coefficients: Floats, phi: Floats, theta: Floats, depth: Floats, masses: tuple[Floats, Floats], on: str
) -> Floats:
    """Impulse on a point [N s] below which no blow on the resting mechanism leaves its well, (n,).

    Energy does not grow under a constant force. So no blow that gives less than the well's depth leaves, and
    none gives more than along the direction in which the point moves most easily. What rounding may make of
    the depth is taken off. NaN for M3 at its dead centres.

    Args:
        coefficients: (n, 8) rows as ``solve`` takes them.
        phi, theta: minima (n,) [rad].
        depth: (n,), over m2 l^2 [1/s^2].
        masses: m2 [kg] and m2 l^2 [kg m2], (n,).
        on: one of :data:`fastmech.mechanism.impulse.POINTS`.
    """
    mass, slider, lift, spring, gravity, force, *_ = coefficients.T
    rounding = ROUNDING * (np.abs(lift) + spring + gravity + 2.0 * np.abs(force))
    easiest = mobility(masses[0], mass, slider, phi, theta, on).greatest
    return impulse_for(np.maximum(depth - rounding, 0.0) * masses[1], easiest)
