"""Motions of mechanisms with an energy that they cannot have are those of steps that are too long."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from random_mechanisms import KINDS

import fastmech as fm
from fastmech.ensembles.status import Status
from fastmech.models.checks import trial_states

#: Of random mechanisms: kind and number; with a range of 7 these are 42, in three minutes.
SOME = [(kind, number) for number in range(2) for kind in KINDS]


def starts_of(mechanism: fm.Mechanism) -> np.ndarray:
    """Some, of which every second is at rest."""
    y, n = trial_states(mechanism)[:32], len(mechanism.coordinates)
    y[::2, n:] = 0.0
    return y


@pytest.mark.parametrize(("kind", "number"), SOME)
@pytest.mark.slow
def test_no_step_that_is_reasonable_is_called_too_large(kind: str, number: int) -> None:
    """At steps whose errors are up to 2e-2 by both of two runs with shorter ones."""
    mechanism = KINDS[kind](np.random.default_rng([number, 7]))
    y, times, looked_at = starts_of(mechanism), np.linspace(0.2, 1.0, 5), 0
    steps = 0.16 * 0.25 ** np.arange(8)
    runs = [fm.integrate(mechanism, y, t_eval=times, dt=dt) for dt in steps]
    for run, fine, finest in zip(runs, runs[1:], runs[2:], strict=False):
        error = np.fmax(np.abs(run.y - finest.y), np.abs(fine.y - finest.y)).max(axis=(0, 2))
        looked_at += int((error < 2e-2).sum())
        assert not (run.status[error < 2e-2] == Status.STEP_TOO_LARGE).any()
    assert looked_at or kind == "chain"


def stiff_truss() -> fm.Mechanism:
    """Two stiff bars with dampers, which snaps through; in its ranges U grows towards all ends."""
    x, y = fm.lengths("x", -0.9, 0.9), fm.lengths("y", -2.0, 2.0)
    bars = [fm.Spring(foot, "M", 1e4, float(np.sqrt(1.25))) for foot in ("A", "B")]
    return fm.Mechanism(
        (x, y),
        points={"A": (-1.0, 0.0), "B": (1.0, 0.0), "M": (x, y)},
        masses={"M": 1.0},
        springs=bars,
        dampers=[fm.Damper("A", "M", 5.0), fm.Damper("B", "M", 5.0)],
    )


def test_steps_that_are_too_long_for_stiff_bars_have_a_status() -> None:
    """rk4's limit on the imaginary axis is 2 sqrt 2; the bars' fastest swing is sqrt(2 k / m) = 141 rad/s."""
    truss, limit = stiff_truss(), 2.0 * np.sqrt(2.0) / np.sqrt(2e4)
    y = np.random.default_rng(1).uniform([-0.3, -0.6, -20.0, -20.0], [0.3, 0.6, 20.0, 20.0], (256, 4))
    assert not fm.integrate(truss, y, 1.0, dt=0.1 * limit).status.any()
    for times in (3.0, 10.0):
        bad = fm.integrate(truss, y, 1.0, dt=times * limit).status
        assert np.isin(bad, (Status.STEP_TOO_LARGE, Status.NOT_FINITE)).all(), times
    right = fm.label_starts(truss, y)
    labels = fm.label_starts(truss, y, dt=10.0 * limit)
    assert (right.status == Status.CAPTURED).all()
    told = labels.status == Status.CAPTURED
    assert (labels.well[told] == right.well[told]).all()
    assert not (labels.status == Status.OUT_OF_RANGE).any()
    assert (labels.status == Status.STEP_TOO_LARGE).any()


def swing(load: fm.loads.Load | None = None, **more: object) -> fm.Mechanism:
    x = fm.lengths("x", -50.0, 50.0)
    forces = [fm.Force("M", load, (1, 0))] if load is not None else []
    own = {"points": {"M": (x, 0)}, "masses": {"M": 1.0}, "potential": 50.0 * x**2, "forces": forces}
    return fm.Mechanism(x, **(own | more))  # type: ignore[arg-type]


@pytest.mark.slow
def test_what_loads_and_forces_bring_is_no_error() -> None:
    """An oscillator of 10 rad/s: loads that act, repeat or fade add energy, and so does a negative damper."""
    x = fm.lengths("x", -50.0, 50.0)
    rest = np.zeros((1, 2))
    for load in (
        fm.loads.Harmonic(30.0, 10.0),
        fm.loads.Decaying(300.0, 3.0),
        fm.loads.Pulse(100.0, 0.1, 0.2),
        fm.loads.Ramp(100.0, 0.5, 0.2),
        fm.loads.Constant(30.0),
    ):
        run = fm.integrate(swing(load), rest, 3.0, dt=0.01)
        assert run.status[0] == Status.OK, load
        assert np.abs(run.y).max() > 0.1, load
    fed = swing(generalized_forces={"x": 2.0 * x.dot})
    run = fm.integrate(fed, np.array([[0.1, 0.0]]), 2.0, dt=0.01)
    assert run.y[-1, 0, 1] ** 2 + 100.0 * run.y[-1, 0, 0] ** 2 > 10.0
    assert run.status[0] == Status.OK


def test_a_load_that_is_over_leaves_an_energy_that_may_not_grow() -> None:
    """Steps end at the pulse's ends, and so are short enough until then: its limit is 0.28 s."""
    over = swing(fm.loads.Pulse(100.0, 0.1, 0.2))
    assert over._motion({}).rests == pytest.approx(0.3)
    times = np.array([0.3, 3.0])
    assert fm.integrate(over, np.zeros((1, 2)), t_eval=times, dt=0.31).status[0] == Status.STEP_TOO_LARGE


