"""Write equilibria.toml: every equilibrium of 82 scenes with a constant force, to 30 digits.

    python data/make_equilibria.py

Notation: a = (m1+m2) g l - c2 l^2, b = m2 g l, C = c1 l^2, f = F0 l; equilibria satisfy

    a cos(phi) + f sin(phi) = b sin(theta) + f cos(theta) = C cos(phi + theta),

so z = exp(i phi) is a root of a polynomial of degree 6.  The parameters are doubles taken as exact rational
numbers: the polynomial is formed and freed of repeated roots without rounding, its roots are found at 130
digits, every root on the unit circle is taken back to all its angles theta, and each pair (phi, theta) is
polished by Newton's method and checked.  Then three checks that know nothing of the polynomial: 4 or 6
equilibria, minima - saddles + maxima = 0, and Newton's method from a 40 x 40 grid in doubles, which must find
the same set.  Nothing of fastmech is used.
Takes about 10 s.
"""

from __future__ import annotations

import random
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from mpmath import mp, mpc, mpf
from sympy import I, Poly, Rational, Symbol

DIGITS = 110
STORED = 30
RANDOM_SCENES = 60
SEED = 20260

Exact = tuple[Fraction, Fraction, Fraction, Fraction]  # a, b, C, f [J]
Scene = dict[str, float]

TABLE_1: Scene = {
    "m1": 10.0, "m2": 12.0, "m3": 8.0, "l": 1.25, "c1": 162.5, "c2": 1100 / 3,
    "beta": 121.0, "g": 9.80665, "F0": 100.0,
}  # fmt: skip

#: name -> (why it is here, changes to Table 1)
NAMED: dict[str, tuple[str, Scene]] = {
    "table_1": ("Table 2 of the paper", {}),
    "table_1_unforced": ("six equilibria, pairs share phi", {"F0": 0.0}),
    "table_1_weak_force": ("six equilibria, close to the unforced ones", {"F0": 0.5}),
    "table_1_force_to_the_left": ("mirror image of table_1: pi - phi, -theta", {"F0": -100.0}),
    "bistable": ("two minima, three saddles, one maximum", {"F0": 85.3, "c1": 294.9, "c2": 92.85}),
    "no_spring_1": ("C = 0: the equations decouple", {"c1": 0.0}),
    "no_spring_1_unforced": ("C = 0 and f = 0", {"c1": 0.0, "F0": 0.0}),
    "no_spring_2": ("c2 = 0", {"c2": 0.0}),
    "no_springs": ("C = 0 and c2 = 0", {"c1": 0.0, "c2": 0.0}),
    "balanced_rod_rounded": (
        "F0 = 0 and c2 = (m1+m2) g/l rounded to a double, so a is tiny but not zero",
        {"F0": 0.0, "c2": 22 * 9.80665 / 1.25},
    ),
    "balanced_rod_exact": (
        "F0 = 0 and c2 = (m1+m2) g/l without rounding: a = f = 0",
        {"F0": 0.0, "l": 1.0, "g": 9.8125, "c2": 22 * 9.8125},
    ),
    "balanced_rod_forced": ("a = 0 with a force", {"l": 1.0, "g": 9.8125, "c2": 22 * 9.8125}),
    "a_equals_b": ("a = b without rounding: pairs share phi", {"l": 1.0, "g": 9.8125, "c2": 10 * 9.8125}),
    "false_double_root": (
        "c1 l = sqrt(F0^2 + (m2 g)^2) to rounding: z = (f - ib)/C is a double unit root",
        {"c1": (100.0**2 + (12 * 9.80665) ** 2) ** 0.5 / 1.25},
    ),
    "false_double_root_exact": (
        "C^2 = b^2 + f^2 without rounding: F0 = 90, m2 g = 120, c1 l = 150",
        {"F0": 90.0, "g": 10.0, "c1": 120.0},
    ),
    "endless_circling": (
        "c1 l = m2 g, F0 = 0: M2 can circle M1 forever", {"F0": 0.0, "c1": 94.14384, "c2": 50.0}
    ),
    "weightless": ("g = 0 with a force: b = 0", {"g": 0.0, "F0": 50.0}),
    "undamped_sin_phi": (
        "damping misses a mode: sin(phi) = 0 at (0, 0.3)", {"F0": 166.722372, "c2": 17.35486052}
    ),
    "undamped_sin_phi_theta": (
        "damping misses a mode: sin(phi + theta) = 0 at (-0.3, 0.3)",
        {"F0": 89.2075641978, "c1": 96.0, "c2": 50.0327795757},
    ),
    "undamped_unloaded_rod": (
        "damping misses a mode: U_theta,theta = C at (-2.21414614, -1.58635572)",
        {"F0": 60.0, "c1": 120.0, "c2": 78.4532},
    ),
    "undamped_unloaded_rod_hanging": (
        "damping misses a mode: U_theta,theta = C at (-pi/2, -0.65530742)",
        {"F0": 40.0, "c1": 52.5104064692, "c2": 31.79704},
    ),
    "undamped_symmetric": (
        "damping misses a mode at (-pi/2, 0), symmetric", {"F0": 0.0, "c1": 47.07192, "c2": 44.59704}
    ),
}  # fmt: skip


