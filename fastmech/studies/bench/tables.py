"""The benchmark as Markdown and as a picture: speed at equal error first, then all that was measured."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fastmech.plots.style import LINES, new_figure, save, style
from fastmech.studies.bench.machine import Cost, Throughput
from fastmech.studies.bench.measure import PROBLEMS, TARGETS, BenchProblem, Row, fastest_at, frontier, rate_at
from fastmech.studies.reporting import section

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Errors [rad, rad/s] that the picture shows: larger ones answer nothing.
LARGEST, SMALLEST = 3e-2, 3e-15

#: Names of methods on the curve keep this ratio of errors between them.
APART = 20.0

#: Curves: what the family's name begins with, its label, marker; in the order of the colours.
CURVES = (
    ("fastmech", "fastmech, best method", "o"),
    ("heyoka", "heyoka batch", "s"),
    ("torch", "torch.compile, best step", "D"),
    ("CyRK", "CyRK", "^"),
    ("numbalsoda", "numbalsoda", "v"),
    ("diffrax", "diffrax", "P"),
    ("Numba RK4", "plain Numba RK4", "X"),
    ("SciPy", "SciPy, best solver", "*"),
)


def draw_bench(rows: list[Row], path: Path) -> None:
    """The fastest settings of every library on one thread; the package's own methods thin behind."""
    with style():
        figure = new_figure(11.0, 6.2)
        panels = figure.subplots(1, len(PROBLEMS), sharey=True, squeeze=False)[0]
        named: dict[str, Any] = {}
        for axes, (name, make) in zip(panels, PROBLEMS.items(), strict=True):
            problem = make(1)
            shown = [row for row in rows if SMALLEST < row.max_error() < LARGEST]
            _draw(axes, [row for row in shown if row.problem == name])
            axes.set(xscale="log", yscale="log", xlim=(LARGEST, SMALLEST))
            axes.set_title(f"{problem.description}, to {problem.t_end:g} s")
            axes.set_xlabel("largest error of a final state [rad, rad/s], smaller to the right")
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                named.setdefault(label, handle)
        panels[0].set_ylabel("trajectories per second of one core")
        place: Any = "outside lower center"
        figure.legend(list(named.values()), list(named), loc=place, ncols=5, frameon=False)
        save(figure, path)


def _draw(axes: Axes, rows: list[Row]) -> None:
    def plot(line: list[Row], **look: Any) -> None:
        axes.plot([row.max_error() for row in line], [row.rate for row in line], **look)

    for family in dict.fromkeys(row.family for row in own(rows)):
        mine = sorted((row for row in rows if row.family == family), key=lambda row: row.max_error())
        plot(mine, color="0.75", linewidth=0.8, label="fastmech, each method")
    for (prefix, label, marker), color in zip(CURVES, [*LINES, "0.35"], strict=True):
        best = frontier(row for row in rows if row.family.startswith(prefix))
        if best:
            width = 2.4 if prefix == OWN else 1.4
            plot(best, marker=marker, color=color, linewidth=width, label=label)
        if prefix == OWN:
            _name_methods(axes, best, color)


def _name_methods(axes: Axes, best: list[Row], color: str) -> None:
    """Names above the curve, where the settings of a method begin that lie together on it."""
    last, named = 0.0, ""
    for name, rows in groupby(best, key=lambda row: row.family.split()[1].rstrip(",")):
        row = list(rows)[-1]
        if name != named and row.max_error() > last * APART:
            last, named = row.max_error(), name
            axes.annotate(name, (last, row.rate), (2, 7), textcoords="offset points", color=color, size=9)


#: Families of the package, and of its engine's yardstick at the same method and step.
OWN, FUSED = "fastmech", "hand-fused"

#: Seconds that a call takes at least for the loop's own speed to show, not what stands around it.
WORTH_COMPARING = 0.01


class Start(NamedTuple):
    """Seconds from the first import to the first result of 1,024 trajectories."""

    entrant: str
    first: float  #: nothing compiled before
    second: float  #: with what the first has left on the disk
    steady: float  #: a later call in the same process


class Footprint(NamedTuple):
    """The largest memory of a process that integrates so many trajectories."""

    trajectories: int
    memory: int  #: bytes, starts and final states included


def own(rows: Iterable[Row]) -> list[Row]:
    """Rows of the package."""
    return [row for row in rows if row.family.startswith(OWN)]


