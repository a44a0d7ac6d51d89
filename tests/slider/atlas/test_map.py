"""Maps of equilibria over grids."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from fastmech.atlas.snap import find_snap
from fastmech.errors import InputError
from fastmech.outcome import Outcome
from fastmech.scan_types.equilibrium_map import EquilibriumMapScan as EquilibriumMapScan
from fastmech.scene import Scene
from fastmech.slider.atlas.damping import trace_undamped
from fastmech.slider.atlas.folds import find_folds, trace_folds
from fastmech.slider.atlas.map import EquilibriumMap, map_equilibria
from fastmech.slider.equilibria import find_equilibria
from fastmech.slider.stability import classify

PAPER = Scene(c2=1100 / 3, alpha=0.0)
AXES = {
    "F0": np.linspace(-100.0, 100.0, 5),
    "c1": np.linspace(0.0, 500.0, 6),
    "c2": np.array([0.0, 172.0, 400.0]),
}


@pytest.fixture(scope="module")
def atlas() -> EquilibriumMap:
    return map_equilibria(PAPER, AXES, threads=1)


def test_shapes_and_types(atlas: EquilibriumMap) -> None:
    grid = (5, 6, 3)
    assert (
        atlas.count.shape
        == atlas.count_stable.shape
        == atlas.outcome.shape
        == atlas.fold_margin.shape
        == grid
    )
    assert atlas.phi.shape == atlas.theta.shape == atlas.energy.shape == atlas.morse_index.shape == (*grid, 6)
    assert atlas.eigenvalues.shape == (*grid, 6, 4)
    assert {a.dtype.name for a in (atlas.count, atlas.count_stable, atlas.outcome, atlas.morse_index)} == {
        "int8"
    }
    assert list(atlas.axes) == list(AXES)


def test_fallen_axes_are_turned_round(atlas: EquilibriumMap) -> None:
    turned = map_equilibria(PAPER, {name: values[::-1] for name, values in AXES.items()}, threads=1)
    np.testing.assert_array_equal(turned.count[::-1, ::-1, ::-1], atlas.count)
    np.testing.assert_allclose(turned.phi[::-1, ::-1, ::-1], atlas.phi, atol=1e-7)


def test_no_scene_is_refused_in_a_line() -> None:
    for wrong in (
        lambda: map_equilibria(None, {"c1": [1.0]}),  # type: ignore[arg-type]
        lambda: find_folds(None, "c1", [1.0, 2.0]),  # type: ignore[arg-type]
        lambda: find_snap(None),  # type: ignore[arg-type]
    ):
        with pytest.raises(InputError, match=r"^scene = None: must be a Scene"):
            wrong()


@pytest.mark.parametrize("trace", [trace_folds, trace_undamped])
def test_planes_that_are_none_are_refused_in_a_line(trace: Callable[..., object]) -> None:
    good = ("c1", [1.0, 2.0])
    for x, y, name in (
        (good, None, "y"),
        ({"c1": [1.0, 2.0]}, None, "x"),
        (("c1",), good, "x"),
        ("c1", good, "x"),
    ):
        with pytest.raises(InputError, match=rf"^{name} = .*: must be a parameter's name and its values$"):
            trace(PAPER, x, y)
    with pytest.raises(InputError, match=r"^scene = None: must be a Scene$"):
        trace(None, good, ("c2", [1.0, 2.0]))


def test_every_point_is_what_find_equilibria_finds(atlas: EquilibriumMap) -> None:
    for i, j, k in np.ndindex(5, 6, 3):
        scene = PAPER.replace(F0=AXES["F0"][i], c1=AXES["c1"][j], c2=AXES["c2"][k])
        found = find_equilibria(scene)
        n = len(found)
        assert atlas.count[i, j, k] == n
        assert atlas.outcome[i, j, k] == found.certificate.outcome
        assert atlas.count_stable[i, j, k] == found.kind.count("minimum")
        # A map starts from neighbours, so the last bits may differ; two proved balls must meet.
        for slot, e in enumerate(found):
            apart = np.hypot(
                np.angle(np.exp(1j * (atlas.phi[i, j, k, slot] - e.phi))),
                np.angle(np.exp(1j * (atlas.theta[i, j, k, slot] - e.theta))),
            )
            assert apart <= atlas.radius[i, j, k, slot] + e.radius + 1e-15
            h = atlas.hessian[i, j, k, slot]
            size = np.abs(e.hessian).max()
            np.testing.assert_allclose([[h[0], h[1]], [h[1], h[2]]], e.hessian, atol=1e-11 * size)
        np.testing.assert_allclose(atlas.energy[i, j, k, :n], found.energy, rtol=1e-13, atol=1e-10)
        np.testing.assert_array_equal(atlas.morse_index[i, j, k, :n], found.morse_index)
        assert np.isnan(atlas.phi[i, j, k, n:]).all()
        assert np.isnan(atlas.eigenvalues[i, j, k, n:]).all()
        assert (atlas.morse_index[i, j, k, n:] == -1).all()


def test_eigenvalues_are_those_of_classify(atlas: EquilibriumMap) -> None:
    scene = PAPER.replace(F0=50.0, c1=300.0, c2=400.0)
    for n, equilibrium in enumerate(find_equilibria(scene)):
        expected = classify(scene, equilibrium).eigenvalues
        np.testing.assert_allclose(atlas.eigenvalues[3, 3, 2, n], expected, rtol=1e-10)


CODES = {"asymptotically stable": 0, "stable": 1, "unstable": 2, "critical": 3}


def near_anything(rng: np.random.Generator) -> Scene:
    """A random scene; many beside the degenerate set, a fold or a symmetry, or with extreme damping."""
    m1, m2, l = 10 ** rng.uniform(-1, 2), 10 ** rng.uniform(-1, 2), rng.uniform(0.2, 4.0)
    c1, c2, F0, beta = 10 ** rng.uniform(0, 4), 10 ** rng.uniform(0, 4), rng.uniform(-1e3, 1e3), 121.0
    kind, tiny = rng.integers(8), 10.0 ** rng.uniform(-16, -6, 3)
    if kind == 0:
        c1, F0, c2 = 200.0 * tiny[0], 100.0 * tiny[1], (m1 + m2) * 9.80665 / l * (1.0 + tiny[2])
    elif kind == 1:
        F0 = 100.0 * tiny[1]
    elif kind == 2:
        beta = 10 ** rng.uniform(-9, 12)
    elif kind == 3:
        beta = 0.0
    scene = Scene(m1=m1, m2=m2, l=l, c1=c1, c2=c2, F0=F0, beta=beta, alpha=0.0)
    if kind == 4:
        snap = find_folds(scene, "F0", np.linspace(-2.1 * c1 * l, 2.1 * c1 * l, 40))
        scene = scene.replace(F0=snap[0].value * (1.0 + tiny[0])) if snap else scene
    return scene


def test_800_scenes_are_to_a_map_what_they_are_one_by_one() -> None:
    """Counts, outcomes, kinds and all four verdicts are the same, and the decay rates and frequencies."""
    rng = np.random.default_rng(5)
    critical = 0
    for _ in range(800):
        scene = near_anything(rng)
        found, one = find_equilibria(scene), map_equilibria(scene, {"F0": [scene.F0]}, threads=1)
        assert (one.count[0], one.outcome[0]) == (len(found), found.certificate.outcome)
        np.testing.assert_array_equal(one.morse_index[0, : len(found)], found.morse_index)
        for slot, e in enumerate(found):
            c = classify(scene, e)
            by_all = [c.sylvester.verdict, c.hurwitz.verdict, c.spectrum.verdict, c.verdict]
            assert list(one.verdict[0, slot]) == [CODES[verdict] for verdict in by_all]
            critical += 3 in one.verdict[0, slot]
            np.testing.assert_allclose(
                one.eigenvalues[0, slot], c.eigenvalues, atol=c.eigenvalue_errors.max()
            )
            if np.isinf(e.radius):
                continue  # merging: its place is a double root, which rounding moves by its square root
            # Beside the degenerate set rounding hides whether U rises or falls: NaN stands for a fall.
            lowest = np.nan_to_num([one.frequency[0, slot], c.natural_frequencies[0]]) ** 2
            highest = np.nan_to_num(c.natural_frequencies[1]) ** 2
            np.testing.assert_allclose(*lowest, rtol=1e-8, atol=1e-13 * highest)
            np.testing.assert_allclose(
                1.0 / one.decay_time[0, slot], c.decay_rate, rtol=1e-8, atol=c.eigenvalue_errors.max()
            )
    assert critical > 40


def test_verdicts_near_a_missed_mode() -> None:
    """The Hurwitz test is silent, the joint verdict is not (the design's table of vanishing damping)."""
    scene = Scene(F0=166.722372, c2=17.35486052, alpha=0.0)
    one = map_equilibria(scene, {"c1": [162.5]})
    slot = int(np.nanargmin(np.hypot(one.phi[0], one.theta[0] - 0.3)))
    assert list(one.verdict[0, slot]) == [1, 3, 3, 0]
    assert one.decay_time[0, slot] > 1e8


@pytest.mark.parametrize("threads", [2, 3])
def test_same_bits_for_any_number_of_threads(threads: int) -> None:
    axes = {"F0": np.linspace(-300.0, 300.0, 60), "c2": np.linspace(0.0, 500.0, 30)}
    one, many = map_equilibria(PAPER, axes, threads=1), map_equilibria(PAPER, axes, threads=threads)
    arrays = [name for name, value in vars(one).items() if isinstance(value, np.ndarray)]
    assert {"phi", "theta", "energy", "sheet", "frequency"} <= set(arrays)
    for name in arrays:
        assert getattr(one, name).tobytes() == getattr(many, name).tobytes(), name


def test_progress_adds_up_to_the_grid() -> None:
    finished: list[int] = []
    map_equilibria(PAPER, {"c1": np.linspace(0.0, 500.0, 70_000)}, progress=finished.append)
    assert sum(finished) == 70_000
    assert len(finished) > 1


def test_decaying_force_rests_without_it() -> None:
    atlas = map_equilibria(PAPER, {"alpha": [0.0, 0.7]})
    assert list(atlas.count) == [4, 6]


def test_degenerate_point_is_marked() -> None:
    scene = PAPER.replace(F0=0.0, c2=22 * 9.80665 / 1.25)
    atlas = map_equilibria(scene, {"c1": [0.0, 10.0]})
    assert list(atlas.outcome) == [Outcome.DEGENERATE, Outcome.COMPLETE]
    assert list(atlas.count) == [0, 4]
    assert np.isnan(atlas.eigenvalues[0]).all()


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({}, r"^axes: 0 given"),
        ({name: [1.0] for name in ("m1", "m2", "m3", "l")}, r"^axes: 4 given"),
        ({"cc1": [1.0]}, r"^axes\.cc1: unknown parameter; did you mean 'c1'\?"),
        ({"c1": []}, r"^axes\.c1: shape \(0,\)"),
        ({"c1": [[1.0]]}, r"^axes\.c1: shape \(1, 1\)"),
        ({"c1": ["stiff"]}, r"^axes\.c1 = \['stiff'\]: must be a sequence of numbers$"),
        ({"c1": ["1", "2"]}, r"^axes\.c1 = \['1', '2'\]: must be a sequence of numbers$"),
        ({"c1": [True]}, r"^axes\.c1 = \[True\]: must be a sequence of numbers$"),
        ({"c1": [1j]}, r"^axes\.c1 = \[1j\]: must be a sequence of numbers$"),
        ({"c1": [[1.0], [1.0, 2.0]]}, r"^axes\.c1 = .*: must be a sequence of numbers$"),
        ({"c1": "12"}, r"^axes\.c1 = '12': must be a sequence of numbers$"),
        ({"F0": None}, r"^axes\.F0 = None: must be a sequence of numbers$"),
        ({"F0": [None, 1.0]}, r"^axes\.F0 = \[None, 1\.0\]: must be a sequence of numbers$"),
        ({"F0": 5.0}, r"^axes\.F0: shape \(\): must be one-dimensional"),
        ({7: [1.0]}, r"^axes\.7: unknown parameter; allowed: m1, "),
        ("F0", r"^axes = 'F0': must map parameter names to their values$"),
        (["F0", [1.0]], r"^axes = \['F0', \[1\.0\]\]: must map parameter names"),
        (None, r"^axes = None: must map parameter names"),
        ({"c1": [1.0, -2.0]}, r"^axes\.c1: scene\.c1 = -2\.0: "),
        ({"F0": [np.nan]}, r"^axes\.F0: scene\.F0 = nan: "),
        (
            {"F0": (0, 100, 5)},
            r"^axes\.F0 = \(0, 100, 5\): may be start, stop and number; give numpy\.linspace\(0, 100, 5\)",
        ),
        (
            {"F0": (0, 100, 500)},
            r"^axes\.F0 = \(0, 100, 500\): may be start, stop and number; .*, or a list of three values$",
        ),
        (
            {"F0": [0, 100, 5]},
            r"^axes\.F0\[2\] = 5 after 100: must rise or fall throughout, no value twice; for 5 values",
        ),
        (
            {"c1": [1.0, 2.0, 2.0, 3.0]},
            r"^axes\.c1\[2\] = 2 after 2: must rise or fall throughout, no value twice$",
        ),
        ({"c1": [3.0, 2.0, 2.5, 1.0]}, r"^axes\.c1\[2\] = 2\.5 after 2: must rise or fall throughout"),
        ({"c1": [1.0, 1.0]}, r"^axes\.c1\[1\] = 1 after 1: must rise or fall"),
        (
            dict.fromkeys(("c1", "c2"), np.arange(30_000.0)),
            r'^axes: 9e\+08 points would take .* GiB on the way, .* run, kind = "equilibrium_map"$',
        ),
    ],
)
def test_wrong_axes_are_refused(axes: dict[str, list[float]], message: str) -> None:
    with pytest.raises(InputError, match=message):
        map_equilibria(PAPER, axes)


