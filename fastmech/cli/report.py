"""``fastmech report``: what is handed over about a device."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from fastmech.cli.reporting import FILE, Account, reporting
from fastmech.errors import InputError


@click.command(name="report")
@click.argument("device", metavar="DEVICE")
@click.option(
    "--out",
    metavar="FILE.html",
    type=FILE,
    help="The page; the PDF lies beside it [default: results/NAME_report.html].",
)
@click.option(
    "--mechanism", "own", metavar="FILE.py:NAME", help="A mechanism of your own, for the file's values."
)
@reporting
def report(told: Account, device: str, out: Path | None, own: str | None) -> None:
    """Write what you hand over about a device: one HTML page and a PDF.

    DEVICE is a request or another TOML file with a table [scene] (and mechanism = "NAME"), the name of a
    shipped mechanism, or FILE.py:NAME. Where the table says c1 = { value = 900.0, plus_minus = 20.0 }, the
    report says how each answer varies.
    """
    with told.bars.preparing():
        from fastmech.cli.run import mechanism_named
        from fastmech.device_report import report as write_report
        from fastmech.scan_types.request import device_of, title_of, tolerances_of
        from fastmech.scene import read_toml
    system: Any
    table: dict[str, Any] = {}
    if ":" in device:
        system, tolerances = mechanism_named(device), {}
    else:
        table = read_toml(device) if device.endswith(".toml") else {"mechanism": device}
        system = device_of(table, mechanism_named(own) if own else None)
        if own is None and not table.keys() & {"mechanism", "scene", "scan"}:
            raise InputError(f'{device}: has no device; write a table [scene] or mechanism = "NAME"')
        tolerances = tolerances_of(table)
    name = device.rpartition(":")[2].removesuffix(".toml")
    target = out or Path("results") / f"{Path(name).name}_report.html"
    how: dict[str, Any] = {"tolerances": tolerances, "title": title_of(table)}
    for path in write_report(system, target, **how, stage=told.bars.stage):
        told.wrote(path, "Report: {}")
