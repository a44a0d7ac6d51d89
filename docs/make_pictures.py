"""Draw the pictures of the README, of the explanations and of the gallery.

python docs/make_pictures.py [readme] [explanations] [gallery] [REQUEST ...]

Without a word it draws all; of the gallery also single requests, by their names. The gallery runs every
shipped request, which takes 15 minutes on two cores.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import tomllib
import warnings
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.patches import Arc
from matplotlib.patheffects import Normal, Stroke
from PIL import Image

import fastmech as fm
from fastmech.plots.equilibria import draw_mechanism, drawing_of, legend_handles
from fastmech.plots.style import PALETTE, entry, new_figure, save, setting, style, suptitle
from fastmech.runner import draw_results, run_request

ROOT = Path(__file__).parents[1]
HERE = ROOT / "docs" / "pictures"

#: Of every shipped request the picture that the gallery shows, and what it shows.
SHOWN = tomllib.loads((HERE / "gallery.toml").read_text(encoding="utf-8"))

#: The scene of the explanations: two wells.
BISTABLE = fm.Scene(F0=-150.0, alpha=0.0, c1=260.0, c2=60.0)

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
        figure = new_figure(7.6, 4.5)
        axes = figure.subplots()
        drawn = drawing_of(scene, POSITION, scene.F0)
        draw_mechanism(axes, drawn)
        look = {"color": PALETTE["vermillion"], "lw": 1.4}
        axes.add_patch(Arc((0.0, 0.0), 0.74, 0.74, theta1=0.0, theta2=np.degrees(phi), **look))
        axes.plot([first[0], first[0]], [first[1], first[1] - 0.7 * l], color=look["color"], lw=0.9, ls=":")
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
        axes.text(*(0.5 * first + [1.46, 0.24]), "$2l$", **named)
        axes.text(1.7, -0.22, r"$\beta$", **named)
        axes.text(second[0] + 0.5, second[1] + 0.1, "$F$", **named)
        axes.annotate("", (-1.2, 0.55), (-1.2, 1.05), arrowprops={"arrowstyle": "->", "lw": 1.2})
        axes.text(-1.1, 0.8, "$g$", **named)
        axes.set_aspect("equal")
        axes.set_xlim(-1.4, 4.0)
        axes.set_ylim(-0.85, 1.75)
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        axes.set_title("The mechanism: crank O-M1, pendulum M1-M2, slider M3; both angles are positive here")
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
    times = np.linspace(0.0, 4.0, 61)
    run = fm.integrate(scene, [*POSITION, 0.0, 0.0], t_eval=times, tol=1e-6)
    fm.animate(scene, run, HERE / "motion.gif", fps=8)


def general(scene: fm.Scene) -> fm.Mechanism:
    """The scene as a mechanism, which tells energies."""
    return fm.mechanisms.slider_pendulum().replace(**scene.parameters)


def energies(scene: fm.Scene, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Kinetic energy, and U = Pi - F x2 with the constant force's potential [J]."""
    found = general(scene).energies(y)
    x2 = scene.l * (np.cos(y[..., 0]) - np.sin(y[..., 1]))
    return found.kinetic, found.potential - scene.F0 * x2


def potential(scene: fm.Scene, sides: int) -> tuple[np.ndarray, np.ndarray]:
    """U [J] over (phi, theta) from -pi to pi, and the angles of a side [rad]."""
    angles = np.linspace(-np.pi, np.pi, sides)
    states = np.zeros((sides, sides, 4))
    states[..., 0], states[..., 1] = np.meshgrid(angles, angles, indexing="ij")
    return energies(scene, states)[1], angles


def completeness() -> None:
    """Lines on which one of the two generalized forces vanishes; rest is where they cross."""
    U, angles = potential(BISTABLE, 401)
    slopes = np.gradient(U, angles, angles)
    with style():
        figure = new_figure(6.4, 5.6)
        axes = figure.subplots()
        for slope, color in zip(slopes, ("blue", "orange"), strict=True):
            axes.contour(angles, angles, slope.T, levels=[0.0], colors=[PALETTE[color]], linewidths=1.4)
        marks = {"minimum": "o", "saddle": "D", "maximum": "^"}
        found = fm.find_equilibria(BISTABLE)
        for kind, mark in marks.items():
            places = np.array([e.position for e in found if e.kind == kind])
            axes.plot(*places.T, mark, color="black", ms=8, label=f"{kind} of U ({len(places)})")
        for color, name in (("blue", "∂U/∂φ = 0"), ("orange", "∂U/∂θ = 0")):
            axes.plot([], [], color=PALETTE[color], label=name)
        axes.set_xlabel("φ [rad]")
        axes.set_ylabel("θ [rad]")
        axes.set_aspect("equal")
        axes.set_title(f"{len(found)} positions of rest; minima + maxima − saddles = 0\n{setting(BISTABLE)}")
        figure.legend(loc="outside lower center", ncols=3)
        save(figure, HERE / "completeness.png")


