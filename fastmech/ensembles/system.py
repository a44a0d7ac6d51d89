"""Your own system: a right-hand side written as a small Python function, run by the same engine."""

from __future__ import annotations

import inspect
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import float64
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, issparse

from fastmech.arrays import Floats, Integers
from fastmech.ensembles import checks
from fastmech.ensembles.ends import MOST_WATCHED, OF_EACH, ROWS_OF_EACH, STOP_CODE, STOP_STATE, STOP_TIME
from fastmech.ensembles.refusals import explain, reason
from fastmech.ensembles.run import NOTHING, Observation
from fastmech.ensembles.switches import UnclearError, require_noted, watching
from fastmech.errors import InputError, shown
from fastmech.generated import new_module, run_module
from fastmech.jit import FLAGS, VECTOR, called, inlined
from fastmech.kernels.attempt import attempted
from fastmech.kernels.blocks import Rates, block_kernel
from fastmech.kernels.rebuilding import (
    CHOSEN,
    Swaps,
    compiled_callees,
    fingerprint,
    raises,
    reaches,
    rebuilt,
    returns,
)
from fastmech.kernels.sincos import WITHIN
from fastmech.objects import Printed
from fastmech.scene import nearest

#: States of a family at most: a block of an implicit method has the square of it.
MOST_STATES = 10_000

_WITH_CONSTANTS = """def rates(t, y, p, found):
    given(t, y, p, found, {names})
"""


class Rows(NamedTuple):
    """A sparse matrix: row i has ``data[k]`` in column ``indices[k]``, k from ``indptr[i]`` to the next."""

    indptr: Integers
    indices: Integers
    data: Floats


_OBSERVE = '''"""Made by fastmech: watches {name!r} of a user's own system."""

from fastmech.ensembles.ends import note_stop
from fastmech.jit import OBSERVER_SIGNATURE, kernel
from fastmech.kernels.attempt import attempt


@kernel(OBSERVER_SIGNATURE)
def observe(t, Y, params, record):
    fresh = 0
    for i in range(Y.shape[1]):
        raised, code = attempt(stop_within, ({arguments},))
        fresh |= raised | ((code + 0.0 != 0.0) & (record[0, i] == 0.0))
    if fresh:
        for i in range(Y.shape[1]):
            note_stop(stop({arguments}) + 0.0, t, Y, record, i)
'''

_WATCH = '''"""Made by fastmech: watches {name!r} of a user's own system, and where it decides."""

import numpy as np
from fastmech.ensembles.ends import note_near, note_stop
from fastmech.ensembles.switches import MOST_NOTES
from fastmech.jit import OBSERVER_SIGNATURE, kernel


@kernel(OBSERVER_SIGNATURE)
def observe(t, Y, params, record):
    seen = np.empty(1 + 2 * MOST_NOTES)
    for i in range(Y.shape[1]):
        if record[0, i] == 0.0:
            seen[0] = 0.0
            code = stop(seen, {arguments}) + 0.0
            note_near(t, code, seen, record, (i, {first}, {most}))
            note_stop(code, t, Y, record, i)
'''

_SWITCHES = '''"""Made by fastmech: notes the decisions of {name!r}."""

from fastmech.ensembles.switches import SWITCHES_SIGNATURE
from fastmech.jit import kernel


@kernel(SWITCHES_SIGNATURE)
def switches(t, y, p, seen):
    seen[0] = 0.0
'''


