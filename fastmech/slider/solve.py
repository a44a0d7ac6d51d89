"""One compiled call from reduced coefficients to certified equilibria, for many scenes in a row.

The completeness proof: each equilibrium by Newton-Kantorovich, their number by the counting theorem. The
statement that is proved is about the scene's parameters as the doubles that they are: the rounding of the
reduced coefficients and of every evaluation is inside the bounds.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import boolean, types
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.jit import MATRIX, STATUSES, VECTOR, inlined, interpreted, kernel, named_tuple
from fastmech.outcome import Outcome
from fastmech.slider.reduced import potential
from fastmech.slider.theorem import (
    EPS,
    LAPS,
    MOST,
    Normal,
    Pulls,
    candidates,
    expected_count,
    gradient,
    hessian,
    normal_form,
    polish,
    pulls,
    vanishing,
    wrap,
)

COMPLETE = int(Outcome.COMPLETE)
AT_FOLD = int(Outcome.AT_FOLD)
UNPROVED = int(Outcome.UNPROVED)
DEGENERATE = int(Outcome.DEGENERATE)

#: Roundings in one evaluated pull or stiffness, each at most EPS/2 of its amplitude: sine, cosine, the sum of
#: angles, products and sums stay below eight.
EVALUATION = 8.0 * EPS

#: A residual is "at rounding level" below this many evaluation bounds: the last Newton step's own rounding.
RESIDUAL = 16.0

#: Residuals are this part of the evaluation's bounds, at most, as a rule.
LEFT = 0.5

#: Beyond a fold that is within rounding a lap's end balances up to the margin's error, in each of the pulls.
BEYOND = 4.0


@inlined
def pull_errors(p: Pulls) -> tuple[float, float, float]:
    """Bounds on the error of each of the three pulls (and of its derivative), over the scale."""
    return (
        p.error_phi + EVALUATION * p.amplitude_phi,
        p.error_theta + EVALUATION * p.amplitude_theta,
        p.error_psi + EVALUATION * p.amplitude_psi,
    )


@inlined
def existence_radius(p: Pulls, phi: float, theta: float) -> tuple[float, int, bool]:
    """Proof that exactly one equilibrium lies within a radius [rad] of (phi, theta).

    Newton-Kantorovich in its affine-invariant form. H = -sum_k e_k v_k v_k^T with e_k = Ak sin yk and the
    directions v = (1, 0), (0, 1), (1, 1), so |H^-1 (H(x) - H(y))| <= w |x - y| with the constant
    w = sum_k Ak |H^-1 v_k| |v_k|^2. If the step h = |H^-1 grad| has w h <= 1/2, a root exists within
    2 h/(1 + sqrt(1 - 2 w h)) and is the only one near. A stiff spring enlarges Ak and shrinks H^-1 v_k alike,
    so it costs nothing.

    Returns:
        The radius (infinite: nothing proved), the sign of det H (0: not certain), and whether the gradient is
        zero to rounding level, so that a missing proof is due to a singular Hessian.
    """
    d1, d2, d3 = pull_errors(p)
    g1, g2 = gradient(p, phi, theta)
    small = abs(g1) + abs(g2) <= RESIDUAL * (d1 + d2 + 2.0 * d3)
    h11, h12, h22 = hessian(p, phi, theta)
    k1, k2, k3 = h11 - h12, h22 - h12, h12  # -e_k
    determinant = k1 * k2 + k1 * k3 + k2 * k3
    doubt = (
        (d1 + d3) * (abs(k2) + abs(k3) + d2)
        + (d2 + d3) * (abs(k1) + abs(k3) + d3)
        + (d1 + d2 + d3) * (abs(k1) + abs(k2) + d1)
        + EVALUATION * (abs(k1 * k2) + abs(k1 * k3) + abs(k2 * k3))
    )
    least = abs(determinant) - doubt
    if not least > 0.0:
        return np.inf, 0, small
    n1 = (np.hypot(k2 + k3, k3) + d2 + 2.0 * d3) / least
    n2 = (np.hypot(k1 + k3, k3) + d1 + 2.0 * d3) / least
    n3 = (np.hypot(k1, k2) + d1 + d2) / least
    errors = d1 * n1 + d2 * n2 + d3 * n3
    step = abs(g1) * n1 + abs(g2) * n2 + errors
    w = p.amplitude_phi * n1 + p.amplitude_theta * n2 + 2.0 * p.amplitude_psi * n3
    if not 2.0 * w * step <= 1.0:
        return np.inf, 0, small
    # What Newton's last step leaves is chance: residuals within rounding have one radius, so that verdicts
    # at the edge of rounding do not depend on where the search began.
    usual = max(abs(g1), LEFT * (d1 + d3)) * n1 + max(abs(g2), LEFT * (d2 + d3)) * n2 + errors
    if 2.0 * w * usual <= 1.0:
        step = usual
    return 2.0 * step / (1.0 + np.sqrt(1.0 - 2.0 * w * step)), 1 if determinant > 0.0 else -1, small


@inlined
def unbalance(p: Pulls, phi: float, theta: float) -> float:
    """Sum of the gradient's entries, over the largest amplitude."""
    g1, g2 = gradient(p, phi, theta)
    size: float = abs(g1) + abs(g2)
    return size


