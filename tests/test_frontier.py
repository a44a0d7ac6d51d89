"""Speed against error of methods on a problem of one's own."""

from __future__ import annotations

import re

import numpy as np
import pytest
from ensembles.references import errors, motions_of, rest_starts

import fastmech as fm


def oscillate(t: float, x: float, v: float) -> tuple[float, float]:
    return v, -x


def test_errors_are_those_of_the_call_to_copy() -> None:
    """Against the closed form: a unit oscillator turns its state."""
    system, starts = fm.System(oscillate, ["x", "v"], {}), np.random.default_rng(0).normal(size=(40, 2))
    found = fm.work_precision(system, starts, 20.0, errors=[1e-3, 1e-6], methods=["rk4", "dop853", "abm8"])
    assert {point.method for point in found.points} == {"rk4", "dop853", "abm8"}
    c, s = np.cos(20.0), np.sin(20.0)
    right = starts @ np.array([[c, -s], [s, c]])
    for point in found.points:
        run = fm.integrate(system, starts, 20.0, dt=point.dt, method=point.method)
        assert errors(run.y, right[None]).max() == pytest.approx(point.largest, rel=0.1)
        assert point.error_99 <= point.largest
    fastest = [max(p.rate for p in found.points if p.largest <= error) for error in found.errors]
    assert [point.rate for point in found.frontier] == list(dict.fromkeys(fastest))
    scope = {"fm": fm, "problem": system, "starts": starts, "t_end": 20.0}
    assert errors(eval(found.call(1e-5), scope).y, right[None]).max() <= 1.1e-5
    with pytest.raises(fm.InputError, match="no method and step tried keeps it"):
        found.call(1e-14)
    assert str(found).count("\n") < 6


@pytest.mark.slow
def test_a_scene_s_steps_are_fitted_and_a_picture_is_drawn() -> None:
    scene, starts = fm.Scene(alpha=0.0), rest_starts(24)
    found = fm.work_precision(scene, starts, 2.0, errors=[1e-5], methods=["abm8", "tsit5"])
    assert found.fit
    run = eval(found.call(1e-5), {"fm": fm, "problem": scene, "starts": starts, "t_end": 2.0})
    assert errors(run.y, motions_of(scene, starts, [2.0])).max() <= 1.1e-5
    ax = found.plot()
    assert "largest error" in ax.get_xlabel()
    assert {line.get_label() for line in ax.get_lines()} >= {"abm8", "tsit5"}
    assert f"{found.number} motions of {found.t_end:g} s" in ax.get_title()
    assert "Table 1" in ax.get_title()


def test_the_call_takes_parameters_of_each_trajectory() -> None:
    """A pair of states that turns by an angle of its own."""
    system = fm.System(lambda t, x, v, w: (w * v, -w * x), ["x", "v"], {"w": 1.0})
    w, starts = np.linspace(1.0, 3.0, 24), np.tile([1.0, 0.0], (24, 1))
    parameters = {"w": w}
    found = fm.work_precision(system, starts, 5.0, errors=[1e-5], methods=["dop853"], parameters=parameters)
    scope = {"fm": fm, "problem": system, "starts": starts, "t_end": 5.0, "parameters": parameters}
    run = eval(found.call(1e-5), scope)
    right = np.column_stack([np.cos(5.0 * w), -np.sin(5.0 * w)])
    assert errors(run.y, right[None]).max() <= 1.1e-5


def test_the_frontier_has_no_steps_that_integrate_calls_too_large() -> None:
    """A stiff spring and a strong damper: one step of what accuracy allows turns by more than 1 rad."""
    scene = fm.Scene(c1=200.0, beta=50.0)
    starts = np.random.default_rng(1).uniform([0.5, -1.0, -2.0, -2.0], [2.5, 1.0, 2.0, 2.0], (200, 4))
    found = fm.work_precision(scene, starts, 8.0, errors=[1e-2, 1e-4, 1e-6], methods=["dop853"])
    assert found.points
    for point in found.frontier:
        call = found.call(point.largest)
        run = eval(call, {"fm": fm, "problem": scene, "starts": starts, "t_end": 8.0})
        assert (run.status == fm.Status.OK).all(), call


def test_an_error_that_rounding_forbids_is_told_with_the_least() -> None:
    """sin' = cos, which all methods have to 1e-15 at most."""
    system = fm.System(lambda t, x, v: (v, -x), ["x", "v"], {})
    found = fm.work_precision(system, [[0.0, 1.0]], 3.0, errors=[1e-3, 1e-20], methods=["dop853"])
    assert re.search(
        r"error 1e-20: no method and step tried keeps it; runs come to \d\S*e-1[56]$", repr(found)
    )
    with pytest.raises(fm.InputError, match=r"no method and step tried keeps it; runs come to \d"):
        fm.work_precision(system, [[0.0, 1.0]], 3.0, errors=[1e-20], methods=["dop853"]).call(1e-20)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"errors": []}, "errors = \\[\\]: must be a list of numbers, not empty"),
        ({"methods": ["rk5"]}, "method = 'rk5': unknown"),
    ],
)
def test_wrong_arguments(change: dict[str, object], message: str) -> None:
    with pytest.raises(fm.InputError, match=message):
        fm.work_precision(fm.Scene(), rest_starts(2), 1.0, **change)  # type: ignore[arg-type]


def test_a_start_that_has_no_motion_to_the_end_is_the_reason_told() -> None:
    """x' = x^2 from 2 has its pole at t = 0.5."""
    poles = fm.System(lambda t, x: (x * x,), ["x"])
    found = fm.work_precision(poles, [[0.1], [2.0]], 1.0, errors=(1e-6,), methods=("rk4",))
    assert repr(found).endswith(
        "error 1e-06: no method and step tried keeps it; some starts converge at no step tried"
    )
