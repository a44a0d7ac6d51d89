"""The one place where the package talks to the just-in-time compiler: flags, signatures, caching.

Flags. ``error_model="numpy"`` is what lets LLVM vectorize at all (with Python's division semantics every
division is a branch that may raise). Of the fast-math flags only ``contract`` is set: a product and a sum
may fuse, nothing may be reordered, and NaN and infinity keep their meaning because statuses are decided
by them.

Vectors. LLVM prefers 256 bit on Intel's processors with AVX-512, as if wide registers slowed the clock. Loops
over lanes are arithmetic from end to end, for which 512 bit are faster all the same: kernels ask for them by
an attribute of their own functions, which changes nothing else in a process, nor anything without AVX-512.

Laziness. A kernel is loaded from the disk, or compiled, at its first use and not when its module is imported:
a process pays for the kernels that it calls. ``listeners`` are told which one is being made.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import cache, wraps
from pathlib import Path
from typing import Any, TypeVar

from llvmlite import ir
from numba import njit, types
from numba.core import config as numba_config
from numba.core.caching import FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import register_pass
from numba.core.lowering import Lower
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering
from numba.core.typing.templates import infer_global, make_intrinsic_template
from numba.extending import overload

from fastmech.callee import CalleeType
from fastmech.compiling import on_terminal
from fastmech.interrupts import check
from fastmech.kernel_cache import alone, cache_directory, sources_unchanged

F = TypeVar("F", bound=Callable[..., Any])

FLAGS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}


class _WideLower(Lower):
    """Numba's lowering of a function that prefers 512-bit vectors."""

    def setup_function(self, fndesc: Any) -> None:
        super().setup_function(fndesc)  # type: ignore[no-untyped-call]
        set.add(self.function.attributes, '"prefer-vector-width"="512"')


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[no-untyped-call]
class _WideLowering(NativeLowering):
    _name = "wide_lowering"
    lowering_class = _WideLower


class _PartLibrary(JITCodeLibrary):
    """The code of a function that only kernels call: it becomes machine code in them alone.

    By itself numba would make machine code of it too, which nobody calls.
    """

    class _NoEnvironment:
        @staticmethod
        def set_env(name: str, environment: Any) -> None:
            """Nothing: parts use no objects of Python."""

    @property
    def codegen(self) -> Any:
        return self._NoEnvironment

    def get_pointer_to_function(self, name: str) -> int:
        return 0  # as numba says of what a library lacks

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._verify_declare_only_symbols()  # type: ignore[no-untyped-call]
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[no-untyped-call]
class _PartLowering(_WideLowering):
    _name = "part_lowering"

    def run_pass(self, state: Any) -> Any:
        library: Any = _PartLibrary
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        return super().run_pass(state)  # type: ignore[no-untyped-call]


class _WideCompiler(CompilerBase):
    """Numba's compiler with another lowering."""

    lowering: Any = _WideLowering

    def define_pipelines(self) -> list[Any]:
        made = DefaultPassBuilder.define_nopython_pipeline(self.state)  # type: ignore[no-untyped-call]
        made.passes = [(self.lowering if step is NativeLowering else step, why) for step, why in made.passes]
        made.finalize()
        return [made]


class _PartCompiler(_WideCompiler):
    """The same for what only kernels call."""

    lowering = _PartLowering


#: Options of kernels: C does not call them by numba's wrapper, see :mod:`fastmech.callee`.
KERNEL: Any = {"no_cfunc_wrapper": True, "pipeline_class": _WideCompiler, **FLAGS}

#: Options of functions that kernels call, and of those compiled into their caller; loops become vectors
#: before they get there.
PART: Any = {**KERNEL, "no_cpython_wrapper": True, "pipeline_class": _PartCompiler}
INLINED: Any = {**PART, "forceinline": True}

#: Options of interval arithmetic besides: nothing is fused, so that an operation rounds once.
EXACT: Any = {"fastmath": False}

VECTOR = types.Array(types.float64, 1, "C")
MATRIX = types.Array(types.float64, 2, "C")
CUBE = types.Array(types.float64, 3, "C")
INTEGERS = types.Array(types.int64, 1, "C")
STATUSES = types.Array(types.int8, 1, "C")


def named_tuple(kinds: list[Any], fields: Any) -> Any:
    """Type of a ``NamedTuple`` class whose fields have these types."""
    return types.NamedTuple(kinds, fields)  # type: ignore[no-untyped-call]


def lanes(precision: Any, dimensions: int) -> Any:
    """Type of an array of lanes: states, derivatives, parameters or outputs of a block, or of blocks."""
    return types.Array(precision, dimensions, "C")


