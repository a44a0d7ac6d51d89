"""Equilibria over one parameter: stable solid, unstable dashed, folds and pitchforks marked."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastmech.plots.labels import PI_TICKS, coordinates_of, flag_codes, logarithmic, quantity
from fastmech.plots.map_curves import not_proved
from fastmech.plots.map_view import View
from fastmech.plots.style import PALETTE, legend_below, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

#: How sheets look, by their Morse index.
LOOKS = {
    1: (PALETTE["vermillion"], "--", 1.3, "unstable: saddle"),
    2: (PALETTE["purple"], ":", 1.6, "unstable: maximum"),
}

#: Colours of stable sheets, all of the first one where there are more.
STABLE = (PALETTE["blue"], PALETTE["green"], PALETTE["orange"])

#: Marks and names of what is special on the branches.
MARKS = {
    "fold": ("o", "fold"),
    "pitchfork": ("^", "pitchfork (symmetric)"),
    "cusp": ("D", "cusp"),
    "transcritical": ("s", "transcritical"),
}

#: Colours and marks of equilibria by their verdict.
VERDICTS = {
    "asymptotically_stable": (PALETTE["blue"], "o"),
    "stable": (PALETTE["green"], "s"),
    "unstable": (PALETTE["vermillion"], "x"),
    "critical": (PALETTE["black"], "D"),
}

#: Half of the smallest range of an axis [rad or m].
LEAST_SPAN = 1e-3

#: How many times the least decay time the picture shows; beyond, damping misses a mode.
SLOWEST = 1e6

#: Folds whose values the title tells at most.
TOLD = 4


def draw_bifurcation(view: View) -> Figure:
    """phi, theta and the slowest decay time of the stable ones over one parameter."""
    (name,) = view.axes
    third = view.has("decay_time")
    figure = new_figure(7.6, 8.4 if third else 6.2)
    panels = figure.subplots(3 if third else 2, 1, sharex=True)
    folds = _folds(view, name)
    for axes, variable, symbol in zip(panels, ("phi", "theta"), ("φ", "θ"), strict=False):
        labelled: set[str] = set()
        for (color, dash, width, label), x, y in _looks(_sheets(view, name, variable, folds)):
            axes.plot(
                x, y, color=color, ls=dash, lw=width, marker="." if np.isfinite(y).sum() < 2 else "",
                label="" if label in labelled else label,
            )  # fmt: skip
            labelled.add(label)
        if folds:
            for kind, there in _kinds(view, folds).items():
                marker, label = MARKS.get(kind, ("P", kind))
                places = folds["at"][there], folds[f"fold_{variable}"][there]
                axes.plot(*places, marker, color="white", mec="black", ms=6, ls="none", label=label)
            for value in folds["at"]:
                axes.axvline(value, color="black", lw=0.6, ls=":", zorder=0)
        axes.set(ylabel=f"angle {symbol} [rad]", ylim=(-3.4, 3.4))
        axes.set_yticks(*PI_TICKS)
        _own(axes, view)
    if third:
        _decay(panels[2], view, name)
    panels[-1].set_xlabel(view.label(name))
    panels[0].set_title(f"Equilibria over {name}{_told(view, folds, name)}\n{view.setting}")
    legend_below(figure, panels[0], 4)
    return figure


def draw_places(view: View) -> Figure:
    """All coordinates and the slowest decay time over one parameter, of maps with equilibria not joined."""
    (name,) = view.axes
    timed = view.has("decay_time") and np.isfinite(view.data("decay_time").astype(np.float64)).any()
    rows = [*coordinates_of(view.dataset), *(["decay_time"] if timed else [])]
    figure = new_figure(7.6, 2.0 + 2.4 * len(rows))
    panels = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    codes, verdict = flag_codes(view.variable("verdict")), view.data("verdict")
    for axes, variable in zip(panels, rows, strict=True):
        values = np.asarray(view.data(variable), dtype=np.float64)
        x = np.broadcast_to(view.axis(name)[:, None], values.shape)
        for word, (color, marker) in VERDICTS.items():
            there = (verdict == codes[word]) & np.isfinite(values)
            if there.any():
                axes.plot(
                    x[there],
                    values[there],
                    marker,
                    color=color,
                    ms=3,
                    ls="none",
                    label=word.replace("_", " "),
                )
        if variable == "decay_time":
            axes.set(ylabel="slowest decay time\nof the stable [s]", yscale="log")
            _widen(axes, 0.9, 1.1)
            logarithmic(axes.yaxis)
        else:
            _widen(axes, -LEAST_SPAN, LEAST_SPAN)
            axes.set_ylabel(quantity(view.dataset, variable))
        _own(axes, view)
    panels[-1].set_xlabel(view.label(name))
    panels[0].set_title(f"Equilibria over {name}\n{view.setting}")
    legend_below(figure, panels[0], 4)
    return figure


def _widen(axes: Axes, low: float, high: float) -> None:
    """Rounding shall not look like structure."""
    bottom, top = axes.get_ylim()
    middle = 0.5 * (bottom + top)
    if axes.get_yscale() == "log":
        axes.set_ylim(min(bottom, low * middle), max(top, high * middle))
    else:
        axes.set_ylim(min(bottom, middle + low), max(top, middle + high))


def _looks(
    sheets: list[tuple[int, Floats, Floats]],
) -> Iterator[tuple[tuple[str, str, float, str], Floats, Floats]]:
    """How each sheet looks: the stable ones by their order, the unstable ones by their Morse index."""
    stable = sum(index == 0 for index, _, _ in sheets)
    seen = 0
    for index, x, y in sheets:
        if index != 0:
            yield LOOKS[index], x, y
            continue
        several = 1 < stable <= len(STABLE)
        label = f"stable, number {seen + 1}" if several else "stable"
        yield (STABLE[seen if several else 0], "-", 2.2, label), x, y
        seen += 1


def _decay(axes: Axes, view: View, name: str) -> None:
    sheets = [sheet for sheet in _sheets(view, name, "decay_time", {}) if sheet[0] == 0]
    for (color, dash, width, _), x, y in _looks(sheets):
        axes.semilogy(x, y, color=color, ls=dash, lw=width, marker="." if np.isfinite(y).sum() < 2 else "")
    known = np.concatenate([np.zeros(0), *(y[np.isfinite(y)] for _, _, y in sheets)])
    if known.size:
        if known.max() > SLOWEST * known.min():
            axes.set_ylim(0.5 * known.min(), SLOWEST * known.min())
        logarithmic(axes.yaxis)
    axes.set_ylabel("slowest decay time\nof the stable [s]")
    _own(axes, view)


def _kinds(view: View, folds: dict[str, Floats]) -> dict[str, NDArray[np.bool_]]:
    """Which folds are of which kind; files of older versions tell none."""
    if not view.has("fold_kind"):
        return {"fold": np.ones(folds["at"].size, dtype=bool)}
    codes, kind = flag_codes(view.variable("fold_kind")), view.variable("fold_kind").data
    found = {name: kind == codes[name] for name in (*MARKS, *codes.others(MARKS))}
    return {name: there for name, there in found.items() if there.any()}


def _told(view: View, folds: dict[str, Floats], name: str) -> str:
    """The values of the parameter at the folds, if they are few, and whether there may be others."""
    told = ""
    if folds and folds["at"].size <= TOLD:
        for kind, there in _kinds(view, folds).items():
            values = ", ".join(f"{value:.6g}" for value in folds["at"][there])
            told += (
                f"; {kind}{'s' if np.count_nonzero(there) > 1 else ''} at {values} {view.dataset[name].units}"
            )
    return told + not_proved(view)


def _own(axes: Axes, view: View) -> None:
    point = view.own()
    if point is not None:
        axes.axvline(point[0], color="black", lw=1.0, ls="-.", label="the scene")


def _folds(view: View, name: str) -> dict[str, Floats]:
    if len(view.dataset.attrs["axes"]) != 1 or not view.has(f"fold_{name}"):
        return {}
    return {"at": view.axis(f"fold_{name}")} | {key: view.axis(key) for key in ("fold_phi", "fold_theta")}


def _sheets(
    view: View, name: str, variable: str, folds: dict[str, Floats]
) -> list[tuple[int, Floats, Floats]]:
    """Morse index, parameter and a variable of every sheet; angles lead to its folds and break at +-pi."""
    sheet, values, x = view.data("sheet"), view.data(variable), view.axis(name)
    if x[0] > x[-1]:
        sheet, values, x = sheet[::-1], values[::-1], x[::-1]
    curves = []
    for number, index in enumerate(view.variable("sheet_morse_index").data):
        there = sheet == number
        line = np.where(there.any(axis=-1), np.where(there, values, 0.0).sum(axis=-1), np.nan)
        curves.append((int(index), x.copy(), np.asarray(line, dtype=np.float64)))
    for at, angle in zip(folds.get("at", ()), folds.get(f"fold_{variable}", ()), strict=True):
        _lead_to_fold(curves, float(at), float(angle))
    goes_round = variable in ("phi", "theta")
    return [
        (index, *(_cut(xs, ys) if goes_round else (xs, ys)))
        for index, xs, ys in curves
        if np.isfinite(ys).any()
    ]


def _lead_to_fold(curves: list[tuple[int, Floats, Floats]], at: float, angle: float) -> None:
    """Extend the two sheets that merge at a fold up to it."""
    ends = []
    for number, (_, x, y) in enumerate(curves):
        k = int(np.searchsorted(x, at))
        if not 0 < k < x.size or np.isfinite(y[k - 1]) == np.isfinite(y[k]):
            continue
        value = y[k - 1] if np.isfinite(y[k - 1]) else y[k]
        ends.append((abs(np.remainder(value - angle + np.pi, 2 * np.pi) - np.pi), number, k))
    for _, number, k in sorted(ends)[:2]:
        index, x, y = curves[number]
        curves[number] = (index, np.insert(x, k, at), np.insert(y, k, angle))


def _cut(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """A line that is broken where the angle goes round."""
    jumps = np.flatnonzero(np.abs(np.diff(y)) > np.pi) + 1
    return np.insert(x, jumps, x[jumps] if jumps.size else []), np.insert(y, jumps, np.nan)
