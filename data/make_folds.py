"""Write folds.toml: loads and stiffnesses at which equilibria merge, to 40 digits.

    python data/make_folds.py

Notation as in make_equilibria.py: equilibria satisfy g1 = a cos(phi) + f sin(phi) - C cos(phi + theta) = 0
and g2 = b sin(theta) + f cos(theta) - C cos(phi + theta) = 0; at a fold the determinant of the Hessian
vanishes too, at a cusp also the third derivative of U along the Hessian's null direction.  Folds over one
parameter are looked for where the number of equilibria changes between neighbours of a grid, counted by the
roots of the polynomial of degree 6 on the unit circle; what is found is solved for at 60 digits by Newton's
method and checked.  Cusps are solved for from rough places.  Nothing of fastmech is used.  Takes about 5 s.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from mpmath import mp, mpf

STORED = 40

Scene = dict[str, float]

TABLE_1: Scene = {
    "m1": 10.0, "m2": 12.0, "m3": 8.0, "l": 1.25, "c1": 162.5, "c2": 1100 / 3,
    "beta": 121.0, "g": 9.80665, "F0": 100.0, "alpha": 0.0,
}  # fmt: skip

#: (name, changes to Table 1, parameter, range)
LINES: list[tuple[str, Scene, str, tuple[float, float]]] = [
    ("table_1", {}, "F0", (-20.0, 20.0)),
    ("table_1_as_printed", {"c2": 366.67}, "F0", (-20.0, 20.0)),
    ("bistable", {"c1": 294.9, "c2": 92.85}, "F0", (-900.0, 900.0)),
    ("soft_c2", {"c2": 20.0}, "F0", (-400.0, 400.0)),
    ("over_c1", {"F0": 350.0}, "c1", (5.0, 500.0)),
    ("over_c2", {"F0": 120.0}, "c2", (1.0, 600.0)),
    ("over_m2", {"F0": 60.0, "c2": 90.0}, "m2", (0.5, 40.0)),
    ("over_l", {"F0": 60.0, "c2": 90.0}, "l", (0.2, 4.0)),
    ("stiff_and_light", {"m1": 0.2, "m2": 0.5, "l": 0.4, "c1": 30.0, "c2": 12.0}, "F0", (-40.0, 40.0)),
]

#: (name, changes, two parameters, rough place phi, theta and the two values)
CUSPS: list[tuple[str, Scene, tuple[str, str], tuple[float, float, float, float]]] = [
    ("unforced_stiff", {}, ("F0", "c1"), (-1.57, 0.0, 0.0, 183.0)),
    ("unforced_soft", {}, ("F0", "c1"), (-1.57, -3.14, 0.0, 63.4)),
    ("stable", {}, ("F0", "c1"), (-0.356, -2.786, 316.5, 270.1)),
    ("stable_c2", {}, ("F0", "c2"), (-0.618, -2.524, 165.6, 277.8)),
]


def load(scene: dict[str, Any]) -> tuple[Any, Any, Any, Any]:
    """a, b, C, f [J]."""
    m1, m2, l, g = scene["m1"], scene["m2"], scene["l"], scene["g"]
    return (m1 + m2) * g * l - scene["c2"] * l**2, m2 * g * l, scene["c1"] * l**2, scene["F0"] * l


def equations(scene: dict[str, Any], phi: Any, theta: Any) -> tuple[Any, Any, Any, Any]:
    """g1, g2, det of the Hessian and its derivative along the null direction, over powers of the load."""
    a, b, C, f = load(scene)
    size = abs(a) + abs(b) + abs(C) + abs(f)
    a, b, C, f = a / size, b / size, C / size, f / size

    def hessian(p: Any, t: Any) -> tuple[Any, Any, Any]:
        s = C * mp.sin(p + t)
        return f * mp.cos(p) - a * mp.sin(p) + s, s, b * mp.cos(t) - f * mp.sin(t) + s

    h11, h12, h22 = hessian(phi, theta)
    # dU3[v, v, v] for the null direction v, from the third derivatives of U.
    v1, v2 = (h12, -h11) if abs(h11) > abs(h22) else (h22, -h12)
    k = C * mp.cos(phi + theta)
    third = (
        (-f * mp.sin(phi) - a * mp.cos(phi)) * v1**3
        + (-b * mp.sin(theta) - f * mp.cos(theta)) * v2**3
        + k * (v1 + v2) ** 3
    )
    return (
        a * mp.cos(phi) + f * mp.sin(phi) - k,
        b * mp.sin(theta) + f * mp.cos(theta) - k,
        h11 * h22 - h12**2,
        third / mp.hypot(v1, v2) ** 3,
    )


def unit_angles(scene: Scene) -> np.ndarray:
    """phi of the polynomial's roots on the unit circle, in doubles."""
    a, b, C, f = load(scene)
    w, q = f + 1j * b, a - 1j * f
    first = np.polymul([C**2, 0.0], np.polymul([w, 0.0, -w.conjugate()], [w, 0.0, -w.conjugate()]))
    square = np.polymul([q, 0.0, q.conjugate()], [q, 0.0, q.conjugate()])
    second = np.polymul(square, np.polymul([-C, w.conjugate()], [w, -C]))
    roots = np.roots(np.polyadd(first, second))
    return np.angle(roots[np.abs(np.abs(roots) - 1.0) < 1e-7])


