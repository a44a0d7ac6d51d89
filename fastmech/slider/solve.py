"""One compiled call from reduced coefficients to certified equilibria, for many scenes in a row."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import boolean, types
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.jit import MATRIX, STATUSES, VECTOR, inlined, interpreted, kernel, named_tuple
from fastmech.outcome import Outcome
from fastmech.slider.proof import AT_FOLD, COMPLETE, UNPROVED, apart, certify, unbalance
from fastmech.slider.reduced import potential
from fastmech.slider.theorem import (
    EPS,
    LAPS,
    MOST,
    Pulls,
    candidates,
    expected_count,
    hessian,
    normal_form,
    polish,
    pulls,
    vanishing,
    wrap,
)

DEGENERATE = int(Outcome.DEGENERATE)

SmallIntegers = NDArray[np.int8]

#: Morse index of an empty slot, and of an equilibrium whose Hessian is singular within rounding.
NO_EQUILIBRIUM = -1
SINGULAR = -2

#: At a cusp three equilibria merge; rounding displaces them by about EPS^(1/3) rad times a condition number.
MERGE = 16.0 * EPS ** (1.0 / 3.0)

#: Energies over the scale that differ by no more are equal within rounding.
EVEN = 32.0 * EPS

INDICES = types.Array(types.int8, 2, "C")


class Roots(NamedTuple):
    """What :func:`solve` writes for n scenes; slots without an equilibrium hold NaN."""

    phi: Floats  #: (n, 6) [rad] in (-pi, pi]
    theta: Floats  #: the same
    energy: Floats  #: (n, 6) U over m2 l^2 less the springs' constant [1/s^2]
    radius: Floats  #: (n, 6) distance [rad] within which the true equilibrium is; infinite: not proved
    index: SmallIntegers  # type: ignore[assignment]  #: (n, 6) Morse index, ``SINGULAR`` or ``NO_EQUILIBRIUM``
    count: SmallIntegers  # type: ignore[assignment]  #: (n,) number found
    expected: SmallIntegers  #: (n,) number by the counting theorem, 0 where rounding hides it
    outcome: SmallIntegers  #: (n,) ``Outcome``
    margin: Floats  #: (n,) distance to the fold [rad], positive with six equilibria; NaN if undefined


SOLUTION: Any = named_tuple([*[MATRIX] * 4, INDICES, *[STATUSES] * 3, VECTOR], Roots)


@inlined
def merge_singular(p: Pulls, error: float, count: int, phi: Floats, theta: Floats, radius: Floats) -> int:
    """Of unproved entries that are the same one, displaced by rounding, keep the one that balances best.

    The margin to the fold is uncertain by ``error`` rad, a position at a cusp by the cube root of that.
    """
    reach = max(MERGE, 4.0 * np.cbrt(error))
    kept = 0
    for i in range(count):
        again = False
        for j in range(kept):
            if (
                np.isinf(radius[i])
                and np.isinf(radius[j])
                and apart(phi[i], theta[i], phi[j], theta[j]) < reach
            ):
                again = True
                if unbalance(p, phi[i], theta[i]) < unbalance(p, phi[j], theta[j]):
                    phi[j], theta[j] = phi[i], theta[i]
        if not again:
            phi[kept], theta[kept], radius[kept] = phi[i], theta[i], radius[i]
            kept += 1
    return kept


@inlined
def energy_at(p: Pulls, phi: float, theta: float) -> float:
    """U over m2 l^2 and the scale, less the springs' constant (paper (10))."""
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    energy: float = potential((s1, c1, s2, c2), s1 * c2 + c1 * s2, (p.lift, p.spring, p.gravity), p.force)
    return energy


@inlined
def morse_index(p: Pulls, phi: float, theta: float, radius: float) -> int:
    """Number of negative eigenvalues of the Hessian: proved where the equilibrium is, else ``SINGULAR``."""
    if np.isinf(radius):
        return SINGULAR
    h11, h12, h22 = hessian(p, phi, theta)
    if h11 * h22 - h12 * h12 < 0.0:
        return 1
    return 0 if h11 + h22 > 0.0 else 2


@inlined
def is_before(energy: Floats, phi: Floats, theta: Floats, i: int, j: int) -> bool:
    """Whether entry i is listed before j: the deeper one; of mirror images the one with the smaller theta."""
    if abs(energy[i] - energy[j]) > EVEN:
        return bool(energy[i] < energy[j])
    if abs(wrap(theta[i] - theta[j])) > MERGE:
        return bool(theta[i] < theta[j])
    return bool(phi[i] < phi[j])


