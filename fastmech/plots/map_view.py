"""What is drawn of an equilibrium map: two of its axes, not too many points, values by depth, its curves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Flags, Floats
from fastmech.plots import style
from fastmech.results import Dataset, Variable
from fastmech.store.read import Section

#: Points of an axis that are drawn at most; of longer ones every n-th is read.
MOST_DRAWN = 1000

#: Variables over the equilibria that pictures show; the others stay in the file.
DRAWN = ("energy", "morse_index", "verdict", "sheet", "depth", "shock_limit_m2", "decay_time")

#: Verdicts of what stays: asymptotically stable, stable.
STABLE = (0, 1)

#: Relative difference of energies that rounding may cause.
ROUNDING = 1e-10


@dataclass(frozen=True)
class View:
    """What is drawn of a map: one or two axes, any further one held at the index nearest to the scene."""

    dataset: Dataset
    scene: Mapping[str, float]
    axes: tuple[str, ...]
    held: Mapping[str, int]

    @property
    def at(self) -> tuple[int | slice, ...]:
        """Index of what is drawn."""
        return tuple(self.held.get(name, slice(None)) for name in self.dataset.attrs["axes"])

    @property
    def setting(self) -> str:
        """For titles: what differs from the defaults and is not on the axes, and what is left out."""
        own = {name: value for name, value in self.scene.items() if name not in self.axes}
        own |= {name: float(self.axis(name)[i]) for name, i in self.held.items()}
        left_out = str(self.dataset.attrs.get("drawn", ""))
        return style.setting_of(self.dataset.attrs, own, decayed=True) + left_out

    def data(self, name: str) -> NDArray[np.generic]:
        """A variable over the axes drawn."""
        return np.asarray(self.dataset[name].data[self.at])

    def floats(self, name: str) -> Floats:
        """A variable over the axes drawn, as floats."""
        return np.asarray(self.data(name), dtype=np.float64)

    def axis(self, name: str) -> Floats:
        """Values along an axis."""
        return np.asarray(self.variable(name).data, dtype=np.float64)

    def variable(self, name: str) -> Variable:
        """A variable of the map or of a group in it."""
        among = [self.dataset, *self.dataset.groups.values()]
        return next((one for one in among if name in one), self.dataset)[name]

    def where(self, name: str) -> dict[str, Flags]:
        """Which entries of a variable have which meaning; nothing of one that the map has not."""
        if not self.has(name):
            return {}
        variable = self.variable(name)
        return {meaning: variable.data == code for meaning, code in variable.codes.items()}

    def label(self, name: str) -> str:
        """Name and unit of an axis."""
        return style.with_unit(name, self.dataset[name].units)

    @property
    def own_name(self) -> str:
        """What the own point is, for legends."""
        return "present values" if "mechanism" in self.dataset.attrs else "the scene"

    def own(self) -> tuple[float, ...] | None:
        """The scene's own point, if the picture shows it."""
        if any(self.axis(name)[i] != self.scene[name] for name, i in self.held.items()):
            return None
        point = tuple(self.scene[name] for name in self.axes)
        inside = all(
            self.axis(name).min() <= value <= self.axis(name).max()
            for name, value in zip(self.axes, point, strict=True)
        )
        return point if inside else None

    def stable(self, rank: int, values: NDArray[np.generic]) -> Floats:
        """Of values over the equilibria, that of the stable one of this rank (0: deepest), NaN if none."""
        stable = self.data("morse_index") == 0
        if "mechanism" in self.dataset.attrs:  # there may be no potential
            stable = np.isin(self.data("verdict"), STABLE)
        energy = np.where(stable, np.nan_to_num(self.floats("energy")), np.inf)
        # Mirror images are equally deep but for rounding: their places order them, so that maps are smooth.
        deepest = energy.min(axis=-1, keepdims=True)
        tied = energy <= deepest + ROUNDING * np.abs(deepest)
        order = np.lexsort(
            (self.data(style.coordinates_of(self.dataset)[0]), np.where(tied, deepest, energy)), axis=-1
        )
        chosen = (np.argsort(order, axis=-1) == rank) & np.isfinite(energy)
        return np.where(chosen.any(axis=-1), np.where(chosen, values, 0.0).sum(axis=-1), np.nan)

    @property
    def ranks(self) -> range:
        """Of stable equilibria, the deepest first, at most three."""
        return range(min(3, int(self.data("count_stable").max())))

    def has(self, *names: str) -> bool:
        """Whether the map kept these variables, or a group in it has them."""
        among = [self.dataset, *self.dataset.groups.values()]
        return all(any(name in one for one in among) for name in names)


def free_axes(names: tuple[str, ...], sizes: Mapping[str, int]) -> tuple[str, ...]:
    """The first two axes that vary."""
    return tuple(name for name in names if sizes[name] > 1)[:2] or names[:1]


def make_view(dataset: Dataset, scene: Mapping[str, float]) -> View:
    """The first two axes that vary; the others are held where the scene is."""
    names = tuple(dataset.attrs["axes"])
    free = free_axes(names, dataset.sizes)
    held = {
        name: int(np.argmin(np.abs(dataset[name].data - scene[name]))) for name in names if name not in free
    }
    return View(dataset, scene, free, held)


