"""Two searches beside the proof: neither knows the counting theorem, so either could contradict it.

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

from fastmech.arrays import Floats
from fastmech.equilibria.certificate import existence_radius
from fastmech.equilibria.search import EPS, pulls
from fastmech.mechanism.coefficients import Coefficients
from fastmech.mechanism.reduced import potential_gradient, potential_hessian

#: How far a double root may lie from its place in |z|: the square root of rounding, and some.
NEAR_CIRCLE = 1e-5


@dataclass(frozen=True)
class UnitRoots:
    """Roots on the unit circle and how they relate to a list of equilibria."""

    angles: Floats  #: arguments of the unit roots [rad]
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


def unit_roots(lift: float, spring: float, gravity: float, force: float, phi: Floats) -> UnitRoots:
    """Unit roots of the polynomial against the angles ``phi`` of the equilibria found."""
    polynomial = rest_polynomial(lift, spring, gravity, force).trim(1e-15)
    roots = polynomial.roots() if polynomial.degree() > 0 else np.zeros(0)
    angles = np.angle(roots[np.abs(np.abs(roots) - 1.0) < NEAR_CIRCLE])
    apart = np.abs(np.exp(1j * angles)[:, None] - np.exp(1j * phi)[None, :])
    matched = apart < 10 * NEAR_CIRCLE
    explained = matched.any(axis=1)
    if spring > 0 and abs(spring**2 - gravity**2 - force**2) <= NEAR_CIRCLE * spring**2:
        trap = (force - 1j * gravity) / spring
        explained |= np.abs(np.exp(1j * angles) - trap) < 10 * NEAR_CIRCLE
    return UnitRoots(angles, int((~explained).sum()), int((~matched.any(axis=0)).sum()))


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
