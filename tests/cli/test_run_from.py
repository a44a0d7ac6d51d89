"""``fastmech run --from``: a result computed again from its file alone."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from cli.refusal import assert_refused

from fastmech import open_results


@pytest.fixture
def done(invoke, tiny) -> Path:
    assert invoke("run", tiny, "--out", "first.h5").exit_code == 0
    tiny.unlink()
    return Path("first.h5")


def same(one: Path, two: Path) -> bool:
    """Every value of every section, to the bit."""
    with open_results(one) as a, open_results(two) as b:
        assert a.sections == b.sections
        assert a.scene == b.scene
        for place in a.groups:
            for name in a[place]:
                assert a[place][name].data.tolist() == b[place][name].data.tolist() or (
                    a[place][name].data.tobytes() == b[place][name].data.tobytes()
                ), (place, name)
        return a.attrs["title"] == b.attrs["title"] and a.request == b.request


def test_the_same_bits_from_the_file_alone(invoke, done):
    again = invoke("run", "--from", done, "--out", "again.h5")
    assert (again.exit_code, again.stderr) == (0, "")
    assert "Bits may differ" not in again.stdout
    assert same(done, Path("again.h5"))
    assert invoke("run", "--from", done).exit_code == 0
    assert same(done, Path("results/tiny.h5"))
    shown = invoke("run", "--from", done)
    assert "results/tiny.h5 holds this result already" in shown.stdout


def test_one_tile_of_it(invoke, done):
    shown = invoke("run", "--from", done, "--tile", "rest:0", "--keep", "tile.h5")
    assert shown.exit_code == 0
    assert "Results: tile.h5" in shown.stdout


def test_other_sources_are_told(invoke, done):
    with h5py.File(done, "r+") as file:
        file.attrs["asked_for"] = np.bytes_(file.attrs["asked_for"].replace(b'"numba": "', b'"numba": "9'))
    shown = invoke("run", "--from", done, "--out", "again.h5")
    assert shown.exit_code == 0
    assert "Bits may differ from the older result: numba = 9" in shown.stdout


def test_what_cannot_be(invoke, done, tiny):
    assert "or --from FILE.h5" in invoke("run").stderr
    assert "or --from FILE.h5" in invoke("run", "scan.toml", "--from", done).stderr
    assert_refused(invoke("run", "--from", "none.h5"), "none.h5", "No such file")
    with h5py.File(done, "r+") as file:
        file.attrs["request"] = np.bytes_(file.attrs["request"].replace(b"motion", b"mention"))
        file.attrs["request_file"] = np.bytes_("../../up\x1b\n.toml")
    assert_refused(invoke("run", "--from", done), "mention")
    with h5py.File(done, "r+") as file:
        file.attrs["request"] = np.bytes_(file.attrs["request"].replace(b"mention", b"motion"))
    shown = invoke("run", "--from", done)
    assert [str(path) for path in Path("results").iterdir()] == ["results/up__.h5"], shown.stdout
    with h5py.File(done, "r+") as file:
        del file.attrs["request"]
    assert_refused(invoke("run", "--from", done), "does not hold the request")
