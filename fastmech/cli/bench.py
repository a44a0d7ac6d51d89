"""``fastmech bench``: speed against error, beside other integrators."""

from __future__ import annotations

from pathlib import Path

import click

from fastmech.cli.reporting import account, reporting_options


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
@reporting_options
def command(out: Path, quick: bool, quiet: bool, as_json: bool) -> None:
    """Measure trajectories per second against the error."""
    with account("bench", quiet, as_json) as told:
        with told.bars.preparing():
            from fastmech.bench.report import run_bench
        for path in run_bench(out, quick=quick, stage=told.bars.stage):
            told.wrote(path)
