"""Equilibria by ``scipy.optimize.root`` from random starts, as a user would do it, and what that misses."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from fastmech.atlas.folds import trace_folds
from fastmech.atlas.map import EquilibriumMap, map_equilibria
from fastmech.ensembles.run import Progress
from fastmech.scene import Scene

Floats = NDArray[np.float64]

SCENE = Scene(c1=294.9, c2=92.85, F0=85.3, alpha=0.0)
F0_RANGE, C1_RANGE = (-400.0, 400.0), (0.0, 400.0)

STARTS = 64

#: Numbers of starts after which what is still missing is counted.
TOLD = (8, 16, 32, 64)

#: Distance in F0 [N] of the scenes beside folds.
NEAR_FOLD = 0.01


@dataclass(frozen=True)
class AtlasRow:
    """What one way of finding equilibria did on the same region of parameters."""

    name: str
    threads: int
    points: int
    rate: float  #: points per second, median of warm calls
    found: int  #: equilibria found
    missed: tuple[int, ...]  #: after each of ``TOLD`` starts, equilibria of the certified map not found yet
    incomplete: int  #: points at which at least one is missing
    unproved: int  #: points without a proof that all are found


def grid(side: int) -> dict[str, Floats]:
    """The map's axes."""
    return {"F0": np.linspace(*F0_RANGE, side), "c1": np.linspace(*C1_RANGE, side)}


def gradient(q: Floats, a: float, C: float, b: float, f: float) -> list[float]:
    """Gradient of U as a user would type it."""
    pull = C * np.cos(q[0] + q[1])
    return [a * np.cos(q[0]) + f * np.sin(q[0]) - pull, b * np.sin(q[1]) + f * np.cos(q[1]) - pull]


def hessian(q: Floats, a: float, C: float, b: float, f: float) -> list[list[float]]:
    """Its Jacobian."""
    s = C * np.sin(q[0] + q[1])
    return [
        [f * np.cos(q[0]) - a * np.sin(q[0]) + s, s],
        [s, b * np.cos(q[1]) - f * np.sin(q[1]) + s],
    ]


def loads(s: Scene) -> tuple[float, float, float, float]:
    """a, C, b, f of a scene [J]."""
    return (s.m1 + s.m2) * s.g * s.l - s.c2 * s.l**2, s.c1 * s.l**2, s.m2 * s.g * s.l, s.F0 * s.l


def region_scenes(n: int) -> list[Scene]:
    """Random points of the map's region."""
    rng = np.random.default_rng(1)
    return [SCENE.replace(F0=rng.uniform(*F0_RANGE), c1=rng.uniform(*C1_RANGE)) for _ in range(n)]


def random_scenes(n: int) -> list[Scene]:
    """Four decades of stiffness, forces of both signs, l 0.2-4 m, masses 0.1-100 kg."""
    rng = np.random.default_rng(2)
    return [
        Scene(
            **{name: 10 ** rng.uniform(-1.0, 2.0) for name in ("m1", "m2", "m3")},
            **{name: 10 ** rng.uniform(0.0, 4.0) for name in ("c1", "c2")},
            l=rng.uniform(0.2, 4.0),
            F0=rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(-1.0, 4.0),
            alpha=0.0,
        )
        for _ in range(n)
    ]


def fold_scenes(n: int) -> list[Scene]:
    """Points of the map's region just beside its fold curves, on either side."""
    rng = np.random.default_rng(4)
    curves = trace_folds(SCENE, *grid(201).items()).curves
    x, y = (np.concatenate([getattr(curve, name) for curve in curves]) for name in ("x", "y"))
    chosen = rng.integers(x.size, size=n)
    sides = rng.choice([-NEAR_FOLD, NEAR_FOLD], n)
    return [
        SCENE.replace(F0=float(x[k] + side), c1=float(y[k])) for k, side in zip(chosen, sides, strict=True)
    ]


def multistart(where: str, scenes: list[Scene], advance: Progress) -> AtlasRow:
    """SciPy from random starts, duplicates removed; what it misses is counted by the certified count."""
    rng = np.random.default_rng(3)
    incomplete = total = 0
    missed = np.zeros(len(TOLD), dtype=int)
    seconds = 0.0
    for scene in scenes:
        args = loads(scene)
        size = sum(abs(x) for x in args)
        began = time.perf_counter()
        found: list[Floats] = []
        number: list[int] = []
        for n, start in enumerate(rng.uniform(-np.pi, np.pi, (STARTS, 2)), start=1):
            solution = optimize.root(gradient, start, args=args, jac=hessian)
            if np.abs(solution.fun).max() < 1e-9 * size and not any(
                np.abs(np.exp(1j * solution.x) - np.exp(1j * other)).max() < 1e-6 for other in found
            ):
                found.append(solution.x)
                number.append(n)
        seconds += time.perf_counter() - began
        exact = map_equilibria(scene, {"F0": [scene.F0]}, threads=1)
        lacking = [
            int(exact.count[0]) - reached(exact, [x for x, n in zip(found, number, strict=True) if n <= most])
            for most in TOLD
        ]
        missed += lacking
        incomplete += lacking[-1] > 0
        total += len(found)
        advance(1)
    name, n = f"scipy.optimize.root, {STARTS} starts, {where}", len(scenes)
    return AtlasRow(name, 1, n, n / seconds, total, tuple(missed.tolist()), incomplete, n)


def reached(exact: EquilibriumMap, found: list[Floats]) -> int:
    """How many certified equilibria of a point are among those found."""
    places = np.stack([exact.phi[0], exact.theta[0]], axis=-1)[: exact.count[0]]
    return sum(
        any(np.abs(np.exp(1j * place) - np.exp(1j * other)).max() < 1e-5 for other in found)
        for place in places
    )
