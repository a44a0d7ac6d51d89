"""``fastmech hardcases``: the gallery of hard cases, method by method."""

from __future__ import annotations

from pathlib import Path

import click

from fastmech.cli.reporting import account, out_option, reporting_options


@click.command(name="hardcases")
@out_option("Folder for the report.", "results/hardcases")
@click.option("--quick", is_flag=True, help="Shorter runs and fewer methods.")
@reporting_options
def command(out: Path, quick: bool, quiet: bool, as_json: bool) -> None:
    """Run the gallery of hard cases and write table, result file and pictures.

    Ends with code 1 if a case fails.
    """
    with account("hardcases", quiet, as_json) as told:
        with told.bars.preparing():
            from fastmech.hardcases.report import write_hardcases
        report = write_hardcases(out, quick=quick, stage=told.bars.stage)
        for path in report.paths:
            told.wrote(path)
        told.say(report.verdict)
        told.facts |= {"verdict": report.verdict, "passed": report.passed}
        if not report.passed:
            raise click.exceptions.Exit(1)
