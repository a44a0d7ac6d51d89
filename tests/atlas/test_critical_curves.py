"""Critical curves of mechanisms against closed forms and SymPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy

import fastmech as fm


def test_hopf_points_and_coalescing_frequencies_of_ziegler_s_column() -> None:
    column = fm.mechanisms.ziegler_column()
    found = fm.critical_curves(
        column.replace(b=0.1), ("P", np.linspace(0.1, 3.0, 12)), ("b", np.linspace(0.05, 0.8, 10))
    )
    (curve,) = found.curves
    assert curve.kind == "Hopf"
    assert curve.finished
    assert not len(found.unexplained)
    np.testing.assert_allclose(curve.x, 41.0 / 28.0 + curve.y**2 / 2.0, rtol=1e-12)
    # Where it begins to flutter the characteristic polynomial has the roots +-iw.
    mass, damping, stiffness = column.replace(b=float(curve.y[0]), P=float(curve.x[0])).linear([0.0, 0.0])
    w = curve.frequency[0]
    assert abs(np.linalg.det(stiffness - w * w * mass + 1j * w * damping)) < 1e-12
    found = fm.critical_curves(column, ("P", np.linspace(0.1, 8.0, 20)), ("k", np.linspace(0.5, 1.5, 7)))
    curve, parting = found.curves
    assert (curve.kind, parting.kind) == ("coalescence", "flutter-divergence")
    np.testing.assert_allclose(parting.x / parting.y, 3.5 + math.sqrt(2.0), rtol=1e-12)
    np.testing.assert_allclose(curve.x / curve.y, 3.5 - math.sqrt(2.0), rtol=1e-12)
    # det(K - w^2 M) has a double root: with k l = 1 it is 2 s^2 - (7 - 2 P) s + 1, s = w^2.
    np.testing.assert_allclose(curve.frequency, (0.5 * curve.y**2) ** 0.25, rtol=1e-9)
    # With dashpots a pair of growing eigenvalues is a double root.
    found = fm.critical_curves(column, ("P", np.linspace(2.0, 8.0, 7)), ("b", np.linspace(0.05, 0.8, 6)))
    (parting,) = found.curves
    assert parting.kind == "flutter-divergence"
    for P, b in zip(parting.x, parting.y, strict=True):
        mass, damping, stiffness = column.replace(P=float(P), b=float(b)).linear([0.0, 0.0])
        by_mass = np.linalg.solve(mass, np.hstack([-stiffness, -damping]))
        growing = np.sort(np.linalg.eigvals(np.vstack([np.eye(2, 4, 2), by_mass])).real)[2:]
        assert growing[0] > 0.0
        assert growing[1] - growing[0] < 1e-6
    # At b = 0 they coalesce in one point, and where damping begins no swing does.
    found = fm.critical_curves(column, ("b", np.linspace(0.0, 1.5, 4)), ("P", np.linspace(1.0, 3.0, 6)))
    (curve,) = found.curves
    assert curve.kind == "Hopf"
    np.testing.assert_allclose(curve.y, 41.0 / 28.0 + curve.x**2 / 2.0, rtol=1e-12)
    np.testing.assert_array_equal(found.unexplained[:, 0], 0.0)
    np.testing.assert_allclose(found.unexplained[:, 1], 3.5 - math.sqrt(2.0), atol=0.01)


def test_where_damping_begins_there_is_no_curve() -> None:
    for made, y in (("von_mises_truss", ("P", [-20.0, 20.0])), ("cart_pendulum", ("kt", [12.0, 30.0]))):
        mechanism = getattr(fm.mechanisms, made)()
        found = fm.critical_curves(mechanism, ("b", np.linspace(0.0, 10.0, 5)), y)
        assert found.curves == ()
        assert found.changes == 0
        # Swings keep their size on the edge, and fade beside it.
        still = fm.find_equilibria(mechanism)[0].position
        for b, grows in ((0.0, 0.0), (1.0, -1e-3)):
            mass, damping, stiffness = mechanism.replace(b=b, **{y[0]: y[1][1]}).linear(still)
            by_mass = np.linalg.solve(mass, np.hstack([-stiffness, -damping]))
            roots = np.linalg.eigvals(np.vstack([np.eye(2, 4, 2), by_mass]))
            assert roots.real.max() <= grows + 1e-9


def test_the_truss_s_snap_over_its_rise() -> None:
    truss = fm.mechanisms.von_mises_truss()
    found = fm.critical_curves(truss, ("P", np.linspace(1.0, 200.0, 13)), ("rise", np.linspace(0.2, 0.8, 9)))
    (curve,) = found.curves
    length = np.hypot(1.0, curve.y)
    expected = 2.0 * truss.parameters["k"] * length * (1.0 - length ** (-2.0 / 3.0)) ** 1.5
    np.testing.assert_allclose(curve.x, expected, rtol=1e-12)
    assert curve.kind == "fold"
    assert (np.abs(curve.position[:, 0]) < 1e-12).all()


def test_pitchforks() -> None:
    cart = fm.mechanisms.cart_pendulum()
    found = fm.critical_curves(cart, ("kt", np.linspace(1.0, 30.0, 9)), ("m", np.linspace(0.5, 2.0, 7)))
    (curve,) = found.curves
    assert curve.kind == "pitchfork"
    assert not curve.frequency.any()
    np.testing.assert_allclose(curve.x, 9.81 * curve.y, rtol=1e-12)
    # Two pendulums: with G = hypot(g, F) the stretched positions split at c = 2 G/3 and 2 G.
    chain = fm.mechanisms.pendulum_chain(2)
    found = fm.critical_curves(chain, ("F", np.linspace(0.0, 20.0, 9)), ("c", np.linspace(1.0, 40.0, 9)))
    assert not len(found.unexplained)
    ratios = sorted(float(np.median(curve.y / np.hypot(9.81, curve.x))) for curve in found.curves)
    np.testing.assert_allclose(ratios, [2.0 / 3.0, 2.0], rtol=1e-12)
    assert [curve.kind for curve in found.curves] == ["pitchfork"] * 2


def test_folds_and_cusps_of_the_papers_mechanism_are_the_scenes() -> None:
    mechanism = fm.mechanisms.slider_pendulum().replace(alpha=0.0)
    x, y = ("F0", np.linspace(1.0, 900.0, 25)), ("c1", np.linspace(40.0, 400.0, 20))
    found = fm.critical_curves(mechanism, x, y)
    expected = fm.trace_folds(fm.Scene(alpha=0.0), x, y)
    assert [curve.kind for curve in found.curves] == ["fold"] * len(expected.curves)
    cusps = np.array(sorted((cusp.x, cusp.y, cusp.phi, cusp.theta) for cusp in expected.cusps))
    np.testing.assert_allclose(found.cusps[np.argsort(found.cusps[:, 0])], cusps, atol=2e-9)
    # Gradient and Hessian's determinant are zero on the curves.
    phi, theta, F, c1 = sympy.symbols("phi theta F c1")
    m1, m2, l, c2, g = (mechanism.parameters[name] for name in ("m1", "m2", "l", "c2", "g"))
    M1 = sympy.Matrix([l * sympy.cos(phi), l * sympy.sin(phi)])
    M2 = M1 - l * sympy.Matrix([sympy.sin(theta), sympy.cos(theta)])
    away = M1 - sympy.Matrix([0, l])
    U = c1 * M2.dot(M2) / 2 + c2 * away.dot(away) / 2 + g * (m1 * M1[1] + m2 * M2[1]) - F * M2[0]
    gradient = [sympy.diff(U, phi), sympy.diff(U, theta)]
    determinant = sympy.hessian(U, (phi, theta)).det()
    residual = sympy.lambdify((F, c1, phi, theta), [*gradient, determinant])
    for curve in found.curves:
        left = np.abs(residual(curve.x, curve.y, *curve.position.T))
        assert left[:2].max() < 1e-10
        assert left[2].max() < 1e-7


def test_what_is_wrong_gets_a_line() -> None:
    chain = fm.mechanisms.pendulum_chain(1)
    good = ("F", [1.0, 2.0])
    with pytest.raises(fm.InputError, match="twice"):
        fm.critical_curves(chain, good, good)
    with pytest.raises(fm.InputError, match="two or more rising values"):
        fm.critical_curves(chain, good, ("l", [2.0]))
    with pytest.raises(fm.InputError, match="a parameter's name and its values"):
        fm.critical_curves(chain, good, "c")  # type: ignore[arg-type]
    with pytest.raises(fm.InputError, match="trace_folds is for a Scene"):
        fm.critical_curves(fm.Scene(), good, good)  # type: ignore[arg-type]
    with pytest.raises(fm.InputError, match="critical_curves are for a Mechanism"):
        fm.trace_folds(chain, good, ("l", [1.0, 2.0]))  # type: ignore[arg-type]
    with pytest.raises(fm.InputError, match="critical_values and"):
        fm.find_folds(chain, *good)  # type: ignore[arg-type]


def test_gyroscopic_forces_damp_nothing() -> None:
    """x'' - 2 W y' + k x = 0 and y'' + 2 W x' + k y = 0: frequencies coalesce at k = -W^2."""
    u, v = fm.lengths("u v", -2.0, 2.0)
    spin, k = sympy.symbols("W k")
    whirl = fm.Mechanism(
        (u, v),
        {"W": 3.0, "k": -1.0},
        kinetic=(u.dot**2 + v.dot**2) / 2,
        potential=k * (u**2 + v**2) / 2,
        generalized_forces={u: 2 * spin * v.dot, v: -2 * spin * u.dot},
    )
    (found,) = (
        one for one in fm.critical_values(whirl, "k", np.linspace(-12.3, -1.0, 9)) if one.value < -2.0
    )
    assert found.kind == "coalescence"
    assert found.value == pytest.approx(-9.0, rel=1e-6)
    curves = fm.critical_curves(whirl, ("k", np.linspace(-12.3, -1.0, 8)), ("W", np.linspace(1.0, 4.0, 7)))
    assert not curves.curves  # of such points curves are not traced, and that is said
    assert len(curves.unexplained)
    np.testing.assert_allclose(curves.unexplained[:, 0], -(curves.unexplained[:, 1] ** 2), atol=0.02)
