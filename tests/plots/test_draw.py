"""Pictures of every kind of scan: units, no overlaps, the right marks; on real results and on edge cases."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
import sympy
from matplotlib import pyplot
from matplotlib._pylab_helpers import Gcf
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from plots.legibility import assert_legible, settings
from scan_types.values import run_scan

from fastmech.basins.map import map_basins
from fastmech.loads import Harmonic
from fastmech.mechanisms import pendulum_chain, slider_pendulum, von_mises_truss, ziegler_column
from fastmech.models.coordinates import angles, lengths
from fastmech.models.equilibria import find_equilibria
from fastmech.models.mechanism import Mechanism
from fastmech.plots import style
from fastmech.plots.basins import Slice, decisive
from fastmech.plots.disturbed import _about
from fastmech.plots.erosion import draw_stability
from fastmech.plots.map_view import View
from fastmech.results import Dataset, Variable
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.map_layout import drawing_group
from fastmech.scan_types.request import RunContext
from fastmech.scene import Scene
from fastmech.slider.atlas.map import map_equilibria
from fastmech.store.read import open_results

CONSTANT = Scene(alpha=0.0)
# Two minima, three saddles and a maximum (the counting law's other case has one minimum).
BISTABLE = Scene(alpha=0.0, F0=85.3, c1=294.9, c2=92.85)
# Without gravity, force and the spring c1 every theta is at rest: no isolated equilibrium.
DEGENERATE = Scene(g=0.0, F0=0.0, c1=0.0)
SMALL = {"trajectories": 24, "t_end": 40.0, "dt": 0.02, "linear_directions": 16}


def axis(start: float, stop: float, num: int) -> dict[str, Any]:
    return {"start": start, "stop": stop, "num": num}


def run(kind: str, scene: Scene, **fields: Any) -> Dataset:
    return run_scan(scan_kinds()[kind](**fields), scene, RunContext(threads=1))


def draw(kind: str, scene: Scene, **fields: Any) -> dict[str, Figure]:
    return scan_kinds()[kind].draw(run(kind, scene, **fields), scene.parameters)


def panel(figure: Figure, title: str) -> Axes:
    (found,) = [axes for axes in figure.axes if title in axes.get_title()]
    return found


def handles(axes: Axes) -> list[str]:
    return [text.get_text() for text in axes.get_legend().get_texts()]


CASES: dict[str, tuple[str, Scene, dict[str, Any], set[str]]] = {
    "motion": (
        "motion",
        Scene(),
        {"outputs": 101},
        {"angles", "coordinates", "reactions", "energies", "residuals"},
    ),
    "motion at rest": (
        "motion",
        Scene(F0=0.0),
        {"start": {"phi": np.pi / 2}, "t_end": 1.0, "outputs": 5},
        {"angles", "coordinates", "reactions", "energies", "residuals"},
    ),
    "equilibria": ("equilibria", CONSTANT, {}, {"potential", "eigenvalues", "positions"}),
    "six equilibria": ("equilibria", BISTABLE, {}, {"potential", "eigenvalues", "positions"}),
    "no isolated equilibrium": ("equilibria", DEGENERATE, {}, {"potential"}),
    "disturbed motion": ("disturbed_motion", CONSTANT, {"outputs": 101}, {"angles", "norm"}),
    "six disturbed motions": ("disturbed_motion", BISTABLE, {"outputs": 101}, {"angles", "norm"}),
    "disturbed": (
        "disturbed",
        CONSTANT,
        SMALL,
        {"outcomes", "time_to_return", "excursions", "linear_range"},
    ),
    "disturbed, six equilibria": (
        "disturbed",
        BISTABLE,
        SMALL | {"radius": 1.0},
        {"outcomes", "time_to_return", "excursions", "linear_range"},
    ),
    "disturbed too briefly": (
        "disturbed",
        CONSTANT,
        SMALL | {"t_end": 0.5, "trajectories": 1},
        {"outcomes", "time_to_return", "excursions", "linear_range"},
    ),
    "map": (
        "equilibrium_map",
        CONSTANT,
        {"axes": {"F0": axis(-400.0, 400.0, 9), "c1": axis(0.0, 400.0, 7)}},
        {"count", "angles", "barrier", "decay"},
    ),
    "map with bistable points": (
        "equilibrium_map",
        CONSTANT,
        {"axes": {"c2": axis(0.0, 300.0, 9), "F0": axis(0.0, 200.0, 5)}},
        {"count", "angles", "barrier", "decay"},
    ),
    "map with degenerate points": (
        "equilibrium_map",
        DEGENERATE,
        {"axes": {"c1": axis(0.0, 100.0, 3), "c2": axis(0.0, 100.0, 3)}},
        {"count", "angles", "barrier"},
    ),
    "map of nothing": (
        "equilibrium_map",
        DEGENERATE,
        {"axes": {"m1": axis(1.0, 2.0, 2), "m2": axis(1.0, 2.0, 2)}},
        {"count"},
    ),
    "map over three": (
        "equilibrium_map",
        CONSTANT,
        {"axes": {"c2": axis(0.0, 400.0, 4), "c1": axis(50.0, 200.0, 3), "F0": axis(-100.0, 100.0, 3)}},
        {"count", "angles", "barrier", "decay"},
    ),
    "line": ("equilibrium_map", CONSTANT, {"axes": {"c2": axis(0.0, 800.0, 41)}}, {"branches"}),
    "line, second axis of one point": (
        "equilibrium_map",
        CONSTANT,
        {"axes": {"c1": axis(162.5, 162.5, 1), "c2": axis(0.0, 800.0, 5)}},
        {"branches"},
    ),
    "point": ("equilibrium_map", CONSTANT, {"axes": {"c2": axis(100.0, 100.0, 1)}}, {"branches"}),
}


@pytest.mark.parametrize("case", CASES)
def test_pictures_are_legible(case: str):
    kind, scene, fields, names = CASES[case]
    before = settings()
    figures = draw(kind, scene, **fields)
    assert set(figures) == names
    for figure in figures.values():
        assert_legible(figure)
    assert settings() == before
    assert not Gcf.figs, "pyplot keeps a figure"


def test_extremes_are_named():
    dataset = run("motion", Scene(), outputs=201)
    figure = scan_kinds()["motion"].draw(dataset, {})["reactions"]
    tension = dataset["rod_m1m2"].data
    (axes,) = [axes for axes in figure.axes if axes.get_title(loc="left").startswith("Rod M1M2")]
    assert f"max {max(tension):.4g} N" in axes.get_title(loc="right")
    assert f"min {min(tension):.4g} N" in axes.get_title(loc="right")


def test_every_equilibrium_is_marked():
    dataset = run("equilibria", BISTABLE)
    axes = scan_kinds()["equilibria"].draw(dataset, BISTABLE.parameters)["potential"].axes[0]
    marked = {line.get_label(): len(line.get_xdata()) for line in axes.lines}
    assert marked.pop("level of a saddle") == 0  # the legend's entry
    codes = dataset["kind"].codes
    energies = np.sort(dataset["energy"].data[dataset["kind"].data == codes["saddle"]])
    levels = [drawn.levels for drawn in axes.collections if hasattr(drawn, "levels")]
    assert any(np.array_equal(energies, of) for of in levels)
    assert marked == {kind: int(np.sum(dataset["kind"].data == codes[kind])) for kind in marked}
    assert marked == {"minimum": 2, "saddle": 3, "maximum": 1}
    assert {text.get_text() for text in axes.texts} == set("012345")


@pytest.mark.slow
def test_shares_of_the_bars_sum_up():
    figure = draw("disturbed", BISTABLE, **SMALL | {"radius": 1.0})["outcomes"]
    widths: dict[float, float] = {}
    for bar in figure.axes[0].patches:
        row = round(bar.get_y() + bar.get_height() / 2)
        widths[row] = widths.get(row, 0.0) + bar.get_width()
    assert widths == pytest.approx(dict.fromkeys(range(6), 100.0))


def test_failures_are_no_part_of_where_motions_end():
    """Steps far too long: bars hold the motions that were computed, and the rest is told apart."""
    scene = Scene(c1=2000.0, c2=8000.0, beta=20.0, alpha=0.0)
    dataset = run("disturbed", scene, trajectories=64, radius=1.0, t_end=20.0, dt=0.05, linear_directions=1)
    figures = scan_kinds()["disturbed"].draw(dataset, scene.parameters)
    for figure in figures.values():
        assert_legible(figure)
    codes = dataset["outcome"].codes
    failing = [codes[name] for name in ("not_finite", "step_too_large", "not_converged")]
    axes = figures["outcomes"].axes[0]
    told = {round(text.xy[1]): text.get_text() for text in axes.texts if hasattr(text, "xy")}
    lost = 100.0 * np.isin(dataset["outcome"].data, failing).mean(axis=1)
    assert lost.max() > 20.0
    for row, share in enumerate(lost):
        bars = [bar for bar in axes.patches if round(bar.get_y() + bar.get_height() / 2) == row]
        assert sum(bar.get_width() for bar in bars) == pytest.approx(100.0 - share)
        assert told[row].startswith("failed, no end known:" if share else "")
    known = {text.get_text() for text in figures["outcomes"].legends[0].get_texts()}
    assert not known & {"not finite", "step too large", "not converged"}


@pytest.mark.parametrize(
    ("kept", "told"),
    [
        ({"outcome", "end_equilibrium"}, "full turns on the way"),
        ({"outcome"}, "which other equilibrium"),
        ({"outcome", "turns_phi", "turns_theta"}, "which other equilibrium"),
    ],
)
def test_outcomes_are_drawn_from_what_was_kept(kept: set[str], told: str):
    dataset = run("disturbed", BISTABLE, **SMALL | {"t_end": 0.5})
    codes = dataset["outcome"].codes
    # Of every 8: 4 returned, 1 at its own some turns further, 2 at the next, 1 still moving.
    row = np.arange(6)[:, None]
    outcome = np.repeat([codes["returned"], codes["elsewhere"], codes["undecided"]], [12, 9, 3])
    end = np.where(np.arange(24) < 15, row, np.where(np.arange(24) < 21, (row + 1) % 6, -1))
    changed = {
        "outcome": replace(dataset["outcome"], data=np.tile(outcome, (6, 1)).astype(np.int8)),
        "end_equilibrium": replace(dataset["end_equilibrium"], data=end.astype(np.int8)),
    }
    apart = {f"{of}_{angle}" for of in ("turns", "excursion") for angle in ("phi", "theta")}
    left_out = {"outcome", "end_equilibrium", "time_to_return", *apart} - kept
    variables = {n: v for n, v in {**dataset.variables, **changed}.items() if n not in left_out}
    figures = scan_kinds()["disturbed"].draw(
        Dataset(variables, dataset.attrs, dataset.groups), BISTABLE.parameters
    )
    assert set(figures) == {"outcomes", "linear_range"}
    figure = figures["outcomes"]
    assert_legible(figure)
    assert told in figure.axes[0].get_title()
    apart = [50.0, 12.5, 25.0, 12.5] if "end_equilibrium" in kept else [50.0, 37.5, 12.5]
    for place in range(6):
        bars = [b for b in figure.axes[0].patches if round(b.get_y() + b.get_height() / 2) == place]
        assert sorted(b.get_width() for b in bars) == pytest.approx(sorted(apart))
        assert sum(b.get_width() for b in bars if b.get_hatch()) == (12.5 if len(apart) == 4 else 0.0)


def test_older_files_are_drawn_by_the_meanings_of_their_codes():
    """Once outcomes had numbers of their own, and motions at an unstable equilibrium another name."""
    dataset = run("disturbed", BISTABLE, **SMALL | {"t_end": 0.5})
    names = "returned elsewhere at_unstable undecided not_finite step_too_large not_converged"
    codes = {"flag_values": np.arange(7, dtype=np.int8), "flag_meanings": names}
    outcome = np.tile(np.repeat([0, 2, 3, 5], 6), (6, 1)).astype(np.int8)
    attrs = dict(dataset["outcome"].attrs) | codes
    changed = {"outcome": replace(dataset["outcome"], data=outcome, attrs=attrs)}
    older = Dataset({**dataset.variables, **changed}, dataset.attrs, dataset.groups)
    figure = scan_kinds()["disturbed"].draw(older, BISTABLE.parameters)["outcomes"]
    known = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"still at an unstable one", "not decided"} <= known
    for place in range(6):
        bars = [b for b in figure.axes[0].patches if round(b.get_y() + b.get_height() / 2) == place]
        assert [b.get_width() for b in bars] == [25.0, 25.0, 25.0]


def test_curves_of_undamped_equilibria_of_older_files_are_drawn():
    with open_results(Path(__file__).parents[1] / "older" / "schema_2.h5") as results:
        section, scene = results["map_F0_c1"].load(), results.scene_of("map_F0_c1")
    assert "unreached_curve" in section.groups["curves"]
    figure = scan_kinds()["equilibrium_map"].draw(section, scene)["count"]
    told = [text.get_text() for text in figure.legends[0].get_texts()]
    assert any(text.startswith("damping misses a mode") for text in told)


def test_counts_have_their_legend_and_the_scene_its_star():
    figure = draw("equilibrium_map", CONSTANT, axes={"F0": axis(-100.0, 100.0, 3), "c2": axis(0.0, 400.0, 5)})
    counts = panel(figure["count"], "Number of equilibria")
    assert [text.split()[0] for text in handles(counts)] == ["4", "6", "the"]
    (star,) = [line for line in counts.lines if line.get_marker() == "*"]
    assert (star.get_xdata()[0], star.get_ydata()[0]) == (100.0, 366.67)


@pytest.mark.parametrize(
    ("low", "high", "told"),
    [
        (8.2, 13.0, ["9", "10", "11", "12", "13"]),
        (0.9, 9.0, ["1", "2", "5"]),
        (0.02, 1.5, ["0.02", "0.05", "0.1", "0.2", "0.5", "1"]),
        (0.01, 15.0, ["0.01", "0.03", "0.1", "0.3", "1", "3", "10"]),
    ],
)
def test_logarithmic_axes_have_three_labels_or_more(low: float, high: float, told: list[str]):
    axes = Figure().subplots()
    axes.set(yscale="log", ylim=(low, high))
    style.logarithmic(axes.yaxis)
    ticks = [at for at in axes.yaxis.get_majorticklocs() if low <= at <= high]
    assert axes.yaxis.get_major_formatter().format_ticks(ticks) == told


def test_angles_that_go_round_have_cyclic_colours_that_are_not_white():
    scene = Scene(m1=3.0, m2=5.0, m3=2.0, l=0.6, c1=240.0, c2=60.0, alpha=0.0)
    grid = {"F0": axis(-400.0, 400.0, 9), "c2": axis(0.0, 400.0, 9)}
    (mesh, *_) = draw("equilibrium_map", scene, axes=grid)["angles"].axes[0].collections
    assert (mesh.norm.vmin, mesh.norm.vmax) == (-np.pi, np.pi)
    low, high = mesh.to_rgba(np.array([-np.pi, np.pi]))
    np.testing.assert_allclose(low, high, atol=0.02)
    assert mesh.cmap(np.linspace(0.0, 1.0, 64))[:, :3].min(axis=1).max() < 0.75


def test_titles_tell_what_was_run():
    told = "24 disturbances up to 0.5 rad of each equilibrium, runs to 40 s\n"
    for figure in draw("disturbed", CONSTANT, **SMALL).values():
        (axes,) = (axes for axes in figure.axes if axes.get_label() != "<colorbar>")
        assert f"\n{told}" in axes.get_title()
    places = {
        name: Variable(("equilibrium",), np.zeros(1), unit) for name, unit in (("u", "m"), ("v", "rad"))
    }
    of_mechanism = {"trajectories": 24, "radius": 0.5, "t_end": 40.0, "coordinate_names": ("u", "v")}
    about = _about(Dataset(places, of_mechanism)).replace("\xa0", " ")
    assert f"{about}\n" == told  # the norm has the last coordinate's unit
    starts = {"phi": axis(-3.0, 3.0, 9), "theta": axis(-3.0, 3.0, 9)}
    figures = draw("basins", CONSTANT, axes=starts, t_end=7.5)
    assert figures["labels"].axes[0].get_title().endswith("starts at rest; runs to 7.5 s")
    motion = draw("motion", Scene(), start={"phi": 1.5}, t_end=1.0, outputs=5)["angles"]
    assert motion.get_suptitle().startswith("Motion from φ = 1.5, θ = 0 rad, φ' = 0, θ' = 0 rad/s\n")


@pytest.mark.parametrize(("spread", "alone"), [(1e-12, True), (1e-3, False)])
def test_a_spread_of_rounding_is_one_colour_with_its_value(spread: float, alone: bool):
    field = 1.728 * (1.0 + spread * np.linspace(0.0, 1.0, 400).reshape(20, 20))
    with style.style():
        figure, axes = style.new_panel()
        norm = style.log_colors(float(field.min()), float(field.max()))
        bar = figure.colorbar(style.shade(axes, range(20), range(20), field, norm=norm))
        assert style.tell_one_value(bar) == alone
    assert (len(np.unique(bar.mappable.to_rgba(field).reshape(-1, 4), axis=0)) == 1) == alone
    if alone:
        assert [text.get_text() for text in bar.ax.get_yticklabels()] == ["1.728"]


def test_what_is_the_same_everywhere_is_told_and_not_drawn():
    """q'' + 2 d q' + (k + P) sin q = 0 falls as exp(-d t) wherever it swings."""
    q = angles("q")
    d, k, P = sympy.symbols("d k P")
    pendulum = Mechanism(
        q, {"d": 0.5, "k": 3.0, "P": 1.0}, kinetic=q.dot**2 / 2, potential=-(k + P) * sympy.cos(q),
        dissipation=d * q.dot**2,
    )  # fmt: skip
    values = np.linspace(2.0, 5.0, 7)
    found = map_equilibria(pendulum, {"k": values, "P": values})
    figure = scan_kinds()["equilibrium_map"].draw(found.dataset(), pendulum.parameters)["decay"]
    (axes,) = figure.axes
    assert not axes.collections
    (said,) = axes.texts
    assert said.get_text() == "time to fall to 1/e [s]: 2 at every stable equilibrium, so no map"


