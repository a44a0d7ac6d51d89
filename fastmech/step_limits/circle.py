"""Roots of Adams methods' characteristic polynomials and values of R, for chunks of modes in compiled passes.

A chunk has :data:`CHUNK` modes: loops of that length are packed instructions, and a mode's numbers depend
neither on its place nor on its companions. Complex numbers are kept as real and imaginary parts, which a
vector takes apart otherwise.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.jit import inlined

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Modes of a chunk: whole vectors of any processor.
CHUNK = 16

#: Newton iterations to a root that is near, and the last one's relative size.
NEWTON, CONVERGED = 10, 1e-10


@inlined
def history_weight(z: Any, age: int, predictor: Floats, corrector: Floats) -> Any:
    """Weight of y_(n-age) in the next y of y' = lambda y, for z = h lambda; ``corrector`` may be empty."""
    now = 1.0 if age == 0 else 0.0
    weight = z * predictor[age] + now
    if corrector.size:
        weight = z * (corrector[0] * weight + corrector[age + 1]) + now
    return weight


@inlined
def mark_outside(
    zr: Floats, zi: Floats, factor: Floats, predictor: Floats, corrector: Floats, work: Floats, told: Bools
) -> None:
    """Whether a root of a chunk's polynomials lies outside the circle of radius ``factor``, into ``told``.

    By Schur's recursion (Henrici, *Applied and Computational Complex Analysis I*, section 6.8): a polynomial
    has all roots inside the unit circle if its last coefficient is smaller than its first, and the polynomial
    of one degree less that eliminates the last has them too. ``work`` is (2, degree + 2, CHUNK).
    """
    degree = predictor.size
    re, im = work[0], work[1]  # all coefficients but the first, which is 1; then what a round needs
    last, shrunk = degree, degree + 1
    for i in range(CHUNK):
        told[i] = False
        re[shrunk, i], im[shrunk, i] = -1.0, 1.0 / factor[i]
    for age in range(degree):
        for i in range(CHUNK):
            re[shrunk, i] *= im[shrunk, i]
            weight = history_weight(complex(zr[i], zi[i]), age, predictor, corrector)
            re[age, i], im[age, i] = re[shrunk, i] * weight.real, re[shrunk, i] * weight.imag
    for end in range(degree - 1, -1, -1):
        for i in range(CHUNK):
            size = re[end, i] * re[end, i] + im[end, i] * im[end, i]
            told[i] |= not size < 1.0
            re[last, i], im[last, i] = re[end, i], im[end, i]
            re[shrunk, i] = 1.0 / (1.0 - size)
        for j in range((end + 1) // 2):
            k = end - 1 - j
            for i in range(CHUNK):
                lr, li, scale = re[last, i], im[last, i], re[shrunk, i]
                ar, ai, br, bi = re[j, i], im[j, i], re[k, i], im[k, i]
                re[j, i], im[j, i] = (ar - (lr * br + li * bi)) * scale, (ai - (li * br - lr * bi)) * scale
                re[k, i], im[k, i] = (br - (lr * ar + li * ai)) * scale, (bi - (li * ar - lr * ai)) * scale


@inlined
def find_principal(
    zr: Floats, zi: Floats, predictor: Floats, corrector: Floats, work: Floats, rr: Floats, ri: Floats
) -> None:
    """The roots for exp(z) of a chunk, by Newton's method from there, into ``rr``, ``ri``; NaN: none is near.

    ``work`` is (2, degree + 2, CHUNK).
    """
    degree = predictor.size
    re, im = work[0], work[1]
    found, missing = degree, CHUNK
    for i in range(CHUNK):
        size = np.exp(zr[i])
        rr[i], ri[i], re[found, i] = size * np.cos(zi[i]), size * np.sin(zi[i]), 0.0
    for age in range(degree):
        for i in range(CHUNK):
            weight = history_weight(complex(zr[i], zi[i]), age, predictor, corrector)
            re[age, i], im[age, i] = weight.real, weight.imag
    for _ in range(NEWTON):
        if not missing:
            break
        missing = 0
        for i in range(CHUNK):
            xr, xi, vr, vi, sr, si = rr[i], ri[i], 1.0, 0.0, 0.0, 0.0
            for age in range(degree):
                sr, si = sr * xr - si * xi + vr, sr * xi + si * xr + vi
                vr, vi = vr * xr - vi * xi - re[age, i], vr * xi + vi * xr - im[age, i]
            size = sr * sr + si * si
            mr, mi = (vr * sr + vi * si) / size, (vi * sr - vr * si) / size
            if re[found, i] == 0.0:  # a root that has been found stays what it is, whatever the others do
                rr[i], ri[i] = xr - mr, xi - mi
            near = mr * mr + mi * mi < CONVERGED * CONVERGED * (rr[i] * rr[i] + ri[i] * ri[i])
            re[found, i] = 1.0 if near else re[found, i]
            missing += 0 if re[found, i] else 1
    for i in range(CHUNK):
        if re[found, i] == 0.0:
            rr[i], ri[i] = np.nan, np.nan


@inlined
def polynomial_exceeds(zr: Floats, zi: Floats, factor: Floats, powers: Floats, told: Bools) -> None:
    """Whether |R(z)| exceeds ``factor``, or any number, into ``told``; ``powers`` are R's, rising."""
    for i in range(CHUNK):
        vr, vi = powers[powers.size - 1], 0.0
        for power in range(powers.size - 2, -1, -1):
            vr, vi = vr * zr[i] - vi * zi[i] + powers[power], vr * zi[i] + vi * zr[i]
        told[i] = not np.sqrt(vr * vr + vi * vi) <= factor[i]
