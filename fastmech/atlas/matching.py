"""Which equilibrium of one scene continues which of another: by nearness where plain, else by tracking."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.equilibria.balance import EPS
from fastmech.equilibria.certificate import apart
from fastmech.jit import inlined
from fastmech.mechanism.reduced import potential_gradient, potential_hessian

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]

#: A partner is plain if the next candidate is this many times as far, and if both Hessians stay regular
#: (see ``trust``) that many times as far around.
PLAIN = 4.0

#: Tracking gives up below this part of the way between two scenes: a fold is in between.
SHORTEST = 1.0 / 16384.0

#: Longest Newton correction [rad] that still counts as following the same equilibrium.
LEAP = 0.05


@inlined
def newton_step(c: Floats, phi: float, theta: float) -> tuple[float, float, float]:
    """Newton step of the reduced gradient and the Hessian's determinant; ``c`` as ``Coefficients``."""
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    s12, c12 = s1 * c2 + c1 * s2, c1 * c2 - s1 * s2
    g1, g2 = potential_gradient(s1, c1, s2, c2, c12, c[2], c[3], c[4], c[5])
    h11, h12, h22 = potential_hessian(s1, c1, s2, c2, s12, c[2], c[3], c[4], c[5])
    determinant = h11 * h22 - h12 * h12
    return -(h22 * g1 - h12 * g2) / determinant, -(h11 * g2 - h12 * g1) / determinant, determinant


@inlined
def trust(c: Floats, phi: float, theta: float) -> float:
    """Distance [rad] within which the Hessian at an equilibrium cannot become singular.

    Each stiffness changes by at most its amplitude a radian, so the least eigenvalue outlives |det|/(|H| L),
    L the sum of the amplitudes. What has not moved this far has met no fold.
    """
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    h11, h12, h22 = potential_hessian(s1, c1, s2, c2, s1 * c2 + c1 * s2, c[2], c[3], c[4], c[5])
    size = abs(h11) + 2.0 * abs(h12) + abs(h22)
    change = np.hypot(c[2], c[5]) + np.hypot(c[4], c[5]) + 2.0 * c[3]
    distance: float = abs(h11 * h22 - h12 * h12) / (size * change)
    return distance


@inlined
def follow(
    start: Floats, end: Floats, between: Floats, phi: float, theta: float
) -> tuple[float, float, bool]:
    """Track an equilibrium from scene ``start`` to scene ``end``, coefficients changing linearly.

    Each stretch of the way is taken by Newton's method; it is halved where the first correction is long, the
    second not much shorter, or the determinant changes by more than a factor of two: a step across two folds
    would give itself away by one of these. ``between`` (8,) is for working in.

    Returns:
        Where it ends, and whether it got there.
    """
    at, stretch = 0.0, 1.0
    before = newton_step(start, phi, theta)[2]
    while at < 1.0:
        stretch = min(stretch, 1.0 - at)
        for k in range(between.shape[0]):
            between[k] = start[k] + (at + stretch) * (end[k] - start[k])
        x, y = phi, theta
        d1, d2, determinant = newton_step(between, x, y)
        first = np.hypot(d1, d2)
        x, y = x + d1, y + d2
        d1, d2, determinant = newton_step(between, x, y)
        second = np.hypot(d1, d2)
        x, y = x + d1, y + d2
        change = determinant / before
        if first < LEAP and second <= 0.1 * first + 8.0 * EPS and 0.5 < change < 2.0:
            phi, theta, at, before = x, y, at + stretch, determinant
            stretch = 2.0 * stretch
        else:
            stretch = 0.5 * stretch
            if stretch < SHORTEST:
                return phi, theta, False
    return phi, theta, True


@inlined
def nearest(
    phi: float, theta: float, index: int, phis: Floats, thetas: Floats, indices: Codes, count: int
) -> tuple[int, float, float]:
    """The nearest equilibrium of the same Morse index, its distance and that of the next [rad]."""
    best, first, second = -1, np.inf, np.inf
    for j in range(count):
        if indices[j] == index:
            distance = apart(phi, theta, phis[j], thetas[j])
            if distance < first:
                best, first, second = j, distance, first
            elif distance < second:
                second = distance
    return best, first, second


@inlined
def match(
    start: Floats,
    end: Floats,
    phi: Floats,
    theta: Floats,
    index: Codes,
    regular: Floats,
    count: int,
    phis: Floats,
    thetas: Floats,
    indices: Codes,
    regulars: Floats,
    counts: int,
    between: Floats,
    partner: Codes,
) -> int:
    """Write the slot in ``end`` that each equilibrium in ``start`` continues to into ``partner``, -1: none.

    ``regular`` and ``regulars`` are the distances by ``trust``.

    Returns:
        the number of pairs; no slot is given twice.
    """
    pairs = 0
    for i in range(count):
        partner[i] = -1
        if index[i] < 0:
            continue
        j, first, second = nearest(phi[i], theta[i], index[i], phis, thetas, indices, counts)
        if j < 0:
            continue
        steady = PLAIN * first < min(regular[i], regulars[j])
        if not (steady and first < LEAP and second > PLAIN * first):
            x, y, reached = follow(start, end, between, phi[i], theta[i])
            if not reached:
                continue
            j, first, second = nearest(x, y, index[i], phis, thetas, indices, counts)
            if first > LEAP:
                continue
        taken = False
        for k in range(i):
            if partner[k] == j:
                taken = True
                partner[k] = -1
                pairs -= 1
        if not taken:
            partner[i] = j
            pairs += 1
    return pairs
