"""Scans of mechanisms that are not the paper's: shipped ones by name, one's own on the command line."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from click.testing import CliRunner
from devices import double_well
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fastmech as fm
from fastmech.cli import main
from fastmech.plots.disturbed import draw_disturbed
from fastmech.results import Variable
from fastmech.runner import draw_results, run_request
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import read_request

TRUSS = """
mechanism = "von_mises_truss"
[scene]
b = 2.0
P = 20.0
[scan.map]
kind = "basins"
t_end = 30.0
[scan.map.axes]
x = { start = -0.4, stop = 0.4, num = 9 }
y = { start = -1.0, stop = 1.0, num = 11 }
"""

OWN = """
import sympy
import fastmech as fm

def pendulum():
    q = fm.angles("q")
    place = (sympy.sin(q), -sympy.cos(q))
    damper = fm.TorsionDamper(q, 0.5)
    return fm.Mechanism(q, points={"M": place}, masses={"M": 1}, dampers=[damper], gravity=9.81, name="own")

number = 3
"""


def test_a_shipped_mechanism_by_name_gives_what_python_gives(tmp_path: Path) -> None:
    request, out = tmp_path / "truss.toml", tmp_path / "truss.h5"
    request.write_text(TRUSS)
    run_request(request, out)
    truss = fm.mechanisms.von_mises_truss().replace(b=2.0, P=20.0)
    axes = {"x": np.linspace(-0.4, 0.4, 9), "y": np.linspace(-1.0, 1.0, 11)}
    expected = fm.map_basins(truss, axes, 30.0)
    with fm.open_results(out) as results:
        assert results.scene == truss.parameters
        assert results.parameters["k"].units == "N/m"
        section = results["map"].load()
        np.testing.assert_array_equal(section["well"].data, expected.well)
        np.testing.assert_array_equal(section["capture_time"].data, expected.time)
        assert section.attrs["mechanism"] == "von_mises_truss"
        groups = results["map/equilibria"].load()
        np.testing.assert_array_equal(groups["equilibrium_y"].data, expected.tree.equilibria.position[:, 1])
        assert groups["equilibrium_y"].units == "m"
    pictures = list(draw_results(out, tmp_path / "pictures"))
    assert {p.name for p in pictures} == {"map_labels.png", "map_capture_time.png"}


def run(tmp_path: Path, text: str, name: str = "scan") -> fm.Results:
    request, out = tmp_path / f"{name}.toml", tmp_path / f"{name}.h5"
    request.write_text(text)
    run_request(request, out)
    return fm.open_results(out)


def words(variable: Variable) -> list[str]:
    known = {code: word for word, code in variable.codes.items()}
    return [known.get(int(code), "none") for code in variable.data.ravel()]


def test_equilibria_of_a_truss_are_those_of_its_closed_form(tmp_path: Path) -> None:
    text = 'mechanism = "von_mises_truss"\n[scene]\nb = 2.0\nP = {P}\n[scan.rest]\nkind = "equilibria"\n'
    with run(tmp_path, text.format(P=20.0), "loaded") as results:
        section = results["rest"].load()
    free, k, P = np.sqrt(1.25), 1000.0, 20.0

    def excess(y: float) -> float:  # of both bars' push over the load
        return 2.0 * k * y * (free / np.hypot(1.0, y) - 1.0) - P

    expected = [brentq(excess, *ends, xtol=1e-15) for ends in ((-0.9, -0.5), (0.4, 0.5), (0.0, 0.2))]
    np.testing.assert_allclose(section["y"].data, expected, rtol=1e-12)
    np.testing.assert_allclose(section["x"].data, 0.0, atol=1e-12)
    assert section["y"].units == "m"
    assert words(section["kind"]) == ["minimum", "minimum", "saddle"]
    assert words(section["verdict"]) == ["asymptotically_stable", "asymptotically_stable", "unstable"]
    assert section.attrs["outcome"] == "complete"
    with run(tmp_path, text.format(P=0.0), "free") as results:
        section = results["rest"].load()
    up = int(np.argmax(section["y"].data))
    across, along = 2.0 * k * np.array([0.25, 1.0]) / 1.25  # 2 k sin^2 a, 2 k cos^2 a with m = 1
    frequencies = [section[f"natural_frequency_{i}"].data[up] for i in (1, 2)]
    np.testing.assert_allclose(frequencies, np.sqrt([across, along]), rtol=1e-12)
    assert section["stiffness_y_y"].units == "N/m"
    np.testing.assert_allclose(section["stiffness_y_y"].data[up], across, rtol=1e-12)
    np.testing.assert_allclose(section["decay_time"].data[up], 1.0, rtol=1e-12)  # 2 m / b
    pictures = {p.name for p in draw_results(tmp_path / "loaded.h5", tmp_path)}
    assert pictures == {"rest_eigenvalues.png", "rest_positions.png"}


def test_map_of_a_truss_ends_at_its_snap_load(tmp_path: Path) -> None:
    text = """
