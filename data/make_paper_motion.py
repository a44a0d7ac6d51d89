"""Write paper_motion.toml: the paper's motion (Table 1, decaying force) to 27 digits.

    python data/make_paper_motion.py

The equations are typed by hand from Lagrange's equations divided by m2 l^2 (paper (10)-(13), corrected) and
are integrated by a Taylor series whose coefficients come from recurrences; mpmath does the arithmetic and
nothing of fastmech is used.  The run is made twice, with different order, tolerance and number of digits; the
file keeps what the two agree on.  Takes about 20 s.

Every parameter and the start are DOUBLES, taken as the exact binary numbers that they are (c2 is the double
nearest to 1100/3, the start the doubles of 4*math.pi/13 and math.pi/7), so that a double-precision code
solves the very same problem and its every digit can be compared.
"""

from __future__ import annotations

import math
from pathlib import Path

from mpmath import mp, mpf

PARAMETERS = {
    "m1": 10.0, "m2": 12.0, "m3": 8.0, "l": 1.25, "c1": 162.5, "c2": 1100 / 3,
    "beta": 121.0, "g": 9.80665, "F0": 100.0, "alpha": 0.7,
}  # fmt: skip
START = (4 * math.pi / 13, math.pi / 7, 0.0, 0.0)
TIMES = (1, 2, 5, 10, 20)
NAMES = ("phi", "theta", "phi_dot", "theta_dot")
RUNS = ({"digits": 42, "order": 40, "tolerance": "1e-34"}, {"digits": 50, "order": 52, "tolerance": "1e-41"})
KEPT_DIGITS = 27
SPARE_DIGITS = 3

Series = list[mpf]


def product(u: Series, v: Series, n: int) -> mpf:
    """Coefficient n of u v."""
    return mp.fdot(u[: n + 1], v[n::-1])


def taylor(state: tuple[mpf, ...], t: mpf, order: int) -> tuple[Series, ...]:
    """Taylor coefficients of (phi, theta, phi', theta') about time ``t``, up to ``order``."""
    P = {key: mpf(value) for key, value in PARAMETERS.items()}
    unit = P["m2"] * P["l"] ** 2
    mu, nu = (P["m1"] + P["m2"]) / P["m2"], P["m3"] / P["m2"]
    a = ((P["m1"] + P["m2"]) * P["g"] * P["l"] - P["c2"] * P["l"] ** 2) / unit
    b, C, B = P["g"] / P["l"], P["c1"] / P["m2"], P["beta"] / P["m2"]
    force = P["F0"] * mp.exp(-P["alpha"] * t) / (P["m2"] * P["l"])

    phi, theta, u, w = ([x] for x in state)
    s, c, st, ct = ([f(x)] for x in (state[0], state[1]) for f in (mp.sin, mp.cos))
    root, inverse, ratio, k, dk, S, K, k2, uu, ww = ([] for _ in range(10))
    s2, c2, sine_ratio, f, det, phi2, R1, R2 = ([] for _ in range(8))
    kdk, curvature = [], []
    for n in range(order):
        if n:  # d sin(x)/dt = cos(x) x', and so on
            for sine, cosine, rate in ((s, c, u), (st, ct, w)):
                sine_n = product(cosine, rate, n - 1) / n
                cosine_n = -product(sine, rate, n - 1) / n
                sine.append(sine_n)
                cosine.append(cosine_n)
        s2.append(product(s, s, n))
        # root = sqrt(4 - s2) and inverse = 1/root
        radicand = (4 if n == 0 else 0) - s2[n]
        if n == 0:
            root.append(mp.sqrt(radicand))
            inverse.append(1 / root[0])
        else:
            inner = product(root[1:], root[1:], n - 2) if n > 1 else mpf(0)
            root.append((radicand - inner) / (2 * root[0]))
            inverse.append(-mp.fdot(root[1 : n + 1], inverse[n - 1 :: -1]) * inverse[0])
        ratio.append(product(c, inverse, n))  # cos(phi) / root
        k.append(s[n] + product(s, ratio, n))
        # dk/dphi = c + (c^2 - s^2)/root + s^2 c^2 / root^3 = c + [c^2 - s^2 + (s c / root)^2] / root
        c2.append(product(c, c, n))
        sine_ratio.append(product(s, ratio, n))
        curvature.append(c2[n] - s2[n] + product(sine_ratio, sine_ratio, n))
        dk.append(c[n] + product(curvature, inverse, n))
        S.append(product(s, ct, n) + product(c, st, n))  # sin(phi + theta)
        K.append(product(c, ct, n) - product(s, st, n))  # cos(phi + theta)
        k2.append(product(k, k, n))
        kdk.append(product(k, dk, n))
        uu.append(product(u, u, n))
        ww.append(product(w, w, n))
        f.append(force if n == 0 else -f[n - 1] * P["alpha"] / n)
        R1.append(
            -a * c[n] + C * K[n] - product(f, s, n)
            - B * product(k2, u, n) - nu * product(kdk, uu, n) - product(K, ww, n)
        )  # fmt: skip
        R2.append(-b * st[n] + C * K[n] - product(f, ct, n) - product(K, uu, n))
        # (mu + nu k^2) phi'' + S theta'' = R1,  S phi'' + theta'' = R2
        det.append((mu if n == 0 else 0) + nu * k2[n] - product(S, S, n))
        phi2.append(
            (R1[n] - product(S, R2, n) - (mp.fdot(det[1 : n + 1], phi2[n - 1 :: -1]) if n else 0)) / det[0]
        )
        theta2_n = R2[n] - product(S, phi2, n)
        phi.append(u[n] / (n + 1))
        theta.append(w[n] / (n + 1))
        u.append(phi2[n] / (n + 1))
        w.append(theta2_n / (n + 1))
    return phi, theta, u, w


