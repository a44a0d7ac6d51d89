"""What is computed for a page: each kind of message has a function that yields frames as they are ready.

The thread that computes is told beforehand how long its answer is wanted (``fastmech.interrupts``): a newer
message ends it between two calls of a kernel, some milliseconds later. What a view needs is imported by it.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import numpy as np

from fastmech.explore.device import Device, Floats
from fastmech.explore.lines import grid, python_of, request_of
from fastmech.explore.messages import COARSEST, frame
from fastmech.interrupts import check

#: Starts of a picture's tile, some 40 ms; divisions of the first atlas along each axis.
TILE, ATLAS = 5_000, 20

#: What views import; one thread at a time, in this order unless a page asks for another.
MODULES = {
    "equilibria": ("models.equilibria", "models.stability", "models.drawing", "mechanisms"),
    "motion": ("ensembles.integrate",),
    "basins": ("basins.label",),
    "atlas": ("slider.atlas.map", "slider.atlas.folds", "atlas.critical_curves"),
}
_LOADING = threading.Lock()


def load(kind: str) -> None:
    """Import what a kind of view needs."""
    with _LOADING:
        for name in MODULES.get(kind, MODULES["equilibria"]):
            import_module(f"fastmech.{name}")


def replies(device: Device, message: Any) -> Iterator[bytes]:
    """Frames that answer a message.

    Raises:
        InputError: the message asks for what the device cannot do.
        Cancelled: the answer is not wanted any more.
    """
    load(message.kind)
    for content in _WORK[message.kind](device, message):
        check()
        yield content


def _header(device: Device, message: Any, divisions: int, /, **more: Any) -> dict[str, Any]:
    python, request = (of(device, message, divisions) for of in (python_of, request_of))
    return {"kind": message.kind, "id": message.id, "python": python, "request": request, **more}


def _drawn(device: Device, message: Any, q: Any) -> tuple[dict[str, Any], Floats]:
    drawn = device.drawn(message.parameters, q)
    masses = [float(m) if np.isfinite(m) else None for m in drawn.mass]
    told = {"elements": drawn.kind.tolist(), "names": drawn.name, "masses": masses, "angles": drawn.angles}
    return told, drawn.ends


def _equilibria(device: Device, message: Any) -> Iterator[bytes]:
    from fastmech.models.equilibria import find_equilibria
    from fastmech.models.stability import classify

    system = device.at(message.parameters)
    found: Any = find_equilibria(system)
    rows = []
    for e in found:
        own: Any = classify(system, e)
        slowest = -float(np.real(own.eigenvalues).max())
        row = {"kind": e.kind, "verdict": own.verdict, "explanation": own.explanation}
        row |= {"energy": float(e.energy) if np.isfinite(e.energy) else None}
        row |= {"decay_time": 1.0 / slowest if slowest > 0.0 else None, "position": [*map(float, e.position)]}
        rows.append(row)
        check()
    told, ends = _drawn(device, message, [row["position"] for row in rows])
    axes = {name: grid(ends, message.num - 1) for name, ends in message.axes.items()}
    energy = device.energy(message.parameters, device.states(axes, message.fixed))
    header = _header(device, message, message.num - 1, rows=rows, axes=message.axes, **told)
    header |= {"certificate": found.certificate.sentence, "complete": bool(found.certificate.complete)}
    yield frame(header, {"ends": ends} | ({} if energy is None else {"landscape": energy.T}))


def _motion(device: Device, message: Any) -> Iterator[bytes]:
    from fastmech.ensembles.integrate import integrate

    system = device.at(message.parameters)
    start = device.states({}, message.start)
    times, y, status = np.zeros(1), start[None], ""
    if message.t_end > 0.0:
        times = np.linspace(0.0, message.t_end, message.outputs)
        run = integrate(system, start[None], message.t_end, t_eval=times, dt=device.dt, method="dop853")
        y, status = run.y[:, 0], run.failures or ""
    told, ends = _drawn(device, message, y[:, : len(device.coordinates)])
    made = device.mechanism(message.parameters)
    energies, powers = made.energies(y), made.powers(times, y)
    # Works by the trapezoidal rule between the outputs.
    brought, lost = (
        np.append(0.0, np.cumsum(0.5 * np.diff(times) * (one[1:] + one[:-1])))
        for one in (np.broadcast_to(power, times.shape) for power in powers)
    )
    header = _header(device, message, 0, t_end=message.t_end, status=status, **told)
    arrays = {"times": times, "y": y, "ends": ends, "kinetic": energies.kinetic}
    yield frame(header, arrays | {"potential": energies.potential, "brought": brought, "lost": lost})


def _basins(device: Device, message: Any) -> Iterator[bytes]:
    from fastmech.basins.label import label_starts

    system, finest = device.at(message.parameters), COARSEST * 2**message.halvings
    states = device.states({name: grid(ends, finest) for name, ends in message.axes.items()}, message.fixed)
    well, time = np.full(states.shape[:2], -2, dtype=np.int8), np.zeros(states.shape[:2], dtype=np.float32)
    turns = np.zeros((*well.shape, len(device.coordinates)), dtype=np.int8)
    for step in (2**k for k in range(message.halvings, -1, -1)):
        starts, *fields = (one[::step, ::step] for one in (states, well, time, turns))
        missing = np.argwhere(fields[0] == -2)
        for begin in range(0, len(missing), TILE):
            i, j = missing[begin : begin + TILE].T
            labels: Any = label_starts(system, starts[i, j], message.t_end)
            found = labels.well, labels.time, np.clip(labels.turns, -127, 127)
            for field, values in zip(fields, found, strict=True):
                field[i, j] = values
            last, divisions = begin + TILE >= len(missing), finest // step
            header = _header(device, message, divisions, axes=message.axes, divisions=divisions)
            header |= {"wells": [int(one) for one in labels.tree.wells], "from": int(i[0]), "last": last}
            rows = slice(int(i[0]), len(starts) if last else int(i[-1]) + 1)
            arrays = {name: one[rows] for name, one in zip(("well", "time", "turns"), fields, strict=True)}
            yield frame(header | {"final": step == 1}, arrays)


def _atlas(device: Device, message: Any) -> Iterator[bytes]:
    from fastmech.atlas.critical_curves import critical_curves
    from fastmech.slider.atlas.folds import trace_folds
    from fastmech.slider.atlas.map import map_equilibria

    system = device.at(message.parameters)
    for halving in range(message.halvings + 1):
        divisions = ATLAS * 2**halving
        axes = {name: grid(ends, divisions) for name, ends in message.axes.items()}
        found: Any = map_equilibria(system, axes, progress=lambda _: check())
        header = _header(device, message, divisions, axes=message.axes, divisions=divisions, curves=[])
        fields = {"count": found.count, "stable": found.count_stable}
        yield frame(header, fields)
    curves: Any = (trace_folds if device.is_scene else critical_curves)(system, *axes.items())
    complete = bool(getattr(curves, "complete", False))
    header |= {"curves": [curve.kind for curve in curves.curves], "curves_complete": complete}
    lines = {f"curve{k}": np.stack([c.x, c.y]) for k, c in enumerate(curves.curves)}
    yield frame(header, fields | lines)


def _pull(device: Device, message: Any) -> Iterator[bytes]:
    from scipy.optimize import least_squares

    made = device.mechanism(message.parameters, still=True)
    made.moved(message.point, message.q)  # says what is wrong

    def away(q: Floats) -> Floats:
        return made.places([q])[0][message.point][0] - message.to

    q = least_squares(away, message.q, jac=lambda q: made.moved(message.point, q), max_nfev=30).x
    state = dict.fromkeys(device.state, 0.0) | dict(zip(device.coordinates, map(float, q), strict=True))
    yield frame({"kind": "pull", "id": message.id, "state": state}, {})


def _strike(device: Device, message: Any) -> Iterator[bytes]:
    """An impulse p on a point changes momenta by its slopes' transpose times p."""
    made = device.mechanism(message.parameters, still=True)
    slopes, metric = made.moved(message.point, message.q), made.metric(message.q)
    momenta = slopes.T @ (message.mass * np.array(message.velocity))
    rates = np.linalg.solve(metric, momenta)
    state = dict(zip(device.state, [*message.q, *map(float, rates)], strict=True))
    speed, energy = float(np.hypot(*(slopes @ rates))), float(0.5 * momenta @ rates)
    header = {"kind": "strike", "id": message.id, "energy": energy, "speed": speed, "state": state}
    yield frame(header, {})


_VIEWS = (_equilibria, _motion, _basins, _atlas, _pull, _strike)
_WORK: dict[str, Callable[[Device, Any], Iterator[bytes]]] = {one.__name__[1:]: one for one in _VIEWS}
