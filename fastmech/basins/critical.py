"""Just enough to snap: the critical force for every decay rate, and its limit, the critical impulse."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fastmech.basins.label import labels_of
from fastmech.basins.measures.labels import Floats
from fastmech.basins.snapping import SnappingMap, force_free, map_snapping
from fastmech.ensembles import checks
from fastmech.equilibria.find import Equilibrium
from fastmech.errors import InputError
from fastmech.mechanism.lagrange import metric
from fastmech.scene import Scene
from fastmech.stability.arguments import require_rest

#: Forces, or impulses, between two known ones that are tried at once.
BETWEEN = 32


def critical_forces(
    snapping: SnappingMap,
    scene: Scene,
    *,
    tolerance: float = 0.1,
    t_end: float | None = None,
    dt: float | None = None,
    method: str = "dop853",
    threads: int | None = None,
) -> Floats:
    """The least force that leaves at every alpha of a map [N], narrowed down between its forces (alphas,).

    NaN where none of the map's forces leaves. A window narrower than the map's steps, below the first force
    that leaves, is not seen.

    Args:
        snapping: a map of the same scene.
        scene: the mechanism.
        tolerance: N.
        t_end, dt, method, threads: as for :func:`fastmech.basins.snapping.map_snapping`.

    Raises:
        InputError: an argument is wrong.
    """
    tolerance = checks.number("tolerance", tolerance, "N", above=0.0)
    start = snapping.equilibria[snapping.start]
    sign = float(np.sign(snapping.F0[0]))
    order = np.argsort(np.abs(snapping.F0))
    size = np.append(0.0, np.abs(snapping.F0)[order])
    found = np.full(snapping.alpha.size, np.nan)
    for k, rate in enumerate(snapping.alpha):
        leaves = np.flatnonzero(snapping.left[k, order])
        if not leaves.size:
            continue

        def left(sizes: Floats, rate: float = float(rate)) -> NDArray[np.bool_]:
            forces = np.sort(sign * sizes)
            part = map_snapping(
                scene, forces, [rate], start=start, t_end=t_end, dt=dt, method=method, threads=threads
            )
            return part.left[0, :: int(sign)]

        first = int(leaves[0])
        found[k] = sign * _narrowed(left, float(size[first]), float(size[first + 1]), tolerance)
    return found


def critical_impulse(
    scene: Scene,
    most: float,
    *,
    start: Equilibrium | None = None,
    n: int = 512,
    tolerance: float = 1e-3,
    t_end: float = 60.0,
    threads: int | None = None,
) -> float:
    """The least impulse on M2 along x at rest that leaves [N s]: the limit of critical F0/alpha; NaN: none.

    Args:
        scene: the mechanism; its own F0 and alpha are not used.
        most: largest impulse to look at [N s], not 0; of its sign are all.
        start: a minimum of the force-free scene, the deepest by default.
        n: evenly spaced impulses among which the first that leaves is looked for.
        tolerance: N s.
        t_end: end of every run [s]; what is not captured by then is not taken to have left.
        threads: threads to use.

    Raises:
        InputError: an argument is wrong, or as :func:`fastmech.basins.snapping.map_snapping`.
    """
    most = checks.number("most", most, "N s")
    if most == 0.0:
        raise InputError("most = 0.0: must not be 0 N s")
    n = checks.whole_number("n", n, least=1)
    tolerance = checks.number("tolerance", tolerance, "N s", above=0.0)
    free, equilibria, index = force_free(scene, start)
    rest, sign = equilibria[index], float(np.sign(most))

    def left(sizes: Floats) -> NDArray[np.bool_]:
        starts = np.array([impulse_start(free, rest, sign * size) for size in sizes])
        ends = labels_of(free, starts, t_end, threads=threads)
        return np.asarray((ends.well >= 0) & ((ends.well != index) | (ends.turns != 0).any(axis=1)))

    sizes = np.linspace(0.0, abs(most), n + 1)
    leaves = np.flatnonzero(left(sizes[1:]))
    if not leaves.size:
        return float("nan")
    first = int(leaves[0])
    return sign * _narrowed(left, float(sizes[first]), float(sizes[first + 1]), tolerance)


def impulse_start(scene: Scene, rest: Equilibrium, impulse: float) -> Floats:
    """State (4,) after a kick on M2 along +x at rest: the limit of F0 exp(-alpha t) at impulse = F0/alpha.

    The generalized momenta are impulse dx2/dq, the rates a^-1 of them, paper (11).

    Args:
        scene: the mechanism.
        rest: where it rests.
        impulse: N s.

    Raises:
        InputError: the impulse is no finite number, or the scene does not rest there.
    """
    require_rest(scene, rest)
    impulse = checks.number("impulse", impulse, "N s")
    lever = scene.l * np.array([-np.sin(rest.phi), -np.cos(rest.theta)])
    rates = np.linalg.solve(metric(scene, (rest.phi, rest.theta)), impulse * lever)
    return np.array([rest.phi, rest.theta, *rates])


def _narrowed(
    left: Callable[[Floats], NDArray[np.bool_]], low: float, high: float, tolerance: float
) -> float:
    """The first size that leaves between one that does not and one that does, to a tolerance."""
    while high - low > tolerance:
        line = np.linspace(low, high, BETWEEN + 2)
        first = int(np.argmax([*left(line[1:-1]), True])) + 1
        low, high = float(line[first - 1]), float(line[first])
    return high
