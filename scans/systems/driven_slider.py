"""The paper's mechanism under a force that never fades: F0 sin(omega t) on M2, along +x."""

import sympy

import fastmech as fm


def mechanism() -> fm.Mechanism:
    load = fm.loads.Harmonic(*sympy.symbols("F0 omega"))
    return fm.mechanisms.slider_pendulum(load, {"F0": (80.0, "N"), "omega": (3.7, "rad/s")})