def test_a_coordinate_that_is_the_same_everywhere_is_told_beside_maps_of_others():
    """The truss rests at x = 0."""
    truss, values = von_mises_truss(), {"P": np.linspace(1.0, 60.0, 5), "rise": [0.4, 0.6, 0.7]}
    found = map_equilibria(truss, values)
    figure = scan_kinds()["equilibrium_map"].draw(found.dataset(), truss.parameters)["angles"]
    told = "position x [m]: 0 at every stable equilibrium, so no map"
    assert figure.get_suptitle().splitlines()[-1] == told
    assert [axes.get_title()[:4] for axes in figure.axes if axes.get_title()] == ["y of", "y of"]


def test_hollow_marks_of_eigenvalues_are_in_the_legend():
    """Those of mirror images lie on each other, those of a pendulum, +-i w and +-w, do not."""
    for mechanism, covered in ((von_mises_truss().replace(P=0.0), True), (pendulum_chain(1), False)):
        figure = draw("equilibria", mechanism)["eigenvalues"]
        hollow = [line for line in figure.axes[0].lines if line.get_markerfacecolor() == "none"]
        texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert bool(hollow) == covered
        assert ("hollow: under another's mark" in texts) == covered


def test_black_and_white_are_the_styles_own_in_axes_of_users():
    found = find_equilibria(BISTABLE)
    with matplotlib.rc_context({"text.color": "#ffff00", "axes.facecolor": "#000080"}):
        axes = found.plot()
        box = next(text.get_bbox_patch() for text in axes.texts)
        assert to_hex(box.get_facecolor()) == "#000080"
        marks = [line for line in axes.lines if line.get_marker() == "o"]
        assert {(line.get_markeredgecolor(), line.get_markerfacecolor()) for line in marks} == {
            ("#ffff00", "#000080")
        }
        level = next(line for line in axes.lines if line.get_label() == "level of a saddle")
        assert level.get_color() == "#ffff00"
        assert style.entry("a").get_color() == style.color(6) == "#ffff00"
        with style.style():  # the package's own pictures stay as they are
            assert (style.ink(), style.paper()) == ("black", "white")
    pyplot.close(axes.figure)


