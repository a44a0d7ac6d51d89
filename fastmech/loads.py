"""Loads: force laws F(t) [N, or N m of a torque] as data. To add one, write a class like these.

A load tells its value over time as an expression, a bound, the work that it can still do, and its period.
Numbers may be a mechanism's parameters, as SymPy symbols: ``load.at(values)`` puts their values in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from fastmech.errors import InputError, shown


@dataclass(frozen=True, eq=False)
class Load:
    """What all loads tell; numbers are asked for of loads without symbols, see :meth:`at`."""

    def at(self, values: Mapping[str, float]) -> Self:
        """The same load with parameters' values in the place of their symbols.

        Raises:
            InputError: a value is missing, or no finite number.
        """
        changes = {}
        for field in fields(self):
            given = getattr(self, field.name)
            if hasattr(given, "free_symbols"):
                named = {
                    symbol: values[symbol.name] for symbol in given.free_symbols if symbol.name in values
                }
                try:
                    changes[field.name] = float(given.subs(named))
                except TypeError:
                    raise InputError(
                        f"{type(self).__name__}.{field.name} = {shown(given)}: needs values of its symbols"
                    ) from None
        return replace(self, **changes)

    def expression(self, t: Any) -> Any:
        """F at the symbol ``t`` [s] as a SymPy expression."""
        raise NotImplementedError

    @property
    def mean(self) -> Any:
        """What the load is at rest: its mean over a period, or what it comes to in the end."""
        raise NotImplementedError

    @property
    def bound(self) -> float:
        """The greatest |F|."""
        raise NotImplementedError

    @property
    def period(self) -> float | None:
        """Period [s]; ``None``: it has none."""
        return None

    def work_left(self, t: float, reach: float = 1.0) -> float:
        """The most work [J] that F less its final value can do after ``t`` [s]; infinite if it never fades.

        ``reach`` [m or rad] is the extent of the motion along the load. With x measured from the middle,
        the work is [(F - F_end) x] less the integral of x dF, at most half the reach times what F lies off
        its end and all its changes together.
        """
        off, changes = self._to_come(t)
        return 0.5 * reach * (off + changes)

    def _to_come(self, t: float) -> tuple[float, float]:
        """|F(t) - F_end| and the total variation of F from t on."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Constant(Load):
    """F(t) = value."""

    value: Any

    def expression(self, t: Any) -> Any:  # noqa: D102
        return self.value

    @property
    def mean(self) -> Any:  # noqa: D102
        return self.value

    @property
    def bound(self) -> float:  # noqa: D102
        return abs(self.value)

    def _to_come(self, t: float) -> tuple[float, float]:
        return 0.0, 0.0


@dataclass(frozen=True, eq=False)
class Decaying(Load):
    """F(t) = value exp(-rate t), rate [1/s]; with a rate of zero it is constant."""

    value: Any
    rate: Any

    def __post_init__(self) -> None:
        _require("Decaying.rate", self.rate, least=0.0)

    def expression(self, t: Any) -> Any:  # noqa: D102
        import sympy

        return self.value * sympy.exp(-self.rate * t)

    @property
    def mean(self) -> Any:  # noqa: D102
        return 0.0 if self.rate != 0 else self.value

    @property
    def bound(self) -> float:  # noqa: D102
        return abs(self.value)

    def _to_come(self, t: float) -> tuple[float, float]:
        left = abs(self.value) * math.exp(-self.rate * t) if self.rate else 0.0
        return left, left


