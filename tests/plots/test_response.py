"""Pictures over a parameter: each curve once, ends and intervals marked, nothing where it means nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

import fastmech as fm
from fastmech.attractors.branches import Branch, FrequencyResponse
from fastmech.attractors.follow import BasinsAlong, Tipping
from fastmech.basins.measures.fractions import wilson

pytestmark = pytest.mark.nojit

SYSTEM = fm.System(lambda t, x, v, w: (v, -x), ["x", "v"], {"w": 1.0})


def branch(
    values: np.ndarray,
    sizes: np.ndarray,
    turns: float = 0.0,
    cut: bool = False,
    stops: tuple[bool, bool] = (False, False),
) -> Branch:
    """An unstable one with these amplitudes."""
    both, multipliers = np.stack([sizes, sizes], axis=1), np.full((values.size, 2), 2.0 + 0j)
    errors, own = np.full(values.size, 1e-9), np.array([turns, 0.0])
    return Branch(
        values, both, multipliers, errors, both, own, (), closed=False, cut=cut, far=False, stops=stops
    )


def curves(axes) -> list[np.ndarray]:
    """Points of dashed lines that are seen."""
    lines = [np.transpose(line.get_data()) for line in axes.lines if line.get_linestyle() == "--"]
    return [line[np.isfinite(line).all(axis=1)] for line in lines if len(line)]


def test_mirrored_branches_are_one_line_rotating_ones_none_and_cut_ends_are_marked() -> None:
    values = np.linspace(1.0, 2.0, 50)
    one = branch(values, values**2, cut=True)
    # Its mirror image, followed with other steps, and there and back in one.
    again = branch(np.linspace(1.0, 1.5, 77), np.linspace(1.0, 1.5, 77) ** 2)
    both = np.concatenate([values, values[::-1]])
    back = branch(both, 5.0 - both)
    rotating, wide = branch(values, np.full(50, np.pi), turns=1.0), branch(np.array([0.5, 3.0]), np.ones(2))
    found = FrequencyResponse("w", ("x", "v"), {}, 1, (one, again, back, rotating, wide), ()).of(SYSTEM)
    axes = found.plot(Figure().subplots())
    shown = curves(axes)
    assert_allclose(shown[0], np.stack([values, values**2], axis=1))
    assert len(shown[1]) <= 1
    assert 49 <= len(shown[2]) <= 52
    assert not any(np.isclose(line[:, 1], np.pi).all() for line in shown if len(line))
    assert "1 branch not shown: there x rotates" in axes.get_title()
    named = {line.get_label(): line.get_color() for line in axes.lines}
    solid = [line for line in axes.lines if len(line.get_xdata()) and line.get_linestyle() in ("-", "--")]
    assert {line.get_color() for line in solid} <= {c for of, c in named.items() if of.startswith("branch")}
    (dots,) = [line for line in axes.lines if line.get_linestyle() == ":" and len(line.get_xdata())]
    assert np.isfinite(dots.get_ydata()).all()
    assert len(dots.get_xdata()) == 77
    assert dots.get_color() == named["branch 2 at x = 1.00, v = 1.00"]
    (marks,) = [line for line in axes.lines if str(line.get_label()).startswith("cut off")]
    assert_allclose(np.transpose(marks.get_data()), [[1.0, 1.0], [2.0, 4.0]])
    assert "rotates" not in found.plot(Figure().subplots(), state="v").get_title()


def test_neutral_motions_have_a_line_of_their_own_and_resonance_a_logarithm() -> None:
    values = np.linspace(1.0, 2.0, 50)
    circle = np.exp(1j * values)[:, None] * (1.0 + 1e-10)
    neutral = replace(branch(values, values), multipliers=np.hstack([circle, circle.conj()]))
    for one, scale in ((neutral, "linear"), (replace(neutral, far=True), "log")):
        axes = FrequencyResponse("w", ("x", "v"), {}, 1, (one,), ()).of(SYSTEM).plot(Figure().subplots())
        (curve,) = [line for line in axes.lines if len(line.get_xdata())]
        assert (curve.get_linestyle(), axes.get_yscale()) == ("-.", scale)
        named = {line.get_label() for line in axes.lines}
        assert named & {"stable", "unstable", "neutral"} == {"neutral"}


def test_where_motions_stop_a_branch_is_marked() -> None:
    values = np.linspace(1.0, 2.0, 50)
    ends = branch(values, values**2, stops=(False, True))
    axes = FrequencyResponse("w", ("x", "v"), {}, 1, (ends,), ()).of(SYSTEM).plot(Figure().subplots())
    (mark,) = [line for line in axes.lines if line.get_label() == "motions stop"]
    assert_allclose(np.transpose(mark.get_data()), [[2.0, 4.0]])


def test_shares_have_intervals_and_are_pale_where_an_attractor_ends() -> None:
    values, shares = np.array([0.0, 1.0, 2.0]), np.array([[0.5, 0.5], [0.25, 0.75], [np.nan, 1.0]])
    tipping = (Tipping(0, "dies", 1.4, 1.6),)
    found = BasinsAlong("w", values, shares, np.zeros(3), ({}, {}, {}), tipping, 200).of(SYSTEM)
    axes = found.plot(Figure().subplots())
    (bars,) = [one for one in axes.containers if str(one.get_label()).startswith("95 %")]
    ends = np.array(bars.lines[2][0].get_segments()[:2])[:, :, 1]
    assert_allclose(ends, np.transpose(wilson(np.array([100, 50]), 200)))
    (pale,) = axes.patches
    assert (pale.get_x(), pale.get_x() + pale.get_width()) == (1.0, 2.0)
    (low, _) = axes.collections[:2]
    edge = low.get_paths()[0].vertices
    # The area is flat up to where the attractor ends, and nothing from there on.
    assert edge[np.isclose(edge[:, 0], 1.5), 1].max() == pytest.approx(0.25)
    assert edge[edge[:, 0] > 1.5 + 1e-9, 1].max() == 0.0


@pytest.mark.parametrize("turned", [1, -1])
def test_no_share_is_drawn_between_where_one_attractor_comes_and_another_goes(turned: int) -> None:
    values, shares = np.array([0.0, 1.0]), np.array([[0.5, np.nan], [np.nan, 0.75]])
    tipping = (Tipping(0, "dies", 0.6, 0.8), Tipping(1, "born", 0.1, 0.3))
    rest = np.array([0.5, 0.25])
    own = values[::turned], shares[::turned], rest[::turned]
    axes = BasinsAlong("w", *own, ({}, {}), tipping, 200).of(SYSTEM).plot(Figure().subplots())
    paths = [area.get_paths()[0] for area in axes.collections[:3]]
    places = ((0.1, 0.25), (0.1, 0.75), (0.3, 0.25), (0.6, 0.25), (0.8, 0.5), (0.8, 0.9))
    inside = [[k for k, path in enumerate(paths) if path.contains_point(place)] for place in places]
    assert inside == [[0], [2], [], [], [1], [2]]
    assert any(str(line.get_label()).endswith("blank: not known") for line in axes.lines)
