"""What public functions return, drawn into given axes by the parts of which scans' pictures consist."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fastmech.attractors.flow import Flow, SectionFlow
from fastmech.errors import InputError, shown
from fastmech.objects import counted
from fastmech.plots import style
from fastmech.plots.basins import Slice, describe, draw_ends, draw_labels
from fastmech.plots.equilibria import draw_potential, mark_kinds, over_potential
from fastmech.plots.equilibrium_map import LEAST_SPAN, draw_branches, draw_count, draw_verdicts, folds_of
from fastmech.plots.erosion import draw_stability
from fastmech.plots.map_view import View, draw_curves, make_view
from fastmech.plots.motion import draw_states
from fastmech.results import coordinate_units, state_units
from fastmech.scene import Scene

#: Points of an attractor up to which each is drawn as a mark.
FEW_POINTS = 32

#: Outputs over a period of a periodic motion.
OUTPUTS = 513

#: Trajectories that are drawn at most: evenly chosen ones.
MOST_LINES = 50


def draw_trajectories(found: Any, axes: style.Axes) -> None:
    """Coordinates over time, of at most 50 trajectories; of a system of one's own all states."""
    own = hasattr(found.system, "rhs")
    units = state_units(found.system) if own else coordinate_units(found.system)
    kept = list(dict.fromkeys(np.linspace(0, found.y.shape[1] - 1, MOST_LINES).astype(int)))
    ordinates, drawn = _ordinates(axes, units), 0
    for unit, ordinate in ordinates.items():
        values = {n: found.y[:, kept, k] for k, (n, u) in enumerate(units.items()) if u == unit}
        draw_states(ordinate, found.t, values, unit, drawn)
        drawn += len(values)
    axes.set_xlabel(style.TIME)
    told = "; only the end is kept: give t_eval" if found.t.size == 1 else ""
    style.title(axes, f"Motion{told}\n{style.setting(found.system)}")
    _legend(axes, ordinates)


def _ordinates(axes: style.Axes, units: Mapping[str, str]) -> dict[str, style.Axes]:
    """An axis for each unit over one abscissa: the first on the left, others on the right."""
    found = {unit: axes.twinx() if k else axes for k, unit in enumerate(dict.fromkeys(units.values()))}
    axes.figure.sca(axes)  # what a user adds by pyplot is still for these
    return found


def _legend(axes: style.Axes, ordinates: Mapping[str, style.Axes]) -> None:
    """What lines are: of several ordinates below, where it hides none."""
    handles = [line for one in ordinates.values() for line in one.get_legend_handles_labels()[0]]
    if len(ordinates) > 1:
        style.legend_under(axes, handles, 4)
    else:
        axes.legend()


def draw_disturbances(found: Any, axes: style.Axes) -> None:
    """Share of all disturbances that are back for good, over time."""
    times = np.sort(found.time_to_return[np.isfinite(found.time_to_return)])
    share = 100.0 * np.arange(times.size + 1) / found.outcome.size
    by_then = np.append(share, share[-1])
    axes.step([0.0, *times, found.t_end], by_then, where="post", label="back by then")
    axes.axhline(100.0 * found.share_returned, color=style.LINES[1], ls="--", label="proved to return")
    until = min(found.t_end, 1.5 * times[-1]) if times.size else found.t_end
    axes.set(
        xlabel=style.TIME, ylabel="share of the disturbances back [%]", xlim=(0.0, until), ylim=(-3.0, 103.0)
    )
    center = found.equilibria.position[found.index]
    far = found.size(found.starts - np.append(center, np.zeros_like(center))).max(initial=0.0)
    about = f"{counted(found.outcome.size, 'disturbance')} of up to {far:.2g} {[*found.names.values()][-1]}"
    kind = f"the {found.equilibria.kind[found.index]} at {found.equilibria.place(found.index)}"
    style.title(axes, f"{about} in the norm of the kinetic energy, of {kind}\n{style.setting(found.system)}")
    axes.legend()


def draw_departures(found: Any, axes: style.Axes) -> None:
    """Departures of the coordinates, nonlinear solid and linearized dashed."""
    units = coordinate_units(found.system)
    ordinates = _ordinates(axes, units)
    for k, (name, unit) in enumerate(units.items()):
        nonlinear, linearized = (motion[:, :MOST_LINES, k] for motion in (found.nonlinear, found.linearized))
        look: Any = {"color": style.LINES[k], "marker": "o" if found.t.size == 1 else ""}
        ordinates[unit].plot(found.t, nonlinear, **look)[0].set_label(f"{style.symbol(name)} [{unit}]")
        ordinates[unit].plot(found.t, linearized, ls="--", mfc=style.paper(), **look)
        ordinates[unit].set_ylabel(f"departure from the equilibrium [{unit}]")
    told: Any = {"marker": "o", "mfc": style.paper()} if found.t.size == 1 else {}
    axes.plot([], [], color=style.ink(), ls="--", label="linearized", **told)
    axes.set_xlabel(style.TIME)
    style.title(axes, f"Disturbed motion\n{style.setting(found.system)}")
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
            room = 0.15 * (high - low) + LEAST_SPAN
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


