"""How the command line fails: one line on standard error, an exit code, no traceback."""

from __future__ import annotations

import signal
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any

import click

from fastmech.errors import InputError
from fastmech.tiles.ends import CrashedTilesError, Stopped


class Failure(click.ClickException):
    """Ends the command with ``fastmech: message`` on standard error."""

    exit_code = 2

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.splitlines()))

    def show(self, file: IO[Any] | None = None) -> None:
        """Write the line."""
        click.echo(f"fastmech: {self.message}", file=file, err=True)


class Interrupted(Failure):
    """The user has stopped the command."""

    exit_code = 130


class Terminated(Failure):
    """SIGTERM has stopped the command."""

    exit_code = 143


class Crashed(Failure):
    """Parts of a scan have failed; the others are kept."""

    exit_code = 1


@contextmanager
def one_line() -> Iterator[None]:
    """Turn what a user causes (a wrong command line, wrong input, an interruption) into a `Failure`.

    Warnings are lines of the same form.
    """
    shown, warnings.showwarning = warnings.showwarning, _show_warning
    try:
        yield
    except click.UsageError as error:
        see = f" See: {error.ctx.command_path} --help" if error.ctx else ""
        raise Failure(f"{error.format_message()}{see}") from None
    except InputError as error:
        raise Failure(str(error)) from None
    except MemoryError as error:
        raise Failure(f"more memory is needed than there is: {error}") from None
    except CrashedTilesError as error:
        raise Crashed(str(error)) from None
    except Stopped as stopped:
        kind = Terminated if stopped.signal_number == signal.SIGTERM else Interrupted
        raise kind(str(stopped)) from None
    except KeyboardInterrupt:
        raise Interrupted("interrupted") from None
    finally:
        warnings.showwarning = shown


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    click.echo(f"fastmech: {message}", err=True)
