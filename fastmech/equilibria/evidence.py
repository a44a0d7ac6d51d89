"""Two searches beside the proof: neither knows the counting theorem, so either could contradict it."""

from __future__ import annotations

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
    """What a grid of Newton starts and the polynomial of degree 6 say of a list of equilibria.

    A grid may miss an equilibrium, it must not find another. Neither decides: the outcome is the proof's.
    """

    reached: int  #: listed equilibria that a start of the grid ran into
    unlisted: int  #: equilibria, proved to exist, that the grid search found and the list lacks
    polynomial: UnitRoots

    @property
    def sentence(self) -> str:
        """The evidence in words."""
        return (
            f"Newton from {STARTS} x {STARTS} starts reached {self.reached} of them and "
            f"{self.unlisted or 'no'} others; {self.polynomial.angles.size} roots of the degree-6 polynomial "
            f"are on the unit circle, {self.polynomial.unexplained or 'none'} of them unexplained"
        )


def gather(coefficients: Coefficients, phi: Floats, theta: Floats, radius: Floats) -> Evidence:
    """Search beside the proof; ``phi``, ``theta``, ``radius`` [rad] are the listed equilibria.

    Where U is nearly flat Newton's method stops far from a root. What it found is another equilibrium only if
    it is proved to exist in a ball that meets none of theirs.
    """
    c = coefficients
    p = pulls(c.mass, c.lift, c.spring, c.gravity, c.force)
    found = grid_search(p.lift, p.spring, p.gravity, p.force)
    apart = np.hypot(
        2.0 * np.sin(0.5 * (found[:, :1] - phi[None, :])), 2.0 * np.sin(0.5 * (found[:, 1:] - theta[None, :]))
    )
    near = apart < NEAR
    listed = np.where(np.isfinite(radius), radius, 0.0)
    reach = np.array([existence_radius(p, *root)[0] for root in found])
    others = np.isfinite(reach) & ~near.any(axis=1) & (apart > reach[:, None] + listed).all(axis=1)
    return Evidence(
        reached=int(near.any(axis=0).sum()),
        unlisted=int(others.sum()),
        polynomial=unit_roots(p.lift, p.spring, p.gravity, p.force, phi),
    )
