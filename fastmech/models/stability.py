"""Stability of a mechanism's equilibrium: by its potential, by Hurwitz, by the eigenvalues, in one word."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.arrays import Floats
from fastmech.errors import InputError, shown
from fastmech.intervals.arithmetic import Interval, add, div, mul, product, sub
from fastmech.loads import held_at
from fastmech.models.equilibria import RestingPlace, find_equilibria
from fastmech.models.mechanism import Linear, Mechanism
from fastmech.objects import Printed
from fastmech.scene import Scene
from fastmech.slider import stability as of_scene
from fastmech.slider.equilibria import require_one
from fastmech.slider.lagrange import linear
from fastmech.slider.linearize import jacobian, passing_eigenvalues, under_its_forces
from fastmech.slider.stability import ASYMPTOTIC, CRITICAL, STABLE, UNSTABLE, VERDICTS, Finding

#: Matrices are taken to be wrong by so many units of rounding of their largest entry.
_ROUNDING = 32.0 * 2.0**-52

#: In place of a Morse index where there is no potential.
_NONE = -1

#: Systems whose modes are remembered.
KEPT = 4096


@dataclass(frozen=True, eq=False, repr=False)
class Stability(Printed):
    """What decides whether a mechanism stays at an equilibrium; SI units."""

    eigenvalues: NDArray[np.complex128]  #: (2 n,) [1/s], largest real part first
    eigenvalue_errors: Floats  #: bounds on their errors (2 n,) [1/s], of first order in rounding
    polynomial: Floats  #: characteristic polynomial (2 n + 1,), monic, powers falling
    hurwitz_determinants: Floats  #: D1 .. D2n
    potential: Finding | None  #: Lagrange-Dirichlet; None where forces have no potential
    hurwitz: Finding
    spectrum: Finding  #: by the eigenvalues
    verdict: of_scene.Word
    instability: Literal["flutter", "divergence"] | None  #: growing swings, or growth without; if unstable
    explanation: str
    nonlinear: bool = False  #: dampers take energy, but not to first order

    told = of_scene.told_stability

    @property
    def decay_time(self) -> float:
        """Time [s] in which the slowest linear mode falls to 1/e; inf: it does not.

        NaN: not stable, or damped, but not exponentially.
        """
        if self.verdict != "asymptotically stable":
            return np.inf if self.verdict == "stable" and not self.nonlinear else np.nan
        return -1.0 / float(self.eigenvalues.real.max())


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
    found = assess(require_own(system, equilibrium), equilibrium.morse_index, damped=system.damped)
    return replace(found, explanation="; ".join(filter(None, (found.explanation, held_at(system.loads)))))


def require_own(system: Mechanism, equilibrium: Any) -> Linear:
    """The linearization of a mechanism at one of its equilibria.

    Raises:
        InputError: it is none, or another mechanism's.
    """
    require_one(equilibrium, RestingPlace)
    if equilibrium.position.size == len(system.coordinates):
        linear, own = system.linear(equilibrium.position), equilibrium.stiffness
        if np.allclose(linear.stiffness, own, rtol=1e-9, atol=1e-9 * np.abs(linear.stiffness).max()):
            return linear
    raise InputError(f"equilibrium = {shown(equilibrium.position.tolist())}: is another mechanism's")


def assess(linear: Linear, morse_index: int | None, *, damped: bool = False) -> Stability:
    """Stability from the linearization, and from the proved Morse index where there is a potential.

    ``morse_index`` is None without a potential and -2 where the Hessian is not proved to be regular;
    ``damped`` tells of dampers that the linearization may lack.
    """
    whole = Linear(*(np.asarray(matrix, dtype=np.float64)[None] for matrix in linear))
    own, c, k = spectra(whole)
    n = whole.mass.shape[1]
    roots, errors, rate = own.roots[0], own.errors[0], float(own.rate[0])
    spectrum, instability = _by_spectrum(roots, errors)
    polynomial, minors, hurwitz = _by_hurwitz(c[0], k[0])
    verdict = VERDICTS[int(verdicts(own, np.array([_NONE if morse_index is None else morse_index]))[0])]
    nonlinear = damped and bool(own.undamped[0])
    potential, explanation = _why(morse_index, own, spectrum, instability, n, nonlinear=nonlinear)
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
        nonlinear=nonlinear,
    )


def linear_of(system: Scene | Mechanism, position: ArrayLike) -> Linear:
    """Mass, damping and stiffness (..., n, n) about positions (..., n), loads at what they come to."""
    if isinstance(system, Mechanism):
        return system.linear(position)
    return Linear(*linear(system, position))


def state_matrix(system: Scene | Mechanism, equilibrium: Any) -> Floats:
    """Of the rates of states by states, at an equilibrium (states, states).

    Raises:
        InputError: the equilibrium is none, or another system's.
    """
    if not isinstance(system, Mechanism):
        return jacobian(system, equilibrium)
    mass, damping, stiffness = require_own(system, equilibrium)
    rates = np.linalg.solve(mass, np.concatenate([-stiffness, -damping], axis=1))
    return np.concatenate([np.eye(len(mass), 2 * len(mass), len(mass)), rates])


@lru_cache(KEPT)
def modes(system: Scene | Mechanism) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Eigenvalues [1/s] of small motions where a system can rest and is not unstable, and where it passes.

    A scene is looked at with its force at full strength and with what the force comes to. Where a mechanism
    passes is not looked at.
    """
    held: list[Any] = [system] if isinstance(system, Mechanism) else under_its_forces(system)
    judged = [classify(one, place) for one in held for place in find_equilibria(one)]
    resting = [found.eigenvalues for found in judged if found.verdict != "unstable"]
    passing = np.zeros(0, np.complex128) if isinstance(system, Mechanism) else passing_eigenvalues(held)
    # A scene that rests all along a line has no isolated place of rest: any may be one.
    return np.concatenate(resting) if resting else passing, passing


