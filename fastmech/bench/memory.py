"""Memory that the final states of many trajectories take, in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass

#: What the process does: it tells its largest memory [bytes], starts included. A few steps are as many as
#: thousands: nothing of a step is kept.
SCRIPT = """
import resource, sys
import numpy as np
import fastmech as fm
n = int(sys.argv[1])
starts = np.zeros((n, 4))
starts[:, 0] = np.linspace(0.5, 2.5, n)
run = fm.integrate(fm.Scene(alpha=0.0), starts, 0.1, dt=0.02)
assert run.y.shape == (1, n, 4)
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(peak * (1 if sys.platform == "darwin" else 1024))
"""

#: Trajectories: few, for what any process takes, and many.
TRAJECTORIES = (1_000, 10_000_000)


@dataclass(frozen=True)
class Peak:
    """The largest memory of a process that integrates so many trajectories."""

    trajectories: int
    memory: int  #: bytes, starts and final states included


def peaks(advance: Callable[[int], None]) -> list[Peak]:
    """One process for each number of trajectories."""
    found = []
    for n in TRAJECTORIES:
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, str(n)], capture_output=True, text=True, check=True
        )
        found.append(Peak(n, int(done.stdout)))
        advance(1)
    return found
