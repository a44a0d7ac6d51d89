"""The mechanism itself, drawn to scale: rods, masses, slider and guide, springs, damper, force."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastmech.mechanism.geometry import positions
from fastmech.plots.style import PALETTE
from fastmech.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Points = NDArray[np.float64]

ROD, SPRING, DAMPER, FORCE = PALETTE["black"], PALETTE["green"], PALETTE["purple"], PALETTE["vermillion"]
MASS, GROUND, INK = PALETTE["blue"], "#8c8c8c", "#404040"

#: Sizes over the rod's length l.
LARGEST_MASS, ARROW, COIL, HOUSING, TURNS = 0.15, 0.75, 0.055, 0.09, 9


def draw_mechanism(axes: Axes, scene: Scene, phi: float, theta: float, force: float) -> None:
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
    axes.set(xlim=(-2.3 * l, wall + 0.1 * l), ylim=(-2.3 * l, 2.3 * l), xlabel="x [m]", ylabel="y [m]")
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
        axes.annotate("", xy=tuple(tip), xytext=tuple(m2), arrowprops=arrow, zorder=6)
    ahead = m2 + np.array([np.sign(force), 0.0])
    _label(axes, "$M_1$", m1, (origin, m2, m3, a), 0.29 * l, MASS)
    _label(axes, "$M_2$", m2, (m1, origin, ahead), 0.29 * l, MASS)
    _label(axes, "$M_3$", m3, (m1, m3 + np.array([1.0, 0.0])), 0.29 * l, MASS)
    _label(axes, "O", origin, (m1, m2), 0.22 * l, INK)
    _label(axes, "A", a, (m1,), 0.22 * l, INK)


def _label(
    axes: Axes, text: str, place: Points, others: tuple[Points, ...], distance: float, colour: str
) -> None:
    """Name a point on the side where nothing is tied to it."""
    ties = np.array([other - place for other in others])
    lengths = np.hypot(*ties.T)
    tied = lengths > 1e-9
    # A point that coincides with all it is tied to gets its name above.
    ties = ties[tied] / lengths[tied, None] if tied.any() else np.array([[0.0, -1.0]])
    # The free direction is the one farthest from every tie.
    angles = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    away = directions[np.argmin(np.max(directions @ ties.T, axis=1))]
    x, y = place + distance * away
    axes.text(x, y, text, ha="center", va="center", color=colour, fontsize=10, zorder=7)


def _ground(axes: Axes, l: float, wall: float) -> None:
    """Guide, wall and the fixed points O and A."""
    axes.axhline(0.0, color=GROUND, lw=0.9, ls=(0, (6, 3)), zorder=1)
    axes.plot([wall, wall], [-0.3 * l, 0.3 * l], color=GROUND, lw=3.0, zorder=1)
    axes.plot([0.0, 0.0], [0.0, l], ls="none", marker="s", ms=7, color=GROUND, zorder=4)


def _masses(axes: Axes, scene: Scene, m1: Points, m2: Points, m3: Points) -> None:
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


def legend_handles(force: float) -> list[Any]:
    """What the drawing's colours mean, for a legend; ``force`` [N]."""
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color=ROD, lw=2.6, label="rod"),
        Line2D([], [], color=MASS, marker="o", ms=9, ls="none", label="mass"),
        Line2D([], [], color=SPRING, lw=1.4, label="spring"),
        Line2D([], [], color=DAMPER, lw=1.8, label="damper"),
        Line2D([], [], color=FORCE, marker=">", lw=2.4, label=f"force on $M_2$, {force:g} N"),
        Line2D([], [], color=GROUND, marker="s", ls="none", label="fixed points O and A"),
        Line2D([], [], color=GROUND, lw=1.2, ls="--", label="guide of the slider"),
    ]
