"""``fm.animate``: a motion as a film, a GIF or a page, drawn as every picture of a mechanism is."""

from __future__ import annotations

import shutil
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from fastmech.errors import InputError, shown
from fastmech.models.mechanism import Mechanism
from fastmech.plots.equilibria import draw_mechanism, drawing_of
from fastmech.plots.style import new_figure, style
from fastmech.scene import Scene

#: Matplotlib's writer by ending of the file.
WRITERS = {".mp4": "ffmpeg", ".gif": "pillow", ".html": "html"}


def animate(
    system: Scene | Mechanism, run: Any, path: str | PathLike[str], *, which: int = 0, fps: int = 30
) -> Path:
    """Write one trajectory of a run as a film in real time.

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
    force = system.F0 if isinstance(system, Scene) else 0.0
    drawn = drawing_of(system, q, force)
    with style():
        figure = new_figure(5.0, 5.0)
        axes = figure.add_subplot()

        def draw(frame: int) -> list[Any]:
            axes.clear()
            draw_mechanism(axes, drawn, frame)
            axes.set_title(f"{frames[frame]:.2f} s")
            return []

        film = FuncAnimation(figure, draw, frames=len(frames), interval=1000.0 / fps)
        if target.suffix == ".html":
            with_rc = film.to_jshtml(fps=fps, embed_frames=True)
            target.write_text(with_rc, encoding="utf-8")
        else:
            film.save(target, writer=WRITERS[target.suffix], fps=fps, dpi=100)
    return target