@dataclass(frozen=True, eq=False)
class Harmonic(Load):
    """F(t) = mean + amplitude sin(frequency t + phase), frequency [rad/s], phase [rad]."""

    amplitude: Any
    frequency: Any
    mean: Any = 0.0
    phase: Any = 0.0

    def expression(self, t: Any) -> Any:  # noqa: D102
        import sympy

        return self.mean + self.amplitude * sympy.sin(self.frequency * t + self.phase)

    @property
    def bound(self) -> float:  # noqa: D102
        return abs(self.mean) + abs(self.amplitude)

    @property
    def period(self) -> float | None:  # noqa: D102
        return 2.0 * math.pi / abs(self.frequency) if self.frequency else None

    def _to_come(self, t: float) -> tuple[float, float]:
        return (math.inf, math.inf) if self.amplitude and self.frequency else (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Pulse(Load):
    """F(t) = value from ``start`` on for ``duration`` [s], else zero."""

    value: Any
    start: Any
    duration: Any

    def __post_init__(self) -> None:
        _require("Pulse.duration", self.duration, least=0.0)

    def expression(self, t: Any) -> Any:  # noqa: D102
        import sympy

        return sympy.Piecewise((0, t < self.start), (self.value, t < self.start + self.duration), (0, True))

    @property
    def mean(self) -> Any:  # noqa: D102
        return 0.0

    @property
    def bound(self) -> float:  # noqa: D102
        return abs(self.value)

    def _to_come(self, t: float) -> tuple[float, float]:
        if t >= self.start + self.duration:
            return 0.0, 0.0
        value = abs(self.value)
        return (0.0, 2.0 * value) if t < self.start else (value, value)


@dataclass(frozen=True, eq=False)
class Ramp(Load):
    """F(t) rises from zero at ``start`` to ``value`` in ``duration`` [s] and stays there."""

    value: Any
    start: Any
    duration: Any

    def __post_init__(self) -> None:
        _require("Ramp.duration", self.duration, above=0.0)

    def expression(self, t: Any) -> Any:  # noqa: D102
        import sympy

        rising = self.value * (t - self.start) / self.duration
        ends = self.start + self.duration
        return sympy.Piecewise((0, t < self.start), (rising, t < ends), (self.value, True))

    @property
    def mean(self) -> Any:  # noqa: D102
        return self.value

    @property
    def bound(self) -> float:  # noqa: D102
        return abs(self.value)

    def _to_come(self, t: float) -> tuple[float, float]:
        done = min(max((t - self.start) / self.duration, 0.0), 1.0)
        left = abs(self.value) * (1.0 - done)
        return left, left


@dataclass(frozen=True, eq=False)
class Sampled(Load):
    """F through values at rising times [s], before the first and after the last as there.

    Attributes:
        times: [s], shape (n,), n at least 2.
        values: shape (n,).
        interpolation: "cubic", a spline with two continuous derivatives and no slope at its ends, of which
            methods of integration keep their order as far as that; or "linear".
    """

    times: Any
    values: Any
    interpolation: str = "cubic"

    def __post_init__(self) -> None:
        try:
            times, values = np.array(self.times, dtype=np.float64), np.array(self.values, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(
                f"Sampled.times = {shown(self.times)}: times and values must be numbers"
            ) from None
        if (
            times.ndim != 1
            or times.size < 2
            or values.shape != times.shape
            or not (np.diff(times) > 0.0).all()
        ):
            raise InputError(
                f"Sampled.times = {shown(self.times)}: must rise, two or more, with a value each"
            )
        if not (np.isfinite(times).all() and np.isfinite(values).all()):
            raise InputError("Sampled.values: times and values must be finite")
        if self.interpolation not in ("cubic", "linear"):
            raise InputError(f"Sampled.interpolation = {shown(self.interpolation)}: must be cubic or linear")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", values)

    @property
    def pieces(self) -> Any:
        """Coefficients (4, n - 1) of (t - times[i])^3, ^2, ^1, ^0."""
        if self.interpolation == "cubic":
            from scipy.interpolate import CubicSpline

            return CubicSpline(self.times, self.values, bc_type="clamped").c
        slopes = np.diff(self.values) / np.diff(self.times)
        return np.array([0.0 * slopes, 0.0 * slopes, slopes, self.values[:-1]])

    @property
    def function(self) -> Callable[[float], float]:
        """F of a time, in compiled code too."""
        times, (a, b, c, d), last = self.times, np.ascontiguousarray(self.pieces), float(self.values[-1])

        def sampled(t):  # type: ignore[no-untyped-def]
            low, high = 0, len(times) - 1
            while high - low > 1:
                middle = (low + high) // 2
                if times[middle] <= t:
                    low = middle
                else:
                    high = middle
            x = max(t - times[low], 0.0)
            inside = ((a[low] * x + b[low]) * x + c[low]) * x + d[low]
            return inside if t < times[-1] else last

        return sampled

    @property
    def mean(self) -> Any:  # noqa: D102
        return float(self.values[-1])

    @property
    def bound(self) -> float:  # noqa: D102
        return float(np.abs(self._extremes(-math.inf)).max())

    def _to_come(self, t: float) -> tuple[float, float]:
        met = self._extremes(t)
        return abs(float(met[0] - met[-1])), float(np.abs(np.diff(met)).sum())

    def _extremes(self, t: float) -> Any:
        """F at t, at every sample and extreme after it, in the order of time."""
        places = [max(t, self.times[0]), *self.times[self.times > t]]
        for start, end, (a, b, c, _) in zip(self.times, self.times[1:], self.pieces.T, strict=False):
            roots = np.roots([3.0 * a, 2.0 * b, c])
            places += [start + x.real for x in roots if not x.imag and max(t, start) < start + x.real < end]
        return np.array([self.function(float(x)) for x in sorted(places)])


@dataclass(frozen=True, eq=False)
class Function(Load):
    """F(t) = function(t), a plain Python function of one float that compiles.

    What is not told of it is not known: then its bound is infinite and it can do any work.

    Attributes:
        function: F of a time [s]; use :func:`fastmech.sin` and :func:`fastmech.cos`.
        mean: what it is at rest.
        bound: the greatest |F|.
        period: [s], if it has one.
    """

    function: Callable[[float], float]
    mean: Any = 0.0
    bound: float = math.inf
    period: float | None = None

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise InputError(f"Function.function = {shown(self.function)}: must be a function of the time")

    def _to_come(self, t: float) -> tuple[float, float]:
        return math.inf, math.inf


def value_of(load: Load, t: ArrayLike) -> Any:
    """F at times [s], shape of ``t``, of a load without symbols."""
    times = np.asarray(t, dtype=np.float64)
    if isinstance(load, Sampled | Function):
        return np.vectorize(load.function, otypes=[np.float64])(times)
    import sympy

    symbol = sympy.Symbol("t", real=True)
    found = sympy.lambdify(symbol, load.expression(symbol), "numpy")(times)
    return np.broadcast_to(np.asarray(found, dtype=np.float64), times.shape)


def _require(field: str, value: Any, *, above: float = -math.inf, least: float = -math.inf) -> None:
    """Refuse a number that is out of its range; symbols are told by :meth:`Load.at`."""
    if isinstance(value, int | float) and not (value > above and value >= least):
        told = f"> {above:g}" if math.isfinite(above) else f"at least {least:g}"
        raise InputError(f"{field} = {shown(value)}: must be {told}")
