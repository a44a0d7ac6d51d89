"""Wells of any mechanism and their barriers, against closed forms and floods."""

from __future__ import annotations

import math
import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import sympy
from devices import double_well
from scipy import ndimage
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

import fastmech as fm
from fastmech.capture.wells import prove_wells


def test_barriers_in_closed_form() -> None:
    wells = fm.barrier_tree(double_well())
    np.testing.assert_allclose(wells.barrier - wells.equilibria.energy[list(wells.wells)], 0.25, rtol=1e-10)
    assert "well 0 at x = -1: 0.25 J over equilibrium 2" in repr(wells)
    scene = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)
    here = [[*e.position, 0.0, 0.0] for e in fm.find_equilibria(scene) if e.kind == "minimum"]
    labels, tree = repr(fm.label_starts(scene, here)), repr(fm.barrier_tree(scene)).splitlines()
    assert len(tree) == len(here) > 1
    assert all(line.partition(":")[0] in labels for line in tree), "one position has one number"
    never = fm.barrier_tree(double_well(fm.loads.Harmonic(0.1, 2.0)))  # no label, but wells at its mean
    np.testing.assert_allclose(never.barrier, wells.barrier, rtol=1e-12)
    chain = prove_wells(fm.mechanisms.pendulum_chain(1))
    depth = chain.barrier[0] - chain.equilibria[0].energy
    assert depth == pytest.approx(2.0 * math.hypot(9.81, 3.0), rel=1e-10)
    assert chain.passes == (1,)


@pytest.mark.parametrize("load", [0.5, 1e-2, 1e-6])
def test_a_pass_that_leads_down_to_an_end_is_the_barrier(load: float) -> None:
    """U = x^3 / 3 - P x: the well at the root of P, the pass at minus it, below it only the end at -2."""
    x = fm.lengths("x", -2.0, 2.0)
    potential = x**3 / 3 - sympy.Symbol("P") * x
    snapping = fm.Mechanism(
        x, {"P": load}, kinetic=x.dot**2 / 2, potential=potential, dissipation=x.dot**2 / 10
    )
    wells = prove_wells(snapping)
    depth = wells.barrier[0] - wells.equilibria.energy[wells.wells[0]]
    assert depth == pytest.approx(4.0 / 3.0 * load**1.5, rel=1e-6, abs=1e-15)
    assert wells.passes == (1,)
    rate = math.sqrt(2.0 * depth)
    starts = [[math.sqrt(load), share * rate] for share in (0.9, -0.9, -1.1)]
    assert fm.trapped(snapping, starts).well.tolist() == [0, 0, -1]


def test_an_end_where_the_potential_rises_is_the_barrier() -> None:
    x = fm.lengths("x", -1.0, 2.0)
    bowl = prove_wells(fm.Mechanism(x, kinetic=x.dot**2 / 2, potential=x**2 / 2, dissipation=x.dot**2))
    assert bowl.barrier[0] == pytest.approx(0.5, rel=1e-9)
    assert bowl.passes == (None,)


def test_a_saddle_that_leads_back_to_its_well_is_no_way_out() -> None:
    """A ring about a hill, tilted: one well, one saddle between its arms, and the first end at x = -2."""
    x, y = fm.lengths("x y", -2.0, 2.0)
    rates = x.dot**2 + y.dot**2
    ring = fm.Mechanism(
        (x, y), kinetic=rates, potential=(x**2 + y**2 - 1) ** 2 / 4 + x / 10, dissipation=rates
    )
    wells = prove_wells(ring)
    assert [place.morse_index for place in wells.equilibria].count(1) == 1
    assert wells.passes == (None,)
    assert wells.barrier[0] == pytest.approx(9.0 / 4.0 - 0.2, rel=1e-9)


