"""``fm.periodic_orbits``: periodic motions and places of rest by Newton's method, unstable ones too."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.attractors.arrival import MOMENT
from fastmech.attractors.find import place_of, within_turn
from fastmech.attractors.flow import FINER, Flow, SectionFlow, flow_of, require_flow
from fastmech.attractors.orbits import (
    RESIDUAL,
    Orbit,
    about_rests,
    cycle,
    eigenvalues,
    periodic,
    rests,
    same,
    visits,
)
from fastmech.attractors.search import DENSE, times_back
from fastmech.ensembles import checks
from fastmech.ensembles.system import System
from fastmech.errors import InputError
from fastmech.jit import working
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Field, Printed, Result, counted
from fastmech.samplers import Starts

#: Starts by default; periods after which motions are guesses too, and those in which cycles may close.
STARTS, RUN_IN, WINDOWS = 128, (8.0, 64.0), (2, 4, 16, 64)

#: Orbits that are printed.
LINES = 5


@dataclass(frozen=True, repr=False)
class PeriodicOrbit(Printed):
    """A periodic motion, or a place of rest."""

    points: Floats  #: after each forcing period, or along a cycle, or the place (m, dim)
    period: float | None  #: s; None: a place of rest
    forcing_periods: int | None  #: the same in periods of the forcing, where there is one
    multipliers: NDArray[np.complex128]  #: of the map over its period; of a cycle without the one along it,
    # of a place of rest none
    eigenvalues: NDArray[np.complex128]  #: of the rates at a place of rest [1/s], of an orbit none
    error: float  #: of these; a multiple one is known less
    residual: float  #: of the map, over the typical state

    def told(self) -> str:
        """Stability, period and place."""
        return self.name

    @property
    def growth(self) -> float:
        """Size of the largest multiplier, or largest real part of an eigenvalue [1/s]."""
        if self.period is None:
            return float(self.eigenvalues.real.max())
        return float(np.abs(self.multipliers).max(initial=0.0))

    @property
    def stability(self) -> str:
        """``"stable"``, ``"unstable"``, or ``"neutral"``: within the error it neither attracts nor repels."""
        beyond = self.growth - (self.period is not None)
        return "neutral" if abs(beyond) <= self.error else "stable" if beyond < 0.0 else "unstable"

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie inside the unit circle, and all eigenvalues left of zero."""
        return self.stability == "stable"

    @property
    def name(self) -> str:
        """Stability, period and place in a few words."""
        where = place_of(self.points[0], 6)
        kind = "rests" if self.period is None else f"period {self.period:.6g} s"
        if self.forcing_periods is not None:
            kind = f"period {self.forcing_periods} of the forcing"
        largest = f"largest multiplier {self.growth:.4g}"
        if self.period is None:
            largest = f"largest real part of an eigenvalue {self.growth:.4g} 1/s"
        return f"{self.stability}, {kind} at ({where}), {largest}"


@dataclass(frozen=True, repr=False)
class PeriodicOrbits(Result, Sequence[PeriodicOrbit]):
    """Periodic orbits, short ones first; printed, some of them."""

    orbits: tuple[PeriodicOrbit, ...]
    starts: int  #: from which they were looked for

    def __len__(self) -> int:
        return len(self.orbits)

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        return self.orbits[index]

    KIND = "periodic_orbits"
    FIELDS = {
        "name": Field("orbit", "1", "stability, period and place", "orbits.name"),
        "stable": Field("orbit", "1", "whether it is stable", "orbits.stable"),
        "stability": Field("orbit", "1", "whether it attracts or repels", "orbits.stability"),
        "residual": Field("orbit", "1", "of the map, over the typical state", "orbits.residual"),
        "points": Field("orbit", "1", "how many of the points are of the orbit"),
        "*": Field("point state", "", "points of the orbits, one after the other:", "orbits.points"),
    }

    @property
    def points(self) -> list[int]:
        """How many points each orbit has."""
        return [len(one.points) for one in self.orbits]

    def told(self) -> str:
        """The orbits, stable and unstable."""
        each = Counter(orbit.stability for orbit in self.orbits)
        neutral = f", {each['neutral']} neutral" if each["neutral"] else ""
        looked = f"found by Newton's method from {counted(self.starts, 'start')}"
        lines = [f"{counted(len(self), 'periodic orbit')}, {each['stable']} stable{neutral}; {looked}"]
        lines += [f"  {orbit.name}" for orbit in self.orbits[: LINES if len(self) <= LINES else LINES - 1]]
        return "\n".join(lines + [f"  {len(self) - LINES + 1} more"] * (len(self) > LINES))


