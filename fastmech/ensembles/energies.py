"""Energies of many trajectories in a compiled pass over lanes, for the bounds that no motion breaks."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.jit import MATRIX, inlined, kernel
from fastmech.kernels.passes import LANES, ROWS, STATES, fill_trigonometry, load, load_own
from fastmech.mechanism.reduced import kinetic, metric_11, potential, slider_ratio

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

FLAGS = types.Array(types.boolean, 1, "C")


@inlined
def energy_at(
    s1: Any,
    c1: Any,
    s2: Any,
    c2: Any,
    phi_dot: Any,
    theta_dot: Any,
    mass: Any,
    slider: Any,
    lift: Any,
    spring: Any,
    gravity: Any,
    force: Any,
) -> tuple[Any, Any]:
    """(T, Pi - F x2) over m2 l^2 [1/s^2], of a lane or of arrays."""
    s12 = s1 * c2 + c1 * s2
    a11 = metric_11(mass, slider, slider_ratio(s1, c1)[0])
    u = potential(s1, c1, s2, c2, s12, lift, spring, gravity, force)
    return kinetic(a11, s12, phi_dot, theta_dot), u


@inlined
def energy_scale(T: Any, lift: Any, spring: Any, gravity: Any, force: Any) -> Any:
    """What an energy over m2 l^2 is compared with: the sum of its terms."""
    return T + abs(lift) + gravity + spring + 2.0 * abs(force)


@inlined
def is_constant(force: Any, decay: Any) -> Any:
    """Whether a force stays what it is; only then it has a potential."""
    return (decay == 0.0) | (force == 0.0)


@inlined
def lane_energy(Y: Floats, i: int, p: Floats, j: int) -> tuple[float, float]:
    """:func:`energy_at` of lane ``i`` with the coefficients of lane ``j``."""
    return energy_at(
        Y[4, i], Y[5, i], Y[6, i], Y[7, i], Y[2, i], Y[3, i],
        p[0, j], p[1, j], p[2, j], p[3, j], p[4, j], p[5, j] if is_constant(p[5, j], p[7, j]) else 0.0,
    )  # fmt: skip


@inlined
def lane_work(Y: Floats, p: Floats, i: int) -> tuple[float, float]:
    """The most that a decaying force can add to T + U, over m2 l^2, and the most that it can take.

    That is its work at full strength until M2 is at either end of its reach, from where a lane of ``Y`` is.
    """
    force, most = p[5, i], 0.0 if is_constant(p[5, i], p[7, i]) else abs(p[5, i])
    way = 2.0 - (Y[5, i] - Y[6, i] if force > 0.0 else Y[6, i] - Y[5, i])
    return most * way, most * (4.0 - way)


@kernel(types.void(STATES, STATES, MATRIX, types.float64, FLAGS, FLAGS))
def tell_broken(
    start: Floats, final: Floats, own: Floats, slack: float, broken: Bools, finite: Bools
) -> None:
    """Which trajectories (n, 4) end with an energy that they cannot have, and whose starts are finite.

    ``own`` are the :func:`fastmech.kernels.passes.columns` of their coefficients. A bound may be missed by
    the share ``slack`` of :func:`energy_scale`.
    """
    Y, p = np.empty((ROWS, 2 * LANES)), np.empty((own.shape[0], LANES))
    told = np.empty((2, LANES))
    for first in range(0, start.shape[0], LANES):
        load(start, first, Y, 0)
        load(final, first, Y, LANES)
        fill_trigonometry(Y)
        load_own(own, first, p)
        for i in range(LANES):
            T, u = lane_energy(Y, i, p, i)
            T_after, u_after = lane_energy(Y, LANES + i, p, i)
            before, after = T + u, T_after + u_after
            gain, fall = lane_work(Y, p, i)
            scale = energy_scale(T, p[2, i], p[3, i], p[4, i], p[5, i])
            # An energy beyond a double's range is none that a motion can have.
            wrong = (after - after != 0.0) | (after - before - gain > slack * scale)
            wrong |= (p[6, i] == 0.0) & (before - after - fall > slack * scale)
            told[0, i] = 1.0 if wrong else 0.0
            told[1, i] = (Y[0, i] - Y[0, i]) + (Y[1, i] - Y[1, i]) + (Y[2, i] - Y[2, i]) + (Y[3, i] - Y[3, i])
        for i in range(min(LANES, start.shape[0] - first)):
            broken[first + i] = told[0, i] != 0.0
            finite[first + i] = told[1, i] == 0.0
