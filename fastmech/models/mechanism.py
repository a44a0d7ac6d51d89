"""``fm.Mechanism``: any holonomic mechanism with one to four degrees of freedom, as data."""

from __future__ import annotations

import ast
import copy
import hashlib
import json
import keyword
import re
import sys
import warnings
from collections.abc import Collection, Mapping, Sequence
from functools import cached_property, reduce
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Flags, Floats
from fastmech.errors import InputError, called_here, shown
from fastmech.generated import kept_text
from fastmech.kernels.rebuilding import fingerprint
from fastmech.loads import BEFORE, Function, Load, Sampled
from fastmech.models.checks import check, check_units, powers_of, sticks
from fastmech.models.statics import Coordinate, Statics
from fastmech.objects import Field, Printed
from fastmech.scene import nearest

if TYPE_CHECKING:
    from fastmech.models.derivation import Derived, Equations
    from fastmech.models.elements import Acting


#: Coordinates at most.
MOST_COORDINATES = 4

#: Names that the compiled text calls by.
RESERVED = {"t", "np", "sin", "cos", "exp", "abs", "min", "max", "sincos", "turned", "float32"}


class _Energies(NamedTuple):
    kinetic: Floats
    potential: Floats


class Energies(Printed, _Energies):
    """Energies [J] of states, each of their shape without the last axis."""

    FIELDS = {"kinetic": Field("", "J", "kinetic"), "potential": Field("", "J", "potential")}


class Powers(NamedTuple):
    """Powers [W] of states: d(T + U)/dt = brought - lost."""

    brought: Floats  #: by loads
    lost: Floats  #: in dampers and to generalized forces


class Works(NamedTuple):
    """Works [J] along a motion (times,): the change of T + U since its first time is brought - lost."""

    brought: Floats  #: by loads
    lost: Floats  #: in dampers and to generalized forces


class Linear(NamedTuple):
    """M q'' + C q' + K q = 0 about a position, loads at their means."""

    mass: Floats  #: metric (n, n)
    damping: Floats  #: (n, n)
    stiffness: Floats  #: (n, n), symmetric where forces have a potential

    @property
    def dissipates(self) -> bool:
        """Whether anything damps; gyroscopic forces do not: the matrix of theirs is antisymmetric."""
        both = self.damping + np.swapaxes(self.damping, -1, -2)
        return bool((np.abs(both) > 1e-12 * np.abs(self.damping).max(initial=0.0)).any())


