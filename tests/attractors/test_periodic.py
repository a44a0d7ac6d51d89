"""Periodic orbits, stable and unstable, against closed forms and published numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fastmech as fm
from fastmech.attractors.orbits import _around


def van_der_pol(t, x, v, mu):  # type: ignore[no-untyped-def]
    return v, mu * (1.0 - x * x) * v - x


def rings(t, x, y):  # type: ignore[no-untyped-def]
    r = x * x + y * y
    g = (r - 1.0) * (4.0 - r)  # circles of radius 1, which repels, and 2, which attracts
    return y + 0.02 * x * g, -x + 0.02 * y * g


def linear(t, x, v):  # type: ignore[no-untyped-def]
    return v, -2.0 * x - 0.4 * v + 3.0 * fm.cos(t)


def duffing(t, x, v, A):  # type: ignore[no-untyped-def]
    return v, -0.08 * v - x * x * x + A * fm.cos(t)


def thomas(t, x, y, z, b):  # type: ignore[no-untyped-def]
    return fm.sin(y) - b * x, fm.sin(z) - b * y, fm.sin(x) - b * z


def test_van_der_pol_s_cycle_and_its_place_of_rest() -> None:
    system = fm.System(van_der_pol, ["x", "v"], {"mu": 1.0})
    rest, cycle = fm.periodic_orbits(system, {"x": (-3.0, 3.0), "v": (-3.0, 3.0)})
    np.testing.assert_allclose(rest.points, [[0.0, 0.0]], atol=1e-12)
    assert not rest.stable
    # s^2 - mu s + 1 = 0
    np.testing.assert_allclose(
        np.sort_complex(rest.eigenvalues), 0.5 + 1j * np.array([-1.0, 1.0]) * math.sqrt(0.75), atol=1e-8
    )
    assert repr(rest).endswith("rests at (0, 0), largest real part of an eigenvalue 0.5 1/s")
    assert cycle.stable
    # Period and amplitude: Andersen and Geer, SIAM J. Appl. Math. 42 (1982), 678: 6.66328686.
    assert cycle.period == pytest.approx(6.66328686, abs=1e-6)
    assert np.abs(cycle.points[:, 0]).max() == pytest.approx(2.00862, abs=1e-3)


def test_a_cycle_that_repels_is_found_where_motions_begin_near_it() -> None:
    starts = np.array([[1.0, 0.0], [0.0, 1.01], [2.5, 0.0]])
    found = fm.periodic_orbits(fm.System(rings, ["x", "y"], {}), starts, 3)
    cycles = [orbit for orbit in found if orbit.period is not None]
    radii = sorted(float(np.hypot(*orbit.points.T).mean()) for orbit in cycles)
    np.testing.assert_allclose(radii, [1.0, 2.0], atol=1e-8)
    for orbit in cycles:
        r = float(np.hypot(*orbit.points.T).mean())
        slope = 0.04 * r * r * (5.0 - 2.0 * r * r)  # of dr/dt over r at the circle
        assert orbit.multipliers[0].real == pytest.approx(math.exp(2.0 * math.pi * slope), rel=1e-5)
        assert orbit.stable == (r > 1.5)


def test_motions_that_preserve_energy_are_neutral_or_unstable() -> None:
    """Henon and Heiles: a centre, three saddles, and families of cycles of which none attracts."""

    def rates(t, x, y, px, py):  # type: ignore[no-untyped-def]
        return px, py, -x - 2.0 * x * y, -y - x * x + y * y

    system = fm.System(rates, ["x", "y", "px", "py"], {})
    found = fm.periodic_orbits(system, {"x": (-0.5, 0.5), "y": (-0.5, 0.5), "px": (-0.2, 0.2)}, 6)
    centre, *saddles = [orbit for orbit in found if orbit.period is None]
    np.testing.assert_allclose(centre.eigenvalues.real, 0.0, atol=1e-8)
    assert centre.stability == "neutral"
    assert {orbit.stability for orbit in saddles} <= {"unstable"}
    cycles = [orbit for orbit in found if orbit.period is not None]
    assert cycles
    assert not any(orbit.stable for orbit in found)
    for orbit in cycles:  # multipliers are 1 and a pair z, 1/z
        z = orbit.multipliers[np.argsort(np.abs(orbit.multipliers - 1.0))[1:]]
        assert (orbit.stability == "neutral") == (np.abs(np.abs(z) - 1.0).max() < 1e-5)
    assert f", 0 stable, {sum(o.stability == 'neutral' for o in found)} neutral" in repr(found)


def test_a_linear_oscillator_s_response_and_multipliers() -> None:
    system = fm.System(linear, ["x", "v"], {}, period=2.0 * math.pi)
    (orbit,) = fm.periodic_orbits(system, {"x": (-1.0, 1.0)}, 4, periods=3)
    response = 3.0 / (2.0 - 1.0 + 0.4j)
    np.testing.assert_allclose(orbit.points, [[response.real, -response.imag]], atol=1e-9)
    roots = np.exp(2.0 * math.pi * np.roots([1.0, 0.4, 2.0]))
    np.testing.assert_allclose(np.sort_complex(orbit.multipliers), np.sort_complex(roots), atol=1e-7)
    assert orbit.forcing_periods == 1


def test_stable_ones_are_the_attractors() -> None:
    system = fm.System(duffing, ["x", "v"], {"A": 0.2}, period=2.0 * math.pi)
    region = {"x": (-1.0, 1.0), "v": (-0.5, 1.0)}
    stable = [o for o in fm.periodic_orbits(system, region, periods=3) if o.stable]
    attractors = fm.find_attractors(system, region, 1000)
    assert len(stable) == len(attractors) == 5
    for orbit in stable:
        away = [min(np.abs(a.points - orbit.points[0]).max(axis=1)) for a in attractors]
        assert min(away) < 1e-7


@pytest.mark.slow
def test_all_places_of_rest_of_thomas_s_system() -> None:
    """They are roots of one equation: z = sin(x) / b, y = sin(z) / b, x = sin(y) / b."""
    b = 0.1665
    system = fm.System(thomas, ["x", "y", "z"], {"b": b})

    def around(x: np.ndarray) -> np.ndarray:
        return np.sin(np.sin(np.sin(x) / b) / b) / b - x

    grid = np.linspace(-6.01, 6.02, 2_000_001)
    change = np.flatnonzero(np.signbit(around(grid[:-1])) != np.signbit(around(grid[1:])))
    roots = [brentq(around, grid[k], grid[k + 1], xtol=1e-14) for k in change]
    orbits = fm.periodic_orbits(system, dict.fromkeys("xyz", (-6.0, 6.0)), 1000)
    rests = sorted(float(orbit.points[0, 0]) for orbit in orbits if orbit.period is None)
    np.testing.assert_allclose(rests, roots, atol=1e-9)


def test_wrong_arguments() -> None:
    system = fm.System(van_der_pol, ["x", "v"], {"mu": 1.0})
    with pytest.raises(fm.InputError, match="system = 3: must be a System or a Mechanism"):
        fm.periodic_orbits(3, {"x": 1.0})  # type: ignore[arg-type]
    with pytest.raises(fm.InputError, match="periods = 0"):
        fm.periodic_orbits(system, {"x": 1.0}, periods=0)


def test_a_spring_that_touches_a_stop_has_orbits_and_dry_friction_a_line() -> None:
    """A right-hand side that bends, beside SciPy; one that jumps is refused."""

    def stop(t, x, v):  # type: ignore[no-untyped-def]
        push = 100.0 * (x - 1.0) if x > 1.0 else 0.0
        return v, -0.1 * v - x - push + fm.cos(1.5 * t)

    region, period = {"x": (-2.0, 2.0), "v": (-2.0, 2.0)}, 2.0 * np.pi / 1.5
    found = fm.periodic_orbits(fm.System(stop, ["x", "v"], {}, period=period), region)
    assert len(found) == 3
    for one in found:
        run = solve_ivp(
            lambda t, y: [y[1], -0.1 * y[1] - y[0] - 100.0 * max(y[0] - 1.0, 0.0) + np.cos(1.5 * t)],
            (0.0, period), one.points[0], method="DOP853", rtol=1e-11, atol=1e-12, max_step=0.002,
        )  # fmt: skip
        np.testing.assert_allclose(run.y[:, -1], one.points[0], atol=1e-7)

    def friction(t, x, v):  # type: ignore[no-untyped-def]
        return v, -x - (0.3 if v > 0.0 else -0.3) + fm.cos(1.5 * t)

    jumping = fm.System(friction, ["x", "v"], {}, period=period)
    with pytest.raises(fm.InputError, match=r"smooth a right-hand side that jumps \(tanh for sign\), "):
        fm.periodic_orbits(jumping, region)


def test_jacobians_once_around_are_products_from_each_place() -> None:
    for m in (1, 2, 7, 256):
        parts = 0.7 * np.random.default_rng(m).normal(size=(m, 3, 3))
        around = _around(parts)
        for j in range(0, m, 5):
            whole = np.eye(3)
            for k in range(m):
                whole = parts[(j + k) % m] @ whole
            np.testing.assert_allclose(around[j], whole, rtol=1e-9, atol=1e-9 * np.abs(whole).max())


def softening(t, x, v, F):  # type: ignore[no-untyped-def]
    return v, -0.3 * v - x + x * x * x + F * fm.cos(t)


def test_orbits_whose_motion_stops_are_none() -> None:
    """Of those without a stop the ones are left that SciPy keeps below it all along a period."""
    region, period = {"x": (-1.5, 1.5), "v": (-1.5, 1.5)}, 2.0 * math.pi
    free = fm.periodic_orbits(fm.System(softening, ["x", "v"], {"F": 0.1}, period=period), region)
    ended = fm.System(
        softening, ["x", "v"], {"F": 0.1}, lambda t, x, v: 1.0 if x > 0.7 else 0.0, period=period
    )
    below = []
    for orbit in free:
        run = solve_ivp(lambda t, y: softening(t, *y, 0.1), (0.0, period), orbit.points[0], max_step=0.01)
        if run.y[0].max() < 0.7:
            below.append(orbit.points[0])
    assert len(below) == 1
    (orbit,) = fm.periodic_orbits(ended, region)
    np.testing.assert_allclose(orbit.points, below, atol=1e-7)
    always = fm.System(softening, ["x", "v"], {"F": 0.1}, lambda t, x, v: 1.0, period=period)
    assert not fm.periodic_orbits(always, region)
    rests = fm.periodic_orbits(fm.System(softening, ["x", "v"], {"F": 0.0}, ended.stop), region)
    np.testing.assert_allclose(
        sorted(orbit.points[0].tolist() for orbit in rests), [[-1.0, 0.0], [0.0, 0.0]], atol=1e-9
    )
