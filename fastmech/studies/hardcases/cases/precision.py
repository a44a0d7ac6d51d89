"""Lanes of float32 beside lanes of float64 near a basin boundary: rounding decides where a motion ends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.basins.label import label_starts
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.status import Status
from fastmech.errors import InputError
from fastmech.studies.hardcases.walk import (
    REFUSED,
    Boundary,
    HardCase,
    Row,
    admitted_step,
    boundary,
    halving_tells,
    labellers,
    labels_row,
    row_of,
    without_euler,
)

#: Distances from the boundary [rad], on both sides.
DISTANCES = 10.0 ** -np.arange(3.0, 15.0)

DT, T_END = 0.01, 60.0

#: Time in which motions come to the saddle [s]: the error that a method makes until then moves its boundary.
NEAR = 5.0

#: Distance from which on every end must be right: a thousand roundings of phi, which is near 1; they grow on
#: the way to the saddle.
RIGHT_FROM = {"float64": 1e-12, "float32": 1e-4}


class _Line(NamedTuple):
    """Starts at rest on both sides of the boundary."""

    edge: Boundary
    starts: Floats  #: (n, 4)
    above: NDArray[np.bool_]  #: whether each lies above the boundary
    distance: Floats  #: from it [rad]


def _line() -> _Line:
    edge, shift = boundary(), np.concatenate([-DISTANCES, DISTANCES])
    starts = np.zeros((shift.size, 4))
    starts[:, 0] = edge.phi + shift
    return _Line(edge, starts, shift > 0.0, np.abs(shift))


def _run(quick: bool) -> Sequence[Row]:
    line, rows = _line(), []
    for method in without_euler(quick):
        dt = admitted_step(line.edge.scene, method, DT)
        rows += [_ends(line, method, dt, dtype) for dtype in RIGHT_FROM]
    return [*rows, *(_certified(line, method) for method in labellers(quick))]


def _ends(line: _Line, method: str, dt: float, dtype: str) -> Row:
    """Where motions end in one precision; the boundary that a method sees moves by its own error, too."""
    edge, starts, above, distance = line
    try:
        run = integrate(edge.scene, starts, T_END, dt, method, dtype=dtype)
    except InputError as refusal:
        why = "float32 is not offered"
        return Row(method, dt, 0, np.nan, np.nan, np.nan, REFUSED, False, str(refusal), why)
    to_above, to_below = (np.abs(run.y[-1, :, :2] - end).max(axis=1) for end in (edge.above, edge.below))
    error = float(distance[(to_above < to_below) != above].max(initial=0.0))
    near = integrate(edge.scene, starts, NEAR, dt, method).y[-1]
    half = integrate(edge.scene, starts, NEAR, 0.5 * dt, method).y[-1]
    estimate = 2.0 * halving_tells(method, near, half)
    farthest = f"farthest wrong end {error:.0e} rad from the boundary" if error else "every end is right"
    remark, why = f"{dtype}: {farthest}", "rounding, and what halving the step tells"
    return row_of(run, error, RIGHT_FROM[dtype] + estimate, remark=remark, why=why)


def _certified(line: _Line, method: str) -> Row:
    """Labels with a proof: none may be wrong, and near the boundary there must be none but a status."""
    edge, starts, above, distance = line
    found = label_starts(edge.scene, starts, T_END, method=method)
    tree = found.tree
    assert tree is not None
    places = np.array([[tree.equilibria[w].phi, tree.equilibria[w].theta] for w in found.well])
    ends = places + 2.0 * np.pi * found.turns
    proved = found.status == Status.CAPTURED
    right = np.where(above[:, None], edge.above, edge.below)
    wrong = proved & (np.abs(ends - right).max(axis=1) > 0.1)
    nearest = float(distance[proved].min(initial=np.inf))
    others = ", ".join(sorted({Status(s).name.lower() for s in found.status[~proved]}))
    remark = f"labels: {proved.sum()} of {above.size} proved, to {nearest:.0e} rad; nearer: {others}"
    return labels_row(method, found, wrong.sum())._replace(remark=remark)


CASES = (
    HardCase(
        "float32_at_a_boundary",
        "starts 1e-3 to 1e-14 rad from a basin boundary, in lanes of float32 and of float64",
        "the boundary by bisection with heyoka in 80-bit arithmetic; error: distance from it at which an end "
        "is wrong; of fm.label_starts, the number of wrong proofs",
        "wrong ends only within the grown rounding of the precision; fm.label_starts proves none: closer "
        "to it there is a status",
        _run,
    ),
)
