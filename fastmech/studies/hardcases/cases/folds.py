"""One part in a million from a fold, on either side: a passage so slow that it looks like rest.

Near a fold the motion follows one direction, x' = b (x^2 - d^2) with the minimum and the saddle at -d and d
before it, x' = b (x^2 + d^2) behind it (the normal form: Strogatz, *Nonlinear Dynamics and Chaos*, sections
3.1 and 4.3). The saddle's growing eigenvalue before the fold is r = 2 b d, so that from the middle
x = -d tanh(r t / 2) before and d tan(r t / 2) behind it: the ghost is left after pi / r, some 5000 s.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.atlas.folds import find_folds
from fastmech.basins.label import label_starts
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.status import Status
from fastmech.equilibria.find import Equilibria, find_equilibria
from fastmech.scene import Scene
from fastmech.stability.linearize import jacobian
from fastmech.studies.hardcases.walk import (
    DRIVEN,
    HardCase,
    Row,
    admitted_step,
    labellers,
    labels_row,
    row_of,
    walked,
)

SCENE = Scene(c1=294.9, c2=92.85, alpha=0.0)

#: Distance from the fold [N].
DISTANCE = 1e-6

#: Where a fold of a minimum lies: force [N].
AROUND = (600.0, 750.0)

#: Longest step, length of the creeping part that every method runs, and of the whole passage [s].
DT, CREEPING, WHOLE = 0.05, 3000.0, 20_000.0

#: Methods with steps as long as this [s] run the whole passage in the full version.
AFFORDABLE = 0.04

#: Relative error of the place on the way, or of the time of leaving: the normal form's own.
ALLOWED = 0.01

#: Starts for labels: distances [rad] from the saddle, or its ghost, along the way; positive: outwards.
OUTWARDS = np.array([-1e-3, -1e-4, -1e-5, 0.0, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1])

#: How long labels are looked for, and the ball in which a motion counts as settled [s, rad].
LABELLED, SETTLED = 60.0, 0.05


class _Passage(NamedTuple):
    """The two scenes beside the fold and the slow way between its equilibria."""

    scenes: dict[float, Scene]  #: by side, -1 and 1
    equilibria: dict[float, Equilibria]
    middle: Floats  #: (2,) rad
    way: Floats  #: (2,), from the minimum to the saddle
    half: float  #: d: half their distance [rad]
    rate: float  #: r: the saddle's growing eigenvalue [1/s]


def _passage() -> _Passage:
    fold = find_folds(SCENE, "F0", np.linspace(*AROUND, 16))[0]
    scenes = {side: SCENE.replace(F0=fold.value + side * DISTANCE) for side in (-1.0, 1.0)}
    equilibria = {side: find_equilibria(scene) for side, scene in scenes.items()}
    places = [e for e in equilibria[-1.0] if np.hypot(e.phi - fold.phi, e.theta - fold.theta) < 0.02]
    minimum = next(e for e in places if e.morse_index == 0)
    saddle = next(e for e in places if e.morse_index == 1)
    ends = np.array([[minimum.phi, minimum.theta], [saddle.phi, saddle.theta]])
    gap = float(np.linalg.norm(ends[1] - ends[0]))
    rate = float(np.linalg.eigvals(jacobian(scenes[-1.0], saddle)).real.max())
    return _Passage(scenes, equilibria, ends.mean(axis=0), (ends[1] - ends[0]) / gap, 0.5 * gap, rate)


def _creeping(passage: _Passage, side: float, method: str) -> Row:
    """How far the motion has crept, by its phase r t / 2, against the normal form's."""
    scene = passage.scenes[side]
    dt = admitted_step(scene, method, DT)
    run = integrate(scene, [*passage.middle, 0.0, 0.0], CREEPING, dt or DT, method)
    x = float((run.y[-1, 0, :2] - passage.middle) @ passage.way) / passage.half
    with np.errstate(invalid="ignore"):
        phase = np.arctan(x) if side > 0.0 else -np.arctanh(x)
    error = abs(float(phase) / (0.5 * passage.rate * CREEPING) - 1.0)
    if dt == 0.0:
        return row_of(run, error, np.nan, claimed=False, why=DRIVEN)
    return row_of(run, error, ALLOWED, remark=f"{x * passage.half:.2e} rad on", why="resolves the slow rate")


