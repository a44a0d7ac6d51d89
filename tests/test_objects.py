"""What public functions return: six lines, HTML, xarray with units, files, pictures in given axes."""

from __future__ import annotations

import copy
import inspect
import pickle
import pydoc
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

import fastmech as fm
from fastmech.objects import Drawn, Field, Printed, Result, counted

matplotlib.use("Agg")

SCENE = fm.Scene(F0=10.0, alpha=0.0, c1=300.0, c2=93.0)
FEW = {"x": [-1.0, 0.5, 1.0], "v": [0.0, 1.0]}
GRID = {"phi": np.linspace(-2.0, 2.0, 5), "theta": np.linspace(-1.0, 1.0, 4)}


def duffing() -> fm.System:
    """Two attractors, forced."""
    return fm.System(
        lambda t, x, v, amplitude, delta: (v, x - x * x * x - delta * v + amplitude * fm.cos(t)),
        ("x", "v"),
        {"amplitude": 0.05, "delta": 0.25},
        period=2.0 * np.pi,
    )


def stopping() -> fm.System:
    """It stops on either side."""
    return fm.System(
        lambda t, x, v: (v, x - 0.1 * v),
        ("x", "v"),
        {},
        stop=lambda t, x, v: 1 if x > 2.0 else 2 if x < -2.0 else 0,
    )


def sides(y: Any) -> Any:
    """Which side of the edge states are on."""
    return (np.atleast_2d(y)[:, 0] > 0.0).astype(int)


def stable(system: Any) -> Any:
    """Its deepest equilibrium."""
    return fm.find_equilibria(system)[0]


