"""Computations of the same starts with ever smaller steps, until two in a row tell the same.

One of them goes on in stages, which pack the lanes still running.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.capture.certificate import CaptureCertificate
from fastmech.capture.observe import OUT
from fastmech.ensembles.ends import STOP_TIME
from fastmech.ensembles.lanes import MOST_STEPS, finite_rows
from fastmech.ensembles.run import run_ensemble
from fastmech.ensembles.status import Status
from fastmech.errors import InputError
from fastmech.integrators.methods import Method

Indices: TypeAlias = NDArray[np.intp]

#: Stages: rounds after which the lanes still running are packed anew, rounds a call, and rounds between stops
#: until then. Most lanes of a dissipative scene are captured early, and blocks should not run on for a few;
#: lanes captured late lose little energy in a round, so their capture is confirmed some rounds later.
STAGES = ((2, 2, 1), (8, 3, 1), (32, 6, 2), (64, 16, 4))
LATE = (32, 8)

#: Steps a round from which on a cubic between their ends decides whether a coordinate leaves its range.
SHORT = 20

#: Lanes a block where calls are short, and where they are long.
BLOCK, LATE_BLOCK = 1024, 256

#: Lanes up to which a second thread takes longer to start than it saves.
ONE_THREAD = 128


@dataclass
class Paths:
    """Where n lanes came to; those not captured have the code 0."""

    code: NDArray[np.int8]  #: number of the well, from 1; ``OUT`` of range
    turns: NDArray[np.int32]  #: (n, coordinates)
    time: Floats  #: of capture [s]
    stop: Floats  #: end of the computation [s]; NaN: whether it left a range is for shorter steps to tell
    energy: Floats  #: bounding energy there, in the certificate's unit
    state: Floats  #: state there, (n, states)
    status: NDArray[np.int8]  #: :class:`fastmech.ensembles.status.Status` of the run, (n,)
    steps: int = 0  #: of all lanes together

    @classmethod
    def empty(cls, n: int, coordinates: int = 2) -> Paths:
        """Nothing known yet."""
        return cls(
            np.zeros(n, dtype=np.int8),
            np.zeros((n, coordinates), dtype=np.int32),
            np.full(n, np.nan),
            np.full(n, np.nan),
            np.full(n, np.nan),
            state=np.full((n, 2 * coordinates), np.nan),
            status=np.zeros(n, dtype=np.int8),
        )

    def put(self, where: NDArray[np.intp], other: Paths) -> None:
        """Fill some of the lanes."""
        for name in ARRAYS:
            getattr(self, name)[where] = getattr(other, name)

    def take(self, which: NDArray[np.intp]) -> Paths:
        """Some of the lanes."""
        return Paths(*(getattr(self, name)[which] for name in ARRAYS))


ARRAYS = ("code", "turns", "time", "stop", "energy", "state", "status")


def rounds_until(t_end: float, longest: float) -> int:
    """Number of rounds, each at most ``longest`` [s], such that there is a stop at the end."""
    if t_end > MOST_STEPS * longest:
        raise InputError(f"t_end = {t_end:g} s: must be at most {MOST_STEPS * longest:.3g} s here")
    rounds = max(1, int(np.ceil(t_end / longest * (1.0 - 1e-12))))
    every = next((stops for until, _, stops in STAGES if rounds <= until), LATE[1])
    return -(-rounds // every) * every


def follow(
    certificate: CaptureCertificate,
    observer: Floats,
    starts: Floats,
    t_end: float,
    rounds: int,
    substeps: int,
    method: Method,
    threads: int | None,
) -> Paths:
    """Follow starts (n, states) until ``t_end`` [s] with so many steps a round; ``observer``: its vector."""
    rhs, params = certificate.motion
    paths = Paths.empty(len(starts), len(certificate.names))
    paths.state[:] = starts
    running, passed = np.arange(len(starts)), 0
    interval = t_end / rounds
    for until, call_rounds, stop_rounds in [*STAGES, (rounds, *LATE)]:
        ahead = min(until, rounds) - passed
        if ahead <= 0 or not running.size:
            continue
        run = run_ensemble(
            rhs,
            params,
            paths.state[running],
            [certificate.origin + passed * interval, certificate.origin + (passed + ahead) * interval],
            interval / substeps,
            method=method,
            observation=certificate.observation(
                observer,
                stop_rounds * interval,
                call_rounds * substeps,
                step=interval / substeps,
                short=substeps >= SHORT,
            ),
            threads=1 if running.size <= ONE_THREAD else threads,
            block_lanes=LATE_BLOCK if until == rounds else BLOCK,
        )
        noted = certificate.noted(run.records)
        stopped = noted.code != 0
        end = np.where(stopped, run.records[STOP_TIME] - certificate.origin, (passed + ahead) * interval)
        own = noted.code, noted.turns, noted.time, end, noted.energy, run.states[-1], run.status
        paths.put(running, Paths(*own))
        paths.steps += int(np.rint(end / interval - passed).sum()) * substeps
        passed += ahead
        running = running[~stopped & finite_rows(run.states[-1])]
    paths.stop[np.isnan(paths.time)] = np.nan
    return paths


#: Steps a round of one computation after the other, a round being two of the coarsest steps. With the default
#: method each makes the error some 25, 60 and then 256 times smaller, down to rounding.
SUBSTEPS = (2, 3, 5, 10, SHORT, 2 * SHORT)

#: A path that has not been captured is at a saddle when it is so near to it [rad], in its norm.
AT_SADDLE = 1e-3


class Computations(ABC):
    """Computations of the same starts with different steps; members are starts' numbers."""

    certificate: CaptureCertificate  #: of the system
    sequence: tuple[int, ...] = SUBSTEPS  #: numbers of substeps, one computation after the other

    @abstractmethod
    def follow(self, members: Indices, substeps: int) -> Paths:
        """One computation of some of the starts."""

    @abstractmethod
    def agree(self, members: Indices, coarse: Paths, fine: Paths) -> NDArray[np.bool_]:
        """Which tell the same with both steps."""

    @abstractmethod
    def impossible(self, members: Indices, states: Floats) -> NDArray[np.bool_]:
        """Which have come to states that their motion cannot have."""

    @abstractmethod
    def lingers(self, members: Indices) -> NDArray[np.bool_]:
        """Which come to an unstable equilibrium on their way."""

    def climb(self, members: Indices, found: Paths, status: NDArray[np.int8]) -> None:
        """Find labels and statuses of some starts, and write them where ``members`` says."""
        coarse = self.follow(members, self.sequence[0])
        for substeps in self.sequence[1:]:
            fine = self.follow(members, substeps)
            settled = self.agree(members, coarse, fine)
            done = np.flatnonzero(settled | (substeps == self.sequence[-1]))
            ends, last = members[done], fine.take(done)
            found.put(ends, last)
            captured = settled[done] & (last.code > 0)
            status[ends] = np.where(captured, Status.CAPTURED, Status.UNDECIDED)
            status[ends[captured & (last.code == OUT)]] = Status.OUT_OF_RANGE
            free = np.flatnonzero(last.code == 0)
            status[ends[free[near_saddle(self.certificate, last.state[free])]]] = Status.AT_SADDLE
            # Where steps do not agree: a stable manifold between the paths leads them to its saddle first.
            torn = ends[~settled[done]]
            if torn.size:
                status[torn[self.lingers(torn)]] = Status.AT_SADDLE
            status[ends[self.impossible(ends, last.state)]] = Status.STEP_TOO_LARGE
            # A start is finite, and so is the energy that its motion can have.
            status[ends[free[~finite_rows(last.state[free])]]] = Status.STEP_TOO_LARGE
            for kind in (Status.NOT_CONVERGED, Status.STEP_TOO_LARGE):
                status[ends[free[last.status[free] == kind]]] = kind
            # The finest step alone is within the limit: nothing bears it out.
            alone = ~settled[done] & (coarse.status[done] == Status.STEP_TOO_LARGE)
            status[ends[alone & (last.status == Status.OK)]] = Status.STEP_TOO_LARGE
            rest = np.flatnonzero(~settled)
            members, coarse = members[rest], fine.take(rest)
            if not members.size:
                break