def capture() -> None:
    """A motion that loses energy until it cannot leave its well."""
    U, angles = potential(BISTABLE, 301)
    start = np.array([-2.2, 2.6, 0.0, 0.0])
    label = fm.label_starts(BISTABLE, start)
    tree = label.tree
    well, at = int(label.well[0]), float(label.time[0])
    barrier = float(tree.barrier[tree.wells.index(well)])
    times = np.linspace(0.0, 4.0 * at, 2001)
    run = fm.integrate(BISTABLE, start, t_eval=times, tol=1e-8)
    total = np.sum(energies(BISTABLE, run.y[:, 0]), axis=0)
    with style():
        edge = Stroke(linewidth=3.0, foreground="black")
        figure = new_figure(10.4, 5.2)
        left, right = figure.subplots(1, 2)
        filled = left.contourf(angles, angles, U.T, levels=24, cmap="cividis")
        figure.colorbar(filled, ax=left, label="potential U [J]")
        left.contour(angles, angles, U.T, levels=[barrier], colors="white", linewidths=1.6)
        handles = [entry(f"U = B = {barrier:.4g} J", color="white", lw=1.6, path_effects=[edge, Normal()])]
        path = run.y[:, 0, :2] - 2.0 * np.pi * np.round(run.y[:, 0, :2] / (2.0 * np.pi))
        path[1:][np.abs(np.diff(path, axis=0)).max(axis=1) > np.pi] = np.nan
        before = times <= at
        left.plot(*path[before].T, color=PALETTE["vermillion"], lw=1.6)
        left.plot(*path[~before].T, color=PALETTE["sky"], lw=1.6)
        left.plot(*start[:2], "o", color=PALETTE["vermillion"], ms=7)
        handles += [
            entry("start at rest", color=PALETTE["vermillion"], marker="o", ms=7, ls="none"),
            entry("path, still free", color=PALETTE["vermillion"], lw=1.6),
            entry("path, captured", color=PALETTE["sky"], lw=1.6),
        ]
        figure.legend(handles=handles, loc="outside lower left", ncols=4)
        left.set_xlabel("φ [rad]")
        left.set_ylabel("θ [rad]")
        left.set_aspect("equal")
        left.grid(False)
        left.set_title("potential U; B is the barrier of the well")
        right.plot(times[before], total[before], color=PALETTE["vermillion"], label="energy E, still free")
        right.plot(times[~before], total[~before], color=PALETTE["sky"], label="energy E, captured")
        right.axhline(barrier, color="black", ls="--", lw=1.2, label=f"barrier B = {barrier:.4g} J")
        right.axvline(at, color="0.5", lw=1.0, ls=":", label=f"label is given at {at:.3g} s")
        right.set_xlabel("time t [s]")
        right.set_ylabel("energy [J]")
        right.set_title("below B in the well's region: it cannot leave")
        right.legend(loc="upper right")
        suptitle(figure, f"A motion that is captured by its well\n{setting(BISTABLE)}")
        save(figure, HERE / "capture.png")


