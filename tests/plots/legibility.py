"""What can be checked of a picture without looking at it."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from fastmech.plots.style import style


def assert_legible(figure: Figure) -> None:
    """Units on every axis, nothing on top of anything else, nothing outside the picture."""
    with style():
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        renderer = canvas.get_renderer()
    assert figure.axes
    for axes in figure.axes:
        for axis in ("x", "y"):
            assert _has_unit(axes, axis), f"{axis} of {axes.get_title() or axes!r}"
            _assert_apart(_tick_labels(axes, axis), renderer)
        titles = [axes.title, axes._left_title, axes._right_title]
        _assert_apart([title for title in titles if title.get_text()], renderer)
    boxes = [legend.get_window_extent(renderer) for legend in figure.legends]
    boxes += [axes.get_legend().get_window_extent(renderer) for axes in figure.axes if axes.get_legend()]
    panels = [axes.get_window_extent(renderer) for axes in figure.axes]
    for box in boxes:
        assert not any(_overlap(box, panel) for panel in panels), "a legend covers a panel"
        assert _inside(box, figure.bbox), "a legend leaves the picture"
    for first, second in combinations(panels, 2):
        assert not _overlap(first, second)
    for axes in figure.axes:
        assert _inside(axes.get_tightbbox(renderer), figure.bbox), "labels leave the picture"


def _has_unit(axes: Axes, axis: str) -> bool:
    """A label with a unit, here or on a panel that shares the axis, or names instead of numbers."""
    siblings = getattr(axes, f"get_shared_{axis}_axes")().get_siblings(axes)
    labels = [getattr(other, f"get_{axis}label")() for other in siblings]
    names = [label.get_text() for label in getattr(axes, f"get_{axis}ticklabels")()]
    named = bool(names) and all(any(map(str.isalpha, name)) and "$" not in name for name in names)
    return named or not names or any("[" in label and "]" in label for label in labels)


def _tick_labels(axes: Axes, axis: str) -> list[Any]:
    low, high = sorted(getattr(axes, f"get_{axis}lim")())
    ruler = getattr(axes, f"{axis}axis")
    ticks = [*ruler.get_major_ticks(), *ruler.get_minor_ticks()]
    labels = [tick.label1 for tick in ticks if low <= tick.get_loc() <= high]
    return [label for label in labels if label.get_visible() and label.get_text()]


def _assert_apart(texts: list[Any], renderer: Any) -> None:
    for first, second in combinations(texts, 2):
        boxes = first.get_window_extent(renderer), second.get_window_extent(renderer)
        assert not _overlap(*boxes), (first.get_text(), second.get_text())


def _overlap(a: Bbox, b: Bbox) -> bool:
    """More than a touch of one pixel."""
    return min(a.x1, b.x1) - max(a.x0, b.x0) > 1.0 and min(a.y1, b.y1) - max(a.y0, b.y0) > 1.0


def _inside(box: Bbox, frame: Bbox) -> bool:
    return (
        box.x0 >= frame.x0 - 1.0
        and box.y0 >= frame.y0 - 1.0
        and box.x1 <= frame.x1 + 1.0
        and box.y1 <= frame.y1 + 1.0
    )


def settings() -> dict[str, Any]:
    """Matplotlib's global settings, which no drawing may change."""
    return dict(matplotlib.rcParams)
