"""``fastmech hardcases``: the gallery of hard cases, method by method."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="hardcases")
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path("results/hardcases"),
    show_default=True,
    help="Folder for the report.",
)
@click.option("--quick", is_flag=True, help="Shorter runs and fewer methods.")
def command(out: Path, quick: bool) -> None:
    """Run the gallery of hard cases and write table, result file and pictures.

    Ends with code 1 if a case fails.
    """
    from fastmech.cli.progress import ProgressBars

    with ProgressBars() as bars:
        with bars.preparing():
            from fastmech.hardcases.report import write_hardcases
        report = write_hardcases(out, quick=quick, stage=bars.stage)
    for path in report.paths:
        click.echo(path)
    click.echo(report.verdict)
    if not report.passed:
        raise click.exceptions.Exit(1)
