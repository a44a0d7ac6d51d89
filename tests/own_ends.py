"""Where starts of a scene end: integration in pieces until the energy is below the well's lowest way out.

The well is the one that the steepest way down from the position leads to: going down never leaves a component
of {U < energy}, so this is a proof as long as the way down is followed closely. Plain NumPy, slow, for tests.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import fastmech as fm
from fastmech.slider.lagrange import (
    kinetic_energy,
    potential_energy,
    potential_gradient,
    potential_hessian,
)

TURN = 2.0 * np.pi


@cache
def depths(scene: fm.Scene) -> NDArray[np.float64]:
    """Depth [J] of every equilibrium's well in the order of ``find_equilibria``; NaN: no minimum."""
    found = fm.map_equilibria(scene, {"F0": [scene.F0]}, wells=True)
    return found.depth[0, : len(fm.find_equilibria(scene))]


@cache
def equilibria_of(scene: fm.Scene) -> Any:
    """``find_equilibria``, once a scene."""
    return fm.find_equilibria(scene)


def go_down(scene: fm.Scene, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bottoms (n, 2) of the ways down from positions q (n, 2), in steps of 0.05 rad at most."""
    q, on = q.copy(), np.arange(len(q))
    for _ in range(600):
        g = potential_gradient(scene, q[on], scene.F0)
        h = potential_hessian(scene, q[on], scene.F0)
        low = 0.5 * (h[:, 0, 0] + h[:, 1, 1]) - np.hypot(0.5 * (h[:, 0, 0] - h[:, 1, 1]), h[:, 0, 1])
        more = np.maximum(-low, 0.0) + np.hypot(*g.T) / 0.05 + 1e-12
        a, b, d = h[:, 0, 0] + more, h[:, 0, 1], h[:, 1, 1] + more
        step = np.stack([b * g[:, 1] - d * g[:, 0], b * g[:, 0] - a * g[:, 1]], axis=1)
        step /= (a * d - b * b)[:, None]
        q[on] += step
        on = on[np.abs(step).max(axis=1) > 1e-6]
        if not on.size:
            break
    return q


def ends(
    scene: fm.Scene, starts: NDArray[np.float64], t_end: float, dt: float = 0.05, piece: float = 2.0
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Label (n,): index in ``find_equilibria``, -1: not captured by t_end; turns (n, 2); time (n,) [s]."""
    equilibria, depth = equilibria_of(scene), depths(scene)
    minima = [i for i, e in enumerate(equilibria) if e.kind == "minimum"]
    places = np.array([[equilibria[i].phi, equilibria[i].theta] for i in minima])
    barrier = np.array([equilibria[i].energy + depth[i] for i in minima])
    label = np.full(len(starts), -1)
    turns, time = np.zeros((len(starts), 2), dtype=np.int64), np.full(len(starts), np.nan)
    y, members, t = np.array(starts, dtype=np.float64), np.arange(len(starts)), 0.0
    while members.size:
        energy = kinetic_energy(scene, y) + potential_energy(scene, y[:, :2], scene.F0)
        low = np.flatnonzero(energy < barrier.max() - 1e-6)
        bottom = go_down(scene, y[low, :2]) if low.size else np.zeros((0, 2))
        away = bottom[:, None] - places
        made = np.round(away / TURN)
        which = np.linalg.norm(away - TURN * made, axis=2).argmin(axis=1)
        sure = energy[low] < barrier[which] - 1e-6
        done = low[sure]
        label[members[done]] = np.array(minima)[which[sure]]
        turns[members[done]] = made[np.flatnonzero(sure), which[sure]]
        time[members[done]] = t
        on = np.setdiff1d(np.arange(members.size), done)
        members, y = members[on], y[on]
        if t >= t_end or not members.size:
            break
        y, t = fm.integrate(scene, y, piece, dt, "dop853").y[-1], t + piece
    return label, turns, time
