"""Equilibria on the potential's map, mechanisms drawn to scale, and eigenvalues in the complex plane."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.models.drawing import Drawing, Element, drawing
from fastmech.models.mechanism import Mechanism
from fastmech.plots import style
from fastmech.results import Dataset
from fastmech.scene import Scene
from fastmech.slider.equilibria import under_force
from fastmech.slider.lagrange import potential_energy

Points = NDArray[np.float64]

ROD, SPRING, DAMPER, FORCE = (
    style.PALETTE["black"],
    style.PALETTE["green"],
    style.PALETTE["purple"],
    style.PALETTE["vermillion"],
)
MASS, GROUND, INK = style.PALETTE["blue"], "#8c8c8c", "#404040"

#: Sizes over the extent of all that is drawn.
LARGEST_MASS, ARROW, COIL, HOUSING, MARGIN, TURNS = 0.035, 0.17, 0.014, 0.02, 0.12, 9

#: Where bars join springs and dampers between the same points, over the length.
JOINED = 0.12

#: Half the width of a letter, how far words stay from lines and other words, half the height of letters, and
#: the room that a tick's label takes [inch].
LETTER, APART, HALF, TICK = 0.042, 0.145, 0.078, 0.65

#: How much freer a place for words must be, over how much farther from its point it is.
NEAR = 0.2


def drawing_of(system: Scene | Mechanism | Dataset, q: ArrayLike = (), force: float = 0.0) -> Drawing:
    """What is drawn of a mechanism at positions (m, n), or what a section of a file holds.

    A scene's mechanism is the shipped one of its parameters under the constant ``force`` [N].
    """
    if isinstance(system, Dataset):
        ends = np.stack([system[f"element_{axis}"].data for axis in "xy"], axis=-1)
        names = tuple(map(str, system["element_name"].data))
        return Drawing(system["element_kind"].data, names, system["element_mass"].data, ends)
    if isinstance(system, Scene):
        from fastmech.mechanisms.slider_pendulum import slider_pendulum

        system = slider_pendulum().replace(**under_force(system, force).parameters)
    return drawing(system, q)


def draw_mechanism(axes: style.Axes, drawn: Drawing, which: int = 0) -> None:
    """Draw one of the positions of a mechanism.

    Lengths are to scale; masses have areas in proportion to them; an arrow has one length for every load.
    The axes cover all positions, so that drawings of one mechanism can be compared.
    """
    from matplotlib.patches import Circle

    size = extent(drawn)
    shown = drawn.ends[:, drawn.kind != Element.GUIDE].copy()
    loads = drawn.kind[drawn.kind != Element.GUIDE] == Element.LOAD
    shown[:, loads, 1] = shown[:, loads, 0] + ARROW * size * (shown[:, loads, 1] - shown[:, loads, 0])
    corners = shown.reshape(-1, 2)
    low, high = corners.min(axis=0), corners.max(axis=0)
    axes.set_aspect("equal")
    # A column, too, has room for its ticks.
    wanting = np.maximum(0.3 * size - 0.5 * (high - low), 0.0) + MARGIN * size
    low, high = low - wanting, high + wanting
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set(xlabel="x [m]", ylabel="y [m]")
    ends = drawn.ends[which]
    words = Words(axes, drawn, which)
    radii, beside = radii_of(drawn), _beside(drawn, which) * HOUSING * size
    lengths = np.linalg.norm(drawn.ends[:, :, 1] - drawn.ends[:, :, 0], axis=-1).max(axis=0)
    each = zip(drawn.kind, radii, ends, beside, lengths, strict=True)
    for kind, radius, (a, b), aside, longest in each:
        # Those that stand aside begin and end at bars, which join them to the points.
        inset = JOINED * (b - a) * aside.any()
        start, end = a + inset + aside, b - inset + aside
        for bar in ((a, a + inset, start), (b, b - inset, end)) if aside.any() else ():
            axes.plot(*np.transpose(bar), color=INK, lw=1.4, zorder=2)
        if kind == Element.GUIDE:
            axes.axline(tuple(a), tuple(b), color=GROUND, lw=0.9, ls=(0, (6, 3)), zorder=1)
        elif kind == Element.FIXED:
            axes.plot(*a, ls="none", marker="s", ms=7, color=GROUND, zorder=4)
        elif kind == Element.MASS:
            axes.add_patch(Circle(tuple(a), radius, color=MASS, zorder=5))
        elif kind == Element.LOAD:
            draw_force(words, a, a + ARROW * size * (b - a))
        elif kind == Element.ROD:
            axes.plot(*np.transpose([a, b]), color=ROD, lw=2.6, solid_capstyle="round", zorder=3)
        elif kind == Element.SPRING:
            axes.plot(*_zigzag(start, end, COIL * size, longest), color=SPRING, lw=1.4, zorder=3.5)
        elif kind == Element.DAMPER:
            _damper(axes, end, start, min(HOUSING * size, 0.3 * longest))
        elif kind in (Element.TORSION_SPRING, Element.TORSION_DAMPER):
            _torsion(axes, a, b, COIL * size, kind == Element.TORSION_SPRING)
    axes.locator_params(
        axis="x", nbins=max(2, int(np.ptp(axes.get_xlim()) * words.scale / words.inch / TICK))
    )
    name_points(words, drawn, which)


def draw_force(words: Words, start: Points, tip: Points, head: float = 14.0) -> None:
    """An arrow of which words stay away; ``head`` is the size of its head [points]."""
    look: Any = {"arrowstyle": "-|>", "color": FORCE, "lw": 2.4, "mutation_scale": head}
    look |= {"shrinkA": 0, "shrinkB": 0}
    words.axes.annotate("", xy=tuple(tip), xytext=tuple(start), arrowprops=look, zorder=6)
    words.keep(start, tip)


def _left(a: Points, b: Points) -> Points:
    """The unit vector to the left of the way from one point to another."""
    return np.array([a[1] - b[1], b[0] - a[0]]) / max(math.dist(a, b), 1e-12)


def _beside(drawn: Drawing, which: int) -> Points:
    """How far springs and dampers between the same points stand aside (elements, 2), in half housings."""
    tied = np.flatnonzero(np.isin(drawn.kind, (Element.SPRING, Element.DAMPER)))
    aside = np.zeros((drawn.kind.size, 2))
    for k in tied:
        a, b = sorted(drawn.ends[which, k], key=tuple)
        same = [j for j in tied if np.allclose(np.sort(drawn.ends[:, j], 1), np.sort(drawn.ends[:, k], 1))]
        aside[k] = 2.6 * (same.index(k) - 0.5 * (len(same) - 1)) * _left(a, b)
    return aside


def extent(drawn: Drawing) -> float:
    """The longer side of what all positions cover, without loads and guides [m]."""
    tied = ~np.isin(drawn.kind, (Element.GUIDE, Element.LOAD))
    corners = drawn.ends[:, tied].reshape(-1, 2)
    return max(float(np.ptp(corners, axis=0).max(initial=0.0)), 1e-12)


def radii_of(drawn: Drawing) -> Points:
    """Radii of the masses' circles [m] (elements,), NaN of others."""
    heaviest = float(np.nanmax(drawn.mass, initial=0.0)) or 1.0
    return np.asarray(LARGEST_MASS * extent(drawn) * np.sqrt(drawn.mass / heaviest))