@pytest.mark.parametrize("threads", [0, -1, 1.5, True])
def test_wrong_thread_count_is_refused(threads: int) -> None:
    with pytest.raises(InputError, match=r"^threads = "):
        map_equilibria(PAPER, {"c1": [1.0]}, threads=threads)


def test_progress_that_is_no_function_is_refused() -> None:
    with pytest.raises(InputError, match=r"^progress = 3: .*finished points"):
        map_equilibria(PAPER, {"c1": [1.0]}, progress=3)  # type: ignore[arg-type]


def test_a_force_that_decays_is_no_axis() -> None:
    """F0 means the load at rest in maps and in searches for folds; where it decays each refuses it."""
    loads = [1.0, 2.0]
    for search in (
        lambda: map_equilibria(Scene(), {"F0": loads}),
        lambda: find_folds(Scene(), "F0", loads),
        lambda: trace_folds(Scene(), ("c1", loads), ("F0", loads)),
        lambda: EquilibriumMapScan(axes={"F0": {"start": 1.0, "stop": 2.0, "num": 2}}).check(Scene()),
    ):
        with pytest.raises(InputError, match=r"^scene\.alpha = 0\.7: must be 0 1/s where F0 is an axis"):
            search()
    # Over other parameters each takes the force for what is left of it.
    stiffness = np.linspace(0.0, 400.0, 50)
    free = PAPER.replace(F0=0.0)
    decaying = PAPER.replace(alpha=0.7)
    assert find_folds(decaying, "c1", stiffness) == find_folds(free, "c1", stiffness) != ()
    one, two = (map_equilibria(scene, {"c1": stiffness}) for scene in (decaying, free))
    np.testing.assert_array_equal(one.count, two.count)
    ends = find_snap(decaying)  # names the load
    assert "decays" in ends.fading
    assert dataclasses.replace(ends, fading="") == find_snap(free)


def test_alpha_moves_no_fold() -> None:
    with pytest.raises(InputError, match=r"^axes\.alpha: equilibria do not depend on how fast"):
        find_folds(PAPER, "alpha", [0.0, 1.0])


def test_no_saddle_is_called_settling() -> None:
    """Sylvester's sign rules every criterion: beside a real positive eigenvalue that LAPACK gave, too."""
    line = map_equilibria(PAPER.replace(c1=131.0), {"F0": np.linspace(-400.0, 400.0, 801)})
    unstable = line.morse_index > 0
    assert unstable.sum() > 1500
    assert (line.verdict[unstable] == line.verdict[unstable][0, 0]).all(axis=-1).mean() > 0.999
    assert not np.isin(line.verdict[unstable], line.verdict[line.morse_index == 0]).any()
    real = np.abs(line.eigenvalues.imag) > 0.0
    assert (np.abs(line.eigenvalues.imag[real]) > 1e-9).all()
