"""Each mistake is told in one line that names what is wrong."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pytest
import sympy

import fastmech as fm

pytestmark = pytest.mark.nojit

PHI, X = fm.angles("phi"), fm.lengths("x", -2.0, 2.0)
M, K, L = sympy.symbols("m k l")
RIGHT: dict[str, Any] = {
    "coordinates": (PHI, X),
    "parameters": {"m": 2.0, "k": 3.0, "l": 1.5},
    "points": {"P": (X + L * sympy.cos(PHI), L * sympy.sin(PHI)), "Q": (X, 0)},
    "masses": {"P": M, "Q": M},
    "springs": [fm.Spring((0, 0), "P", K)],
}

WRONG: list[tuple[dict[str, Any], str]] = [
    ({"coordinates": ()}, "coordinates = "),
    ({"coordinates": (sympy.Symbol("phi"),)}, "must be one to four symbols"),
    ({"coordinates": fm.lengths("a b c d e")}, "one to four"),
    ({"dissipation": K}, "dissipation = k: must have rates, as c "),
    ({"coordinates": (PHI, PHI)}, "phi: names a coordinate, a rate or a parameter twice"),
    ({"coordinates": (PHI, fm.lengths("phi_dot"))}, "phi_dot: names"),
    ({"parameters": {"m": 2.0, "phi": 3.0}}, "phi: names"),
    ({"parameters": {"m": 2.0, "l": 1.0}}, r"springs\[0\].stiffness: has the symbol k"),
    ({"parameters": {"m": math.nan, "k": 1.0}}, "parameters.m = nan: must be a finite number"),
    ({"parameters": {"m": True, "k": 1.0}}, "parameters.m = True"),
    ({"parameters": {"m": (1.0, "kg"), "k": (1.0, "lbf"), "l": (1.0, "m")}}, "parameters.k: unit = 'lbf'"),
    ({"parameters": {"m": (1.0, "kg"), "k": (1.0, "kg"), "l": (1.0, "m")}}, r"^springs\[0\] .*-P\): has "),
    ({"parameters": {"m": (1.0, "m"), "k": (1.0, "N/m"), "l": (1.0, "m")}}, r"masses\[0\]: has another unit"),
    (
        {
            "parameters": {"m": (1.0, "kg"), "k": (1.0, "N/m"), "l": (1.0, "m")},
            "springs": [fm.Spring("P", "Q", K), fm.Spring((0, 0.7), "Q", K)],
        },
        r"springs\[1\] \(\(0, 0.7\)-Q\): has another unit than J .* plain numbers other than 0 have no unit",
    ),
    ({"parameters": {"m": 1.0, "k": 1.0, "sin": 1.0}}, "'sin' must be a Python name"),
    ({"parameters": {"m": 1.0, "k": 1.0, "_a": 1.0}}, "'_a' must be a Python name"),
    ({"parameters": {"m": 1.0, M: 1.0, "k": 1.0}}, "parameters.m: is given twice"),
    ({"points": {"P": (X,)}}, "points.P = "),
    ({"points": {"P": (X, sympy.Symbol("u"))}}, "points.P: has the symbol u"),
    ({"points": {"P": (X, PHI.dot), "Q": (X, 0)}}, "points.P: has the symbol phi_dot"),
    ({"points": {"P": (X, "phi"), "Q": (X, 0)}}, "points.P = 'phi': must be a number or a SymPy expression"),
    ({"masses": {"R": M}}, r"masses\[0\] = 'R': no such point; points are P, Q"),
    ({"masses": 3.0}, "masses = 3.0: must be a list"),
    ({"masses": {"Q": M}}, "kinetic: is not positive definite: phi moves no mass"),
    ({"masses": {"P": -M, "Q": 3 * M}}, "kinetic: is not positive definite"),
    ({"masses": {"P": M}}, "kinetic: is not positive definite, as at phi = -?1.57"),
    ({"kinetic": PHI.dot**3}, "kinetic: must be quadratic in the rates"),
    ({"kinetic": PHI.dot}, "kinetic: must be quadratic in the rates"),
    ({"kinetic": M}, "kinetic: must be quadratic in the rates"),
    ({"potential": K * PHI**2}, "phi: the mechanism is not the same after a full turn"),
    ({"springs": [fm.TorsionSpring(PHI, K)]}, "phi: the mechanism is not the same after a full turn"),
    ({"potential": K * sympy.cos(1.000000001 * PHI)}, "phi: the mechanism is not the same after a full turn"),
    ({"potential": sympy.sqrt(X - 3)}, "potential: is no finite number at 100% of the .*, as at .*x = "),
    ({"potential": sympy.log(X)}, r"potential: is no finite number at [45]\d% of the .*, as at .*x = -[01]"),
    ({"forces": [fm.Torque(X, 1.0)]}, r"forces\[0\].angle = x: is a length; must be an angle \[rad\]"),
    ({"springs": [fm.TorsionSpring(-X, K)]}, r"springs\[0\].angle = -x: is a length"),
    ({"dampers": [fm.TorsionDamper(X, K)]}, r"dampers\[0\].angle = x: is a length"),
    ({"masses": [("P", M), fm.Body("Q", M, M, X)]}, r"masses\[1\].angle = x: is a length"),
    ({"potential": PHI.dot}, "potential: has the symbol phi_dot"),
    *(
        ({"potential": f}, f"potential: has {type(f).__name__}, which is not known here; functions are sin")
        for f in (
            sympy.gamma(X), sympy.floor(X), sympy.ceiling(X), sympy.Mod(X, 2), sympy.erf(X),
            sympy.Derivative(X**2, X), sympy.Integral(X, X), sympy.Sum(X**K, (K, 1, 3)),
        )
    ),
    ({"potential": sympy.sign(1 + X ** sympy.Rational(3, 2))}, "equations: has .* is not known here"),
    *(
        ({field: sympy.Matrix([X, 1])}, rf"^{field} = Matrix.*: must be a number or a SymPy expression")
        for field in ("kinetic", "potential", "dissipation")
    ),
    ({"potential": sympy.I * X}, "must be a finite real expression"),
    ({"springs": [fm.Spring("P", (0, 0, 0), K)]}, r"springs\[0\].b: has 3 components"),
    ({"springs": [("P", "Q", K)]}, r"springs\[0\] = .*must be a Spring or TorsionSpring"),
    ({"springs": fm.Spring("P", "Q", K)}, "springs = .*: must be a list"),
    ({"dampers": [fm.Damper((0, 0), "P", -K)]}, "dissipation: feeds energy in"),
    ({"dissipation": -(PHI.dot**2)}, "dissipation: feeds energy in"),
    ({"dissipation": K * sympy.sqrt(PHI.dot**2 + X.dot**2)}, "dissipation, .*: friction has no direction"),
    (
        {"generalized_forces": {X: -K * X.dot / sympy.sqrt(PHI.dot**2 + X.dot**2)}},
        ".*generalized_forces: friction has no direction where rates are zero.*e",
    ),
    ({"dampers": [fm.Damper("P", "Q", K, along=(0, 0))]}, r"dampers\[0\].along = \(0, 0\): must not be zero"),
    ({"dampers": [fm.Damper("P", "P", K)]}, r"dampers\[0\].b = 'P': must be another point than a"),
    ({"springs": [fm.Spring("P", "P", K)]}, r"springs\[0\].b = 'P': must be another point than a"),
    ({"forces": [fm.Force("P", 3.0, (1, 1))]}, r"forces\[0\].direction = .*: must be a unit vector"),
    ({"forces": [fm.Force("P", 3.0, (0.866, 0.5))]}, r"forces\[0\].direction = .*: must be a unit vector"),
    ({"forces": [fm.Force("P", 3.0, (L, sympy.sqrt(3) / 2))]}, "must be a unit vector"),
    ({"forces": [fm.Force("P", 3.0, (sympy.cos(PHI / 2), sympy.sin(PHI / 2)))]}, "phi: .* after a full turn"),
    ({"forces": [fm.Force("P", K * X, (1, 0))]}, r"forces\[0\].load.value: depends on a coordinate"),
    ({"forces": [fm.Force("P", sympy.Symbol("z"), (1, 0))]}, r"forces\[0\].load: has the symbol z"),
    ({"generalized_forces": {"z": 1.0}}, "generalized_forces: 'z' is no coordinate"),
    ({"generalized_forces": 3.0}, "generalized_forces = 3.0"),
    ({"gravity": "down"}, "gravity = 'down': must be a number or a SymPy expression"),
    ({"gravity": (0, 0, -1)}, "gravity: has 3 components, must have the points' 2"),
    ({"name": "two\nlines"}, r"name = 'two.*lines': must be words of letters"),
    ({"name": " "}, "name = ' ': must be words of letters"),
    ({"name": 'a "b"'}, "name = 'a \"b\"': must be words"),
    ({"name": 3}, "name = 3: must be words of letters"),
]  # fmt: skip


def test_the_right_one_is_taken() -> None:
    fm.Mechanism(**RIGHT)


@pytest.mark.parametrize(("change", "told"), WRONG)
def test_each_mistake_gets_a_line(change: dict[str, Any], told: str) -> None:
    with pytest.raises(fm.InputError, match=told) as caught:
        fm.Mechanism(**RIGHT | change)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("two-words",), "names = 'two-words': must be different Python names"),
        (("a a",), "names = 'a a'"),
        (("",), "names = ''"),
        ((3,), "names = 3"),
        (("a", 1.0, 1.0), r"low, high = \(1.0, 1.0\): low must be less"),
        (("a", "b", 1.0), "low, high = .*must be numbers"),
    ],
)
def test_wrong_coordinates(arguments: tuple[Any, ...], told: str) -> None:
    for make in (fm.angles, fm.lengths):
        with pytest.raises(fm.InputError, match=told):
            make(*arguments)


@pytest.mark.parametrize("ends", [{"low": 0.0}, {"high": 2.0}])
def test_an_angle_has_both_ends_or_none(ends: dict[str, float]) -> None:
    with pytest.raises(fm.InputError, match=r"low, high = \(.*\): an angle must have both ends, or none and"):
        fm.angles("q", **ends)
    fm.lengths("q", **ends)


def test_a_potential_may_be_none_in_single_places() -> None:
    """A magnet's at its own place; an angle of a point is one where the point moves by lengths."""
    x, y = fm.lengths("x y", -1.0, 1.0)
    away = sympy.sqrt(x**2 + y**2)
    fm.Mechanism(
        (x, y), {"k": 1.0}, points={"P": (x, y)}, masses={"P": 1.0}, potential=-K / away,
        forces=[fm.Torque(sympy.atan2(y, x - 2), 1.0), fm.Torque(x / 0.3, 1.0)],
    )  # fmt: skip


