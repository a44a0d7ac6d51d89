"""The way back to work: the Python lines and the request that give what a view shows."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from fastmech.explore.device import Device


def python_of(device: Device, message: Any, divisions: int) -> str:
    """Python lines that compute what a message asked for; axes have so many divisions."""
    lines = ["import numpy as np", "import fastmech as fm", "", device.python(message.parameters)]
    match message.kind:
        case "equilibria":
            lines += [
                "found = fm.find_equilibria(system)",
                "verdicts = [fm.classify(system, e).verdict for e in found]",
                "print(found, verdicts)",
            ]
        case "motion":
            start = [message.start.get(name, 0.0) for name in device.state]
            lines += [
                f"times = np.linspace(0.0, {message.t_end!r}, {message.outputs})",
                f"run = fm.integrate(system, [{start!r}], {message.t_end!r}, t_eval=times,"
                f' dt={device.dt!r}, method="dop853")',
                "print(run.y[:, 0])",
            ]
        case "basins":
            lines += [
                f"axes = {_axes(message.axes, divisions)}",
                f"found = fm.map_basins(system, axes, {message.t_end!r}, fixed={dict(message.fixed)!r})",
                "print(found)",
            ]
        case "atlas":
            curves = "fm.trace_folds" if device.is_scene else "fm.critical_curves"
            first, second = message.axes
            lines += [
                f"axes = {_axes(message.axes, divisions)}",
                "found = fm.map_equilibria(system, axes)",
                f'curves = {curves}(system, ("{first}", axes["{first}"]), ("{second}", axes["{second}"]))',
                "print(found.count)",
            ]
    return "\n".join(lines) + "\n"


def request_of(device: Device, message: Any, divisions: int) -> str:
    """The text of a request that computes the same."""
    lines = [f'title = "{device.name}, from the explorer"', *device.request_head()]
    lines += ["", "[scene]", *(f"{name} = {value!r}" for name, value in message.parameters.items())]
    match message.kind:
        case "equilibria":
            lines += ["", "[scan.rest]", 'kind = "equilibria"']
        case "motion":
            start = {name: message.start.get(name, 0.0) for name in device.state}
            given = [f"{name} = {value!r}" for name, value in start.items()]
            lines += ["", "[scan.swing]", 'kind = "motion"']
            lines += given if device.is_scene else [f"start = {{ {', '.join(given)} }}"]
            lines += [f"t_end = {message.t_end!r}", f"outputs = {message.outputs}", f"dt = {device.dt!r}"]
        case "basins":
            lines += ["", "[scan.basins]", 'kind = "basins"', f"t_end = {message.t_end!r}"]
            lines += _tables(message.axes, divisions)
            lines += [f"fixed.{name} = {value!r}" for name, value in message.fixed.items()]
        case "atlas":
            lines += ["", "[scan.atlas]", 'kind = "equilibrium_map"', *_tables(message.axes, divisions)]
    return "\n".join(lines) + "\n"


def grid(ends: list[float], divisions: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Values along an axis; those of twice the divisions hold them, bit for bit."""
    return np.linspace(ends[0], ends[1], divisions + 1)


def _axes(axes: Mapping[str, list[float]], divisions: int) -> str:
    each = (
        f"{json.dumps(name)}: np.linspace({a!r}, {b!r}, {divisions + 1})" for name, (a, b) in axes.items()
    )
    return "{" + ", ".join(each) + "}"


def _tables(axes: Mapping[str, list[float]], divisions: int) -> list[str]:
    return [
        f"axes.{name} = {{ start = {a!r}, stop = {b!r}, num = {divisions + 1} }}"
        for name, (a, b) in axes.items()
    ]
