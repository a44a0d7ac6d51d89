"""Colours of basins: one label, one colour, apart from each other for every kind of eye."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from fastmech.plots.basins import FURTHER, basin_color
from fastmech.results import Dataset, Variable

pytestmark = pytest.mark.nojit

#: Linear RGB as seen by normal, protanopic and deuteranopic eyes (Machado et al. 2009, severity 1).
EYES = (
    np.eye(3),
    [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
)
#: Linear sRGB to XYZ (IEC 61966-2-1, D65), and its white.
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def equilibria(morse_index: list[int]) -> Dataset:
    return Dataset({"equilibrium_morse_index": Variable(("equilibrium",), np.array(morse_index))})


def lab(color: str, eye: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of a colour."""
    srgb = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    ratio = XYZ @ np.clip(np.asarray(eye) @ linear, 0.0, 1.0) / XYZ.sum(axis=1)
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def apart(colors: list[str]) -> float:
    """Smallest CIE 1976 difference of two of the colours for any eye; 2.3 is just noticeable."""
    smallest = np.inf
    for eye in EYES:
        points = np.array([lab(color, np.asarray(eye)) for color in colors])
        away = np.linalg.norm(points[:, None] - points, axis=2) + 1e3 * np.eye(len(colors))
        smallest = min(smallest, float(away.min()))
    return smallest


def test_usual_labels_have_colours_apart_for_every_eye() -> None:
    wells = equilibria([0, 0, 1])
    turns = list(product(range(-2, 3), repeat=2))
    colors = [basin_color(wells, well, t) for well in (0, 1) for t in turns]
    marks = ["#ffffff", "#000000", "#4d4d4d", FURTHER]
    assert len(set(colors)) == 50
    assert apart(colors + marks) > 2.3
    near = [(0, 0), (0, 1), (0, -1), (1, 0), (-1, 0), (1, -1), (-1, 1)]
    assert apart([basin_color(wells, 0, t) for t in near] + marks) > 3 * 2.3


def test_a_well_s_number_counts_not_its_place_among_the_equilibria() -> None:
    assert basin_color(equilibria([0, 1, 0]), 2, (0, 1)) == basin_color(equilibria([0, 0]), 1, (0, 1))


def test_rare_labels_share_grey() -> None:
    wells = equilibria([0, 0, 0])
    assert basin_color(wells, 0, (3, 0)) == basin_color(wells, 2, (1, 0)) == FURTHER
    assert len({basin_color(wells, well, (0, 0)) for well in range(3)} | {FURTHER}) == 4
