"""How every picture looks: fonts, colours, labels, saving; matplotlib is left alone globally."""

from __future__ import annotations

import re
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from fastmech.results import Dataset
from fastmech.results import told as about_system
from fastmech.scene import Scene

if TYPE_CHECKING:  # matplotlib is loaded where something is drawn
    from matplotlib.artist import Artist as Artist
    from matplotlib.axes import Axes as Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure as Figure

    from fastmech.store.read import Section


#: Okabe and Ito's colours, told apart by colour-blind readers too.
PALETTE = {
    "blue": "#0072B2",
    "vermillion": "#D55E00",
    "green": "#009E73",
    "purple": "#CC79A7",
    "orange": "#E69F00",
    "sky": "#56B4E9",
    "yellow": "#F0E442",
    "black": "#000000",
}

#: Colours of lines in their order (without yellow, which is too pale for a line on white).
LINES = [PALETTE[name] for name in ("blue", "vermillion", "green", "purple", "orange", "sky", "black")]


def color(number: int) -> str:
    """The colour of a line by its number, from 0."""
    return on_paper(LINES[number % len(LINES)])


def ink() -> str:
    """What lines and marks are drawn with: the text's colour in the style that is in force."""
    return str(_in_force("text.color"))


def paper() -> str:
    """What marks are filled with: the ground's colour."""
    return str(_in_force("axes.facecolor"))


def _in_force(setting: Any) -> Any:
    from matplotlib import rcParams

    return rcParams[setting]


def on_paper(color: str) -> str:
    """A colour of a table of looks, of which black is ink and white is paper."""
    return {"black": ink(), PALETTE["black"]: ink(), "white": paper(), "#ffffff": paper()}.get(color, color)


#: Colour map of fields: equal steps look equal, in grey and to colour-blind readers too.
FIELD = "cividis"

DPI = 150

#: Entries of a legend inside of axes, at most.
MOST_INSIDE = 6

#: Rows of a legend for which figures have room; for more they grow.
ROWS = 9

#: What differs from Matplotlib's own defaults.
_SETTINGS: dict[Any, Any] = {
    "axes.titlesize": 11.0,
    "legend.fontsize": 9.0,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#d9d9d9",
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "axes.formatter.useoffset": False,
    "image.cmap": FIELD,
    "svg.hashsalt": "fastmech",
}


@contextmanager
def style() -> Iterator[None]:
    """The package's look, for figures that are made and saved inside of the ``with`` block."""
    import matplotlib
    from cycler import cycler

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update({**_SETTINGS, "axes.prop_cycle": cycler(color=LINES)})
        yield


def new_figure(width: float = 7.2, height: float = 4.2) -> Figure:
    """An empty figure of this size [inch] that keeps its texts apart."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def new_panel(width: float = 7.2, height: float = 4.2) -> tuple[Figure, Axes]:
    """A figure of one panel, with its axes."""
    figure = new_figure(width, height)
    return figure, figure.subplots()


def legend_below(figure: Figure, of: Axes | Sequence[Artist], columns: int = 2) -> None:
    """A legend of what axes have, or of some entries, under the whole figure, where it covers nothing."""
    handles = list(of if isinstance(of, Sequence) else of.get_legend_handles_labels()[0])
    fit = _fitting(handles, columns, 72.0 * figure.get_figwidth())
    beyond = max(0, -(-len(handles) // fit) - ROWS)
    figure.set_figheight(figure.get_figheight() + 0.19 * beyond)
    figure.legend(handles=handles, loc="outside lower center", ncols=fit)


def _fitting(handles: Sequence[Artist], columns: int, points: float) -> int:
    """How many columns of a legend fit over so many points, not more than asked for."""
    lengths, room = [len(str(one.get_label())) + 6 for one in handles], _in_force("legend.fontsize")
    counts = range(min(columns, len(lengths)), 1, -1)  # each column is as wide as its longest entry
    wide = {n: sum(max(part) for part in np.array_split(lengths, n)) for n in counts}
    return next((n for n in counts if wide[n] <= _letters(points, room)), 1)


def legend_under(axes: Axes, handles: Sequence[Artist] | None = None, columns: int = 2) -> None:
    """A legend under axes that may be one panel of a user's figure, in as many columns as fit."""
    from matplotlib.transforms import ScaledTranslation

    known = axes.get_legend_handles_labels()[0] if handles is None else handles
    if known:
        # Below the ticks' labels and the axis' own, however high the axes are.
        below = -3.8 * float(axes.xaxis.label.get_fontsize()) / 72.0
        place = axes.transAxes + ScaledTranslation(0.0, below, axes.figure.dpi_scale_trans)
        look: dict[str, Any] = {"bbox_transform": place, "ncols": _fitting(known, columns, _points(axes))}
        axes.legend(handles=list(known), loc="upper center", bbox_to_anchor=(0.5, 0.0), **look)