def draw_curves_of(found: Any, axes: style.Axes) -> None:
    """Fold curves, and where damping misses a mode; folds over one parameter as places of the first angle."""
    dataset = found.dataset()
    units = found.system.described()
    names = dataset.attrs["axes"]
    style.title(
        axes, f"{'Folds' if len(names) == 1 else 'Curves'}\n{style.setting(found.system, names, True)}"
    )
    if len(names) == 1:
        places = dataset[f"fold_{names[0]}"].data
        axes.plot(places, dataset["fold_phi"].data, "o", label="fold")
        axes.set(xlabel=style.with_unit(names[0], units[names[0]][1]), ylabel="angle φ [rad]")
        if not places.size:
            style.message(axes, "no fold between these values")
        return
    handles = draw_curves(axes, View(dataset, {}, names, {}))
    if not handles:
        style.message(axes, "no curve between these values")
    axes.set(**{f"{k}label": style.with_unit(n, units[n][1]) for k, n in zip("xy", names, strict=True)})
    style.legend_under(axes, handles)


def draw_critical_curves(found: Any, axes: style.Axes) -> None:
    """Critical curves by their kind, and cusps."""
    kinds = list(dict.fromkeys(curve.kind for curve in found.curves))
    for curve in found.curves:
        k = kinds.index(curve.kind)
        (line,) = axes.plot(curve.x, curve.y, color=style.color(k), ls=("-", "--", "-.", ":")[k % 4])
        line.set_label(curve.kind if curve is next(c for c in found.curves if c.kind == curve.kind) else "")
    if len(found.cusps):
        axes.plot(*found.cusps[:, :2].T, "D", color=style.paper(), mec=style.ink(), ls="none", label="cusp")
    units = found.system.described()
    axes.set(**{f"{k}label": style.with_unit(n, units[n][1]) for k, n in zip("xy", found.names, strict=True)})
    style.title(axes, f"Critical curves\n{style.setting(found.system, found.names)}")
    if not found.curves:
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


def draw_exponents(found: Any, axes: style.Axes) -> None:
    """Estimates of the largest Lyapunov exponent over time."""
    axes.plot(found.t, found.exponents[:, :MOST_LINES], color=style.LINES[0])
    axes.set(xlabel=style.TIME, ylabel="largest Lyapunov exponent [1/s]")
    style.title(axes, f"Estimates over time\n{style.setting(found.system)}")


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
        return
    names = [*found.axes][:2]
    well = found.well.reshape(*(found.axes[n].size for n in names), -1)
    well = well[..., well.shape[-1] // 2].reshape(found.axes[names[0]].size, -1)
    there = np.unique(well)
    colors = ["#d9d9d9" if k < 0 else style.color(k) for k in there]
    y = found.axes[names[1]] if len(names) > 1 else np.zeros(1)
    style.paint(axes, found.axes[names[0]], y, np.searchsorted(there, well), colors)
    units = state_units(found.system)
    labels = [style.quantity(dataset, name, " at the start") for name in names]
    axes.set(xlabel=labels[0], ylabel=labels[1] if len(names) > 1 else "")
    style.angle_ticks(axes, x=units.get(names[0], "1"), y=units.get(names[-1], "1"))
    told = ["no label" if k < 0 else f"code {k}" if found.tree is None else found.tree[k].name for k in there]
    shares = [f"{text}: {style.share(well == k)}" for k, text in zip(there, told, strict=True)]
    handles = [style.swatch(t, c, style.ink()) for c, t in zip(colors, shares, strict=True)]
    if found.tree is not None and len(names) > 1:
        columns = [found.tree.names.index(name) for name in names]
        looks: Any = {"ls": "none", "marker": "o", "mfc": style.paper(), "mec": style.ink()}
        low, high = np.array([[found.axes[name][k] for name in names] for k in (0, -1)])
        inside = False
        for one in found.tree.attractors:
            points = one.points[:, columns]
            points = points[((points >= low) & (points <= high)).all(axis=1)]
            axes.plot(*points.T, ms=5 if len(one.points) < FEW_POINTS else 1.5, **looks)
            inside |= len(points) > 0
        if inside:
            handles.append(style.entry("points of attractors", ms=5, **looks))
    style.title(axes, f"Where each start ends\n{style.setting(found.system)}")
    style.legend_under(axes, handles, 1)
