"""Runs killed by SIGKILL at random moments and resumed."""

from __future__ import annotations

import random
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from fastmech.faults.processes import FaultFound, Place, Reference, check_result, place
from fastmech.faults.victim import IN_HAND, computed_again, content_of


@dataclass
class KillReport:
    """What a campaign has found.

    Attributes:
        kills: runs that were killed.
        finished: scans that were brought to their end.
        again: tiles that were computed more than once.
        stages: kills by what the run was doing.
    """

    kills: int = 0
    finished: int = 0
    again: int = 0
    stages: Counter[str] = field(default_factory=Counter)


def kill_campaign(
    kills: int, expected: Reference, seed: int = 0, tell: Callable[[int], None] = lambda n: None
) -> KillReport:
    """Kill runs at random moments, every third while it assembles, and resume them to the end.

    Args:
        kills: how many.
        expected: the undisturbed scan.
        seed: of the moments.
        tell: is told of every kill.

    Raises:
        FaultFound: a result differs, something is left behind, or more was computed again than was in hand.
    """
    rng, report = random.Random(seed), KillReport()
    while report.kills < kills:
        with place() as here:
            here.begin()
            before = report.kills
            for _ in range(rng.randint(1, 8)):
                if not _killed(here, expected, rng, report):
                    break
                tell(1)
                _nothing_broken(here, expected)
            here.finish()
            again, most = computed_again(here.lines()), IN_HAND * (report.kills - before)
            if again > most:
                raise FaultFound(f"{again} tiles were computed again, at most {most} were in hand")
            check_result(here, expected, f"after {report.kills - before} kills")
            report.again += again
            report.finished += 1
    return report


def _killed(here: Place, expected: Reference, rng: random.Random, report: KillReport) -> bool:
    """Start a run and kill it; False where it was faster."""
    seen = len(here.lines())
    process = here.start()
    if rng.random() < 1 / 3:
        while process.exitcode is None and "stage assembling" not in here.lines()[seen:]:
            time.sleep(0.001)
        time.sleep(rng.uniform(0.0, expected.assembly))
    else:
        time.sleep(rng.uniform(0.0, expected.seconds - expected.assembly))
    if process.exitcode is not None:
        return False
    process.kill()
    process.join()
    if process.exitcode == 0:
        return False
    doing = here.lines()[seen:]
    what = "starting" if not doing else doing[-1].removeprefix("stage ")
    report.stages["computing" if what.startswith("tile ") else what] += 1
    report.kills += 1
    return True


def _nothing_broken(here: Place, expected: Reference) -> None:
    """Under the final name there is nothing or the whole result."""
    if here.result.exists() and content_of(here.result) != expected.content:
        raise FaultFound("a result that is not whole has its final name")