def test_an_angle_with_a_range_takes_a_torsion_spring() -> None:
    bounded = fm.angles("phi", -2.0, 2.0)
    found = fm.Mechanism(
        bounded, {"k": 2.0}, kinetic=bounded.dot**2 / 2, springs=[fm.TorsionSpring(bounded, K)]
    )
    np.testing.assert_allclose(found.accelerations(0.0, [0.5, 0.0]), [-1.0])
    assert found.coordinates[0].high == 2.0
    assert not found.coordinates[0].periodic
    assert fm.Mechanism(**RIGHT).coordinates[0].periodic


def test_states_of_another_shape_are_refused() -> None:
    with pytest.raises(fm.InputError, match=r"y: has shape \(3,\), must be \(\.\.\., 4\)"):
        fm.Mechanism(**RIGHT).energies([1.0, 2.0, 3.0])


F, W, H = sympy.symbols("F w h")
UNITS = {"m": "kg", "k": "N/m", "l": "m", "F": "N", "w": "1/s", "h": "s"}


def of_units(units: dict[str, str], **more: Any) -> fm.Mechanism:
    parameters = {name: (0.7, unit) for name, unit in (UNITS | units).items()}
    return fm.Mechanism(**RIGHT | {"parameters": parameters} | more)


def test_what_has_the_right_units_is_taken() -> None:
    """Also a load's plain numbers, which are in SI units, and branches; no unit is that of a pure number."""
    assert of_units({"s": ""}).units["s"] == "1"
    for load in (
        fm.loads.Harmonic(F, W),
        fm.loads.Pulse(F, 0, H),
        fm.loads.Harmonic(80.0, W, mean=F),
        5.0,
        F,
    ):
        of_units({}, forces=[fm.Force("P", load, (1, 0)), fm.Torque(PHI, F * L)])
    bent = sympy.Piecewise((K * X**2, X < 0), (F * sympy.Max(X, 0), True))
    of_units({}, potential=bent, generalized_forces={"x": -F * X.dot / L * H, "phi": F * L}, gravity=L / H**2)


