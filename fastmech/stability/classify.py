"""Stability of one equilibrium by three criteria, and what they come to together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from fastmech.equilibria.certificate import existence_radius
from fastmech.equilibria.search import pulls
from fastmech.equilibria.solve import morse_index
from fastmech.mechanism.lagrange import unit
from fastmech.scene import Scene
from fastmech.stability.criteria import (
    ASYMPTOTIC,
    CRITICAL,
    STABLE,
    UNSTABLE,
    Assessment,
    Verdict,
    assess_one,
    hurwitz_determinants,
    root_errors,
)
from fastmech.stability.linearize import MEANING, FloatArray, Rest, linearized, reach

Word = Literal["asymptotically stable", "stable", "unstable", "critical"]

#: Kinds of equilibria by Morse index, for sentences.
_EXTREME = ("minimum", "saddle", "maximum")


class Finding(NamedTuple):
    """What one criterion says and why."""

    verdict: Word
    reason: str


@dataclass(frozen=True, eq=False)
class Classification:
    """Everything that decides an equilibrium's stability; SI units."""

    minors: FloatArray  #: Sylvester's leading minors of the Hessian of U (2,) [J, J^2]
    polynomial: FloatArray  #: characteristic polynomial (5,), monic, powers falling
    hurwitz_determinants: FloatArray  #: D1 .. D4
    eigenvalues: NDArray[np.complex128]  #: (4,) [1/s], largest real part first
    eigenvalue_errors: FloatArray  #: bound on the error of each [1/s]
    natural_frequencies: FloatArray  #: undamped (2,) [rad/s], rising; NaN for a direction that grows
    sylvester: Finding  #: Lagrange-Dirichlet with Sylvester's minors
    hurwitz: Finding
    spectrum: Finding  #: by the eigenvalues
    verdict: Word  #: the joint one
    explanation: str  #: why, and where the criteria differ, what that means
    decay_rate: float  #: of the slowest linear mode [1/s]; NaN unless U has a minimum
    reach: dict[str, float]  #: how well the damper reaches the modes; see ``modes.reach``
    unreached: str | None  #: which measure of ``reach`` vanishes, if the damper misses a mode

    @property
    def decay_time(self) -> float:
        """Time [s] in which the slowest linear mode falls to 1/e; inf if it does not decay."""
        return 1.0 / self.decay_rate if self.decay_rate != 0.0 else np.inf


def classify(scene: Scene, equilibrium: Rest) -> Classification:
    """Stability of ``equilibrium`` of ``scene``, the force frozen at the equilibrium's.

    The joint verdict: a singular Hessian is critical (second order does not decide); a Hessian with a
    negative direction is unstable, damped or not (Kelvin-Tait-Chetaev); a minimum is stable without damping
    and asymptotically stable with it, also where the linear damping misses a mode: no motion near a
    minimum keeps the slider at rest, so by LaSalle's principle all come to rest, only slowly. Verdicts are
    those of ``map_equilibria``: both come from ``fastmech.stability.criteria.assess_one``.

    Raises:
        InputError: an argument is wrong, or the scene is not at rest there, for example because the
            equilibrium is another scene's.
    """
    c, _ = linearized(scene, equilibrium)
    p = pulls(c.mass, c.lift, c.spring, c.gravity, c.force)
    radius = existence_radius(p, equilibrium.phi, equilibrium.theta)[0]
    index = morse_index(p, equilibrium.phi, equilibrium.theta, radius)
    roots = np.empty(4, dtype=np.complex128)
    with np.errstate(all="ignore"):
        a = assess_one(np.array(c), (equilibrium.phi, equilibrium.theta, radius, index), roots)
        errors = np.array([root_errors(root, a.p, a.roots_error) for root in roots])
        frequencies = np.sqrt(np.array(a.squares))
    by_minors, by_hurwitz, by_spectrum = (
        _by_minors(a, index),
        _by_hurwitz(a),
        _by_spectrum(a, roots, errors[:, 1]),
    )

    measures, unreached = reach(a.s, c.spring), None
    if a.sylvester == STABLE and a.hurwitz == CRITICAL and a.spectrum != ASYMPTOTIC and c.damping > 0.0:
        unreached = min(measures, key=lambda name: measures[name])
    inertia = unit(scene)
    return Classification(
        minors=np.array([a.s.k11 * inertia, (a.s.k11 * a.s.k22 - a.s.k12 * a.s.k12) * inertia**2]),
        polynomial=np.array([1.0, *a.p]),
        hurwitz_determinants=np.array(hurwitz_determinants(a.p, a.p_error)[0]),
        eigenvalues=roots,
        eigenvalue_errors=errors[:, 0],
        natural_frequencies=frequencies,
        sylvester=by_minors,
        hurwitz=by_hurwitz,
        spectrum=by_spectrum,
        verdict=_word(a.joint),
        explanation=_explanation(a, c.damping, by_minors.reason, unreached, measures),
        decay_rate=float(a.decay),
        reach=measures,
        unreached=unreached,
    )


