"""How every picture looks: fonts, colours, labels, saving; matplotlib is left alone globally."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fastmech.results import Dataset, Variable

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
    return LINES[number % len(LINES)]


#: Colour map of fields: equal steps look equal, in grey and to colour-blind readers too.
FIELD = "cividis"

DPI = 150

_SETTINGS: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 10.0,
    "axes.titlesize": 11.0,
    "axes.labelsize": 10.0,
    "legend.fontsize": 9.0,
    "figure.titlesize": 12.0,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#d9d9d9",
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "axes.formatter.useoffset": False,
    "axes.unicode_minus": True,
    "image.cmap": FIELD,
    "savefig.facecolor": "white",
    "svg.hashsalt": "fastmech",
}


@contextmanager
def style() -> Iterator[None]:
    """The package's look, for figures that are made and saved inside of the ``with`` block."""
    import matplotlib
    from cycler import cycler

    with matplotlib.rc_context({**_SETTINGS, "axes.prop_cycle": cycler(color=LINES)}):
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
    handles = of if isinstance(of, Sequence) else of.get_legend_handles_labels()[0]
    figure.legend(handles=list(handles), loc="outside lower center", ncols=columns)


def legend_under(axes: Axes, handles: Sequence[Artist] | None = None, columns: int = 2) -> None:
    """A legend under axes that may be one panel of a user's figure."""
    known = axes.get_legend_handles_labels()[0] if handles is None else handles
    if known:
        axes.legend(handles=list(known), loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=columns)


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


#: Parameters of a mechanism that a title tells.
MOST_TOLD = 6

#: A code that no variable has.
NOWHERE = 1 << 40

#: Places and labels of the ticks of an angle's axis over one turn.
PI_TICKS = ([-np.pi, -np.pi / 2, 0.0, np.pi / 2, np.pi], ["-π", "-π/2", "0", "π/2", "π"])


SYMBOLS = {"phi": "φ", "theta": "θ", "phi_dot": "φ'", "theta_dot": "θ'"}

#: The paper's coordinates, of which both turn fully.
ANGLES = ("phi", "theta")


def symbol(name: str) -> str:
    """How pictures write a coordinate or a rate."""
    return SYMBOLS.get(name, f"{name.removesuffix('_dot')}'" if name.endswith("_dot") else name)


def coordinates_of(dataset: Dataset | Section) -> tuple[str, ...]:
    """Names of the coordinates that a section is about."""
    return tuple(dataset.attrs.get("coordinate_names", ANGLES))


def setting_of(dataset: Dataset, parameters: Mapping[str, float]) -> str:
    """A mechanism and some of its parameters, for titles."""
    each = ", ".join(f"{name} = {value:g}" for name, value in list(parameters.items())[:MOST_TOLD])
    name = dataset.attrs.get("mechanism", dataset.attrs.get("system", ""))
    return f"{name}: {each}{', ...' * (len(parameters) > MOST_TOLD)}"


def with_unit(name: str, unit: str) -> str:
    """A name with its unit, for an axis; nothing of a pure number."""
    return name if unit == "1" else f"{name} [{unit}]"


def quantity(dataset: Dataset, name: str) -> str:
    """What a coordinate or a rate is, with its unit, for an axis."""
    unit = dataset[name].units
    kind = {"rad": "angle", "m": "position"}.get(unit, "rate")
    return f"{'' if symbol(name) == kind else f'{kind} '}{symbol(name)} [{unit}]"


def equilibrium_names(dataset: Dataset) -> list[str]:
    """One name for each equilibrium of a dataset: its number (from 1) and place."""
    names = coordinates_of(dataset)
    units = [dataset[name].units for name in names]
    told = [f" {unit}" if unit != after else "" for unit, after in zip(units, [*units[1:], ""], strict=True)]
    return [
        f"{number}: "
        + ", ".join(f"{symbol(n)} = {v:z.3f}{unit}" for n, v, unit in zip(names, place, told, strict=True))
        for number, place in enumerate(zip(*(dataset[name].data for name in names), strict=True), start=1)
    ]


class Codes(dict[str, int]):
    """Codes by their meanings; a meaning that the file does not know is no code."""

    def __missing__(self, meaning: str) -> int:
        return NOWHERE

    def others(self, known: Container[str]) -> list[str]:
        """Meanings that the file knows and this version does not: it is older or newer."""
        return [meaning for meaning in self if meaning not in known]


def flag_codes(variable: Variable) -> Codes:
    """Meanings and codes of a variable of flags, as the file explains them itself."""
    return Codes(variable.codes)


def logarithmic(axis: Axis) -> None:
    """Ticks of a logarithmic axis whose labels keep apart, over a part of a decade or over many."""
    low, high = axis.get_view_interval()
    in_fifths(axis, high < 30.0 * low)


def in_fifths(axis: Axis, labelled: bool = True) -> None:
    """Ticks of a logarithmic axis at 1, 2 and 5 in every decade, else as usual; none between."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    if labelled:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def entry(label: str, **look: Any) -> Artist:
    """A line or a mark of a legend, black unless it has another colour."""
    from matplotlib.lines import Line2D

    return Line2D([], [], **{"color": "black", "label": label, **look})


def swatch(label: str, color: str, edge: str | None = None) -> Artist:
    """A patch of colour of a legend."""
    from matplotlib.patches import Patch

    return Patch(facecolor=color, edgecolor=edge, label=label)


def shade(axes: Axes, x: Any, y: Any, values: Any, **look: Any) -> Any:
    """A field (x, y) in colours, over the middles or the edges of its cells."""
    return axes.pcolormesh(x, y, values.T, rasterized=True, **look)


def paint(axes: Axes, x: Any, y: Any, numbers: Any, colors: Sequence[str]) -> None:
    """Cells (x, y) in the colours of these numbers; -1: none."""
    from matplotlib.colors import ListedColormap

    shade(axes, x, y, numbers, cmap=ListedColormap(colors), vmin=-0.5, vmax=len(colors) - 0.5)


def share(where: Any) -> str:
    """The share of cells, in words."""
    return f"{100.0 * np.mean(where):.3g} %"
