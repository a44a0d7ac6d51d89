"""Which small motion grows in the steps taken there, in compiled passes over lanes.

A lane is acquitted by the size of h lambda, else by the method's table of
:mod:`fastmech.step_limits.region`, or its modes are judged by the method's own polynomials.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.jit import MATRIX, STATUSES, VECTOR, inlined, kernel
from fastmech.kernels.passes import LANES, ROWS, STATES, fill_trigonometry, load, load_own
from fastmech.stability.linearize import polynomial, small_motion_at
from fastmech.step_limits.circle import CHUNK, find_principal, mark_outside, polynomial_exceeds
from fastmech.step_limits.limits import (
    ALLOWED,
    CERTAIN,
    GROWS,
    INNOCENT,
    UNSURE,
    errors_of,
    factor_of,
    steps_there,
)
from fastmech.step_limits.local import bound_of, time_near
from fastmech.step_limits.modes import factored, polished
from fastmech.step_limits.predict import GROWTH_PER_RADIAN
from fastmech.step_limits.region import row_of, sector_of

Floats = NDArray[np.float64]

#: Rows of what is known of a lane's motion: its polynomial, the bound on its eigenvalues, the time there, its
#: quadratics and whether they are found, its step and number of steps.
P3, P2, P1, P0, BOUND, TIME, A, B, C, D, FOUND, STEP, NUMBER, KNOWN = range(14)

#: Rows of what is known of modes, behind their lane's polynomial: z = h lambda, the factor that is let pass,
#: that of errors, whether the mode itself is not acquitted, a complex number.
ZR, ZI, FACTOR, ERRORS, DOUBTED, RR, RI, OF_MODES = range(4, 12)

PAIR: Any = types.Tuple((types.int64, types.int64))  # type: ignore[no-untyped-call]
METHOD: Any = (VECTOR, VECTOR, VECTOR)  #: R's coefficients, or predictor and corrector; empty: has none


@inlined
def judge_chunk(
    modes: Floats, powers: Floats, predictor: Floats, corrector: Floats, work: Floats, told: Any
) -> None:
    """Whether a chunk's modes (OF_MODES, CHUNK) grow by more than is let pass, or errors do, into ``told``.

    A mode counts by its own root, and an Adams method's other roots from the growth of errors.
    """
    if powers.size:
        polynomial_exceeds(modes[ZR], modes[ZI], modes[FACTOR], powers, told)
        return
    for i in range(CHUNK):
        modes[RR, i] = max(modes[FACTOR, i], modes[ERRORS, i])
    mark_outside(modes[ZR], modes[ZI], modes[RR], predictor, corrector, work, told)
    left = 0
    for i in range(CHUNK):
        left += (not told[i]) & (modes[FACTOR, i] < modes[ERRORS, i]) & (modes[DOUBTED, i] != 0.0)
    if left:
        find_principal(modes[ZR], modes[ZI], predictor, corrector, work, modes[RR], modes[RI])
        for i in range(CHUNK):
            size = np.sqrt(modes[RR, i] * modes[RR, i] + modes[RI, i] * modes[RI, i])
            asked = (modes[FACTOR, i] < modes[ERRORS, i]) & (modes[DOUBTED, i] != 0.0)
            told[i] |= asked & (size > modes[FACTOR, i])


@inlined
def fill_motion(Y: Floats, p: Floats, known: Floats) -> None:
    """Polynomial, bound and time of lanes, into their rows of ``known``."""
    for i in range(LANES):
        motion = small_motion_at(
            Y[4, i], Y[5, i], Y[6, i], Y[7, i],
            p[0, i], p[1, i], p[2, i], p[3, i], p[4, i], p[5, i], p[6, i],
        )  # fmt: skip
        known[P3, i], known[P2, i], known[P1, i], known[P0, i] = polynomial(motion)
        known[BOUND, i] = bound_of(known[P3, i], known[P2, i], known[P0, i])
        known[TIME, i] = time_near(
            Y[4, i], Y[5, i], Y[6, i], Y[7, i], Y[2, i], Y[3, i], motion,
            p[2, i], p[3, i], p[4, i], p[5, i],
        )  # fmt: skip


@inlined
def collect(
    known: Floats, i: int, quiet: float, sector: Floats, principal: Floats, found: Floats, of: Any, count: int
) -> int:
    """Put modes of lane ``i`` that decay and that no bound acquits behind ``count`` others."""
    step = known[STEP, i]
    there = steps_there(known[TIME, i], step, known[NUMBER, i])
    for quadratic in range(2):
        slope, offset = known[A + 2 * quadratic, i], known[B + 2 * quadratic, i]
        middle, square = -0.5 * slope, 0.25 * slope * slope - offset
        root = np.sqrt(abs(square))
        farther = middle if square < 0.0 else middle + np.copysign(root, middle)
        for other in range(1 if square < 0.0 else 2):
            imaginary = root if square < 0.0 else 0.0
            real = farther
            if other:
                real = offset / farther if farther != 0.0 else 0.0
            size = np.sqrt(real * real + imaginary * imaginary)
            # Half of what counts as decay, as the factors are not exact.
            if step * size > quiet and real < -0.5 * GROWTH_PER_RADIAN * size:
                row, column = int(row_of(step * size)), int(sector_of(real, imaginary))
                if not sector[row, column] * there <= CERTAIN * ALLOWED:
                    doubted = not principal[row, column] * there <= CERTAIN * ALLOWED
                    found[0, count], found[1, count], found[2, count] = (
                        real,
                        imaginary,
                        1.0 if doubted else 0.0,
                    )
                    of[count] = i
                    count += 1
    return count


@kernel(
    PAIR(
        STATES,
        MATRIX,
        VECTOR,
        VECTOR,
        *METHOD,
        *(MATRIX, MATRIX, VECTOR),
        types.float64,
        types.float64,
        types.boolean,
        STATUSES,
    )
)
def judge_states(
    states: Floats,
    own: Floats,
    dt: Floats,
    number: Floats,
    powers: Floats,
    predictor: Floats,
    corrector: Floats,
    sector: Floats,
    principal: Floats,
    largest: Floats,
    quiet: float,
    spurious: float,
    stiffest: bool,
    verdicts: NDArray[np.int8],
) -> tuple[int, int]:
    """Judge the small motion at states (n, 4) in steps of dt [s], of which so many are taken in all.

    ``own`` are the :func:`fastmech.kernels.passes.columns` of the coefficients; ``dt`` and ``number`` have
    one entry for all or one for each; ``sector``, ``principal``, ``largest`` are the method's table, and h
    lambda of size ``quiet`` is acquitted in the greatest number of steps. Errors of an Adams method count
    from a growth by ``spurious`` in all steps; inf: they do not. Lanes that have a verdict keep it.
    With ``stiffest`` only those are judged that are stiffer than the ones found growing before.

    Returns:
        of the lanes found growing, the one whose eigenvalues' bound is greatest, -1: none; and how many
        lanes were looked at closer than by their size.
    """
    n, last_dt, last_number = states.shape[0], dt.size - 1, number.size - 1
    Y, p = np.empty((ROWS, LANES)), np.empty((own.shape[0], LANES))
    known = np.empty((KNOWN, LANES))
    found, of = np.empty((3, 4 * LANES)), np.empty(4 * LANES, dtype=np.int64)
    modes, work = np.empty((OF_MODES, CHUNK)), np.empty((2, predictor.size + 2, CHUNK))
    sure, told = np.empty(CHUNK, dtype=np.bool_), np.empty(CHUNK, dtype=np.bool_)
    worst, place, closer = 0.0, -1, 0
    for first in range(0, n, LANES):
        load(states, first, Y, 0)
        fill_trigonometry(Y)
        load_own(own, first, p)
        for i in range(LANES):
            known[STEP, i] = dt[min(first + i, last_dt)]
            known[NUMBER, i] = number[min(first + i, last_number)]
        fill_motion(Y, p, known)
        suspects = 0
        for i in range(LANES):
            suspects += (known[STEP, i] * known[BOUND, i] > quiet) & (p[6, i] > 0.0)
        if not suspects:
            continue
        closer += suspects
        for i in range(LANES):
            known[A, i], known[B, i], known[C, i], known[D, i], whole = factored(
                known[P3, i], known[P2, i], known[P1, i], known[P0, i]
            )
            known[FOUND, i] = 1.0 if whole else 0.0
        count = 0
        for i in range(min(LANES, n - first)):
            size, bound = known[STEP, i] * known[BOUND, i], known[BOUND, i]
            if not (size > quiet and p[6, i] > 0.0 and bound < np.inf and verdicts[first + i] == INNOCENT):
                continue
            if stiffest and bound <= worst:
                continue
            if largest[int(row_of(size))] * known[NUMBER, i] <= CERTAIN * ALLOWED:
                continue
            if known[FOUND, i]:
                count = collect(known, i, quiet, sector, principal, found, of, count)
            else:
                verdicts[first + i] = UNSURE
        for begin in range(0, count, CHUNK):
            for j in range(CHUNK):
                k = min(begin + j, count - 1)
                i = of[k]
                for row in range(4):
                    modes[row, j] = known[row, i]
                step, most = known[STEP, i], known[NUMBER, i]
                modes[RR, j], modes[RI, j], modes[DOUBTED, j] = found[0, k], found[1, k], found[2, k]
                modes[ZR, j], modes[ERRORS, j] = step, errors_of(most, spurious)
                modes[FACTOR, j] = factor_of(steps_there(known[TIME, i], step, most))
            for j in range(CHUNK):
                real, imaginary, sure[j] = polished(
                    modes[RR, j], modes[RI, j], modes[P3, j], modes[P2, j], modes[P1, j], modes[P0, j]
                )
                size = np.sqrt(real * real + imaginary * imaginary)
                # A mode that does not decay after all is taken for one at rest, which does not grow.
                step = modes[ZR, j] if real < -GROWTH_PER_RADIAN * size else 0.0
                # Beside critical damping a mode may have become its conjugate: the two grow alike.
                modes[ZR, j], modes[ZI, j] = step * real, step * abs(imaginary)
            judge_chunk(modes, powers, predictor, corrector, work, told)
            for j in range(min(CHUNK, count - begin)):
                i = of[begin + j]
                if not sure[j]:
                    verdicts[first + i] = UNSURE
                elif told[j] and verdicts[first + i] == INNOCENT:
                    verdicts[first + i] = GROWS
        for i in range(min(LANES, n - first)):
            if stiffest and verdicts[first + i] == GROWS and known[BOUND, i] > worst:
                worst, place = known[BOUND, i], first + i
    return place, closer


@kernel(
    types.void(VECTOR, VECTOR, VECTOR, VECTOR, *METHOD, types.float64, types.Array(types.boolean, 1, "C"))
)
def judge_modes(
    real: Floats,
    imaginary: Floats,
    there: Floats,
    number: Floats,
    powers: Floats,
    predictor: Floats,
    corrector: Floats,
    spurious: float,
    grow: NDArray[np.bool_],
) -> None:
    """Which modes z = h lambda (n,) that decay grow in ``there`` steps.

    Or errors do, by ``spurious`` in ``number`` steps; inf: they do not count.
    """
    modes, work = np.empty((OF_MODES, CHUNK)), np.empty((2, predictor.size + 2, CHUNK))
    told = np.empty(CHUNK, dtype=np.bool_)
    for first in range(0, real.size, CHUNK):
        for j in range(CHUNK):
            k = min(first + j, real.size - 1)
            modes[ZR, j], modes[ZI, j] = real[k], imaginary[k]
            modes[FACTOR, j], modes[ERRORS, j] = factor_of(there[k]), errors_of(number[k], spurious)
            modes[DOUBTED, j] = 1.0
        judge_chunk(modes, powers, predictor, corrector, work, told)
        for j in range(min(CHUNK, real.size - first)):
            grow[first + j] = told[j]
