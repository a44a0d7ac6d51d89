"""The one exception for mistakes that a user can mend, the one warning, and how values are shown in both."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

#: Characters of a value that a message shows.
LONGEST_VALUE = 80

#: What is longer than any file's name.
_TOO_LONG = re.compile(r"[^\s/:]{256,}")


class InputError(ValueError):
    """A user's input cannot be used.

    The message is one line that names the field, the value given and what is allowed, for example
    ``scene.m1 = -3.0: must be > 0 kg``. The command line prints it without a traceback and exits with code 2.
    """

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class StepWarning(UserWarning):
    """A step cannot be right for a scene; the message names one that would do."""


def printable(text: str, kept: str = "") -> str:
    """A text for a terminal: characters that cannot be printed are escaped, but for those kept."""
    return "".join(c if c.isprintable() or c in kept else ascii(c)[1:-1] for c in text)


def shown(value: object) -> str:
    """A value as a message shows it: at most 80 characters of one line, control characters escaped."""
    try:
        text = repr(value[: 2 * LONGEST_VALUE] if isinstance(value, str | bytes) else value)
    except ValueError:  # an integer of more digits than Python writes
        text = f"an integer of {value.bit_length():,} bits" if isinstance(value, int) else "a huge number"
    except RecursionError:
        text = "a value nested too deeply"
    return shown_name(text)


def shown_name(name: object) -> str:
    """The same of a name, such as a table's or a path, which has no quotes."""
    text = printable(" ".join(str(name).split())[: LONGEST_VALUE + 1])
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 3]}..."


def one_line(message: str) -> str:
    """A message on one line that a terminal shows as it is; what can be no file's name is cut as a value."""
    return _TOO_LONG.sub(lambda word: shown_name(word[0]), printable(" ".join(message.splitlines())))


def called_here(**names: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Have a function refuse other libraries' keywords: each with its name here, or some words on it."""

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        @wraps(function)
        def checked(*args: P.args, **kwargs: P.kwargs) -> T:
            for name in kwargs:
                if name in names:
                    told = names[name]
                    raise InputError(f"{name}: {told if ' ' in told else f'is called {told} here'}")
            return function(*args, **kwargs)

        return checked

    return decorate


def necessary(**allowed: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Have a function refuse a call that lacks one of ``allowed``, each with what it must be."""

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        told = signature(function)

        @wraps(function)
        def checked(*args: P.args, **kwargs: P.kwargs) -> T:
            given = told.bind_partial(*args, **kwargs).arguments
            for name in allowed:
                if name not in given:
                    raise InputError(f"{name}: missing; must be {allowed[name]}")
            return function(*args, **kwargs)

        return checked

    return decorate
