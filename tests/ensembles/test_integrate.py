"""``fm.integrate``: times, steps, statuses, refusals."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from ensembles.starts import random_starts

from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.lanes import output_steps
from fastmech.ensembles.problem import extreme_scenes, motion_problem
from fastmech.ensembles.run import run_ensemble
from fastmech.errors import InputError
from fastmech.integrators.methods import METHODS
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.kernels.select import right_hand_side

pytestmark = pytest.mark.nojit

SCENE = Scene()
START = [0.9, 0.4, 0.0, 0.0]


@pytest.mark.parametrize(
    ("arguments", "steps", "longest"),
    [
        ({"t_end": 1.0, "dt": 0.25}, 4, 0.25),
        ({"t_end": 1.0, "dt": 0.1}, 10, 0.1),
        ({"t_end": 0.14, "dt": 0.02}, 7, 0.02),  # the quotient is a bit more than 7 in doubles
        ({"t_end": 0.3, "dt": 0.1}, 3, 0.1),  # the quotient is a bit less than 3
        ({"t_end": 1.0, "dt": 0.3}, 4, 0.25),
        ({"t_end": 1.0, "dt": 5.0}, 1, 1.0),
        ({"t_end": 1.0, "dt": 1.0 - 1e-9}, 2, 0.5),
        ({"t_eval": [0.5, 0.55, 1.0], "dt": 0.1}, 5 + 1 + 5, 0.1),
        ({"t_eval": [0.0, 0.4], "dt": 0.1}, 4, 0.1),
        ({"t_eval": [0.0], "dt": 0.1}, 0, 0.0),
        ({"t_eval": 0.2, "dt": 0.1}, 2, 0.1),
        ({"t_eval": [0.2], "t_end": 0.2, "dt": 0.1}, 2, 0.1),
        ({"t_eval": [0.2], "t_end": 9.0, "dt": 0.1}, 2, 0.1),
    ],
)
def test_steps_and_longest_step(arguments: dict[str, Any], steps: int, longest: float) -> None:
    run = integrate(SCENE, START, **arguments)
    assert run.steps == steps
    assert run.dt == pytest.approx(longest, rel=1e-12)
    assert run.dt <= arguments["dt"] * (1 + 1e-11)
    outputs = np.atleast_1d(arguments.get("t_eval", arguments.get("t_end")))
    np.testing.assert_array_equal(run.t, outputs)
    assert run.y.shape == (outputs.size, 1, 4)


def test_output_at_zero_is_the_start() -> None:
    run = integrate(SCENE, START, t_eval=[0.0, 0.1])
    np.testing.assert_array_equal(run.y[0, 0], START)
    alone = integrate(SCENE, START, 0.1)
    np.testing.assert_array_equal(run.y[1], alone.y[0])


def test_output_times_only_divide_the_run() -> None:
    """Outputs that fall on steps change nothing but rounding of times."""
    few = integrate(SCENE, START, 1.0, dt=0.125)
    many = integrate(SCENE, START, dt=0.125, t_eval=[0.25, 0.5, 1.0])
    np.testing.assert_allclose(many.y[-1], few.y[-1], rtol=0, atol=1e-14)


def test_output_steps_are_the_fewest_allowed() -> None:
    times = np.array([0.0, 0.0, 0.1, 0.3, 1.0, 1.0 + 1e-9])
    assert output_steps(times, 0.1).tolist() == [0, 1, 2, 7, 1]


@pytest.mark.parametrize(("times", "dt"), [([0.0, 1e308], 1e-5), ([0.0, 5e307, 1e308, 1.5e308], 0.5)])
def test_steps_without_number_are_refused(times: list[float], dt: float) -> None:
    with pytest.raises(InputError, match="inf steps"):
        output_steps(np.array(times), dt)


def test_names_of_the_run() -> None:
    run = integrate(SCENE, START, 0.1, method="tsit5", formulation="hamilton")
    assert run.method == "tsit5"
    run = integrate(SCENE, START, 0.1)
    assert run.method == "rk4"


def test_no_trajectories() -> None:
    run = integrate(SCENE, np.empty((0, 4)), t_eval=[0.1, 0.2])
    assert run.y.shape == (2, 0, 4)
    assert run.status.shape == (0,)


def test_progress_counts_every_trajectory_once() -> None:
    told: list[int] = []
    integrate(SCENE, random_starts(7), 0.02, progress=told.append)
    assert sum(told) == 7
    told.clear()
    params, times = np.array(reduce(SCENE)), np.array([0.0, 0.02])
    rhs, rk4 = right_hand_side(reduce(SCENE)), METHODS["rk4"]
    run_ensemble(rhs, params, random_starts(200), times, 0.01, rk4, block_lanes=3, progress=told.append)
    assert sum(told) == 200
    assert len(told) > 1


def test_y0_of_any_kind_of_numbers() -> None:
    right = integrate(SCENE, [1.0, 2.0, 0.0, -1.0], 0.1).y
    for y0 in (
        (1, 2, 0, -1),
        [[1, 2, 0, -1]],
        np.array([1, 2, 0, -1]),
        np.array([1, 2, 0, -1], dtype=np.float32),
    ):
        np.testing.assert_array_equal(integrate(SCENE, y0, 0.1).y, right)
    columns = np.asfortranarray(np.array([[1.0, 2.0, 0.0, -1.0]] * 3))
    np.testing.assert_array_equal(integrate(SCENE, columns, 0.1).y[:, 1:2], right)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"y0": [1.0, 2.0, 3.0]}, "y0: has shape (3,), must be (n, 4): phi, theta, phi_dot, theta_dot"),
        ({"y0": 1.0}, "y0: has shape (), must be (n, 4)"),
        ({"y0": np.zeros((2, 3, 4))}, "y0: has shape (2, 3, 4), must be (n, 4)"),
        ({"y0": [1.0, 2.0, 3.0, "x"]}, "y0: must be numbers of shape (n, 4)"),
        ({"y0": [[1.0, 2.0], [1.0]]}, "y0: must be numbers of shape (n, 4)"),
        ({"y0": [1j, 0, 0, 0]}, "y0: must be numbers of shape (n, 4)"),
        ({"y0": None}, "y0: "),
        ({"dt": 0.0}, "dt = 0.0: must be a finite number of s greater than 0"),
        ({"dt": -0.1}, "dt = -0.1: must be a finite number of s greater than 0"),
        ({"dt": np.nan}, "dt = nan: must be a finite number of s greater than 0"),
        ({"dt": np.inf}, "dt = inf: must be a finite number of s greater than 0"),
        ({"dt": "0.1"}, "dt = '0.1': must be a finite number of s greater than 0"),
        ({"dt": True}, "dt = True: must be a finite number of s greater than 0"),
        ({"t_end": 0.0}, "t_end = 0.0: must be a finite number of s greater than 0"),
        ({"t_end": -1.0}, "t_end = -1.0: must be a finite number of s greater than 0; backwards"),
        ({"t_end": np.inf}, "t_end = inf: must be a finite number of s greater than 0"),
        ({"t_end": "1"}, "t_end = '1': must be a finite number of s greater than 0"),
        ({"t_end": None}, "t_end: missing; give the end of the run in s, or output times t_eval"),
        ({"t_eval": []}, "t_eval: has shape (0,), must be a row of at least one time"),
        ({"t_eval": [[0.1, 0.2]]}, "t_eval: has shape (1, 2), must be a row of at least one time"),
        ({"t_eval": [0.2, 0.1]}, "t_eval[1] = 0.1: must be finite, not negative and strictly rising"),
        ({"t_eval": [0.1, 0.1]}, "t_eval[1] = 0.1: must be finite, not negative and strictly rising"),
        ({"t_eval": [-0.1, 0.1]}, "t_eval[0] = -0.1: must be finite, not negative and strictly rising"),
        ({"t_eval": [0.1, np.nan]}, "t_eval[1] = nan: must be finite, not negative and strictly rising"),
        ({"t_eval": [0.1, np.inf], "t_end": None}, "t_eval[1] = inf: must be finite, not negative"),
        ({"t_eval": ["a"]}, "t_eval: must be times in s"),
        ({"t_eval": [0.5, 2.0]}, "t_eval: its last time 2 s lies behind t_end = 1 s"),
        ({"method": "rk5"}, "method = 'rk5': unknown; known: euler"),
        ({"formulation": "lagrangian"}, "formulation = 'lagrangian': unknown; did you mean 'lagrange'?"),
        ({"formulation": "x"}, "formulation = 'x': unknown; allowed: lagrange, hamilton"),
        ({"formulation": [3]}, "formulation = [3]: unknown; allowed: lagrange, hamilton"),
        ({"dtype": [1]}, "dtype = [1]: must be one of float64, float32"),
        ({"method": ""}, "method = '': unknown; known: euler, midpoint"),
        ({"dt": 1e-13}, "dt = 1e-13 s: gives 1e+13 steps, at most 2e+10 are possible"),
        ({"progress": 3}, "progress = 3: must be a function of the number of finished trajectories"),
        ({"threads": 0}, "threads = 0: must be an integer not less than 1"),
        ({"threads": -2}, "threads = -2: must be an integer not less than 1"),
        ({"threads": 1.5}, "threads = 1.5: must be an integer not less than 1"),
        ({"threads": True}, "threads = True: must be an integer not less than 1"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(arguments: dict[str, Any], message: str) -> None:
    right: dict[str, Any] = {"y0": START, "t_end": 1.0}
    with pytest.raises(InputError, match=f"^{re.escape(message)}") as error:
        integrate(SCENE, **(right | arguments))
    assert "\n" not in str(error.value)


def test_a_wrong_t_end_beside_t_eval_is_refused() -> None:
    for t_end in (np.nan, "1", -1.0, 0.0):
        with pytest.raises(InputError, match=r"^t_end"):
            integrate(SCENE, START, t_end, t_eval=[0.0])  # type: ignore[arg-type]


def test_scenes_to_look_at_are_the_most_and_least_damped_and_the_stiffest() -> None:
    own = {"beta": np.array([50.0, 1.0, 900.0, 60.0, 70.0]), "c1": np.array([1.0, 2.0, 3.0, 5e4, 4.0])}
    problem = motion_problem(SCENE, 5, own, "lagrange")
    chosen = [{name: values[k] for name, values in own.items()} for k in (1, 2, 3)]
    assert extreme_scenes(SCENE, own, problem) == [SCENE.replace(**values) for values in chosen]
    assert extreme_scenes(SCENE, {}, motion_problem(SCENE, 5, {}, "lagrange")) == [SCENE]
    none = {"beta": np.empty(0)}
    assert extreme_scenes(SCENE, none, motion_problem(SCENE, 0, none, "lagrange")) == [SCENE]


def test_a_value_of_own_parameters_that_no_scene_may_have_is_told() -> None:
    for name, value in (("m2", -1.0), ("beta", -2.0), ("c1", 1e31), ("l", 1e-31)):
        own = {"F0": np.array([1.0, -2.0, 3.0]), name: np.array([1.0, value, 2.0])}
        with pytest.raises(InputError, match=rf"^scene\.{name} = {re.escape(str(value))}: ") as error:
            integrate(SCENE, np.zeros((3, 4)), 0.1, parameters=own)
        assert "\n" not in str(error.value)


def test_numpy_numbers_are_numbers() -> None:
    run = integrate(SCENE, START, np.float64(0.1), dt=np.float32(0.05), threads=np.int64(1))  # type: ignore[arg-type]
    assert run.steps == 2
