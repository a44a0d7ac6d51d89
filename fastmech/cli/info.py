"""``fastmech info``: what a result file holds."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from fastmech.cli.reporting import section_option


@click.command(name="info")
@click.argument("file", metavar="[FILE]", required=False, type=click.Path(path_type=Path))
@section_option("Only this section, or a group in it: SECTION/GROUP.")
@click.option("--request", is_flag=True, help="Print the request that FILE was made from, as TOML.")
@click.option("--system", is_flag=True, help="Show what fastmech runs on here: processor, vectors, caches.")
def command(file: Path | None, section: str | None, request: bool, system: bool) -> None:
    """Show a result file (origin, scene, variables), or this system."""
    from rich.console import Console

    if (file is None) != system:
        raise click.UsageError("FILE: give a result file, or --system")
    if (section is not None) + request + system > 1:
        raise click.UsageError("--section, --request and --system exclude each other")
    console = Console(width=None if sys.stdout.isatty() else 100)
    if file is None:
        from rich.table import Table

        from fastmech.system_info import system_info

        table = Table("", "", show_header=False, box=None)
        for name, value in system_info().items():
            table.add_row(f"[bold]{name}[/]", value)
        console.print(table)
        return
    from fastmech.errors import printable
    from fastmech.store.read import open_results
    from fastmech.store.summary import summarize

    with open_results(file) as results:
        if request:
            click.echo(printable(results.request, kept="\n\t"), nl=False)
        else:
            console.print(summarize(results, section))
