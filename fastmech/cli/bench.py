"""``fastmech bench``: speed against error, beside other integrators."""

from __future__ import annotations

from pathlib import Path

import click

from fastmech.cli.reporting import account, out_option, reporting_options


@click.command(name="bench")
@out_option("Folder for the report.", "results/bench")
@click.option("--quick", is_flag=True, help="Fewer trajectories and methods.")
@click.option(
    "--only",
    type=click.Choice(["atlas", "basins", "proofs", "stiff", "systems", "threads", "tolerances", "vectors"]),
    help="One study alone.",
)
@click.option(
    "--problem",
    metavar="FILE",
    help="Every method on a problem of your own instead: FILE.py:NAME, a function that returns problem, "
    "starts, t_end (and keywords of fm.work_precision); or the scene of a scan request, REQUEST.toml.",
)
@click.option(
    "--scenes",
    metavar="N",
    type=click.IntRange(min=1),
    help="Random scenes of `tolerances`, mechanisms of `proofs`.",
)
@click.option(
    "--starts", metavar="N", type=click.IntRange(min=1), help="Trajectories of each scene of `tolerances`."
)
@reporting_options
def command(
    out: Path,
    quick: bool,
    only: str | None,
    problem: str | None,
    scenes: int | None,
    starts: int | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Measure trajectories per second against the error."""
    chosen = {name: value for name, value in (("scenes", scenes), ("starts", starts)) if value is not None}
    for name in chosen:
        if only != "tolerances" and (name, only) != ("scenes", "proofs"):
            raise click.UsageError(f"--{name}: goes with --only tolerances")
    if problem is not None and (only is not None or quick):
        raise click.UsageError("--problem: goes without --only and --quick")
    with account("bench", quiet, as_json) as told:
        with told.bars.preparing():
            from fastmech.bench.own_problem import run_problem
            from fastmech.bench.report import run_bench, run_study
        if problem is not None:
            lines, written = run_problem(problem, out, told.bars.stage)
            told.say("\n".join([*lines, ""]))
        elif only is None:
            written = run_bench(out, quick=quick, stage=told.bars.stage)
        else:
            written = [run_study(only, out, quick=quick, stage=told.bars.stage, **chosen)]
        for path in written:
            told.wrote(path)
