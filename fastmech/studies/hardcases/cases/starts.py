"""Bad company and bad steps: what is not finite, a force gone within a step, steps ten times too long."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fastmech.arrays import Floats
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.status import Status
from fastmech.equilibria.find import find_equilibria
from fastmech.integrators.methods import find_method
from fastmech.scene import Scene
from fastmech.step_limits.predict import largest_stable_step
from fastmech.step_limits.warning import impulse_ratio, step_warning
from fastmech.studies.hardcases.walk import HardCase, Row, claimed_row, motion, row_of, walked, worst

SCENE = Scene(c2=1100 / 3, alpha=0.0)

#: Step [s] for methods that claim nothing.
FAR_TOO_LONG = 2.0

#: Starts that are not finite, or nearly so, by the trajectory that has one.
BAD = {3: np.nan, 17: np.inf, 18: -np.inf, 40: 1e200, 41: 5e-324, 42: -1e-310}


def _neighbours(quick: bool) -> Sequence[Row]:
    n = 64 if quick else 256
    starts = np.random.default_rng(1).uniform([-2, -2, -3, -3], [2, 2, 3, 3], (n, 4))
    mixed = starts.copy()
    for lane, value in BAD.items():
        mixed[lane, lane % 4] = value
    kinds = [(method, "float64") for method in walked(quick)]
    kinds += [(name, "float32") for name in ("rk4", "dop853", "abm8")]
    return [_block(starts, mixed, method, dtype) for method, dtype in kinds]


def _block(starts: Floats, mixed: Floats, method: str, dtype: str) -> Row:
    """One block with and without unusual starts."""
    healthy = np.delete(np.arange(len(starts)), list(BAD))
    with np.errstate(over="ignore"):  # 1e200 has no float32
        alone, together = (integrate(SCENE, y, 0.5, 0.002, method, dtype=dtype) for y in (starts, mixed))
    same = np.array_equal(alone.y[:, healthy], together.y[:, healthy])
    told = (together.status[[3, 17, 18]] == Status.START_NOT_FINITE).all()
    told &= together.status[40] != Status.OK
    fine = (together.status[healthy] == Status.OK).all() and (together.status[[41, 42]] == Status.OK).all()
    remark = f"{dtype}; unusual starts: {', '.join(worst([together.status[lane]]) for lane in BAD)}"
    error = 0.0 if same and told and fine else np.inf
    row = row_of(together, error, 0.0, remark=remark, why="lanes do not know each other")
    return row._replace(status=worst(together.status[healthy]))


def _sudden(quick: bool) -> Sequence[Row]:
    m = motion("sudden_decay")
    gone = 50.0 / m.scene.alpha
    after = m._replace(scene=m.scene.replace(F0=0.0), t_end=m.t_end - gone)
    rows = []
    for method in walked(quick):
        # Short steps while the force lasts, then those of the motion.
        first = integrate(m.scene, m.start, gone, 0.01 / m.scene.alpha, method)
        row = claimed_row(after._replace(start=first.y[-1, 0]), method, 0.005, FAR_TOO_LONG)
        warned = step_warning(m.scene, row.dt, method)
        wrong = "" if warned and "impulse" in warned else "; NOT warned"
        times = impulse_ratio(find_method(method), row.dt * m.scene.alpha)
        remark = f"at dt = {row.dt:.3g} s from the start the impulse would be {times:.3g} times itself{wrong}"
        rows.append(row._replace(error=row.error if not wrong else np.inf, remark=remark))
    return rows


def _too_long(quick: bool) -> Sequence[Row]:
    minimum = next(e for e in find_equilibria(SCENE) if e.morse_index == 0)
    starts = np.random.default_rng(2).uniform([0.5, -1, 0, 0], [2.5, 1, 0, 0], (32 if quick else 256, 4))
    rows = []
    for method in walked(quick):
        dt = 10.0 * largest_stable_step(SCENE, minimum, method)
        if not np.isfinite(dt):
            continue  # A-stable: no step is too long for stability
        told = step_warning(SCENE, dt, method) is not None
        run = integrate(SCENE, starts, 400.0 * dt, dt, method)
        share = float((run.status != Status.OK).mean())
        # Every single trajectory must be flagged, not just one.
        status = worst(run.status) if share == 1.0 and told else "ok"
        remark = f"{share:.0%} flagged{', warned before' if told else ', NOT warned before'}"
        row = row_of(run, np.nan, np.nan, claimed=False, remark=remark, why="beyond its limit")
        rows.append(row._replace(status=status))
    return rows


CASES = (
    HardCase(
        "bad_neighbours",
        "NaN, infinities, 1e200 and subnormal numbers among the starts of one block",
        "the same starts without them; error: 0 if every other lane agrees to the bit",
        "the neighbours notice nothing, and every start that is not finite has its status",
        _neighbours,
    ),
    HardCase(
        "sudden_decay",
        "alpha = 1e6 1/s: the impulse of 1e-4 N s is over within a step",
        "heyoka in 80-bit arithmetic; largest difference of the final state",
        "a step that falsifies the impulse is told before the run; short steps while it lasts are right",
        _sudden,
    ),
    HardCase(
        "steps_ten_times_too_long",
        "ten times the largest stable step",
        "none is needed: no number may come out",
        "a warning before, and a status for every trajectory",
        _too_long,
    ),
)