@pytest.mark.parametrize(
    ("units", "more", "told"),
    [
        ({"F": "kg"}, fm.loads.Harmonic(F, W), r"forces\[0\].load.amplitude: has another unit than N "),
        ({"w": "m"}, fm.loads.Harmonic(F, W), r"forces\[0\].load.frequency: has another unit than 1/s "),
        ({"w": "kg"}, fm.loads.Harmonic(F, W), r"forces\[0\].load.frequency: has another unit than 1/s "),
        ({}, fm.loads.Harmonic(F, W, mean=K), r"forces\[0\].load.mean: has another unit than N "),
        ({"F": "kg"}, fm.loads.Pulse(F, 0, H), r"forces\[0\].load.value: has another unit than N "),
        ({"h": "m"}, fm.loads.Pulse(F, 0, H), r"forces\[0\].load.duration: has another unit than s "),
        ({}, {"forces": [fm.Torque(PHI, F)]}, r"forces\[0\].load.value: has another unit than N m "),
        (
            {},
            {"generalized_forces": {"phi": F}},
            r"generalized_forces\[phi\] \* phi_dot: has another unit than W",
        ),
        (
            {},
            {"generalized_forces": {"x": -F * X.dot}},
            r"generalized_forces\[x\] \* x_dot: has another unit",
        ),
        ({}, {"gravity": 9.81}, r"gravity on masses\[0\]: .* give each as a parameter with its unit"),
        ({}, {"dissipation": K * X.dot**2}, "dissipation: has another unit than W "),
    ],
)
def test_each_wrong_unit_is_named(units: dict[str, str], more: Any, told: str) -> None:
    given = more if isinstance(more, dict) else {"forces": [fm.Force("P", more, (1, 0))]}
    with pytest.raises(fm.InputError, match=told):
        of_units(units, **given)


