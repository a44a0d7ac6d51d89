"""Runs the gallery and puts what came out into a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from fastmech.ensembles.status import Status
from fastmech.hardcases.case import HardCase, Row
from fastmech.hardcases.registry import CASES
from fastmech.results import Dataset, Variable, flags


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

    codes = np.array([Status[row.status.upper()] for _, row in rows], dtype=np.int8)
    return Dataset(
        {
            "case": Variable(("row",), np.array([case.name for case, _ in rows], object), "1", "case"),
            "method": Variable(("row",), np.array([row.method for _, row in rows], object), "1", "method"),
            "dt": numbers("dt", "s", "step"),
            "steps": Variable(("row",), np.array([row.steps for _, row in rows]), "1", "steps"),
            "error": numbers("error", "1", "error as the case defines it; NaN: it has none"),
            "allowed": numbers("allowed", "1", "largest error that passes"),
            "drift": numbers("drift", "1", "largest relative change of energy; NaN: it is not conserved"),
            "status": Variable(("row",), codes, "1", "worst status", flags(Status)),
            "claimed": Variable(
                ("row",), np.array([row.claimed for _, row in rows]), "1", "method claims it"
            ),
            "passed": Variable(("row",), np.array([row.passed for _, row in rows]), "1", "did what it must"),
            "remark": Variable(("row",), np.array([row.remark for _, row in rows], object), "1", "remark"),
        },
        {"failures": sum(not row.passed for _, row in rows)},
    )


def verdict(results: Sequence[Result]) -> str:
    """One line: how many cases passed, and which did not."""
    failed = [result.case.name for result in results if not result.passed]
    rows = sum(len(result.rows) for result in results)
    if not failed:
        return f"all {len(results)} cases passed ({rows} rows)"
    return f"{len(failed)} of {len(results)} cases failed: {', '.join(failed)}"


def gallery_markdown(results: Sequence[Result], tables: str) -> str:
    """The report's text; ``tables`` are those that follow the cases."""
    lines = ["# Hard cases", "", f"{verdict(results).capitalize()}.", ""]
    lines += ["A method that does not claim a case must end with a status, not with a number.", ""]
    for result in results:
        case = result.case
        lines += [f"## {case.name}: {'passed' if result.passed else 'FAILED'}", ""]
        lines += [f"Hard: {case.hard}.  ", f"Oracle: {case.oracle}.  ", f"Must: {case.must}.", ""]
        lines += [
            "| method | step [s] | steps | error | allowed | drift | status | claimed | passed | remark |"
        ]
        lines += ["|---|---:|---:|---:|---:|---:|---|---|---|---|"]
        lines += [
            f"| {row.method} | {row.dt:.3g} | {row.steps:,} | {_number(row.error)} | "
            f"{_number(row.allowed)} | {_number(row.drift)} | {row.status} | {_yes(row.claimed)} | "
            f"{_yes(row.passed)} | {row.remark} |"
            for row in result.rows
        ]
        lines.append("")
    return "\n".join([*lines, tables, ""])


def _number(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.1e}"


def _yes(value: bool) -> str:
    return "yes" if value else "no"
