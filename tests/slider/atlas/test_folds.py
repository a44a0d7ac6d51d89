"""Folds and cusps against 60-digit solutions, and that none is lost."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.spatial import cKDTree

from fastmech.errors import InputError
from fastmech.outcome import Outcome
from fastmech.scene import Scene
from fastmech.slider.atlas.folds import FoldSet, find_folds, trace_folds
from fastmech.slider.atlas.map import Coincidence, map_equilibria

DATA = tomllib.loads((Path(__file__).parents[3] / "data" / "folds.toml").read_text())
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


ISLANDS = Scene(alpha=0.0, c1=294.9)


def pulls_at(scene: Scene, phi: Any, theta: Any, **changes: Any) -> tuple[Any, ...]:
    """Gradient and Hessian's determinant of U, and A1^2, A2^2, A3^2, f (a - b), at 50 digits."""
    p = {n: mpmath.mpf(v) for n, v in scene.parameters.items()} | changes
    a = (p["m1"] + p["m2"]) * p["g"] * p["l"] - p["c2"] * p["l"] ** 2
    b, C, f = p["m2"] * p["g"] * p["l"], p["c1"] * p["l"] ** 2, p["F0"] * p["l"]
    one = a * mpmath.cos(phi) + f * mpmath.sin(phi) - C * mpmath.cos(phi + theta)
    two = b * mpmath.sin(theta) + f * mpmath.cos(theta) - C * mpmath.cos(phi + theta)
    s = C * mpmath.sin(phi + theta)
    h11 = f * mpmath.cos(phi) - a * mpmath.sin(phi) + s
    h22 = b * mpmath.cos(theta) - f * mpmath.sin(theta) + s
    return one, two, h11 * h22 - s * s, a * a + f * f, b * b + f * f, C * C, f * (a - b)


@pytest.mark.parametrize("number", [2, 3, 12, 101])
@pytest.mark.parametrize("falling", [1, -1])
def test_islands_are_found_whatever_the_grid(number: int, falling: int) -> None:
    """Cusps lie where two amplitudes are equal, or where f (a - b) = 0: at 50 digits."""
    F0, c2 = np.linspace(-400.0, 400.0, number)[::falling], np.linspace(0.0, 500.0, number)[::falling]
    found = trace_folds(ISLANDS, ("F0", F0), ("c2", c2))
    assert (len(found.curves), len(found.cusps)) == (3, 10)
    assert (found.complete, found.reason) == (True, "")
    assert {curve.kind for curve in found.curves} == {"fold"}
    with mpmath.workdps(50):
        for cusp in found.cusps:
            at = [mpmath.mpf(v) for v in (cusp.phi, cusp.theta, cusp.x, cusp.y)]
            here = pulls_at(ISLANDS, *at[:2], F0=at[2], c2=at[3])
            kind = int(np.argmin([abs(x) for x in vanishing(here)]))
            # One of these vanishes besides the gradient; which, fixes the cusp with the determinant's zero.
            exact = mpmath.findroot(
                lambda phi, theta, F, c2, kind=kind: cusp_equations(phi, theta, F, c2, kind), at, tol=1e-30
            )
            assert max(abs(x - y) for x, y in zip(exact, at, strict=True)) < 1e-9


def vanishing(p: tuple[Any, ...]) -> list[Any]:
    *_, A1, A2, A3, turn = p
    return [A2 - A3, A3 - A1, A1 - A2, turn]


def cusp_equations(phi: Any, theta: Any, F: Any, c2: Any, kind: int) -> list[Any]:
    """Gradient and determinant, and that the null direction's third derivative vanishes."""
    p = pulls_at(ISLANDS, phi, theta, F0=F, c2=c2)
    return [*p[:3], vanishing(p)[kind]]


def test_folds_far_from_the_values_are_found() -> None:
    scene = Scene(alpha=0.0, c1=779.0951, c2=87.5796)
    found = find_folds(scene, "F0", [0.05, 600.0])
    assert found.complete
    assert [fold.kind for fold in found] == ["fold", "fold"]
    with mpmath.workdps(50):
        for fold in found:
            exact = mpmath.findroot(
                lambda phi, theta, F: pulls_at(scene, phi, theta, F0=F)[:3],
                (fold.phi, fold.theta, fold.value),
            )
            assert fold.value == pytest.approx(float(exact[2]), rel=1e-11)


