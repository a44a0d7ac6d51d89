"""Mechanisms, at rest from their potentials and forces."""

from __future__ import annotations

import math
from typing import Any

import sympy as sp

import fastmech as fm
from fastmech.models.statics import Coordinate, Statics

phi, theta, x, y = sp.symbols("phi theta x y", real=True)


def angle(symbol: Any) -> Coordinate:
    return Coordinate(symbol, -math.pi, math.pi, True)


def ranged(symbol: Any, low: float, high: float) -> Coordinate:
    return Coordinate(symbol, low, high, False)


def of_potential(coordinates: Any, parameters: Any, U: Any) -> Statics:
    forces = tuple(-sp.diff(U, coordinate.symbol) for coordinate in coordinates)
    return Statics(tuple(coordinates), tuple(parameters), forces, True)


def slider_pendulum() -> Statics:
    """The paper's mechanism; parameters in the order of ``SLIDER``."""
    m1, m2, g, l, c1, c2, F = parameters = sp.symbols("m1 m2 g l c1 c2 F", real=True)
    x2, y2 = l * (sp.cos(phi) - sp.sin(theta)), l * (sp.sin(phi) - sp.cos(theta))
    x1, y1 = l * sp.cos(phi), l * sp.sin(phi)
    U = m1 * g * y1 + m2 * g * y2 + c1 * (x2**2 + y2**2) / 2 + c2 * (x1**2 + (l - y1) ** 2) / 2 - F * x2
    return of_potential([angle(phi), angle(theta)], parameters, sp.expand(U))


def chain(n: int) -> Statics:
    """Pendulums on one line, neighbours coupled."""
    q = sp.symbols(f"q:{n}", real=True)
    U = -sum((n - i) * (sp.Float(9.81) * sp.cos(q[i]) + 3 * sp.sin(q[i])) for i in range(n))
    U -= 12 * sum(sp.cos(q[i] - q[i + 1]) for i in range(n - 1))
    return of_potential([angle(s) for s in q], (), U)


def truss(width: float = 0.7) -> Statics:
    """Von Mises: bars of stiffness k and length L0 from (-1, 0) and (1, 0) to (x, y), load P downwards."""
    k, L0, P = sp.symbols("k L0 P", real=True)
    bars = [sp.sqrt((x - side) ** 2 + y**2) for side in (-1, 1)]
    U = sum(k / 2 * (bar - L0) ** 2 for bar in bars) + P * y
    return of_potential([ranged(x, -width, width), ranged(y, -1.5, 1.5)], (k, L0, P), U)


def cart_pendulum() -> Statics:
    """A pendulum of unit mass and length upside down on a cart: springs k to the wall, w from its tip."""
    k, w, g = sp.symbols("k w g", real=True)
    U = g * sp.cos(theta) + k / 2 * x**2 + w / 2 * (x + sp.sin(theta)) ** 2
    return of_potential([ranged(x, -3.0, 3.0), angle(theta)], (k, w, g), U)


def ziegler_column() -> Statics:
    """Two rods of unit length on torsion springs k; the force P follows the second."""
    k, P = sp.symbols("k P", real=True)
    forces = (-k * phi + k * (theta - phi) + P * sp.sin(phi - theta), -k * (theta - phi))
    return Statics((ranged(phi, -1.5, 1.5), ranged(theta, -1.5, 1.5)), (k, P), forces, False)


def double_well(load: object = None, *, b: float = 0.2, reach: float = 3.0) -> fm.Mechanism:
    """x'' = x - x^3 - b x' + F(t): minima at +-1, a saddle at 0, barriers of 1/4 J."""
    x = fm.lengths("x", -reach, reach)
    m, c = sp.symbols("m c")
    return fm.Mechanism(
        x,
        {"m": 1.0, "c": b},
        points={"O": (0, 0), "M": (x, 0)},
        masses={"M": m},
        potential=x**4 / 4 - x**2 / 2,
        dampers=[fm.Damper("O", "M", c, along=(1, 0))],
        forces=[] if load is None else [fm.Force("M", load, (1, 0))],
        name="double_well",
    )


def inverted_pendulum(reach: float = 2.5) -> fm.Mechanism:
    """th'' = 9.81 sin th - 6 (th - 0.1) - 0.4 th': on a torsion spring, so with a range."""
    th = fm.angles("th", -reach, reach)
    return fm.Mechanism(
        th,
        points={"P": (sp.sin(th), sp.cos(th))},
        masses={"P": 1},
        springs=[fm.TorsionSpring(th - sp.Rational(1, 10), 6)],
        dampers=[fm.TorsionDamper(th, sp.Rational(2, 5))],
        gravity=9.81,
        name="inverted_pendulum",
    )


def plane(low: float, reach: float, *, wells: bool = False) -> fm.Mechanism:
    """A mass of 1 kg in a plane: x'' = -9 x - 2 y - 0.3 x', y'' = -16 y - 2 x - 0.3 y'.

    With ``wells`` x'' = 2 x - 2 x^3 - 2 y - 0.3 x': a saddle at the origin.
    """
    x, y = fm.lengths("x", low, 2.5), fm.lengths("y", -reach, reach)
    U = x**4 / 2 - x**2 if wells else 9 * x**2 / 2
    return fm.Mechanism(
        (x, y),
        points={"M": (x, y)},
        masses={"M": 1},
        potential=U + 2 * x * y + 8 * y**2,
        dissipation=sp.Rational(3, 20) * (x.dot**2 + y.dot**2),
        name=f"plane_{wells}",
    )


def resonator(load: object, values: dict[str, float], *, reach: float = math.inf) -> fm.Mechanism:
    """A mass of 2 kg on a spring of 9 N/m with a damper of 0.6 N s/m, pushed by a load, within walls."""
    x = fm.lengths("x", -reach, reach)
    return fm.Mechanism(
        x,
        values,
        points={"M": (x, 0), "O": (0, 0)},
        masses={"M": 2.0},
        potential=4.5 * x**2,
        dissipation=0.3 * x.dot**2,
        forces=[fm.Force("M", load, (1, 0))],
        name="resonator",
    )
