"""What public functions return, drawn into given axes by the parts of which scans' pictures consist."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from functools import partial, wraps
from typing import Any

import numpy as np

from fastmech.attractors.flow import Flow, SectionFlow
from fastmech.errors import InputError, shown
from fastmech.objects import counted, state_units
from fastmech.plots import style
from fastmech.plots.basins import FEW_POINTS, Slice, describe, draw_attained, draw_ends, draw_labels
from fastmech.plots.equilibria import draw_potential, mark_kinds, over_potential
from fastmech.plots.equilibrium_map import draw_branches, draw_count, draw_verdicts, folds_of, least_span
from fastmech.plots.erosion import draw_stability
from fastmech.plots.map_view import View, draw_curves, make_view
from fastmech.plots.motion import MOTIONS, draw_states
from fastmech.results import Dataset
from fastmech.scene import Scene

#: Outputs over a period of a periodic motion.
OUTPUTS = 513

#: Trajectories that are drawn at most: evenly chosen ones.
MOST_LINES = 50

#: What curves and points of these kinds are; marks of folds by their kind.
TITLES = {
    "folds": "Folds: where equilibria merge",
    "fold_curves": "Fold curves: where equilibria merge",
    "undamped_curves": "Curves on which the damper misses a mode of a stable equilibrium",
}
FOLD_MARKS = {"fold": "o", "pitchfork": "^", "cusp": "D", "transcritical": "X"}

#: Marks and dashes that tell methods of one colour apart.
MARKERS, DASHES = "osD^vPX*", ("-", "--", ":", "-.")


#: How what an object has saved is drawn again, by its kind: from its dataset, into axes; what is about it.
About = Callable[..., str]
SAVED: dict[str, Callable[[Dataset, style.Axes, About], None]] = {}

#: Kinds of objects that have no picture, and what shows the same.
UNDRAWN = {
    "critical_values": "; an equilibrium_map over its parameter shows where positions come and go",
    "edge_track": "",
    "feature_groups": "",
    "labels": "; a map of basins shows where starts end",
    "linear_range": "; a request of kind disturbed draws it",
    "periodic_orbits": "",
}


def saved(*kinds: str) -> Callable[[Callable[[Dataset, style.Axes, About], None]], Callable[..., None]]:
    """Make a picture of a dataset one of the objects of these kinds, which draws their files too."""

    def made(draw: Callable[[Dataset, style.Axes, About], None]) -> Callable[..., None]:
        SAVED.update(dict.fromkeys(kinds, draw))

        @wraps(draw)
        def draw_object(found: Any, axes: style.Axes) -> None:
            draw(found.dataset(), axes, partial(style.setting, found.system))

        return draw_object

    return made


@style.style()
def draw_saved(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, style.Figure]:
    """The picture of a section that an object has saved, with the parameters that it is about.

    Raises:
        InputError: an older version saved less than is drawn.
    """

    def about(varied: Container[str | None] = (), decayed: bool = False) -> str:
        own = {name: value for name, value in scene.items() if name not in varied}
        return style.setting_of(dataset.attrs, own, decayed)

    figure, axes = style.new_panel()
    kind = str(dataset.attrs["kind"])
    try:
        SAVED[kind](dataset, axes, about)
    except KeyError as gone:
        raise InputError(f"{kind}: lacks {gone}, as older versions saved it; save it again") from None
    style.make_room(axes)
    return {"plot": figure}


@saved("trajectories")
def draw_trajectories(dataset: Dataset, axes: style.Axes, about: About) -> None:
    """Coordinates over time, of at most 50 trajectories; of a system of one's own all states."""
    t, states = dataset["time"].data, [n for n in dataset if dataset[n].dims == ("time", "trajectory")]
    units = {
        n: dataset[n].units for n in (states if "system" in dataset.attrs else style.coordinates_of(dataset))
    }
    number = dataset.sizes["trajectory"]
    kept = list(dict.fromkeys(np.linspace(0, number - 1, MOST_LINES).astype(int)))
    ordinates, drawn = _ordinates(axes, units), 0
    for unit, ordinate in ordinates.items():
        values = {n: dataset[n].data[:, kept] for n, u in units.items() if u == unit}
        draw_states(ordinate, t, values, unit, drawn)
        drawn += len(values)
    if 1 < number <= len(MOTIONS):
        for k, dashes in enumerate(MOTIONS[:number]):
            ordinate.plot([], [], color=style.ink(), ls=dashes, label=f"motion {k}")
    axes.set_xlabel(style.TIME)
    told = "Motion" if number == 1 else f"{len(kept)} of {number:,} motions"
    told = f"{number} motions" if 1 < number == len(kept) else told
    told += "; only the end is kept: give t_eval" * (t.size == 1)
    style.title(axes, f"{told}\n{about()}")
    _legend(axes, ordinates)