class Spectra(NamedTuple):
    """Eigenvalues of many linearizations, and what verdicts need besides; arrays over m of them."""

    roots: NDArray[np.complex128]  #: over ``rate`` (m, 2 n), largest real part first
    errors: Floats  #: bounds on their errors (m, 2 n)
    rate: Floats  #: by which times are measured (m,) [1/s]
    undamped: NDArray[np.bool_]  #: no damping at all (m,)
    loses: NDArray[np.bool_]  #: damping takes energy, whatever the motion (m,)
    gyroscopic: NDArray[np.bool_]  #: it has a part that turns motions (m,)


def spectra(linear: Linear) -> tuple[Spectra, Floats, Floats]:
    """Eigenvalues of linearizations (m, n, n), and their damping and stiffness by mass, over the rate."""
    mass, damping, stiffness = linear
    m, n = mass.shape[:2]
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    by_mass = [inverse @ matrix @ inverse.mT for matrix in (damping, stiffness)]
    rate = np.maximum(np.sqrt(np.abs(by_mass[1]).max((1, 2))), np.abs(by_mass[0]).max((1, 2)))
    rate[rate == 0.0] = 1.0
    c, k = by_mass[0] / rate[:, None, None], by_mass[1] / rate[:, None, None] ** 2
    undamped: Any = ~damping.any((1, 2))
    roots, errors = np.empty((m, 2 * n), dtype=np.complex128), np.empty((m, 2 * n))
    if undamped.any():
        squares, wrong = _eigenvalues(-k[undamped])
        half = np.sqrt(squares)
        size = np.maximum(np.abs(half), np.sqrt(wrong))
        roots[undamped] = np.concatenate([half, -half], axis=1)
        errors[undamped] = np.tile(wrong / np.maximum(size, 1e-300), 2)
    if not undamped.all():
        some = ~undamped
        matrices = np.zeros((int(some.sum()), 2 * n, 2 * n))
        matrices[:, :n, n:] = np.eye(n)
        matrices[:, n:, :n], matrices[:, n:, n:] = -k[some], -c[some]
        roots[some], errors[some] = _eigenvalues(matrices)
    order = np.lexsort((-roots.imag, -roots.real))
    roots, errors = (np.take_along_axis(values, order, axis=1) for values in (roots, errors))
    size = np.abs(damping).max((1, 2))
    loses: Any = np.linalg.eigvalsh(0.5 * (damping + damping.mT))[:, 0] >= -_ROUNDING * size
    gyroscopic: Any = np.abs(damping - damping.mT).max((1, 2)) > _ROUNDING * size
    return Spectra(roots, errors, rate, undamped, loses, gyroscopic=gyroscopic), c, k


def verdicts(own: Spectra, morse_index: NDArray[np.integer[Any]]) -> NDArray[np.int8]:
    """Numbers of :data:`VERDICTS` (m,) from eigenvalues and proved Morse indices (-1: no potential)."""
    growing = (own.roots.real > own.errors).any(axis=1)
    falling = (own.roots.real < -own.errors).all(axis=1)
    spectrum = np.where(growing, UNSTABLE, np.where(falling, ASYMPTOTIC, CRITICAL))
    found = np.where(~own.loses | (spectrum == ASYMPTOTIC), spectrum, STABLE)
    found = np.where(morse_index > 0, np.where(own.loses & ~own.gyroscopic, UNSTABLE, spectrum), found)
    found = np.where(morse_index == -2, CRITICAL, found)
    return np.where(morse_index == _NONE, spectrum, found).astype(np.int8)


