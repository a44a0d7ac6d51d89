"""Systems of one's own: the same engine, checked against SciPy, closed forms and published fractions."""

from __future__ import annotations

import importlib.util
import math
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fastmech as fm
from fastmech.ensembles.system import System

SCANS = Path(__file__).parents[2] / "scans" / "systems"
FREQUENCY = 2.0


def oscillator(t: float, x: float, v: float, omega: float) -> tuple[float, float]:
    return v, -omega * omega * x


def falling(t: float, x: float, rate: float) -> tuple[float]:
    return (-rate,)


def below_zero(t: float, x: float) -> float:
    return 7.0 if x < 0.0 else 0.0


def scaled(t: float, x: float) -> tuple[float]:
    return (FREQUENCY * x,)


def shipped(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, SCANS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_trajectory_may_have_its_own_parameters() -> None:
    omega = np.linspace(0.5, 3.0, 300)
    system = System(oscillator, ["x", "v"], {"omega": 1.0})
    run = fm.integrate(
        system, np.tile([1.0, 0.0], (300, 1)), 2.0, 0.01, "dop853", parameters={"omega": omega}
    )
    np.testing.assert_allclose(run.y[0, :, 0], np.cos(2.0 * omega), atol=1e-12)
    np.testing.assert_allclose(run.y[0, :, 1], -omega * np.sin(2.0 * omega), atol=1e-12)


def test_a_scene_s_own_parameters_are_as_so_many_scenes() -> None:
    starts = np.random.default_rng(0).uniform(-2, 2, (5, 4))
    own = {
        "F0": np.array([0.0, 50.0, -20.0, 10.0, 5.0]),
        "c1": np.linspace(0, 300, 5),
        "m2": np.linspace(1, 5, 5),
    }
    for formulation in ("lagrange", "hamilton"):
        together = fm.integrate(fm.Scene(), starts, 1.0, parameters=own, formulation=formulation).y[0]
        for i, start in enumerate(starts):
            scene = fm.Scene().replace(**{name: float(values[i]) for name, values in own.items()})
            alone = fm.integrate(scene, start, 1.0, formulation=formulation).y[0, 0]
            np.testing.assert_allclose(together[i], alone, rtol=0, atol=1e-14)


def test_own_decay_rates_are_each_trajectory_s() -> None:
    starts, alpha = np.tile([0.5, 0.1, 0.0, 0.0], (9, 1)), np.linspace(0.0, 4.0, 9)
    run = fm.integrate(fm.Scene(), starts, 1.0, parameters={"alpha": alpha}).y[0]
    for i in (0, 4, 8):
        alone = fm.integrate(fm.Scene(alpha=float(alpha[i])), starts[0], 1.0).y[0, 0]
        np.testing.assert_allclose(run[i], alone, rtol=0, atol=1e-14)


def test_a_stopped_trajectory_keeps_its_state_time_and_code() -> None:
    """x = x0 - t falls below zero at the first step after x0."""
    x0 = np.concatenate([np.random.default_rng(1).uniform(0.1, 30.0, 5000), [1000.0]])
    system = System(falling, ["x"], {"rate": 1.0}, stop=below_zero)
    times = np.array([5.0, 20.0, 40.0])
    run = fm.integrate(system, x0[:, None], t_eval=times, dt=0.125, method="euler", threads=1)
    assert run.stop_code is not None
    assert run.stop_time is not None
    stopped = np.floor(x0[:-1] / 0.125) * 0.125 + 0.125
    np.testing.assert_array_equal(run.stop_code, [*np.full(5000, 7), 0])
    np.testing.assert_allclose(run.stop_time[:-1], stopped, atol=1e-9)
    assert math.isnan(run.stop_time[-1])
    for k, t in enumerate(times):
        np.testing.assert_allclose(run.y[k, :-1, 0], x0[:-1] - np.minimum(stopped, t), atol=1e-9)
    again = fm.integrate(system, x0[:, None], t_eval=times, dt=0.125, method="euler", threads=2)
    np.testing.assert_array_equal(again.y, run.y)


def test_a_trajectory_that_is_not_finite_is_taken_out_and_told() -> None:
    system = System(falling, ["x"], {"rate": 1.0}, stop=below_zero)
    run = fm.integrate(system, [[np.nan], [1.0]], 3.0, 0.1, "euler")
    assert run.status.tolist() == [fm.Status.START_NOT_FINITE, fm.Status.OK]
    assert run.stop_code is not None
    assert run.stop_code.tolist() == [0, 7]


def test_a_changed_constant_is_another_system(monkeypatch: pytest.MonkeyPatch) -> None:
    first = fm.integrate(System(scaled, ["x"], {}), [[1.0]], 1.0, 0.01).y[0, 0, 0]
    monkeypatch.setitem(scaled.__globals__, "FREQUENCY", 3.0)
    second = fm.integrate(System(scaled, ["x"], {}), [[1.0]], 1.0, 0.01).y[0, 0, 0]
    np.testing.assert_allclose([first, second], np.exp([2.0, 3.0]), rtol=1e-6)


def test_a_system_needs_no_parameters() -> None:
    run = fm.integrate(fm.System(lambda t, x: (-x,), ["x"]), [1.0], 1.0, 0.01)
    assert run.y[-1, 0, 0] == pytest.approx(math.exp(-1.0), rel=1e-9)


def test_parameters_go_by_name() -> None:
    def pull(t: float, x: float, a: float, b: float) -> tuple[float]:
        return (a - b * x,)

    given, swapped = ({"a": 1.0, "b": 2.0}, {"b": 2.0, "a": 1.0})
    runs = [fm.integrate(System(pull, ["x"], p), [[0.0]], 1.0).y for p in (given, swapped)]
    np.testing.assert_allclose(runs[0][0, 0, 0], 0.5 * (1.0 - np.exp(-2.0)), rtol=1e-8)
    np.testing.assert_array_equal(*runs)


def asserting(t: float, x: float) -> tuple[float]:
    assert x > 0.0
    return (x,)


def keyword(t: float, x: float, *, a: float) -> tuple[float]:
    return (a * x,)


RATES = "must return a tuple of 2, the rates of x, v"
COMPILED = "cannot be compiled (arithmetic, numpy and math only; functions that it calls need numba.njit)"
HEAD = "def rhs(t, x, v):\n    "
REFUSED = {
    f"{HEAD}return v, -x, 0.0": f"rhs: returns a tuple of 3, {RATES}",
    f"{HEAD}return (v,)": f"rhs: returns a tuple of 1, {RATES}",
    f"{HEAD}return v": f"rhs: returns float64, {RATES}",
    f"{HEAD}return [v, x]": f"rhs: returns list(float64)<iv=None>, {RATES}",
    f"{HEAD}pass": f"rhs: returns none, {RATES}",
    f"{HEAD}return v, 1j * x": "rhs: returns complex128 as the rate of v, must be a real number",
    f"{HEAD}return v, unknown * x": f"rhs: {COMPILED}: NameError: name 'unknown' is not defined",
    f"f = print\n{HEAD}return v, len(x)": f"rhs: {COMPILED}: line 3: nothing known for len(float64)",
    f"def f(x):\n    return x\n\n{HEAD}return v, f(x)": f"rhs: {COMPILED}: line 5: "
    "Untyped global name 'f': Cannot determine Numba type of <class 'function'>",
    f"{HEAD}return v, x['a']": f"rhs: {COMPILED}: line 2: "
    "nothing known for getitem(float64, Literal[str](a))",
    f"{HEAD}return v, -x\n\ndef stop(t, x, v):\n    pass": "stop: returns none, must return a real number, "
    "0 while it runs on",
}


@pytest.mark.parametrize("code", REFUSED)
def test_functions_that_cannot_be_run_are_refused_in_one_line(code: str, tmp_path: Path) -> None:
    """Told again in the next process's place: nothing of what was refused is kept."""
    (tmp_path / "users.py").write_text(code)
    names: dict[str, Any] = {}
    exec(compile(code, tmp_path / "users.py", "exec"), names)
    for _ in range(2):
        system = System(names["rhs"], ["x", "v"], {}, stop=names.get("stop"))
        with pytest.raises(fm.InputError) as refusal:
            fm.integrate(system, [[1.0, 0.0]], 1.0)
        assert str(refusal.value) == REFUSED[code]


@pytest.mark.parametrize(
    ("stop", "told"),
    [
        (lambda t, x, v: math.nan * x, "stop: gave nan at t = 0.5 in state (1.5, 1), "),
        (lambda t, x, v: 0.5 * (t > 1.2), "stop: gave 0.5 at t = 1.5 in state (2.5, 1), "),
        (lambda t, x, v: 1e300, "stop: gave 1e+300 at t = 0.5 in state (1.5, 1), "),
    ],
)
def test_codes_that_are_no_whole_numbers_are_refused(stop: Any, told: str) -> None:
    system = System(lambda t, x, v: (v, 0.0), ["x", "v"], {}, stop=stop)
    with pytest.raises(fm.InputError) as refusal:
        fm.integrate(system, [[1.0, 1.0]], 3.0, 0.5)
    wanted = "must give 0 while a trajectory runs on, another whole number where it stops"
    assert str(refusal.value) == told + wanted


def test_a_code_that_is_nan_because_the_state_is_stops_nothing() -> None:
    system = System(lambda t, x: (x * x,), ["x"], {}, stop=lambda t, x: x - x)
    run = fm.integrate(system, [[1.0], [-1.0]], 3.0, 0.1)
    assert run.status.tolist() == [fm.Status.NOT_FINITE, fm.Status.OK]
    assert run.stop_code is not None
    assert run.stop_code.tolist() == [0, 0]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"y0": [1j, 0.0]}, "y0: must be numbers of shape (n, 2): x, v"),
        ({"y0": ["1", "2"]}, "y0: must be numbers of shape (n, 2): x, v"),
        ({"y0": [None, 1.0]}, "y0: must be numbers of shape (n, 2): x, v"),
        ({"y0": np.ma.array([1.0, 2.0], mask=[0, 1])}, "y0: must be numbers of shape (n, 2): x, v"),
        ({"y0": [1.0, 2.0, 3.0]}, "y0: has shape (3,), must be (n, 2): x, v"),
        ({"t_eval": ["0.1"], "t_end": None}, "t_eval: must be times in s"),
        ({"formulation": "lagrange"}, "formulation = 'lagrange': only for a scene or a mechanism"),
        ({"quantile": 0.5}, "quantile = 0.5: tells whose error tol is; give tol with it"),
        ({"fit": True}, "fit: only for a scene, whose energy bounds its speed"),
    ],
)
def test_wrong_arguments_of_a_run_are_refused(wrong: dict[str, Any], message: str) -> None:
    system = System(oscillator, ["x", "v"], {"omega": 1.0})
    with pytest.raises(fm.InputError) as refusal:
        fm.integrate(system, **({"y0": [1.0, 0.0], "t_end": 1.0} | wrong))
    assert str(refusal.value) == message