@dataclass(frozen=True, eq=False, repr=False)
class System(Printed):
    """A system of ordinary differential equations of your own.

    Attributes:
        rhs: ``rhs(t, *state, *parameters)`` gives the derivatives as a tuple, one for each state; plain
            arithmetic on floats. Use :func:`fastmech.sin` and :func:`fastmech.cos`, and values chosen by
            ``a if condition else b`` instead of branches: then the loop over trajectories becomes packed
            instructions. Write ``2.0 * x``, not ``2 * x``: in float32 a whole number makes the rest of the
            arithmetic double.
            Of many states the function is ``rhs(t, y, p, rates)``: arrays of one trajectory's states and
            parameters, and one into which it writes the rates, in loops over indices.
        state: names of the states, or ``("x", 100)`` for x0, ..., x99 and arrays.
        parameters: the parameters' values by name, none by default; ``rhs`` takes arguments of these names
            after the states.
        stop: ``stop(t, *state)`` (or ``stop(t, y)``), with parameters behind the states where it needs them
            (or ``stop(t, y, p)``), gives 0 while the trajectory runs on, any other whole number as the code
            of why it stops (True is 1); it is looked at after every step. A trajectory that has stopped
            costs nothing any more.
        period: after which the right-hand side repeats, where it depends on the time: a number [s], or a
            function of parameters by their names, ``lambda omega: 2 * math.pi / omega``.
        angles: names of states of which only the value modulo a turn of 2 pi counts.
        constants: arrays by name that a function of many states takes behind ``rates``, such as weights of
            each state; of a network its sparse matrix (SciPy's, any format), of which ``links.indices[k]``
            are row i's columns and ``links.data[k]`` its values, k from ``links.indptr[i]`` up to
            ``links.indptr[i + 1]``. They are compiled in.
        section: ``section(*state)``: attractors are looked for where it rises through zero, in place of at
            equal times; of a system that does not depend on the time.

    Raises:
        InputError: names do not match the functions' arguments, or values are no finite numbers. A function
            that cannot be compiled is refused when the system first runs.
    """

    rhs: Callable[..., tuple[float, ...]]
    state: Sequence[str]
    parameters: Mapping[str, float] = field(default_factory=dict)
    stop: Callable[..., float] | None = None
    period: float | Callable[..., float] | None = None
    angles: Sequence[str] = ()
    section: Callable[..., float] | None = None
    constants: Mapping[str, ArrayLike] = field(default_factory=dict)
    vector: bool = field(default=False, init=False)  #: whether functions take arrays
    origin: System | None = field(default=None, init=False)  #: of which it has other values of parameters

    def __post_init__(self) -> None:
        vector = isinstance(self.state, tuple) and [type(part) for part in self.state] == [str, int]
        given: Any = self.state
        state = _names("state", _family(*given) if vector else given, least=1)
        if not isinstance(self.parameters, Mapping):
            raise InputError(f"parameters = {shown(self.parameters)}: must be a mapping of names to numbers")
        names = _names("parameters", self.parameters, least=0)
        values = [checks.number(f"parameters.{k}", v, "") for k, v in self.parameters.items()]
        constants = _constants(self.constants)
        if constants and not vector:
            raise InputError("constants: only of a family of states, whose function takes arrays")
        parameters = dict(zip(names, values, strict=True))
        vars(self).update(vector=vector, state=state, parameters=parameters, constants=constants)
        taken = ["y", "p", "rates"] if vector else state
        _check_function("rhs", self.rhs, taken, list(constants) if vector else names)
        if vector and returns(self.rhs):  # type: ignore[arg-type]
            raise InputError("rhs: returns something, must write the rates into its last argument")
        if self.stop is not None:
            _check_function("stop", self.stop, ["y"] if vector else state, self._taken_by_stop)
        angles = _names("angles", self.angles, least=0)
        for name in set(angles) - set(state):
            raise InputError(f"angles: {name!r} is no state; must be some of {shown(state)}")
        vars(self).update(angles=tuple(angles))
        if self.section is not None:
            if vector or self.stop is not None or self.period is not None:
                raise InputError("section: not with a stopping condition, a period or a family of states")
            _check_function("section", self.section, state, [], first=0)
        self.period_at({})

    def period_at(self, values: Mapping[str, float]) -> float | None:
        """Period of the right-hand side [s], None: it has none; with other ``values`` of some parameters.

        Raises:
            InputError: it is not positive, or asks for something that is no parameter.
        """
        period: Any = self.period
        if callable(period):
            names = list(inspect.signature(period).parameters)
            for name in set(names) - set(self.parameters):
                raise InputError(f"period: asks for {name!r}, which is no parameter of the system")
            known = {**self.parameters, **values}
            period = period(**{name: known[name] for name in names})
        return None if period is None else checks.number("period", period, "s", above=0.0)

    @property
    def name(self) -> str:
        """That of its right-hand side."""
        return str(getattr(self.rhs, "__name__", "rhs"))

    def replace(self, **values: float) -> System:
        """The same, compiled once for both, with other values of some parameters.

        Raises:
            InputError: a name is unknown, or a value is no finite number.
        """
        for name in set(values) - set(self.parameters):
            raise InputError(f"{name}: is no parameter of the system; {nearest(name, list(self.parameters))}")
        made = object.__new__(System)
        known = {name: checks.number(name, value, "") for name, value in values.items()}
        own = {"origin": self.origin or self, "parameters": {**self.parameters, **known}}
        vars(made).update(vars(self) | own)
        return made

    def told(self) -> str:
        """States and parameters."""
        values = ", ".join(f"{name}={value:g}" for name, value in self.parameters.items())
        return f"System({self.name}: {', '.join(self.state)}; {values or 'no parameters'})"

    def described(self) -> dict[str, tuple[float, str, str]]:
        """Value, unit and description of every parameter."""
        about = f"parameter of {self.name}"
        return {name: (value, "1", about) for name, value in self.parameters.items()}

    @property
    def prints(self) -> dict[str, str]:
        """What tells its functions apart from others."""
        given = {"rhs": self._right, "stop": self.stop, "period": self.period, "section": self.section}
        return {k: fingerprint(f) if callable(f) else repr(f) for k, f in given.items()}

    def __getstate__(self) -> dict[str, Any]:
        """Without what is made again from the rest."""
        return {
            k: v
            for k, v in self.__dict__.items()
            if k
            not in (
                "rates",
                "kernel",
                "switches",
                "told_switches",
                "stop_switches",
                "watched_stop",
                "_observer",
                "_right",
            )
        }

    @cached_property
    def _right(self) -> Any:
        """The right-hand side with its constants, as a function without them."""
        function: Any = self.rhs
        if not self.constants:
            return function
        names = list(inspect.signature(function).parameters)[4:]
        source = _WITH_CONSTANTS.format(names=", ".join(names))
        prints = [fingerprint(value) for value in (function, *self.constants.values())]
        module = new_module("system", source, prints)
        vars(module).update(self.constants)
        vars(module)["given"] = numba.njit(**FLAGS)(rebuilt(function, module.__name__, {}))
        return run_module(module, source).rates

    @property
    def observation(self) -> Observation:
        """What is watched while the system runs: its stopping condition, if it has one."""
        if self.stop is None:
            return NOTHING
        record, own = np.zeros(2 + len(self.state)), bool(self._taken_by_stop)
        if own:
            record = np.append(record, np.full(len(self.parameters), np.nan))
        return Observation(self._observer, np.zeros(0), record, stops=True, parameters=own)

    @property
    def _taken_by_stop(self) -> list[str]:
        """Parameters that the stopping condition asks for, in its order; "p", all of them as an array."""
        stop: Any = self.stop
        taken = list(inspect.signature(stop).parameters) if isinstance(stop, types.FunctionType) else []
        return [name for name in taken if name in (["p"] if self.vector else self.parameters)]

    @cached_property
    def switches(self) -> Any:
        """The kernel that notes where the right-hand side decides, see :mod:`fastmech.ensembles.switches`.

        ``None`` where it does not: then it is smooth, as far as its operations are. A stopping condition's
        decisions are noted behind its own.

        Raises:
            UnclearError: it cannot be told where.
        """
        given = inspect.signature(self._right).parameters
        depend = set(given) - ({"p"} if self.vector else set(self.parameters))
        arrays = [VECTOR if self.vector else float64] * (len(given) - 1)
        if not require_noted(self._right, depend, [float64, *arrays]):
            return None
        if self.vector:
            raise UnclearError("decisions on arrays are not located")
        if self.stop is None:
            return self._noting("rhs")
        self._require_noted_stop()
        return self._noting("rhs", "stop")

    def _require_noted_stop(self) -> None:
        names = set(inspect.signature(self.stop).parameters)  # type: ignore[arg-type]
        require_noted(self.stop, names, [float64] * len(names))

    def _noting(self, *fields: str) -> Any:
        """The kernel that notes the decisions of some of the functions."""
        source, names = _SWITCHES.format(name=self.name), list(self.parameters)
        functions: dict[str, Any] = {kind: getattr(self, kind) for kind in fields}
        for kind in fields:
            taken = self.parameter_order if kind == "rhs" else self._taken_by_stop
            own = [*(f"y[{d}]" for d in range(len(self.state))), *(f"p[{names.index(k)}]" for k in taken)]
            source += f"    {kind}(seen, {', '.join(['t', *own])})\n"
        module = new_module("system", source, [fingerprint(function) for function in functions.values()])
        vars(module).update({k: inlined(watching(function)[0]) for k, function in functions.items()})
        return run_module(module, source).switches

    @cached_property
    def stop_switches(self) -> Any:
        """The kernel that notes where the stopping condition decides."""
        return self._noting("stop")

    @cached_property
    def watched_stop(self) -> Observation | None:
        """The stopping condition, and whether it may be true between steps: watched under a tolerance.

        None: there is none, or it cannot be told where it decides.
        """
        if self.stop is None or self.vector:
            return None
        try:
            self._require_noted_stop()
        except UnclearError:
            return None
        copy, decisions, _ = watching(self.stop)
        seen, plain = STOP_STATE + len(self.state), self.observation
        most, own = min(decisions, MOST_WATCHED), list(self.parameters)
        end = seen + OF_EACH + ROWS_OF_EACH * most
        arguments = ["t", *(f"Y[{d}, i]" for d in range(len(self.state)))]
        arguments += [f"record[{end + own.index(name)}, i]" for name in self._taken_by_stop]
        name, given = self.stop.__name__, ", ".join(arguments)
        source = _WATCH.format(name=name, arguments=given, first=seen, most=most)
        module = new_module("system", source, [fingerprint(self.stop)])
        vars(module)["stop"] = inlined(copy)
        record = np.insert(plain.record, seen, np.zeros(end - seen))
        return replace(
            plain, observe=run_module(module, source).observe, record=record, near=range(seen, end)
        )

    @cached_property
    def told_switches(self) -> tuple[Any, str]:
        """``switches``, or None and why it cannot be told where it decides."""
        try:
            return self.switches, ""
        except UnclearError as unknown:
            return None, str(unknown)

    @property
    def parameter_order(self) -> list[str]:
        """Parameters in the order in which the right-hand side takes them."""
        return list(inspect.signature(self.rhs).parameters)[1 + len(self.state) :]

    @cached_property
    def rates(self) -> Rates:
        """What the engine's loops are made from."""
        function = self._right
        dim, names = len(self.state), list(self.parameters)
        own = () if self.vector else tuple(names.index(name) for name in self.parameter_order)
        return Rates(
            self.name,
            dim,
            own,
            partial(_array_functions if self.vector else _functions, "rates", function),
            (fingerprint(function),),
            ranged=not self.vector and reaches(function, _swaps()),
            vector=self.vector,
            looked_at=dim,
        )

    @cached_property
    def kernel(self) -> Any:
        """The compiled block right-hand side, loaded from the disk cache where it is there."""
        if self.origin is not None:
            return self.origin.kernel
        kinds: list[Any] = [float64] * (len(self.state) + len(self.parameters))
        if self.vector:
            order = list(inspect.signature(self.rhs).parameters)[4:]
            kinds = [VECTOR] * 3 + [numba.typeof(self.constants[name]) for name in order]  # type: ignore[no-untyped-call]
        states = [] if self.vector else list(self.state)
        return _compiled("rhs", self.rhs, lambda: block_kernel(self.rates), kinds, states)

    @cached_property
    def _observer(self) -> Any:
        """The observer of the stopping condition."""
        stop: Any = self.stop
        taken, dim = self._taken_by_stop, len(self.state)
        kinds: list[Any] = [VECTOR if self.vector else float64] * ((1 if self.vector else dim) + len(taken))
        own = [f"record[{2 + dim + list(self.parameters).index(name)}, i]" for name in taken if name != "p"]
        arguments = ["t", *(f"Y[{d}, i]" for d in range(dim)), *own]
        if self.vector:
            arguments = ["t", "Y[:, i]", *([f"record[{2 + dim}:, i]"] if taken else [])]
        source = _OBSERVE.format(name=stop.__name__, arguments=", ".join(arguments))

        def observer() -> Any:
            module = new_module("system", source, [fingerprint(stop)])
            vars(module).update(_functions("stop", stop, module.__name__, "float64"))
            return run_module(module, source).observe

        return _compiled("stop", stop, observer, kinds, None)


