"""The report's tables and figures as labelled data, and all its pictures with their captions.

Names, units, titles and captions stand in ``figures.toml``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.plots.equilibria import draw_mechanism, drawing_of, legend_handles
from fastmech.plots.style import LINES, PALETTE, entry, legend_below, new_figure, style
from fastmech.results import Dataset, Variable
from fastmech.slider.geometry import constraints, positions
from fastmech.slider.lagrange import potential_energy, potential_gradient
from fastmech.studies.paper.compare import HEADINGS, Agreement, PaperRow
from fastmech.studies.paper.compute import (
    DISTURBED_SPAN,
    MOTION_SPAN,
    PAPER_SCENE,
    STATIC_SCENE,
    Computed,
    PaperCase,
)
from fastmech.studies.reporting import columns, content

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ABOUT = content(__package__, "figures.toml")

#: Points a side of the potential's grid.
GRID = 181


def all_datasets(computed: Computed, rows: Sequence[PaperRow]) -> dict[str, Dataset]:
    """One dataset for every table and figure, and the rows of all printed numbers."""
    motion = computed.motion
    points = positions(PAPER_SCENE, motion.y)
    p_phi, p_theta = computed.momenta.T
    values = points._asdict() | {"phi": motion.y[:, 0], "theta": motion.y[:, 1], "p_phi": p_phi}
    values |= {f"f_{i}": f for i, f in enumerate(constraints(PAPER_SCENE, points), start=1)}
    values |= {"p_theta": p_theta, "kinetic_energy": motion.kinetic, "potential_energy": motion.potential}
    values |= {"work_damper": motion.work_damper, "work_force": motion.work_force}
    values |= {"energy_residual": motion.residual}
    time = {"time": Variable(("time",), motion.t, "s", "time")}
    moving = {
        section: Dataset(time | {n: Variable(("time",), values[n], *ABOUT["variables"][n]) for n in names})
        for section, names in ABOUT["over_time"].items()
    }
    last = {"energy_balance": moving.pop("energy_balance"), "printed_numbers": rows_dataset(rows)}
    tables = {_file(n): rows_dataset([row for row in rows if row.section == n]) for n in ABOUT["tables"]}
    disturbed = {
        name: _disturbed([computed.cases[number - 1] for number in about["cases"]])
        for name, about in ABOUT["disturbed"].items()
    }
    return tables | moving | {"figure_6": _equilibria(computed.cases)} | disturbed | last


def _file(table: str) -> str:
    return table.lower().replace(" ", "_")


def _numbers(cases: Sequence[PaperCase]) -> Variable:
    return Variable(("case",), np.array([case.number for case in cases]), "1", "case of Table 2")


def _equilibria(cases: Sequence[PaperCase]) -> Dataset:
    angles = np.linspace(-np.pi, np.pi, GRID)
    grid = np.stack(np.meshgrid(angles, angles, indexing="ij"), axis=-1)
    force = STATIC_SCENE.F0
    gradient = potential_gradient(STATIC_SCENE, grid, force)
    found = [case.equilibrium for case in cases]
    rest = np.array([(e.phi, e.theta, 0.0, 0.0) for e in found])
    plane, along = ("phi", "theta"), ("case",)
    points = positions(STATIC_SCENE, rest)._asdict().items()
    return Dataset(
        {
            "phi": Variable(("phi",), angles, "rad", "angle phi"),
            "theta": Variable(("theta",), angles, "rad", "angle theta"),
            "potential": Variable(plane, potential_energy(STATIC_SCENE, grid, force), "J", "U = Pi - F x2"),
            "condition_phi": Variable(plane, gradient[..., 0], "J", "dU/dphi, first of (20)"),
            "condition_theta": Variable(plane, gradient[..., 1], "J", "dU/dtheta, second of (20)"),
            "case": _numbers(cases),
            "phi_st": Variable(along, rest[:, 0], "rad", "angle phi at rest"),
            "theta_st": Variable(along, rest[:, 1], "rad", "angle theta at rest"),
            **columns("case", found, "resting"),
            **{n: Variable(along, x, "m", f"{ABOUT['variables'][n][1]} at rest") for n, x in points},
        }
    )


def _disturbed(cases: Sequence[PaperCase]) -> Dataset:
    along = ("case", "time")
    variables = {"case": _numbers(cases), "time": Variable(("time",), cases[0].disturbed.t, "s", "time")}
    for which in ("nonlinear", "linearized"):
        for i, (name, (unit, long_name)) in enumerate(ABOUT["disturbances"].items()):
            data = np.stack([getattr(case.disturbed, which)[:, 0, i] for case in cases])
            variables[f"{name}_{which}"] = Variable(along, data, unit, f"{long_name}, {which} equations")
        norm, about = np.stack([getattr(case, f"norm_{which}") for case in cases]), "size of the disturbance"
        variables[f"norm_{which}"] = Variable(along, norm, "rad", f"{about}, {which} equations")
    roots, about = np.stack([case.classification.eigenvalues for case in cases]), "characteristic polynomial"
    for part, data in (("re", roots.real), ("im", roots.imag)):
        variables[f"root_{part}"] = Variable(("case", "root"), data, "1/s", f"root of the {about}, {part}")
    return Dataset(variables)


def rows_dataset(rows: Sequence[PaperRow]) -> Dataset:
    """Rows of printed against computed values."""
    found, names = columns("row", rows, "printed_numbers"), {"word": "computed_text", "value": "computed"}
    about = {names.get(name, name): column for name, column in found.items()}
    return Dataset(about, {"disagreeing": sum(row.verdict == Agreement.DIFFERS for row in rows)})


ROW_HEIGHT = 0.27  #: inch

#: Widths of the columns: place, symbol, unit, printed, computed, difference, verdict.
WIDTHS = (0.10, 0.12, 0.10, 0.13, 0.16, 0.12, 0.27)
HEADING, SHADES = "#e6e6e6", {Agreement.MISPRINT: "#fbe3cf", Agreement.DIFFERS: "#f4b6a6"}


def draw_table(title: str, rows: Sequence[PaperRow]) -> Figure:
    """One table of the paper, a line for each number; misprints are shaded."""
    from matplotlib.transforms import Bbox

    with style():
        figure = new_figure(9.4, 0.75 + ROW_HEIGHT * (len(rows) + 1))
        axes = figure.subplots()
        axes.axis("off")
        axes.set_title(title, loc="left")
        shades = [[SHADES.get(row.verdict, "#ffffff")] * len(WIDTHS) for row in rows]
        table = axes.table(
            cellText=[list(row.cells) for row in rows],
            cellColours=shades,
            colLabels=HEADINGS,
            colColours=[HEADING] * len(WIDTHS),
            colWidths=WIDTHS,
            bbox=Bbox.unit(),
            cellLoc="left",
            colLoc="left",
        )
        table.auto_set_font_size(False)
        table.set_fontsize(9.0)
        for (_, column), cell in table.get_celld().items():
            cell.set_edgecolor("#d0d0d0")
            if 3 <= column <= 5:
                cell.set_text_props(ha="right")
    return figure


#: Marker and name of each kind of equilibrium.
KINDS = {
    "minimum": ("o", "minimum, stable"),
    "saddle": ("X", "saddle, unstable"),
    "maximum": ("^", "maximum, unstable"),
}

#: Curves on which a condition (20) holds: variable, angle, place, colour, dashes.
CURVES = (
    ("condition_phi", r"\varphi", "first", "black", "-"),
    ("condition_theta", r"\theta", "second", PALETTE["vermillion"], "--"),
)


def draw_potential(data: Dataset) -> Figure:
    """Figure 6 (a): contours of U = Pi - F x2, both curves of (20) and their intersections."""
    from matplotlib import patheffects
    from matplotlib.ticker import MaxNLocator

    with style():
        figure = new_figure(7.4, 7.2)
        axes = figure.subplots()
        phi, theta = data["phi"].data, data["theta"].data
        filled = axes.contourf(phi, theta, data["potential"].data.T, levels=24)
        figure.colorbar(filled, ax=axes, label="U = Π − F x₂ [J]", shrink=0.9, ticks=MaxNLocator(8))
        halo: Any = [patheffects.withStroke(linewidth=4.5, foreground="white")]
        handles = []
        for name, angle, place, colour, dashes in CURVES:
            line = axes.contour(phi, theta, data[name].data.T, levels=[0.0], colors=[colour])
            line.set(linestyles=dashes, linewidths=2.2, path_effects=halo)
            label = rf"$\partial U/\partial{angle} = 0$, {place} of (20)"
            handles.append(entry(label, color=colour, ls=dashes, lw=2.2))
        handles += _mark_equilibria(axes, data)
        _angle_axes(axes)
        axes.set_title("Fig. 6 (a)  Static equilibria: where both curves cross (F = 100 N)")
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


def _mark_equilibria(axes: Axes, data: Dataset) -> list[Any]:
    box = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    look: dict[str, Any] = {"mfc": "white", "mec": "black", "ms": 11, "ls": "none"}
    names = ("case", "phi_st", "theta_st", "kind")
    for number, phi, theta, kind in zip(*(data[name].data for name in names), strict=True):
        axes.plot(phi, theta, KINDS[kind][0], zorder=5, **look)
        offset = (0, 14) if theta < 0.7 * np.pi else (0, -22)
        text: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "zorder": 6, "bbox": box}
        axes.annotate(f"Case {number}", (phi, theta), offset, **text)
    present = [kind for kind in KINDS if kind in set(data["kind"].data)]
    return [entry(KINDS[kind][1], marker=KINDS[kind][0], **look) for kind in present]


def _angle_axes(axes: Axes) -> None:
    ticks = np.array([-1.0, -0.5, 0.0, 0.5, 1.0]) * np.pi
    names = ["−π", "−π/2", "0", "π/2", "π"]
    axes.set_xticks(ticks, names)
    axes.set_yticks(ticks, names)
    axes.set(xlabel=r"$\varphi$ [rad]", ylabel=r"$\theta$ [rad]", aspect="equal")
    axes.grid(False)


def draw_positions(cases: Sequence[PaperCase]) -> Figure:
    """Figure 6 (b): the mechanism at each equilibrium, to scale."""
    with style():
        figure = new_figure(9.6, 9.2)
        grid = figure.subplots(2, 2, sharex=True, sharey=True)
        rests = [case.equilibrium for case in cases]
        drawn = drawing_of(STATIC_SCENE, [e.position for e in rests], STATIC_SCENE.F0)
        for k, (axes, case, e) in enumerate(zip(grid.flat, cases, rests, strict=True)):
            draw_mechanism(axes, drawn, k)
            colour = PALETTE["blue"] if case.verdict == "stable" else PALETTE["vermillion"]
            axes.set_title(
                f"Case {case.number}: {case.verdict} ({e.kind})\n"
                rf"$\varphi$ = {degrees(e.phi)}, $\theta$ = {degrees(e.theta)}",
                color=colour,
            )
            axes.label_outer()
        figure.suptitle(
            "Fig. 6 (b)  The mechanism at its static equilibria, to scale; areas of the masses in proportion"
        )
        figure.legend(
            handles=legend_handles(drawn, f"force on $M_2$, {STATIC_SCENE.F0:g} N"),
            loc="outside lower center",
            ncols=4,
        )
    return figure


def degrees(angle: float) -> str:
    """An angle [rad] in degrees, with a true minus."""
    return f"{np.degrees(angle):.1f}°".replace("-", "−")


TIME = "time t [s]"


def draw_over_time(about: Mapping[str, Any], data: Dataset) -> Figure:
    """Figures 2, 3 and 5: ``about`` has title and panels."""
    panels = about["panels"]
    with style():
        figure = new_figure(7.2, 2.8 + 1.4 * len(panels))
        rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (label, lines) in zip(rows, panels.items(), strict=True):
            for dashes, (line, told) in zip(("-", "-", "--"), lines.items(), strict=False):
                axes.plot(data["time"].data, data[line].data, dashes, label=told)
            axes.axhline(0.0, color="0.4", lw=0.8, zorder=1.5)
            axes.set_ylabel(label)
            axes.margins(x=0)
        rows[0].set_title(about["title"])
        rows[-1].set_xlabel(TIME)
        legend_below(figure, rows[0], len(lines))
    return figure


def draw_constraints(about: Mapping[str, Any], data: Dataset) -> Figure:
    """Figure 4: residuals of the constraints (2)-(5)."""
    with style():
        figure = new_figure(7.2, 6.4)
        rows = figure.subplots(4, 1, sharex=True, sharey=True)
        for axes, (name, label), colour in zip(rows, about["constraints"].items(), LINES, strict=False):
            axes.plot(data["time"].data, data[name].data / 1e-15, color=colour, lw=0.7)
            unit = data[name].units.replace("m2", "m²")
            axes.set_title(f"{label}", loc="left", fontsize=10)
            axes.set_ylabel(f"10⁻¹⁵ {unit}")
            axes.margins(x=0)
        figure.suptitle(about["title"])
        rows[-1].set_xlabel(TIME)
    return figure


ANGLES = (r"$\xi_1$ (of $\varphi$)", r"$\xi_2$ (of $\theta$)")

BOX = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}

GROWTH = 1.5
"""A linearized disturbance leaves the picture at so many times the nonlinear one's largest angle."""


