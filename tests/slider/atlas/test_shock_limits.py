"""Proved shock limits of maps: least impulses that give the depth, from velocities and the metric."""

from __future__ import annotations

import numpy as np
import pytest

import fastmech as fm
from fastmech.slider.geometry import velocities
from fastmech.slider.lagrange import metric

LIGHT = fm.Scene(m1=0.5, m2=0.2, l=0.4, c1=12.0, c2=9.0, F0=1.5, alpha=0.0)


def test_they_are_those_of_the_easiest_direction() -> None:
    """Over l, m2 and the load: sqrt(2 depth / lambda) with the largest eigenvalue of B a^-1 B^T."""
    axes = {"l": [0.3, 0.4], "m2": [0.1, 0.2, 0.5], "F0": [-1.0, 0.5, 1.5]}
    atlas = fm.map_equilibria(LIGHT, axes, wells=True, threads=1)
    wells = np.argwhere(atlas.morse_index == 0)
    assert len(wells) >= 18
    for i, j, k, slot in wells:
        scene = LIGHT.replace(l=axes["l"][i], m2=axes["m2"][j], F0=axes["F0"][k])
        q = [atlas.phi[i, j, k, slot], atlas.theta[i, j, k, slot]]
        moved = velocities(scene, [[*q, 1.0, 0.0], [*q, 0.0, 1.0]])
        for n in (1, 2, 3):
            B = np.array([getattr(moved, f"x{n}"), getattr(moved, f"y{n}")])
            largest = np.linalg.eigvalsh(B @ np.linalg.solve(metric(scene, q), B.T))[-1]
            told = getattr(atlas, f"shock_limit_m{n}")[i, j, k, slot]
            right = np.sqrt(2.0 * atlas.depth[i, j, k, slot] / largest)
            assert (
                right * (1.0 - 1e-6) < told <= right
            )  # what rounding may make of shallow wells is taken off
    rest = atlas.morse_index != 0
    for n in (1, 2, 3):
        assert np.isnan(getattr(atlas, f"shock_limit_m{n}")[rest]).all()
    without = fm.map_equilibria(LIGHT, {"F0": [1.5]})
    assert np.isnan(without.shock_limit_m2).all()


def test_a_deep_well_has_a_large_limit_where_crank_and_rod_are_in_line() -> None:
    """Unforced, M2 hangs in line with the crank, 802 J deep: sqrt(2 m2 depth) = 138.7 N s."""
    scene = fm.Scene(F0=0.0, alpha=0.0)
    atlas = fm.map_equilibria(scene, {"F0": [0.0]}, wells=True)
    depth = 2.0 * (scene.m2 * scene.g * scene.l + scene.c1 * scene.l**2)
    assert atlas.depth[0, 0] == pytest.approx(depth, rel=1e-12)
    assert atlas.shock_limit_m2[0, 0] == pytest.approx(np.sqrt(2.0 * scene.m2 * depth), rel=1e-10)


def test_maps_and_single_positions_agree() -> None:
    scene = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0, beta=0.0)
    atlas = fm.map_equilibria(scene, {"F0": [scene.F0]}, wells=True)
    for slot, e in enumerate(fm.find_equilibria(scene)[:2]):
        for on in ("M1", "M2", "M3"):
            told = fm.shock_limit(scene, e, on).proved.impulse
            assert getattr(atlas, f"shock_limit_{on.lower()}")[0, slot] == pytest.approx(told, rel=1e-12)
