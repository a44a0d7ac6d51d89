"""What is computed for a page: each kind of message has a function that yields frames as they are ready."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.critical_curves import critical_curves
from fastmech.atlas.folds import trace_folds
from fastmech.atlas.map import map_equilibria
from fastmech.atlas.resting_map import RestingMap
from fastmech.basins.label import labels_of
from fastmech.ensembles.integrate import integrate
from fastmech.explore.device import Device
from fastmech.explore.lines import grid, python_of, request_of
from fastmech.explore.messages import COARSEST, frame
from fastmech.models.drawing import Drawing
from fastmech.models.equilibria import find_equilibria
from fastmech.models.stability import VERDICTS, classify

#: Starts of one call: what is under way when newer work comes lasts about 20 ms.
TILE = 2_500

#: Divisions of the first atlas along each axis.
ATLAS = 20

Progress = Callable[[int], None]


def replies(device: Device, message: Any, tell: Progress) -> Iterator[bytes]:
    """Frames that answer a message; ``tell`` is called often and raises where the work is to end.

    Raises:
        InputError: the message asks for what the device cannot do.
    """
    yield from _WORK[message.kind](device, message, tell)


def _header(device: Device, message: Any, divisions: int, /, **more: Any) -> dict[str, Any]:
    return {
        "kind": message.kind,
        "id": message.id,
        "python": python_of(device, message, divisions),
        "request": request_of(device, message, divisions),
        **more,
    }


def _equilibria(device: Device, message: Any, tell: Progress) -> Iterator[bytes]:
    system = device.at(message.parameters)
    found: Any = find_equilibria(system)
    tell(0)
    rows = []
    for k, e in enumerate(found):
        own: Any = classify(system, e)
        slowest = -float(np.real(own.eigenvalues).max())
        row = {"kind": e.kind, "verdict": own.verdict, "explanation": own.explanation}
        row |= {"energy": float(e.energy) if np.isfinite(e.energy) else None, "place": found.place(k)}
        row |= {
            "position": list(map(float, e.position)),
            "decay_time": 1.0 / slowest if slowest > 0.0 else None,
        }
        row |= {"eigenvalues": [[float(v.real), float(v.imag)] for v in own.eigenvalues]}
        rows.append(row)
        tell(0)
    drawn = device.drawn(message.parameters, [row["position"] for row in rows])
    axes = {name: grid(ends, message.num - 1) for name, ends in message.axes.items()}
    energy = device.energy(message.parameters, device.states(axes, message.fixed))
    header = _header(
        device, message, message.num - 1, rows=rows, certificate=found.certificate.sentence,
        complete=bool(found.certificate.complete), axes=message.axes, **_drawing(drawn)
    )  # fmt: skip
    landscape = {} if energy is None else {"landscape": energy.T}
    yield frame(header, {"ends": drawn.ends, **landscape})


def _drawing(drawn: Drawing) -> dict[str, Any]:
    masses = [float(m) if np.isfinite(m) else None for m in drawn.mass]
    return {"elements": drawn.kind.tolist(), "names": drawn.name, "masses": masses}


def _motion(device: Device, message: Any, tell: Progress) -> Iterator[bytes]:
    system = device.at(message.parameters)
    device.states({}, message.start)  # says which name is unknown
    start = np.array([message.start.get(name, 0.0) for name in device.state])
    if message.t_end == 0.0:
        y, times, status = start[None], np.zeros(1), ""
    else:
        times = np.linspace(0.0, message.t_end, message.outputs)
        run = integrate(
            system, start[None], message.t_end, t_eval=times, dt=device.dt, method="dop853",
            progress=tell,
        )  # fmt: skip
        y, status = run.y[:, 0], run.failures or ""
    drawn = device.drawn(message.parameters, y[:, : len(device.coordinates)])
    still = device.still(message.parameters)
    energies = still.energies(y)
    header = _header(device, message, 0, t_end=message.t_end, status=status, **_drawing(drawn))
    arrays = {"times": times, "y": y, "ends": drawn.ends}
    yield frame(header, arrays | {"kinetic": energies.kinetic, "potential": energies.potential})


def _basins(device: Device, message: Any, tell: Progress) -> Iterator[bytes]:
    system = device.at(message.parameters)
    known: tuple[NDArray[np.int8], NDArray[np.float32], NDArray[np.int8]] | None = None
    for halving in range(message.halvings + 1):
        divisions = COARSEST * 2**halving
        axes = {name: grid(ends, divisions) for name, ends in message.axes.items()}
        states = device.states(axes, message.fixed)
        shape = states.shape[:2]
        well = np.full(shape, -2, dtype=np.int8)
        time = np.full(shape, np.nan, dtype=np.float32)
        turns = np.zeros((*shape, len(device.coordinates)), dtype=np.int8)
        if known is not None:
            well[::2, ::2], time[::2, ::2], turns[::2, ::2] = known
        missing = np.argwhere(well == -2)
        for begin in range(0, len(missing), TILE):
            tell(0)
            i, j = missing[begin : begin + TILE].T
            labels: Any = labels_of(system, states[i, j], message.t_end, progress=tell)
            wells = [int(one) for one in labels.tree.wells]
            well[i, j], time[i, j] = labels.well, labels.time
            turns[i, j] = np.clip(labels.turns, -127, 127)
            done = int(i[-1]) if begin + TILE < len(missing) else shape[0]
            header = {"kind": "basins", "id": message.id, "axes": message.axes, "divisions": divisions}
            header |= {"wells": wells}
            first = int(i[0])
            header |= {
                "from": first,
                "last": begin + TILE >= len(missing),
                "final": halving == message.halvings,
            }
            if header["last"]:
                header |= _header(device, message, divisions)
            rows = slice(first, min(done + 1, shape[0]))
            yield frame(header, {"well": well[rows], "time": time[rows], "turns": turns[rows]})
        known = well, time, turns


def _atlas(device: Device, message: Any, tell: Progress) -> Iterator[bytes]:
    system = device.at(message.parameters)
    for halving in range(message.halvings + 1):
        divisions = ATLAS * 2**halving
        axes = {name: grid(ends, divisions) for name, ends in message.axes.items()}
        tell(0)
        found: Any = map_equilibria(system, axes, progress=tell)
        header = _header(device, message, divisions, axes=message.axes, divisions=divisions, curves=[])
        yield frame(header, {"count": found.count, "stable": _stable(found)})
    tell(0)
    first, second = axes.items()
    trace: Any = trace_folds if device.is_scene else critical_curves
    curves = trace(system, first, second)
    header |= {"curves": [curve.kind for curve in curves.curves]}
    header |= {"curves_complete": bool(getattr(curves, "complete", False))}
    lines = {f"curve{k}": np.stack([c.x, c.y]) for k, c in enumerate(curves.curves)}
    yield frame(header, {"count": found.count, "stable": _stable(found), **lines})


def _stable(found: Any) -> NDArray[np.int8]:
    """How many equilibria of every point of a map are stable."""
    if isinstance(found, RestingMap):
        stable = [VERDICTS.index(verdict) for verdict in ("asymptotically stable", "stable")]
        return np.isin(found.verdict, stable).sum(axis=-1).astype(np.int8)
    return found.count_stable


def _pull(device: Device, message: Any, tell: Progress) -> Iterator[bytes]:
    """By Levenberg and Marquardt's method: few steps, since the place moved little."""
    q = np.array(message.q)
    place, slopes = device.point(message.point, message.parameters, q)
    damping, miss = 1e-3 * float(np.sum(slopes**2)) + 1e-12, np.array(message.to) - place
    for _ in range(30):
        step = np.linalg.solve(slopes.T @ slopes + damping * np.eye(q.size), slopes.T @ miss)
        there, there_slopes = device.point(message.point, message.parameters, q + step)
        left = np.array(message.to) - there
        if left @ left < miss @ miss:
            q, slopes, miss, damping = q + step, there_slopes, left, 0.2 * damping
        else:
            damping *= 5.0
    state = dict.fromkeys(device.state, 0.0) | dict(zip(device.coordinates, map(float, q), strict=True))
    yield frame({"kind": "pull", "id": message.id, "state": state}, {})


def _strike(device: Device, message: Any, tell: Progress) -> Iterator[bytes]:
    """An impulse p on a point changes momenta by its slopes' transpose times p."""
    _, slopes = device.point(message.point, message.parameters, message.q)
    metric = device.still(message.parameters).metric(np.array(message.q))
    momenta = slopes.T @ (message.mass * np.array(message.velocity))
    rates = np.linalg.solve(metric, momenta)
    values = [*message.q, *map(float, rates)]
    header = {"kind": "strike", "id": message.id, "energy": float(0.5 * momenta @ rates)}
    header |= {
        "speed": float(np.hypot(*(slopes @ rates))),
        "state": dict(zip(device.state, values, strict=True)),
    }
    yield frame(header, {})


_WORK: dict[str, Callable[[Device, Any, Progress], Iterator[bytes]]] = {
    "equilibria": _equilibria,
    "motion": _motion,
    "basins": _basins,
    "atlas": _atlas,
    "pull": _pull,
    "strike": _strike,
}