@inlined
def sort_by_energy(count: int, energy: Floats, phi: Floats, theta: Floats, radius: Floats) -> None:
    """Deepest first; where a scene is its own mirror image rounding does not decide."""
    for i in range(1, count):
        for j in range(i, 0, -1):
            if not is_before(energy, phi, theta, j, j - 1):
                break
            energy[j], energy[j - 1] = energy[j - 1], energy[j]
            phi[j], phi[j - 1] = phi[j - 1], phi[j]
            theta[j], theta[j - 1] = theta[j - 1], theta[j]
            radius[j], radius[j - 1] = radius[j - 1], radius[j]


@kernel(types.void(MATRIX, boolean, SOLUTION))
def solve(coefficients: Floats, inherit: bool, out: Roots) -> None:
    """Equilibria of every row of ``coefficients``, deepest first, with the outcome of the proof.

    Args:
        coefficients: (n, 8) rows of ``fastmech.slider.coefficients.Coefficients``, the force frozen.
        inherit: whether a row first tries Newton's method from the row before; what that gives counts only
            if its completeness is proved, else the row is searched afresh.
        out: written.
    """
    phi, theta, energy, radius, index = out.phi, out.theta, out.energy, out.radius, out.index
    count, expected, outcome, margin = out.count, out.expected, out.outcome, out.margin
    at_phi, at_theta, at_radius = np.empty(LAPS), np.empty(LAPS), np.empty(LAPS)
    for row in range(coefficients.shape[0]):
        for i in range(MOST):
            phi[row, i], theta[row, i], energy[row, i], radius[row, i] = np.nan, np.nan, np.nan, np.nan
            index[row, i] = NO_EQUILIBRIUM
        count[row], expected[row], outcome[row], margin[row] = 0, 0, UNPROVED, np.nan
        mass, lift, spring = coefficients[row, 0], coefficients[row, 2], coefficients[row, 3]
        gravity, force = coefficients[row, 4], coefficients[row, 5]
        p = pulls(mass, lift, spring, gravity, force)
        if not np.isfinite(lift + spring + gravity + force):
            continue
        if vanishing(p) >= 2:
            outcome[row] = DEGENERATE
            continue
        n = normal_form(p)
        expected[row] = expected_count(n)
        margin[row] = n.peak - n.distance
        found = 0
        if inherit and row > 0 and outcome[row - 1] == COMPLETE and count[row - 1] == expected[row]:
            found = int(count[row - 1])
            for i in range(found):
                at_phi[i], at_theta[i] = polish(p, phi[row - 1, i], theta[row - 1, i])
            outcome[row] = certify(p, n, found, at_phi, at_theta, radius=at_radius)
        if found == 0 or outcome[row] != COMPLETE:
            found = candidates(p, n, at_phi, at_theta)
            outcome[row] = certify(p, n, found, at_phi, at_theta, radius=at_radius)
        if outcome[row] == AT_FOLD:
            found = min(MOST, merge_singular(p, n.error, found, at_phi, at_theta, radius=at_radius))
        scale = max(np.hypot(lift, force), np.hypot(gravity, force), spring)
        for i in range(found):
            phi[row, i], theta[row, i], radius[row, i] = at_phi[i], at_theta[i], at_radius[i]
            energy[row, i] = energy_at(p, at_phi[i], at_theta[i])
        sort_by_energy(found, energy[row], phi[row], theta[row], radius[row])
        for i in range(found):
            energy[row, i] *= scale
            index[row, i] = morse_index(p, phi[row, i], theta[row, i], radius[row, i])
        count[row] = found


def solve_rows(coefficients: Floats, compiled: bool = True) -> Roots:
    """Equilibria of n scenes from their (n, 8) reduced coefficients, contiguous, the force frozen.

    Without ``compiled`` plain Python does the same, up to rounding: in milliseconds a scene, with nothing to
    compile.
    """
    n, code = len(coefficients), np.int8
    places = [np.empty((n, MOST)) for _ in range(4)]
    made: Any = [*places, np.empty((n, MOST), code), *(np.empty(n, code) for _ in range(3)), np.empty(n)]
    result = Roots(*made)
    with np.errstate(all="ignore"):
        (solve if compiled else interpreted(solve))(coefficients, False, result)
    return result


def explain(outcome: Outcome, count: int, expected: int, margin: float) -> str:
    """One sentence for a certificate; a degenerate scene's is made from its parameters instead."""
    if outcome is Outcome.COMPLETE:
        return f"all {count} are proved to exist and to be all"
    if outcome is Outcome.AT_FOLD:
        there = f"{expected} exist" if expected else "how many exist is hidden"
        return f"at a fold within rounding: {there}, {count} are told apart, the merging ones as degenerate"
    if np.isnan(margin):
        return "not proved: the reduced coefficients are not finite"
    return f"not proved: {count} equilibria listed, {expected or 'four to six'} must exist"
