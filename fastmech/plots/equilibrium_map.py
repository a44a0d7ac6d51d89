"""Equilibria over one or two parameters: how many, where, how deep wells are, how fast motions settle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fastmech.arrays import Flags, Floats
from fastmech.objects import spaced
from fastmech.plots import style
from fastmech.plots.map_view import View, draw_curves, make_view, not_proved
from fastmech.results import Dataset

#: How sheets look, by their Morse index.
LOOKS = {
    1: (style.PALETTE["vermillion"], "--", 1.3, "unstable: saddle"),
    2: (style.PALETTE["purple"], ":", 1.6, "unstable: maximum"),
}

#: Colours of stable sheets, all of the first one where there are more.
STABLE = (style.PALETTE["blue"], style.PALETTE["green"], style.PALETTE["orange"])

#: Marks and names of what is special on the branches.
MARKS = {
    "fold": ("o", "fold"),
    "pitchfork": ("^", "pitchfork (symmetric)"),
    "cusp": ("D", "cusp"),
    "transcritical": ("s", "transcritical"),
}

#: Colours and marks of equilibria by their verdict.
VERDICTS = {
    "asymptotically_stable": (style.PALETTE["blue"], "o"),
    "stable": (style.PALETTE["green"], "s"),
    "unstable": (style.PALETTE["vermillion"], "x"),
    "critical": (style.PALETTE["black"], "D"),
}

#: How many times the least decay time the picture shows; beyond, damping misses a mode.
SLOWEST_SHOWN = 1e6

#: Folds whose values the title tells at most.
TOLD = 4


def draw_line(view: View) -> style.Figure:
    """All coordinates and the slowest decay time of the stable ones over one parameter.

    A scene's equilibria are joined to branches, which its folds end; those of a mechanism are told apart by
    their verdicts.
    """
    (name,), joined = view.axes, "mechanism" not in view.dataset.attrs
    rows, folds = [*style.coordinates_of(view.dataset)], folds_of(view, name)
    if view.has("decay_time") and (joined or np.isfinite(view.floats("decay_time")).any()):
        rows.append("decay_time")
    height = 1.8 + 2.2 * len(rows) if joined else 2.0 + 2.4 * len(rows)
    figure = style.new_figure(7.6, height)
    panels = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for axes, variable in zip(panels, rows, strict=True):
        if not joined:
            draw_verdicts(axes, view, variable)
        elif variable == "decay_time":
            _decay_times(axes, view, name)
        else:
            draw_branches(axes, view, variable, folds)
    panels[-1].set_xlabel(view.label(name))
    told = _told(view, folds, name) if joined else ""
    style.title(panels[0], f"Equilibria over {name}{told}\n{view.setting}")
    style.legend_below(figure, panels[0], 4)
    return figure


def draw_branches(axes: style.Axes, view: View, variable: str, folds: dict[str, Floats]) -> None:
    """Draw an angle of all equilibria over one parameter."""
    _draw_sheets(axes, _sheets(view, view.axes[0], variable, folds))
    if folds:
        for kind, there in _kinds(view, folds).items():
            marker, label = MARKS.get(kind, ("P", kind))
            places = folds["at"][there], folds[f"fold_{variable}"][there]
            axes.plot(*places, marker, color=style.paper(), mec=style.ink(), ms=6, ls="none", label=label)
        for value in folds["at"]:
            axes.axvline(value, color=style.ink(), lw=0.6, ls=":", zorder=0)
    axes.set(ylabel=f"angle {style.symbol(variable)} [rad]", ylim=(-3.4, 3.4))
    style.angle_ticks(axes, x="", y="rad")
    _own(axes, view)


def draw_verdicts(axes: style.Axes, view: View, variable: str) -> None:
    """Draw a coordinate or the decay time of all equilibria over one parameter, by their verdicts."""
    codes, verdict = view.variable("verdict").codes, view.data("verdict")
    values = view.floats(variable)
    x = np.broadcast_to(view.axis(view.axes[0])[:, None], values.shape)
    for word, (color, marker) in VERDICTS.items():
        there = (verdict == codes[word]) & np.isfinite(values)
        if there.any():
            look: Any = {"color": style.on_paper(color), "ms": 3, "ls": "none"}
            axes.plot(x[there], values[there], marker, label=word.replace("_", " "), **look)
    if variable == "decay_time":
        axes.set(ylabel="slowest decay time\nof the stable [s]", yscale="log")
        _widen(axes, 0.9, 1.1)
        style.logarithmic(axes.yaxis)
    else:
        least = least_span(view.dataset, variable)
        _widen(axes, -least, least)
        axes.set_ylabel(style.quantity(view.dataset, variable))
    _own(axes, view)


def least_span(dataset: Dataset, name: str) -> float:
    """Half of the smallest range of an axis of this variable: small devices have small ones."""
    unit = dataset[name].units
    alike = [dataset[n].data for n in {name, *style.coordinates_of(dataset)} if dataset[n].units == unit]
    largest = max(float(np.abs(np.nan_to_num(values)).max(initial=0.0)) for values in alike)
    return LEAST_SPAN * (largest if unit != "rad" and ROUNDING < largest < 1.0 else 1.0)


def _widen(axes: style.Axes, low: float, high: float) -> None:
    """Rounding shall not look like structure."""
    bottom, top = axes.get_ylim()
    middle = 0.5 * (bottom + top)
    if axes.get_yscale() == "log":
        axes.set_ylim(min(bottom, low * middle), max(top, high * middle))
    else:
        axes.set_ylim(min(bottom, middle + low), max(top, middle + high))


def _draw_sheets(axes: style.Axes, sheets: list[tuple[int, Floats, Floats]]) -> None:
    """Lines of sheets: the stable ones look by their order, the unstable ones by their Morse index."""
    several, number = 1 < sum(index == 0 for index, *_ in sheets) <= len(STABLE), 0
    labelled = {""}
    for index, x, y in sheets:
        color, dash, width, label = LOOKS.get(index, (STABLE[0], "-", 2.2, "stable"))
        if index == 0 and several:
            color, label, number = STABLE[number], f"stable, number {number}", number + 1
        look: Any = {"color": color, "ls": dash, "lw": width, "label": "" if label in labelled else label}
        axes.plot(x, y, marker="." if np.isfinite(y).sum() < 2 else "", **look)
        labelled.add(label)


def _decay_times(axes: style.Axes, view: View, name: str) -> None:
    sheets = [sheet for sheet in _sheets(view, name, "decay_time", {}) if sheet[0] == 0]
    _draw_sheets(axes, sheets)
    known = np.concatenate([np.zeros(0), *(y[np.isfinite(y)] for _, _, y in sheets)])
    if known.size:
        axes.set_yscale("log")
        if known.max() > SLOWEST_SHOWN * known.min():
            axes.set_ylim(0.5 * known.min(), SLOWEST_SHOWN * known.min())
        style.logarithmic(axes.yaxis)
    axes.set_ylabel("slowest decay time\nof the stable [s]")
    _own(axes, view)


def _kinds(view: View, folds: dict[str, Floats]) -> dict[str, Flags]:
    """Which folds are of which kind; files of older versions tell none."""
    found = view.where("fold_kind") or {"fold": np.ones(folds["at"].size, dtype=bool)}
    return {kind: there for kind, there in found.items() if there.any()}


def _told(view: View, folds: dict[str, Floats], name: str) -> str:
    """The values of the parameter at the folds, if they are few, and whether there may be others."""
    told = ""
    if folds and folds["at"].size <= TOLD:
        for kind, there in _kinds(view, folds).items():
            values = ", ".join(f"{value:.6g}" for value in folds["at"][there])
            several = "s" if np.count_nonzero(there) > 1 else ""
            told += f"; {kind}{several} at {values}{spaced(view.dataset[name].units)}"
    return told + not_proved(view)


def _own(axes: style.Axes, view: View) -> None:
    point = view.own()
    if point is not None:
        axes.axvline(point[0], color=style.ink(), lw=1.0, ls="-.", label=view.own_name)


def folds_of(view: View, name: str) -> dict[str, Floats]:
    """Where equilibria merge over one parameter."""
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
    goes_round = variable in style.ANGLES
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


#: Colours of counts, the same in both maps.
COUNT_COLORS = {
    0: "#bdbdbd",
    1: style.PALETTE["sky"],
    2: style.PALETTE["orange"],
    3: style.PALETTE["purple"],
    4: "#d5e3ec",
    5: style.PALETTE["green"],
    6: style.PALETTE["yellow"],
}

#: Half of the smallest range of an axis or a colour bar [rad], or over the largest value where that is less
#: than 1 m or J: rounding shall not look like structure. Values up to the other are rounding.
LEAST_SPAN, ROUNDING = 1e-3, 1e-12

#: Values differ by more, over the largest or 1, if a map of them tells anything.
ALIKE = 1e-6

#: How many times the least decay time colours still tell; beyond, damping misses a mode.
SLOWEST = 1e4

#: What part of the deepest well colours still tell; towards a fold depths vanish.
SHALLOWEST = 1e-2

#: Marks of points whose count is not an ordinary proved one.
UNSETTLED = {"at_fold": "|", "degenerate": "x", "unproved": "+"}

_ORDER = ("deepest", "second", "third")

#: What is shown of the stable equilibria: variables with the panels' title and the colour bar's label.
Rows = dict[str, tuple[str, str]]

#: Depth of each well, and the impulse on M2 that a blow needs at least to leave it.
BARRIER = {
    "depth": ("Energy to leave the {} well", "depth [J]"),
    "shock_limit_m2": ("No smaller blow on M2 leaves the {} well", "impulse on M2 [N s]"),
}

#: Time in which the slowest linear mode falls to 1/e.
DECAY = {"decay_time": ("Slowest mode of the {} stable equilibrium", "time to fall to 1/e [s]")}


@style.style()
def draw_equilibrium_map(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, style.Figure]:
    """Pictures of a dataset of the scan type ``equilibrium_map`` about the scene with these parameters."""
    view, stability = make_view(dataset, scene), "verdict" if "mechanism" in dataset.attrs else "morse_index"
    names = style.coordinates_of(dataset)

    def known(name: str) -> bool:
        return view.has(name) and bool(np.isfinite(view.stable(0, view.data(name))).any())

    if len(view.axes) == 1:
        return {"branches": draw_line(view)} if view.has(*names, stability) else {}
    figures = {}
    if view.has("count", "count_stable", "outcome"):
        figures["count"] = _counts(view)
    if not view.has("count_stable", "energy", names[0], stability) or not view.ranks:
        return figures
    wide = len(view.ranks)
    if view.has(*names) and any(
        np.ptp(np.nan_to_num(view.data(name))) > least_span(dataset, name) for name in names
    ):
        told = "{} of the {{}} stable equilibrium"
        rows = {n: (told.format(style.symbol(n)), style.quantity(dataset, n)) for n in names}
        figures["angles"] = _fields(view, (1.6 + 4.6 * wide, 0.4, 3.8), rows)
    if known("depth"):
        rows = {n: row for n, row in BARRIER.items() if view.has(n)}
        figures["barrier"] = _fields(view, (0.6 + 5.4 * wide, 1.4, 4.2), rows, apart=True)
    if known("decay_time"):
        figures["decay"] = _fields(view, (1.9 + 4.6 * wide, 1.2, 4.2), DECAY)
    return figures


def _counts(view: View) -> style.Figure:
    figure = style.new_figure(9.6, 5.6)
    titles = {"count": "Number of equilibria", "count_stable": "Number of stable equilibria"}
    for axes, (name, title) in zip(figure.subplots(1, 2), titles.items(), strict=True):
        handles, curves = draw_count(axes, view, name, title)
        style.legend_under(axes, handles, 3)
    _finish(figure, view, curves)
    return figure


def draw_count(
    axes: style.Axes, view: View, name: str, title: str
) -> tuple[list[style.Artist], list[style.Artist]]:
    """Draw a number of equilibria over two parameters; returns what the colours mean, and the curves."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    most = max(6, int(view.data("count").max()))
    more = colormaps["tab20c"](np.linspace(0.0, 1.0, max(1, most - 6)))
    looks = {**COUNT_COLORS, **{n: to_hex(more[n - 7]) for n in range(7, most + 1)}}
    counts, (x, y) = view.data(name), map(view.axis, view.axes)
    style.paint(axes, x, y, counts, list(looks.values()))
    handles = [
        style.swatch(f"{n} ({style.share(counts == n)})", looks[int(n)], looks[int(n)])
        for n in np.unique(counts)
    ]
    curves = draw_curves(axes, view)
    _label(axes, view, title)
    return handles + _mark_unsettled(axes, view) + _mark_own(axes, view), curves


