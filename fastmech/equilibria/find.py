"""All equilibria of one scene, with their certificate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import overload

import numpy as np

from fastmech.equilibria.evidence import Evidence, gather
from fastmech.equilibria.outcome import Outcome
from fastmech.equilibria.search import FloatArray
from fastmech.equilibria.solve import explain, solve_rows
from fastmech.errors import InputError, shown
from fastmech.mechanism.coefficients import Coefficients, force, reduce
from fastmech.mechanism.reduced import potential_hessian
from fastmech.scene import Scene, require_scene

#: Kind of equilibrium by Morse index; an index of -2 stands for a Hessian that is singular within rounding.
KINDS = {0: "minimum", 1: "saddle", 2: "maximum", -2: "degenerate"}


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """One resting position."""

    phi: float  #: [rad] in (-pi, pi]
    theta: float  #: [rad] in (-pi, pi]
    energy: float  #: U = Pi - F x2 [J]
    hessian: FloatArray  #: second derivatives of U (2, 2) [J], paper (19)
    morse_index: int  #: number of negative eigenvalues of the Hessian; -2: singular within rounding
    radius: float  #: the true equilibrium is proved to be within so many rad; inf: not proved
    force: float  #: the frozen force F that it holds for [N]

    @property
    def position(self) -> FloatArray:
        """Both angles (2,) [rad]."""
        return np.array([self.phi, self.theta])

    @property
    def kind(self) -> str:
        """``minimum``, ``saddle``, ``maximum``; ``degenerate`` if the Hessian is singular within rounding."""
        return KINDS[self.morse_index]


@dataclass(frozen=True)
class Certificate:
    """What is proved about a list of equilibria."""

    outcome: Outcome
    count: int  #: equilibria listed
    expected: int | None  #: equilibria that exist by the counting theorem; None where rounding hides it
    fold_margin: float  #: signed distance to the fold [rad], positive with six equilibria; NaN if degenerate
    evidence: Evidence  #: two searches that share nothing with the proof
    sentence: str

    @property
    def complete(self) -> bool:
        """Whether the list is proved to be correct and complete."""
        return self.outcome is Outcome.COMPLETE


@dataclass(frozen=True, eq=False)
class Equilibria(Sequence[Equilibrium]):
    """The equilibria of a scene, the deepest first."""

    items: tuple[Equilibrium, ...]
    force: float  #: the frozen force F [N]
    certificate: Certificate

    def __len__(self) -> int:
        return len(self.items)

    @overload
    def __getitem__(self, index: int) -> Equilibrium: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Equilibrium]: ...
    def __getitem__(self, index: int | slice) -> Equilibrium | Sequence[Equilibrium]:
        return self.items[index]

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

    @property
    def position(self) -> FloatArray:
        """Angles phi, theta (n, 2) [rad]."""
        return np.array([item.position for item in self.items]).reshape(-1, 2)

    def place(self, k: int) -> str:
        """Where an equilibrium is, in words."""
        return f"phi = {self.items[k].phi:.4g}, theta = {self.items[k].theta:.4g} rad"

    @property
    def phi(self) -> FloatArray:
        """Angles phi (n,) [rad]."""
        return np.array([item.phi for item in self.items])

    @property
    def theta(self) -> FloatArray:
        """Angles theta (n,) [rad]."""
        return np.array([item.theta for item in self.items])

    @property
    def energy(self) -> FloatArray:
        """U = Pi - F x2 (n,) [J]."""
        return np.array([item.energy for item in self.items])

    @property
    def hessian(self) -> FloatArray:
        """Second derivatives of U (n, 2, 2) [J]."""
        return np.array([item.hessian for item in self.items]).reshape(-1, 2, 2)

    @property
    def morse_index(self) -> np.typing.NDArray[np.int8]:
        """Morse indices (n,)."""
        return np.array([item.morse_index for item in self.items], dtype=np.int8)

    @property
    def kind(self) -> tuple[str, ...]:
        """Kinds, one for each equilibrium."""
        return tuple(item.kind for item in self.items)


def find_equilibria(scene: Scene, at: float = math.inf) -> Equilibria:
    """All equilibria of ``scene`` with the force frozen at time ``at`` [s].

    A constant force (alpha = 0) is F0 at every time. A decaying one is zero at the default ``at = inf``,
    so Table 2 of the paper needs ``alpha = 0`` or ``at=0``.

    Raises:
        InputError: ``at`` is not a number >= 0.
    """
    require_scene(scene)
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
            hessian=stiffness(scene, coefficients, solution.phi[0, i], solution.theta[0, i]),
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
    )


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


def stiffness(scene: Scene, coefficients: Coefficients, phi: float, theta: float) -> FloatArray:
    """Hessian of U (2, 2) [J], paper (19)."""
    c = coefficients
    h11, h12, h22 = potential_hessian(
        np.sin(phi),
        np.cos(phi),
        np.sin(theta),
        np.cos(theta),
        np.sin(phi + theta),
        c.lift,
        c.spring,
        c.gravity,
        c.force,
    )
    return scene.m2 * scene.l**2 * np.array([[h11, h12], [h12, h22]])


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
