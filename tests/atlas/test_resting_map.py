"""Maps of any mechanism's equilibria: against the scene's map, single proofs and verdicts, closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy

import fastmech as fm
from fastmech.models.stability import VERDICTS
from fastmech.outcome import Outcome


@pytest.mark.slow
def test_the_papers_mechanism_has_the_scenes_map() -> None:
    axes = {"F0": np.linspace(-300.0, 300.0, 13), "c1": np.linspace(40.0, 400.0, 11)}
    scene = fm.map_equilibria(fm.Scene(alpha=0.0, c2=92.85), axes)
    found = fm.map_equilibria(fm.mechanisms.slider_pendulum().replace(alpha=0.0, c2=92.85), axes)
    both = (scene.outcome == Outcome.COMPLETE) & (found.outcome == Outcome.COMPLETE)
    assert both.mean() > 0.95
    np.testing.assert_array_equal(found.count[both], scene.count[both])
    slots = found.position.shape[2]
    for k in np.argwhere(both):
        place = tuple(k)
        own = found.count[place]
        order = np.lexsort((scene.phi[place][:own], np.round(scene.energy[place][:own], 6)))
        ours = np.lexsort((found.position[place][:own, 0], np.round(found.energy[place][:own], 6)))
        np.testing.assert_allclose(
            found.energy[place][:own][ours], scene.energy[place][:own][order], rtol=1e-10, atol=1e-9
        )
        np.testing.assert_array_equal(
            found.morse_index[place][:own][ours], scene.morse_index[place][:own][order]
        )
        away = found.position[place][:own][ours, 0] - scene.phi[place][:own][order]
        assert np.abs(np.sin(away / 2.0)).max() < 1e-9
    assert np.isnan(found.energy[..., slots - 1]).any() or slots == found.count.min()


def test_every_point_is_what_one_call_says() -> None:
    chain = fm.mechanisms.pendulum_chain(2)
    axes = {"F": np.linspace(0.0, 9.0, 7), "c": np.linspace(0.5, 20.0, 5)}
    found = fm.map_equilibria(chain, axes, threads=2)
    again = fm.map_equilibria(chain, axes, threads=1)
    np.testing.assert_array_equal(found.position, again.position)
    for i, F in enumerate(axes["F"]):
        for j, c in enumerate(axes["c"]):
            one = chain.replace(F=float(F), c=float(c))
            rest = fm.find_equilibria(one)
            assert found.outcome[i, j] == rest.certificate.outcome
            assert found.count[i, j] == len(rest)
            for k, place in enumerate(rest):
                away = np.abs(np.sin((found.position[i, j] - place.position) / 2)).sum(axis=1)
                slot = int(np.nanargmin(away))
                np.testing.assert_allclose(found.energy[i, j, slot], place.energy, rtol=1e-12, atol=1e-12)
                assert found.morse_index[i, j, slot] == place.morse_index
                single = fm.classify(one, place)
                assert VERDICTS[found.verdict[i, j, slot]] == single.verdict, (F, c, k)
                np.testing.assert_allclose(
                    found.eigenvalues[i, j, slot].real, single.eigenvalues.real, atol=1e-6
                )


@pytest.mark.slow
def test_wells_are_as_deep_as_closed_forms_and_the_scene_s() -> None:
    """A pendulum of weight m g that F pushes sideways is 2 l sqrt((m g)^2 + F^2) deep."""
    chain, masses = fm.mechanisms.pendulum_chain(1), np.array([0.5, 1.0, 3.0])
    swings = fm.map_equilibria(chain, {"m": masses}, wells=True)
    deep = 2.0 * chain.parameters["l"] * np.hypot(masses * chain.parameters["g"], chain.parameters["F"])
    assert swings.depth is not None
    np.testing.assert_allclose(np.nanmax(swings.depth, axis=1), deep, rtol=1e-9)
    assert (np.isfinite(swings.depth) == (swings.morse_index == 0)).all()
    axes, own = {"F0": np.array([-40.0, 20.0, 150.0])}, {"alpha": 0.0, "c2": 92.85}
    scene = fm.map_equilibria(fm.Scene(**own), axes, wells=True)
    found = fm.map_equilibria(fm.mechanisms.slider_pendulum().replace(**own), axes, wells=True)
    assert found.depth is not None
    for ours, theirs in zip(found.depth, scene.depth, strict=True):
        np.testing.assert_allclose(
            np.sort(ours[np.isfinite(ours)]), np.sort(theirs[np.isfinite(theirs)]), rtol=1e-9
        )
    with pytest.raises(fm.InputError, match="wells = 'yes': must be True or False"):
        fm.map_equilibria(chain, {"m": masses}, wells="yes")  # type: ignore[arg-type]
    with pytest.raises(fm.InputError, match="potential"):
        fm.map_equilibria(fm.mechanisms.ziegler_column(), {"P": [1.0, 2.0]}, wells=True)


def test_ziegler_s_column_flutters_beyond_its_load() -> None:
    """P l / k = 7/2 - sqrt(2) undamped; 41/28 + b^2 / (2 k m l^2) with dashpots."""
    column = fm.mechanisms.ziegler_column()
    for b, limit in ((0.0, 3.5 - math.sqrt(2.0)), (0.4, 41.0 / 28.0 + 0.4**2 / 2.0)):
        loads = limit * np.array([0.5, 0.999, 1.001, 1.2])
        found = fm.map_equilibria(column.replace(b=b), {"P": loads})
        upright = np.abs(found.position).max(axis=2).argmin(axis=1)
        unstable = VERDICTS.index("unstable")
        assert (found.verdict[np.arange(4), upright] == unstable).tolist() == [False, False, True, True]


def test_the_truss_snaps_at_its_closed_form() -> None:
    """The upper state ends at 2 k L0 (1 - cos^(2/3) a)^(3/2), or goes sideways before."""
    truss = fm.mechanisms.von_mises_truss()
    k, span, rise = (truss.parameters[name] for name in ("k", "span", "rise"))
    length, cosine = math.hypot(span / 2, rise), span / 2 / math.hypot(span / 2, rise)
    snap = 2.0 * k * length * (1.0 - cosine ** (2.0 / 3.0)) ** 1.5
    found = fm.map_equilibria(truss, {"P": snap * np.array([0.99, 1.01])})
    upper = [(found.position[i, :, 1] > 0.2) & (np.abs(found.position[i, :, 0]) < 1e-9) for i in (0, 1)]
    assert upper[0].sum() == 2  # a minimum or a saddle, and a maximum along the path
    assert upper[1].sum() == 0


@pytest.mark.parametrize(
    ("axes", "told"),
    [
        ({"Q": [1.0]}, "axes.Q: unknown parameter"),
        ({}, "must map at least one parameter"),
        ({"F": [[1.0]]}, "must be one-dimensional"),
        ({"m": [-1.0, 1.0]}, "axes.m = -1: kinetic"),
        ({"F": [0.0, 2.0, 1.0]}, "axes.F"),
    ],
)
def test_what_is_wrong_gets_a_line(axes: dict[str, object], told: str) -> None:
    with pytest.raises(fm.InputError, match=told):
        fm.map_equilibria(fm.mechanisms.pendulum_chain(2), axes)  # type: ignore[arg-type]


def test_equally_deep_equilibria_keep_their_order() -> None:
    """Without a load the truss rests above and below alike: rounding does not decide which comes first."""
    truss = fm.mechanisms.von_mises_truss()
    found = fm.map_equilibria(truss, {"rise": np.linspace(0.2, 0.8, 31)})
    assert (found.position[:, 0, 1] < 0.0).all()
    assert (found.position[:, 1, 1] > 0.0).all()
    for k, rise in enumerate(found.axes["rise"]):
        alone = fm.find_equilibria(truss.replace(rise=float(rise)))
        np.testing.assert_allclose(found.position[k], alone.position, atol=1e-12)


def test_a_map_may_hold_no_equilibrium() -> None:
    x, a = fm.lengths("x", -1.0, 1.0), sympy.Symbol("a", real=True)
    falls = fm.Mechanism(x, {"a": 3.0}, kinetic=x.dot**2 / 2, potential=a * x)
    found = fm.map_equilibria(falls, {"a": [-1.0, 1.0, 2.0]})
    assert found.position.shape == (3, 0, 1)
    assert (found.outcome == Outcome.COMPLETE).all()
    assert fm.critical_values(falls, "a", [1.0, 2.0]) == ()
