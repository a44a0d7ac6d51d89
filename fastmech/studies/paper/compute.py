"""Everything that the paper's tables and figures show, computed once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.ensembles.integrate import integrate
from fastmech.scene import Scene
from fastmech.slider.balance import EnergyBalance, energy_balance
from fastmech.slider.equilibria import Equilibria, Equilibrium, find_equilibria
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


class PaperCase(NamedTuple):
    """One of the paper's equilibria, under the number that Table 2 gives it."""

    number: int
    equilibrium: Equilibrium
    classification: Classification

    @property
    def title(self) -> str:
        """Case and verdict, for pictures."""
        return f"Case {self.number}, {self.verdict}"

    @property
    def verdict(self) -> str:
        """ "stable" or "unstable"."""
        return "stable" if self.equilibrium.kind == "minimum" else "unstable"


class Computed(NamedTuple):
    """The paper, computed."""

    equilibria: Equilibria  #: all under the constant force
    cases: tuple[PaperCase, ...]
    motion: EnergyBalance  #: Lagrange's equations from Table 1's start
    momenta: Floats  #: p_phi, p_theta [kg m2/s] from the canonical equations, shape (times, 2)
    formulations_differ: Floats  #: largest differences between the formulations [rad, rad/s], (4,)


def compute(printed: Printed) -> Computed:
    """Compute tables and figures; the print is used for the numbering of the cases only."""
    t = outputs(MOTION_SPAN)
    motion = energy_balance(PAPER_SCENE, START, t, dt=STEP, method=METHOD)
    run = integrate(PAPER_SCENE, START, dt=STEP, method=METHOD, t_eval=t, formulation="hamilton")
    canonical, equilibria = run.y[:, 0], find_equilibria(STATIC_SCENE)
    places = (nearest(equilibria, printed["table_2"][name]) for name in CASES)
    cases = tuple(PaperCase(k, e, classify(STATIC_SCENE, e)) for k, e in enumerate(places, start=1))
    apart = np.max(np.abs(canonical - motion.y), axis=0)
    return Computed(equilibria, cases, motion, momenta(PAPER_SCENE, canonical), apart)


def outputs(span: float) -> Floats:
    """When a motion of that length is told [s]."""
    return np.linspace(0.0, span, round(span / OUTPUT) + 1)


def nearest(equilibria: Equilibria, angles: Printed) -> Equilibrium:
    """The computed equilibrium nearest to printed angles on the torus."""
    phi, theta = float(angles["phi"]), float(angles["theta"])
    return min(equilibria, key=lambda e: np.hypot(np.sin((e.phi - phi) / 2), np.sin((e.theta - theta) / 2)))
