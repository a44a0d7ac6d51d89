"""Driven damped pendulum: how much of the state space comes to rest and how much keeps turning.

x'' = -alpha x' + T - K sin x with alpha = 0.1, T = 0.5, K = 1; starts uniform in
[-pi + asin(T/K), pi + asin(T/K)] x [-10, 10], to t = 1000. Published share at rest, 10,000 starts: 0.152
(bSTAB, Stender and Hoffmann, Nonlinear Dynamics 107 (2022), case 1, as computed by pybasin).
"""

import time

import numpy as np

import fastmech as fm

PUBLISHED, STARTS = 0.152, 10_000


def pendulum(t, x, x_dot, alpha, T, K):
    return x_dot, -alpha * x_dot + T - K * fm.sin(x)


system = fm.System(pendulum, state=["x", "x_dot"], parameters={"alpha": 0.1, "T": 0.5, "K": 1.0})

if __name__ == "__main__":
    rng = np.random.default_rng(1)
    middle = np.arcsin(system.parameters["T"] / system.parameters["K"])
    starts = rng.uniform([middle - np.pi, -10.0], [middle + np.pi, 10.0], (STARTS, 2))
    fm.integrate(system, starts, t_end=0.1, dt=0.1)  # compiles, once for each version
    began = time.process_time()
    run = fm.integrate(system, starts, t_end=1000.0, dt=0.1, threads=1)
    print(f"{STARTS:,} trajectories to t = 1000 on one core: {time.process_time() - began:.2f} s")
    at_rest = np.mean(np.abs(run.y[-1, :, 1]) < 1e-3)
    error = np.sqrt(PUBLISHED * (1 - PUBLISHED) / STARTS)
    print(f"share at rest {at_rest:.4f}, published {PUBLISHED} ({(at_rest - PUBLISHED) / error:+.1f} sigma)")
