"""How the times of a run are passed: steps between outputs, in calls that are not too long."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastmech.errors import InputError

Floats = NDArray[np.float64]

#: More steps than this cannot be counted by their times in double precision.
MOST_STEPS = 2.0**53


@dataclass(frozen=True)
class Span:
    """Times that one call passes: where it starts, then where each ``steps`` ends; some are outputs."""

    times: Floats
    steps: NDArray[np.int64]
    outputs: NDArray[np.int64]  #: index of the output at the end of each piece, -1: none
    passed: int  #: outputs passed at the end of the span


def output_steps(times: Floats, dt: float) -> NDArray[np.int64]:
    """Steps between output times: the fewest equal ones that are no longer than ``dt``.

    Raises:
        InputError: the step is not positive, the times do not rise, or there would be too many steps.
    """
    if not dt > 0.0 or not (np.diff(times) >= 0.0).all():
        raise InputError(f"dt = {dt:g} s: must be greater than 0, and the times must rise")
    # A quotient that is an integer but for rounding must not cost a step more.
    with np.errstate(over="ignore"):  # an infinite number is refused below
        steps = np.ceil(np.diff(times) / dt * (1.0 - 1e-12))
        number = steps.sum()
    if not number <= MOST_STEPS:
        raise InputError(f"dt = {dt:g} s: gives {number:.3g} steps, at most {MOST_STEPS:.0e} are possible")
    return steps.astype(np.int64)


def spans(times: Floats, dt: float, most: int) -> Iterator[Span]:
    """The way through all output times in pieces of at most ``most`` steps.

    An interval between outputs that has more steps is cut; shorter ones are gathered into one span.
    """
    at: list[float] = [float(times[0])]
    steps: list[int] = []
    outputs: list[int] = []
    passed = 0
    for output, total in enumerate(output_steps(times, dt).tolist()):
        start, stop = times[output], times[output + 1]
        for end in [*range(most, total, most), total]:
            piece = end - (end - 1) // most * most if end else 0
            if steps and sum(steps) + piece > most:
                yield Span(np.array(at), np.array(steps), np.array(outputs), passed)
                at, steps, outputs = at[-1:], [], []
            at.append(float(stop if end == total else start + (stop - start) * (end / total)))
            steps.append(piece)
            outputs.append(output if end == total else -1)
            passed = output + 1 if end == total else passed
    yield Span(np.array(at), np.array(steps), np.array(outputs), passed)