def test_no_star_for_a_scene_outside_the_map():
    figure = draw("equilibrium_map", CONSTANT, axes={"F0": axis(-9.0, 9.0, 2), "c2": axis(0.0, 400.0, 2)})
    lines = panel(figure["count"], "Number of equilibria").lines
    assert not [line for line in lines if line.get_marker() == "*"]


def test_unsettled_points_are_marked():
    figure = draw("equilibrium_map", DEGENERATE, axes={"c1": axis(0.0, 9.0, 2), "c2": axis(1.0, 9.0, 3)})
    axes = panel(figure["count"], "Number of equilibria")
    assert "degenerate (3)" in handles(axes)
    (crosses,) = [line for line in axes.lines if line.get_marker() == "x"]
    assert list(crosses.get_xdata()) == [0.0] * 3


def test_mirror_images_keep_their_order():
    """Without a force both minima are equally deep but for rounding: a map shows one side of them."""
    grid = {"c1": axis(100.0, 200.0, 11), "c2": axis(40.0, 60.0, 5)}
    figure = draw("equilibrium_map", Scene(alpha=0.0, F0=0.0), axes=grid)["angles"]
    first = panel(figure, "φ of the deepest").collections[0].get_array()
    second = panel(figure, "φ of the second").collections[0].get_array()
    assert (np.ma.compressed(first) <= np.ma.compressed(second)).all()


