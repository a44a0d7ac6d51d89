"""One part in a million from a fold, on either side: a passage so slow that it looks like rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fastmech.atlas.fold_points import find_folds
from fastmech.ensembles.integrate import integrate
from fastmech.equilibria.find import find_equilibria
from fastmech.hardcases.case import HardCase, Row, row_of
from fastmech.scene import Scene

SCENE = Scene(c2=1100 / 3, c1=294.9, alpha=0.0).replace(c2=92.85)

#: Distance from the fold [N].
DISTANCE = 1e-6

#: Where a fold of a minimum lies: force [N].
AROUND = (600.0, 750.0)

DT, FULL, QUICK = 0.05, 20000.0, 3000.0


def _beside(side: float) -> Callable[[bool], Sequence[Row]]:
    def run(quick: bool) -> Sequence[Row]:
        fold = find_folds(SCENE, "F0", np.linspace(*AROUND, 16))[0]
        scene = SCENE.replace(F0=fold.value + side * DISTANCE)
        equilibria = find_equilibria(scene)
        ghost = np.array([fold.phi, fold.theta])
        gap = np.array([np.hypot(*(np.array([e.phi, e.theta]) - ghost)) for e in equilibria])
        near = [e for e, distance in zip(equilibria, gap, strict=True) if distance < 0.02]
        rows = []
        for method in ("rk4", "dop853", "radau5"):
            result = integrate(scene, [*ghost, 0.0, 0.0], QUICK if quick else FULL, DT, method)
            end = result.y[-1, 0]
            if near:
                well = next(e for e in near if e.morse_index == 0)
                error = float(np.hypot(*(end[:2] - [well.phi, well.theta])))
                rows.append(row_of(result, error, 2e-2, remark="stays in the shallow well"))
            else:
                # It has left: at rest, if so, in a true minimum.
                away = float(np.hypot(*(end[:2] - ghost)))
                wells = [e for e in equilibria if e.morse_index == 0]
                turn = min(
                    np.abs(np.exp(1j * (end[0] - e.phi)) - 1) + np.abs(np.exp(1j * (end[1] - e.theta)) - 1)
                    for e in wells
                )
                left = away > 0.1
                remark = (
                    f"left, {turn:.1e} rad from a minimum" if left else f"still passing, {away:.1e} rad on"
                )
                resting = np.hypot(*end[2:]) < 1e-9
                rows.append(
                    row_of(result, float(turn) if left and not quick else float(resting), 0.5, remark=remark)
                )
        return rows

    return run


CASES = tuple(
    HardCase(
        name,
        f"{DISTANCE:g} N {where}: speeds of 1e-7 rad/s far from any rest",
        "the fold and the equilibria beside it; error: distance from the minimum that must be reached",
        must,
        _beside(side),
    )
    for name, side, where, must in (
        ("before_a_fold", -1.0, "before a minimum and a saddle merge", "it stays in the well that is left"),
        ("behind_a_fold", 1.0, "behind the merging", "it passes the ghost and is never taken for rest there"),
    )
)
