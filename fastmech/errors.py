"""The one exception for mistakes that a user can mend, and the one warning."""

from __future__ import annotations


class InputError(ValueError):
    """A user's input cannot be used.

    The message is one line that names the field, the value given and what is allowed, for example
    ``scene.m1 = -3.0: must be > 0 kg``. The command line prints it without a traceback and exits with code 2.
    """


class StepWarning(UserWarning):
    """A step cannot be right for a scene; the message names one that would do."""
