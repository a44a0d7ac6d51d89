"""Basin maps and dynamic snapping: who ends where, with what decides it on top, and how long that takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fastmech.arrays import Floats
from fastmech.capture.select import certificate_of
from fastmech.models.mechanism import Mechanism
from fastmech.objects import spaced
from fastmech.plots import style
from fastmech.results import Codes, Dataset
from fastmech.scene import Scene
from fastmech.slider.lagrange import kinetic_energy, potential_energy

#: Colours of areas, those of lines of the same numbers and yellow: apart for colour-blind readers too, and
#: from white, black and the greys of this module; none too dark for black marks on top.
COLORS = [*style.LINES[:-1], style.PALETTE["yellow"]]

#: Colour of all other basins, and of what share of the starts, at most, if turns are told apart unasked.
FURTHER, MANY = "#9a9a9a", 0.1


def basin_name(dataset: Dataset, well: int, turns: tuple[int, ...]) -> str:
    """Name of a copy of a well; ``well`` is an index among the dataset's equilibria."""
    wells = np.flatnonzero(dataset["equilibrium_morse_index"].data == 0)
    text = f"well {np.searchsorted(wells, well)}" if wells.size > 1 else "the well"
    names = map(style.symbol, style.coordinates_of(dataset))
    made = [f"{t:+d} {name}" for t, name in zip(turns, names, strict=True) if t]
    return f"{text}, {', '.join(made)} turn{'s' * (len(made) > 1 or abs(sum(turns)) > 1)}" if made else text


#: Points along each side on which energies are evaluated for their contours.
GRID = 401

#: An equilibrium so near to the slice [rad, rad/s] counts as in it: held values are typed with some digits.
IN_SLICE = 1e-3

MARKERS = {"well": "o", "saddle": "D", "maximum": "^"}
DASHES = ["-", "--", ":"]

#: Points of an attractor up to which each is drawn as a mark.
FEW_POINTS = 32