def make_room(axes: Axes) -> None:
    """Make the axes' own figure as much higher as their legend and title are."""
    figure: Any = axes.figure
    legend = axes.get_legend()
    heights = [axes.title.get_window_extent().height]
    if legend is not None and legend.get_window_extent().y1 < axes.get_window_extent().y0:
        heights.append(legend.get_window_extent().height)
    figure.set_figheight(figure.get_figheight() + sum(heights) / figure.dpi)
    # Above a power of ten on the axis the title moves as it is drawn, which the layout has not foreseen.
    figure.draw_without_rendering()
    if (y := axes.title.get_position()[1]) > 1.0:
        axes.set_title(axes.get_title(), y=y, fontsize=axes.title.get_fontsize())


def keep_inside(axes: Axes) -> None:
    """Move a legend that is under the axes into them, or remove one of many entries.

    Figures whose layout makes room for it keep it there.
    """
    figure: Any = axes.figure
    legend: Any = axes.get_legend()
    if legend is None or figure.get_layout_engine() is not None:
        return
    if legend.get_window_extent().y0 < axes.get_window_extent().y0:
        entries = legend.legend_handles, [text.get_text() for text in legend.get_texts()]
        legend.remove()
        if len(entries[0]) <= MOST_INSIDE:
            axes.legend(*entries, fontsize="x-small", framealpha=0.9)


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG (150 dots an inch), or in the format that the file's name says, undated."""
    with style():
        metadata = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(path.suffix)
        figure.savefig(path, dpi=DPI, metadata=metadata)


def png(figure: Figure) -> bytes:
    """A figure as the bytes of a PNG file."""
    buffer = BytesIO()
    with style():
        figure.savefig(buffer, format="png", dpi=DPI)
    return buffer.getvalue()


SYMBOLS = {"phi": "φ", "theta": "θ", "phi_dot": "φ'", "theta_dot": "θ'", "omega": "ω"}

#: Whose defaults a scene has, in titles; how exponents of units are written.
PAPER, RAISED = "the paper's Table 1", str.maketrans("23", "²³")

#: Letters of parameters that a title tells at most: two lines. What is left is in the file.
MOST_TOLD = 80

#: The paper's coordinates, of which both turn fully.
ANGLES = ("phi", "theta")


#: The axis of motions, and what a coordinate of a unit is.
TIME, KINDS = "time t [s]", {"rad": "angle", "m": "position"}


def symbol(name: str) -> str:
    """How pictures write a coordinate or a rate."""
    return SYMBOLS.get(name, f"{name.removesuffix('_dot')}'" if name.endswith("_dot") else name)


def coordinates_of(dataset: Dataset | Section) -> tuple[str, ...]:
    """Names of the coordinates that a section is about."""
    return tuple(dataset.attrs.get("coordinate_names", ANGLES))


def _defaults(name: str) -> dict[str, tuple[float, str, str]]:
    """Value and unit of every parameter of Table 1, or of a shipped mechanism."""
    if not name:
        return Scene().described()
    from fastmech.mechanisms import shipped

    known = shipped()
    return known[name]().described() if name in known else {}


@contextmanager
def values_alone() -> Iterator[None]:
    """Titles that leave parameters to the table of the device, which a report has above its pictures."""
    token = _alone.set(True)
    try:
        yield
    finally:
        _alone.reset(token)


_alone = ContextVar("alone", default=False)


