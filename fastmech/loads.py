"""Loads: force laws F(t) [N, or N m of a torque] as data. To add one, write a class like these.

A load tells its value over time as an expression, its bound, mean and period, and what work it can still do.
Numbers may be a mechanism's parameters, as SymPy symbols: ``load.at(values)`` puts their values in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from numbers import Real
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from fastmech.errors import InputError, shown

__all__ = ["Constant", "Decaying", "Function", "Harmonic", "Load", "Pulse", "Ramp", "Sampled"]

inf = math.inf

#: Share of a time by which the last step before a jump ends before it, so that it sees nothing of what comes:
#: far above the rounding of times, in either precision.
BEFORE = {"float64": 1e-14, "float32": 4e-7}


def __dir__() -> list[str]:
    return __all__


class Facts(NamedTuple):
    """What is known of a load."""

    mean: Any  #: what it is at rest: its mean over a period, or what it comes to in the end
    bound: float  #: the greatest |F|
    period: float | None = None  #: [s], if it has one


@dataclass(frozen=True, eq=False)
class Load:
    """What all loads tell. Of one with symbols only ``expression`` and ``facts().mean`` can be asked for."""

    jumps: ClassVar[bool] = False  #: whether F itself jumps at its kinks

    def __post_init__(self) -> None:
        for each in fields(self):
            self._require(each.name)

    def expression(self, t: Any) -> Any:
        """F at the symbol ``t`` [s] as a SymPy expression."""
        raise NotImplementedError

    def facts(self) -> Facts:
        """What is known of it."""
        raise NotImplementedError

    def mean_at(self, values: Mapping[str, float]) -> Any:
        """The mean, of symbols still, in the form that it has for these values; raises as :meth:`at`."""
        self.at(values)
        return self.facts().mean

    def to_come(self, t: float) -> tuple[float, float]:
        """|F(t) - F_end| and the total variation of F from ``t`` [s] on; infinite where it never fades."""
        raise NotImplementedError

    def kinks(self) -> tuple[float, ...]:
        """Times [s] at which F or a derivative jumps: steps must not cross them."""
        return ()

    def work_left(self, t: float, reach: float = 1.0) -> float:
        """The most work [J] that F less its final value can do after ``t`` [s]; infinite if it never fades.

        ``reach`` [m or rad] is the extent of the motion along the load. With x measured from the middle,
        the work is [(F - F_end) x] less the integral of x dF, at most half the reach times what F lies off
        its end and all its changes together.
        """
        return 0.5 * reach * sum(self.to_come(t))

    def at(self, values: Mapping[str, float]) -> Self:
        """The same load with parameters' values in the place of their symbols.

        Raises:
            InputError: a value is missing, or out of its range.
        """
        given = {f.name: v for f in fields(self) if hasattr(v := getattr(self, f.name), "free_symbols")}
        missing = {s.name for v in given.values() for s in v.free_symbols} - set(values)
        if missing:
            raise InputError(f"{type(self).__name__}: has no values of {', '.join(sorted(missing))}")
        # Whatever is assumed of the symbols.
        put = {s: values[s.name] for v in given.values() for s in v.free_symbols}
        found = {k: values[v.name] if v.is_Symbol else v.subs(put) for k, v in given.items()}
        return replace(self, **{name: float(value) for name, value in found.items()})

    def _require(self, name: str, least: float = -inf, above: float = -inf, else_give: str = "") -> None:
        """Refuse what is neither a finite number in its range nor an expression of parameters."""
        value = getattr(self, name)
        fits = isinstance(value, Real) and above < value >= least and value < inf  # type: ignore[operator]
        if not fits and not hasattr(value, "free_symbols"):
            told = f"finite and > {above:g}" if above > -inf else f"finite and at least {least:g}"
            told = told if max(above, least) > -inf else "a finite number or an expression of parameters"
            told += f"; give a {else_give} load" if else_give else ""
            raise InputError(f"{type(self).__name__}.{name} = {shown(value)}: must be {told}")


def held_at(loads: Iterable[Load]) -> str:
    """For which values of loads that change equilibria are, in words; empty where none changes."""
    changing = [load for load in loads if load.to_come(0.0) != (0.0, 0.0)]
    ends = ["what it comes to" if math.isfinite(load.work_left(0.0)) else "its mean" for load in changing]
    each = (f"{type(load).__name__} at {end}" for load, end in zip(changing, ends, strict=True))
    return f"loads that change are held: {', '.join(each)}" if changing else ""


@dataclass(frozen=True, eq=False)
class Constant(Load):
    """F(t) = value."""

    value: Any

    def expression(self, t: Any) -> Any:
        """The value."""
        return self.value

    def facts(self) -> Facts:
        """Bound and mean are the value."""
        return Facts(self.value, abs(self.value))

    def to_come(self, t: float) -> tuple[float, float]:
        """Nothing."""
        return 0.0, 0.0


@dataclass(frozen=True, eq=False)
class Decaying(Load):
    """F(t) = value exp(-rate t), rate [1/s]; with a rate of zero it is constant."""

    value: Any
    rate: Any

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require("rate", least=0.0)

    def expression(self, t: Any) -> Any:
        """An exponential."""
        import sympy

        return self.value * sympy.exp(-self.rate * t)

    def facts(self) -> Facts:
        """At rest it is gone, unless its rate is zero."""
        return Facts(0.0 if self.rate != 0 else self.value, abs(self.value))

    def mean_at(self, values: Mapping[str, float]) -> Any:
        """Of a rate that is zero the value."""
        return 0.0 if self.at(values).rate else self.value

    def to_come(self, t: float) -> tuple[float, float]:
        """What is left, and to go."""
        left = abs(self.value) * math.exp(-self.rate * t) if self.rate else 0.0
        return left, left


@dataclass(frozen=True, eq=False)
class Harmonic(Load):
    """F(t) = mean + amplitude sin(frequency t + phase), frequency [rad/s] above zero, phase [rad]."""

    amplitude: Any
    frequency: Any
    mean: Any = 0.0
    phase: Any = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require("frequency", above=0.0, else_give="Constant")

    def expression(self, t: Any) -> Any:
        """A sine."""
        import sympy

        return self.mean + self.amplitude * sympy.sin(self.frequency * t + self.phase)

    def facts(self) -> Facts:
        """Its mean, and a period."""
        period = None if getattr(self.frequency, "free_symbols", None) else 2.0 * math.pi / self.frequency
        return Facts(self.mean, abs(self.mean) + abs(self.amplitude), period)

    def to_come(self, t: float) -> tuple[float, float]:
        """It never fades."""
        return (inf, inf) if self.amplitude else (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Pulse(Load):
    """F(t) = value from ``start`` on for ``duration`` [s], else zero."""

    value: Any
    start: Any
    duration: Any
    jumps = True

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require("duration", least=0.0)

    def expression(self, t: Any) -> Any:
        """A piecewise constant."""
        import sympy

        return sympy.Piecewise((0, t < self.start), (self.value, t < self.start + self.duration), (0, True))

    def kinks(self) -> tuple[float, ...]:
        """Its begin and its end."""
        return self.start, self.start + self.duration

    def facts(self) -> Facts:
        """At rest it is over."""
        return Facts(0.0, abs(self.value))

    def to_come(self, t: float) -> tuple[float, float]:
        """Up and down, or down."""
        height = abs(self.value) if t < self.start + self.duration else 0.0
        return (0.0, 2.0 * height) if t < self.start else (height, height)


@dataclass(frozen=True, eq=False)
class Ramp(Load):
    """F(t) rises from zero at ``start`` to ``value`` in ``duration`` [s] and stays there."""

    value: Any
    start: Any
    duration: Any

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require("duration", above=0.0)

    def expression(self, t: Any) -> Any:
        """A piecewise line."""
        import sympy

        rising, ends = self.value * (t - self.start) / self.duration, self.start + self.duration
        return sympy.Piecewise((0, t < self.start), (rising, t < ends), (self.value, True))

    def kinks(self) -> tuple[float, ...]:
        """Its begin and its end."""
        return self.start, self.start + self.duration

    def facts(self) -> Facts:
        """At rest it has its value."""
        return Facts(self.value, abs(self.value))

    def to_come(self, t: float) -> tuple[float, float]:
        """What it has to rise."""
        left = abs(self.value) * (1.0 - min(max((t - self.start) / self.duration, 0.0), 1.0))
        return left, left


@dataclass(frozen=True, eq=False)
class Sampled(Load):
    """F through values at rising times [s], before the first and after the last as there.

    ``interpolation`` is "cubic", a spline with two continuous derivatives and no slope at its ends, or
    "linear". ``times`` and ``values`` have shape (n,), n at least 2.
    """

    times: Any
    values: Any
    interpolation: str = "cubic"

    def __post_init__(self) -> None:
        times, values = self._numbers("times"), self._numbers("values")
        if times.size < 2 or not np.all(np.diff(times) > 0.0):
            raise InputError(
                f"Sampled.times = {shown(self.times)}: must be two or more finite, rising numbers"
            )
        if values.size != times.size:
            told = f"must be {times.size} finite numbers, one for each time"
            raise InputError(f"Sampled.values = {shown(self.values)}: {told}")
        if self.interpolation not in ("cubic", "linear"):
            raise InputError(f"Sampled.interpolation = {shown(self.interpolation)}: must be cubic or linear")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", values)
        with np.errstate(all="ignore"):
            try:
                known = np.isfinite(self.pieces).all() and math.isfinite(sum(self.to_come(-inf)))
            except ValueError:  # SciPy's, of slopes that are not finite
                known = False
        if not known:
            raise InputError("Sampled.values: change by too much, or too fast, for double precision")

    def _numbers(self, name: str) -> Any:
        """A field as a row of finite numbers; empty: it is none."""
        try:
            given = np.asarray(getattr(self, name))
            row = np.array(given if given.dtype.kind in "biufO" else 0.0, dtype=np.float64)
            return row if row.ndim == 1 and np.isfinite(row).all() else np.zeros(0)
        except (TypeError, ValueError, OverflowError):
            return np.zeros(0)

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

    def kinks(self) -> tuple[float, ...]:
        """The samples."""
        return tuple(self.times.tolist())

    def facts(self) -> Facts:
        """At rest it is the last value; between samples a spline may exceed them."""
        return Facts(float(self.values[-1]), float(np.abs(self._extremes(-inf)).max()))

    def to_come(self, t: float) -> tuple[float, float]:
        """From extreme to extreme."""
        met = self._extremes(t)
        return abs(float(met[0] - met[-1])), float(np.abs(np.diff(met)).sum())

    def _extremes(self, t: float) -> Any:
        """F at t, at every sample and extreme after it, in the order of time."""
        places = [max(t, self.times[0]), *self.times[self.times > t]]
        starts, (a, b, c, _) = self.times[:-1], self.pieces
        with np.errstate(all="ignore"):  # a root of none is not finite
            a, b, c = np.array([3.0 * a, b, c]) / np.max(np.abs([3.0 * a, b, c]), axis=0)
            q = -b - np.copysign(np.sqrt(b * b - a * c), b)  # of a x^2 + 2 b x + c, without cancellation
            for at in (starts + q / a, starts + c / q):
                places += [*at[(np.maximum(t, starts) < at) & (at < self.times[1:])]]
        return np.array(list(map(self.function, map(float, sorted(places)))))


@dataclass(frozen=True, eq=False)
class Function(Load):
    """F(t) = function(t), a plain Python function of one float that compiles; what is not told is unknown."""

    function: Callable[[float], float]  #: use :func:`fastmech.sin` and :func:`fastmech.cos` in it
    mean: float = 0.0
    bound: float = inf
    period: float | None = None

    def __post_init__(self) -> None:
        if not callable(self.function) or isinstance(self.function, np.ufunc):
            given = shown(self.function)
            raise InputError(f"Function.function = {given}: must be a Python function of the time")
        try:
            value, told = np.asarray(self.function(0.0)), ""
        except Exception as error:  # whatever a user's function may raise
            value, told = np.asarray(None), f", not raise {type(error).__name__}"
        if value.shape or value.dtype.kind not in "biuf":
            given = shown(self.function)
            raise InputError(f"Function.function = {given}: must give a number at any time, as at 0 s{told}")
        self._require("mean")
        if self.bound != inf:
            self._require("bound", least=0.0)
        if self.period is not None:
            self._require("period", above=0.0)

    def facts(self) -> Facts:
        """What has been told."""
        return Facts(self.mean, self.bound, self.period)

    def to_come(self, t: float) -> tuple[float, float]:
        """Unknown."""
        return inf, inf
