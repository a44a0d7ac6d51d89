"""``fastmech run``: from a request to a result file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from fastmech.scan_types.request import RunContext
    from fastmech.tiles.report import RunReport
    from fastmech.tiles.work import Hiring


@click.command(name="run")
@click.argument("request_file", metavar="SCAN.toml", type=click.Path(path_type=Path))
@click.option(
    "--out",
    metavar="FILE.h5",
    type=click.Path(path_type=Path),
    help="Result file [default: results/SCAN.h5].",
)
@click.option("--fresh", is_flag=True, help="Start anew; replace the result file if it exists.")
@click.option("--threads", metavar="N", type=click.IntRange(min=1), help="Threads to use [default: all].")
@click.option("--workers", metavar="N", type=click.IntRange(min=1), help="Compute in N processes (Dask).")
@click.option("--scheduler", metavar="ADDRESS", help="Compute on a Dask cluster: tcp://HOST:8786.")
@click.option("--tile", metavar="SECTION:INDEX", help="Compute one tile alone.")
@click.option("--keep", metavar="FILE.h5", type=click.Path(path_type=Path), help="Keep that tile here.")
@click.option("--quiet", is_flag=True, help="No progress.")
@click.option("--json", "as_json", is_flag=True, help="End with a summary in JSON.")
def command(
    request_file: Path,
    out: Path | None,
    fresh: bool,
    threads: int | None,
    workers: int | None,
    scheduler: str | None,
    tile: str | None,
    keep: Path | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Run every scan of a request, write one HDF5 file.

    Finished work is kept: after an interruption the same command goes on.
    """
    from fastmech.cli.progress import ProgressBars
    from fastmech.tiles.ends import terminable

    if keep is not None and tile is None:
        raise click.UsageError("--keep needs --tile")
    if workers is not None and scheduler is not None:
        raise click.UsageError("--workers and --scheduler exclude each other")
    with terminable(), ProgressBars(quiet) as bars:
        with bars.preparing():
            from fastmech.runner import default_output, run_request
            from fastmech.scan_types.request import RunContext
        context = RunContext(threads, bars.stage)
        target = out or default_output(request_file)
        if tile is not None:
            _run_tile(request_file, tile, target, keep, context)
            return
        with _hiring(workers, scheduler) as hire:
            report = run_request(
                request_file, target, fresh=fresh, context=context, hire=hire, tell=bars.tell
            )
    if as_json:
        click.echo(json.dumps(report.summary()))
    else:
        _show(report)


@contextmanager
def _hiring(workers: int | None, scheduler: str | None) -> Iterator[Hiring | None]:
    """The cluster that computes, where one is asked for."""
    if workers is None and scheduler is None:
        yield None
        return
    from fastmech.tiles.cluster import cluster

    with cluster(workers, scheduler) as hire:
        yield hire


def _run_tile(request_file: Path, tile: str, target: Path, keep: Path | None, context: RunContext) -> None:
    from fastmech.tiles.alone import compute_alone

    alone = compute_alone(request_file, tile, context, target)
    click.echo(f"{alone.seconds:9.2f} s  {tile}: {alone.items:,} {alone.what}")
    click.echo(f"Content: {alone.content}")
    if alone.same is not None:
        click.echo("The tile kept beside the result is " + ("the same." if alone.same else "ANOTHER ONE."))
    if keep is not None:
        alone.write(keep)
        click.echo(f"Results: {keep}")


def _show(report: RunReport) -> None:
    from fastmech.store.read import open_results

    target = report.path
    with open_results(target) as results:
        for name in results:
            if not report.was_complete:
                click.echo(f"{results[name].attrs['wall_time_s']:9.2f} s  {name}")
            failures = results[name].attrs.get("failures")
            if failures:
                click.echo(f"fastmech: {name}: {failures}", err=True)
    if report.was_complete:
        click.echo(f"{target} holds this result already; --fresh computes it again")
    else:
        click.echo(f"{report.seconds:9.2f} s  in all")
    click.echo(f"Results: {target}")
    click.echo(f"Next:    fastmech info {target}")
    click.echo(f"         fastmech plot {target}")
