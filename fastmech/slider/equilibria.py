"""All equilibria of one scene, with their certificate.

The polynomial of degree 6 among whose roots on the unit circle lie exp(i phi) of all equilibria. With z =
exp(i phi) the conditions of rest a cos phi + f sin phi = b sin theta + f cos theta = C cos(phi + theta)
become, theta eliminated (f is the force's coefficient, a, b, C those of lift, gravity and spring),

    C^2 z [(f + ib) z^2 - (f - ib)]^2 + [(a - if) z^2 + (a + if)]^2 [(f - ib) - C z] [(f + ib) z - C] = 0.

Two equilibria that share phi make a double root; if C^2 = b^2 + f^2 the double root z = (f - ib)/C need not
belong to any equilibrium; the degree drops when C = 0, a = f = 0 or f = b = 0. Hence the roots are not
counted blindly: each is taken back to the equilibria.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeVar, overload

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from fastmech.arrays import Codes, Floats
from fastmech.errors import InputError, shown
from fastmech.objects import Drawn, Field, Printed
from fastmech.outcome import Outcome
from fastmech.scene import Scene, require_scene
from fastmech.slider.coefficients import Coefficients, force, reduce
from fastmech.slider.lagrange import potential_hessian as stiffness
from fastmech.slider.proof import existence_radius
from fastmech.slider.reduced import potential_gradient, potential_hessian
from fastmech.slider.solve import explain, solve_rows
from fastmech.slider.theorem import EPS, pulls

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
    loads, scale = ((lift, spring, gravity), force), max(map(abs, (lift, spring, gravity, force)))
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
        h11, h12, h22 = potential_hessian((s[0], c[0], s[1], c[1]), s[0] * c[1] + c[0] * s[1], *loads)
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


def _gradient(s: Floats, c: Floats, loads: Any) -> Floats:
    return np.stack(potential_gradient((s[0], c[0], s[1], c[1]), c[0] * c[1] - s[0] * s[1], *loads))


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
        lost = self.polynomial.unexplained
        belongs = f"{lost} of them of no listed" if lost else "each of a listed"
        return (
            f"Newton from {STARTS} x {STARTS} starts reached {self.reached} of them and "
            f"{self.unlisted or 'no'} others; {self.polynomial.angles.size} roots of the degree-6 polynomial "
            f"have modulus 1, {belongs} equilibrium"
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


#: Kind of equilibrium by Morse index; an index of -2 stands for a Hessian that is singular within rounding.
KINDS = {0: "minimum", 1: "saddle", 2: "maximum", -2: "degenerate"}


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium(Printed):
    """One resting position."""

    phi: float  #: [rad] in (-pi, pi]
    theta: float  #: [rad] in (-pi, pi]
    energy: float  #: U = Pi - F x2 [J]
    hessian: Floats  #: second derivatives of U (2, 2) [J], paper (19)
    morse_index: int  #: number of negative eigenvalues of the Hessian; -2: singular within rounding
    radius: float  #: the true equilibrium is proved to be within so many rad; inf: not proved
    force: float  #: the frozen force F that it holds for [N]

    FIELDS = {
        "kind": Field("", "1", "kind"),
        "phi": Field("", "rad", "angle phi"),
        "theta": Field("", "rad", "angle theta"),
        "energy": Field("", "J", "potential energy"),
        "radius": Field("", "rad", "proved to within"),
        "force": Field("", "N", "force"),
    }

    @property
    def position(self) -> Floats:
        """Both angles (2,) [rad]."""
        return np.array([self.phi, self.theta])

    @property
    def kind(self) -> str:
        """``minimum``, ``saddle``, ``maximum``; ``degenerate`` if the Hessian is singular within rounding."""
        return KINDS[self.morse_index]


@dataclass(frozen=True, repr=False)
class Certificate(Printed):
    """What is proved about a list of equilibria; printed, its sentence."""

    outcome: Outcome
    count: int  #: equilibria listed
    expected: int | None  #: equilibria that exist by the counting theorem; None where rounding hides it
    fold_margin: float  #: signed distance to the fold [rad], positive with six equilibria; NaN if degenerate
    evidence: Evidence  #: two searches that share nothing with the proof
    sentence: str

    def told(self) -> str:
        """The sentence."""
        return self.sentence

    @property
    def complete(self) -> bool:
        """Whether the list is proved to be correct and complete."""
        return self.outcome is Outcome.COMPLETE


Place = TypeVar("Place")


class Listed(Drawn, Sequence[Place]):
    """A list of equilibria of any system with what is proved of it."""

    items: tuple[Place, ...]
    certificate: Any
    names: tuple[str, ...]  # of the coordinates

    KIND = "equilibria"
    LAYOUT = "scan_types.equilibria:equilibria_dataset"
    PICTURE = "plots.objects:draw_resting"

    def __len__(self) -> int:
        return len(self.items)

    @overload
    def __getitem__(self, index: int) -> Place: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Place]: ...
    def __getitem__(self, index: int | slice) -> Place | Sequence[Place]:
        return self.items[index]

    def told(self) -> str:
        """How many equilibria, what is proved of the list, and where they are."""
        places = "; ".join(f"{k}: {kind} at {self.place(k)}" for k, kind in enumerate(self.kind))
        return f"{'; '.join(self.certificate.sentence.split('; ')[:2])}\n  {places}"

    def place(self, k: int) -> str:
        """Where an equilibrium is, in words."""
        raise NotImplementedError

    def each(self, name: str) -> Any:
        """An attribute of all equilibria, stacked."""
        return np.array([getattr(item, name) for item in self.items])

    @property
    def position(self) -> Floats:
        """Coordinates (count, n) [rad or m]."""
        return np.asarray(self.each("position").reshape(-1, len(self.names)))

    @property
    def kind(self) -> tuple[str, ...]:
        """Kinds, one for each equilibrium."""
        return tuple(item.kind for item in self.items)  # type: ignore[attr-defined]

    @property
    def energy(self) -> Floats:
        """U (count,) [J]; of a mechanism loads are at their means, NaN where there is no potential."""
        return np.asarray(self.each("energy"))


@dataclass(frozen=True, eq=False, repr=False)
class Equilibria(Listed[Equilibrium]):
    """The equilibria of a scene, the deepest first."""

    items: tuple[Equilibrium, ...]
    force: float  #: the frozen force F [N]
    certificate: Certificate

    names = ("phi", "theta")

    def index_of(self, equilibrium: Equilibrium) -> int:
        """Which of these an equilibrium is.

        Raises:
            InputError: it is none of them, for example one of another scene or for another force.
        """
        if not isinstance(equilibrium, Equilibrium):
            raise InputError(f"equilibrium = {shown(equilibrium)}: must be one of fastmech.find_equilibria")
        # Where g = 0 the force alone may differ: the place is an equilibrium of both, its Hessian is not.
        same = abs(equilibrium.force - self.force) <= 1e-12 * abs(self.force)
        for i, item in enumerate(self.items if same else ()):
            away = 2.0 * np.hypot(
                np.sin((equilibrium.phi - item.phi) / 2), np.sin((equilibrium.theta - item.theta) / 2)
            )
            within = equilibrium.radius + item.radius  # both are near the same true one
            if away <= (within if within < math.inf else 1e-9):
                return i
        raise InputError(
            f"equilibrium = ({equilibrium.phi:g}, {equilibrium.theta:g}) rad, F = {equilibrium.force:g} N: "
            f"must be one of this scene's equilibria (F = {self.force:g} N)"
        )

    def place(self, k: int) -> str:
        """Where an equilibrium is, in words."""
        return f"phi = {self.items[k].phi:.4g}, theta = {self.items[k].theta:.4g} rad"

    @property
    def phi(self) -> Floats:
        """Angles phi (n,) [rad]."""
        return np.asarray(self.each("phi"))

    @property
    def theta(self) -> Floats:
        """Angles theta (n,) [rad]."""
        return np.asarray(self.each("theta"))

    @property
    def hessian(self) -> Floats:
        """Second derivatives of U (n, 2, 2) [J]."""
        return np.asarray(self.each("hessian").reshape(-1, 2, 2))

    @property
    def morse_index(self) -> Codes:
        """Morse indices (n,)."""
        return np.asarray(self.each("morse_index").astype(np.int8))


def find_equilibria(scene: Scene, at: float = math.inf) -> Equilibria:
    """All equilibria of a scene, see :func:`fastmech.find_equilibria`."""
    require_scene(scene, " or a Mechanism")
    frozen = frozen_force(scene, at)
    coefficients = reduce(scene)._replace(force=frozen / (scene.m2 * scene.l))
    solution = solve_rows(np.array([coefficients]), compiled=False)
    outcome, count = Outcome(int(solution.outcome[0])), int(solution.count[0])
    evidence = gather(
        coefficients, solution.phi[0, :count], solution.theta[0, :count], solution.radius[0, :count]
    )
    expected, margin = int(solution.expected[0]), float(solution.margin[0])
    items = tuple(
        Equilibrium(
            phi=float(solution.phi[0, i]),
            theta=float(solution.theta[0, i]),
            energy=float(solution.energy[0, i]) * scene.m2 * scene.l**2 + (scene.c1 + scene.c2) * scene.l**2,
            hessian=stiffness(scene, (solution.phi[0, i], solution.theta[0, i]), frozen),
            morse_index=int(solution.index[0, i]),
            radius=float(solution.radius[0, i]),
            force=frozen,
        )
        for i in range(count)
    )
    if outcome is Outcome.DEGENERATE:
        sentence = degenerate_sentence(scene, frozen)
    else:
        sentence = f"{explain(outcome, count, expected, margin)}; {evidence.sentence}"
    return Equilibria(
        items, frozen, Certificate(outcome, count, expected or None, margin, evidence, sentence)
    ).of(scene)


def held(scene: Scene, equilibrium: Equilibrium | Equilibria) -> Scene:
    """The scene under a constant force, the one that an equilibrium holds for."""
    return scene.replace(F0=equilibrium.force, alpha=0.0)


def frozen_force(scene: Scene, at: float) -> float:
    """Force [N] at time ``at`` [s], which may be infinite.

    Raises:
        InputError: ``at`` is not a number >= 0.
    """
    if not isinstance(at, int | float | np.integer | np.floating) or not at >= 0.0:
        raise InputError(f"at = {at!r}: must be a time >= 0 s, or inf for the force's limit")
    if scene.alpha == 0.0:
        return scene.F0
    return 0.0 if math.isinf(at) else float(force(scene, at))


def degenerate_sentence(scene: Scene, frozen: float) -> str:
    """Which conditions make the equilibria non-isolated; whether they hold exactly is decided in rationals.

    Equilibria are not isolated exactly if two of the three pulls vanish: the spring's on psi (c1 = 0), the
    one on phi (F = 0 and (m1 + m2) g = c2 l), the one on theta (F = 0 and g = 0).
    """
    weight = (Fraction(scene.m1) + Fraction(scene.m2)) * Fraction(scene.g)
    pull = Fraction(scene.c2) * Fraction(scene.l)
    conditions = []
    if scene.c1 == 0.0:
        conditions.append("c1 = 0")
    if frozen == 0.0:
        conditions.append("F = 0")
    if scene.g == 0.0:
        conditions.append("g = 0")
    exact = weight == pull
    if scene.g > 0.0 or (exact and scene.c2 == 0.0):
        conditions.append("c2 = 0" if scene.c2 == 0.0 else "(m1 + m2) g = c2 l")
    closing = "" if exact or scene.g == 0.0 else ", the last within rounding"
    return f"equilibria are not isolated: {', '.join(conditions)}{closing}"