def test_pictures_tell_their_scene():
    grid = {"F0": axis(-100.0, 100.0, 3), "c2": axis(0.0, 400.0, 3)}
    titles = {
        "the paper's Table 1 with alpha = 0 1/s": draw("equilibrium_map", CONSTANT, axes=grid)["count"],
        "the paper's Table 1 with c1 = 294.9 N/m, alpha = 0 1/s": draw(
            "equilibrium_map", BISTABLE, axes=grid
        )["decay"],
        "the paper's Table 1 with l = 2 m, the force decayed": draw(
            "equilibrium_map", Scene(l=2.0), axes={"c1": axis(1.0, 2.0, 2), "c2": axis(1.0, 2.0, 2)}
        )["count"],
    }
    for title, figure in titles.items():
        told = figure.get_suptitle() or figure.axes[0].get_title()
        assert " ".join(told.split()).endswith(title)
    line = draw("equilibrium_map", BISTABLE, axes={"F0": axis(-800.0, 800.0, 161)})["branches"].axes[0]
    # The folds of data/folds.toml.
    assert line.get_title() == (
        "Equilibria over F0; folds at -671.163, 671.163 N\n"
        "the paper's Table 1 with c1 = 294.9 N/m, c2 = 92.85 N/m,\nalpha = 0 1/s"
    )
    frozen = {0.0: "F0 = 0 N, alpha = 0 1/s", 25.0: "F0 = 25 N, alpha = 0 1/s"}
    for force, told in frozen.items():
        scene = Scene(F0=force, alpha=0.0)
        assert (
            scan_kinds()["equilibria"]
            .draw(run("equilibria", scene), scene.parameters)["positions"]
            .get_suptitle()
            .endswith(f"the paper's Table 1 with {told}")
        )
    assert {"stable, number 0", "stable, number 1"} <= {curve.get_label() for curve in line.lines}


