"""The benchmark as Markdown: speed at equal error first, then everything that was measured."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from fastmech.bench.machine import Cost, Throughput
from fastmech.bench.measure import TARGETS, Row, fastest_at, rate_at
from fastmech.bench.problem import Problem
from fastmech.reports import table as table

OWN = "fastmech"

#: Rows of the package's engine and of its yardstick at the same method and step.
FUSED = "hand-fused"

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


def peers(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows of everyone else but the yardstick, by family."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        if not row.family.startswith((OWN, FUSED)):
            found.setdefault(row.family, []).append(row)
    return found


def equal_error(rows: list[Row], threads: int) -> list[str]:
    """The package's rate at each error, and how many times the rate of each peer that is."""
    mine = own(rows)
    first = ["fastmech, best method"]
    for error in TARGETS:
        best = fastest_at(mine, error)
        first.append("-" if best is None else f"{best[1]:,.0f} ({best[0].removeprefix(OWN).strip()})")
    lines = [first]
    for family, theirs in peers(rows).items():
        count = min(len(row.errors) for row in theirs)
        line = [family + (f" (first {count})" if count < len(mine[0].errors) else "")]
        for error in TARGETS:
            rate, best = rate_at(theirs, error, count), fastest_at(mine, error, count)
            line.append("-" if rate is None or best is None else f"{best[1] / rate:.2f} x ({rate:,.0f})")
        lines.append(line)
    unit = "core second" if threads == 1 else "second"
    return [
        f"Trajectories per {unit} at equal largest error, {threads} thread{'s' * (threads > 1)}; for the "
        "others fastmech's rate over theirs, and theirs in brackets. A peer that was given fewer "
        "trajectories is compared on those. `-`: no setting is as accurate.",
        "",
        *table(["largest error", *(f"{error:.0e}" for error in TARGETS)], lines),
    ]


def same_step(rows: list[Row]) -> list[str]:
    """The engine against the hand-fused loop and against plain Numba, same method and step."""
    found = {(row.family, row.setting): row for row in rows if row.threads == 1}
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
    return [
        "The same method and step, one thread, trajectories per core second. The hand-fused loop is the "
        "engine's yardstick: this mechanism and this method alone, in the same blocks.",
        "",
        *table("against | its rate | fastmech | ratio", lines),
        *([told, ""] if left_out else []),
    ]


def speed_up(rows: list[Row]) -> list[str]:
    """All threads over one, by wall time, of the package."""
    one = {(row.family, row.setting): row for row in rows if row.threads == 1}
    lines = []
    for row in rows:
        if row.threads > 1:
            single = one[row.family, row.setting]
            ratio = (single.wall / single.trajectories) / (row.wall / row.trajectories)
            used = row.processor / row.wall
            lines.append(f"{row.family}, {row.setting} | {row.threads} | {ratio:.2f} | {used:.2f}")
    if not lines:
        return []
    return [
        "All threads over one, by wall time, and the cores that it got.",
        "",
        *table("integrator | threads | speed-up | cores used", lines),
    ]


def everything(rows: list[Row]) -> list[str]:
    """Every row."""
    head = (
        "integrator | setting | threads | n | 1/s a core | 1/s wall | largest error | median error | "
        "compared | first call [s]"
    )
    lines = []
    for row in rows:
        rates = (f"{row.trajectories / seconds:,.0f}" for seconds in (row.processor, row.wall))
        lines.append(
            f"{row.family} | {row.setting} | {row.threads} | {row.trajectories} | {' | '.join(rates)} | "
            f"{row.max_error():.1e} | {row.median_error:.1e} | {len(row.errors)} | {row.first_call:.2f}"
        )
    return table(head, lines)


def problem_section(problem: Problem, rows: list[Row]) -> list[str]:
    """All that was measured on one problem."""
    mine = [row for row in rows if row.problem == problem.name]
    lines = [f"## {problem.name}: {problem.description}, to t = {problem.t_end:g} s", ""]
    for threads in sorted({row.threads for row in mine}):
        lines += equal_error([row for row in mine if row.threads == threads], threads)
    return [*lines, *same_step(mine), *speed_up(mine), "Every setting:", "", *everything(mine)]


def machine_sections(
    peak: float,
    throughputs: list[Throughput],
    costs: list[Cost],
    starts: list[Start],
    memory: list[Footprint],
) -> list[str]:
    """Peak, terms, cold starts and memory."""
    lines = [
        "## Right-hand sides and the core's peak",
        "",
        f"Measured peak: {peak / 1e9:.1f} billion fused multiply-adds of doubles per core second.",
        "",
        *table(
            "where | million right-hand sides/s | of the kernel alone | multiply-adds in that time",
            (f"{t.place} | {t.rhs / 1e6:.1f} | {t.share:.2f} | {t.slots:.0f}" for t in throughputs),
        ),
        "## Terms of a scene (RK4, dt = 0.01 s)",
        "",
        *table(
            "scene | trajectories per core second | relative",
            (f"{c.kind} | {c.rate:,.0f} | {c.relative:.3f}" for c in costs),
        ),
    ]
    if starts:
        lines += [
            "## Cold start and steady state",
            "",
            "Seconds from the first import to the first result of 1,024 rest starts, in a first process and "
            "in a second one that finds what the first has left on the disk, and of a later call.",
            "",
            *table(
                "integrator | first process | second process | later call",
                (f"{s.entrant} | {s.first:.2f} | {s.second:.2f} | {s.steady:.4f}" for s in starts),
            ),
        ]
    if memory:
        lines += [
            "## Memory",
            "",
            "The most that a process takes which asks for final states, its starts included.",
            "",
            *table("trajectories | GiB", (f"{p.trajectories:,} | {p.memory / 2**30:.2f}" for p in memory)),
        ]
    return lines
