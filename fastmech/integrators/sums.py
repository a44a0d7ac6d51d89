"""Weighted sums of stages over a block's flat memory, in as few passes as can be.

A pass reads every one of its terms once and writes its sum once: what it costs is memory traffic, so a sum
is cut into passes only where it is wider than the vector registers. The compiler must know how wide a pass
is; here it is the length of a tuple, and the functions that unroll it are chosen by that length.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from fastmech.jit import INLINED, inlined, rounded_to

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Terms of the widest pass of one sum, and of two sums over the same rows.
TERMS: tuple[int, ...] = tuple(range(8))
TERMS_OF_TWO: tuple[int, ...] = tuple(range(7))

#: Bytes that processors move at once, and the length of their longest vectors.
CACHE_LINE = 64


@inlined
def rows_of(Y: Floats, count: int) -> Floats:
    """Memory for ``count`` arrays as large as the block ``Y``: flat, and no vector lies on two lines."""
    n, line = count * Y.size, CACHE_LINE // Y.itemsize
    memory = np.empty(n + line, dtype=Y.dtype)
    first = -(memory.ctypes.data // Y.itemsize) % line
    return memory[first : first + n]


@inlined
def pass_width(terms: int, widest: int) -> int:
    """Terms of the next pass: passes as few and as equal as can be."""
    passes = (terms + widest - 1) // widest
    return (terms + passes - 1) // passes


def taken(values: Any, first: int, terms: Any) -> Any:
    """The values from index ``first`` on, as many as there are ``terms``, as a tuple."""
    return tuple(values[first : first + len(terms)])


@overload(taken, jit_options=INLINED, strict=False)
def _taken(values: Any, first: Any, terms: Any) -> Any:
    if len(terms) == 1:
        return lambda values, first, terms: (values[first],)
    return lambda values, first, terms: taken(values, first, terms[:-1]) + (values[first + terms[-1]],)  # noqa: RUF005


def scaled(z: Floats, h: float, values: Any) -> Any:
    """Products of ``h`` and each of a tuple, in the precision of ``z``."""
    return tuple(h * value for value in values)


@overload(scaled, jit_options=INLINED, strict=False)
def _scaled(z: Any, h: Any, values: Any) -> Any:
    if len(values) == 1:
        return lambda z, h, values: (rounded_to(z, h * values[0]),)
    return lambda z, h, values: scaled(z, h, values[:-1]) + (rounded_to(z, h * values[-1]),)  # noqa: RUF005


def weighted(weights: Any, K: Floats, rows: Any, i: int) -> Any:
    """Sum over tuples of weights times element ``i`` of their rows, from the first to the last."""
    return sum(weight * K[row, i] for weight, row in zip(weights, rows, strict=True))


@overload(weighted, jit_options=INLINED, strict=False)
def _weighted(weights: Any, K: Any, rows: Any, i: Any) -> Any:
    if len(weights) == 1:
        return lambda weights, K, rows, i: weights[0] * K[rows[0], i]
    return lambda weights, K, rows, i: weighted(weights[:-1], K, rows[:-1], i) + weights[-1] * K[rows[-1], i]


@inlined
def one_pass(
    z: Floats, y: Floats | None, K: Floats, h: float, row: Integers, weight: Floats, k: int, terms: Any
) -> None:
    """The pass of :func:`add_stages` from weight ``k`` on, of as many terms as there are ``terms``."""
    weights, rows = scaled(z, h, taken(weight, k, terms)), taken(row, k, terms)
    if y is None:
        for i in range(z.shape[0]):
            z[i] += weighted(weights, K, rows, i)
    else:
        for i in range(z.shape[0]):
            z[i] = y[i] + weighted(weights, K, rows, i)


def narrowest_pass(
    z: Any, y: Any, K: Any, h: Any, row: Any, weight: Any, k: Any, count: Any, terms: Any
) -> None:
    """The same of ``count`` terms, at most as many as there are ``terms``."""
    one_pass(z, y, K, h, row, weight, k, terms[:count])


@overload(narrowest_pass, jit_options=INLINED, strict=False)
def _narrowest_pass(
    z: Any, y: Any, K: Any, h: Any, row: Any, weight: Any, k: Any, count: Any, terms: Any
) -> Any:
    width = len(terms)
    if width == 1:
        return lambda z, y, K, h, row, weight, k, count, terms: one_pass(z, y, K, h, row, weight, k, terms)

    def choose(z, y, K, h, row, weight, k, count, terms):  # type: ignore[no-untyped-def]
        if count == width:
            one_pass(z, y, K, h, row, weight, k, terms)
        else:
            narrowest_pass(z, y, K, h, row, weight, k, count, terms[:-1])

    return choose


@inlined
def add_stages(
    z: Floats, y: Floats | None, K: Floats, h: float, row: Integers, weight: Floats, k: int, stop: int
) -> None:
    """z = y + h * sum of weight[k:stop] times the rows of ``K`` they belong to; z += it if ``y`` is ``None``.

    ``z`` must not share memory with ``y`` or ``K``.
    """
    count = pass_width(stop - k, len(TERMS))
    narrowest_pass(z, y, K, h, row, weight, k, count, TERMS)
    k += count
    while k < stop:
        count = pass_width(stop - k, len(TERMS))
        narrowest_pass(z, None, K, h, row, weight, k, count, TERMS)
        k += count


@inlined
def one_pass_of_two(
    z: Floats,
    w: Floats,
    y: Floats | None,
    K: Floats,
    h: float,
    row: Integers,
    p: Floats,
    c: Floats,
    k: int,
    terms: Any,
) -> None:
    """The pass of :func:`add_two_sums` from weight ``k`` on, of as many terms as there are ``terms``."""
    ps, cs, rows = scaled(z, h, taken(p, k, terms)), scaled(z, h, taken(c, k, terms)), taken(row, k, terms)
    for i in range(z.shape[0]):
        first, second = weighted(ps, K, rows, i), weighted(cs, K, rows, i)
        if y is None:
            z[i], w[i] = z[i] + first, w[i] + second
        else:
            z[i], w[i] = y[i] + first, second


def narrowest_pass_of_two(
    z: Any, w: Any, y: Any, K: Any, h: Any, row: Any, p: Any, c: Any, k: Any, count: Any, terms: Any
) -> None:
    """The same of ``count`` terms, at most as many as there are ``terms``."""
    one_pass_of_two(z, w, y, K, h, row, p, c, k, terms[:count])


@overload(narrowest_pass_of_two, jit_options=INLINED, strict=False)
def _narrowest_pass_of_two(
    z: Any, w: Any, y: Any, K: Any, h: Any, row: Any, p: Any, c: Any, k: Any, count: Any, terms: Any
) -> Any:
    width = len(terms)
    if width == 1:
        return lambda z, w, y, K, h, row, p, c, k, count, terms: one_pass_of_two(
            z, w, y, K, h, row, p, c, k, terms
        )

    def choose(z, w, y, K, h, row, p, c, k, count, terms):  # type: ignore[no-untyped-def]
        if count == width:
            one_pass_of_two(z, w, y, K, h, row, p, c, k, terms)
        else:
            narrowest_pass_of_two(z, w, y, K, h, row, p, c, k, count, terms[:-1])

    return choose


@inlined
def add_two_sums(
    z: Floats, w: Floats, y: Floats, K: Floats, h: float, row: Integers, p: Floats, c: Floats
) -> None:
    """z = y + h sum_a p[a] K[row[a]] and w = h sum_a c[a] K[row[a]]: each row is read once for both."""
    k = pass_width(p.shape[0], len(TERMS_OF_TWO))
    narrowest_pass_of_two(z, w, y, K, h, row, p, c, 0, k, TERMS_OF_TWO)
    while k < p.shape[0]:
        count = pass_width(p.shape[0] - k, len(TERMS_OF_TWO))
        narrowest_pass_of_two(z, w, None, K, h, row, p, c, k, count, TERMS_OF_TWO)
        k += count
