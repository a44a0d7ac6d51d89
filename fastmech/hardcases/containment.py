"""What failing trajectories cost their neighbours in a block: throughput of the rest beside them.

The rest are the trajectories that do not fail; their throughput is how many of them end in how much time. The
share is that beside failing ones over that of the same ensemble in which nobody fails: the time without
failures over the time with them. It passes 1 where lanes that have failed have left.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from fastmech.arrays import Floats
from fastmech.ensembles.integrate import Trajectories, integrate
from fastmech.ensembles.status import Status
from fastmech.ensembles.system import System
from fastmech.reports import in_turns, table
from fastmech.results import Dataset, Variable
from fastmech.scene import Scene

#: Methods that are measured, explicit, multistep and implicit ones, with the step [s].
CONTAINED = {"rk4": 0.01, "dop853": 0.02, "ab6": 0.005, "abm8": 0.01, "gauss6": 0.05, "sdirk4": 0.02}

#: Lengths of the runs [s], and those of the quick version.
SPANS, QUICK_SPANS = (5.0, 20.0, 100.0), (2.0,)

#: When trajectories fail: the mechanism's at once, the system's about these shares of the run's length.
WHEN = {"in the first step": 0.0, "after 10 %": 0.1, "after 85 %": 0.85}

SCENE = Scene(c2=1100 / 3, alpha=0.0)

#: Trajectories, one in how many fails, and runs of each kind, in turn, after one that does not count.
NUMBER, ONE_IN, REPETITIONS = 4096, 16, 3


def pendulums(
    t: float, phi: float, omega: float, psi: float, rate: float, y: float
) -> tuple[float, float, float, float, float]:
    """Two coupled pendulums, and y' = y^2, which is infinite at t = 1/y(0)."""
    first = -math.sin(phi) - 0.1 * omega
    return omega, first, rate, 0.2 * math.sin(phi) - math.sin(psi) - 0.1 * rate, y * y


def ensembles(when: float, span: float) -> tuple[Scene | System, Floats, Floats]:
    """What is integrated, starts without failures, and the same where every sixteenth fails.

    They fail in the first step, or spread over a tenth around the share ``when`` of ``span`` [s].
    """
    random, failing = np.random.default_rng(1), np.arange(0, NUMBER, ONE_IN)
    if when == 0.0:
        starts = random.uniform([-2, -2, -3, -3], [2, 2, 3, 3], (NUMBER, 4))
        mixed = starts.copy()
        mixed[failing, 2] = 1e200
        return SCENE, starts, mixed
    starts = random.uniform(-2.0, 2.0, (NUMBER, 5))
    starts[:, 4] = -1.0
    mixed = starts.copy()
    mixed[failing, 4] = 1.0 / (when * span * np.linspace(0.95, 1.05, failing.size))
    return System(pendulums, ["phi", "omega", "psi", "rate", "y"], {}), starts, mixed


def _beside(method: str, dt: float, when: float, span: float, repetitions: int) -> tuple[float, int, bool]:
    """The share, how many have failed, and whether the rest is the same to the bit."""
    what, *both = ensembles(when, span)
    runs: dict[int, Trajectories] = {}

    def run(kind: int) -> None:
        runs[kind] = integrate(what, both[kind], span, dt, method, threads=1)

    alone, beside = in_turns({kind: partial(run, kind) for kind in (0, 1)}, repetitions).values()
    least = np.finfo(np.float64).tiny
    share = np.median([one / max(other, least) for one, other in zip(alone, beside, strict=True)])
    healthy = np.flatnonzero(np.arange(NUMBER) % ONE_IN)
    same = np.array_equal(runs[0].y[:, healthy], runs[1].y[:, healthy], equal_nan=True)
    return float(share), int((runs[1].status != Status.OK).sum()), same


def containment(quick: bool, progress: Callable[[int], None]) -> Dataset:
    """Share of the throughput of healthy trajectories that is left, by method, time of failure and span."""
    spans = QUICK_SPANS if quick else SPANS
    found = []
    for method, dt in CONTAINED.items():
        for when in WHEN.values():
            found += [_beside(method, dt, when, span, 1 if quick else REPETITIONS) for span in spans]
        progress(1)
    shape = (len(CONTAINED), len(WHEN), len(spans))
    shares, flagged, same = (np.array(part).reshape(shape) for part in zip(*found, strict=True))
    each = ("method", "when", "span")
    return Dataset(
        {
            "method": Variable(each[:1], np.array(list(CONTAINED), object), "1", "method"),
            "when": Variable(each[1:2], np.array(list(WHEN), object), "1", "when trajectories fail"),
            "span": Variable(each[2:], np.array(spans), "s", "length of the run"),
            "share": Variable(each, shares, "1", "throughput of the rest beside failing ones"),
            "failed": Variable(each, flagged, "1", "trajectories with a status that is not OK"),
            "same": Variable(each, same, "1", "whether the rest is the same to the bit"),
        },
        {"trajectories": NUMBER, "failing": -(-NUMBER // ONE_IN)},
    )


def contained(shares: Dataset) -> bool:
    """Whether those that fail, and nobody else, have a status, and the rest is the same to the bit."""
    return bool(shares["same"].data.all() and (shares["failed"].data == shares.attrs["failing"]).all())


def containment_markdown(shares: Dataset) -> list[str]:
    """The table as text."""
    methods, when, spans = (shares[name].data for name in ("method", "when", "span"))
    failing, number = shares.attrs["failing"], shares.attrs["trajectories"]
    return [
        "## Failing neighbours",
        "",
        f"{failing} of {number} trajectories fail: throughput of the rest over that in the same run "
        "without failures. At least 0.9 is wanted; above 1 those that failed have made room. Processor time "
        "of one thread, median of runs in turn. Failing trajectories have a status and the rest is "
        f"the same to the bit: {'yes' if contained(shares) else 'NO'}.",
        "",
        *table(
            ["method", *(f"{kind}, {span:g} s" for kind in when for span in spans)],
            (
                [method, *(f"{share:.2f}" for share in row.ravel())]
                for method, row in zip(methods, shares["share"].data, strict=True)
            ),
        ),
    ]
