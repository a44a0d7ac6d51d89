"""fastmech's entrants, all through ``fm.integrate``. To add one, add a line here."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.status import Status
from fastmech.errors import StepWarning
from fastmech.studies.bench.measure import Entrant, Prepare, Problem, Solve

#: Steps [s] of each method for the rest starts; other problems scale them by their pace.
STEPS: dict[str, tuple[float, ...]] = {
    "rk4": (0.08, 0.05, 0.02, 0.01, 0.005),
    "tsit5": (0.15, 0.12, 0.08, 0.05, 0.03, 0.015),
    "verner6": (0.2, 0.14, 0.1, 0.06, 0.035, 0.02),
    "dop853": (0.25, 0.18, 0.12, 0.08, 0.05, 0.03, 0.018),
    "hairer10": (0.22, 0.16, 0.1, 0.07, 0.045, 0.03),
    "ab6": (0.0175, 0.014, 0.011, 0.008, 0.005),
    "abm8": (0.028, 0.02, 0.015),
    "abm12": (0.0145, 0.0125, 0.009, 0.0065, 0.0045, 0.004),
}

#: The same where each trajectory's step is fitted to its energy: no step is scaled, fitting does that.
FITTED: dict[str, tuple[float, ...]] = {
    "ab6": (0.0175, 0.014, 0.011, 0.008),
    "ab7": (0.0085, 0.007, 0.0055),
    "abm8": (0.055, 0.05, 0.045, 0.04, 0.034, 0.028, 0.024, 0.02),
    "abm10": (0.03, 0.026, 0.022, 0.018, 0.0165, 0.015, 0.0135, 0.012, 0.01),
    "abm12": (0.0145, 0.013, 0.0115, 0.01, 0.0085, 0.007, 0.006),
}

#: Steps of methods in float32, where rounding leaves them something to say, and of those that fit.
SINGLE: dict[str, tuple[float, ...]] = {
    "ab6": (0.0175, 0.014),
    "rk4": (0.08, 0.05, 0.03),
    "tsit5": (0.12, 0.09, 0.06),
}
SINGLE_FITTED: dict[str, tuple[float, ...]] = {"ab6": (0.0175,), "abm8": (0.055, 0.05, 0.045, 0.04)}

#: Shares of the run at which steps are fitted again.
AGAIN = (0.0, 0.125, 0.5)

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)


def settings(problem: Problem) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Family, setting and the keywords that ``fm.integrate`` is given."""
    again, single = {"fit": [share * problem.t_end for share in AGAIN]}, {"dtype": "float32"}
    kinds: tuple[tuple[dict[str, tuple[float, ...]], dict[str, dict[str, Any]]], ...] = (
        (STEPS, {"": {}}),
        (FITTED, {", fitted": {"fit": True}, ", fitted again": again}),
        (SINGLE, {", float32": single}),
        (SINGLE_FITTED, {", fitted, float32": {"fit": True} | single}),
    )
    for table, ways in kinds:
        for method, dt in ((method, dt) for method, steps in table.items() for dt in steps):
            for way, more in ways.items():
                h = dt if "fit" in more else dt * problem.pace
                yield f"fastmech {method}{way}", f"dt = {h:g} s", {"method": method, "dt": h} | more
    for tol in TOLERANCES:
        yield "fastmech tol", f"tol = {tol:g}, every error estimated", {"tol": tol}
        yield "fastmech tol, 99 %", f"tol = {tol:g}, 99 % quantile", {"tol": tol, "quantile": 0.99}


def entrants(problem: Problem) -> Iterator[Entrant]:
    """Every setting, on one thread and on all."""
    for family, setting, keywords in settings(problem):
        yield Entrant(family, setting, prepared(keywords), threaded=True)


def prepared(keywords: dict[str, Any]) -> Prepare:
    """A call of ``fm.integrate`` with these keywords; what it says is not to be trusted has no end."""

    def prepare(problem: Problem, threads: int) -> Solve:
        def solve(starts: Any) -> Any:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", StepWarning)  # the status tells whom it concerns
                run = integrate(problem.scene, starts, problem.t_end, threads=threads, **keywords)
            final = run.y[-1]
            if run.status.any():
                final[run.status != Status.OK] = np.inf
            return final

        return solve

    return prepare
