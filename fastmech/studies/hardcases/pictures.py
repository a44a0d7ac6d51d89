"""Pictures of the step limits: stability regions with a scene's eigenvalues."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.integrators.methods import METHODS, Adams, ImplicitRungeKutta, RungeKutta
from fastmech.plots.style import PALETTE, entry, legend_below, new_figure, style, swatch
from fastmech.studies.hardcases.limits import amplification

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Points a side of the fields of |R|, and panels in a row.
SIDE, ACROSS = 181, 4

#: Step [s] for the eigenvalues of a method that has no limit, and half width of its panel.
WITHOUT_LIMIT, WIDE = 2.0, 14.0

#: Pages of stability regions: methods on them, title.
REGIONS = {
    "explicit": (RungeKutta, "Stability regions |R(z)| ≤ 1 of the explicit Runge-Kutta methods"),
    "adams": (Adams, "Stability regions of the Adams methods, by the roots of the history's map"),
    "implicit": (ImplicitRungeKutta, "Stability regions |R(z)| ≤ 1 of the implicit Runge-Kutta methods"),
}

#: Marks of a panel: marker, edge, face.
PREDICTED = {"marker": "o", "mec": PALETTE["vermillion"], "mfc": PALETTE["vermillion"], "ms": 6, "ls": ""}
MEASURED = PREDICTED | {"marker": "x", "mec": PALETTE["black"]}
ON_REAL = PREDICTED | {"marker": "D", "mec": PALETTE["black"], "mfc": "white", "ms": 5}
ON_IMAGINARY = ON_REAL | {"marker": "s"}


class Limits(NamedTuple):
    """How far a method is stable; inf: it has no limit."""

    method: str
    real_limit: float
    imaginary_limit: float
    predicted_step: float  #: s
    measured_step: float  #: s


def stability_pages(limits: Sequence[Limits], eigenvalues: NDArray[np.complex128]) -> dict[str, Figure]:
    """Where steps do not amplify, by name: a page a family, about sixteen methods; eigenvalues in 1/s."""
    pages = {}
    for name, (family, title) in REGIONS.items():
        mine = [row for row in limits if isinstance(METHODS[row.method], family)]
        if mine:
            with style():
                pages[f"stability_{name}"] = figure = new_figure(12.0, 3.6 * -(-len(mine) // ACROSS) + 0.9)
                panels = figure.subplots(-(-len(mine) // ACROSS), ACROSS, squeeze=False)
                for axes in panels.flat[len(mine) :]:
                    axes.remove()
                for axes, row in zip(panels.flat, mine, strict=False):
                    _panel(axes, row, eigenvalues)
                title += "\nλ: eigenvalues at the minimum of Table 1 under the constant force"
                figure.suptitle(title)
                marks = {f"h λ of the scene at h = {WITHOUT_LIMIT:g} s: no step is too long": PREDICTED}
                if np.isfinite(mine[0].predicted_step):
                    marks = {
                        "h λ of the scene, h predicted": PREDICTED,
                        "h λ of the scene, h measured": MEASURED,
                        "limit on the real axis": ON_REAL,
                        "limit on the imaginary axis": ON_IMAGINARY,
                    }
                handles = [entry(told, **look) for told, look in marks.items()]
                handles.insert(0, swatch("no step amplifies", PALETTE["sky"], PALETTE["blue"]))
                legend_below(figure, handles, len(handles))
    return pages


def _panel(axes: Axes, limits: Limits, eigenvalues: NDArray[np.complex128]) -> None:
    name, real, imaginary, predicted, measured = limits
    method, bounded = METHODS[name], np.isfinite(predicted)
    scaled = (predicted if bounded else WITHOUT_LIMIT) * eigenvalues
    reach = 1.2 * max(real, imaginary, float(np.abs(scaled).max())) if bounded else WIDE
    left, right = -reach, 0.5 * reach if bounded else reach
    x, y = np.linspace(left, right, SIDE), np.linspace(-reach, reach, SIDE)
    field = amplification(method, x[None, :] + 1j * y[:, None])
    axes.contourf(x, y, field, levels=[0.0, 1.0], colors=[PALETTE["sky"]], alpha=0.35)
    axes.contour(x, y, field, levels=[1.0], colors=[PALETTE["blue"]], linewidths=1.1)
    axes.axhline(0.0, color="0.5", lw=0.6)
    axes.axvline(0.0, color="0.5", lw=0.6)
    axes.plot(scaled.real, scaled.imag, **PREDICTED)  # type: ignore[arg-type]
    if bounded:
        again = measured * eigenvalues
        axes.plot(again.real, again.imag, **MEASURED)  # type: ignore[arg-type]
        axes.plot([-real], [0.0], clip_on=False, **ON_REAL)  # type: ignore[arg-type]
        axes.plot([0.0, 0.0], [-imaginary, imaginary], **ON_IMAGINARY)  # type: ignore[arg-type]
    told = [
        f"{sign}{value:{form}}" if np.isfinite(value) else "no limit"
        for sign, value, form in (
            ("", predicted, ".5f"), ("", measured, ".5f"), ("−", real, ".3g"), ("±", imaginary, ".3g")
        )
    ]  # fmt: skip
    text = "h predicted {} s\nh measured {} s\nreal {}, imaginary {}".format(*told)
    axes.set(aspect="equal", xlim=(left, right), ylim=(-reach, reach))
    axes.locator_params(axis="x", nbins=4)
    axes.locator_params(axis="y", nbins=5)
    axes.set_title(f"{name}, order {method.order}", loc="left", fontsize=10, pad=44, weight="bold")
    text = text.replace("limit s", "limit")
    axes.text(0.0, 1.02, text, transform=axes.transAxes, fontsize=8.5, va="bottom", linespacing=1.25)
    axes.set_xlabel("Re z", labelpad=1)
    axes.set_ylabel("Im z", labelpad=1)