def swinging(free_length: float, stiffness: float = 100.0) -> fm.Mechanism:
    """A mass on a spring in a plane."""
    x, y = fm.lengths("x y", -2.0, 2.0)
    return fm.Mechanism(
        (x, y),
        {"k": stiffness, "L": free_length},
        points={"O": (0, 0), "M": (x, y)},
        masses={"M": 1},
        springs=[fm.Spring("O", "M", sympy.Symbol("k"), sympy.Symbol("L"))],
        dampers=[fm.Damper("O", "M", 3, along=(1, 0)), fm.Damper("O", "M", 3, along=(0, 1))],
        gravity=9.81,
        name="swing",
    )


@pytest.mark.parametrize("share", [1e-3, 0.5, 0.999, 1.01, 2.0, 10.0])
def test_a_spring_at_length_zero_is_a_peak_where_it_pushes_more_than_the_weight(share: float) -> None:
    """By hand: it pushes with k L; with less than the weight, the mass falls past it, and hangs alone."""
    found = fm.find_equilibria(swinging(0.0981 * share)).certificate
    assert found.complete
    assert len(found.peaks) == (share > 1.0)
    assert found.index_sum == found.expected_sum == 1
    assert ("a peak of the potential" in found.sentence) == (share > 1.0)
    for peak in found.peaks:
        assert (np.abs([peak.low, peak.high]) < 1e-5).all()


@pytest.mark.parametrize("free_length", [0.0981, -1.0])
def test_a_spring_at_length_zero_that_may_hold_the_mass_is_not_decided(free_length: float) -> None:
    """It pushes just as much as the weight, or it pulls: then the potential is least there."""
    found = fm.find_equilibria(swinging(free_length)).certificate
    assert not found.complete
    assert not found.peaks
    (here,) = [place for place in found.places if (place.low <= 0.0).all() and (place.high >= 0.0).all()]
    assert "a spring has length zero" in here.reason


def test_a_spring_at_length_zero_bars_no_labels() -> None:
    """A mass on a spring: one well, whose ring closes over its top; the first way out is at y = -2."""
    swing = swinging(1.0)
    wells = prove_wells(swing)
    assert len(wells.wells) == 1
    end, bottom = 50.0 - 9.81 * 2.0, -9.81 - 9.81**2 / 200.0  # U at (0, -2), and at the minimum
    assert wells.equilibria[wells.wells[0]].energy == pytest.approx(bottom, rel=1e-10)
    assert end * (1.0 - 1e-9) < wells.barrier[0] <= end
    assert f"at least {end - bottom:.6g} J to an end" in " ".join(str(wells).split())
    assert wells.passes == (None,)
    rng = np.random.default_rng(4)
    found = fm.label_starts(swing, np.concatenate([rng.uniform(-1.0, 1.0, (200, 4))], axis=1))
    assert found.counts["captured"] == 200


def test_wells_of_a_height_that_is_a_tangent() -> None:
    """The double well over tan q: minima at 45 degrees, 1/4 J deep."""
    q = fm.angles("q", -1.2, 1.2)
    height = sympy.tan(q)
    bowl = fm.Mechanism(
        q, kinetic=q.dot**2, potential=height**4 / 4 - height**2 / 2, dissipation=q.dot**2 / 10, name="bowl"
    )
    wells = fm.barrier_tree(bowl)
    places = wells.equilibria.position[list(wells.wells), 0]
    np.testing.assert_allclose(places, [-math.pi / 4, math.pi / 4], atol=1e-12)
    np.testing.assert_allclose(wells.barrier - wells.equilibria.energy[list(wells.wells)], 0.25, rtol=1e-10)
    assert fm.label_starts(bowl, [[0.3, 0.0], [-0.3, 0.0]]).well.tolist() == [1, 0]


def test_an_undecided_ridge_bars_the_way() -> None:
    """The double well with a flat ridge between: all places on it are equilibria, as high as at 0."""
    x, half = fm.lengths("x", -3.0, 3.0), sympy.Rational(1, 2)
    aside = (sympy.Abs(x - half) + sympy.Abs(x + half)) / 2 - half
    potential = aside**4 / 4 - aside**2 / 2
    ridge = fm.Mechanism(x, kinetic=x.dot**2, potential=potential, dissipation=x.dot**2 / 10)
    wells = fm.barrier_tree(ridge)
    assert ((wells.barrier <= 0.0) & (wells.barrier > -1e-3)).all()
    assert fm.trapped(ridge, [[1.5, 0.4], [-1.5, 0.4], [1.5, 0.6]]).well.tolist() == [1, 0, -1]


