"""Scenes on and beside folds and cusps: proved, or said to be at one."""

from __future__ import annotations

import numpy as np
import pytest
from slider.atlas.test_folds import PAPER, PLANES, WEIGHT
from slider.scenes import exact_unit_roots

from fastmech.outcome import Outcome
from fastmech.scene import Scene
from fastmech.slider.atlas.axes import coefficient_columns
from fastmech.slider.atlas.folds import trace_folds
from fastmech.slider.atlas.map import Coincidence, map_equilibria
from fastmech.slider.solve import Roots, solve_rows

Floats = np.typing.NDArray[np.float64]

#: On c2 = (m1 + 2 m2) g / l the lift is minus the gravity, and three equilibria merge on whole curves.
MORE = {
    "lift = -gravity crossed": (PAPER.replace(c1=294.9), "F0", (-400.0, 400.0), "c2", (0.0, 500.0)),
    "masses": (PAPER, "m1", (0.1, 60.0), "m2", (0.1, 60.0)),
}


def solve_at(scene: Scene, values: dict[str, Floats]) -> Roots:
    n = len(next(iter(values.values())))
    columns = coefficient_columns(scene, values)
    rows = np.stack([np.broadcast_to(np.asarray(c, dtype=np.float64), n) for c in columns], axis=1)
    return solve_rows(np.ascontiguousarray(rows))


@pytest.mark.parametrize("name", [*PLANES, *MORE])
def test_every_point_of_the_curves_is_proved_or_at_a_fold(name: str) -> None:
    """The points as they are, and relative displacements on either side of them in either parameter."""
    scene, x, x_range, y, y_range = {**PLANES, **MORE}[name]
    found = trace_folds(scene, (x, np.linspace(*x_range, 46)), (y, np.linspace(*y_range, 53)))
    xs = np.concatenate([*(c.x for c in found.curves), [c.x for c in found.cusps]])
    ys = np.concatenate([*(c.y for c in found.curves), [c.y for c in found.cusps]])
    assert xs.size > 30
    checked = 0
    for away in (0.0, 1e-14, 1e-12, 1e-9, 1e-6, 1e-3):
        for u, v in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            values = {x: xs * (1.0 + u * away), y: ys * (1.0 + v * away)}
            solution = solve_at(scene, values)
            proved = solution.outcome == Outcome.COMPLETE
            assert (proved | (solution.outcome == Outcome.AT_FOLD)).all(), away
            if away == 0.0 or scene.F0 == 0.0 or scene.alpha > 0.0:
                continue
            # Beside a fold roots on the unit circle are told from the others by their digits: 60 of them.
            for k in np.flatnonzero(proved)[:: max(1, np.count_nonzero(proved) // 2)][:2]:
                point = scene.replace(**{n: float(a[k]) for n, a in values.items()})
                exact = {n: getattr(point, n) for n in ("m1", "m2", "l", "c1", "c2", "F0")}
                if abs(exact["c2"] * exact["l"] / 9.80665 - exact["m1"]) > 1e-6 and exact["F0"] != 0.0:
                    assert exact_unit_roots(exact) == solution.count[k], (away, exact)
                    checked += 1
    print(f"{checked} counts confirmed at 60 digits")


@pytest.mark.parametrize("away", [0.0, 1e-12, -1e-12])
@pytest.mark.parametrize("F0", [19.5685007275454, -19.5685007275454, 254.784792758814, -254.784792758814])
def test_cusps_where_lift_is_minus_gravity(F0: float, away: float) -> None:
    scene = Scene(c1=294.9, c2=34 * WEIGHT, alpha=0.0)
    one = map_equilibria(scene, {"F0": [F0 * (1.0 + away)]})
    if one.outcome[0] != Outcome.COMPLETE:
        assert (one.outcome[0], one.coincidence[0]) == (Outcome.AT_FOLD, Coincidence.CUSP)
        assert one.count[0] == 4  # the three that merge count as one
        assert np.count_nonzero(one.morse_index[0] == -2) == 1


def test_every_cusp_is_named() -> None:
    for scene, x, x_range, y, y_range in (*PLANES.values(), *MORE.values()):
        found = trace_folds(scene, (x, np.linspace(*x_range, 46)), (y, np.linspace(*y_range, 53)))
        for cusp in found.cusps:
            one = map_equilibria(scene.replace(**{y: cusp.y}), {x: [cusp.x]})
            assert one.outcome[0] in (Outcome.AT_FOLD, Outcome.COMPLETE)
            assert one.outcome[0] == Outcome.COMPLETE or one.coincidence[0] == Coincidence.CUSP, cusp
