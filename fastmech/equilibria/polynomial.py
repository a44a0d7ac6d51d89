"""The polynomial of degree 6 among whose roots on the unit circle lie exp(i phi) of all equilibria.

With z = exp(i phi) the conditions of rest
a cos phi + f sin phi = b sin theta + f cos theta = C cos(phi + theta) become, theta eliminated (f is the
force's coefficient, a, b, C those of lift, gravity and spring),

    C^2 z [(f + ib) z^2 - (f - ib)]^2 + [(a - if) z^2 + (a + if)]^2 [(f - ib) - C z] [(f + ib) z - C] = 0.

Two equilibria that share phi make a double root; if C^2 = b^2 + f^2 the double root z = (f - ib)/C need not
belong to any equilibrium; the degree drops when C = 0, a = f = 0 or f = b = 0. Hence the roots are not
counted blindly: each is taken back to the equilibria.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

#: How far a double root may lie from its place in |z|: the square root of rounding, and some.
NEAR = 1e-5


@dataclass(frozen=True)
class UnitRoots:
    """Roots on the unit circle and how they relate to a list of equilibria."""

    angles: NDArray[np.float64]  #: arguments of the unit roots [rad]
    unexplained: int  #: unit roots at which no listed equilibrium has its phi
    unmatched: int  #: listed equilibria whose phi is at no unit root

    @property
    def agrees(self) -> bool:
        """Whether roots and equilibria explain each other."""
        return self.unexplained == 0 and self.unmatched == 0


def rest_polynomial(lift: float, spring: float, gravity: float, force: float) -> Any:
    """The polynomial in z = exp(i phi), coefficients over their largest."""
    a, C, b, f = lift, spring, gravity, force
    z: Any = Polynomial([0.0, 1.0])
    lever = (f + 1j * b) * z**2 - (f - 1j * b)
    pull = (a - 1j * f) * z**2 + (a + 1j * f)
    eliminated = C**2 * z * lever**2 + pull**2 * ((f - 1j * b) - C * z) * ((f + 1j * b) * z - C)
    largest = np.max(np.abs(eliminated.coef))
    return eliminated / largest if largest > 0 else eliminated


def unit_roots(
    lift: float, spring: float, gravity: float, force: float, phi: NDArray[np.float64]
) -> UnitRoots:
    """Unit roots of the polynomial against the angles ``phi`` of the equilibria found."""
    polynomial = rest_polynomial(lift, spring, gravity, force).trim(1e-15)
    roots = polynomial.roots() if polynomial.degree() > 0 else np.zeros(0)
    angles = np.angle(roots[np.abs(np.abs(roots) - 1.0) < NEAR])
    apart = np.abs(np.exp(1j * angles)[:, None] - np.exp(1j * phi)[None, :])
    matched = apart < 10 * NEAR
    explained = matched.any(axis=1)
    if spring > 0 and abs(spring**2 - gravity**2 - force**2) <= NEAR * spring**2:
        trap = (force - 1j * gravity) / spring
        explained |= np.abs(np.exp(1j * angles) - trap) < 10 * NEAR
    return UnitRoots(angles, int((~explained).sum()), int((~matched.any(axis=0)).sum()))
