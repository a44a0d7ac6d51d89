"""How the command line fails: one line on standard error, an exit code, no traceback; JSON if asked for."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any

import click

from fastmech.errors import InputError, one_line, shown_name
from fastmech.interrupts import signal_of
from fastmech.tiles.ends import CrashedTilesError

#: Added to the number of a signal that ends a command, as shells do: 130 for Ctrl-C, 143 for SIGTERM.
BY_SIGNAL = 128

#: What is too long in a message of click's: a value in quotes, or a word.
_LONG_WORD = re.compile(r"(?<!\w)(?P<quote>['\"])(?P<value>.{81,}?)(?P=quote)|\S{81,}")

#: Where in a context's ``meta`` a command leaves what it has done when it fails.
SUMMARY = "fastmech.summary"


class Failure(click.ClickException):
    """Ends the command with ``fastmech: message`` on standard error.

    Attributes:
        summary: what the JSON on standard output says besides; None: no JSON is asked for.
    """

    def __init__(self, message: str, exit_code: int = 2) -> None:
        super().__init__(one_line(message))
        self.exit_code = exit_code  # type: ignore[misc] # click has one for each class of failures
        self.summary: dict[str, Any] | None = None

    def show(self, file: IO[Any] | None = None) -> None:
        """Write the line, and the JSON."""
        click.echo(f"fastmech: {self.message}", file=file, err=True)
        if self.summary is not None:
            told = {**self.summary, "error": self.message, "exit_code": self.exit_code}
            click.echo(json.dumps(told))


def _cut(word: re.Match[str]) -> str:
    """What click quotes of the command line, as short as other values."""
    quote = word["quote"]
    return shown_name(word[0]) if quote is None else f"{quote}{shown_name(word['value'])}{quote}"


@contextmanager
def told_in_one_line(summary: dict[str, Any] | None) -> Iterator[None]:
    """Turn what a user causes (a wrong command line, wrong input, an interruption) into a `Failure`.

    Warnings are lines of the same form.

    Args:
        summary: what is known to say in JSON; None: no JSON is asked for.
    """
    shown, warnings.showwarning = warnings.showwarning, _show_warning
    try:
        yield
    except (Exception, KeyboardInterrupt) as error:
        failure = _failure(error)
        if failure is None:
            raise
        failure.summary = summary
        raise failure from None
    finally:
        warnings.showwarning = shown


def _failure(error: BaseException) -> Failure | None:
    """The same for a user; None where the program is wrong, not the user."""
    match error:
        case Failure():
            return error
        case click.UsageError():
            see = f" See: {error.ctx.command_path} --help" if error.ctx else ""
            return Failure(f"{_LONG_WORD.sub(_cut, error.format_message())}{see}")
        case InputError():
            return Failure(str(error))
        case MemoryError():
            return Failure(f"more memory is needed than there is: {error}")
        case CrashedTilesError():
            return Failure(str(error), 1)
        case KeyboardInterrupt():
            return Failure(str(error) or "interrupted", BY_SIGNAL + signal_of(error))
    return None


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    click.echo(f"fastmech: {message}", err=True)