mechanism = "von_mises_truss"
[scene]
b = 2.0
[scan.map]
kind = "equilibrium_map"
[scan.map.axes]
P = { start = 1.0, stop = 60.0, num = 60 }
rise = { start = 0.2, stop = 0.6, num = 5 }
"""
    with run(tmp_path, text) as results:
        section = results["map"].load()
        low = results["map"].select(P=10.0, rise=0.5)
    rise = section["rise"].data
    cosine = 1.0 / np.hypot(1.0, rise)
    snap = 2000.0 / cosine * (1.0 - cosine ** (2.0 / 3.0)) ** 1.5
    below = section["P"].data[:, None] < snap
    assert section["count"].data.tolist() == np.where(below, 3, 1).tolist()
    assert section["count_stable"].data.tolist() == np.where(below, 2, 1).tolist()
    assert (section["outcome"].data == section["outcome"].codes["complete"]).all()
    assert np.isnan(section["y"].data[~below][:, 1:]).all()
    assert np.isnan(section["eigenvalue_im_1"].data[~below][:, 1:]).all()
    assert low["y"].units == "m"
    assert np.isfinite(low["y"].data).sum() == 3
    drawn = {p.name for p in draw_results(tmp_path / "scan.h5", tmp_path)}
    assert drawn == {"map_count.png", "map_angles.png", "map_decay.png"}


def test_map_of_a_column_flutters_where_ziegler_says(tmp_path: Path) -> None:
    axes = "P = { start = 1.2, stop = 1.9, num = 36 }\nb = { values = [0.1, 0.5, 0.8] }\n"
    head = 'mechanism = "ziegler_column"\n[scan.map]\nkind = "equilibrium_map"\n[scan.map.axes]\n'
    with run(tmp_path, head + axes) as results:
        section = results["map"].load()
    limit = 41.0 / 28.0 + section["b"].data ** 2 / 2.0
    still = section["P"].data[:, None] < limit
    straight = (np.abs(section["lower"].data) < 1e-9) & (np.abs(section["upper"].data) < 1e-9)
    verdict = np.array(words(section["verdict"])).reshape(straight.shape)
    assert (straight.sum(axis=-1) == 1).all()
    expected = np.where(still, "asymptotically_stable", "unstable")
    np.testing.assert_array_equal(verdict[straight].reshape(still.shape), expected)
    assert (section["morse_index"].data == -1).all()  # a follower force has no potential
    assert {p.name for p in draw_results(tmp_path / "scan.h5", tmp_path)} >= {"map_count.png"}


@pytest.mark.filterwarnings("ignore:equilibrium. is a")
def test_disturbances_of_a_truss_are_those_of_python(tmp_path: Path) -> None:
    more = "trajectories = 64\nradius = 0.3\nt_end = 20.0\nlinear_directions = 4\n"
    text = TRUSS[: TRUSS.index("[scan.map]")] + f'[scan.shock]\nkind = "disturbed"\n{more}'
    with run(tmp_path, text) as results:
        section = results["shock"].load()
    truss = fm.mechanisms.von_mises_truss().replace(b=2.0, P=20.0)
    equilibria = fm.find_equilibria(truss)
    for k, equilibrium in enumerate(equilibria):
        found = fm.disturb(truss, equilibrium, 64, radius=0.3, t_end=20.0)
        np.testing.assert_array_equal(section["end_equilibrium"].data[k], found.end_index)
        np.testing.assert_array_equal(section["excursion_y"].data[k], found.excursion[:, 1])
    assert section["excursion_y"].units == section["start_x"].units == "m"
    assert section["start_x_dot"].units == "m/s"
    assert section.groups["linear"]["linear_limit"].units == "m"
    names = {p.name for p in draw_results(tmp_path / "scan.h5", tmp_path)}
    assert names == {f"shock_{n}.png" for n in ("outcomes", "time_to_return", "excursions", "linear_range")}


@pytest.mark.filterwarnings("ignore:equilibrium. is a")
def test_without_an_end_runs_end_as_those_of_python(tmp_path: Path) -> None:
    """At x = +-1, x'' = -2 x - b x': swings fall to 1/e in 2/b, runs end after 100 or 6 of these times."""
    for kind, b, until, more in (
        ("disturbed", 2.0, 100.0, "trajectories = 8\nlinear_directions = 1\n"),
        ("basins", 0.05, 240.0, "".join(f"axes.{x} = {{ values = [-1.0, 0.5] }}\n" for x in ("x", "x_dot"))),
    ):
        request, out = tmp_path / f"{kind}.toml", tmp_path / f"{kind}.h5"
        request.write_text(f'[scan.own]\nkind = "{kind}"\n{more}')
        run_request(request, out, mechanism=double_well(b=b))
        with fm.open_results(out) as results:
            assert results["own"].attrs["t_end"] == pytest.approx(until, rel=1e-9)
        assert draw_results(out, tmp_path)


