"""A start on a saddle's stable manifold to 1e-12: the smallest difference decides where it ends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.basins.label import label_starts
from fastmech.ensembles.integrate import Trajectories, integrate
from fastmech.ensembles.status import Status
from fastmech.equilibria.find import find_equilibria
from fastmech.scene import Scene
from fastmech.stability.linearize import jacobian
from fastmech.studies.hardcases.walk import (
    HardCase,
    Row,
    admitted_step,
    labellers,
    labels_row,
    row_of,
    without_euler,
)

SCENE = Scene(c1=294.9, c2=92.85, F0=85.3, alpha=0.0)
DT, CLOSEST = 0.02, 1e-12

#: How far behind the saddle sides are told [rad], and how long that may take [s].
NEAR, LONGEST = 0.3, 40.0

#: How long labels are looked for [s], and relative error of the growth.
LABELLED, ALLOWED = 100.0, 0.05


class _Saddle(NamedTuple):
    """A saddle with the directions in which motions leave and approach it."""

    place: Floats  #: (4,)
    growth: float  #: its growing eigenvalue [1/s]
    out: Floats  #: (4,), of the growing mode, largest angle 1
    along: Floats  #: (4,), of the slowest decaying mode, largest entry 1
    aside: Floats  #: (4,): times a departure gives the growing mode's share


def _saddle() -> _Saddle:
    saddle = next(e for e in find_equilibria(SCENE) if e.morse_index == 1)
    values, vectors = np.linalg.eig(jacobian(SCENE, saddle))
    fast = int(np.argmax(values.real))
    slow = min((k for k in range(4) if values[k].real < 0.0), key=lambda k: abs(values[k].imag))
    out, along = vectors[:, fast].real, vectors[:, slow].real
    out, along = out / np.abs(out[:2]).max(), along / np.abs(along).max()
    basis = np.column_stack([vectors.real, vectors.imag])[:, _basis(values)]
    basis[:, 0] = out
    place = np.array([saddle.phi, saddle.theta, 0.0, 0.0])
    return _Saddle(place, float(values[fast].real), out, along, np.linalg.inv(basis)[0])


def _starts(saddle: _Saddle, offset: Floats) -> Floats:
    return np.asarray(saddle.place + 0.1 * saddle.along + np.atleast_1d(offset)[:, None] * saddle.out)


def _leave(saddle: _Saddle, offset: Floats, method: str, dt: float) -> tuple[Floats, Floats, Trajectories]:
    """Sides on which starts at these offsets [rad] leave, and when [s]."""
    times = np.arange(DT, LONGEST, 10 * DT)
    run = integrate(SCENE, _starts(saddle, offset), t_eval=times, dt=dt, method=method)
    aside = (run.y - saddle.place) @ saddle.aside
    far = np.abs(aside) > NEAR
    first = np.argmax(far, axis=0)
    when = np.where(far.any(axis=0), times[first], np.inf)
    return np.sign(aside[first, np.arange(offset.size)]), when, run


def _root(saddle: _Saddle, method: str, dt: float) -> float:
    """Offset [rad] of the start on the stable manifold, by bisection."""
    low, high = -0.1, 0.1
    while high - low > CLOSEST:
        middle = np.linspace(low, high, 18)
        side, _, _ = _leave(saddle, middle, method, dt)
        change = int(np.argmax(side != side[0]))
        low, high = middle[change - 1], middle[change]
    return 0.5 * (low + high)


def _manifold(saddle: _Saddle, method: str) -> Row:
    """The stay of starts beside the manifold, and of the one on it to 1e-12."""
    dt = admitted_step(SCENE, method, DT)
    root = _root(saddle, method, dt)
    offsets = root + np.array([-CLOSEST, CLOSEST, 1e-10, 1e-3])
    side, when, run = _leave(saddle, offsets, method, dt)
    # Each factor of ten nearer stays longer by ln(10)/growth.
    measured = float(np.log(1e-3 / 1e-10) / (when[2] - when[3]))
    apart = side[0] != side[1]
    error = abs(measured / saddle.growth - 1.0) if apart else np.inf
    remark = f"growth {measured:.4f} 1/s; 1e-12 on either side leave apart after {when[:2].min():.0f} s"
    return row_of(run, error, ALLOWED, remark=remark, why="its own manifold")


def _labels(saddle: _Saddle, root: float, method: str) -> Row:
    """Labels of starts on either side of the manifold at offset ``root``: the side's well, or none."""
    distance = 10.0 ** -np.arange(2.0, 13.0)
    sides = np.array([-1.0, 1.0])
    far = label_starts(SCENE, _starts(saddle, root + sides * distance[0]), LABELLED)
    assert (far.status == Status.CAPTURED).all()
    offsets = np.concatenate([-distance, [0.0], distance])
    found = label_starts(SCENE, _starts(saddle, root + offsets), LABELLED, method=method)
    captured = found.status == Status.CAPTURED
    right = (offsets > 0.0).astype(int)
    wrong = captured & (
        (found.well != far.well[right]) | (found.turns != far.turns[right]).any(axis=1) | (offsets == 0.0)
    )
    nearest = np.abs(offsets[captured]).min(initial=np.inf)
    return labels_row(method, found, wrong.sum(), f", to {nearest:.0e} rad" if captured.any() else "")


def _run(quick: bool) -> Sequence[Row]:
    saddle = _saddle()
    rows = [_manifold(saddle, method) for method in without_euler(quick)]
    root = _root(saddle, "dop853", 0.25 * DT)
    return [*rows, *(_labels(saddle, root, method) for method in labellers(quick))]


def _basis(values: NDArray[np.complex128]) -> list[int]:
    """Columns of [real, imaginary] that form a basis, the fastest growing direction first."""
    order = np.argsort(-values.real)
    return [int(k) if values[k].imag >= 0.0 else 4 + int(k) for k in order]


CASES = (
    HardCase(
        "saddle_manifold",
        "starts on a saddle's stable manifold to 1e-12, found by bisection: the last digits decide",
        "the saddle's growing eigenvalue; error: relative difference of the growth seen in times of leaving; "
        "of fm.label_starts, the number of wrong labels",
        "the manifold is found, starts 1e-12 on either side of it leave on either side, and ten times nearer "
        "stay longer by ln(10) over the eigenvalue; a label is the side's well or none",
        _run,
    ),
)