@inlined
def apart(phi1: float, theta1: float, phi2: float, theta2: float) -> float:
    """Distance on the torus [rad]."""
    distance: float = np.hypot(wrap(phi1 - phi2), wrap(theta1 - theta2))
    return distance


@inlined
def certify(p: Pulls, n: Normal, count: int, phi: Floats, theta: Floats, radius: Floats) -> int:
    """Outcome for a list of ``count`` equilibria; writes the existence radius [rad] of each into ``radius``.

    COMPLETE needs all three: every entry proved, the balls disjoint (so all are different), and as many as
    the counting theorem says, where six is enough even if rounding hides the theorem's margin. The
    counting law minima - saddles + maxima = 0 is checked too. The list may come from anywhere: with an
    entry missing, false or twice it does not pass.

    AT_FOLD needs that every entry which is not proved balances to rounding; where rounding hides which side
    of the fold the scene is on, to what rounding may have moved the fold by: it is then either an
    equilibrium or where two would appear.
    """
    proved, law, explained = 0, 0, True
    hidden = expected_count(n) == 0
    for i in range(count):
        radius[i], sign, small = existence_radius(p, phi[i], theta[i])
        law += sign
        if radius[i] < np.inf:
            proved += 1
        elif not small:
            explained = explained and hidden and unbalance(p, phi[i], theta[i]) <= BEYOND * n.error
    for i in range(count):
        for j in range(i):
            reach = radius[i] + radius[j]
            if reach < np.inf and apart(phi[i], theta[i], phi[j], theta[j]) <= reach:
                return UNPROVED
    if proved == count and law == 0 and (count == 6 or count == expected_count(n)):
        return COMPLETE
    if proved < count and explained:
        return AT_FOLD
    return UNPROVED


SmallIntegers = NDArray[np.int8]

#: Morse index of an empty slot, and of an equilibrium whose Hessian is singular within rounding.
NO_EQUILIBRIUM = -1
SINGULAR = -2

#: At a cusp three equilibria merge; rounding displaces them by about EPS^(1/3) rad times a condition number.
MERGE = 16.0 * EPS ** (1.0 / 3.0)

#: Energies over the scale that differ by no more are equal within rounding.
EVEN = 32.0 * EPS

INDICES = types.Array(types.int8, 2, "C")


