"""Motion over a parameter: amplitudes of periodic motions, and shares of the starts that end where."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from fastmech.arrays import Flags, Floats
from fastmech.basins.measures.fractions import wilson
from fastmech.errors import InputError
from fastmech.objects import counted, spaced
from fastmech.plots import style
from fastmech.results import Dataset
from fastmech.scene import nearest

#: What tells areas of the same colour apart.
HATCHES = ("", "//", "..", "xx")

#: Curves are one that are nearer than this share of the picture.
NEAR = 2e-3

#: Lines of motions that repel, attract, and do neither.
LOOKS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("unstable", {"ls": "--", "lw": 1.2}),
    ("stable", {"ls": "-", "lw": 1.8}),
    ("neutral", {"ls": "-.", "lw": 1.2}),
)

#: Lines on those of other branches, of which both are seen.
DOTS: dict[str, Any] = {"ls": ":", "lw": 1.8}

#: Marker of each kind of special point.
MARKERS = {"fold": "o", "branch point": "^", "period doubling": "s", "Neimark-Sacker": "D"}


def draw_frequency_response(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, style.Figure]:
    """Amplitudes of the first coordinate over the parameter; each stability has its own line."""
    lines = max((v.data.size for v in dataset.variables.values()), default=1)
    return {"response": _lines(dataset, scene, _response, lines)}


def draw_response(response: Any, ax: style.Axes, state: str | None = None) -> None:
    """Draw the amplitude of a state, the first by default, over the parameter.

    Raises:
        InputError: there is no such state.
    """
    if state is not None and state not in response.names:
        raise InputError(f"state: {nearest(str(state), list(response.names))}")
    _response(response.dataset(), ax, 0, state)
    style.title(ax, f"{ax.get_title()}\n{style.setting(response.system, [response.parameter])}")


def _response(dataset: Dataset, ax: style.Axes, line: int, state: str | None = None) -> None:
    points, special = dataset.groups["points"], dataset.groups["special"]
    prefix = "amplitude_"
    states = [n.removeprefix(f"point_{prefix}") for n in points if n.startswith(f"point_{prefix}")]
    amplitude = f"{prefix}{state or states[0]}"
    mine, own = points["point_line"].data == line, points["point_branch"].data
    turns = f"point_turns_{state or states[0]}"  # not in older files
    rotates = points[turns].data != 0.0 if turns in points else np.zeros_like(mine)
    rotating, mine = np.unique(own[mine & rotates]), mine & ~rotates
    values, sizes = points["point_value"].data, points[f"point_{amplitude}"].data
    spans = [np.ptp(every[mine]) or 1.0 if mine.any() else 1.0 for every in (values, sizes)]
    drawn: list[tuple[int, Floats]] = []
    together = False
    multipliers = points["point_multiplier_re"].data + 1j * points["point_multiplier_im"].data
    looks = np.all(np.abs(multipliers) < 1.0, axis=1).astype(int)
    if "point_neutral" in points:  # not in older files
        looks[points["point_neutral"].data != 0] = 2
    for k, branch in enumerate(np.unique(own[mine])):
        at = np.flatnonzero(mine & (own == branch))
        for part in np.split(np.arange(at.size), np.flatnonzero(np.diff(looks[at])) + 1):
            joined = at[part[0] : part[-1] + 2]
            look = int(looks[joined[0]])
            curve = np.stack([values[joined], sizes[joined]], axis=1)
            again, below = _drawn_before(curve / spans, look, drawn)
            on = below & ~again
            on[:-1] |= below[1:]  # up to what is beside
            on[1:] |= below[:-1]
            for shown, its in ((~again & ~below, LOOKS[look][1]), (on, DOTS))[: 1 + on.any()]:
                y = np.where(shown, curve[:, 1], np.nan)
                ax.plot(curve[:, 0], y, color=style.color(k), **its)
            together |= bool(on.any())
    if "point_far" in points and (points["point_far"].data[mine] != 0).any():
        ax.set_yscale("log")
    last = np.append(own[mine][1:] != own[mine][:-1], True) if mine.any() else mine[:0]
    x, y, cut = values[mine], sizes[mine], (points["point_cut"].data[mine] != 0) & (last | np.roll(last, 1))
    cut &= (x > x.min(initial=np.inf)) & (x < x.max(initial=-np.inf))  # not at the end of the range
    stops = points["point_stops"].data[mine] != 0 if "point_stops" in points else cut & False  # older files
    for ends, marker, about in ((cut, "kx", "cut off: the branch goes on"), (stops, "k*", "motions stop")):
        if ends.any():
            ax.plot(x[ends], y[ends], marker, ms=5, zorder=4, label=about)
    branches = np.unique(own[mine])
    for k, branch in enumerate(branches[: len(style.LINES)] if branches.size > 1 else ()):
        at = np.flatnonzero(mine & (own == branch))
        least = at[np.argmin(sizes[at])]
        names = [n for n in states if not n.endswith("_dot")][:2]
        place = [points[f"point_place_{n}"] for n in names]
        about = style.place(names, [one.data[least] for one in place], [one.units for one in place], "z.2f")
        ax.plot([], [], color=style.color(k), lw=4.0, label=f"branch {k + 1} at {about}")
    for k, (label, line_look) in enumerate(LOOKS):
        if (looks[mine] == k).any():
            ax.plot([], [], color=style.ink(), label=label, **line_look)
    if together:
        ax.plot([], [], color=style.ink(), label="on the line of another branch", **DOTS)
    for kind, marker in MARKERS.items():
        there = (special["special_line"].data == line) & (special["special_kind"].data == kind)
        there &= ~np.isin(special["special_branch"].data, rotating)
        if there.any():
            x, y = special["special_value"].data[there], special[f"special_{amplitude}"].data[there]
            ax.plot(x, y, marker, ls="none", mfc=style.paper(), mec=style.ink(), ms=5, label=kind, zorder=4)
    parameter = style.with_unit(style.symbol(str(dataset.attrs["parameter"])), points["point_value"].units)
    about = style.with_unit(style.symbol(amplitude.removeprefix(prefix)), points[f"point_{amplitude}"].units)
    ax.set(xlabel=parameter, ylabel=f"amplitude of {about},\nhalf of its range")
    told = f"\n{counted(rotating.size, 'branch')} not shown: there {state or states[0]} rotates"
    told *= rotating.size > 0
    periods = int(dataset.attrs["periods"])
    period = "one period" if periods == 1 else f"{periods} periods"
    ax.set_title(f"Motions that repeat after {period} of the forcing{told}")
    style.legend_under(ax, columns=2)


def _drawn_before(curve: Floats, look: int, drawn: list[tuple[int, Floats]]) -> tuple[Flags, Flags]:
    """Which points of a curve (m, 2) lie on its own way there, and which on others of one look.

    Dashes upon dashes would be a line. Mirror images of a motion have one amplitude, and lie on each other.
    The curve joins what is drawn.
    """
    gone = np.zeros((2, len(curve)), dtype=np.bool_)
    length = np.append(0.0, np.hypot(*np.diff(curve, axis=0).T).cumsum())
    for of, line in [*drawn, (look, curve)]:
        if of != look or len(line) < 2:
            continue
        along, away = np.diff(line, axis=0), curve[:, None] - line[:-1]
        share = np.clip((away * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-300), 0.0, 1.0)
        near = np.hypot(*np.moveaxis(away - share[..., None] * along, 2, 0)) < NEAR
        if line is curve:
            near &= length[:, None] - length[1:] > 10.0 * NEAR
        gone[0 if line is curve else 1] |= near.any(axis=1)
    gone[:, 1:-1] &= gone[:, :-2] | gone[:, 2:]  # one point alone is a crossing
    drawn.append((look, curve))
    return gone[0], gone[1]


def draw_shares(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, style.Figure]:
    """Shares stacked over the parameter; of a second one's first, middle and last values."""
    share = dataset["share"].data
    return {"shares": _lines(dataset, scene, _fractions, len(share) if share.ndim == 3 else 1)}


