"""The Lorenz system with two chaotic attractors and escape.

sigma = 0.12, r = 0, b = -0.6; starts uniform in [-10, 10] x [-20, 20] x {0}. Published shares at 4,000 starts:
0.093 and 0.087 at the two attractors, 0.820 escaped (bSTAB, Stender and Hoffmann, Nonlinear Dynamics 107 (2022),
case 3).
"""

import fastmech as fm

PUBLISHED = (0.093, 0.087, 0.820)
REGION = {"x": (-10.0, 10.0), "y": (-20.0, 20.0)}


def lorenz(t, x, y, z, sigma, r, b):
    return sigma * (y - x), r * x - y - x * z, x * y - b * z


system = fm.System(lorenz, ["x", "y", "z"], {"sigma": 0.12, "r": 0.0, "b": -0.6})

if __name__ == "__main__":
    print(fm.find_attractors(system, REGION))
    print("published shares, the last one escapes:", PUBLISHED)