class Words:
    """Words where neither lines nor other words are, and within the axes."""

    def __init__(self, axes: style.Axes, drawn: Drawing, which: int) -> None:
        self.axes = axes
        self.low, self.high = np.transpose([axes.get_xlim(), axes.get_ylim()])
        sides = np.array(axes.get_window_extent().size) / axes.figure.dpi
        self.scale = float(np.clip(sides.max() / 3.0, 0.7, 1.0))  #: smaller letters in small axes
        self.inch = self.scale * float(((self.high - self.low) / sides).max())  #: of the page [m]
        self._taken = list[Points]()
        ring = np.cos(np.linspace(0.0, 2.0 * np.pi, 24)[:, None] + [0.0, -0.5 * np.pi])
        radii = radii_of(drawn)
        for kind, (a, b), radius in zip(drawn.kind, drawn.ends[which], radii, strict=True):
            if kind == Element.GUIDE:
                far = float((self.high - self.low).sum()) * (b - a)
                self.keep(a - far, a + far, 401)
            elif kind in (Element.TORSION_SPRING, Element.TORSION_DAMPER):
                spring = kind == Element.TORSION_SPRING
                self._taken.append(_spiral(a, b, COIL * extent(drawn), spring))
            elif kind == Element.MASS:
                self._taken.append(a + radius * ring)
            elif kind != Element.LOAD:
                self.keep(a, b)

    def keep(self, a: Points, b: Points, points: int = 41) -> None:
        """Let no words stand on a line."""
        self._taken.append(a + np.linspace(0.0, 1.0, points)[:, None] * (b - a))

    def say(self, words: str, spots: list[tuple[float, float]], **look: Any) -> None:
        """Put words at one of some places [m] about a point: where nothing is, but not far from it."""
        half = LETTER * self.inch * len(re.sub(r"[\\${}_]", "", words))
        ways = np.array(spots)[:, None] + np.array([[-half, 0.0], [0.0, 0.0], [half, 0.0]])
        away = np.linalg.norm(ways[:, :, None] - np.concatenate([np.empty((0, 2)), *self._taken]), axis=-1)
        free = np.minimum(away.min(axis=(1, 2), initial=np.inf), APART * self.inch)
        free -= NEAR * np.linalg.norm(spots - np.mean(spots, axis=0), axis=1)
        up = np.array([0.0, HALF * self.inch])
        inside = (ways > self.low + up) & (ways < self.high - up)
        place = spots[int(np.argmax(np.where(inside.all(axis=(1, 2)), free, -np.inf)))]
        self._taken.append(ways[spots.index(place)])
        self.axes.annotate(words, place, ha="center", va="center", zorder=7, **look)


