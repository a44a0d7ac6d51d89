"""Commands that write a report, on a device, or by the studies of the package."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from fastmech.cli.reporting import FILE, Account, out_option, reporting
from fastmech.errors import InputError


@click.command(name="report")
@click.argument("device", metavar="DEVICE")
@click.option(
    "--out",
    metavar="FILE.html",
    type=FILE,
    help="The page; the PDF lies beside it [default: results/NAME_report.html].",
)
@click.option(
    "--mechanism", "own", metavar="FILE.py:NAME", help="A mechanism of your own, for the file's values."
)
@reporting
def report(told: Account, device: str, out: Path | None, own: str | None) -> None:
    """Write what you hand over about a device: one HTML page and a PDF.

    DEVICE is a request or another TOML file with a table [scene] (and mechanism = "NAME"), the name of a
    shipped mechanism, or FILE.py:NAME. Where the table says c1 = { value = 900.0, plus_minus = 20.0 }, the
    report says how each answer varies.
    """
    with told.bars.preparing():
        from fastmech.cli.run import mechanism_named
        from fastmech.device_report import report as write_report
        from fastmech.scan_types.request import device_of, title_of, tolerances_of
        from fastmech.scene import read_toml
    system: Any
    table: dict[str, Any] = {}
    if ":" in device:
        system, tolerances = mechanism_named(device), {}
    else:
        table = read_toml(device) if device.endswith(".toml") else {"mechanism": device}
        system = device_of(table, mechanism_named(own) if own else None)
        if own is None and not table.keys() & {"mechanism", "scene", "scan"}:
            raise InputError(f'{device}: has no device; write a table [scene] or mechanism = "NAME"')
        tolerances = tolerances_of(table)
    name = device.rpartition(":")[2].removesuffix(".toml")
    target = out or Path("results") / f"{Path(name).name}_report.html"
    how: dict[str, Any] = {"tolerances": tolerances, "title": title_of(table)}
    for path in write_report(system, target, **how, stage=told.bars.stage):
        told.wrote(path, "Report: {}")


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
