"""The capture certificate: from which energy on, and where, a motion belongs to a well for good.

A motion whose bounding energy is below B(w) and whose position lies in w's component of {U < B(w)} ends in
w, since it can never have the energy to leave that component; B(w) is the well's barrier on unwrapped angles.
The certificate is about the path as it was computed.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.capture.cells import Cells
from fastmech.capture.observe import HEAD, OUT, RECORD, TABLE_ROWS
from fastmech.disturbance.motion import Size, confining_energy, damped_times, size_of
from fastmech.ensembles.ends import STOP_CODE
from fastmech.ensembles.run import CALL_STEPS_WITH_STOPS, Observation
from fastmech.integrators.methods import Method, find_method, with_inverse
from fastmech.models.mechanism import short_way
from fastmech.objects import Printed, coordinate_units, counted

#: Coarse step times the highest frequency [rad], and times the fastest turning that the energy allows. With
#: ``dop853`` the error of such a step is some 1e-3 by the time of capture; half of it makes that 1e-5.
PHASE, TURNING = 1.0, 2.5

#: Where forces have kinks, as of a contact, methods lose their order: steps are so many times shorter. With
#: longer ones two computations of a start may come near each other by chance, and its label be wrong:
#: ``pytest tests/basins/test_label.py -k stops`` has such starts.
KINKED = 8.0

#: Octaves below a mechanism's own step that a start may take: rates of some thousand rad/s. A start that is
#: faster still comes out as what that step makes of it.
MOST_OCTAVES = 7.0

#: Share of a start's coarse step, at which labels begin, that measuring takes by default (an implicit method,
#: whose error constant is larger, takes half of it).
MEASURING = 0.6


@dataclass(frozen=True, repr=False)
class Captured(Printed):
    """Wells that states belong to for good; arrays over n states."""

    well: NDArray[np.int8]  #: index among the equilibria, -1: not captured
    turns: NDArray[np.int32]  #: full turns of each coordinate of that well from its listed place, (n, coords)

    def told(self) -> str:
        """How many of the states belong to which well."""
        each = ", ".join(f"{np.sum(self.well == k):,} well {k}" for k in np.unique(self.well[self.well >= 0]))
        return f"{counted(self.well.size, 'state')}, of which belong for good to: {each or 'no well'}"


class Noted(NamedTuple):
    """What observers have noted of n lanes."""

    code: NDArray[np.int8]  #: number of the well, from 1; ``OUT``; 0: none yet
    turns: NDArray[np.int32]  #: (n, coordinates)
    time: Floats  #: of capture [s]
    energy: Floats  #: bounding energy at the stop


class Early(NamedTuple):
    """What is over long before motions come to rest, and asks for shorter steps until then."""

    rest: CaptureCertificate  #: of what follows
    span: float  #: s
    step: float  #: coarsest [s]


class CaptureCertificate(ABC):
    """What is known of a system whose energy falls, for whoever follows its motions to rest.

    Energies are in units of its own; states are coordinates, then rates.
    """

    system: Any  #: what :func:`fastmech.ensembles.integrate.integrate` takes
    tree: Any  #: wells, barriers and equilibria
    decays: bool  #: whether a load still changes
    origin: float = 0.0  #: time [s] from which on motions are followed
    joule: float = 1.0  #: J of the unit that energies have here
    offset: float = 0.0  #: J that are zero here
    work: Floats  #: at most what loads can still do, evenly over the time until they have faded
    fades: float  #: that time [s]
    amplitudes: float  #: how much U varies, in that unit: the scale of its rounding
    rounding: float  #: share of it by which levels are lowered

    @property
    def names(self) -> tuple[str, ...]:
        """Of the coordinates."""
        return tuple(self.system.state[: len(self.system.turning)])

    @property
    def units(self) -> tuple[str, ...]:
        """Of the coordinates, rad or m."""
        return tuple(coordinate_units(self.system).values())

    @property
    def periods(self) -> Floats:
        """2 pi of coordinates that turn fully, else 0 (coordinates,)."""
        return np.where(self.system.turning, 2.0 * np.pi, 0.0)

    def outside(self, states: Floats) -> NDArray[np.bool_]:
        """Which states (n, states) lie beyond the range of a coordinate (n,)."""
        return np.zeros(len(states), np.bool_) if all(self.periods) else self.system.outside(states)

    def reduced(self, energy: Floats) -> Floats:
        """Energies [J] in the unit that they have here."""
        return np.asarray((energy - self.offset) / self.joule)

    @property
    def levels(self) -> Floats:
        """Energies below which each well captures (wells,): its barrier, less what rounding may take."""
        return self.reduced(self.tree.barrier) - self.rounding * self.amplitudes

    @property
    def energies(self) -> Floats:
        """Of the equilibria (count,)."""
        return self.reduced(self.tree.equilibria.energy)

    @cached_property
    def packed(self) -> Floats:
        """The observers' vector of the wells' own levels."""
        return self.params(self.levels)

    @property
    @abstractmethod
    def cells(self) -> Cells:
        """Bounds of U over cells of the domain."""

    @property
    @abstractmethod
    def coefficients(self) -> Floats:
        """What the observer takes of the system."""

    @property
    @abstractmethod
    def observer(self) -> Any:
        """The kernel that looks at lanes."""

    def params(self, levels: Floats) -> Floats:
        """The observers' vector, see :mod:`fastmech.capture.observe`; interval and step are still empty."""
        n, wells = len(self.names), list(self.tree.wells)
        places, domain = self.tree.equilibria.position[wells], self.cells.domain
        # Of boxes about the wells in which U is convex; a radius has one for all coordinates.
        half_widths = np.broadcast_to(self.tree.radius.reshape(len(wells), -1), (len(wells), n))
        head = np.array([0.0, n, len(wells), self.fades, len(self.work), self.origin])
        assert len(head) == HEAD
        rows = [domain[:, 0], 1.0 / self.cells.widths, self.cells.counts, domain[:, 2], domain[:, 1]]
        assert len(rows) == TABLE_ROWS
        table = self.cells.table(places, self.levels)
        parts = [self.coefficients, head, *rows, places, half_widths, levels, self.work, table, [np.nan, 0.0]]
        return np.concatenate([np.ravel(np.asarray(part, dtype=np.float64)) for part in parts])

    def observation(
        self,
        params: Floats,
        interval: float,
        call_steps: int = CALL_STEPS_WITH_STOPS,
        step: float = np.nan,
        short: bool = False,
    ) -> Observation:
        """An observer that stops captured lanes at multiples of ``interval`` [s].

        They leave after at most ``call_steps`` steps. ``params`` is what the method of this name gives. Where
        a range ends between the ends of a ``step`` [s], a cubic decides who leaves it if steps are ``short``;
        else who may is out of it with no time.
        """
        own, n = params.copy(), len(self.names)
        first, wells = len(self.coefficients), len(self.tree.wells)
        own[first], own[-2:] = interval, (step, short)
        begin = first + HEAD + TABLE_ROWS * n + 2 * wells * n
        seen = 0 if all(self.periods) else 2 * n
        record = np.append(np.zeros(2 + 2 * n + RECORD + n), np.full(seen, np.nan))
        record[2 + 2 * n] = params[begin : begin + wells].max()
        return Observation(self.observer, own, record, stops=True, call_steps=call_steps, states=seen)

    def noted(self, records: Floats) -> Noted:
        """What is in an observer's record (rows, n)."""
        n = len(self.names)
        begin = 2 + 2 * n
        turns = records[begin + RECORD : begin + RECORD + n]
        code = records[STOP_CODE].astype(np.int8)
        return Noted(code, turns.T.astype(np.int32), records[begin + 3], records[begin + 4])

    @cached_property
    def motion(self) -> tuple[Any, Floats]:
        """Right-hand side and parameters for :func:`fastmech.ensembles.run.run_ensemble`."""
        rhs, columns, _ = self.system._motion({}).equations("lagrange")
        return rhs, np.array(columns, dtype=np.float64)

    @property
    def held(self) -> Any:
        """The system with the loads that its equilibria hold for."""
        return self.system

    def method(self, name: str | None) -> str:
        """The method of this name, or the one by default."""
        return find_method(name or "dop853").name

    def warn_of_step(self, dt: float, method: str) -> None:
        """Warn, in the caller's caller, if a step [s] cannot be right; where energies tell later, of none."""
        return

    def grows(self, dt: float, steps: float, method: str, damped: bool = True) -> bool:
        """Whether so many steps of dt [s] make motion grow that should die out, if that is known before.

        Without ``damped`` it is asked of any motion.
        """
        return False

    @abstractmethod
    def coarse_steps(self, starts: Floats) -> Floats:
        """Coarse step [s] of each start (n, states), shape (n,)."""

    @property
    def shortest_step(self) -> float:
        """Shortest of the coarse steps by default [s]."""
        return float(0.5**MOST_OCTAVES * self.slow_step)

    def damped_times(self, method: str, until: float, ratio: float = 2.0) -> Floats:
        """Times [s] before ``until`` at which an implicit method's first steps end."""
        return damped_times(self.system, method, until, ratio)

    def early(self, method: Method) -> Early | None:
        """What is over at once, if anything is."""
        return None

    @abstractmethod
    def impossible(self, starts: Floats, states: Floats, threads: int | None = 1) -> NDArray[np.bool_]:
        """Which motions from starts (n, states) have come to states that they cannot have (n,)."""

    @abstractmethod
    def change(self, states: Floats, apart: Floats, push: Floats | None = None) -> Floats:
        """Bound on how much the bounding energy changes from states over boxes of these half-widths (n,)."""

    def size(self, equilibrium: int) -> Size:
        """The kinetic-energy norm at one of the equilibria."""
        return size_of(self.held, self.tree.equilibria[equilibrium])

    @property
    def places(self) -> Floats:
        """States of rest at the equilibria (count, states)."""
        position = self.tree.equilibria.position
        return np.concatenate([position, np.zeros_like(position)], axis=1)

    def confining(self, radius: float) -> Floats:
        """Energies with which motions stay in the ball of a radius about each well, to second order."""
        wells, e = list(self.tree.wells), self.tree.equilibria
        more = np.array([confining_energy(self.held, e[well], radius) for well in wells])
        return np.asarray(self.energies[wells] + more / self.joule)

    def measuring_steps(self, starts: Floats, method: str) -> Floats:
        """Longest steps [s] of starts (n, states) for what is measured on the way, shape (n,)."""
        return MEASURING * self.coarse_steps(starts)

    @property
    @abstractmethod
    def slow_step(self) -> float:
        """Coarse step of slow motions [s]."""

    def formula(self, method: str) -> Method:
        """A method that knows how to solve its systems, if it has any and there is a short way."""
        return with_inverse(find_method(method), self.system._motion({}).inverse)

    def captured(self, states: Floats) -> Captured:
        """Which states (n, states) at t = 0 are captured already."""
        observation = self.observation(self.packed, 1.0)
        record = np.repeat(observation.record[:, None], len(states), axis=1)
        observation.observe(0.0, np.ascontiguousarray(states.T), observation.params, record)
        found = self.noted(record)
        code = np.where(found.code == OUT, 0, found.code)
        return Captured(np.append(-1, self.tree.wells)[code].astype(np.int8), found.turns)

    def away(self, states: Floats, place: Floats) -> Floats:
        """Departures (n, states) from the copy of a place that is nearest."""
        return short_way(states - place, self.system.turning)
