"""Write fastmech/studies/bench/references/{rest,fast}.csv: the benchmark's final states to 24 digits.

    pip install heyoka mpmath && python data/make_bench_reference.py

Table 1 with its force constant, to t = 10 s, from 1,024 starts a problem. Starts and parameters are DOUBLES
and stand for exactly the binary numbers that they are. Nothing of fastmech is used.

The file keeps heyoka's Taylor series in 128-bit floats (113 bits of mantissa) at tolerance 1e-28, from the
equations of motion divided by m2 l^2 and typed by hand. Two other computations are compared with it:
every trajectory in 80-bit floats (64 bits of mantissa) from the undivided Lagrangian, whose derivatives
heyoka takes symbolically, and the five trajectories that this check moves most by the mpmath series of
make_paper_motion.py in 40-digit arithmetic, which shares neither code nor recurrences with heyoka.
Takes about 15 minutes on two cores.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import heyoka as hy
import make_paper_motion as series
import numpy as np
from mpmath import mp, mpf

PARAMETERS = {
    "m1": 10.0, "m2": 12.0, "m3": 8.0, "l": 1.25, "c1": 162.5, "c2": 366.67,
    "beta": 121.0, "g": 9.80665, "F0": 100.0, "alpha": 0.0,
}  # fmt: skip
T_END = 10.0
COUNT = 1024
KEPT_DIGITS = 24
HARDEST = 5
LARGEST_RATE = {"rest": 0.0, "fast": 10.0}
FOLDER = Path(__file__).parents[1] / "fastmech" / "studies" / "bench" / "references"


def starts(problem: str) -> np.ndarray:
    """All phi first, then all theta, all phi', all theta'."""
    rng = np.random.default_rng(1)
    angles = [rng.uniform(0.5, 2.5, COUNT), rng.uniform(-1.0, 1.0, COUNT)]
    rate = LARGEST_RATE[problem]
    return np.stack([*angles, *(rng.uniform(-rate, rate, COUNT) for _ in range(2))], axis=1)


def divided() -> list[tuple[hy.expression, hy.expression]]:
    """Lagrange's equations over m2 l^2; parameters: lift, m3/m2, c1/m2, g/l, F/(m2 l), beta/m2, m1/m2."""
    phi, theta, u, w = hy.make_vars("phi", "theta", "u", "w")
    lift, slider, spring, gravity, force, damping, mass = (hy.par[i] for i in range(7))
    s, c, s12, c12 = hy.sin(phi), hy.cos(phi), hy.sin(phi + theta), hy.cos(phi + theta)
    root = hy.sqrt(4.0 - s * s)
    q = c / root
    k, dk = s * (1.0 + q), c + q * c - s * s * (1.0 - q * q) / root
    pull = spring * c12
    r1 = pull - lift * c - force * s - k * (damping * k * u + slider * dk * u * u) - c12 * w * w
    r2 = pull - gravity * hy.sin(theta) - force * hy.cos(theta) - c12 * u * u
    phi_ddot = (r1 - s12 * r2) / (mass + c12 * c12 + slider * k * k)
    return [(phi, u), (theta, w), (u, phi_ddot), (w, r2 - s12 * phi_ddot)]


def undivided() -> list[tuple[hy.expression, hy.expression]]:
    """Euler and Lagrange's equations of T - Pi + F x2 with the damper on the slider, by symbolic derivatives.

    Parameters: m1, m2, m3, l, c1, c2, beta, g, F.
    """
    phi, theta, u, w = hy.make_vars("phi", "theta", "u", "w")
    m1, m2, m3, l, c1, c2, beta, g, force = (hy.par[i] for i in range(9))
    x1, y1 = l * hy.cos(phi), l * hy.sin(phi)
    x2, y2 = x1 - l * hy.sin(theta), y1 - l * hy.cos(theta)
    x3 = l * (hy.cos(phi) + hy.sqrt(4.0 - hy.sin(phi) ** 2.0))

    def rate(f: hy.expression) -> hy.expression:
        return hy.diff(f, "phi") * u + hy.diff(f, "theta") * w

    kinetic = 0.5 * m1 * (rate(x1) ** 2.0 + rate(y1) ** 2.0)
    kinetic += 0.5 * m2 * (rate(x2) ** 2.0 + rate(y2) ** 2.0) + 0.5 * m3 * rate(x3) ** 2.0
    springs = 0.5 * c1 * (x2 * x2 + y2 * y2) + 0.5 * c2 * (x1 * x1 + (y1 - l) ** 2.0)
    lagrangian = kinetic - m1 * g * y1 - m2 * g * y2 - springs + force * x2
    p1, p2 = hy.diff(lagrangian, "u"), hy.diff(lagrangian, "w")
    damper = -beta * hy.diff(x3, "phi") ** 2.0 * u
    r1 = hy.diff(lagrangian, "phi") + damper - rate(p1)
    r2 = hy.diff(lagrangian, "theta") - rate(p2)
    a11, a12, a22 = hy.diff(p1, "u"), hy.diff(p1, "w"), hy.diff(p2, "w")
    det = a11 * a22 - a12 * a12
    return [(phi, u), (theta, w), (u, (a22 * r1 - a12 * r2) / det), (w, (a11 * r2 - a12 * r1) / det)]