def test_pitchforks_are_named_and_missing_proofs_told():
    """C = a b / (a + b): see ``tests/slider/atlas/test_folds.py``."""
    unforced = Scene(alpha=0.0, F0=0.0, c2=92.85)
    falling = {"c1": axis(120.0, 1.0, 60)}
    axes = draw("equilibrium_map", unforced, axes=falling)["branches"].axes[0]
    assert axes.get_title().startswith("Equilibria over c1; pitchfork at 43.1747 N/m\n")
    marks = [line for line in axes.lines if line.get_label() == "pitchfork (symmetric)"]
    assert [float(x) for x in marks[0].get_xdata()] == pytest.approx([43.17473449000661])
    grid = {"c1": axis(1.0, 400.0, 8), "c2": axis(1.0, 800.0, 9)}
    dataset = run("equilibrium_map", unforced, axes=grid)
    figure = scan_kinds()["equilibrium_map"].draw(dataset, unforced.parameters)["count"]
    (legend,) = figure.legends
    assert {text.get_text() for text in legend.get_texts()} >= {
        "pitchfork (symmetric) of resting positions", "pitchfork (symmetric) of unstable equilibria"
    }  # fmt: skip
    dataset.groups["curves"]["fold_proof"].data[0] = "not proved near c1 = 1 N/m"
    figure = scan_kinds()["equilibrium_map"].draw(dataset, unforced.parameters)["count"]
    assert "not proved that these are all folds" in figure.get_suptitle()


