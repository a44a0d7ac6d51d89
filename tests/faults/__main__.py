"""Long scans put to the test: ``make faults``, or ``PYTHONPATH=tests python -m faults --kills 200``.

Kills runs by SIGKILL at random moments and resumes them, runs on disks that fill up (needs the right to
mount), kills Dask workers, and reads files with flipped, lost and added bytes. Ends with code 1 if a result
is not the undisturbed one, or a damaged file is not refused in one line.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from collections.abc import Callable

from fastmech.cli.progress import ProgressBars
from faults import campaigns
from faults.fuzz import fuzz_requests, fuzz_results
from faults.overhead import RUNS, overheads

#: How often what is done by default; seconds of scans that measure what durability and Dask cost, 0: none.
DEFAULTS = {"kills": 200, "disks": 20, "workers": 5, "mutations": 100_000, "overhead": 0, "seed": 0}


def main() -> None:
    parser = ArgumentParser(prog="faults", description=__doc__)
    for name, default in DEFAULTS.items():
        parser.add_argument(f"--{name}", type=int, default=default, metavar="N", help=f"[{default}]")
    asked = parser.parse_args()
    if asked.disks and not campaigns.can_mount():
        print("no right to mount small disks: full disks are left out")
        asked.disks = 0
    interrupted = {"killed": asked.kills, "full_disks": asked.disks, "workers_killed": asked.workers}
    works: list[tuple[str, int, Callable[..., campaigns.CampaignFound], tuple[object, ...]]] = []
    if any(interrupted.values()):
        expected = campaigns.reference()
        works = [(n, k, campaigns.campaign, (n, k, expected, asked.seed)) for n, k in interrupted.items()]
    for what, fuzz in (("requests", fuzz_requests), ("result files", fuzz_results)):
        works.append((what, asked.mutations // 2, fuzz, (asked.mutations // 2, asked.seed)))
    works.append(("scans all ways", RUNS * bool(asked.overhead), overheads, (asked.overhead,)))
    with ProgressBars() as bars:
        for name, total, work, arguments in works:
            if total:
                print(*work(*arguments, bars.stage(name, total)).sentences, sep="\n", flush=True)


if __name__ == "__main__":
    try:
        main()
    except campaigns.FaultFound as fault:
        sys.exit(f"fault found: {fault}")
