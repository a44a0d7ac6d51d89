"""One computation of where starts are captured, in stages that pack the lanes still running."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.capture.certificate import CaptureCertificate
from fastmech.ensembles.ends import STOP_TIME
from fastmech.ensembles.lanes import MOST_STEPS, finite_rows
from fastmech.ensembles.run import run_ensemble
from fastmech.errors import InputError
from fastmech.integrators.methods import Method

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
    """Follow starts (n, states) until ``t_end`` [s] with so many steps a round.

    ``rounds`` is a number that ``rounds_until`` gives, ``observer`` the observers' vector.
    """
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
        reached = Paths(
            noted.code,
            noted.turns,
            noted.time,
            end,
            noted.energy,
            state=run.states[-1],
            status=run.status,
        )
        paths.put(running, reached)
        paths.steps += int(np.rint(end / interval - passed).sum()) * substeps
        passed += ahead
        running = running[~stopped & finite_rows(run.states[-1])]
    paths.stop[np.isnan(paths.time)] = np.nan
    return paths