def test_whole_numbers_are_starts() -> None:
    system = System(oscillator, ["x", "v"], {"omega": 1.0})
    whole, real = (fm.integrate(system, y0, 1.0).y for y0 in ([1, 0], [1.0, 0.0]))
    np.testing.assert_array_equal(whole, real)


def test_a_variable_without_a_value_is_refused_in_one_line() -> None:
    def growing(t: float, x: float) -> tuple[float]:
        return (rate * x,)

    with pytest.raises(fm.InputError) as refusal:
        fm.integrate(System(growing, ["x"], {}), [[1.0]], 1.0)
    assert str(refusal.value) == "growing: uses rate, which has no value yet"
    rate = 2.0
    run = fm.integrate(System(growing, ["x"], {}), [[1.0]], 1.0)
    np.testing.assert_allclose(run.y, math.exp(rate), rtol=1e-7)


RAISING = """
import types, numba

@numba.njit
def root(x):
    if x < 0.0:
        raise ValueError(x)
    return x**0.5

@numba.njit
def half(x):
    return 0.5 * root(x)

own = types.ModuleType("own")
own.half = half
"""


@pytest.mark.parametrize(
    ("line", "field"),
    [
        ("def rhs(t, x): return (root(x),)", "rhs"),
        ("def rhs(t, x): return (half(x),)", "rhs"),
        ("def rhs(t, x): return (own.half(x),)", "rhs"),
        ("def rhs(t, x): return (x,)\ndef stop(t, x): return half(x) > 2.0", "stop"),
    ],
)
def test_no_function_that_is_called_may_raise(line: str, field: str) -> None:
    """One trajectory's error would end all the others."""
    names: dict[str, Any] = {}
    exec(RAISING + line, names)
    with pytest.raises(fm.InputError) as refusal:
        fm.integrate(System(names["rhs"], ["x"], {}, names.get("stop")), [[1.0]], 1.0)
    told = "calls root, which must not raise or assert; nan as a result ends a trajectory"
    assert str(refusal.value) == f"{field}: {told}"


