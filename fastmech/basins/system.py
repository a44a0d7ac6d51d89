"""Labels of a system of your own: the code with which its stopping condition ends each trajectory."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.basins.convergence import SUBSTEPS
from fastmech.basins.labels import Labels, pieces_of
from fastmech.ensembles import checks
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.run import Progress
from fastmech.ensembles.status import Status
from fastmech.ensembles.system import System
from fastmech.errors import InputError


def label_system_starts(
    system: System,
    starts: Floats,
    t_end: float,
    *,
    dt: float | None,
    method: str = "dop853",
    parameters: Mapping[str, Floats] | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Labels:
    """Label starts (n, dim) by stop codes; a code has to be a whole number from 1 to 127.

    Each trajectory is computed with the step ``dt`` and with two thirds of it; where codes differ, or times
    of stopping by more than a step, with ever smaller ones. What a code means, and whether it is final, is
    the stopping condition's matter. ``parameters`` have a value for every start, shape (n,); those that are
    not named are the system's.

    Raises:
        InputError: no stopping condition, no step, or a wrong argument.
    """
    if system.stop is None:
        raise InputError("stop: missing; basins of a system need a stopping condition that tells them apart")
    if dt is None:
        raise InputError("dt: missing; a system needs its longest step in s")
    dt, t_end = checks.number("dt", dt, "s", above=0.0), checks.number("t_end", t_end, "s", above=0.0)
    n = len(starts)
    before: tuple[NDArray[np.int64], Floats] | None
    status = np.full(n, Status.UNDECIDED, dtype=np.int8)
    code, time, steps = np.zeros(n, dtype=np.int64), np.full(n, np.nan), 0
    own = parameters or {}
    for piece in pieces_of(n):
        members, before = piece, None
        for substeps in SUBSTEPS:
            run = integrate(
                system,
                starts[members],
                t_end,
                dt * SUBSTEPS[0] / substeps,
                method,
                parameters={name: values[members] for name, values in own.items()},
                threads=threads,
            )
            assert run.stop_code is not None  # the system has a stopping condition
            assert run.stop_time is not None
            code[members], time[members] = run.stop_code, run.stop_time
            steps += int(np.nansum(np.where(run.stop_code != 0, run.stop_time, t_end) / run.dt))
            ended = np.where(run.stop_code != 0, run.stop_time, t_end)
            agrees = np.zeros(members.size, dtype=np.bool_)
            if before is not None:
                agrees = (before[0] == run.stop_code) & (np.abs(before[1] - ended) <= dt)
            failed = run.status != Status.OK
            status[members] = np.where(agrees & (run.stop_code != 0), Status.CAPTURED, Status.UNDECIDED)
            status[members[failed]] = run.status[failed]
            if before is not None and substeps == SUBSTEPS[-1]:
                split = ~agrees & (before[0] != run.stop_code) & (before[0] != 0) & (run.stop_code != 0)
                status[members[split]] = Status.AT_SADDLE
            rest = np.flatnonzero(~agrees | failed)
            members, before = members[rest], (run.stop_code[rest], ended[rest])
            if not members.size:
                break
        if (code < 0).any() or (code > 127).any():
            raise InputError(f"stop: gave the code {code[(code < 0) | (code > 127)][0]}, must be 0 to 127")
        if progress is not None:
            progress(piece.size)
    captured = status == Status.CAPTURED
    return Labels(
        None,
        np.where(captured, code, -1).astype(np.int8),
        np.zeros((n, 2), dtype=np.int32),
        np.where(captured, time, np.nan),
        None,
        status=status,
        steps=steps,
        t_end=t_end,
    ).of(system)