def test_stable_branches_are_solid_and_unstable_dashed():
    dataset = run("equilibrium_map", CONSTANT, axes={"F0": axis(-3.0, 3.0, 41)})
    axes = scan_kinds()["equilibrium_map"].draw(dataset, CONSTANT.parameters)["branches"].axes[0]
    looks = {line.get_label(): line for line in axes.lines}
    assert looks["stable"].get_linestyle() == "-"
    assert looks["unstable: saddle"].get_linestyle() == "--"
    assert len(looks["fold"].get_xdata()) == 2


@pytest.mark.parametrize(
    ("low", "high", "told"),
    [
        (-3.2, 3.2, ["−π", "−π/2", "0", "π/2", "π"]),
        (-6.0, 6.0, ["−3π/2", "−π", "−π/2", "0", "π/2", "π", "3π/2"]),
        (-20.0, 20.0, ["−6π", "−4π", "−2π", "0", "2π", "4π", "6π"]),
        (-1.5, 1.5, ["−π/4", "0", "π/4"]),
        (0.1, 0.3, None),
    ],
)
def test_angles_have_ticks_at_parts_of_a_turn(low, high, told):
    axes = Figure().subplots()
    axes.set(xlim=(low, high), ylim=(-3.2, 3.2))
    style.angle_ticks(axes, x="rad", y="m")
    for axis, expected in ((axes.xaxis, told), (axes.yaxis, None)):
        inside = [
            x for x in axis.get_majorticklocs() if np.prod(np.subtract(axis.get_view_interval(), x)) <= 0
        ]
        found = axis.get_major_formatter().format_ticks(inside)
        assert found == expected if expected else not any("π" in one for one in found)


def test_starts_captured_by_the_first_look_are_not_on_the_scale():
    """Starts in the well, below the barrier, have the least time of all."""
    grid = {"phi": axis(-3.0, 3.0, 31), "theta": axis(-3.0, 3.0, 31)}
    dataset = run("basins", BISTABLE, axes=grid)
    figure = scan_kinds()["basins"].draw(dataset, BISTABLE.parameters)["capture_time"]
    times = dataset["capture_time"].data
    least = np.nanmin(times)
    (legend,) = figure.legends
    told = [text.get_text() for text in legend.get_texts()]
    share = style.share(times == least)
    assert f"already when first looked at, after {least:.2g} s: {share}" in told
    (bar,) = [axes for axes in figure.axes if axes.get_ylabel() == "capture time [s]"]
    assert bar.get_ylim()[0] > least
    assert "\nmedian" in figure.axes[0].get_title()


def resting(system: Mechanism) -> dict[str, Figure]:
    """Pictures of where a mechanism rests."""
    found = find_equilibria(system)
    dataset = found.dataset()
    drawn = Dataset(dataset.variables, dataset.attrs, drawing_group(system, found.position))
    return scan_kinds()["equilibria"].draw(drawn, system.parameters)