def random_scenes() -> dict[str, tuple[str, Scene]]:
    """Masses 0.1-100 kg, l 0.2-4 m, stiffness 1-1e4 N/m, force 0.1-1e3 N of either sign, all log-uniform."""
    draw = random.Random(SEED)

    def log_uniform(low: float, high: float) -> float:
        return float(low * (high / low) ** draw.random())

    scenes = {}
    for number in range(RANDOM_SCENES):
        scene = {
            **{key: log_uniform(0.1, 100) for key in ("m1", "m2", "m3")},
            "l": log_uniform(0.2, 4), "c1": log_uniform(1, 1e4), "c2": log_uniform(1, 1e4),
            "F0": draw.choice((-1, 1)) * log_uniform(0.1, 1e3),
        }  # fmt: skip
        scenes[f"random_{number:02d}"] = ("random", scene)
    return scenes


def exact_coefficients(scene: Scene) -> Exact:
    P = {key: Fraction(value) for key, value in scene.items()}
    a = (P["m1"] + P["m2"]) * P["g"] * P["l"] - P["c2"] * P["l"] ** 2
    return a, P["m2"] * P["g"] * P["l"], P["c1"] * P["l"] ** 2, P["F0"] * P["l"]


def unit_roots(exact: Exact) -> list[Any]:
    """The distinct angles phi whose z = exp(i phi) is a root of the polynomial."""
    a, b, C, f = (Rational(x.numerator, x.denominator) for x in exact)
    z = Symbol("z")

    def poly(expression: Any) -> Poly:
        return Poly(expression, z, domain="QQ_I")

    first = poly((f + I * b) * z**2 - (f - I * b))
    second = poly((a - I * f) * z**2 + (a + I * f))
    third = poly((f - I * b) - C * z) * poly((f + I * b) * z - C)
    whole = poly(C**2 * z) * first**2 + second**2 * third
    if whole.is_zero:
        raise ValueError("equilibria are not isolated")
    _, whole = whole.terms_gcd()  # z = 0 is no angle
    simple = whole.sqf_part().monic()
    with mp.workdps(DIGITS + 20):
        parts = [c.as_real_imag() for c in simple.all_coeffs()]
        coefficients = [mpc(mpf(x.p) / x.q, mpf(y.p) / y.q) for x, y in parts]
        roots = mp.polyroots(coefficients, maxsteps=2000, extraprec=600)
        return [mp.arg(root) for root in roots if abs(abs(root) - 1) < mpf(10) ** -60]