class Mechanism(Printed):
    """A holonomic mechanism.

    Write it the engineer's way, by points that are expressions of the coordinates and what acts between them,
    or the analyst's, by energies and forces; what is given both ways adds up.

    Args:
        coordinates: one to four symbols of :func:`fastmech.angles` and :func:`fastmech.lengths`; ``q.dot`` is
            the rate of ``q``.
        parameters: values by name, or by symbol; ``(value, unit)`` of any gives the units of all, which are
            checked then. One that is used nowhere brings a warning.
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
        name: what it is called: words of letters, digits and any of ``.,:()+/-``.

    Raises:
        InputError: names are wrong, twice there or unknown; the kinetic energy is not quadratic, or not
            positive; the potential is no number in a part of the ranges; dampers feed energy in; something
            does not repeat after a turn of an angle; a torque or torsion spring is on a length; units do not
            fit.
    """

    @called_here(bodies="belong in masses=[fm.Body(center, mass, inertia, angle)]", loads="forces")
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
        if not isinstance(name, str) or not re.fullmatch(r"\w[\w .,:()+/-]*", name):
            raise InputError(f"name = {shown(name)}: must be words of letters, digits and any of .,:()+/-")
        self.name = name
        self._symbols = tuple(sympy.Symbol(q.name, real=True) for q in given)
        self._rates = tuple(sympy.Symbol(f"{q.name}_dot", real=True) for q in given)
        named = zip(self._symbols, given, strict=True)
        self.coordinates = tuple(Coordinate(symbol, q.low, q.high, q.periodic) for symbol, q in named)
        self.parameters, self.units = _parameters({} if parameters is None else parameters)
        self.built_with = self.parameters  #: the values that ``replace`` changes, for titles
        self._constants = tuple(sympy.Symbol(name, real=True) for name in self.parameters)
        names = [*map(str, self._symbols), *map(str, self._rates), *self.parameters]
        for one in names:
            _identifier("coordinates and parameters", one)
            if names.count(one) > 1:
                raise InputError(f"{one}: names a coordinate, a rate or a parameter twice")
        known = {symbol.name: symbol for symbol in (*self._symbols, *self._constants)}
        self.lengths = frozenset(q.name for q in given if q.unit == "m")
        builder = Builder(self._symbols, self._rates, known, self.lengths)
        self.points = builder.points({} if points is None else points)
        self._parts = builder.parts(
            {
                "masses": masses, "springs": springs, "dampers": dampers, "forces": forces,
                "gravity": gravity, "kinetic": kinetic, "potential": potential, "dissipation": dissipation,
                "generalized_forces": {} if generalized_forces is None else generalized_forces,
            }
        )  # fmt: skip
        for one in self.parameters:
            if one not in builder.used:
                told = f"parameters.{one}: is used nowhere; leave it out, or use its symbol"
                warnings.warn(told, stacklevel=3)
        self._drawn = tuple(builder.drawn)
        self.dissipation = builder.dissipation  #: Rayleigh's function as given, then dampers' coefficients
        #: Whether it is proved that the metric is positive definite, and that dissipation feeds nothing in.
        self.definite, self.passive = check(self)
        if self.units:
            check_units(self, builder.terms)

    def replace(self, **parameters: float) -> Mechanism:
        """The same mechanism with other values of some parameters."""
        made = self.with_values(parameters)
        made.definite, made.passive = check(made)
        return made

    def with_values(self, parameters: Mapping[str, float]) -> Mechanism:
        """The same with other values of some parameters, of which only names and numbers are checked."""
        made = copy.copy(self)
        known = list(self.parameters)
        for name in parameters:
            if name not in known:
                raise InputError(f"parameters.{name}: unknown name; {nearest(name, known)}")
        made.parameters, _ = _parameters(self.parameters | dict(parameters))
        if list(map(str, made._means())) != list(map(str, self._means())):
            made._forget()
        return made

    def _means(self) -> list[Any]:
        return [load.mean_at(self.parameters) for load, *_ in self._parts.loads]

    def _forget(self) -> None:
        """What follows from the equations, which are others now."""
        for name in _MADE:
            self.__dict__.pop(name, None)

    def with_terms(self, varied: Collection[str]) -> Mechanism:
        """The same with no terms of parameters that are zero, but for those whose values are ``varied``."""
        names = {name for name, value in self.parameters.items() if value == 0.0 and name not in varied}
        if not names:
            return self
        key = self.prints, self.name, *sorted(names)
        if key not in _with_terms:
            made = copy.copy(self)
            made._forget()
            made._parts = self._parts.put({c: 0 for c in self._constants if c.name in names})
            _with_terms[key] = made if made._parts.finite else copy.copy(self)
            _ = _with_terms[key]._numpy  # what copies share
        made = copy.copy(_with_terms[key])
        made.parameters = self.parameters
        return made

    @property
    def state(self) -> tuple[str, ...]:
        """Names of the states: coordinates, then rates."""
        return tuple(symbol.name for symbol in (*self._symbols, *self._rates))

    @property
    def turning(self) -> tuple[bool, ...]:
        """Whether each coordinate is an angle that turns fully."""
        return tuple(coordinate.periodic for coordinate in self.coordinates)

    @property
    def ranges(self) -> Floats:
        """Range of each coordinate, of an angle that turns fully no end of one (coordinates, 2)."""
        return np.array([(-np.inf, np.inf) if c.periodic else (c.low, c.high) for c in self.coordinates])

    def outside(self, states: Floats) -> Flags:
        """Which states (..., states) lie beyond the range of a coordinate (...)."""
        low, high = self.ranges.T
        q = states[..., : len(low)]
        return np.asarray(((q < low) | (q > high)).any(axis=-1))

    @property
    def loads(self) -> tuple[Load, ...]:
        """Its loads with the parameters' values."""
        return tuple(load.at(self.parameters) for load, *_ in self._parts.loads)

    def described(self) -> dict[str, tuple[float, str, str]]:
        """Value, unit and description of every parameter."""
        about = f"parameter of {self.name}"
        return {name: (value, self.units.get(name, "1"), about) for name, value in self.parameters.items()}

    def __getstate__(self) -> dict[str, Any]:
        """Without what is made again from the rest."""
        return {k: v for k, v in self.__dict__.items() if k not in _MADE}

    def __copy__(self) -> Mechanism:
        """With what is made from the rest, which other values of parameters share."""
        made = object.__new__(type(self))
        vars(made).update(vars(self))
        return made

    def _motion(self, own: Mapping[str, ArrayLike]) -> Any:
        """What the engine is told of its motions; of parameters ``own`` each trajectory has one (n,)."""
        from fastmech.models.motion import MechanismMotion

        return MechanismMotion(self.with_terms(own), {k: np.asarray(column) for k, column in own.items()})

    fading = 0.0  #: rate [1/s] at which a load decays that steps must follow, as a scene's; none is asked for

    @property
    def timing(self) -> set[str]:
        """Parameters that set when a load jumps or bends."""
        times = [time for load, *_ in self.acting for time in load.kinks()]
        return {symbol.name for time in times for symbol in getattr(time, "free_symbols", ())}

    def kinks(self, until: float, precision: str = "float64") -> Floats:
        """Times [s] within (0, until) that no step may cross: there a load's value or derivative jumps."""
        each = {t for load in self.loads for t in load.kinks()}
        each |= {t - BEFORE[precision] * abs(t) for load in self.loads if load.jumps for t in load.kinks()}
        times = np.array(sorted(each))
        return times[(times > 0.0) & (times < until)]

    @cached_property
    def equations(self) -> Equations:
        """Metric and forces as SymPy expressions."""
        from fastmech.models.derivation import equations

        return equations(self._parts, self._symbols, self._rates, self._means())

    @cached_property
    def _statics(self) -> Statics:
        from fastmech.models.derivation import statics
        from fastmech.models.drawing import Element

        springs = tuple(tuple(d.b - d.a) for d in self._drawn if d.kind is Element.SPRING)
        return statics(self._parts, self.equations, self.coordinates, self._constants, springs)

    def statics(self) -> Statics:
        """Generalized forces at rest, loads at their means."""
        return self._statics

    @property
    def moving(self) -> tuple[str, ...]:
        """Parameters that move its equilibria: those that forces at rest depend on."""
        known = {symbol.name for force in self.statics().forces for symbol in force.free_symbols}
        return tuple(name for name in self.parameters if name in known)

    @property
    def acting(self) -> tuple[Acting, ...]:
        """Its loads and what they act on, as expressions."""
        return self._parts.loads

    @property
    def damped(self) -> bool:
        """Whether dampers take energy with the parameters' values."""
        import sympy

        values = {sympy.Symbol(name, real=True): value for name, value in self.parameters.items()}
        return sympy.sympify(self._parts.dissipation).xreplace(values) != 0

    @property
    def dry(self) -> bool:
        """Whether friction stays as rates vanish: it holds the mechanism also where forces do not balance."""
        return sticks(self)

    @property
    def moving_points(self) -> list[str]:
        """Names of its points that move."""
        return [name for name, place in self.points.items() if place.free_symbols & {*self._symbols}]

    def moved(self, point: str, q: ArrayLike) -> Floats:
        """Derivatives (components, n) of a named point [m] by coordinates, at a position (n,).

        Raises:
            InputError: there is no such point, or it is fixed.
        """
        moving = self.moving_points
        if point not in moving:
            known = ", ".join(moving) or "none"
            raise InputError(f"on = {shown(point)}: must be a point that moves: {known}")
        slopes = self._placing[2][point](*self._split(q, 1), *self.parameters.values())
        return np.array(slopes, dtype=np.float64)

    def places(self, q: ArrayLike) -> tuple[dict[str, Floats], list[tuple[Any, float, Floats]]]:
        """Named points (m, 2) of the plane [m] at positions (m, n), and kind, size and ends of elements.

        Ends are (m, 2, 2), sizes the values [SI] of masses, stiffnesses, coefficients and loads' means.
        Nothing of a mechanism in space, or of one given by energies alone.
        """
        told = (*self.points.values(), *(d.a for d in self._drawn))
        if not told or any(len(place) != 2 for place in told):
            return {}, []
        values, states = list(self.parameters.values()), self._split(q, 1)
        sizes, place_of, _ = self._placing
        numbers = sizes(*values)
        found = [np.broadcast_to(np.float64(one), states.shape[1:]) for one in place_of(*states, *values)]
        columns, named = np.stack(found, axis=-1), 2 * len(self.points)
        points = {name: columns[:, 2 * k : 2 * k + 2] for k, name in enumerate(self.points)}
        ends = np.moveaxis(columns[:, named:].reshape(len(columns), len(self._drawn), 2, 2), 1, 0)
        kinds = [d.kind for d in self._drawn]
        return points, list(zip(kinds, map(float, numbers), ends, strict=True))

    def definition(self) -> list[tuple[str, str]]:
        """What it is, in rows of two texts: coordinates, points, elements, energies and further forces."""

        def told(*parts: Any) -> str:
            return ", ".join(str(part).replace("**", "^").replace("*", "·") for part in parts)

        names = {tuple(place): name for name, place in self.points.items()}
        rows = [
            (f"coordinate {q.symbol}", "angle" if q.periodic else f"from {q.low:g} to {q.high:g}")
            for q in self.coordinates
        ]
        rows += [(f"point {name}", f"({told(*place)})") for name, place in self.points.items()]
        for kind, size, a, b, beside in self._drawn:
            at, to = (names.get(tuple(end), f"({told(*end)})") for end in (a, b))
            place = f"from {at} to {to}"
            if a == b:
                place = f"on {told(a[0])}" if "TORSION" in kind.name else f"at {at}"
            elif kind.name == "LOAD":
                place = f"on {at} along ({told(*(b - a))})"
            what = [f"{kind.name.lower().replace('_', ' ')} {told(size)}"]
            rows.append((", ".join(what + [f"{name} {told(x)}" for name, x in beside.items()]), place))
        rates, parts = self._rates, self._parts
        pairs = ((u * v, i, j) for i, u in enumerate(rates) for j, v in enumerate(rates))
        kinetic = parts.kinetic + sum(parts.metric[i, j] * both for both, i, j in pairs) / 2
        rows += [("kinetic energy T", told(kinetic)), ("potential energy U", told(parts.potential))]
        beside = {"Rayleigh's function D": parts.dissipation}
        beside |= {f"force on {q.symbol}": x for q, x in zip(self.coordinates, parts.forces, strict=True)}
        return rows + [(what, told(x)) for what, x in beside.items() if x != 0]

    @cached_property
    def _placing(self) -> tuple[Any, Any, dict[str, Any]]:
        """Sizes of what is drawn, of parameters; places, and points' slopes, of coordinates too."""
        import sympy

        sizes = [d.size.mean_at(self.parameters) if isinstance(d.size, Load) else d.size for d in self._drawn]
        places = [*self.points.values(), *(end for d in self._drawn for end in (d.a, d.b))]
        components = [component for place in places for component in place]
        symbols = [*self._symbols, *self._constants]
        slopes = {name: place.jacobian(list(self._symbols)) for name, place in self.points.items()}
        place_of = sympy.lambdify(symbols, components, "numpy", cse=True)
        slopes_of = {name: sympy.lambdify(symbols, one.tolist()) for name, one in slopes.items()}
        return sympy.lambdify(self._constants, sizes), place_of, slopes_of

    def energy(self) -> Any:
        """T + U, loads at their means, as an expression of coordinates, rates and parameters.

        None where the forces at rest are not known to come from a potential.
        """
        from fastmech.models.derivation import bounding_energy

        return bounding_energy(self._parts, self.equations, self._symbols, self._rates)

    @cached_property
    def prints(self) -> str:
        """Text that changes with its equations, not with the values of parameters."""
        loads = []
        for load, *acted in self._parts.loads:
            if isinstance(load, Sampled):  # its function is the package's own: what differs are numbers
                loads.append(fingerprint((load.times, load.values, load.pieces)))
            else:
                loads.append(fingerprint(load.function) if isinstance(load, Function) else repr(load))
            loads.append(str(acted))
        told = [*self._parts[:-1], loads, self._means(), self._symbols, self._constants]
        return hashlib.sha256("\0".join(map(str, told)).encode()).hexdigest()[:16]

    @cached_property
    def derived(self) -> Derived:
        """Texts of its functions, kept on disk from the first time on."""
        from fastmech.models.derivation import Derived, derive

        def text() -> str:
            found = derive(self._parts, self.equations, self._symbols, self._rates, self._constants)
            return json.dumps(found)

        found = json.loads(kept_text("mechanism", self.prints, text))
        return Derived(tuple(found[0]), found[1])

    def functions_of_time(self) -> dict[str, Any]:
        """Loads that are functions, by the names under which the text calls them."""
        each = ((k, load) for k, (load, *_) in enumerate(self._parts.loads))
        return {f"function_{k}": load.function for k, load in each if isinstance(load, Sampled | Function)}

    @cached_property
    def _numpy(self) -> dict[str, Any]:
        """Its functions over NumPy arrays."""
        names = {"np": np, "sin": np.sin, "cos": np.cos, "exp": np.exp}
        names |= {"min": np.minimum, "max": np.maximum} | self.functions_of_time()
        for function in self.derived.functions.keys() & {"lagrange_rates", *_PLAIN}:
            text = in_precision(self.derived.functions[function][1], "float64")
            tree = ast.fix_missing_locations(_OnArrays().visit(ast.parse(text)))
            exec(compile(tree, f"<{function}>", "exec"), names)
        return names

    def coefficients(self, parameters: Mapping[str, ArrayLike] | None = None) -> dict[str, Any]:
        """What its functions take of the parameters, of which some may have other values, by name."""
        values = self.parameters | dict(parameters or {})
        given = (np.asarray(values[name], dtype=np.float64)[()] for name in self.parameters)
        with np.errstate(all="ignore"):
            found = self._numpy["coefficients"](*given)
        return dict(zip(self.derived.coefficients, map(np.float64, found), strict=True))

    def evaluate(self, name: str, states: Any, parameters: Mapping[str, ArrayLike] | None = None) -> Floats:
        """One of its functions of numbers or arrays, one a state: all that it gives, stacked in front."""
        known = self.coefficients(parameters)
        own, _ = self.derived.functions[name]
        with np.errstate(all="ignore"):
            found = self._numpy[name](*map(np.float64, states), *(known[k] for k in own))
        return np.stack(np.broadcast_arrays(*found, np.asarray(states[-1]))[:-1])

    def energies(self, y: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Energies:
        """T and U [J] of states (..., 2 n); parameters' other values have shapes that fit."""
        return Energies(*self.evaluate("energies", self._split(y, 2), parameters))

    def powers(self, t: ArrayLike, y: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Powers:
        """Powers [W] in states (..., 2 n), at a time [s] or each at its own."""
        times = np.asarray(t, dtype=np.float64)[()]
        brought, damped, taken = self.evaluate("powers", [times, *self._split(y, 2)], parameters)
        return Powers(brought, damped + taken)

    def works(self, t: ArrayLike, y: ArrayLike) -> Works:
        """Works [J] along one motion since its first time, each of shape (times,).

        What loads bring is the integral of their power by Simpson's rule: its error falls with the fourth
        power of the distance of times. What is lost is what the energy then lacks.

        Args:
            t: times [s], rising, shape (times,).
            y: states (times, 2 n) at these times.
        """
        from scipy.integrate import cumulative_simpson

        energy, (power, taken) = np.add(*self.energies(y)), self.powers(t, y)
        brought = cumulative_simpson(np.broadcast_to(power, energy.shape), x=np.asarray(t), initial=0.0)
        lost = energy[0] + brought - energy if np.any(taken) else np.zeros_like(energy)
        return Works(brought, lost)

    def accelerations(
        self, t: float, y: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None
    ) -> Floats:
        """q'' (..., n) at a time [s] in states (..., 2 n)."""
        rates = self.evaluate("lagrange_rates", [t, *self._split(y, 2)], parameters)
        return np.moveaxis(rates[len(self.coordinates) :], 0, -1)

    def to_momenta(self, y: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Floats:
        """Coordinates and momenta dT/dq' (..., 2 n) from coordinates and rates."""
        return self._second_half("momenta", y, parameters)

    def to_rates(self, y: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Floats:
        """Coordinates and rates (..., 2 n) from coordinates and momenta."""
        return self._second_half("velocities", y, parameters)

    def _second_half(self, name: str, y: ArrayLike, parameters: Mapping[str, ArrayLike] | None) -> Floats:
        states = self._split(y, 2)
        found = self.evaluate(name, states, parameters)
        return np.moveaxis(np.concatenate([np.broadcast_to(states[: len(found)], found.shape), found]), 0, -1)

    def metric(self, q: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Floats:
        """The metric a (..., n, n) at positions (..., n)."""
        return self._matrices("metric", q, parameters)[0]

    def linear(self, q: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Linear:
        """Mass, damping and stiffness (..., n, n) about positions (..., n)."""
        return Linear(self.metric(q, parameters), *self._matrices("slopes", q, parameters))

    def _matrices(self, name: str, q: ArrayLike, parameters: Mapping[str, ArrayLike] | None) -> Floats:
        found, n = self.evaluate(name, self._split(q, 1), parameters), len(self.coordinates)
        return np.moveaxis(found.reshape(len(found) // n**2, n, n, *found.shape[1:]), (1, 2), (-2, -1))

    def _split(self, y: ArrayLike, halves: int) -> Floats:
        states, count = np.asarray(y, dtype=np.float64), halves * len(self.coordinates)
        if not states.ndim or states.shape[-1] != count:
            raise InputError(f"y: has shape {states.shape}, must be (..., {count})")
        return np.moveaxis(states, -1, 0)

    def told(self) -> str:
        """Coordinates and parameters."""
        values = ", ".join(f"{name}={value:g}" for name, value in self.parameters.items())
        return f"Mechanism({self.name}: {', '.join(map(str, self._symbols))}; {values})"


#: Names of what follows from the equations.
_MADE = ("equations", "_statics", "prints", "derived", "_numpy", "_placing")

#: Mechanisms without some of their terms, by what tells them apart.
_with_terms: dict[tuple[str, ...], Mechanism] = {}

_PLAIN = ("bounding", "coefficients", "momenta", "energies", "metric", "velocities", "powers", "slopes")


class _OnArrays(ast.NodeTransformer):
    """Makes decisions of single numbers those of arrays."""

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        self.generic_visit(node)
        where = ast.Attribute(ast.Name("np", ast.Load()), "where", ast.Load())
        return ast.Call(where, [node.test, node.body, node.orelse], [])

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        self.generic_visit(node)
        joined = ast.BitAnd() if isinstance(node.op, ast.And) else ast.BitOr()
        return reduce(lambda a, b: ast.BinOp(a, joined, b), node.values)

    def visit_Not(self, node: ast.Not) -> ast.unaryop:
        return ast.Invert()


def in_precision(text: str, precision: str) -> str:
    """The text with its numbers in a precision: a float64 would turn a lane's arithmetic into its own."""
    left, right = ("float32(", ")") if precision == "float32" else ("", "")
    return text.replace("<<", left).replace(">>", right)


def _identifier(field: str, name: Any) -> str:
    usable = isinstance(name, str) and name.isidentifier() and not keyword.iskeyword(name)
    if not usable or name.startswith("_") or name in RESERVED:
        raise InputError(
            f"{field}: {shown(name)} must be a Python name, with no underscore in front, and none of "
            + ", ".join(sorted(RESERVED))
        )
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
            value, units[name] = told[0], told[1].strip() or "1"
            powers_of(told[1], f"parameters.{name}: ")
        number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
        if not (number and -sys.float_info.max <= value <= sys.float_info.max):
            raise InputError(f"parameters.{name} = {shown(value)}: must be a finite number")
        if name in values:
            raise InputError(f"parameters.{name}: is given twice")
        values[name] = float(value)
    return values, units


def short_way(away: Floats, turning: Sequence[bool]) -> Floats:
    """Departures (..., n or states) with angles, of which ``turning`` (n,) tells, the short way."""
    own = away[..., : len(turning)]
    with np.errstate(invalid="ignore"):
        turns = np.where(turning, np.round(own / (2.0 * np.pi)), 0.0)
    return np.concatenate([own - 2.0 * np.pi * turns, away[..., len(turning) :]], axis=-1)
