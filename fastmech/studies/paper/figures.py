"""The report's tables and figures as labelled data, and all its pictures with their captions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.mechanism.geometry import constraints, positions
from fastmech.mechanism.lagrange import potential_energy, potential_gradient
from fastmech.plots.equilibria import draw_mechanism, drawing_of, legend_handles
from fastmech.plots.style import LINES, PALETTE, legend_below, new_figure, style
from fastmech.results import Dataset, Variable
from fastmech.studies.paper.compare import HEADINGS, Row, Verdict
from fastmech.studies.paper.compute import (
    DISTURBED_SPAN,
    MOTION_SPAN,
    PAPER_SCENE,
    STATIC_SCENE,
    Case,
    Computed,
)
from fastmech.studies.reporting import columns

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TABLES = ("Table 1", "Table 2", "Table 3", "Table 4")
#: Cases that each figure of disturbed motion shows.
DISTURBED = {"figure_7": (1, 3), "figure_8": (1, 3), "figure_9": (2,), "figure_10": (4,), "figure_11": (4,)}
GRID = 181

_DISTURBANCES = {
    "xi_1": ("rad", "disturbance of phi"),
    "xi_2": ("rad", "disturbance of theta"),
    "eta_1": ("rad/s", "disturbance of phi'"),
    "eta_2": ("rad/s", "disturbance of theta'"),
}


def all_datasets(computed: Computed, rows: Sequence[Row]) -> dict[str, Dataset]:
    """One dataset for every table and figure, and the rows of all printed numbers."""
    tables = {
        name.lower().replace(" ", "_"): rows_dataset([row for row in rows if row.section == name])
        for name in TABLES
    }
    motion = computed.motion
    points = positions(PAPER_SCENE, motion.y)
    constrained = enumerate(constraints(PAPER_SCENE, points), start=1)
    p_phi, p_theta = computed.momenta.T
    over_time: dict[str, dict[str, tuple[str, Floats]]] = {
        "figure_2": {"phi": ("rad", motion.y[:, 0]), "theta": ("rad", motion.y[:, 1])},
        "figure_3": {name: ("m", value) for name, value in points._asdict().items()},
        "figure_4": {f"f_{i}": ("m" if i == 3 else "m2", residual) for i, residual in constrained},
        "figure_5": {"p_phi": ("kg m2/s", p_phi), "p_theta": ("kg m2/s", p_theta)},
        "energy_balance": {
            "kinetic_energy": ("J", motion.kinetic),
            "potential_energy": ("J", motion.potential),
            "work_damper": ("J", motion.work_damper),
            "work_force": ("J", motion.work_force),
            "energy_residual": ("J", motion.residual),
        },
    }
    moving = {name: _over_time(computed, values) for name, values in over_time.items()}
    balance = moving.pop("energy_balance")
    disturbed = {
        name: _disturbed([computed.cases[number - 1] for number in numbers])
        for name, numbers in DISTURBED.items()
    }
    resting = {"figure_6": _equilibria(computed.cases)}
    last = {"energy_balance": balance, "printed_numbers": rows_dataset(rows)}
    return tables | moving | resting | disturbed | last


_LONG_NAMES = {
    "phi": "angle phi",
    "theta": "angle theta",
    "p_phi": "generalized momentum of phi, canonical equations",
    "p_theta": "generalized momentum of theta, canonical equations",
    "kinetic_energy": "kinetic energy T",
    "potential_energy": "potential energy Pi",
    "work_damper": "work of the damper since t = 0",
    "work_force": "work of the force since t = 0",
    "energy_residual": "change of T + Pi less both works",
    **{f"f_{i}": f"residual of constraint ({i + 1})" for i in range(1, 5)},
    **{f"{axis}{i}": f"coordinate {axis} of M{i}" for axis in "xy" for i in (1, 2, 3)},
}


def _over_time(computed: Computed, values: dict[str, tuple[str, Floats]]) -> Dataset:
    moving = {name: Variable(("time",), v, unit, _LONG_NAMES[name]) for name, (unit, v) in values.items()}
    return Dataset({"time": Variable(("time",), computed.motion.t, "s", "time")} | moving)


def _numbers(cases: Sequence[Case]) -> Variable:
    return Variable(("case",), np.array([case.number for case in cases]), "1", "case of Table 2")


def _equilibria(cases: Sequence[Case]) -> Dataset:
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
            **columns("case", found, {"energy": ("J", "U at rest"), "kind": ("1", "kind of equilibrium")}),
            **{name: Variable(along, x, "m", f"{_LONG_NAMES[name]} at rest") for name, x in points},
        }
    )


def _disturbed(cases: Sequence[Case]) -> Dataset:
    along = ("case", "time")
    variables = {"case": _numbers(cases), "time": Variable(("time",), cases[0].disturbed.t, "s", "time")}
    for which in ("nonlinear", "linearized"):
        for i, (name, (unit, long_name)) in enumerate(_DISTURBANCES.items()):
            data = np.stack([getattr(case.disturbed, which)[:, 0, i] for case in cases])
            variables[f"{name}_{which}"] = Variable(along, data, unit, f"{long_name}, {which} equations")
        norm, about = np.stack([getattr(case, f"norm_{which}") for case in cases]), "size of the disturbance"
        variables[f"norm_{which}"] = Variable(along, norm, "rad", f"{about}, {which} equations")
    roots, about = np.stack([case.classification.eigenvalues for case in cases]), "characteristic polynomial"
    for part, data in (("re", roots.real), ("im", roots.imag)):
        variables[f"root_{part}"] = Variable(("case", "root"), data, "1/s", f"root of the {about}, {part}")
    return Dataset(variables)


#: Columns of the printed numbers.
_ROWS = {
    "section": ("1", "where it is printed"),
    "place": ("1", "case or part"),
    "symbol": ("1", "symbol"),
    "unit": ("1", "unit of the values"),
    "printed": ("1", "as printed, * for lost characters"),
    "word": ("1", "the computed word, for words"),
    "verdict": ("1", "what the comparison came to"),
    "see": ("1", "key of the misprint that explains it"),
    "value": ("1", "value in its unit, NaN for words"),
    "difference": ("1", "computed less printed in that unit"),
}
_ROW_NAMES = {"word": "computed_text", "value": "computed"}


def rows_dataset(rows: Sequence[Row]) -> Dataset:
    """Rows of printed against computed values."""
    found = {_ROW_NAMES.get(name, name): column for name, column in columns("row", rows, _ROWS).items()}
    return Dataset(found, {"disagreeing": sum(row.verdict == Verdict.DIFFERS for row in rows)})


ROW_HEIGHT = 0.27  #: inch

#: Widths of the columns: place, symbol, unit, printed, computed, difference, verdict.
WIDTHS = (0.10, 0.12, 0.10, 0.13, 0.16, 0.12, 0.27)
HEADING, SHADES = "#e6e6e6", {Verdict.MISPRINT: "#fbe3cf", Verdict.DIFFERS: "#f4b6a6"}


def draw_table(title: str, rows: Sequence[Row]) -> Figure:
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
    from matplotlib.lines import Line2D
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
            handles.append(Line2D([], [], color=colour, ls=dashes, lw=2.2, label=label))
        handles += _mark_equilibria(axes, data)
        _angle_axes(axes)
        axes.set_title("Fig. 6 (a)  Static equilibria: where both curves cross (F = 100 N)")
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


def _mark_equilibria(axes: Axes, data: Dataset) -> list[Any]:
    from matplotlib.lines import Line2D

    box = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    look: dict[str, Any] = {"mfc": "white", "mec": "black", "ms": 11, "ls": "none"}
    places = zip(
        data["case"].data, data["phi_st"].data, data["theta_st"].data, data["kind"].data, strict=True
    )
    for number, phi, theta, kind in places:
        axes.plot(phi, theta, KINDS[kind][0], zorder=5, **look)
        offset = (0, 14) if theta < 0.7 * np.pi else (0, -22)
        text: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "zorder": 6, "bbox": box}
        axes.annotate(f"Case {number}", (phi, theta), offset, **text)
    present = [kind for kind in KINDS if kind in set(data["kind"].data)]
    return [Line2D([], [], marker=KINDS[kind][0], label=KINDS[kind][1], **look) for kind in present]


def _angle_axes(axes: Axes) -> None:
    ticks = np.array([-1.0, -0.5, 0.0, 0.5, 1.0]) * np.pi
    names = ["−π", "−π/2", "0", "π/2", "π"]
    axes.set_xticks(ticks, names)
    axes.set_yticks(ticks, names)
    axes.set(xlabel=r"$\varphi$ [rad]", ylabel=r"$\theta$ [rad]", aspect="equal")
    axes.grid(False)


def draw_positions(cases: Sequence[Case]) -> Figure:
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

_POINTS = {1: "point $M_1$", 2: "point $M_2$", 3: "slider $M_3$"}

#: Title of a figure, and its panels: label of the ordinate, names of what is drawn.
PANELS: dict[str, tuple[str, dict[str, dict[str, str]]]] = {
    "figure_2": (
        "Fig. 2  Generalized coordinates, force decaying as F₀ exp(−αt)",
        {"angle [rad]": {"phi": r"$\varphi$", "theta": r"$\theta$"}},
    ),
    "figure_3": (
        "Fig. 3  Coordinates of the points; the slider stays on its guide, y₃ = 0",
        {f"{axis} [m]": {f"{axis}{i}": name for i, name in _POINTS.items()} for axis in "xy"},
    ),
    "figure_5": (
        "Fig. 5  Generalized momenta, from Hamilton's equations",
        {"generalized momentum [kg m²/s]": {"p_phi": r"$p_\varphi$", "p_theta": r"$p_\theta$"}},
    ),
}

#: The constraints of Figure 4.
CONSTRAINTS = {
    "f_1": "(2)  $x_1^2 + y_1^2 - l^2$",
    "f_2": "(3)  $(x_2-x_1)^2 + (y_2-y_1)^2 - l^2$",
    "f_3": "(4)  $y_3$",
    "f_4": "(5)  $(x_3-x_1)^2 + (y_3-y_1)^2 - 4l^2$",
}


def draw_over_time(name: str, data: Dataset) -> Figure:
    """Figures 2, 3 and 5."""
    title, panels = PANELS[name]
    with style():
        figure = new_figure(7.2, 2.8 + 1.4 * len(panels))
        rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (label, lines) in zip(rows, panels.items(), strict=True):
            for dashes, (line, about) in zip(("-", "-", "--"), lines.items(), strict=False):
                axes.plot(data["time"].data, data[line].data, dashes, label=about)
            axes.axhline(0.0, color="0.4", lw=0.8, zorder=1.5)
            axes.set_ylabel(label)
            axes.margins(x=0)
        rows[0].set_title(title)
        rows[-1].set_xlabel(TIME)
        legend_below(figure, rows[0], len(lines))
    return figure


def draw_constraints(data: Dataset) -> Figure:
    """Figure 4: residuals of the constraints (2)-(5)."""
    with style():
        figure = new_figure(7.2, 6.4)
        rows = figure.subplots(4, 1, sharex=True, sharey=True)
        for axes, (name, label), colour in zip(rows, CONSTRAINTS.items(), LINES, strict=False):
            axes.plot(data["time"].data, data[name].data / 1e-15, color=colour, lw=0.7)
            unit = data[name].units.replace("m2", "m²")
            axes.set_title(f"{label}", loc="left", fontsize=10)
            axes.set_ylabel(f"10⁻¹⁵ {unit}")
            axes.margins(x=0)
        figure.suptitle("Fig. 4  Residuals of the constraints: rounding of double precision")
        rows[-1].set_xlabel(TIME)
    return figure


ANGLES = (r"$\xi_1$ (of $\varphi$)", r"$\xi_2$ (of $\theta$)")

BOX = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}

GROWTH = 1.5
"""A linearized disturbance leaves the picture at so many times the nonlinear one's largest angle."""