def angles_theta(exact: tuple[Any, ...], phi: Any) -> list[Any]:
    """Every theta in equilibrium with ``phi``: two solve b sin + f cos = v; C cos(phi + theta) picks."""
    a, b, C, f = exact
    v = a * mp.cos(phi) + f * mp.sin(phi)
    R = mp.hypot(b, f)
    cosine = v / R
    if abs(cosine) > 1:
        if abs(cosine) > 1 + mpf(10) ** -50:
            return []
        cosine = mp.sign(cosine)
    spread, centre = mp.acos(cosine), mp.atan2(b, f)
    scale = abs(C) + R + abs(a)
    candidates = [centre + spread] if spread < mpf(10) ** -25 else [centre + spread, centre - spread]
    return [x for x in candidates if abs(C * mp.cos(phi + x) - v) < scale * mpf(10) ** -25]


def polish(exact: tuple[Any, ...], phi: Any, theta: Any) -> tuple[Any, Any, Any]:
    """Newton in (phi, theta); returns angles in (-pi, pi] and the Hessian."""
    a, b, C, f = exact
    start = (phi, theta)
    for _ in range(8):
        K, S = C * mp.cos(phi + theta), C * mp.sin(phi + theta)
        by_phi = a * mp.cos(phi) + f * mp.sin(phi) - K
        by_theta = b * mp.sin(theta) + f * mp.cos(theta) - K
        gradient = mp.matrix([by_phi, by_theta])
        h11, h22 = -a * mp.sin(phi) + f * mp.cos(phi) + S, b * mp.cos(theta) - f * mp.sin(theta) + S
        H = mp.matrix([[h11, S], [S, h22]])
        if mp.norm(gradient) == 0:
            break
        step = mp.lu_solve(H, gradient)
        phi, theta = phi - step[0], theta - step[1]
    scale = max(abs(x) for x in exact)
    moved = abs(phi - start[0]) + abs(theta - start[1])
    if mp.norm(gradient) > scale * mpf(10) ** -(DIGITS - 10) or moved > 1e-20:
        raise ArithmeticError(f"Newton left the root: {mp.nstr(start, 20)}")
    return wrap(phi), wrap(theta), H


def wrap(angle: Any) -> Any:
    """The copy in (-pi, pi]; an angle within rounding of -pi counts as pi, one within rounding of 0 as 0."""
    tiny = mpf(10) ** -(DIGITS - 15)
    wrapped = mp.pi - (mp.pi - angle) % (2 * mp.pi)
    if abs(wrapped) < tiny:
        return mpf(0)
    return wrapped + 2 * mp.pi if wrapped < -mp.pi + tiny else wrapped


def solve(scene: Scene) -> list[tuple[Any, Any, list[int]]]:
    """(phi, theta, signs of the Hessian's eigenvalues) of every equilibrium, sorted by phi, then theta."""
    rational = exact_coefficients(scene)
    with mp.workdps(DIGITS):
        exact = tuple(mpf(x.numerator) / x.denominator for x in rational)
        a, b, C, f = exact
        if C == 0:
            zero_phi, zero_theta = mp.atan2(-a, f), mp.atan2(-f, b)
            pairs = [(p, t) for p in (zero_phi, zero_phi + mp.pi) for t in (zero_theta, zero_theta + mp.pi)]
        else:
            pairs = [(phi, theta) for phi in unit_roots(rational) for theta in angles_theta(exact, phi)]
        found = []
        for pair in pairs:
            phi, theta, H = polish(exact, *pair)
            # A determinant that is zero to many digits would be a fold, which no scene here is.
            determinant = H[0, 0] * H[1, 1] - H[0, 1] ** 2
            if abs(determinant) < mpf(10) ** -12 * max(abs(x) for x in H) ** 2:
                raise ArithmeticError("an equilibrium is too close to a fold")
            trace_sign = 1 if H[0, 0] + H[1, 1] > 0 else -1
            signs = [-1, 1] if determinant < 0 else [trace_sign, trace_sign]
            found.append((phi, theta, signs))
        # Angles that are equal but for rounding must sort as equal.
        return sorted(found, key=lambda e: tuple(mp.nint(x * 10**STORED) for x in e[:2]))


