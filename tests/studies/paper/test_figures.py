from __future__ import annotations

import numpy as np
import pytest
from oracles import TABLE_1, oracle

from fastmech.plots.equilibria import ROD, draw_mechanism, drawing_of
from fastmech.plots.style import new_figure, png, style
from fastmech.studies.paper.compute import STATIC_SCENE


@pytest.mark.parametrize("angles", [(0.688, -2.915), (-2.447, 1.523), (0.0, 0.0), (np.pi / 2, 0.0)])
@pytest.mark.parametrize("force", [100.0, -100.0, 0.0])
def test_rods_are_where_the_oracle_has_the_points(angles: tuple[float, float], force: float) -> None:
    with style():
        figure = new_figure()
        axes = figure.subplots()
        draw_mechanism(axes, drawing_of(STATIC_SCENE, angles, force))
    rods = [np.transpose(line.get_data()) for line in axes.lines if line.get_color() == ROD]
    x1, y1, x2, y2, x3, y3 = (float(x) for x in oracle().positions(TABLE_1, angles))
    expected = [[(0, 0), (x1, y1)], [(x1, y1), (x2, y2)], [(x1, y1), (x3, y3)]]
    np.testing.assert_allclose(rods, expected, atol=1e-12)
    assert png(figure).startswith(b"\x89PNG")