def _mark_unsettled(axes: style.Axes, view: View) -> list[style.Artist]:
    x, y = np.meshgrid(*map(view.axis, view.axes), indexing="ij")
    codes = view.dataset["outcome"].codes
    handles: list[style.Artist] = []
    for name, marker in {**dict.fromkeys(codes.others({"complete"}), "P"), **UNSETTLED}.items():
        where = view.data("outcome") == codes[name]
        if where.any():
            label = f"{name.replace('_', ' ')} ({np.count_nonzero(where)})"
            handles += axes.plot(x[where], y[where], marker, color=style.ink(), ms=5, label=label)
    return handles


def _mark_own(axes: style.Axes, view: View) -> list[style.Artist]:
    point = view.own()
    if point is None:
        return []
    return list(
        axes.plot(*point, "*", color=style.paper(), mec=style.ink(), ms=15, ls="none", label=view.own_name)
    )


def _fields(view: View, size: tuple[float, float, float], rows: Rows, apart: bool = False) -> style.Figure:
    """A row for each variable, a column for each stable equilibrium; a colour bar for each panel or row.

    ``size``: width, height of what is round the rows, and of each. Of a variable that is the same everywhere
    the value is told.
    """
    values = {name: np.array([view.stable(rank, view.data(name)) for rank in view.ranks]) for name in rows}
    varied = {name: fields for name, fields in values.items() if not _alike(fields)}
    means = {name: np.round(np.nanmean(values[name]), 12) + 0.0 for name in rows if name not in varied}
    told = "\n".join(
        f"{rows[name][1]}: {mean:.4g} at every stable equilibrium, so no map" for name, mean in means.items()
    )
    figure = style.new_figure(size[0], size[1] + (size[2] * len(varied) or 1.0))
    if not varied:
        style.message(figure.subplots(), told)
        _finish(figure, view, [])
        return figure
    panels = figure.subplots(len(varied), len(view.ranks), squeeze=False, sharex=True, sharey=True)
    handles: list[style.Artist] = []
    for row, (name, fields) in zip(panels, varied.items(), strict=True):
        title, label = rows[name]
        for alike in [[rank] for rank in view.ranks] if apart else [[*view.ranks]]:
            _colour(list(row[alike]), view, fields[alike], name, label)
        for axes, order in zip(row, _ORDER, strict=False):
            handles = draw_curves(axes, view) + _mark_own(axes, view)
            _label(axes, view, title.format(order))
    _finish(figure, view, handles + _nothing(view), told)
    return figure


