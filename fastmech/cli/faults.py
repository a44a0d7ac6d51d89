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
    from fastmech.faults.processes import FaultFound

    with account("faults", quiet, as_json) as told:
        with told.bars.preparing():
            from fastmech.faults.disk import can_mount, disk_campaign
            from fastmech.faults.fuzz import fuzz_requests, fuzz_results
            from fastmech.faults.kill import kill_campaign
            from fastmech.faults.processes import reference
            from fastmech.faults.worker import worker_campaign

        try:
            if kills or disks or workers:
                expected = reference()
            if kills:
                killed = kill_campaign(kills, expected, seed, told.bars.stage("kills", kills))
                told.say(f"{killed.kills} runs killed, {killed.finished} scans resumed to the same result")
                told.facts["killed"] = {"runs": killed.kills, "tiles_again": killed.again, **killed.stages}
                told.say(f"  {killed.again} tiles computed again; killed while " + _counts(killed.stages))
            if disks and not can_mount():
                told.say("no right to mount small disks: full disks are left out")
            elif disks:
                full = disk_campaign(disks, expected, seed, told.bars.stage("full disks", disks))
                told.say(f"{full.full} full disks told, the scans resumed to the same result")
                told.facts["full_disks"] = {"runs": full.full, "tiles_again": full.again}
                told.say(f"  {full.again} tiles computed again; {full.fitting} disks were large enough")
            if workers:
                died = worker_campaign(workers, expected, seed, told.bars.stage("workers", workers))
                told.facts["workers_killed"] = died.kills
                told.say(f"{died.kills} Dask workers killed, {died.finished} scans with the same result")
            if mutations:
                for what, fuzz in (("requests", fuzz_requests), ("result files", fuzz_results)):
                    count = fuzz(mutations // 2, seed, told.bars.stage(what, mutations // 2))
                    told.say(f"{count.tried} damaged {what} read: {count.refused} refused, none crashed")
                    told.facts[what] = {"tried": count.tried, "refused": count.refused}
                    told.say(f"  slowest {count.slowest:.2f} s, memory grew by {count.grown / 1e6:.0f} MB")
            if overhead:
                from fastmech.faults.overhead import REPEATS, overheads

                for ratio in overheads(overhead, told.bars.stage("scans both ways", 4 * REPEATS)):
                    told.say(str(ratio))
                    told.facts[ratio.what] = [ratio.value, ratio.error]
        except FaultFound as fault:
            told.say(f"fastmech: fault found: {fault}", err=True)
            raise click.exceptions.Exit(1) from None


def _counts(stages: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in sorted(stages.items()))
