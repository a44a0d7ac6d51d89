"""The report's tables and figures as labelled data, and its pictures with their captions.

Titles and captions stand in ``figures.toml``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fastmech import results
from fastmech.arrays import Floats
from fastmech.plots import style
from fastmech.plots.equilibria import draw_mechanism, drawing_of, legend_handles
from fastmech.results import Dataset, Variable
from fastmech.scan_types.disturbed_motion import DisturbedMotionScan
from fastmech.scan_types.equilibria import EquilibriaScan
from fastmech.scan_types.motion import Motion
from fastmech.scan_types.request import RunContext, Scan
from fastmech.scene import Scene
from fastmech.slider.lagrange import potential_energy, potential_gradient
from fastmech.studies.paper import compute as paper
from fastmech.studies.paper.compare import Agreement, PaperRow
from fastmech.studies.reporting import columns, content

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ABOUT = content(__package__, "figures.toml")

#: What the file says of a figure; the report's data by section.
About = Mapping[str, Any]
Sections = Mapping[str, Dataset]

#: Points a side of the potential's grid.
GRID = 181


def all_datasets(rows: Sequence[PaperRow]) -> dict[str, Dataset]:
    """What the figures show, as scans give it, the potential of Figure 6, and the rows of printed numbers."""
    motion: dict[str, Any] = {"dt": paper.STEP, "method": paper.METHOD}
    disturbed = motion | {"t_end": paper.DISTURBED_SPAN, "outputs": paper.outputs(paper.DISTURBED_SPAN).size}
    scans: dict[str, tuple[Scan, Scene]] = {
        "motion": (Motion(**motion, t_end=paper.MOTION_SPAN), paper.PAPER_SCENE),
        "equilibria": (EquilibriaScan(), paper.STATIC_SCENE),
        "disturbed_motion": (DisturbedMotionScan(**disturbed), paper.STATIC_SCENE),
    }
    sections = {name: _section(*one) for name, one in scans.items()} | {"figure_6": _potential()}
    for name in ABOUT["tables"]:
        sections[name.lower().replace(" ", "_")] = rows_dataset([row for row in rows if row.section == name])
    return sections | {"printed_numbers": rows_dataset(rows)}


def _section(scan: Scan, scene: Scene) -> Dataset:
    tiling = scan.tiling(scene)
    made = tiling.assemble(lambda index: tiling.compute(index, RunContext()))
    assert isinstance(made, Dataset)
    return made


def _potential() -> Dataset:
    angles, plane, scene = np.linspace(-np.pi, np.pi, GRID), ("phi", "theta"), paper.STATIC_SCENE
    grid = np.stack(np.meshgrid(angles, angles, indexing="ij"), axis=-1)
    gradient = potential_gradient(scene, grid, scene.F0)
    fields = {
        "potential": (potential_energy(scene, grid, scene.F0), "J", "U = Pi - F x2"),
        "condition_phi": (gradient[..., 0], "J", "dU/dphi, first of (20)"),
        "condition_theta": (gradient[..., 1], "J", "dU/dtheta, second of (20)"),
    }
    along = {name: Variable((name,), angles, "rad", f"angle {name}") for name in plane}
    return Dataset(along | results.columns(plane, fields))


def rows_dataset(rows: Sequence[PaperRow]) -> Dataset:
    """Rows of printed against computed values."""
    found = columns("row", rows, "printed_numbers")
    return Dataset(found, {"disagreeing": sum(row.verdict == Agreement.DIFFERS for row in rows)})


#: Marker and name of each kind of equilibrium.
KINDS = {
    "minimum": ("o", "minimum, stable"),
    "saddle": ("X", "saddle, unstable"),
    "maximum": ("^", "maximum, unstable"),
}

#: Curves on which a condition (20) holds: variable, angle, place, colour, dashes.
CURVES = (
    ("condition_phi", r"\varphi", "first", "black", "-"),
    ("condition_theta", r"\theta", "second", style.PALETTE["vermillion"], "--"),
)


def draw_potential(about: About, computed: paper.Computed, sections: Sections) -> Figure:
    """Figure 6 (a): contours of U = Pi - F x2, both curves of (20) and their intersections."""
    from matplotlib import patheffects
    from matplotlib.ticker import MaxNLocator

    figure, axes = style.new_panel(7.4, 7.2)
    data = sections["figure_6"]
    phi, theta = data["phi"].data, data["theta"].data
    filled = axes.contourf(phi, theta, data["potential"].data.T, levels=24)
    figure.colorbar(filled, ax=axes, label="U = Π − F x₂ [J]", shrink=0.9, ticks=MaxNLocator(8))
    halo: Any = [patheffects.withStroke(linewidth=4.5, foreground="white")]
    handles = []
    for name, angle, place, colour, dashes in CURVES:
        line = axes.contour(phi, theta, data[name].data.T, levels=[0.0], colors=[colour])
        line.set(linestyles=dashes, linewidths=2.2, path_effects=halo)
        label = rf"$\partial U/\partial{angle} = 0$, {place} of (20)"
        handles.append(style.entry(label, color=colour, ls=dashes, lw=2.2))
    look: dict[str, Any] = {"mfc": "white", "mec": "black", "ms": 11, "ls": "none"}
    for case in computed.cases:
        x, y = case.equilibrium.position
        axes.plot(x, y, KINDS[case.equilibrium.kind][0], zorder=5, **look)
        offset = (0, 14) if y < 0.7 * np.pi else (0, -22)
        text: dict[str, Any] = {"ha": "center", "zorder": 6, "bbox": style.box(0.2, 0.85)}
        axes.annotate(f"Case {case.number}", (x, y), offset, textcoords="offset points", **text)
    present = [kind for kind in KINDS if kind in {case.equilibrium.kind for case in computed.cases}]
    handles += [style.entry(KINDS[kind][1], marker=KINDS[kind][0], **look) for kind in present]
    style.angle_ticks(axes, x="rad", y="rad")
    axes.set(xlabel=r"$\varphi$ [rad]", ylabel=r"$\theta$ [rad]", aspect="equal")
    axes.grid(False)
    axes.set_title(about["title"])
    style.legend_below(figure, handles)
    return figure


def draw_positions(about: About, computed: paper.Computed, sections: Sections) -> Figure:
    """Figure 6 (b): the mechanism at each equilibrium, to scale."""
    figure = style.new_figure(9.6, 9.2)
    grid = figure.subplots(2, 2, sharex=True, sharey=True)
    drawn = drawing_of(
        paper.STATIC_SCENE, [case.equilibrium.position for case in computed.cases], paper.STATIC_SCENE.F0
    )
    for k, (axes, case) in enumerate(zip(grid.flat, computed.cases, strict=True)):
        draw_mechanism(axes, drawn, k)
        e, colour = case.equilibrium, style.PALETTE["blue" if case.verdict == "stable" else "vermillion"]
        phi, theta = (f"{np.degrees(angle):.1f}°".replace("-", "−") for angle in (e.phi, e.theta))
        axes.set_title(f"{case.title} ({e.kind})\n" rf"$\varphi$ = {phi}, $\theta$ = {theta}", color=colour)
        axes.label_outer()
    figure.suptitle(about["title"])
    style.legend_below(figure, legend_handles(drawn, f"force on $M_2$, {paper.STATIC_SCENE.F0:g} N"), 4)
    return figure


def draw_over_time(about: About, computed: paper.Computed, sections: Sections) -> Figure:
    """Figures 2 to 5: ``about`` has title and panels, each with its ordinate and lines."""
    panels, data = about["panels"], sections["motion"]
    figure = style.new_figure(7.2, 2.8 + 1.4 * len(panels))
    rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (label, lines) in zip(rows, panels, strict=True):
        for dashes, (line, told) in zip(("-", "-", "--"), lines.items(), strict=False):
            values = data[line].data / about.get("scale", 1.0)
            axes.plot(data["time"].data, values, dashes, label=told, lw=0.7 if "scale" in about else 1.6)
            if len(lines) == 1:
                axes.set_title(told, loc="left", fontsize=10)
        axes.axhline(0.0, color="0.4", lw=0.8, zorder=1.5)
        axes.set_ylabel(label)
        axes.margins(x=0)
    figure.suptitle(about["title"])
    rows[-1].set_xlabel(style.TIME)
    if len(lines) > 1:
        style.legend_below(figure, rows[0], len(lines))
    return figure


ANGLES = (r"$\xi_1$ (of $\varphi$)", r"$\xi_2$ (of $\theta$)")

GROWTH = 1.5
"""A linearized disturbance leaves the picture at so many times the nonlinear one's largest angle."""


