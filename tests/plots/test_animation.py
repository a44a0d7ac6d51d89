"""Films of motions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from PIL import Image

import fastmech as fm
from fastmech.models.drawing import Element, drawing

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


def test_a_page_holds_its_pictures(run: object, tmp_path: Path) -> None:
    text = fm.animate(SCENE, run, tmp_path / "motion.html", fps=3).read_text(encoding="utf-8")
    assert text.count("data:image/png;base64") == 3


def test_words_do_not_lie_on_rods_or_on_each_other(tmp_path: Path) -> None:
    times, system = np.linspace(0.0, 2.0, 41), fm.mechanisms.slider_pendulum()
    run = fm.integrate(SCENE, [[1.0, 0.1, 0.0, 0.0]], 2.0, t_eval=times, dt=0.01)
    places: list[list[Any]] = []
    text, annotate, clear = Axes.text, Axes.annotate, Axes.clear

    def written(self: Any, x: float, y: float, words: str, **how: Any) -> Any:
        places[-1].append((x, y))
        return text(self, x, y, words, **how)

    def noted(self: Any, words: str, xy: Any, *rest: Any, **how: Any) -> Any:
        if words and words.endswith(" N"):
            places[-1].append(xy)
            assert "xytext" not in how
        return annotate(self, words, xy, *rest, **how)

    def begun(self: Any) -> None:
        places.append([])
        clear(self)

    with pytest.MonkeyPatch.context() as patch:
        for name, instead in (("text", written), ("annotate", noted), ("clear", begun)):
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
    with pytest.raises(fm.InputError, match="which = 1"):
        fm.animate(SCENE, run, tmp_path / "motion.gif", which=1)