def draw_disturbed(cases: Sequence[Case], title: str, *, linearized: bool) -> Figure:
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


def _draw_angles(axes: Axes, case: Case, linearized: bool) -> None:
    t, nonlinear, linear = case.disturbed.t, case.disturbed.nonlinear[:, 0], case.disturbed.linearized[:, 0]
    shown = _span(t, nonlinear, linear) if linearized else t[-1]
    inside = t <= shown
    broad = 3.4 if linearized else 1.8
    for i, (name, colour) in enumerate(zip(ANGLES, (PALETTE["sky"], PALETTE["orange"]), strict=True)):
        axes.plot(t[inside], nonlinear[inside, i], color=colour, lw=broad, label=f"{name}, nonlinear")
    if linearized:
        for i, (name, colour) in enumerate(
            zip(ANGLES, (PALETTE["blue"], PALETTE["vermillion"]), strict=True)
        ):
            axes.plot(t[inside], linear[inside, i], "--", color=colour, lw=1.5, label=f"{name}, linearized")
        if case.verdict == "unstable":
            axes.set_ylim(_limits(nonlinear[inside, :2]))
    axes.axhline(0.0, color="0.4", lw=0.8)
    axes.set(xlabel="time t [s]", ylabel="disturbance [rad]", title=case.title)
    axes.margins(x=0)


