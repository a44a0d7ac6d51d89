"""``python -m fastmech`` is the command ``fastmech``."""

from __future__ import annotations

from fastmech.interrupts import listen

listen()

from fastmech.cli import main  # noqa: E402 - a signal may come while it is loaded

main(prog_name="fastmech")
