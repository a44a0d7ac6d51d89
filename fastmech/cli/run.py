"""``fastmech run``: from a request to a result file."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="run")
@click.argument("request_file", metavar="SCAN.toml", type=click.Path(path_type=Path))
@click.option(
    "--out",
    metavar="FILE.h5",
    type=click.Path(path_type=Path),
    help="Result file [default: results/SCAN.h5].",
)
@click.option("--fresh", is_flag=True, help="Replace the result file if it exists.")
@click.option("--threads", metavar="N", type=click.IntRange(min=1), help="Threads to use [default: all].")
@click.option("--quiet", is_flag=True, help="No progress bars.")
def command(request_file: Path, out: Path | None, fresh: bool, threads: int | None, quiet: bool) -> None:
    """Run every scan of a request, write one HDF5 file."""
    from fastmech.cli.progress import ProgressBars
    from fastmech.errors import InputError

    with ProgressBars(quiet) as bars:
        with bars.preparing():
            from fastmech.runner import default_output, run_request
            from fastmech.scan_types.request import RunContext
        target = out or default_output(request_file)
        if target.is_file() and not fresh:
            raise InputError(f"{target}: exists already; --fresh replaces it, --out names another file")
        run_request(request_file, target, fresh=fresh, context=RunContext(threads, bars.stage))
    _report(target)


def _report(target: Path) -> None:
    from fastmech.store.read import open_results

    with open_results(target) as results:
        for name in results:
            click.echo(f"{results[name].attrs['wall_time_s']:9.2f} s  {name}")
            failed = results[name].attrs.get("failed", 0)
            if failed:
                click.echo(f"{name}: {failed} trajectories failed; use a smaller dt", err=True)
        click.echo(f"{results.attrs['wall_time_s']:9.2f} s  in all")
    click.echo(f"Results: {target}")
    click.echo(f"Next:    fastmech info {target}")
    click.echo(f"         fastmech plot {target}")
