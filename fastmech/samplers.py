"""Samplers: where starts are drawn from, as data, for every function that takes starts.

Each names states by ranges ``(low, high)`` or by one value; what is not named is zero. A plain mapping of
names to ranges is :class:`Uniform`. The first starts are the same for every number of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.errors import InputError, shown
from fastmech.scene import nearest

__all__ = ["Ball", "Gaussian", "Grid", "LatinHypercube", "Sampler", "Sobol", "Uniform"]


def __dir__() -> list[str]:
    return __all__


@dataclass(frozen=True)
class Sampler:
    """What samplers share."""

    ranges: Mapping[str, Any]  #: by name (low, high), or a value
    n: int | None = field(default=None, kw_only=True)  #: how many, where the function is not told
    seed: int = field(default=0, kw_only=True)

    def __post_init__(self) -> None:
        if self.n is not None and not (isinstance(self.n, Integral) and self.n >= 1):
            raise InputError(f"n = {shown(self.n)}: must be an integer not less than 1")
        if not (isinstance(self.seed, Integral) and self.seed >= 0):
            raise InputError(f"seed = {shown(self.seed)}: must be an integer not less than 0")

    def draw(self, n: int, names: Sequence[str], seed: int | None = None) -> Floats:
        """The first n starts, shape (n, len(names)), in the order of ``names``; by default of its own seed.

        Raises:
            InputError: a name is unknown, or a range is no pair of finite numbers that does not fall.
        """
        low, high = self._ends(names)
        ranged = np.flatnonzero(high > low)
        starts = np.tile(low, (n, 1))
        if ranged.size:
            unit: Any = self._unit(
                n, [names[k] for k in ranged.tolist()], self.seed if seed is None else seed
            )
            starts[:, ranged] += (high - low)[ranged] * unit
        return starts

    def _unit(self, n: int, names: Sequence[str], seed: int) -> Floats:
        """Points (n, len(names)) of the unit cube."""
        raise NotImplementedError

    def _ends(self, names: Sequence[str]) -> tuple[Floats, Floats]:
        if not isinstance(self.ranges, Mapping):
            raise InputError(f"ranges = {shown(self.ranges)}: must map names to (low, high) or to a value")
        for name in self.ranges:
            if name not in names:
                raise InputError(f"ranges.{name}: unknown name; {nearest(str(name), list(names))}")
        ends = np.zeros((2, len(names)))
        for k, name in enumerate(names):
            given = self.ranges.get(name, 0.0)
            try:
                found = np.array(given, dtype=np.float64).ravel()
            except (TypeError, ValueError):
                found = np.zeros(0)
            if found.size not in (1, 2) or not np.isfinite(found).all() or found[0] > found[-1]:
                raise InputError(
                    f"ranges.{name} = {shown(given)}: must be (low, high) with low <= high, or a value"
                )
            ends[:, k] = found[0], found[-1]
        return ends[0], ends[1]


@dataclass(frozen=True)
class Uniform(Sampler):
    """Independent uniform starts."""

    def _unit(self, n: int, names: Sequence[str], seed: int) -> Floats:
        return np.random.default_rng(seed).random((n, len(names)))


@dataclass(frozen=True)
class Sobol(Sampler):
    """Scrambled Sobol points, more even than independent ones (``scipy.stats.qmc.Sobol``)."""

    def _unit(self, n: int, names: Sequence[str], seed: int) -> Floats:
        from scipy.stats import qmc

        drawn = qmc.Sobol(len(names), rng=seed).random_base2(math.ceil(math.log2(max(n, 1))))
        return np.asarray(drawn[:n])


@dataclass(frozen=True)
class LatinHypercube(Sampler):
    """Nested Latin hypercubes: of the first 2^k starts every state has one in each of 2^k equal intervals.

    Each hypercube is doubled by starts in the halves of intervals that are empty, in an order of its own for
    every state (Qian, Biometrika 96 (2009) 957).
    """

    def _unit(self, n: int, names: Sequence[str], seed: int) -> Floats:
        rng = np.random.default_rng(seed)
        points = rng.random((1, len(names)))
        while len(points) < n:
            parts = 2 * len(points)
            empty = np.floor(parts * points).astype(np.int64) ^ 1
            # In single precision: the sum is exact, so that no start comes into the next interval.
            places = rng.permuted(empty, axis=0) + rng.random(points.shape, np.float32)
            points = np.concatenate([points, places / parts])
        return points[:n]


@dataclass(frozen=True)
class Grid(Sampler):
    """A grid over the ranges, ends included, the last state fastest; ``counts`` are its points by name.

    All of them where no ``n`` is given.

    Raises:
        InputError: a count is no integer of 2 or more.
    """

    counts: Mapping[str, int]

    def __post_init__(self) -> None:
        super().__post_init__()
        counts = self.counts.values() if isinstance(self.counts, Mapping) else (None,)
        if not all(isinstance(count, Integral) and count >= 2 for count in counts):
            raise InputError(f"counts = {shown(self.counts)}: must map names to integers of 2 or more")
        if self.n is None:
            object.__setattr__(self, "n", math.prod(self.counts.values()))

    def _unit(self, n: int, names: Sequence[str], seed: int) -> Floats:
        shape = tuple(int(self.counts.get(name, 0)) for name in names)
        if math.prod(shape) < n:
            raise InputError(
                f"counts = {shown(self.counts)}: must name each of {', '.join(names)}, and give the {n:,} "
                "starts asked for"
            )
        places = np.unravel_index(np.arange(n), shape)
        return np.stack([place / (count - 1) for place, count in zip(places, shape, strict=True)], axis=1)


@dataclass(frozen=True)
class Gaussian(Sampler):
    """Independent normal starts, of which (low, high) is one standard deviation about the mean."""

    def draw(self, n: int, names: Sequence[str], seed: int | None = None) -> Floats:
        """As of any sampler."""
        low, high = self._ends(names)
        z = np.random.default_rng(self.seed if seed is None else seed).standard_normal((n, len(names)))
        return np.asarray(0.5 * (low + high) + 0.5 * (high - low) * z)


@dataclass(frozen=True)
class Ball(Sampler):
    """Uniform in a ball of ``radius`` about the ranges' middle, in the norm of their halves.

    So a radius of 1 gives the ellipsoid that fills the ranges. With a matrix ``norm`` (states, states), such
    as :func:`fastmech.kinetic_norm` gives: departures d of all states with ``|d @ norm| <= radius``.

    Raises:
        InputError: the radius is not positive; when drawn, the norm is no such matrix or singular.
    """

    norm: ArrayLike | None = field(default=None, kw_only=True)
    radius: float = field(default=1.0, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (isinstance(self.radius, Real) and 0.0 < self.radius < math.inf):
            raise InputError(f"radius = {shown(self.radius)}: must be a finite number greater than 0")

    def draw(self, n: int, names: Sequence[str], seed: int | None = None) -> Floats:
        """As of any sampler."""
        low, high = self._ends(names)
        departs, back = high > low, np.diag(0.5 * (high - low))
        if self.norm is not None:
            departs, back = np.ones(len(names), dtype=np.bool_), self._from_norm(len(names))
        z = np.random.default_rng(self.seed if seed is None else seed).standard_normal((n, len(names) + 1))
        size = np.linalg.norm(z[:, :-1][:, departs], axis=1)
        from scipy.stats import norm

        far = norm.cdf(z[:, -1]) ** (1.0 / max(1, int(np.count_nonzero(departs))))
        inside = z[:, :-1] * departs * (far / np.where(size > 0.0, size, 1.0))[:, None]
        return np.asarray(0.5 * (low + high) + self.radius * inside @ back)

    def _from_norm(self, dim: int) -> Floats:
        """Departures (dim, dim) of unit lengths along the axes of the norm."""
        try:
            matrix = np.array(self.norm, dtype=np.float64)
            back = np.asarray(np.linalg.inv(matrix))
            if matrix.shape == (dim, dim) and np.isfinite(back).all():
                return back
        except (TypeError, ValueError, np.linalg.LinAlgError):
            pass
        raise InputError(f"norm = {shown(self.norm)}: must be a matrix ({dim}, {dim}), not singular")


#: What functions take as starts: a sampler, ranges of uniform starts, or states (n, dim).
Starts = Sampler | Mapping[str, ArrayLike] | ArrayLike


def sampler_of(given: Any) -> Sampler | None:
    """A sampler, also from a mapping of ranges; None of anything else."""
    return Uniform(given) if isinstance(given, Mapping) else given if isinstance(given, Sampler) else None