def quadruple(y0: np.ndarray) -> list[list[str]]:
    """Final states of some starts in 128-bit floats, as digits."""
    real = hy.real128
    m1, m2, m3, l, c1, c2, beta, g, force = (real(x) for x in list(PARAMETERS.values())[:9])
    lift = ((m1 + m2) * g / l - c2) / m2
    pars = [lift, m3 / m2, c1 / m2, g / l, force / (m2 * l), beta / m2, m1 / m2]
    flow = hy.taylor_adaptive(
        divided(), np.zeros(4, dtype=real), tol=real("1e-28"), fp_type=real, compact_mode=True,
        pars=np.array(pars),
    )  # fmt: skip
    found = []
    for y in y0:
        flow.time = real(0.0)
        flow.state[:] = [real(x) for x in y]
        flow.propagate_until(real(T_END))
        found.append([str(x) for x in flow.state])
    return found


def extended(y0: np.ndarray) -> np.ndarray:
    """Final states in 80-bit floats."""
    pars = np.array(list(PARAMETERS.values())[:9], dtype=np.longdouble)
    flow = hy.taylor_adaptive(
        undivided(), np.zeros(4, dtype=np.longdouble), fp_type=np.longdouble, compact_mode=True, pars=pars
    )
    found = np.empty(y0.shape, dtype=np.longdouble)
    for i, y in enumerate(y0):
        flow.time = np.longdouble(0.0)
        flow.state[:] = y
        flow.propagate_until(np.longdouble(T_END))
        found[i] = flow.state
    return found


def by_series(y0: np.ndarray) -> list[mpf]:
    """A final state by the Taylor series of make_paper_motion.py."""
    series.PARAMETERS = PARAMETERS
    with mp.workdps(40):
        state, t = tuple(mpf(float(x)) for x in y0), mpf(0)
        while t < T_END:
            terms = series.taylor(state, t, 36)
            h = min(series.step_size(terms, 36, mpf("1e-30")), T_END - t)
            state, t = tuple(mp.polyval(x[::-1], h) for x in terms), t + h
    return list(state)


def write(problem: str, pool: ProcessPoolExecutor) -> None:
    y0 = starts(problem)
    check = pool.submit(extended, y0)
    digits = [row for part in pool.map(quadruple, np.array_split(y0, 64)) for row in part]
    with mp.workdps(40):
        truth = [[mpf(x) for x in row] for row in digits]
        near = np.array([[np.longdouble(x) for x in row] for row in digits])
        moved = np.abs(near - check.result()).max(axis=1)
        hardest = np.argsort(moved)[-HARDEST:]
        exact = list(pool.map(by_series, y0[hardest]))
        apart = max(
            abs(x - y)
            for i, row in zip(hardest, exact, strict=True)
            for x, y in zip(truth[i], row, strict=True)
        )
        print(f"{problem}: 80-bit floats {np.median(moved):.1e} (median), {moved.max():.1e} (largest)")
        print(f"{problem}: mpmath on the hardest {HARDEST} {mp.nstr(apart, 2)}", flush=True)
        if apart > mpf("1e-21") or np.median(moved) > 1e-17:  # some starts magnify a rounding a million times
            sys.exit("the references disagree")
        lines = [
            f"# {problem}: final states made by data/make_bench_reference.py.",
            f"# Apart from 40-digit arithmetic on the {HARDEST} hardest by {mp.nstr(apart, 1)}, "
            f"from 80-bit floats on all by {moved.max():.0e}.",
            "phi,theta,phi_dot,theta_dot",
            *(",".join(mp.nstr(x, KEPT_DIGITS) for x in row) for row in truth),
        ]
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{problem}.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    with ProcessPoolExecutor(2) as workers:
        for name in LARGEST_RATE:
            write(name, workers)