Q = fm.angles("q")


@pytest.mark.parametrize("potential", [1 / sympy.cos(Q), -(sympy.Abs(sympy.cos(Q)) ** -0.5)], ids=str)
def test_a_potential_that_is_not_defined_everywhere_has_no_wells(potential: Any) -> None:
    gap = fm.Mechanism(Q, kinetic=Q.dot**2, potential=potential, dissipation=Q.dot**2)
    with pytest.raises(fm.InputError, match="its potential is not defined everywhere, as at q = "):
        fm.label_starts(gap, [[2.0, 1.0]])


@pytest.mark.parametrize("reach", [1.2, 3.0])
def test_a_ranges_end_may_be_the_lowest_way_out(reach: float) -> None:
    """U(1.2) = -0.2016 lies below the saddle at 0."""
    wells = prove_wells(double_well(reach=reach))
    end = min(0.0, reach**4 / 4 - reach**2 / 2)
    assert (wells.barrier <= end + 1e-12).all()
    np.testing.assert_allclose(wells.barrier, end, atol=1e-9)


def test_the_lowest_end_of_three_ranges_is_scipys() -> None:
    q = fm.lengths("x0 x1 x2", -1.0, 1.0)
    pairs = sum(a * b for a, b in pairwise(q))
    U = sum(x**2 / 2 + x**3 / 20 for x in q) + sympy.Rational(3, 10) * pairs
    chain = fm.Mechanism(q, kinetic=sum(x.dot**2 for x in q) / 2, potential=U)

    def on_end(z: np.ndarray, k: int, end: float) -> float:
        x = np.insert(z, k, end)
        return float((x**2 / 2 + x**3 / 20).sum() + 0.3 * (x[1:] * x[:-1]).sum())

    ends = [(k, end) for k in range(3) for end in (-1.0, 1.0)]
    least = [minimize(on_end, np.zeros(2), where, bounds=[(-1, 1)] * 2, tol=1e-14).fun for where in ends]
    assert prove_wells(chain).barrier == pytest.approx([min(least)], rel=1e-9)


def fold(p: float) -> fm.Mechanism:
    """A well at x = y = sqrt(p), a pass at -sqrt(p), 4/3 p^1.5 higher, and an end behind it."""
    x, y = fm.lengths("x y", -2.0, 2.0)
    U = x**3 / 3 - sympy.Symbol("p") * x + (y - x) ** 2 / 2
    rates = x.dot**2 + y.dot**2
    return fm.Mechanism((x, y), {"p": p}, kinetic=rates / 2, potential=U, dissipation=rates, name="fold")


@pytest.mark.parametrize("p", [0.5, 1e-2, 1e-4, 1e-6])
def test_a_pass_that_leads_to_an_end_is_as_high_as_it_is(p: float) -> None:
    wells = fm.barrier_tree(fold(p))
    assert len(wells.wells) == 1
    depth = wells.barrier[0] - wells.equilibria[wells.wells[0]].energy
    assert depth == pytest.approx(4.0 / 3.0 * p**1.5, rel=1e-6)
    (saddle,) = wells.passes
    assert saddle is not None
    np.testing.assert_allclose(wells.equilibria[saddle].position, -math.sqrt(p), atol=1e-9)


def test_starts_below_a_pass_near_a_fold_belong_to_the_well() -> None:
    """At rest on y = x, from the pass on to as high a place on the other side of the well."""
    p = 1e-4
    x = math.sqrt(p) * np.linspace(-1.0, 2.0, 40)[1:-1]
    starts = np.stack([x, x, 0.0 * x, 0.0 * x], axis=1)
    found = fm.label_starts(fold(p), starts)
    assert found.counts["captured"] == len(x)
    near = np.abs(x - math.sqrt(p)) < 0.25 * math.sqrt(p)  # U is convex for x > 0
    assert (fm.trapped(fold(p), starts[near]).well == found.well[near]).all()