def setting_of(about: Mapping[str, Any], parameters: Mapping[str, float], decayed: bool = False) -> str:
    """What differs from the defaults among these parameters, with units, for titles.

    Of a mechanism of one's own those that ``replace`` or a request has changed, then loads, then a few of the
    others.

    Args:
        about: a section's attributes; of a mechanism or a system its name, ``unit_*`` of its parameters, and
            which are changed.
        parameters: all but those on axes; those of a system of one's own have no defaults.
        decayed: what is shown is without a force that fades.
    """
    name, comma, load = str(about.get("mechanism", about.get("system", ""))).partition(",")
    known, changed = _defaults(name), set(about.get("changed_parameters", ()))
    loads = [] if known else [one for one in parameters if about.get(f"unit_{one}") in ("N", "N m")]
    own = dict(sorted(parameters.items(), key=lambda one: (one[0] not in changed, one[0] not in loads)))
    told, least = [], 0
    decayed = decayed and not name and own.get("alpha", 0.0) > 0.0
    if decayed:
        own = {one: value for one, value in own.items() if one not in ("F0", "alpha")}
    for one, value in own.items():
        default, unit = (*known.get(one, (np.nan, "1")), "")[:2]
        if f"{value:.5g}" != f"{default:.5g}":  # 1100/3 N/m is printed as 366.67 N/m
            unit = str(about.get(f"unit_{one}", unit))
            told.append(f"{one} = {value:.5g}" + f" {unit.translate(RAISED)}" * (unit != "1"))
            least += one in known or one in changed
    lengths = np.cumsum([len(one) + 2 for one in told])
    if lengths.size and lengths[-1] > MOST_TOLD:
        kept = max(1, least, int(np.count_nonzero(lengths <= MOST_TOLD)))
        told = [*told[:kept], *[f"and {len(told) - kept} more"] * (kept < len(told))]
    told = ["parameters as in the table of the device"] if _alone.get() else told
    told += ["the force decayed"] * decayed
    of = PAPER if name in ("", "slider_pendulum") else name.replace("_", " ")
    if _alone.get() and of == PAPER and not load:
        return ", ".join(told)
    return f"{of}{comma}{load}" + (f" with {', '.join(told)}" if told else "")


def setting(system: Any, varied: Container[str | None] = (), decayed: bool = False) -> str:
    """The same of a scene, a mechanism or a system, but for the parameters that vary."""
    about = {} if isinstance(system, Scene) else {"system": system.name, **about_system(system)}
    own = {name: value for name, (value, *_) in system.described().items() if name not in varied}
    return setting_of(about | _units(system), own, decayed)


def _units(system: Any) -> dict[str, str]:
    return {f"unit_{name}": unit for name, (_, unit, _) in system.described().items()}


def with_units(dataset: Dataset, system: Any) -> Dataset:
    """A dataset whose attributes also tell the units of a system's parameters, for titles."""
    return replace(dataset, attrs={**dataset.attrs, **_units(system)})


def _points(axes: Axes) -> float:
    """How wide axes are."""
    return 72.0 * axes.get_window_extent().width / axes.figure.dpi


def _letters(points: float, size: Any) -> int:
    """How many letters of this size fit over so many points."""
    from matplotlib.font_manager import FontProperties

    return int(points / (0.57 * FontProperties(size=size).get_size_in_points()))


def title(axes: Axes, text: str, size: float | None = None) -> None:
    """A title over axes, in as many lines as it takes."""
    of = _in_force("axes.titlesize") if size is None else size
    axes.set_title(_in_lines(text, _letters(_points(axes), of)), fontsize=of)


def _in_lines(text: str, width: int) -> str:
    """Lines of so many letters, with values and their units beside their names."""
    whole = re.sub(r"\S+ = [^,;\n]+", lambda found: found[0].replace(" ", "\xa0"), text)
    return "\n".join(fill(line, width) for line in whole.split("\n")).replace("\xa0", " ")


def suptitle(figure: Figure, text: str) -> None:
    """A title over all panels, or below the own one of a single panel, in as many lines as it takes."""
    panels = [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]
    if len(panels) == 1 and panels[0].get_title():
        title(panels[0], f"{panels[0].get_title()}\n{text}")
        return
    figure.suptitle(_in_lines(text, int(12 * figure.get_figwidth())), fontsize=10.0)


def message(axes: Axes, text: str) -> None:
    """Why there is nothing to draw."""
    axes.set(xticks=[], yticks=[])
    axes.set_axis_off()
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", wrap=True)


def with_unit(name: str, unit: str) -> str:
    """A name with its unit, for an axis; nothing of a pure number."""
    return name if unit == "1" else f"{name} [{unit.translate(RAISED)}]"


def quantity(dataset: Dataset, name: str, when: str = "") -> str:
    """What a coordinate, a rate or another state is, and when, with its unit, for an axis."""
    unit = dataset[name].units
    kind = KINDS.get(unit, "rate" if "/s" in unit else "")
    return with_unit(f"{'' if symbol(name) == kind else kind} {symbol(name)}{when}".lstrip(), unit)


def place(names: Sequence[str], values: Sequence[float], units: Sequence[str], digits: str = "z.3f") -> str:
    """Values of coordinates with their names, and units after the last one of each."""
    told = [
        f" {unit}" * (unit not in (after, "1")) for unit, after in zip(units, [*units[1:], ""], strict=True)
    ]
    each = zip(names, values, told, strict=True)
    return ", ".join(f"{symbol(n)} = {value:{digits}}{unit}" for n, value, unit in each)


