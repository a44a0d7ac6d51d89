"""Computations of the same starts with ever smaller steps, until two in a row tell the same."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fastmech.basins.runs import Paths
from fastmech.capture.certificate import Certificate
from fastmech.disturbance.size import size_at
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.lanes import finite_rows
from fastmech.ensembles.status import Status
from fastmech.errors import StepWarning
from fastmech.mechanism.coefficients import Coefficients, reduce
from fastmech.mechanism.reduced import metric_11, slider_ratio

Floats = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.intp]

#: Steps a round of one computation after the other, a round being two of the coarsest steps. With the default
#: method each makes the error some 25, 60 and then 256 times smaller, down to rounding.
SUBSTEPS = (2, 3, 5, 10, 20, 40)

#: A path that has not been captured is at a saddle when it is so near to it [rad], in its norm.
AT_SADDLE = 1e-3

#: Seconds between looks at whether a path is there, and how many are kept at a time.
LOOK, MOST_LOOKS = 0.25, 1 << 20

#: ``compute(members, substeps)``: one computation of some of the starts.
Compute: TypeAlias = Callable[[Indices, int], Paths]
#: ``agree(members, coarse, fine)``: which of them tell the same with both steps.
Agree: TypeAlias = Callable[[Indices, Paths, Paths], NDArray[np.bool_]]
#: ``impossible(members, states)``: which have come to states that their motion cannot have.
Impossible: TypeAlias = Callable[[Indices, Floats], NDArray[np.bool_]]
#: ``lingers(members)``: which come to an unstable equilibrium on their way.
Lingers: TypeAlias = Callable[[Indices], NDArray[np.bool_]]


def climb(
    certificate: Certificate,
    members: Indices,
    compute: Compute,
    agree: Agree,
    impossible: Impossible,
    lingers: Lingers,
    found: Paths,
    status: NDArray[np.int8],
    ladder: tuple[int, ...] = SUBSTEPS,
) -> None:
    """Find labels and statuses of some starts, and write them where ``members`` says."""
    coarse = compute(members, ladder[0])
    for substeps in ladder[1:]:
        fine = compute(members, substeps)
        settled = agree(members, coarse, fine)
        done = np.flatnonzero(settled | (substeps == ladder[-1]))
        ends, last = members[done], fine.take(done)
        found.put(ends, last)
        captured = settled[done] & (last.code > 0)
        status[ends] = np.where(captured, Status.CAPTURED, Status.UNDECIDED)
        free = np.flatnonzero(last.code == 0)
        status[ends[free[near_saddle(certificate, last.state[free])]]] = Status.AT_SADDLE
        # Steps that do not agree: a stable manifold between the paths leads them to its equilibrium first.
        torn = ends[~settled[done]]
        if torn.size:
            status[torn[lingers(torn)]] = Status.AT_SADDLE
        bad = free[impossible(ends[free], last.state[free])]
        status[ends[bad]] = Status.STEP_TOO_LARGE
        status[ends[free[~finite_rows(last.state[free])]]] = Status.NOT_FINITE
        for kind in (Status.NOT_CONVERGED, Status.STEP_TOO_LARGE):
            status[ends[free[last.status[free] == kind]]] = kind
        # The finest step alone is within the limit: nothing bears it out.
        alone = ~settled[done] & (coarse.status[done] == Status.STEP_TOO_LARGE) & (last.status == Status.OK)
        status[ends[alone]] = Status.STEP_TOO_LARGE
        rest = np.flatnonzero(~settled)
        members, coarse = members[rest], fine.take(rest)
        if not members.size:
            break


def tell_the_same(
    certificate: Certificate, coarse: Paths, fine: Paths, longest: float, push: Floats | float
) -> NDArray[np.bool_]:
    """Which paths are not captured either time, or captured both times beyond their difference.

    Args:
        certificate: of the scene.
        coarse, fine: the two computations.
        longest: by how much the times at which they stop may differ [s].
        push: decaying force over m2 l that the bounding energies count with, 0 where there is none [1/s^2].
    """
    finite = finite_rows(coarse.state) & finite_rows(fine.state)
    same = (coarse.code == fine.code) & (coarse.turns == fine.turns).all(axis=1) & finite
    same &= np.abs(coarse.stop - fine.stop) < longest
    apart = np.abs(np.where(finite.reshape(-1, 1), coarse.state - fine.state, np.inf))
    level = np.append(np.inf, certificate.levels)[fine.code]
    with np.errstate(invalid="ignore"):
        room = energy_change(reduce(certificate.scene), np.abs(push), fine.state, apart)
        proved = room < level - fine.energy
    return np.asarray(same & (proved | (fine.code == 0)))


def energy_change(c: Coefficients, push: Floats | float, states: Floats, apart: Floats) -> Floats:
    """Bound on how much the bounding energy of states (n, 4) changes over the box of half-widths ``apart``.

    Over m2 l^2 [1/s^2]. The change of U is at most its largest slope times the way; T is quadratic in the
    rates with coefficients whose slopes are at most ``slider max|k k'|`` and 1.
    """
    dphi, dtheta, du, dv = apart.T
    slope = (
        np.hypot(c.lift, c.force) * dphi + np.hypot(c.gravity, c.force) * dtheta + c.spring * (dphi + dtheta)
    )
    slope = slope + push * (dphi + dtheta)
    angles = np.linspace(-np.pi, np.pi, 721)
    k, dk = slider_ratio(np.sin(angles), np.cos(angles))
    a11 = metric_11(c.mass, c.slider, float(np.abs(k).max()))
    u, v = np.abs(states[:, 2]) + du, np.abs(states[:, 3]) + dv
    kinetic = (c.slider * float(np.abs(k * dk).max()) * u * u + u * v) * dphi + u * v * dtheta
    return np.asarray(slope + kinetic + (a11 * u + v) * du + (u + v) * dv)


def near_saddle(certificate: Certificate, states: Floats) -> NDArray[np.bool_]:
    """Which states (n, 4) rest at an unstable equilibrium.

    Beside a fold, a motion that creeps between two equilibria is near both: near is a tenth of the way to
    the next one.
    """
    scene, equilibria = certificate.scene, certificate.tree.equilibria
    held = scene.replace(F0=equilibria.force, alpha=0.0)
    near = np.zeros(len(states), dtype=np.bool_)
    places = np.zeros((len(equilibria), 4))
    places[:, 0], places[:, 1] = equilibria.phi, equilibria.theta
    for place, e in zip(places, equilibria, strict=True):
        if e.kind != "minimum":
            size = size_at(held, e.phi, e.theta)
            others = np.sort(size(_away(places, place)))[1:]
            near |= size(_away(states, place)) < min(AT_SADDLE, 0.1 * float(others.min(initial=np.inf)))
    return near


def _away(states: Floats, place: Floats) -> Floats:
    """Departures (n, 4) from the copy of a place that is nearest."""
    away = states - place
    with np.errstate(invalid="ignore"):
        away[:, :2] -= 2.0 * np.pi * np.round(away[:, :2] / (2.0 * np.pi))
    return away


def lingering(
    certificate: Certificate, starts: Floats, t_end: float, dt: float, method: str, threads: int | None
) -> NDArray[np.bool_]:
    """Which motions from ``starts`` (n, 4) come to an unstable equilibrium by ``t_end`` [s]."""
    times = np.linspace(0.0, t_end, math.ceil(t_end / LOOK) + 1)
    together = max(1, MOST_LOOKS // times.size)
    found = np.zeros(len(starts), dtype=np.bool_)
    for first in range(0, len(starts), together):
        some = slice(first, first + together)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", StepWarning)
            run = integrate(
                certificate.scene, starts[some], dt=dt, method=method, t_eval=times, threads=threads
            )
        near = near_saddle(certificate, run.y.reshape(-1, 4)).reshape(times.size, -1)
        found[some] = near.any(axis=0)
    return found
