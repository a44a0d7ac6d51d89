"""Mechanisms drawn to scale: what lies beside what."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest
import sympy
from matplotlib import pyplot
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import fastmech as fm
from fastmech.models.drawing import Drawing, Element
from fastmech.plots import style
from fastmech.plots.equilibria import DAMPER, INK, SPRING, Words, draw_mechanism, drawing_of
from fastmech.scene import Scene

#: A mass on a spring and a damper from the same point, guided upwards, under a load to the right.
ENDS = {
    Element.FIXED: [[0.0, 0.0], [0.0, 0.0]],
    Element.POINT: [[0.0, 2.0], [0.0, 2.0]],
    Element.GUIDE: [[0.0, 2.0], [0.0, 3.0]],
    Element.SPRING: [[0.0, 0.0], [0.0, 2.0]],
    Element.DAMPER: [[0.0, 2.0], [0.0, 0.0]],
    Element.MASS: [[0.0, 2.0], [0.0, 2.0]],
    Element.LOAD: [[0.0, 2.0], [1.0, 2.0]],
}
DRAWN = Drawing(
    np.array(list(ENDS), dtype=np.int8),
    ("O", "M1", "", "", "", "", ""),
    np.where(np.array(list(ENDS)) == Element.MASS, 3.0, np.nan),
    np.array([list(ENDS.values())]),
)


@pytest.mark.nojit
def test_spring_and_damper_between_the_same_points_and_names_lie_beside_each_other() -> None:
    figure = Figure(figsize=(4.0, 4.0))
    axes = figure.add_subplot()
    draw_mechanism(axes, DRAWN)
    lines = {
        colour: np.concatenate(
            [line.get_xdata() for line in axes.lines if to_hex(line.get_color()) == colour]
        )
        for colour in (SPRING.lower(), DAMPER.lower())
    }
    spring, damper = lines.values()
    assert spring.max() < damper.min() or damper.max() < spring.min()
    order = {to_hex(line.get_color()): line.get_zorder() for line in axes.lines}
    assert order[SPRING.lower()] > order[DAMPER.lower()]  # a short spring is seen in a long damper
    figure.draw_without_rendering()
    names = {text.get_text(): text.get_window_extent() for text in axes.texts if text.get_text()}
    assert set(names) == {"O", "$M_{1}$"}
    for box in names.values():
        low, high = axes.transData.inverted().transform([[box.x0, box.y0], [box.x1, box.y1]])
        assert low[0] > 0.0 or high[0] < 0.0  # no name on the guide
        for circle in axes.patches:
            x, y = circle.center
            nearest = np.clip(x, low[0], high[0]) - x, np.clip(y, low[1], high[1]) - y
            assert np.hypot(*nearest) > circle.radius


@pytest.mark.nojit
def test_a_joint_s_name_is_beside_it_with_a_torsion_damper_there() -> None:
    ends = {
        Element.FIXED: [[0.0, 0.0], [0.0, 0.0]],
        Element.ROD: [[0.0, 0.0], [0.0, 1.0]],
        Element.TORSION_DAMPER: [[0.0, 0.0], [0.0, 1.0]],
    }
    drawn = Drawing(
        np.array(list(ends), dtype=np.int8),
        ("O", "", ""),
        np.full(3, np.nan),
        np.array([list(ends.values())]),
    )
    axes = Figure(figsize=(3.0, 3.0)).add_subplot()
    draw_mechanism(axes, drawn)
    (name,) = axes.texts
    assert np.hypot(*name.xy) < 0.2


@pytest.mark.nojit
def test_words_stay_near_their_point_where_places_are_free() -> None:
    axes = Figure(figsize=(4.0, 4.0)).add_subplot()
    axes.set(xlim=(-9.0, 9.0), ylim=(-9.0, 9.0))
    spots = [(4.0, 6.0), (4.0, 3.0), (4.0, -3.0), (4.0, -6.0)]
    Words(axes, DRAWN, 0).say("M", spots)
    assert axes.texts[0].xy == (4.0, 3.0)


@pytest.mark.nojit
def test_the_pivot_s_name_is_nearer_to_it_than_the_damper_is_wide() -> None:
    """Rods and springs lie all about it; the nearest place between them will do."""
    scene = Scene(m1=3.0, m2=5.0, m3=2.0, l=0.6, c1=240.0, c2=60.0, F0=-40.0, alpha=0.0)
    axes = Figure(figsize=(9.6, 12.3)).subplots(3, 2)[0, 0]
    draw_mechanism(axes, drawing_of(scene, [(2.467, -0.481), (-0.699, 1.853), (-2.279, 0.728)], -40.0))
    (name,) = [text for text in axes.texts if text.get_text() == "O"]
    assert np.hypot(*name.xy) < 0.25


@pytest.mark.nojit
def test_spring_and_damper_between_the_same_points_are_joined_to_these() -> None:
    """Bars lead from both points to where they begin and end; of short ones turns and housing are small."""
    axes = Figure(figsize=(4.0, 4.0)).add_subplot()
    draw_mechanism(axes, DRAWN)
    lines = {to_hex(line.get_color()): [] for line in axes.lines}
    for line in axes.lines:
        lines[to_hex(line.get_color())].append(line.get_xydata())
    bars = np.array([line for line in lines[INK] if len(line) == 3])
    assert {tuple(point) for point in bars[:, 0]} == {(0.0, 0.0), (0.0, 2.0)}
    for kind in (SPRING.lower(), DAMPER.lower()):
        points = np.concatenate(lines[kind])
        ends = points[[points[:, 1].argmin(), points[:, 1].argmax()]]
        assert all(np.linalg.norm(bars[:, 2] - end, axis=1).min() < 1e-12 for end in ends)
    ends = DRAWN.ends.copy()
    tied = np.isin(DRAWN.kind, (Element.SPRING, Element.DAMPER))
    ends[:, tied] *= 0.05
    axes.clear()
    draw_mechanism(axes, DRAWN._replace(ends=ends))
    (spring,) = [line for line in axes.lines if to_hex(line.get_color()) == SPRING.lower()]
    assert len(spring.get_xydata()) == 7  # two turns and its ends
    widths = [np.ptp(line.get_xdata()) for line in axes.lines if to_hex(line.get_color()) == DAMPER.lower()]
    assert max(widths) < 0.7 * 0.05 * 2.0


def test_a_title_above_a_power_of_ten_is_whole() -> None:
    """It moves above that one where both would meet, as some of these would."""
    x = np.linspace(-1e-5, 1e-5, 9)
    for letters in (64, 66, 68, 70, 72):
        figure, axes = pyplot.subplots(layout="constrained")
        bar = figure.colorbar(axes.contourf(x, x, np.outer(x, x)), ax=axes)
        bar.ax.set_ylabel("u")
        axes.set(title="i" * letters + "\nanother\ngy, lf", ylabel="y")
        axes.plot([], [], label="l")
        style.legend_under(axes)
        style.make_room(axes)
        figure.savefig(io.BytesIO())
        assert axes.title.get_window_extent().y1 <= figure.bbox.height
        pyplot.close(figure)


def test_small_devices_are_seen_and_told_as_large_ones() -> None:
    """Micrometres: at F = 0 minima at +-10 um, the saddle at 0; folds at +-2 k L / 27^0.5 = +-3.849 mN."""
    x = fm.lengths("x", -2e-5, 2e-5)
    k, L, F = sympy.symbols("k L F")
    device = fm.Mechanism(
        x,
        {"m": (1e-11, "kg"), "k": (1000.0, "N/m"), "L": (1e-5, "m"), "F": (0.0, "N"), "b": (1e-5, "N s/m")},
        points={"O": (0, 0), "M": (x, 0)},
        masses={"M": sympy.Symbol("m")},
        potential=k * (x**4 / (4 * L**2) - x**2 / 2) - F * x,
        dampers=[fm.Damper("O", "M", sympy.Symbol("b"), along=(1, 0))],
        name="a device of a few micrometres with a long name",
    )
    rest = fm.find_equilibria(device)
    assert str(rest[0]).startswith("equilibrium: minimum at (")
    low, high = fm.map_equilibria(device, {"F": np.linspace(-0.005, 0.005, 11)}).plot().get_ylim()
    assert -3e-5 < low < -1e-5 < 1e-5 < high < 3e-5
    told = fm.find_snap(device, [1e-5], parameter="F").sentence
    assert told.startswith("the position (x = 1e-05 m) at F = 0 N disappears below -0.003849")
    told = str(fm.disturbed_motion(device, rest[0], [1e-6, 0.0], [0.0, 1e-7]))
    assert re.search(r"\S+e-0[67] m of x \(\S+\), \S+ m/s of x_dot", told)
