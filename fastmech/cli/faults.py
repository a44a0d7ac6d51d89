"""``fastmech faults``: long scans killed, on full disks, with dying workers; files damaged."""

from __future__ import annotations

import click

from fastmech.cli.reporting import account, reporting_options


@click.command(name="faults")
@click.option("--kills", metavar="N", type=click.IntRange(min=0), default=200, show_default=True)
@click.option("--disks", metavar="N", type=click.IntRange(min=0), default=20, show_default=True)
@click.option("--workers", metavar="N", type=click.IntRange(min=0), default=5, show_default=True)
@click.option("--mutations", metavar="N", type=click.IntRange(min=0), default=100_000, show_default=True)
@click.option(
    "--overhead",
    metavar="SECONDS",
    type=click.IntRange(min=0),
    default=0,
    help="Also measure what durability and Dask cost, in scans of so many seconds.",
)
@click.option("--seed", metavar="N", type=click.IntRange(min=0), default=0, show_default=True)
@reporting_options
def command(
    kills: int,
    disks: int,
    workers: int,
    mutations: int,
    overhead: int,
    seed: int,
    quiet: bool,
    as_json: bool,
) -> None:
    """Put runs and files to the test.

    Kills runs by SIGKILL at random moments and resumes them, runs on disks that fill up (needs the right to
    mount), kills Dask workers, and reads files with flipped, lost and added bytes. Ends with code 1 if a
    result is not the undisturbed one, or a damaged file is not refused in one line.
    """
    from fastmech.faults.processes import FaultFound, Found

    with account("faults", quiet, as_json) as told:
        with told.bars.preparing():
            from fastmech.faults.campaigns import can_mount, disk_campaign, kill_campaign, worker_campaign
            from fastmech.faults.fuzz import fuzz_requests, fuzz_results
            from fastmech.faults.processes import reference

        def show(found: Found) -> None:
            for sentence in found.sentences:
                told.say(sentence)
            told.facts.update(found.facts)

        try:
            if kills or disks or workers:
                expected = reference()
            if disks and not can_mount():
                told.say("no right to mount small disks: full disks are left out")
                disks = 0
            interruptions = (
                ("kills", kills, kill_campaign),
                ("full disks", disks, disk_campaign),
                ("workers", workers, worker_campaign),
            )
            for name, count, campaign in interruptions:
                if count:
                    show(campaign(count, expected, seed, told.bars.stage(name, count)))
            if mutations:
                for what, fuzz in (("requests", fuzz_requests), ("result files", fuzz_results)):
                    show(fuzz(mutations // 2, seed, told.bars.stage(what, mutations // 2)))
            if overhead:
                from fastmech.faults.overhead import REPEATS, overheads

                for ratio in overheads(overhead, told.bars.stage("scans both ways", 4 * REPEATS)):
                    show(Found((str(ratio),), {ratio.what: [ratio.value, ratio.error]}))
        except FaultFound as fault:
            told.say(f"fastmech: fault found: {fault}", err=True)
            raise click.exceptions.Exit(1) from None
