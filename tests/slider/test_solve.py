"""Ten thousand random scenes: the right count and positions to 1e-12 wherever the proof is complete."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from slider.scenes import exact_unit_roots, loads, polynomial, random_scenes, roots

from fastmech.outcome import Outcome
from fastmech.scene import Scene
from fastmech.slider.atlas.axes import coefficient_columns
from fastmech.slider.solve import Roots, solve_rows

N = 10_000
SCENES = random_scenes(N, seed=2026)


@pytest.fixture(scope="module")
def solution() -> Roots:
    columns = coefficient_columns(Scene(alpha=0.0), SCENES)
    rows = np.stack([np.broadcast_to(np.asarray(c, dtype=np.float64), N) for c in columns], axis=1)
    return solve_rows(np.ascontiguousarray(rows))


def test_at_most_one_in_a_thousand_is_not_proved(solution: Roots) -> None:
    proved = np.count_nonzero(solution.outcome == Outcome.COMPLETE)
    print(f"proved complete: {proved} of {N}")
    assert proved >= 0.999 * N
    assert not (solution.outcome == Outcome.UNPROVED).any()


def test_counts_are_those_of_the_polynomial(solution: Roots) -> None:
    """Unit roots of the degree-6 polynomial: in doubles where plain, at 60 digits where not."""
    off = np.abs(np.log(np.abs(roots(polynomial(*loads(SCENES))))))
    on = off < 1e-8
    plain = (on | (off > 1e-4)).all(axis=1)
    assert np.count_nonzero(plain) > 0.97 * N
    proved = solution.outcome == Outcome.COMPLETE
    np.testing.assert_array_equal(on.sum(axis=1)[plain & proved], solution.count[plain & proved])
    for k in np.flatnonzero(~plain & proved)[:60]:
        assert exact_unit_roots({name: float(v[k]) for name, v in SCENES.items()}) == solution.count[k]


def newton_in_long_double(phi: Any, theta: Any, a: Any, b: Any, C: Any, f: Any) -> tuple[Any, Any]:
    """Newton steps in 64-bit mantissas on the unreduced equations of rest."""
    phi, theta = phi.astype(np.longdouble), theta.astype(np.longdouble)
    a, b, C, f = (x[:, None] for x in (a, b, C, f))
    for _ in range(4):
        k, s = C * np.cos(phi + theta), C * np.sin(phi + theta)
        g1 = a * np.cos(phi) + f * np.sin(phi) - k
        g2 = b * np.sin(theta) + f * np.cos(theta) - k
        h11, h22 = f * np.cos(phi) - a * np.sin(phi) + s, b * np.cos(theta) - f * np.sin(theta) + s
        d = h11 * h22 - s * s
        phi, theta = phi - (h22 * g1 - s * g2) / d, theta - (h11 * g2 - s * g1) / d
    return phi, theta


def test_positions_to_1e_12(solution: Roots) -> None:
    assert np.finfo(np.longdouble).eps < 2e-19, "needs 80-bit long doubles"
    phi, theta = newton_in_long_double(solution.phi, solution.theta, *loads(SCENES))
    moved = np.hypot((phi - solution.phi).astype(float), (theta - solution.theta).astype(float))
    proved = (solution.outcome == Outcome.COMPLETE)[:, None] & np.isfinite(solution.phi)
    print(f"largest error of a proved position: {moved[proved].max():.1e} rad")
    # An equilibrium near a fold moves by more than 1e-12 when the parameters' last bits change: then its
    # proved radius says so.
    assert (moved[proved] <= np.maximum(1e-12, solution.radius[proved])).all()
    assert np.mean(moved[proved] <= 1e-12) >= 0.9999
    assert (moved[proved] <= solution.radius[proved] + 1e-15).all()
