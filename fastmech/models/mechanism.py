"""``fm.Mechanism``: any holonomic mechanism with one to four degrees of freedom, as data."""

from __future__ import annotations

import hashlib
import json
import keyword
import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.errors import InputError, shown
from fastmech.generated import kept_text
from fastmech.kernel_cache import PACKAGE, source_hash
from fastmech.kernels.fingerprint import fingerprint
from fastmech.loads import Function, Load, Sampled
from fastmech.models.statics import Coordinate, Statics
from fastmech.scene import nearest

if TYPE_CHECKING:
    from fastmech.models.derivation import Derived, Equations

Floats = NDArray[np.float64]

#: Coordinates at most.
MOST_COORDINATES = 4

#: Names that the compiled text calls by.
RESERVED = {"t", "np", "sin", "cos", "exp", "abs", "min", "max", "sincos", "turned", "rounded_to", "float32"}

#: States at which what formulas cannot tell is tried when a mechanism is built.
TRIED = 256

#: Relative rounding of energies and forces that are compared there.
ROUNDING = 1e-9


class Energies(NamedTuple):
    """Energies [J] of states, each of their shape without the last axis."""

    kinetic: Floats
    potential: Floats


class Powers(NamedTuple):
    """Powers [W] of states: d(T + U)/dt = brought - lost."""

    brought: Floats  #: by loads
    lost: Floats  #: in dampers and to generalized forces


class Linear(NamedTuple):
    """M q'' + C q' + K q = 0 about a position, loads at their means."""

    mass: Floats  #: metric (n, n)
    damping: Floats  #: (n, n)
    stiffness: Floats  #: (n, n), symmetric where forces have a potential