@pytest.mark.parametrize(("made", "lowest"), [(partial(pendulum_chain, 3), 3), (ziegler_column, 1)])
def test_positions_have_room_for_their_ticks_and_labels_below(made, lowest):
    """Of twelve positions of a chain nine, in three columns."""
    figure = resting(made())["positions"]
    assert_legible(figure)
    assert ("first 9 of 12" in figure.get_suptitle()) == (lowest == 3)
    assert sum(bool(axes.get_xlabel()) for axes in figure.axes) == lowest
    for axes in figure.axes:
        assert np.ptp(axes.get_xlim()) > 0.5 * np.ptp(axes.get_ylim())


def test_a_pendulum_s_potential_is_a_curve_with_its_positions_on_it():
    """U = -g cos q - F sin q over a turn, of a mass of 1 kg on a rod of 1 m."""
    found = find_equilibria(pendulum_chain(1))
    axes = found.plot(Figure(layout="constrained").subplots())
    curve, *marks = (np.asarray(line.get_data()) for line in axes.lines)
    np.testing.assert_allclose(curve[0][[0, -1]], [-np.pi, np.pi])
    np.testing.assert_allclose(np.ptp(curve[1]), 2.0 * np.hypot(9.81, 3.0), rtol=1e-3)
    for q, energy in np.concatenate(marks, axis=1).T:
        np.testing.assert_allclose(energy, np.interp(q, *curve), atol=1e-2)
    places = sorted(np.concatenate(marks, axis=1)[0])
    np.testing.assert_allclose(places, [np.arctan2(-3.0, -9.81), np.arctan2(3.0, 9.81)])


def test_a_mark_under_one_of_another_equilibrium_is_a_ring_round_it():
    """The slow pairs of these two wells differ by less than a mark; the fast ones do not."""
    scene = Scene(m1=3.0, m2=5.0, m3=2.0, l=0.6, c1=240.0, c2=60.0, F0=-40.0, alpha=0.0, beta=80.0)
    lines = draw("equilibria", scene)["eigenvalues"].axes[0].lines
    rings = [np.transpose(line.get_data()) for line in lines if line.get_markerfacecolor() == "none"]
    filled, ring, *_ = lines
    assert {filled.get_marker(), ring.get_marker()} == {"o"}
    np.testing.assert_allclose(np.abs(rings[0][:, 1]), 7.24, atol=0.05)
    assert ring.get_markersize() > filled.get_markersize()


def test_a_mark_shows_round_one_that_lies_on_it():
    """Without a force the last two positions of two pendulums are mirror images."""
    *_, first, second, _ = resting(pendulum_chain(2).replace(F=0.0))["eigenvalues"].axes[0].lines
    np.testing.assert_allclose(first.get_data(), second.get_data(), atol=1e-6)
    assert first.get_markersize() > second.get_markersize()
    assert first.get_markerfacecolor() == "none"


def test_shares_that_are_whole_are_said_to_be_and_bands_have_their_line_s_colour():
    share = np.ones((3, 1))
    variables = {"P": Variable(("P",), np.arange(3.0), "N")}
    for name, of in {
        "stability": share,
        "lower": 0.9 * share,
        "upper": share,
        "undecided": 0 * share,
    }.items():
        variables[f"well_{name}"] = Variable(("P", "well"), of)
    axes = Figure().subplots()
    told = {str(one.get_label()): one for one in draw_stability(axes, Dataset(variables, {"along": "P"}))}
    assert "all starts come to the well" in axes.get_title()
    assert axes.get_ylim()[0] < 0.0 < 100.0 < axes.get_ylim()[1]
    (band,) = axes.collections
    (swatch,) = [one for name, one in told.items() if "95 %" in name]
    np.testing.assert_allclose(band.get_facecolor()[0], swatch.get_facecolor())
    assert "well 0, found at values from 0 to 2 N" in told
    lost = "starts that leave their range and end in no well"
    assert lost not in told
    variables["out_of_range"] = Variable(("P",), np.array([0.5, 0.25, 0.0]))
    axes = Figure().subplots()
    assert lost in {one.get_label() for one in draw_stability(axes, Dataset(variables, {"along": "P"}))}
    (line,) = (line for line in axes.lines if line.get_marker() == "v")
    assert [*line.get_ydata()] == [50.0, 25.0, 0.0]