C = sympy.Symbol("c")
BOUNDED = fm.lengths("s", -1.0, 1.0)


def between(**terms: Any) -> fm.Mechanism:
    """One that is a mechanism at c = 0 and near pi, but for the ``terms``."""
    given: dict[str, Any] = {"kinetic": BOUNDED.dot**2, "potential": BOUNDED**2 - C * BOUNDED / 9}
    return fm.Mechanism(BOUNDED, {"c": 0.0}, **given | terms)


@pytest.mark.parametrize(
    ("mechanism", "values", "told"),
    [
        (
            between(kinetic=(1 - 2 * sympy.sin(C) + BOUNDED**2 / 9) * BOUNDED.dot**2),
            np.linspace(0.0, 3.14, 9),
            r"c = \S+: kinetic: is not positive definite, as at s = ",
        ),
        (
            between(dissipation=(0.1 - sympy.sin(C)) * BOUNDED.dot**2),
            np.linspace(0.0, 3.14, 9),
            r"c = \S+: dissipation: feeds energy in, as at ",
        ),
        (
            fm.Mechanism(
                PHI, {"c": 1.0}, kinetic=PHI.dot**2, potential=-3 * sympy.cos(PHI) - sympy.cos(C * PHI)
            ),
            np.array([1.0, 1.5, 2.0, 3.0]),
            r"c = 1.5: phi: the mechanism is not the same after a full turn",
        ),
    ],
)  # fmt: skip
def test_values_between_allowed_ones_are_refused(mechanism: fm.Mechanism, values: Any, told: str) -> None:
    """At both ends each is a mechanism."""
    for end in (values[0], values[-1]):
        mechanism.replace(c=end)
    with pytest.raises(fm.InputError, match=f"^axes.{told}"):
        fm.map_equilibria(mechanism, {"c": values})
    with pytest.raises(fm.InputError, match=f"^parameters.{told}"):
        fm.integrate(mechanism, [[0.1, 0.0]] * values.size, t_end=1.0, dt=0.1, parameters={"c": values})
    with pytest.raises(fm.InputError, match=told.replace("1.5", r"\S+")):
        fm.find_snap(mechanism, parameter="c", searched=(values[0], values[-1]))


