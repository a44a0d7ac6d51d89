"""Arguments of the public functions, checked and cast once: kernels assume clean arrays.

All raise :class:`fastmech.errors.InputError` where an argument is not what is described.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.errors import InputError, shown
from fastmech.samplers import Starts, sampler_of
from fastmech.scene import nearest

#: Bytes for which the machine is not asked whether it has them: the question takes longer than a small run.
UNASKED = 2**26

#: Angles lie within so many turns of zero: what is beyond was meant in degrees. Angles larger than the second
#: number are none in degrees either.
FEW_TURNS, MOST_DEGREES = 4, 720.0


def number(name: str, value: Any, unit: str, *, above: float = -math.inf, least: float = -math.inf) -> float:
    """A finite number greater than ``above`` and not less than ``least``."""
    allowed = f"must be a finite number of {unit}" if unit else "must be a finite number"
    if above > -math.inf:
        allowed += f" greater than {above:g}"
    if least > -math.inf:
        allowed += f" not less than {least:g}"
    try:
        found = float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    except OverflowError:  # of an integer
        found = math.inf
    if not math.isfinite(found) or not found > above or not found >= least:
        raise InputError(f"{name} = {shown(value)}: {allowed}")
    return found


def whole_number(name: str, value: Any, *, least: int, most: int | None = None) -> int:
    """An integer not less than ``least`` and not greater than ``most``."""
    if not isinstance(value, Integral) or isinstance(value, bool) or value < least:
        raise InputError(f"{name} = {shown(value)}: must be an integer not less than {least}")
    if most is not None and int(value) > most:
        raise InputError(f"{name} = {shown(value)}: must be an integer not greater than {most}")
    return int(value)


def one_of(name: str, value: Any, names: Iterable[str]) -> str:
    """A text that is one of ``names``."""
    known = list(names)
    if not isinstance(value, str) or value not in known:
        raise InputError(f"{name} = {shown(value)}: {nearest(value, known)}")
    return value


def mapping(name: str, value: Any, what: str) -> Mapping[str, Any]:
    """A mapping from names to ``what``."""
    if not isinstance(value, Mapping):
        raise InputError(f"{name} = {shown(value)}: must map names to {what}")
    return value


def listed(name: str, value: Any, what: str) -> list[Any]:
    """At least one of ``what``, in a list or the like."""
    if isinstance(value, str | Mapping) or not isinstance(value, Iterable) or not (found := list(value)):
        raise InputError(f"{name} = {shown(value)}: must be a list of {what}, not empty")
    return found


def part_of(part: Any) -> slice:
    """Which of many are asked for, all by default."""
    if part is not None and not isinstance(part, slice):
        raise InputError(f"part = {shown(part)}: must be a slice, such as slice(0, 100)")
    return part or slice(None)


def function(name: str, value: Any, of: str) -> None:
    """Refuse what cannot be called with ``of``; ``None`` is none."""
    if value is not None and not callable(value):
        raise InputError(f"{name} = {shown(value)}: must be a function of {of}")


def progress_function(progress: Any, what: str) -> None:
    """Refuse a ``progress`` that cannot be told how many of ``what`` have finished; ``None`` is none."""
    function("progress", progress, f"the number of finished {what}")


def reals(name: str, values: ArrayLike, what: str, least_dimensions: int = 0) -> Floats:
    """An array of doubles from numbers; texts, complex numbers, objects and hidden entries are no numbers.

    Not copied where it is one already: ten million states take 320 MB.
    """
    try:
        given = np.asarray(values)
        if (given.dtype.kind not in "iuf" and given.size) or np.ma.is_masked(values):
            raise TypeError
        return np.array(given, dtype=np.float64, order="C", ndmin=least_dimensions, copy=None)
    except (TypeError, ValueError):
        raise InputError(f"{name}: must be {what}") from None


def states(name: str, values: ArrayLike, columns: int, each: str = "") -> Floats:
    """An array of shape (n, columns); a single state becomes one row. Values need not be finite.

    ``each`` tells what the columns are.
    """
    shape = f"(n, {columns}){each}"
    memory(getattr(values, "size", 0), 1, f"{name}: the states", "fewer")
    array = reals(name, values, f"numbers of shape {shape}", 2)
    if array.ndim != 2 or array.shape[1] != columns:
        raise InputError(f"{name}: has shape {np.shape(values)}, must be {shape}")
    return array


def starts(
    name: str,
    given: Starts,
    names: Sequence[str],
    *,
    n: int | None = None,
    seed: int | None = None,
    default: int | None = None,
) -> Floats:
    """States (n, len(names)) of a sampler, of ranges by name, or given ones; the first ``n`` if told.

    ``n`` and ``seed`` are those of the sampler if not told, and ``default`` is how many if it has no number.
    """
    sampler = sampler_of(given)
    if n is not None:
        n = whole_number("n", n, least=1, most=1 << 31)
    if sampler is None:
        each = f": {', '.join(names)}"
        return states(name, given, len(names), each)[:n]  # type: ignore[arg-type]
    asked = next((count for count in (n, sampler.n, default) if count is not None), None)
    if asked is None:
        raise InputError(f"{name}: how many starts? such as fastmech.samplers.Uniform(ranges, n=1000)")
    count = whole_number("n", asked, least=1, most=1 << 31)
    memory(count * len(names), 2, f"n: {count:,} starts", "fewer")
    drawn = sampler.draw(
        count, tuple(names), whole_number("seed", sampler.seed if seed is None else seed, least=0)
    )
    if count > 1 and (drawn == drawn[0]).all():
        raise InputError(f"{name}: all {count:,} are the same; give a range (low, high) of some state")
    return drawn


def beyond_turns(largest: float) -> str:
    """What is wrong with an angle so large."""
    return f"reaches {largest:g}, beyond {FEW_TURNS} turns; angles are in radians (numpy.deg2rad)"


def warn_of_turns(name: str, given: Floats, angles: Sequence[int]) -> None:
    """Warn of states (n, dim) whose angles, columns of them, may be degrees."""
    sizes = np.abs(given[:, list(angles)])
    largest = float(np.max(sizes, initial=0.0, where=np.isfinite(sizes)))
    if 2.0 * np.pi * FEW_TURNS < largest <= MOST_DEGREES:
        warnings.warn(f"{name}: {beyond_turns(largest)}", stacklevel=3)


def memory(
    numbers: int,
    copies: int,
    what: str = "y0, t_eval: the states",
    fewer: str = "fewer trajectories or output times",
) -> None:
    """Refuse results of so many numbers, held ``copies`` times on the way, before anything is allocated.

    ``what`` they are, and what needs less, is for the message.
    """
    needed = 8 * numbers * copies
    free = free_memory() if needed > UNASKED else math.inf
    if needed > free:
        raise InputError(
            f"{what} would take {needed / 2**30:.3g} GiB on the way, {free / 2**30:.3g} GiB are free; "
            f"ask for {fewer}"
        )


def free_memory() -> float:
    """Bytes of memory that this machine could still give, infinite where it does not tell."""
    try:
        text = Path("/proc/meminfo").read_text(encoding="ascii")
        return 1024.0 * float(text.split("MemAvailable:")[1].split()[0])
    except (OSError, IndexError, ValueError):
        return math.inf


def one_way(name: str, given: Any, values: Floats) -> None:
    """Refuse values of an axis that neither rise nor fall, or are a range, or start, stop and number.

    ``given`` is what ``values`` were made from.
    """
    if isinstance(given, tuple) and len(given) == 2:
        low, high = map(shown, given)
        raise InputError(f"{name} = {shown(given)}: must be values; give np.linspace({low}, {high}, 101)")
    spaced = values.size == 3 and float(values[2]).is_integer() and values[2] >= 2.0
    advice = f"numpy.linspace({values[0]:g}, {values[1]:g}, {values[2]:g})" if spaced else ""
    if spaced and isinstance(given, tuple) and isinstance(given[2], Integral):
        raise InputError(
            f"{name} = {shown(given)}: may be start, stop and number; "
            f"give {advice}, or a list of three values"
        )
    if not np.isfinite(values).all():
        k = int(np.argmin(np.isfinite(values)))
        raise InputError(f"{name}[{k}] = {values[k]:g}: must be finite")
    steps = np.diff(values) * (1.0 if values[-1] > values[0] else -1.0)
    if not (steps > 0.0).all():
        k = int(np.argmin(steps > 0.0)) + 1
        raise InputError(
            f"{name}[{k}] = {values[k]:g} after {values[k - 1]:g}: "
            "must rise or fall throughout, no value twice"
            + (f"; for {values[2]:g} values give {advice}" if spaced else "")
        )


def rising_times(name: str, values: ArrayLike) -> Floats:
    """Times [s], finite, not negative, strictly rising, at least one."""
    times = reals(name, values, "times in s", 1).copy()  # results keep it
    if times.ndim != 1 or not times.size:
        raise InputError(f"{name}: has shape {times.shape}, must be a row of at least one time")
    wrong = ~np.isfinite(times) | (times < 0.0) | (np.diff(times, prepend=-np.inf) <= 0.0)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(
            f"{name}[{k}] = {times[k]:g}: must be finite, not negative and strictly rising times in s"
        )
    return times


def check_pair(x: Any, y: Any) -> None:
    """Refuse what are no two parameters' names with their values."""
    for name, given in (("x", x), ("y", y)):
        if not isinstance(given, tuple | list) or len(given) != 2 or not isinstance(given[0], str):
            raise InputError(f"{name} = {shown(given)}: must be a parameter's name and its values")
    if x[0] == y[0]:
        raise InputError(f"axes: {x[0]} is given twice; two different parameters are needed")