def name_points(words: Words, drawn: Drawing, which: int) -> None:
    """Names of points beside them: of fixed ones below if there is space, of others above."""
    turns = np.pi * np.array([0.25, 0.75, -0.25, -0.75, 0.5, 0.0, 1.0, -0.5])
    for kind, name, (place, _) in zip(drawn.kind, drawn.name, drawn.ends[which], strict=True):
        ways = np.stack([np.cos(turns), np.sin(turns)], axis=-1) * (1 if kind != Element.FIXED else -1)
        text = re.sub(r"^([A-Za-z])(\d+)$", r"$\1_{\2}$", name.replace("$", r"\$"))
        letters = len(re.sub(r"\W|_", "", text))
        far = np.array([1.0 + LETTER / APART * letters, 1.0]) * 1.3 * APART * words.inch
        far_off = [place + far * reach * way for reach in (1.0, 1.5, 2.0) for way in ways]
        spots = [(float(x), float(y)) for x, y in far_off]
        if name:
            colour = INK if kind == Element.FIXED else MASS
            words.say(text, spots, color=colour, fontsize=10.0 * words.scale)


def _torsion(axes: style.Axes, joint: Points, end: Points, size: float, spring: bool) -> None:
    """A spiral from a joint to a rod; of a damper an arc about the joint and a piston on the rod."""
    line = _spiral(joint, end, size, spring)
    if not spring:
        piston = joint + np.array([[5.0], [8.0]]) * size * (end - joint) / max(math.dist(end, joint), 1e-12)
        axes.plot(*piston.T, color=DAMPER, lw=4.0, zorder=4)
    axes.plot(*line.T, color=SPRING if spring else DAMPER, lw=1.3 if spring else 1.8, zorder=4)


def _spiral(joint: Points, end: Points, size: float, spring: bool) -> Points:
    """Points of the line of a torsion spring or damper (97, 2)."""
    way = np.arctan2(*(end - joint)[::-1])
    radius, turns = np.linspace(1.0, 4.5, 97) * size, way + np.linspace(-6.0, 0.0, 97) * np.pi
    if not spring:
        radius, turns = np.full(97, 6.5 * size), way + np.linspace(-1.0, 1.0, 97)
    return joint + radius[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=-1)


def _zigzag(start: Points, end: Points, width: float, longest: float) -> tuple[Points, Points]:
    """Coordinates of a spring's line between two points; of one that is always short few turns are seen."""
    turns = int(np.clip(longest / (3.0 * width), 2, TURNS))
    place = np.concatenate([[0.0], np.linspace(0.12, 0.88, 2 * turns + 1), [1.0]])
    side = np.zeros(place.size)
    side[2:-2] = np.where(np.arange(2 * turns - 1) % 2, -width, width)
    line = start + place[:, None] * (end - start) + side[:, None] * _left(start, end)
    return line[:, 0], line[:, 1]