def rhs_signature(precision: Any) -> Any:
    """``rhs(t, Y, dY, params)``: derivatives of a block of lanes, in either precision.

    ``Y`` and ``dY`` have shape (dim, lanes), ``params`` (count, lanes).
    """
    block = lanes(precision, 2)
    return types.void(types.float64, block, block, block)


def observer_signature(precision: Any) -> Any:
    """``observe(t, Y, params, record)``: looks at a block after every step; ``record`` is (rows, lanes)."""
    return types.void(types.float64, lanes(precision, 2), VECTOR, MATRIX)


RHS_SIGNATURE = rhs_signature(types.float64)
RHS = CalleeType(RHS_SIGNATURE)
OBSERVER_SIGNATURE = observer_signature(types.float64)
OBSERVER = CalleeType(OBSERVER_SIGNATURE)

#: ``inverse(J, mu, G, X, V)``: X + i V = (mu - J)^-1, where row ``r * dim + c`` of ``J`` (dim * dim, lanes)
#: is the derivative of the rate of state ``r`` by state ``c``; ``V`` is left where mu is real. ``G`` (8 dim *
#: dim + 1, lanes) is scratch.
INVERSE_SIGNATURE = types.void(MATRIX, types.complex128, MATRIX, MATRIX, MATRIX)
INVERSE = CalleeType(INVERSE_SIGNATURE)


#: Held while numba's cache directory, one for the whole process, is the package's.
_DIRECTORY_SET = threading.Lock()


class _Kept(FunctionCache):
    """Numba's disk cache of a kernel, which keeps nothing once the package's sources have been edited."""

    @classmethod
    def of(cls, function: Any) -> _Kept:
        """A kernel's, in the package's directory: numba looks where that is only here."""
        settings: Any = numba_config
        with _DIRECTORY_SET:
            previous = settings.CACHE_DIR
            settings.CACHE_DIR = str(cache_directory())
            try:
                return cls(function)
            finally:
                settings.CACHE_DIR = previous

    @property
    def made_by(self) -> Path:
        """The file that is held by the process that loads or compiles this kernel."""
        return Path(self._cache_path, f"{self._impl.filename_base}.lock")

    def save_overload(self, sig: Any, data: Any) -> None:
        if sources_unchanged():
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]


#: Told the name of every kernel before it is loaded or compiled, and None when it is there; a terminal is
#: where nobody else listens.
listeners: list[Callable[[str | None], None]] = []

#: Names of the kernels that this process has compiled; the others were on disk.
compiled: list[str] = []


def working(words: str) -> AbstractContextManager[Callable[[str], None]]:
    """What lasts for a block, on the terminal; gives what changes the words. Listeners have own bars."""
    return nullcontext(lambda words: None) if listeners else on_terminal.work(words)