def draw_disturbed(about: About, computed: paper.Computed, sections: Sections) -> Figure:
    """Disturbances of the angles over time, one row a case, with the roots of the polynomial."""
    cases, linearized = [computed.cases[number - 1] for number in about["cases"]], about["linearized"]
    figure = style.new_figure(9.6, 1.4 + 3.1 * len(cases))
    rows = figure.subplots(len(cases), 2, squeeze=False, gridspec_kw={"width_ratios": [1.9, 1.0]})
    for (left, right), case in zip(rows, cases, strict=True):
        number = computed.equilibria.index_of(case.equilibrium)
        _draw_angles(left, case, linearized, sections["disturbed_motion"], number)
        _draw_roots(right, case)
    figure.suptitle(about["title"])
    style.legend_below(figure, rows[0, 0], 4 if linearized else 2)
    return figure


def _draw_angles(axes: Axes, case: paper.PaperCase, linearized: bool, data: Dataset, number: int) -> None:
    t = data["time"].data
    nonlinear, linear = (
        np.stack([data[f"{kind}_{angle}"].data[number] for angle in ("phi", "theta")], axis=1)
        for kind in ("nonlinear", "linearized")
    )
    inside = t <= (_span(t, nonlinear, linear) if linearized else t[-1])
    broad: dict[str, Any] = {"lw": 3.4 if linearized else 1.8}
    looks = {"nonlinear": (nonlinear, ("sky", "orange"), broad)}
    if linearized:
        looks["linearized"] = (linear, ("blue", "vermillion"), {"lw": 1.5, "ls": "--"})
    for which, (states, colours, look) in looks.items():
        for i, (name, colour) in enumerate(zip(ANGLES, colours, strict=True)):
            axes.plot(
                t[inside], states[inside, i], color=style.PALETTE[colour], label=f"{name}, {which}", **look
            )
    if linearized and case.verdict == "unstable":
        shown = np.append(nonlinear[inside], 0.0)
        room = 0.15 * np.ptp(shown)
        axes.set_ylim(shown.min() - room, shown.max() + room)
    axes.axhline(0.0, color="0.4", lw=0.8)
    axes.set(xlabel=style.TIME, ylabel="disturbance [rad]", title=case.title)
    axes.margins(x=0)