def errors() -> None:
    """Estimated errors of motions against true ones."""
    scene = BISTABLE
    starts = np.zeros((600, 4))
    starts[:, :2] = np.random.default_rng(1).uniform(-np.pi, np.pi, (600, 2))
    exact = fm.integrate(scene, starts, 10.0, tol=1e-12, quantile=1.0).y[-1]
    with style():
        figure = new_figure(6.2, 5.4)
        axes = figure.subplots()
        for tol, color in ((1e-3, "vermillion"), (1e-6, "blue"), (1e-9, "green")):
            run = fm.integrate(scene, starts, 10.0, tol=tol, quantile=1.0)
            true = np.abs(run.y[-1] - exact).max(axis=-1)
            within = f"{np.mean(true <= tol):.1%} within"
            axes.loglog(run.error, true, ".", color=PALETTE[color], ms=4, label=f"tol = {tol:g}: {within}")
            axes.axhline(tol, color=PALETTE[color], lw=1.0, ls="--")
        ends = [1e-14, 1e-2]
        axes.plot(ends, ends, color="black", lw=1.0, label="true = estimated")
        axes.plot([], [], color="black", lw=1.0, ls="--", label="the tolerance")
        axes.set_xlabel("estimated error of a state, run.error [rad or rad/s]")
        axes.set_ylabel("true error of a state [rad or rad/s]")
        suptitle(figure, f"600 motions of 10 s from rest\n{setting(scene)}")
        figure.legend(loc="outside lower center", ncols=2)
        save(figure, HERE / "errors.png")


def step_limits() -> None:
    """Error over the step, with the longest stable step of each method."""
    scene = fm.Scene(alpha=0.0, beta=3000.0)
    rest = fm.find_equilibria(scene)[0]
    start = [rest.position[0] + 0.3, rest.position[1] + 0.2, 0.0, 0.0]
    exact = fm.integrate(scene, start, 1.0, dt=2e-5, method="radau5").y[-1, 0]
    with style():
        figure = new_figure(7.4, 4.8)
        axes = figure.subplots()
        for method, color in (
            ("ab6", "vermillion"),
            ("rk4", "blue"),
            ("dop853", "green"),
            ("radau5", "purple"),
        ):
            steps = 1.0 / np.unique(np.round(np.geomspace(10, 20000, 40)))
            error = []
            for dt in steps:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", fm.StepWarning)  # this is what is shown
                    run = fm.integrate(scene, start, 1.0, dt=float(dt), method=method)
                error.append(
                    np.abs(run.y[-1, 0] - exact).max() if np.isfinite(run.y[-1, 0]).all() else np.nan
                )
            axes.loglog(steps, error, ".-", color=PALETTE[color], label=method)
            limit = fm.largest_stable_step(scene, rest, method)
            if np.isfinite(limit):
                axes.axvline(limit, color=PALETTE[color], ls="--", lw=1.0)
        axes.set_xlabel("step dt [s]")
        axes.set_ylabel("error of the state after 1 s [rad or rad/s]")
        axes.set_ylim(1e-15, 1e2)
        axes.set_title(f"{setting(scene)}\ndashed: fm.largest_stable_step of the method; radau5 has no limit")
        figure.legend(loc="outside lower center", ncols=4)
        save(figure, HERE / "step_limits.png")


def gallery(names: str = "*") -> None:
    """One picture of every shipped request, or of one, drawn by the commands that the page shows.

    Results are kept in ``results/gallery``, so that pictures are drawn anew without computing.
    """
    pictures, results = HERE / "gallery", ROOT / "results" / "gallery"
    for folder in (pictures, results):
        folder.mkdir(parents=True, exist_ok=True)
    for request in sorted((ROOT / "scans").rglob(f"{names}.toml")):
        shown = SHOWN[request.stem]["picture"]
        result = results / f"{request.stem}.h5"
        with tempfile.TemporaryDirectory() as folder:
            text = request.read_text(encoding="utf-8").replace("num = 4000", "num = 400")
            (coarse := Path(folder) / request.name).write_text(text, encoding="utf-8")
            own = request.with_suffix(".py")
            name = "mechanism" if own.exists() and "def mechanism" in own.read_text() else "system"
            how = ["--mechanism", f"{own}:{name}"] if own.exists() else []
            fastmech = [sys.executable, "-m", "fastmech"]
            subprocess.run([*fastmech, "run", str(coarse), "--out", str(result), *how], check=True)
            section = ["--section", shown.rpartition("/")[0]]
            subprocess.run([*fastmech, "plot", str(result), "--out", folder, *section], check=True)
            drawn = Path(folder) / f"{shown.replace('/', '_')}.png"
            Image.open(drawn).convert("RGB").save(pictures / f"{request.stem}.png", optimize=True)


DRAWN = {
    "readme": (sketch, basins, motion),
    "explanations": (completeness, capture, errors, step_limits),
    "gallery": (gallery,),
}

if __name__ == "__main__":
    HERE.mkdir(exist_ok=True)
    for word in sys.argv[1:] or DRAWN:
        for draw in DRAWN.get(word, [partial(gallery, word)]):
            draw()