def load_drawn(section: Section, scene: Mapping[str, float]) -> Dataset:
    """What pictures show of a map's section, read without the rest of it ever being in memory.

    Of two axes with more than ``MOST_DRAWN`` values every n-th is taken, of a third axis the one held.
    """
    names = tuple(section.attrs["axes"])
    free = free_axes(names, section.sizes)
    part, left_out = {}, ""
    for name in names:
        if name not in free:
            k = int(np.argmin(np.abs(section[name].data - scene[name])))
            part[name] = slice(k, k + 1)
        elif len(free) == 2 and section.sizes[name] > MOST_DRAWN:
            step = -(-section.sizes[name] // MOST_DRAWN)
            part[name] = slice(None, None, step)
            left_out += f"; 1 in {step} values of {name}"
    shown = {*DRAWN, *style.coordinates_of(section)}
    wanted = [name for name in section if name in shown or "root" not in section.dims(name)]
    dataset = section.load(wanted, part)
    attrs = {**dataset.attrs, **({"drawn": left_out} if left_out else {})}
    groups = {name: group.load() for name, group in section.groups.items()}
    return Dataset(dataset.variables, attrs, groups)


#: How fold curves look, by their kind and what merges with a saddle.
FOLDS = {
    ("fold", "minimum"): ("black", "-", 1.8, "fold: a resting position disappears"),
    ("fold", "maximum"): ("#555555", "--", 1.2, "fold of unstable equilibria"),
    ("pitchfork", "minimum"): ("black", (0, (6, 1, 1, 1)), 1.8, "pitchfork (symmetric) of resting positions"),
    ("pitchfork", "maximum"): ("#555555", (0, (1, 1)), 1.4, "pitchfork (symmetric) of unstable equilibria"),
}

#: How vanishing-damping curves look, by what vanishes.
UNDAMPED = {
    "sin_phi": (style.PALETTE["vermillion"], "-", "damping misses a mode: sin φ = 0"),
    "sin_phi_theta": (style.PALETTE["vermillion"], "--", "damping misses a mode: sin(φ+θ) = 0"),
    "unloaded_rod": (style.PALETTE["vermillion"], ":", "damping misses a mode: rod M1M2 unloaded"),
}


def draw_curves(axes: style.Axes, view: View) -> list[style.Artist]:
    """Draw what the map has of curves; returns one handle a legend entry."""
    undamped = "unreached" if view.has("unreached_curve") else "undamped"  # as older files say
    if len(view.dataset.attrs["axes"]) != 2 or not (view.has("fold_curve") or view.has(f"{undamped}_curve")):
        return []
    handles: list[style.Artist] = []
    merges, kinds = view.where("fold_merges"), view.where("fold_kind")
    # Files of older versions tell no kind; those of others may know kinds that this one does not.
    shown = [(kind, name) for kind in kinds or ["fold"] for name in merges]
    for kind, name in [one for one in FOLDS if one in shown] + [one for one in shown if one not in FOLDS]:
        look = FOLDS.get((kind, name), ("#777777", "-.", 1.2, f"{kind}: {name}"))
        handles += _line(axes, view, "fold", merges[name] & kinds.get(kind, np.True_), look)
    for name, chosen in view.where(f"{undamped}_vanishes").items():
        color, dash, label = UNDAMPED.get(name, ("#777777", "-.", f"damping misses a mode: {name}"))
        handles += _line(axes, view, undamped, chosen, (color, dash, 1.4, label))
    cusp = [f"cusp_{name}" for name in view.axes]
    if view.has(*cusp) and view.axis(cusp[0]).size:
        handles += axes.plot(
            *map(view.axis, cusp), "D", color=style.paper(), mec=style.ink(), ms=5.5, ls="none", label="cusp"
        )
    if not all(name in view.dataset for name in view.axes):
        return handles
    for axis, name in zip("xy", view.axes, strict=True):
        values = view.axis(name)
        margin = 0.5 * float(np.ptp(values)) / max(1, values.size - 1)
        axes.set(**{f"{axis}lim": (values.min() - margin, values.max() + margin)})
    return handles


def not_proved(view: View) -> str:
    """What to add where folds may be missing; the file tells why."""
    proof = str(view.variable("fold_proof").data[0]) if view.has("fold_proof") else "complete"
    return "" if proof == "complete" else "; not proved that these are all folds"


def _line(
    axes: style.Axes, view: View, what: str, chosen: Flags, look: tuple[str, Any, float, str]
) -> list[style.Artist]:
    """Some of the curves in one look, each one with a point more that breaks the line."""
    from matplotlib.patheffects import Normal, Stroke

    points = np.flatnonzero(chosen)
    if not points.size:
        return []
    color, dash, width, label = look
    ends = np.flatnonzero(np.diff(view.variable(f"{what}_curve").data[points], append=-1)) + 1
    lines = [np.insert(view.axis(f"{what}_{name}")[points], ends, np.nan) for name in view.axes]
    effects = [Stroke(linewidth=width + 1.6, foreground=style.paper(), alpha=0.9), Normal()]
    return list(
        axes.plot(*lines, color=style.on_paper(color), ls=dash, lw=width, label=label, path_effects=effects)
    )
