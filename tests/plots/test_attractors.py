"""Attractors and who ends at them: labels within the picture, one colour and one name in both pictures."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_hex
from plots.legibility import assert_legible

from fastmech.plots import style
from fastmech.plots.attractors import draw_attractors
from fastmech.results import Dataset, Variable

pytestmark = pytest.mark.nojit

UNITS = {"q1": "rad", "q2": "rad", "q1_dot": "rad/s", "q2_dot": "rad/s"}


def found() -> Dataset:
    """Two attractors, of which the second has more of these starts; a tenth of them is unsure."""
    label = np.repeat([0, 1, -1], [30, 60, 10]).reshape(10, 10)
    flags = {"flag_values": np.array([0, 1], np.int8), "flag_meanings": "captured unsure"}
    table = {"kind": np.array(["periodic"] * 2, object), "forcing_periods": np.ones(2, int)}
    table |= {"period": np.ones(2), "share": np.array([0.3, 0.6])}
    table |= {"share_low": table["share"] - 0.05, "share_high": table["share"] + 0.05}
    rows = {n: Variable(("attractor",), values) for n, values in table.items()}
    rows |= {f"place_{n}": Variable(("attractor",), np.array([-1.234, 0.5]), u) for n, u in UNITS.items()}
    points = {f"point_{n}": Variable(("point",), np.array([-1.0, 0.5]), u) for n, u in UNITS.items()}
    points["point_attractor"] = Variable(("point",), np.arange(2))
    variables = {n: Variable((n,), np.linspace(-2.0, 2.0, 10), UNITS[n]) for n in ("q1", "q2")}
    variables["label"] = Variable(("q1", "q2"), label)
    variables["status"] = Variable(("q1", "q2"), (label < 0).astype(np.int8), attrs=flags)
    groups = {"attractors": Dataset(rows), "points": Dataset(points)}
    return Dataset(variables, {"coordinate_names": ("q1", "q2"), "t_end": 50.0}, groups)


def test_attractors_have_their_number_s_colour_in_both_pictures_and_places_their_units():
    figures = draw_attractors(found(), {})
    for figure in figures.values():
        assert_legible(figure)
    (axes,), colors = figures["shares"].axes, [style.color(0), style.color(1), "#ffffff"]
    assert [to_hex(bar.get_facecolor()) for bar in axes.patches] == [c.lower() for c in colors]
    told = [text.get_text() for text in axes.get_yticklabels()]
    assert told[0].endswith("at q1 = -1.23, q2 = -1.23 rad, q1' = -1.23, q2' = -1.23 rad/s")
    assert told[2] == "unsure"
    (legend,) = figures["labels"].legends
    swatches = [to_hex(one.get_facecolor()) for one in legend.get_patches()]
    assert swatches == [colors[k].lower() for k in (1, 0, 2)]
    assert figures["labels"].axes[0].get_xlabel() == "angle q1 at the start [rad]"
