"""stub"""

from __future__ import annotations

import click


@click.command(name="x")
def command() -> None:
    """Stub."""