def draw_disturbed(cases: Sequence[PaperCase], title: str, *, linearized: bool) -> Figure:
    """Disturbances of the angles over time, one row a case, with the roots of the polynomial."""
    with style():
        figure = new_figure(9.6, 1.4 + 3.1 * len(cases))
        rows = figure.subplots(len(cases), 2, squeeze=False, gridspec_kw={"width_ratios": [1.9, 1.0]})
        for (left, right), case in zip(rows, cases, strict=True):
            _draw_angles(left, case, linearized)
            _draw_roots(right, case)
        figure.suptitle(title)
        legend_below(figure, rows[0, 0], 4 if linearized else 2)
    return figure


def _draw_angles(axes: Axes, case: PaperCase, linearized: bool) -> None:
    t, nonlinear, linear = case.disturbed.t, case.disturbed.nonlinear[:, 0], case.disturbed.linearized[:, 0]
    inside = t <= (_span(t, nonlinear, linear) if linearized else t[-1])
    broad = 3.4 if linearized else 1.8
    for i, (name, colour) in enumerate(zip(ANGLES, (PALETTE["sky"], PALETTE["orange"]), strict=True)):
        axes.plot(t[inside], nonlinear[inside, i], color=colour, lw=broad, label=f"{name}, nonlinear")
    both = zip(ANGLES, (PALETTE["blue"], PALETTE["vermillion"]), strict=True)
    for i, (name, colour) in enumerate(both if linearized else ()):
        axes.plot(t[inside], linear[inside, i], "--", color=colour, lw=1.5, label=f"{name}, linearized")
    if linearized and case.verdict == "unstable":
        shown = np.append(nonlinear[inside, :2], 0.0)
        room = 0.15 * np.ptp(shown)
        axes.set_ylim(shown.min() - room, shown.max() + room)
    axes.axhline(0.0, color="0.4", lw=0.8)
    axes.set(xlabel=TIME, ylabel="disturbance [rad]", title=case.title)
    axes.margins(x=0)