def test_values_on_a_grid_are_checked_together() -> None:
    """The mass is positive along each axis, not where both are large; and for all of many values but one."""
    d = sympy.Symbol("d")
    both = fm.Mechanism(
        BOUNDED, {"c": 0.0, "d": 0.0}, kinetic=(1 - C * d) * BOUNDED.dot**2, potential=BOUNDED**2
    )
    with pytest.raises(fm.InputError, match=r"^axes.c = 2, axes.d = 1: kinetic: is not positive definite"):
        fm.map_equilibria(both, {"c": [0.0, 2.0], "d": [0.0, 1.0]})
    values = np.zeros(10_000)
    values[1234] = 2.0
    with pytest.raises(fm.InputError, match=r"^parameters.c = 2: kinetic: is not positive definite"):
        fm.integrate(both.replace(d=1.0), [[0.1, 0.0]] * 10_000, t_end=1.0, dt=0.1, parameters={"c": values})
    assert fm.map_equilibria(both, {"c": [0.0, 0.5], "d": [0.0, 1.0]}).outcome.tolist() == [[0, 0], [0, 0]]


def test_of_a_parameter_that_is_used_nowhere_one_is_warned() -> None:
    """Those in loads alone, in points that nothing needs and in lengths of springs are used."""
    a, f, w, s = sympy.symbols("a f w s")
    more = {"a": 1.0, "f": 2.0, "w": 3.0, "s": 0.5}
    given = {**RIGHT, "parameters": {**RIGHT["parameters"], **more}}
    given["points"] = {**RIGHT["points"], "drawn": (w, 0)}
    given["forces"] = [fm.Force("Q", fm.loads.Harmonic(a, f), (1, 0))]
    springs = [*RIGHT["springs"], fm.Spring((0, 0), "Q", K, free_length=s)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fm.Mechanism(**{**given, "springs": springs})
    with pytest.warns(UserWarning, match="^parameters.s: is used nowhere; leave it out, or use its symbol$"):
        fm.Mechanism(**given)


@pytest.mark.parametrize("n", [2.0, 2.5, 3.0])
def test_the_exponent_of_friction_may_be_a_parameter(n: float) -> None:
    """b |v|^n / n is lost by the force b |v|^(n - 1), and at rest there is none."""
    x = fm.lengths("x", -1.0, 1.0)
    b, power = sympy.symbols("b n")
    slider = fm.Mechanism(
        x, {"b": 0.7, "n": n}, kinetic=x.dot**2 / 2, dissipation=b * sympy.Abs(x.dot) ** power / power
    )
    for v in (-0.8, 0.0, 0.3):
        pulled = -0.7 * abs(v) ** (n - 1.0) * np.sign(v)
        assert slider.accelerations(0.0, [0.1, v]) == pytest.approx([pulled], rel=1e-12)


def test_an_angle_that_turns_fully_may_have_a_million_waves() -> None:
    """Rounding of the turned angle is no change; half a wave more is one."""
    q = fm.angles("q")
    for waves in (1_000_000, -300_000):
        fm.Mechanism(q, kinetic=q.dot**2, potential=sympy.cos(waves * q))
        with pytest.raises(fm.InputError, match="q: the mechanism is not the same after a full turn"):
            fm.Mechanism(q, kinetic=q.dot**2, potential=sympy.cos((waves + 0.5) * q))


def test_numbers_beyond_floating_point_get_a_line() -> None:
    x, k = fm.lengths("x", -1, 1), sympy.Symbol("k")
    with pytest.raises(fm.InputError, match=r"potential = 10+\.\.\.: must be a finite real expression"):
        fm.Mechanism(x, kinetic=x.dot**2, potential=10**400 * x**2)
    with pytest.raises(fm.InputError, match=r"parameters\.k = 10+\.\.\.: must be a finite number"):
        fm.Mechanism(x, {"k": 10**400}, kinetic=x.dot**2, potential=k * x**2)
