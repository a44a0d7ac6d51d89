"""``fastmech hardcases``: the gallery's table, result file and pictures in a folder."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fastmech.ensembles.threads import thread_count
from fastmech.equilibria.find import find_equilibria
from fastmech.errors import InputError, StepWarning
from fastmech.hardcases.cases.conservative import (
    DT,
    ENERGETIC_START,
    PAPER_START,
    QUICK_STEPS,
    STEPS,
    energy_history,
)
from fastmech.hardcases.containment import CONTAINED, contained, containment, containment_markdown
from fastmech.hardcases.gallery import gallery_dataset, gallery_markdown, run_gallery, verdict
from fastmech.hardcases.registry import CASES
from fastmech.integrators.method import Adams, ImplicitRungeKutta, RungeKutta
from fastmech.integrators.methods import METHODS
from fastmech.plots.energy_drift import draw_energy_drift
from fastmech.plots.stability_region import draw_stability_regions
from fastmech.plots.style import save
from fastmech.results import Dataset, Variable, scene_parameters
from fastmech.scene import Scene
from fastmech.step_limits.axes import imaginary_limit, real_limit
from fastmech.step_limits.measure import measured_stable_step
from fastmech.step_limits.predict import largest_stable_step, limiting_eigenvalues
from fastmech.store.provenance import provenance
from fastmech.store.write import write_results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Methods and formulations whose energy is drawn.
DRIFTS = (("rk4", "lagrange"), ("dop853", "lagrange"), ("gauss6", "lagrange"), ("gauss6", "hamilton"))

#: Pages of stability regions: name, methods on it, title.
REGIONS = (
    ("explicit", RungeKutta, "Stability regions |R(z)| ≤ 1 of the explicit Runge-Kutta methods"),
    ("adams", Adams, "Stability regions of the Adams methods, by the roots of the history's map"),
    ("implicit", ImplicitRungeKutta, "Stability regions |R(z)| ≤ 1 of the implicit Runge-Kutta methods"),
)

Stage = Callable[[str, int], Callable[[int], None]]


class Report(NamedTuple):
    """What was written, and how the gallery ended."""

    paths: list[Path]
    verdict: str
    passed: bool


def write_hardcases(
    out: Path, *, quick: bool = False, stage: Stage = lambda name, total: lambda done: None
) -> Report:
    """Run the gallery and write ``hardcases.md``, ``hardcases.h5`` and pictures into the folder ``out``.

    Raises:
        InputError: the folder cannot be written.
    """
    started = time.perf_counter()
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out}: cannot be made: {error.strerror}") from None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StepWarning)  # steps that are too long are what some cases are about
        return _write(out, quick, stage, started)


def _write(out: Path, quick: bool, stage: Stage, started: float) -> Report:
    results = run_gallery(quick, stage("hard cases", len(CASES)))
    scene = Scene(c2=1100 / 3, alpha=0.0)
    advance = stage("step limits", len(METHODS))
    limits = _limits(scene, advance)
    table, store = out / "hardcases.md", out / "hardcases.h5"
    shares = containment(quick, stage("failing neighbours", len(CONTAINED)))
    tables = f"{_limits_markdown(limits)}\n\n{containment_markdown(shares)}"
    told, passed = verdict(results), all(result.passed for result in results)
    if not contained(shares):
        told, passed = f"{told}; failing trajectories are not contained", False
    table.write_text(gallery_markdown(results, tables), encoding="utf-8")
    attrs = {
        **provenance(thread_count(None)),
        "title": "Hard cases",
        "verdict": told,
        "wall_time_s": time.perf_counter() - started,
    }
    write_results(
        store,
        scene_parameters=scene_parameters(scene),
        sections={"gallery": gallery_dataset(results), "step_limits": limits, "containment": shares},
        attrs=attrs,
        replace=True,
    )
    paths = [table, store]
    pictures = _region_pictures(scene, limits)
    steps = QUICK_STEPS if quick else STEPS
    pictures["energy_paper_start"] = _energy_picture("the paper's start", PAPER_START, steps)
    pictures["energy_energetic_start"] = _energy_picture("an energetic start", ENERGETIC_START, steps)
    for name, figure in pictures.items():
        paths.append(out / f"{name}.png")
        save(figure, paths[-1])
    return Report(paths, told, passed)


def _region_pictures(scene: Scene, limits: Dataset) -> dict[str, Figure]:
    """A page a family: regions, the scene's eigenvalues at the limits, limits on the axes."""
    minimum = next(e for e in find_equilibria(scene) if e.morse_index == 0)
    eigenvalues = limiting_eigenvalues(scene, minimum)
    pages = {}
    for name, family, title in REGIONS:
        members = {key: method for key, method in METHODS.items() if isinstance(method, family)}
        if members:
            full = f"{title}\nλ: eigenvalues at the minimum of Table 1 under the constant force"
            pages[f"stability_{name}"] = draw_stability_regions(members, eigenvalues, limits, full)
    return pages


def _energy_picture(label: str, start: Sequence[float], steps: int) -> Figure:
    """Energy errors from one start by a few methods."""
    histories = {
        f"{method}, {'(q, p)' if formulation == 'hamilton' else '(q, q′)'}": energy_history(
            start, method, formulation, steps
        )[:2]
        for method, formulation in DRIFTS
    }
    phi, theta, u, v = start
    return draw_energy_drift(
        histories,
        f"Energy error of an undamped motion from {label}",
        f"φ = {phi:.4g} rad, θ = {theta:.4g} rad, φ′ = {u:g} rad/s, θ′ = {v:g} rad/s; "
        f"{steps:,} steps of h = {DT:g} s",
    )


def _limits(scene: Scene, advance: Callable[[int], None]) -> Dataset:
    """Axis limits of every method, and at the scene's minimum the step predicted and measured."""
    minimum = next(e for e in find_equilibria(scene) if e.morse_index == 0)
    columns: list[tuple[float, ...]] = []
    for name, method in METHODS.items():
        columns.append(
            (
                real_limit(method),
                imaginary_limit(method),
                largest_stable_step(scene, minimum, name),
                measured_stable_step(scene, minimum, name),
            )
        )
        advance(1)
    values = np.array(columns)
    about = (
        ("real_limit", "1", "stable for -x up to here; inf: no limit"),
        ("imaginary_limit", "1", "stable for iy up to here; inf: no limit"),
        ("predicted_step", "s", "largest stable step at the minimum, from coefficients and eigenvalues"),
        ("measured_step", "s", "the same from the differenced one-step map"),
    )
    variables = {
        name: Variable(("method",), values[:, k], units, text) for k, (name, units, text) in enumerate(about)
    }
    names = Variable(("method",), np.array(list(METHODS), object), "1", "method")
    return Dataset({"method": names, **variables})


def _limits_markdown(limits: Dataset) -> str:
    lines = [
        "## Step limits",
        "",
        "At the minimum of Table 1 under the constant force.",
        "",
        "| method | real axis | imaginary axis | predicted step [s] | measured step [s] | difference |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    columns = [
        limits[name].data
        for name in ("method", "real_limit", "imaginary_limit", "predicted_step", "measured_step")
    ]
    for name, real, imaginary, predicted, measured in zip(*columns, strict=True):
        difference = f"{measured / predicted - 1:+.1e}" if np.isfinite(predicted) else ""
        lines.append(
            f"| {name} | {real:.4f} | {imaginary:.4f} | {predicted:.5f} | {measured:.5f} | {difference} |"
        )
    return "\n".join(lines)