def test_depths_on_a_map_to_a_fold_are_those_of_the_closed_form() -> None:
    p = np.geomspace(1e-6, 0.5, 7)
    depth = fm.map_equilibria(fold(0.1), {"p": p}, wells=True).depth
    np.testing.assert_allclose(np.nanmax(depth, axis=1), 4.0 / 3.0 * p**1.5, rtol=1e-6)


def first_meeting(u: np.ndarray, cell: tuple[int, ...], others: np.ndarray) -> float:
    """The energy from which on a place's component on a grid holds one of others."""
    low, high = u[cell], u.max() + 1.0
    for _ in range(45):
        middle = 0.5 * (low + high)
        number, _ = ndimage.label(u < middle, np.ones((3, 3)))
        met = number[cell] != 0 and bool((number[others] == number[cell]).any())
        low, high = (low, middle) if met else (middle, high)
    return float(high)


def test_barriers_against_floods_of_any_potentials() -> None:
    """Of quartics that leave through passes and through ends: neither above nor below a fine grid's."""
    x, y = fm.lengths("x y", -1.0, 1.0)
    powers = [(i, j) for i in range(5) for j in range(5) if 0 < i + j <= 4]
    U = sum(sympy.Symbol(f"a{i}{j}") * x**i * y**j for i, j in powers)
    rates = x.dot**2 + y.dot**2
    quartic = fm.Mechanism(
        (x, y), {f"a{i}{j}": 0.1 for i, j in powers}, kinetic=rates, potential=U, dissipation=rates
    )
    rng, grid = np.random.default_rng(8), np.linspace(-1.0, 1.0, 401)
    ways = set()
    for _ in range(30):
        a = rng.normal(0.0, [0.1 if i + j == 1 else 2.0 for i, j in powers])
        device = quartic.replace(**{f"a{i}{j}": value for (i, j), value in zip(powers, a, strict=True)})
        try:
            wells = prove_wells(device)
        except fm.InputError:  # no well
            continue
        u = sum(value * grid[:, None] ** i * grid**j for (i, j), value in zip(powers, a, strict=True))
        places = wells.equilibria.position[list(wells.wells)]
        cells = [tuple(int(k) for k in np.abs(grid[:, None] - place).argmin(axis=0)) for place in places]
        for row, cell in enumerate(cells):
            others = np.ones(u.shape, dtype=bool)
            others[1:-1, 1:-1] = False
            for other in cells[:row] + cells[row + 1 :]:
                others[other] = True
            met = first_meeting(u, cell, others)
            np.testing.assert_allclose(wells.barrier[row], met, atol=3e-4 * float(np.ptp(u)))
            ways.add(wells.passes[row] is None)
    assert ways == {True, False}


