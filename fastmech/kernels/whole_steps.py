"""Whole steps of a Runge-Kutta method in one loop over lanes, for those that run most and for starters.

Stage by stage, a step reads and writes its stages' derivatives in memory. Here all stages of a lane are local
numbers: the loop's source is made from the tableau, once for each combination of terms, and compiled when a
run first asks for it. ``fastmech bench`` shows the engine beside a hand-fused loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from textwrap import indent
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fastmech.generated import new_module, run_module
from fastmech.kernels import lagrange

Floats = NDArray[np.float64]


class Formula(Protocol):
    """What a loop is made from: the tableau of an explicit method."""

    @property
    def name(self) -> str:
        """Name of the method."""

    @property
    def a(self) -> Sequence[Sequence[float]]:
        """Rows of the lower triangle."""

    @property
    def b(self) -> Sequence[float]:
        """Weights."""

    @property
    def c(self) -> Sequence[float]:
        """Nodes."""


_HEAD = '''"""Made by fastmech: a step of {name} of Lagrange's equations, all stages in one loop."""

from fastmech.jit import STEP_SIGNATURE, kernel
from fastmech.kernels.blocks import DAMPING, DECAY, FORCE, write_decay
from fastmech.kernels.sincos import sincos
from fastmech.mechanism.equations import lagrange_accelerations


@kernel(STEP_SIGNATURE)
def step(t, h, Y, Z, p, work):
{decay}    for i in range(Y.shape[1]):
        phi0, theta0, phi_dot0, theta_dot0 = Y[0, i], Y[1, i], Y[2, i], Y[3, i]
        mass, slider, lift, spring, gravity = p[0, i], p[1, i], p[2, i], p[3, i], p[4, i]
        force, damping = {force}, {damping}
'''

_DECAY = """    write_decay(t + {c!r} * h, p, DECAY, work[{s}:])
"""

#: Sines and cosines of a state, and its accelerations.
ANGLES = """
s1, c1 = sincos(phi{s})
s2, c2 = sincos(theta{s})
"""
ACCELERATIONS = """\
a{s}, b{s} = lagrange_accelerations(
    s1, c1, s2, c2, phi_dot{s}, theta_dot{s}, mass, slider, lift, spring, gravity, {push}, damping
)
"""

_END = """
Z[0, i], Z[1, i], Z[2, i], Z[3, i] = phi{s}, theta{s}, phi_dot{s}, theta_dot{s}
"""

#: A state, and what its rate is called.
RATES = (("phi", "phi_dot"), ("theta", "theta_dot"), ("phi_dot", "a"), ("theta_dot", "b"))


def source(tableau: Formula, terms: str) -> str:
    """The loop of a method for a combination of terms (:func:`~fastmech.kernels.select.terms`): a module."""
    decays = "decaying" in terms
    text = _HEAD.format(
        name=tableau.name,
        decay="".join(_DECAY.format(s=s, c=float(c)) for s, c in enumerate(tableau.c)) if decays else "",
        force="p[FORCE, i]" if decays or "constant" in terms else None,
        damping="p[DAMPING, i]" if "damped" in terms else None,
    )
    loop = ""
    for s, row in enumerate([*tableau.a[1:], tableau.b], start=1):
        push = f"force * work[{s - 1}, i]" if decays else "force"
        loop += ANGLES.format(s=s - 1) + ACCELERATIONS.format(s=s - 1, push=push)
        for state, rate in RATES:
            loop += f"{state}{s} = {state}0 + h * ({_sum(row, rate)})\n"
    return text + indent(loop + _END.format(s=len(tableau.b)), " " * 8)


def _sum(row: Sequence[float], rate: str) -> str:
    return " + ".join(f"{float(weight)!r} * {rate}{s}" for s, weight in enumerate(row) if weight)


@cache
def whole_step(rhs: Any, tableau: Formula) -> Any:
    """``step(t, h, Y, Z, p, work)`` of one of Lagrange's block right-hand sides and a method.

    It writes the states (dim, lanes) after a step from ``Y`` into ``Z``, with ``work`` (stages, lanes) as
    scratch. Lanes that are far out (:mod:`fastmech.kernels.far`) are not to be used.
    """
    return compiled(source(tableau, terms_of(rhs))).step


def is_lagrange(rhs: Any) -> bool:
    """Whether a block right-hand side is one of Lagrange's equations."""
    return rhs is getattr(lagrange, getattr(rhs, "__name__", ""), None)


def terms_of(rhs: Any) -> str:
    """The combination of terms of one of Lagrange's block right-hand sides."""
    return str(rhs.__name__).removeprefix("lagrange_")


def compiled(text: str) -> Any:
    """The module of a loop's source."""
    return run_module(new_module("step", text), text)
