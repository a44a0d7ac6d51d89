"""``fm.animate``: a motion as a film, a GIF or a page, drawn as every picture of a mechanism is."""

from __future__ import annotations

import shutil
from itertools import compress
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.errors import InputError, shown
from fastmech.models.drawing import Drawing, Element, drawing
from fastmech.models.mechanism import Mechanism
from fastmech.plots.equilibria import ARROW, FORCE, draw_mechanism
from fastmech.plots.style import PALETTE, new_figure, style, symbol
from fastmech.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes


#: Half the width of a letter, and how far words stay from lines and other words, over the extent of all.
LETTER, APART = 0.012, 0.045

#: Matplotlib's writer by ending of the file.
WRITERS = {".mp4": "ffmpeg", ".gif": "pillow", ".html": "html"}


def load_arrows(mechanism: Mechanism, q: ArrayLike, times: Floats) -> tuple[Floats, Floats]:
    """Forces: ends a unit apart (m, k, 2, 2) [m] at positions (m, n), values (m, k) [N] at times (m,) [s]."""
    import sympy

    t = sympy.Symbol("t")
    ends, values = [np.zeros((len(times), 0, 2, 2))], [np.zeros((len(times), 0))]
    for (kind, load, *_), (*_, places) in zip(mechanism._drawn, mechanism.places(q)[1], strict=False):
        if kind is Element.LOAD:
            one = load.at(mechanism.parameters)
            value = getattr(one, "function", None) or sympy.lambdify(t, one.expression(t), "math")
            ends.append(places[:, None])
            values.append(np.array([float(value(float(s))) for s in times])[:, None])
    return np.concatenate(ends, axis=1), np.concatenate(values, axis=1)