def _limits(values: NDArray[np.float64]) -> tuple[float, float]:
    low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
    room = 0.15 * (high - low)
    return low - room, high + room


def _span(t: NDArray[np.float64], nonlinear: NDArray[np.float64], linear: NDArray[np.float64]) -> float:
    """Time to show: twice as long as the linearized angles stay in the nonlinear one's range [s]."""
    gone = np.max(np.abs(linear[:, :2]), axis=1) > GROWTH * np.max(np.abs(nonlinear[:, :2]))
    return float(min(t[-1], 2.0 * t[np.argmax(gone)])) if gone.any() else float(t[-1])


def _draw_roots(axes: Axes, case: Case) -> None:
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
    axes.set_title(
        "no root on the right"
        if not unstable
        else f"{unstable} root{'s' if unstable > 1 else ''} on the right"
    )


def draw_norms(cases: Sequence[Case]) -> Figure:
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
            axes.set_xlabel("time t [s]")
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


#: Titles of the tables, and of the figures of disturbed motion.
TITLES = {
    "Table 1": "Numerical values",
    "Table 2": "Static equilibria [rad]",
    "Table 3": "Hessian of U = Π − F x₂ at the equilibria",
    "Table 4": "Characteristic polynomials, with the sign of the print",
    "figure_7": "Cases 1 and 3: disturbed motion and roots of the polynomial",
    "figure_8": "Cases 1 and 3: nonlinear and linearized equations",
    "figure_9": "Case 2: nonlinear and linearized equations, roots of the polynomial",
    "figure_10": "Case 4: disturbed motion and roots of the polynomial",
    "figure_11": "Case 4: nonlinear and linearized equations",
}
_ONLY_NONLINEAR = ("figure_7", "figure_10")
_KICK = "After the disturbance ξ1 = 0.1 rad, η1 = 0.1 rad/s."


