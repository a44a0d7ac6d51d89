"""What is computed for a page: each kind of message has a function that yields frames as they are ready.

The thread that computes is told beforehand how long its answer is wanted (``fastmech.interrupts``): a newer
message ends it between two calls of a kernel, some milliseconds later. What a view needs is imported by it.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import numpy as np

from fastmech.arrays import Floats
from fastmech.explore.device import Device
from fastmech.explore.messages import COARSEST, frame
from fastmech.interrupts import check

#: Starts of a picture's tile, some 40 ms; divisions of the first atlas along each axis.
TILE, ATLAS = 5_000, 20

#: Parts of a motion's size by which runs with steps 2 dt and dt may differ, of which the finer one is far
#: better, and by which lines between outputs may leave it. Halvings of steps, and points of a curve, at most.
SAME, STRAIGHT, FINEST, MOST = 1e-4, 0.01, 6, 40_000

#: By what steps half as long must at least lengthen the time until which they agree once that is so many
#: outputs: where motions part exponentially they do not, and ever shorter ones bring nothing.
LONGER, RESOLVED = 1.25, 30

#: What views import; one thread at a time, in this order unless a page asks for another.
MODULES = {
    "equilibria": ("models.equilibria", "models.stability", "plots.animation", "mechanisms"),
    "motion": ("ensembles.integrate",),
    "basins": ("basins.label", "attractors.flow"),
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


def _header(message: Any, **more: Any) -> dict[str, Any]:
    return {"kind": message.kind, "id": message.id, **more}


def _drawn(device: Device, message: Any, q: Any, times: Floats) -> tuple[dict[str, Any], dict[str, Floats]]:
    from fastmech.models.drawing import drawing
    from fastmech.plots.animation import load_arrows

    drawn = drawing(device.mechanism(message.parameters, still=True), q)
    loads, forces, means = load_arrows(device.mechanism(message.parameters), q, times)
    masses = [float(m) if np.isfinite(m) else None for m in drawn.mass]
    told = {"elements": drawn.kind.tolist(), "names": drawn.name, "masses": masses, "angles": drawn.angles}
    return told | {"means": means}, {"ends": drawn.ends, "loads": loads, "forces": forces}


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
    places = [row["position"] for row in rows] or [[0.0] * len(device.coordinates)]
    told, arrays = _drawn(device, message, places, np.zeros(len(places)))
    axes = {name: np.linspace(a, b, message.num) for name, (a, b) in message.axes.items()}
    energy = device.energy(message.parameters, device.states(axes, {}))
    header = _header(message, rows=rows, axes=message.axes, divisions=message.num - 1, **told)
    header |= {"certificate": found.certificate.sentence, "complete": bool(found.certificate.complete)}
    yield frame(header, arrays | ({} if energy is None else {"landscape": energy.T}))


def _motion(device: Device, message: Any) -> Iterator[bytes]:
    made, start = device.mechanism(message.parameters), device.states({}, message.start)
    run, dt, per, status = _followed(device, message, start)
    times, y = run.t, run.y[:, 0]
    told, arrays = _drawn(device, message, y[::per, : len(device.coordinates)], times[::per])
    energies, works = made.energies(y), made.works(times, y)
    header = _header(message, t_end=message.t_end, outputs=len(times), dt=dt, per=per, status=status, **told)
    arrays |= {"times": times[::per], "y": y[::per], "curve_times": times, "curve": y}
    arrays |= {"kinetic": energies.kinetic, "potential": energies.potential}
    yield frame(header, arrays | works._asdict())


def _followed(device: Device, message: Any, start: Floats) -> tuple[Any, float, int, str]:
    """A motion, its step [s], its outputs for each moment asked for, and what is wrong with it.

    Steps are halved until the motion is that of steps twice as long, outputs doubled until lines that join
    every second one are the motion, and the power of its loads.
    """
    from fastmech.ensembles.integrate import integrate

    system, made, per = device.at(message.parameters), device.mechanism(message.parameters), 1

    def followed(dt: float) -> Any:
        check()
        times = np.linspace(0.0, message.t_end, per * (message.outputs - 1) + 1)
        return integrate(system, start[None], message.t_end, t_eval=times, dt=dt, method="dop853")

    def size(y: Floats) -> Floats:
        """What each column of a picture spans; more than its rounding."""
        low, high = np.nanmin(y, axis=0), np.nanmax(y, axis=0)
        spans = np.maximum(high - low, 1e-6 * np.maximum(-low, high) + 1e-9)
        turn = np.where(made.turning, 2.0 * np.pi, np.inf)  # on whose axes paths go round
        return np.concatenate([np.minimum(spans[: turn.size], turn), spans[turn.size :]])

    dt, before, coarser, run = device.dt, 0.0, followed(2.0 * device.dt), followed(device.dt)
    while True:
        y, other = run.y[:, 0], coarser.y[:, 0]
        apart = np.nanmax(np.abs(other - y) / size(y), axis=1, initial=0.0)
        agree = (apart <= SAME) & (np.isfinite(other) == np.isfinite(y)).all(axis=1)
        until = run.t[-1] if agree.all() else run.t[np.argmin(agree)]
        parting = np.isfinite(other).all() and RESOLVED * run.t[1] < until < LONGER * before
        if (agree.all() and not run.failures) or parting or dt <= device.dt * 0.5**FINEST:
            break
        dt, before, coarser = 0.5 * dt, until, run
        run = followed(dt)
    while True:
        y = run.y[:, 0]
        curve = np.column_stack([y, np.broadcast_to(made.powers(run.t, y).brought, len(y))])
        off = np.abs(curve[1:-1:2] - 0.5 * (curve[:-2:2] + curve[2::2])) / size(curve)
        chord, finer = float(np.nanmax(off, initial=0.0)), 2 * per
        if chord <= STRAIGHT or finer * message.outputs > MOST:
            break
        while chord > 4.0 * STRAIGHT and 2 * finer * message.outputs <= MOST:
            chord, finer = 0.25 * chord, 2 * finer
        per = finer
        run = followed(dt)
    status = run.failures or ""
    if not status and not agree.all():
        status = f"Motions by steps of {2 * dt:.3g} s and {dt:.3g} s part at {until:.3g} s: "
        status += "what follows is one of many."
    if not status and chord > STRAIGHT:
        status = f"The motion is faster than lines between {len(y):,} outputs show: shorten it."
    return run, dt, per, status


def _basins(device: Device, message: Any) -> Iterator[bytes]:
    from fastmech.attractors.flow import keeps_moving
    from fastmech.basins.label import label_starts, of_attractors
    from fastmech.ensembles.status import Status

    system = device.at(message.parameters)
    moving, attractors = keeps_moving(system), None  # which the first starts tell
    halvings, tile = (min(message.halvings, 2), TILE // 8) if moving else (message.halvings, TILE)
    finest = COARSEST * 2**halvings
    states = device.states({name: np.linspace(a, b, finest + 1) for name, (a, b) in message.axes.items()}, {})
    shape, statuses = states.shape[:2], [one.name.lower() for one in Status]
    whole: dict[str, Any] = {"well": np.full(shape, -2, dtype=np.int8), "time": np.zeros(shape)}
    whole["turns"] = np.zeros((*shape, len(device.coordinates)), dtype=np.int8)
    whole["status"] = np.zeros_like(whole["well"])
    for step in (2**k for k in range(halvings, -1, -1)):
        starts, fields = states[::step, ::step], {name: one[::step, ::step] for name, one in whole.items()}
        missing = np.argwhere(fields["well"] == -2)
        for begin in range(0, len(missing), tile):
            i, j = missing[begin : begin + tile].T
            if attractors is None:
                labels: Any = label_starts(system, starts[i, j])
                attractors = labels.tree if moving else None
            else:
                labels = of_attractors(attractors, attractors.label_starts(starts[i, j]))
            for name, field in fields.items():
                field[i, j] = np.clip(labels.turns, -127, 127) if name == "turns" else getattr(labels, name)
            tree, last = labels.tree, begin + tile >= len(missing)
            header = _header(message, axes=message.axes, divisions=finest // step, statuses=statuses)
            # Until the last tile of all there is work to stop.
            header |= {"from": int(i[0]), "last": last, "final": last and step == 1}
            header["attractors"] = [one.name for one in tree] if moving else None
            header["wells"] = [] if moving else [*map(int, tree.wells)]
            header["t_end"] = tree.t_end if moving else labels.t_end
            rows = slice(int(i[0]), len(starts) if last else int(i[-1]) + 1)
            yield frame(header, {name: one[rows] for name, one in fields.items()})


def _atlas(device: Device, message: Any) -> Iterator[bytes]:
    from fastmech.atlas.critical_curves import critical_curves
    from fastmech.outcome import Outcome
    from fastmech.slider.atlas.axes import check_axis
    from fastmech.slider.atlas.folds import trace_folds
    from fastmech.slider.atlas.map import map_equilibria

    system = device.at(message.parameters)
    for name, ends in message.axes.items() if device.is_scene else ():
        check_axis(system, name, ends)  # what its curves refuse, before numbers are shown
    for halving in range(message.halvings + 1):
        divisions = ATLAS * 2**halving
        axes = {name: np.linspace(a, b, divisions + 1) for name, (a, b) in message.axes.items()}
        found: Any = map_equilibria(system, axes, progress=lambda _: check())
        header = _header(message, axes=message.axes, divisions=divisions, curves=[], final=False)
        decided = found.outcome == Outcome.COMPLETE
        fields = {"count": found.count, "stable": found.count_stable, "decided": decided}
        yield frame(header, fields)
    curves: Any = (trace_folds if device.is_scene else critical_curves)(system, *axes.items())
    complete = bool(getattr(curves, "complete", False))
    header |= {"curves": [curve.kind for curve in curves.curves], "curves_complete": complete, "final": True}
    if not device.is_scene:
        header |= {"changes": curves.changes, "unexplained": len(curves.unexplained)}
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
    yield frame(_header(message, state=state), {})


def _strike(device: Device, message: Any) -> Iterator[bytes]:
    """An impulse p on a point changes momenta by its slopes' transpose times p; rates stay as they were."""
    made = device.mechanism(message.parameters, still=True)
    slopes, metric = made.moved(message.point, message.q), made.metric(message.q)
    momenta, before = slopes.T @ (message.mass * np.array(message.velocity)), np.array(message.rates)
    change = np.linalg.solve(metric, momenta)
    state = dict(zip(device.state, [*message.q, *map(float, before + change)], strict=True))
    speed, energy = np.hypot(*(slopes @ (before + change))), momenta @ (before + 0.5 * change)
    yield frame(_header(message, energy=float(energy), speed=float(speed), state=state), {})


_WORK = {one.__name__[1:]: one for one in (_equilibria, _motion, _basins, _atlas, _pull, _strike)}