def _span(t: Floats, nonlinear: Floats, linear: Floats) -> float:
    """Time to show: twice as long as the linearized angles stay in the nonlinear one's range [s]."""
    gone = np.max(np.abs(linear[:, :2]), axis=1) > GROWTH * np.max(np.abs(nonlinear[:, :2]))
    return float(min(t[-1], 2.0 * t[np.argmax(gone)])) if gone.any() else float(t[-1])


def _draw_roots(axes: Axes, case: PaperCase) -> None:
    roots = case.classification.eigenvalues
    reach = 1.7 * float(np.max(np.abs(roots.real)))
    height = 1.5 * max(1.0, float(np.max(np.abs(roots.imag))))
    axes.axvspan(0.0, reach, color=PALETTE["vermillion"], alpha=0.10, lw=0)
    axes.axhline(0.0, color="0.4", lw=0.8)
    axes.axvline(0.0, color="0.4", lw=0.8)
    for root in roots:
        colour = PALETTE["vermillion"] if root.real > 0 else PALETTE["blue"]
        axes.plot(root.real, root.imag, "x", color=colour, ms=9, mew=2.4)
        if root.imag >= 0.0:
            pair = f" ± {root.imag:.2f}i" if root.imag > 0 else ""
            text = f"{root.real:.2f}{pair}".replace("-", "−")
            look: dict[str, Any] = {"ha": "center", "fontsize": 8.5, "bbox": BOX}
            axes.annotate(text, (root.real, root.imag), (0, 11), textcoords="offset points", **look)
    axes.set(xlim=(-reach, reach), ylim=(-height, height), xlabel="Re λ [1/s]", ylabel="Im λ [1/s]")
    unstable = int(np.sum(roots.real > 0))
    axes.set_title(f"{unstable or 'no'} root{'s' * (unstable > 1)} on the right")


