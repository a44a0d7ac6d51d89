"""One device on a few pages: where it rests, what ends that, what it survives, and how sure that is.

Sensitivities are closed forms. Of a position of rest q with forces f(q, p) = 0 the implicit function theorem
gives dq/dp = -f_q^-1 f_p; of an eigenvalue l of the motion about it, with P(l) = l^2 M + l D + K, left and
right vectors w and v, dl/dp = -w.P'v / w.(2 l M + D)v with P' along that change; of a value c at which a
position ends, where w f_q = 0, dc/dp = -w.f_p / w.f_c. Ends that are no fold, as on the kink of a stop, are
searched again at both ends of each tolerance, and differ by that. What has neither is asked of an ensemble.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg
import scipy.optimize
from numpy.typing import NDArray
from scipy.stats import qmc

from fastmech.arrays import Floats
from fastmech.atlas.snap import LOAD_UNITS, Snap, ending_parameters, find_snap
from fastmech.attractors.flow import keeps_moving
from fastmech.basins.disturbed import disturb, return_quantile, told_energy, usual_radius
from fastmech.basins.erosion import wells_along
from fastmech.basins.label import STEPS as AT_MOST
from fastmech.basins.label import advice, capture_end, label_starts
from fastmech.basins.map import map_basins
from fastmech.basins.measures.fractions import basin_stability
from fastmech.basins.shock_limit import Blow, proved_limit, shock_limit
from fastmech.capture.select import certificate_of
from fastmech.disturbance.motion import require_constant_force
from fastmech.ensembles import checks
from fastmech.errors import InputError, shown
from fastmech.models.equilibria import find_equilibria
from fastmech.models.mechanism import Mechanism, short_way
from fastmech.models.stability import classify
from fastmech.objects import coordinate_units, spaced
from fastmech.plots import style
from fastmech.plots.basins import draw_basins
from fastmech.plots.equilibria import MOST, draw_equilibria, picture_of_potential
from fastmech.plots.erosion import draw_stability
from fastmech.reports import Stage, no_stage, plain, table, to_html, to_pdf
from fastmech.results import Dataset, Variable
from fastmech.scan_types.map_layout import drawing_group
from fastmech.scan_types.request import device_of
from fastmech.scene import Scene, nearest, path_of
from fastmech.slider.atlas.snap import MOVING
from fastmech.slider.impulse import POINTS
from fastmech.store.provenance import history_line

#: Points along each axis of the map, starts of the shares, of each load and of each member of the ensemble,
#: loads along which wells erode, disturbances, and members.
MAP, STARTS, ERODED, FEW, LOADS, DISTURBANCES, MEMBERS = 121, 4096, 512, 256, 11, 1024, 64

#: Rate [1/s] up to which motions of one coordinate are started whose wells have no end.
FAST = 5.0

#: Loads just before and beyond a snap load, by the share of the way there.
NEAR = (0.98, 1.02)

#: Decay slower than this [1/s] is none; smaller changes, or smaller parts of a value, are rounding.
LEAST, ROUNDED = 1e-12, 1e-9

#: By what part of it a change may differ from first order; in how many steps at least changes are followed,
#: and the shortest of them.
LINEAR, STEPS, SHORTEST = 0.1, 20, 1e-4

#: An answer with some parameters at other values; None: it is not there any more.
Solve = Callable[[Mapping[str, float]], float | None]

#: What kinds of positions mean where no potential tells them.
WITHOUT_POTENTIAL = (
    "Kind: forces have no potential, so it is the sign of the stiffness matrix' determinant. Negative is "
    "unstable, positive may be stable."
)

#: Why nothing that follows motions to where they rest can be told of a device.
REPEATS = "its load repeats, so nothing comes to rest; fm.find_attractors finds what motions settle on"


def report(
    system: Scene | Mechanism,
    path: str | Path,
    *,
    title: str | None = None,
    tolerances: Mapping[str, float] | None = None,
    threads: int | None = None,
    stage: Stage = no_stage,
) -> tuple[Path, Path]:
    """Write what an engineer hands over about a device: one HTML page, which needs no other file, and a PDF.

    Args:
        system: a scene (a force that decays has done so) or a mechanism (loads are at their means).
        path: of the page, ending in ``.html``; the PDF lies beside it.
        title: of the page, by default "Report on" and the device's name.
        tolerances: half widths of the uniform distributions of parameters, by name, in the parameters' units.
        threads: threads to use, all processors by default.
        stage: makes a progress bar for the parts.

    Returns:
        the paths of the page and of the PDF.

    Raises:
        InputError: the system is neither, a tolerance is unknown or does not fit, or the files cannot be
            written.
    """
    if not isinstance(system, Scene | Mechanism):
        raise InputError(f"system = {shown(system)}: must be a Scene or a Mechanism")
    if path_of(path).suffix not in ("", ".html"):
        raise InputError(f"path = {shown(str(path))}: must end in .html; the PDF lies beside the page")
    if not isinstance(title, str | None):
        raise InputError(f"title = {shown(title)}: must be a text")
    target = path_of(path).with_suffix(".html")
    made = _Report(system, _checked(system, {} if tolerances is None else tolerances), threads)
    made.title = title or made.title
    lines: list[str] = []
    parts = {
        "": made.device,
        "Positions of rest": made.rests,
        "Where positions end (snap loads)": made.snaps,
        "Shocks it survives": made.shocks,
        "Basins": made.basins,
        "Disturbances": made.disturbances,
        "Erosion over the load": made.erosion,
        "Tolerances": made.tolerances,
        "How each number was obtained": made.proofs,
        "To repeat this": made.repeat,
    }
    for number, (heading, part) in enumerate(parts.items(), 1):
        advance = stage(f"report, part {number} of {len(parts)}: {heading or 'The device'}", 1)
        lines += [f"## {heading}", ""] if heading else []
        try:
            with style.values_alone():
                lines += part()
        except InputError as error:  # what this device has not is said in its place
            made.without.add(part.__name__)
            lines += [f"Not for this device: {plain(str(error))}.", ""]
        advance(1)
    text = "\n".join(lines)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        pictures = {f"{name}.png": style.png(figure) for name, figure in made.figures.items()}
        target.write_text(to_html(text, made.title, pictures), encoding="utf-8")
        to_pdf(text, made.figures, target.with_suffix(".pdf"))
    except OSError as error:
        raise InputError(f"{target}: cannot be written: {error.strerror}") from None
    return target, target.with_suffix(".pdf")


def _checked(system: Scene | Mechanism, tolerances: Mapping[str, float]) -> dict[str, float]:
    known = system.described()
    for name, half in checks.mapping("tolerances", tolerances, "half-widths").items():
        if name not in known:
            raise InputError(f"tolerances.{name}: unknown parameter; {nearest(name, known)}")
        if isinstance(half, bool) or not isinstance(half, int | float) or not 0.0 < half < math.inf:
            raise InputError(f"tolerances.{name} = {shown(half)}: must be a number > 0 {known[name][1]}")
        value, unit, _ = known[name]
        if isinstance(system, Mechanism) and 0.0 < value < half and unit not in (*LOAD_UNITS, "rad"):
            raise InputError(
                f"tolerances.{name} = {shown(half)}: plus_minus must be less than the value, "
                f"{value:g}{spaced(unit)}"
            )
        for end in (value - half, value + half):
            try:
                system.replace(**{name: end})
            except InputError as error:
                raise InputError(f"tolerances.{name} = {shown(half)}: plus_minus reaches {error}") from None
    return {name: float(half) for name, half in tolerances.items()}


class _Report:
    """The parts of a report, and what they share."""

    def __init__(self, given: Scene | Mechanism, tolerances: dict[str, float], threads: int | None) -> None:
        self.given, self.plus_minus, self.threads = given, tolerances, threads
        self.figures: dict[str, style.Figure] = {}
        self.without = set[str]()  #: parts that are not for this device
        self.of_paper = isinstance(given, Scene)
        self.decays = isinstance(given, Scene) and given.alpha > 0.0
        self.system: Any = given.replace(F0=0.0, alpha=0.0) if self.decays else given
        self.load = "after the force has decayed" if self.decays else "under its constant load"
        to_come = sum(sum(load.to_come(0.0)) for load in getattr(given, "loads", ()))
        if to_come > 0.0:
            self.load = f"under {'what its load comes to' if to_come < math.inf else 'the mean of its load'}"
        self.title = "Report on a slider and pendulum"
        if isinstance(given, Mechanism):
            self.title = f"Report on {given.name}"
        self.default = self.title
        self.known = given.described()
        self.units = coordinate_units(self.system)
        self.found: Any = find_equilibria(self.system)
        self.wells = [k for k, kind in enumerate(self.found.kind) if kind == "minimum"]
        self.stability = [classify(self.system, e) for e in self.found]
        verdicts = [one.verdict for one in self.stability]
        self.stable = [k for k, v in enumerate(verdicts) if v in ("stable", "asymptotically stable")]
        self.snapped: dict[tuple[int, str], Snap] = {}

    def require_rest(self) -> None:
        """Refuse what never comes to rest, before any motion is followed."""
        if keeps_moving(self.given):
            raise InputError(REPEATS)

    def require_stable(self) -> None:
        """Refuse what has nothing that could end."""
        if not self.stable:
            raise InputError("it rests nowhere stably")

    @cached_property
    def bounded(self) -> list[int]:
        """Stable positions whose barrier may be higher than the energy that is proved."""
        tree = certificate_of(self.system).tree
        return [k for k in self.stable if k in tree.wells and tree.bounded(k)]

    def name(self, k: int) -> str:
        """Number of a position, and of its well on the map where that is another."""
        of_well = self.wells.index(k) if k in self.wells else k
        return f"{k}" if of_well == k else f"{k} (well {of_well})"

    def device(self) -> list[str]:
        """Parameters, and the device to scale where it rests."""
        half = {name: f"± {value:g}" for name, value in self.plus_minus.items()}
        rows = (
            f"{name} | {value:g} | {half.get(name, '')} | {spaced(unit).strip()}"
            + f" | {about}" * self.of_paper
            for name, (value, unit, about) in self.known.items()
        )
        stable = f"{len(self.stable)} of them stable" if self.found else ""
        positions = f"{len(self.found)} position{'s' * (len(self.found) != 1)}"
        if not self.found.certificate.complete:
            positions = f"At least {positions}"
        lines = [
            f"# {plain(self.title)}", "",
            f"{positions} of rest {self.load}, {stable}. "
            f"Made by: {plain(history_line())}. Units are SI, angles in rad.", "",
            "## The device", "",
            *table("Parameter | Value | Tolerance | Unit" + " | Meaning" * self.of_paper, rows, (0, 2, 3, 4)),
        ]  # fmt: skip
        if isinstance(self.given, Mechanism):
            definition = (map(plain, row) for row in self.given.definition())
            lines += table("What | Definition", definition, (0, 1))
        dataset = self.found.dataset()
        groups = {} if self.of_paper else drawing_group(self.system, self.found.position)
        shown = style.with_units(Dataset(dataset.variables, dataset.attrs, groups), self.system)
        drawn = draw_equilibria(shown, self.system.parameters)
        drawn |= {} if self.of_paper else picture_of_potential(dataset, self.system)
        for name, caption in (
            ("positions", f"The device to scale where it rests, in at most {MOST} positions."),
            ("potential", "Potential energy over the coordinates; numbers are those of the positions."),
        ):
            if name in drawn:
                lines += self.picture(name, drawn[name], caption)
        return lines

    def picture(self, name: str, figure: style.Figure, caption: str) -> list[str]:
        """Lines that show a figure."""
        self.figures[name] = figure
        return [f"![{caption}]({name}.png)", "", caption, ""]

    def rests(self) -> list[str]:
        """Positions with stability and decay times."""
        rows = []
        for k, (e, s) in enumerate(zip(self.found, self.stability, strict=True)):
            place = ", ".join(
                f"{style.symbol(n)}\xa0=\xa0{x:z.6f}\xa0{u}"  # stays in one line
                for (n, u), x in zip(self.units.items(), e.position, strict=True)
            )
            slowest, swing = -float(s.eigenvalues.real.max()), float(np.abs(s.eigenvalues.imag).max())
            decay = "" if k not in self.stable else f"{1.0 / slowest:.4g}" if slowest > LEAST else "does not"
            fastest = f"{swing:.4g}" if swing > 0.0 else ""
            energy = "-" if math.isnan(e.energy) else f"{round(e.energy, 9) + 0.0:.6g}"
            told = f"{energy} | {e.kind} | {s.verdict} | {decay} | {fastest}"
            rows.append(f"{self.name(k)} | {place} | {told} | {e.radius:.1g}")
        heads = "No. | Where | Energy [J] | Kind | Stability | Decay to 1/e [s] | Fastest swing [rad/s]"
        units = " or ".join(dict.fromkeys(self.units.values()))
        return [
            *table(f"{heads} | Proved to within [{units}]", rows, (0, 1, 3, 4)),
            *[WITHOUT_POTENTIAL, ""] * any(e.morse_index is None for e in self.found),
            f"Proof: {self.found.certificate.sentence}.", "",
            *(f"- Position {self.name(k)}: {self.stability[k].explanation}." for k in self.stable), "",
        ]  # fmt: skip

    def snaps(self) -> list[str]:
        """Values of every parameter at which each stable position ends."""
        self.require_stable()
        rows, notes = [], []
        for k in self.stable:
            lasts = []
            for name in MOVING if self.of_paper else ending_parameters(self.system):
                snap = self.snap(k, name)
                if snap is None:
                    continue
                self.snapped[k, name] = snap
                beyond = " and never beyond" if snap.exhaustive else ""
                low, high = (f"{end:.4g}" for end in snap.searched)
                if snap.below is None and snap.above is None:
                    lasts.append(f"{name} from {low} to {high}{spaced(snap.unit)}{beyond}")
                    continue
                spans = f"down to {low}", f"up to {high}"
                ends = [
                    f"not {to}{beyond}" if v is None else f"{v:.6g} ({how})"
                    for v, how, to in zip((snap.below, snap.above), snap.how, spans, strict=True)
                ]
                margin = min(abs(v - snap.value) for v in (snap.below, snap.above) if v is not None)
                own = f"{spaced(snap.unit).strip()} | {snap.value:g}"
                rows.append(f"{self.name(k)} | {name} | {own} | {ends[0]} | {ends[1]} | {margin:.4g}")
            if lasts:
                notes.append(
                    f"- Position {self.name(k)} does not end as one of these changes: {'; '.join(lasts)}."
                )
        if not rows and not notes:
            raise InputError("it has no parameter that moves a stable position")
        heads = "Position | Parameter | Unit | Present | Ends below | Ends above | Margin"
        return [
            "One parameter changes slowly, all others are as in the table of the device. A position ends "
            "where it merges with an unstable one and disappears (a fold, also on a kink of the forces, as "
            "of a stop), where it turns unstable, begins to flutter, or leaves its range. At a pitchfork "
            "another stable position may go on from the same place: then nothing snaps, and that position is "
            "followed. `fm.critical_values` finds these.", "",
            *(table(heads, rows, (0, 1, 2, 4, 5)) if rows else []),
            *notes, "",
        ]  # fmt: skip

    def snap(self, k: int, name: str) -> Snap | None:
        """Where a position ends as a parameter changes; None: it does not move it, or cannot change."""
        try:
            return find_snap(self.system, self.found[k], parameter=name)
        except InputError:
            return None

    def blows(self, system: Any, place: Any) -> dict[str, Blow]:
        """The proved limit of every point that can be struck."""
        found = {}
        for on in POINTS if self.of_paper else system.points:
            with suppress(InputError):  # a point in space, or a well that is not certain
                found[on] = proved_limit(system, place, on)
        return {on: blow for on, blow in found.items() if math.isfinite(blow.impulse)}

    def shocks(self) -> list[str]:
        """Blows that each stable position survives; searched is the point with the least proved limit."""
        self.require_rest()
        require_constant_force(self.system)
        certificate_of(self.system)
        rows, notes, others = [], [], ""
        for k in self.bounded:
            notes.append(
                f"- Position {self.name(k)}: its barrier is at least the energy that is used (to an end of a "
                "range, or what is not decided); harder blows than the proved one may stay in the well."
            )
        for k in self.stable:
            proved = self.blows(self.system, self.found[k])
            weakest = min(proved, key=lambda on: proved[on].impulse, default=None)
            for on, blow in proved.items():
                least = ""
                if on == weakest:
                    limit = shock_limit(self.system, self.found[k], on, threads=self.threads)
                    weak = limit.found
                    sense = "-" if math.isnan(weak.impulse) else f"{math.degrees(weak.direction):.1f}°"
                    least = f"{_told(weak)} | {sense}"
                    if math.isfinite(limit.undecided_from):
                        notes.append(
                            f"- Position {self.name(k)}: of some blows on {plain(on)}, the least of them "
                            f"{limit.undecided_from:.4g} N s, it is not known where they lead."
                        )
                else:
                    call = f"fm.shock_limit(device, fm.find_equilibria(device)[{k}], on={on!r})"
                    others = (
                        f"A blow on a point that was not searched may leave at less: {plain(call)} tells."
                    )
                angle = f"{math.degrees(blow.direction):.1f}°"
                told = f"{plain(on)} | {angle} | {_told(blow)} | {least or 'not searched | - | - | -'}"
                rows.append(f"{self.name(k)} | {told}")
        self.require_stable()
        if not rows:
            raise InputError("no blow on a named point of a plane moves it")
        heads = (
            "Position | On | Weakest | Proved [N s] | [m/s] | [J] | Found there [N s] | [m/s] | [J] | "
            "Direction"
        )
        return [
            "A blow on a point of the resting device. It leaves the well if the motion ends in another one, "
            "in the same one full turns away, or beyond a range. Proved: no blow below this leaves the well, "
            "whatever its direction and whatever the damper. Weakest: the direction in which the proved "
            "limit is least, measured from +x, in either sense. m/s: by how much the point's velocity "
            "changes at once. "
            "Found: the least blow that was seen to leave, and its direction (-: none was); harder ones may "
            "stay. It was searched in all directions on the point with the least proved limit. "
            f"{others}", "",
            *table(heads, rows, (0, 1)),
            *notes, "",
        ]  # fmt: skip

    @cached_property
    def window(self) -> dict[str, tuple[float, float]]:
        """From where motions are started at rest: a turn or an angle's range, about positions of lengths."""
        spans = {}
        for j, (name, unit) in enumerate(self.units.items()):
            low, high = -math.pi, math.pi
            if not self.system.turning[j]:
                low, high = map(float, self.system.ranges[j])
            if unit == "m" or math.inf in (-low, high):
                places = self.found.position[:, j]
                room = 0.5 * float(np.ptp(places)) + 0.1 * float(np.abs(places).max()) + 0.1
                low, high = max(low, float(places.min()) - room), min(high, float(places.max()) + room)
            spans[name] = (low, high)
        return spans

    def nearest(self, found: Any, q: Floats) -> int:
        """Which of some positions is the nearest to a place, whole turns apart."""
        return int(np.linalg.norm(short_way(found.position - q, self.system.turning), axis=1).argmin())

    def starts(self, n: int) -> Floats:
        """Starts at rest (n, states), evenly spread over the window."""
        low, high = np.array(list(self.window.values())).T
        points = qmc.scale(qmc.Sobol(low.size, seed=0).random(n), low, high)
        return np.concatenate([points, np.zeros_like(points)], axis=1)

    def basins(self) -> list[str]:
        """Shares of starts that end in each stable position, and a map."""
        self.require_rest()
        labels = label_starts(self.system, self.starts(STARTS), threads=self.threads)
        ends = [f"{n:,} {status.replace('_', ' ')}" for status, n in labels.counts.items() if n]
        rows = []
        for k in self.stable:
            share = basin_stability(labels, k)
            rows.append(
                f"{self.name(k)} | {share.fraction:.2%} | {share.lower:.2%} to {share.upper:.2%} | "
                f"{share.at_most:.2%}"
            )
        span = "; ".join(
            f"{style.symbol(n)} from {a:.4g} to {b:.4g} {self.units[n]}" for n, (a, b) in self.window.items()
        )
        lines = [
            f"{STARTS:,} starts at rest, spread over {span}, followed until their end is proved, at most "
            f"{labels.t_end:.4g} s: {', '.join(ends)}{advice(labels)}.", "",
            *table("Position | Share | 95 % interval | If all undecided ended there", rows),
        ]  # fmt: skip
        names = [*self.units][:2]
        axes = {n: np.linspace(*self.window[n], MAP) for n in names}
        if len(names) == 1:
            axes[f"{names[0]}_dot"] = np.linspace(-self.reach, self.reach, MAP)
        found = map_basins(self.system, axes, threads=self.threads)
        caption = (
            f"Where starts of the map end; {MAP} x {MAP} points. A well has the number of its position, "
            "or the one in brackets in the tables. Of one well, copies full turns away have colours of their "
            "own; of several, each has one. Shares are in the legend."
        )
        dataset = style.with_units(found.dataset().merged, self.system)
        figures = draw_basins(dataset, self.system.parameters, None if self.of_paper else self.system)
        return lines + self.picture("basins", figures.get("wells", figures["labels"]), caption)

    @cached_property
    def reach(self) -> float:
        """Twice the greatest rate with which the bottom of a well is left, of one coordinate."""
        tree, rates = certificate_of(self.system).tree, list[float]()
        for well, barrier in zip(tree.wells, tree.barrier, strict=True):
            place = tree.equilibria[well]
            kinetic, _ = self.system.energies(np.append(place.position, 1.0))
            rates.append(math.sqrt((barrier - place.energy) / kinetic))
        return 2.0 * max((rate for rate in rates if rate < math.inf), default=FAST)

    def disturbances(self) -> list[str]:
        """How soon disturbed motions are back."""
        self.require_rest()
        self.require_stable()
        rows, notes, most = [], [], AT_MOST * certificate_of(self.system).slow_step
        for k in self.stable:
            of = partial(disturb, self.system, self.found[k], DISTURBANCES, threads=self.threads)
            found = of()
            while return_quantile(found, 1.0) > found.t_end < min(found.enough, most) < math.inf:
                found = of(t_end=min(max(found.enough, 2.0 * found.t_end), most))
            in_time = f"{np.isfinite(found.time_to_return).mean():.2%}"
            median, share = return_quantile(found, 0.5), found.returned
            back = f"{found.t_end:.4g} | {in_time} | {f'{median:.4g}' if median < math.inf else 'later'}"
            known = found.excursion[np.isfinite(found.excursion).all(axis=1)].max(axis=0, initial=0.0)
            if isinstance(self.system, Mechanism) and (beyond := self.system.outside(found.starts).sum()):
                notes.append(
                    f"{beyond:,} of those of position {self.name(k)} begin beyond the range of a coordinate."
                )
            if energy := told_energy(self.system, self.found[k], usual_radius(self.system, self.found[k])):
                notes.append(f"Those of position {self.name(k)} are given up to {energy}.")
            far = ", ".join(f"{x:.3g} {unit}" for x, unit in zip(known, self.units.values(), strict=True))
            interval = f"{share.lower:.2%} to {share.upper:.2%}"
            rows.append(
                f"{self.name(k)} | {share.fraction:.2%} | {share.at_most:.2%} | {interval} | {back} | "
                f"{far} | {found.dt.min():.3g}"
            )
        unit = [*self.units.values()][-1]
        sizes = {self.name(k): f"{usual_radius(self.system, self.found[k]):.3g} {unit}" for k in self.stable}
        told = ", ".join(f"{size} for position {k}" for k, size in sizes.items())
        if len({*sizes.values()}) == 1:
            told = min(sizes.values())
        if isinstance(self.system, Mechanism) and "m" in self.units.values():
            told += " (0.5, or the largest size at which none begins beyond a range)"
        heads = (
            "Position | Return, proved | At most | 95 % interval | Followed for [s] | Back by then | "
            "Back after, median [s]"
        )
        return [
            f"{DISTURBANCES:,} random disturbances of coordinates and rates of each stable position, up to "
            f"{told} in the norm of the kinetic energy. A motion returns when it ends in the position's well "
            "without a full turn. It is back when it is within 2 % of that size, or half the distance to the "
            "next position if that is less, in the same norm, and cannot leave that ball. Slow swings are "
            f"followed until all that return are back, for at most {AT_MOST:,.0f} of the coarsest steps. "
            "At most: if those whose end is not known returned too.", "", *notes, *[""] * bool(notes),
            *table(f"{heads} | Largest swing | Step [s]", rows, (0, 7)),
        ]  # fmt: skip

    def erosion(self) -> list[str]:
        """Shares of the starts over the load, between its snap loads."""
        self.require_rest()
        loads = [n for n, (_, unit, _) in self.known.items() if unit in LOAD_UNITS]
        name = next((n for n in loads if any((k, n) in self.snapped for k in self.stable)), None)
        if name is None:
            raise InputError("no parameter is a load that ends a position")
        snaps = [s for (_, n), s in self.snapped.items() if n == name]
        told = [end for s in snaps for end in zip((s.below, s.above), s.how, strict=True)]
        ends = sorted({v for v, how in told if v is not None and how != "leaves its range"})
        value, unit = self.system.described()[name][:2]
        reach = 1.1 * max([abs(v - value) for v in ends] or [abs(value) or 1.0])
        near = [value + share * (v - value) for v in ends for share in NEAR]
        loads_tried = np.union1d(np.linspace(value - reach, value + reach, LOADS), near)
        _, places = wells_along(self.system, name, loads_tried)
        # Those of the present load come first, in the order of the positions.
        present = places[np.abs(loads_tried - value).argmin()]
        now = [self.nearest(self.found, q) if np.isfinite(q).all() else math.inf for q in present]
        places = places[:, np.argsort(now, kind="stable")]
        names = [f"position {self.name(int(k))}" for k in sorted(now) if k < math.inf]
        names += [f"a well of other loads, {chr(ord('A') + k)}" for k in range(len(now) - len(names))]
        measured = np.full((4, *places.shape[:2]), np.nan)
        until, left = capture_end(certificate_of(self.system)), np.full(len(loads_tried), np.nan)
        for i, load in enumerate(loads_tried):
            changed = self.system.replace(**{name: float(load)})
            found = find_equilibria(changed)
            with suppress(InputError):  # too near to where one ends: its well is not certain
                ends_there = label_starts(changed, self.starts(ERODED), until, threads=self.threads)
                left[i] = ends_there.counts.get("out_of_range", 0) / ERODED
                for w in np.flatnonzero(np.isfinite(places[i]).all(axis=1)):
                    own = basin_stability(ends_there, self.nearest(found, places[i, w]))
                    measured[:, i, w] = own.fraction, own.lower, own.upper, own.missing / own.n
        variables = {name: Variable((name,), loads_tried, unit, self.known[name][2])}
        for n, of in zip(("stability", "lower", "upper", "undecided"), measured, strict=True):
            variables[f"well_{n}"] = Variable((name, "well"), of)
        if lost := np.nanmax(left, initial=0.0):
            variables["out_of_range"] = Variable((name,), left)
        with style.style():
            figure, axes = style.new_panel(7.2, 5.2)
            handles = draw_stability(axes, Dataset(variables, {"along": name, "well_names": names}))
            axes.axvline(value, color="black", lw=1.0, ls="-.")
            handles.append(style.entry("present load", lw=1.0, ls="-."))
            for end in ends:
                axes.axvline(end, color="black", lw=1.0, ls="--")
            handles += [
                style.entry("snap load: where a position of the present load ends", lw=1.0, ls="--")
            ] * bool(ends)
            style.legend_below(figure, handles)
            style.title(axes, f"{axes.get_title()}\n{style.setting(self.system, [name])}")
        caption = f"Share of {ERODED} starts at rest that end in each well as {name} changes. "
        caption += "A position has its number in the tables; others are no positions of the present load."
        most = np.nanmax(measured[3], initial=0.0)
        caption += f" Up to {most:.1%} are undecided: not lost, each well may have them." * bool(most)
        caption += f" Up to {lost:.1%} leave their range and end in none." * bool(lost)
        return self.picture("erosion", figure, caption)

    def tolerances(self) -> list[str]:
        """How the answers vary with the parameters."""
        if not self.plus_minus:
            return [
                "No tolerances were given. To give one, write for example "
                f"`{next(iter(self.known), 'k')} = {{ value = 1.0, plus_minus = 0.1 }}` in the table "
                "`[scene]` of the request, or `tolerances=` in Python.",
                "",
            ]
        self.require_stable()
        gone = ("F0", "alpha") if self.decays else ()
        names = [name for name in self.plus_minus if name not in gone]
        half = np.array([self.plus_minus[name] for name in names])
        slopes = Sensitivities(self.system, names)
        ends = [(name, sign) for name in names for sign in (-1.0, 1.0)]
        changed_ends = cache(partial(self.changed_ends, slopes))
        members = self._members(names, half)
        rows: list[str] = []
        columns: dict[str, list[float]] = {}

        def answer(what: str, unit: str, value: float, row: Floats | None, solve: Solve) -> None:
            """A row: the answer, solved again at both ends of each tolerance, and of first order."""
            rounded = max(ROUNDED * abs(value), LEAST)
            present = self.system.parameters
            there = [solve({n: present[n] + sign * self.plus_minus[n]}) for n, sign in ends]
            if row is None:
                known = np.array([math.nan if x is None else x for x in there])
                change = 0.5 * (known[1::2] - known[::2])
            else:
                change = row * half
            by = np.where(np.abs(change) <= rounded, 0.0, change)
            first = [sign * float(by[names.index(name)]) for name, sign in ends]
            each = " | ".join("gone" if x is None else f"{_no_less(x):.6g}" for x in there)
            linear = all(
                x is not None and abs(x - value - change) <= LINEAR * abs(change) + 1e3 * rounded
                for x, change in zip(there, first, strict=True)
            )
            deviation, worst = math.sqrt(float((by**2).sum() / 3.0)), float(np.abs(by).sum())
            of_first = f"{deviation:.3g} | {worst:.3g}" if linear else "not linear | not linear"
            rows.append(f"{what} | {_no_less(value):.6g} | {spaced(unit).strip()} | {each} | {of_first}")
            if not linear:
                found = (solve(member) for member in members)
                columns[f"{what} [{unit}]"] = [x for x in found if x is not None]

        def end(k: int, name: str, side: int, values: Mapping[str, float]) -> float | None:
            """Where a position ends below or above; no end of a parameter changes by what that one is."""
            return changed_ends(k, name, tuple((n, v) for n, v in values.items() if n != name))[side]

        for k in self.stable:
            q = self.found[k].position
            for j, ((n, unit), value, row) in enumerate(
                zip(self.units.items(), q, slopes.position(q), strict=True)
            ):
                what = f"{self.name(k)}: {style.symbol(n)}"
                answer(what, unit, value, row, partial(slopes.coordinate, j, q))
            root, change = slopes.slowest(q)
            what = f"{self.name(k)}: decay rate of the slowest mode"
            answer(what, "1/s", -root.real, -change.real, partial(slopes.decay_rate, q))
        for (k, name), snap in self.snapped.items():
            for side, value in enumerate((snap.below, snap.above)):
                if value is None or names == [name]:
                    continue
                disappears = snap.how[side] == "disappears"
                fold = slopes.fold(name, value, self.found[k].position) if disappears else None
                row = None if fold is None else slopes.end(name, fold)
                what = f"{self.name(k)}: ends {('below', 'above')[side]} at {name}"
                what += " (by differences)" * (row is None)
                answer(what, snap.unit, value, row, partial(end, k, name, side))
        told = ", ".join(
            f"{n} = {self.known[n][0]:g} ± {d:g} {self.known[n][1]}" for n, d in zip(names, half, strict=True)
        )
        heads = " | ".join(f"at {n} = {self.known[n][0] + sign * self.plus_minus[n]:g}" for n, sign in ends)
        return [
            f"Parameters are uniform and independent: {told}. Each answer is solved again at both ends of "
            "each tolerance, the other parameters as they are; where a position ends is searched again. "
            "Deviation and worst are of first order: the standard deviation of all changes together, and all "
            "at the ends that add up. First order is in closed form. By differences: it is half of what lies "
            "between both ends of a tolerance, as where a position ends on a kink or leaves its range. "
            f"Not linear: an end differs from first order by more than {LINEAR:.0%} of the change; then the "
            "next table has its distribution. Gone: the position, or this end of it, is not there.", "",
            *table(f"Answer | Value | Unit | {heads} | Deviation | Worst, first order", rows, (0, 2)),
            *self._ensemble(members, columns),
        ]  # fmt: skip

    def changed_ends(
        self, slopes: Sensitivities, k: int, name: str, others: tuple[tuple[str, float], ...]
    ) -> tuple[float | None, float | None]:
        """Where a position ends below and above as one parameter changes, with others at other values.

        It is searched anew: the fold of the given device may meet another one on the way, or come second.
        """
        snap, values = self.snapped[k, name], dict(others)
        present = ends = snap.below, snap.above
        place = slopes.moved(self.found[k].position, values) if others else None
        if place is None:
            return (None, None) if others else present
        # Most ends move little: searched first, in less time, is twice as far as the present ones.
        far = (snap.value if end is None else 2.0 * end - snap.value for end in present)
        low, high = (min(max(end, snap.searched[0]), snap.searched[1]) for end in far)
        for searched in ((low, high), None):
            ends = None, None
            with suppress(InputError):  # the position is not stable there, or the range is none of the device
                found = find_snap(self.system.replace(**values), place, searched, parameter=name)
                ends = found.below, found.above
            if all(was is None or now is not None for was, now in zip(present, ends, strict=True)):
                break
        return ends

    def _members(self, names: list[str], half: Floats) -> list[dict[str, float]]:
        """Parameters of devices, drawn from their distributions."""
        drawn = qmc.Sobol(len(names), seed=1).random(MEMBERS) * 2.0 - 1.0
        present = self.system.parameters
        return [
            {m: present[m] + float(r * d) for m, r, d in zip(names, row, half, strict=True)} for row in drawn
        ]

    def _ensemble(self, members: list[dict[str, float]], columns: dict[str, list[float]]) -> Iterator[str]:
        """Distributions over the members of what has no closed form, and of the answers given."""
        repeats, lost, without = keeps_moving(self.given), 0, ""
        for member in [] if repeats else members:
            changed = self.system.replace(**member)
            places = find_equilibria(changed)
            try:
                ends = label_starts(changed, self.starts(FEW), threads=self.threads)
            except InputError as error:
                ends, without = None, str(error)
            for k in self.stable:
                j = self.nearest(places, self.found[k].position)
                if places[j].morse_index != self.found[k].morse_index:
                    lost += 1
                    continue
                for on, blow in self.blows(changed, places[j]).items():
                    name = f"{self.name(k)}: proved blow on {plain(on)} [N s]"
                    columns.setdefault(name, []).append(blow.impulse)
                if ends is not None:
                    share = basin_stability(ends, j)
                    for what, part in (("", share.fraction), (", undecided ones too", share.at_most)):
                        name = f"{self.name(k)}: share of {FEW} starts{what} [%]"
                        columns.setdefault(name, []).append(100.0 * float(part))
        told = {"Least": 0.0, "5 %": 0.05, "Median": 0.5, "95 %": 0.95, "Largest": 1.0}
        rows = [
            [what, *(f"{q:.4g}" for q in np.quantile(found, list(told.values()))), len(found)]
            for what, found in columns.items()
            if found
        ]
        yield f"Over {len(members)} devices with parameters drawn from these distributions:"
        yield ""
        if rows:
            yield from table(["Answer", *told, "Devices that have it"], rows)
        if repeats:
            yield f"Blows and shares: not for this device: {REPEATS}."
        else:
            if without and not any("share of" in what for what in columns):
                yield f"Shares: not for this device: {plain(without)}."
            gone = f"In {lost} cases a stable position had disappeared."
            yield gone if lost else "Every stable position exists in all of them."
        yield ""

    def proofs(self) -> list[str]:
        """Step and error of every number, and what proves it."""
        closed, steps = self.of_paper, "halved until two runs agree"
        barrier = "energy below the lowest saddle of the well"
        if "shocks" not in self.without and self.bounded:
            names = " and ".join(map(self.name, self.bounded))
            barrier = f"energy below the barrier; that of position {names} is at least so high"
        with suppress(InputError):  # no well is certain, or nothing damps: then nothing was labelled
            coarse = certificate_of(self.system).coarse_steps(self.starts(STARTS))
            ends = dict.fromkeys(f"{end:.2g}" for end in (coarse.min(), coarse.max()))
            steps = f"{' to '.join(ends)} s, by the start's energy; {steps}"
        proof = "potential's Hessian, then eigenvalues"
        if any(e.morse_index is None for e in self.found):
            proof = "real parts of the eigenvalues"
        rows = {
            "positions of rest | no steps | radius in the table | "
            + (
                "counting theorem and interval balls" if closed else "branch and prune over interval boxes"
            ): "",
            f"stability | no steps | eigenvalues to rounding | {proof}": "",
            "snap loads | continuation | 1e-9 relative | the position is followed to where it ends": "snaps",
            f"proved blows | no steps | rounding | {barrier}": "shocks",
            "blows found | as for shares, by energy | last grid's spacing | none: weaker may leave": "shocks",
            f"shares, map | {steps} | none in labels; the share's interval | "
            "capture: energy below the barrier, inside the well": "basins",
            "erosion | the same, by each load's energies | the same | the same": "erosion",
            "disturbances | in the table | compared with half the step | as for shares": "disturbances",
        }
        if self.plus_minus:
            proof = "Newton's method; ends as snap loads"
            rows[f"tolerances | no steps | rounding; first order where it says so | {proof}"] = "tolerances"
        told = (row for row, part in rows.items() if part not in self.without)
        return [*table("Number | Step | Error | Proof", told, (0, 1, 2, 3))]

    def repeat(self) -> list[str]:
        """The request that gives the same pages."""
        own = False
        head = [f"title = {json.dumps(self.title, ensure_ascii=False)}"] if self.title != self.default else []
        if isinstance(self.given, Mechanism):
            try:
                own = device_of({"mechanism": self.given.name}).prints != self.given.prints
            except InputError:
                own = True
            head += [f'mechanism = "{self.given.name}"'] if not own else []
        how = " --mechanism FILE.py:NAME` with the file that defines the mechanism" if own else "`"
        values = [
            f"{n} = {{ value = {v!r}, plus_minus = {self.plus_minus[n]!r} }}"
            if n in self.plus_minus
            else f"{n} = {v!r}"
            for n, (v, *_) in self.known.items()
        ]
        lines = [*head, "[scene]", *values]
        return [
            f"Save the following as `device.toml` and run `fastmech report device.toml{how}:", "",
            *(f"    {line}" for line in lines), "",
        ]  # fmt: skip