def equal_error(rows: list[Row]) -> list[str]:
    """The package's rate at each error, and how many times the rate of each peer that is."""
    mine, peers = own(rows), dict[str, list[Row]]()
    for row in rows:
        if not row.family.startswith((OWN, FUSED)):
            peers.setdefault(row.family, []).append(row)
    known = [fastest_at(mine, error) for error in TARGETS]
    told = ["-" if x is None else f"{x[1]:,.0f} ({x[0].removeprefix(OWN).strip()})" for x in known]
    lines = [["fastmech, best method", *told]]
    for family, theirs in peers.items():
        count = min(len(row.errors) for row in theirs)
        line = [family + (f" (first {count})" if count < len(mine[0].errors) else "")]
        for error in TARGETS:
            rate, best = rate_at(theirs, error, count), fastest_at(mine, error, count)
            line.append("-" if rate is None or best is None else f"{best[1] / rate:.2f} x ({rate:,.0f})")
        lines.append(line)
    about = (
        "Trajectories per core second at equal largest error, one thread; for the others fastmech's rate "
        "over theirs, and theirs in brackets. A peer that was given fewer trajectories is compared on those. "
        "`-`: no setting is as accurate."
    )
    return section("", about, ["largest error", *(f"{error:.0e}" for error in TARGETS)], lines)


def same_step(rows: list[Row]) -> list[str]:
    """The engine against the hand-fused loop and against plain Numba, same method and step."""
    found = {(row.family, row.setting): row for row in rows}
    lines, left_out = [], 0
    for (family, setting), row in found.items():
        method = "rk4" if family.startswith("Numba RK4") else family.removeprefix(FUSED).strip()
        engine = found.get((f"{OWN} {method}", setting))
        if engine is None:
            continue
        if family.startswith(FUSED) and min(row.processor, engine.processor) < WORTH_COMPARING:
            left_out += 1
            continue
        rates = f"{row.rate:,.0f} | {engine.rate:,.0f} | {engine.rate / row.rate:.2f}"
        lines.append(f"{family}, {setting} | {rates}")
    told = f"Left out: {left_out} whose calls are shorter than {WORTH_COMPARING:g} s."
    about = (
        "The same method and step, one thread, trajectories per core second. The hand-fused loop is the "
        "engine's yardstick: this mechanism and this method alone, in the same blocks."
    )
    compared = section("", about, "against | its rate | fastmech | ratio", lines)
    return [*compared, told, ""] if left_out else compared


def problem_section(problem: BenchProblem, rows: list[Row]) -> list[str]:
    """All that was measured on one problem."""
    mine = [row for row in rows if row.problem == problem.name]
    lines = [f"## {problem.name}: {problem.description}, to t = {problem.t_end:g} s", ""]
    lines += equal_error(mine)
    head = (
        "integrator | setting | n | 1/s a core | 1/s wall | largest error | median error | "
        "compared | first call [s]"
    )
    everything = (
        f"{r.family} | {r.setting} | {r.trajectories} | {r.trajectories / r.processor:,.0f} | "
        f"{r.trajectories / r.wall:,.0f} | {r.max_error():.1e} | {r.median_error:.1e} | {len(r.errors)} | "
        f"{r.first_call:.2f}"
        for r in mine
    )
    return [*lines, *same_step(mine), *section("", "Every setting:", head, everything)]


def machine_sections(
    peak: float,
    throughputs: list[Throughput],
    costs: list[Cost],
    starts: list[Start],
    memory: list[Footprint],
) -> list[str]:
    """Peak, terms, cold starts and memory."""
    lines = section(
        "## Right-hand sides and the core's peak",
        f"Measured peak: {peak / 1e9:.1f} billion fused multiply-adds of doubles per core second.",
        "where | million right-hand sides/s | of the kernel alone | multiply-adds in that time",
        (f"{t.place} | {t.rhs / 1e6:.1f} | {t.share:.2f} | {t.slots:.0f}" for t in throughputs),
    )
    lines += section(
        "## Terms of a scene (RK4, dt = 0.01 s)",
        "",
        "scene | trajectories per core second | relative",
        (f"{c.kind} | {c.rate:,.0f} | {c.relative:.3f}" for c in costs),
    )
    if starts:
        lines += section(
            "## Cold start and steady state",
            "Seconds from the first import to the first result of 1,024 rest starts, in a first process and "
            "in a second one that finds what the first has left on the disk, and of a later call.",
            "integrator | first process | second process | later call",
            (f"{s.entrant} | {s.first:.2f} | {s.second:.2f} | {s.steady:.4f}" for s in starts),
        )
    if memory:
        lines += section(
            "## Memory",
            "The most that a process takes which asks for final states, its starts included.",
            "trajectories | GiB",
            (f"{p.trajectories:,} | {p.memory / 2**30:.2f}" for p in memory),
        )
    return lines
