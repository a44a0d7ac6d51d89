"""``fastmech plot``: a result file as pictures."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="plot")
@click.argument("file", metavar="FILE", type=click.Path(path_type=Path))
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="Folder for the pictures [default: FILE without its ending].",
)
def command(file: Path, out: Path | None) -> None:
    """Draw every section of a result file as PNG pictures."""
    from fastmech.cli.progress import ProgressBars

    with ProgressBars() as bars, bars.preparing():
        from fastmech.runner import draw_results

    for picture in draw_results(file, out):
        click.echo(picture)
