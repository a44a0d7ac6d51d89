"""Which wells a saddle joins, proved by ways down from it.

Just below the energy E of a saddle with one falling direction, its surroundings have two parts, one on either
side (Morse). A way of straight pieces from a part to a minimum, on which U is proved to be less than E, shows
whose component of {U < E} the part belongs to. Any way does: this one takes Newton's steps downhill.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numba import types

from fastmech.arrays import Floats, Integers
from fastmech.capture.cells import bound_cells
from fastmech.intervals.arithmetic import add, mul
from fastmech.intervals.search import FORCES
from fastmech.jit import EXACT, MATRIX, VECTOR, kernel
from fastmech.models.mechanism import Mechanism

#: Steps of a way, and halvings of one until U falls along it and is proved less than E.
STEPS, HALVINGS = 200, 30

#: Halvings of a piece over which no bound is less than E.
CUTS = 10

#: Shares of the domain: the longest step, how near a minimum the way goes straight to it, differences that
#: tell slopes, and what boxes about pieces are larger, beyond the rounding of positions.
LONGEST, STRAIGHT, DIFFERENCE, ENLARGED = 0.05, 0.02, 1e-6, 1e-12

#: Curvatures below this share of the slope are taken for that: steps would be longer than the longest anyway.
FLAT = 1e-9


class WayEnd(NamedTuple):
    """Where a way down ends."""

    well: int  #: which equilibrium; -1: an end of a range
    turns: tuple[int, ...]  #: from the equilibrium's place


@kernel(types.boolean(FORCES, MATRIX, MATRIX, VECTOR), **EXACT)
def falls_along(forces: Any, box: Any, p: Any, d: Any) -> bool:
    """Whether U is proved concave in a direction ``d`` (n,) all over a box (n, 2) about an equilibrium."""
    n = len(d)
    f, J, bent = np.zeros((n, 2)), np.zeros((n, n, 2)), (0.0, 0.0)
    if not forces(box, p, f, J):
        return False
    for i in range(n):
        for j in range(n):
            bent = add(bent, mul(mul((J[i, j, 0], J[i, j, 1]), (d[i], d[i])), (d[j], d[j])))
    return bent[0] > 0.0


@dataclass(frozen=True)
class WaysDown:
    """Ways from saddles of a mechanism to its wells."""

    mechanism: Mechanism
    equilibria: Any
    wells: Integers  #: which equilibria are minima
    domain: Floats  #: as in :class:`fastmech.capture.cells.Cells`
    energies: Any
    forces: Any
    p: Floats  #: parameters as intervals
    slack: float  #: of energies [J]

    @cached_property
    def _widths(self) -> Floats:
        return np.asarray(self.domain[:, 1] - self.domain[:, 0])

    def joined(self, saddle: int) -> tuple[WayEnd, WayEnd] | None:
        """Where ways from both sides of a saddle with one falling direction end; None: not proved."""
        place = self.equilibria[saddle]
        q, w = place.position, self._widths
        stiffness = np.outer(w, w) * self.mechanism.linear(q).stiffness
        if not np.isfinite(stiffness).all():
            return None
        d = w * np.linalg.eigh(stiffness + stiffness.T)[1][:, 0]
        one, other = (self._down(q, side * d, place.energy - self.slack) for side in (1.0, -1.0))
        return None if one is None or other is None else (one, other)

    def _down(self, q: Floats, d: Floats, below: float) -> WayEnd | None:
        share = LONGEST
        while not (self._inside(q + share * d) and self._falls(q, q + share * d, d)):
            share *= 0.5
            if share < LONGEST * 0.5**HALVINGS:
                return None
        x = q + share * d
        for _ in range(STEPS):
            for well in self.wells:
                place, period = self.equilibria[int(well)].position, self.domain[:, 2]
                turns = np.rint((x - place) / np.where(period > 0.0, period, np.inf))
                straight = place + turns * period
                near = np.all(np.abs(straight - x) < STRAIGHT * self._widths)
                if near and self._proved(x, straight, below, CUTS):
                    return WayEnd(int(well), tuple(turns.astype(int).tolist()))
            step, energy = self._step(x), self._energy(x[:, None])[0]
            for _ in range(HALVINGS):
                y, out = self._within(x, x + step)
                if self._energy(y[:, None])[0] < energy and self._proved(x, y, below, CUTS):
                    break
                step = 0.5 * step
            else:
                return None
            if out:
                return WayEnd(-1, ())
            x = y
        return None

    def _inside(self, q: Floats) -> bool:
        low, high, period = self.domain.T
        return bool(np.all((period > 0.0) | ((q > low) & (q < high))))

    def _within(self, x: Floats, y: Floats) -> tuple[Floats, bool]:
        """As much of the way from x to y as is in the domain, and whether that ends there."""
        low, high, period = self.domain.T
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(y < low, (low - x) / (y - x), np.where(y > high, (high - x) / (y - x), 1.0))
        least = float(np.where(period > 0.0, 1.0, share).min())
        return (y, False) if least >= 1.0 else (x + least * (y - x), True)

    def _energy(self, q: Floats) -> Floats:
        """U [J] at positions (n, m), rounded; infinite where it is not known."""
        found = self.mechanism.evaluate("bounding", np.concatenate([q, np.zeros_like(q)]))[0]
        return np.where(np.isnan(found), np.inf, found)

    def _step(self, x: Floats) -> Floats:
        """Newton's step with all curvatures taken for rising ones, no longer than :data:`LONGEST`."""
        w = self._widths
        beside = x[:, None] + DIFFERENCE * np.diag(w), x[:, None] - DIFFERENCE * np.diag(w)
        with np.errstate(invalid="ignore"):
            slope = (self._energy(beside[0]) - self._energy(beside[1])) / (2.0 * DIFFERENCE)
        stiffness = np.outer(w, w) * self.mechanism.linear(x).stiffness
        size = np.abs(slope).max()
        if not (np.isfinite(size) and size > 0.0):
            return np.zeros_like(x)
        if np.isfinite(stiffness).all():
            curved, axes = np.linalg.eigh(stiffness + stiffness.T)
            slope = axes @ (axes.T @ slope / np.fmax(np.abs(0.5 * curved), FLAT * size))
        return -w * slope * min(1.0, LONGEST / np.abs(slope).max())

    def _box(self, x: Floats, y: Floats) -> Floats:
        more = ENLARGED * self._widths
        return np.stack([np.fmin(x, y) - more, np.fmax(x, y) + more], axis=-1)

    def _falls(self, x: Floats, y: Floats, d: Floats) -> bool:
        return bool(falls_along(self.forces, self._box(x, y), self.p, d / np.abs(d).max()))

    def _proved(self, x: Floats, y: Floats, below: float, cuts: int) -> bool:
        """Whether U is less than ``below`` all along a straight piece."""
        bounds, ones = np.empty((1, 2)), np.ones(len(x), dtype=np.int64)
        bound_cells(self.energies, self.forces, self._box(x, y), self.p, ones, bounds=bounds, end=0)
        if bounds[0, 1] < below:
            return True
        middle, cuts = 0.5 * (x + y), cuts - 1
        return cuts >= 0 and self._proved(x, middle, below, cuts) and self._proved(middle, y, below, cuts)
