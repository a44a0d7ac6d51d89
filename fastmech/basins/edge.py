"""The edge state: what rules the boundary between two basins, found by bisection and tracking.

A start on a boundary stays on it and tends to the edge state, an attractor within the boundary. Two starts on
either side are brought together by bisection, followed until they part, brought together again, and so on
(Skufca, Yorke, Eckhardt, Phys. Rev. Lett. 96 (2006) 174101; Schneider, Eckhardt, Yorke, Phys. Rev. Lett. 99
(2007) 034502). For the mechanism under a constant force it is a saddle with one falling direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.basins.label import label_name, well_numbers
from fastmech.basins.measures.labels import LabelOf, ask, check_point, norm_on
from fastmech.capture.select import certificate_of
from fastmech.disturbance.motion import equilibria_to_disturb
from fastmech.ensembles import checks
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.system import System
from fastmech.errors import InputError
from fastmech.models.equilibria import RestingPlace
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Field, Result
from fastmech.scene import Scene
from fastmech.slider.equilibria import Equilibrium

#: Points between two starts whose labels are asked for at once.
SECTIONS = 15

#: Doublings of their distance by which two starts that came to be on one side are drawn apart.
DOUBLINGS = 24

#: Share of a basin map's coarsest step with which the boundary is followed: errors are to stay below ``far``.
FINER = 0.2

#: Outputs of a stretch, after which two starts that have not parted are followed further.
OUTPUTS = 64


@dataclass(frozen=True, eq=False, repr=False)
class EdgeTrack(Result):
    """The way along a boundary; k stretches, each begun by a bisection."""

    t: Floats  #: time of every bisection [s] (k,)
    y: Floats  #: state there, on the first basin's side (k, dim)
    gap: Floats  #: distance to the state on the other side, in the norm (k,)
    state: Floats  #: the last one (dim,)
    moved: float  #: largest distance between the last stretch's states, in the norm
    settled: bool  #: ``moved`` is within the tolerance: the edge state is a resting one, this one
    lost: bool  #: no boundary was found any more near the track
    labels: tuple[int, int]  #: basins on either side at the start

    KIND = "edge_track"
    FIELDS = {
        "time": Field("time", "s", "time of a bisection", "t"),
        "*": Field("time state", "", "state at a bisection:", "y"),
        "gap": Field("time", "1", "distance to the other side"),
        "last_*": Field("state", "", "last state:", "state"),
        "moved": Field("", "1", "how far the last stretch moved, in the norm"),
        "settled": Field("", "1", "whether it has come to rest"),
        "lost": Field("", "1", "whether the boundary was lost"),
    }

    def told(self) -> str:
        """Where it rests, or how far it was followed."""
        place = ", ".join(f"{name} = {x:.6g}" for name, x in zip(self.system.state, self.state, strict=True))
        time = f"{self.t[-1]:.4g} s"
        end = f"has not come to rest within {time}; last seen"
        if self.settled or self.lost:
            end = f"rests, after {time}," if self.settled else f"was lost after {time}, last seen"
        units = "" if isinstance(self.system, System) else " (SI units)"
        return f"the boundary {end} at\n  {place}{units}"


def track_edge(
    scene: Scene | Mechanism | System,
    inside: ArrayLike,
    outside: ArrayLike,
    label_of: LabelOf | None = None,
    norm: ArrayLike | None = None,
    *,
    t_end: float,
    near: float = 1e-10,
    far: float = 1e-5,
    tolerance: float = 1e-3,
    interval: float = 0.25,
    dt: float | None = None,
    method: str | None = None,
) -> EdgeTrack:
    """Follow the boundary between two starts until it comes to rest.

    Args:
        scene: a scene with a constant force, or a system of your own whose right-hand side has no time in it.
        inside: a start in the first basin (dim,).
        outside: one in another basin (dim,).
        label_of: labels (n,) of starts (n, dim), negative: none. Starts without a label count to neither
            side; a bisection ends where there are no others. By default, of a scene, which copy of which
            well captures them within 60 s, see :func:`fastmech.well_numbers`.
        norm: matrix N (dim, dim): ``|d @ N|`` is a distance. By default, of a scene, the kinetic-energy norm
            at its deepest well.
        t_end: longest time to follow the boundary [s].
        near: distance that a bisection stops at. Below the error of ``label_of`` the two may come to be on
            one side; they are then drawn apart along their difference.
        far: distance at which the two have parted.
        tolerance: the edge state rests if a whole stretch moves by no more than this, ``far`` or more.
        interval: time between looks at their distance [s].
        dt: longest step [s]. By default, of a scene, it follows from frequencies and the starts' energies.
        method: name of the method; ``dop853`` by default, of a scene see ``fm.label_starts``.

    Raises:
        InputError: an argument is wrong, the force decays, or the starts' labels are not two known ones.
    """
    checks.function("label_of", label_of, "starts (n, dim)")
    certificate = None
    if isinstance(scene, Scene | Mechanism):
        equilibria_to_disturb(scene)
        certificate = certificate_of(scene)
        label_of = label_of or well_numbers(scene)
        norm = certificate.size(certificate.tree.wells[0]).to_ball if norm is None else norm
    if label_of is None or norm is None:
        raise InputError("label_of, norm: missing; only a scene or a mechanism has them by default")
    a = check_point("inside", inside)
    b = check_point("outside", outside, a.size)
    if dt is None:
        if certificate is None:
            raise InputError("dt: missing; a system needs its longest step in s")
        dt = FINER * float(certificate.coarse_steps(np.stack([a, b])).min())
    matrix = norm_on(norm, a.size)
    t_end = checks.number("t_end", t_end, "s", above=0.0)
    near = checks.number("near", near, "", above=0.0)
    far = checks.number("far", far, "", above=near)
    tolerance = checks.number("tolerance", tolerance, "", least=far)
    interval = checks.number("interval", interval, "s", above=0.0)
    first, second = (int(label) for label in ask(label_of, np.stack([a, b])))
    if first < 0 or second < 0 or first == second:
        names = " and ".join(label_name(label_of, label) for label in (first, second))
        raise InputError(f"inside, outside: lead to {names}, must lead to two different known ends")
    labels = first, second

    def distance(x: Floats, y: Floats) -> Floats:
        return np.asarray(np.linalg.norm((x - y) @ matrix, axis=-1))

    track = []
    t, moved, lost = 0.0, np.inf, False
    looks, at_first = interval * np.arange(1, OUTPUTS + 1), np.zeros(0)
    if certificate is not None:
        method = certificate.method(method)
        at_first = certificate.damped_times(method, min(dt, interval))
    while True:
        a, b = _bisect(label_of, first, a, b, float(distance(a, b)), near=near)
        track.append((t, a, float(distance(a, b))))
        if t >= t_end or moved <= tolerance:
            break
        seen = np.append(at_first, looks)
        way = integrate(scene, np.stack([a, b]), dt=dt, method=method or "dop853", t_eval=seen).y
        way = way[at_first.size :]
        parted = np.flatnonzero(distance(way[:, 0], way[:, 1]) > far)
        last = int(parted[0]) if parted.size else OUTPUTS - 1
        moved = float(distance(way[: last + 1, 0], a).max())
        sides = _sides(label_of, way[last, 0], way[last, 1])
        if sides is None:
            lost = True
            break
        first, a, b = sides
        t += float(looks[last])
    settled = not lost and moved <= tolerance
    times, states, gaps = (np.array(column) for column in zip(*track, strict=True))
    path = times, states, gaps, states[-1], moved
    return EdgeTrack(*path, settled=settled, lost=lost, labels=labels).of(scene)


def nearest_saddle(
    scene: Scene | Mechanism, state: ArrayLike | Equilibrium | RestingPlace
) -> tuple[Equilibrium | RestingPlace, float]:
    """The index-1 saddle nearest to a state (states,), and its distance in coordinates and rates as they are.

    The state may be an equilibrium. Angles are compared up to full turns.

    Raises:
        InputError: a load changes, or the state is not one of finite numbers.
    """
    equilibria, certificate = equilibria_to_disturb(scene), certificate_of(scene)
    places = certificate.places
    if isinstance(state, Equilibrium | RestingPlace):
        state = np.append(state.position, np.zeros_like(state.position))
    y = check_point("state", state, places.shape[1])
    away = np.linalg.norm(certificate.away(places, y), axis=1)
    away[np.asarray([e.morse_index != 1 for e in equilibria])] = np.inf
    nearest = int(np.argmin(away))
    if not np.isfinite(away[nearest]):
        raise InputError("scene: has no saddle with one falling direction")
    return equilibria[nearest], float(away[nearest])


def _sides(label_of: LabelOf, a: Floats, b: Floats) -> tuple[int, Floats, Floats] | None:
    """Two points on the line through a and b with different known labels, the nearest, and the first's."""
    line, points, labels = np.zeros(0), np.zeros((0, a.size)), np.zeros(0, dtype=np.int64)
    further = np.array([0.0, 1.0])
    for doubling in range(DOUBLINGS):
        more = a + further[:, None] * (b - a)
        line, points = np.append(line, further), np.concatenate([points, more])
        labels = np.append(labels, ask(label_of, more))
        known = np.flatnonzero(labels >= 0)
        known = known[np.argsort(line[known])]
        changes = np.flatnonzero(np.diff(labels[known]) != 0)
        if changes.size:
            pairs = np.stack([known[changes], known[changes + 1]], axis=1)
            nearest = pairs[np.abs(line[pairs]).max(axis=1).argmin()]
            return int(labels[nearest[0]]), points[nearest[0]], points[nearest[1]]
        further = np.array([-(2.0**doubling), 2.0 ** (doubling + 1)])
    return None


def _bisect(
    label_of: LabelOf, first: int, a: Floats, b: Floats, gap: float, near: float
) -> tuple[Floats, Floats]:
    """Two points on the segment from a to b, the one labelled ``first``, the next known one not."""
    while gap > near:
        share = np.arange(1, SECTIONS + 1)[:, None] / (SECTIONS + 1)
        points = np.concatenate([a[None], a + share * (b - a), b[None]])
        labels = np.array([first, *ask(label_of, points[1:-1]), -1])
        labels[-1] = first + 1  # b is known to be on the other side
        other = np.flatnonzero((labels >= 0) & (labels != first))[0]
        own = np.flatnonzero(labels[:other] == first)[-1]
        shrunk = gap * (other - own) / (SECTIONS + 1)
        a, b = points[own], points[other]
        if shrunk >= gap:  # all between have no label
            break
        gap = shrunk
    return a, b
