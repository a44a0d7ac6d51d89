"""The two searches beside the proof: they find what the 50-digit reference lists, and they can contradict."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

from fastmech.outcome import Outcome
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.equilibria import find_equilibria, gather, rest_polynomial

DATA = Path(__file__).parents[2] / "data" / "equilibria.toml"
REFERENCE: list[dict[str, Any]] = tomllib.loads(DATA.read_text())["scene"]
PAPER = Scene(c2=1100 / 3, alpha=0.0)


@pytest.mark.parametrize("case", REFERENCE, ids=lambda case: str(case["name"]))
def test_both_searches_agree_with_the_reference(case: dict[str, Any]) -> None:
    scene = Scene(**{name: float(value) for name, value in case["parameters"].items()})
    phi, theta = (np.array([float(e[name]) for e in case["equilibria"]]) for name in ("phi", "theta"))
    evidence = gather(reduce(scene), phi, theta, np.full(phi.size, 1e-12))
    assert (evidence.reached, evidence.unlisted) == (phi.size, 0)
    assert evidence.polynomial.agrees


def test_a_missing_equilibrium_is_noticed_by_both() -> None:
    listed = find_equilibria(PAPER)
    evidence = gather(reduce(PAPER), listed.phi[1:], listed.theta[1:], np.full(len(listed) - 1, 1e-12))
    assert evidence.unlisted == 1
    assert "and 1 others" in evidence.sentence
    assert evidence.polynomial.unexplained == 1


def test_an_invented_equilibrium_matches_no_root() -> None:
    listed = find_equilibria(PAPER)
    phi, theta = np.append(listed.phi, 0.1), np.append(listed.theta, 0.2)
    evidence = gather(reduce(PAPER), phi, theta, np.full(phi.size, 1e-12))
    assert evidence.polynomial.unmatched == 1
    assert evidence.reached == 4


#: Beside c1 = 0, F = 0, c2 = (m1 + m2) g/l, where equilibria are not isolated: U is nearly flat.
BESIDE = [(2e-10, 0.0, 1e-12), (2e-10, 0.0, -1e-12), (2e-10, 0.0, 2e-12), (2e-10, 1e-12, 1e-12)]


@pytest.mark.parametrize(("c1", "F0", "away"), BESIDE)
def test_beside_the_degenerate_set_the_list_is_proved(c1: float, F0: float, away: float) -> None:
    """Forty digits count four equilibria there, each in its ball; Newton's method stops along the valley."""
    scene = Scene(c1=c1, F0=F0, c2=22 * 9.80665 / 1.25 * (1 + away), alpha=0.0)
    found = find_equilibria(scene)
    with mpmath.workdps(40):
        m1, m2, l, g, c2, f = (
            mpmath.mpf(getattr(scene, name)) for name in ("m1", "m2", "l", "g", "c2", "F0")
        )
        a, b, C = (m1 + m2) * g - c2 * l, m2 * g, mpmath.mpf(scene.c1) * l

        def theta(phi: Any, side: int) -> Any:
            """b sin theta + f cos theta = a cos phi + f sin phi, on one of two sides."""
            pull = mpmath.asin((a * mpmath.cos(phi) + f * mpmath.sin(phi)) / mpmath.hypot(b, f))
            return (pull if side else mpmath.pi - pull) - mpmath.atan2(f, b)

        def left(phi: Any, side: int) -> Any:
            return a * mpmath.cos(phi) + f * mpmath.sin(phi) - C * mpmath.cos(phi + theta(phi, side))

        roots = []
        grid = [mpmath.mpf(k) / 100 for k in range(-314, 316)]
        for side in (0, 1):
            values = [left(phi, side) for phi in grid]
            for k in range(len(grid) - 1):
                if values[k] * values[k + 1] < 0:
                    phi = mpmath.findroot(lambda x: left(x, side), grid[k : k + 2], solver="anderson")  # noqa: B023
                    roots.append((float(phi), float(theta(phi, side))))
    assert (len(roots), len(found), found.certificate.outcome) == (4, 4, Outcome.COMPLETE)
    assert found.certificate.evidence.unlisted == 0
    for e in found:
        apart = [
            abs(np.exp(1j * e.phi) - np.exp(1j * x)) + abs(np.exp(1j * e.theta) - np.exp(1j * y))
            for x, y in roots
        ]
        assert min(apart) <= e.radius


def test_the_polynomial_vanishes_at_table_2() -> None:
    c = reduce(PAPER)
    polynomial = rest_polynomial(c.lift, c.spring, c.gravity, c.force)
    printed = np.array([0.68803, 1.45058, -1.35581, -2.44693])
    assert np.abs(polynomial(np.exp(1j * printed))).max() < 1e-4
    assert abs(polynomial(np.exp(0.5j))) > 1e-2