CONSTANT_IN = {
    "a global number": "K = {k}\ndef rhs(t, x):\n    return (K * x,)\n",
    "a compiled helper": (
        "import numba\n@numba.njit\ndef h(x):\n    return {k} * x\n\ndef rhs(t, x):\n    return (h(x),)\n"
    ),
    "a nested function": "def rhs(t, x):\n    def h(x):\n        return {k} * x\n    return (h(x),)\n",
    "a module": "import own\ndef rhs(t, x):\n    return (own.K * x,)\n",
    "an array": "import numpy as np\nA = np.full(5000, {k})\ndef rhs(t, x):\n    return (A[2500] * x,)\n",
}


@pytest.mark.parametrize("code", CONSTANT_IN.values(), ids=CONSTANT_IN)
def test_a_second_process_never_gets_an_old_answer(code: str, tmp_path: Path) -> None:
    """Wherever a constant hides: y = exp(K) after it has been edited from 2 to 3."""
    script = "import sys; sys.path.insert(0, sys.argv[1]); import fastmech as fm, users\n"
    script += "print(fm.integrate(fm.System(users.rhs, ['x'], {}), [[1.0]], 1.0, 0.01).y[0, 0, 0])"
    for k in (2.0, 3.0):
        (tmp_path / "users.py").write_text(code.format(k=k))
        (tmp_path / "own.py").write_text(f"K = {k}\n")
        command = [sys.executable, "-B", "-c", script, str(tmp_path)]
        told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        assert float(told) == pytest.approx(np.exp(k), rel=1e-6)