def _no_less(value: float) -> float:
    """Without what is rounding of zero."""
    return value if abs(value) > LEAST else 0.0


def _told(blow: Any) -> str:
    return " | ".join(
        "-" if math.isnan(x) else f"{x:.4g}" for x in (blow.impulse, abs(blow.velocity), blow.energy)
    )


class Sensitivities:
    """Derivatives by parameters of positions of rest, of the motion about them, and of where they end.

    Args:
        system: with its loads at rest.
        names: of the parameters.
    """

    def __init__(self, system: Scene | Mechanism, names: list[str]) -> None:
        import sympy

        from fastmech.models.expansion import slope_of

        if isinstance(system, Scene):
            from fastmech.mechanisms.slider_pendulum import slider_pendulum

            system = slider_pendulum().replace(**system.parameters)
        self.mechanism, self.names = system, names
        statics = system.statics()
        self.all = [str(symbol) for symbol in statics.parameters]
        q, p = [c.symbol for c in statics.coordinates], list(statics.parameters)
        forces = sympy.Matrix(statics.forces)
        by_place, by_parameter = (
            sympy.Matrix([[slope_of(force, x) for x in those] for force in forces]) for those in (q, p)
        )
        made = [sympy.lambdify([*q, *p], m, "numpy") for m in (forces, by_place, by_parameter)]
        self._forces, self._by_place, self._by_parameter = made

    def _at(self, function: Callable[..., Any], q: Floats, changes: Mapping[str, float] = {}) -> Floats:
        values = {**self.mechanism.parameters, **changes}
        return np.asarray(function(*q, *(values[name] for name in self.all)), dtype=np.float64)

    def position(self, q: Floats) -> Floats:
        """Of coordinates by parameters (coordinates, names)."""
        columns = [self.all.index(name) for name in self.names]
        by = self._at(self._by_parameter, q)[:, columns]
        return np.asarray(-np.linalg.solve(self._at(self._by_place, q), by))

    def moved(self, q: Floats, values: Mapping[str, float]) -> Floats | None:
        """A position with some parameters at other values; None: it ends on the way there."""
        sign = np.sign(np.linalg.det(self._at(self._by_place, q)))

        def solve(q: Floats, at: Mapping[str, float]) -> Floats | None:
            last = math.inf
            while True:  # each change at most half the one before: Deuflhard, Newton Methods, section 5.1
                slopes = self._at(self._by_place, q, at)
                change = np.linalg.lstsq(slopes, self._at(self._forces, q, at).ravel(), rcond=None)[0]
                size, q = float(np.abs(change).max()), q - change
                if size <= 1e-12 * max(1.0, float(np.abs(q).max())):
                    kept = np.sign(np.linalg.det(self._at(self._by_place, q, at))) == sign
                    return q if kept else None
                if not size <= 0.5 * last:
                    return None
                last = size

        present, share, step = self.mechanism.parameters, 0.0, 1.0 / STEPS
        while share < 1.0:
            ahead = min(share + step, 1.0)
            found = solve(q, {n: present[n] + ahead * (value - present[n]) for n, value in values.items()})
            if found is not None:
                q, share, step = found, ahead, min(2.0 * step, 1.0 / STEPS)
            elif step < SHORTEST:
                return None
            else:
                step *= 0.5
        return q

    def coordinate(self, j: int, q: Floats, values: Mapping[str, float]) -> float | None:
        """Coordinate ``j`` of the moved position."""
        moved = self.moved(q, values)
        return None if moved is None else float(moved[j])

    def decay_rate(self, q: Floats, values: Mapping[str, float]) -> float | None:
        """Of the slowest mode about the moved position [1/s]."""
        moved = self.moved(q, values)
        return None if moved is None else -float(self._modes(moved, values)[0].real.max())

    def _modes(self, q: Floats, values: Mapping[str, float] = {}) -> tuple[Any, Any, Any]:
        """Eigenvalues and vectors of the motion about a position, and its matrices."""
        n = len(q)
        linear = self.mechanism.linear(q, values)
        zero, one = np.zeros((n, n)), np.eye(n)
        left = np.block([[zero, one], [-linear.stiffness, -linear.damping]])
        roots, vectors = scipy.linalg.eig(left, np.block([[one, zero], [zero, linear.mass]]))
        return roots, vectors, linear

    def slowest(self, q: Floats) -> tuple[complex, NDArray[np.complex128]]:
        """The eigenvalue of the largest real part, and its derivatives by parameters (names,)."""
        n, along = len(q), self.position(q)
        roots, vectors, (M, D, K) = self._modes(q)
        k = int(np.argmax(roots.real))
        root, v = roots[k], vectors[:n, k]
        w = np.linalg.svd(root**2 * M + root * D + K)[0][:, -1].conj()
        change = []
        for j, name in enumerate(self.names):
            value = self.mechanism.parameters[name]
            h = 1e-5 * max(abs(value), 1e-3)
            ends = [
                self.mechanism.linear(q + s * h * along[:, j], {name: value + s * h}) for s in (1.0, -1.0)
            ]
            m, d, c = ((np.asarray(a) - np.asarray(b)) / (2.0 * h) for a, b in zip(*ends, strict=True))
            change.append(-(w @ (root**2 * m + root * d + c) @ v) / (w @ (2.0 * root * M + D) @ v))
        return complex(root), np.array(change)

    def fold(self, name: str, value: float, q: Floats) -> Floats | None:
        """Where a position disappears near a parameter's value: place, direction, value; None: not found."""
        present = self.mechanism.parameters[name]
        for share in np.linspace(0.0, 1.0 - 1e-6, 41)[1:]:  # along the branch, by Newton's method
            at = {name: present + (value - present) * float(share)}
            for _ in range(8):
                slopes, forces = self._at(self._by_place, q, at), self._at(self._forces, q, at)
                q = q - np.linalg.lstsq(slopes, forces.ravel(), rcond=None)[0]
        null = np.linalg.svd(self._at(self._by_place, q, {name: value}))[2][-1]
        n = q.size

        def equations(z: Floats) -> Floats:
            at, v = {name: float(z[-1])}, z[n : 2 * n]
            forces, K = self._at(self._forces, z[:n], at).ravel(), self._at(self._by_place, z[:n], at)
            return np.concatenate([forces, K @ v, [v @ v - 1.0]])

        found = scipy.optimize.root(equations, np.concatenate([q, null, [value]]), method="lm")
        # Of a single coordinate the stiffness itself is zero here: changes beside the root measure.
        aside = np.diag(1e-7 * np.maximum(np.abs(found.x), 1.0))
        beside = [np.abs(equations(found.x + step) - found.fun)[: 2 * n].max() for step in aside]
        near = abs(found.x[-1] - value) <= 1e-6 * max(abs(value), 1.0)
        return found.x if near and np.abs(found.fun).max() <= max(beside) else None

    def end(self, name: str, fold: Floats) -> Floats | None:
        """Of a parameter's value at a fold, by parameters (names,); None: that parameter does not move it."""
        n, at = fold.size // 2, {name: float(fold[-1])}
        w = np.linalg.svd(self._at(self._by_place, fold[:n], at))[0][:, -1]
        by = w @ self._at(self._by_parameter, fold[:n], at)
        own = by[self.all.index(name)]
        each = np.array([0.0 if other == name else -by[self.all.index(other)] / own for other in self.names])
        return each if abs(own) > 1e-9 * np.abs(by).max() else None