@pytest.mark.filterwarnings("ignore:equilibrium. is a")
def test_what_leaves_its_range_is_no_possible_return_of_a_request_either(tmp_path: Path) -> None:
    """A start comes to x = 1.5 with the energy 1.5^4/4 - 1.5^2/2, of which there is enough in this ball."""
    mechanism = double_well(b=0.1, reach=1.5)
    text = '[scan.shock]\nkind = "disturbed"\ntrajectories = 200\nradius = 1.2\nt_end = 60.0\nvariables = '
    request, out = tmp_path / "shock.toml", tmp_path / "shock.h5"
    request.write_text(f'{text}["outcome"]\nlinear_directions = 1\n')
    run_request(request, out, mechanism=mechanism)
    with fm.open_results(out) as results:
        section = results["shock"].load()
    gone = 0
    for k, equilibrium in enumerate(fm.find_equilibria(mechanism)):
        found = fm.disturb(mechanism, equilibrium, 200, radius=1.2, t_end=60.0)
        own = [words(section["outcome"])[200 * k + i] for i in range(200)]
        ends = {end: own.count(end) for end in set(own)}
        known = sum(ends.get(end, 0) for end in ("returned", "elsewhere", "out_of_range"))
        most = (ends.get("returned", 0) + 200 - known) / 200
        shares = [section[f"share_returned{end}"].data[k] for end in ("", "_at_most", "_lower", "_upper")]
        told = found.returned
        assert shares[1] == pytest.approx(most, rel=1e-15)
        expected = told.fraction, told.at_most, told.lower, told.upper
        assert shares == [float(one) for one in expected]
        gone += ends.get("out_of_range", 0)
    assert gone > 10


