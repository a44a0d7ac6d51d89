"""Stability of a mechanism's equilibrium: by its potential, by Hurwitz, by the eigenvalues, in one word."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from fastmech.errors import InputError, shown
from fastmech.intervals.arithmetic import Interval, add, div, mul, sub
from fastmech.models.equilibria import Floats, RestingPlace
from fastmech.models.mechanism import Linear, Mechanism
from fastmech.stability import classify as of_scene
from fastmech.stability.classify import Finding

#: Matrices are taken to be wrong by so many units of rounding of their largest entry.
_ROUNDING = 32.0 * 2.0**-52


@dataclass(frozen=True, eq=False, repr=False)
class Stability:
    """What decides whether a mechanism stays at an equilibrium; SI units."""

    eigenvalues: NDArray[np.complex128]  #: (2 n,) [1/s], largest real part first
    eigenvalue_errors: Floats  #: bounds on their errors (2 n,) [1/s], of first order in rounding
    polynomial: Floats  #: characteristic polynomial (2 n + 1,), monic, powers falling
    hurwitz_determinants: Floats  #: D1 .. D2n
    potential: Finding | None  #: Lagrange-Dirichlet; None where forces have no potential
    hurwitz: Finding
    spectrum: Finding  #: by the eigenvalues
    verdict: Literal["asymptotically stable", "stable", "unstable", "critical"]
    instability: Literal["flutter", "divergence"] | None  #: growing swings, or growth without; if unstable
    explanation: str

    def __repr__(self) -> str:
        swings = ", ".join(f"{value:.6g}" for value in self.eigenvalues)
        return f"{self.verdict}: {self.explanation}\neigenvalues [1/s]: {swings}"


def classify(system: Any, equilibrium: Any) -> of_scene.Classification | Stability:
    """Stability of one of a scene's or a mechanism's equilibria.

    A minimum of the potential is stable, also where nothing damps; where damping is pervasive it is
    asymptotically stable. Where U falls in some direction the equilibrium is unstable, damped or not
    (Kelvin-Tait-Chetaev). Without a potential, as with forces that follow a body, the eigenvalues decide:
    a growing swing is flutter, growth without one is divergence.

    Raises:
        InputError: an argument is wrong, or the equilibrium is another system's.
    """
    if not isinstance(system, Mechanism):
        return of_scene.classify(system, equilibrium)
    return assess(require_own(system, equilibrium), equilibrium.morse_index)


def require_own(system: Mechanism, equilibrium: Any) -> Linear:
    """The linearization of a mechanism at one of its equilibria.

    Raises:
        InputError: it is none, or another mechanism's.
    """
    if not isinstance(equilibrium, RestingPlace):
        raise InputError(f"equilibrium = {shown(equilibrium)}: must be one of fastmech.find_equilibria")
    linear = system.linear(equilibrium.position)
    if linear.stiffness.shape != equilibrium.stiffness.shape or not np.allclose(
        linear.stiffness, equilibrium.stiffness, rtol=1e-9, atol=1e-9 * np.abs(linear.stiffness).max()
    ):
        raise InputError(f"equilibrium = {shown(equilibrium.position.tolist())}: is another mechanism's")
    return linear


def assess(linear: Linear, morse_index: int | None) -> Stability:
    """Stability from the linearization, and from the proved Morse index where there is a potential.

    ``morse_index`` is None without a potential and -2 where the Hessian is not proved to be regular.
    """
    mass, damping, stiffness = (np.asarray(matrix, dtype=np.float64) for matrix in linear)
    n = len(mass)
    factor = np.linalg.cholesky(mass)
    by_mass = [
        scipy.linalg.solve_triangular(
            factor, scipy.linalg.solve_triangular(factor, matrix, lower=True).T, lower=True
        ).T
        for matrix in (damping, stiffness)
    ]
    rate = float(max(np.sqrt(np.abs(by_mass[1]).max()), np.abs(by_mass[0]).max())) or 1.0
    c, k = by_mass[0] / rate, by_mass[1] / rate**2
    undamped = not damping.any()
    roots: NDArray[np.complex128]
    if undamped:
        squares, square_errors = _eigenvalues(-k)
        half = np.sqrt(squares)
        size = np.maximum(np.abs(half), np.sqrt(square_errors))
        roots = np.concatenate([half, -half])
        errors = np.tile(square_errors / np.maximum(size, 1e-300), 2)
    else:
        roots, errors = _eigenvalues(np.block([[np.zeros((n, n)), np.eye(n)], [-k, -c]]))
    order = np.lexsort((-roots.imag, -roots.real))
    roots, errors = roots[order], errors[order]
    spectrum, instability = _by_spectrum(roots, errors)
    polynomial, minors, hurwitz = _by_hurwitz(c, k)
    potential, verdict, explanation = _jointly(morse_index, damping, spectrum, instability, undamped)
    if verdict != "unstable":
        instability = None
    elif instability is None:
        instability = "divergence"
    powers = np.arange(2 * n + 1)
    return Stability(
        eigenvalues=roots * rate,
        eigenvalue_errors=errors * rate,
        polynomial=polynomial * rate**powers,
        hurwitz_determinants=minors * rate ** (powers[1:] * powers[1:] / 2 + powers[1:] / 2),
        potential=potential,
        hurwitz=hurwitz,
        spectrum=spectrum,
        verdict=verdict,
        instability=instability,
        explanation=explanation,
    )


def _eigenvalues(matrix: Floats) -> tuple[NDArray[np.complex128], Floats]:
    """Eigenvalues, and how far rounding of the matrix may move each (Wilkinson's condition numbers)."""
    values, left, right = scipy.linalg.eig(matrix, left=True)
    overlap = np.abs(np.einsum("ik,ik->k", left.conj(), right))
    conditions = np.linalg.norm(left, axis=0) * np.linalg.norm(right, axis=0) / np.maximum(overlap, 1e-300)
    size = _ROUNDING * len(matrix) * np.linalg.norm(matrix)
    return values.astype(np.complex128), np.minimum(
        size * conditions, np.linalg.norm(matrix) * (size ** (1.0 / len(matrix)))
    )


def _by_spectrum(
    roots: NDArray[np.complex128], errors: Floats
) -> tuple[Finding, Literal["flutter", "divergence"] | None]:
    growing = roots.real > errors
    if growing.any():
        swings = bool((growing & (np.abs(roots.imag) > errors)).any())
        pure = bool((growing & (np.abs(roots.imag) <= errors)).any())
        what = " and ".join(["swings that grow"] * swings + ["a motion that grows without swinging"] * pure)
        reason = f"{int(growing.sum())} of the {len(roots)} eigenvalues have a positive real part: {what}"
        return Finding("unstable", reason), "divergence" if pure else "flutter"
    if (roots.real < -errors).all():
        return Finding("asymptotically stable", "every eigenvalue has a negative real part"), None
    count = int((roots.real >= -errors).sum())
    return Finding(
        "critical", f"{count} of the {len(roots)} eigenvalues are on the imaginary axis within rounding"
    ), None


def _by_hurwitz(c: Floats, k: Floats) -> tuple[Floats, Floats, Finding]:
    """Polynomial, determinants and finding of q'' + c q' + k q = 0, in intervals as wide as rounding."""
    n = len(c)
    matrix = [[(float(i + n == j),) * 2 for j in range(2 * n)] for i in range(n)]
    widths = [_ROUNDING * np.abs(part).max() for part in (k, c)]
    for row in range(n):
        entries = [*zip(-k[row], [widths[0]] * n, strict=True), *zip(-c[row], [widths[1]] * n, strict=True)]
        matrix.append([(float(value - width), float(value + width)) for value, width in entries])
    polynomial = _characteristic(matrix)
    rows = [
        [polynomial[2 * j - i + 1] if 0 <= 2 * j - i + 1 <= 2 * n else (0.0, 0.0) for j in range(2 * n)]
        for i in range(2 * n)
    ]
    minors, minor, finding = [], (1.0, 1.0), None
    for i in range(2 * n):  # elimination without exchanges: the product of pivots is the leading minor
        pivot = rows[i][i]
        minor = mul(minor, pivot)
        minors.append(0.5 * (minor[0] + minor[1]))
        if finding is None and pivot[1] < 0.0:
            finding = Finding("unstable", f"the Hurwitz determinant D{i + 1} is negative")
        elif finding is None and not pivot[0] > 0.0:
            finding = Finding("critical", f"the Hurwitz determinant D{i + 1} is zero within rounding")
        for j in range(i + 1, 2 * n):
            factor = div(rows[j][i], pivot)
            rows[j] = [sub(a, mul(factor, b)) for a, b in zip(rows[j], rows[i], strict=True)]
    for power, (_, high) in enumerate(polynomial):
        if high < 0.0:
            finding = Finding("unstable", f"the coefficient p{2 * n - power} is negative: a root grows")
    if finding is None:
        finding = Finding("asymptotically stable", f"all {2 * n} Hurwitz determinants are positive")
    values = np.array([0.5 * (low + high) for low, high in polynomial])
    return values, np.array([m if np.isfinite(m) else np.nan for m in minors]), finding


def _characteristic(matrix: list[list[Interval]]) -> list[Interval]:
    """Coefficients of the monic characteristic polynomial, powers falling (Faddeev and LeVerrier)."""
    size = len(matrix)
    found: list[Interval] = [(1.0, 1.0)]
    power = [[(0.0, 0.0)] * size for _ in range(size)]
    for step in range(1, size + 1):
        for i in range(size):
            power[i][i] = add(power[i][i], found[-1])
        product = []
        for row in matrix:
            line = []
            for j in range(size):
                total = (0.0, 0.0)
                for i, entry in enumerate(row):
                    if entry != (0.0, 0.0):
                        total = add(total, mul(entry, power[i][j]))
                line.append(total)
            product.append(line)
        power, trace = product, (0.0, 0.0)
        for i in range(size):
            trace = add(trace, power[i][i])
        found.append(div(trace, (-float(step), -float(step))))
    return found


def _jointly(
    index: int | None,
    damping: Floats,
    spectrum: Finding,
    instability: str | None,
    undamped: bool,
) -> tuple[Finding | None, Any, str]:
    """The potential's finding, the verdict and why."""
    symmetric = 0.5 * (damping + damping.T)
    size = float(np.abs(damping).max())
    loses = bool(np.linalg.eigvalsh(symmetric).min() >= -_ROUNDING * size)
    gyroscopic = bool(np.abs(damping - damping.T).max() > _ROUNDING * size)
    if index is None:
        word = spectrum.verdict
        if word == "unstable":
            return None, word, f"{instability}: {spectrum.reason}"
        if word == "critical" and undamped:
            return None, word, "nothing damps and all swings keep their size; second order does not decide"
        return None, word, spectrum.reason
    if index == -2:
        reason = "the Hessian of U is singular within rounding"
        return Finding("critical", reason), "critical", f"{reason}; second order does not decide"
    if index > 0:
        reason = f"U falls in {index} of {len(damping)} directions"
        if loses and not gyroscopic:
            return Finding("unstable", reason), "unstable", f"{reason}, which no damping makes stable"
        return Finding("unstable", reason), spectrum.verdict, spectrum.reason
    reason = "the Hessian of U is proved positive definite: U has a minimum"
    finding = Finding("stable", reason)
    if not loses:
        return finding, spectrum.verdict, f"U has a minimum but velocities feed energy in: {spectrum.reason}"
    if spectrum.verdict == "asymptotically stable":
        return finding, spectrum.verdict, f"{reason}, and damping reaches every mode"
    if undamped:
        return finding, "stable", f"{reason}; nothing damps: disturbances stay small but do not die out"
    return finding, "stable", f"{reason}; damping misses a mode to first order, or reaches it within rounding"