def tell_the_same(
    certificate: CaptureCertificate, coarse: Paths, fine: Paths, longest: float, push: Floats | None = None
) -> NDArray[np.bool_]:
    """Which paths are not captured either time, or captured both times beyond their difference.

    A captured path stops where its bounding energy is below its well's level: what lies between the two there
    is captured if that holds for all of it. The times at which they stop may differ by ``longest`` [s].
    ``push`` is a scene's decaying force over m2 l, which the bounding energies count with [1/s^2].
    """
    finite = finite_rows(coarse.state) & finite_rows(fine.state)
    same = (coarse.code == fine.code) & (coarse.turns == fine.turns).all(axis=1) & finite
    same &= np.abs(coarse.stop - fine.stop) < longest
    apart = np.abs(np.where(finite.reshape(-1, 1), coarse.state - fine.state, np.inf))
    held = (fine.code > 0) & (fine.code != OUT)
    level = np.append(np.inf, certificate.levels)[np.where(held, fine.code, 0)]
    with np.errstate(invalid="ignore"):
        proved = certificate.change(fine.state, apart, push) < level - fine.energy
    return np.asarray(same & (proved | ~held))


def near_saddle(certificate: CaptureCertificate, states: Floats) -> NDArray[np.bool_]:
    """Which states (n, dim) rest at an unstable equilibrium.

    Beside a fold, a motion that creeps between two equilibria is near both: near is a tenth of the way to
    the next one.
    """
    near, places = np.zeros(len(states), dtype=np.bool_), certificate.places
    for k, place in enumerate(places):
        if k not in certificate.tree.wells:
            size = certificate.size(k)
            others = np.sort(size(certificate.away(places, place)))[1:]
            most = min(AT_SADDLE, 0.1 * float(others.min(initial=np.inf)))
            near |= size(certificate.away(states, place)) < most
    return near