def animate(
    system: Scene | Mechanism, run: Any, path: str | PathLike[str], *, which: int = 0, fps: int = 30
) -> Path:
    """Write one trajectory of a run as a film in real time, with angles marked and loads as they are then.

    The arrow of the trajectory's largest force is a sixth of the mechanism long, the others in proportion.

    Args:
        system: whose run it is.
        run: what :func:`fastmech.integrate` gives, with ``t_eval``; pictures between its outputs are
            interpolated.
        path: a file ``.mp4`` (needs the program ffmpeg), ``.gif`` or ``.html``.
        which: number of the trajectory.
        fps: pictures a second.

    Returns:
        The file.

    Raises:
        InputError: an argument is wrong, the trajectory has failed, or ffmpeg is missing.
    """
    target = Path(path)
    if target.suffix not in WRITERS:
        raise InputError(f"path = {shown(str(path))}: must end with {', '.join(WRITERS)}")
    if target.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise InputError("path: .mp4 needs the program ffmpeg, which is not there; .gif and .html do without")
    if not isinstance(system, Scene | Mechanism):
        raise InputError(f"system = {shown(system)}: must be a Scene or a Mechanism")
    if not isinstance(fps, int) or not 1 <= fps <= 120:
        raise InputError(f"fps = {shown(fps)}: must be a whole number from 1 to 120")
    times, y = np.asarray(run.t), np.asarray(run.y)
    if len(times) < 2:
        raise InputError("run: has one output; give fm.integrate times by t_eval")
    if not isinstance(which, int) or not 0 <= which < y.shape[1]:
        raise InputError(f"which = {shown(which)}: must be a trajectory's number, 0 to {y.shape[1] - 1}")
    if not np.isfinite(y[:, which]).all():
        raise InputError(f"which = {which}: this trajectory has failed: {run.failures}")
    from matplotlib.animation import FuncAnimation

    frames = np.arange(times[0], times[-1], 1.0 / fps)
    own = y[:, which, : y.shape[2] // 2]
    q = np.stack([np.interp(frames, times, column) for column in own.T], axis=-1)
    if isinstance(system, Scene):
        from fastmech.mechanisms.slider_pendulum import slider_pendulum

        system = slider_pendulum().replace(**{n: value for n, (value, *_) in system.described().items()})
    whole, arrows = drawing(system, q), load_arrows(system, q, frames)
    kept = whole.kind != Element.LOAD  # an arrow as long as its load's mean asks for
    names, ends = tuple(compress(whole.name, kept)), whole.ends[:, kept]
    drawn = whole._replace(kind=whole.kind[kept], name=names, mass=whole.mass[kept], ends=ends)
    with style():
        figure = new_figure(5.0, 5.0)
        axes = figure.add_subplot()

        def draw(frame: int) -> list[Any]:
            axes.clear()
            draw_mechanism(axes, drawn, frame)
            _mark(axes, system, drawn, q[frame], frame)
            _push(axes, drawn, *arrows, frame)
            axes.set_title(f"{frames[frame]:.2f} s\n{_told(system, q[frame])}", fontsize=10)
            return []

        film = FuncAnimation(figure, draw, frames=len(frames), interval=1000.0 / fps)
        if target.suffix == ".html":
            with_rc = film.to_jshtml(fps=fps, embed_frames=True)
            target.write_text(with_rc, encoding="utf-8")
        else:
            film.save(target, writer=WRITERS[target.suffix], fps=fps, dpi=100)
    return target


def _size(drawn: Drawing) -> float:
    """Extent of all that is drawn [m]."""
    corners = drawn.ends[:, drawn.kind != Element.GUIDE].reshape(-1, 2)
    return max(float(np.ptp(corners, axis=0).max(initial=0.0)), 1e-12)


def _mark(axes: Axes, mechanism: Mechanism, drawn: Drawing, q: Floats, frame: int) -> None:
    """Coordinates that are angles of rods, as arcs."""
    radius = ARROW * _size(drawn)
    look: dict[str, Any] = {"color": PALETTE["orange"], "zorder": 4}
    for rod, end, k, sign, origin in drawn.angles:
        angle = sign * (q[k] - 2.0 * np.pi * np.round(q[k] / (2.0 * np.pi)))
        x, y = drawn.ends[frame, rod, end]
        turns = origin + np.linspace(0.0, angle, 33)
        far, middle = 1.25 * radius, turns[16]
        axes.plot([x, x + far * np.cos(origin)], [y, y + far * np.sin(origin)], ls="--", lw=0.9, **look)
        axes.plot(x + radius * np.cos(turns), y + radius * np.sin(turns), lw=1.6, **look)
        name = symbol(str(mechanism.coordinates[k].symbol))
        ways = [(middle, 1.3), (middle, 0.65), *((middle + turn, 1.5) for turn in (0.6, -0.6, 1.2, -1.2))]
        spots = [(x + far * radius * np.cos(way), y + far * radius * np.sin(way)) for way, far in ways]
        place = _free(axes, drawn, frame, spots, 1)
        axes.text(place[0], place[1], name, ha="center", va="center")


def _free(
    axes: Axes, drawn: Drawing, frame: int, spots: list[tuple[float, float]], letters: int
) -> tuple[float, float]:
    """The first of some places [m] for words where neither lines nor other words are, or the freest."""
    size = _size(drawn)
    lines = drawn.ends[frame, np.isin(drawn.kind, (Element.ROD, Element.SPRING, Element.DAMPER))]
    along = np.linspace(0.0, 1.0, 41)[:, None]
    taken = [a + along * (b - a) for a, b in lines]
    taken += [np.array([one.get_position()], dtype=float) for one in axes.texts if one.get_text()]
    half = LETTER * size * letters
    ways = np.array(spots)[:, None] + np.array([[-half, 0.0], [0.0, 0.0], [half, 0.0]])
    away = np.linalg.norm(ways[:, :, None] - np.concatenate([np.empty((0, 2)), *taken]), axis=-1)
    return spots[int(np.argmax(np.minimum(away.min(axis=(1, 2), initial=np.inf), APART * size)))]


def _told(mechanism: Mechanism, q: Floats) -> str:
    """Coordinates as numbers."""
    each = [(str(c.symbol), value) for c, value in zip(mechanism.coordinates, q, strict=True)]
    return ", ".join(
        f"{symbol(n)} = {v:z.3f} {'m' if n in mechanism.lengths else f'rad ({np.degrees(v):z.1f}°)'}"
        for n, v in each
    )


def _push(axes: Axes, drawn: Drawing, ends: Floats, values: Floats, frame: int) -> None:
    """Loads at one moment as arrows with their values."""
    longest = ARROW * _size(drawn) / max(float(np.abs(values).max(initial=0.0)), 1e-300)
    for (a, b), value in zip(ends[frame], values[frame], strict=True):
        tip = a + longest * value * (b - a)
        look: dict[str, Any] = {"arrowstyle": "-|>", "color": FORCE, "lw": 2.4, "shrinkA": 0, "shrinkB": 0}
        look["mutation_scale"] = 14.0 * min(1.0, 3.0 * float(np.hypot(*(tip - a))) / (ARROW * _size(drawn)))
        if value:
            axes.annotate("", xy=tuple(tip), xytext=tuple(a), arrowprops=look, zorder=6)
            words, step = f"{value:.3g} N", APART * _size(drawn)
            ways = [(0.0, 1.0), (0.0, -1.0), (1.5, 1.0), (1.5, -1.0), (-1.5, 1.0), (-1.5, -1.0), (0.0, 2.0)]
            spots = [(float(tip[0] + step * u), float(tip[1] + step * v)) for u, v in [*ways, (0.0, -2.0)]]
            place = _free(axes, drawn, frame, spots, len(words))
            axes.annotate(words, place, color=FORCE, ha="center", va="center", fontsize=8)