def test_the_top_of_one_coordinate_is_a_maximum_as_in_the_list():
    """A pendulum, upright at pi; the well is at 0."""
    line = np.linspace(-4.0, 4.0, 9)
    variables = {"q": Variable(("q",), line, "rad"), "q_dot": Variable(("q_dot",), line, "rad/s")}
    for name, values in {"q": [0.0, np.pi], "morse_index": [0, 1]}.items():
        variables[f"equilibrium_{name}"] = Variable(("equilibrium",), np.array(values))
    variables["barrier"] = Variable(("equilibrium",), np.array([1.0, np.nan]))
    attrs = {"axes": ("q", "q_dot"), "coordinate_names": ("q",), "turning_names": ("q",)}
    found = decisive(Figure().subplots(), Slice(Dataset(variables, attrs), None))
    assert [one.get_label() for one in found] == ["well", "maximum"]


def test_barriers_of_mechanisms_are_drawn_and_told_above_their_wells():
    truss = von_mises_truss().replace(b=3.0, P=5.0)
    axes = map_basins(truss, {"x": np.linspace(-0.8, 0.8, 5), "y": np.linspace(-1.2, 1.2, 5)}).plot()
    shown = find_equilibria(truss).plot()
    x, y = truss.coordinates
    title = " ".join(shown.get_title().split())
    assert f"near them (y can go from {y.low:g} to {y.high:g} m)" in title
    assert np.ptp(shown.get_ylim()) < 0.9 * (y.high - y.low)
    assert shown.get_xlim() == (x.low, x.high)
    low, high, top = sorted(find_equilibria(truss), key=lambda e: e.energy)
    assert top.kind == "saddle"
    # Most of the energies lie above the saddle, half of the colours below; the bar has even room for each.
    filled, bar = shown.collections[0], shown.figure.axes[-1]
    assert filled.levels[-1] - filled.levels[0] > 10.0 * (top.energy - filled.levels[0])
    assert np.sum(filled.levels < top.energy - 1e-9) == np.sum(filled.levels > top.energy + 1e-9) >= 10
    shades = filled.to_rgba(0.5 * (filled.levels[1:] + filled.levels[:-1])).mean(axis=1)
    assert np.diff(shades).min() > 0.2 * np.diff(shades).max()
    assert "finer below the highest saddle" in bar.get_ylabel()
    heights = " and ".join(f"{top.energy - e.energy:.4g}" for e in (low, high))
    told = [text.get_text() for text in axes.get_legend().get_texts()]
    assert f"energy at the barrier of wells 0 and 1: {heights} J above them" in told
    (line,) = (one for one in axes.collections if hasattr(one, "levels"))
    states = np.pad(np.concatenate([path.vertices for path in line.get_paths()]), ((0, 0), (0, 2)))
    total = sum(truss.energies(states)) + 5.0 * states[:, 1]  # P acts downwards
    np.testing.assert_allclose(total, top.energy, atol=0.01)


def test_a_mechanism_has_present_values_and_a_scene_s_load_its_kind():
    assert View(Dataset({}, {"mechanism": "own"}), {}, (), {}).own_name == "present values"
    load = Harmonic(*sympy.symbols("F0 omega"))
    made = slider_pendulum(load, {"F0": (80.0, "N"), "omega": (3.7, "rad/s")})
    assert style.setting(made, ["omega"]) == "the paper's Table 1, harmonic load with F0 = 80 N"


def test_titles_of_many_parameters_are_short_and_begin_with_what_was_changed() -> None:
    """An own mechanism has no defaults to compare with, so all of its parameters would be told."""
    x = lengths("x", -1.0, 1.0)
    names = [f"k{n}" for n in range(9)]
    stiffness = sum(sympy.Symbol(name) for name in names)
    made = Mechanism(
        (x,),
        dict.fromkeys(names, 1234.5),
        kinetic=x.dot**2,
        potential=stiffness * x**2 / 2,
        name="nine springs",
    )
    told = style.setting(made)
    assert (
        told == "nine springs with k0 = 1234.5, k1 = 1234.5, k2 = 1234.5, k3 = 1234.5, k4 = 1234.5, "
        "k5 = 1234.5, and 3 more"
    )
    assert style.setting(made.replace(k7=3.0)).startswith("nine springs with k7 = 3, k0 = 1234.5, ")
    changed = {"mechanism": "nine_springs", "changed_parameters": ("k8", "k7")}  # as result files tell
    assert style.setting_of(changed, made.parameters).startswith("nine springs with k7 = 1234.5, k8 = 1234.5")
    pushed = {"mechanism": "nine_springs", "changed_parameters": ("k8",), "unit_k7": "N"}
    assert style.setting_of(pushed, made.parameters).startswith(
        "nine springs with k8 = 1234.5, k7 = 1234.5 N"
    )
    axes = find_equilibria(made).plot()
    assert len(axes.get_title().splitlines()) <= 4  # what is drawn, and what of
    chain = pendulum_chain(4)  # a shipped one has defaults
    assert style.setting(chain).count("=") == 0
