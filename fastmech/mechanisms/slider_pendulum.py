"""The source paper's mechanism: crank and slider with a pendulum on the crank's end, Table 1."""

from __future__ import annotations

from collections.abc import Mapping

from sympy import cos, sin, sqrt, symbols

from fastmech.loads import Decaying, Load
from fastmech.models.coordinates import angles
from fastmech.models.elements import Damper, Force, Spring
from fastmech.models.mechanism import Mechanism

#: Values of the paper's Table 1, with the g that it computed with.
TABLE_1 = {
    "m1": (10.0, "kg"), "m2": (12.0, "kg"), "m3": (8.0, "kg"), "l": (1.25, "m"), "c1": (162.5, "N/m"),
    "c2": (366.67, "N/m"), "beta": (121.0, "N s/m"), "g": (9.80665, "m/s2"), "F0": (100.0, "N"),
    "alpha": (0.7, "1/s"),
}  # fmt: skip


def slider_pendulum(
    load: Load | None = None, parameters: Mapping[str, tuple[float, str]] | None = None
) -> Mechanism:
    """The mechanism of :class:`fastmech.Scene`, through the general way.

    ``load`` acts on M2 along +x in place of F0 exp(-alpha t), any of :mod:`fastmech.loads` [N]; where it has
    symbols, ``parameters`` are their values with units: ``Harmonic(F0, omega)`` with
    ``{"F0": (80.0, "N"), "omega": (4.0, "rad/s")}``. Other values: ``slider_pendulum().replace(c1=260.0)``.
    """
    phi, theta = angles("phi theta")
    values = {name: TABLE_1[name] for name in TABLE_1 if load is None or name not in ("F0", "alpha")}
    values |= parameters or {}
    m1, m2, m3, l, c1, c2, beta, g, F0, alpha = symbols(list(TABLE_1))
    x1, y1 = l * cos(phi), l * sin(phi)
    return Mechanism(
        (phi, theta),
        values,
        points={
            "O": (0, 0),
            "A": (0, l),
            "M1": (x1, y1),
            "M2": (x1 - l * sin(theta), y1 - l * cos(theta)),
            "M3": (x1 + l * sqrt(4 - sin(phi) ** 2), 0),
        },
        masses={"M1": m1, "M2": m2, "M3": m3},
        springs=[Spring("O", "M2", c1), Spring("A", "M1", c2)],
        dampers=[Damper("O", "M3", beta, along=(1, 0))],
        forces=[Force("M2", Decaying(F0, alpha) if load is None else load, (1, 0))],
        gravity=g,
        name="slider_pendulum" + (f", {type(load).__name__.lower()} load" if load else ""),
    )
