"""Branches of periodic motion against linear theory and harmonic balance."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from devices import resonator
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve, root

import fastmech as fm

Floats = NDArray[np.float64]

#: Duffing's equation x'' + 0.1 x' + x + x^3 = 0.2 cos(omega t), and places of a period.
DELTA, FORCE, PLACES = 0.1, 0.2, 64


# One right-hand side for springs and one for pendulums: each that is another is compiled for itself.
def duffing(t, x, v, delta, k, b, A, omega):  # type: ignore[no-untyped-def]
    return v, -delta * v - k * x - b * x * x * x + A * fm.cos(omega * t)


def pendulum(t, x, v, d, g, F, w):  # type: ignore[no-untyped-def]
    return v, -d * v - g * fm.sin(x) + F * fm.cos(w * t)


SYSTEM = fm.System(
    duffing,
    ["x", "v"],
    {"delta": DELTA, "k": 1.0, "b": 1.0, "A": FORCE, "omega": 1.0},
    period=lambda omega: 2.0 * math.pi / omega,
)
PENDULUM = fm.System(
    pendulum,
    ["x", "v"],
    {"d": 0.1, "g": 1.0, "F": 0.5, "w": 1.0},
    period=lambda w: 2.0 * math.pi / w,
    angles=["x"],
)
REGION = {"x": (-2.0, 2.0), "v": (-2.0, 2.0)}


def balance(x: Floats, omega: float) -> Floats:
    """Duffing's equation at equal times of a period: derivatives by Fourier's coefficients."""
    k = np.fft.rfftfreq(PLACES, 1.0 / PLACES) * omega
    spectrum = np.fft.rfft(x)
    first, second = np.fft.irfft(1j * k * spectrum, PLACES), np.fft.irfft(-(k**2) * spectrum, PLACES)
    tau = 2.0 * np.pi * np.arange(PLACES) / PLACES
    return np.asarray(second + DELTA * first + x + x**3 - FORCE * np.cos(tau))


def slopes(x: Floats, omega: float) -> Floats:
    """Its Jacobian by the values."""
    identity = np.eye(PLACES)
    k = np.fft.rfftfreq(PLACES, 1.0 / PLACES) * omega
    spectra = np.fft.rfft(identity, axis=0)
    symbol = (1j * DELTA * k - k**2)[:, None]
    return np.asarray(np.fft.irfft(symbol * spectra, PLACES, axis=0) + identity * (1.0 + 3.0 * x**2)[:, None])


def test_duffings_branch_and_its_folds_are_those_of_harmonic_balance() -> None:
    found = fm.frequency_response(SYSTEM, "omega", (0.8, 2.0), REGION)
    assert len(found.branches) == 1
    branch = found.branches[0]
    assert (branch.values.min(), branch.values.max()) == (pytest.approx(0.8), pytest.approx(2.0))
    for k in range(0, branch.values.size, 7):
        omega = branch.values[k]
        run = fm.integrate(
            SYSTEM.replace(omega=omega),
            branch.places[k],
            t_eval=2.0 * np.pi / omega * np.arange(PLACES) / PLACES,
            dt=0.02,
            method="dop853",
        )
        solved = fsolve(balance, run.y[:, 0, 0], args=(omega,), fprime=slopes, xtol=1e-12)
        assert np.abs(solved - run.y[:, 0, 0]).max() < 1e-7
        fine = np.fft.irfft(np.fft.rfft(solved), 4096) * 64
        assert branch.amplitudes[k, 0] == pytest.approx(0.5 * np.ptp(fine), abs=2e-6)
    folds = [s for s in found.special if s.kind == "fold"]
    assert len(folds) == len(found.special) == 2

    def singular(z: Floats) -> Floats:
        x, v, omega = z[:PLACES], z[PLACES:-1], z[-1]
        return np.concatenate([balance(x, omega), slopes(x, omega) @ v, [v @ v - 1.0]])

    for fold in folds:
        run = fm.integrate(
            SYSTEM.replace(omega=fold.value),
            fold.place,
            t_eval=2.0 * np.pi / fold.value * np.arange(PLACES) / PLACES,
            dt=0.02,
            method="dop853",
        )
        x = run.y[:, 0, 0]
        v = np.linalg.svd(slopes(x, fold.value))[2][-1]
        solved = fsolve(singular, np.concatenate([x, v, [fold.value + 1e-3]]), xtol=1e-12)
        assert fold.value == pytest.approx(solved[-1], abs=1e-8)
    assert not branch.stable[np.abs(branch.values - 1.4) < 0.05].all()
    assert branch.stable[branch.values > 1.6].all()


@pytest.mark.slow
def test_motions_found_at_a_frequency_do_not_depend_on_the_range() -> None:
    """Indices, signs of det(1 - J), of all motions of a period add up to 1, as motions stay in a disc."""
    system = SYSTEM.replace(delta=0.25, k=-1.0, A=0.2)
    for between in ((0.5, 2.0), (0.9, 3.0)):
        found = fm.frequency_response(system, "omega", between, REGION)
        signs = []
        for branch in found.branches:
            k = np.flatnonzero((branch.values[1:] - 1.0) * (branch.values[:-1] - 1.0) <= 0.0)
            signs += np.sign(np.prod(1.0 - branch.multipliers[k], axis=1).real).tolist()
        assert (len(signs), sum(signs)) == (7, 1)


def test_a_linear_mechanism_has_its_resonance_curve() -> None:
    """|x| = F / sqrt((k - m w^2)^2 + (c w)^2), of a mass on a spring under a harmonic force."""
    mechanism = resonator(fm.loads.Harmonic(0.7, sympy.Symbol("omega")), {"omega": 1.0})
    found = fm.frequency_response(mechanism, "omega", (0.5, 4.0), {"x": (-1.0, 1.0), "x_dot": (-1.0, 1.0)})
    assert len(found.branches) == 1
    branch = found.branches[0]
    w = branch.values
    np.testing.assert_allclose(branch.amplitudes[:, 0], 0.7 / np.hypot(9.0 - 2.0 * w**2, 0.6 * w), rtol=1e-6)
    assert branch.stable.all()
    # Multipliers are exp(lambda T), lambda the roots of 2 s^2 + 0.6 s + 9.
    k = w.size // 2
    expected = np.exp(np.roots([2.0, 0.6, 9.0]) * 2.0 * np.pi / w[k])
    np.testing.assert_allclose(np.sort_complex(branch.multipliers[k]), np.sort_complex(expected), atol=1e-8)
    axes = found.plot(state="x")
    assert axes.get_xlabel() == "ω"
    assert axes.get_ylabel() == "amplitude of x [m],\nhalf of its range"


@pytest.mark.slow
def test_undamped_resonance_goes_to_infinity_and_is_neutral_all_along() -> None:
    """x'' = -x + cos wt: x = cos wt / (1 - w^2), multipliers exp(+-2 pi i / w)."""
    system = SYSTEM.replace(delta=0.0, b=0.0, A=1.0)
    found = fm.frequency_response(system, "omega", (0.5, 2.0), REGION)
    assert len(found.branches) == 2
    assert not found.special  # multipliers touch -1 at w = 2/3 and 2
    for branch in found.branches:
        assert branch.far
        assert not branch.cut
        assert branch.neutral.all()
        assert not branch.stable.any()
        w = branch.values
        np.testing.assert_allclose(branch.amplitudes[:, 0], 1.0 / np.abs(1.0 - w**2), rtol=1e-4)
        away = np.abs(branch.multipliers - np.exp(2j * np.pi / w)[:, None]).min(axis=1)
        assert (away <= branch.errors).all()
    assert "2 to infinity" in str(found)
    assert "100% neutral" in str(found.branches[0])


def test_doublings_without_damping_are_told_where_motions_begin_to_repel() -> None:
    """Mathieu's equation x'' = -(a + 0.1 cos t) x: where the trace over a period passes -2, by SciPy."""

    def trace(a: float) -> float:
        rates = lambda t, y: [y[1], -(a + 0.1 * math.cos(t)) * y[0], y[3], -(a + 0.1 * math.cos(t)) * y[2]]  # noqa: E731
        y = solve_ivp(rates, (0.0, 2.0 * np.pi), [1, 0, 0, 1], method="DOP853", rtol=1e-12, atol=1e-13).y
        return float(y[0, -1] + y[3, -1])

    def rates(t, x, v, a):  # type: ignore[no-untyped-def]
        return v, -(a + 0.1 * fm.cos(t)) * x

    system = fm.System(rates, ["x", "v"], {"a": 0.2}, period=2.0 * math.pi)
    found = fm.frequency_response(system, "a", (0.1, 0.42), {"x": (-1.0, 1.0), "v": (-1.0, 1.0)})
    edges = [brentq(lambda a: trace(a) + 2.0, *ends, xtol=1e-12) for ends in ((0.15, 0.25), (0.25, 0.35))]
    assert [one.kind for one in found.special] == ["period doubling"] * 2
    assert [one.value for one in found.special] == pytest.approx(edges, abs=1e-8)
    (branch,) = found.branches
    inside = (branch.values > edges[0]) & (branch.values < edges[1])
    assert not branch.stable.any()
    assert (branch.neutral == ~inside).all()


