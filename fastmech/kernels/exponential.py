"""The exponential function without branches, so that a loop over lanes becomes packed instructions.

The argument is reduced by multiples of ln 2 in two parts (Cody and Waite, *Software Manual for the Elementary
Functions*, 1980, chapter 6), the Taylor polynomial gives what is left on [-ln(2)/2, ln(2)/2], and the power
of two is added to the exponent's bits.
"""

from __future__ import annotations

from math import factorial
from typing import Any

import numpy as np

from fastmech.jit import by_precision, inlined
from fastmech.kernels.bits import times_power_of_two

_LOG2_E = 1.4426950408889634
_LN2_1 = 6.93147180369123816490e-01  # first 33 bits of ln 2, as in the FreeBSD library's e_exp.c
_LN2_2 = 1.90821492927058770002e-10  # the rest, rounded
_LOG2_E_SINGLE, _LN2_1_SINGLE, _LN2_2_SINGLE = map(
    np.float32, (_LOG2_E, 0.693359375, -2.12194440e-4)
)  # Cephes, expf.c

#: Numbers of this size are the integers, see :mod:`fastmech.kernels.sincos`.
_INTEGERS, _INTEGERS_SINGLE = 1.5 * 2.0**52, np.float32(1.5 * 2.0**23)

#: Below it, the result is that at it: a double's least normal number, nearly.
_LEAST, _LEAST_SINGLE = -708.0, np.float32(-87.0)

_T2, _T3, _T4, _T5, _T6, _T7 = (1.0 / factorial(k) for k in range(2, 8))
_T8, _T9, _T10, _T11, _T12, _T13 = (1.0 / factorial(k) for k in range(8, 14))
_F1, _F2, _F3, _F4, _F5, _F6, _F7 = map(np.float32, (1.0, _T2, _T3, _T4, _T5, _T6, _T7))


@inlined
def exp_double(x: float) -> float:
    """e^x for x <= 709, to 2.3e-16 of the value down to -708; NaN gives NaN."""
    x = _LEAST if x < _LEAST else x
    shifted = x * _LOG2_E + _INTEGERS
    n = shifted - _INTEGERS
    r = (x - n * _LN2_1) - n * _LN2_2
    value = _T8 + r * (_T9 + r * (_T10 + r * (_T11 + r * (_T12 + r * _T13))))
    value = 1.0 + r * (
        1.0 + r * (_T2 + r * (_T3 + r * (_T4 + r * (_T5 + r * (_T6 + r * (_T7 + r * value))))))
    )
    return times_power_of_two(value, shifted)


@inlined
def exp_single(x: Any) -> Any:
    """The same of a float32, x <= 88, to 1.2e-7 of the value down to -87."""
    x = _LEAST_SINGLE if x < _LEAST_SINGLE else x
    shifted = x * _LOG2_E_SINGLE + _INTEGERS_SINGLE
    n = shifted - _INTEGERS_SINGLE
    r = (x - n * _LN2_1_SINGLE) - n * _LN2_2_SINGLE
    value = _F1 + r * (_F1 + r * (_F2 + r * (_F3 + r * (_F4 + r * (_F5 + r * (_F6 + r * _F7))))))
    return times_power_of_two(value, shifted)


exp = by_precision(exp_double, exp_single)
