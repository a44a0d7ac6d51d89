"""One motion in full: both formulations, points and energies; of the paper's mechanism reactions too."""

from __future__ import annotations

from functools import cache
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from fastmech.arrays import Floats
from fastmech.ensembles import checks
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.lanes import output_steps
from fastmech.models.mechanism import Mechanism
from fastmech.objects import coordinate_units, state_units
from fastmech.plots.motion import draw_motion
from fastmech.results import Dataset, columns, told
from fastmech.scan_types import request as scans
from fastmech.scene import Scene
from fastmech.slider.balance import energy_balance
from fastmech.slider.coefficients import force
from fastmech.slider.geometry import constraints, positions, reactions
from fastmech.slider.lagrange import momenta
from fastmech.step_limits.warning import step_warning

#: Longest step [s], how often it is halved at most, and what is the same motion, as part of its size.
STEP, HALVINGS, SAME = 0.01, 10, 1e-4

#: Numbers of a section for every output.
OUTPUT_NUMBERS = 30

_REACTIONS = {
    "rod_om1": "axial force in rod O-M1, tension positive",
    "rod_m1m2": "axial force in rod M1-M2, tension positive",
    "rod_m1m3": "axial force in rod M1-M3, tension positive",
    "slider_normal": "force of the guide on the slider, upwards positive",
}
#: Energies and works, by what `fastmech.slider.balance` calls them, and their meaning.
_BALANCE = {
    "kinetic_energy": ("kinetic", "kinetic energy T"),
    "potential_energy": ("potential", "potential energy Pi"),
    "work_damper": ("work_damper", "work of the damper since t = 0"),
    "work_force": ("work_force", "work of the force since t = 0"),
    "energy_residual": ("residual", "change of T + Pi less the work of damper and force"),
}

#: What is known of a mechanism that is not the paper's.
_OF_MECHANISM = {
    "kinetic_energy": ("J", "kinetic energy T"),
    "potential_energy": ("J", "potential energy"),
    "power_loads": ("W", "power that loads bring"),
    "power_lost": ("W", "power lost in dampers and to forces"),
}


class OneMotion(scans.Scan):
    """What scans of single motions ask for: a state, and at which times the motion is told."""

    of_mechanisms = True
    own: ClassVar[str]  #: the field that gives the state
    of_paper: ClassVar[dict[str, float]]  #: that of the paper's mechanism where none is given

    t_end: float = Field(20.0, gt=0)
    outputs: int = Field(2001, ge=2, le=10_000_000)

    @property
    def times(self) -> Floats:
        """When it is told [s]."""
        return np.linspace(0.0, self.t_end, self.outputs)

    def state(self, scene: Scene | Mechanism) -> dict[str, float]:
        """Coordinates and rates, 0 where nothing is given.

        Raises:
            InputError: one is given that is none of the mechanism's.
        """
        given, names = getattr(self, self.own), state_units(scene)
        scans.check_names(f"{self.own}.", given, names, "unknown coordinate")
        given = given or (self.of_paper if isinstance(scene, Scene) else {})
        return {name: given.get(name, 0.0) for name in names}

    def settings(self, scene: Scene | Mechanism) -> dict[str, Any]:
        """What a section says of the request."""
        state = {f"{self.own}_{name}": value for name, value in self.state(scene).items()}
        return self.model_dump(exclude={"scene", self.own}, exclude_none=True) | state