def _span(t: Floats, nonlinear: Floats, linear: Floats) -> float:
    """Time to show: twice as long as the linearized angles stay in the nonlinear one's range [s]."""
    gone = np.max(np.abs(linear), axis=1) > GROWTH * np.max(np.abs(nonlinear))
    return float(min(t[-1], 2.0 * t[np.argmax(gone)])) if gone.any() else float(t[-1])


def _draw_roots(axes: Axes, case: paper.PaperCase) -> None:
    roots = case.classification.eigenvalues
    reach = 1.7 * float(np.max(np.abs(roots.real)))
    height = 1.5 * max(1.0, float(np.max(np.abs(roots.imag))))
    axes.axvspan(0.0, reach, color=style.PALETTE["vermillion"], alpha=0.10, lw=0)
    axes.axhline(0.0, color="0.4", lw=0.8)
    axes.axvline(0.0, color="0.4", lw=0.8)
    for root in roots:
        colour = style.PALETTE["vermillion" if root.real > 0 else "blue"]
        axes.plot(root.real, root.imag, "x", color=colour, ms=9, mew=2.4)
        if root.imag >= 0.0:
            text = (f"{root.real:.2f}" + f" ± {root.imag:.2f}i" * bool(root.imag > 0)).replace("-", "−")
            look: dict[str, Any] = {"ha": "center", "fontsize": 8.5, "bbox": style.box(0.2, 0.85)}
            axes.annotate(text, (root.real, root.imag), (0, 11), textcoords="offset points", **look)
    axes.set(xlim=(-reach, reach), ylim=(-height, height), xlabel="Re λ [1/s]", ylabel="Im λ [1/s]")
    unstable = int(np.sum(roots.real > 0))
    axes.set_title(f"{unstable or 'no'} root{'s' * (unstable > 1)} on the right")


#: How a kind of figure is drawn: what the file says of it, what is computed, and the data.
DRAWN: dict[str, Callable[[About, paper.Computed, Sections], Figure]] = {
    "motion": draw_over_time,
    "potential": draw_potential,
    "positions": draw_positions,
    "disturbed": draw_disturbed,
}
