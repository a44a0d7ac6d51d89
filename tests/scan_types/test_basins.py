"""The basin map as a scan: its layout through a file, its limits, its pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from plots.legibility import assert_legible
from scan_types.values import check_labels, decoded, stored

import fastmech as fm
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.basins import Basins
from fastmech.scan_types.request import RunContext, read_request

CONSTANT = fm.Scene(alpha=0.0)
BISTABLE = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)
AXES = {
    "theta": {"start": -3.0, "stop": 3.0, "num": 21},
    "phi": {"start": -3.2, "stop": 3.2, "num": 17},
}


def test_layout(tmp_path: Path) -> None:
    section = stored(Basins(axes=AXES, fixed={"theta_dot": 1.0}, settle_radius=0.01), CONSTANT, tmp_path)
    one = dict.fromkeys(("basin", "equilibrium", "label", "well", "turns_phi", "turns_theta"), "1")
    one |= dict.fromkeys(("status", "computed"), "1")
    one |= {f"basin_{name}": "1" for name in ("well", "turns_phi", "turns_theta", "share", "share_at_most")}
    one |= {"equilibrium_phi": "rad", "equilibrium_theta": "rad", "equilibrium_energy": "J", "barrier": "J"}
    one |= {"equilibrium_morse_index": "1", "force": "N", "phi": "rad", "theta": "rad"}
    check_labels(section, one | {"capture_time": "s", "settle_time": "s"})
    assert section["label"].dims == ("theta", "phi")
    states = np.stack(np.meshgrid(section["phi"].data, section["theta"].data), -1)
    starts = np.concatenate([states, np.broadcast_to([0.0, 1.0], states.shape)], axis=-1)
    expected = fm.label_starts(CONSTANT, starts.reshape(-1, 4))
    np.testing.assert_array_equal(section["turns_phi"].data.ravel(), expected.turns[:, 0])
    np.testing.assert_array_equal(section["capture_time"].data.ravel(), expected.time)
    assert set(np.ravel(decoded(section["status"]))) == {"captured"}
    assert section["basin_share"].data.sum() == pytest.approx(1.0)
    np.testing.assert_array_equal(section["basin_share_at_most"].data, section["basin_share"].data)
    label = section["label"].data
    np.testing.assert_array_equal(section["basin_turns_theta"].data[label], section["turns_theta"].data)
    assert section.attrs["captured"] == label.size


@pytest.mark.parametrize("settle_radius", [None, 0.01])
def test_tiles_are_the_whole_bit_for_bit(
    settle_radius: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan = Basins(axes=AXES, t_end=20.0, settle_radius=settle_radius)
    values = {name: np.array(axis.array) for name, axis in scan.axes.items()}
    whole = fm.map_basins(BISTABLE, values, t_end=20.0, settle_radius=settle_radius)
    monkeypatch.setattr("fastmech.scan_types.basins.TILE_POINTS", 60)
    tiling = scan.tiling(BISTABLE)
    assert tiling.count == 7
    assert sum(map(tiling.items, range(7))) == 21 * 17
    tiles = [tiling.compute(index, RunContext(threads=1)) for index in range(7)]
    joined = tiling.assemble(tiles.__getitem__)
    arrays = {
        "well": whole.well,
        "capture_time": whole.time,
        "status": whole.status,
        "label": whole.labels[0],
    }
    arrays |= {"turns_phi": whole.turns[..., 0], "turns_theta": whole.turns[..., 1]}
    if settle_radius is not None:
        arrays["settle_time"] = whole.settle_time
    assert ("settle_time" in joined) == (settle_radius is not None)
    for name, array in arrays.items():
        np.testing.assert_array_equal(joined[name].data, array, err_msg=name)
    assert joined.attrs["steps"] == whole.steps
    assert joined.attrs["undecided"] == whole.counts["undecided"] > 0
    assert joined["computed"].data.all()
    # A look at it before its second tile is there: every seventh plane of theta is missing.
    look = tiling.assemble(lambda index: tiling.missing(index) if index == 1 else tiles[index])
    there = np.arange(21) % 7 != 1
    np.testing.assert_array_equal(look["computed"].data, np.repeat(there[:, None], 17, axis=1))
    np.testing.assert_array_equal(look["well"].data[there], whole.well[there])
    assert set(look["well"].data[~there].ravel()) == {-1}


def test_shares_say_what_they_are_at_most(tmp_path: Path) -> None:
    section = stored(Basins(axes=AXES, t_end=3.0), BISTABLE, tmp_path)
    label = section["label"].data
    unknown = np.count_nonzero(label < 0) / label.size
    assert 0.1 < unknown < 1.0
    share = [np.count_nonzero(label == k) / label.size for k in range(section.sizes["basin"])]
    np.testing.assert_allclose(section["basin_share"].data, share, rtol=1e-14)
    np.testing.assert_allclose(section["basin_share_at_most"].data, np.add(share, unknown), rtol=1e-14)


def test_a_refined_map_is_one_tile() -> None:
    assert Basins(axes=AXES, refine=4).tiling(BISTABLE).count == 1


@pytest.mark.parametrize(
    ("scene", "fields", "names"),
    [
        (CONSTANT, {"settle_radius": 0.01}, {"labels", "capture_time", "settle_time"}),
        (BISTABLE, {"t_end": 20.0, "refine": 4}, {"labels", "wells", "capture_time"}),
        (BISTABLE, {"t_end": 0.01}, {"labels"}),
        (fm.Scene(), {"fixed": {"phi_dot": 8.0}}, {"labels", "capture_time"}),
    ],
)
def test_pictures(scene: fm.Scene, fields: dict[str, object], names: set[str], tmp_path: Path) -> None:
    axes = (
        AXES
        if "t_end" not in fields or fields["t_end"] != 0.01
        else {
            "phi": {"start": 2.0, "stop": 2.2, "num": 5},
            "theta": {"start": 2.0, "stop": 2.2, "num": 5},
        }
    )
    figures = Basins.draw(stored(Basins(axes=axes, **fields), scene, tmp_path), scene.parameters)
    assert set(figures) == names
    for figure in figures.values():
        assert_legible(figure)


def test_requests_in_the_repository_are_valid() -> None:
    folder = Path(__file__).parents[2] / "scans"
    files = sorted(folder.glob("basins_*.toml"))
    assert len(files) == 7
    for file in files:
        read_request(file, scan_kinds())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("axes.phi = {start=0.0, stop=1.0, num=3}", r"scan.b.axes.*at least 2"),
        (
            "axes.ph = {start=0.0, stop=1.0, num=3}\naxes.theta = {start=0.0, stop=1.0, num=3}",
            r"did you mean 'phi'",
        ),
        (
            "axes.phi = {start=1.0, stop=0.0, num=3}\naxes.theta = {start=0.0, stop=1.0, num=3}",
            r"axes.phi: falls",
        ),
        (
            "axes.phi = {start=0.0, stop=1.0, num=3}\naxes.theta = {start=0.0, stop=1.0, num=3}\n"
            "scene = {beta = 0.0}",
            r"beta = 0",
        ),
    ],
)
def test_wrong_requests(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "r.toml"
    path.write_text(f'[scan.b]\nkind = "basins"\n{text}\n')
    with pytest.raises(fm.InputError, match=message):
        read_request(path, scan_kinds())
