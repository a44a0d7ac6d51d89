"""Scans of attractors: the same numbers as from Python, whatever the division into tiles and workers."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import fastmech as fm
from fastmech.cli import main
from fastmech.runner import draw_results, run_request
from fastmech.scan_types import attractors, scan_kinds
from fastmech.scan_types.request import read_request

OWN = """
import math
import fastmech as fm

def duffing(t, x, x_dot, delta, A):
    return x_dot, -delta * x_dot - x * x * x + A * fm.cos(t)

system = fm.System(duffing, ["x", "x_dot"], {"delta": 0.08, "A": 0.2}, period=2.0 * math.pi)
"""

RANGES = "ranges = { x = [-1.0, 1.0], x_dot = [-0.5, 1.0] }\n"


def duffing(t: float, x: float, x_dot: float, delta: float, A: float) -> tuple[float, float]:
    return x_dot, -delta * x_dot - x * x * x + A * fm.cos(t)


SYSTEM = fm.System(duffing, ["x", "x_dot"], {"delta": 0.08, "A": 0.2}, period=2.0 * math.pi)
REGION = {"x": (-1.0, 1.0), "x_dot": (-0.5, 1.0)}


def run(tmp_path: Path, scan: str, system: fm.System = SYSTEM, name: str = "scan") -> fm.Results:
    request, out = tmp_path / f"{name}.toml", tmp_path / f"{name}.h5"
    request.write_text(f"[scan.it]\n{scan}")
    run_request(request, out, mechanism=system)
    return fm.open_results(out)


def test_random_starts_have_the_labels_that_python_gives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(attractors, "TILE_STARTS", 300)
    expected = fm.find_attractors(SYSTEM, REGION, 1000)
    with run(tmp_path, f'kind = "attractors"\nn = 1000\n{RANGES}') as results:
        section, table = results["it"].load(), results["it/attractors"].load()
    np.testing.assert_array_equal(section["label"].data, expected.label)
    np.testing.assert_array_equal(section["time"].data, expected.time)
    np.testing.assert_allclose(table["share"].data, expected.fractions)
    np.testing.assert_array_equal(table["forcing_periods"].data, [a.forcing_periods for a in expected])
    assert section.attrs["captured"] == 1000
    assert section.attrs["system"] == "duffing"
    assert {p.name for p in draw_results(tmp_path / "scan.h5")} == {"it_shares.png"}


def test_a_grid_has_them_in_their_places(tmp_path: Path) -> None:
    axes = {"x": np.linspace(-1.0, 1.0, 21), "x_dot": np.linspace(-0.5, 1.0, 16)}
    text = (
        "axes.x = { start = -1.0, stop = 1.0, num = 21 }\naxes.x_dot = { start = -0.5, stop = 1.0, num = 16 }"
    )
    expected = fm.map_basins(SYSTEM, axes)
    with run(tmp_path, f'kind = "attractors"\n{text}\n') as results:
        section, table = results["it"].load(), results["it/attractors"].load()
    first = np.array([one.points[0] for one in expected.tree])
    own = np.stack([table["place_x"].data, table["place_x_dot"].data], axis=1)
    order = [int(np.abs(own - place).max(axis=1).argmin()) for place in first]
    np.testing.assert_array_equal(section["label"].data, np.array(order)[expected.well])
    assert {p.name for p in draw_results(tmp_path / "scan.h5")} == {"it_shares.png", "it_labels.png"}


@pytest.mark.slow
def test_attractors_are_followed_over_two_parameters(tmp_path: Path) -> None:
    text = "n = 20\nalong.A = { values = [0.17, 0.18, 0.19] }\neach.delta = { values = [0.08, 0.16] }\n"
    with run(tmp_path, f'kind = "follow_basins"\n{text}{RANGES}') as results:
        section, tipping = results["it"].load(), results["it/tipping"].load()
    each = {"delta": [0.08, 0.16]}
    expected = fm.follow_basins(SYSTEM, "A", [0.17, 0.18, 0.19], REGION, 20, each=each)
    assert isinstance(expected, fm.BasinsOver)
    np.testing.assert_array_equal(section["share"].data, expected.fractions)
    low = [t.low for line in expected.lines for t in line.tipping]
    low += [t.low for column in expected.tipping for t in column]
    np.testing.assert_array_equal(tipping["tipping_low"].data, low)
    assert section["share"].dims == ("delta", "A", "attractor")
    assert {p.name for p in draw_results(tmp_path / "scan.h5")} == {"it_shares.png"}


def test_branches_and_folds_come_back_from_the_file(tmp_path: Path) -> None:
    text = 'parameter = "A"\nbetween = [0.05, 0.3]\nn = 8\n'
    with run(tmp_path, f'kind = "frequency_response"\n{text}{RANGES}') as results:
        points, special = results["it/points"].load(), results["it/special"].load()
    starts = fm.samplers.Uniform(REGION).draw(8, ("x", "x_dot"))
    expected = fm.frequency_response(SYSTEM, "A", (0.05, 0.3), starts)
    values = np.concatenate([branch.values for branch in expected.branches])
    np.testing.assert_array_equal(points["point_value"].data, values)
    assert sorted(special["special_value"].data) == [s.value for s in expected.special]
    assert set(special["special_kind"].data) == {"fold"}
    assert {p.name for p in draw_results(tmp_path / "scan.h5")} == {"it_response.png"}


@pytest.mark.slow
def test_systems_that_stop_are_scanned_as_they_are_called(tmp_path: Path) -> None:
    """Swings beyond x = 1.2 end; of the Python calls the tests of attractors tell what is right."""
    system = fm.System(
        duffing, ["x", "x_dot"], SYSTEM.parameters, lambda t, x, x_dot: abs(x) > 1.2, period=2.0 * math.pi
    )
    with run(tmp_path, f'kind = "attractors"\nn = 100\n{RANGES}', system) as results:
        status = results["it"].load()["status"].data
    assert (
        np.count_nonzero(status == fm.Status.ESCAPED)
        == fm.find_attractors(system, fm.samplers.Uniform(REGION), 100).counts["escaped"]
    )
    assert 0 < np.count_nonzero(status == fm.Status.ESCAPED) < 100
    text = 'parameter = "A"\nbetween = [0.05, 0.3]\nn = 8\n'
    with run(tmp_path, f'kind = "frequency_response"\n{text}{RANGES}', system, "response") as results:
        points = results["it/points"].load()
    starts = fm.samplers.Uniform(REGION).draw(8, ("x", "x_dot"))
    expected = fm.frequency_response(system, "A", (0.05, 0.3), starts)
    stops = np.concatenate([np.zeros(len(one.values), dtype=np.int8) for one in expected.branches])
    ends = np.cumsum([len(one.values) for one in expected.branches])
    for one, end in zip(expected.branches, ends.tolist(), strict=True):
        stops[[end - len(one.values), end - 1]] = one.stops
    assert stops.any()
    np.testing.assert_array_equal(points["point_stops"].data, stops)
    text = "n = 50\nalong.A = { values = [0.05, 0.2] }\n"
    with run(tmp_path, f'kind = "follow_basins"\n{text}{RANGES}', system, "along") as results:
        unlabelled = results["it"].load()["unlabelled"].data
    assert unlabelled.max() > 0.0
    always = fm.System(duffing, system.state, system.parameters, lambda t, x, x_dot: 1.0, SYSTEM.period)
    with run(tmp_path, f'kind = "follow_basins"\n{text}{RANGES}', always, "none") as results:
        assert (results["it"].load()["unlabelled"].data == 1.0).all()
    assert {p.name for p in draw_results(tmp_path / "none.h5")} == {"it_shares.png"}


def test_a_file_s_system_runs_on_workers_too(tmp_path: Path) -> None:
    source, request = tmp_path / "own.py", tmp_path / "own.toml"
    source.write_text(OWN)
    request.write_text(f'[scan.it]\nkind = "attractors"\nn = 200\n{RANGES}')
    labels = []
    for extra in ([], ["--workers", "1"]):
        out = tmp_path / f"own{len(extra)}.h5"
        command = ["run", str(request), "--mechanism", f"{source}:system", "--out", str(out), *extra]
        ended = CliRunner().invoke(main, command)
        assert ended.exit_code == 0, ended.output
        with fm.open_results(out) as results:
            labels.append(results["it"].load()["label"].data)
    np.testing.assert_array_equal(*labels)


@pytest.mark.parametrize(
    ("scan", "told"),
    [
        ('kind = "attractors"\n', "give axes (a grid of starts) or ranges"),
        ('kind = "attractors"\nranges = { y = 1.0 }\n', "ranges.y: unknown name"),
        ('kind = "attractors"\naxes.y = { values = [0.0] }\n', "axes.y: unknown state 'y'"),
        (
            f'kind = "follow_basins"\nalong.B = {{ values = [0.0, 1.0] }}\n{RANGES}',
            "along.B: unknown parameter",
        ),
        (
            f'kind = "follow_basins"\nalong.A = {{ values = [0.1] }}\n{RANGES}',
            "must have two values",
        ),
        (f'kind = "frequency_response"\nparameter = "A"\nbetween = [1.0, 0.5]\n{RANGES}', "must rise"),
        (f'kind = "frequency_response"\nparameter = "B"\nbetween = [0.5, 1.0]\n{RANGES}', "parameter = 'B'"),
        ('kind = "snap"\n', "is not for systems; for systems are: attractors"),
    ],
)
def test_wrong_requests_are_refused(scan: str, told: str) -> None:
    with pytest.raises(fm.InputError) as caught:
        read_request("it.toml", scan_kinds(), f"[scan.it]\n{scan}", SYSTEM)
    assert told in str(caught.value)


def test_what_rests_is_refused() -> None:
    with pytest.raises(fm.InputError, match=r"scan\.it\.kind: is for systems and for mechanisms under loads"):
        read_request(
            "it.toml",
            scan_kinds(),
            '[scan.it]\nkind = "attractors"\nranges = { x = 1.0 }\n',
            fm.mechanisms.von_mises_truss(),
        )