def test_motion_of_a_cart_is_that_of_its_equations(tmp_path: Path) -> None:
    text = 'mechanism = "cart_pendulum"\n[scene]\nb = 6.0\nkt = 8.0\n[scan.swing]\nkind = "motion"\n'
    with run(tmp_path, text + "start = { x = 0.2, angle = 0.1 }\nt_end = 4.0\noutputs = 41\n") as results:
        section = results["swing"].load()

    def rates(t: float, state: list[float]) -> list[float]:  # M = 2, m = l = 1, k = 10
        x, angle, speed, turn = state
        sine, cosine = np.sin(angle), np.cos(angle)
        push = [-10.0 * x - 6.0 * speed + sine * turn**2, -8.0 * angle + 9.81 * sine]
        return [speed, turn, *np.linalg.solve([[3.0, cosine], [cosine, 1.0]], push)]

    times = section["time"].data
    expected = solve_ivp(rates, (0.0, 4.0), [0.2, 0.1, 0.0, 0.0], "DOP853", times, rtol=1e-12, atol=1e-13).y
    x, angle, speed, turn = expected
    for name, values in zip(("x", "angle", "x_dot", "angle_dot"), expected, strict=True):
        np.testing.assert_allclose(section[name].data, values, atol=1e-10)
        assert np.abs(section[f"formulation_difference_{name}"].data).max() < 1e-11
    kinetic = speed**2 + 0.5 * ((speed + np.cos(angle) * turn) ** 2 + (np.sin(angle) * turn) ** 2)
    potential = 5.0 * x**2 + 4.0 * angle**2 + 9.81 * np.cos(angle)
    np.testing.assert_allclose(section["kinetic_energy"].data, kinetic, atol=1e-9)
    np.testing.assert_allclose(np.diff(section["potential_energy"].data), np.diff(potential), atol=1e-9)
    np.testing.assert_allclose(section["power_lost"].data, 6.0 * speed**2, atol=1e-9)
    np.testing.assert_allclose(section["point_mass_x"].data, x + np.sin(angle), atol=1e-9)
    assert (section["x"].units, section["point_mass_y"].units, section["power_lost"].units) == ("m", "m", "W")
    assert 0.0 < section.attrs["error_estimate"] < 1e-10
    names = {p.name for p in draw_results(tmp_path / "scan.h5", tmp_path)}
    assert names == {f"swing_{n}.png" for n in ("angles", "coordinates", "energies", "residuals")}


@pytest.mark.slow
def test_a_motion_that_leaves_its_range_says_so(tmp_path: Path) -> None:
    """Without spring at the wall or pendulum's swing the cart goes x = 4 + 4 t, its range ends at 5 m."""
    text = 'mechanism = "cart_pendulum"\n[scene]\nk = 0.0\nkt = 0.0\n[scan.cart]\nkind = "motion"\n'
    with run(tmp_path, text + "start = { x = 4.0, x_dot = 4.0 }\nt_end = 1.0\noutputs = 11\n") as results:
        told = results["cart"].attrs["left_range"]
    assert told == "x is out of range, -5 to 5 m, at t = 0.3 s: what follows is not described"


@pytest.mark.parametrize(
    ("mechanism", "line", "told"),
    [
        ("cart_pendulum", "start = { y = 1.0 }", "start.y: unknown coordinate 'y'"),
        (None, "start = { x = 1.0 }", "start.x: unknown coordinate 'x'"),
    ],
)
def test_starts_of_motions_are_named_by_coordinates(
    tmp_path: Path, mechanism: str | None, line: str, told: str
) -> None:
    request = tmp_path / "scan.toml"
    head = f'mechanism = "{mechanism}"\n' if mechanism else ""
    request.write_text(f'{head}[scan.swing]\nkind = "motion"\n{line}\n')
    with pytest.raises(fm.InputError, match=told):
        read_request(request, scan_kinds())


