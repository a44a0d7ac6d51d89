"""Memory that the final states of many trajectories take, in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

#: What the process does: it tells its largest memory [bytes], starts included. A few steps are as many as
#: thousands: nothing of a step is kept.
SCRIPT = """
import sys
import numpy as np
import fastmech as fm
n = int(sys.argv[1])
starts = np.zeros((n, 4))
starts[:, 0] = np.linspace(0.5, 2.5, n)
run = fm.integrate(fm.Scene(alpha=0.0), starts, 0.1, dt=0.02)
assert run.y.shape == (1, n, 4)
with open("/proc/self/status") as status:  # what getrusage tells may be the parent's
    print(next(1024 * int(line.split()[1]) for line in status if line.startswith("VmHWM")))
"""

#: Trajectories: few, for what any process takes, and many.
TRAJECTORIES = (1_000, 10_000_000)


@dataclass(frozen=True)
class Footprint:
    """The largest memory of a process that integrates so many trajectories."""

    trajectories: int
    memory: int  #: bytes, starts and final states included


def footprints(advance: Callable[[int], None]) -> list[Footprint]:
    """One process for each number of trajectories; none where the system does not tell (Linux does)."""
    found: list[Footprint] = []
    if not Path("/proc/self/status").exists():
        advance(len(TRAJECTORIES))
        return found
    for n in TRAJECTORIES:
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, str(n)], capture_output=True, text=True, check=True
        )
        found.append(Footprint(n, int(done.stdout)))
        advance(1)
    return found
