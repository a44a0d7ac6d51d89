"""Colours of basins: the largest ones apart from each other for every kind of eye."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from fastmech.plots import style
from fastmech.plots.basins import COLORS, FURTHER, UNLABELLED, Slice, draw_labels
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


def test_the_largest_basins_have_colours_apart_for_every_eye() -> None:
    marks = ["#ffffff", "#000000", "#4d4d4d", FURTHER]
    assert apart(COLORS + marks) > 3 * 2.3


def picture(label: np.ndarray, ends: Any = None, turns: bool | None = None, axes: Any = None) -> list[Any]:
    """The legend of a map of nine wells, each a basin; -1: the motion is out of range.

    ``ends``: the well of each basin, if others, and how often phi turns on the way there, (9, 2).
    """
    well, made = np.array([[k, 0] for k in range(9)] if ends is None else ends).T
    wells = {"morse_index": np.zeros(9, int), "phi": np.full(9, 9.0), "theta": np.full(9, 9.0)}
    basin = {"well": well, "turns_phi": made, "turns_theta": np.zeros(9, int)}
    status = {"flag_values": np.array([0, 1], np.int8), "flag_meanings": "captured out_of_range"}
    dims = ("phi", "theta")
    variables = {
        "phi": Variable(("phi",), np.arange(9.0), "rad"),
        "theta": Variable(("theta",), np.arange(10.0), "rad"),
        "label": Variable(dims, label),
        "status": Variable(dims, (label < 0).astype(np.int8), attrs=status),
        "barrier": Variable(("equilibrium",), np.full(9, np.inf), "J"),
        **{f"equilibrium_{n}": Variable(("equilibrium",), v, "rad") for n, v in wells.items()},
        **{f"basin_{n}": Variable(("basin",), v) for n, v in basin.items()},
    }
    view = Slice(Dataset(variables, {"axes": dims, "coordinate_names": dims, "turning_names": ()}), None)
    return draw_labels(Figure().subplots() if axes is None else axes, view, turns)


def test_smaller_basins_share_one_colour_with_a_swatch() -> None:
    """Nine basins in a row, each smaller than the one before."""
    label = np.repeat(np.arange(9), np.arange(18, 0, -2)).reshape(9, 10)
    told = {str(one.get_label()): to_hex(one.get_facecolor()).lower() for one in picture(label)}
    expected = [f"well {k}: {style.share(label == k)}" for k in range(7)]
    assert told == {
        **dict(zip(expected, map(str.lower, COLORS), strict=True)),
        f"others (basins: 2): {style.share(label > 6)}": FURTHER,
    }


def test_a_well_has_the_colour_of_its_number_and_of_lines_whatever_its_share() -> None:
    label = np.repeat(np.arange(9), 10).reshape(9, 10)
    label[1] = 3
    told = {str(one.get_label()).split(":")[0]: to_hex(one.get_facecolor()) for one in picture(label)}
    assert {told[f"well {k}"] == style.color(k).lower() for k in (0, 2, 3, 4, 5)} == {True}


def test_wells_alone_have_colours_where_turns_leave_many_starts_to_the_others() -> None:
    """Nine wells have all colours, so the two copies of the first two are the others."""
    ends = [*([k, 0] for k in range(7)), [0, 1], [1, -2]]

    def told(label: np.ndarray, turns: bool | None) -> tuple[dict[str, str], bool]:
        axes = Figure().subplots()
        legend = (str(one.get_label()).split(": ") for one in picture(label, ends, turns, axes))
        return {
            one[0]: one[-1] for one in legend if "%" in one[-1]
        }, "whatever their turns" in axes.get_title()

    label = np.repeat(np.arange(9), 10).reshape(9, 10)
    assert told(label, None) == told(label, False)  # 2 of 9 are more than a tenth
    assert told(label, False) == (
        {"well 0": "22.2 %", "well 1": "22.2 %", **{f"well {k}": "11.1 %" for k in range(2, 7)}},
        True,
    )
    legend, whatever = told(label, True)
    assert (legend["others (basins"], legend["well 0, no turn"], whatever) == ("22.2 %", "11.1 %", False)
    label[7:] = 0
    label[8, :5] = 8  # 5 of 90
    assert told(label, None) == told(label, True)
    assert told(np.where(label == 8, 7, 0), None)[1] is False  # of one well there are turns alone to tell


def test_marks_of_the_legend_are_those_of_the_map() -> None:
    label = np.zeros((9, 10), dtype=int)
    label[3, 4] = -1
    (mark,) = [one for one in picture(label) if str(one.get_label()).startswith("out of range")]
    assert mark.get_markerfacecolor() == "black"
    label[3] = -1  # an area is seen without marks, and has its colour in the legend
    (area,) = [one for one in picture(label) if str(one.get_label()).startswith("out of range")]
    assert to_hex(area.get_facecolor()) == UNLABELLED["out_of_range"][0]