def _compiled(
    field: str, function: Any, make: Callable[[], Any], kinds: list[Any], states: list[str] | None
) -> Any:
    """The kernel that ``make`` gives, there or, in one line, why the function cannot be compiled."""
    for callee in filter(raises, compiled_callees(function)):
        raise InputError(
            f"{field}: calls {callee.__name__}, which must not raise or assert; "
            "nan as a result ends a trajectory"
        )
    try:
        made = make()
        if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
            made.make()
        return made
    except Exception as error:  # numba lets those of the code it looks at pass
        explain(field, rebuilt(function, "fastmech_user", {}), (float64, *kinds), states)
        raise InputError(f"{field}: cannot be compiled: {reason(error)}") from None


def _array_functions(field: str, function: Any, module: str, precision: str) -> dict[str, Any]:
    """The same of one that takes arrays."""
    return {field: called(rebuilt(function, module, numbers(precision)))}


def numbers(precision: str) -> Swaps:
    """What constants and choices become: a float64 would turn a lane's arithmetic into its own."""
    single: Any = np.float32
    return CHOSEN | ({float: single} if precision == "float32" else {})


def _swaps() -> Swaps:
    """What the packed loops call in the place of what."""
    return {} if numba.config.DISABLE_JIT else dict(WITHIN)  # type: ignore[attr-defined]