@pytest.mark.slow
def test_periods_double_where_the_longer_motion_begins() -> None:
    """Of Duffing's oscillator without a linear spring; both methods know nothing of each other."""
    system = SYSTEM.replace(delta=0.08, k=0.0)
    region = {"x": (-1.0, 1.0), "v": (-0.5, 1.0)}
    folds = [s.value for s in fm.frequency_response(system, "A", (0.15, 0.26), region, periods=2).special]
    along = fm.follow_basins(system, "A", [0.16, 0.2], region, 1500)
    born = [t for t in along.tipping if t.kind == "born"]
    assert len(born) == 2
    assert all(t.low <= min(folds) <= t.high for t in born)


@pytest.mark.slow
def test_a_branch_of_twice_the_period_begins_at_a_doubling() -> None:
    """Thompson's escape equation: the same doubling as on the shorter motion's branch."""

    def escape(t, x, v, F):  # type: ignore[no-untyped-def]
        return v, -0.1 * v - x + x * x + F * fm.sin(0.85 * t)

    system = fm.System(escape, ["x", "v"], {"F": 0.05}, period=2.0 * math.pi / 0.85)
    region = {"x": (-0.8, 1.2), "v": (-0.8, 0.8)}
    (shorter,) = fm.frequency_response(system, "F", (0.095, 0.103), region).special
    both = fm.frequency_response(system, "F", (0.095, 0.103), region, periods=2)
    assert [len(branch.special) for branch in both.branches] == [1, 1]
    assert len(both.special) == 1
    for one in (shorter, *both.special):
        assert one.kind == "period doubling"
        assert one.value == pytest.approx(shorter.value, abs=1e-9)


