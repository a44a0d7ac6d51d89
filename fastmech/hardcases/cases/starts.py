"""Bad company and bad steps: what is not finite, a force gone within a step, steps ten times too long."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.status import Status
from fastmech.equilibria.find import find_equilibria
from fastmech.hardcases.case import HardCase, Row, row_of, worst
from fastmech.hardcases.references import motion
from fastmech.integrators.methods import METHODS
from fastmech.scene import Scene
from fastmech.step_limits.predict import largest_stable_step
from fastmech.step_limits.warning import step_warning

SCENE = Scene(c2=1100 / 3, alpha=0.0)


def _neighbours(quick: bool) -> Sequence[Row]:
    n = 64 if quick else 256
    starts = np.random.default_rng(1).uniform([-2, -2, -3, -3], [2, 2, 3, 3], (n, 4))
    bad = {3: np.nan, 17: np.inf, 18: -np.inf, 40: 1e200, 41: 5e-324, 42: -1e-310}
    mixed = starts.copy()
    for lane, value in bad.items():
        mixed[lane, lane % 4] = value
    healthy = np.delete(np.arange(n), list(bad))
    rows = []
    for method in METHODS if not quick else ("rk4", "abm12", "gauss6", "sdirk4"):
        dt = 0.002
        alone, together = (integrate(SCENE, y, 0.5, dt, method) for y in (starts, mixed))
        same = np.array_equal(alone.y[:, healthy], together.y[:, healthy])
        told = (together.status[[3, 17, 18]] == Status.START_NOT_FINITE).all() and together.status[
            40
        ] != Status.OK
        fine = (together.status[healthy] == Status.OK).all() and (
            together.status[[41, 42]] == Status.OK
        ).all()
        remark = f"unusual starts: {', '.join(worst([together.status[lane]]) for lane in bad)}"
        rows.append(
            Row(method, together.dt, together.steps, 0.0 if same and told and fine else np.inf, 0.0, np.nan,
                worst(together.status[healthy]), True, remark)
        )  # fmt: skip
    return rows


def _sudden(quick: bool) -> Sequence[Row]:
    m = motion("sudden_decay")
    gone = 50.0 / m.scene.alpha
    after = m.scene.replace(F0=0.0)
    rows = []
    for method, dt in (("rk4", 0.002), ("dop853", 0.01), ("radau5", 0.005)):
        told = step_warning(m.scene, dt, method) is not None
        # Short steps while the force lasts, then those of the motion.
        first = integrate(m.scene, m.start, gone, 0.05 / m.scene.alpha, method)
        run = integrate(after, first.y[-1, 0], m.t - gone, dt, method)
        error = float(np.abs(run.y[-1, 0] - m.state).max()) if told else np.inf
        rows.append(row_of(run, error, 1e-8, remark="warned of dt before the run" if told else "no warning"))
    return rows


def _too_long(quick: bool) -> Sequence[Row]:
    minimum = next(e for e in find_equilibria(SCENE) if e.morse_index == 0)
    starts = np.random.default_rng(2).uniform([0.5, -1, 0, 0], [2.5, 1, 0, 0], (32 if quick else 256, 4))
    rows = []
    for method in ("euler", "rk4", "dop853", "ab6", "abm12"):
        dt = 10.0 * largest_stable_step(SCENE, minimum, method)
        told = step_warning(SCENE, dt, method) is not None
        run = integrate(SCENE, starts, 400.0 * dt, dt, method)
        share = float((run.status != Status.OK).mean())
        # Every single trajectory must be flagged, not just one.
        status = worst(run.status) if share == 1.0 and told else "ok"
        rows.append(
            Row(method, run.dt, run.steps, np.nan, 0.0, np.nan, status, False,
                f"{share:.0%} flagged{', warned before' if told else ''}")
        )  # fmt: skip
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
