"""Everything that the paper's tables and figures show, computed once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastmech.arrays import Floats
from fastmech.disturbance.motion import DisturbedMotion, disturbed_motion, size_at
from fastmech.ensembles.balance import EnergyBalance, energy_balance
from fastmech.ensembles.integrate import integrate
from fastmech.scene import Scene
from fastmech.slider.equilibria import Certificate, Equilibria, Equilibrium, find_equilibria
from fastmech.slider.lagrange import momenta
from fastmech.slider.stability import Classification, classify
from fastmech.studies.paper.compare import CASES, Printed

PAPER_SCENE = Scene(c2=1100.0 / 3.0)
"""Table 1 with the stiffness c2 = 1100/3 N/m, of which the table prints the rounding 366.67 N/m.

The paper computed with the unrounded value: with it all eight angles of Table 2 and the coefficients of (16)
and (20) come out to the printed digit; with 366.67 N/m five of the eight angles miss their last digit.
"""

STATIC_SCENE = PAPER_SCENE.replace(alpha=0.0)
"""The same under the constant force of 100 N: Tables 2 to 4 and Figures 6 to 11."""

START = (4.0 * np.pi / 13.0, np.pi / 7.0, 0.0, 0.0)
"""Table 1: phi, theta [rad], phi', theta' [rad/s] at t = 0."""

DISTURBANCE = (0.1, 0.0, 0.1, 0.0)
"""Figures 7 to 11: xi_1, xi_2 [rad], eta_1, eta_2 [rad/s]."""


#: Motion of Figures 2 to 5 and disturbed motion of Figures 7 to 11 [s]; the paper does not print its spans.
MOTION_SPAN, DISTURBED_SPAN, OUTPUT = 20.0, 30.0, 0.01
STEP, METHOD = 0.01, "dop853"


@dataclass(frozen=True)
class PaperCase:
    """One of the paper's equilibria, under the number that Table 2 gives it."""

    number: int
    equilibrium: Equilibrium
    classification: Classification
    disturbed: DisturbedMotion
    norm_nonlinear: Floats  #: size of the disturbance [rad], shape (times,)
    norm_linearized: Floats

    @property
    def title(self) -> str:
        """Case and verdict, for pictures."""
        return f"Case {self.number}, {self.verdict}"

    @property
    def verdict(self) -> str:
        """ "stable" or "unstable"."""
        return "stable" if self.equilibrium.kind == "minimum" else "unstable"


@dataclass(frozen=True)
class Computed:
    """The paper, computed."""

    count: int  #: number of equilibria under the constant force
    certificate: Certificate  #: of their completeness
    cases: tuple[PaperCase, ...]
    motion: EnergyBalance  #: Lagrange's equations from Table 1's start
    momenta: Floats  #: p_phi, p_theta [kg m2/s] from the canonical equations, shape (times, 2)
    formulations_differ: Floats  #: largest differences between the formulations [rad, rad/s], (4,)


def compute(printed: Printed) -> Computed:
    """Compute tables and figures; the print is used for the numbering of the cases only."""
    t = np.linspace(0.0, MOTION_SPAN, round(MOTION_SPAN / OUTPUT) + 1)
    motion = energy_balance(PAPER_SCENE, START, t, dt=STEP, method=METHOD)
    canonical = integrate(PAPER_SCENE, START, dt=STEP, method=METHOD, t_eval=t, formulation="hamilton").y[
        :, 0
    ]
    equilibria = find_equilibria(STATIC_SCENE)
    return Computed(
        count=len(equilibria),
        certificate=equilibria.certificate,
        cases=tuple(
            _case(number, nearest(equilibria, printed["table_2"][name]))
            for number, name in enumerate(CASES, start=1)
        ),
        motion=motion,
        momenta=momenta(PAPER_SCENE, canonical),
        formulations_differ=np.max(np.abs(canonical - motion.y), axis=0),
    )


def nearest(equilibria: Equilibria, angles: Printed) -> Equilibrium:
    """The computed equilibrium nearest to printed angles on the torus."""
    phi, theta = float(angles["phi"]), float(angles["theta"])
    return min(equilibria, key=lambda e: np.hypot(np.sin((e.phi - phi) / 2), np.sin((e.theta - theta) / 2)))


def _case(number: int, equilibrium: Equilibrium) -> PaperCase:
    t = np.linspace(0.0, DISTURBED_SPAN, round(DISTURBED_SPAN / OUTPUT) + 1)
    disturbed = disturbed_motion(STATIC_SCENE, equilibrium, DISTURBANCE, t, dt=STEP, method=METHOD)
    size = size_at(STATIC_SCENE, equilibrium.phi, equilibrium.theta)
    return PaperCase(
        number=number,
        equilibrium=equilibrium,
        classification=classify(STATIC_SCENE, equilibrium),
        disturbed=disturbed,
        norm_nonlinear=size(disturbed.nonlinear[:, 0]),
        norm_linearized=size(disturbed.linearized[:, 0]),
    )
