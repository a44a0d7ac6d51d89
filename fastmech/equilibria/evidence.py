"""Two searches beside the proof: neither knows the counting theorem, so either could contradict it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastmech.equilibria.balance import pulls
from fastmech.equilibria.certificate import existence_radius
from fastmech.equilibria.grid import STARTS, grid_search
from fastmech.equilibria.polynomial import UnitRoots, unit_roots
from fastmech.mechanism.coefficients import Coefficients

Floats = NDArray[np.float64]

#: A grid root further than this [rad] from every listed equilibrium is one that the list lacks. Newton's
#: method stops this far from a nearly double root.
NEAR = 1e-4


@dataclass(frozen=True)
class Evidence:
    """What a grid of Newton starts and the polynomial of degree 6 say of a list of equilibria."""

    reached: int  #: listed equilibria that a start of the grid ran into
    unlisted: int  #: equilibria, proved to exist, that the grid search found and the list lacks
    polynomial: UnitRoots

    @property
    def contradicts(self) -> bool:
        """Whether the list is shown to lack something.

        A grid may miss an equilibrium, it must not find another. The polynomial's roots are not proved (in
        double precision double roots are uncertain by 1e-8), so they are reported and decide nothing.
        """
        return self.unlisted > 0

    @property
    def sentence(self) -> str:
        """The evidence in words."""
        return (
            f"Newton from {STARTS} x {STARTS} starts reached {self.reached} of them and "
            f"{self.unlisted or 'no'} others; {self.polynomial.angles.size} roots of the degree-6 polynomial "
            f"are on the unit circle, {self.polynomial.unexplained or 'none'} of them unexplained"
        )


def gather(coefficients: Coefficients, phi: Floats, theta: Floats) -> Evidence:
    """Search beside the proof; ``phi``, ``theta`` [rad] are the listed equilibria."""
    c = coefficients
    p = pulls(c.mass, c.lift, c.spring, c.gravity, c.force)
    found = grid_search(p.lift, p.spring, p.gravity, p.force)
    apart = np.hypot(
        2.0 * np.sin(0.5 * (found[:, :1] - phi[None, :])), 2.0 * np.sin(0.5 * (found[:, 1:] - theta[None, :]))
    )
    near = apart < NEAR
    # Beside a fold Newton's method may stop in a dip that is no root: only proved roots count.
    proved = [math.isfinite(existence_radius(p, *root)[0]) for root in found[~near.any(axis=1)]]
    return Evidence(
        reached=int(near.any(axis=0).sum()),
        unlisted=sum(proved),
        polynomial=unit_roots(p.lift, p.spring, p.gravity, p.force, phi),
    )
