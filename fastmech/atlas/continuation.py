"""Pseudo-arclength continuation of a curve F(z) = 0, F: R^(n+1) -> R^n, with Newton's method.

Keller's method (1977): a step along the tangent, then Newton's method on F together with the plane through
the predicted point that is normal to the tangent; so turning points in any coordinate are passed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fastmech.arrays import Floats

#: Gives values F(z) and Jacobian.
Equations = Callable[[Floats], tuple[Floats, Floats]]

#: Longest and shortest step along a curve, in radians and in parts of the parameters' ranges.
LONGEST, SHORTEST = 0.02, 1e-8

#: Cosine of the largest turn of the tangent in one step.
TURN = 0.985

#: How a march along a curve ends.
CLOSED, LEFT, CUT_SHORT = "closed", "left the rectangle", "cut short"

#: Newton's method ends when a step is this short.
SETTLED = 1e-14

#: How near to a side that it touches, or to where else it ends, a curve's last point is.
TOUCHING = 1e-9

MOST_STEPS = 20_000

#: Singular values below this part of the largest one are zero within rounding.
RANK = 1e-9


@dataclass(frozen=True)
class Curve:
    """Points along a solution curve, in order."""

    points: Floats  #: (points, n + 1)
    closed: bool  #: the last point is the first one again
    finished: bool = True  #: False: cut short at ``MOST_STEPS``, or where the curve could not be followed


def regular(system: Equations, z: Floats) -> bool:
    """Whether the solutions near z are one curve: the Jacobian has full rank beyond rounding."""
    sizes = np.linalg.svd(system(z)[1], compute_uv=False)
    return bool(sizes[-1] > RANK * sizes[0])


def newton(
    system: Equations, z: Floats, reach: float, normal: Floats | None = None, *, left: float = 1e-11
) -> Floats | None:
    """Solution near z: the nearest one, or the one in the plane through z with this normal.

    A system of as many equations as unknowns is solved as it is.

    Returns:
        None if Newton's method leaves the distance ``reach`` or does not settle: rounding may leave its last
        step longer, but not as long as ``left``.
    """
    start = z
    for _ in range(12):
        try:
            value, jacobian = system(z)
            if normal is not None:
                rows = np.vstack([jacobian, normal])
                step = np.linalg.solve(rows, -np.append(value, normal @ (z - start)))
            elif jacobian.shape[0] == jacobian.shape[1]:
                step = np.linalg.solve(jacobian, -value)
            else:
                step = -np.linalg.pinv(jacobian) @ value
        except np.linalg.LinAlgError:  # singular, or not defined there
            return None
        z = z + step
        size = float(np.linalg.norm(step))
        if not np.linalg.norm(z - start) < reach:
            return None
        if size < SETTLED * (1.0 + float(np.linalg.norm(z))) * 4.0:
            return z
    return z if size < left else None


def tangent_at(system: Equations, z: Floats) -> Floats:
    """Unit tangent of the curve, of either direction."""
    tangent: Floats = np.linalg.svd(system(z)[1])[2][-1]
    return tangent


def trace(
    system: Equations,
    start: Floats,
    inside: Callable[[Floats], bool],
    finish: Callable[[Floats, Floats], Floats],
    apart: Callable[[Floats, Floats], Floats],
) -> Curve:
    """The curve through ``start``, in both directions until it leaves ``inside`` or closes.

    Args:
        system: the curve's equations.
        start: a point on the curve.
        inside: where it is wanted.
        finish: given the last point inside and the first one outside, the curve's end between them.
        apart: difference of two points, angles counted the short way.
    """

    def march(t: Floats) -> tuple[list[Floats], str]:
        points, step = [start], 0.25 * LONGEST
        while step >= SHORTEST and len(points) < MOST_STEPS:
            z = points[-1]
            there = newton(system, z + step * t, 0.5 * step, t)
            ahead = t if there is None else tangent_at(system, there)
            if there is None or abs(ahead @ t) < TURN:
                step *= 0.5
                continue
            if len(points) > 4:
                gap = apart(start, z)
                along = float(gap @ t)
                if 0.0 < along <= 1.2 * step and np.linalg.norm(gap - along * t) < 0.3 * step:
                    return [*points, z + gap], CLOSED
            if not inside(there):
                end = finish(z, there)
                moved = np.linalg.norm(end - z) > 0.0
                return ([*points, end] if moved else points), LEFT
            points.append(there)
            t, step = ahead * np.sign(ahead @ t), min(LONGEST, 1.5 * step)
        return points, CUT_SHORT

    tangent = tangent_at(system, start)
    points, end = march(tangent)
    ends = [end]
    if end != CLOSED:
        back, end = march(-tangent)
        points = back[:0:-1] + points
        ends.append(end)
    return Curve(np.array(points), CLOSED in ends, CUT_SHORT not in ends)


def distance(curve: Floats, point: Floats, apart: Callable[[Floats, Floats], Floats]) -> tuple[float, int]:
    """Distance of a point from a polyline (points, n), and the number of the nearest segment."""
    here = apart(np.broadcast_to(point, curve.shape), curve)
    if len(curve) == 1:
        return float(np.linalg.norm(here[0])), 0
    along = np.diff(curve, axis=0)
    squared = np.einsum("ij,ij->i", along, along)
    share = np.clip(np.einsum("ij,ij->i", here[:-1], along) / np.maximum(squared, 1e-300), 0.0, 1.0)
    gaps = np.linalg.norm(here[:-1] - share[:, None] * along, axis=1)
    nearest = int(np.argmin(gaps))
    return float(gaps[nearest]), nearest


def inside(z: Floats) -> bool:
    """Within the rectangle of the two parameters."""
    return bool(((z[-2:] >= 0.0) & (z[-2:] <= 1.0)).all())


def finish_on_edge(
    equations: Equations, inside: Callable[[Floats], bool] = inside, near: float = TOUCHING
) -> Callable[[Floats, Floats], Floats]:
    """How a curve ends: on the side of the rectangle that it crosses, or so ``near`` to another end."""

    def finish(last: Floats, beyond: Floats) -> Floats:
        for k in (-2, -1):
            if 0.0 <= beyond[k] <= 1.0 or last[k] == beyond[k]:
                continue
            side = 0.0 if beyond[k] < 0.0 else 1.0
            guess = last + (beyond - last) * (side - last[k]) / (beyond[k] - last[k])
            normal = np.zeros(last.size)
            normal[k] = 1.0
            end = newton(equations, guess, 0.5 * LONGEST, normal)
            if end is not None and inside(np.where(np.arange(last.size) == last.size + k, side, end)):
                end[k] = side
                return end
        while np.linalg.norm(beyond - last) > near:
            middle = newton(equations, 0.5 * (last + beyond), LONGEST)
            if middle is None or np.linalg.norm(middle - last) > 0.9 * np.linalg.norm(beyond - last):
                break
            last, beyond = (middle, beyond) if inside(middle) else (last, middle)
        return last

    return finish
