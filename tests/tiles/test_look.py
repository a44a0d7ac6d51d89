"""What a look at a scan in progress shows."""

from __future__ import annotations

import re
import time
from pathlib import Path

import numpy as np
import pytest
from filelock import FileLock
from tiles.conftest import TILES, Run, content
from tiles.test_run import stopped_after, tiles

from fastmech.errors import InputError
from fastmech.interrupts import Stopped
from fastmech.runner import draw_results
from fastmech.store.read import open_results
from fastmech.tiles.look import ScanLook


def interrupted(run: Run, count: int) -> None:
    with stopped_after(count, KeyboardInterrupt()), pytest.raises(Stopped):
        run(threads=1)


def test_progress(run: Run, tmp_path: Path) -> None:
    target = tmp_path / "scan.h5"
    with pytest.raises(InputError, match="neither a result nor a scan in progress"):
        ScanLook(target)
    interrupted(run, 4)
    rest, line, both, who = ScanLook(target).told()
    assert rest.split() == ["1", "of", "1", "tiles", "rest"]
    assert line.strip() == f"3 of {TILES - 1} tiles  line, 20 of 59 points of the map"
    assert both.strip() == f"4 of {TILES} tiles  in all"
    assert who == f"{target}: nobody works on it; fastmech run goes on where it was"
    run()
    assert [*ScanLook(target).told()] == [f"{target}: complete"]


def test_a_running_scan_says_who_and_how_long(run: Run, tmp_path: Path) -> None:
    interrupted(run, 4)
    look = ScanLook(tmp_path / "scan.h5")
    begun = min(path.stat().st_mtime for path in tiles(tmp_path))
    with FileLock(look.parts.folder / "lock"):
        look.parts.note_run({"pid": 123, "host": "here", "since": begun - 4000.0})
        *_, line = look.told()
    running = time.time() - begun + 4000.0
    told = re.search(r": process 123 on here works on it for 1:(.*), (.*) tiles/s, about (.*) left$", line)
    assert told is not None
    assert float(told[2]) == pytest.approx(4 / running, rel=5e-3)
    # One section of two is done, and three sevenths of the other: 4/7 are left of 10/7.
    minutes, seconds = map(int, told[3].removeprefix("0:").split(":"))
    assert 60 * minutes + seconds == pytest.approx(0.4 * running, abs=2.0)


def test_a_snapshot_is_a_result_file(run: Run, tmp_path: Path) -> None:
    interrupted(run, 4)
    snapshot = tmp_path / "now.h5"
    ScanLook(tmp_path / "scan.h5").write_snapshot(snapshot)
    with open_results(snapshot) as results:
        assert results.sections == ("rest", "line")
        assert results["line"].attrs["partial"] == f"3 of {TILES - 1} tiles"
        count, phi = results["line"]["count"].data, results["line"]["phi"].data
    assert (count[:20] > 0).all()
    assert (count[20:] == 0).all()
    assert np.isnan(phi[20:]).all()
    assert [path.name for path in draw_results(snapshot)]
    report = run()
    whole = content(report.path)["line", "phi"]
    assert np.frombuffer(whole[-1])[: 20 * 6].tobytes() == phi[:20].tobytes()
    with pytest.raises(InputError, match="nothing in progress"):
        ScanLook(tmp_path / "scan.h5").write_snapshot(tmp_path / "later.h5")


def test_a_section_that_is_refused_loses_no_other(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(self: object, tile: object) -> None:
        raise InputError("it cannot be put together")

    monkeypatch.setattr("fastmech.scan_types.equilibrium_map.MapTiling.assemble", refuse)
    with pytest.raises(InputError) as refusal:
        run()
    kept = f"{TILES} of {TILES} tiles are kept in scan.h5.parts"
    how = f"fastmech status {tmp_path / 'scan.h5'} --snapshot OTHER.h5 writes what other scans have"
    assert str(refusal.value) == f"scan.line: it cannot be put together; {kept}; {how}"
    ScanLook(tmp_path / "scan.h5").write_snapshot(tmp_path / "now.h5")
    with open_results(tmp_path / "now.h5") as results:
        assert results.sections == ("rest",)
        assert results["rest"]["energy"].data.size


def test_a_snapshot_leaves_out_what_is_not_complete(run: Run, tmp_path: Path) -> None:
    with stopped_after(0, KeyboardInterrupt()), pytest.raises(Stopped):
        run(threads=1)
    interrupted(run, 1)
    ScanLook(tmp_path / "scan.h5").write_snapshot(tmp_path / "now.h5")
    with open_results(tmp_path / "now.h5") as results:
        assert results.sections == ("rest",)
