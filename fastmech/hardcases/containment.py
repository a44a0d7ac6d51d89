"""What failing trajectories cost their neighbours in a block: throughput of the rest beside them."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.status import Status
from fastmech.results import Dataset, Variable
from fastmech.scene import Scene

#: Methods that are measured: explicit, multistep and implicit ones, with step and length of the run [s].
CONTAINED = {
    "rk4": (0.01, 100.0),
    "dop853": (0.02, 100.0),
    "abm8": (0.01, 100.0),
    "gauss6": (0.05, 20.0),
    "radau5": (0.05, 20.0),
    "sdirk4": (0.02, 10.0),
}

SCENE = Scene(c2=1100 / 3, alpha=0.0)

#: Trajectories, one in how many fails in its first step, and the share of the run's length if it is quick.
NUMBER, ONE_IN, QUICK = 1024, 16, 0.05

#: Runs of each kind, in turn; the fastest counts, because others share the machine.
REPETITIONS = 3


def containment(quick: bool, progress: Callable[[int], None]) -> Dataset:
    """Share of the throughput of healthy trajectories that is left beside failing ones, by method."""
    starts = np.random.default_rng(1).uniform([-2, -2, -3, -3], [2, 2, 3, 3], (NUMBER, 4))
    mixed, failing = starts.copy(), np.arange(0, NUMBER, ONE_IN)
    mixed[failing, 2] = 1e200
    healthy = np.setdiff1d(np.arange(NUMBER), failing)
    shares, flagged, same = [], [], []
    for method, (dt, length) in CONTAINED.items():
        t_end = QUICK * length if quick else length
        seconds = np.empty((REPETITIONS + 1, 2))
        for repetition in range(REPETITIONS + 1):
            runs = []
            for kind, y in enumerate((starts, mixed)):
                begun = time.perf_counter()
                runs.append(integrate(SCENE, y, t_end, dt, method, threads=1))
                seconds[repetition, kind] = time.perf_counter() - begun
        alone, beside = seconds[1:].min(axis=0)
        shares.append((healthy.size / beside) / (NUMBER / alone))
        flagged.append(np.count_nonzero(runs[1].status != Status.OK))
        same.append(np.array_equal(runs[0].y[:, healthy], runs[1].y[:, healthy]))
        progress(1)
    each = ("method",)
    return Dataset(
        {
            "method": Variable(each, np.array(list(CONTAINED), object), "1", "method"),
            "share": Variable(each, np.array(shares), "1", "throughput of the rest beside failing ones"),
            "failed": Variable(each, np.array(flagged), "1", "trajectories with a status that is not OK"),
            "same": Variable(each, np.array(same), "1", "whether the rest is the same to the bit"),
        },
        {"trajectories": NUMBER, "failing": failing.size},
    )


def containment_markdown(shares: Dataset) -> str:
    """The table as text."""
    lines = [
        "## Failing neighbours",
        "",
        f"{shares.attrs['failing']} of {shares.attrs['trajectories']} trajectories fail in their first step; "
        "trajectories per second of the rest beside them, over those of a run without failures. At least "
        "0.9 is wanted; one thread, fastest of three runs each, in turn.",
        "",
        "| method | throughput of the rest | failed | rest the same to the bit |",
        "|---|---:|---:|---|",
    ]
    columns = [shares[name].data for name in ("method", "share", "failed", "same")]
    lines += [
        f"| {method} | {share:.2f} | {failed} | {'yes' if same else 'no'} |"
        for method, share, failed, same in zip(*columns, strict=True)
    ]
    return "\n".join(lines)
