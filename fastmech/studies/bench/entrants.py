"""What takes part in the benchmark, from ``entrants.toml``: fastmech's settings, and series of others."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.status import Status
from fastmech.errors import StepWarning
from fastmech.studies.bench import peers
from fastmech.studies.bench.measure import BenchProblem, Entrant, Prepare
from fastmech.studies.reporting import content

#: Steps and tolerances of fastmech's own methods.
PACKAGE: dict[str, Any] = content(__package__, "entrants.toml")["package"]

#: Series by library; those of ``fastmech`` are always there.
SERIES: dict[str, list[dict[str, Any]]] = content(__package__, "entrants.toml")["series"]
LIBRARIES = tuple(library for library in SERIES if library != "fastmech")

#: What a value is, and how it is told; steps are scaled by a problem's pace.
SETTINGS = {"dt": "dt = {:g} s", "rtol": "rtol = {:g}", "tol": "tol = {:g}"}


def installed() -> list[str]:
    """Libraries that are there."""
    return [name for name in LIBRARIES if find_spec(name) is not None]


def _package(problem: BenchProblem) -> Iterator[Entrant]:
    """The package's own."""
    fit, single = {"fit": True}, {"dtype": "float32"}
    again = {"fit": [share * problem.t_end for share in PACKAGE["again"]]}
    kinds: dict[str, dict[str, dict[str, Any]]] = {
        "steps": {"": {}},
        "fitted": {", fitted": fit, ", fitted again": again},
        "single": {", float32": single},
        "single_fitted": {", fitted, float32": fit | single},
    }
    for kind, ways in kinds.items():
        for method, dt in ((method, dt) for method, steps in PACKAGE[kind].items() for dt in steps):
            for way, more in ways.items():
                h = dt if "fit" in more else dt * problem.pace
                keywords = {"method": method, "dt": h} | more
                yield Entrant(f"fastmech {method}{way}", f"dt = {h:g} s", prepared(keywords))
    for tol in PACKAGE["tolerances"]:
        every, most = prepared({"tol": tol}), prepared({"tol": tol, "quantile": 0.99})
        yield Entrant("fastmech tol", f"tol = {tol:g}, every error estimated", every)
        yield Entrant("fastmech tol, 99 %", f"tol = {tol:g}, 99 % quantile", most)


def prepared(keywords: dict[str, Any]) -> Prepare:
    """A call of ``fm.integrate`` with these keywords, on one thread unless they say otherwise.

    What it says is not to be trusted has no end.
    """

    def solve(problem: BenchProblem, starts: Any) -> Any:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", StepWarning)  # the status tells whom it concerns
            run = integrate(problem.scene, starts, problem.t_end, **({"threads": 1} | keywords))
        final = run.y[-1]
        if run.status.any():
            final[run.status != Status.OK] = np.inf
        return final

    return lambda problem: partial(solve, problem)


def _of_series(series: dict[str, Any], problem: BenchProblem) -> Iterator[Entrant]:
    """One for each value."""
    function = getattr(peers, series["prepare"])
    ((kind, values),) = ((kind, series[kind]) for kind in SETTINGS if kind in series)
    sizes = {key: series[key] for key in ("most", "least") if key in series}
    for value in values:
        x = value * problem.pace if kind == "dt" else value
        prepare = partial(function, *series.get("given", ()), x)
        yield Entrant(series["family"], SETTINGS[kind].format(x), prepare, **sizes)


def entrants_of(library: str, problem: BenchProblem) -> Iterator[Entrant]:
    """Those of a library; of fastmech: its own and what is always there."""
    if library == "fastmech":
        yield from _package(problem)
    for series in SERIES[library]:
        yield from _of_series(series, problem)


def entrants(problem: BenchProblem, quick: bool) -> Iterator[Entrant]:
    """Every entrant, the package's first; quick: every third of its own and one of what is always there."""
    if quick:
        yield from list(_package(problem))[::3]
        first = {series["prepare"]: series for series in reversed(SERIES["fastmech"])}
        yield from (next(_of_series(first[name], problem)) for name in ("fused", "plain", "scipy"))
    else:
        for library in ("fastmech", *installed()):
            yield from entrants_of(library, problem)
