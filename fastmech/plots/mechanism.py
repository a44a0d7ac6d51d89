"""The mechanism itself, drawn to scale: rods, masses, slider and guide, springs, damper, force."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastmech.mechanism.coefficients import Parameters
from fastmech.mechanism.geometry import positions
from fastmech.plots.style import PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Points = NDArray[np.float64]

ROD, SPRING, DAMPER, FORCE = PALETTE["black"], PALETTE["green"], PALETTE["purple"], PALETTE["vermillion"]
MASS, GROUND = PALETTE["blue"], "#8c8c8c"

#: Sizes over the rod's length l.
LARGEST_MASS, ARROW, COIL, HOUSING, TURNS = 0.15, 0.75, 0.055, 0.09, 9


def draw_mechanism(axes: Axes, scene: Parameters, phi: float, theta: float, force: float) -> None:
    """Draw the mechanism at rest in (phi, theta) [rad], with ``force`` [N] on M2 along +x.

    Lengths are to scale; masses have areas in proportion to them; the arrow has one length for every force.
    The springs are drawn from M2 to O and from M1 to A = (0, l), the points where they are unstressed. The
    axes cover every configuration, so that drawings of one scene can be compared.
    """
    l = scene.l
    p = positions(scene, np.array([phi, theta, 0.0, 0.0]))
    origin, a = np.zeros(2), np.array([0.0, l])
    m1, m2, m3 = (np.array(point, dtype=np.float64) for point in ((p.x1, p.y1), (p.x2, p.y2), (p.x3, p.y3)))
    wall = 3.62 * l

    axes.set_aspect("equal")
    axes.set(xlim=(-2.15 * l, wall + 0.15 * l), ylim=(-2.2 * l, 2.2 * l), xlabel="x [m]", ylabel="y [m]")
    _ground(axes, l, wall)
    for start, end in ((m2, origin), (m1, a)):
        axes.plot(*_zigzag(start, end, COIL * l), color=SPRING, lw=1.1, zorder=2)
    _damper(axes, m3, wall, HOUSING * l)
    for start, end in ((origin, m1), (m1, m2), (m1, m3)):
        axes.plot(*np.transpose([start, end]), color=ROD, lw=2.6, solid_capstyle="round", zorder=3)
    _masses(axes, scene, m1, m2, m3)
    if force:
        tip = m2 + np.array([np.sign(force) * ARROW * l, 0.0])
        arrow = {
            "arrowstyle": "-|>",
            "color": FORCE,
            "lw": 2.4,
            "mutation_scale": 14,
            "shrinkA": 0,
            "shrinkB": 0,
        }
        axes.annotate("", xy=tip, xytext=m2, arrowprops=arrow, zorder=6)
        axes.text(*(tip + [0.06 * l, 0.0]), f"F = {force:g} N", color=FORCE, va="center", zorder=7, **_HALO)


_HALO = {
    "fontsize": 9,
    "bbox": {"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.8},
}


def _ground(axes: Axes, l: float, wall: float) -> None:
    """Guide, wall and the fixed points O and A."""
    axes.axhline(0.0, color=GROUND, lw=0.9, ls=(0, (6, 3)), zorder=1)
    axes.plot([wall, wall], [-0.3 * l, 0.3 * l], color=GROUND, lw=3.0, zorder=1)
    for name, y, below in (("O", 0.0, True), ("A", l, False)):
        axes.plot(0.0, y, marker="^" if below else "v", ms=8, color=GROUND, zorder=4)
        axes.text(-0.1 * l, y + 0.1 * l, name, ha="right", va="bottom", color="#404040", zorder=7, **_HALO)


def _masses(axes: Axes, scene: Parameters, m1: Points, m2: Points, m3: Points) -> None:
    from matplotlib.patches import Circle, Rectangle

    l = scene.l
    heaviest = max(scene.m1, scene.m2, scene.m3)
    for name, mass, center in (("M1", scene.m1, m1), ("M2", scene.m2, m2), ("M3", scene.m3, m3)):
        radius = LARGEST_MASS * l * np.sqrt(mass / heaviest)
        if name == "M3":
            # A square of the area that a circle of this mass would have.
            side = radius * np.sqrt(np.pi)
            axes.add_patch(Rectangle(tuple(center - side / 2), side, side, color=MASS, zorder=5))
        else:
            axes.add_patch(Circle(tuple(center), radius, color=MASS, zorder=5))
        up = -1.0 if name == "M2" else 1.0
        axes.text(
            *(center + [0.0, up * 1.25 * LARGEST_MASS * l]),
            f"$M_{name[1]}$",
            ha="center",
            va="bottom" if up > 0 else "top",
            color=MASS,
            zorder=7,
            **_HALO,
        )


def _zigzag(start: Points, end: Points, width: float) -> tuple[Points, Points]:
    """Coordinates of a spring's line between two points."""
    along = end - start
    length = float(np.hypot(*along))
    across = np.array([-along[1], along[0]]) / max(length, 1e-12)
    place = np.concatenate([[0.0], np.linspace(0.12, 0.88, 2 * TURNS + 1), [1.0]])
    side = np.zeros(place.size)
    side[2:-2] = np.where(np.arange(2 * TURNS - 1) % 2, -width, width)
    line = start + place[:, None] * along + side[:, None] * across
    return line[:, 0], line[:, 1]


def _damper(axes: Axes, slider: Points, wall: float, half: float) -> None:
    """Piston rod from the slider into a housing that is fixed to the wall."""
    x, span = float(slider[0]), wall - float(slider[0])
    back, front, piston = wall - 0.18 * span, wall - 0.72 * span, wall - 0.45 * span
    axes.plot([x, piston], [0.0, 0.0], color=DAMPER, lw=1.6, zorder=2)
    axes.plot([piston, piston], [-0.8 * half, 0.8 * half], color=DAMPER, lw=2.6, zorder=2)
    axes.plot([front, back, back, front], [half, half, -half, -half], color=DAMPER, lw=1.6, zorder=2)
    axes.plot([back, wall], [0.0, 0.0], color=DAMPER, lw=1.6, zorder=2)