@pytest.mark.parametrize("path", sorted(Path("scans/mechanisms").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_requests_are_valid(path: Path) -> None:
    request = read_request(path, scan_kinds())
    assert request.scene.name == path.stem


PAPER = """
{mechanism}
[scene]
F0 = -150.0
alpha = 0.0
c1 = 260.0
c2 = 60.0
[scan.erosion]
kind = "erosion"
along.F0 = {{ values = [-150.0, 60.0] }}
axes.phi = {{ start = -3.0, stop = 3.0, num = 9 }}
axes.theta_dot = {{ start = -3.0, stop = 3.0, num = 7 }}
starts = 24
directions = 4
[scan.moved]
kind = "disturbed_motion"
disturbance = {{ phi = 0.1, theta = 0.02, phi_dot = 0.1 }}
t_end = 1.0
outputs = 11
[scan.snap]
kind = "snap"
parameter = "c1"
searched = [1.0, 500.0]
"""


@pytest.mark.slow
def test_the_paper_s_mechanism_by_its_name_erodes_moves_and_snaps_as_the_scene_does(tmp_path: Path) -> None:
    sections = []
    for mechanism in ("", 'mechanism = "slider_pendulum"'):
        (tmp_path / "r.toml").write_text(PAPER.format(mechanism=mechanism))
        run_request(tmp_path / "r.toml", tmp_path / "r.h5", fresh=True)
        draw_results(tmp_path / "r.h5", tmp_path)
        with fm.open_results(tmp_path / "r.h5") as results:
            sections.append({name: results[name].load() for name in ("erosion", "moved", "snap")})
    for name, scene in sections[0].items():
        own = sections[1][name]
        assert {*own} == {*scene}
        for key in scene:
            variable = scene[key]
            assert own[key].units == variable.units
            if variable.data.dtype.kind == "f":
                np.testing.assert_allclose(own[key].data, variable.data, rtol=1e-7, atol=1e-9)
            elif variable.data.dtype.kind != "O":
                np.testing.assert_array_equal(own[key].data, variable.data)
    assert np.isfinite(sections[0]["erosion"]["well_shock"].data).any()
    assert np.isfinite(sections[0]["snap"]["snap_below"].data).any()


TRUSS_SCANS = """
mechanism = "von_mises_truss"
scene.b = 2.0
[scan.snap]
kind = "snap"
parameter = "P"
position = [0.0, 0.5]
[scan.erosion]
kind = "erosion"
along.P = { values = [0.0, 30.0] }
axes.y = { start = -1.0, stop = 1.0, num = 21 }
starts = 32
directions = 4
most_shock = 0.5
"""


def test_a_truss_snaps_at_its_closed_form_and_erodes_in_metres(tmp_path: Path) -> None:
    (tmp_path / "r.toml").write_text(TRUSS_SCANS)
    run_request(tmp_path / "r.toml", tmp_path / "r.h5")
    pictures = draw_results(tmp_path / "r.h5", tmp_path)
    assert [picture.name for picture in pictures] == ["erosion_profile.png"]
    with fm.open_results(tmp_path / "r.h5") as results:
        snap, erosion = results["snap"].load(), results["erosion"].load()
    length = np.hypot(1.0, 0.5)  # linear bars, no gravity, symmetric path: 2 k L0 (1 - cos^(2/3) a)^(3/2)
    load = 2.0 * 1000.0 * length * (1.0 - (1.0 / length) ** (2.0 / 3.0)) ** 1.5
    np.testing.assert_allclose(snap["snap_above"].data, [load], rtol=1e-9)
    assert erosion["well_shock"].units == erosion["position_y"].units == "m"
    # Without a load both wells are alike; under one the upper is the shallower.
    shock = erosion["well_shock"].data
    np.testing.assert_allclose(shock[0, 0], shock[0, 1], rtol=3e-3)
    assert shock[1, 1] < shock[0, 1] < shock[1, 0]


def test_ones_own_is_given_on_the_command_line(tmp_path: Path) -> None:
    device, request, out = tmp_path / "device.py", tmp_path / "scan.toml", tmp_path / "own.h5"
    device.write_text(OWN)
    axes = "q = { start = -3.0, stop = 3.0, num = 5 }\nq_dot = { start = -9.0, stop = 9.0, num = 7 }\n"
    request.write_text(f'[scan.map]\nkind = "basins"\nt_end = 60.0\n[scan.map.axes]\n{axes}')
    run = ["run", str(request), "--out", str(out), "--quiet"]
    found = CliRunner().invoke(main, [*run, "--mechanism", f"{device}:pendulum"])
    assert found.exit_code == 0, found.output
    with fm.open_results(out) as results:
        turns = results["map"].load()["turns_q"].data
        assert np.abs(turns).max() >= 1
        np.testing.assert_array_equal(turns, -turns[::-1, ::-1])
    again = ["run", "--from", str(out), "--out", str(tmp_path / "again.h5"), "--quiet"]
    wrong = CliRunner().invoke(main, again)
    assert wrong.exit_code == 2
    assert "which the file does not hold; give --mechanism FILE.py:NAME" in wrong.output
    assert not (tmp_path / "again.h5").exists()
    assert CliRunner().invoke(main, [*again, "--mechanism", f"{device}:pendulum"]).exit_code == 0
    with fm.open_results(tmp_path / "again.h5") as results:
        np.testing.assert_array_equal(turns, results["map"].load()["turns_q"].data)
    for name, told in (("number", "is no fastmech.Mechanism"), ("missing", "is no fastmech.Mechanism")):
        wrong = CliRunner().invoke(main, [*run, "--mechanism", f"{device}:{name}"])
        assert wrong.exit_code == 2
        assert told in wrong.output


def test_a_coordinate_with_the_name_of_a_variable_is_refused(tmp_path: Path) -> None:
    request = tmp_path / "scan.toml"
    axis = "= { start = -1, stop = 1, num = 3 }"
    axes = f"[scan.map.axes]\nwell {axis}\nwell_dot {axis}\n"
    request.write_text(f'[scan.map]\nkind = "basins"\n{axes}')
    well = fm.lengths("well", -2.0, 2.0)
    damper = fm.Damper("O", "M", 1, along=(1, 0))
    points = {"O": (0, 0), "M": (well, 0)}
    made = fm.Mechanism(well, points=points, masses={"M": 1}, potential=well**2, dampers=[damper])
    with pytest.raises(fm.InputError, match="mechanism: well is the name of a coordinate and of a variable"):
        read_request(request, scan_kinds(), mechanism=made)


def test_a_mechanism_goes_to_other_processes() -> None:
    truss = fm.mechanisms.von_mises_truss()
    _ = truss.derived, truss.energies(np.zeros(4))
    again = pickle.loads(pickle.dumps(truss))
    np.testing.assert_array_equal(
        again.accelerations(0.0, [0.1, 0.2, 0.0, 0.0]), truss.accelerations(0.0, [0.1, 0.2, 0.0, 0.0])
    )


def held_by_friction() -> fm.Mechanism:
    x, P = fm.lengths("x", -1.0, 1.0), sympy.Symbol("P")
    return fm.Mechanism(x, {"P": 0.0}, kinetic=x.dot**2, potential=x**2 - P * x, dissipation=abs(x.dot))


def shaken(amplitude: float = 0.3) -> fm.Mechanism:
    x, P, w = fm.lengths("x", -1.0, 1.0), *sympy.symbols("P w")
    energies = {"kinetic": x.dot**2, "potential": x**2, "dissipation": x.dot**2}
    force = fm.Force("M", fm.loads.Harmonic(P, w), (1, 0))
    return fm.Mechanism(x, {"P": amplitude, "w": 1.0}, **energies, points={"M": (x, 0)}, forces=[force])


BASINS = 'kind = "basins"\naxes.x_dot = { start = -1.0, stop = 1.0, num = 3 }\n'
EROSION = 'kind = "erosion"\nalong.P = { start = 0.0, stop = 0.5, num = 2 }\n'


@pytest.mark.parametrize(
    ("made", "kind", "told"),
    [
        (
            shaken,
            BASINS,
            r'^scan\.map\.kind: under loads that repeat .* take kind = "attractors", with these ax',
        ),
        (
            lambda: double_well(fm.loads.Function(math.sin)),
            BASINS,
            r"^scan\.map\.double_well: .* never fades",
        ),
        (held_by_friction, BASINS, r"^scan\.map\..* dry friction"),
        (held_by_friction, EROSION, r"^scan\.map\..* dry friction"),
        (held_by_friction, 'kind = "disturbed"\n', r"^scan\.map\..* dry friction"),
        (lambda: shaken(0.0), EROSION, r"^scan\.map\..* changes; nothing rests while it does"),
    ],
)
def test_what_has_no_labels_is_said_before_anything_runs(
    tmp_path: Path, made: Any, kind: str, told: str
) -> None:
    axes = "axes.x = { start = -1.0, stop = 1.0, num = 3 }\n" * ("disturbed" not in kind)
    request = tmp_path / "wrong.toml"
    request.write_text(f'[scan.rest]\nkind = "equilibria"\n[scan.map]\n{kind}{axes}')
    with pytest.raises(fm.InputError, match=told):
        read_request(request, scan_kinds(), mechanism=made())


def test_wells_that_are_not_certain_are_refused_before_any_tile(tmp_path: Path) -> None:
    axes = "".join(f"axes.{q} = {{ start = -1.0, stop = 1.0, num = 3 }}\n" for q in ("lower", "upper"))
    text = 'mechanism = "ziegler_column"\nscene.b = 1.0\n[scan.rest]\nkind = "equilibria"\n'
    with pytest.raises(
        fm.InputError, match=r"^scan\.map: ziegler_column: [^;]* come from a potential; [^;]*$"
    ):
        run(tmp_path, f'{text}[scan.map]\nkind = "basins"\n{axes}')
    assert not [*tmp_path.rglob("*.tile")]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("von_mises_truss", "von_mises_trus", "mechanism = 'von_mises_trus': unknown"),
        ("P = 20.0", "Q = 20.0", "parameters.Q: unknown name"),
        ("P = 20.0", 'P = "much"', "scene.P = 'much': must be a number"),
        ('kind = "basins"', 'kind = "snapping"', "is for the paper's mechanism alone; for mech"),
        ('kind = "basins"', 'kind = "snap"', "parameter: missing; must be one that moves equilibria: k,.*P"),
        ("x = {", "phi = {", "axes.phi: unknown coordinate 'phi'"),
        ("b = 2.0", "b = 0.0", "has no dampers"),
        (
            TRUSS[TRUSS.index('kind = "basins"') :],
            'kind = "disturbed"\naxes.b = { start = 1.0, stop = 2.0, num = 3 }\n',
            r"axes = \['b'\]: this kind has axes for .* of others give a value in",
        ),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_before_anything_runs(tmp_path: Path, old: str, new: str, told: str) -> None:
    text = TRUSS.replace(old, new)
    if "snap" in new:
        text = text[: text.index("t_end")]
    request = tmp_path / "wrong.toml"
    request.write_text(text)
    with pytest.raises(fm.InputError, match=told):
        read_request(request, scan_kinds())


@pytest.mark.filterwarnings("ignore:equilibrium. is a")
def test_a_request_has_the_sizes_of_disturbances_by_default(tmp_path: Path) -> None:
    """At -1, 0 and 1 m in a range that ends at 1.1 m: 0.1 m about the outer ones, 0.5 m about the other."""
    text = '[scan.shock]\nkind = "disturbed"\ntrajectories = 64\nt_end = 1.0\nlinear_directions = 1\n'
    (tmp_path / "shock.toml").write_text(text)
    run_request(tmp_path / "shock.toml", tmp_path / "shock.h5", mechanism=double_well(reach=1.1))
    with fm.open_results(tmp_path / "shock.h5") as results:
        section = results["shock"].load()
    sizes, places = section["disturbance_radius"], section["x"].data
    np.testing.assert_allclose(sizes.data, np.where(np.abs(places) > 0.5, 0.1, 0.5), rtol=1e-9)
    assert sizes.units == "m"
    assert np.abs(section["start_x"].data.ravel()).max() < 1.1
    told = draw_disturbed(section, {})["outcomes"].axes[0].get_title()
    assert "disturbances up to 0.1 or 0.5 m of each" in " ".join(told.split())
