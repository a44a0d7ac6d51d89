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
    """Compute the source paper's tables and figures again."""
    from fastmech.cli.progress import ProgressBars

    with ProgressBars() as bars, bars.preparing():
        from fastmech.paper.report import write_paper

    click.echo(f"Report: {write_paper(out)}")