class Mechanism:
    """A holonomic mechanism.

    Write it the engineer's way, by points that are expressions of the coordinates and what acts between them,
    or the analyst's, by energies and forces; what is given both ways adds up.

    Args:
        coordinates: one to four symbols of :func:`fastmech.angles` and :func:`fastmech.lengths`; ``q.dot`` is
            the rate of ``q``.
        parameters: values by name, or by symbol; ``(value, unit)`` of any gives the units of all, which are
            checked then.
        points: places by name, two expressions [m] (three in space).
        masses: mass [kg] by point, or a list of ``(point, mass)`` and :class:`~.elements.Body`.
        springs: list of :class:`~.elements.Spring` and :class:`~.elements.TorsionSpring`.
        dampers: list of :class:`~.elements.Damper` and :class:`~.elements.TorsionDamper`.
        forces: list of :class:`~.elements.Force` and :class:`~.elements.Torque`, with loads of ``fm.loads``.
        gravity: acceleration [m/s^2] along -y (-z in space), or its components.
        kinetic: T [J], quadratic in the rates.
        potential: U [J].
        dissipation: Rayleigh's function D [W], half the power lost; the force is -dD/dq'.
        generalized_forces: further forces by coordinate, of coordinates and rates [N or N m].
        name: what it is called.

    Raises:
        InputError: names are wrong, twice there or unknown; the kinetic energy is not quadratic, or not
            positive; dampers feed energy in; something does not repeat after a turn of an angle; units do not
            fit.
    """

    def __init__(
        self,
        coordinates: Any,
        parameters: Mapping[Any, Any] | None = None,
        *,
        points: Mapping[str, Any] | None = None,
        masses: Any = (),
        springs: Sequence[Any] = (),
        dampers: Sequence[Any] = (),
        forces: Sequence[Any] = (),
        gravity: Any = None,
        kinetic: Any = 0,
        potential: Any = 0,
        dissipation: Any = 0,
        generalized_forces: Mapping[Any, Any] | None = None,
        name: str = "mechanism",
    ) -> None:
        import sympy

        from fastmech.models.coordinates import CoordinateSymbol
        from fastmech.models.elements import Builder

        given = list(coordinates) if isinstance(coordinates, Sequence) else [coordinates]
        if not 1 <= len(given) <= MOST_COORDINATES or not all(isinstance(q, CoordinateSymbol) for q in given):
            raise InputError(
                f"coordinates = {shown(coordinates)}: must be one to four symbols of fm.angles and fm.lengths"
            )
        self.name = _identifier("name", name)
        self._symbols = tuple(sympy.Symbol(q.name, real=True) for q in given)
        self._rates = tuple(sympy.Symbol(f"{q.name}_dot", real=True) for q in given)
        self.coordinates = tuple(
            Coordinate(symbol, q.low, q.high, q.periodic)
            for symbol, q in zip(self._symbols, given, strict=True)
        )
        self.parameters, self.units = _parameters({} if parameters is None else parameters)
        self._constants = tuple(sympy.Symbol(name, real=True) for name in self.parameters)
        names = [*map(str, self._symbols), *map(str, self._rates), *self.parameters]
        for one in names:
            _identifier("coordinates and parameters", one)
            if names.count(one) > 1:
                raise InputError(f"{one}: names a coordinate, a rate or a parameter twice")
        known = {symbol.name: symbol for symbol in (*self._symbols, *self._constants)}
        builder = Builder(self._symbols, self._rates, known)
        self.points = builder.points({} if points is None else points)
        self._parts = builder.parts(
            {
                "masses": masses, "springs": springs, "dampers": dampers, "forces": forces,
                "gravity": gravity, "kinetic": kinetic, "potential": potential, "dissipation": dissipation,
                "generalized_forces": {} if generalized_forces is None else generalized_forces,
            }
        )  # fmt: skip
        self._length = {q.name: q.unit == "m" for q in given}
        self._check()

    def replace(self, **parameters: float) -> Mechanism:
        """The same mechanism with other values of some parameters."""
        import copy

        made = copy.copy(self)
        known = list(self.parameters)
        for name in parameters:
            if name not in known:
                raise InputError(f"parameters.{name}: unknown name; {nearest(name, known)}")
        made.parameters, _ = _parameters(self.parameters | parameters)
        made._check_values()
        return made

    @property
    def state(self) -> tuple[str, ...]:
        """Names of the states: coordinates, then rates."""
        return tuple(symbol.name for symbol in (*self._symbols, *self._rates))

    @cached_property
    def loads(self) -> tuple[Load, ...]:
        """Its loads with the parameters' values."""
        return tuple(load.at(self.parameters) for load, _ in self._parts.loads)

    @cached_property
    def equations(self) -> Equations:
        """Metric and forces as SymPy expressions."""
        from fastmech.models.derivation import equations

        return equations(self._parts, self._symbols, self._rates)

    @cached_property
    def _statics(self) -> Statics:
        from fastmech.models.derivation import statics

        return statics(self._parts, self.equations, self.coordinates, self._constants)

    def statics(self) -> Statics:
        """Generalized forces at rest, loads at their means."""
        return self._statics

    @cached_property
    def prints(self) -> str:
        """Text that changes with its equations, not with the values of parameters."""
        functions = [
            fingerprint(load.function) for load, _ in self._parts.loads if isinstance(load, Function)
        ]
        tables = [
            hashlib.sha256(
                np.concatenate([load.times, load.values, load.pieces.ravel()]).tobytes()
            ).hexdigest()
            for load, _ in self._parts.loads
            if isinstance(load, Sampled)
        ]
        loads = [
            type(load).__name__ if isinstance(load, Sampled | Function) else repr(load)
            for load, _ in self._parts.loads
        ]
        moved = [moved for _, moved in self._parts.loads]
        told = [*self._parts[:5], loads, moved, self._symbols, self._constants, functions, tables]
        return hashlib.sha256("\0".join(map(str, told)).encode()).hexdigest()[:16]

    @cached_property
    def derived(self) -> Derived:
        """Texts of its functions, kept on disk from the first time on."""
        from fastmech.models.derivation import Derived, derive

        def text() -> str:
            found = derive(self._parts, self.equations, self._symbols, self._rates, self._constants)
            return json.dumps(found)

        sources = source_hash(sorted((PACKAGE / "models").glob("*.py")))
        found = json.loads(kept_text("mechanism", f"{self.prints}_{sources}", text))
        return Derived(tuple(found[0]), found[1])

    def functions_of_time(self) -> dict[str, Any]:
        """Loads that are functions, by the names under which the text calls them."""
        return {
            f"function_{k}": load.function
            for k, (load, _) in enumerate(self._parts.loads)
            if isinstance(load, Sampled | Function)
        }

    @cached_property
    def _numpy(self) -> dict[str, Any]:
        """Its functions over NumPy arrays."""
        names = {"np": np, "sin": np.sin, "cos": np.cos, "exp": np.exp, "rounded_to": lambda x, value: value}
        names |= self.functions_of_time()
        for function in ("lagrange_rates", *_PLAIN):
            exec(in_precision(self.derived.functions[function][1], "float64"), names)
        return names

    def coefficients(self, parameters: Mapping[str, ArrayLike] | None = None) -> dict[str, Any]:
        """What its functions take of the parameters, of which some may have other values, by name."""
        values = self.parameters | dict(parameters or {})
        given = (np.asarray(values[name], dtype=np.float64)[()] for name in self.parameters)
        with np.errstate(all="ignore"):
            found = self._numpy["coefficients"](*given)
        return dict(zip(self.derived.coefficients, map(np.float64, found), strict=True))

    def _evaluated(
        self, name: str, states: Any, parameters: Mapping[str, ArrayLike] | None
    ) -> tuple[Any, ...]:
        found = self.coefficients(parameters)
        own = (found[k] for k in self.derived.functions[name][0])
        with np.errstate(all="ignore"):
            return tuple(self._numpy[name](*states, *own))

    def _split(self, y: ArrayLike, count: int) -> Floats:
        states = np.asarray(y, dtype=np.float64)
        if not states.ndim or states.shape[-1] != count:
            raise InputError(f"y: has shape {states.shape}, must be (..., {count})")
        return np.moveaxis(states, -1, 0)

    def energies(self, y: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Energies:
        """T and U [J] of states (..., 2 n); parameters' other values have shapes that fit."""
        states = self._split(y, len(self.state))
        return Energies(
            *(np.broadcast_to(e, states[0].shape) for e in self._evaluated("energies", states, parameters))
        )

    def powers(self, t: float, y: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Powers:
        """Powers [W] at a time [s] in states (..., 2 n)."""
        states = self._split(y, len(self.state))
        found = self._evaluated("powers", [t, *states], parameters)
        return Powers(*(np.broadcast_to(power, states[0].shape) for power in found))

    def accelerations(
        self, t: float, y: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None
    ) -> Floats:
        """q'' (..., n) at a time [s] in states (..., 2 n)."""
        states = self._split(y, len(self.state))
        found = self._evaluated("lagrange_rates", [t, *states], parameters)[len(self.coordinates) :]
        return np.stack([np.broadcast_to(a, states[0].shape) for a in found], axis=-1)

    def to_momenta(self, y: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Floats:
        """Coordinates and momenta dT/dq' (..., 2 n) from coordinates and rates."""
        return self._second_half("momenta", y, parameters)

    def to_rates(self, y: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Floats:
        """Coordinates and rates (..., 2 n) from coordinates and momenta."""
        return self._second_half("velocities", y, parameters)

    def _second_half(self, name: str, y: ArrayLike, parameters: Mapping[str, ArrayLike] | None) -> Floats:
        states = self._split(y, len(self.state))
        found = self._evaluated(name, states, parameters)
        return np.stack(np.broadcast_arrays(*states[: len(found)], *found), axis=-1)

    def metric(self, q: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Floats:
        """The metric a (..., n, n) at positions (..., n)."""
        place = self._split(q, len(self.coordinates))
        return self._matrix(self._evaluated("metric", place, parameters), place)

    def linear(self, q: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Linear:
        """Mass, damping and stiffness (..., n, n) about positions (..., n)."""
        place = self._split(q, len(self.coordinates))
        found, n = self._evaluated("slopes", place, parameters), len(place)
        return Linear(
            self.metric(q, parameters),
            self._matrix(found[: n * n], place),
            self._matrix(found[n * n :], place),
        )

    @staticmethod
    def _matrix(entries: Sequence[Any], place: Floats) -> Floats:
        n, shape = len(place), place[0].shape
        full = np.stack([np.broadcast_to(entry, shape) for entry in entries], axis=-1)
        return full.reshape(*shape, n, n)

    def _check(self) -> None:
        """Refuse what is no mechanism; what formulas cannot tell is tried at some states."""
        _ = self.derived
        self._check_values()

    def _check_values(self) -> None:
        y = self._trial_states()
        n = len(self.coordinates)
        with np.errstate(all="ignore"):
            a = self.metric(y[:, :n])
            usable = np.isfinite(a).all(axis=(1, 2))
            least = np.full(len(y), -np.inf)
            least[usable] = np.linalg.eigvalsh(_scaled(a[usable])).min(axis=-1)
            if not (least > 0.0).all():
                where = dict(zip(map(str, self._symbols), y[np.argmin(least), :n].tolist(), strict=True))
                told = ", ".join(f"{name} = {value:.3g}" for name, value in where.items())
                raise InputError(
                    f"kinetic: is not positive definite, as at {told}; every coordinate needs a mass"
                )
            lost = self._evaluated_dissipation(y)
            if (lost < -ROUNDING * np.abs(lost).max()).any():
                raise InputError("dissipation: feeds energy in; coefficients of dampers must not be negative")
        self._check_periods(y)

    def _evaluated_dissipation(self, y: Floats) -> Floats:
        import sympy

        power = sum(sympy.diff(self._parts.dissipation, v) * v for v in self._rates)
        named = (*self._symbols, *self._rates, *self._constants)
        found = sympy.lambdify(named, power, "numpy")(*y.T, *self.parameters.values())
        return np.nan_to_num(np.broadcast_to(np.asarray(found, dtype=np.float64), len(y)))

    def _check_periods(self, y: Floats) -> None:
        n = len(self.coordinates)
        for k, coordinate in enumerate(self.coordinates):
            if not coordinate.periodic:
                continue
            turned = y.copy()
            turned[:, k] += 2.0 * math.pi
            for what, function in (
                ("the potential", self._potential),
                ("motion", self._accelerations_at_start),
            ):
                before, after = function(y), function(turned)
                scale = np.nanmax(np.abs(before), initial=0.0, axis=0)
                if (np.abs(after - before) > 1e-6 * (scale + 1e-300)).any():
                    raise InputError(
                        f"{coordinate.symbol}: {what} does not repeat after a full turn; "
                        f"give the angle a range: fm.angles('{coordinate.symbol}', low, high)"
                    )
        _ = n

    def _potential(self, y: Floats) -> Floats:
        return self.energies(y).potential

    def _accelerations_at_start(self, y: Floats) -> Floats:
        return self.accelerations(0.0, y)

    def _trial_states(self) -> Floats:
        """States all over the ranges (TRIED, 2 n), of an endless one within some sizes."""
        random, columns = np.random.default_rng(0), []
        for coordinate in self.coordinates:
            low, high = coordinate.low, coordinate.high
            if math.isfinite(low) and math.isfinite(high):
                columns.append(random.uniform(low, high, TRIED))
            else:
                size = 10.0 ** random.uniform(-2.0, 2.0, TRIED)
                signed = size * random.choice([-1.0, 1.0], TRIED)
                columns.append(
                    low + size if math.isfinite(low) else high - size if math.isfinite(high) else signed
                )
        columns += [random.normal(size=TRIED) for _ in self.coordinates]
        return np.stack(columns, axis=-1)

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value:g}" for name, value in self.parameters.items())
        return f"Mechanism({self.name}: {', '.join(map(str, self._symbols))}; {values})"


_PLAIN = ("coefficients", "momenta", "energies", "metric", "velocities", "powers", "slopes")


def in_precision(text: str, precision: str) -> str:
    """The text with its numbers in a precision: a float64 would turn a lane's arithmetic into its own."""
    left, right = ("float32(", ")") if precision == "float32" else ("", "")
    return text.replace("<<", left).replace(">>", right)


def _scaled(a: Floats) -> Floats:
    """Matrices (..., n, n) with ones, or what is not positive, on their diagonals."""
    diagonal = np.abs(np.diagonal(a, axis1=-2, axis2=-1))
    root = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    return np.asarray(a / root[..., :, None] / root[..., None, :])


def _identifier(field: str, name: Any) -> str:
    if (
        not isinstance(name, str)
        or not name.isidentifier()
        or keyword.iskeyword(name)
        or name.startswith("_")
    ):
        raise InputError(
            f"{field}: {shown(name)} must be a Python name that does not begin with an underscore"
        )
    if name in RESERVED:
        raise InputError(f"{field}: {shown(name)} is taken; choose another name")
    return name


def _parameters(given: Any) -> tuple[dict[str, float], dict[str, str]]:
    """Values and units by name."""
    if not isinstance(given, Mapping):
        raise InputError(f"parameters = {shown(given)}: must map names to values")
    values: dict[str, float] = {}
    units: dict[str, str] = {}
    for symbol, told in given.items():
        name, value = str(symbol), told
        if isinstance(told, tuple):
            if len(told) != 2 or not isinstance(told[1], str):
                raise InputError(f"parameters.{name} = {shown(told)}: must be a number, or (number, unit)")
            value, units[name] = told
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float | np.number)
            or not math.isfinite(value)
        ):
            raise InputError(f"parameters.{name} = {shown(value)}: must be a finite number")
        if name in values:
            raise InputError(f"parameters.{name}: is given twice")
        values[name] = float(value)
    return values, units
