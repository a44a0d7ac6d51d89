"""Attractors by their passages of a section: Roessler's period doublings, against the flow without one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fastmech as fm


def roessler(t, x, y, z, c):  # type: ignore[no-untyped-def]
    return -y - z, x + 0.2 * y, 0.2 + z * (x - c)


def leaving(x, y, z):  # type: ignore[no-untyped-def]
    return -x


REGION = {"x": (-5.0, 5.0), "y": (-5.0, 5.0), "z": (0.0, 1.0)}


def system(c: float) -> fm.System:
    return fm.System(roessler, ["x", "y", "z"], {"c": c}, section=leaving)


@pytest.mark.parametrize(("c", "passages"), [(2.5, 1), (3.5, 2), (4.0, 4)])
def test_cycles_double_their_passages(c: float, passages: int) -> None:
    """Period doublings at c = 2.83 and 3.84 (a = b = 0.2): Strogatz, *Nonlinear Dynamics and Chaos*, 12.3."""
    (cycle,) = fm.find_attractors(system(c), REGION, 100)
    assert cycle.kind == "periodic"
    assert len(cycle.points) == passages
    np.testing.assert_allclose(cycle.points[:, 0], 0.0, atol=1e-12)  # located on the section
    assert cycle.period is not None
    run = solve_ivp(
        lambda t, y: roessler(t, *y, c), (0.0, cycle.period), cycle.points[0], method="DOP853",
        rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    np.testing.assert_allclose(run.y[:, -1], cycle.points[0], atol=1e-7)  # back after a period


@pytest.mark.slow
def test_chaos_is_a_band_on_the_section() -> None:
    (chaos,) = fm.find_attractors(system(5.7), REGION, 24)
    assert chaos.kind == "chaos"
    assert chaos.exponent == pytest.approx(0.0714, abs=0.01)  # Sprott, *Chaos and Time-Series Analysis*, 2003
    assert np.abs(chaos.points[:, 0]).max() < 1e-9


def rings(t, x, y):  # type: ignore[no-untyped-def]
    """A turn takes 2 pi; circles of radius 1/2, 1, 2 ** (1/2) and 2 repel and attract in turn."""
    r = x * x + y * y
    g = -0.02 * (r - 0.25) * (r - 1.0) * (r - 2.0) * (r - 4.0)
    return g * x - y, g * y + x


AROUND = {"x": (-2.5, 2.5), "y": (-2.5, 2.5)}


def test_motions_that_no_longer_come_to_the_section() -> None:
    """Within the circle of radius 1/2 they come to rest off it; about that of radius 1 they move on."""
    away = fm.System(rings, ["x", "y"], {}, section=lambda x, y: x - 1.3)
    starts = fm.samplers.Uniform(AROUND).draw(100, ("x", "y"), 0)
    found = fm.find_attractors(away, starts)
    outer, rest = found
    assert (outer.kind, rest.kind, rest.period) == ("periodic", "fixed point", None)
    np.testing.assert_allclose(np.hypot(*outer.points.T), 2.0, rtol=1e-9)
    np.testing.assert_allclose(rest.points, 0.0, atol=1e-12)
    assert rest.exponent == pytest.approx(-0.02 * 0.25 * 1.0 * 2.0 * 4.0, rel=1e-6)
    radius = np.hypot(*starts.T)
    np.testing.assert_array_equal(found.label, np.select([radius < 0.5, radius < 2.0**0.5], [1, -1], 0))
    assert found.counts["undecided"] == np.count_nonzero(found.label < 0) > 0


def test_places_of_rest_on_the_section_and_cycles_that_pass_it() -> None:
    through = fm.System(rings, ["x", "y"], {}, section=lambda x, y: x)
    kinds = {round(float(np.hypot(*a.points[0])), 6): a.kind for a in fm.find_attractors(through, AROUND, 60)}
    assert kinds == {0.0: "fixed point", 1.0: "periodic", 2.0: "periodic"}
    orbits = fm.periodic_orbits(through, np.column_stack([np.zeros(48), np.linspace(-2.4, -0.05, 48)]))
    told = {round(float(np.hypot(*one.points[0])) ** 2, 6): one for one in orbits}
    assert set(told) == {0.0, 0.25, 1.0, 2.0, 4.0}
    for square, one in told.items():
        assert one.stable == (square in (0.0, 1.0, 4.0))
        assert one.forcing_periods is None
        if square:
            assert one.period == pytest.approx(2.0 * np.pi, rel=1e-9)
            others = np.prod([square - other for other in (0.25, 1.0, 2.0, 4.0) if other != square])
            expected = np.exp(-0.02 * others * 2.0 * square * 2.0 * np.pi)  # d(g r)/dr over a turn
            assert one.growth == pytest.approx(expected, rel=1e-6, abs=1e-8)
        else:
            np.testing.assert_allclose(one.eigenvalues.real, -0.04, rtol=1e-6)
    assert "period 6.28319 s at" in told[4.0].name


def test_sections_that_motions_do_not_come_to_are_refused() -> None:
    def spiral(t, x, y):  # type: ignore[no-untyped-def]
        r = x * x + y * y
        return y + 0.1 * x * (1.0 - r), -x + 0.1 * y * (1.0 - r) + 0.0 * r

    ring = fm.System(spiral, ["x", "y"], {}, section=lambda x, y: x)
    found = fm.find_attractors(ring, {"x": (-2.0, 2.0), "y": (-2.0, 2.0)}, 50)
    assert len(found) == 1
    assert found.counts["captured"] == 50
    with pytest.raises(fm.InputError, match="section: no start of a sample comes to it twice"):
        fm.find_attractors(
            fm.System(spiral, ["x", "y"], {}, section=lambda x, y: x - 7.0), {"x": (-2.0, 2.0)}, 50
        )


def test_sections_that_cannot_be_are_refused() -> None:
    with pytest.raises(fm.InputError, match=r"section: takes \(x\), must take \(x, y, z\)"):
        fm.System(roessler, ["x", "y", "z"], {"c": 1.0}, section=lambda x: x)
    with pytest.raises(fm.InputError, match="section: not with a stopping condition"):
        fm.System(roessler, ["x", "y", "z"], {"c": 1.0}, section=leaving, period=1.0)
    driven = fm.System(lambda t, x, v: (v, fm.cos(t) - x - v), ["x", "v"], {}, section=lambda x, v: x)
    with pytest.raises(fm.InputError, match=r"^section: is for systems that do not depend on the time"):
        fm.find_attractors(driven, {"x": (-1.0, 1.0)}, 10)