def test_a_second_process_loads_the_kernels_from_the_disk(tmp_path: Path) -> None:
    script = f"import sys; sys.path.insert(0, {str(SCANS)!r}); import lorenz\n"
    script += (
        "s = lorenz.system.kernel.stats; print(sum(s.cache_hits.values()), sum(s.cache_misses.values()))"
    )
    told = [
        subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert told[1].split() == ["1", "0"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((oscillator, ["x"], {"omega": 1.0}), "rhs: takes (t, x, v, omega), must take (t, x, omega)"),
        ((oscillator, ["x", "x"], {"omega": 1.0}), "state = ['x', 'x']: must be different Python names"),
        ((oscillator, ["x", "2v"], {"omega": 1.0}), "state = ['x', '2v']: must be different Python names"),
        ((oscillator, ["x", "v"], {"omega": 1.0}, below_zero), "stop: takes (t, x), must take (t, x, v)"),
        ((oscillator, ["v", "x"], {"omega": 1.0}), "rhs: takes (t, x, v, omega), must take (t, v, x, omega)"),
        ((oscillator, ["x", "v"], {"k": 1.0}), "rhs: takes (t, x, v, omega), must take (t, x, v, k)"),
        (("x", ["x", "v"], {"omega": 1.0}), "rhs = 'x': must be a plain Python function"),
        ((oscillator, "xv", {"omega": 1.0}), "state = 'xv': must be a list of different Python names, at"),
        ((oscillator, None, {"omega": 1.0}), "state = None: must be a list of different Python names"),
        (
            (oscillator, [], {"omega": 1.0}),
            "state = []: must be a list of different Python names, at least 1",
        ),
        ((oscillator, ["x", 3], {"omega": 1.0}), "state = ['x', 3]: must be different Python names"),
        ((oscillator, ["x", "v"], {"omega": math.nan}), "parameters.omega = nan: must be a finite number"),
        ((oscillator, ["x", "v"], {"omega": "1"}), "parameters.omega = '1': must be a finite number"),
        ((oscillator, ["x", "v"], {"omega": 1j}), "parameters.omega = 1j: must be a finite number"),
        ((oscillator, ["x", "v"], [1.0]), "parameters = [1.0]: must be a mapping of names to numbers"),
        ((oscillator, ["x", "v"], {"omega": 1.0}, 5), "stop = 5: must be a plain Python function"),
        ((asserting, ["x"], {}), "rhs: must not raise or assert; nan as a result ends a trajectory"),
        ((keyword, ["x"], {"a": 1.0}), "rhs: takes (t, x, *, a), must take (t, x, a)"),
    ],
)
def test_wrong_systems_are_refused(arguments: Any, message: str) -> None:
    with pytest.raises(fm.InputError) as refusal:
        System(*arguments)
    assert str(refusal.value).startswith(message)


