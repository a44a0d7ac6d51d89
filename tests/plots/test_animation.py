"""Films of motions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import fastmech as fm

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


def test_wrong_arguments_give_a_line(run: object, tmp_path: Path) -> None:
    with pytest.raises(fm.InputError, match=r"must end with \.mp4"):
        fm.animate(SCENE, run, tmp_path / "motion.avi")
    with pytest.raises(fm.InputError, match="which = 1"):
        fm.animate(SCENE, run, tmp_path / "motion.gif", which=1)
