"""Labels: where starts end, when, and how they are told."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.attractors.find import Attractors
from fastmech.attractors.settle import Ends
from fastmech.ensembles.status import LABELS, Status, counts
from fastmech.objects import Field, Result, counted

#: Starts that are followed together, at most; and so many pieces, if they are not smaller than the least.
#: Every piece takes something of everywhere, so that all take about as long and progress tells the time left.
BATCH, PIECES, LEAST = 1 << 16, 16, 1 << 11

#: Wells that have a line of their own where ends are printed.
MOST_LINES = 3


@dataclass(frozen=True, repr=False)
class Labels(Result):
    """Where n starts end; printed, how many end where, and when."""

    tree: Any  #: wells, barriers and equilibria; of what keeps moving :class:`~.find.Attractors`
    well: NDArray[np.int8]  #: index of the well among the equilibria or attractors, -1: no label; shape (n,)
    turns: NDArray[np.int32]  #: full turns of each coordinate of that well from its listed place, (n, coords)
    time: Floats  #: of capture [s], NaN: not captured; the end of a step; (n,)
    settle_time: Floats | None  #: s, from then on within the settling ball; NaN: not by t_end; (n,)
    status: NDArray[np.int8]  #: :class:`Status`, (n,)
    steps: int  #: integration steps of all computations of all starts
    t_end: float = np.nan  #: end of the runs [s]
    parted: int = 0  #: undecided ones that the finest steps capture, but that others do not confirm

    @property
    def counts(self) -> dict[str, int]:
        """How many starts have each status."""
        return counts(self.status, LABELS)

    KIND = "labels"
    FIELDS = {
        "well": Field("start", "1", "well or attractor at the end, -1: no label", codes=-1),
        "turns": Field("start coordinate_number", "1", "full turns of each coordinate of that well"),
        "time": Field("start", "s", "when it is known, NaN: it is not"),
        "settle_time": Field("start", "s", "from then on near its well, NaN: not by the end"),
        "status": Field("start", "1", "what is known of the start", codes=Status),
        "steps": Field("", "1", "integration steps of all computations"),
        "t_end": Field("", "s", "end of the runs"),
    }

    def told(self) -> str:
        """How many starts end where, and when."""
        return told_ends(counted(self.status.size, "start"), self)


def told_ends(what: str, found: Any) -> str:
    """At most six lines on ``what`` has the wells, statuses and times of :class:`Labels`, and its tree."""
    n, well = found.status.size, found.well.ravel()
    known, number = np.unique(well[well >= 0], return_counts=True)
    order = np.argsort(-number, kind="stable")
    statuses = ", ".join(f"{count:,} {name}" for name, count in found.counts.items() if count)
    lines = [f"{what}: {statuses}"]
    # A line that says how many more there are might as well name the only one.
    named = order.size if order.size == MOST_LINES + 1 else MOST_LINES
    for k in order[:named]:
        lines.append(f"  {_named(found.tree, int(known[k]))}: {number[k]:,} ({number[k] / n:.1%})")
    if order.size > named:
        lines.append(f"  {order.size - named} more: {number[order[named:]].sum():,}")
    times = found.time[np.isfinite(found.time)]
    took = f"  after {np.median(times):.3g} s (median), {times.max():.3g} s at most" if times.size else ""
    late = found.counts[Status.UNDECIDED.name.lower()] - found.parted
    helps = f"; a longer t_end may decide {late:,}" * (late > 0)
    helps += f"; steps part for {found.parted:,}, which a smaller dt may decide" * (found.parted > 0)
    lines.append(f"{took}{';' if took else ' '} followed for {found.t_end:g} s{helps}")
    return "\n".join(lines)


def _named(tree: Any, k: int) -> str:
    """A stop's code, an attractor, or a well by its number among wells, as pictures have it."""
    if tree is None:
        return f"code {k}"
    if isinstance(tree, Attractors):
        return tree[k].name
    number = sum(e.morse_index == 0 for e in tree.equilibria[:k])
    listed = "" if number == k else f" (equilibrium {k})"
    return f"well {number}{listed} at {tree.equilibria.place(k)}"


def of_attractors(found: Attractors, ends: Attractors | Ends) -> Labels:
    """Labels of starts by attractors."""
    n = len(ends.label)
    turns = np.zeros((n, max(len(found.names) // 2, 1)), dtype=np.int32)
    own = found, ends.label.astype(np.int8), turns, ends.time, None
    return Labels(*own, status=ends.status, steps=ends.steps, t_end=found.t_end)


def pieces_of(n: int) -> Iterator[NDArray[np.intp]]:
    """Indices of n starts, piece by piece."""
    pieces = max(-(-n // BATCH), min(PIECES, n // LEAST), 1)
    for piece in range(pieces):
        yield np.arange(piece, n, pieces)
