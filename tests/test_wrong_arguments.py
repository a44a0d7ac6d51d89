"""Arguments of a wrong kind get one short line, whatever they are."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fastmech as fm

SCENE = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)
STARTS = np.zeros((2, 4))
AXES = {"phi": [0.0, 0.1], "theta": [0.0, 0.1]}
STABLE = fm.find_equilibria(SCENE)[0]
TRUSS = fm.mechanisms.von_mises_truss()
SYSTEM = fm.System(lambda t, x, v, A: (v, A - x), ["x", "v"], {"A": 1.0}, period=1.0)
REGION, GRID = {"x": (-1.0, 1.0), "v": (-1.0, 1.0)}, {"x": [0.0, 0.1], "v": [0.0, 0.1]}

WRONG = [
    None,
    "x",
    np.nan,
    -1,
    {1, 2},
    [],
    1e300,
    np.zeros((2, 3, 5)),
    object(),
    True,
    [["a"]],
    "x" * 3_000_000,
]

#: Public functions, what they are given otherwise, and arguments for which none of the values above will do.
CALLS: list[tuple[Callable[..., Any], dict[str, Any], tuple[str, ...]]] = [
    (fm.integrate, {"scene": SCENE, "y0": STARTS, "t_end": 1.0}, ("scene",)),
    (fm.label_starts, {"scene": SCENE, "starts": STARTS}, ("scene",)),
    (fm.map_basins, {"scene": SCENE, "axes": AXES}, ("scene", "axes")),
    (fm.map_snapping, {"scene": SCENE, "F0": [1.0], "alpha": [1.0]}, ("scene",)),
    (fm.well_numbers, {"scene": SCENE}, ("scene",)),
    (fm.trapped, {"scene": SCENE, "states": STARTS}, ("scene",)),
    (fm.reactions, {"scene": SCENE, "y": STARTS, "t": 0.0}, ("scene", "y")),
    (fm.nearest_saddle, {"scene": SCENE, "state": STARTS[0]}, ("scene", "state")),
    (
        fm.erosion,
        {"scene": SCENE, "parameter": "F0", "values": [1.0], "axes": AXES, "most_shock": 1.0},
        ("scene", "parameter", "label_starts"),
    ),
    (fm.largest_lyapunov, {"scene": SCENE, "y0": STARTS, "t_end": 1.0}, ("scene",)),
    (fm.step_warning, {"scene": SCENE, "dt": 0.1, "method": "rk4"}, ("scene", "method")),
    (fm.find_snap, {"system": SCENE}, ("system", "parameter")),
    (fm.find_snap, {"system": TRUSS, "parameter": "P"}, ("system", "equilibrium", "searched", "parameter")),
    (
        fm.critical_values,
        {"mechanism": TRUSS, "parameter": "P", "values": [0.0, 1.0]},
        ("mechanism", "parameter", "values"),
    ),
    (fm.map_basins, {"scene": SYSTEM, "axes": GRID, "t_end": 1.0}, ("scene", "axes", "parameters")),
    (
        fm.track_edge,
        {"scene": SCENE, "inside": STARTS[0], "outside": STARTS[0], "t_end": 1.0},
        ("inside", "outside", "label_of"),
    ),
    (
        fm.frequency_response,
        {"system": SYSTEM, "parameter": "A", "between": (0.0, 1.0), "starts": REGION},
        ("system", "parameter", "between"),
    ),
    (
        fm.follow_basins,
        {"system": SYSTEM, "parameter": "A", "values": [0.0, 1.0], "starts": REGION},
        ("system", "parameter", "values", "each"),
    ),
    (fm.work_precision, {"scene": SYSTEM, "y0": STARTS[:, :2], "t_end": 1.0}, ("scene", "methods")),
    (fm.animate, {"system": SCENE, "run": None, "path": "film.gif"}, ("system", "run", "path")),
    (fm.report, {"system": SCENE, "path": "page.html"}, ("system", "tolerances")),
    (fm.disturb, {"scene": SCENE, "equilibrium": STABLE, "n": 8}, ("scene", "equilibrium", "part")),
]


@pytest.mark.nojit
@pytest.mark.parametrize(("function", "given", "names"), CALLS, ids=[call[0].__name__ for call in CALLS])
def test_arguments_of_a_wrong_kind(
    function: Callable[..., Any], given: dict[str, Any], names: tuple[str, ...]
) -> None:
    for name in names:
        by_default = inspect.signature(function).parameters[name].default
        for value in WRONG:
            if value is None and by_default is None:
                continue
            with pytest.raises(fm.InputError) as error:
                function(**{**given, name: value})
            assert len(str(error.value)) < 500
            assert str(error.value).isprintable()


CHAIN = fm.mechanisms.double_pendulum()
X = fm.lengths("x", -1.0, 1.0)
ROLLING = fm.Mechanism(X, kinetic=X.dot**2 / 2, potential=X**2 / 2)


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (
            lambda: fm.classify(SCENE, fm.find_equilibria(SCENE)),
            "equilibrium: is a list of 6: must be one of fm.find_equilibria(...), such as E[0]",
        ),
        (
            lambda: fm.find_snap(TRUSS, fm.find_equilibria(TRUSS), parameter="P"),
            "equilibrium: is a list of 3: must be one of fm.find_equilibria(...), such as E[0]",
        ),
        (
            lambda: fm.classify(SCENE, 0),
            "equilibrium = 0: must be one of fm.find_equilibria(...), such as E[0]",
        ),
        (
            lambda: fm.classify(CHAIN, fm.find_equilibria(TRUSS)[0]),
            f"equilibrium = {fm.find_equilibria(TRUSS)[0].position.tolist()}: is another mechanism's",
        ),
        (
            lambda: fm.erosion(TRUSS, "P", [0.0, 1.0], {"x": [-0.1, 0.1]}),
            "most_shock: missing; must be the largest shock to look for, greater than 0 "
            "[rad, or the last coordinate's unit]",
        ),
        (
            lambda: fm.erosion(SCENE, "F0", [0.0]),
            "axes: missing; must be names of states with their rising values, the map and its window",
        ),
        (
            lambda: fm.minimal_shock(TRUSS, fm.find_equilibria(TRUSS)[0]),
            "most: missing; must be the largest size to look at, a number greater than 0",
        ),
        (
            lambda: fm.brute_force_shock(TRUSS, most=1.0),
            "attractor: missing; must be a resting state, one of fm.find_equilibria(...), such as E[0], "
            "or an attractor",
        ),
        (
            lambda: fm.integrity(np.zeros(2), [[0.0, 1.0]], attractor=[0.0]),
            "label: missing; must be the basin's label, a whole number",
        ),
        (
            lambda: fm.shock_limit(TRUSS),
            "equilibrium: missing; must be one of fm.find_equilibria(...), such as E[0]",
        ),
        (
            lambda: fm.shock_limit(CHAIN, fm.find_equilibria(CHAIN)[0]),
            "on: missing; must be a point that moves: M1, M2",
        ),
        (
            lambda: fm.shock_limit(ROLLING, fm.find_equilibria(ROLLING)[0]),
            "on: no point of the mechanism moves; name one to strike, as points={'P': (x, y)}",
        ),
        (
            lambda: fm.impulse_start(CHAIN, fm.find_equilibria(CHAIN)[0], 1.0),
            "on: missing; must be a point that moves: M1, M2",
        ),
        (lambda: fm.classify(None, STABLE), "scene = None: must be a Scene or a Mechanism"),
        (lambda: fm.shock_limit(3, STABLE), "scene = 3: must be a Scene or a Mechanism"),
        (lambda: fm.map_equilibria(3, {"F0": [0.0, 1.0]}), "scene = 3: must be a Scene or a Mechanism"),
        (
            lambda: fm.map_equilibria(SCENE, {"phi": [0.0, 1.0]}),
            "axes.phi: is a coordinate or rate; axes are parameters: "
            "m1, m2, m3, l, c1, c2, beta, g, F0, alpha",
        ),
        (
            lambda: fm.map_equilibria(TRUSS, {"y_dot": [0.0, 1.0]}),
            f"axes.y_dot: is a coordinate or rate; axes are parameters: {', '.join(TRUSS.parameters)}",
        ),
        (lambda: fm.samplers.Sobol({"x": (0, 1)}, n="a"), "n = 'a': must be an integer not less than 1"),
        (
            lambda: fm.samplers.Grid({"x": (0, 1)}, {"x": 3}, n=0),
            "n = 0: must be an integer not less than 1",
        ),
    ],
)
def test_lines_name_what_was_written_and_what_would_do(call: Any, line: str) -> None:
    with pytest.raises(fm.InputError) as error:
        call()
    assert str(error.value) == line


@pytest.mark.parametrize(
    "search",
    [
        lambda scene: fm.find_attractors(scene, REGION),
        lambda scene: fm.periodic_orbits(scene, REGION),
        lambda scene: fm.group_by_features(scene, REGION, t_end=1.0),
        lambda scene: fm.frequency_response(scene, "F0", (0.0, 1.0), REGION),
        lambda scene: fm.follow_basins(scene, "F0", [0.0, 1.0], REGION),
    ],
)
def test_attractors_of_a_scene_are_those_of_its_mechanism(search: Any) -> None:
    ends = r"must be a System or a Mechanism; of a Scene give fm\.mechanisms\.slider_pendulum\(\)$"
    with pytest.raises(fm.InputError, match=ends):
        search(SCENE)


@pytest.mark.nojit
def test_integers_beyond_doubles() -> None:
    huge = 10**5000
    for call in (
        lambda: fm.step_warning(SCENE, huge, "rk4"),
        lambda: fm.step_warning(SCENE, 0.1, "rk4", [huge, 0, 0, 0]),
        lambda: fm.integrate(SCENE, STARTS, huge),
        lambda: fm.nearest_saddle(SCENE, [huge, 0, 0, 0]),
        lambda: fm.map_basins(SCENE, {**AXES, "phi": [0, huge]}),
        lambda: fm.reactions(SCENE, [huge, 0, 0, 0], 0.0),
    ):
        with pytest.raises(fm.InputError):
            call()


@pytest.mark.nojit
def test_names_of_other_libraries() -> None:
    with pytest.raises(fm.InputError, match=r"^rtol: is called tol here$"):
        fm.integrate(SCENE, STARTS, 1.0, rtol=1e-6)  # type: ignore[call-arg]
    with pytest.raises(fm.InputError, match=r"^t_start: is always 0: y0 are the states at t = 0$"):
        fm.integrate(SCENE, STARTS, 1.0, t_start=2.0)  # type: ignore[call-arg]
    with pytest.raises(
        fm.InputError, match=r"^bodies: belong in masses=\[fm.Body\(center, mass, inertia, ang"
    ):
        fm.Mechanism(fm.angles("q"), bodies=[])  # type: ignore[call-arg]
    with pytest.raises(fm.InputError, match=r"^tolerance: is called tol here$"):
        fm.integrate(SCENE, STARTS, 1.0, tolerance=1e-6)  # type: ignore[call-arg]
    for method, here in (("RK45", "dopri5"), ("RK4", "rk4"), ("DOP853", "dop853"), ("Radau", "radau5")):
        with pytest.raises(
            fm.InputError, match=rf"^method = '{method}': unknown; did you mean '{here}'\? known: "
        ):
            fm.integrate(SCENE, STARTS, 1.0, method=method)


def test_growth_beyond_doubles() -> None:
    saddle = next(e for e in fm.find_equilibria(SCENE) if e.morse_index == 1)
    with pytest.raises(fm.InputError, match=r"^until = 1e\+06 s: by then disturbances are beyond doubles$"):
        fm.transient_growth(SCENE, saddle, 1e6)


@pytest.mark.parametrize(
    "call",
    [
        lambda: fm.find_equilibria(None),
        lambda: fm.barrier_tree(None),
        lambda: fm.disturb(None, None),
        lambda: fm.disturbed_motion(None, None, np.zeros(4), [1.0]),
        lambda: fm.linear_range(None, None),
        lambda: fm.critical_forces(None, fm.Scene()),
        lambda: fm.Scene.from_toml(None),
        lambda: fm.open_results(10**5000),
        lambda: delattr(fm.Scene(), "m1"),
        lambda: fm.find_folds(fm.Scene(alpha=0.0), "F0", np.zeros(0)),
        lambda: fm.disturb(fm.Scene(alpha=0.0), fm.find_equilibria(fm.Scene(alpha=0.0))[0], 8, radius=1e6),
    ],
)
def test_what_is_none_at_all_is_told_in_one_line(call: Any) -> None:
    with pytest.raises(fm.InputError) as refusal:
        call()
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 200


def two_wells(t: float, x: float, r: float) -> float:
    return r + x - x * x * x


PAIR = (0.1, 0.4)
GRIDS: dict[str, Callable[[], Any]] = {
    "axes.phi": lambda: fm.map_basins(SCENE, {"phi": PAIR, "theta": [0.0, 0.1]}),
    "axes.c1": lambda: fm.map_equilibria(SCENE, {"c1": PAIR}),
    "axes.P": lambda: fm.map_equilibria(fm.mechanisms.von_mises_truss(), {"P": PAIR}),
    "axes.k": lambda: fm.critical_values(fm.mechanisms.von_mises_truss(), "k", PAIR),
    "F0": lambda: fm.map_snapping(SCENE, PAIR, [1.0]),
    "alpha": lambda: fm.map_snapping(SCENE, [1.0], PAIR),
    "values": lambda: fm.erosion(SCENE, "F0", PAIR, AXES, most_shock=1.0),
    "axes.theta": lambda: fm.erosion(SCENE, "F0", [1.0], AXES | {"theta": PAIR}, most_shock=1.0),
    "each.r": lambda: fm.follow_basins(
        fm.System(lambda t, x, r, s: s * two_wells(t, x, r), ["x"], {"r": 0.0, "s": 1.0}),
        "s", [1.0, 2.0], {"x": (-1.0, 1.0)}, each={"r": PAIR},
    ),
}  # fmt: skip


@pytest.mark.nojit
@pytest.mark.parametrize("name", GRIDS)
def test_a_range_is_no_grid(name: str) -> None:
    with pytest.raises(fm.InputError) as error:
        GRIDS[name]()
    assert str(error.value) == f"{name} = (0.1, 0.4): must be values; give np.linspace(0.1, 0.4, 101)"