def equilibrium_names(dataset: Dataset) -> list[str]:
    """One name for each equilibrium of a dataset: its number and place."""
    names = coordinates_of(dataset)
    units, places = [dataset[n].units for n in names], zip(*(dataset[n].data for n in names), strict=True)
    return [f"{number}: {place(names, values, units)}" for number, values in enumerate(places)]


#: Up to which ratio of its ends a logarithmic axis has ticks at which values of every decade; none: at any.
TICKS: tuple[tuple[float, tuple[float, ...]], ...] = (
    (8.0, ()),
    (100.0, (1.0, 2.0, 5.0)),
    (2000.0, (1.0, 3.0)),
)


def logarithmic(axis: Axis) -> None:
    """Labelled ticks of a logarithmic axis that keep apart, at least three in a part of a decade or many."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    low, high = axis.get_view_interval()
    for ratio, at in TICKS:
        if high < ratio * low:
            axis.set_major_locator(LogLocator(subs=at) if at else MaxNLocator(5, steps=[1, 2, 5, 10]))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            break
    axis.set_minor_formatter(NullFormatter())


def angle_ticks(axes: Axes, **units: str) -> None:
    """Ticks at quarter turns, or fewer, on those of the axes x and y in rad that show half a turn or more.

    On those that show less than a turn, also at eighths.
    """
    from matplotlib.ticker import FuncFormatter, MultipleLocator

    def told(value: float, _: int) -> str:
        part = Fraction(round(4.0 * value / np.pi), 4)
        number, below = abs(part.numerator), f"/{part.denominator}" * (part.denominator > 1)
        return f"{'−' * (part < 0)}{'' if number == 1 else number}π{below}" if part else "0"

    for name, axis in (("x", axes.xaxis), ("y", axes.yaxis)):
        quarters = np.ptp(axis.get_view_interval()) / (0.5 * np.pi)
        if units[name] == "rad" and quarters > 1.9:
            least = 0.5 if quarters < 3.9 else 1.0
            step = 0.5 * np.pi * 2.0 ** np.ceil(np.log2(max(quarters / 8.5, least)))
            axis.set_major_locator(MultipleLocator(step))
            axis.set_major_formatter(FuncFormatter(told))


def entry(label: str, **look: Any) -> Artist:
    """A line or a mark of a legend, in ink unless it has another colour."""
    from matplotlib.lines import Line2D

    return Line2D([], [], **{"color": ink(), "label": label, **look})


def swatch(label: str, color: str, edge: str | None = None) -> Artist:
    """A patch of colour of a legend."""
    from matplotlib.patches import Patch

    return Patch(facecolor=color, edgecolor=edge, label=label)


def box(pad: float, alpha: float) -> dict[str, Any]:
    """What is behind a text that stands in a picture."""
    return {"boxstyle": f"round,pad={pad}", "facecolor": paper(), "edgecolor": "none", "alpha": alpha}


def shade(axes: Axes, x: Any, y: Any, values: Any, **look: Any) -> Any:
    """A field (x, y) in colours, over the middles or the edges of its cells."""
    return axes.pcolormesh(x, y, values.T, rasterized=True, **look)


#: By how little, relatively, values differ by rounding alone; half a colour bar's width about such a value.
ROUNDED, AROUND = 1e-9, 1e-6


def log_colors(low: float, high: float) -> Any:
    """Colours by the logarithm of values; one colour where they differ by rounding alone."""
    from matplotlib.colors import LogNorm

    alone = high <= (1.0 + ROUNDED) * low
    return LogNorm(low * (1.0 - AROUND), low * (1.0 + AROUND)) if alone else LogNorm(low, high)


def tell_one_value(bar: Any) -> bool:
    """Write the value of a field of one colour at its colour bar; whether it is such a one."""
    low, high = bar.norm.vmin, bar.norm.vmax
    alone = bool(high <= (1.0 + 3.0 * AROUND) * low)
    if alone:
        bar.set_ticks([np.sqrt(low * high)], labels=[f"{np.sqrt(low * high):.4g}"])
        bar.minorticks_off()
    return alone


def paint(axes: Axes, x: Any, y: Any, numbers: Any, colors: Sequence[str]) -> None:
    """Cells (x, y) in the colours of these numbers; -1: none."""
    from matplotlib.colors import ListedColormap

    shade(axes, x, y, numbers, cmap=ListedColormap(colors), vmin=-0.5, vmax=len(colors) - 0.5)


def share(where: Any) -> str:
    """The share of cells, in words."""
    return f"{100.0 * np.mean(where):.3g} %"
