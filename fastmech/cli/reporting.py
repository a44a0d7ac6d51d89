"""What every long command shares: ``--quiet``, ``--json``, progress, and an account of what it has done."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from fastmech.cli.progress import ProgressBars

Command = TypeVar("Command", bound=Callable[..., Any])


def reporting_options(function: Command) -> Command:
    """Add ``--quiet`` and ``--json`` to a command, as the arguments ``quiet`` and ``as_json``."""
    for option in (
        click.option(
            "--json", "as_json", is_flag=True, help="End with a summary in JSON, print nothing else."
        ),
        click.option("--quiet", is_flag=True, help="No progress."),
    ):
        function = option(function)
    return function


class Account:
    """What a command has done, told line by line or as JSON in the end.

    Attributes:
        bars: where progress is told.
        facts: what the JSON says besides the command, its time, its stages and files.
    """

    def __init__(self, bars: ProgressBars, as_json: bool) -> None:
        self.bars, self.facts = bars, dict[str, Any]()
        self._as_json, self._files = as_json, list[str]()

    def say(self, line: object = "", err: bool = False) -> None:
        """A line for the user; with ``--json`` only what goes to standard error is shown."""
        if self._as_json and not err:
            return
        if self.bars.shown and (err or sys.stdout.isatty()):
            self.bars.above(str(line))  # the same terminal: an ordinary line would run into the bars
        else:
            click.echo(line, err=err)

    def wrote(self, path: Path, line: str = "{}") -> None:
        """A file was written."""
        self._files.append(str(path))
        self.say(line.format(path))

    def summary(self, name: str, seconds: float) -> dict[str, Any]:
        """Everything, for other programs."""
        about = {"command": name, "seconds": round(seconds, 3), "stages": self.bars.stages(), **self.facts}
        return about | ({"files": self._files} if self._files else {})


@contextmanager
def account(name: str, quiet: bool, as_json: bool) -> Iterator[Account]:
    """Run a command with progress; in the end, also where it ends with a code of its own, comes the JSON."""
    from fastmech.cli.progress import ProgressBars

    started = time.perf_counter()
    with ProgressBars(quiet) as bars:
        told = Account(bars, as_json)
        code: click.exceptions.Exit | None = None
        try:
            yield told
        except click.exceptions.Exit as end:
            code = end
    if as_json:
        click.echo(json.dumps(told.summary(name, time.perf_counter() - started)))
    if code is not None:
        raise code
