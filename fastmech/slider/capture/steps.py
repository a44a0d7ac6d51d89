"""Steps for basin maps: bounded by the scene's frequencies and by how fast a start can ever move."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fastmech.arrays import Floats
from fastmech.capture.certificate import MOST_OCTAVES, PHASE, TURNING
from fastmech.disturbance.motion import default_method
from fastmech.scene import Scene
from fastmech.slider.coefficients import Coefficients, reduce
from fastmech.slider.motion import SceneMotion
from fastmech.slider.reduced import metric_11, metric_determinant, potential_hessian, slider_ratio

#: Least share of a start's coarse step that measuring takes by default: that of the finest labels.
FINEST = 0.05

#: A force whose decay rate is so many times the scene's highest frequency is gone at once: while it acts, it
#: falls by ``exp(-FALL)`` in the coarsest step.
AT_ONCE, FALL = 4.0, 0.5

#: Share of the scene's own coarse step that must be stable: shorter explicit steps cost more than implicit.
EXPLICIT = 0.2

#: Points along a turn at which the scene's frequencies are looked up.
GRID = 48


def method_for(scene: Scene, name: str | None) -> str:
    """The method of this name; by default ``dop853``, or ``radau5`` where the damper would set its steps."""
    return name or default_method(scene, EXPLICIT * PHASE / highest_frequency(reduce(scene)))


@lru_cache(4096)
def highest_frequency(c: Coefficients) -> float:
    """Largest sqrt|eigenvalue| of Hessian and metric over the torus [rad/s], on a grid."""
    angles = np.linspace(-np.pi, np.pi, GRID, endpoint=False)
    phi, theta = np.meshgrid(angles, angles)
    s1, c1, s12 = np.sin(phi), np.cos(phi), np.sin(phi + theta)
    push = abs(c.force)
    trig = s1, c1, np.sin(theta), np.cos(theta)
    h11, h12, h22 = potential_hessian(trig, s12, (c.lift, c.spring, c.gravity), push)
    k, _ = slider_ratio(s1, c1)
    a11 = metric_11(c.mass, c.slider, k)
    determinant = metric_determinant(c.mass, c.slider, k, np.cos(phi + theta))
    # Roots of det(H - x a) = 0 with a = [[a11, s12], [s12, 1]].
    middle = 0.5 * (h11 + h22 * a11 - 2.0 * h12 * s12) / determinant
    product = (h11 * h22 - h12 * h12) / determinant
    largest = np.abs(middle) + np.sqrt(np.maximum(middle * middle - product, 0.0))
    return float(np.sqrt(largest.max()))


def fastest_rate(c: Coefficients, starts: Floats) -> Floats:
    """Bound on the angular rates [rad/s] that the energy of each start (n, 4) allows, shape (n,).

    The metric's smaller eigenvalue is at least its determinant over its trace. A force, decaying or not, can
    add at most what it does from one end of its reach to the other, and one that decays at most its impulse
    F0/alpha, to no less mass than m2.
    """
    angles = np.linspace(-np.pi, np.pi, 8 * GRID)
    k, _ = slider_ratio(np.sin(angles), np.cos(angles))
    smaller = metric_determinant(c.mass, c.slider, k, 0.0) / (metric_11(c.mass, c.slider, k) + 1.0)
    lowest = -(abs(c.lift) + c.gravity + c.spring)
    with np.errstate(invalid="ignore", over="ignore"):
        total = SceneMotion(c._replace(force=0.0)).energies(starts)[0]
        room, push = np.maximum(total - lowest, 0.0), abs(c.force)
        speed = np.sqrt(2.0 * (room + 4.0 * push))
        if c.decay > 0.0:
            speed = np.minimum(speed, np.sqrt(2.0 * room) + push / c.decay)
        return np.asarray(speed / np.sqrt(float(smaller.min())))


def gone_at_once(c: Coefficients) -> bool:
    """Whether a force decays before the mechanism has moved on its own."""
    return c.force != 0.0 and c.decay > AT_ONCE * highest_frequency(c._replace(force=0.0))


def fastest_followed(c: Coefficients) -> float:
    """Largest turning [rad/s] for which the shortest of the steps by default is short enough."""
    return TURNING / shortest_step(c)


def shortest_step(c: Coefficients) -> float:
    """Shortest of the coarse steps by default [s].

    A motion that fails with a longer one is followed again with a 16th of its step, and so on: where the
    metric is nearly singular (a light M1, crank and rod in line), some motions need it for an instant.
    """
    return 0.5**MOST_OCTAVES * PHASE / highest_frequency(c)


def coarse_steps(c: Coefficients, starts: Floats) -> Floats:
    """Coarse step [s] of each start, shape (n,): the scene's own, halved until it is small enough.

    Steps come in octaves, so that starts of about the same speed run together; a start's step depends on
    nothing but the start and the scene. Where the force is gone at once, they are those for the time after.
    """
    slow = highest_frequency(c._replace(force=0.0) if gone_at_once(c) else c)
    with np.errstate(invalid="ignore", divide="ignore"):
        octaves = np.ceil(np.log2(fastest_rate(c, starts) * PHASE / (TURNING * slow)) - 1e-9)
    return np.asarray(PHASE / slow * 0.5 ** np.clip(np.nan_to_num(octaves), 0.0, MOST_OCTAVES))