def _whole(passage: _Passage, side: float, method: str) -> Row:
    """The minimum that is reached in the end, and when the ghost is left."""
    scene = passage.scenes[side]
    times = np.arange(10.0, WHOLE + 5.0, 10.0)
    run = integrate(scene, [*passage.middle, 0.0, 0.0], dt=DT, method=method, t_eval=times)
    places = run.y[:, 0, :2]
    away = np.linalg.norm(places - passage.middle, axis=1)
    if side < 0.0:
        error = abs(float(away[-1]) / passage.half - 1.0)
        return row_of(run, error, ALLOWED, remark="at the shallow minimum", why="resolves the slow rate")
    left = float(times[np.argmax(away > 0.1)]) if (away > 0.1).any() else np.inf
    minimum = next(e for e in passage.equilibria[side] if e.morse_index == 0)
    off = float(np.abs(np.exp(1j * (places[-1] - [minimum.phi, minimum.theta])) - 1.0).max())
    error = abs(left * passage.rate / np.pi - 1.0) if off < 1e-3 else np.inf
    remark = f"left after {left:g} s, {off:.0e} rad from the minimum in the end"
    return row_of(run, error, ALLOWED, remark=remark, why="resolves the slow rate")


def _labels(passage: _Passage, side: float, method: str) -> Row:
    """No start may be given to a well that it does not end in, and none be settled on the way."""
    scene, wells = passage.scenes[side], [e.morse_index == 0 for e in passage.equilibria[side]]
    shallow = [
        k
        for k, e in enumerate(passage.equilibria[side])
        if wells[k] and np.hypot(e.phi - passage.middle[0], e.theta - passage.middle[1]) < 0.02
    ]
    deep = next(k for k, is_well in enumerate(wells) if is_well and k not in shallow)
    starts = np.zeros((OUTWARDS.size, 4))
    saddle = passage.half if side < 0.0 else 0.0
    starts[:, :2] = passage.middle + (saddle + OUTWARDS[:, None]) * passage.way
    found = label_starts(scene, starts, LABELLED, method=method, settle_radius=SETTLED)
    assert found.settle_time is not None
    captured = found.status == Status.CAPTURED
    # Before the fold starts on the saddle, and inwards of it, are not the deep well's.
    inside = (OUTWARDS <= 0.0) & (side < 0.0)
    right = np.where(inside, np.isin(found.well, shallow) & (OUTWARDS < 0.0), found.well == deep)
    wrong = int((captured & ~right).sum() + np.isfinite(found.settle_time).sum())
    return labels_row(method, found, wrong, "; none settled")


def _beside(side: float, quick: bool) -> Sequence[Row]:
    passage = _passage()
    rows = [_creeping(passage, side, method) for method in walked(quick)]
    if not quick:
        rows += [_whole(passage, side, row.method) for row in rows if row.claimed and row.dt >= AFFORDABLE]
    return [*rows, *(_labels(passage, side, method) for method in labellers(quick))]


CASES = tuple(
    HardCase(
        name,
        f"{DISTANCE:g} N {where}: speeds of 1e-7 rad/s far from any rest",
        "the fold's normal form with the saddle's eigenvalue; error: of the phase on the way, of the time of "
        "leaving, of the minimum's place; of fm.label_starts, how many labels are wrong and motions settled",
        must,
        partial(_beside, side),
    )
    for name, side, where, must in (
        (
            "before_a_fold", -1.0, "before a minimum and a saddle merge",
            "it creeps into the well that is left; a start on the saddle, or between, is never given to the "
            "well behind it, nor is the saddle taken for rest",
        ),
        (
            "behind_a_fold", 1.0, "behind the merging",
            "it passes the ghost in the time of the normal form; the ghost is never taken for rest, and "
            "every label is the well that remains",
        ),
    )
)  # fmt: skip