def _ordinates(axes: style.Axes, units: Mapping[str, str]) -> dict[str, style.Axes]:
    """An axis for each unit over one abscissa: the first on the left, others on the right."""
    found = {unit: axes.twinx() if k else axes for k, unit in enumerate(dict.fromkeys(units.values()))}
    getattr(axes.figure, "sca", lambda one: None)(axes)  # what a user adds by pyplot is still for these
    return found


def _legend(axes: style.Axes, ordinates: Mapping[str, style.Axes]) -> None:
    """What lines are: of several ordinates below, where it hides none."""
    handles = [line for one in ordinates.values() for line in one.get_legend_handles_labels()[0]]
    if len(ordinates) > 1:
        style.legend_under(axes, handles, 4)
    else:
        axes.legend()


@saved("disturbances")
def draw_disturbances(dataset: Dataset, axes: style.Axes, about: About) -> None:
    """Share of all disturbances that are back for good, over time."""
    every, until = dataset["time_to_return"].data, float(dataset["t_end"].data)
    times = np.sort(every[np.isfinite(every)])
    share = 100.0 * np.arange(times.size + 1) / every.size
    axes.step([0.0, *times, until], np.append(share, share[-1]), where="post", label="back by then")
    proved = 100.0 * float(dataset["share_returned"].data)
    axes.axhline(proved, color=style.LINES[1], ls="--", label="proved to return")
    until = min(until, 1.5 * times[-1]) if times.size else until
    axes.set(
        xlabel=style.TIME, ylabel="share of the disturbances back [%]", xlim=(0.0, until), ylim=(-3.0, 103.0)
    )
    style.title(axes, f"{dataset.attrs['heading']}\n{about()}")
    axes.legend()


@saved("disturbances_over_time")
def draw_departures(dataset: Dataset, axes: style.Axes, about: About) -> None:
    """Departures of the coordinates, nonlinear solid and linearized dashed."""
    t = dataset["time"].data
    units = {name: dataset[f"nonlinear_{name}"].units for name in style.coordinates_of(dataset)}
    ordinates = _ordinates(axes, units)
    for k, (name, unit) in enumerate(units.items()):
        nonlinear, linearized = (
            dataset[f"{kind}_{name}"].data[:, :MOST_LINES] for kind in ("nonlinear", "linearized")
        )
        look: Any = {"color": style.LINES[k], "marker": "o" if t.size == 1 else ""}
        ordinates[unit].plot(t, nonlinear, **look)[0].set_label(f"{style.symbol(name)} [{unit}]")
        ordinates[unit].plot(t, linearized, ls="--", mfc=style.paper(), **look)
        ordinates[unit].set_ylabel(f"departure from the equilibrium [{unit}]")
    told: Any = {"marker": "o", "mfc": style.paper()} if t.size == 1 else {}
    axes.plot([], [], color=style.ink(), ls="--", label="linearized", **told)
    axes.set_xlabel(style.TIME)
    style.title(axes, f"Disturbed motion\n{about()}")
    _legend(axes, ordinates)


def draw_resting(found: Any, axes: style.Axes) -> None:
    """Equilibria by kind: on the potential over one or two coordinates, else over two coordinates."""
    from matplotlib.ticker import MaxNLocator

    dataset = found.dataset()
    if over_potential(found.system):
        draw_potential(axes, dataset, found.system)
    else:
        x, y = (*style.coordinates_of(dataset), "energy")[:2]
        told = [style.quantity(dataset, name) if name != "energy" else "energy [J]" for name in (x, y)]
        axes.set(xlabel=told[0], ylabel=told[1])
        for axis, name in (("x", x), ("y", y)):
            low, high = dataset[name].data.min(), dataset[name].data.max()
            room = 0.15 * (high - low) + least_span(dataset, name)
            getattr(axes, f"set_{axis}lim")(low - room, high + room)
            getattr(axes, f"{axis}axis").set_major_locator(MaxNLocator(5))
        mark_kinds(axes, dataset, (x, y))
        style.title(axes, f"Equilibria\n{style.setting(found.system)}")
    style.legend_under(axes, columns=4)


