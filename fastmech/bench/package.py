"""fastmech's entrants, all through ``fm.integrate``. To add one, add a line here."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fastmech.bench.entrant import Entrant, Prepare, Solve
from fastmech.bench.problem import Problem
from fastmech.ensembles.integrate import integrate

#: Steps [s] of each method for the rest starts; other problems scale them by their pace.
STEPS: dict[str, tuple[float, ...]] = {
    "rk4": (0.08, 0.05, 0.02, 0.01, 0.005),
    "tsit5": (0.15, 0.12, 0.08, 0.05, 0.03, 0.015),
    "verner6": (0.2, 0.14, 0.1, 0.06, 0.035, 0.02),
    "dop853": (0.25, 0.18, 0.12, 0.08, 0.05, 0.03, 0.018),
    "hairer10": (0.3, 0.22, 0.16, 0.1, 0.07, 0.045, 0.03),
    "ab5": (0.033, 0.025, 0.017, 0.01),
    "ab6": (0.025, 0.017, 0.012, 0.008, 0.005),
    "ab8": (0.012, 0.009, 0.006, 0.004),
    "abm10": (0.03, 0.022, 0.016, 0.011, 0.008, 0.0055),
    "abm12": (0.022, 0.016, 0.0125, 0.009, 0.0065, 0.0045, 0.004),
}


def settings(problem: Problem) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Family, setting and the keywords that ``fm.integrate`` is given."""
    for method, steps in STEPS.items():
        for dt in steps:
            h = dt * problem.pace
            yield f"fastmech {method}", f"dt = {h:g} s", {"method": method, "dt": h}


def entrants(problem: Problem) -> Iterator[Entrant]:
    """Every setting on one thread, every second one also on all."""
    for number, (family, setting, keywords) in enumerate(settings(problem)):
        yield Entrant(family, setting, prepared(keywords), threaded=number % 2 == 0)


def prepared(keywords: dict[str, Any]) -> Prepare:
    """A call of ``fm.integrate`` with these keywords."""

    def prepare(problem: Problem, threads: int) -> Solve:
        return lambda starts: integrate(problem.scene, starts, problem.t_end, threads=threads, **keywords).y[
            -1
        ]

    return prepare
