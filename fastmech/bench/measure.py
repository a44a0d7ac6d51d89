"""Timing one entrant: first call apart, medians of warm calls, error against the reference."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastmech.bench.entrants import Entrant
from fastmech.bench.problem import Problem

REPEATS = 3


@dataclass(frozen=True)
class Row:
    """What one entrant did on one problem."""

    problem: str
    family: str
    setting: str
    threads: int
    trajectories: int
    rate: float  #: trajectories per second, median of warm calls
    compared: int  #: trajectories whose error is known, the same ones for every entrant
    max_error: float  #: largest error of any component of any of these final states [rad, rad/s]
    median_error: float  #: median over them of the largest error of a component
    first_call: float  #: s, on a few trajectories: compiling or loading included


def measure(problem: Problem, entrant: Entrant, reference: NDArray[np.float64], threads: int) -> Row:
    """Time an entrant on its share of the problem's starts."""
    n = max(len(reference), round(len(problem.starts) * entrant.share))
    starts = problem.starts[:n]
    began = time.perf_counter()
    entrant.run(problem, starts[:8], threads)
    first_call = time.perf_counter() - began
    seconds = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        final = entrant.run(problem, starts, threads)
        seconds.append(time.perf_counter() - began)
    errors = np.abs(final[: len(reference)] - reference).max(axis=1)
    return Row(
        problem.name,
        entrant.family,
        entrant.setting,
        threads,
        n,
        n / statistics.median(seconds),
        len(reference),
        float(errors.max()),
        float(np.median(errors)),
        first_call,
    )