def draw_map(found: Any, axes: style.Axes) -> None:
    """Numbers of equilibria over two parameters; over one an angle, or the coordinate that varies most.

    Where their number is the same everywhere, the number of stable ones is drawn.
    """
    view = make_view(style.with_units(found.dataset(), found.system), found.system.parameters)
    about = f"\n{view.setting}"
    if len(view.axes) == 2:
        name, kind = ("count", "") if np.ptp(view.data("count")) else ("count_stable", "stable ")
        handles, curves = draw_count(axes, view, name, "")
        style.title(axes, f"Number of {kind}equilibria{about}")
        style.legend_under(axes, handles + curves)
        return
    names = style.coordinates_of(view.dataset)
    if isinstance(found.system, Scene):
        draw_branches(axes, view, names[0], folds_of(view, view.axes[0]))
    else:
        draw_verdicts(axes, view, max(names, key=lambda name: np.ptp(np.nan_to_num(view.axis(name)))))
    axes.set_xlabel(view.label(view.axes[0]))
    style.title(axes, f"Equilibria over {view.axes[0]}{about}")
    style.legend_under(axes)


@saved("folds", "fold_curves", "undamped_curves")
def draw_curves_of(dataset: Dataset, axes: style.Axes, about: About) -> None:
    """Fold curves, and where damping misses a mode; folds over one parameter as places of the first angle."""
    names = dataset.attrs["axes"]
    what = TITLES[str(dataset.attrs["kind"])]
    style.title(axes, f"{what}\n{about(names, True)}")
    prefix = "undamped" if f"undamped_{names[0]}" in dataset else "fold"
    labels = [style.with_unit(name, dataset[f"{prefix}_{name}"].units) for name in names]
    if len(names) == 1:
        view = View(dataset, {}, names, {})
        places = dataset[f"fold_{names[0]}"].data
        for kind, of_kind in view.where("fold_kind").items():
            for k, merges in enumerate(("minimum", "maximum")):
                which = of_kind & view.where("fold_merges")[merges]
                look: Any = {"color": style.color(k), "marker": FOLD_MARKS.get(kind, "D"), "ls": "none"}
                if which.any():
                    look["label"] = f"{kind} of a {merges}"
                    axes.plot(places[which], dataset["fold_phi"].data[which], **look)
        axes.set(xlabel=labels[0], ylabel="angle φ [rad]")
        if not places.size:
            style.message(axes, "no fold between these values")
        style.legend_under(axes)
        return
    handles = draw_curves(axes, View(dataset, {}, names, {}))
    if not handles:
        style.message(axes, "no curve between these values")
    axes.set(xlabel=labels[0], ylabel=labels[1])
    style.legend_under(axes, handles)


@saved("critical_curves")
def draw_critical_curves(dataset: Dataset, axes: style.Axes, about: About) -> None:
    """Critical curves by their kind, and cusps."""
    each, names = list(dataset["kind"].data), dataset.attrs["names"]
    kinds = list(dict.fromkeys(each))
    ends = np.cumsum(dataset["points"].data)[:-1]
    for number, (x, y) in enumerate(
        zip(*(np.split(dataset[name].data, ends) for name in "xy"), strict=True) if each else ()
    ):
        k = kinds.index(each[number])
        (line,) = axes.plot(x, y, color=style.color(k), ls=("-", "--", "-.", ":")[k % 4])
        line.set_label(each[number] if number == each.index(each[number]) else "")
    if dataset.sizes["cusp"]:
        cusps = dataset["cusps"].data[:, :2].T
        axes.plot(*cusps, "D", color=style.paper(), mec=style.ink(), ls="none", label="cusp")
    axes.set(**{f"{k}label": style.with_unit(n, dataset[k].units) for k, n in zip("xy", names, strict=True)})
    style.title(axes, f"Critical curves\n{about(names)}")
    if not each:
        style.message(axes, "no curve between these values")
    style.legend_under(axes)


def draw_erosion_profile(found: Any, axes: style.Axes) -> None:
    """Shares of the starts that end in each well, with their intervals."""
    handles = draw_stability(axes, found.dataset())
    style.title(axes, f"{axes.get_title()}\n{style.setting(found.system, [found.parameter])}")
    style.legend_under(axes, handles)


def draw_snapping_map(found: Any, axes: style.Axes) -> None:
    """Where motions end over force and decay rate."""
    style.legend_under(axes, draw_ends(axes, found.dataset().merged, found.system.parameters))


@saved("lyapunov_exponents")
def draw_exponents(dataset: Dataset, axes: style.Axes, about: About) -> None:
    """Estimates of the largest Lyapunov exponent over time."""
    axes.plot(dataset["time"].data, dataset["exponents"].data[:, :MOST_LINES], color=style.LINES[0])
    axes.set(xlabel=style.TIME, ylabel="largest Lyapunov exponent [1/s]")
    style.title(axes, f"Estimates of the largest Lyapunov exponent\n{about()}")


