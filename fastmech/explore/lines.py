"""The way back to work: the Python lines and the request that give what a view shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fastmech.explore.device import Device


def python_of(device: Device, message: Any, divisions: int) -> str:
    """Python lines that compute what a message asked for; axes have so many divisions."""
    lines = ["import numpy as np", "import fastmech as fm", "", _system(device, message.parameters)]
    match message.kind:
        case "equilibria":
            lines += ["found = fm.find_equilibria(system)"]
            lines += ["print(found, [fm.classify(system, e).verdict for e in found])"]
        case "motion":
            start = [message.start.get(name, 0.0) for name in device.state]
            how = f'{message.t_end!r}, t_eval=times, dt={device.dt!r}, method="dop853"'
            lines += [f"times = np.linspace(0.0, {message.t_end!r}, {message.outputs})"]
            lines += [f"run = fm.integrate(system, [{start!r}], {how})", "print(run.y[:, 0])"]
        case "basins":
            how = f"{message.t_end!r}, fixed={dict(message.fixed)!r}"
            lines += [f"axes = {_axes(message.axes, divisions)}"]
            lines += [f"found = fm.map_basins(system, axes, {how})", "print(found)"]
        case "atlas":
            curves = "fm.trace_folds" if device.is_scene else "fm.critical_curves"
            lines += [f"axes = {_axes(message.axes, divisions)}", "found = fm.map_equilibria(system, axes)"]
            lines += [f"curves = {curves}(system, *axes.items())", "print(found.count)"]
    return "\n".join(lines) + "\n"


def _system(device: Device, parameters: Mapping[str, float]) -> str:
    """The lines that make the system."""
    values = device.at(parameters).described().items()
    given = ", ".join(f"{name}={value!r}" for name, (value, *_) in values)
    source = str(device.source)
    if device.is_scene:
        return f"system = fm.Scene({given})"
    if ":" in source:
        file, _, name = source.rpartition(":")
        made = f"import runpy\n\nmade = runpy.run_path({file!r})[{name!r}]\n"
        return f"{made}system = (made if isinstance(made, fm.Mechanism) else made()).replace({given})"
    made, _, number = source.rpartition("_") if source.startswith("pendulum_chain") else (source, "", "")
    return f"system = fm.mechanisms.{made}({number}).replace({given})"


def request_of(device: Device, message: Any, divisions: int) -> str:
    """The text of a request that computes the same."""
    source, head = str(device.source), list[str]()
    if ":" in source:
        head = [f"# fastmech run THIS.toml --mechanism {source}"]
    elif not device.is_scene:
        head = [f'mechanism = "{source}"']
    lines = [f'title = "{device.name}, from the explorer"', *head]
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
    each = (f"{name!r}: np.linspace({a!r}, {b!r}, {divisions + 1})" for name, (a, b) in axes.items())
    return "{" + ", ".join(each) + "}"


def _tables(axes: Mapping[str, list[float]], divisions: int) -> list[str]:
    ends = ((name, f"start = {a!r}, stop = {b!r}") for name, (a, b) in axes.items())
    return [f"axes.{name} = {{ {told}, num = {divisions + 1} }}" for name, told in ends]