def _damper(axes: style.Axes, start: Points, end: Points, half: float) -> None:
    """Piston rod from the start into a housing that is tied to the end."""
    along, across = end - start, half * _left(start, end)

    def line(width: float, *places: tuple[float, float]) -> None:
        where = np.array([start + s * along + t * across for s, t in places])
        axes.plot(*where.T, color=DAMPER, lw=width, zorder=2)

    line(1.6, (0.0, 0.0), (0.55, 0.0))
    line(2.6, (0.55, -0.8), (0.55, 0.8))
    line(1.6, (0.28, 1.0), (0.82, 1.0), (0.82, -1.0), (0.28, -1.0))
    line(1.6, (0.82, 0.0), (1.0, 0.0))


def legend_handles(drawn: Drawing, load: str = "load") -> list[Any]:
    """What a drawing's colours mean, for a legend; ``load`` says which one it is."""
    entries = {
        Element.ROD: style.entry("rod", color=ROD, lw=2.6),
        Element.MASS: style.entry("mass, its area in proportion", color=MASS, marker="o", ms=9, ls="none"),
        Element.SPRING: style.entry("spring", color=SPRING, lw=1.4),
        Element.DAMPER: style.entry("damper", color=DAMPER, lw=1.8),
        Element.LOAD: style.entry(load, color=FORCE, marker=">", lw=2.4),
        Element.FIXED: style.entry("fixed point", color=GROUND, marker="s", ls="none"),
        Element.GUIDE: style.entry("guide", color=GROUND, lw=1.2, ls="--"),
    }
    also = {Element.TORSION_SPRING: Element.SPRING, Element.TORSION_DAMPER: Element.DAMPER}
    there = {also.get(Element(kind), kind) for kind in drawn.kind}
    return [one for kind, one in entries.items() if kind in there]


MARKERS = {"minimum": "o", "saddle": "D", "maximum": "^", "degenerate": "X"}
#: Kinds by the sign of the stiffness matrix' determinant.
WITHOUT_POTENTIAL = {"positive": "no potential, det K > 0", "negative": "no potential, det K < 0"}
SHAPES = ["o", "s", "^", "D", "v", "P"]
#: Marks that are nearer than this share of what all of them span cover each other.
COVERED = 0.02
#: Points along each side of the potential, and positions that are drawn at most.
GRID, MOST = 241, 9
#: Half the number of colours, and between which shares of the energies a highest saddle has that half below.
SHADES, FLAT, DEEP = 12, 1e-6, 0.4


@style.style()
def draw_equilibria(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, style.Figure]:
    """Pictures of a dataset of the scan type ``equilibria`` of the scene with these parameters."""
    of_paper = "mechanism" not in dataset.attrs
    figures = picture_of_potential(dataset, Scene(**scene)) if of_paper else {}
    if dataset.sizes["equilibrium"]:
        figures["eigenvalues"] = _eigenvalues(dataset)
        told = style.setting_of(dataset.attrs, scene)
        if of_paper:
            force = float(dataset.attrs["force"])
            places = np.stack([dataset[n].data for n in style.coordinates_of(dataset)], axis=-1)
            drawn = drawing_of(Scene(**scene), places, force)
            told = _setting(Scene(**scene), force)
            figures["positions"] = _positions(dataset, drawn, told)
        elif "drawing" in dataset.groups:
            drawn = drawing_of(dataset.groups["drawing"])
            figures["positions"] = _positions(dataset, drawn, told)
        style.suptitle(figures["eigenvalues"], told)
    return figures


def over_potential(system: Scene | Mechanism) -> bool:
    """Whether it has a potential over one or two coordinates."""
    if isinstance(system, Scene):
        return True
    return len(system.coordinates) < 3 and "bounding" in system.derived.functions


@style.style()
def picture_of_potential(dataset: Dataset, system: Scene | Mechanism) -> dict[str, style.Figure]:
    """The potential over one or two coordinates, by the picture's name; nothing of what has none."""
    if not over_potential(system):
        return {}
    figure, axes = style.new_panel(7.4, 6.4)
    draw_potential(axes, dataset, system)
    if dataset.sizes["equilibrium"]:
        style.legend_below(figure, axes, 4)
    return {"potential": figure}


