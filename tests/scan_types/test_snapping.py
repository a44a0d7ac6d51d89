"""Dynamic snapping as a scan: the function's numbers through a file, tiles in any order, pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from plots.legibility import assert_legible
from scan_types.values import check_labels, decoded, stored

import fastmech as fm
from fastmech.results import Dataset
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import RunContext, read_request
from fastmech.scan_types.snapping import Snapping

SCENE = fm.Scene()
#: Rates 0.8, 2 and 5 1/s; the forces hit the window at 5 1/s in which the mechanism comes back.
REQUEST = Snapping(
    F0={"start": 1068.0, "stop": 5340.0, "num": 5},
    alpha={"start": 0.8, "stop": 5.0, "num": 3},
    tolerance=5.0,
)


@pytest.fixture(scope="module")
def section(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return stored(REQUEST, SCENE, tmp_path_factory.mktemp("snapping"))


def test_a_file_holds_what_the_functions_give(section: Dataset) -> None:
    grid = dict.fromkeys(("well", "turns_phi", "turns_theta", "left", "status"), "1")
    units = grid | {"F0": "N", "alpha": "1/s", "capture_time": "s", "critical_F0": "N"}
    units |= {"critical_impulse": "N s", "window_alpha": "1/s", "window_first": "N", "window_last": "N"}
    units |= dict.fromkeys(("window_well", "window_turns_phi", "window_turns_theta", "window_left"), "1")
    units |= {"equilibrium_phi": "rad", "equilibrium_theta": "rad", "equilibrium_energy": "J"}
    check_labels(section, units | {"equilibrium": "1", "equilibrium_morse_index": "1"})
    np.testing.assert_allclose(section["alpha"].data, [0.8, 2.0, 5.0])
    own = fm.map_snapping(SCENE, section["F0"].data, section["alpha"].data)
    np.testing.assert_array_equal(section["well"].data, own.label)
    np.testing.assert_array_equal(section["turns_theta"].data, own.turns[..., 1])
    np.testing.assert_array_equal(section["left"].data, own.left)
    np.testing.assert_array_equal(section["capture_time"].data, own.time)
    assert set(np.ravel(decoded(section["status"]))) == {"captured"}
    critical = fm.critical_forces(own, SCENE, tolerance=5.0)
    np.testing.assert_array_equal(section["critical_F0"].data, critical)
    assert np.isnan(critical[0])
    assert section["critical_impulse"].data == pytest.approx(158.558, abs=2e-3)
    at = section["window_alpha"].data == section["alpha"].data[2]
    windows = own.windows(2)
    np.testing.assert_array_equal(section["window_first"].data[at], [w.first for w in windows])
    np.testing.assert_array_equal(section["window_left"].data[at], [w.left for w in windows])
    assert [w.left for w in windows] == [False, True, False, True]


def test_tiles_are_the_whole_bit_for_bit(section: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fastmech.scan_types.snapping.TILE_POINTS", 10)
    tiling = REQUEST.tiling(SCENE)
    assert tiling.count == 2
    assert sum(map(tiling.items, range(2))) == 15
    tiles = [tiling.compute(index, RunContext(threads=1)) for index in range(2)]
    joined = tiling.assemble(tiles.__getitem__)
    assert isinstance(joined, Dataset)
    joined = joined.merged
    for name in section:
        np.testing.assert_array_equal(joined[name].data, section[name].data, err_msg=name)
    look = tiling.assemble(lambda index: tiling.missing(index) if index == 0 else tiles[index])
    assert isinstance(look, Dataset)
    np.testing.assert_array_equal(look["well"].data[1], section["well"].data[1])
    assert set(look["well"].data[[0, 2]].ravel()) == {-1}


@pytest.mark.parametrize("t_end", [None, 0.5])
def test_pictures(t_end: float | None, section: Dataset, tmp_path: Path) -> None:
    """Also of a run that ends before anything is decided."""
    short = REQUEST.model_copy(update={"t_end": t_end})
    dataset = section if t_end is None else stored(short, SCENE, tmp_path)
    figures = Snapping.draw(dataset, SCENE.parameters)
    assert set(figures) == {"map"}
    assert_legible(figures["map"])
    labels = [text.get_text() for text in figures["map"].legends[0].get_texts()]
    assert any(label.startswith("undecided") for label in labels) == (t_end is not None)
    assert ("smallest force that leaves" in labels) == (t_end is None)


@pytest.mark.nojit
def test_the_request_in_the_repository_is_valid() -> None:
    read_request(Path(__file__).parents[2] / "scans" / "basins_snapping.toml", scan_kinds())


@pytest.mark.nojit
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("F0 = {start=-1.0, stop=1.0, num=3}", r"F0: goes from -1 to 1 N: must be of one sign"),
        ("F0 = {start=2.0, stop=1.0, num=3}", r"F0: falls from 2 to 1, must rise"),
        ("alpha = {start=0.0, stop=1.0, num=3}", r"alpha = .*must have one sign and not be 0"),
        ("scene = {beta = 0.0}", r"beta = 0"),
    ],
)
def test_wrong_requests(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "r.toml"
    given = {"F0": "{start=1.0, stop=2.0, num=3}", "alpha": "{start=1.0, stop=2.0, num=3}"}
    lines = [f"{key} = {value}" for key, value in given.items() if not text.startswith(key)] + [text]
    path.write_text('[scan.b]\nkind = "snapping"\n' + "\n".join(lines) + "\n")
    with pytest.raises(fm.InputError, match=message):
        read_request(path, scan_kinds())