class Kernel(CPUDispatcher):
    """A function compiled for one explicit signature, which is loaded from the disk or made at its first use.

    Where other processes need it too, one compiles it and they wait to load it.

    A use is a call, a call of it in another kernel that is being made, and handing it to a kernel as a
    :func:`fastmech.callee.callee`. Importing a module with kernels costs nothing of that.
    """

    declared: Any = None  #: the signature, until the kernel is there

    def make(self) -> None:
        """Load or compile it, unless it is there; any thread may.

        Raises:
            Interrupt: a command is to stop: this is the one place between two compilations.
        """
        if self.declared is not None:
            check()
            self._make()

    def _make(self) -> None:
        with global_compiler_lock:
            signature = self.declared
            if signature is None:
                return
            told = listeners or [on_terminal.tell]
            for tell in told:
                tell(self.py_func.__name__)
            try:
                self._cache = kept = _Kept.of(self.py_func)
                with alone(kept.made_by):
                    self.compile(signature)
                if self.stats.cache_misses:
                    compiled.append(self.py_func.__name__)
                self.disable_compile()
                self.declared = None
            finally:
                for tell in told:
                    tell(None)

    @property
    def signatures(self) -> list[Any]:
        """The one signature."""
        return [self.declared.args] if self.declared is not None else list(self.overloads)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Numba asks for it where another kernel that is being made calls this one."""
        self._make()
        return super().get_call_template(args, kws)

    def _compile_for_args(self, *args: Any, **kws: Any) -> Any:
        """Numba asks for it where Python calls a kernel that is not there; what is given back is called."""
        self.make()
        return self


def kernel(signature: Any, **options: Any) -> Callable[[F], Any]:
    """A kernel of one explicit signature, without the interpreter's lock, kept on disk, see :class:`Kernel`.

    Explicit signatures make the disk entry usable in every later process even where an argument is a
    first-class function. The user's own kernels keep their cache directory, and any thread may compile.
    """

    def decorate(function: F) -> Any:
        settings: Any = numba_config
        if settings.DISABLE_JIT:
            return function
        made = _new(function, options)
        made.declared = signature
        return made

    return decorate


def _new(function: Any, options: dict[str, Any], kind: Any = Kernel) -> Any:
    options = {"nopython": True, "nogil": True, **KERNEL, **options}
    return kind(function, pipeline_class=options.pop("pipeline_class"), targetoptions=options)


def compiled_anew(function: Any, signature: Any = None) -> Any:
    """A kernel, or a function of a signature, compiled in this process: what was kept shows no code."""
    anew = _new(interpreted(function), {})
    anew.compile(function.signatures[0] if signature is None else signature)
    return anew


def interpreted(function: F) -> F:
    """The Python function of a kernel: the same arithmetic but for fused products."""
    plain: F = getattr(function, "py_func", function)
    return plain


#: Keeps what ``inlined`` has made: numba's types only refer to it.
_parts: list[Any] = []


def inlined(function: F) -> F:
    """Make a small function callable from kernels; in Python it stays the plain function.

    The same source therefore serves compiled lanes and NumPy arrays. It is compiled once for its arguments'
    types: numba's ``register_jitable`` does so for kernels and for inlined functions apart.
    """
    return _inlined(function, INLINED)


def inlined_exactly(function: F) -> F:
    """The same for interval arithmetic: whatever function it is compiled into, nothing of it is fused."""
    return _inlined(function, {**INLINED, **EXACT})


def _inlined(function: F, options: Any) -> F:
    _parts.append(njit(**options)(function))
    infer_global(function, types.Dispatcher(_parts[-1]))  # type: ignore[no-untyped-call]
    return function


class _Part(CPUDispatcher):
    """A function that kernels call; numba would compile it anew for every literal that it is given."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        plain: Any = types.unliteral
        given = {name: plain(kind) for name, kind in kws.items()}
        return super().get_call_template(tuple(map(plain, args)), given)


def called(function: F) -> Any:
    """Make a function callable from kernels that is compiled once for all its calls there."""
    settings: Any = numba_config
    return function if settings.DISABLE_JIT else _new(function, PART, _Part)


def lowered(typed: Callable[..., Any]) -> Callable[[F], F]:
    """A function that kernels compile to instructions of LLVM; in Python it stays what it is.

    ``typed(context, *types)`` gives signature and writer of the instructions, as of numba's intrinsics.
    """

    def decorate(function: F) -> F:
        made: Any = make_intrinsic_template(function, typed, function.__name__)  # type: ignore[no-untyped-call]
        infer_global(function, types.Function(made))  # type: ignore[no-untyped-call]
        return function

    return decorate


def _fused(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        number = args[0].type
        function = builder.module.declare_intrinsic(
            "llvm.fmuladd", [number], ir.FunctionType(number, [number] * 3)
        )
        return builder.call(function, args)

    return c(c, c, c), generate


@lowered(_fused)
def multiply_add(a: Any, b: Any, c: Any) -> Any:
    """a b + c, compiled to one instruction where the processor has it.

    For sums of two products, of which ``contract`` lets the compiler fuse either one: vectors and what is
    left of a loop may then differ by a rounding. The arguments have one type.
    """
    return a * b + c


@cache
def in_precision(shipped: Any, precision: str, signature: Callable[[Any], Any]) -> Any:
    """A kernel, or the same source for lanes of float32; ``signature`` makes that of a precision."""
    return shipped if precision == "float64" else kernel(signature(types.float32))(interpreted(shipped))


def by_precision(double: F, single: F) -> F:
    """A function of one number that kernels compile as ``single`` for float32 and as ``double`` otherwise.

    In Python it is ``double``.
    """

    @wraps(double)
    def function(x: Any) -> Any:
        return double(x)

    def choose(x: Any) -> Any:
        return single if x == types.float32 else double

    overload(function, jit_options=INLINED, strict=False)(choose)
    return function  # type: ignore[return-value]


def _cast(typingctx: Any, x: Any, value: Any) -> Any:
    kind = types.float32 if getattr(x, "dtype", x) == types.float32 else value

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return context.cast(builder, args[1], value, kind)

    return kind(x, value), generate


@lowered(_cast)
def rounded_to(x: Any, value: Any) -> Any:
    """``value`` in the precision of ``x``, a number or an array: what keeps float32 lanes in float32.

    Without it a literal or a step's length would turn a lane's arithmetic into float64. In Python it is
    ``value``.
    """
    return value
