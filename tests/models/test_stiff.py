"""Equilibria beside stiff springs against mpmath: narrow curved valleys, on which they are well apart."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp
from proofs import newton, unlisted

import fastmech as fm
from fastmech.arrays import Floats
from fastmech.models.equilibria import RestingPlaces, prove_equilibria

NAMES = ("k", "kt", "a", "b", "c", "d", "m")


def four_bar(**values: float) -> Any:
    """Crank a, coupler b (a stiff spring), rocker c on a torsion spring, base d; masses at both joints."""
    q1, q2 = fm.angles("q1"), fm.angles("q2", -3.0, 3.0)
    k, kt, a, b, c, d, m = sp.symbols(NAMES)
    return fm.Mechanism(
        (q1, q2),
        values,
        points={"A": (a * sp.cos(q1), a * sp.sin(q1)), "B": (d + c * sp.cos(q2), c * sp.sin(q2))},
        masses={"A": m, "B": m},
        springs=[fm.Spring("A", "B", k, b), fm.TorsionSpring(q2 - 1.5, kt)],
        gravity=9.81,
    )


def slopes(q1: Any, q2: Any, values: dict[str, float]) -> tuple[Any, Any, Any]:
    """By hand: dU/dq, and the part across the coupler's force, which does not depend on it."""
    k, kt, a, b, c, d, m = (values[name] for name in NAMES)
    f = mpmath if isinstance(q1, mpmath.mpf) else np
    g, at = (mpmath.mpf("9.81"), mpmath.mpf("1.5")) if f is mpmath else (9.81, 1.5)
    x, y = d + c * f.cos(q2) - a * f.cos(q1), c * f.sin(q2) - a * f.sin(q1)
    u1, u2 = x * a * f.sin(q1) - y * a * f.cos(q1), -x * c * f.sin(q2) + y * c * f.cos(q2)
    pull = k * (1 - b / f.sqrt(x * x + y * y))
    s1, s2 = m * g * a * f.cos(q1), m * g * c * f.cos(q2) + kt * (q2 - at)
    return pull * u1 + s1, pull * u2 + s2, s1 * u2 - s2 * u1


def on_the_rigid_linkage(values: dict[str, float]) -> list[tuple[float, float]]:
    """Where forces across the coupler's change their sign along the curve on which its length is b."""
    a, b, c, d = (values[name] for name in "abcd")
    turn, found = np.linspace(-np.pi, np.pi, 40_001), []
    for way in (-1.0, 1.0):
        for crank in (True, False):  # |D + r e(angle)| = b with D from one joint to the other link's pivot
            x, y, r = (
                (d - a * np.cos(turn), -a * np.sin(turn), c)
                if crank
                else (-d - c * np.cos(turn), -c * np.sin(turn), a)
            )
            with np.errstate(invalid="ignore"):
                gamma = np.arccos((b**2 - x**2 - y**2 - r**2) / (2.0 * r * np.hypot(x, y)))
            other = np.angle(np.exp(1j * (np.arctan2(y, x) + way * gamma)))
            q1, q2 = (turn, other) if crank else (other, turn)
            across = slopes(q1, q2, values)[2]
            at = np.flatnonzero((across[1:] * across[:-1] < 0.0) & (np.abs(np.diff(other)) < 1.0))
            found += [(float(q1[k]), float(q2[k])) for k in at if abs(q2[k]) < 3.0]
    return found


def confirmed(start: Any, values: dict[str, float]) -> Floats | None:
    """The zero of the forces near a place, by Newton's method in forty digits."""
    with mpmath.workdps(40):
        exact = {name: mpmath.mpf(value) for name, value in values.items()}
        try:
            zero = mpmath.findroot(lambda *q: slopes(*q, exact)[:2], [mpmath.mpf(float(x)) for x in start])
        except ValueError:
            return None
        return np.array([float(zero[0]), float(zero[1])])


def hessian(place: Floats, values: dict[str, float]) -> tuple[Any, Any, Any]:
    """d2U/dq1^2, d2U/dq2^2 and the determinant, by differences in forty digits."""
    with mpmath.workdps(40):
        exact, q = {name: mpmath.mpf(x) for name, x in values.items()}, [mpmath.mpf(float(x)) for x in place]
        a, b = (
            [mpmath.diff(lambda *x, i=i: slopes(*x, exact)[i], q, n) for n in ((1, 0), (0, 1))]
            for i in (0, 1)
        )
        return a[0], b[1], a[0] * b[1] - a[1] * b[0]


def away(a: Any, b: Any) -> float:
    return float(np.abs(np.angle(np.exp(1j * (np.asarray(a) - b)))).max())


def check(found: RestingPlaces, values: dict[str, float]) -> int:
    """Each listed one is a zero within its radius, and each zero on the rigid linkage is listed; how many."""
    for place in found:
        zero = confirmed(place.position, values)
        assert zero is not None
        assert away(place.position, zero) <= place.radius + 1e-15
        index = 1 if (J := hessian(zero, values))[2] < 0 else 0 if J[0] > 0 else 2
        assert place.morse_index == index
    zeros = [confirmed(start, values) for start in on_the_rigid_linkage(values)]
    known = [zero for zero in zeros if zero is not None and abs(zero[1]) < 3.0]
    for zero in known:
        assert min(away(place.position, zero) for place in found) < 1e-9
    return len(known)


