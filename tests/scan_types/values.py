"""What tests of stored sections share: re-reading, own equations of motion, the norm by the oracle."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from disturbance.known import known
from numpy.typing import NDArray
from oracles import motion_rates, oracle
from scipy.integrate import solve_ivp

from fastmech.results import Dataset, Variable
from fastmech.scan_types.request import RunContext, Scan
from fastmech.scene import Scene
from fastmech.store.provenance import provenance
from fastmech.store.read import open_results
from fastmech.store.write import Stream, in_memory, write_results

Floats = NDArray[np.float64]
Params = Mapping[str, float]
Rates = Callable[[float, Floats], Floats]


def run_scan(scan: Scan, scene: Any, context: RunContext) -> Dataset:
    """One tile after the other, in memory."""
    tiling = scan.tiling(scene)
    tiles = [tiling.compute(index, context) for index in range(tiling.count)]
    result = tiling.assemble(tiles.__getitem__)
    return in_memory(result) if isinstance(result, Stream) else result


def stored(scan: Scan, scene: Scene, folder: Path) -> Dataset:
    """The result of a scan after a way through a file."""
    dataset = run_scan(scan, scene, RunContext(threads=2))
    path = folder / "result.h5"
    attrs = {**provenance(2), "title": "values"}
    write_results(path, scene_parameters={}, sections={"section": dataset}, attrs=attrs, replace=True)
    with open_results(path) as results:
        return results["section"].load().merged


def check_labels(section: Dataset, units: Mapping[str, str]) -> None:
    """Exactly these variables, each with its unit and a description of its own."""
    assert {name: section[name].units for name in section} == units
    names = [section[name].long_name for name in section]
    assert all(name.strip() for name in names)
    assert len(set(names)) == len(names)


def together(section: Dataset, name: str) -> Floats:
    """The entries of a quantity, each a variable NAME_ENTRY, along a last axis."""
    entries = [section[entry].data for entry in section if entry.startswith(f"{name}_")]
    return np.stack(entries, axis=-1)


def decoded(variable: Variable) -> list[Any]:
    """The meanings of a variable's codes."""
    assert variable.data.dtype == np.int8
    table = {code: meaning for meaning, code in variable.codes.items()}
    return np.vectorize(table.__getitem__, otypes=[object])(variable.data).tolist()


def deepest_first(name: str) -> tuple[Scene, Floats]:
    """A scene of data/equilibria.toml and its equilibria (n, 2) [rad], the least potential energy first."""
    scene, angles, _ = known(name)
    energies = [float(oracle().potential(scene.parameters, q, scene.F0)) for q in angles]
    assert np.diff(np.sort(energies)).min() > 1e-6
    return scene, angles[np.argsort(energies)]


def array(numbers: Any) -> Floats:
    return np.array(numbers, dtype=np.float64)


def along(function: Callable[..., Any], params: Params, *columns: Any) -> Floats:
    """A function of the oracle at every instant, shape (times, ...)."""
    return array([function(params, *row) for row in zip(*columns, strict=True)])


def slider_slopes(params: Params, phi: Floats) -> tuple[Floats, Floats]:
    """First and second derivative of x3 = l (cos phi + sqrt(4 - sin^2 phi)) [m]."""
    s, c = np.sin(phi), np.cos(phi)
    root = np.sqrt(4.0 - s * s)
    return (
        -params["l"] * (s + s * c / root),
        -params["l"] * (c + (c * c - s * s) / root + (s * c) ** 2 / root**3),
    )


def rk4(rates: Rates, y: Floats, t_end: float, steps: int) -> Floats:
    """Classical Runge-Kutta with equal steps from t = 0: the start and every step's end, (steps + 1, ...)."""
    h, states = t_end / steps, [y]
    for i in range(steps):
        t = i * h
        k1 = rates(t, y)
        k2 = rates(t + h / 2, y + h / 2 * k1)
        k3 = rates(t + h / 2, y + h / 2 * k2)
        k4 = rates(t + h, y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        states.append(y)
    return array(states)


def scipy_motion(params: Params, starts: Floats, times: Floats) -> Floats:
    """Motions from starts (..., 4) by SciPy at tolerances near rounding, shape (times, ..., 4)."""
    rates = motion_rates(params)
    solution = solve_ivp(
        lambda t, y: rates(t, y.reshape(starts.shape)).ravel(),
        (0.0, times[-1]),
        starts.ravel(),
        method="DOP853",
        rtol=1e-12,
        atol=1e-12,
        t_eval=times,
    )
    assert solution.success
    return solution.y.T.reshape(-1, *starts.shape)


def oracle_jacobian(params: Params, q: Floats) -> Floats:
    """Matrix (4, 4) of the linearized motion about an equilibrium under a constant force."""
    return array(oracle().jacobian({**params, "alpha": 0.0}, (*q, 0.0, 0.0), 0.0))


class Norm:
    """The kinetic-energy norm at an equilibrium under a constant force, and the energy above it."""

    def __init__(self, params: Params, q: Floats) -> None:
        self.params, self.q = params, q
        self.metric = array(oracle().metric(params, q))
        self.hessian = array(oracle().hessian(params, q, params["F0"]))
        self.squares = np.sort(np.linalg.eigvals(np.linalg.inv(self.metric) @ self.hessian).real)
        self.omega = float(np.sqrt(np.abs(self.squares).max()))
        self.inertia = params["m2"] * params["l"] ** 2

    def __call__(self, away: Floats) -> Floats:
        """Sizes [rad] of disturbances (..., 4)."""
        xi, eta = away[..., :2], away[..., 2:] / self.omega
        square = np.einsum("...i,ij,...j", xi, self.metric, xi) + np.einsum(
            "...i,ij,...j", eta, self.metric, eta
        )
        return np.asarray(np.sqrt(square / self.inertia))

    def excess(self, y: Floats) -> float:
        """Energy of a state (4,) above the equilibrium's [J]."""
        F, o = self.params["F0"], oracle()
        here = o.kinetic_energy(self.params, y) + o.potential(self.params, y[:2], F)
        return float(here - o.potential(self.params, self.q, F))