def _word(code: int) -> Word:
    return cast("Word", Verdict(code).name.lower().replace("_", " "))


def _by_minors(a: Assessment, index: int) -> Finding:
    """Lagrange-Dirichlet: a minimum of U is stable; a negative direction of U is unstable by second order."""
    first, second = a.s.k11, a.s.k11 * a.s.k22 - a.s.k12 * a.s.k12
    e, error = a.minor_error
    if a.sylvester == CRITICAL:
        reason = f"the Hessian is singular within rounding: its determinant is {second:.2g} 1/s^4"
    elif second < -error:
        reason = "the Hessian's determinant is negative: U has a saddle"
    elif second > error and first > e:
        reason = "both leading minors of the Hessian are positive: U has a minimum"
    elif second > error and first < 0.0:
        reason = "the Hessian is negative definite: U has a maximum"
    else:
        reason = (
            f"U has a {_EXTREME[index]}: its minors are near zero, their signs proved with the equilibrium"
        )
    return Finding(_word(a.sylvester), reason)


def _by_hurwitz(a: Assessment) -> Finding:
    """Hurwitz, with the coefficient or determinant that decides."""
    if a.hurwitz == ASYMPTOTIC:
        return Finding(_word(ASYMPTOTIC), "all four Hurwitz determinants are positive")
    d, error = (np.array(values) for values in hurwitz_determinants(a.p, a.p_error))
    negative = np.array(a.p) < -np.array(a.p_error)
    if negative.any():
        name = ("p3", "p2", "p1", "p0")[int(np.argmax(negative))]
        reason = f"the coefficient {name} is negative: a root has a positive real part"
    elif a.hurwitz == UNSTABLE:
        reason = f"the Hurwitz determinant D{int(np.argmax(d < -error)) + 1} is negative"
    else:
        name = f"D{int(np.argmin(d > error)) + 1}"
        reason = f"the Hurwitz determinant {name} is zero within rounding: a root is on the axis"
    return Finding(_word(a.hurwitz), reason)


def _by_spectrum(a: Assessment, roots: NDArray[np.complex128], errors: FloatArray) -> Finding:
    """The eigenvalues' real parts, counted."""
    if a.spectrum == ASYMPTOTIC:
        return Finding(_word(ASYMPTOTIC), "every eigenvalue has a negative real part")
    unstable = a.spectrum == UNSTABLE
    count = int(np.count_nonzero(roots.real > errors if unstable else roots.real >= -errors))
    verb = ("has" if count == 1 else "have") if unstable else ("is" if count == 1 else "are")
    what = "a positive real part" if unstable else "on the imaginary axis within rounding"
    return Finding(_word(a.spectrum), f"{count} of the four eigenvalues {verb} {what}")


def _explanation(
    a: Assessment, damping: float, minors: str, unreached: str | None, measures: dict[str, float]
) -> str:
    """Why the joint verdict is what it is."""
    if a.joint == CRITICAL:
        return f"{minors}; equilibria merge here and second order does not decide"
    if a.joint == UNSTABLE:
        return f"{minors}, which no damping makes stable (Kelvin-Tait-Chetaev)"
    if damping == 0.0:
        return (
            "U has a minimum and nothing damps (beta = 0): disturbances stay small but do not die out; "
            "Hurwitz and the eigenvalues are silent because all roots are on the imaginary axis"
        )
    if unreached is not None:
        return (
            f"U has a minimum but the damper misses a mode: {MEANING[unreached]} "
            f"(measure {measures[unreached]:.2g}, linear decay rate {a.decay:.2g} 1/s); Hurwitz and the "
            "eigenvalues are silent and the decay is algebraic, the energy falling like 1/t or slower"
        )
    settled = f"U has a minimum and the damper reaches both modes; the slower one decays at {a.decay:.3g} 1/s"
    silent = [
        name for name, code in (("Hurwitz", a.hurwitz), ("the eigenvalues", a.spectrum)) if code == CRITICAL
    ]
    if silent:
        settled += f"; that is below the rounding of {silent[0]}"
    return settled
