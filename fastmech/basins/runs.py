"""One computation of where starts are captured: with one step, in stages that pack the lanes still running."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastmech.capture.certificate import Certificate
from fastmech.capture.observe import CAPTURE_ENERGY, TURNS_PHI, TURNS_THETA
from fastmech.ensembles.run import CALL_STEPS_WITH_STOPS, run_ensemble
from fastmech.ensembles.stopping import STOP_CODE, STOP_TIME
from fastmech.integrators.method import Method
from fastmech.kernels.select import right_hand_side
from fastmech.mechanism.coefficients import reduce

Floats = NDArray[np.float64]

#: Looks after which the lanes still running are packed anew, and steps a call until then: most lanes of a
#: dissipative scene are captured early, and blocks should not run on for a few.
STAGES = ((8, 8), (32, 16), (128, 32))


@dataclass
class Paths:
    """Where n lanes came to: code of the well (0: not captured), turns, time [s], energy, state."""

    code: NDArray[np.int8]
    turns: NDArray[np.int32]  #: (n, 2)
    time: Floats  #: s, that of capture or t_end
    energy: Floats  #: over m2 l^2, at capture
    state: Floats  #: (n, 4)
    steps: int = 0  #: of all lanes together

    @classmethod
    def empty(cls, n: int) -> Paths:
        """Nothing known yet."""
        return cls(
            np.zeros(n, dtype=np.int8),
            np.zeros((n, 2), dtype=np.int32),
            np.full(n, np.nan),
            np.full(n, np.nan),
            np.full((n, 4), np.nan),
        )

    def take(self, which: NDArray[np.intp]) -> Paths:
        """Some of the lanes."""
        parts = (a[which] for a in (self.code, self.turns, self.time, self.energy, self.state))
        return Paths(*parts)


def follow(
    certificate: Certificate,
    starts: Floats,
    looks: int,
    interval: float,
    halvings: int,
    method: Method,
    threads: int | None,
    levels: Floats | None = None,
) -> Paths:
    """Follow starts (n, 4) for so many looks, ``interval`` [s] apart, with 2**halvings steps between looks."""
    c = reduce(certificate.scene)
    rhs, params = right_hand_side(c), np.array(c, dtype=np.float64)
    observation = certificate.observation(interval, levels)
    paths = Paths.empty(len(starts))
    paths.state[:] = starts
    running, passed = np.arange(len(starts)), 0
    for until, call_steps in [*STAGES, (looks, CALL_STEPS_WITH_STOPS)]:
        ahead = min(until, looks) - passed
        if ahead <= 0 or not running.size:
            continue
        run = run_ensemble(
            rhs,
            params,
            paths.state[running],
            [passed * interval, (passed + ahead) * interval],
            interval / 2**halvings,
            method,
            replace(observation, call_steps=call_steps),
            threads=threads,
        )
        passed += ahead
        code = run.records[STOP_CODE].astype(np.int8)
        stopped = code != 0
        paths.code[running] = code
        paths.turns[running] = run.records[[TURNS_PHI, TURNS_THETA]].T
        paths.time[running] = np.where(stopped, run.records[STOP_TIME], passed * interval)
        paths.energy[running] = run.records[CAPTURE_ENERGY]
        paths.state[running] = run.states[-1]
        paths.steps += int(np.rint((paths.time[running] - (passed - ahead) * interval) / interval).sum()) << halvings
        running = running[~stopped & np.isfinite(run.states[-1]).all(axis=1)]
    return paths