class Motion(OneMotion):
    """Motion from one start; of the paper's mechanism the default start is that of Table 1."""

    kind: ClassVar[str] = "motion"
    draw = staticmethod(draw_motion)
    taken = frozenset({"time", *_BALANCE, *_OF_MECHANISM})
    own = "start"
    of_paper = {"phi": 4.0 * np.pi / 13.0, "theta": np.pi / 7.0}

    start: dict[str, float] = Field(
        default={}, description="coordinates [rad or m] and rates at the start, 0 by default"
    )
    dt: float | None = Field(
        None,
        gt=0,
        description="longest step [s]; 0.01 by default, and of a mechanism shorter until half of it changes "
        "nothing",
    )
    method: scans.MethodName = "dop853"

    def check(self, scene: Scene | Mechanism) -> None:
        """So many steps must be possible, and what is kept of every output fit into memory."""
        self.state(scene)
        scans.check_steps("t_end", self.t_end, self.dt or STEP)
        checks.memory(self.outputs * OUTPUT_NUMBERS, 3, "outputs: the motion", "fewer outputs")

    def step_warning(self, scene: Scene | Mechanism) -> str | None:
        """By the scene's limit, its load and the rates of the start."""
        return step_warning(scene, self.dt or STEP, self.method, [*self.state(scene).values()])

    def tiling(self, scene: Scene | Mechanism) -> scans.Tiling:
        """Integrations of the same motion, none of which needs another, and of the paper's its works."""
        t, start = self.times, [*self.state(scene).values()]
        runs: tuple[dict[str, Any], ...] = ({}, {"formulation": "hamilton"}, {})

        @cache
        def longest() -> float:
            if self.dt is not None or isinstance(scene, Scene):
                return self.dt or STEP
            return _agreeing_step(scene, start, t, self.method)

        def piece(index: int) -> Dataset:
            settings: dict[str, Any] = {"dt": longest(), "method": self.method}
            if index == len(runs):
                assert isinstance(scene, Scene)
                balance = energy_balance(scene, start, t, **settings)
                return scans.tile_of({name: getattr(balance, one) for name, (one, _) in _BALANCE.items()})
            if index == len(runs) - 1:  # half of the step that the first two take
                settings["dt"] = 0.5 * float(np.max(np.diff(t) / output_steps(t, longest())))
            run = integrate(scene, start, t_eval=t, **(settings | runs[index]))
            about = {"steps": run.steps, "dt": longest()} | scans.failures(run.status)
            return scans.tile_of({"y": run.y[:, 0]}, about)

        count = len(runs) + isinstance(scene, Scene)
        return scans.Each(
            "integrations of the motion", count, piece, lambda tiles: self._joined(scene, tiles)
        )

    def _joined(self, scene: Scene | Mechanism, tiles: list[Dataset]) -> Dataset:
        """Derive everything else from the Lagrangian motion."""
        t, y, canonical, halved = self.times, *(tile["y"].data for tile in tiles[:3])
        units = state_units(scene)
        coordinates, n = coordinate_units(scene), len(units) // 2
        rows: dict[str, tuple[Any, ...]] = {
            "time": (t, "s", "time"),
            "": (y[:, :n], coordinates, "{1} {0}"),
            **{
                f"{q}_dot": (y[:, n + k], units[f"{q}_dot"], f"rate of {q}")
                for k, q in enumerate(coordinates)
            },
            "formulation_difference": (canonical - y, units, "{}, canonical less Lagrangian"),
        }
        of_paper = isinstance(scene, Scene)
        rows |= _of_scene(scene, t, y, canonical, tiles[3]) if of_paper else _of_mechanism(scene, t, y)
        largest = float(np.max(np.abs(halved - y)))
        error = {"error_estimate": largest, "error_estimate_is": scans.HALVING}
        attrs = self.settings(scene) | _left_range(scene, t, y) | {**tiles[0].attrs, **error}
        return Dataset(columns(("time",), rows), attrs | told(scene))


def _agreeing_step(mechanism: Mechanism, start: list[float], t: Floats, method: str) -> float:
    """The longest step [s] of which the half gives the same motion, from :data:`STEP` on."""
    step, last = STEP, integrate(mechanism, start, t_eval=t, dt=STEP, method=method).y
    for _ in range(HALVINGS):
        finer = integrate(mechanism, start, t_eval=t, dt=0.5 * step, method=method).y
        if np.abs(finer - last).max() <= SAME * np.abs(finer).max():
            break
        step, last = 0.5 * step, finer
    return step


def _left_range(scene: Scene | Mechanism, t: Floats, y: Floats) -> dict[str, str]:
    """The attribute that tells that a motion is out of range, and from when on."""
    if isinstance(scene, Scene) or not (beyond := scene.outside(y)).any():
        return {}
    first = int(beyond.argmax())
    told = [
        f"{name} is out of range, {one.low:g} to {one.high:g} {unit}"
        for (name, unit), one, value in zip(
            coordinate_units(scene).items(), scene.coordinates, y[first], strict=False
        )
        if not (one.periodic or one.low <= value <= one.high)
    ]
    return {"left_range": f"{', '.join(told)}, at t = {t[first]:g} s: what follows is not described"}


def _of_scene(
    scene: Any, t: Floats, y: Floats, canonical: Floats, balance: Dataset
) -> dict[str, tuple[Any, ...]]:
    """What is known of the paper's mechanism: momenta, points, constraints, reactions and works."""
    p, points = momenta(scene, canonical), positions(scene, y)
    residuals = np.moveaxis(constraints(scene, points), 0, -1)
    moments, units = dict.fromkeys(("phi", "theta"), "kg m2/s"), {"2": "m2", "3": "m2", "4": "m", "5": "m2"}
    places, forces = points._asdict().items(), reactions(scene, y, t)._asdict().items()
    return {
        "p": (p, moments, "generalized momentum of {}, canonical equations"),
        **{name: (value, "m", f"coordinate {name[0]} of M{name[1]}") for name, value in places},
        "constraint_residual": (residuals, units, "left side of the constraint ({})"),
        "force": (force(scene, t), "N", "force on M2 along +x"),
        **{name: (value, "N", _REACTIONS[name]) for name, value in forces},
        **{name: (balance[name].data, "J", about) for name, (_, about) in _BALANCE.items()},
    }


def _of_mechanism(mechanism: Any, t: Floats, y: Floats) -> dict[str, tuple[Any, ...]]:
    """Energies, powers and moving points of any mechanism."""
    values = *mechanism.energies(y), *mechanism.powers(t, y)
    about = zip(_OF_MECHANISM.items(), values, strict=True)
    rows: dict[str, tuple[Any, ...]] = {n: (np.broadcast_to(v, t.shape), *row) for (n, row), v in about}
    points, _ = mechanism.places(y[:, : len(mechanism.coordinates)])
    for name, place in points.items():
        if np.ptp(place, axis=0).any():
            rows[f"point_{name}"] = (place, {"x": "m", "y": "m"}, f"coordinate {{}} of {name}")
    return rows