def periodic_orbits(
    system: System | Mechanism,
    starts: Starts,
    n: int | None = None,
    *,
    periods: int = 1,
    seed: int | None = None,
    threads: int | None = None,
) -> PeriodicOrbits:
    """Periodic orbits that Newton's method finds from many starts together, on lanes.

    Args:
        system: a system of your own or a mechanism, as for :func:`fastmech.find_attractors`.
        starts: ranges by name, a sampler or states (n, dim): guesses, and so are the states to which they
            have moved a little and a while later.
        n: how many starts, by default the sampler's, or 128; of states given all.
        periods: orbits take up to so many periods of the forcing, or passages of the section. Of another
            system that does not depend on the time cycles of any period are looked for where motions come
            back near to themselves.
        seed, threads: as for :func:`fastmech.find_attractors`.

    Returns:
        places, periods and multipliers (Floquet's), measured by differences of the map over a period, of
        places of rest eigenvalues; what no guess leads to is not found. Nothing on them stops, or leaves a
        range of a mechanism's coordinates. Of a system that preserves volume none attracts, they are unstable
        or ``neutral``; if it does not depend on the time, cycles are some of families, one for each energy.

    Raises:
        InputError: an argument is wrong, or the system depends on the time and has no period.
    """
    require_flow(system)
    most = checks.whole_number("periods", periods, least=1, most=64)
    y = checks.starts("starts", starts, system.state, n=n, seed=seed, default=STARTS)
    y = y[np.isfinite(y).all(axis=1)]
    if not len(y):
        raise InputError("starts: none is finite")
    flow = flow_of(system, y, {}, threads=threads)
    found: list[Orbit] = []
    guesses = np.concatenate([y, *flow.run(y, np.array(RUN_IN)).y])
    guesses = guesses[np.isfinite(guesses).all(axis=1) & ~flow.is_far(guesses)]
    if flow.forced:
        guesses = np.concatenate([about_rests(flow, y), guesses])
    if not flow.forced or isinstance(flow, SectionFlow):
        found += _rests(flow, guesses)
    with working("looking for periodic orbits") as say:
        for p in range(1, most + 1) if flow.forced else ():
            each = periodic(flow, guesses, p)
            found += [new for new in each if new.periods and not _known(flow, found, new)]
            say(f"looking for periodic orbits, {len(found)} of up to {p} periods found")
        if not flow.forced:
            _add_cycles(flow, y, found)
    orbits = tuple(_told(flow, orbit) for orbit in sorted(found, key=lambda o: o.periods))
    return PeriodicOrbits(orbits, len(y)).of(system)


def _rests(flow: Flow, y: Floats) -> list[Orbit]:
    """Zeros of the rates by Newton's method from states (n, dim), each once."""
    y = rests(flow, y)
    y = y[np.isfinite(Flow.run(flow, y, np.array([MOMENT])).y[-1]).all(axis=1)]  # where nothing stops
    found: list[Orbit] = []
    for place, jacobian in zip(y, flow.slopes(y), strict=True):
        residual = float(np.abs(flow.rates(place[None])[0] * flow.period / flow.scale).max())
        over = np.exp(np.linalg.eigvals(jacobian) * flow.period)
        new = Orbit(place[None], 0.0, jacobian[None], over, residual)
        if residual < RESIDUAL and not _known(flow, found, new):
            found.append(new)
    return found


def _known(flow: Flow, found: list[Orbit], new: Orbit) -> bool:
    return any(same(flow, orbit, new) for orbit in found)


def _add_cycles(flow: Flow, starts: Floats, found: list[Orbit]) -> None:
    """Cycles near motions that come back, at once or after a while."""
    paths = flow.run(starts, np.arange(1.0, WINDOWS[-1] * DENSE + 1.0) / DENSE).y
    for end in WINDOWS:
        part = paths[: end * DENSE]
        for i in np.flatnonzero(np.isfinite(part).all(axis=(0, 2)) & ~flow.is_far(part[-1])):
            if any(visits(flow, orbit, part[-1, i]) for orbit in found):
                continue
            for back in times_back(flow, part[:, i]):
                new = cycle(flow, part[-1, i], back / DENSE)
                if new is not None and not _known(flow, found, new):
                    found.append(new)


def _told(flow: Flow, orbit: Orbit) -> PeriodicOrbit:
    points = within_turn(flow, orbit.points)
    period = orbit.periods * flow.period if orbit.periods else None
    forcing = round(orbit.periods) if flow.forced else None
    if isinstance(flow, SectionFlow):
        period = float(flow.passages(points[:1], np.array([orbit.periods]), FINER)[1][0]) or None
        forcing = None
    values, error = eigenvalues(flow, orbit.jacobians[0])
    multipliers, values = (orbit.multipliers, values[:0]) if orbit.periods else (values[:0], values)
    return PeriodicOrbit(
        points, period, forcing, multipliers, eigenvalues=values, error=error, residual=orbit.residual
    )
