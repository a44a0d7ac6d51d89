"""Fold curves, cusps and vanishing-damping curves on top of a map."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastmech.plots.labels import flag_codes
from fastmech.plots.map_view import View
from fastmech.plots.style import PALETTE

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

#: How fold curves look, by their kind and what merges with a saddle.
FOLDS = {
    ("fold", "minimum"): ("black", "-", 1.8, "fold: a resting position disappears"),
    ("fold", "maximum"): ("#555555", "--", 1.2, "fold of unstable equilibria"),
    ("pitchfork", "minimum"): ("black", (0, (6, 1, 1, 1)), 1.8, "pitchfork (symmetric) of resting positions"),
    ("pitchfork", "maximum"): ("#555555", (0, (1, 1)), 1.4, "pitchfork (symmetric) of unstable equilibria"),
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
    handles: list[Artist] = []
    merges, kinds = _codes(view, "fold_merges"), _codes(view, "fold_kind")
    # Files of older versions tell no kind; those of others may know kinds that this one does not.
    shown = [(kind, name) for kind in kinds or ["fold"] for name in merges]
    for kind, name in [one for one in FOLDS if one in shown] + [one for one in shown if one not in FOLDS]:
        look = FOLDS.get((kind, name), ("#777777", "-.", 1.2, f"{kind}: {name}"))
        handles += _line(axes, view, "fold", merges[name] & kinds.get(kind, np.True_), look)
    for name, chosen in _codes(view, "unreached_vanishes").items():
        color, dash, label = UNREACHED.get(name, ("#777777", "-.", f"damping misses a mode: {name}"))
        handles += _line(axes, view, "unreached", chosen, (color, dash, 1.4, label))
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


def not_proved(view: View) -> str:
    """What to add where folds may be missing; the file tells why."""
    proof = str(view.variable("fold_proof").data[0]) if view.has("fold_proof") else "complete"
    return "" if proof == "complete" else "; not proved that these are all folds"


def _codes(view: View, name: str) -> dict[str, NDArray[np.bool_]]:
    """Which points of curves have which code of a variable."""
    if not view.has(name):
        return {}
    variable = view.variable(name)
    return {code: variable.data == value for code, value in flag_codes(variable).items()}


def _line(
    axes: Axes, view: View, what: str, chosen: NDArray[np.bool_], look: tuple[str, Any, float, str]
) -> list[Artist]:
    """Some of the curves in one look, each one with a point more that breaks the line."""
    from matplotlib.patheffects import Normal, Stroke

    points = np.flatnonzero(chosen)
    if not points.size:
        return []
    color, dash, width, label = look
    ends = np.flatnonzero(np.diff(view.variable(f"{what}_curve").data[points], append=-1)) + 1
    lines = [np.insert(view.axis(f"{what}_{name}")[points], ends, np.nan) for name in view.axes]
    effects = [Stroke(linewidth=width + 1.6, foreground="white", alpha=0.9), Normal()]
    return list(axes.plot(*lines, color=color, ls=dash, lw=width, label=label, path_effects=effects))