class Slice:
    """The first two axes that vary; further ones are held at their middle value."""

    def __init__(self, dataset: Dataset, system: Scene | Mechanism | None) -> None:
        """``system``: what the dataset is about; None: a mechanism that the file does not hold."""
        self.dataset, self.system = dataset, system
        self.coordinates = style.coordinates_of(dataset)
        of_scene = isinstance(system, Scene)
        self.turning = style.ANGLES if of_scene else tuple(dataset.attrs.get("turning_names", ()))
        self.states = (*self.coordinates, *(f"{name}_dot" for name in self.coordinates))
        names = tuple(dataset.attrs["axes"])
        self.axes = tuple(sorted(names, key=lambda n: dataset.sizes[n] == 1)[:2])
        self.index = tuple(slice(None) if n in self.axes else dataset.sizes[n] // 2 for n in names)
        self.swapped = names.index(self.axes[0]) > names.index(self.axes[1])
        fixed = {name: dataset.attrs.get(f"fixed_{name}") for name in self.states}
        self.held = {name: float(value) for name, value in fixed.items() if value is not None}
        self.held |= {n: float(dataset[n].data[dataset.sizes[n] // 2]) for n in names if n not in self.axes}

    def data(self, name: str) -> NDArray[np.generic]:
        """A variable over the two axes, the first one first."""
        values = np.asarray(self.dataset[name].data[self.index])
        return values.T if self.swapped else values

    def axis(self, number: int) -> Floats:
        """Values along one of the two axes."""
        return np.asarray(self.dataset[self.axes[number]].data, dtype=np.float64)

    def energy(self, system: Scene | Mechanism) -> tuple[Floats, Floats, Floats]:
        """Values along both axes and T + U over them [J], U with the load that the wells hold for."""
        x, y = (np.linspace(self.axis(k)[0], self.axis(k)[-1], GRID) for k in (0, 1))
        grids = dict(zip(self.axes, np.meshgrid(x, y, indexing="ij"), strict=True))
        states = np.stack(
            [grids[n] if n in grids else np.full((GRID, GRID), self.held[n]) for n in self.states], axis=-1
        )
        if isinstance(system, Mechanism):
            return x, y, system.evaluate("bounding", np.moveaxis(states, -1, 0))[0]
        force = float(self.dataset["force"].data)
        return x, y, kinetic_energy(system, states) + potential_energy(system, states[..., :2], force)


def mark(marker: str, text: str, face: str = "white") -> style.Artist:
    """What a marker in a legend means."""
    return style.entry(text, marker=marker, mfc=style.on_paper(face), ms=8, ls="none")


def decisive(axes: style.Axes, view: Slice) -> list[style.Artist]:
    """Equilibria in the slice, and where the energy is that of each well's barrier."""
    handles: list[style.Artist] = []
    data = view.dataset
    wells = np.flatnonzero(data["equilibrium_morse_index"].data == 0)
    barriers = data["barrier"].data[wells]
    if view.system is not None:
        of_mechanism = isinstance(view.system, Mechanism)
        bounded = np.array([of_mechanism and certificate_of(view.system).tree.bounded(k) for k in wells])
        x, y, energy = view.energy(view.system)
        levels = np.unique(barriers.astype(np.float32))  # those of symmetric wells differ by rounding
        for number, level in enumerate(levels[(np.nanmin(energy) < levels) & (levels < np.nanmax(energy))]):
            look, which = DASHES[number % len(DASHES)], np.flatnonzero(np.float32(barriers) == level)
            near = _near_wells(view, (x, y, energy), float(level), [int(well) for well in wells[which]])
            axes.contour(x, y, near.T, levels=[level], colors=style.ink(), linewidths=1.6, linestyles=look)
            above = barriers[which] - data["equilibrium_energy"].data[wells[which]]
            heights = " and ".join(dict.fromkeys(f"{height:.4g}" for height in above))
            of = f" of well{'s' * (which.size > 1)} {' and '.join(map(str, which))}" * (wells.size > 1)
            least = "at least " * bool(bounded[which].any())
            it = "them" if which.size > 1 else "the well"
            text = f"energy at the barrier{of}: {least}{heights} J above {it}"
            handles.append(style.entry(text, lw=1.6, ls=look))
    lowest = {0: "well", len(view.coordinates): "maximum"}
    for index in range(len(view.coordinates) + 1):
        name = lowest.get(index, "saddle")
        marker = MARKERS[name]
        for inside in (True, False):
            places = _places(view, index, inside)
            if len(places):
                face = style.paper() if inside else "none"
                axes.plot(*places.T, marker, mfc=face, mec=style.ink(), mew=1.4, ms=8, ls="none", zorder=5)
                text = name if inside else f"{name}, outside of this slice"
                handles.append(mark(marker, text, face))
    if wells.size > 1:
        for number, well in enumerate(wells):
            for place in _places(view, 0, True, int(well)):
                box = style.box(pad=0.1, alpha=0.8)
                beside: dict[str, Any] = {"textcoords": "offset points", "weight": "bold", "bbox": box}
                axes.annotate(str(number), place, xytext=(7, 6), zorder=6, **beside)
    return handles


def _near_wells(view: Slice, field: tuple[Floats, Floats, Floats], level: float, own: list[int]) -> Floats:
    """The energy, raised above the level in those parts below it that hold only other wells than ``own``."""
    x, y, energy = field
    parts, _ = ndimage.label(energy < level)
    at: dict[bool, set[int]] = {True: set(), False: set()}
    for well in np.flatnonzero(view.dataset["equilibrium_morse_index"].data == 0):
        for place in _places(view, 0, True, int(well)):
            i, j = (int(np.abs(axis - value).argmin()) for axis, value in zip((x, y), place, strict=True))
            at[int(well) in own].add(int(parts[i, j]))
    others = np.isin(parts, [*(at[False] - at[True] - {0})])
    return np.where(others, 2.0 * level - energy, energy)


def _places(view: Slice, index: int, inside: bool, only: int | None = None) -> Floats:
    """Copies of equilibria of a Morse index within the picture (n, 2): those in the slice, or those outside.

    Those outside are seen along the held coordinates, if an angle is an axis; over two rates they would all
    lie at the origin.
    """
    data, found = view.dataset, []
    if not inside and not set(view.coordinates) & set(view.axes):
        return np.zeros((0, 2))
    reach = {name: (view.axis(k)[0], view.axis(k)[-1]) for k, name in enumerate(view.axes)}
    for i in np.flatnonzero(data["equilibrium_morse_index"].data == index):
        place = {name: data[f"equilibrium_{name}"].data[i] for name in view.coordinates}
        away = [held - place.get(name, 0.0) for name, held in view.held.items()]
        turning = [name in view.turning for name in view.held]
        apart = np.where(turning, np.remainder(np.add(away, np.pi), 2.0 * np.pi) - np.pi, away)
        if only not in (None, i) or bool(np.abs(apart).max(initial=0.0) <= IN_SLICE) != inside:
            continue
        copies = []
        for name, (low, high) in reach.items():
            at = place.get(name, 0.0)
            first, last = np.ceil((low - at) / (2.0 * np.pi)), np.floor((high - at) / (2.0 * np.pi))
            every = at + 2.0 * np.pi * np.arange(first, last + 1.0)
            copies.append(every if name in view.turning else [at] * bool(low <= at <= high))
        found += [(a, b) for a in copies[0] for b in copies[1]]
    return np.array(found).reshape(-1, 2)


#: Looks of starts without a label: colour, and the marker that keeps single ones visible.
UNLABELLED = {
    "undecided": ("#ffffff", "x", "undecided: too late, or too near a boundary"),
    "at_saddle": ("#000000", "s", "on a saddle's stable manifold"),
    "out_of_range": ("#d0b8a0", "v", "out of range"),
    "not_finite": ("#4d4d4d", "+", "not finite"),
    "step_too_large": ("#4d4d4d", "1", "step too large"),
    "not_converged": ("#4d4d4d", "3", "Newton's iteration failed"),
    "start_not_finite": ("#4d4d4d", "2", "start not finite"),
}

#: Pictures of times: title, and why a computed start has none.
TIMES = {
    "capture_time": ("Time until capture is proved", "not captured"),
    "settle_time": ("Time to settle", "not settled"),
}

#: Colour of starts of a refined map that have not been computed.
SKIPPED = "#d9d9d9"

#: Colour of starts that are captured or settled by the first look.
AT_ONCE = style.PALETTE["sky"]

#: Starts without label up to which each is marked, and their share: more are seen as an area.
FEW, AREA = 400, 0.02


@style.style()
def draw_basins(
    dataset: Dataset, scene: Mapping[str, float], mechanism: Mechanism | None = None
) -> dict[str, style.Figure]:
    """Pictures of a dataset of the scan type ``basins`` about the scene with these parameters.

    Of a mechanism that is not given, as from a file, barriers are not drawn.
    """
    if "equilibria" not in dataset.groups and "axes" not in dataset.attrs:  # no wells
        figure, axes = style.new_panel(8.2, 8.0)
        handles = draw_attained(axes, dataset, style.setting_of(dataset.attrs, scene))
        style.legend_below(figure, handles, 1)
        return {"labels": figure}
    dataset = dataset.merged
    slice_ = Slice(dataset, mechanism if "mechanism" in dataset.attrs else Scene(**scene))
    figures = {}
    turned = any(slice_.data(f"turns_{name}").any() for name in slice_.coordinates)
    wells = np.setdiff1d(slice_.data("well"), [-1])
    for name, turns in {"labels": True, "wells": False}.items():
        if turns or (turned and wells.size > 1):
            figures[name], axes = style.new_panel(8.2, 8.0)
            style.legend_below(figures[name], draw_labels(axes, slice_, turns))
    for name in TIMES:
        if name in dataset and np.isfinite(slice_.data(name)).any():
            figures[name] = _times(slice_, name)
    for figure in figures.values():
        describe(figure.axes[0], slice_, scene)
    return figures


def draw_attained(axes: style.Axes, dataset: Dataset, setting: str) -> list[style.Artist]:
    """Draw which starts come to which attractor, or stop with which code, over the first two axes.

    Further axes are held in their middle. Returns the legend's entries.
    """
    names = dataset["well"].dims[:2]
    well = dataset["well"].data.reshape(*(dataset.sizes[n] for n in names), -1)
    well = well[..., well.shape[-1] // 2].reshape(dataset.sizes[names[0]], -1)
    there = np.unique(well)
    colors = ["#d9d9d9" if k < 0 else style.color(k) for k in there]
    x, y = dataset[names[0]].data, dataset[names[1]].data if len(names) > 1 else np.zeros(1)
    style.paint(axes, x, y, np.searchsorted(there, well), colors)
    labels = [style.quantity(dataset, name, " at the start") for name in names]
    axes.set(xlabel=labels[0], ylabel=labels[1] if len(names) > 1 else "")
    style.angle_ticks(axes, x=dataset[names[0]].units, y=dataset[names[-1]].units)
    ends = dataset.attrs.get("ends")
    told = ["no label" if k < 0 else f"code {k}" if ends is None else ends[k] for k in there]
    shares = [f"{text}: {style.share(well == k)}" for k, text in zip(there, told, strict=True)]
    handles = [style.swatch(t, c, style.ink()) for c, t in zip(colors, shares, strict=True)]
    if "points" in dataset.groups and len(names) > 1:
        group, inside = dataset.groups["points"], False
        looks: Any = {"ls": "none", "marker": "o", "mfc": style.paper(), "mec": style.ink()}
        points = np.array([group[f"point_{name}"].data for name in names])
        low, high = np.array([[line[k] for line in (x, y)] for k in (0, -1)])[..., None]
        seen = ((points >= low) & (points <= high)).all(axis=0)
        for one in np.unique(group["point_attractor"].data):
            own = group["point_attractor"].data == one
            size = 5 if np.count_nonzero(own) < FEW_POINTS else 1.5
            axes.plot(*points[:, own & seen], ms=size, **looks)
            inside |= bool((own & seen).any())
        if inside:
            handles.append(style.entry("points of attractors", ms=5, **looks))
    style.title(axes, f"Where each start ends\n{setting}")
    return handles


def draw_labels(axes: style.Axes, view: Slice, turns: bool | None = None) -> list[style.Artist]:
    """Draw who ends where; returns the legend's entries.

    Colours are wells with their turns, or wells alone. None: wells alone where there are several and more
    than ``MANY`` of the starts would be among the others.
    """
    data, told = view.dataset, ("", "others (basins: {})")
    made = [data[f"basin_turns_{name}"].data for name in view.coordinates]
    ends = np.column_stack([data["basin_well"].data, *made])
    label = view.data("label").astype(int)
    picture, colors, handles = _by_well(data, label, ends, told)
    others = np.isin(picture, np.flatnonzero(np.array(colors) == FURTHER))
    if turns is None:
        alike = not ends[:, 1:].any() or np.unique(ends[label[label >= 0], 0]).size < 2
        turns = alike or bool(np.mean(others) <= MANY)
    if not turns:
        ends[:, 1:] = 0
        ends, number = np.unique(ends, axis=0, return_inverse=True)
        label = np.append(number, -1)[label]
        picture, colors, handles = _by_well(data, label, ends, told)
    x, y, status = view.axis(0), view.axis(1), view.data("status")
    handles += _unlabelled(axes, x, y, status, data["status"].codes, picture=picture, colors=colors)
    style.paint(axes, x, y, picture, colors)
    axes.set_title("Where starts come to rest" + ", whatever their turns" * (not turns))
    return handles + decisive(axes, view)


def _by_well(
    dataset: Dataset, label: NDArray[np.int_], ends: NDArray[np.int_], told: tuple[str, str]
) -> tuple[NDArray[np.int_], list[str], list[style.Artist]]:
    """Areas of ends (labels, 1 + coordinates), a well and turns; what is told before each, and of others."""
    wells = np.flatnonzero(dataset["equilibrium_morse_index"].data == 0).tolist()
    numbers = [None if any(turns) else wells.index(well) for well, *turns in ends.tolist()]
    turned = {well for (well, *_), number in zip(ends.tolist(), numbers, strict=True) if number is None}

    def name_of(one: int) -> str:
        well, *turns = ends[one].tolist()
        alone = "" if any(turns) or well not in turned else ", no turn"
        return f"{told[0]}{basin_name(dataset, well, tuple(turns))}{alone}"

    return by_number(label, numbers, len(wells), name_of, told[1])


def by_number(
    label: NDArray[np.int_],
    numbers: Sequence[int | None],
    kept: int,
    name_of: Callable[[int], str],
    others: str,
) -> tuple[NDArray[np.int_], list[str], list[style.Artist]]:
    """Numbers of colours, -1 without a label; the colours; and what they mean, of smaller ones together.

    A label with a number has the colour of that number in every picture, and the first so many colours are
    kept for those; the largest of the labels without one have the colours that are left.
    """
    present, number = np.unique(label[label >= 0], return_counts=True)
    order = present[np.argsort(-number, kind="stable")].tolist()
    own, left = [numbers[one] for one in order], iter(COLORS[kept:])
    colors = [next(left, FURTHER) if k is None else [*COLORS, FURTHER][min(k, len(COLORS))] for k in own]
    picture, handles = np.full(label.shape, -1), list[Any]()
    for k, (one, color) in enumerate(zip(order, colors, strict=True)):
        picture[label == one] = k
        if color != FURTHER:
            handles.append(style.swatch(f"{name_of(one)}: {style.share(label == one)}", color))
    smaller = [one for one, color in zip(order, colors, strict=True) if color == FURTHER]
    if smaller:
        text = f"{others.format(len(smaller))}: {style.share(np.isin(label, smaller))}"
        handles.append(style.swatch(text, FURTHER))
    return picture, colors, handles


def _unlabelled(
    axes: style.Axes,
    x: Floats,
    y: Floats,
    status: NDArray[np.generic],
    codes: Codes,
    picture: NDArray[np.int_],
    colors: list[str],
) -> list[style.Artist]:
    """Give motions without a label their colours, few ones a mark each; returns the legend's entries."""
    handles = []
    for name, (color, marker, meaning) in unlabelled(codes).items():
        where, color = status == codes[name], style.on_paper(color)
        if where.any():
            picture[where] = len(colors)
            colors.append(color)
            text = f"{meaning}: {np.count_nonzero(where)} ({style.share(where)})"
            few = np.count_nonzero(where) <= FEW and np.mean(where) <= AREA
            if few:
                i, j = np.nonzero(where)
                axes.plot(x[i], y[j], marker, color=style.ink(), ms=4, ls="none", zorder=5.5)
            handles.append(mark(marker, text, "black") if few else style.swatch(text, color, style.ink()))
    return handles


def unlabelled(codes: Codes) -> dict[str, tuple[str, str, str]]:
    """Colour, marker and meaning of every status without a label, also of those that only the file knows."""
    others = codes.others({"captured", *UNLABELLED})
    return {**UNLABELLED, **{name: ("#b3a2c7", "P", name.replace("_", " ")) for name in others}}


def _times(view: Slice, name: str) -> style.Figure:
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm, Normalize

    figure, axes = style.new_panel(8.2, 7.0)
    times = np.asarray(view.data(name), dtype=np.float64)
    known = times[np.isfinite(times)]
    least = float(known.min())
    # Who is captured where it begins is noted at the first look.
    at_once = (times == least) & (np.count_nonzero(known == least) > 1)
    later = known[known > least] if at_once.any() else known
    low, high = (float(later.min()), float(later.max())) if later.size else (0.1, 1.0)
    norm = LogNorm(low, high) if high > 20.0 * low else Normalize(low, max(high, low * 1.01))
    # A start that has been computed and has no time is white, as an undecided one among the labels.
    computed, (title, untimed) = view.data("computed").astype(np.bool_), TIMES[name]
    skipped = ~computed & ~np.isfinite(times)
    without = [
        (f"already when first looked at, after {least:.2g} s", AT_ONCE, at_once),
        (untimed, "white", computed & ~np.isfinite(times)),
        ("not computed: filled in between equal labels", SKIPPED, skipped),
    ]
    axes.set_facecolor("white")
    x, y = view.axis(0), view.axis(1)
    style.paint(axes, x, y, np.where(skipped, 0.0, np.nan), [SKIPPED])
    colors = colormaps[style.FIELD].with_extremes(under=AT_ONCE)
    mesh = style.shade(axes, x, y, np.where(at_once, 0.5 * low, times), norm=norm, cmap=colors)
    below = "min" if at_once.any() else "neither"
    bar = figure.colorbar(mesh, ax=axes, label=f"{name.replace('_', ' ')} [s]", extend=below)
    if isinstance(norm, LogNorm):
        style.logarithmic(bar.ax.yaxis)
    handles = [
        style.swatch(f"{told}: {style.share(where)}", color, style.ink())
        for told, color, where in without
        if where.any()
    ]
    style.legend_below(figure, handles + decisive(axes, view))
    if computed.all():  # else those near boundaries are over-represented
        title += f"\nmedian {np.median(known):.3g} s, 99 % within {np.quantile(known, 0.99):.3g} s"
    axes.set_title(title)
    return figure


def describe(axes: style.Axes, view: Slice, parameters: Mapping[str, float]) -> None:
    """Labels with units, the decisive parameters, and what is held."""
    told = style.setting_of(view.dataset.attrs, parameters)
    at_rest = all(value == 0.0 for value in view.held.values()) and not set(view.coordinates) & set(view.held)
    units = {
        n: view.dataset[f"equilibrium_{n.removesuffix('_dot')}"].units + "/s" * n.endswith("_dot")
        for n in view.held
    }
    each = ", ".join(f"{style.symbol(n)} = {value:.4g}{spaced(units[n])}" for n, value in view.held.items())
    held = f"starts with {each}" if each else ""
    if at_rest and set(view.axes) == set(view.coordinates):
        held = "starts\xa0at\xa0rest"
    runs = f"runs\xa0to\xa0{view.dataset.attrs['t_end']:.4g}\xa0s" if "t_end" in view.dataset.attrs else ""
    style.title(axes, f"{axes.get_title()}\n{'; '.join(filter(None, (told, held, runs)))}")
    for axis, name in (("x", view.axes[0]), ("y", view.axes[1])):
        getattr(axes, f"set_{axis}label")(style.quantity(view.dataset, name, " at the start"))
    style.angle_ticks(axes, **{k: view.dataset[n].units for k, n in zip("xy", view.axes, strict=True)})
    axes.grid(visible=False)


#: Where the mechanism comes back to its well.
BACK = "#e6e6e6"


@style.style()
def draw_snapping(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, style.Figure]:
    """Picture of a dataset of the scan type ``snapping`` about the scene with these parameters."""
    figure, axes = style.new_panel(8.2, 6.6)
    style.legend_below(figure, draw_ends(axes, dataset.merged, scene))
    return {"map": figure}


def draw_ends(axes: style.Axes, dataset: Dataset, scene: Mapping[str, float]) -> list[style.Artist]:
    """Draw who ends where over force and decay rate; returns the legend's entries."""
    picture, colors, handles = _ends(dataset)
    x, y = np.exp(_edges(np.log(dataset["alpha"].data))), _edges(dataset["F0"].data)
    status, middles = dataset["status"], (dataset["alpha"].data, dataset["F0"].data)
    codes = status.codes
    handles += _unlabelled(axes, *middles, status.data, codes, picture=picture, colors=colors)
    style.paint(axes, x, y, picture, colors)
    axes.set_xscale("log")
    handles += _curves(axes, dataset)
    axes.set(xlim=x[[0, -1]], ylim=y[[0, -1]])
    style.logarithmic(axes.xaxis)
    axes.set_xlabel("rate α at which the force decays [1/s]")
    axes.set_ylabel("force F0 when it is switched on [N]")
    own = {name: value for name, value in scene.items() if name not in ("F0", "alpha")}
    about = "Where the mechanism ends that rests until F0 exp(-α\xa0t) is switched on"
    style.title(axes, f"{about}\n{style.setting_of(dataset.attrs, own)}")
    axes.grid(visible=False)
    return handles


def _ends(dataset: Dataset) -> tuple[NDArray[np.int_], list[str], list[style.Artist]]:
    """Numbers of colours over (alpha, F0), the colours, and what they mean; what stays comes first."""
    well, left = dataset["well"].data, dataset["left"].data.astype(np.bool_)
    ends = np.stack([well, dataset["turns_phi"].data, dataset["turns_theta"].data], axis=-1)
    gone, inverse = np.unique(ends[left], axis=0, return_inverse=True)
    label, back = np.full(well.shape, -1), (well >= 0) & ~left
    label[left] = inverse.ravel()
    told = ("leaves to ", "leaves elsewhere (ends: {})")
    picture, colors, handles = _by_well(dataset, label, gone, told)
    picture[back] = len(colors)
    first = style.swatch(f"comes back to its well: {style.share(back)}", BACK)
    return picture, [*colors, BACK], [first, *handles]


def _curves(axes: style.Axes, dataset: Dataset) -> list[style.Artist]:
    """The critical curve, and its limit for fast decay."""
    handles: list[style.Artist] = []
    if "critical_F0" not in dataset:
        return handles
    alpha, critical = dataset["alpha"].data, dataset["critical_F0"].data
    if np.isfinite(critical).any():
        line = axes.plot(alpha, critical, color=style.ink(), lw=1.6, marker="o", ms=2.5, zorder=5)
        line[0].set_label("smallest force that leaves")
        handles += line
    limit = float(dataset["critical_impulse"].data)
    if np.isfinite(limit):
        text = f"its limit for fast decay: F0/α = {limit:.4g} N s"
        handles += axes.plot(alpha, limit * alpha, color=style.ink(), lw=1.4, ls="--", zorder=5, label=text)
    return handles


def _edges(middles: Floats) -> Floats:
    """Edges of cells about evenly spaced middles."""
    half = 0.5 * (middles[1] - middles[0]) if middles.size > 1 else 0.5 * max(abs(float(middles[0])), 1e-3)
    return np.append(middles - half, middles[-1] + half)