def _functions(field: str, function: Any, module: str, precision: str) -> dict[str, Any]:
    """A user's function for a module of that name, and the same with trigonometry that raises."""
    swaps = numbers(precision)
    whole = inlined(rebuilt(function, module, swaps))
    return {field: whole, f"{field}_within": attempted(rebuilt(function, module, _swaps() | swaps))}


def stop_codes(records: Floats) -> Integers:
    """Codes (n,) of the records (rows, n) of a run whose system may stop, 0: it did not.

    Raises:
        InputError: a code is no whole number.
    """
    codes = records[STOP_CODE]
    wrong = np.flatnonzero(~((np.abs(codes) < 2.0**53) & (codes == np.rint(codes))))
    if wrong.size:
        state = ", ".join(f"{x:g}" for x in records[STOP_STATE:, wrong[0]])
        code, t = codes[wrong[0]], records[STOP_TIME, wrong[0]]
        raise InputError(
            f"stop: gave {code:g} at t = {t:g} in state ({state}), must give 0 while a trajectory runs on, "
            "another whole number where it stops"
        )
    return codes.astype(np.int64)


def _family(name: str, count: int) -> list[str]:
    """Names of a family of states."""
    if not 1 <= count <= MOST_STATES:
        raise InputError(
            f"state = {shown((name, count))}: must be a name and a number from 1 to {MOST_STATES}"
        )
    return [f"{name}{d}" for d in range(count)]


