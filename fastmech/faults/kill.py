"""Runs killed by SIGKILL at random moments and resumed."""

from __future__ import annotations

import random
import time
from collections import Counter
from collections.abc import Callable

from fastmech.faults.processes import FaultFound, Found, Place, Reference, check_resumed, place
from fastmech.faults.victim import content_of


def kill_campaign(
    kills: int, expected: Reference, seed: int = 0, tell: Callable[[int], None] = lambda n: None
) -> Found:
    """Kill runs at random moments, every third while it assembles, and resume them to the end.

    Args:
        kills: how many.
        expected: the undisturbed scan.
        seed: of the moments.
        tell: is told of every kill.

    Raises:
        FaultFound: a result differs, something is left behind, or more was computed again than was in hand.
    """
    rng, stages, finished, again = random.Random(seed), Counter[str](), 0, 0
    while stages.total() < kills:
        with place() as here:
            here.begin()
            before = stages.total()
            for _ in range(rng.randint(1, 8)):
                stage = _killed_in(here, expected, rng)
                if not stage:
                    break
                stages[stage] += 1
                tell(1)
                _nothing_broken(here, expected)
            here.finish()
            killed = stages.total() - before
            again += check_resumed(here, expected, f"after {killed} kills", killed)
            finished += 1
    while_doing = ", ".join(f"{name} {count}" for name, count in sorted(stages.items()))
    sentences = (
        f"{stages.total()} runs killed, {finished} scans resumed to the same result",
        f"  {again} tiles computed again; killed while {while_doing}",
    )
    return Found(sentences, {"killed": {"runs": stages.total(), "tiles_again": again, **stages}})


def _killed_in(here: Place, expected: Reference, rng: random.Random) -> str:
    """Start a run and kill it; what it was doing, empty where it was faster."""
    seen = len(here.lines())
    process = here.start()
    if rng.random() < 1 / 3:
        while process.exitcode is None and "stage assembling" not in here.lines()[seen:]:
            time.sleep(0.001)
        time.sleep(rng.uniform(0.0, expected.assembly))
    else:
        time.sleep(rng.uniform(0.0, expected.seconds - expected.assembly))
    if process.exitcode is not None:
        return ""
    process.kill()
    process.join()
    if process.exitcode == 0:
        return ""
    what = "starting" if len(here.lines()) == seen else here.lines()[-1].removeprefix("stage ")
    return "computing" if what.startswith("tile ") else what


def _nothing_broken(here: Place, expected: Reference) -> None:
    """Under the final name there is nothing or the whole result."""
    if here.result.exists() and content_of(here.result) != expected.content:
        raise FaultFound("a result that is not whole has its final name")
