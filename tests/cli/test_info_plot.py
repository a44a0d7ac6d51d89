"""``fastmech info`` and ``fastmech plot`` on a result file, and on what is none."""

from __future__ import annotations

from pathlib import Path

import h5py
import pytest
from cli.refusal import assert_refused

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture
def done(invoke, tiny) -> Path:
    assert invoke("run", tiny).exit_code == 0
    return Path("results/tiny.h5")


def test_info_shows_title_scene_and_sections(invoke, done):
    result = invoke("info", done)
    assert result.exit_code == 0
    assert result.stderr == ""
    for fragment in ("a tiny request", "150.0", "swing", "rest", "equilibrium"):
        assert fragment in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 100


def test_plot_draws_every_section_and_lists_the_pictures(invoke, done):
    result = invoke("plot", done)
    assert result.exit_code == 0
    assert result.stderr == ""
    listed = [Path(line) for line in result.stdout.splitlines()]
    assert set(listed) == set(Path("results/tiny").iterdir())
    assert {path.name.split("_")[0] for path in listed} == {"swing", "rest"}
    assert all(path.read_bytes().startswith(PNG) for path in listed)


def test_plot_into_a_folder(invoke, done):
    assert invoke("plot", done, "--out", "pictures/here").exit_code == 0
    assert Path("pictures/here/rest_potential.png").is_file()
    assert not Path("results/tiny").exists()


def test_plot_into_what_is_no_folder(invoke, done):
    Path("file").write_text("no folder", encoding="utf-8")
    assert_refused(invoke("plot", done, "--out", "file/inner"), "file/inner: cannot be made")


@pytest.mark.parametrize("command", ["info", "plot"])
def test_what_is_no_result_file(invoke, command):
    assert_refused(invoke(command, "none.h5"), "none.h5", "No such file")
    Path("text.h5").write_text("not HDF5", encoding="utf-8")
    assert_refused(invoke(command, "text.h5"), "text.h5", "not an HDF5 file")
    h5py.File("other.h5", "w").close()
    assert_refused(invoke(command, "other.h5"), "other.h5", "not a result file")
    assert not Path("text").exists()


def test_plot_of_a_tile(invoke, done, tiny):
    assert invoke("run", tiny, "--tile", "swing:1", "--keep", "t1.h5").exit_code == 0
    assert_refused(invoke("plot", "t1.h5"), "t1.h5: swing: is a tile", "plot the result", "snapshot")
    assert not Path("t1").exists()


def test_plot_of_an_unknown_kind(invoke, done):
    with h5py.File(done, "r+") as file:
        file["rest"].attrs["kind"] = "later"
    assert_refused(invoke("plot", done), "rest", "'later'", "motion")
    assert not Path("results/tiny").exists()
