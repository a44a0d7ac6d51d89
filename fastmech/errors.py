"""The one exception for mistakes that a user can mend, the one warning, and how values are shown in both."""

from __future__ import annotations

#: Characters of a value that a message shows.
LONGEST_VALUE = 80


class InputError(ValueError):
    """A user's input cannot be used.

    The message is one line that names the field, the value given and what is allowed, for example
    ``scene.m1 = -3.0: must be > 0 kg``. The command line prints it without a traceback and exits with code 2.
    """


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
    text = " ".join(text.split())
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 3]}..."