def merging(scene: Scene) -> tuple[float, float]:
    """Rough place of the two equilibria that are about to merge: the closest pair of unit roots."""
    phi = np.sort(unit_angles(scene))
    gaps = np.abs(np.angle(np.exp(1j * (np.roll(phi, -1) - phi))))
    first = int(np.argmin(gaps))
    middle = phi[first] + 0.5 * gaps[first]
    a, b, C, f = load(scene)
    pull = a * math.cos(middle) + f * math.sin(middle)
    spread = math.acos(max(-1.0, min(1.0, pull / math.hypot(b, f))))
    choices = [math.atan2(b, f) + spread, math.atan2(b, f) - spread]
    return middle, min(choices, key=lambda t: abs(C * math.cos(middle + t) - pull))


def folds(scene: Scene, name: str, limits: tuple[float, float], points: int = 801) -> list[tuple[Any, ...]]:
    """(value, phi, theta) of every fold over a parameter, rising."""
    # An odd shift keeps the grid off values with symmetry, where roots of the polynomial are double.
    grid = np.linspace(*limits, points) + 1.234e-4
    counts = [len(unit_angles({**scene, name: float(value)})) for value in grid]
    found = []
    for k in np.flatnonzero(np.diff(counts)):
        low, high = float(grid[k]), float(grid[k + 1])
        more = counts[k] > counts[k + 1]
        for _ in range(30):
            middle = 0.5 * (low + high)
            if (len(unit_angles({**scene, name: middle})) > min(counts[k], counts[k + 1])) == more:
                low = middle
            else:
                high = middle
        inside = low if more else high
        place = merging({**scene, name: inside})

        def conditions(value: Any, phi: Any, theta: Any) -> tuple[Any, ...]:
            return equations({**scene, name: value}, phi, theta)[:3]

        with mp.workdps(60):
            root = mpmath.findroot(conditions, (inside, *place), tol=mpf(10) ** -100, maxsteps=60)
            if abs(root[0] - inside) > 1e-3 * (1.0 + abs(inside)):
                raise ArithmeticError(f"Newton's method left the fold at {name} = {inside}")
            found.append(tuple(root))
    return found


def cusp(scene: Scene, names: tuple[str, str], place: tuple[float, ...]) -> tuple[Any, ...]:
    """(first value, second value, phi, theta) of the cusp near a place."""

    def conditions(phi: Any, theta: Any, x: Any, y: Any) -> tuple[Any, ...]:
        return equations({**scene, names[0]: x, names[1]: y}, phi, theta)

    with mp.workdps(60):
        phi, theta, x, y = mpmath.findroot(conditions, place, tol=mpf(10) ** -90, maxsteps=60)
    return x, y, phi, theta


def main() -> None:
    def text(value: Any) -> str:
        return mp.nstr(mp.chop(value, mpf(10) ** -45), STORED)

    lines = ["# Folds and cusps, made by make_folds.py; parameters are exact doubles, angles in rad."]
    with mp.workdps(60):
        for name, changes, parameter, limits in LINES:
            scene = {**TABLE_1, **changes}
            found = folds(scene, parameter, limits)
            parameters = ", ".join(f"{key} = {value!r}" for key, value in scene.items())
            lines += ["", "[[line]]", f'name = "{name}"', f"parameters = {{ {parameters} }}"]
            lines += [f'parameter = "{parameter}"', f"range = [{limits[0]!r}, {limits[1]!r}]", "folds = ["]
            for value, phi, theta in found:
                lines.append(
                    f'  {{ value = "{text(value)}", phi = "{text(phi)}", theta = "{text(theta)}" }},'
                )
            lines.append("]")
            print(name, len(found), "folds")
        for name, changes, names, place in CUSPS:
            scene = {**TABLE_1, **changes}
            x, y, phi, theta = cusp(scene, names, place)
            parameters = ", ".join(f"{key} = {value!r}" for key, value in scene.items())
            lines += ["", "[[cusp]]", f'name = "{name}"', f"parameters = {{ {parameters} }}"]
            lines += [f'names = ["{names[0]}", "{names[1]}"]', f'values = ["{text(x)}", "{text(y)}"]']
            lines += [f'phi = "{text(phi)}"', f'theta = "{text(theta)}"']
    Path(__file__).with_name("folds.toml").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
