"""How the times of a run are passed: steps between outputs, in pieces of which a call takes some.

Where a piece ends depends on output times and step alone, never on who runs: it decides how times round.
How many pieces a call takes is free.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastmech.errors import InputError

Floats = NDArray[np.float64]

#: More steps than this take hours, and the times of their pieces more memory than most machines have.
MOST_STEPS = 2.0**34

#: Steps of a piece: as few as these, more where an interval has more than so many pieces, never above most.
PIECE_STEPS, PIECES, MOST_PIECE_STEPS = 64, 1024, 2048


@dataclass(frozen=True)
class Span:
    """Times that one call passes: where it starts, then where each ``steps`` ends; some are outputs."""

    times: Floats
    steps: NDArray[np.int64]
    outputs: NDArray[np.int64]  #: index of the output at the end of each piece, -1: none
    passed: int  #: outputs passed at the end of the span

    def part(self, first: int, end: int) -> Span:
        """Pieces from ``first`` on, before ``end``; outputs count as passed at the end of the whole span."""
        return Span(self.times[first : end + 1], self.steps[first:end], self.outputs[first:end], self.passed)


@dataclass(frozen=True)
class Way:
    """All pieces of a run; fields as those of :class:`Span`."""

    times: Floats
    steps: NDArray[np.int64]
    outputs: NDArray[np.int64]

    @cached_property
    def _steps_before(self) -> NDArray[np.int64]:
        return np.concatenate([[0], np.cumsum(self.steps)])

    @cached_property
    def _passed(self) -> NDArray[np.int64]:
        return np.cumsum(self.outputs >= 0)

    def span(self, first: int, most: int) -> Span:
        """What a call passes from piece ``first`` on: one piece, or more while steps are at most ``most``."""
        before = self._steps_before
        end = max(first + 1, int(np.searchsorted(before, before[first] + most, side="right")) - 1)
        return Span(
            self.times[first : end + 1],
            self.steps[first:end],
            self.outputs[first:end],
            int(self._passed[end - 1]),
        )


def output_steps(times: Floats, dt: float) -> NDArray[np.int64]:
    """Steps between output times: the fewest equal ones that are no longer than ``dt``.

    Raises:
        InputError: the step is not positive, the times do not rise, or there would be too many steps.
    """
    intervals = times[1:] - times[:-1]
    if not dt > 0.0 or not (intervals >= 0.0).all():
        raise InputError(f"dt = {dt:g} s: must be greater than 0, and the times must rise")
    # A quotient that is an integer but for rounding must not cost a step more.
    with np.errstate(over="ignore"):  # an infinite number is refused below
        steps = np.ceil(intervals / dt * (1.0 - 1e-12))
        number = steps.sum()
    if not number <= MOST_STEPS:
        raise InputError(f"dt = {dt:g} s: gives {number:.3g} steps, at most {MOST_STEPS:.0e} are possible")
    return steps.astype(np.int64)


def way(times: Floats, dt: float) -> Way:
    """The way through all output times; an interval of many steps is cut into pieces.

    Raises:
        InputError: as :func:`output_steps`.
    """
    totals = output_steps(times, dt)
    lengths = np.minimum(np.maximum(-(-totals // PIECES), PIECE_STEPS), MOST_PIECE_STEPS)
    pieces = np.maximum(1, -(-totals // lengths))
    output = np.repeat(np.arange(totals.size), pieces)
    number = np.arange(output.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    total, begin = totals[output], number * lengths[output]
    end = np.minimum(begin + lengths[output], total)
    start, stop, last = times[output], times[output + 1], end == total
    at = np.where(last, stop, start + (stop - start) * (end / np.maximum(total, 1)))
    return Way(np.concatenate([times[:1], at]), end - begin, np.where(last, output, -1))