def draw_potential(axes: style.Axes, dataset: Dataset, system: Scene | Mechanism) -> None:
    """Draw the potential over one or two coordinates, with the equilibria; loads are at their means."""
    names, zoomed = style.coordinates_of(dataset), ""
    sides = [np.linspace(-np.pi, np.pi, GRID)] * 2
    if isinstance(system, Scene):
        force = float(dataset.attrs["force"])
        energy = potential_energy(system, np.stack(np.meshgrid(*sides), axis=-1), force)
        setting = _setting(system, force)
    else:
        sides = [_side(c, dataset[n].data) for c, n in zip(system.coordinates, names, strict=True)]
        cut = [
            f"{n} can go from {c.low:g} to {c.high:g} {dataset[n].units}"
            for n, c, side in zip(names, system.coordinates, sides, strict=True)
            if np.ptp(side) < c.high - c.low
        ]
        zoomed = f" near them\n({', '.join(cut)})" if cut else ""
        q = np.array([side.ravel() for side in np.meshgrid(*sides)])
        energy = system.evaluate("bounding", np.concatenate([q, np.zeros_like(q)]))[0]
        energy = energy.reshape(-1, sides[0].size)
        setting = style.setting(system)
    if len(names) == 1:
        axes.plot(sides[0], energy[0])
        axes.margins(x=0.04, y=0.1)
        axes.set_ylabel("potential energy [J]")
    else:
        passes = np.unique(dataset["energy"].data[dataset["morse_index"].data == 1])
        levels, ticks, norm = _shades(energy, float(passes.max(initial=-np.inf)))
        filled = axes.contourf(*sides, energy, levels, cmap=style.FIELD, norm=norm)
        axes.contour(*sides, energy, filled.levels, colors=style.paper(), linewidths=0.4, alpha=0.6)
        if passes.size:  # where wells are shallow, no even level shows them
            axes.contour(*sides, energy, levels=passes, colors=style.ink(), linewidths=0.9)
            axes.plot([], [], color=style.ink(), lw=0.9, label="level of a saddle")
        label = "potential energy [J]" + ", finer below the highest saddle" * (norm is not None)
        bar = axes.figure.colorbar(filled, ax=axes, label=label, ticks=ticks)
        bar.minorticks_off()
        for level in passes:
            bar.ax.axhline(level, color=style.ink(), lw=0.9)
        axes.set_ylabel(style.quantity(dataset, names[1]))
        axes.grid(visible=False)
    mark_kinds(axes, dataset, [*names, "energy"][:2])
    style.angle_ticks(axes, x=dataset[names[0]].units, y=dataset[[*names, "energy"][1]].units)
    axes.set_xlabel(style.quantity(dataset, names[0]))
    style.title(axes, f"Equilibria and potential{zoomed}\n{setting}")


def _shades(energy: Points, top: float) -> tuple[Any, Any, Any]:
    """Levels, ticks and norm of the colours: half of them below the highest saddle if most lies above it."""
    from matplotlib.colors import BoundaryNorm
    from matplotlib.ticker import MaxNLocator

    low, high = float(energy.min()), float(energy.max())
    if not FLAT * (high - low) < top - low < DEEP * (high - low):
        return 2 * SHADES, MaxNLocator(8, steps=[1, 2, 5, 10]), None
    levels = np.concatenate([np.linspace(low, top, SHADES + 1), np.linspace(top, high, SHADES + 1)[1:]])
    nice = MaxNLocator(5, steps=[1, 2, 5, 10])
    # On the bar each half takes as much room.
    lower, upper = np.array(nice.tick_values(low, top)), np.array(nice.tick_values(top, high))
    upper = upper[(upper > top + 0.1 * (high - top)) & (upper <= high)]
    return levels, [*lower[(lower >= low) & (lower <= top)], *upper], BoundaryNorm(levels, 256)


def _side(coordinate: Any, places: Points) -> Points:
    """Values of a coordinate over a full turn, or about its places as far as its range goes."""
    low, high = coordinate.low, coordinate.high
    reach = float(np.ptp(places)) if places.size else 0.0
    if not coordinate.periodic and reach > 1e-6 * (high - low):
        low = max(low, float(places.min()) - 0.5 * reach)
        high = min(high, float(places.max()) + 0.5 * reach)
    return np.linspace(low, high, GRID)


def _setting(scene: Scene, force: float) -> str:
    """For titles: a force that is frozen at a time holds as a constant one."""
    shown = under_force(scene, force) if force else scene
    return style.setting_of({}, shown.parameters, decayed=not force)


