"""Implicit methods: the driver against the definition, stability far out, Newton's failures, Jacobians."""

from __future__ import annotations

import numpy as np
import pytest
from integrators.driving import A, W, drive, one_block, polynomial, rotation
from integrators.systems import Floats

import fastmech as fm
from fastmech.integrators.explicit import observe_nothing
from fastmech.integrators.methods import METHODS, ImplicitRungeKutta
from fastmech.integrators.tableau import ImplicitTableau
from fastmech.integrators.tableaus.implicit import IMPLICIT_TABLEAUS
from fastmech.jit import RHS_SIGNATURE, kernel

EVERY_IMPLICIT = pytest.mark.parametrize("method", IMPLICIT_TABLEAUS)

L_STABLE = {"radau3", "radau5", "sdirk4"}


@kernel(RHS_SIGNATURE)
def spiral(t: float, Y: Floats, dY: Floats, p: Floats) -> None:
    """y' = lambda y, lambda = p0 + i p1, as two real states."""
    for i in range(Y.shape[1]):
        dY[0, i] = p[0, i] * Y[0, i] - p[1, i] * Y[1, i]
        dY[1, i] = p[1, i] * Y[0, i] + p[0, i] * Y[1, i]


@kernel(RHS_SIGNATURE)
def unsolvable(t: float, Y: Floats, dY: Floats, p: Floats) -> None:
    """y' = p0 (1 + |y|^1/2 sign(y)): with p0 < 0 harmless; NaN beyond |y| = 10."""
    for i in range(Y.shape[1]):
        y = Y[0, i]
        dY[0, i] = np.nan if abs(y) > 10.0 else p[0, i] * y * y


def amplification(tableau: ImplicitTableau, z: complex) -> complex:
    """R(z) = 1 + z b (I - z A)^-1 1."""
    one = np.ones(tableau.stages)
    return complex(
        1 + z * np.array(tableau.b) @ np.linalg.solve(np.eye(tableau.stages) - z * tableau.matrix, one)
    )


def one_step(method: str, z: Floats) -> Floats:
    """The driver's R(z): one step of length 1 from y = 1, one lane a value of z."""
    Y = np.stack([np.ones(z.size), np.zeros(z.size)])
    bound = ImplicitRungeKutta(IMPLICIT_TABLEAUS[method])
    batch = one_block(Y, np.stack([z.real, z.imag]), np.array([0.0, 1.0]), 1)
    failed = bound.run(spiral, observe_nothing, batch)
    assert np.isnan(failed).all()
    return np.asarray(batch.Y[0, 0] + 1j * batch.Y[0, 1])


@EVERY_IMPLICIT
@pytest.mark.nojit
def test_driver_does_what_the_definition_says(method: str) -> None:
    """Coarse steps of y' = A y with the Jacobian by differences: one linear solve with all stages at once."""
    tableau = IMPLICIT_TABLEAUS[method]
    h, s = 0.5, tableau.stages
    Y = np.random.default_rng(0).standard_normal((3, 9))
    out, last, *_ = drive(rotation, method, Y, np.array([0.0, 2.0]), [4], W)
    slopes = np.linalg.solve(np.eye(3 * s) - h * np.kron(tableau.matrix, A), np.tile(A, (s, 1)))
    step = np.eye(3) + h * np.kron(np.array(tableau.b), np.eye(3)) @ slopes
    np.testing.assert_allclose(out[0], np.linalg.matrix_power(step, 4) @ Y, rtol=0, atol=2e-14)
    np.testing.assert_array_equal(out[0], last)


@EVERY_IMPLICIT
@pytest.mark.nojit
def test_polynomials_up_to_the_order_are_exact(method: str) -> None:
    order = IMPLICIT_TABLEAUS[method].order
    p = 1.0 / np.arange(1.0, order + 1)
    out, *_ = drive(polynomial, method, np.array([[0.5]]), np.array([1.0, 3.0]), [1], p)
    exact = 0.5 + sum(p[k] * (3.0 ** (k + 1) - 1) / (k + 1) for k in range(order))
    assert out[0, 0, 0] == pytest.approx(exact, rel=1e-13)


