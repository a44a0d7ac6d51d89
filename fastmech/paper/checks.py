"""What the computation promises of itself: numbers that are zero, or whole, if all is right."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fastmech.equilibria.find import find_equilibria
from fastmech.mechanism.geometry import constraints, positions
from fastmech.paper.compare import CASES, Printed, agrees
from fastmech.paper.compute import METHOD, MOTION_SPAN, PAPER_SCENE, STATIC_SCENE, STEP, Computed, nearest
from fastmech.scene import Scene


class Check(NamedTuple):
    """One promise, kept if the value does not exceed the limit."""

    name: str
    value: float
    unit: str
    limit: float

    @property
    def passed(self) -> bool:
        """Whether the promise is kept."""
        return bool(self.value <= self.limit)


def all_checks(computed: Computed) -> list[Check]:
    """The promises about the motion and the equilibria, with the values found now."""
    motion = computed.motion
    angles, rates = computed.formulations_differ[:2], computed.formulations_differ[2:]
    residual = np.abs(constraints(PAPER_SCENE, positions(PAPER_SCENE, motion.y)))
    certificate = computed.certificate
    run = f"over {MOTION_SPAN:g} s ({METHOD}, step {STEP:g} s)"
    missing = abs((certificate.expected or 0) - computed.count) if certificate.complete else float("nan")
    balance = "energy balance: change of T + Π less the works of damper and force, over max(T + Π) − min Π"
    both, along = "Lagrange's and Hamilton's equations", "largest residual along the motion"
    return [
        Check(f"{both}: largest difference of the angles {run}", angles.max(), "rad", 1e-10),
        Check("the same, rates", rates.max(), "rad/s", 1e-10),
        Check(f"constraints (2), (3), (5): {along}", residual[[0, 1, 3]].max(), "m²", 1e-13),
        Check(f"constraint (4): {along}", residual[2].max(), "m", 1e-13),
        Check(balance, motion.relative_residual, "1", 1e-10),
        Check("equilibria missing from the list, by the counting theorem", missing, "1", 0.0),
    ]


class Guess(NamedTuple):
    """A parameter set that might be the paper's, and how many of Table 2's angles it gives."""

    c2: str
    g: str
    agreeing: int
    total: int


def parameters_used(printed: Printed) -> list[Guess]:
    """Which c2 and g the paper computed with: how many angles of Table 2 each choice gives."""
    stiffnesses = {"1100/3": STATIC_SCENE.c2, printed["table_1"]["c2"]: float(printed["table_1"]["c2"])}
    gravities = {"9.80665": STATIC_SCENE.g, "9.81": 9.81}
    return [
        Guess(c2, g, _agreeing(printed, STATIC_SCENE.replace(c2=stiffness, g=gravity)), 2 * len(CASES))
        for c2, stiffness in stiffnesses.items()
        for g, gravity in gravities.items()
    ]


def _agreeing(printed: Printed, scene: Scene) -> int:
    found = find_equilibria(scene)
    count = 0
    for name in CASES:
        entry = printed["table_2"][name]
        equilibrium = nearest(found, entry)
        count += agrees(entry["phi"], equilibrium.phi) + agrees(entry["theta"], equilibrium.theta)
    return count
