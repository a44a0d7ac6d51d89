"""Fold curves, cusps and vanishing-damping curves on top of a map."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastmech.plots.labels import flag_codes
from fastmech.plots.map_view import View
from fastmech.plots.style import PALETTE
from fastmech.results import Variable

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

#: How fold curves look, by what merges with a saddle.
FOLDS = {
    "minimum": ("black", "-", 1.8, "fold: a resting position disappears"),
    "maximum": ("#555555", "--", 1.2, "fold of unstable equilibria"),
}

#: How vanishing-damping curves look, by what vanishes.
UNREACHED = {
    "sin_phi": (PALETTE["vermillion"], "-", "damping misses a mode: sin φ = 0"),
    "sin_phi_theta": (PALETTE["vermillion"], "--", "damping misses a mode: sin(φ+θ) = 0"),
    "unloaded_rod": (PALETTE["vermillion"], ":", "damping misses a mode: rod M1M2 unloaded"),
}


def draw_curves(axes: Axes, view: View) -> list[Artist]:
    """Draw what the map has of curves; returns one handle a legend entry."""
    if len(view.dataset.attrs["axes"]) != 2 or not view.has("fold_curve"):
        return []
    handles = _lines(axes, view, "fold", "fold_merges", FOLDS)
    handles += _lines(axes, view, "unreached", "unreached_vanishes", {
        name: (color, dash, 1.4, label) for name, (color, dash, label) in UNREACHED.items()
    })  # fmt: skip
    cusp = [view.axis(f"cusp_{name}") for name in view.axes]
    if cusp[0].size:
        handles += axes.plot(*cusp, "D", color="white", mec="black", ms=5.5, ls="none", label="cusp")
    low, high = zip(*((view.axis(name).min(), view.axis(name).max()) for name in view.axes), strict=True)
    margin = [
        0.5 * (b - a) / max(1, view.axis(name).size - 1)
        for a, b, name in zip(low, high, view.axes, strict=True)
    ]
    axes.set(xlim=(low[0] - margin[0], high[0] + margin[0]), ylim=(low[1] - margin[1], high[1] + margin[1]))
    return handles


def _lines(
    axes: Axes, view: View, what: str, kind: str, looks: dict[str, tuple[str, str, float, str]]
) -> list[Artist]:
    from matplotlib.patheffects import Normal, Stroke

    variable = view.variable(kind)
    number = view.variable(f"{what}_curve").data
    x, y = (view.axis(f"{what}_{name}") for name in view.axes)
    handles: list[Artist] = []
    others = {name: ("#777777", "-.", 1.2, f"{what}: {name}") for name in flag_codes(variable).others(looks)}
    for name, (color, dash, width, label) in {**looks, **others}.items():
        chosen = _broken(variable, name, number)
        if not chosen[0].size:
            continue
        effects = [Stroke(linewidth=width + 1.6, foreground="white", alpha=0.9), Normal()]
        handles += axes.plot(
            np.where(chosen[1], np.nan, x[chosen[0]]),
            np.where(chosen[1], np.nan, y[chosen[0]]),
            color=color,
            ls=dash,
            lw=width,
            label=label,
            path_effects=effects,
        )
    return handles


def _broken(
    variable: Variable, name: str, number: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Points of one kind's curves, each curve with one more that breaks the line, and where these are."""
    of_kind = np.flatnonzero(variable.data == flag_codes(variable)[name])
    ends = np.flatnonzero(np.diff(number[of_kind], append=-1))
    return (
        np.insert(of_kind, ends + 1, of_kind[ends]),
        np.insert(np.zeros(of_kind.size, dtype=bool), ends + 1, True),
    )