def test_a_barrier_in_four_coordinates_is_the_lowest_saddle_that_leads_out() -> None:
    """A row of coupled masses with two places each: wells that saddles join, by SciPy's steepest descents."""
    x = fm.lengths("x1 x2 x3 x4", -2.2, 2.2)
    potential = sum((q**2 - 1) ** 2 / 4 for q in x) + sum((a - b) ** 2 for a, b in pairwise(x)) / 20
    rates = sum(q.dot**2 for q in x)
    row = fm.Mechanism(
        x, kinetic=rates / 2, potential=potential + x[0] / 10 - x[2] / 20, dissipation=rates / 3
    )
    wells = prove_wells(row)

    def force(_: float, q: Any) -> Any:
        found = q - q**3 - np.array([0.1, 0.0, -0.05, 0.0])
        found[:-1] -= 0.1 * (q[:-1] - q[1:])
        found[1:] -= 0.1 * (q[1:] - q[:-1])
        return found

    places, lowest = wells.equilibria.position, dict[int, tuple[float, int]]()
    for saddle in np.flatnonzero([place.morse_index == 1 for place in wells.equilibria]):
        q, ends = places[saddle], []
        curved = np.diag(3.0 * q**2 - 1.0) + 0.1 * (np.diag([1.0, 2.0, 2.0, 1.0]))
        curved -= 0.1 * (np.eye(4, k=1) + np.eye(4, k=-1))
        along = np.linalg.eigh(curved)[1][:, 0]
        for side in (1e-3, -1e-3):
            end = solve_ivp(force, (0.0, 400.0), q + side * along, method="LSODA", rtol=1e-8, atol=1e-10)
            apart = np.linalg.norm(places[list(wells.wells)] - end.y[:, -1], axis=1)
            assert apart.min() < 1e-3
            ends.append(wells.wells[int(apart.argmin())])
        for well in ends if ends[0] != ends[1] else []:
            lowest[well] = min(
                lowest.get(well, (np.inf, -1)), (wells.equilibria[int(saddle)].energy, int(saddle))
            )
    assert len(wells.wells) == 16
    assert dict(zip(wells.wells, wells.passes, strict=True)) == {
        w: saddle for w, (_, saddle) in lowest.items()
    }
    np.testing.assert_allclose(wells.barrier, [lowest[w][0] for w in wells.wells], rtol=1e-12, atol=1e-12)


def test_barriers_against_a_flood() -> None:
    """Of the truss: the energy at which the upper state's sublevel set first reaches the lower one."""
    truss = fm.mechanisms.von_mises_truss().replace(P=20.0)
    wells = prove_wells(truss)
    x, y = np.linspace(-0.9, 0.9, 721), np.linspace(-2.0, 2.0, 1601)
    free, k = math.hypot(1.0, 0.5), 1000.0
    grid = np.meshgrid(x, y, indexing="ij")
    stretch = [np.hypot(grid[0] + side, grid[1]) - free for side in (-1.0, 1.0)]
    u = 0.5 * k * (stretch[0] ** 2 + stretch[1] ** 2) + 20.0 * grid[1]
    cells = [
        (np.abs(x - place[0]).argmin(), np.abs(y - place[1]).argmin())
        for place in wells.equilibria.position[list(wells.wells)]
    ]
    other = np.zeros(u.shape, dtype=bool)
    other[cells[1]] = True
    met = first_meeting(u, cells[0], other)
    np.testing.assert_allclose(wells.barrier, met, atol=2e-2)  # a step of the grid


@pytest.mark.parametrize(
    ("masses", "lengths", "springs", "peaks"),
    [
        ((1.577, 0.735), (0.474, 0.611), [((-0.861, 0.45), 191.018, 0.07)], 1),
        ((1.931, 1.443), (0.461, 0.643), [((0.85, 0.56), 48.929, 0.193), ((0.308, 0.396), 65.138, 0.321)], 1),
        ((2.0, 1.5), (0.5, 0.4), [((0.6, 0.0), 60.0, 0.05), ((0.0, 0.3), 120.0, 0.0)], 0),
    ],
)
def test_springs_at_length_zero_are_no_way_out(masses: Any, lengths: Any, springs: Any, peaks: int) -> None:
    """Of double pendulums: the flood goes on to another well, or to a copy, over a higher saddle."""
    a, b = fm.angles("a b")

    def tip(of: Any, a: Any, b: Any) -> Any:
        return lengths[0] * of.sin(a) + lengths[1] * of.sin(b), -lengths[0] * of.cos(a) - lengths[1] * of.cos(
            b
        )

    feet = {f"S{k}": foot for k, (foot, *_) in enumerate(springs)}
    pendulum = fm.Mechanism(
        (a, b),
        points=feet
        | {"elbow": (lengths[0] * sympy.sin(a), -lengths[0] * sympy.cos(a)), "tip": tip(sympy, a, b)},
        masses=dict(zip(("elbow", "tip"), masses, strict=True)),
        springs=[fm.Spring(f"S{k}", "tip", *each[1:]) for k, each in enumerate(springs)],
        gravity=9.81,
    )
    wells = prove_wells(pendulum)
    assert wells.equilibria.certificate.complete
    assert len(wells.equilibria.certificate.peaks) == peaks
    assert wells.equilibria.certificate.index_sum == 0
    turn, count = 2.0 * np.pi, 240
    places = wells.equilibria.position[list(wells.wells)]
    grid = [places[0, k] + turn / count * np.arange(-2 * count, 2 * count + 1) for k in (0, 1)]
    x, y = tip(np, grid[0][:, None], grid[1])
    u = 9.81 * (masses[1] * y - masses[0] * lengths[0] * np.cos(grid[0][:, None]))
    for foot, k, free in springs:
        u = u + k / 2 * (np.hypot(x - foot[0], y - foot[1]) - free) ** 2
    others = np.ones(u.shape, dtype=bool)
    others[1:-1, 1:-1] = False
    for place in places:
        near = [
            np.abs(np.angle(np.exp(1j * (g - q)))) <= 0.5001 * turn / count
            for g, q in zip(grid, place, strict=True)
        ]
        others[np.ix_(*near)] = True
    cell = (2 * count, 2 * count)
    others[cell] = False
    assert wells.barrier[0] == pytest.approx(first_meeting(u, cell, others), abs=2e-4 * float(np.ptp(u)))
    assert wells.passes[0] is not None


