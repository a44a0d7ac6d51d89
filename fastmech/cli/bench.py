"""``fastmech bench``: speed against error, beside other integrators."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="bench")
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path("results/bench"),
    show_default=True,
    help="Folder for the report.",
)
@click.option("--quick", is_flag=True, help="Fewer trajectories and methods.")
def command(out: Path, quick: bool) -> None:
    """Measure trajectories per second against the error."""
    from fastmech.cli.progress import ProgressBars

    with ProgressBars() as bars:
        with bars.preparing():
            from fastmech.bench.report import run_bench
        written = run_bench(out, quick=quick, stage=bars.stage)
    for path in written:
        click.echo(path)