def test_a_full_swing_from_rest_is_judged_by_what_it_turns_over() -> None:
    """Both ends are turning points at which U is zero: an error of 1e-3 there is none of the energy."""
    x, theta = fm.lengths("x", -50.0, 50.0), fm.angles("theta")
    hung = fm.Mechanism(
        x, points={"M": (0, x), "O": (0, 0)}, masses={"M": 1.0}, gravity=9.81, potential=50.0 * x**2
    )
    level = fm.Mechanism(theta, kinetic=theta.dot**2 / 2, potential=-9.81 * sympy.cos(theta))
    # A pendulum's period from 90 degrees: 4 K(1/2) / sqrt(g / l).
    quarter = 1.8540746773013719 / np.sqrt(9.81)
    for mechanism, start, period in ((hung, 0.0, 0.2 * np.pi), (level, 0.5 * np.pi, 4.0 * quarter)):
        for steps in (16, 32, 64):
            run = fm.integrate(mechanism, np.array([[start, 0.0]]), period, dt=period / steps)
            assert run.status[0] == Status.OK
            assert np.abs(run.y[-1, 0, 0] - start) < 0.1
    many = fm.integrate(hung, np.zeros((1, 2)), 40.0, dt=0.3)
    assert many.status[0] == Status.STEP_TOO_LARGE


def test_parameters_of_their_own_are_each_motion_s() -> None:
    """Of stiffnesses from 1 to 1e4 those whose rk4 steps are too long have the status, and no others."""
    x = fm.lengths("x", -1e3, 1e3)
    k, c = sympy.symbols("k c")
    own = fm.Mechanism(
        x, {"k": 1.0, "c": 0.1}, kinetic=x.dot**2 / 2, potential=k * x**2 / 2, dissipation=c * x.dot**2 / 2
    )
    stiffness = np.array([1.0, 100.0, 1e4])
    run = fm.integrate(own, np.ones((3, 2)), 0.5, dt=0.05, parameters={"k": stiffness, "c": np.zeros(3)})
    assert run.status.tolist() == [Status.OK, Status.OK, Status.STEP_TOO_LARGE]
    assert fm.integrate(own, np.ones((2, 2)), 0.5, parameters={"c": np.array([0.0, 3.0])}).status.max() == 0
