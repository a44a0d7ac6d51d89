"""All equilibria of one scene, with their certificate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeVar, overload

import numpy as np

from fastmech.arrays import Codes, Floats
from fastmech.errors import InputError, shown
from fastmech.objects import Drawn, Printed
from fastmech.outcome import Outcome
from fastmech.scene import Scene, require_scene
from fastmech.slider.coefficients import force, reduce
from fastmech.slider.lagrange import potential_hessian as stiffness
from fastmech.slider.solve import explain, solve_rows

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

    def told(self) -> str:
        """Kind, place, energy and force."""
        within = f"within {self.radius:.2g} rad; {self.energy:.6g} J; F = {self.force:g} N"
        return f"equilibrium: {self.kind} at {self.place('6g')} {within}"

    def place(self, digits: str) -> str:
        """Where it is, in words; what is less than rounding is 0."""
        phi, theta = (round(angle, 12) + 0.0 for angle in (self.phi, self.theta))
        return f"phi = {phi:.{digits}}, theta = {theta:.{digits}} rad"

    @property
    def position(self) -> Floats:
        """Both angles (2,) [rad]."""
        return np.array([self.phi, self.theta])

    @property
    def kind(self) -> str:
        """``minimum``, ``saddle``, ``maximum``; ``degenerate`` if the Hessian is singular within rounding."""
        return KINDS[self.morse_index]


class Proved(Printed):
    """What is proved about a list of equilibria of any system; printed, its sentence."""

    outcome: Outcome
    sentence: str

    def told(self) -> str:
        """The sentence."""
        return self.sentence

    @property
    def complete(self) -> bool:
        """Whether the list is proved to be correct and complete."""
        return self.outcome is Outcome.COMPLETE


@dataclass(frozen=True, repr=False)
class Certificate(Proved):
    """What is proved about the equilibria of a scene."""

    outcome: Outcome
    count: int  #: equilibria listed
    expected: int | None  #: equilibria that exist by the counting theorem; None where rounding hides it
    fold_margin: float  #: signed distance to the fold [rad], positive with six equilibria; NaN if degenerate
    sentence: str


Place = TypeVar("Place")


def require_one(equilibrium: Any, kind: type) -> None:
    """Refuse what is no equilibrium of this kind, a scene's or a mechanism's.

    Raises:
        InputError: it is something else.
    """
    if not isinstance(equilibrium, kind):
        listed = isinstance(equilibrium, Listed)
        told = f": is a list of {len(equilibrium)}" if listed else f" = {shown(equilibrium)}"
        raise InputError(f"equilibrium{told}: must be one of fm.find_equilibria(...), such as E[0]")


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
        proved, held = "; ".join(self.certificate.sentence.split("; ")[:2]), self.held()
        return "\n  ".join([proved, *([held] if held and held not in proved else []), places])

    def held(self) -> str:
        """Under which loads they are, in words; empty where none changes."""
        raise NotImplementedError

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
        require_one(equilibrium, Equilibrium)
        # Where g = 0 the force alone may differ: the place is an equilibrium of both, its Hessian is not.
        same = abs(equilibrium.force - self.force) <= 1e-12 * abs(self.force)
        for i, item in enumerate(self.items if same else ()):
            half = 0.5 * (equilibrium.position - item.position)
            away = 2.0 * np.hypot(*np.sin(half))
            within = equilibrium.radius + item.radius  # both are near the same true one
            if away <= (within if within < math.inf else 1e-9):
                return i
        raise InputError(
            f"equilibrium = ({equilibrium.phi:g}, {equilibrium.theta:g}) rad, F = {equilibrium.force:g} N: "
            f"must be one of this scene's equilibria (F = {self.force:g} N)"
        )

    def place(self, k: int) -> str:
        """Where an equilibrium is, in words."""
        return self.items[k].place("4g")

    def held(self) -> str:
        """Of a force that decays, what is left of it."""
        scene = self.system
        return "" if scene is None or scene.alpha == 0.0 or scene.F0 == 0.0 else told_force(scene, self.force)

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
    require_scene(scene)
    frozen = frozen_force(scene, at)
    solution = solve_rows(np.array([reduce(scene, frozen)]), compiled=False)
    outcome, count = Outcome(int(solution.outcome[0])), int(solution.count[0])
    expected, margin = int(solution.expected[0]), float(solution.margin[0])
    items, springs = [], (scene.c1 + scene.c2) * scene.l**2
    columns = (column[0, :count].tolist() for column in solution[:5])
    for phi, theta, energy, radius, index in zip(*columns, strict=True):
        hessian = stiffness(scene, (phi, theta), frozen)
        joule = energy * scene.m2 * scene.l**2 + springs
        items.append(Equilibrium(phi, theta, joule, hessian, index, radius=radius, force=frozen))
    if outcome is Outcome.DEGENERATE:
        sentence = degenerate_sentence(scene, frozen)
    else:
        sentence = explain(outcome, count, expected, margin)
    certificate = Certificate(outcome, count, expected or None, margin, sentence)
    return Equilibria(tuple(items), frozen, certificate).of(scene)


def held(scene: Scene, equilibrium: Equilibrium | Equilibria) -> Scene:
    """The scene under a constant force, the one that an equilibrium holds for."""
    return under_force(scene, equilibrium.force)


def under_force(scene: Scene, force: float) -> Scene:
    """The scene under a constant force [N] in place of its own."""
    return scene.replace(F0=force, alpha=0.0)


def told_force(scene: Scene, force: float) -> str:
    """The force [N] that equilibria hold for, and whether it stays, in words."""
    told = f"force F = {force:g} N on M2"
    if scene.alpha == 0.0 or scene.F0 == 0.0:
        return f"{told}, constant"
    when = f"frozen at t = {math.log(scene.F0 / force) / scene.alpha:g} s" if force else "decayed"
    return f"{told}, {when} (F0 = {scene.F0:g} N, alpha = {scene.alpha:g} 1/s)"


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