class Roots(NamedTuple):
    """What :func:`solve` writes for n scenes; slots without an equilibrium hold NaN."""

    phi: Floats  #: (n, 6) [rad] in (-pi, pi]
    theta: Floats  #: the same
    energy: Floats  #: (n, 6) U over m2 l^2 less the springs' constant [1/s^2]
    radius: Floats  #: (n, 6) distance [rad] within which the true equilibrium is; infinite: not proved
    index: SmallIntegers  # type: ignore[assignment]  #: (n, 6) Morse index, ``SINGULAR`` or ``NO_EQUILIBRIUM``
    count: SmallIntegers  # type: ignore[assignment]  #: (n,) number found
    expected: SmallIntegers  #: (n,) number by the counting theorem, 0 where rounding hides it
    outcome: SmallIntegers  #: (n,) ``Outcome``
    margin: Floats  #: (n,) distance to the fold [rad], positive with six equilibria; NaN if undefined


SOLUTION: Any = named_tuple([*[MATRIX] * 4, INDICES, *[STATUSES] * 3, VECTOR], Roots)


@inlined
def merge_singular(p: Pulls, error: float, count: int, phi: Floats, theta: Floats, radius: Floats) -> int:
    """Of unproved entries that are the same one, displaced by rounding, keep the one that balances best.

    The margin to the fold is uncertain by ``error`` rad, a position at a cusp by the cube root of that.
    """
    reach = max(MERGE, 4.0 * np.cbrt(error))
    kept = 0
    for i in range(count):
        again = False
        for j in range(kept):
            unproved = np.isinf(radius[i]) and np.isinf(radius[j])
            if unproved and apart(phi[i], theta[i], phi[j], theta[j]) < reach:
                again = True
                if unbalance(p, phi[i], theta[i]) < unbalance(p, phi[j], theta[j]):
                    phi[j], theta[j] = phi[i], theta[i]
        if not again:
            phi[kept], theta[kept], radius[kept] = phi[i], theta[i], radius[i]
            kept += 1
    return kept


@inlined
def energy_at(p: Pulls, phi: float, theta: float) -> float:
    """U over m2 l^2 and the scale, less the springs' constant (paper (10))."""
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    energy: float = potential((s1, c1, s2, c2), s1 * c2 + c1 * s2, (p.lift, p.spring, p.gravity), p.force)
    return energy


@inlined
def morse_index(p: Pulls, phi: float, theta: float, radius: float) -> int:
    """Number of negative eigenvalues of the Hessian: proved where the equilibrium is, else ``SINGULAR``."""
    if np.isinf(radius):
        return SINGULAR
    h11, h12, h22 = hessian(p, phi, theta)
    if h11 * h22 - h12 * h12 < 0.0:
        return 1
    return 0 if h11 + h22 > 0.0 else 2


@inlined
def is_before(energy: Floats, phi: Floats, theta: Floats, i: int, j: int) -> bool:
    """Whether entry i is listed before j: the deeper one; of mirror images the one with the smaller theta."""
    if abs(energy[i] - energy[j]) > EVEN:
        return bool(energy[i] < energy[j])
    if abs(wrap(theta[i] - theta[j])) > MERGE:
        return bool(theta[i] < theta[j])
    return bool(phi[i] < phi[j])


@inlined
def sort_by_energy(count: int, energy: Floats, phi: Floats, theta: Floats, radius: Floats) -> None:
    """Deepest first; where a scene is its own mirror image rounding does not decide."""
    for i in range(1, count):
        for j in range(i, 0, -1):
            if not is_before(energy, phi, theta, j, j - 1):
                break
            energy[j], energy[j - 1] = energy[j - 1], energy[j]
            phi[j], phi[j - 1] = phi[j - 1], phi[j]
            theta[j], theta[j - 1] = theta[j - 1], theta[j]
            radius[j], radius[j - 1] = radius[j - 1], radius[j]