def step_size(series: tuple[Series, ...], order: int, tolerance: mpf) -> mpf:
    """The largest power of two at which the last two terms of every series are below ``tolerance``."""
    h = mpf(1)
    while any(abs(x[n]) * h**n > tolerance for x in series for n in (order - 1, order)):
        h /= 2
    return h


def run(digits: int, order: int, tolerance: str) -> dict[int, tuple[mpf, ...]]:
    """States at TIMES."""
    states = {}
    with mp.workdps(digits):
        state = tuple(mpf(x) for x in START)
        t = mpf(0)
        steps = 0
        for stop in TIMES:
            while t < stop:
                series = taylor(state, t, order)
                h = min(step_size(series, order, mpf(tolerance)), stop - t)
                state = tuple(mp.polyval(x[::-1], h) for x in series)
                t += h
                steps += 1
            states[stop] = state
    print(f"{digits} digits, order {order}, tolerance {tolerance}: {steps} steps")
    return states


def main() -> None:
    coarse, fine = (run(**settings) for settings in RUNS)
    with mp.workdps(60):
        difference = max(abs(x - y) for t in TIMES for x, y in zip(coarse[t], fine[t], strict=True))
    agreed = math.floor(-mp.log10(difference))
    print(f"largest difference {mp.nstr(difference, 3)}: {agreed} decimals agree")
    if agreed < KEPT_DIGITS + SPARE_DIGITS:
        raise SystemExit("the two runs agree on too few digits")

    lines = [
        "# The paper's motion, made by make_paper_motion.py: Table 1 with the decaying force.",
        "# Parameters and start are doubles, taken as exact binary numbers (see the script).",
        f"# Angles in rad, rates in rad/s, time in s; two runs agree to {agreed} decimals.",
        "",
        "[parameters]",
        *(f"{key} = {value!r}" for key, value in PARAMETERS.items()),
        "",
        "[start]",
        *(f"{name} = {value!r}" for name, value in zip(NAMES, START, strict=True)),
    ]
    for t in TIMES:
        lines += ["", "[[state]]", f"t = {float(t)!r}"]
        with mp.workdps(60):
            lines += [f'{name} = "{mp.nstr(x, KEPT_DIGITS)}"' for name, x in zip(NAMES, fine[t], strict=True)]
    Path(__file__).with_name("paper_motion.toml").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