def test_forces_that_do_no_work_leave_wells_and_labels() -> None:
    """Two wells on a turning table: Coriolis' force is at right angles to the rates. Ends by SciPy."""
    (u, v), spin = fm.lengths("u v", -3.0, 3.0), sympy.Symbol("W")
    table = fm.Mechanism(
        (u, v),
        {"W": 1.5},
        kinetic=(u.dot**2 + v.dot**2) / 2,
        potential=(u**2 - 1) ** 2 / 4 + v**2 / 2 + u * v / 5,
        dissipation=(u.dot**2 + v.dot**2) / 10,
        generalized_forces={u: 2 * spin * v.dot, v: -2 * spin * u.dot},
    )
    wells = prove_wells(table)
    # v = -u / 5 in a well: U = (u^2 - 1)^2 / 4 - u^2 / 50, least at u^2 = 1.04, and U = 1 / 4 between.
    depth = wells.barrier - wells.equilibria.energy[list(wells.wells)]
    np.testing.assert_allclose(depth, 0.25 - (0.04**2 / 4.0 - 1.04 / 50.0), rtol=1e-9)
    starts = np.random.default_rng(0).uniform(-1.5, 1.5, (20, 4))
    found = fm.label_starts(table, starts)
    assert found.counts["captured"] == 20

    def rates(t: float, y: Any) -> Any:
        a, b, p, q = y
        return p, q, a - a**3 - b / 5.0 - 0.2 * p + 3.0 * q, -b - a / 5.0 - 0.2 * q - 3.0 * p

    for start, well in zip(starts, found.well, strict=True):
        end = solve_ivp(rates, (0.0, 200.0), start, "DOP853", rtol=1e-9, atol=1e-10).y[:2, -1]
        np.testing.assert_allclose(end, wells.equilibria[int(well)].position, atol=0.05)


def test_a_saddle_whose_way_down_is_not_proved_is_named() -> None:
    """Two pendulums joined by a spring a million times as stiff: they turn as one, over b = pi at U = 1.5."""
    a, b = fm.angles("a b")
    device = fm.Mechanism(
        (a, b),
        kinetic=(a.dot**2 + b.dot**2) / 2,
        potential=-sympy.cos(a) - sympy.cos(b) / 2 + 10**6 * (1 - sympy.cos(a - b)),
    )
    tree = fm.barrier_tree(device)
    (row,) = [k for k, well in enumerate(tree.wells) if tree.equilibria[well].energy < -1.0]
    assert tree.barrier[row] == pytest.approx(1.5, abs=1e-9)
    text = " ".join(repr(tree).split())
    if tree.passes[row] is None:
        assert re.search(r"at least 3 J to equilibrium \d+, which is not proved to lead out", text)
    else:
        assert "3 J over equilibrium" in text