def test_pitchforks_are_named() -> None:
    """Without a force M1 and M2 hang at (-pi/2, 0) until C = a b / (a + b), where the position splits."""
    scene = Scene(alpha=0.0, F0=0.0, c2=92.85)
    a, b = 22.0 * 9.80665 * 1.25 - 92.85 * 1.25**2, 12.0 * 9.80665 * 1.25
    (found,) = find_folds(scene, "c1", np.linspace(0.0, 150.0, 31))
    assert found.kind == "pitchfork"
    assert found.value == pytest.approx(a * b / (a + b) / 1.25**2, rel=1e-14)
    assert (found.phi, found.theta) == pytest.approx((-np.pi / 2, 0.0), abs=1e-12)
    plane = trace_folds(PAPER.replace(F0=0.0), ("c1", [1.0, 400.0]), ("c2", [1.0, 800.0]))
    assert {curve.kind for curve in plane.curves} == {"pitchfork"}
    assert plane.complete
    # Where two amplitudes agree everywhere there are both.
    plane = trace_folds(PAPER.replace(c2=34 * WEIGHT), ("F0", [-400.0, 400.0]), ("c1", [0.0, 400.0]))
    assert {curve.kind for curve in plane.curves} == {"fold", "pitchfork"}
    assert plane.complete


@pytest.mark.parametrize("name", ["c1", "c2", "m1", "g", "l"])
def test_what_merges_is_named_by_the_parameter_that_passes_it(name: str) -> None:
    """Where both pulls are opposite, only c1 keeps the scene its own mirror image: the others pass a cusp."""
    balanced = Scene(alpha=0.0, c1=294.9)
    m, g, length = balanced.m1 + 2.0 * balanced.m2, balanced.g, balanced.l
    scene = balanced.replace(c2=m * g / length, F0=19.568500727545274)
    value = getattr(scene, name)
    (found,) = [
        f for f in find_folds(scene, name, [0.7 * value, 1.3 * value]) if abs(f.value / value - 1) < 1e-3
    ]
    assert found.kind == ("pitchfork" if name == "c1" else "cusp")


def test_a_line_through_a_cusp_says_that_it_is_one() -> None:
    found = find_folds(PAPER.replace(c1=float(CUSPS["unforced_stiff"]["values"][1])), "F0", [-50.0, 50.0])
    assert [(fold.kind, round(fold.value, 6)) for fold in found] == [("cusp", 0.0)]
    assert not found.complete
    assert "folds meet or touch there" in found.reason


@pytest.mark.parametrize(
    ("scene", "x", "y"),
    [
        (PAPER.replace(c1=0.0), ("F0", [-400.0, 400.0]), ("c2", [0.0, 400.0])),
        (PAPER.replace(g=0.0), ("F0", [-400.0, 400.0]), ("c1", [0.0, 400.0])),
        (PAPER.replace(g=0.0, F0=0.0), ("c1", [0.0, 400.0]), ("c2", [0.0, 400.0])),
    ],
    ids=["no spring c1", "no gravity", "no gravity, no force"],
)
def test_planes_with_degenerate_points_say_so(scene: Scene, x: Any, y: Any) -> None:
    found = trace_folds(scene, x, y)
    assert found.curves == ()
    assert not found.complete
    assert "equilibria are not isolated near" in found.reason


@pytest.mark.parametrize("names", [("F0", "c1"), ("F0", "c2"), ("c1", "c2"), ("F0", "m2"), ("l", "c1")])
def test_no_zero_on_the_torus_is_missed(names: tuple[str, str]) -> None:
    """Brute force: at a place (phi, theta) the gradient is solved for the two parameters, linearly.

    Wherever the determinant then changes its sign between neighbours of 500 x 500 places, with parameters in
    the rectangle, a curve passes.
    """
    rng = np.random.default_rng(len("".join(names)))
    ends = {"F0": (-300.0, 200.0), "c1": (1.0, 900.0), "c2": (2.0, 500.0), "m2": (0.5, 30.0), "l": (0.3, 3.0)}
    checked = 0
    for _ in range(3):
        scene = Scene(
            alpha=0.0,
            **{n: 10 ** rng.uniform(-0.3, 1.3) for n in ("m1", "m2")},
            **{n: 10 ** rng.uniform(1.0, 2.9) for n in ("c1", "c2")},
            l=rng.uniform(0.4, 2.5),
            F0=rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(0.5, 2.5),
        )
        ranges = [ends[name] for name in names]
        found = trace_folds(scene, *zip(names, ranges, strict=True))
        assert found.complete, found.reason
        zeros = zeros_on_the_torus(scene, names, ranges, 500)
        checked += len(zeros)
        if not len(zeros):
            continue
        known = np.concatenate(
            [
                np.column_stack([f(g) for g in (c.phi, c.theta) for f in (np.cos, np.sin)] + [
                    (v - low) / (high - low) for v, (low, high) in zip((c.x, c.y), ranges, strict=True)
                ])
                for c in found.curves
            ]
        )  # fmt: skip
        assert cKDTree(known).query(zeros)[0].max() < 0.03
    assert checked > 100


