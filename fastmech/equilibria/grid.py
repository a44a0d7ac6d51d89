"""A grid of starts and Newton's method with a line search: the search that assumes nothing of the scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.equilibria.balance import EPS
from fastmech.mechanism.reduced import potential_gradient, potential_hessian

Floats = NDArray[np.float64]

#: Starts along each angle. The proof does not rest on it: what a grid misses is found to be missing.
STARTS = 16

#: Two results nearer than this [rad] are one equilibrium.
MERGE = 1e-6

_MOST_STEPS = 60
_ARMIJO = 1e-4
_HALVED = 0.5 ** np.arange(53)[:, None]


def grid_search(lift: float, spring: float, gravity: float, force: float, starts: int = STARTS) -> Floats:
    """Equilibria that Newton's method reaches from a grid of ``starts`` x ``starts``, (count, 2) [rad].

    Angles are in (-pi, pi], duplicates on the torus merged. All starts go on together, as arrays: one
    scene is searched long before a kernel would be compiled.
    """
    angles = -np.pi + 2.0 * np.pi * (np.arange(starts) + 0.5) / starts
    places = np.stack([np.repeat(angles, starts), np.tile(angles, starts)])
    roots = _wrapped(places[:, newton_with_line_search(lift, spring, gravity, force, places)])
    found = []
    while roots.size:
        found.append(roots[:, 0])
        roots = roots[:, np.hypot(*_wrapped(roots - roots[:, :1])) >= MERGE]
    return np.array(found).reshape(-1, 2)


def newton_with_line_search(
    lift: float, spring: float, gravity: float, force: float, places: Floats
) -> NDArray[np.bool_]:
    """Take every place (2, n) to a root of the reduced gradient, in place; whether each reached one.

    The merit is half the gradient's square. A Newton step is halved until it satisfies Armijo's condition;
    where the Hessian is singular or its step does not descend, the merit's own gradient is followed
    (Nocedal, Wright, *Numerical Optimization*, section 11.2).
    """
    loads = (lift, spring, gravity, force)
    scale = max(map(abs, loads))
    reached = np.zeros(places.shape[1], dtype=np.bool_)
    under_way = np.arange(places.shape[1])
    for _ in range(_MOST_STEPS):
        x = places[:, under_way]
        s, c = np.sin(x), np.cos(x)
        g = _gradient(s, c, loads)
        done = np.abs(g).sum(axis=0) <= 8.0 * EPS * scale
        reached[under_way[done]] = True
        under_way, x, s, c, g = under_way[~done], x[:, ~done], s[:, ~done], c[:, ~done], g[:, ~done]
        if not under_way.size:
            break
        h11, h12, h22 = potential_hessian(*_each(s, c), s[0] * c[1] + c[0] * s[1], *loads)
        merit = 0.5 * (g * g).sum(axis=0)
        down = np.stack([h11 * g[0] + h12 * g[1], h12 * g[0] + h22 * g[1]])
        determinant = h11 * h22 - h12 * h12
        regular = np.abs(determinant) > EPS * scale * scale
        newton = np.stack([h12 * g[1] - h22 * g[0], h12 * g[0] - h11 * g[1]])
        step = np.where(regular, newton, -down) / np.where(regular, determinant, scale * scale)
        slope = (down * step).sum(axis=0)
        length = 1.0 / np.maximum(1.0, np.abs(step).sum(axis=0))
        waiting = np.arange(under_way.size)
        for halvings in (_HALVED[:1], _HALVED[1:4], _HALVED[4:]):
            tried = halvings * length[waiting]
            new = x[:, None, waiting] + tried * step[:, None, waiting]
            g = _gradient(np.sin(new), np.cos(new), loads)
            accepted = 0.5 * (g * g).sum(axis=0) <= merit[waiting] + _ARMIJO * tried * slope[waiting]
            first, found = accepted.argmax(axis=0), accepted.any(axis=0)
            places[:, under_way[waiting[found]]] = new[:, first[found], found]
            waiting = waiting[~found]
        # At rounding level no step descends any more; else the start fell into a dip that is no root.
        reached[under_way[waiting]] = merit[waiting] <= (256.0 * EPS * scale) ** 2
        under_way = np.delete(under_way, waiting)
    return reached


def _gradient(s: Floats, c: Floats, loads: tuple[float, float, float, float]) -> Floats:
    return np.stack(potential_gradient(*_each(s, c), c[0] * c[1] - s[0] * s[1], *loads))


def _each(s: Floats, c: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    return s[0], c[0], s[1], c[1]


def _wrapped(angles: Floats) -> Floats:
    turned: Floats = np.pi - np.remainder(np.pi - angles, 2.0 * np.pi)
    return turned
