"""Draw the pictures of the README: the labelled mechanism, its basins and a motion.

python docs/make_pictures.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.patches import Arc

import fastmech as fm
from fastmech.plots.equilibria import draw_mechanism, drawing_of, legend_handles
from fastmech.plots.style import PALETTE, new_figure, save, style
from fastmech.runner import draw_results, run_request

HERE = Path(__file__).parent / "pictures"

#: A position in which all angles can be seen [rad].
POSITION = (0.9, 1.2)

BASINS = """
title = "Basins"
[scene]
F0 = -150.0
alpha = 0.0
c1 = 260.0
c2 = 60.0
[scan.basins]
kind = "basins"
axes.phi = { start = -3.14, stop = 3.14, num = 241 }
axes.theta = { start = -3.14, stop = 3.14, num = 241 }
"""


def sketch() -> None:
    """The mechanism with its angles, points, springs, damper and force."""
    scene = fm.Scene()
    phi, theta, l = *POSITION, scene.l
    first = l * np.array([np.cos(phi), np.sin(phi)])
    second = first - l * np.array([np.sin(theta), np.cos(theta)])
    with style():
        figure = new_figure(7.6, 5.0)
        axes = figure.subplots()
        drawn = drawing_of(scene, POSITION, scene.F0)
        draw_mechanism(axes, drawn)
        look = {"color": PALETTE["vermillion"], "lw": 1.4}
        axes.add_patch(Arc((0.0, 0.0), 0.74, 0.74, theta1=0.0, theta2=np.degrees(phi), **look))
        axes.plot([first[0], first[0]], [first[1], first[1] - 1.35 * l], color="#7f7f7f", lw=0.9, ls="--")
        arc = Arc(first, 1.0, 1.0, theta1=270.0 - np.degrees(theta), theta2=270.0, **look)
        axes.add_patch(arc)
        text = {"color": PALETTE["vermillion"], "fontsize": 14, "ha": "center", "va": "center"}
        axes.text(0.49 * np.cos(phi / 2), 0.49 * np.sin(phi / 2), "φ", **text)
        axes.text(*(first + 0.63 * np.array([-np.sin(0.2), -np.cos(0.2)])), "θ", **text)
        named = {"fontsize": 11, "ha": "center", "va": "center", "color": "black"}
        axes.text(*(0.5 * second + [-0.18, -0.02]), "$c_1$", **named)
        axes.text(*(0.5 * (first + np.array([0.0, l])) + [0.02, 0.17]), "$c_2$", **named)
        axes.text(*(0.5 * first + [0.12, -0.06]), "$l$", **named)
        axes.text(*(0.5 * (first + second) + [-0.02, 0.12]), "$l$", **named)
        axes.annotate("", (-1.2, 0.55), (-1.2, 1.05), arrowprops={"arrowstyle": "->", "lw": 1.2})
        axes.text(-1.1, 0.8, "$g$", **named)
        axes.set_aspect("equal")
        axes.set_xlim(-1.4, 4.0)
        axes.set_ylim(-0.85, 1.75)
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        axes.set_title("The mechanism: crank O-M1, pendulum M1-M2, slider M3; φ and θ as positive")
        figure.legend(handles=legend_handles(drawn, "force F on M2"), loc="outside lower center", ncols=4)
        save(figure, HERE / "mechanism.png")


def basins() -> None:
    """Which start at rest ends in which well."""
    request = HERE / "basins.toml"
    request.write_text(BASINS, encoding="utf-8")
    out = HERE / "basins.h5"
    run_request(request, out, fresh=True)
    for picture in draw_results(out, HERE, section="basins"):
        if not picture.name.endswith("labels.png"):
            picture.unlink()
    request.unlink()
    out.unlink()


def motion() -> None:
    """A motion under the decaying force."""
    scene = fm.Scene(c2=1100 / 3)
    run = fm.integrate(
        scene, [4 * np.pi / 13, np.pi / 7, 0.0, 0.0], t_eval=np.linspace(0.0, 5.0, 76), tol=1e-6
    )
    fm.animate(scene, run, HERE / "motion.gif")


if __name__ == "__main__":
    HERE.mkdir(exist_ok=True)
    sketch()
    basins()
    motion()