@pytest.mark.parametrize(
    ("own", "message"),
    [
        ({"omge": [1.0]}, "parameters.omge: unknown name; did you mean 'omega'?"),
        ({"omega": 1.0}, "parameters.omega: has shape (), must be (1,), one value a start"),
        ({"omega": [np.nan]}, "parameters.omega: must be finite"),
        ({"omega": ["1.0"]}, "parameters.omega: must be real numbers"),
        ({"omega": [1j]}, "parameters.omega: must be real numbers"),
        ({3: [1.0]}, "parameters.3: unknown name; allowed: omega"),
        ([1.0], "parameters = [1.0]: must map names to values, one a start"),
    ],
)
def test_wrong_parameters_are_refused(own: dict[str, Any], message: str) -> None:
    with pytest.raises(fm.InputError) as refusal:
        fm.integrate(System(oscillator, ["x", "v"], {"omega": 1.0}), [[1.0, 0.0]], 1.0, parameters=own)
    assert str(refusal.value) == message


def test_parameters_that_no_scene_may_have_are_refused() -> None:
    with pytest.raises(fm.InputError, match=r"^scene\.m1 = 0\.0: "):
        fm.integrate(fm.Scene(), np.zeros((2, 4)), 1.0, parameters={"m1": [1.0, 0.0]})


@pytest.mark.parametrize("name", ["pendulum", "duffing", "lorenz"])
def test_shipped_systems_move_as_scipy_says(name: str) -> None:
    system = shipped(name).system
    start = np.array([0.3, -0.4, 0.0][: len(system.state)])
    p = list(system.parameters.values())

    def rhs(t: float, y: Any) -> Any:
        return system.rhs(t, *y, *p)

    right = solve_ivp(rhs, (0.0, 5.0), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(fm.integrate(system, start, 5.0, 0.02, "dop853").y[0, 0], right, atol=1e-10)