def test_a_pitchfork_is_a_branch_point_of_both_branches() -> None:
    """x' = m x - x^3 has its pitchfork at m = 0, where a fold's determinant vanishes too."""

    def rates(t, x, y, m):  # type: ignore[no-untyped-def]
        return m * x - x**3, -y + fm.cos(t)

    system = fm.System(rates, ["x", "y"], {"m": 0.1}, period=2.0 * math.pi)
    found = fm.frequency_response(system, "m", (-0.37, 0.5), {"x": (-1.0, 1.0), "y": (-1.0, 1.0)})
    assert len(found.branches) == 2
    for branch in found.branches:
        (point,) = branch.special
        assert point.kind == "branch point"
        assert abs(point.value) < 1e-9


@pytest.mark.slow
def test_a_driven_pendulum_loses_its_symmetry_where_its_half_period_s_multiplier_says() -> None:
    """The multiplier of -x(T/2) is -1 there: by shooting with variational equations, DOP853 to 1e-13."""

    def equations(u: Any) -> Any:
        def varied(t: float, s: Any) -> Any:
            x, v, M = s[0], s[1], s[2:].reshape(2, 2)
            J = np.array([[0.0, 1.0], [-np.cos(x), -0.5]])
            return [v, -0.5 * v - np.sin(x) + u[2] * np.cos(2.0 / 3.0 * t), *(J @ M).ravel()]

        s = solve_ivp(
            varied, (0.0, 1.5 * np.pi), [*u[:2], 1.0, 0.0, 0.0, 1.0], method="DOP853", rtol=1e-12, atol=1e-12
        ).y[:, -1]
        return [*(s[:2] + u[:2]), np.linalg.det(s[2:].reshape(2, 2) - np.eye(2))]

    system = PENDULUM.replace(d=0.5, w=2.0 / 3.0)
    found = fm.frequency_response(system, "F", (0.9, 1.02), {"x": (-3.0, 3.0), "v": (-3.0, 3.0)})
    points = [one for one in found.special if one.kind == "branch point"]
    assert points
    for point in points:
        expected = root(equations, [*point.place, 1.001 * point.value])
        assert np.abs(expected.fun).max() < 1e-10
        assert point.value == pytest.approx(expected.x[2], abs=1e-8)
    assert not [one for one in found.special if one.kind == "fold"]