def draw_norms(cases: Sequence[PaperCase]) -> Figure:
    """The size of the disturbance over time for all cases, nonlinear and linearized."""
    with style():
        figure = new_figure(9.6, 4.6)
        left, right = figure.subplots(1, 2, sharey=True)
        for case, colour in zip(cases, LINES, strict=False):
            left.semilogy(case.disturbed.t, case.norm_nonlinear, color=colour, label=case.title)
            right.semilogy(case.disturbed.t, case.norm_linearized, color=colour)
        left.set(title="nonlinear equations", ylabel="size of the disturbance [rad]", ylim=(3e-4, 30.0))
        right.set_title("linearized equations")
        for axes in (left, right):
            axes.set_xlabel(TIME)
            axes.margins(x=0)
        figure.suptitle("Norm of the disturbance over time")
        legend_below(figure, left, 4)
    return figure


class Picture(NamedTuple):
    """A picture to be drawn: its file name without ending, heading, caption."""

    name: str
    heading: str
    caption: str
    draw: Callable[[], Figure]


_KICK = "After the disturbance ξ1 = 0.1 rad, η1 = 0.1 rad/s."


def table_pictures(rows: Sequence[PaperRow]) -> list[Picture]:
    """Tables 1 to 4."""
    return [
        Picture(
            _file(name),
            name,
            title,
            partial(draw_table, f"{name}  {title}", [row for row in rows if row.section == name]),
        )
        for name, title in ABOUT["tables"].items()
    ]


