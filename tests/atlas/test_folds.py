"""Folds and cusps against 60-digit solutions, and that none is lost."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fastmech.atlas.coincidence import Coincidence
from fastmech.atlas.fold_points import find_folds
from fastmech.atlas.folds import FoldSet, trace_folds
from fastmech.atlas.map import map_equilibria
from fastmech.equilibria.outcome import Outcome
from fastmech.errors import InputError
from fastmech.scene import Scene

DATA = tomllib.loads((Path(__file__).parents[2] / "data" / "folds.toml").read_text())
LINES = {entry["name"]: entry for entry in DATA["line"]}
CUSPS = {entry["name"]: entry for entry in DATA["cusp"]}

PAPER = Scene(c2=1100 / 3, alpha=0.0)
WEIGHT = 9.80665 / 1.25


def around(angle: float) -> float:
    return float(np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi)


@pytest.mark.parametrize("name", LINES)
def test_folds_over_one_parameter(name: str) -> None:
    entry = LINES[name]
    found = find_folds(Scene(**entry["parameters"]), entry["parameter"], np.linspace(*entry["range"], 400))
    assert len(found) == len(entry["folds"])
    for mine, exact in zip(found, entry["folds"], strict=True):
        assert mine.value == pytest.approx(float(exact["value"]), rel=1e-10, abs=1e-10)
        assert abs(around(mine.phi - float(exact["phi"]))) < 1e-7
        assert abs(around(mine.theta - float(exact["theta"]))) < 1e-7
        assert mine.residual < 1e-12


def test_two_folds_in_the_force_at_opposite_signs_to_1e_10() -> None:
    low, high = (fold.value for fold in find_folds(PAPER, "F0", np.linspace(-400.0, 400.0, 1000)))
    assert high == pytest.approx(1.399165605086367740487374498948964, abs=1e-10)
    assert low == pytest.approx(-1.399165605086367740487374498948964, abs=1e-10)


@pytest.mark.parametrize("name", LINES)
@pytest.mark.parametrize("away", [1e-3, 1e-6, 1e-9])
def test_neighbours_of_a_fold(name: str, away: float) -> None:
    """Six equilibria on one side and four on the other, or the point says that it is at the fold."""
    entry = LINES[name]
    scene = Scene(**entry["parameters"])
    for fold in entry["folds"]:
        at = float(fold["value"])
        points = map_equilibria(scene, {entry["parameter"]: [at - away * abs(at), at + away * abs(at)]})
        settled = points.outcome == Outcome.COMPLETE
        assert (settled | (points.outcome == Outcome.AT_FOLD)).all()
        if settled.all():
            assert sorted(points.count) == [4, 6]
        assert (settled | (points.coincidence == Coincidence.FOLD)).all()
        if away >= 1e-9:
            assert settled.all()


@pytest.mark.parametrize("name", CUSPS)
def test_cusps(name: str) -> None:
    entry = CUSPS[name]
    values = [float(v) for v in entry["values"]]
    axes = [(n, np.linspace(v - 60.0, v + 50.0, 60)) for n, v in zip(entry["names"], values, strict=True)]
    found = trace_folds(Scene(**entry["parameters"]), *axes).cusps
    nearest = min(found, key=lambda c: abs(c.x - values[0]) + abs(c.y - values[1]))
    assert (nearest.x, nearest.y) == pytest.approx(values, rel=1e-9, abs=1e-7)
    assert abs(around(nearest.phi - float(entry["phi"]))) < 1e-7
    assert abs(around(nearest.theta - float(entry["theta"]))) < 1e-7
    assert all(c.residual < 1e-12 for c in found)


def test_cusp_point_is_named() -> None:
    """a = b = 10, C = 5: 1/A1 = 1/A2 + 1/A3, three equilibria merge at one."""
    scene = Scene(m1=1.0, m2=1.0, l=1.0, g=10.0, c1=5.0, c2=10.0, F0=0.0, alpha=0.0)
    assert list(map_equilibria(scene, {"c1": [5.0]}).coincidence) == [Coincidence.CUSP]


PLANES: dict[str, tuple[Scene, str, tuple[float, float], str, tuple[float, float]]] = {
    "paper": (PAPER, "F0", (-400.0, 400.0), "c1", (0.0, 400.0)),
    "both stiffnesses": (PAPER, "c1", (0.0, 400.0), "c2", (0.0, 800.0)),
    "bistable": (PAPER.replace(c1=294.9), "F0", (-400.0, 400.0), "c2", (0.0, 500.0)),
    "mass and length": (PAPER, "m1", (1.0, 40.0), "l", (0.2, 4.0)),
    "no force: branchings": (PAPER.replace(F0=0.0), "c1", (1.0, 400.0), "c2", (1.0, 800.0)),
    "decaying force": (PAPER.replace(alpha=0.7), "c1", (1.0, 400.0), "m2", (1.0, 30.0)),
    "c2 = m1 g / l": (PAPER.replace(c2=10 * WEIGHT), "F0", (-400.0, 400.0), "c1", (0.0, 400.0)),
    "a = -b": (PAPER.replace(c2=34 * WEIGHT), "F0", (-400.0, 400.0), "c1", (0.0, 400.0)),
}


@pytest.mark.parametrize("name", PLANES)
def test_no_curve_is_lost(name: str) -> None:
    """Every change of the count between neighbours of a map is crossed by a traced curve."""
    scene, x, x_range, y, y_range = PLANES[name]
    # 47 x 53 points: off the values with symmetry, where a grid point would lie on the fold.
    axes = {x: np.linspace(*x_range, 46), y: np.linspace(*y_range, 53)}
    found = trace_folds(scene, *axes.items())
    assert found.unexplained == 0
    assert all(curve.residual < 1e-12 for curve in found.curves)
    count = map_equilibria(scene, axes).count
    changes = 0
    for along in (0, 1):
        for i, j in np.argwhere(np.diff(count, axis=along) != 0):
            start = np.array([axes[x][i], axes[y][j]])
            end = np.array([axes[x][i + (along == 0)], axes[y][j + (along == 1)]])
            assert crossed(found, start, end, along), (start, end)
            changes += 1
    assert changes > 10


def crossed(found: FoldSet, start: Any, end: Any, along: int) -> bool:
    """Whether a polyline of the curves crosses an edge of the grid, to the curves' own coarseness."""
    span = end[along] - start[along]
    for curve in found.curves:
        points = np.stack([curve.x, curve.y], axis=-1)
        across = points[:, 1 - along] - start[1 - along]
        for k in np.flatnonzero(across[:-1] * across[1:] <= 0.0):
            gap = across[k] - across[k + 1]
            share = across[k] / gap if gap != 0.0 else 0.0
            place = points[k, along] + share * (points[k + 1, along] - points[k, along])
            if start[along] - 0.05 * span <= place <= end[along] + 0.05 * span:
                return True
    return False


def test_closed_curve_is_closed() -> None:
    found = trace_folds(PAPER, ("F0", np.linspace(-100.0, 100.0, 81)), ("c1", np.linspace(20.0, 250.0, 81)))
    (curve,) = found.curves
    assert curve.closed
    assert curve.merges == "maximum"
    assert (curve.x[0], curve.y[0]) == pytest.approx((curve.x[-1], curve.y[-1]), abs=1e-6)
    assert len(found.cusps) == 4


@pytest.mark.parametrize(
    ("x", "y", "message"),
    [
        (("F0", [0.0, 1.0]), ("F0", [0.0, 1.0]), r"^axes: F0 is given twice"),
        (("alpha", [0.0, 1.0]), ("F0", [0.0, 1.0]), r"^axes\.alpha: equilibria do not depend"),
        (("F0", [1.0, 0.0]), ("c1", [0.0, 1.0]), r"^axes\.F0: must be two or more values that rise"),
        (("F0", [0.0, 1.0]), ("c9", [0.0, 1.0]), r"^axes\.c9: unknown parameter"),
    ],
)
def test_wrong_planes_are_refused(x: Any, y: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        trace_folds(PAPER, x, y)
