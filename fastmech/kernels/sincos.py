"""Sine and cosine without branches, so that a loop over lanes becomes packed instructions.

Numba from PyPI has no vector mathematics library: every ``math.sin`` in a loop is a scalar call. Here the
argument is reduced by multiples of pi/2 in three parts (Cody and Waite, *Software Manual for the Elementary
Functions*, 1980, chapter 8), two polynomials give sine and cosine on [-pi/4, pi/4], and the quadrant is
applied by selection. The polynomials' coefficients and the parts of pi/2 are those of the FreeBSD
mathematics library (``k_sin.c``, ``k_cos.c``, ``e_rem_pio2.c``; Sun Microsystems 1993); for float32 those of
the Cephes library (``sinf.c``; Moshier 1992).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fastmech.jit import by_precision, inlined, rounded_to
from fastmech.kernels.bits import from_bits, to_bits

#: Largest angle [rad] for which the reduction is used: multiples up to 2**20 keep its first products exact.
#: In float32 fused instructions do; without those they round, beyond 1e4, by no more than the angle has been.
REDUCTION_LIMIT = 1.0e6

_TWO_OVER_PI = 0.6366197723675814
_HALF_PI_1 = 1.57079632673412561417e00  # first 33 bits of pi/2
_HALF_PI_2 = 6.07710050630396597660e-11  # next 33 bits
_HALF_PI_3 = 2.02226624879595063154e-21  # the rest, rounded

#: Doubles of this size are the integers: adding it rounds to one, whose two's complement ends the bits.
_INTEGERS = 1.5 * 2.0**52
_SIGN = np.int64(-(2**63))  # the bit of a double's sign

_S1, _S2, _S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
_S4, _S5, _S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
_C1, _C2, _C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
_C4, _C5, _C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11

#: The same for float32; pi/2 in its first 8 bits, the next 11 and the rest.
_TWO_OVER_PI_SINGLE, _ONE, _TWO, _HALF = map(np.float32, (_TWO_OVER_PI, 1.0, 2.0, 0.5))
_HALF_PI_1_SINGLE, _HALF_PI_2_SINGLE = map(np.float32, (1.5703125, 4.837512969970703125e-04))
_HALF_PI_3_SINGLE = np.float32(7.54978995489188216e-08)
_S1_SINGLE, _S2_SINGLE, _S3_SINGLE = map(np.float32, (-1.6666654611e-1, 8.3321608736e-3, -1.9515295891e-4))
_C1_SINGLE, _C2_SINGLE, _C3_SINGLE = map(
    np.float32, (4.166664568298827e-2, -1.388731625493765e-3, 2.443315711809948e-5)
)


@inlined
def sincos_double(x: float) -> tuple[float, float]:
    """Sine and cosine of ``x`` [rad], ``abs(x) <= REDUCTION_LIMIT``; NaN gives NaN.

    Beyond the limit the result is inaccurate: block kernels compute such lanes again with the library's
    functions.
    """
    shifted = x * _TWO_OVER_PI + _INTEGERS
    n = shifted - _INTEGERS
    r = ((x - n * _HALF_PI_1) - n * _HALF_PI_2) - n * _HALF_PI_3
    quadrant = to_bits(shifted)  # its last two bits
    odd = (quadrant & 1) != 0  # swaps sine and cosine
    z = r * r
    s = r + r * z * (_S1 + z * (_S2 + z * (_S3 + z * (_S4 + z * (_S5 + z * _S6)))))
    c = 1.0 - 0.5 * z + z * z * (_C1 + z * (_C2 + z * (_C3 + z * (_C4 + z * (_C5 + z * _C6)))))
    sine, cosine = (c if odd else s), (s if odd else c)
    sine = from_bits(to_bits(sine) ^ ((quadrant << 62) & _SIGN))
    cosine = from_bits(to_bits(cosine) ^ (((quadrant + 1) << 62) & _SIGN))
    return sine, cosine


@inlined
def sincos_single(x: Any) -> Any:
    """Sine and cosine of a float32 ``x`` [rad], ``abs(x) <= REDUCTION_LIMIT``; NaN gives NaN.

    Absolute error at most 1.3e-7; beside zeros, where less is left, at most 1e-4 of the value.
    """
    n = np.floor(x * _TWO_OVER_PI_SINGLE + _HALF)
    r = ((x - n * _HALF_PI_1_SINGLE) - n * _HALF_PI_2_SINGLE) - n * _HALF_PI_3_SINGLE
    half = np.floor(_HALF * n)
    odd = n - _TWO * half
    sign = _ONE - _TWO * (half - _TWO * np.floor(_HALF * half))
    z = r * r
    s = r + r * z * (_S1_SINGLE + z * (_S2_SINGLE + z * _S3_SINGLE))
    c = _ONE - _HALF * z + z * z * (_C1_SINGLE + z * (_C2_SINGLE + z * _C3_SINGLE))
    return sign * (c if odd > _HALF else s), sign * (-s if odd > _HALF else c)


sincos = by_precision(sincos_double, sincos_single)


@inlined
def turned(s: float, c: float, d: float) -> tuple[float, float]:
    """Sine and cosine of x + ``d`` from those of x, right to the fourth order in the small ``d`` [rad]."""
    q = d * d
    sine = d - d * q * rounded_to(d, 1.0 / 6.0)
    versine = q * (rounded_to(d, 0.5) - q * rounded_to(d, 1.0 / 24.0))
    return s + (c * sine - s * versine), c - (s * sine + c * versine)


@inlined
def reduction_limit(x: float) -> float:
    """Largest angle [rad] for which the reduction is used, as a number of the kind of ``x``."""
    return rounded_to(x, REDUCTION_LIMIT)


@inlined
def sin(x: float) -> float:
    """Sine of ``x`` [rad] for right-hand sides, whatever its size.

    Up to 1e6 rad own arithmetic that becomes packed instructions, beyond it the library's.
    """
    return sincos(x)[0] if abs(x) <= reduction_limit(x) else np.sin(x)


@inlined
def cos(x: float) -> float:
    """Cosine of ``x`` [rad] for right-hand sides, whatever its size, see :func:`sin`."""
    return sincos(x)[1] if abs(x) <= reduction_limit(x) else np.cos(x)


@inlined
def sin_within(x: float) -> float:
    """What :func:`sin` gives, without the call that keeps a loop from being packed.

    Raises:
        OverflowError: ``x`` lies beyond the reduction's limit. NaN gives NaN.
    """
    if abs(x) > reduction_limit(x):
        raise OverflowError
    return sincos(x)[0]


@inlined
def cos_within(x: float) -> float:
    """What :func:`cos` gives, see :func:`sin_within`."""
    if abs(x) > reduction_limit(x):
        raise OverflowError
    return sincos(x)[1]


#: For the loop over lanes: what may be called in the place of what.
WITHIN: dict[Callable[[float], float], Callable[[float], float]] = {sin: sin_within, cos: cos_within}
