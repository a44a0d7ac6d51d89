"""``fastmech paper``: the source paper's tables and figures, printed against computed."""

from __future__ import annotations

from pathlib import Path

import click

from fastmech.cli.reporting import account, out_option, reporting_options


@click.command(name="paper")
@out_option("Folder for the report.", "results/report")
@reporting_options
def command(out: Path, quiet: bool, as_json: bool) -> None:
    """Compute the source paper's tables and figures again.

    Ends with code 1 if a difference from what the paper prints is no proved misprint, or a check fails.
    """
    with account("paper", quiet, as_json) as told:
        with told.bars.preparing():
            from fastmech.paper.report import write_paper
        report = write_paper(out, stage=told.bars.stage)
        told.wrote(report.paths[0], "Report: {}")
        told.say(f"{report.n_rows} printed values compared, {len(report.misprints)} misprints proved")
        told.facts |= {"compared": report.n_rows, "misprints": len(report.misprints)}
        told.facts |= {"as_expected": report.as_expected}
        if not report.as_expected:
            told.say("fastmech: some differences or checks are not as expected; see the report", err=True)
            raise click.exceptions.Exit(1)
