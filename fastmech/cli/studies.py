"""The studies of the package: ``fastmech paper``, ``hardcases`` and ``bench``."""

from __future__ import annotations

from pathlib import Path

import click

from fastmech.cli.reporting import Account, out_option, reporting


@click.command(name="paper")
@out_option("Folder for the report.", "results/report")
@reporting
def paper(told: Account, out: Path) -> None:
    """Compute the source paper's tables and figures again.

    Ends with code 1 if a difference from what the paper prints is no proved misprint, or a check fails.
    """
    with told.bars.preparing():
        from fastmech.studies.paper.report import write_paper
    report = write_paper(out, stage=told.bars.stage)
    told.wrote(report.paths[0], "Report: {}")
    told.say(f"{len(report.rows)} printed values compared, {len(report.misprints)} misprints proved")
    told.facts |= {"compared": len(report.rows), "misprints": len(report.misprints)}
    told.facts |= {"as_expected": report.as_expected}
    if not report.as_expected:
        told.say("fastmech: some differences or checks are not as expected; see the report", err=True)
        raise click.exceptions.Exit(1)


@click.command(name="hardcases")
@out_option("Folder for the report.", "results/hardcases")
@click.option("--quick", is_flag=True, help="Shorter runs and fewer methods.")
@reporting
def hardcases(told: Account, out: Path, quick: bool) -> None:
    """Run the gallery of hard cases and write table, result file and pictures.

    Ends with code 1 if a case fails.
    """
    with told.bars.preparing():
        from fastmech.studies.hardcases.report import write_hardcases
    report = write_hardcases(out, quick=quick, stage=told.bars.stage)
    for path in report.paths:
        told.wrote(path)
    told.say(report.verdict)
    told.facts |= {"verdict": report.verdict, "passed": report.passed}
    if not report.passed:
        raise click.exceptions.Exit(1)


#: Studies by name, see :data:`fastmech.studies.bench.report.STUDIES`.
STUDIES = (
    "atlas", "attractors", "basins", "stiff", "systems", "threads", "tolerances", "vectors",
)  # fmt: skip


@click.command(name="bench")
@out_option("Folder for the report.", "results/bench")
@click.option("--quick", is_flag=True, help="Fewer trajectories and methods.")
@click.option("--only", type=click.Choice(STUDIES), help="One study alone.")
@click.option(
    "--problem",
    metavar="FILE",
    help="Every method on a problem of your own instead: FILE.py:NAME, a function that returns problem, "
    "starts, t_end (and keywords of fm.work_precision); or the scene of a scan request, REQUEST.toml.",
)
@reporting
def bench(told: Account, out: Path, quick: bool, only: str | None, problem: str | None) -> None:
    """Measure trajectories per second against the error."""
    if problem is not None and (only is not None or quick):
        raise click.UsageError("--problem: goes without --only and --quick")
    with told.bars.preparing():
        from fastmech.studies.bench.own_problem import run_problem
        from fastmech.studies.bench.report import run_bench, run_study
    if problem is not None:
        lines, written = run_problem(problem, out, told.bars.stage)
        told.say("\n".join([*lines, ""]))
    elif only is None:
        written = run_bench(out, quick=quick, stage=told.bars.stage)
    else:
        written = [run_study(only, out, quick=quick, stage=told.bars.stage)]
    for path in written:
        told.wrote(path)
