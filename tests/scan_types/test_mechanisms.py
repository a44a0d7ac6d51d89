"""Scans of mechanisms that are not the paper's: shipped ones by name, one's own on the command line."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import fastmech as fm
from fastmech.cli import main
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


@pytest.mark.parametrize("path", sorted(Path("scans/mechanisms").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_requests_are_valid(path: Path) -> None:
    request = read_request(path, scan_kinds())
    assert request.scene.name == path.stem


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


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("von_mises_truss", "von_mises_trus", "mechanism = 'von_mises_trus': unknown"),
        ("P = 20.0", "Q = 20.0", "parameters.Q: unknown name"),
        ("P = 20.0", 'P = "much"', "scene.P = 'much': must be a number"),
        ('kind = "basins"', 'kind = "snap"', "is for the paper's mechanism"),
        ("x = {", "phi = {", "axes.phi: unknown coordinate 'phi'"),
        ("b = 2.0", "b = 0.0", "has no dampers"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_before_anything_runs(tmp_path: Path, old: str, new: str, told: str) -> None:
    text = TRUSS.replace(old, new)
    if "snap" in new:
        text = text[: text.index("t_end")] + 'parameter = "F0"\n'
    request = tmp_path / "wrong.toml"
    request.write_text(text)
    with pytest.raises(fm.InputError, match=told):
        read_request(request, scan_kinds())
