"""``fastmech status``: how far a scan is."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from fastmech.tiles.look import ScanProgress


@click.command(name="status")
@click.argument("file", metavar="FILE.h5", type=click.Path(path_type=Path))
@click.option(
    "--snapshot",
    metavar="OTHER.h5",
    type=click.Path(path_type=Path),
    help="Write what there is so far as a result file of its own.",
)
def command(file: Path, snapshot: Path | None) -> None:
    """Show how far a running or interrupted scan is.

    FILE.h5 is the result file to be, as given to fastmech run.
    """
    from fastmech.tiles.look import ScanLook

    look = ScanLook(file)
    _show(file, look.progress())
    if snapshot is not None:
        look.write_snapshot(snapshot)
        click.echo(f"Results so far: {snapshot}")


def _show(file: Path, progress: ScanProgress) -> None:
    if progress.complete:
        click.echo(f"{file}: complete")
        return
    for section in progress.sections:
        items = f", {section.items_done:,} of {section.items:,} {section.what}" if section.tiles > 1 else ""
        click.echo(f"{section.done:6,} of {section.tiles:,} tiles  {section.name}{items}")
    done = sum(section.done for section in progress.sections)
    tiles = sum(section.tiles for section in progress.sections)
    click.echo(f"{done:6,} of {tiles:,} tiles  in all")
    if progress.worker is None:
        click.echo(f"{file}: nobody works on it; fastmech run goes on where it was")
        return
    rate = ""
    if progress.running and progress.since:
        rate = f", {progress.since / progress.running:.3g} tiles/s"
    left = "" if progress.left is None else f", about {timedelta(seconds=int(progress.left))} left"
    since = "" if progress.running is None else f" for {timedelta(seconds=int(progress.running))}"
    click.echo(f"{file}: {progress.worker} works on it{since}{rate}{left}")
