"""Curves on which the damper misses a mode."""

from __future__ import annotations

import numpy as np
import pytest

from fastmech.scene import Scene
from fastmech.slider.atlas.damping import trace_undamped
from fastmech.slider.equilibria import find_equilibria
from fastmech.slider.linearize import SIN_PHI, SIN_PSI, UNLOADED
from fastmech.slider.stability import classify

#: The design's verified sets, otherwise Table 1: F0, c1, c2 and (phi, theta).
VERIFIED = {
    SIN_PHI: ((166.722372, 162.5, 17.35486052), (0.0, 0.3)),
    SIN_PSI: ((89.2075641978, 96.0, 50.0327795757), (-0.3, 0.3)),
    UNLOADED: ((60.0, 120.0, 78.4532), (-2.21414614, -1.58635572)),
    UNLOADED + " ": ((40.0, 52.5104064692, 31.79704), (-np.pi / 2, -0.65530742)),
}


@pytest.mark.parametrize("name", VERIFIED)
def test_verified_sets_lie_on_a_curve(name: str) -> None:
    (F0, c1, c2), (phi, theta) = VERIFIED[name]
    scene = Scene(c1=c1, alpha=0.0)
    axes = (
        ("F0", np.linspace(F0 - 40.0, F0 + 37.0, 41)),
        ("c2", np.linspace(max(c2 - 30.0, 0.0), c2 + 33.0, 43)),
    )
    curves = [curve for curve in trace_undamped(scene, *axes).curves if curve.vanishes == name.strip()]
    assert all(curve.residual < 1e-12 for curve in curves)
    near = min(
        np.min(
            np.abs(curve.x - F0) / 77.0
            + np.abs(curve.y - c2) / 63.0
            + np.abs(np.angle(np.exp(1j * (curve.phi - phi))))
            + np.abs(np.angle(np.exp(1j * (curve.theta - theta))))
        )
        for curve in curves
    )
    # Points of a curve are at most two hundredths apart.
    assert near < 0.02


def test_points_of_the_curves_are_stable_and_silent() -> None:
    """On a curve the eigenvalues leave the verdict open and the Hessian says minimum."""
    scene = Scene(c1=294.9, alpha=0.0)
    curves = trace_undamped(
        scene, ("F0", np.linspace(-300.0, 300.0, 61)), ("c2", np.linspace(10.0, 300.0, 41))
    ).curves
    assert {curve.vanishes for curve in curves} >= {SIN_PHI, UNLOADED}
    for curve in curves:
        for k in np.linspace(2, len(curve.x) - 3, 4).astype(int):
            point = scene.replace(F0=float(curve.x[k]), c2=float(curve.y[k]))
            e = min(
                find_equilibria(point),
                key=lambda e, k=k, curve=curve: (
                    abs(np.exp(1j * e.phi) - np.exp(1j * curve.phi[k]))
                    + abs(np.exp(1j * e.theta) - np.exp(1j * curve.theta[k]))
                ),
            )
            c = classify(point, e)
            assert c.sylvester.verdict == "stable"
            assert c.decay_rate < 1e-9
            assert c.hurwitz.verdict == "critical"


def test_no_damper_no_curve() -> None:
    scene = Scene(beta=0.0, alpha=0.0)
    found = trace_undamped(scene, ("F0", [0.0, 1.0]), ("c1", [0.0, 1.0]))
    assert (found.curves, found.everywhere, found.crossings) == ((), (), 0)


@pytest.mark.parametrize("c2", [78.4532, 10 * 9.80665 / 1.25, np.nextafter(78.4532, 79.0)])
def test_a_sheet_that_damping_misses_everywhere_is_named(c2: float) -> None:
    """c2 = m1 g / l: where R = sqrt((m2 g)^2 + F0^2) < 2 c1 l the two tilted minima have an unloaded rod.

    With a = b equilibria have cos x (R + 2 C sin x) = 0 for x = phi - atan2(f, a); the second factor gives
    U_theta,theta = C identically.
    """
    scene = Scene(F0=60.0, c1=120.0, c2=c2, alpha=0.0)
    F0, c1 = np.linspace(-400.0, 400.0, 41), np.linspace(0.0, 400.0, 41)
    found = trace_undamped(scene, ("F0", F0), ("c1", c1))
    assert [sheet.vanishes for sheet in found.everywhere] == [UNLOADED, UNLOADED]
    assert (found.unexplained, found.unfinished) == (0, 0)
    assert UNLOADED not in {curve.vanishes for curve in found.curves}
    there = np.hypot(12 * 9.80665, F0)[:, None] < 2.0 * c1 * 1.25
    for sheet in found.everywhere:
        # Cells are counted whole, so points at the rim may be left out.
        assert there.mean() - 0.03 < sheet.share <= there.mean()
        point = scene.replace(F0=sheet.x, c1=sheet.y)
        (e,) = (
            e for e in find_equilibria(point) if np.hypot(e.phi - sheet.phi, e.theta - sheet.theta) < 1e-9
        )
        assert e.kind == "minimum"
        assert classify(point, e).hurwitz.verdict == "critical"


def test_what_cannot_be_traced_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    axes = (("F0", np.linspace(-300.0, 300.0, 31)), ("c2", np.linspace(10.0, 300.0, 21)))
    scene = Scene(c1=294.9, alpha=0.0)
    whole = trace_undamped(scene, *axes)
    assert (whole.unexplained, whole.unfinished) == (0, 0)
    monkeypatch.setattr("fastmech.atlas.continuation.MOST_STEPS", 7)
    assert trace_undamped(scene, *axes).unfinished > 0
    monkeypatch.undo()
    monkeypatch.setattr("fastmech.slider.atlas.damping.MOST_POINTS", 0)
    none = trace_undamped(scene, *axes)
    assert none.curves == ()
    assert none.unexplained == none.crossings == whole.crossings > 0
