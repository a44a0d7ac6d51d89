"""Lanes of float32 beside lanes of float64 near a basin boundary: rounding decides where a motion ends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastmech.basins.label import labels_of
from fastmech.basins.status import BasinStatus
from fastmech.ensembles.integrate import Trajectories, integrate
from fastmech.ensembles.status import Status
from fastmech.hardcases.case import HardCase, Row, row_of
from fastmech.hardcases.references import Boundary, boundary

#: Distances from the boundary [rad], on both sides.
DISTANCES = 10.0 ** -np.arange(3.0, 15.0)

DT, T_END = 0.01, 60.0

#: Distance from which on every end must be right: a thousand roundings of phi, which is near 1; they grow on
#: the way to the saddle.
RIGHT_FROM = {"float64": 1e-12, "float32": 1e-4}


def _starts(edge: Boundary) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
    """Starts (n, 4), whether each lies above the boundary, and its distance [rad]."""
    shift = np.concatenate([-DISTANCES, DISTANCES])
    starts = np.zeros((shift.size, 4))
    starts[:, 0] = edge.phi + shift
    return starts, shift > 0.0, np.abs(shift)


def _wrong(edge: Boundary, run: Trajectories, above: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which trajectories have not ended where they must."""
    to_above, to_below = (np.abs(run.y[-1, :, :2] - end).max(axis=1) for end in (edge.above, edge.below))
    return np.asarray((to_above < to_below) != above)


def _run(quick: bool) -> Sequence[Row]:
    edge = boundary()
    starts, above, distance = _starts(edge)
    rows = []
    for dtype, allowed in RIGHT_FROM.items():
        run = integrate(edge.scene, starts, T_END, DT, "dop853", dtype=dtype)
        error = float(distance[_wrong(edge, run, above)].max(initial=0.0))
        farthest = f"farthest wrong end {error:.0e} rad from the boundary" if error else "every end is right"
        remark = f"{dtype}: {farthest}"
        rows.append(row_of(run, error, allowed, remark=remark))
    return [*rows, _certified(edge, starts, above, distance)]


def _certified(
    edge: Boundary, starts: NDArray[np.float64], above: NDArray[np.bool_], distance: NDArray[np.float64]
) -> Row:
    """Labels with a proof: none may be wrong, and near the boundary there must be none but a status."""
    found = labels_of(edge.scene, starts, T_END)
    tree = found.tree
    assert tree is not None
    places = np.array([[tree.equilibria[w].phi, tree.equilibria[w].theta] for w in found.well])
    ends = places + 2.0 * np.pi * found.turns
    proved = found.status == BasinStatus.CAPTURED
    right = np.where(above[:, None], edge.above, edge.below)
    wrong = proved & (np.abs(ends - right).max(axis=1) > 0.1)
    nearest = float(distance[proved].min(initial=np.inf))
    others = ", ".join(sorted({BasinStatus(s).name.lower() for s in found.status[~proved]}))
    remark = f"fm.labels_of: {proved.sum()} of {above.size} proved, to {nearest:.0e} rad; nearer: {others}"
    status = Status.OK.name.lower()
    return Row("dop853", np.nan, found.steps, float(wrong.sum()), 0.0, np.nan, status, True, remark)


CASES = (
    HardCase(
        "float32_at_a_boundary",
        "starts 1e-3 to 1e-14 rad from a basin boundary, in lanes of float32 and of float64",
        "the boundary by bisection with heyoka in 80-bit arithmetic; error: distance from it at which an end "
        "is wrong; of fm.labels_of, the number of wrong proofs",
        "wrong ends only within the grown rounding of the precision; fm.labels_of proves none: nearer to the "
        "boundary it gives a status",
        _run,
    ),
)