#: Cheap calls of public functions whose results are objects.
CALLS: dict[str, Callable[[], Any]] = {
    "find_equilibria": lambda: fm.find_equilibria(SCENE),
    "find_equilibria, mechanism": lambda: fm.find_equilibria(fm.mechanisms.von_mises_truss()),
    "one equilibrium": lambda: stable(SCENE),
    "one resting place": lambda: stable(fm.mechanisms.von_mises_truss()),
    "classify": lambda: fm.classify(SCENE, stable(SCENE)),
    "classify, mechanism": lambda: fm.classify(m := fm.mechanisms.von_mises_truss(), stable(m)),
    "integrate": lambda: fm.integrate(SCENE, np.zeros((3, 4)), 1.0, 0.01),
    "integrate to tol": lambda: fm.integrate(SCENE, np.full((3, 4), 0.1), 1.0, tol=1e-4, t_eval=[0.5, 1.0]),
    "integrate, system": lambda: fm.integrate(duffing(), np.ones((2, 2)), 1.0, 0.01),
    "disturb": lambda: fm.disturb(SCENE, stable(SCENE), 16, t_end=20.0),
    "disturbed_motion": lambda: fm.disturbed_motion(SCENE, stable(SCENE), [0.1, 0, 0, 0], [0.5, 1.0, 2.0]),
    "linear_range": lambda: fm.linear_range(SCENE, stable(SCENE), directions=4),
    "map_basins": lambda: fm.map_basins(SCENE, GRID, 10.0),
    "map_basins, stop codes": lambda: fm.map_basins(stopping(), FEW, 20.0, dt=0.05),
    "map_basins, attractors": lambda: fm.map_basins(duffing(), FEW),
    "label_starts": lambda: fm.label_starts(SCENE, np.zeros((3, 4)), 10.0),
    "map_equilibria": lambda: fm.map_equilibria(SCENE, {"F0": np.linspace(-20, 20, 4), "c1": [200.0, 300.0]}),
    "map_equilibria, one axis": lambda: fm.map_equilibria(SCENE, {"c1": np.linspace(200.0, 300.0, 7)}),
    "map_equilibria, mechanism": lambda: fm.map_equilibria(
        fm.mechanisms.von_mises_truss(), {"P": np.linspace(-5.0, 5.0, 5)}
    ),
    "find_folds": lambda: fm.find_folds(SCENE, "c1", [100.0, 400.0]),
    "trace_folds": lambda: fm.trace_folds(SCENE, ("c1", [150.0, 350.0]), ("F0", [0.0, 200.0])),
    "trace_undamped": lambda: fm.trace_undamped(
        SCENE, ("c1", np.linspace(250, 300, 4)), ("F0", np.linspace(1, 200, 4))
    ),
    "find_snap": lambda: fm.find_snap(SCENE, stable(SCENE)),
    "critical_values": lambda: fm.critical_values(
        fm.mechanisms.von_mises_truss(), "P", np.linspace(-900.0, 900.0, 7)
    ),
    "critical_curves": lambda: fm.critical_curves(
        fm.mechanisms.von_mises_truss(), ("P", np.linspace(-900, 900, 5)), ("k", [800.0, 1200.0])
    ),
    "erosion": lambda: fm.erosion(
        SCENE, "F0", [0.0, 10.0], GRID, most_shock=1.0, t_end=20.0, n=8, directions=4
    ),
    "map_snapping": lambda: fm.map_snapping(SCENE.replace(alpha=1.0), [50.0, 100.0], [1.0, 2.0], t_end=20.0),
    "shock_limit": lambda: fm.shock_limit(SCENE, stable(SCENE), "M2", 0.0, t_end=20.0),
    "trapped": lambda: fm.trapped(SCENE, np.array([[*stable(SCENE).position, 0.0, 0.0], [0.0] * 4])),
    "barrier_tree": lambda: fm.barrier_tree(SCENE),
    "basin_fractions": lambda: fm.basin_fractions([0, 0, 1, -1])[1],
    "basin_stability": lambda: fm.basin_stability([0, 0, 1, -1], 0),
    "basin_entropy": lambda: fm.basin_entropy(np.indices((20, 20)).sum(0) // 7 % 3),
    "integrity": lambda: fm.integrity(np.zeros((9, 9), int), [np.arange(9.0)] * 2, 0, [4.0, 4.0], np.eye(2)),
    "largest_lyapunov": lambda: fm.largest_lyapunov(SCENE, [0.1, 0.2, 0.0, 0.0], 2.0),
    "transient_growth": lambda: fm.transient_growth(SCENE, stable(SCENE)),
    "find_attractors": lambda: fm.find_attractors(duffing(), {"x": (-1.5, 1.5), "v": (-1.0, 1.0)}, 32),
    "frequency_response": lambda: fm.frequency_response(
        duffing(), "amplitude", (0.01, 0.06), {"x": (-1.5, 1.5), "v": (-1.0, 1.0)}
    ),
    "follow_basins": lambda: fm.follow_basins(
        duffing(), "amplitude", [0.02, 0.04], {"x": (-1.5, 1.5), "v": (-1.0, 1.0)}, 32
    ),
    "follow_basins, two parameters": lambda: fm.follow_basins(
        duffing(), "amplitude", [0.02, 0.04], {"x": (-1.5, 1.5)}, 16, each={"delta": [0.2, 0.3]}
    ),
    "periodic_orbits": lambda: fm.periodic_orbits(duffing(), {"x": (-1.5, 1.5), "v": (-1.0, 1.0)}, 8),
    "minimal_shock": lambda: fm.minimal_shock(
        lambda y: (y[:, 0] > 1.0).astype(int), [0.0, 0.0], np.eye(2), most=3.0, directions=8
    ),
    "track_edge": lambda: fm.track_edge(
        duffing(), [1.0, 0.0], [-1.0, 0.0], sides, np.eye(2), t_end=1.0, dt=0.1
    ),
    "wada_merge_test": lambda: fm.wada_merge_test(np.indices((30, 30)).sum(0) // 20),
    "fractal_boundary_test": lambda: fm.fractal_boundary_test(np.indices((40, 40)).sum(0) // 40, balls=50),
    "boundary_dimension": lambda: fm.boundary_dimension(np.indices((64, 64)).sum(0) // 64),
    "uncertainty_exponent": lambda: fm.uncertainty_exponent(
        sides, [-1.0, -1.0], [1.0, 1.0], np.geomspace(0.01, 0.3, 6), n=256
    ),
    "reactions": lambda: fm.reactions(SCENE, np.full((9, 4), 0.1), 0.0),
    "energies": lambda: fm.mechanisms.von_mises_truss().energies([0.1, 0.2, 0.0, 0.0]),
    "system": duffing,
    "mechanism": fm.mechanisms.von_mises_truss,
    "work_precision": lambda: fm.work_precision(
        SCENE, np.full((4, 4), 0.1), 1.0, errors=(1e-3,), methods=("rk4",)
    ),
}  # fmt: skip

#: Public functions that give plain arrays, numbers, functions, open files or another library's objects; those
#: whose results are of a class that is walked; and one that needs a further library.
PLAIN = {
    "angles", "animate", "cos", "critical_forces", "impulse_start", "kinetic_norm", "largest_stable_step",
    "lengths", "memory",
    "nearest_saddle", "number_turns", "open_results", "report",
    "sin", "step_warning", "system_info",
    "tipping_probabilities", "well_numbers", "well_of_number", "wilson",
    "brute_force_shock", "finite_time_basin_stability", "group_by_features",
}  # fmt: skip

found: dict[str, Any] = {}


class Numbers(Printed):
    """Some numbers and texts."""

    FIELDS = {"few": Field("x", "m", "few"), "many": Field("x", "1", "many"), "why": Field("", "1", "why")}
    few, many, why = np.array([0.25, 0.75]), np.arange(7.0), ""


def test_short_arrays_print_their_values_and_empty_texts_nothing() -> None:
    assert repr(Numbers()) == "numbers: few: 0.25, 0.75 m; many: from 0 to 6, 7 values"


@pytest.mark.parametrize(
    ("number", "noun", "told"),
    [(1, "cusp", "1 cusp"), (0, "cusp", "0 cusps"), (1, "trajectory", "1 trajectory"),
     (2, "trajectory", "2 trajectories"), (1200, "branch", "1,200 branches")],
)  # fmt: skip
def test_one_of_a_kind_is_singular(number: int, noun: str, told: str) -> None:
    assert counted(number, noun) == told


def test_forces_and_energies_print_with_units_and_are_tuples() -> None:
    truss = fm.mechanisms.von_mises_truss()
    rest = [*stable(truss).position, 0.0, 0.0]
    kinetic, potential = truss.energies(rest)
    assert repr(truss.energies(rest)) == f"energies: kinetic: 0 J; potential: {potential:.6g} J"
    assert kinetic == 0.0
    forces = fm.reactions(SCENE, [0.1, 0.2, 0.0, 0.0], 0.0)
    assert f"pull in rod O-M1: {forces[0]:.6g} N; in M1-M2: {forces.rod_m1m2:.6g} N;" in repr(forces)


def test_measures_say_in_words_what_they_found() -> None:
    # Wilson: (2 + z^2/2 - z sqrt(1 + z^2/4))/(4 + z^2) and (3 + z^2/2 + z sqrt(3/4 + z^2/4))/(4 + z^2).
    share = "share of 4 starts: 50.0% (15.0% to 95.4%); no label: 1 of 4"
    assert repr(fm.basin_stability([0, 0, 1, -1], 0)) == share
    whole = fm.integrity(np.zeros((9, 9), int), [np.arange(9.0)] * 2, 0, [4.0, 4.0], np.eye(2))
    assert "radius 4, up to the map's edge, about the attractor (LIM)" in repr(whole)
    still = fm.transient_growth(SCENE, stable(SCENE))
    assert repr(still) == "small disturbances do not grow within 10 s, in the energy norm"
    assert repr(fm.basin_entropy(np.zeros((20, 20), int))).endswith("no box holds more than one label")
    assert repr(fm.boundary_dimension(np.zeros((64, 64), int))) == "the map has no boundary"
    line = repr(fm.boundary_dimension(np.indices((128, 128)).sum(0) // 128))
    assert line.startswith("boundary of dimension 1.0")
    assert line.endswith("it is smooth, within that error")
    track = fm.track_edge(duffing(), [1.0, 0.0], [-1.0, 0.0], sides, np.eye(2), t_end=1.0, dt=0.1)
    assert re.match(r"the boundary (rests|was lost|has not come to rest).*\n  x = .*, v = ", repr(track))


@pytest.mark.parametrize("part", ["loads", "mechanisms", "samplers"])
def test_dir_of_a_part_holds_what_users_call_alone(part: str) -> None:
    module = getattr(fm, part)
    own = f"fastmech.{part}"
    assert dir(module)
    assert all(getattr(module, name).__module__.startswith(own) for name in dir(module))


def test_this_installation_prints_one_fact_a_line() -> None:
    from click.testing import CliRunner

    from fastmech.cli import main

    facts = fm.system_info()
    assert [line.split("  ")[0] for line in repr(facts).splitlines()] == [*facts]
    assert CliRunner().invoke(main, ["info", "--system"]).output == f"{facts!r}\n"


def test_every_public_function_is_walked() -> None:
    functions = {name for name in fm.__all__ if not isinstance(getattr(fm, name), type)}
    assert functions == {name.partition(",")[0] for name in CALLS} & functions | PLAIN


def test_dir_holds_public_names_and_the_docstring_groups_them() -> None:
    assert dir(fm) == sorted([*fm.__all__, "loads", "mechanisms", "samplers", "__version__"])
    told = set(re.findall(r"\w+", str(fm.__doc__)))
    assert set(fm.__all__) <= told


def test_help_on_a_scene_shows_parameters_and_hides_how_they_are_checked() -> None:
    page = pydoc.render_doc(fm.Scene, renderer=pydoc.plaintext)
    assert len(page.splitlines()) < 120
    assert "pydantic" not in page
    assert not [name for name in dir(fm.Scene) if name.startswith(("model_", "__pydantic"))]
    for name, (value, unit, about) in fm.Scene(c1=300.0).described().items():
        assert f"{name} = {value:g} {unit}: {about}" in repr(fm.Scene(c1=300.0))
        assert about in page
    assert str(inspect.signature(fm.Scene)).startswith("(*, m1: float = 10.0")


@pytest.mark.parametrize(
    ("element", "units"),
    [
        (fm.Body, {"mass": "kg", "inertia": "kg m2", "angle": "rad"}),
        (fm.Spring, {"stiffness": "N/m", "free_length": "m"}),
        (fm.TorsionSpring, {"angle": "rad", "stiffness": "N m/rad", "free_angle": "rad"}),
        (fm.Damper, {"coefficient": "N s/m"}),
        (fm.TorsionDamper, {"angle": "rad", "coefficient": "N m s/rad"}),
        (fm.Force, {"load": "N"}),
        (fm.Torque, {"angle": "rad", "load": "N m"}),
    ],
)
def test_help_on_an_element_tells_what_it_takes_with_units(element: Any, units: dict[str, str]) -> None:
    about = " ".join(str(inspect.getdoc(element)).split())
    assert all(f"``{name}``" in about for name in inspect.signature(element).parameters)
    for name, unit in units.items():
        assert re.search(rf"``{name}``[^;.]*\[{re.escape(unit)}\]", about), name
    assert "tuple" not in pydoc.render_doc(element, renderer=pydoc.plaintext)


def test_dir_and_help_show_what_is_for_users() -> None:
    shown = dir(stable(SCENE))
    assert {"phi", "theta", "position", "energy", "kind"} <= {*shown}
    assert not {"FIELDS", "told", "value_of"} & {*shown}
    assert "engine" not in pydoc.render_doc(fm.Scene, renderer=pydoc.plaintext)
    shares = fm.basin_fractions([0, 0, 2, -1])
    assert shares.labels.tolist() == [0, 2]
    assert shares.shares.fraction.tolist() == [0.5, 0.25]


def test_captured_states_are_told_by_their_wells() -> None:
    rest = [*stable(SCENE).position, 0.0, 0.0]
    found = fm.trapped(SCENE, np.array([rest, rest, [0.0, 0.0, 90.0, 90.0]]))
    well = next(k for k, e in enumerate(fm.find_equilibria(SCENE)) if e.kind == "minimum")
    assert repr(found) == f"3 states, of which belong for good to: 2 well {well}"


def test_scenes_are_values() -> None:
    scene = fm.Scene(c1=300.0)
    assert pickle.loads(pickle.dumps(scene)) == copy.deepcopy(scene) == scene
    assert eval(repr(scene).splitlines()[0], {"Scene": fm.Scene}) == scene
    assert len({scene, fm.Scene(c1=300.0), fm.Scene()}) == 2


@pytest.fixture(params=CALLS)
def result(request: pytest.FixtureRequest) -> Any:
    """What a call gives, computed once."""
    if request.param not in found:
        found[request.param] = CALLS[request.param]()
    return found[request.param]


def test_it_prints_in_six_lines(result: Any) -> None:
    lines = repr(result).splitlines()
    assert 1 <= len(lines) <= 6, repr(result)
    assert max(map(len, lines)) <= 110, repr(result)
    assert not re.search(r"array\(|float64|::|: (True|False|None)\b", repr(result)), repr(result)
    assert "object at" not in repr(result)


def test_notebooks_show_the_same(result: Printed) -> None:
    html = result._repr_html_()
    assert html.startswith("<div>")
    assert (
        repr(result).splitlines()[0].replace("<", "&lt;").replace(">", "&gt;").replace("'", "&#x27;")[:20]
        in html
    )


def test_xarray_has_a_unit_on_every_variable_and_files_give_equal_numbers(
    result: Any, tmp_path: Path
) -> None:
    if not isinstance(result, Result):
        return
    dataset = result.to_xarray()
    assert dataset.variables
    for name, variable in dataset.variables.items():
        assert variable.attrs["units"], name
        assert variable.attrs["long_name"], name
    result.save(tmp_path / "kept.h5")
    with fm.open_results(tmp_path / "kept.h5") as kept:
        (section,) = kept.sections
        stored = kept[section].load()
        if result.system is not None:
            assert kept.scene == {n: v for n, (v, *_) in result.system.described().items()}
    for name, variable in stored.merged.variables.items():
        np.testing.assert_array_equal(variable.data, dataset[name].values, err_msg=name)
        assert variable.units == dataset[name].attrs["units"]
    with pytest.raises(fm.InputError, match="exists already"):
        result.save(tmp_path / "kept.h5")
    with pytest.raises(fm.InputError, match=r"kept\.csv: a result file is HDF5: must end in \.h5"):
        result.save(tmp_path / "kept.csv")
    with pytest.raises(fm.InputError, match=r"there is no folder .*missing"):
        result.save(tmp_path / "missing" / "kept.h5")
    assert [file.name for file in tmp_path.iterdir()] == ["kept.h5"]
    result.save(tmp_path / "kept.h5", replace=True)


def test_it_draws_into_the_axes_that_it_is_given(result: Any) -> None:
    if not isinstance(result, Drawn):
        return
    with matplotlib.rc_context({"font.size": 17.0, "axes.facecolor": "#eeeeff", "axes.grid": True}):
        before = dict(matplotlib.rcParams)
        figure = Figure(figsize=(12.0, 8.0), layout="constrained")
        left, right = figure.subplots(1, 2)
        assert result.plot(ax=right) is right
        assert dict(matplotlib.rcParams) == before
        assert right.has_data()
        assert not left.has_data()
        assert matplotlib.colors.same_color(right.get_facecolor(), "#eeeeff")
        assert right.xaxis.label.get_fontsize() == 17.0
        assert right.get_xlabel() or right.get_ylabel()
        figure.canvas.draw()
    with pytest.raises(fm.InputError, match="must be the axes"):
        result.plot(ax=3)


def test_a_legend_stays_in_axes_without_room_below_or_has_too_many_entries() -> None:
    figure = Figure(figsize=(9.0, 9.0))
    left, right = figure.subplots(2, 2)[0]
    fm.find_equilibria(SCENE).plot(left)
    fm.map_basins(SCENE, GRID, 10.0).plot(right)
    assert left.get_window_extent().containsy(left.get_legend().get_window_extent().y0)
    shown = right.get_legend()
    assert shown is None or len(shown.get_texts()) <= 6


def test_without_axes_it_makes_a_figure_of_its_own() -> None:
    from matplotlib import pyplot

    ax = fm.find_equilibria(SCENE).plot()
    assert pyplot.gcf() is ax.figure
    pyplot.close(ax.figure)


def test_what_it_saves_is_drawn_where_it_draws_itself(result: Any, tmp_path: Path) -> None:
    """With the same lines where the picture is of the object's own kind; a line tells what is not drawn."""
    from fastmech.plots.objects import SAVED, UNDRAWN, draw_saved
    from fastmech.runner import draw_results

    if not isinstance(result, Result):
        return
    result.save(tmp_path / "kept.nc")
    lines: list[str] = []
    pictures = list(draw_results(tmp_path / "kept.nc", tell=lines.append))
    assert bool(pictures) is isinstance(result, Drawn)
    assert all(picture.stat().st_size > 5000 for picture in pictures)
    assert (len(lines) == 1) is (result.KIND in UNDRAWN), lines
    if result.KIND in SAVED:
        assert [picture.name for picture in pictures] == [f"{result.KIND}_plot.png"]
        with fm.open_results(tmp_path / "kept.nc") as kept:
            figure = draw_saved(kept[result.KIND].load(), kept.scene)["plot"]
        own, again = result.plot(Figure(layout="constrained").subplots()), figure.axes[0]
        for here, there in zip(own.figure.axes, figure.axes, strict=True):
            assert here.get_ylabel() == there.get_ylabel()
            for one, other in zip(here.lines, there.lines, strict=True):
                np.testing.assert_array_equal(one.get_xydata(), other.get_xydata())
        assert own.get_xlabel() == again.get_xlabel()
        legends = [one.get_legend() for one in (own, again)]
        entries = [[text.get_text() for text in one.get_texts()] if one else None for one in legends]
        assert entries[0] == entries[1]


def test_less_than_is_drawn_is_refused_in_a_line() -> None:
    from fastmech.plots.objects import draw_saved

    made = CALLS["disturb"]().dataset()
    older = replace(made, attrs={name: told for name, told in made.attrs.items() if name != "heading"})
    with pytest.raises(fm.InputError, match=r"^disturbances: lacks 'heading', as older versions saved it"):
        draw_saved(older, SCENE.parameters)


def test_files_of_objects_are_drawn_as_scans_are(tmp_path: Path) -> None:
    from fastmech.runner import draw_results

    fm.map_basins(SCENE, GRID, 10.0).save(tmp_path / "map.h5")
    assert next(draw_results(tmp_path / "map.h5")).name == "basins_labels.png"


def test_attractors_are_drawn_as_motions_over_a_period_within_what_starts_reach() -> None:
    """x'' + x' + 4 x = cos 2t comes to x = sin(2t)/2, v = cos 2t from wherever it starts."""
    system = fm.System(lambda t, x, v: (v, -v - 4.0 * x + fm.cos(2.0 * t)), ["x", "v"], {}, period=np.pi)
    axes = fm.find_attractors(system, {"x": (-3.0, 3.0), "v": (-2.0, 2.0)}, 16).plot(Figure().subplots())
    (path,) = [np.transpose(line.get_data()) for line in axes.lines if len(line.get_xdata()) > 100]
    np.testing.assert_allclose(4.0 * path[:, 0] ** 2 + path[:, 1] ** 2, 1.0, atol=1e-6)
    low, high = axes.get_xlim()
    assert low < -2.0
    assert high > 2.0


def test_a_run_without_outputs_says_how_to_get_some() -> None:
    run = fm.integrate(SCENE, [0.1, 0.2, 0.0, 0.0], 1.0)
    assert "give t_eval" in run.plot(Figure().subplots()).get_title()
    more = fm.integrate(SCENE, [0.1, 0.2, 0.0, 0.0], t_eval=[0.0, 0.5, 1.0])
    assert "t_eval" not in more.plot(Figure().subplots()).get_title()


def test_a_few_motions_are_told_apart_and_numbered() -> None:
    """Dashes are the motion's, colours the state's; of seven all lines of a state look alike."""
    few, many = (
        fm.integrate(duffing(), np.ones((n, 2)) * np.arange(n)[:, None], t_eval=[0.0, 0.5, 1.0])
        for n in (6, 7)
    )
    axes = few.plot(Figure().subplots())
    drawn = [line for line in axes.lines if len(line.get_xdata())]
    assert (
        len({(line.get_color(), line._dash_pattern[1] and tuple(line._dash_pattern[1])) for line in drawn})
        == 12
    )
    told = [text.get_text() for text in axes.get_legend().get_texts()]
    assert told == ["x", "v", *(f"motion {k}" for k in range(6))]
    assert axes.get_title().startswith("6 motions\n")
    other = many.plot(Figure().subplots())
    assert [text.get_text() for text in other.get_legend().get_texts()] == ["x", "v"]


@pytest.mark.parametrize("own", [False, True], ids=["motion", "disturbed"])
def test_coordinates_of_two_units_have_an_ordinate_each(own: bool) -> None:
    cart = fm.mechanisms.cart_pendulum()
    times, start = np.linspace(0.0, 1.0, 11), [[0.1, 0.2, 0.0, 0.0]]
    if own:
        motion = fm.disturbed_motion(cart, fm.find_equilibria(cart)[0], start, times)
        states = motion.nonlinear
    else:
        motion = fm.integrate(cart, start, t_eval=times)
        states = motion.y
    axes = motion.plot(Figure(layout="constrained").subplots())
    ordinates = axes.figure.axes
    assert [one.get_ylabel().rpartition(" ")[2] for one in ordinates] == ["[m]", "[rad]"]
    for k, one in enumerate(ordinates):
        np.testing.assert_array_equal(one.lines[0].get_ydata(), states[:, 0, k])
        assert len(one.lines) == (3 - k if own else 1)  # the linearized ones too, and what dashes mean
    told = [text.get_text().partition(" ")[0] for text in axes.get_legend().get_texts()]
    assert sorted(told) == sorted(["x", "angle", *["linearized"] * own])