def mark_kinds(axes: style.Axes, dataset: Dataset, names: Sequence[str]) -> None:
    """Mark equilibria by their kind in the plane of two variables, with their numbers."""
    codes = dataset["kind"].codes
    for kind, marker in {**dict.fromkeys(codes.others(MARKERS), "P"), **MARKERS}.items():
        of_kind = dataset["kind"].data == codes[kind]
        if of_kind.any():
            place = [dataset[name].data[of_kind] for name in names]
            look: Any = {"color": style.paper(), "mec": style.ink(), "mew": 1.4, "ms": 10}
            axes.plot(*place, marker, label=WITHOUT_POTENTIAL.get(kind, kind), **look)
    for number, (x, y) in enumerate(zip(*(dataset[name].data for name in names), strict=True)):
        # Towards the middle, so that none leaves the picture.
        offset = (0.0, -15.0 if y > np.mean(axes.get_ylim()) else 15.0)
        look = {"textcoords": "offset points", "ha": "center", "va": "center", "bbox": style.box(0.15, 0.85)}
        axes.annotate(str(number), (x, y), offset, **look)


def _eigenvalues(dataset: Dataset) -> style.Figure:
    figure, axes = style.new_panel(7.2, 5.4)
    ranks = [name.rpartition("_")[2] for name in dataset if name.startswith("eigenvalue_re_")]
    parts = [[dataset[f"eigenvalue_{part}_{k}"].data for k in ranks] for part in ("re", "im")]
    values = np.array(parts).transpose(2, 0, 1)
    near = COVERED * np.maximum(np.ptp(values, axis=(0, 2)), 1e-12)
    handles, covered = [], False
    for i, name in enumerate(style.equilibrium_names(dataset)):
        away = np.abs(values[i][None, :, :, None] - values[i + 1 :, :, None, :])
        # Rings about those that lie on top.
        above = (away < near[:, None, None]).all(axis=1).any(axis=2).sum(axis=0)
        own, shape, covered = style.color(i), SHAPES[i % len(SHAPES)], covered or bool(above.any())
        for rings in np.unique(above):
            look: Any = {"color": own, "mec": style.paper(), "ms": 8}
            if rings:
                look = {"mec": own, "mew": 1.6, "mfc": "none", "ms": min(8 + 5 * rings, 28)}
            axes.plot(*values[i][:, above == rings], shape, **look)
        handles.append(style.entry(name, color=own, marker=shape, ms=8, ls="none"))
    if covered:
        handles.append(style.entry("hollow: under another's mark", marker="o", mfc="none", ms=12, ls="none"))
    left, right = axes.get_xlim()
    axes.set_xlim(min(left, -0.1 * right), max(right, -0.1 * left))
    axes.axvline(0.0, color=style.ink(), lw=1.0, zorder=1.0)
    axes.axvspan(0.0, axes.get_xlim()[1], color=style.ink(), alpha=0.07, lw=0)
    axes.text(0.99, 0.98, "growing", transform=axes.transAxes, ha="right", va="top", color="#404040")
    axes.text(0.01, 0.98, "decaying", transform=axes.transAxes, ha="left", va="top", color="#404040")
    axes.set(xlabel="real part [1/s]", ylabel="imaginary part [rad/s]")
    axes.set_title("Eigenvalues of the linearized motion")
    axes.margins(y=0.12)
    style.legend_below(figure, handles, 2)
    return figure


def _positions(dataset: Dataset, drawn: Drawing, setting: str) -> style.Figure:
    names = style.equilibrium_names(dataset)
    shown = names[:MOST]
    columns = min(2 if len(shown) <= 6 else 3, len(shown))
    rows = -(-len(shown) // columns)
    figure = style.new_figure(5.4 if columns == 1 else 9.6, (3.9 if columns < 3 else 3.5) * rows + 0.6)
    told = f"The first {MOST} of {len(names)} positions" if len(names) > MOST else "Positions"
    style.suptitle(figure, f"{told} of rest, {setting}")
    panels = figure.subplots(rows, columns, squeeze=False)
    for axes in panels.flat[len(shown) :]:
        axes.remove()
    for i, name in enumerate(shown):
        axes = panels.flat[i]
        draw_mechanism(axes, drawn, i)
        verdict, kind = (dataset[of].meaning(i) for of in ("verdict", "kind"))
        if i + columns < len(shown):  # another one is below
            axes.set_xlabel("")
            axes.tick_params(labelbottom=False)
        if i % columns:
            axes.set_ylabel("")
            axes.tick_params(labelleft=False)
        style.title(axes, f"{name}\n{verdict} ({kind})", 12 - columns)
    style.legend_below(figure, legend_handles(drawn), 4)
    return figure