@saved("work_precision")
def draw_frontier(dataset: Dataset, axes: style.Axes, about: About) -> None:
    """Trajectories a second over the largest error, a line for each method, the frontier marked.

    From each point a thin bar leads to the 99 % quantile of the errors.
    """
    methods = list(dataset["method"].data)
    largest, quantile, rate = (dataset[name].data for name in ("largest", "error_99", "rate"))
    for k, name in enumerate(dict.fromkeys(methods)):
        mine = np.flatnonzero([one == name for one in methods])
        mine = mine[np.argsort(largest[mine])]
        x, y, quantiles = largest[mine], rate[mine], quantile[mine]
        turn = k // len(style.LINES)  # the colours begin anew with another mark and other dashes
        look: dict[str, Any] = {"marker": MARKERS[turn % len(MARKERS)], "ls": DASHES[turn % len(DASHES)]}
        axes.plot(x, y, color=style.color(k), label=name, linewidth=1.2, **look)
        axes.hlines(y, quantiles, x, color=style.color(k), linewidth=0.8)
        axes.plot(quantiles, y, "|", color=style.color(k), markersize=7)
    best = np.flatnonzero(dataset["fastest"].data)
    axes.plot(
        largest[best], rate[best], "o", markersize=13, fillstyle="none",
        color=style.ink(), label="fastest at its largest error",
    )  # fmt: skip
    axes.plot([], [], "-|", color=style.ink(), linewidth=0.8, markersize=7, label="to the error of 99 %")
    axes.set(xscale="log", yscale="log")
    axes.set(xlabel="largest error [state's units], bars to the error of 99 %", ylabel="trajectories [1/s]")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    axes.grid(which="both", alpha=0.25)
    number, t_end = (dataset[name].data.item() for name in ("number", "t_end"))
    style.title(axes, f"Speed against error: {counted(number, 'motion')} of {t_end:g} s\n{about()}")


def draw_attractors(found: Any, axes: style.Axes) -> None:
    """Attractors over the first two states: points, and periodic motions over a period."""
    columns, flow = [0, min(1, len(found.names) - 1)], found.search.flow
    turning, told = flow.angles[columns], ""
    for k, one in enumerate(found.attractors):
        size = 8 if len(one.points) == 1 else 5 if len(one.points) < FEW_POINTS else 1
        axes.plot(*one.points[:, columns].T, "o", ms=size, color=style.color(k), label=one.name)
        if one.period:
            times = np.linspace(0.0, one.period / flow.period, OUTPUTS)
            path = Flow.run(flow, one.points[:1], times).y[:, 0, columns]  # in time, also with a section
            path = np.where(turning, np.remainder(path + np.pi, 2.0 * np.pi) - np.pi, path)
            path[1:][(np.abs(np.diff(path, axis=0)) > np.pi)[:, turning].any(axis=1)] = np.nan
            axes.plot(*path.T, color=style.color(k), lw=1.2)
            section = isinstance(flow, SectionFlow)
            marks = "passages of the section" if section else "a period of the forcing begins"
            told = "over one period" + f"; marks: {marks}" * flow.forced
    if told:
        axes.plot([], [], color=style.ink(), lw=1.2, label=told)
    room = np.where(turning, np.pi, flow.reach[columns])
    middle = np.where(turning, 0.0, flow.middle[columns])
    axes.update_datalim([middle - room, middle + room])
    axes.autoscale_view()
    units = state_units(found.system)
    shown = [found.names[c] for c in columns]
    labels = [style.with_unit(style.symbol(n), units.get(n, "1")) for n in shown]
    axes.set(xlabel=labels[0], ylabel=labels[1])
    style.angle_ticks(axes, **{k: units.get(n, "1") for k, n in zip("xy", shown, strict=True)})
    style.title(axes, f"Attractors\n{style.setting(found.system)}")
    style.legend_under(axes, columns=1)


def draw_basin_map(found: Any, axes: style.Axes, turns: bool | None = None) -> None:
    """Who ends where over the first two axes that vary; ``turns`` as for :func:`draw_labels`."""
    dataset = style.with_units(found.dataset(), found.system)
    of_wells = "equilibria" in dataset.groups
    if turns is not None and not (isinstance(turns, bool) and of_wells):
        raise InputError(f"turns = {shown(turns)}: must be True or False, and of a map of wells")
    if of_wells:
        view = Slice(dataset.merged, found.system)
        handles = draw_labels(axes, view, turns)
        style.legend_under(axes, handles)
        describe(axes, view, found.system.parameters)
    else:
        style.legend_under(axes, draw_attained(axes, dataset, style.setting(found.system)), 1)
