"""Erosion profiles as a scan: the function's numbers through a file, any tile by itself, pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plots.legibility import assert_legible
from scan_types.values import check_labels, stored

import fastmech as fm
from fastmech.results import Dataset
from fastmech.runner import draw_results
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.erosion import Erosion
from fastmech.scan_types.request import RunContext, read_request

BISTABLE = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)
#: Up to the fold at c2 = 98.59 N/m, where the shallow well ends; a small window about that well.
ALONG = {"c2": {"start": 96.0, "stop": 100.0, "num": 3}}
AXES = {
    "phi": {"start": -3.1, "stop": -2.2, "num": 6},
    "theta": {"start": -2.1, "stop": -1.3, "num": 5},
}
SMALL: dict[str, Any] = {"most_shock": 0.3, "t_end": 10.0, "starts": 40, "directions": 2}


@pytest.fixture(scope="module")
def section(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return stored(Erosion(along=ALONG, axes=AXES, **SMALL), BISTABLE, tmp_path_factory.mktemp("erosion"))


def test_a_file_holds_what_the_function_gives(section: Dataset, tmp_path: Path) -> None:
    axes = {name: np.linspace(a["start"], a["stop"], a["num"]) for name, a in AXES.items()}
    own = fm.erosion(
        BISTABLE, "c2", [96.0, 98.0, 100.0], axes, most_shock=0.3, t_end=10.0, n=40, directions=2
    )
    units = dict.fromkeys(("lim", "factor", "shock", "kick"), "rad")
    units |= dict.fromkeys(("shock_undecided", "kick_undecided"), "rad")
    units |= dict.fromkeys(("lim_at_most", "factor_at_most"), "rad")
    units |= dict.fromkeys(
        ("stability", "stability_at_most", "lower", "upper", "gim", "gim_at_most", "undecided"), "1"
    )
    units |= dict.fromkeys(("lim_at_window", "factor_at_window"), "1")
    places = {"position_phi": "rad", "position_theta": "rad"}
    check_labels(section, {f"well_{k}": u for k, u in units.items()} | places | {"c2": "N/m", "sheet": "1"})
    for name in units:
        np.testing.assert_array_equal(section[f"well_{name}"].data, vars(own)[name], err_msg=name)
    for name, place in own.position.items():
        np.testing.assert_array_equal(section[f"position_{name}"].data, place)
    np.testing.assert_array_equal(section["sheet"].data, own.sheet)
    most, share = own.stability_at_most, own.stability
    there = np.isfinite(share)
    np.testing.assert_allclose(most[there], (share + own.undecided)[there], rtol=1e-14)
    assert (own.undecided[there] > 0.1).any(), "10 s do not decide all here"
    assert (own.lower[there] <= share[there] + 1e-15).all()
    assert (own.upper[there] >= most[there] - 1e-15).all()
    shallow = int(np.flatnonzero(np.isnan(own.position["phi"][-1]))[0])
    assert own.shock[1, shallow] > 0.0
    own.save(tmp_path / "own.nc")
    (picture,) = draw_results(
        tmp_path / "own.nc"
    )  # its title tells no window, which the object does not know
    assert picture.name == "erosion_profile.png"


def test_a_tile_needs_no_other_one() -> None:
    tiling = Erosion(along=ALONG, axes=AXES, **SMALL).tiling(BISTABLE)
    assert tiling.count == 3 * 2
    last = [tiling.compute(index, RunContext(threads=1)) for index in (4, 5)]
    assert sum(np.isnan(alone["place_phi"].data) for alone in last) == 1, "one of the wells has ended"
    look = tiling.assemble(lambda index: last[index - 4] if index >= 4 else tiling.missing(index))
    assert isinstance(look, Dataset)
    assert np.isnan(look["well_stability"].data[:2]).all()
    np.testing.assert_array_equal(
        look["well_stability"].data[2], [alone["stability"].data[0] for alone in last]
    )


def test_a_tile_is_left_between_integrations() -> None:
    class Left(Exception):  # noqa: N818
        pass

    def leave() -> None:
        raise Left

    tiling = Erosion(along=ALONG, axes=AXES, **SMALL).tiling(BISTABLE)
    with pytest.raises(Left):
        tiling.compute(0, RunContext(threads=1, check=leave))


def test_picture(section: Dataset) -> None:
    figures = Erosion.draw(section, BISTABLE.parameters)
    assert set(figures) == {"profile"}
    assert_legible(figures["profile"])
    labels = [text.get_text() for text in figures["profile"].legends[0].get_texts()]
    assert any("found at values from 96 to 98 N/m" in label for label in labels)
    assert any("found at values from 96 to 100 N/m" in label for label in labels)


@pytest.mark.slow
def test_picture_marks_radii_that_undecided_starts_limit(section: Dataset) -> None:
    """Of this short section one start of the map is undecided, next to the shallow well."""

    def drawn(shown: Dataset) -> tuple[bool, list[float]]:
        figure = Erosion.draw(shown, BISTABLE.parameters)["profile"]
        assert_legible(figure)
        texts = [text.get_text() for text in figure.legends[0].get_texts()]
        marks = [line for line in figure.axes[1].lines if line.get_marker() == "^"]
        heights = [float(y) for line in marks for y in np.asarray(line.get_ydata())]
        return "radius, if all undecided starts ended there" in texts, heights

    names = ("well_lim", "well_factor")
    most = {name: section[f"{name}_at_most"] for name in names}
    limited = [most[name].data[most[name].data > section[name].data] for name in names]
    assert limited[0].size
    marked, heights = drawn(section)
    assert marked
    assert sorted(heights) == sorted(np.concatenate(limited).tolist())
    decided = {f"{name}_at_most": section[name] for name in names}
    assert drawn(Dataset({**{name: section[name] for name in section}, **decided}, section.attrs)) == (
        False,
        [],
    )


@pytest.mark.nojit
def test_the_request_in_the_repository_is_valid() -> None:
    request = read_request(Path(__file__).parents[2] / "scans" / "basins_erosion.toml", scan_kinds())
    assert {next(iter(scan.along)) for scan in request.scans.values()} == {"F0", "c1", "c2"}


@pytest.mark.nojit
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ("along.c4 = {start=1.0, stop=2.0, num=3}", r"scan.b.along.c4: unknown parameter 'c4'; did you mean"),
        ("along.alpha = {start=1.0, stop=2.0, num=3}", r"scan.b.along.alpha: unknown parameter"),
        ("along.c1 = {start=2.0, stop=1.0, num=3}", r"scan.b.along.c1: falls from 2 to 1, must rise"),
        ("along.beta = {start=0.0, stop=1.0, num=3}", r"beta = 0"),
        ("along.c1 = {start=1.0, stop=2.0, num=3}\nscene = {alpha = 0.5}", r"alpha = 0.5: must be 0"),
    ],
)
def test_wrong_requests(changes: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "r.toml"
    axes = "axes.phi = {start=0.0, stop=1.0, num=3}"
    path.write_text(f'[scene]\nalpha = 0.0\n[scan.b]\nkind = "erosion"\n{axes}\n{changes}\n')
    with pytest.raises(fm.InputError, match=message):
        read_request(path, scan_kinds())


@pytest.mark.slow
def test_runs_end_when_motions_are_captured_unless_asked(tmp_path: Path) -> None:
    """A damper of a tenth of the usual strength: in 60 s nothing is captured."""
    slow = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0, beta=5.0)
    small = {"most_shock": 0.1, "starts": 8, "directions": 1}
    along = {"c2": {"start": 96.0, "stop": 96.0, "num": 1}}
    late, early = (
        stored(Erosion(along=along, axes=AXES, **small, **given), slow, tmp_path / name)
        for name, given in (("late", {}), ("early", {"t_end": 60.0}))
    )
    assert "t_end" not in late.attrs
    assert early.attrs["t_end"] == 60.0
    assert (late["well_undecided"].data < early["well_undecided"].data).all()
