"""The command ``fastmech``: modules of a few commands each, loaded when one is asked for.

To add a command, write a click command in a module here, under its own name, and name both in ``COMMANDS``.
Imports at module level must stay as light as click: numerical libraries are imported inside of the command,
so that ``fastmech --help`` answers at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import click

from fastmech import __version__
from fastmech.cli.reporting import SUMMARY, Failure, told_in_one_line
from fastmech.errors import shown
from fastmech.interrupts import listen

#: Every command, and the module that has it.
COMMANDS = {
    "run": "run",
    "status": "results",
    "info": "results",
    "export": "results",
    "plot": "results",
    "explore": "explore",
    "equilibria": "equilibria",
    "paper": "studies",
    "report": "studies",
    "hardcases": "studies",
    "bench": "studies",
    "warmup": "warmup",
}


class _Commands(click.Group):
    """Loads commands when they are needed and tells every user error in one line."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = getattr(import_module(f"{__name__}.{COMMANDS[cmd_name]}"), cmd_name)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            raise Failure(f"{shown(name)}: unknown command; {_hint(name)}")
        return super().resolve_command(ctx, args)

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: object
    ) -> click.Context:
        summary = {"command": next(iter(args), None)} if "--json" in args else None
        with told_in_one_line(summary):
            context = super().make_context(info_name, args, parent, **extra)
        context.meta[SUMMARY] = summary
        return context

    def invoke(self, ctx: click.Context) -> object:
        with told_in_one_line(ctx.meta[SUMMARY]):
            return super().invoke(ctx)

    def main(self, args: Sequence[str] | None = None, *others: Any, **extra: Any) -> Any:
        """Run the command; signals are listened to only where it has the process to itself."""
        if args is None:
            listen()
        return super().main(args, *others, **extra)


def _hint(name: str) -> str:
    from difflib import get_close_matches

    close = get_close_matches(name, COMMANDS, n=1)
    return f"did you mean {close[0]!r}?" if close else f"commands: {', '.join(COMMANDS)}"


@click.group(cls=_Commands, invoke_without_command=True)
@click.version_option(__version__, message="fastmech %(version)s")
@click.pass_context
def main(ctx: click.Context) -> None:
    """Where a mechanism can rest, whether it stays there, and what shock it survives.

    Start with: fastmech run scans/paper.toml
    """
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())
