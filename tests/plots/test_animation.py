"""Films of motions."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
import sympy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

import fastmech as fm
from fastmech.models.drawing import Element, drawing
from fastmech.plots.animation import draw_moment, moments

SCENE = fm.Scene()


@pytest.fixture(scope="module")
def run() -> object:
    times = np.linspace(0.0, 1.0, 21)
    return fm.integrate(SCENE, [[1.0, 0.5, 0.0, 0.0]], 1.0, t_eval=times, dt=0.01)


def test_a_gif_has_the_motion_s_pictures_and_they_differ(run: object, tmp_path: Path) -> None:
    with Image.open(fm.animate(SCENE, run, tmp_path / "motion.gif", fps=5)) as film:
        assert film.n_frames == 5
        first = np.asarray(film.convert("L"), dtype=float)
        film.seek(4)
        assert np.abs(np.asarray(film.convert("L"), dtype=float) - first).max() > 50.0


def test_a_page_holds_all_its_pictures(run: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Matplotlib's limit of 20 MB would leave out the end of a film of some 16 s."""
    monkeypatch.setitem(matplotlib.rcParams, "animation.embed_limit", 1e-3)
    text = fm.animate(SCENE, run, tmp_path / "motion.html", fps=3).read_text(encoding="utf-8")
    assert text.count("data:image/png;base64") == 3
    assert "http" not in text  # nothing is fetched from elsewhere
    assert text.count("<button") == len(re.findall(r"<button[^>]*>\s*[^<\s]+\s*</button>", text)) == 9