@kernel(types.void(MATRIX, boolean, SOLUTION))
def solve(coefficients: Floats, inherit: bool, out: Roots) -> None:
    """Equilibria of every row of ``coefficients``, deepest first, with the outcome of the proof.

    Args:
        coefficients: (n, 8) rows of ``fastmech.slider.coefficients.Coefficients``, the force frozen.
        inherit: whether a row first tries Newton's method from the row before; what that gives counts only
            if its completeness is proved, else the row is searched afresh.
        out: written.
    """
    phi, theta, energy, radius, index = out.phi, out.theta, out.energy, out.radius, out.index
    count, expected, outcome, margin = out.count, out.expected, out.outcome, out.margin
    at_phi, at_theta, at_radius = np.empty(LAPS), np.empty(LAPS), np.empty(LAPS)
    for row in range(coefficients.shape[0]):
        for i in range(MOST):
            phi[row, i], theta[row, i], energy[row, i], radius[row, i] = np.nan, np.nan, np.nan, np.nan
            index[row, i] = NO_EQUILIBRIUM
        count[row], expected[row], outcome[row], margin[row] = 0, 0, UNPROVED, np.nan
        mass, lift, spring = coefficients[row, 0], coefficients[row, 2], coefficients[row, 3]
        gravity, force = coefficients[row, 4], coefficients[row, 5]
        p = pulls(mass, lift, spring, gravity, force)
        if not np.isfinite(lift + spring + gravity + force):
            continue
        if vanishing(p) >= 2:
            outcome[row] = DEGENERATE
            continue
        n = normal_form(p)
        expected[row] = expected_count(n)
        margin[row] = n.peak - n.distance
        found = 0
        if inherit and row > 0 and outcome[row - 1] == COMPLETE and count[row - 1] == expected[row]:
            found = int(count[row - 1])
            for i in range(found):
                at_phi[i], at_theta[i] = polish(p, phi[row - 1, i], theta[row - 1, i])
            outcome[row] = certify(p, n, found, at_phi, at_theta, radius=at_radius)
        if found == 0 or outcome[row] != COMPLETE:
            found = candidates(p, n, at_phi, at_theta)
            outcome[row] = certify(p, n, found, at_phi, at_theta, radius=at_radius)
        if outcome[row] == AT_FOLD:
            found = min(MOST, merge_singular(p, n.error, found, at_phi, at_theta, radius=at_radius))
        scale = max(np.hypot(lift, force), np.hypot(gravity, force), spring)
        for i in range(found):
            phi[row, i], theta[row, i], radius[row, i] = at_phi[i], at_theta[i], at_radius[i]
            energy[row, i] = energy_at(p, at_phi[i], at_theta[i])
        sort_by_energy(found, energy[row], phi[row], theta[row], radius[row])
        for i in range(found):
            energy[row, i] *= scale
            index[row, i] = morse_index(p, phi[row, i], theta[row, i], radius[row, i])
        count[row] = found


def solve_rows(coefficients: Floats, compiled: bool = True) -> Roots:
    """Equilibria of n scenes from their (n, 8) reduced coefficients, contiguous, the force frozen.

    Without ``compiled`` plain Python does the same, up to rounding: in milliseconds a scene, with nothing to
    compile.
    """
    n, code = len(coefficients), np.int8
    places = [np.empty((n, MOST)) for _ in range(4)]
    made: Any = [*places, np.empty((n, MOST), code), *(np.empty(n, code) for _ in range(3)), np.empty(n)]
    result = Roots(*made)
    with np.errstate(all="ignore"):
        (solve if compiled else interpreted(solve))(coefficients, False, result)
    return result


def explain(outcome: Outcome, count: int, expected: int, margin: float) -> str:
    """One sentence for a certificate; a degenerate scene's is made from its parameters instead."""
    if outcome is Outcome.COMPLETE:
        return f"all {count} are proved to exist and to be all"
    if outcome is Outcome.AT_FOLD:
        there = f"{expected} exist" if expected else "how many exist is hidden"
        return f"at a fold within rounding: {there}, {count} are told apart, the merging ones as degenerate"
    if np.isnan(margin):
        return "not proved: the reduced coefficients are not finite"
    return f"not proved: {count} equilibria listed, {expected or 'four to six'} must exist"