@EVERY_IMPLICIT
def test_stability_far_out(method: str) -> None:
    """|R| <= 1 on rays of the left half-plane to |z| = 1e8; L-stable methods forget everything out there."""
    radius, angle = np.geomspace(1e-3, 1e8, 45), np.linspace(np.pi / 2, np.pi, 19)
    z = (radius[:, None] * np.exp(1j * angle)).ravel()
    found = one_step(method, z)
    np.testing.assert_allclose(found, [amplification(IMPLICIT_TABLEAUS[method], x) for x in z], atol=1e-9)
    assert np.abs(found).max() <= 1.0 + 1e-12
    far = np.abs(found[np.abs(z) > 0.9e8])
    assert (far < 1e-6).all() if method in L_STABLE else far == pytest.approx(1.0, abs=1e-6)


@EVERY_IMPLICIT
def test_what_solves_the_systems_changes_the_iteration_only(method: str) -> None:
    """Solves in two unknowns against elimination in four: the same solution of the same equations."""
    from fastmech.ensembles.problem import motion_problem
    from fastmech.ensembles.run import run_ensemble

    starts = np.random.default_rng(1).uniform(-2, 2, (20, 4))
    scene = fm.Scene(beta=500.0)
    told = fm.integrate(scene, starts, 1.0, 0.02, method)
    assert not told.status.any()
    problem = motion_problem(scene, 20, {}, "lagrange")
    untold = run_ensemble(
        problem.rhs, problem.params, problem.inward(starts), [0.0, 1.0], 0.02, METHODS[method]
    )
    np.testing.assert_allclose(problem.outward(untold.states), told.y, rtol=0, atol=1e-11)


@EVERY_IMPLICIT
def test_a_lane_that_does_not_converge_keeps_its_last_state(method: str) -> None:
    """y' = y^2 from 1 blows up at t = 1; from -1 it is tame. The neighbours do not notice."""

    def run(starts: list[float]) -> tuple[Floats, Floats]:
        Y = np.array([starts])
        batch = one_block(Y, np.ones((1, len(starts))), np.array([0.0, 2.0]), 40)
        failed = METHODS[method].run(unsolvable, observe_nothing, batch)
        assert failed is not None
        return batch.Y[0, 0], failed[0]

    together, failed = run([-1.0, 1.0, -0.5, np.nan])
    alone, fine = run([-1.0, -0.5])
    np.testing.assert_array_equal(together[[0, 2]], alone)
    assert np.isnan(fine).all()
    assert 0.8 < failed[1] < 1.0
    assert together[1] == pytest.approx(1.0 / (1.0 - failed[1]), rel=0.2)
    assert failed[3] == 0.0


def test_the_form_that_the_driver_reads() -> None:
    """T^-1 A^-1 T is the real block form that the driver solves."""
    for tableau in IMPLICIT_TABLEAUS.values():
        p = tableau.scheme
        real, re, im = p.eigenvalues
        form = np.linalg.inv(p.back) @ np.linalg.inv(p.a[: len(p.back), : len(p.back)]) @ p.back
        expected = np.zeros_like(form)
        if real:
            expected[0, 0] = real
        if im:
            expected[-2:, -2:] = [[re, -im], [im, re]]
        np.testing.assert_allclose(form, expected, atol=1e-13)


def test_which_methods_are_symplectic() -> None:
    assert {name for name, t in IMPLICIT_TABLEAUS.items() if t.symplectic} == {"gauss2", "gauss4", "gauss6"}


def test_a_wrong_tableau_is_refused() -> None:
    good = IMPLICIT_TABLEAUS["gauss4"]
    with pytest.raises(ValueError, match="row 1 of a has 1 entries, must have 2"):
        ImplicitTableau("x", 4, [good.a[0], [1.0]], good.b, good.c, "")
    with pytest.raises(ValueError, match="a condition of order 5 fails"):
        ImplicitTableau("x", 5, good.a, good.b, good.c, "")