def _constants(given: Any) -> dict[str, Any]:
    """Arrays as compiled code takes them, by name; sparse matrices as :class:`Rows`."""
    if not isinstance(given, Mapping):
        raise InputError(f"constants = {shown(given)}: must be a mapping of names to arrays")
    found: dict[str, Any] = {}
    for name in _names("constants", given, least=0):
        value: Any = given[name]
        if issparse(value):
            rows = csr_array(value)
            data = checks.reals(f"constants.{name}", rows.data, "real numbers")
            found[name] = Rows(rows.indptr.astype(np.int64), rows.indices.astype(np.int64), data)
        else:
            found[name] = checks.reals(f"constants.{name}", value, "real numbers", 1)
    return found


def _names(field: str, given: Any, least: int) -> list[str]:
    names = list(given) if isinstance(given, Iterable) and not isinstance(given, str) else None
    if (
        names is None
        or len(names) < least
        or not all(isinstance(name, str) and name.isidentifier() for name in names)
        or len(set(names)) < len(names)
    ):
        what = "different Python names" if names else "a list of different Python names"
        few = f", at least {least}" if least else ""
        raise InputError(f"{field} = {shown(names or given)}: must be {what}{few}")
    return names


def _check_function(
    field: str, function: Any, state: list[str], parameters: list[str], first: int = 1
) -> None:
    """Arguments are matched by name: a value never lands in the wrong place silently."""
    if not isinstance(function, types.FunctionType):
        raise InputError(f"{field} = {shown(function)}: must be a plain Python function")
    given = inspect.signature(function).parameters
    taken, wanted = list(given), ", ".join([*["t"][:first], *state, *parameters])
    rest = taken[first + len(state) :]
    fits = taken[first : first + len(state)] == state and sorted(rest) == sorted(parameters)
    if not fits or any(one.kind is not one.POSITIONAL_OR_KEYWORD for one in given.values()):
        told = inspect.Signature([one.replace(annotation=one.empty) for one in given.values()])
        raise InputError(f"{field}: takes {told}, must take ({wanted})")
    if raises(function):
        raise InputError(f"{field}: must not raise or assert; nan as a result ends a trajectory")
