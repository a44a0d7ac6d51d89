"""``fm.animate``: a motion as a film, a GIF or a page, drawn as every picture of a mechanism is."""

from __future__ import annotations

import re
import shutil
from itertools import compress
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.ensembles.integrate import Trajectories
from fastmech.errors import InputError, shown
from fastmech.models.drawing import Drawing, Element, drawing
from fastmech.models.mechanism import Mechanism
from fastmech.plots.equilibria import (
    APART,
    ARROW,
    FORCE,
    MARGIN,
    Words,
    draw_force,
    draw_mechanism,
    extent,
    legend_handles,
    name_points,
)
from fastmech.plots.style import PALETTE, entry, legend_below, new_figure, setting, style, suptitle, symbol
from fastmech.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes


#: How many times the arrow of the force that gives the scale the longest arrow is.
LONGEST = 3.0

#: The longer side of the axes [inch].
LONG_SIDE = 4.8

#: Letters in a line of the title, at most.
IN_A_LINE = 60

#: Matplotlib's writer by ending of the file.
WRITERS = {".mp4": "ffmpeg", ".gif": "pillow", ".html": "html"}

#: Signs on the buttons of a page, in place of those that Matplotlib has browsers fetch from elsewhere.
SIGNS = {
    "minus": "−",
    "fast-backward": "«",
    "step-backward": "‹",
    "play fa-flip-horizontal": "◂",
    "pause": "❚❚",
    "play": "▸",
    "step-forward": "›",
    "fast-forward": "»",
    "plus": "+",
}


class Moments(NamedTuple):
    """What is drawn of a mechanism at m moments."""

    mechanism: Mechanism
    q: Floats  #: coordinates (m, n)
    drawn: Drawing  #: without loads
    ends: Floats  #: of loads, a unit apart [m]: (m, k, 2, 2)
    forces: Floats  #: [N] (m, k)


def load_arrows(mechanism: Mechanism, q: ArrayLike, times: Floats) -> tuple[Floats, Floats, list[float]]:
    """Forces: ends a unit apart (m, k, 2, 2) [m] at positions (m, n), values (m, k) [N] at times (m,) [s].

    With them the mean [N] of each, under which the mechanism rests.
    """
    import sympy

    t, means = sympy.Symbol("t"), list[float]()
    ends, values = [np.zeros((len(times), 0, 2, 2))], [np.zeros((len(times), 0))]
    for (kind, load, *_), (_, mean, places) in zip(mechanism._drawn, mechanism.places(q)[1], strict=False):
        if kind is Element.LOAD:
            one = load.at(mechanism.parameters)
            value = getattr(one, "function", None) or sympy.lambdify(t, one.expression(t), "math")
            ends.append(places[:, None])
            values.append(np.array([float(value(float(s))) for s in times])[:, None])
            means.append(mean)
    return np.concatenate(ends, axis=1), np.concatenate(values, axis=1), means


def moments(system: Scene | Mechanism, q: ArrayLike, times: ArrayLike) -> Moments:
    """What is drawn of a mechanism at positions (m, n) and times (m,) [s].

    Raises:
        InputError: nothing of it can be drawn.
    """
    if isinstance(system, Scene):
        from fastmech.mechanisms.slider_pendulum import slider_pendulum

        system = slider_pendulum().replace(**system.parameters)
    places = np.asarray(q, dtype=np.float64).reshape(-1, len(system.coordinates))
    whole = drawing(system, places)
    if not whole.kind.size:
        raise InputError("system: has no points in a plane, nothing of it can be drawn")
    ends, forces, _ = load_arrows(system, places, np.asarray(times, dtype=np.float64))
    kept = whole.kind != Element.LOAD  # an arrow as long as its load's mean asks for
    drawn = whole._replace(
        kind=whole.kind[kept],
        name=tuple(compress(whole.name, kept)),
        mass=whole.mass[kept],
        ends=whole.ends[:, kept],
        angles=tuple(one._replace(rod=int(kept[: one.rod].sum())) for one in whole.angles),
    )
    return Moments(system, places, drawn, ends, forces)


