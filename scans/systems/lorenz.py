"""The Lorenz system with two attractors and escape: a stopping condition ends what has escaped.

sigma = 0.12, r = 0, b = -0.6; starts uniform in [-10, 10] x [-20, 20] x {0}; escaped beyond a distance of
200. Published shares at 4,000 starts: 0.093 and 0.087 at the two attractors, 0.820 escaped (bSTAB, Stender
and Hoffmann, Nonlinear Dynamics 107 (2022), case 3).
"""

import numpy as np

import fastmech as fm

PUBLISHED, STARTS = {"attractor x > 0": 0.087, "attractor x < 0": 0.093, "escaped": 0.820}, 4_000


def lorenz(t, x, y, z, sigma, r, b):
    return sigma * (y - x), r * x - y - x * z, x * y - b * z


def escaped(t, x, y, z):
    return 1.0 if x * x + y * y + z * z > 200.0**2 else 0.0


system = fm.System(
    lorenz, state=["x", "y", "z"], parameters={"sigma": 0.12, "r": 0.0, "b": -0.6}, stop=escaped
)

if __name__ == "__main__":
    rng = np.random.default_rng(1)
    starts = rng.uniform([-10.0, -20.0, 0.0], [10.0, 20.0, 0.0], (STARTS, 3))
    run = fm.integrate(system, starts, t_eval=np.linspace(900.0, 1000.0, 101), dt=0.02, method="rk4")
    # The attractors are each other's mirror image in x; x changes sign on neither.
    side = np.where(run.stop_code == 1, 0.0, np.sign(run.y[..., 0].mean(axis=0)))
    shares = [np.mean(side == 1), np.mean(side == -1), np.mean(side == 0)]
    for (name, published), share in zip(PUBLISHED.items(), shares, strict=True):
        error = np.sqrt(published * (1 - published) / STARTS)
        print(f"{name}: {share:.4f}, published {published} ({(share - published) / error:+.1f} sigma)")