@pytest.mark.parametrize(
    ("system", "start"),
    [
        (fm.Scene(F0=-300.0, alpha=0.0), [1.0, 0.3]),
        (fm.mechanisms.pendulum_chain(4), [-0.5, 0.3, -0.8, -1.0]),
        (fm.mechanisms.ziegler_column(), [0.3, 0.5]),
    ],
)
def test_arrows_names_and_the_title_are_whole(system: Any, start: list[float]) -> None:
    times = np.linspace(0.0, 1.0, 11)
    run = fm.integrate(system, [[*start, *np.zeros(len(start))]], 1.0, t_eval=times, dt=0.005)
    shown = moments(system, run.y[:, 0, : len(start)], times)
    figure = Figure(figsize=(5.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    for k in range(len(times)):
        axes.clear()
        draw_moment(axes, shown, k)
        figure.draw_without_rendering()
        whole, page = axes.get_window_extent(), figure.bbox
        assert axes.title.get_window_extent().x0 >= 0.0
        assert axes.title.get_window_extent().x1 <= page.x1
        words = [one for one in axes.texts if one.get_text()]
        assert len(words) == sum(map(bool, shown.drawn.name)) + len(start) + shown.forces.shape[1]
        for one in words:
            box = one.get_window_extent()
            assert whole.x0 - 1 <= box.x0 < box.x1 <= whole.x1 + 1, one.get_text()
            assert whole.y0 - 1 <= box.y0 < box.y1 <= whole.y1 + 1, one.get_text()
        arrows = [one for one in axes.texts if not one.get_text()]
        assert len(arrows) == shown.forces.shape[1]
        for arrow in arrows:
            tip, tail = (np.array(axes.transData.transform(at)) for at in (arrow.xy, arrow.xyann))
            assert whole.contains(*tip)
            along = tail + np.linspace(0.1, 0.9, 9)[:, None] * (tip - tail)
            for one in words:
                if not one.get_text().endswith(" N"):
                    assert not any(one.get_window_extent().contains(*place) for place in along), k


def test_what_has_no_points_gives_a_line(tmp_path: Path) -> None:
    x = fm.lengths("x", -2.0, 2.0)
    made = fm.Mechanism(x, {"k": 1.0}, kinetic=x.dot**2 / 2, potential=sympy.Symbol("k") * x**2)
    run = fm.integrate(made, [[1.0, 0.0]], 1.0, t_eval=[0.0, 0.5, 1.0], dt=0.01)
    with pytest.raises(fm.InputError, match="has no points in a plane"):
        fm.animate(made, run, tmp_path / "motion.gif")


def test_words_do_not_lie_on_rods_or_on_each_other(tmp_path: Path) -> None:
    times, system = np.linspace(0.0, 2.0, 41), fm.mechanisms.slider_pendulum()
    run = fm.integrate(SCENE, [[1.0, 0.1, 0.0, 0.0]], 2.0, t_eval=times, dt=0.01)
    places: list[list[Any]] = []
    annotate, clear = Axes.annotate, Axes.clear

    def noted(self: Any, words: str, xy: Any, *rest: Any, **how: Any) -> Any:
        if words:
            places[-1].append(xy)
            assert "xytext" not in how
        return annotate(self, words, xy, *rest, **how)

    def begun(self: Any) -> None:
        places.append([])
        clear(self)

    with pytest.MonkeyPatch.context() as patch:
        for name, instead in (("annotate", noted), ("clear", begun)):
            patch.setattr(Axes, name, instead)
        fm.animate(SCENE, run, tmp_path / "motion.gif", fps=5)
    frames = np.arange(0.0, 2.0, 0.2)
    q = np.stack([np.interp(frames, times, run.y[:, 0, k]) for k in range(2)], axis=-1)
    shown = drawing(system, q)
    for k, words in enumerate(places[-len(frames) :]):
        at = np.array(words)
        apart = np.linalg.norm(at[:, None] - at, axis=-1) + np.eye(len(at))
        assert apart.min() > 0.08, frames[k]
        for a, b in shown.ends[k, shown.kind == Element.ROD]:
            along = np.clip((at - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
            assert np.linalg.norm(a + along[:, None] * (b - a) - at, axis=1).min() > 0.04, frames[k]


def test_arrows_and_angles_are_those_of_the_moment(run: object, tmp_path: Path) -> None:
    """Arrows are as long as the load's value asks for, arcs as wide as the coordinates are large."""
    forces, arrows, turns = list[float](), list[float](), list[float]()
    annotate, plot = Axes.annotate, Axes.plot

    def noted(self: Any, words: str, xy: Any, *rest: Any, **how: Any) -> Any:
        if "arrowprops" in how:
            arrows.append(xy[0] - how["xytext"][0])
        elif words.endswith(" N"):
            forces.append(float(words.removesuffix(" N")))
        return annotate(self, words, xy, *rest, **how)

    def drawn(self: Any, x: Any, y: Any, *rest: Any, **how: Any) -> Any:
        if np.size(x) == 33:
            whole, half = (np.hypot(x[k] - x[0], y[k] - y[0]) for k in (32, 16))
            turns.append(4.0 * np.arccos(0.5 * whole / half))
        return plot(self, x, y, *rest, **how)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Axes, "annotate", noted)
        patch.setattr(Axes, "plot", drawn)
        fm.animate(SCENE, run, tmp_path / "motion.gif", fps=5)
    fades = np.exp(-SCENE.alpha * np.linspace(0.0, 0.8, 5))
    np.testing.assert_allclose(forces[-5:], SCENE.F0 * fades, rtol=5e-3)
    np.testing.assert_allclose(np.array(arrows[-5:]) / arrows[-5], fades, rtol=1e-6)
    angles = np.abs(run.y[::4, 0, :2][:5])  # type: ignore[attr-defined]
    np.testing.assert_allclose(np.sort(np.reshape(turns[-10:], (5, 2))), np.sort(angles), atol=1e-6)


def test_wrong_arguments_give_a_line(run: object, tmp_path: Path) -> None:
    with pytest.raises(fm.InputError, match=r"must end with \.mp4"):
        fm.animate(SCENE, run, tmp_path / "motion.avi")
    with pytest.raises(fm.InputError, match=r"path = .*: there is no such folder"):
        fm.animate(SCENE, run, tmp_path / "none" / "motion.gif")
    with pytest.raises(fm.InputError, match="which = 1"):
        fm.animate(SCENE, run, tmp_path / "motion.gif", which=1)