@pytest.mark.slow
def test_small_multipliers_beside_large_ones_are_known() -> None:
    """About the upright position of a driven pendulum: their product is exp(-damping T) (Liouville)."""
    system = PENDULUM.replace(g=-1.5)
    found = fm.frequency_response(system, "F", (0.3, 0.8), {"x": (-0.3, 0.3), "v": (-0.3, 0.3)})
    values = next(b.multipliers for b in found.branches if np.abs(b.multipliers).max() > 1000.0)
    np.testing.assert_allclose(np.prod(values, axis=1).real, math.exp(-0.2 * math.pi), rtol=1e-3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("omege", (0.5, 1.0), REGION), "parameter"),
        (("omega", (1.0, 0.5), REGION), "between"),
        (("omega", (0.5, 1.0), {"y": 1.0}), "ranges.y"),
    ],
)
def test_wrong_calls_get_one_line(arguments: tuple[object, ...], message: str) -> None:
    with pytest.raises(fm.InputError, match=message):
        fm.frequency_response(SYSTEM, *arguments)  # type: ignore[arg-type]


def test_a_number_of_a_load_has_no_name() -> None:
    device = fm.Scene(load=fm.loads.Harmonic(80.0, 4.0))
    with pytest.raises(
        fm.InputError, match=r"^parameter = 'omega': .*; a load's own number has no name: write"
    ):
        fm.frequency_response(device, "omega", (2.0, 12.0), {"phi": (1.0, 2.0), "theta": (-1.0, 1.0)})


@pytest.mark.parametrize("low", [0.0, -1.0])
def test_a_range_to_a_frequency_of_zero_gets_one_line(low: float) -> None:
    """There is no period 2 pi / 0, of a system nor of a mechanism's load."""
    load = fm.loads.Harmonic(0.5, sympy.Symbol("omega"))
    q = fm.angles("q")
    shaken = fm.Mechanism(
        q,
        {"omega": 1.0},
        points={"M": (sympy.sin(q), -sympy.cos(q))},
        masses={"M": 1.0},
        dampers=[fm.TorsionDamper(q, 0.5)],
        forces=[fm.Torque(q, load)],
        gravity=9.81,
    )
    for system, region in ((SYSTEM, REGION), (shaken, {"q": (-0.1, 0.1)})):
        with pytest.raises(fm.InputError) as error:
            fm.frequency_response(system, "omega", (low, 1.5), region)
        assert f"between = ({low:g}" in str(error.value)
        assert f"at omega = {low:g} the system has no period" in str(error.value)
        assert "\n" not in str(error.value)


def test_without_time_there_is_no_response() -> None:
    system = fm.System(lambda t, x, v, c: (v, -x - c * v), ["x", "v"], {"c": 0.1})
    for between in ((0.1, 0.2), (0.1, 20.0)):  # slower states are looked at less often
        with pytest.raises(fm.InputError, match=r"^system: does not depend on the time"):
            fm.frequency_response(system, "c", between, {"x": (-1.0, 1.0)})


SCRIPT = """
import math
import fastmech as fm

def spring(t, x, v, A):
    return v, -0.3 * v - x - x * x * x + A * fm.cos(t)

system = fm.System(spring, ["x", "v"], {"A": 0.2}, period=2.0 * math.pi)
print(fm.frequency_response(system, "A", (0.1, 0.2), [[0.0, 0.0]]))
"""


