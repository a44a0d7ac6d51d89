"""``fastmech info``, ``export``, ``plot`` and ``status``: what a result file holds, and how far one is."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from fastmech.cli.reporting import FILE, Account, out_option, reporting, section_option


@click.command(name="info")
@click.argument("file", metavar="[FILE]", required=False, type=FILE)
@section_option("Only this section, or a group in it: SECTION/GROUP.")
@click.option("--request", is_flag=True, help="Print the request that FILE was made from, as TOML.")
@click.option("--system", is_flag=True, help="Show what fastmech runs on here: processor, vectors, caches.")
def info(file: Path | None, section: str | None, request: bool, system: bool) -> None:
    """Show what a result file holds, or this system.

    With --section the values and meanings of its variables.
    """
    if (file is None) != system:
        raise click.UsageError("FILE: give a result file, or --system")
    if (section is not None) + request + system > 1:
        raise click.UsageError("--section, --request and --system exclude each other")
    if file is None:
        from fastmech.system_info import system_info

        click.echo(system_info())
        return
    from rich.console import Console

    from fastmech.errors import printable
    from fastmech.store.read import open_results
    from fastmech.store.summary import summarize

    console = Console(width=None if sys.stdout.isatty() else 100)
    with open_results(file) as results:
        if request:
            click.echo(printable(results.request, kept="\n\t"), nl=False)
        else:
            console.print(summarize(results, section))


@click.command(name="export")
@click.argument("file", metavar="FILE.h5", type=FILE)
@click.option("--to", "form", type=click.Choice(["csv", "nc", "npz"]), required=True, help="Format.")
@section_option("Only this section.")
@click.option(
    "--variable", "variables", metavar="NAME", multiple=True, help="Only this variable; repeatable."
)
@click.option(
    "--select",
    "selections",
    metavar="NAME=VALUE|LOW:HIGH",
    multiple=True,
    help="The nearest point along a coordinate, or a range (--select F0=-10:10); repeatable.",
)
@out_option("Folder for the files [default: FILE without its ending].")
@click.option("--fresh", is_flag=True, help="Replace files that exist.")
@reporting
def export(told: Account, file: Path, out: Path | None, fresh: bool, **what: Any) -> None:
    """Write a result file in another format.

    Selected values must lie within their coordinate's range; along a dimension without coordinate they are
    places counted from 0. What was taken is printed.

    csv: one table for each set of dimensions of a section; nc: netCDF-4, one file for each section (needs
    xarray); npz: one file for each section.
    """
    from fastmech.store.export import export_results

    selected: list[str] = []
    folder = out if out is not None else file.with_suffix("")
    told.facts["selected"] = selected

    def tell(line: str) -> None:
        selected.append(line)
        told.say(line)

    how: dict[str, Any] = {"replace": fresh, "stage": told.bars.stage, "tell": tell}
    for path in export_results(file, folder, **what, **how):
        told.wrote(path)


@click.command(name="plot")
@click.argument("file", metavar="FILE", type=FILE)
@out_option("Folder for the pictures [default: FILE without its ending].")
@section_option("Only this section.")
@click.option(
    "--format", "form", type=click.Choice(["png", "pdf", "svg"]), default="png", help="Format [default: png]."
)
@reporting
def plot(told: Account, file: Path, out: Path | None, section: str | None, form: str) -> None:
    """Draw every section of a result file as pictures; a line says of which there are none."""
    from fastmech.store.read import open_results

    with open_results(file) as results:  # before kernels are compiled, which may take a minute
        if section is not None:
            results[section]  # says what there is
    with told.bars.preparing():
        from fastmech.runner import draw_results
    how: dict[str, Any] = {"tell": lambda line: told.say(f"fastmech: {line}", err=True)}
    for picture in draw_results(file, out, stage=told.bars.stage, section=section, form=form, **how):
        told.wrote(picture)


@click.command(name="status")
@click.argument("file", metavar="FILE.h5", type=FILE)
@click.option(
    "--snapshot",
    metavar="OTHER.h5",
    type=FILE,
    help="Write what there is so far as a result file of its own.",
)
@click.option(
    "--mechanism", metavar="FILE.py:NAME", help="What the scan is about, if fastmech run was given it."
)
def status(file: Path, snapshot: Path | None, mechanism: str | None) -> None:
    """Show how far a running or interrupted scan is.

    FILE.h5 is the result file to be, as given to fastmech run. Only a snapshot of a scan with --mechanism
    needs that option here.
    """
    if mechanism is not None and snapshot is None:
        raise click.UsageError("--mechanism needs --snapshot")
    from fastmech.tiles.look import ScanLook

    look = ScanLook(file)
    for line in look.told():
        click.echo(line)
    if snapshot is not None:
        from fastmech.cli.run import mechanism_named

        look.write_snapshot(snapshot, mechanism_named(mechanism) if mechanism is not None else None)
        click.echo(f"Results so far: {snapshot}")