def table_pictures(rows: Sequence[Row]) -> list[Picture]:
    """Tables 1 to 4."""
    pictures = []
    for name in TABLES:
        own = [row for row in rows if row.section == name]
        draw = partial(draw_table, f"{name}  {TITLES[name]}", own)
        pictures.append(Picture(name.lower().replace(" ", "_"), name, TITLES[name], draw))
    return pictures


def figure_pictures(computed: Computed, data: Mapping[str, Dataset]) -> list[Picture]:
    """Figures 2 to 11 and the norm of the disturbances."""
    start = f"From Table 1's start with the decaying force, {MOTION_SPAN:g} s."
    over_time = {
        "figure_2": "Generalized coordinates.",
        "figure_3": "Coordinates of the points.",
        "figure_4": "Left sides of the constraints (2) to (5), of (2) as corrected.",
        "figure_5": "Generalized momenta, from the canonical equations.",
    }
    pictures = []
    for name, caption in over_time.items():
        draw = partial(draw_over_time, name) if name in PANELS else draw_constraints
        pictures.append(Picture(name, f"Figure {name[-1]}", f"{caption} {start}", partial(draw, data[name])))
    crossings = (
        "Potential under the constant force, both curves of (20), and the equilibria at their crossings."
    )
    scale = "The mechanism at its equilibria, to scale."
    pictures += [
        Picture("figure_6a", "Figure 6 (a)", crossings, partial(draw_potential, data["figure_6"])),
        Picture("figure_6b", "Figure 6 (b)", scale, partial(draw_positions, computed.cases)),
    ]
    for name, numbers in DISTURBED.items():
        number, cases = name.removeprefix("figure_"), [computed.cases[case - 1] for case in numbers]
        linearized, caption = name not in _ONLY_NONLINEAR, f"{TITLES[name]}. {_KICK}"
        if linearized and any(case.verdict == "unstable" for case in cases):
            caption += " The linearized motion leaves the picture; the time shown is twice as long."
        title = f"Fig. {number}  {TITLES[name]}"
        draw = partial(draw_disturbed, cases, title, linearized=linearized)
        pictures.append(Picture(name, f"Figure {number}", caption, draw))
    norm = (
        "Size of the disturbance in the kinetic-energy norm (radians of θ): it falls to zero in the stable "
        f"case alone. {_KICK} {DISTURBED_SPAN:g} s."
    )
    draw = partial(draw_norms, computed.cases)
    return [*pictures, Picture("figure_norm", "Norm of the disturbances", norm, draw)]