def animate(
    system: Scene | Mechanism, run: Any, path: str | PathLike[str], *, which: int = 0, fps: int = 30
) -> Path:
    """Write one trajectory of a run as a film in real time, with angles marked and loads as they are then.

    The axes hold all that is drawn at any time. The arrow of the trajectory's largest force is a sixth of the
    mechanism long, the others in proportion.

    Args:
        system: whose run it is.
        run: what :func:`fastmech.integrate` gives, with ``t_eval``; pictures between its outputs are
            interpolated.
        path: a file ``.mp4`` (needs the program ffmpeg), ``.gif`` or ``.html``, in a folder that is there.
        which: number of the trajectory.
        fps: pictures a second.

    Returns:
        The file.

    Raises:
        InputError: an argument is wrong, the trajectory has failed, nothing of the system can be drawn, or
            ffmpeg is missing.
    """
    if not isinstance(path, str | PathLike):
        raise InputError(f"path = {shown(path)}: must be the name of a file")
    target = Path(path)
    if target.suffix not in WRITERS:
        raise InputError(f"path = {shown(str(path))}: must end with {', '.join(WRITERS)}")
    if not target.parent.is_dir():
        raise InputError(f"path = {shown(str(path))}: there is no such folder")
    if target.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise InputError("path: .mp4 needs the program ffmpeg, which is not there; .gif and .html do without")
    if not isinstance(system, Scene | Mechanism):
        raise InputError(f"system = {shown(system)}: must be a Scene or a Mechanism")
    if not isinstance(fps, int) or not 1 <= fps <= 120:
        raise InputError(f"fps = {shown(fps)}: must be a whole number from 1 to 120")
    if not isinstance(run, Trajectories):
        raise InputError(f"run = {shown(run)}: must be what fm.integrate gives")
    times, y = run.t, run.y
    if len(times) < 2:
        raise InputError("run: has one output; give fm.integrate times by t_eval")
    if not isinstance(which, int) or not 0 <= which < y.shape[1]:
        raise InputError(f"which = {shown(which)}: must be a trajectory's number, 0 to {y.shape[1] - 1}")
    if not np.isfinite(y[:, which]).all():
        raise InputError(f"which = {which}: this trajectory has failed: {run.failures}")
    from matplotlib import rc_context
    from matplotlib.animation import FuncAnimation

    frames = np.arange(times[0], times[-1], 1.0 / fps)
    own = y[:, which, : y.shape[2] // 2]
    shown_at = moments(system, np.stack([np.interp(frames, times, one) for one in own.T], axis=-1), frames)
    with style():
        figure = new_figure(5.0, 5.0)
        suptitle(figure, setting(system))  # of the figure: every moment has its own title
        axes = figure.add_subplot()
        draw_moment(axes, shown_at)
        axes.set_title(f"0 s\n{axes.get_title()}", fontsize=10)
        sides = np.ptp([axes.get_xlim(), axes.get_ylim()], axis=1)
        width, height = LONG_SIDE * sides / sides.max()
        figure.set_size_inches(max(width, 4.0) + 0.8, height + 1.3)
        kinds = [*shown_at.drawn.kind, *[Element.LOAD] * bool(shown_at.forces.any())]
        handles = legend_handles(shown_at.drawn._replace(kind=np.array(kinds)))
        handles += [entry("angle", color=PALETTE["orange"], lw=1.6)] * bool(shown_at.drawn.angles)
        legend_below(figure, handles, 4)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # all pictures have their axes in one place

        def draw(frame: int) -> list[Any]:
            axes.clear()
            draw_moment(axes, shown_at, frame)
            axes.set_title(f"{frames[frame]:.2f} s\n{axes.get_title()}", fontsize=10)
            return []

        film = FuncAnimation(figure, draw, frames=len(frames), interval=1000.0 / fps)
        if target.suffix == ".html":
            with rc_context({"animation.embed_limit": np.inf}):  # by default the end of a film is left out
                page = re.sub(r"<link[^>]*>", "", film.to_jshtml(fps=fps, embed_frames=True))
            target.write_text(
                re.sub(r'<i class="fa fa-([^"]*)"></i>', lambda icon: SIGNS[icon[1]], page), encoding="utf-8"
            )
        else:
            film.save(target, writer=WRITERS[target.suffix], fps=fps, dpi=100)
    return target


def draw_moment(axes: Axes, at: Moments, which: int = 0, *, force: float | None = None) -> None:
    """Draw one moment with angles, forces and their values; the axes hold those of all moments.

    Args:
        axes: where.
        at: the moments.
        which: number of the moment.
        force: of the arrow that is a sixth of the mechanism long [N]; none is longer than three times that.
            By default the largest of all moments. The explorer's lines give it: its arrows keep their scale.
    """
    drawn, size = at.drawn, extent(at.drawn)
    nameless = drawn._replace(name=("",) * len(drawn.name))  # names stand where loads and angles let them
    draw_mechanism(axes, nameless, which)
    unit = force or float(np.abs(at.forces).max(initial=0.0)) or 1.0
    lengths = ARROW * size * np.clip(at.forces / unit, -LONGEST, LONGEST)
    starts = at.ends[:, :, 0]
    tips = starts + lengths[..., None] * (at.ends[:, :, 1] - starts)
    corners = np.concatenate([drawn.ends[:, drawn.kind != Element.GUIDE].reshape(-1, 2), tips.reshape(-1, 2)])
    low, high = corners.min(axis=0) - MARGIN * size, corners.max(axis=0) + MARGIN * size
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    words = Words(axes, drawn, which)
    for a, tip, value in zip(starts[which], tips[which], at.forces[which], strict=True):
        if value:
            draw_force(words, a, tip, 14.0 * min(1.0, 3.0 * float(np.hypot(*(tip - a))) / (ARROW * size)))
    step = 1.2 * APART * words.inch
    for tip, value in zip(tips[which], at.forces[which], strict=True):
        ways = [(u, v) for far in (1.0, 1.5, 2.0) for u in (0.0, 1.5, -1.5) for v in (far, -far)]
        spots = [(float(tip[0] + step * u), float(tip[1] + step * v)) for u, v in ways]
        if value:
            words.say(f"{value:.3g} N", spots, color=FORCE, fontsize=8)
    _mark(words, at, which)
    name_points(words, drawn, which)  # last: there are most places for them
    axes.set_title(_told(at.mechanism, at.q[which]), fontsize=10)


def _mark(words: Words, at: Moments, which: int) -> None:
    """Coordinates that are angles of rods, as arcs."""
    radius, axes = ARROW * extent(at.drawn), words.axes
    look: dict[str, Any] = {"color": PALETTE["orange"], "zorder": 4}
    for rod, end, k, sign, origin in at.drawn.angles:
        q = at.q[which, k]
        angle = sign * (q - 2.0 * np.pi * np.round(q / (2.0 * np.pi)))
        x, y = at.drawn.ends[which, rod, end]
        turns = origin + np.linspace(0.0, angle, 33)
        far, middle = 1.25 * radius, turns[16]
        axes.plot([x, x + far * np.cos(origin)], [y, y + far * np.sin(origin)], ls="--", lw=0.9, **look)
        axes.plot(x + radius * np.cos(turns), y + radius * np.sin(turns), lw=1.6, **look)
        ways = [(middle, 1.3), (middle, 0.65), *((middle + turn, 1.5) for turn in (0.6, -0.6, 1.2, -1.2))]
        spots = [(x + far * radius * np.cos(way), y + far * radius * np.sin(way)) for way, far in ways]
        words.say(symbol(str(at.mechanism.coordinates[k].symbol)), spots)


def _told(mechanism: Mechanism, q: Floats) -> str:
    """Coordinates as numbers, in lines that the figure holds."""
    each = [
        f"{symbol(n)} = {v:z.3f} {'m' if n in mechanism.lengths else f'rad ({np.degrees(v):z.1f}°)'}"
        for n, v in zip((str(c.symbol) for c in mechanism.coordinates), q, strict=True)
    ]
    lines = each[:1]
    for one in each[1:]:
        if len(lines[-1]) + len(one) < IN_A_LINE:
            lines[-1] += f", {one}"
        else:
            lines.append(one)
    return "\n".join(lines)
