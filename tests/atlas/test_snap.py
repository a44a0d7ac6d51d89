"""The load at which a resting position disappears."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from fastmech.atlas.fold_points import find_folds
from fastmech.atlas.snap import find_snap
from fastmech.equilibria.find import find_equilibria
from fastmech.errors import InputError
from fastmech.scene import Scene

DATA = tomllib.loads((Path(__file__).parents[2] / "data" / "folds.toml").read_text())
BISTABLE = Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)
EXACT = next(line for line in DATA["line"] if line["name"] == "bistable")["folds"]


def test_table_1_never_snaps() -> None:
    snap = find_snap(Scene(alpha=0.0))
    assert (snap.below, snap.above) == (None, None)
    assert snap.exhaustive
    assert (snap.phi, snap.theta) == pytest.approx((1.4506, -0.2326), abs=1e-3)
    assert "no load whatever" in snap.sentence


def test_each_well_of_a_bistable_mechanism_snaps_at_one_end() -> None:
    stable = [e for e in find_equilibria(BISTABLE) if e.kind == "minimum"]
    first, second = (find_snap(BISTABLE, e) for e in stable)
    assert first.above is None
    assert first.below == pytest.approx(float(EXACT[0]["value"]), abs=1e-9)
    assert second.below is None
    assert second.above == pytest.approx(float(EXACT[1]["value"]), abs=1e-9)
    assert find_snap(BISTABLE).below == first.below


def test_a_decaying_force_starts_from_none() -> None:
    snap = find_snap(BISTABLE.replace(alpha=0.7))
    assert snap.force == 0.0
    (load,) = (load for load in (snap.below, snap.above) if load is not None)
    assert abs(load) == pytest.approx(671.1627073982018, rel=1e-12)


def test_the_position_is_there_before_and_gone_after() -> None:
    rng = np.random.default_rng(8)
    snapped = 0
    for _ in range(40):
        scene = Scene(
            m1=rng.uniform(1, 30), m2=rng.uniform(1, 30), l=rng.uniform(0.4, 3.0), alpha=0.0,
            c1=10 ** rng.uniform(0.5, 3), c2=10 ** rng.uniform(0.5, 3), F0=rng.uniform(-200, 200),
        )  # fmt: skip
        snap = find_snap(scene)
        for load in (snap.below, snap.above):
            if load is None:
                continue
            snapped += 1
            away = 1e-4 * max(1.0, abs(load))
            counts = [
                find_equilibria(scene.replace(F0=load + d)).kind.count("minimum") for d in (-away, away)
            ]
            assert sorted(counts) == [1, 2]
    assert snapped > 3


def test_beyond_twice_c1_l_there_is_no_fold() -> None:
    """The bound that makes a search exhaustive."""
    rng = np.random.default_rng(9)
    for _ in range(30):
        scene = Scene(
            m1=10 ** rng.uniform(-1, 2), m2=10 ** rng.uniform(-1, 2), l=rng.uniform(0.2, 4.0), alpha=0.0,
            c1=10 ** rng.uniform(0, 3), c2=10 ** rng.uniform(0, 4),
        )  # fmt: skip
        bound = 2.0 * scene.c1 * scene.l
        assert find_folds(scene, "F0", np.linspace(bound, 10.0 * bound, 200)) == ()


def test_wrong_requests_are_refused() -> None:
    saddle = next(e for e in find_equilibria(BISTABLE) if e.kind == "saddle")
    with pytest.raises(InputError, match=r"^equilibrium = .*: must be a stable one"):
        find_snap(BISTABLE, saddle)
    with pytest.raises(InputError, match=r"^equilibrium = 3: must be one that find_equilibria gives$"):
        find_snap(BISTABLE, 3)  # type: ignore[arg-type]
    for searched in ((100.0, 200.0), (1.0,), "ab", 5, (None, None), ("-500", "500"), (np.nan, 500.0)):
        message = f"searched = {searched!r}: must be a range of forces [N] that holds 85.3 N"
        with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
            find_snap(BISTABLE, searched=searched)  # type: ignore[arg-type]


def test_searched_range_is_kept_to() -> None:
    snap = find_snap(BISTABLE, searched=(-600.0, 600.0))
    assert (snap.below, snap.above, snap.exhaustive) == (None, None, False)
    assert "no load in that range" in snap.sentence