def zeros_on_the_torus(
    scene: Scene, names: tuple[str, str], ranges: list[tuple[float, float]], n: int
) -> np.typing.NDArray[np.float64]:
    """(cos phi, sin phi, cos theta, sin theta, u, v) of sign changes of the determinant."""
    angle = (np.arange(n) + 0.5) / n * 2.0 * np.pi
    phi, theta = np.meshgrid(angle, angle, indexing="ij")

    def gradient(first: Any, second: Any) -> tuple[Any, Any, Any, Any, Any, Any]:
        p = scene.parameters | {names[0]: first, names[1]: second}
        # Over l the loads are linear in l and c1 l together; c1 l stands for c1 where both vary.
        spring = p["c1"] if names == ("l", "c1") else p["c1"] * p["l"]
        a, b, f = (p["m1"] + p["m2"]) * p["g"] - p["c2"] * p["l"], p["m2"] * p["g"], p["F0"]
        pull = spring * np.cos(phi + theta)
        return (
            a * np.cos(phi) + f * np.sin(phi) - pull,
            b * np.sin(theta) + f * np.cos(theta) - pull,
            a, b, spring, f,
        )  # fmt: skip

    zero, by_first, by_second = (np.array(gradient(*at)[:2]) for at in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
    by_first, by_second = by_first - zero, by_second - zero
    with np.errstate(divide="ignore", invalid="ignore"):
        solvable = by_first[0] * by_second[1] - by_first[1] * by_second[0]
        first = -(zero[0] * by_second[1] - zero[1] * by_second[0]) / solvable
        second = -(by_first[0] * zero[1] - by_first[1] * zero[0]) / solvable
        _, _, a, b, spring, f = gradient(first, second)
        s = spring * np.sin(phi + theta)
        h11 = f * np.cos(phi) - a * np.sin(phi) + s
        determinant = h11 * (b * np.cos(theta) - f * np.sin(theta) + s) - s * s
        if names == ("l", "c1"):
            second = second / first
        parts = [(v - low) / (high - low) for v, (low, high) in zip((first, second), ranges, strict=True)]
        inside = (parts[0] > 0.0) & (parts[0] < 1.0) & (parts[1] > 0.0) & (parts[1] < 1.0)
        places = []
        for along in (0, 1):
            after = [np.roll(v, -1, along) for v in (determinant, solvable, inside, *parts)]
            near = (np.abs(after[3] - parts[0]) < 0.02) & (np.abs(after[4] - parts[1]) < 0.02)
            change = inside & after[2] & near & (determinant * after[0] < 0.0) & (solvable * after[1] > 0.0)
            places.append(
                np.column_stack(
                    [f(g[change]) for g in (phi, theta) for f in (np.cos, np.sin)]
                    + [v[change] for v in parts]
                )
            )
    return np.concatenate(places)


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
        (("F0", [1.0, 0.0, 2.0]), ("c1", [0.0, 1.0]), r"^axes\.F0.*must rise or fall throughout"),
        (("F0", [1.0]), ("c1", [0.0, 1.0]), r"^axes\.F0 = \[1\.0\]: must be two or more values"),
        (("F0", [0.0, 1.0]), ("c9", [0.0, 1.0]), r"^axes\.c9: unknown parameter"),
    ],
)
def test_wrong_planes_are_refused(x: Any, y: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        trace_folds(PAPER, x, y)


def test_an_array_for_the_name_of_a_parameter_is_refused_in_a_line() -> None:
    with pytest.raises(InputError, match=r"^axes\.\[\]: unknown parameter; allowed: m1, "):
        find_folds(PAPER, np.zeros(0), [0.0, 1.0])  # type: ignore[arg-type]
