"""What commands share: ``--quiet``, ``--json``, progress, failures in one line, an account of it all."""

from __future__ import annotations

import json
import re
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TypeVar

import click

from fastmech.errors import InputError, one_line, shown_name
from fastmech.interrupts import CrashedTilesError, Interrupt, check, signal_of

if TYPE_CHECKING:
    from fastmech.cli.progress import ProgressBars

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

    Warnings are lines of the same form. ``summary`` is as for `Failure`.
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
            return Failure(f"{_LONG_WORD.sub(_cut, ' '.join(error.format_message().split()))}{see}")
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


#: What options and arguments of commands are: a file that is read, and one to be written.
FILE, NEW_FILE = click.Path(path_type=Path), click.Path(dir_okay=False, path_type=Path)

Command = TypeVar("Command", bound=Callable[..., Any])


def reporting(function: Callable[..., Callable[[], None] | None]) -> Callable[..., None]:
    """Add ``--quiet`` and ``--json`` to a command, whose function is given its `Account` before the rest.

    What it returns shows more on the terminal, once the bars are gone.
    """

    @click.option("--quiet", is_flag=True, help="No progress.")
    @click.option("--json", "as_json", is_flag=True, help="End with a summary in JSON, print nothing else.")
    @wraps(function)
    def command(quiet: bool, as_json: bool, **given: Any) -> None:
        with account(function.__name__, quiet, as_json) as told:
            show = function(told, **given)
        if show is not None and not as_json:
            show()

    return command


def out_option(about: str, default: str | None = None) -> Callable[[Command], Command]:
    """Add ``--out DIR`` to a command."""
    folder = click.Path(file_okay=False, path_type=Path)
    return click.option("--out", metavar="DIR", type=folder, default=default, show_default=True, help=about)


def section_option(about: str) -> Callable[[Command], Command]:
    """Add ``--section NAME`` to a command, which may be given once."""

    def once(context: click.Context, option: click.Parameter, given: tuple[str, ...]) -> str | None:
        if len(given) > 1:
            raise click.UsageError(f"--section is given {len(given)} times; give it once", context)
        return given[0] if given else None

    return click.option("--section", metavar="NAME", multiple=True, callback=once, help=about)


class Account:
    """What a command has done, told line by line or as JSON in the end.

    Attributes:
        bars: where progress is told.
        done: the file that is complete, whatever comes; empty: none yet.
        facts: what the JSON says besides the command, its time, its stages and files.
    """

    def __init__(self, bars: ProgressBars, as_json: bool) -> None:
        self.bars, self.facts, self.done = bars, dict[str, Any](), ""
        self._begun = time.perf_counter()
        self._as_json, self._files = as_json, list[str]()

    @property
    def seconds(self) -> float:
        """Wall time since the command began, loading and compiling included [s]."""
        return time.perf_counter() - self._begun

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

    def summary(self, name: str) -> dict[str, Any]:
        """Everything, for other programs."""
        about = {"command": name, "seconds": round(self.seconds, 3)}
        about |= {"seconds_preparing": round(self.bars.prepared, 3), "stages": self.bars.stages()}
        return about | self.facts | ({"files": self._files} if self._files else {})


@contextmanager
def account(name: str, quiet: bool, as_json: bool) -> Iterator[Account]:
    """Run a command with progress; in the end, also where it ends with a code of its own, comes the JSON.

    Where it fails the JSON is left to who tells the failure.
    """
    from fastmech.cli.progress import ProgressBars

    with ProgressBars(quiet) as bars:
        told = Account(bars, as_json)
        code: click.exceptions.Exit | None = None
        try:
            check()
            yield told
            check()
        except click.exceptions.Exit as end:
            code = end
        except BaseException as error:
            context = click.get_current_context(silent=True)
            if context is not None and as_json:
                context.meta[SUMMARY] |= told.summary(name)
            if isinstance(error, KeyboardInterrupt) and told.done:
                raise Interrupt(f"interrupted; {told.done} is complete", signal_of(error)) from None
            raise
    if as_json:
        ended = 0 if code is None else code.exit_code
        click.echo(json.dumps({**told.summary(name), "exit_code": ended}))
    if code is not None:
        raise code
