"""Equations of motion of mechanisms against others' derivations of them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sympy
from oracles import TABLE_1, oracle

import fastmech as fm
from fastmech.models.mechanism import Mechanism
from fastmech.slider.lagrange import (
    angular_accelerations,
    kinetic_energy,
    momenta,
    potential_energy,
    potential_gradient,
    potential_hessian,
    unit,
)

pytestmark = pytest.mark.nojit

X, (F, D) = fm.lengths("x", -1.0, 1.0), sympy.symbols("F D")


@pytest.fixture(scope="module")
def states() -> np.ndarray:
    return np.random.default_rng(0).uniform(-4.0, 4.0, (500, 4))


def distance(found: np.ndarray, wanted: np.ndarray) -> float:
    """Greatest difference of vectors relative to their lengths."""
    return float(np.max(np.linalg.norm(found - wanted, axis=-1) / np.linalg.norm(wanted, axis=-1)))


@pytest.mark.parametrize("t", [0.0, 0.4])
@pytest.mark.parametrize("changes", [{}, {"m2": 0.3, "c1": 12.0, "F0": -40.0, "alpha": 0.0, "l": 3.0}])
def test_the_paper_s_mechanism_moves_as_the_scene(
    states: np.ndarray, t: float, changes: dict[str, float]
) -> None:
    mechanism, scene = fm.mechanisms.slider_pendulum().replace(**changes), fm.Scene(**changes)
    assert mechanism.parameters == scene.parameters
    assert distance(mechanism.accelerations(t, states), angular_accelerations(scene, states, t)) < 1e-13


def test_the_paper_s_mechanism_moves_as_40_digits_tell(states: np.ndarray) -> None:
    mechanism = fm.mechanisms.slider_pendulum().replace(c2=TABLE_1["c2"])
    found = mechanism.accelerations(0.3, states[:20])
    for state, accelerations in zip(states[:20], found, strict=True):
        wanted = np.array(oracle().accelerations(TABLE_1, state.tolist(), 0.3), dtype=float)
        assert distance(accelerations, wanted) < 1e-13


def test_energies_and_momenta_are_the_scene_s(states: np.ndarray) -> None:
    mechanism, scene = fm.mechanisms.slider_pendulum(), fm.Scene()
    energies = mechanism.energies(states)
    np.testing.assert_allclose(energies.kinetic, kinetic_energy(scene, states), rtol=1e-13)
    ours = energies.potential - energies.potential[0]
    theirs = potential_energy(scene, states[:, :2])
    np.testing.assert_allclose(ours, theirs - theirs[0], atol=1e-10 * unit(scene) * 100.0)
    np.testing.assert_allclose(mechanism.to_momenta(states)[:, 2:], momenta(scene, states), rtol=1e-12)
    np.testing.assert_allclose(mechanism.to_rates(mechanism.to_momenta(states)), states, rtol=1e-12)


def lagrange(T, U, q, forces):  # type: ignore[no-untyped-def]
    """Accelerations by Euler's and Lagrange's equations, differentiated and solved as they stand."""
    t = sympy.Symbol("time")
    moving = [sympy.Function(str(x))(t) for x in q]
    names = dict(zip(q, moving, strict=True))
    names |= {sympy.Symbol(f"{x}_dot", real=True): f.diff(t) for x, f in zip(q, moving, strict=True)}
    L = (T - U).subs(names)
    left = [L.diff(f.diff(t)).diff(t) - L.diff(f) for f in moving]
    a = sympy.symbols(f"a:{len(q)}")
    left = [e.subs({f.diff(t, 2): x for f, x in zip(moving, a, strict=True)}) for e in left]
    back = {f.diff(t): sympy.Symbol(f"{x}_dot", real=True) for x, f in zip(q, moving, strict=True)}
    left = [
        e.subs(back).subs(dict(zip(moving, q, strict=True))) - f for e, f in zip(left, forces, strict=True)
    ]
    M, r = sympy.linear_eq_to_matrix(left, a)
    rates = [sympy.Symbol(f"{x}_dot", real=True) for x in q]
    return sympy.lambdify([*q, *rates], [M, r], "numpy")


@pytest.mark.parametrize("constant", [0, 1, 2, 3])
def test_metrics_of_every_shape_are_solved(constant: int) -> None:
    """One to four coordinates, with none to all of the diagonal constant, full and sparse."""
    q = [fm.lengths(name) for name in ("a", "b", "c", "d")]
    rng = np.random.default_rng(constant)
    for n in (1, 2, 3, 4):
        some, v = q[:n], [x.dot for x in q[:n]]
        B = [[int(rng.integers(-2, 3)) for _ in range(n)] for _ in range(n)]
        each = [sum(b * x for b, x in zip(row, some, strict=True)) for row in B]
        T = sum(
            (2 + (sympy.sin(e) if i >= constant else 0)) * u**2
            for i, (e, u) in enumerate(zip(each, v, strict=True))
        )
        T += sum(sympy.cos(e) * v[i] * v[i - 1] / 3 for i, e in enumerate(each) if i)
        U = sum(sympy.exp(x / 3) + x**2 * some[0] / 5 for x in some)
        mechanism = Mechanism(some, kinetic=T, potential=U, dissipation=v[0] ** 2)
        plain = [sympy.Symbol(x.name, real=True) for x in some]
        swapped = dict(zip(some, plain, strict=True))
        solve = lagrange(T.subs(swapped), U.subs(swapped), plain, [-2 * v[0], *[0] * (n - 1)])
        for y in rng.uniform(-2.0, 2.0, (20, 2 * n)):
            M, r = solve(*y)
            np.testing.assert_allclose(
                mechanism.accelerations(0.0, y), np.linalg.solve(M, r).ravel(), rtol=1e-10, atol=1e-11
            )


def test_both_ways_of_writing_give_the_same() -> None:
    x, angle = fm.lengths("x"), fm.angles("angle")
    values = {"M": 2.0, "m": 0.7, "J": 0.3, "l": 1.3, "k": 5.0, "c": 0.4, "L0": 0.6, "g": 9.0}
    M, m, J, l, k, c, L0, g = sympy.symbols(list(values))
    tip = (x + l * sympy.sin(angle), -l * sympy.cos(angle))
    built = Mechanism(
        (x, angle), values, points={"cart": (x, 0), "tip": tip, "wall": (-3, 1)},
        masses=[("cart", M), fm.Body("tip", m, J, 2 * angle)],
        springs=[fm.Spring("wall", "tip", k, L0)], dampers=[fm.Damper("wall", "tip", c)], gravity=g,
    )  # fmt: skip
    away = sympy.sqrt((tip[0] + 3) ** 2 + (tip[1] - 1) ** 2)
    speed = away.diff(x) * x.dot + away.diff(angle) * angle.dot
    v = [p.diff(x) * x.dot + p.diff(angle) * angle.dot for p in tip]
    written = Mechanism(
        (x, angle), values,
        kinetic=M * x.dot**2 / 2 + m * (v[0] ** 2 + v[1] ** 2) / 2 + J * (2 * angle.dot) ** 2 / 2,
        potential=m * g * tip[1] + k * (away - L0) ** 2 / 2,
        dissipation=c * speed**2 / 2,
    )  # fmt: skip
    y = np.random.default_rng(3).uniform(-2.0, 2.0, (200, 4))
    assert distance(built.accelerations(0.0, y), written.accelerations(0.0, y)) < 1e-11
    np.testing.assert_allclose(built.energies(y).kinetic, written.energies(y).kinetic, rtol=1e-12)
    np.testing.assert_allclose(built.powers(0.0, y).lost, written.powers(0.0, y).lost, rtol=1e-10, atol=1e-12)


def test_energy_changes_by_what_is_brought_and_lost() -> None:
    """d(T + U)/dt along the motion, by differences, is the power of loads less that of dampers."""
    mechanism = fm.mechanisms.slider_pendulum()
    y = np.random.default_rng(5).uniform(-2.0, 2.0, (100, 4))
    rates = np.concatenate([y[:, 2:], mechanism.accelerations(0.2, y)], axis=-1)
    h = 1e-5
    energy = [sum(mechanism.energies(y + s * h * rates)) for s in (-1.0, 1.0)]
    power = mechanism.powers(0.2, y)
    np.testing.assert_allclose((energy[1] - energy[0]) / (2.0 * h), power.brought - power.lost, atol=1e-4)


def test_the_linear_motion_is_the_slope_of_the_forces() -> None:
    mechanism = fm.mechanisms.ziegler_column().replace(b=0.3, P=1.7)
    q, h = np.array([0.2, -0.4]), 1e-6
    M, C, K = mechanism.linear(q)

    def forces(position: np.ndarray, rates: np.ndarray) -> np.ndarray:
        return mechanism.metric(position) @ mechanism.accelerations(0.0, np.concatenate([position, rates]))

    still = np.zeros(2)
    for k, step in enumerate(h * np.eye(2)):
        slope = (forces(q + step, still) - forces(q - step, still)) / (2.0 * h)
        np.testing.assert_allclose(slope, -K[:, k], atol=1e-8)
        slope = (forces(q, step) - forces(q, -step)) / (2.0 * h)
        np.testing.assert_allclose(slope, -C[:, k], atol=1e-8)
    np.testing.assert_allclose(M, mechanism.metric(q))


def test_statics_are_the_forces_at_rest_with_loads_at_their_means() -> None:
    x, y = fm.lengths("x y")
    k, F = sympy.symbols("k F")
    mechanism = Mechanism(
        (x, y), {"k": 2.0, "F": 3.0}, points={"M": (x, y)}, masses={"M": 1.0},
        springs=[fm.Spring("M", (0, 0), k)],
        forces=[
            fm.Force("M", fm.loads.Harmonic(F, 4.0, mean=5.0), (1, 0)),
            fm.Force("M", fm.loads.Decaying(F, 1.0), (1, 0)),
            fm.Force("M", fm.loads.Ramp(F, 0.0, 1.0), (0, -1)),
        ],
    )  # fmt: skip
    found = mechanism.statics()
    assert [c.symbol.name for c in found.coordinates] == ["x", "y"]
    assert found.conservative
    named = {s.name: s for e in found.forces for s in e.free_symbols}
    assert sympy.simplify(found.forces[0] - (5.0 - named["k"] * named["x"])) == 0
    assert sympy.simplify(found.forces[1] - (-named["F"] - named["k"] * named["y"])) == 0
    assert not fm.mechanisms.ziegler_column().statics().conservative


@pytest.mark.parametrize(("alpha", "acting"), [(0.7, 0.0), (0.0, 100.0)])
def test_a_force_that_decays_is_gone_at_rest_and_one_that_does_not_stays(alpha: float, acting: float) -> None:
    mechanism, scene = fm.mechanisms.slider_pendulum().replace(alpha=alpha), fm.Scene()
    q = np.array([0.4, -0.7])
    found = mechanism.statics()
    at = [c.symbol for c in found.coordinates] + list(found.parameters)
    assert mechanism.loads[0].facts().mean == acting
    assert mechanism.loads[0].facts().bound == 100.0
    values = dict(zip(at, [*q, *mechanism.parameters.values()], strict=True))
    forces = [float(force.subs(values)) for force in found.forces]
    np.testing.assert_allclose(forces, -potential_gradient(scene, q, acting), rtol=1e-12)
    np.testing.assert_allclose(mechanism.linear(q).stiffness, potential_hessian(scene, q, acting), rtol=1e-12)


@pytest.mark.parametrize(
    ("point", "load", "direction", "pull"),
    [
        ((D + X, 0), F, (1, 0), lambda x: 3.0 * (0.7 + x)),
        ((0.7 + X, 0), 3.0, (1, 0), lambda x: 3.0 * (0.7 + x)),
        ((D + X, 0), fm.loads.Harmonic(1.0, 2.0, F), (1, 0), lambda x: 3.0 * (0.7 + x)),
        ((X, D), F, (sympy.sqrt(3) / 2, sympy.Rational(1, 2)), lambda x: 3.0 * (3.0**0.5 / 2.0 * x + 0.35)),
    ],
)
def test_a_lasting_force_acts_beside_the_origin(point: Any, load: Any, direction: Any, pull: Any) -> None:
    """T + U with its potential, and the acceleration that it gives."""
    mechanism = Mechanism(
        X,
        {"F": 3.0, "D": 0.7},
        points={"M": point},
        masses={"M": 2.0},
        forces=[fm.Force("M", load, direction)],
    )
    x, v = np.random.default_rng(8).uniform(-1.0, 1.0, (2, 20))
    wanted = v**2 - pull(x)
    np.testing.assert_allclose(mechanism.evaluate("bounding", [x, v])[0], wanted, rtol=1e-14)
    found = mechanism.accelerations(0.0, np.stack([x, v], -1))
    np.testing.assert_allclose(found[:, 0], 3.0 * float(direction[0]) / 2.0, rtol=1e-14)


Q, THIRD, CABLE = fm.angles("q", -2.0, 2.0), sympy.Rational(1, 3), sympy.Matrix([2 - F * X, 1 - X])


@pytest.mark.parametrize(
    ("q", "direction"),
    [
        (Q, (sympy.cos(D), sympy.sin(D))),
        (Q, (sympy.cos(Q + D), sympy.sin(Q + D))),
        (Q, (sympy.cos(Q + THIRD), sympy.sin(Q + THIRD))),
        (Q, (-sympy.sin(3 * Q / 5), -sympy.cos(3 * Q / 5))),
        (Q, (sympy.cos(D * Q), sympy.sin(D * Q))),
        (X, (D, sympy.sqrt(1 - D**2))),
        (X, tuple(CABLE / sympy.sqrt(CABLE.dot(CABLE)))),
        (X, CABLE.normalized()),
    ],
)
def test_unit_vectors_of_every_form_direct_a_force(q: Any, direction: Any) -> None:
    mechanism = Mechanism(
        q, {"F": 3.0, "D": 0.7}, points={"M": (2 * q, -q)}, masses={"M": 0.2},
        forces=[fm.Force("M", F, direction)],
    )  # fmt: skip
    for place in (-0.6, 0.3):
        along = [float(e.subs({F: 3.0, D: 0.7, q: place})) for e in map(sympy.sympify, direction)]
        wanted = 3.0 * (2.0 * along[0] - along[1])
        np.testing.assert_allclose(mechanism.accelerations(0.0, [place, 0.0]), [wanted], rtol=1e-13)


def test_branches_of_parameters_alone_are_parameters_still() -> None:
    """A spring that saturates, as a potential and as a force, in branches and their conditions."""
    k, h = sympy.symbols("k h")
    potential = sympy.Piecewise((k * X**2 / 2, (h > X) & (k > h)), (k * h * X - k * h**2 / 2, True))
    force = sympy.Piecewise((0, h > X), (-k, True))
    mechanism = Mechanism(
        X, {"k": 20.0, "h": 0.3}, kinetic=X.dot**2, potential=potential, generalized_forces={"x": force}
    )
    x = np.array([-0.5, 0.2, 0.8])
    found = mechanism.accelerations(0.0, np.stack([x, 0.0 * x], -1))[:, 0]
    np.testing.assert_allclose(found, [5.0, -2.0, -(6.0 + 20.0) / 2.0], rtol=1e-14)
    found = mechanism.accelerations(0.0, np.stack([x, 0.0 * x], -1), {"h": 0.1})[:, 0]
    np.testing.assert_allclose(found, [5.0, -(2.0 + 20.0) / 2.0, -(2.0 + 20.0) / 2.0], rtol=1e-14)


def test_a_torque_that_lasts_acts_on_an_angle_measured_from_elsewhere() -> None:
    q = fm.angles("q", -3.0, 3.0)
    mechanism = Mechanism(q, {"F": 3.0, "D": 0.7}, kinetic=q.dot**2, forces=[fm.Torque(2 * q - D, F)])
    np.testing.assert_allclose(mechanism.evaluate("bounding", [0.2, 1.0]), [1.0 - 3.0 * (0.4 - 0.7)])
    np.testing.assert_allclose(mechanism.accelerations(0.0, [0.2, 1.0]), [3.0])


def test_a_name_may_be_words_and_changes_no_motion() -> None:
    q = fm.angles("q")
    runs = [
        fm.integrate(
            fm.Mechanism(q, kinetic=q.dot**2 / 2, potential=-sympy.cos(q), name=name), [[1.0, 0.0]], 1.0, 0.1
        )
        for name in ("pendulum", "hanging pendulum (2.0 m/s)")
    ]
    np.testing.assert_array_equal(runs[0].y, runs[1].y)
    assert "Mechanism(hanging pendulum (2.0 m/s): q" in repr(runs[1].system)


def test_a_mechanism_prints_itself_in_a_line_and_takes_other_values() -> None:
    mechanism = fm.mechanisms.double_pendulum()
    assert "upper, lower" in repr(mechanism)
    assert mechanism.replace(m1=5.0).parameters["m1"] == 5.0
    assert mechanism.parameters["m1"] == 1.0
    assert mechanism.replace(m1=5.0).metric([0.0, 0.0])[0, 0] == 6.0
    with pytest.raises(fm.InputError, match=r"parameters\.m9: unknown name"):
        mechanism.replace(m9=1.0)


@pytest.mark.parametrize("load", [fm.loads.Pulse(F, 0.313, 1.07), fm.loads.Ramp(F, 0.313, 1.07)])
def test_steps_end_where_a_load_has_a_kink(load: fm.loads.Load) -> None:
    """rk4 keeps its order: x'' = -x + F(t) in closed form, piece by piece, by superposed steps and ramps."""
    x = fm.lengths("x")
    points = {"O": (0, 0), "M": (x, 0)}
    force = [fm.Force("M", load, (1, 0))]
    springs = [fm.Spring("O", "M", 1)]
    mechanism = fm.Mechanism(x, {"F": 2.0}, points=points, masses={"M": 1}, springs=springs, forces=force)
    t, start, end = 3.0, 0.313, 1.383
    if isinstance(load, fm.loads.Pulse):
        expected = 2.0 * (np.cos(t - end) - np.cos(t - start))
    else:
        expected = 2.0 / 1.07 * ((t - start - np.sin(t - start)) - (t - end - np.sin(t - end)))
    for method, order in (("rk4", 4), ("tsit5", 5), ("radau5", 5)):
        steps = (0.1, 0.05, 0.025, 0.0125)
        runs = [fm.integrate(mechanism, [0.0, 0.0], t, dt=dt, method=method) for dt in steps]
        errors = np.array([abs(run.y[-1, 0, 0] - expected) for run in runs])
        assert (errors < 1e-4 * (np.array(steps) / 0.1) ** (order - 1)).all()


@pytest.mark.slow
def test_steps_cannot_end_at_jumps_of_each_trajectory() -> None:
    """A tolerance follows them: x'' = -x + F(t) after a jump of 1 at s is 1 - cos(t - s)."""
    x, (F, s) = fm.lengths("x"), sympy.symbols("F s")
    force = [fm.Force("M", fm.loads.Pulse(F, s / 2, 5.0), (1, 0))]
    mechanism = fm.Mechanism(
        x, {"F": 1.0, "s": 1.0}, points={"M": (x, 0)}, masses={"M": 1}, potential=x**2 / 2, forces=force
    )
    starts, own = np.zeros((2, 2)), {"s": [2.469, 1.0]}
    with pytest.raises(fm.InputError, match=r"parameters\.s: sets when a load jumps or bends, .*; give tol "):
        fm.integrate(mechanism, starts, 2.0, dt=0.01, parameters=own)
    run = fm.integrate(mechanism, starts, 2.0, tol=1e-8, parameters=own)
    np.testing.assert_allclose(run.y[-1, :, 0], 1.0 - np.cos(2.0 - np.array(own["s"]) / 2.0), atol=1e-8)


def test_a_scene_under_another_load_is_a_mechanism(states: np.ndarray) -> None:
    driven: Any = fm.Scene(c1=200.0, load=fm.loads.Harmonic(80.0, 4.0, mean=5.0))
    assert "F0" not in driven.parameters
    t, values = 0.3, {**TABLE_1, "c1": 200.0, "c2": 366.67, "alpha": 0.0}
    values["F0"] = 5.0 + 80.0 * math.sin(4.0 * t)
    for y in states[:5]:
        expected = np.array(oracle().accelerations(values, y, t), dtype=float)
        np.testing.assert_allclose(driven.accelerations(t, y), expected, rtol=1e-12)
    with pytest.raises(fm.InputError, match="the load acts in place of F0"):
        fm.Scene(F0=1.0, load=fm.loads.Constant(1.0))
    with pytest.raises(fm.InputError, match=r"c1 = -1\.0"):
        fm.Scene(c1=-1.0, load=fm.loads.Constant(1.0))
    with pytest.raises(fm.InputError, match="must be a number or a SymPy expression"):
        fm.Scene(load="strong")


def test_a_metric_is_proved_to_be_positive_definite() -> None:
    """Also where a narrow place escapes what is tried; where functions have no bounds it stays open."""
    assert all(
        getattr(fm.mechanisms, name)().definite for name in fm.mechanisms.__all__ if name != "pendulum_chain"
    )
    assert fm.mechanisms.pendulum_chain(3).definite
    assert not fm.mechanisms.pendulum_chain(4).definite  # too long
    for span in ((), (-1.0, 1.0), ()):  # an endless range leaves it open, whichever was there before
        x = fm.lengths("x", *span)
        assert fm.Mechanism(x, kinetic=(1 + x**2) * x.dot**2 / 2, potential=x**2).definite == bool(span)
    q, (a, b) = fm.lengths("q", -2.0, 2.0), sympy.symbols("a b")
    pit = a - sympy.exp(-((q - b) ** 2) * 1e10)
    mechanism = fm.Mechanism(q, {"a": 1.5, "b": 0.123}, kinetic=pit * q.dot**2 / 2, potential=q**2)
    assert mechanism.definite
    with pytest.raises(fm.InputError, match=r"not positive definite, as at q = 0\.123"):
        mechanism.replace(a=0.9)
    open_ = 2 + sympy.Piecewise((1, sympy.Eq(q, 0)), (sympy.sin(q), True))
    assert not fm.Mechanism(q, kinetic=open_ * q.dot**2 / 2, potential=q**2).definite


X = fm.lengths("x", -3.0, 3.0)
Y = fm.lengths("y", -3.0, 3.0)
B, E = sympy.symbols("b e")
#: Rayleigh's functions that feed nothing in, some touching zero or semi-definite.
PASSIVE = [
    B * (X - 1) ** 2 * X.dot**2,
    B * (1 + sympy.cos(X)) * Y.dot**2,
    sympy.expand(B * (sympy.cos(X) * X.dot + sympy.sin(X) * Y.dot) ** 2),
    B * sympy.Abs(X.dot) + B * sympy.Abs(X.dot - Y.dot) ** 3,
    B * (sympy.sqrt(X.dot**2 + E**2) - E),
    B * sympy.log(sympy.cosh(X.dot / E)),
    B * X.dot**2 - B * X.dot**2 / 2,
    B * (X.dot**2 + X.dot * Y.dot + Y.dot**2),
]
#: That feed energy in, some only in narrow places or along few directions of rates.
FEEDING = [
    B * (1 - 4000 * sympy.exp(-(((X - sympy.Rational(31, 100)) / E) ** 2))) * X.dot**2,
    B * ((X - 1) ** 2 - E**2) * X.dot**2,
    B * (X**2 - 1) * Y.dot**2,
    B * (X.dot**2 + 3 * X.dot * Y.dot + Y.dot**2),
    B * (X.dot**2 + 2.0002 * X.dot * Y.dot + Y.dot**2),
]


def dissipating(given: Any, **more: Any) -> Mechanism:
    values = {"b": 0.5, "e": 1e-3}
    return Mechanism((X, Y), values, kinetic=X.dot**2 + Y.dot**2, dissipation=given, **more)


@pytest.mark.parametrize("given", PASSIVE, ids=str)
def test_dissipation_is_proved_to_feed_nothing_in(given: Any) -> None:
    assert dissipating(given).passive


@pytest.mark.parametrize("given", FEEDING, ids=str)
def test_dissipation_that_feeds_energy_in_anywhere_is_refused(given: Any) -> None:
    with pytest.raises(fm.InputError, match=r"^dissipation: feeds energy in, as at x = "):
        dissipating(given)


def test_dry_friction_is_told_from_friction_that_fades() -> None:
    """Coulomb's holds a mass that a spring pulls with less; smoothed, drag and viscous friction hold none."""
    assert [given for given in PASSIVE if dissipating(given).dry] == [PASSIVE[3]]
    assert dissipating(PASSIVE[4]).replace(e=0.0).dry
    assert not dissipating(PASSIVE[3]).replace(b=0.0).dry
    assert dissipating(0, generalized_forces={X: sympy.sin(X) - B * sympy.sign(X.dot)}).dry
    assert not dissipating(0, generalized_forces={X: sympy.sin(X) - B * X.dot}).dry


def test_dampers_feed_nothing_in_by_their_coefficients() -> None:
    """Also where their points meet; what is neither proved nor refuted says so."""
    points: dict[str, Any] = {"O": (0, 0), "M": (X, Y)}
    assert dissipating(0, points=points, dampers=[fm.Damper("O", "M", B)]).passive
    assert dissipating(0).passive
    with pytest.raises(fm.InputError, match="dissipation: feeds energy in"):
        dissipating(0, points=points, dampers=[fm.Damper("O", "M", B)]).replace(b=-1.0)
    assert not dissipating(B * (X**2 - 2 * X * Y + Y**2) * X.dot**2).passive
    with pytest.raises(fm.InputError, match="dissipation: is nowhere a finite number"):
        dissipating(0, points=points, dampers=[fm.Damper("O", "M", B / E)]).replace(e=0.0)


def test_other_values_of_parameters_derive_nothing_anew() -> None:
    truss = fm.mechanisms.von_mises_truss()
    assert truss.replace(P=3.0).derived is truss.derived
    assert truss.replace(P=3.0).with_terms(()).derived is not truss.derived  # without the damper's terms
