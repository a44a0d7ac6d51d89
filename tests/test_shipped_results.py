"""The shipped result file: of today's request, readable to its last value, and what is computed now."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fastmech as fm
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import read_request

ROOT = Path(__file__).parents[1]
SHIPPED = ROOT / "data" / "small.h5"
REQUEST = ROOT / "scans" / "small.toml"


def test_it_is_of_the_request_beside_it() -> None:
    with fm.open_results(SHIPPED) as results:
        assert results.attrs["request"] == REQUEST.read_text(encoding="utf-8")


def test_every_value_of_every_kind_can_be_read() -> None:
    asked = read_request(REQUEST, scan_kinds())
    for_the_scene = {kind for kind, one in scan_kinds().items() if not one.of_systems}
    assert {scan.kind for scan in asked.scans.values()} == for_the_scene
    with fm.open_results(SHIPPED) as results:
        assert results.sections == tuple(asked.scans)
        assert all(f"{name} ({scan.kind})" in repr(results) for name, scan in asked.scans.items())
        for name, scan in asked.scans.items():
            section = results[name]
            assert section.attrs["kind"] == scan.kind
            for variable in section:
                read = section[variable]
                assert read.data.shape == tuple(section.sizes[dim] for dim in read.dims), (name, variable)


def test_it_holds_what_is_computed_now() -> None:
    with fm.open_results(SHIPPED) as results:
        equilibria = fm.find_equilibria(fm.Scene(**results.scene))
        for name in ("phi", "theta", "energy"):
            stored = results["equilibria"][name].data
            assert stored == pytest.approx(np.asarray(getattr(equilibria, name)), rel=1e-12)


def test_it_is_small() -> None:
    assert SHIPPED.stat().st_size < 400_000
