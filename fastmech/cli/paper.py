"""``fastmech paper``: the source paper's tables and figures, printed against computed."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="paper")
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path("results/report"),
    show_default=True,
    help="Folder for the report.",
)
def command(out: Path) -> None:
    """Compute the source paper's tables and figures again.

    Ends with code 1 if a difference from what the paper prints is no proved misprint, or a check fails.
    """
    from fastmech.cli.progress import ProgressBars

    with ProgressBars() as bars:
        with bars.preparing():
            from fastmech.paper.report import write_paper
        report = write_paper(out, progress=bars.counter("tables and figures"))
    click.echo(f"Report: {report.paths[0]}")
    click.echo(f"{report.n_rows} printed values compared, {len(report.misprints)} misprints proved")
    if not report.as_expected:
        click.echo("fastmech: some differences or checks are not as expected; see the report", err=True)
        raise click.exceptions.Exit(1)
