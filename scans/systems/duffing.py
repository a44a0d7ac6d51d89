"""The Duffing oscillator with five periodic attractors, told apart by their stroboscopic points.

x'' = -delta x' - x^3 + A cos t with delta = 0.08, A = 0.2; starts uniform in [-1, 1] x [-0.5, 1]. Five
periodic attractors are published (bSTAB, Stender and Hoffmann, Nonlinear Dynamics 107 (2022), case 2); their
shares at 4,000 starts are those that pybasin's tests expect of it (github.com/adrianwix/pybasin,
tests/integration/duffing).
"""

import numpy as np

import fastmech as fm

PUBLISHED = (0.4945, 0.25625, 0.1955, 0.0275, 0.02625)
STARTS, PERIODS = 10_000, 12


def duffing(t, x, x_dot, delta, A):
    return x_dot, -delta * x_dot - x * x * x + A * np.cos(t)


system = fm.System(duffing, state=["x", "x_dot"], parameters={"delta": 0.08, "A": 0.2})


def attractors(starts):
    """Lowest and highest stroboscopic x of each attractor, and its share of the starts, largest first."""
    strobes = 2.0 * np.pi * np.arange(300 - PERIODS, 300)
    run = fm.integrate(system, starts, t_eval=strobes, dt=0.05, method="dop853")
    # An orbit of period 1, 2, 3, ... shows the same points in another order, so only their extremes count.
    extremes = np.stack([run.y[..., 0].min(axis=0), run.y[..., 0].max(axis=0)], axis=1)
    kinds, counts = np.unique(np.round(extremes, 3), axis=0, return_counts=True)
    order = np.argsort(-counts)
    return kinds[order], counts[order] / len(starts)


if __name__ == "__main__":
    kinds, shares = attractors(np.random.default_rng(1).uniform([-1.0, -0.5], [1.0, 1.0], (STARTS, 2)))
    print(f"{len(kinds)} attractors, published {len(PUBLISHED)}")
    for (low, high), share, published in zip(kinds, shares, PUBLISHED, strict=True):
        where = f"stroboscopic x from {low:6.3f} to {high:6.3f}"
        print(f"  {where}: {share:.3f} of the starts, published {published}")
