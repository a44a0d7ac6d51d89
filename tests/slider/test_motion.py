"""Energy bounds of whole ensembles: right energies, the same for every company and number of threads."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from ensembles.starts import Floats, random_starts

from fastmech.ensembles import threads
from fastmech.ensembles.work_precision import FUNCTION, Counted
from fastmech.kernels.sincos import REDUCTION_LIMIT
from fastmech.scene import Scene
from fastmech.slider.coefficients import Coefficients, reduce
from fastmech.slider.geometry import positions, velocities
from fastmech.slider.kernels.select import lagrange_rates
from fastmech.slider.lagrange import unit
from fastmech.slider.motion import LANES, SLACK, SceneMotion

pytestmark = pytest.mark.nojit

PLAIN_PYTHON = os.environ.get("NUMBA_DISABLE_JIT") == "1"
CONSTANT = Scene(m1=3.0, m2=7.0, m3=5.0, l=0.8, c1=90.0, c2=210.0, beta=33.0, F0=-140.0, alpha=0.0)
UNDAMPED = CONSTANT.replace(beta=0.0)
SCENES = [
    CONSTANT,
    UNDAMPED,
    CONSTANT.replace(alpha=0.4),
    UNDAMPED.replace(alpha=0.4, F0=90.0),
    Scene(F0=0.0),
]


def energy_of_points(scene: Scene, y: Floats) -> Floats:
    """T + Pi - F x2 [J] from places and velocities of the points, less a constant, paper (8)-(10)."""
    at, v = positions(scene, y), velocities(scene, y)
    kinetic = 0.5 * (scene.m1 * (v.x1**2 + v.y1**2) + scene.m2 * (v.x2**2 + v.y2**2) + scene.m3 * v.x3**2)
    s1, c1, s2, c2 = np.sin(y[:, 0]), np.cos(y[:, 0]), np.sin(y[:, 1]), np.cos(y[:, 1])
    weights = scene.g * (scene.m1 * at.y1 + scene.m2 * at.y2)
    springs = -(scene.l**2) * (scene.c1 * (s1 * c2 + c1 * s2) + scene.c2 * s1)
    return np.asarray(kinetic + weights + springs - scene.F0 * at.x2)


def own_scenes(n: int, seed: int) -> Coefficients:
    """Coefficients of each of n trajectories; some without force, decay or damper."""
    random = np.random.default_rng(seed)
    values = random.uniform(0.5, 20.0, (8, n))
    for row in values[5:]:
        row[random.random(n) < 0.3] = 0.0
    values[5] *= random.choice([-1.0, 1.0], n)
    return Coefficients(*values)  # type: ignore[arg-type]


def part(c: Coefficients, members: Any) -> Coefficients:
    return Coefficients(*(np.asarray(v)[members] if np.ndim(v) else v for v in c))


def odd_states(n: int, seed: int) -> Floats:
    """States of which some are far out, huge or not finite."""
    random, states = np.random.default_rng(seed), random_starts(n, seed)
    odd = [np.nan, np.inf, -np.inf, 1e200, -1e300, 0.0, REDUCTION_LIMIT, 2.0 * REDUCTION_LIMIT, 1e9]
    which = random.random((n, 4)) < 0.05
    states[which] = random.choice(odd, which.sum())
    return states


@pytest.mark.parametrize("scene", [CONSTANT, Scene(alpha=0.0)])
def test_energies_are_those_of_the_points(scene: Scene) -> None:
    """Up to a constant, and for angles beyond the range of the packed trigonometry too."""
    y = random_starts(50)
    y[::5, :2] += 2.0**21
    c, right = reduce(scene), energy_of_points(scene, y) / unit(scene)
    total = SceneMotion(c).energies(y)[0]
    np.testing.assert_allclose(total - total[0], right - right[0], rtol=1e-12, atol=1e-11)
    highest = 0.5 * SceneMotion(c).speed(y) ** 2  # above the least that the potential can be
    np.testing.assert_allclose(highest - highest[0], right - right[0], rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize("scene", SCENES)
def test_where_the_bounds_lie(scene: Scene) -> None:
    """Ends whose energy misses a bound by a little more or less than is let pass; a rate makes it."""
    n, c = 200, reduce(scene)
    start, final = random_starts(n), random_starts(n, seed=1)
    decays = c.decay != 0.0 and c.force != 0.0
    before, *_, scale = SceneMotion(c).energies(start)
    reach = 2.0 - np.sign(c.force) * (np.cos(start[:, 0]) - np.sin(start[:, 1]))
    final[:, 2:] = 0.0
    rest = SceneMotion(c).energies(final)[0]
    gained = before + (abs(c.force) * reach if decays else 0.0)
    fallen = before - (abs(c.force) * (4.0 - reach) if decays else 0.0)
    for bound, sign, holds in ((gained, 1.0, True), (fallen, -1.0, c.damping == 0.0)):
        for share, breaks in ((1.0 - 1e-6, False), (1.0 + 1e-6, True)):
            wanted = bound + sign * share * SLACK * scale - rest
            some = wanted > 0.0
            final[some, 3] = np.sqrt(2.0 * wanted[some])
            assert (SceneMotion(c).impossible(start, final)[some] == (breaks and holds)).all()
            assert some.any()


@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("n", [1, LANES - 1, LANES, 2 * LANES + 7])
def test_company_place_and_threads_change_nothing(own: bool, n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    c = own_scenes(n, seed=n) if own else reduce(UNDAMPED.replace(alpha=0.4))
    start, final = odd_states(n, seed=1), odd_states(n, seed=2)
    broken, bound = SceneMotion(c).impossible(start, final), SceneMotion(c).speed(start)
    for k in range(n):
        alone = part(c, slice(k, k + 1))
        assert SceneMotion(alone).impossible(start[k : k + 1], final[k : k + 1])[0] == broken[k]
        np.testing.assert_array_equal(SceneMotion(alone).speed(start[k : k + 1])[0], bound[k])
    order = np.random.default_rng(n).permutation(n)
    np.testing.assert_array_equal(SceneMotion(part(c, order)).speed(start[order]), bound[order])
    monkeypatch.setattr(threads, "PART", 13)
    np.testing.assert_array_equal(SceneMotion(c).impossible(start, final, 3), broken)
    np.testing.assert_array_equal(SceneMotion(c).speed(start, 3), bound)


def test_operations_are_those_of_the_equations() -> None:
    """Counted by arithmetic that counts itself; sine and cosine of one angle come together."""
    count = [0.0]
    y, c, loads = ([Counted(0.5, count) for _ in range(number)] for number in (4, 5, 2))
    trig = np.sin(y[0]), np.cos(y[0]), np.sin(y[1]), np.cos(y[1])
    lagrange_rates(trig, y[2:], c, *loads)
    assert count[0] - 2.0 * FUNCTION == pytest.approx(SceneMotion.operations, rel=0.1)


def test_ends_that_are_not_finite_and_states_that_are_locked() -> None:
    """What is not finite has an energy that no motion can have; whatever a start makes of it."""
    start, final = random_starts(8), random_starts(8)
    start[0, 0], start[2, 1] = np.nan, 1e300
    final[3, 2], final[4, 3], final[5, 0], final[6, 2] = 1e200, np.inf, np.nan, 90.0
    for states in (start, final):
        states.flags.writeable = False
    found = SceneMotion(reduce(CONSTANT)).impossible(start, final)
    assert found[3:].tolist() == [True, True, True, True, False]


def test_no_trajectories() -> None:
    none = np.empty((0, 4))
    assert SceneMotion(reduce(CONSTANT)).impossible(none, none).shape == (0,)
    assert SceneMotion(own_scenes(0, seed=0)).speed(none).shape == (0,)