@pytest.mark.slow
def test_a_second_process_finds_the_same_with_kernels_from_the_disk(tmp_path: Path) -> None:
    script = tmp_path / "spring.py"
    script.write_text(SCRIPT)
    told = [
        subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert told[0] == told[1]
    assert told[0].startswith("1 branch of period 1 over A")


@pytest.mark.slow
def test_rotating_motions_have_the_range_of_their_turn() -> None:
    """A driven pendulum that turns over once or twice a period, beside SciPy."""
    found = fm.frequency_response(PENDULUM, "w", (0.5, 0.65), {"x": (-np.pi, np.pi), "v": (-3.0, 3.0)})
    turning = 0
    for branch in found.branches:
        for k in (0, len(branch.values) // 2, -1):
            if np.abs(branch.multipliers[k]).max() > 10.0:
                continue  # SciPy would leave it
            w, end = branch.values[k], 2.0 * np.pi / branch.values[k]
            rates = lambda t, y, w=w: pendulum(t, *y, 0.1, 1.0, 0.5, w)  # noqa: E731
            run = solve_ivp(rates, (0.0, end), branch.places[k], rtol=1e-11, atol=1e-11, dense_output=True)
            y = run.sol(np.linspace(0.0, end, 20_001))
            assert branch.amplitudes[k] == pytest.approx(0.5 * np.ptp(y, axis=1), abs=2e-5)
            turning += abs(y[0, -1] - y[0, 0]) > 6.0
    assert turning >= 2


def test_a_branch_ends_where_its_motions_meet_a_stopping_condition() -> None:
    """Of a softening spring: where SciPy's motion on it first comes to x = 0.7; nothing lies beyond."""

    def softening(t, x, v, c, F):  # type: ignore[no-untyped-def]
        return v, -c * v - x + x * x * x + F * fm.cos(t)

    def largest(F: float) -> float:
        rates = lambda t, y: softening(t, *y, 0.3, F)  # noqa: E731
        times = np.linspace(0.0, 2.0 * np.pi, 2001)
        y = solve_ivp(rates, (0.0, 60.0 * np.pi), [-0.5, 0.4], rtol=1e-9, atol=1e-11, method="DOP853").y[
            :, -1
        ]
        run = solve_ivp(rates, times[[0, -1]], y, rtol=1e-9, atol=1e-11, method="DOP853", dense_output=True)
        return float(run.sol(times)[0].max())

    def stop(t, x, v, F):  # type: ignore[no-untyped-def]
        return 1.0 if x > 0.7 + 0.0 * F else 0.0

    system = fm.System(softening, ["x", "v"], {"c": 0.3, "F": 0.1}, stop, period=2.0 * math.pi)
    region = {"x": (-1.5, 1.5), "v": (-1.5, 1.5)}
    found = fm.frequency_response(system, "F", (0.2, 0.4), region)
    (branch,) = [one for one in found.branches if one.stable.any()]
    assert branch.values.max() == pytest.approx(brentq(lambda F: largest(F) - 0.7, 0.3, 0.35), abs=2e-5)
    assert sorted(branch.stops) == [False, True]
    assert not branch.cut
    assert "up to where motions stop" in str(found)
    for one in found.branches:
        for k in (0, len(one.values) // 2, -1):
            rates = lambda t, y, F=one.values[k]: softening(t, *y, 0.3, F)  # noqa: E731
            run = solve_ivp(rates, (0.0, 2.0 * np.pi), one.places[k], rtol=1e-10, atol=1e-12, max_step=0.01)
            np.testing.assert_allclose(run.y[:, -1], one.places[k], atol=1e-5)
            assert run.y[0].max() < 0.7 + 1e-4
    always = fm.System(softening, ["x", "v"], {"c": 0.3, "F": 0.1}, lambda t, x, v: 1.0, period=2.0 * math.pi)
    assert not fm.frequency_response(always, "F", (0.2, 0.4), region).branches


@pytest.mark.slow
def test_a_branch_ends_where_its_motions_leave_a_coordinate_s_range() -> None:
    """|x| = F / sqrt((k - m w^2)^2 + (c w)^2) is 1 there; nothing is told of motions beyond."""
    mechanism = resonator(fm.loads.Harmonic(2.0, sympy.Symbol("omega")), {"omega": 1.0}, reach=1.0)
    found = fm.frequency_response(mechanism, "omega", (0.5, 4.0), {"x": (-0.5, 0.5)})
    ends = [one.values[[0, -1]] for one in sorted(found.branches, key=lambda one: one.values[0])]
    # (9 - 2 s)^2 + 0.36 s = 4, s = w^2
    expected = np.sqrt(np.sort(np.roots([4.0, 0.36 - 36.0, 77.0])))
    np.testing.assert_allclose(ends, [[0.5, expected[0]], [expected[1], 4.0]], rtol=2e-5)
    assert [any(one.stops) for one in found.branches] == [True, True]
    for omega, number in ((1.0, 1), (2.0, 0)):
        assert len(fm.periodic_orbits(mechanism.replace(omega=omega), {"x": (-0.5, 0.5)})) == number


@pytest.mark.slow
def test_motions_on_the_way_to_infinity_give_no_warning() -> None:
    """They are beside the branches of an escape equation, whose motions come back by SciPy too."""

    def rates(t, x, v, w):  # type: ignore[no-untyped-def]
        return v, -0.1 * v - x + x * x + 0.06 * fm.cos(w * t)

    system = fm.System(rates, ["x", "v"], {"w": 0.85}, period=lambda w: 2.0 * math.pi / w)
    starts = fm.samplers.Uniform({"x": (-0.8, 1.3), "v": (-0.9, 0.9)})
    found = fm.frequency_response(system, "w", (0.6, 1.2), starts)
    assert len(found.branches) >= 2
    for branch in found.branches:
        k = int(np.argmin(np.abs(branch.multipliers).max(axis=1)))
        w, end = branch.values[k], 2.0 * np.pi / branch.values[k]
        run = solve_ivp(
            lambda t, y, w=w: rates(t, *y, w), (0.0, end), branch.places[k], rtol=1e-10, atol=1e-12
        )
        np.testing.assert_allclose(run.y[:, -1], branch.places[k], atol=1e-4)
