"""Stability of one equilibrium by three criteria, and what they come to together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastmech.errors import InputError
from fastmech.mechanism.coefficients import Coefficients
from fastmech.mechanism.lagrange import potential_gradient, unit
from fastmech.scene import Scene
from fastmech.stability.arguments import require_rest
from fastmech.stability.criteria import (
    ROUNDING,
    Finding,
    Verdict,
    characteristic,
    eigenvalues,
    hurwitz,
    hurwitz_determinants,
    minors,
    spectrum,
    sylvester,
)
from fastmech.stability.linearize import FloatArray, Rest, jacobian, linearized
from fastmech.stability.modes import MEANING, reach, slowest_decay, squared_frequencies

#: Share of the loads that may be left unbalanced: far above rounding, far below any other scene's loads.
NOT_AT_REST = 1e-7

_PROVED = {
    0: Finding(
        "stable", "U has a minimum: its minors are near zero, their signs proved with the equilibrium"
    ),
    1: Finding(
        "unstable", "U has a saddle: its minors are near zero, their signs proved with the equilibrium"
    ),
    2: Finding(
        "unstable", "U has a maximum: its minors are near zero, their signs proved with the equilibrium"
    ),
}


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
    verdict: Verdict  #: the joint one
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
    minimum keeps the slider at rest, so by LaSalle's principle all come to rest, only slowly.

    Raises:
        InputError: an argument is wrong, or the scene is not at rest there, for example because the
            equilibrium is another scene's.
    """
    require_rest(scene, equilibrium)
    c, s = linearized(scene, equilibrium)
    loads = abs(c.lift) + (c.mass + 2.0) * c.gravity + 2.0 * c.spring + 2.0 * abs(c.force)
    gradient = potential_gradient(scene, (equilibrium.phi, equilibrium.theta), equilibrium.force)
    if not np.max(np.abs(gradient)) <= NOT_AT_REST * loads * unit(scene):
        raise InputError(
            f"equilibrium = ({equilibrium.phi:g}, {equilibrium.theta:g}) rad: this scene does not rest there"
        )
    # Third derivatives of U are at most 2 loads, so an angle's error changes the Hessian by no more.
    stiffness_error = loads * (ROUNDING + 2.0 * min(equilibrium.radius, 1.0))
    minor = minors(s, stiffness_error)
    p = characteristic(s, stiffness_error)
    d = hurwitz_determinants(p)
    squares = squared_frequencies(s)
    rate = float(np.sqrt(np.max(np.abs(squares)))) or 1.0
    values, errors = eigenvalues(jacobian(scene, equilibrium), rate, stiffness_error)
    by_minors, by_hurwitz, by_spectrum = sylvester(minor), hurwitz(p, d), spectrum(values, errors)
    if by_minors.verdict == "critical":
        # The equilibrium's own proof knows the determinant's sign more closely than the minors' bound.
        by_minors = _PROVED.get(equilibrium.morse_index, by_minors)

    decay, measures, unreached = np.nan, reach(s, c.spring), None
    if by_minors.verdict == "stable":
        resolved = by_spectrum.verdict == "asymptotically stable"
        decay = float(-values.real.max()) if resolved else slowest_decay(s, c.spring, squares)
        missed = by_hurwitz.verdict == "critical" and not resolved and c.damping > 0.0
        unreached = min(measures, key=lambda name: measures[name]) if missed else None
    verdict, explanation = join(c, by_minors, by_hurwitz, by_spectrum, unreached, measures, decay)
    inertia = scene.m2 * scene.l**2
    with np.errstate(invalid="ignore"):
        frequencies = np.sqrt(squares)
    return Classification(
        minors=minor.value * np.array([inertia, inertia**2]),
        polynomial=np.concatenate([[1.0], p.value]),
        hurwitz_determinants=d.value,
        eigenvalues=values,
        eigenvalue_errors=errors,
        natural_frequencies=frequencies,
        sylvester=by_minors,
        hurwitz=by_hurwitz,
        spectrum=by_spectrum,
        verdict=verdict,
        explanation=explanation,
        decay_rate=decay,
        reach=measures,
        unreached=unreached,
    )


def join(
    c: Coefficients,
    by_minors: Finding,
    by_hurwitz: Finding,
    by_spectrum: Finding,
    unreached: str | None,
    measures: dict[str, float],
    decay: float,
) -> tuple[Verdict, str]:
    """Joint verdict of the three findings and its explanation."""
    if by_minors.verdict == "critical":
        return "critical", f"{by_minors.reason}; equilibria merge here and second order does not decide"
    if by_minors.verdict == "unstable":
        return "unstable", f"{by_minors.reason}, which no damping makes stable (Kelvin-Tait-Chetaev)"
    if c.damping == 0.0:
        return "stable", (
            "U has a minimum and nothing damps (beta = 0): disturbances stay small but do not die out; "
            "Hurwitz and the eigenvalues are silent because all roots are on the imaginary axis"
        )
    if unreached is not None:
        return "asymptotically stable", (
            f"U has a minimum but the damper misses a mode: {MEANING[unreached]} "
            f"(measure {measures[unreached]:.2g}, linear decay rate {decay:.2g} 1/s); Hurwitz and the "
            "eigenvalues are silent and the decay is algebraic, the energy falling like 1/t or slower"
        )
    settled = f"U has a minimum and the damper reaches both modes; the slower one decays at {decay:.3g} 1/s"
    silent = [
        name
        for name, finding in (("Hurwitz", by_hurwitz), ("the eigenvalues", by_spectrum))
        if finding.verdict == "critical"
    ]
    if silent:
        settled += f"; that is below the rounding of {silent[0]}"
    return "asymptotically stable", settled
