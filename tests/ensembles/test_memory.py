"""Runs that would not fit into memory are refused before any is taken."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest
from ensembles.starts import random_starts

import fastmech as fm
from fastmech.ensembles import checks, integrate
from fastmech.errors import InputError
from fastmech.scene import Scene

TIMES = np.linspace(0.0, 0.1, 2001)
SMALL_CHANGE = 2**21  #: bytes of what does not grow with the trajectories: a task's lanes
STATES = TIMES.size * 20 * 4 * 8  #: bytes of the states of 20 trajectories


@pytest.mark.parametrize("arguments", [{}, {"tol": 1e-4}, {"formulation": "hamilton"}])
def test_too_little_memory_is_refused_before_any_is_taken(
    arguments: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    starts = random_starts(20)
    fm.integrate(Scene(), starts, t_eval=TIMES[:3], **arguments)  # whatever is compiled, is by now
    monkeypatch.setattr(checks, "UNASKED", 0)
    monkeypatch.setattr(checks, "free_memory", lambda: float(STATES))
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"^y0, t_eval: the states would .* are free") as error:
            fm.integrate(Scene(), starts, t_eval=TIMES, **arguments)
        assert tracemalloc.get_traced_memory()[1] < STATES / 4
    finally:
        tracemalloc.stop()
    assert "\n" not in str(error.value)


OWN = {"beta": np.linspace(0.5, 1.5, 100_000)}
GEOMETRY = {"m2": np.linspace(3.0, 4.0, 100_000), "l": np.linspace(0.5, 0.6, 100_000)}


@pytest.mark.parametrize(
    ("n", "times"),
    [(400, TIMES), (100_000, TIMES[-1:]), (100_000, TIMES[400::400])],
    ids=["times", "end", "both"],
)
@pytest.mark.parametrize(
    "arguments",
    [
        {},
        {"method": "ab6"},
        {"fit": True},
        {"fit": [0.0, 0.05]},
        {"formulation": "hamilton"},
        {"tol": 1e-4},
        {"parameters": OWN},
        {"parameters": OWN | GEOMETRY},
        {"parameters": {"m2": GEOMETRY["m2"]}},
        {"parameters": OWN, "tol": 1e-4},
    ],
    ids=str,
)
def test_no_run_takes_more_than_it_was_checked_for(
    arguments: dict[str, Any], n: int, times: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a run asks for is what Python's own bookkeeping sees it take, but for small change."""
    if "parameters" in arguments:
        own = {name: values[:n] for name, values in arguments["parameters"].items()}
        arguments = arguments | {"parameters": own}
    asked: list[float] = []
    original = checks.memory

    def noted(numbers: int, copies: int, *words: str) -> None:
        asked.append(8.0 * numbers * copies)
        original(numbers, copies, *words)

    monkeypatch.setattr(integrate.checks, "memory", noted)
    starts = random_starts(n)
    fm.integrate(
        Scene(), starts, t_eval=times[-1:], threads=1, **arguments
    )  # whatever is compiled, is by now
    tracemalloc.start()
    try:
        fm.integrate(Scene(), starts, t_eval=times, threads=1, **arguments)
        assert tracemalloc.get_traced_memory()[1] < 1.1 * asked[-1] + SMALL_CHANGE
    finally:
        tracemalloc.stop()
