"""Places of rest and their balls, proved: against closed forms, 50 digits and motions by SciPy."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fastmech as fm
from fastmech.attractors.arrival import balls
from fastmech.attractors.flow import flow_of
from fastmech.attractors.orbits import Orbit
from fastmech.attractors.proof import RestProof, prove_rest


def lorenz(t, x, y, z, sigma, rho, beta):  # type: ignore[no-untyped-def]
    return sigma * (y - x), x * (rho - z) - y, x * y - beta * z


def pendulum(t, x, v, a, T):  # type: ignore[no-untyped-def]
    return v, -a * v + T - fm.sin(x)


def magnets(t, x, y, vx, vy, height):  # type: ignore[no-untyped-def]
    ax, ay = -0.5 * x - 0.2 * vx, -0.5 * y - 0.2 * vy
    for k in range(3):
        px, py = math.cos(2.0 * math.pi * k / 3.0), math.sin(2.0 * math.pi * k / 3.0)
        d = ((px - x) ** 2 + (py - y) ** 2 + height * height) ** 1.5
        ax, ay = ax + (px - x) / d, ay + (py - y) / d
    return vx, vy, ax, ay


LORENZ = fm.System(lorenz, ["x", "y", "z"], {"sigma": 10.0, "rho": 15.0, "beta": 8.0 / 3.0})
PENDULUM = fm.System(pendulum, ["x", "v"], {"a": 0.3, "T": 0.5}, angles=["x"])
MAGNETS = fm.System(magnets, ["x", "y", "vx", "vy"], {"height": 0.2})


def rest_of_magnets() -> np.ndarray:
    with mpmath.workdps(50):
        x = mpmath.findroot(lambda x: magnets(0, x, 0, 0, 0, 0.2)[2], 0.99)
    return np.array([float(x), 0.0, 0.0, 0.0])


def plain(system: fm.System, y: np.ndarray) -> tuple[float, ...]:
    values = [system.parameters[name] for name in system.parameter_order]
    return system.rhs(0.0, *y.tolist(), *values)


def proved(system: fm.System, place: np.ndarray, scale: np.ndarray) -> RestProof:
    found = prove_rest(system, place, scale)
    assert found is not None
    return found


CASES = [
    (LORENZ, np.array([math.sqrt(8.0 / 3.0 * 14.0)] * 2 + [14.0]), np.array([10.0, 10.0, 10.0])),
    (PENDULUM, np.array([math.pi / 6.0, 0.0]), np.array([math.pi, 2.0])),
    (MAGNETS, rest_of_magnets(), np.ones(4)),
]


@pytest.mark.parametrize(("system", "place", "scale"), CASES, ids=["lorenz", "pendulum", "magnets"])
@pytest.mark.slow
def test_the_box_holds_the_place_and_the_ball_is_attracted(
    system: fm.System, place: np.ndarray, scale: np.ndarray
) -> None:
    found = proved(system, place, scale)
    assert (found.box[:, 0] <= place).all()
    assert (place <= found.box[:, 1]).all()
    assert (found.box[:, 1] - found.box[:, 0] < 1e-5 * scale).all()
    rng = np.random.default_rng(0)
    u = rng.standard_normal((40, len(place)))
    root = np.linalg.cholesky(found.form)
    shell = np.linalg.solve(root.T, (u / np.linalg.norm(u, axis=1)[:, None]).T).T
    for e in shell:
        slope = 2.0 * e @ found.form @ plain(system, place + e)
        assert slope < 0.0  # V falls on the border
    for e in shell[:3]:
        run = solve_ivp(lambda t, y: plain(system, y), (0.0, 200.0), place + 0.99 * e, rtol=1e-9, atol=1e-12)
        assert np.abs(run.y[:, -1] - place).max() < 1e-3 * np.abs(e).max()


def test_no_proof_where_nothing_attracts_or_symbols_do_not_go_through() -> None:
    assert prove_rest(PENDULUM, np.array([5.0 * math.pi / 6.0, 0.0]), np.ones(2)) is None  # a saddle
    assert prove_rest(PENDULUM, np.array([1.0, 0.0]), np.ones(2)) is None  # no place of rest

    def kinked(t, x, v):  # type: ignore[no-untyped-def]
        return v, (-x - v if x > 0.0 else -2.0 * x - v)

    assert prove_rest(fm.System(kinked, ["x", "v"], {}), np.zeros(2), np.ones(2)) is None

    def timed(t, x):  # type: ignore[no-untyped-def]
        return (-x + 0.0 * t,) if t is None else (-x + t - t * 1.5,)

    assert prove_rest(fm.System(timed, ["x"], {}), np.zeros(1), np.ones(1)) is None


def test_a_family_of_states_is_proved_too() -> None:
    def chain(t, y, p, rates):  # type: ignore[no-untyped-def]
        n = len(y) // 2
        for i in range(n):
            rates[i] = y[n + i]
            rates[n + i] = -p[0] * y[n + i] - y[i] - y[i] ** 3 + 0.1 * (y[(i + 1) % n] - y[i])

    system = fm.System(chain, ("y", 6), {"damping": 0.5})
    found = proved(system, np.zeros(6), np.ones(6))
    assert np.linalg.eigvalsh(found.form)[-1] < 1e6


def test_attractors_say_what_is_proved() -> None:
    found = fm.find_attractors(PENDULUM.replace(a=0.8), {"x": (-3.0, 3.0), "v": (-2.0, 2.0)}, 200)
    assert len(found) == 1
    assert found[0].proof is not None
    assert "proved" in found[0].name


def test_a_form_that_scipy_warns_of_is_none_or_falls() -> None:
    """x' = s y - x, y' = -y with s = 1e17: equations for the form are singular to rounding."""

    def shear(t, x, y):  # type: ignore[no-untyped-def]
        return 1e17 * y - x, -y

    system = fm.System(shear, ["x", "y"], {})
    assert prove_rest(system, np.zeros(2), np.ones(2)) is None  # e' P e is not positive in 16 digits

    flow = flow_of(fm.System(lambda t, x, y: (-x, -y), ["x", "y"], {}), np.eye(2), {})
    jacobian = np.array([[0.5, 1e17], [0.0, 0.5]])
    own = balls(flow, Orbit(np.zeros((1, 2)), 1.0, jacobian[None], np.array([0.5 + 0j, 0.5 + 0j]), 0.0))
    assert own is None or own.radius > 0.0
