from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from own_ends import ends

import fastmech as fm
from fastmech.basins.edge import nearest_saddle, track_edge
from fastmech.basins.label import well_of_number
from fastmech.disturbance.motion import kinetic_norm

BISTABLE = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)


def two_wells(t, x, y):
    """Wells at x = -1 and 1, a saddle at (0, 2); the boundary is x = 0."""
    return x - x * x * x, 2.0 - y


def ring(t, x, y):
    """r' = r (r^2 - 1)(4 - r^2), angle' = 1: ends at the origin or on r = 2, parted by the orbit r = 1."""
    r2 = x * x + y * y
    rate = (r2 - 1.0) * (4.0 - r2)
    return x * rate - y, y * rate + x


def test_the_edge_of_two_wells_is_the_saddle_between() -> None:
    track = track_edge(
        fm.System(two_wells, ["x", "y"], {}), [-0.7, -1.0], [1.6, 0.3], lambda y: (y[:, 0] > 0.0).astype(int),
        np.eye(2), t_end=60.0, tolerance=1e-4, dt=0.02,
    )  # fmt: skip
    assert track.settled
    assert track.labels == (0, 1)
    np.testing.assert_allclose(track.state, [0.0, 2.0], atol=1e-4)
    assert (track.gap < 1e-10).all()
    # On the boundary y - 2 falls as exp(-t).
    decay = (track.y[:, 1] - 2.0) / np.exp(-track.t)
    np.testing.assert_allclose(decay[:2], decay[0], rtol=1e-3)


def test_an_orbit_on_the_edge_never_settles() -> None:
    track = track_edge(
        fm.System(ring, ["x", "y"], {}), [0.1, 0.0], [1.9, 0.0], lambda y: (np.hypot(*y.T) > 1.0).astype(int),
        np.eye(2), t_end=30.0, dt=0.02,
    )  # fmt: skip
    assert not track.settled
    assert not track.lost
    np.testing.assert_allclose(np.hypot(*track.y.T), 1.0, atol=1e-6)


@pytest.mark.parametrize(("from_well", "energy"), [(0, 163.932229), (1, 129.471686)])
def test_the_bistable_mechanism_s_edge_lands_on_a_saddle(from_well: int, energy: float) -> None:
    wells = [e for e in fm.find_equilibria(BISTABLE) if e.kind == "minimum"]
    places = np.array([[e.phi, e.theta, 0.0, 0.0] for e in wells])
    inside = places[from_well]
    # From the one well straight to the other; from the other one to the first's copy a turn of phi further.
    outside = places[1 - from_well] + (0.0 if from_well == 0 else np.array([-2.0 * np.pi, 0.0, 0.0, 0.0]))
    track = track_edge(
        BISTABLE, inside, outside, lambda y: ends(BISTABLE, y, 60.0)[0], kinetic_norm(BISTABLE, wells[0]),
        t_end=400.0, dt=0.05,
    )  # fmt: skip
    assert track.settled
    saddle, away = nearest_saddle(BISTABLE, track.state)
    same, none = nearest_saddle(BISTABLE, saddle)
    assert ((same.phi, same.theta), none) == ((saddle.phi, saddle.theta), 0.0)
    assert saddle.morse_index == 1
    assert away < 1e-3
    assert saddle.energy == pytest.approx(energy, abs=1e-5)


def test_the_default_labels_and_norm_lead_to_the_same_saddle() -> None:
    """Of two copies of one well: between them is the saddle that the barrier tree names."""
    scene = fm.Scene(alpha=0.0)
    tree = fm.barrier_tree(scene)
    well = tree.equilibria[0]
    rest = np.array([well.phi, well.theta, 0.0, 0.0])
    track = track_edge(scene, rest, rest + np.array([0.0, 2.0 * np.pi, 0.0, 0.0]), t_end=60.0)
    assert track.settled
    assert [well_of_number(label) for label in track.labels] == [(0, (0, 0)), (0, (0, 1))]
    saddle, away = nearest_saddle(scene, track.state)
    assert away < 1e-3
    assert saddle.energy == pytest.approx(tree.barrier[0], abs=1e-9)
    turned = rest + np.array([0.0, 2.0 * np.pi, 0.0, 0.0])
    told = r"lead to well 0, \+1 turn of theta and well 0, \+1 turn of theta, must lead to two different"
    with pytest.raises(fm.InputError, match=told):
        track_edge(scene, turned, turned + 0.01, t_end=1.0)
    with pytest.raises(
        fm.InputError, match=r"^label_of, norm: missing; only a scene or a mechanism has them"
    ):
        track_edge(fm.System(two_wells, ["x", "y"], {}), [-1.0, 0.0], [1.0, 0.0], t_end=1.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"label_of": lambda y: np.zeros(len(y), dtype=int)},
            "inside, outside: lead to the label 0 and the label 0, must",
        ),
        ({"scene": fm.Scene()}, "scene.alpha = 0.7: must be 0"),
        ({"tolerance": 1e-6}, "tolerance = 1e-06: must be a finite number not less than 1e-05"),
        (
            {"scene": fm.System(two_wells, ["x", "y"], {}), "inside": np.zeros(2), "outside": np.ones(2)},
            "dt: missing; a system needs its longest step in s",
        ),
        ({"near": 1e-3}, "far = 1e-05: must be a finite number greater than 0.001"),
        ({"outside": [0.0, 0.0]}, "outside: has shape (2,), must be (4,)"),
    ],
)
def test_wrong_arguments_are_refused(changes: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {
        "scene": BISTABLE, "label_of": lambda y: (y[:, 0] > 0.5).astype(int), "inside": np.zeros(4),
        "outside": np.ones(4), "norm": np.eye(4), "t_end": 1.0,
    }  # fmt: skip
    with pytest.raises(fm.InputError) as refusal:
        track_edge(**(arguments | changes))
    assert str(refusal.value).startswith(message)


def test_two_starts_that_parted_are_not_drawn_further_apart() -> None:
    """Starts far from both run fast and take minutes: none is asked for where the two differ already."""
    asked: list[float] = []

    def label_of(y):
        asked.append(np.abs(y).max())
        return (y[:, 0] > 0.0).astype(int)

    system = fm.System(two_wells, ["x", "y"], {})
    track = track_edge(system, [-0.7, -1.0], [1.6, 0.3], label_of, np.eye(2), t_end=5.0, dt=0.02)
    assert track.t.size > 1
    assert max(asked) <= 2.0 + 1e-6
