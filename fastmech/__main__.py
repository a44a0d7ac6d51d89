"""``python -m fastmech`` is the command ``fastmech``."""

from __future__ import annotations

from fastmech.cli import main

main(prog_name="fastmech")