def growth(own: Spectra, morse_index: NDArray[np.integer[Any]]) -> NDArray[np.int8]:
    """How many eigenvalues grow, and how many of these swing (m, 2): as proved where a potential decides."""
    growing = own.roots.real > own.errors
    counts = np.stack([growing.sum(1), (growing & (np.abs(own.roots.imag) > own.errors)).sum(1)], axis=1)
    decided = own.loses & ((morse_index == 0) | ((morse_index > 0) & ~own.gyroscopic))
    by_potential = np.stack([morse_index, np.zeros_like(morse_index)], axis=1)
    return np.where(decided[:, None], by_potential, counts).astype(np.int8)


def _eigenvalues(matrices: Floats) -> tuple[NDArray[np.complex128], Floats]:
    """Eigenvalues (m, s), and how far rounding of a matrix may move each (Wilkinson's condition numbers)."""
    values, right = np.linalg.eig(matrices)
    s = matrices.shape[1]
    conditions = np.full(values.shape, np.inf)
    try:
        conditions = np.linalg.norm(np.linalg.inv(right), axis=2) * np.linalg.norm(right, axis=1)
    except np.linalg.LinAlgError:  # one of them has too few eigenvectors: the others one by one
        for k, vectors in enumerate(right):
            with contextlib.suppress(np.linalg.LinAlgError):
                left = np.linalg.inv(vectors)
                conditions[k] = np.linalg.norm(left, axis=1) * np.linalg.norm(vectors, axis=0)
    norm = np.linalg.norm(matrices, axis=(1, 2))[:, None]
    size = _ROUNDING * s * norm
    return values.astype(np.complex128), np.minimum(size * conditions, norm * size ** (1.0 / s))


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
    told = f"{count} of the {len(roots)} eigenvalues are on the imaginary axis within rounding"
    return Finding("critical", told), None


def _by_hurwitz(c: Floats, k: Floats) -> tuple[Floats, Floats, Finding]:
    """Polynomial, determinants and finding of q'' + c q' + k q = 0, in intervals as wide as rounding."""
    n = len(c)
    matrix = [[(float(i + n == j),) * 2 for j in range(2 * n)] for i in range(n)]
    widths = [_ROUNDING * np.abs(part).max() for part in (k, c)]
    for row in range(n):
        entries = [*zip(-k[row], [widths[0]] * n, strict=True), *zip(-c[row], [widths[1]] * n, strict=True)]
        matrix.append([(float(value - width), float(value + width)) for value, width in entries])
    polynomial, zero = _characteristic(matrix), (0.0, 0.0)
    places = [[2 * j - i + 1 for j in range(2 * n)] for i in range(2 * n)]
    rows = [[polynomial[k] if 0 <= k <= 2 * n else zero for k in row] for row in places]
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
        power, trace = product(matrix, power), (0.0, 0.0)
        for i in range(size):
            trace = add(trace, power[i][i])
        found.append(div(trace, (-float(step), -float(step))))
    return found


def _why(
    index: int | None, own: Spectra, spectrum: Finding, instability: str | None, n: int, *, nonlinear: bool
) -> tuple[Finding | None, str]:
    """The potential's finding, and why the verdict is what it is."""
    loses, gyroscopic, undamped = bool(own.loses[0]), bool(own.gyroscopic[0]), bool(own.undamped[0])
    if index is None:
        if spectrum.verdict == "unstable":
            return None, f"{instability}: {spectrum.reason}"
        if spectrum.verdict == "critical" and undamped and not nonlinear:
            return None, "nothing damps and all swings keep their size; second order does not decide"
        return None, spectrum.reason
    if index == -2:
        reason = "the Hessian of U is singular within rounding"
        return Finding("critical", reason), f"{reason}; second order does not decide"
    if index > 0:
        reason = f"U falls in {index} of {n} directions"
        told = f"{reason}, which no damping makes stable" if loses and not gyroscopic else spectrum.reason
        return Finding("unstable", reason), told
    reason = "the Hessian of U is proved positive definite: U has a minimum"
    finding = Finding("stable", reason)
    if not loses:
        return finding, f"U has a minimum but velocities feed energy in: {spectrum.reason}"
    if spectrum.verdict == "asymptotically stable":
        return finding, f"{reason}, and damping reaches every mode"
    if nonlinear:
        lost = "no linear damping: disturbances lose energy, but do not decay exponentially"
        return finding, f"{reason}; {lost}"
    if undamped:
        return finding, f"{reason}; nothing damps: disturbances stay small but do not die out"
    return finding, f"{reason}; damping misses a mode to first order, or reaches it within rounding"
