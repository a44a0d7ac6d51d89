"""Equilibria on the potential's map, drawn to scale, and their eigenvalues in the complex plane."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from fastmech.mechanism.lagrange import potential_energy
from fastmech.models.drawing import Drawing
from fastmech.plots.mechanism import draw_mechanism, drawing_of, legend_handles
from fastmech.plots.style import (
    LINES,
    PI_TICKS,
    equilibrium_names,
    flag_codes,
    legend_below,
    new_figure,
    setting_of,
    style,
)
from fastmech.results import Dataset
from fastmech.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKERS = {"minimum": "o", "saddle": "D", "maximum": "^", "degenerate": "X"}
SHAPES = ["o", "s", "^", "D", "v", "P"]
GRID = 241


def draw_equilibria(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
    """Pictures of a dataset of the scan type ``equilibria`` of the scene with these parameters."""
    of_paper = "mechanism" not in dataset.attrs
    with style():
        figures = {"potential": _potential(dataset, Scene(**scene))} if of_paper else {}
        if dataset.sizes["equilibrium"]:
            figures["eigenvalues"] = _eigenvalues(dataset)
            if of_paper:
                force = float(dataset.attrs["force"])
                places = np.stack([dataset["phi"].data, dataset["theta"].data], axis=-1)
                figures["positions"] = _positions(
                    dataset, drawing_of(Scene(**scene), places, force), f"force F = {force:g} N on M2"
                )
            elif "drawing" in dataset.groups:
                figures["positions"] = _positions(
                    dataset, drawing_of(dataset.groups["drawing"]), setting_of(dataset, scene)
                )
    return figures


def _potential(dataset: Dataset, scene: Scene) -> Figure:
    figure = new_figure(7.4, 6.4)
    axes = figure.subplots()
    angle = np.linspace(-np.pi, np.pi, GRID)
    q = np.stack(np.meshgrid(angle, angle), axis=-1)
    energy = potential_energy(scene, q, float(dataset.attrs["force"]))
    filled = axes.contourf(angle, angle, energy, levels=24)
    axes.contour(angle, angle, energy, levels=24, colors="white", linewidths=0.4, alpha=0.6)
    figure.colorbar(filled, ax=axes, label="potential energy Π - F x2 [J]")
    codes = flag_codes(dataset["kind"])
    for kind, marker in {**dict.fromkeys(codes.others(MARKERS), "P"), **MARKERS}.items():
        of_kind = dataset["kind"].data == codes[kind]
        if of_kind.any():
            place = dataset["phi"].data[of_kind], dataset["theta"].data[of_kind]
            axes.plot(*place, marker, color="white", mec="black", mew=1.4, ms=10, clip_on=False, label=kind)
    _number(axes, dataset)
    axes.set_xticks(*PI_TICKS)
    axes.set_yticks(*PI_TICKS)
    axes.set(xlabel="angle φ [rad]", ylabel="angle θ [rad]")
    axes.set_title(f"Equilibria and potential, force F = {dataset.attrs['force']:g} N")
    axes.grid(visible=False)
    if dataset.sizes["equilibrium"]:
        legend_below(figure, axes, 4)
    return figure


def _number(axes: Axes, dataset: Dataset) -> None:
    """Numbers beside the equilibria, towards the middle so that none leaves the picture."""
    places = zip(dataset["phi"].data, dataset["theta"].data, strict=True)
    for number, (phi, theta) in enumerate(places, start=1):
        offset = (-13.0 if phi > 0 else 13.0, -13.0 if theta > 0 else 13.0)
        box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
        axes.annotate(
            str(number), (phi, theta), offset, textcoords="offset points", ha="center", va="center", bbox=box
        )


def _eigenvalues(dataset: Dataset) -> Figure:
    figure = new_figure(7.2, 5.4)
    axes = figure.subplots()
    ranks = [name.rpartition("_")[2] for name in dataset if name.startswith("eigenvalue_re_")]
    for i, name in enumerate(equilibrium_names(dataset)):
        axes.plot(
            *([dataset[f"eigenvalue_{part}_{k}"].data[i] for k in ranks] for part in ("re", "im")),
            SHAPES[i % len(SHAPES)],
            color=LINES[i % len(LINES)],
            mec="white",
            ms=9,
            label=name,
        )
    left, right = axes.get_xlim()
    axes.set_xlim(min(left, -0.1 * right), max(right, -0.1 * left))
    axes.axvline(0.0, color="black", lw=1.0, zorder=1.0)
    axes.axvspan(0.0, axes.get_xlim()[1], color="black", alpha=0.07, lw=0)
    axes.text(0.99, 0.98, "growing", transform=axes.transAxes, ha="right", va="top", color="#404040")
    axes.text(0.01, 0.98, "decaying", transform=axes.transAxes, ha="left", va="top", color="#404040")
    axes.set(xlabel="real part [1/s]", ylabel="imaginary part [rad/s]")
    axes.set_title("Eigenvalues of the linearized motion")
    axes.margins(y=0.12)
    legend_below(figure, axes, 2)
    return figure


def _positions(dataset: Dataset, drawn: Drawing, setting: str) -> Figure:
    names = equilibrium_names(dataset)
    told = [
        {code: word.replace("_", " ") for word, code in flag_codes(dataset[of]).items()}
        for of in ("verdict", "kind")
    ]
    rows, columns = -(-len(names) // 2), min(2, len(names))
    figure = new_figure(1.2 + 4.2 * columns, 3.9 * rows + 0.6)
    figure.suptitle("Positions of rest, " + setting.replace(": ", ":\n" if columns == 1 else ": "))
    panels = figure.subplots(rows, columns, squeeze=False)
    for axes in panels.flat[len(names) :]:
        axes.remove()
    for i, name in enumerate(names):
        axes = panels.flat[i]
        draw_mechanism(axes, drawn, i)
        verdict, kind = (
            words.get(int(dataset[of].data[i]), "unknown")
            for words, of in zip(told, ("verdict", "kind"), strict=True)
        )
        axes.set_title(f"{name}\n{verdict} ({kind})", fontsize=10)
    figure.legend(handles=legend_handles(drawn), loc="outside lower center", ncols=2 * columns)
    return figure
