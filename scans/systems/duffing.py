"""The Duffing oscillator with five periodic attractors, found without being told what to look for.

x'' = -delta x' - x^3 + A cos t with delta = 0.08, A = 0.2; starts uniform in [-1, 1] x [-0.5, 1]. Published shares
at 4,000 starts: bSTAB (Stender and Hoffmann, Nonlinear Dynamics 107 (2022), case 2) as pybasin's tests expect them
(github.com/adrianwix/pybasin, tests/integration/duffing).
"""

import math

import fastmech as fm

PUBLISHED = (0.4945, 0.25625, 0.1955, 0.0275, 0.02625)
REGION = {"x": (-1.0, 1.0), "x_dot": (-0.5, 1.0)}


def duffing(t, x, x_dot, delta, A):
    return x_dot, -delta * x_dot - x * x * x + A * fm.cos(t)


system = fm.System(duffing, ["x", "x_dot"], {"delta": 0.08, "A": 0.2}, period=2.0 * math.pi)

if __name__ == "__main__":
    print(fm.find_attractors(system, REGION))
    print("published shares:", PUBLISHED)