def draw_fractions(along: Any, ax: style.Axes) -> None:
    """Draw shares stacked over the parameter."""
    _fractions(along.dataset(), ax, 0, [told_attractor(along, k) for k in range(along.fractions.shape[1])])
    style.title(ax, f"{ax.get_title()}\n{style.setting(along.system, [along.parameter])}")


def told_attractor(along: Any, number: int) -> str:
    """An attractor's number, with its kind where it is first met."""
    first = next((one[number] for one in along.attractors if number in one), None)
    period = getattr(first, "forcing_periods", None)
    told = f", period {period} of the forcing" if period else f", {getattr(first, 'kind', '')}"
    return f"{number}{told.rstrip(', ')}"


def _fractions(dataset: Dataset, ax: style.Axes, line: int, names: Sequence[str] = ()) -> None:
    name, tips = str(dataset.attrs["along"]), dataset.groups["tipping"]
    values, every = dataset[name].data, dataset["share"].data
    share = every[line] if every.ndim == 3 else every
    known = np.flatnonzero(np.isfinite(share).any(axis=0))
    shares = np.nan_to_num(share[:, known]).T
    names = [f"attractor {names[k] if names else k}" for k in known.tolist()]
    colors = [style.color(k) for k in known.tolist()]
    rest = np.maximum(dataset["unlabelled"].data.reshape(-1, values.size)[line], 0.0)
    if (rest > 0.0).any():
        shares, names, colors = np.vstack([shares, rest]), [*names, "without a label"], [*colors, "#d9d9d9"]
    there = (tips["tipping_along"].data == name) & (tips["tipping_line"].data == line)
    events = np.unique(0.5 * (tips["tipping_low"].data + tips["tipping_high"].data)[there])
    # Areas break where an attractor comes or goes; between two such places no share is known.
    order = np.argsort(values)
    x, shares = values[order], shares[:, order]
    measured = shares
    after, first, count = np.unique(np.searchsorted(x, events), return_index=True, return_counts=True)
    breaks = events[np.stack([first, first, first + count - 1, first + count - 1], axis=1).ravel()]
    four = np.repeat(after, 4)
    beside = shares[:, four - np.tile([1, 1, 0, 0], after.size)] * np.tile([1.0, 0.0, 0.0, 1.0], after.size)
    x_of, shares = np.insert(x, four, breaks), np.insert(shares, four, beside, axis=1)
    areas = ax.stackplot(x_of, shares, labels=names, colors=colors, alpha=0.85)
    if n := int(dataset.attrs.get("starts", 0)):
        tops, told = np.cumsum(measured, axis=0)[:-1], "95 % Wilson interval of all below"
        for top in tops:
            low, high = wilson(np.rint(top * n).astype(int), n)
            look: dict[str, Any] = {"fmt": "none", "ecolor": style.ink(), "elinewidth": 1.0, "capsize": 3}
            top = np.where(top > 0.0, top, np.nan)
            ax.errorbar(x, top, [np.maximum(top - low, 0.0), np.maximum(high - top, 0.0)], label=told, **look)
            told = ""
    for k, area in zip(known.tolist(), areas, strict=False):
        area.set_hatch(HATCHES[k // len(style.LINES) % len(HATCHES)])
    blank = ", blank: not known" if (count > 1).any() else ""
    told = f"one comes or goes; pale: shares as at the values beside{blank}"
    for change in events:
        ax.axvline(change, color=style.ink(), lw=0.8, ls=":", label=told)
        told = ""
    for k in after:
        ax.axvspan(x[k - 1], x[k], color=style.paper(), alpha=0.4, lw=0)
    low, high = sorted((values[0], values[-1]))
    ax.set(xlabel=name, ylabel="share of the starts", xlim=(low, high), ylim=(0.0, 1.0))
    ax.set_title("Where starts end")
    style.legend_under(ax)


def draw_numbers(over: Any, ax: style.Axes) -> None:
    """Draw how many attractors there are over two parameters, and where one comes or goes."""
    first = over.lines[0]
    number = np.isfinite(over.fractions).sum(axis=2)
    mesh = ax.pcolormesh(first.values, over.values, number, cmap="Blues", vmin=0, shading="nearest")
    tips = [
        (0.5 * (t.low + t.high), v)
        for v, line in zip(over.values, over.lines, strict=True)
        for t in line.tipping
    ]
    tips += [
        (v, 0.5 * (t.low + t.high))
        for v, column in zip(first.values, over.tipping, strict=True)
        for t in column
    ]
    ax.plot(*np.reshape(tips, (-1, 2)).T, "k.", ms=4, label="one comes or goes")
    ax.figure.colorbar(mesh, ax=ax, label="attractors")
    ax.set(xlabel=first.parameter, ylabel=over.second)
    style.title(ax, f"Attractors\n{style.setting(over.system, [first.parameter, over.second])}")


@style.style()
def _lines(
    dataset: Dataset, scene: Mapping[str, float], draw: Callable[[Dataset, style.Axes, int], None], count: int
) -> style.Figure:
    """The first, middle and last of so many values of a second parameter, a panel each."""
    shown = sorted({0, count // 2, count - 1})
    figure = style.new_figure(8.0, 1.2 + 4.4 * len(shown))
    panels = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
    for k, ax in zip(shown, panels, strict=True):
        draw(dataset, ax, k)
        second = [(n, v) for n, v in dataset.variables.items() if v.dims == (n,) and v.data.size == count]
        if count > 1:
            name, values = second[0]
            ax.set_title(f"{ax.get_title()}; {name} = {values.data[k]:g}{spaced(values.units)}")
    changes = {*dataset.variables, dataset.attrs.get("parameter")}
    held = {name: value for name, value in scene.items() if name not in changes}
    style.suptitle(figure, style.setting_of(dataset.attrs, held))
    return figure
