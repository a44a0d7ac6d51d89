"""``fastmech warmup``: compile beforehand what computations need."""

from __future__ import annotations

import click

from fastmech.cli.reporting import Account, Failure, reporting


@click.command(name="warmup")
@click.option(
    "--for",
    "purpose",
    type=click.Choice(["integrate", "atlas", "basins", "all"]),
    default="all",
    show_default=True,
    help="What to compile.",
)
@reporting
def warmup(told: Account, purpose: str) -> None:
    """Compile beforehand what computations need, on all cores, and keep it on disk."""
    with told.bars.preparing():
        from fastmech.cli.warming import JOBS, PARTS, warm_up
    purposes = tuple(JOBS) if purpose == "all" else (purpose,)
    jobs = [name for each in purposes for name in JOBS[each]]
    try:
        made = warm_up(purposes, told.say, told.bars.stage("warmup", PARTS * len(jobs)))
    except RuntimeError as error:
        raise Failure(str(error), 1) from None
    told.facts |= {"jobs": jobs, "kernels": made}
    told.say(f"{told.seconds:8.1f} s  in all, {made} kernels compiled")
