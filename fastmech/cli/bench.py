"""``fastmech bench``: speed against error, beside other integrators."""

from __future__ import annotations

from pathlib import Path

import click

from fastmech.cli.reporting import account, reporting_options


@click.command(name="bench")
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("results/bench"),
    show_default=True,
    help="Folder for the report.",
)
@click.option("--quick", is_flag=True, help="Fewer trajectories and methods.")
@click.option(
    "--only",
    type=click.Choice(["atlas", "basins", "stiff", "tolerances", "vectors"]),
    help="One study alone.",
)
@click.option("--scenes", metavar="N", type=click.IntRange(min=1), help="Random scenes of `tolerances`.")
@reporting_options
def command(out: Path, quick: bool, only: str | None, scenes: int | None, quiet: bool, as_json: bool) -> None:
    """Measure trajectories per second against the error."""
    if scenes is not None and only != "tolerances":
        raise click.UsageError("--scenes: goes with --only tolerances")
    with account("bench", quiet, as_json) as told:
        with told.bars.preparing():
            from fastmech.bench.report import STUDIES, run_bench
        if only is None:
            written = run_bench(out, quick=quick, stage=told.bars.stage)
        else:
            chosen = {} if scenes is None else {"scenes": scenes}
            written = STUDIES[only](out, quick=quick, stage=told.bars.stage, **chosen)
        for path in written:
            told.wrote(path)
