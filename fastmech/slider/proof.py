"""The completeness proof: each equilibrium by Newton-Kantorovich, their number by the counting theorem.

The statement that is proved is about the scene's parameters as the doubles that they are: the rounding
of the reduced coefficients and of every evaluation is inside the bounds.
"""

from __future__ import annotations

import numpy as np

from fastmech.arrays import Floats
from fastmech.jit import inlined
from fastmech.outcome import Outcome
from fastmech.slider.theorem import EPS, Normal, Pulls, expected_count, gradient, hessian, wrap

COMPLETE = int(Outcome.COMPLETE)
AT_FOLD = int(Outcome.AT_FOLD)
UNPROVED = int(Outcome.UNPROVED)

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
