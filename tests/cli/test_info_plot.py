"""``fastmech info`` and ``fastmech plot`` on a result file, and on what is none."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from cli.refusal import assert_refused

from fastmech import open_results
from fastmech.plots import style
from fastmech.plots.equilibria import draw_equilibria

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


def test_plot_says_what_it_does_not_draw(invoke):
    text = '[scene]\nalpha = 0.0\n[scan.end]\nkind = "snap"\n[scan.rest]\nkind = "equilibria"\n'
    Path("ends.toml").write_text(text, encoding="utf-8")
    assert invoke("run", "ends.toml").exit_code == 0
    line = (
        "results/ends.h5: end: nothing is drawn of this section of kind snap; "
        "an equilibrium_map over its parameter alone shows where positions end"
    )
    result = invoke("plot", "results/ends.h5")
    assert result.exit_code == 0
    assert result.stderr.splitlines() == [f"fastmech: {line}"]
    assert {path.name.split("_")[0] for path in Path("results/ends").iterdir()} == {"rest"}
    assert_refused(invoke("plot", "results/ends.h5", "--section", "end"), line)


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


def test_info_of_a_section(invoke, done):
    shown = invoke("info", done, "--section", "rest")
    assert shown.exit_code == 0
    assert "natural_frequency_1" in shown.stdout
    assert "swing" not in shown.stdout
    assert_refused(invoke("info", done, "--section", "rset"), "section 'rset'", "swing, rest")


def test_info_prints_the_request_as_it_was(invoke, done, tiny):
    shown = invoke("info", "--request", done)
    assert (shown.exit_code, shown.stderr) == (0, "")
    assert shown.stdout == tiny.read_text(encoding="utf-8")
    with h5py.File(done, "r+") as file:
        file.attrs["request"] = np.bytes_("a\x1b[2J\n")
    assert invoke("info", "--request", done).stdout == "a\\x1b[2J\n"
    with h5py.File(done, "r+") as file:
        del file.attrs["request"]
    assert_refused(invoke("info", "--request", done), "does not hold the request")


@pytest.mark.parametrize(("form", "begin"), [("png", PNG), ("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_plot_of_a_section_in_a_format(invoke, done, form, begin):
    assert invoke("plot", done, "--section", "rest", "--format", form, "--out", "p").exit_code == 0
    pictures = sorted(Path("p").iterdir())
    names = ("eigenvalues", "positions", "potential")
    assert [path.name for path in pictures] == [f"rest_{name}.{form}" for name in names]
    assert all(path.read_bytes().startswith(begin) for path in pictures)
    assert_refused(invoke("plot", done, "--section", "none", "--out", "q"), "section 'none'")


@pytest.mark.slow
def test_every_shipped_and_every_older_file_is_plotted(invoke, monkeypatch):
    """By the names of codes that the file itself has, whatever version wrote it; small, as nobody looks."""
    monkeypatch.setattr(style, "DPI", 40)
    root = Path(__file__).parents[2]
    files = [root / "data" / "small.h5", *sorted((root / "tests" / "older").glob("*.h5"))]
    assert len(files) >= 2
    for file in files:
        assert invoke("plot", file, "--out", file.stem).exit_code == 0, file
        names = {path.name for path in Path(file.stem).iterdir()}
        assert {"basins_labels.png", "disturbed_outcomes.png", "map_F0_c1_count.png"} <= names, file
        assert len(names) >= 21, file


def test_codes_are_named_by_the_file(invoke, done):
    """A code that today's enumeration lacks, or has under another number, is drawn as the file calls it."""
    with h5py.File(done, "r+") as file:
        kind = file["rest/kind"]
        kind.attrs["flag_meanings"] = np.bytes_("maximum novel minimum")
        kind.attrs["flag_values"] = np.array([0, 1, 2], np.int8)
        del file["rest/eigenvalue_re_1"], file["swing"]
    with open_results(done) as results:
        dataset = results["rest"].load()
        scene = results.scene_of("rest")
    figure = draw_equilibria(dataset, scene)["potential"]
    (axes,) = [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]
    labels = {line.get_label(): len(line.get_xdata()) for line in axes.get_lines()}
    # Of the four equilibria one is a minimum (0), two are saddles (1), one is a maximum (2).
    assert {name: labels.get(name) for name in ("maximum", "novel", "minimum")} == {
        "maximum": 1, "novel": 2, "minimum": 1,
    }  # fmt: skip
    assert "saddle" not in labels


@pytest.mark.parametrize("command", [["info"], ["plot"], ["export", "--to", "csv"]])
def test_section_given_twice_is_refused(invoke, done, command):
    refused = invoke(*command, done, "--section", "rest", "--section", "swing")
    assert_refused(refused, "--section is given 2 times; give it once")
