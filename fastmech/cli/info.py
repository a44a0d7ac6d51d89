"""``fastmech info``: what a result file holds."""

from __future__ import annotations

import sys
from pathlib import Path

import click


@click.command(name="info")
@click.argument("file", metavar="FILE", type=click.Path(path_type=Path))
def command(file: Path) -> None:
    """Show a result file: origin, scene, variables."""
    from rich.console import Console

    from fastmech.store.read import open_results
    from fastmech.store.summary import summarize

    with open_results(file) as results:
        Console(width=None if sys.stdout.isatty() else 100).print(summarize(results))