def newton_from_grid(exact: Exact, n: int = 40) -> np.ndarray:
    """Distinct equilibria that Newton's method in doubles reaches from an n x n grid, (k, 2)."""
    a, b, C, f = (float(x) for x in exact)
    axis = np.linspace(-np.pi, np.pi, n, endpoint=False) + 0.0123
    phi, theta = (x.ravel() for x in np.meshgrid(axis, axis))
    with np.errstate(all="ignore"):
        for _ in range(60):
            K, S = C * np.cos(phi + theta), C * np.sin(phi + theta)
            g1 = a * np.cos(phi) + f * np.sin(phi) - K
            g2 = b * np.sin(theta) + f * np.cos(theta) - K
            h11, h22 = -a * np.sin(phi) + f * np.cos(phi) + S, b * np.cos(theta) - f * np.sin(theta) + S
            determinant = h11 * h22 - S * S
            phi = phi - np.clip((h22 * g1 - S * g2) / determinant, -0.5, 0.5)
            theta = theta - np.clip((h11 * g2 - S * g1) / determinant, -0.5, 0.5)
    scale = max(abs(x) for x in (a, b, C, f))
    settled = np.hypot(g1, g2) < 1e-11 * scale
    return np.column_stack([phi, theta])[settled]


def check(name: str, exact: Exact, found: list[tuple[Any, Any, list[int]]]) -> None:
    """Counting law, and the same set by Newton's method from a grid."""
    index = sum(signs[0] * signs[1] for *_, signs in found)
    if index != 0 or len(found) not in (4, 6):
        raise ArithmeticError(f"{name}: {len(found)} equilibria with index sum {index}")
    known = np.array([(float(phi), float(theta)) for phi, theta, _ in found])
    reached = newton_from_grid(exact)
    distance = np.abs(np.angle(np.exp(1j * (reached[:, None, :] - known[None, :, :])))).max(axis=2)
    if distance.min(axis=1).max() > 1e-6:
        raise ArithmeticError(f"{name}: Newton's method reaches an equilibrium that is not listed")
    if distance.min(axis=0).max() > 1e-6:
        raise ArithmeticError(f"{name}: Newton's method from the grid misses a listed equilibrium")


def main() -> None:
    lines = [
        "# Equilibria under a constant force, made by make_equilibria.py; parameters are exact doubles.",
        "# phi, theta: rad, in (-pi, pi] but for the rounding to 30 digits.",
        "# hessian_signs: signs of the eigenvalues of the Hessian of U = Pi - F0 x2, rising.",
    ]
    counts: dict[tuple[int, ...], int] = {}
    for name, (why, changes) in chain(NAMED.items(), random_scenes().items()):
        scene = {**TABLE_1, **changes}
        found = solve(scene)
        check(name, exact_coefficients(scene), found)
        morse = [signs.count(-1) for *_, signs in found]
        census = tuple(morse.count(index) for index in range(3))
        counts[census] = counts.get(census, 0) + 1
        parameters = ", ".join(f"{key} = {value!r}" for key, value in scene.items())
        lines += ["", "[[scene]]", f'name = "{name}"', f'why = "{why}"']
        lines += [f"parameters = {{ {parameters}, alpha = 0.0 }}", "equilibria = ["]
        for (phi, theta, signs), index in zip(found, morse, strict=True):
            angles = f'phi = "{mp.nstr(phi, STORED)}", theta = "{mp.nstr(theta, STORED)}"'
            lines.append(f"  {{ {angles}, hessian_signs = {signs}, morse_index = {index} }},")
        lines.append("]")
    Path(__file__).with_name("equilibria.toml").write_text("\n".join(lines) + "\n")
    print(f"{sum(counts.values())} scenes; (minima, saddles, maxima): number of scenes")
    print(counts)


if __name__ == "__main__":
    main()