def _alike(fields: Floats) -> bool:
    """Whether values differ by rounding alone."""
    known = fields[np.isfinite(fields)]
    return bool(known.size and np.ptp(known) <= ALIKE * max(1.0, float(np.abs(known).max())))


def _colour(panels: list[style.Axes], view: View, fields: Floats, name: str, label: str) -> None:
    """Fields of a variable in panels with one colour bar, which has arrows where values are beyond it.

    Those have the colour of the nearer end. Angles that go round have cyclic colours.
    """
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap, Normalize

    known, place = fields[np.isfinite(fields)], name in style.coordinates_of(view.dataset)
    known, extend = known if place else known[known > 0.0], "neither"
    cmap: Any = style.FIELD
    if not known.size:
        return
    low, high = float(known.min()), float(known.max())
    if not place:
        if name == "decay_time":
            high = min(high, SLOWEST * low)
        else:
            low = max(low, SHALLOWEST * high)
        norm = style.log_colors(low, high)
        extend = "min" if np.nanmin(fields) < low else "max" if np.nanmax(fields) > high else extend
    elif view.dataset[name].units == "rad" and high - low > 1.5 * np.pi:
        norm = Normalize(-np.pi, np.pi)  # cyclic, and nowhere white, which means that there is none
        cmap = ListedColormap(0.78 * colormaps["twilight"](np.linspace(0.0, 1.0, 256))[:, :3])
    else:
        middle, half = 0.5 * (low + high), max(0.5 * (high - low), least_span(view.dataset, name))
        norm = Normalize(middle - half, middle + half)
    x, y = map(view.axis, view.axes)
    for axes, field in zip(panels, fields, strict=True):
        mesh = style.shade(axes, x, y, np.clip(field, norm.vmin, norm.vmax), norm=norm, cmap=cmap)
    bar = panels[0].figure.colorbar(mesh, ax=panels, label=label, extend=extend)
    if not place and not style.tell_one_value(bar):
        style.logarithmic(bar.ax.yaxis)


def _nothing(view: View) -> list[style.Artist]:
    """What white means where not every point has as many stable equilibria as panels."""
    if int(view.data("count_stable").min()) == len(view.ranks):
        return []
    return [style.swatch("white: no such stable equilibrium", "white", "#808080")]


def _label(axes: style.Axes, view: View, title: str) -> None:
    axes.set(xlabel=view.label(view.axes[0]), ylabel=view.label(view.axes[1]))
    axes.set_title(title, fontsize=10.5)
    axes.grid(visible=False)


def _finish(figure: style.Figure, view: View, handles: list[style.Artist], told: str = "") -> None:
    """The scene above everything, with what else is told, the legend below."""
    style.suptitle(figure, "\n".join(filter(None, (view.setting + not_proved(view), told))))
    for axes in figure.axes:
        if axes.get_subplotspec() is not None:
            axes.label_outer()
    if handles:
        style.legend_below(figure, handles, 2 if figure.get_figwidth() > 8.0 else 1)
