"""Driven damped pendulum: how many starts come to rest, and how many keep turning.

x'' = -alpha x' + T - K sin x with alpha = 0.1, T = 0.5, K = 1; starts uniform in
[-pi + asin(T/K), pi + asin(T/K)] x [-10, 10]. Published share at rest, 10,000 starts: 0.152 (bSTAB, Stender and
Hoffmann, Nonlinear Dynamics 107 (2022), case 1, as computed by pybasin).
"""

import math
import time

import fastmech as fm

PUBLISHED = 0.152
REGION = {"x": (math.asin(0.5) - math.pi, math.asin(0.5) + math.pi), "x_dot": (-10.0, 10.0)}


def pendulum(t, x, x_dot, alpha, T, K):
    return x_dot, -alpha * x_dot + T - K * fm.sin(x)


system = fm.System(pendulum, ["x", "x_dot"], {"alpha": 0.1, "T": 0.5, "K": 1.0}, angles=["x"])

if __name__ == "__main__":
    fm.find_attractors(system, REGION, 100)  # compiles
    began = time.process_time()
    print(fm.find_attractors(system, REGION, threads=1))
    print(f"published share at rest: {PUBLISHED}; {time.process_time() - began:.2f} s on one core")
