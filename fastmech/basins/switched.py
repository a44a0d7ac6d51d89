"""Where motions end that rest until a decaying force is switched on, each with a force of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.basins.ladder import SUBSTEPS, Indices, climb, near_saddle, tell_the_same
from fastmech.basins.runs import Paths
from fastmech.capture.scene import SceneCertificate
from fastmech.capture.steps import coarse_steps
from fastmech.ensembles.fitting import breaks_energy_bounds, energies
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.run import Progress
from fastmech.ensembles.status import Status
from fastmech.mechanism.coefficients import reduce

#: Time between looks at what is captured [s].
PIECE = 1.0

#: A force may fall by this share of itself in a coarse step, until so many of its time constants have passed.
FALL, GONE = 0.5, 30.0

#: Motions followed together.
TOGETHER = 1 << 12


@dataclass(frozen=True)
class Switched:
    """Motions (n,) from one state under F0 exp(-alpha t).

    The certificate is that of the force-free scene. A motion is captured by a well w once it is below B(w) in
    w's component and ``T + Pi + |F(t)| (2 l - sgn(F) x2(t))``, which no later T + Pi exceeds, is below B(w).
    """

    certificate: SceneCertificate
    start: Floats  #: (4,)
    F0: Floats  #: N
    alpha: Floats  #: 1/s
    end: Floats  #: s
    step: Floats  #: coarsest [s]
    method: str
    threads: int | None
    near: NDArray[np.bool_]  #: which have been seen at an unstable equilibrium, with the finest step

    @classmethod
    def of(
        cls,
        certificate: SceneCertificate,
        start: Floats,
        F0: Floats,
        alpha: Floats,
        end: Floats,
        *,
        dt: float | None,
        method: str,
        threads: int | None,
    ) -> Switched:
        """With the steps that follow from the forces, in octaves, where ``dt`` [s] does not say them."""
        free = reduce(certificate.system)
        unit = certificate.system.m2 * certificate.system.l
        slowest = float(coarse_steps(free, start[None])[0])
        own = np.full(F0.size, dt if dt is not None else slowest)
        if dt is None:
            for force in np.unique(F0):
                needed = float(coarse_steps(free._replace(force=force / unit), start[None])[0])
                octaves = np.ceil(np.log2(slowest / needed) - 1e-9)
                own[force == F0] = slowest * 0.5 ** max(octaves, 0.0)
        return cls(
            certificate, start, F0, alpha, end, own, method, threads, np.zeros(F0.size, dtype=np.bool_)
        )

    def label(self, progress: Progress | None) -> tuple[Paths, NDArray[np.int8]]:
        """Ends and statuses of all of them."""
        found = Paths.empty(self.F0.size)
        status = np.full(self.F0.size, Status.UNDECIDED, dtype=np.int8)
        pieces = -(-self.F0.size // TOGETHER)
        for first in range(pieces):
            # Each piece takes something of everywhere, so that all take about as long.
            members = np.arange(first, self.F0.size, pieces)
            climb(
                self.certificate,
                members,
                self.follow,
                self.agree,
                self.impossible,
                self.lingers,
                found,
                status,
            )
            if progress is not None:
                progress(members.size)
        return found, status

    def push(self, members: Indices, t: Floats) -> Floats:
        """F(t)/(m2 l) [1/s^2]."""
        scene = self.certificate.system
        return np.asarray(
            self.F0[members] * np.exp(-self.alpha[members] * t) / (scene.m2 * scene.l), dtype=np.float64
        )

    def follow(self, members: Indices, substeps: int) -> Paths:
        """One computation, with a look at every end of a piece."""
        paths = Paths.empty(members.size)
        paths.state[:] = self.start
        clock, running = np.zeros(members.size), np.arange(members.size)
        while running.size:
            lanes = members[running]
            acting = self.alpha[lanes] * clock[running] < GONE
            needed = np.where(acting, FALL / self.alpha[lanes], np.inf)
            with np.errstate(divide="ignore"):
                octaves = np.maximum(np.ceil(np.log2(self.step[lanes] / needed) - 1e-9), 0.0)
            step = self.step[lanes] * 0.5**octaves * SUBSTEPS[0] / substeps
            span = np.where(acting, np.minimum(PIECE, GONE / self.alpha[lanes]), PIECE)
            span = np.minimum(span, self.end[lanes] - clock[running])
            for h, length in np.unique(np.column_stack([step, span]), axis=0):
                group = running[(step == h) & (span == length)]
                self._advance(paths, clock, members, group, float(length), float(h))
            self._look(paths, clock, members, running)
            if substeps == SUBSTEPS[-1]:
                self.near[members[running]] |= near_saddle(self.certificate, paths.state[running])
            alive = (paths.code[running] == 0) & np.isfinite(paths.state[running]).all(axis=1)
            running = running[alive & (clock[running] < self.end[members[running]])]
        return paths

    def _advance(
        self, paths: Paths, clock: Floats, members: Indices, group: Indices, span: float, step: float
    ) -> None:
        lanes = members[group]
        # A force that decays is at any time the start of one that is smaller by then.
        now = self.F0[lanes] * np.exp(-self.alpha[lanes] * clock[group])
        run = integrate(
            self.certificate.system,
            paths.state[group],
            span,
            step,
            self.method,
            parameters={"F0": now, "alpha": self.alpha[lanes]},
            threads=self.threads,
        )
        paths.state[group], paths.status[group] = run.y[-1], run.status
        clock[group] += span
        paths.stop[group] = clock[group]

    def _look(self, paths: Paths, clock: Floats, members: Indices, running: Indices) -> None:
        state = paths.state[running]
        captured = self.certificate.captured(state)
        place = np.zeros(len(self.certificate.tree.equilibria) + 1, dtype=np.int8)
        place[list(self.certificate.tree.wells)] = np.arange(1, len(self.certificate.tree.wells) + 1)
        code = place[captured.well]
        bound = energies(reduce(self.certificate.system)._replace(force=0.0), state)[0]
        push = self.push(members[running], clock[running])
        bound = bound + 2.0 * np.abs(push) - push * (np.cos(state[:, 0]) - np.sin(state[:, 1]))
        held = (code > 0) & (bound < np.append(-np.inf, self.certificate.levels)[code])
        paths.energy[running] = bound
        there = running[held]
        paths.code[there], paths.turns[there] = code[held], captured.turns[held]
        paths.time[there] = clock[there]

    def agree(self, members: Indices, coarse: Paths, fine: Paths) -> NDArray[np.bool_]:
        """Which tell the same with both steps."""
        push = self.push(members, fine.stop)
        return tell_the_same(self.certificate, coarse, fine, 0.5 * PIECE, push)

    def impossible(self, members: Indices, states: Floats) -> NDArray[np.bool_]:
        """Which have energies that the force cannot have given."""
        scene = self.certificate.system
        own = reduce(scene)._replace(
            force=self.F0[members] / (scene.m2 * scene.l),  # type: ignore[arg-type]
            decay=self.alpha[members],  # type: ignore[arg-type]
        )
        return breaks_energy_bounds(own, np.tile(self.start, (members.size, 1)), states)

    def lingers(self, members: Indices) -> NDArray[np.bool_]:
        """Which came to an unstable equilibrium of the force-free scene in the finest computation."""
        return self.near[members]
