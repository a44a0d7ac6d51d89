"""The exponential function without branches, so that a loop over lanes becomes packed instructions.

The argument is reduced by multiples of ln 2 in two parts (Cody and Waite, *Software Manual for the Elementary
Functions*, 1980, chapter 6), the Taylor polynomial gives what is left on [-ln(2)/2, ln(2)/2], and the power
of two is added to the exponent's bits.
"""

from __future__ import annotations

from math import factorial

from fastmech.jit import by_precision, inlined, rounded_to
from fastmech.kernels.bits import times_power_of_two

_LOG2_E = 1.4426950408889634
_LN2_1 = 6.93147180369123816490e-01  # first 33 bits of ln 2, as in the FreeBSD library's e_exp.c
_LN2_2 = 1.90821492927058770002e-10  # the rest, rounded
_LN2_1_SINGLE, _LN2_2_SINGLE = 0.693359375, -2.12194440e-4  # Cephes, expf.c

#: Numbers of this size are the integers, see :mod:`fastmech.kernels.sincos`.
_INTEGERS, _INTEGERS_SINGLE = 1.5 * 2.0**52, 1.5 * 2.0**23

#: Below it, the result is that at it: a double's least normal number, nearly.
_LEAST, _LEAST_SINGLE = -708.0, -87.0

_T2, _T3, _T4, _T5, _T6, _T7 = (1.0 / factorial(k) for k in range(2, 8))
_T8, _T9, _T10, _T11, _T12, _T13 = (1.0 / factorial(k) for k in range(8, 14))


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
def exp_single(x: float) -> float:
    """The same of a float32, x <= 88, to 1.2e-7 of the value down to -87."""
    x = rounded_to(x, _LEAST_SINGLE) if x < rounded_to(x, _LEAST_SINGLE) else x
    integers = rounded_to(x, _INTEGERS_SINGLE)
    shifted = x * rounded_to(x, _LOG2_E) + integers
    n = shifted - integers
    r = (x - n * rounded_to(x, _LN2_1_SINGLE)) - n * rounded_to(x, _LN2_2_SINGLE)
    one, t2, t3, t4 = rounded_to(x, 1.0), rounded_to(x, _T2), rounded_to(x, _T3), rounded_to(x, _T4)
    t5, t6, t7 = rounded_to(x, _T5), rounded_to(x, _T6), rounded_to(x, _T7)
    value = one + r * (one + r * (t2 + r * (t3 + r * (t4 + r * (t5 + r * (t6 + r * t7))))))
    return times_power_of_two(value, shifted)


exp = by_precision(exp_double, exp_single)
