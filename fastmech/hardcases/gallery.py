"""Runs the gallery and puts what came out into a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from fastmech.ensembles.status import FAILURES, Status
from fastmech.hardcases.case import REFUSED, HardCase, Row
from fastmech.hardcases.registry import CASES
from fastmech.results import Dataset, Variable, flags

#: Statuses of rows in the file: the trajectories', and one for a request that is refused before the run.
RowStatus = IntEnum(  # type: ignore[misc]
    "RowStatus",
    {status.name: status.value for status in sorted((Status.OK, *FAILURES))} | {REFUSED.upper(): 100},
)


class Result(NamedTuple):
    """A case and its rows."""

    case: HardCase
    rows: Sequence[Row]

    @property
    def passed(self) -> bool:
        """Whether every row did what it must."""
        return all(row.passed for row in self.rows)


def run_gallery(quick: bool, progress: Callable[[int], None] = lambda done: None) -> list[Result]:
    """Every case in turn; ``progress`` is told of each."""
    results = []
    for case in CASES.values():
        results.append(Result(case, case.run(quick)))
        progress(1)
    return results


def gallery_dataset(results: Sequence[Result]) -> Dataset:
    """One row a case and method."""
    rows = [(result.case, row) for result in results for row in result.rows]

    def numbers(name: str, units: str, about: str) -> Variable:
        return Variable(("row",), np.array([float(getattr(row, name)) for _, row in rows]), units, about)

    codes = np.array([RowStatus[row.status.upper()] for _, row in rows], dtype=np.int8)
    return Dataset(
        {
            "case": Variable(("row",), np.array([case.name for case, _ in rows], object), "1", "case"),
            "method": Variable(("row",), np.array([row.method for _, row in rows], object), "1", "method"),
            "dt": numbers("dt", "s", "step"),
            "steps": Variable(("row",), np.array([row.steps for _, row in rows]), "1", "steps"),
            "error": numbers("error", "1", "error as the case defines it; NaN: it has none"),
            "allowed": numbers("allowed", "1", "error to which the method claims the case; NaN: it does not"),
            "drift": numbers("drift", "1", "largest relative change of energy; NaN: it is not conserved"),
            "status": Variable(("row",), codes, "1", "worst status", flags(RowStatus)),
            "claimed": Variable(
                ("row",), np.array([row.claimed for _, row in rows]), "1", "method claims it"
            ),
            "passed": Variable(("row",), np.array([row.passed for _, row in rows]), "1", "did what it must"),
            "why": Variable(("row",), np.array([row.why for _, row in rows], object), "1", "why so far"),
            "remark": Variable(("row",), np.array([row.remark for _, row in rows], object), "1", "remark"),
        },
        {"failures": sum(not row.passed for _, row in rows)},
    )


def verdict(results: Sequence[Result]) -> str:
    """One line: how many cases passed, and which did not."""
    failed = [result.case.name for result in results if not result.passed]
    rows = [row for result in results for row in result.rows]
    if not failed:
        claims = sum(row.claimed for row in rows)
        told = f"{claims} claims hold, {len(rows) - claims} end with a status" if len(rows) > 1 else "1 row"
        return f"all {len(results)} cases passed ({told})"
    return f"{len(failed)} of {len(results)} cases failed: {', '.join(failed)}"


_INTRODUCTION = (
    "A method claims a case to an error, at a step that the package lets pass without a warning; the oracle "
    "says whether the claim holds. Where the claim is its own, it comes from the method alone: twice what "
    "halving the step tells. A method that claims nothing must end with a status, not with a number."
)


def gallery_markdown(results: Sequence[Result], tables: str) -> str:
    """The report's text; ``tables`` are those that follow the cases."""
    lines = ["# Hard cases", "", f"{verdict(results).capitalize()}.", "", _INTRODUCTION, ""]
    for result in results:
        case = result.case
        lines += [f"## {case.name}: {'passed' if result.passed else 'FAILED'}", ""]
        lines += [f"Hard: {case.hard}.  ", f"Oracle: {case.oracle}.  ", f"Must: {case.must}.", ""]
        lines += [
            "| method | step [s] | steps | error | claimed to | drift | status | verdict | why | remark |"
        ]
        lines += ["|---|---:|---:|---:|---:|---:|---|---|---|---|"]
        for row in result.rows:
            claim = _number(row.allowed) if row.claimed else "not claimed"
            lines.append(
                f"| {row.method} | {_step(row.dt)} | {row.steps:,} | {_number(row.error)} | {claim} | "
                f"{_number(row.drift)} | {row.status} | {row.verdict} | {row.why} | {row.remark} |"
            )
        lines.append("")
    return "\n".join([*lines, tables, ""])


def _step(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.3g}"


def _number(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.1e}"
