"""What a planar mechanism looks like: its elements between points of the plane, at given positions."""

from __future__ import annotations

from enum import IntEnum
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from fastmech.models.mechanism import Mechanism

#: Positions of the whole range that tell which points are fixed, guided or joined by a rod, and what lengths
#: without a range are looked at within [m].
SAMPLES, FAR = 16, 1.0

#: Rounding of lengths, relative.
ROUNDING = 1e-9


#: Places of its end at a joint and of its other one (rows, 2).
Rod = tuple[NDArray[np.float64], NDArray[np.float64]]


class Element(IntEnum):
    """What is drawn."""

    FIXED = 0  #: a point that never moves
    POINT = 1
    GUIDE = 2  #: the straight line on which a point stays
    ROD = 3  #: between two points that keep their distance
    SPRING = 4
    DAMPER = 5
    LOAD = 6  #: from its point a unit along its mean
    MASS = 7
    TORSION_SPRING = 8  #: from the joint to the end of a rod
    TORSION_DAMPER = 9


class Angle(NamedTuple):
    """Where a coordinate is seen as the angle of a rod: its direction is ``origin + sign * q`` [rad]."""

    rod: int  #: place among the elements
    end: int  #: of the rod that is the vertex, 0 or 1
    coordinate: int
    sign: int
    origin: float


class Drawing(NamedTuple):
    """Elements at some positions; springs, dampers and loads whose parameter is zero are left out."""

    kind: NDArray[np.int8]  #: :class:`Element` (elements,)
    name: tuple[str, ...]  #: of points
    mass: NDArray[np.float64]  #: [kg] (elements,), NaN of others than masses
    ends: NDArray[np.float64]  #: [m] (positions, elements, 2, 2): both ends, x and y
    angles: tuple[Angle, ...] = ()  #: at most one of a coordinate


def drawing(mechanism: Mechanism, q: ArrayLike) -> Drawing:
    """The elements of a planar mechanism at positions (m, n); none of one in space.

    Rods are not told: two points that keep their distance everywhere are joined by one.
    """
    places = np.asarray(q, dtype=np.float64).reshape(-1, len(mechanism.coordinates))
    ends = np.array([c[1:3] for c in mechanism.coordinates])
    low, high = np.where(np.isfinite(ends), ends, np.sign(ends) * FAR).T
    samples = low + (high - low) * np.random.default_rng(0).random((SAMPLES, len(low)))
    alone = samples[0] + 0.3 * np.eye(len(low))  # each coordinate moved by itself
    points, elements = mechanism.places(np.concatenate([places, samples, alone]))
    count = len(places)
    found: list[tuple[Element, str, float, NDArray[np.float64]]] = []
    angles: dict[int, Angle] = {}
    rods: list[Rod] = []

    def add(kind: Element, ends: NDArray[np.float64], name: str = "", mass: float = np.nan) -> None:
        found.append((kind, name, mass, ends[:count]))

    def varies(values: NDArray[np.float64]) -> bool:
        scale = 1.0 + np.abs(values[count:]).max()
        return not np.ptp(values[count:], axis=0).max() <= ROUNDING * scale

    for name, place in points.items():
        add(Element.POINT if varies(place) else Element.FIXED, np.stack([place, place], axis=1), name)
        away = place[count:] - place[count:].mean(axis=0)
        along = np.linalg.svd(away)[2][0]
        if varies(place) and np.abs(away @ [-along[1], along[0]]).max() <= ROUNDING * np.abs(away).max():
            add(Element.GUIDE, np.stack([place, place + along], axis=1))
    for a, b in combinations(points.values(), 2):
        length = np.hypot(*(b - a).T)
        if (varies(a) or varies(b)) and not varies(length) and length.min() > ROUNDING:
            for end, (vertex, other) in enumerate(((a, b), (b, a))):
                away = (other - vertex)[count : count + SAMPLES]
                for k, coordinate in enumerate(mechanism.coordinates):
                    if np.ptp(vertex[[count, count + SAMPLES + k]], axis=0).max() > ROUNDING or k in angles:
                        continue
                    for sign in () if str(coordinate.symbol) in mechanism.lengths else (1, -1):
                        from_origin = np.exp(1j * (np.arctan2(*away.T[::-1]) - sign * samples[:, k]))
                        if np.abs(from_origin - from_origin[0]).max() <= ROUNDING:
                            angles[k] = Angle(len(found), end, k, sign, float(np.angle(from_origin[0])))
            add(Element.ROD, np.stack([a, b], axis=1))
            rods += [(a, b), (b, a)]
    for kind, size, ends in elements:
        if kind in (Element.TORSION_SPRING, Element.TORSION_DAMPER):
            joint = _joint(rods, ends[:, 0, 0], count) if size else None
            if joint is not None:
                add(kind, np.stack(joint, axis=1))
        elif kind is Element.MASS:
            add(kind, ends, mass=size)
        elif size:
            add(kind, ends if size > 0.0 or kind is not Element.LOAD else mirrored(ends))
    return Drawing(
        np.array([one[0] for one in found], dtype=np.int8),
        tuple(one[1] for one in found),
        np.array([one[2] for one in found]),
        np.stack([one[3] for one in found], axis=1) if found else np.zeros((count, 0, 2, 2)),
        tuple(angles.values()),
    )


def _joint(rods: list[Rod], angle: NDArray[np.float64], count: int) -> Rod | None:
    """The rod that makes this angle with another one, or with the ground at its end that moves least."""
    ways = [np.arctan2(*(far - near).T[::-1]) for near, far in rods]
    found = [(way, rod) for way, rod in zip(ways, rods, strict=True)]
    found.sort(key=lambda one: float(np.ptp(one[1][0][count:], axis=0).sum()))
    both = [(way - ways[k], rod) for way, rod in found for k in range(len(rods)) if rods[k][0] is rod[0]]
    for way, rod in [*both, *found]:
        for sign in (1, -1):
            turned = np.exp(1j * (way - sign * angle))[count:]
            if np.abs(turned - turned[0]).max() <= ROUNDING:
                return rod
    return None


def mirrored(ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """The second end on the other side of the first."""
    return np.stack([ends[:, 0], 2.0 * ends[:, 0] - ends[:, 1]], axis=1)
