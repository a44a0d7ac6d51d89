"""Energy bounds that no motion of a scene breaks, only too large a step; told in compiled passes over lanes.

Under a constant force T + U never grows, and without damper it is conserved; under a decaying force T + Pi
grows by at most F0 (2 l - sgn(F0) x2), the work done if M2 went to the far end of its reach at full force,
and without damper falls by at most F0 (2 l + sgn(F0) x2).

A pass goes through :data:`LANES` trajectories at a time, the last time through copies of the last one too:
loops that always have that length are packed instructions for all of them, so a trajectory's numbers depend
neither on its place nor on its companions.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.ensembles.threads import in_parts
from fastmech.jit import MATRIX, kernel
from fastmech.kernels.sincos import REDUCTION_LIMIT, sincos
from fastmech.mechanism.coefficients import Coefficients
from fastmech.mechanism.reduced import kinetic, metric_11, potential, slider_ratio

Floats = NDArray[np.float64]

#: States (n, 4), which a user may have locked.
STATES = types.Array(types.float64, 2, "C", readonly=True)

#: Trajectories that are in the caches together; whole vectors of any processor.
LANES = 64

#: Share of the energy's scale by which a bound may be missed: integration errors are far below it as long as
#: the step resolves the motion.
SLACK = 1e-2


@kernel(types.void(STATES, MATRIX, MATRIX))
def tell_energies(states: Floats, own: Floats, told: Floats) -> None:
    """:func:`energies` of states (n, 4) with coefficients ``own`` (8, n), or (8, 1) where all share them."""
    n, shared = states.shape[0], own.shape[1] == 1
    Y, p, found = np.empty((8, LANES)), np.empty((8, LANES)), np.empty((4, LANES))
    for first in range(0, n, LANES):
        for i in range(LANES):
            row = min(first + i, n - 1)
            for d in range(4):
                Y[d, i] = states[row, d]
            for k in range(8):
                p[k, i] = own[k, 0 if shared else row]
        for angle in range(2):
            beyond = 0
            for i in range(LANES):
                beyond |= abs(Y[angle, i]) > REDUCTION_LIMIT
                Y[4 + 2 * angle, i], Y[5 + 2 * angle, i] = sincos(Y[angle, i])
            if beyond:
                for i in range(LANES):
                    if abs(Y[angle, i]) > REDUCTION_LIMIT:
                        Y[4 + 2 * angle, i], Y[5 + 2 * angle, i] = np.sin(Y[angle, i]), np.cos(Y[angle, i])
        for i in range(LANES):
            s1, c1, s2, c2 = Y[4, i], Y[5, i], Y[6, i], Y[7, i]
            s12, force = s1 * c2 + c1 * s2, p[5, i]
            constant = force if p[7, i] == 0.0 else 0.0
            T = kinetic(metric_11(p[0, i], p[1, i], slider_ratio(s1, c1)[0]), s12, Y[2, i], Y[3, i])
            u = potential(s1, c1, s2, c2, s12, p[2, i], p[3, i], p[4, i], constant)
            most, way = abs(force - constant), 2.0 - (c1 - s2 if force > 0.0 else s2 - c1)
            found[0, i], found[1, i], found[2, i] = T + u, most * way, most * (4.0 - way)
            found[3, i] = T + abs(p[2, i]) + p[4, i] + p[3, i] + 2.0 * abs(force)
        for i in range(min(LANES, n - first)):
            for k in range(4):
                told[k, first + i] = found[k, i]


def energies(c: Coefficients, states: Floats, members: slice = slice(None)) -> Floats:
    """T + U of states (n, 4), of all or of some, and what it may become; over m2 l^2 [1/s^2], shape (4, n).

    A row each: T + U with U = Pi - F x2 of a constant force and Pi of one that decays; the most that a
    decaying force can add to it; the most that it can take; the scale to compare it with, the sum of its
    terms. ``c`` are reduced coefficients, numbers or one a trajectory.
    """
    values: Any = [np.asarray(value) for value in c]
    some = np.ascontiguousarray(states[members], dtype=np.float64)
    if any(value.ndim and value.strides[0] for value in values):
        own = np.empty((len(values), len(some)))
        for row, value in zip(own, values, strict=True):
            row[:] = value[members] if value.ndim else value
    else:
        own = np.array([value.flat[0] for value in values], dtype=np.float64)[:, None]
    told = np.empty((4, len(some)))
    tell_energies(some, own, told)
    return told


def highest_energies(c: Coefficients, starts: Floats, threads: int | None = None) -> Floats:
    """The highest T + U over m2 l^2 [1/s^2] to which motions from states (n, 4) can come, shape (n,)."""
    highest = np.empty(len(starts))

    def tell(part: slice) -> None:
        total, gain, _, _ = energies(c, starts, part)
        np.add(total, gain, out=highest[part])

    in_parts(tell, len(starts), threads)
    return highest


def breaks_energy_bounds(
    c: Coefficients, start: Floats, final: Floats, threads: int | None = 1
) -> NDArray[np.bool_]:
    """Which trajectories from states (n, 4) end in states with an energy that they cannot have (n,)."""
    broken, damped = np.empty(len(start), dtype=np.bool_), np.broadcast_to(c.damping, len(start)) != 0.0

    def tell(part: slice) -> None:
        (before, gain, fall, scale), after = energies(c, start, part), energies(c, final, part)[0]
        # An energy beyond a double's range is none that a motion can have.
        broken[part] = ~np.isfinite(after) | (after - before - gain > SLACK * scale)
        broken[part] |= ~damped[part] & (before - after - fall > SLACK * scale)

    in_parts(tell, len(start), threads)
    return broken
