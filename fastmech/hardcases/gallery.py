"""Runs the gallery and puts what came out into a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from fastmech.ensembles.status import FAILURES, Status
from fastmech.hardcases.case import REFUSED, HardCase, Row
from fastmech.hardcases.cases import (
    algebraic,
    chaos,
    conservative,
    folds,
    precision,
    references,
    saddle,
    starts,
)
from fastmech.reports import columns, table
from fastmech.results import Dataset, Variable, flags

#: Statuses of rows in the file: the trajectories', and one for a request that is refused before the run.
RowStatus = IntEnum(  # type: ignore[misc]
    "RowStatus",
    {status.name: status.value for status in sorted((Status.OK, *FAILURES))} | {REFUSED.upper(): 100},
)


#: Every case by its name.
CASES: dict[str, HardCase] = {
    case.name: case
    for module in (references, conservative, algebraic, folds, saddle, chaos, precision, starts)
    for case in module.CASES
}


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


#: Columns of the file, by the attributes of a row.
_COLUMNS = {
    "method": ("1", "method"),
    "dt": ("s", "step"),
    "steps": ("1", "steps"),
    "error": ("1", "error as the case defines it; NaN: it has none"),
    "allowed": ("1", "error to which the method claims the case; NaN: it does not"),
    "drift": ("1", "largest relative change of energy; NaN: it is not conserved"),
    "claimed": ("1", "method claims it"),
    "passed": ("1", "did what it must"),
    "why": ("1", "why so far"),
    "remark": ("1", "remark"),
}


def gallery_dataset(results: Sequence[Result]) -> Dataset:
    """One row a case and method."""
    rows = [row for result in results for row in result.rows]
    names = np.array([result.case.name for result in results for _ in result.rows], object)
    codes = np.array([RowStatus[row.status.upper()] for row in rows], dtype=np.int8)
    about = {
        "case": Variable(("row",), names, "1", "case"),
        "status": Variable(("row",), codes, "1", "worst status", flags(RowStatus)),
    }
    return Dataset(about | columns("row", rows, _COLUMNS), {"failures": sum(not row.passed for row in rows)})


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


def gallery_markdown(results: Sequence[Result], tables: Sequence[str]) -> str:
    """The report's text; ``tables`` are those that follow the cases."""
    head = "method | step [s] | steps | error | claimed to | drift | status | verdict | why | remark"
    lines = ["# Hard cases", "", f"{verdict(results).capitalize()}.", "", _INTRODUCTION, ""]
    for result in results:
        case = result.case
        lines += [f"## {case.name}: {'passed' if result.passed else 'FAILED'}", ""]
        lines += [f"Hard: {case.hard}.  ", f"Oracle: {case.oracle}.  ", f"Must: {case.must}.", ""]
        lines += table(head, map(_line, result.rows), (0, 6, 7, 8, 9))
    return "\n".join([*lines, *tables])


def _line(row: Row) -> str:
    step, error, allowed, drift = (
        "" if np.isnan(value) else f"{value:{form}}"
        for value, form in ((row.dt, ".3g"), (row.error, ".1e"), (row.allowed, ".1e"), (row.drift, ".1e"))
    )
    claim = allowed if row.claimed else "not claimed"
    numbers = f"{row.method} | {step} | {row.steps:,} | {error} | {claim} | {drift}"
    return f"{numbers} | {row.status} | {row.verdict} | {row.why} | {row.remark}"