@pytest.mark.parametrize("k", [1e4, 1e6, 1e8])
@pytest.mark.slow
def test_a_linkage_with_a_stiff_coupler_is_decided(k: float) -> None:
    """Lengths for which the coupler always has one; a stiffness matrix of condition up to 1e10."""
    rng, total, worst = np.random.default_rng(2), 0, 0.0
    bar = four_bar(k=1.0, kt=1.0, a=0.5, b=1.0, c=0.6, d=1.2, m=1.0)
    for _ in range(8):
        a, c = rng.uniform(0.3, 0.6, 2)
        d = (a + c) * rng.uniform(1.1, 1.5)
        values = {
            "k": k, "kt": 10.0 ** rng.uniform(-1, 2), "a": a, "b": d * rng.uniform(0.7, 1.2), "c": c, "d": d,
            "m": float(rng.choice([0.01, 0.1, 1.0])),
        }  # fmt: skip
        found = fm.find_equilibria(bar.replace(**values))
        assert found.certificate.complete, found.certificate.sentence
        total += check(found, values)
        worst = max(worst, *(float(np.linalg.cond(place.stiffness)) for place in found))
    assert total >= 16
    assert worst > 0.1 * k


@pytest.mark.parametrize(
    "values",
    [
        (2.9249e7, 3.6049, 0.13105, 0.15579, 0.11427, 0.21535, 10.0),
        (1.1685e6, 36.302, 0.33091, 1.0572, 0.59729, 0.34791, 0.01),
    ],
)
def test_beside_a_coupler_of_length_zero_nothing_is_said_to_merge(values: tuple[float, ...]) -> None:
    given = dict(zip(NAMES, values, strict=True))
    _, _, a, _, c, d, _ = (given[name] for name in ("k", "kt", "a", "b", "c", "d", "m"))
    found = fm.find_equilibria(four_bar(**given))
    assert check(found, given) > 0
    crank = np.arccos((a**2 + d**2 - c**2) / (2.0 * a * d))
    both = [
        np.array([way * crank, np.arctan2(way * a * np.sin(crank), a * np.cos(crank) - d)]) for way in (-1, 1)
    ]
    assert found.certificate.complete
    peaks = found.certificate.peaks
    assert {min((0, 1), key=lambda k: away(place.low, both[k])) for place in peaks} == {0, 1}
    for place in peaks:
        assert "has length zero" in place.reason
        assert min(away(0.5 * (place.low + place.high), zero) for zero in both) < 1e-5


@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.slow
def test_a_bead_on_a_stiff_wall_is_decided(power: int) -> None:
    """A hanging bead on the outside of a circle that it hardly enters; by hand along the circle."""
    X, Y = fm.lengths("X Y", -2.0, 2.1)
    k, K = sp.symbols("k K")
    r2 = (X - sp.Rational(3, 10)) ** 2 + (Y + 1) ** 2
    wall = sp.Max(0, 1 - (sp.sqrt(r2) if power == 1 else r2)) ** 2 / 2
    U = k * (X**2 + Y**2) / 2 + Y + K * wall
    bead = fm.Mechanism((X, Y), {"k": 2.0, "K": 1e6}, kinetic=X.dot**2 + Y.dot**2, potential=U)
    found = fm.find_equilibria(bead)
    reach = float(
        np.hypot(0.3, 0.5)
    )  # the bead's free place (0, -1/2) lies inside; it is pushed out straight
    places = {place.kind: place.position for place in found}
    np.testing.assert_allclose(places["minimum"], [0.3 - 0.3 / reach, -1.0 + 0.5 / reach], atol=1e-5)
    np.testing.assert_allclose(places["saddle"], [0.3 + 0.3 / reach, -1.0 - 0.5 / reach], atol=1e-5)
    if power == 1:  # of the middle no more is known than that the wall pushes in all directions
        (place,) = found.certificate.places
        np.testing.assert_allclose(0.5 * (place.low + place.high), [0.3, -1.0], atol=1e-5)
        assert "not be defined" in place.reason
    else:
        assert found.certificate.complete
        assert found.certificate.index_sum == 1


@pytest.mark.slow
def test_two_arms_on_a_spring_of_5e8_are_decided_and_a_limit_is_told() -> None:
    """Three springs and weights; a search by Newton's method finds nothing beside the list."""
    q1, q2 = fm.angles("q1 q2")
    elbow = (sp.sin(q1), -sp.cos(q1))
    hand = (elbow[0] + 1.1832 * sp.sin(q2), elbow[1] - 1.1832 * sp.cos(q2))
    arms = fm.Mechanism(
        (q1, q2),
        {},
        points={"O": (0, 0), "G": (0.7694, 0.89747), "A": elbow, "B": hand},
        masses={"A": 1.0, "B": 1.37985},
        springs=[
            fm.Spring("G", "B", 10.0, free_length=0.965),
            fm.Spring("O", "B", 4.8557e8, free_length=0.5),
            fm.Spring("G", "A", 5.63),
        ],
        gravity=9.81,
    )
    found = fm.find_equilibria(arms)
    zeros = newton(arms.statics(), [], 2000, 0)
    assert unlisted(arms.statics(), [], found, zeros) == []
    assert len(found) == len(zeros) == 8
    assert found.certificate.complete
    assert not found.certificate.peaks, "where the soft spring has length zero the stiff one pulls more"
    assert found.certificate.index_sum == 0
    few = prove_equilibria(arms.statics(), [], 12_500).certificate
    assert "the limit on the number of boxes was reached" in few.sentence
    assert "isolated" not in few.sentence