def figure_pictures(computed: Computed, data: Mapping[str, Dataset]) -> list[Picture]:
    """Figures 2 to 11 and the norm of the disturbances."""
    start = f"From Table 1's start with the decaying force, {MOTION_SPAN:g} s."
    pictures = []
    for name, about in ABOUT["motion"].items():
        draw = partial(draw_over_time if "panels" in about else draw_constraints, about, data[name])
        pictures.append(Picture(name, f"Figure {name[-1]}", f"{about['caption']} {start}", draw))
    crossings = (
        "Potential under the constant force, both curves of (20), and the equilibria at their crossings."
    )
    scale = "The mechanism at its equilibria, to scale."
    pictures += [
        Picture("figure_6a", "Figure 6 (a)", crossings, partial(draw_potential, data["figure_6"])),
        Picture("figure_6b", "Figure 6 (b)", scale, partial(draw_positions, computed.cases)),
    ]
    for name, about in ABOUT["disturbed"].items():
        number, linearized = name.removeprefix("figure_"), about["linearized"]
        cases, caption = [computed.cases[case - 1] for case in about["cases"]], f"{about['title']}. {_KICK}"
        if linearized and any(case.verdict == "unstable" for case in cases):
            caption += " The linearized motion leaves the picture; the time shown is twice as long."
        draw = partial(draw_disturbed, cases, f"Fig. {number}  {about['title']}", linearized=linearized)
        pictures.append(Picture(name, f"Figure {number}", caption, draw))
    norm = (
        "Size of the disturbance in the kinetic-energy norm (radians of θ): it falls to zero in the stable "
        f"case alone. {_KICK} {DISTURBED_SPAN:g} s."
    )
    draw = partial(draw_norms, computed.cases)
    return [*pictures, Picture("figure_norm", "Norm of the disturbances", norm, draw)]
