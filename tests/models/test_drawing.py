"""What is drawn of mechanisms: places from trigonometry, rods, guides and fixed points from what they do."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
import sympy

import fastmech as fm
from fastmech.models.drawing import Drawing, Element, drawing


def ends(found: Drawing, kind: Element) -> list[list[list[list[float]]]]:
    """Of every position the elements of a kind."""
    return found.ends[:, found.kind == kind].round(12).tolist()


def test_a_chain_has_a_rod_from_each_mass_to_the_next() -> None:
    q = np.array([[0.3, -0.7, 1.9], [2.0, 0.1, -3.0]])
    found = drawing(fm.mechanisms.pendulum_chain(3), q)
    places = np.cumsum(np.stack([np.sin(q), -np.cos(q)], axis=-1), axis=1)
    places = np.concatenate([np.zeros((2, 1, 2)), places], axis=1)
    rods = np.stack([places[:, :-1], places[:, 1:]], axis=2)
    np.testing.assert_allclose(found.ends[:, found.kind == Element.ROD], rods, atol=1e-15)
    assert found.mass[found.kind == Element.MASS].tolist() == [1.0] * 3
    loads = found.ends[:, found.kind == Element.LOAD]
    np.testing.assert_allclose(loads[:, :, 1] - loads[:, :, 0], np.broadcast_to([1.0, 0.0], (2, 3, 2)))


def test_a_truss_has_springs_for_bars_and_dampers_along_both_axes() -> None:
    truss = fm.mechanisms.von_mises_truss()
    assert Element.DAMPER not in drawing(truss, [[0.1, 0.4]]).kind  # b = 0
    found = drawing(truss.replace(b=2.0, P=-5.0), [[0.1, 0.4]])
    assert ends(found, Element.SPRING) == [[[[-1.0, 0.0], [0.1, 0.4]], [[1.0, 0.0], [0.1, 0.4]]]]
    assert ends(found, Element.DAMPER) == [[[[-1.0, 0.4], [0.1, 0.4]], [[0.1, 0.0], [0.1, 0.4]]]]
    assert ends(found, Element.LOAD) == [[[[0.1, 0.4], [0.1, 1.4]]]]  # a negative load pulls upwards
    assert {Element.ROD, Element.GUIDE}.isdisjoint(found.kind)


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        (
            "slider_pendulum",
            {"FIXED": 2, "POINT": 3, "GUIDE": 1, "ROD": 3, "SPRING": 2, "DAMPER": 1, "MASS": 3},
        ),
        (
            "cart_pendulum",
            {"FIXED": 1, "POINT": 2, "GUIDE": 1, "ROD": 1, "SPRING": 1, "MASS": 2, "TORSION_SPRING": 1},
        ),
        ("ziegler_column", {"FIXED": 1, "POINT": 2, "ROD": 2, "LOAD": 1, "MASS": 2, "TORSION_SPRING": 2}),
    ],
)
def test_elements_of_shipped_mechanisms(name: str, kinds: dict[str, int]) -> None:
    found = drawing(getattr(fm.mechanisms, name)(), [[0.4, 1.1]])
    assert Counter(Element(kind).name for kind in found.kind) == kinds


def test_of_a_mechanism_in_space_nothing_is_drawn() -> None:
    x = fm.lengths("x", -1.0, 1.0)
    made = fm.Mechanism(x, points={"M": (x, 0, 0)}, masses={"M": 1}, potential=x**2)
    assert drawing(made, [[0.2]]).kind.size == 0


def test_torsion_springs_are_at_the_joints_whose_angles_they_take() -> None:
    """Of a column of two rods: at the foot from the ground, and at the joint between the rods."""
    column = fm.mechanisms.ziegler_column().replace(b=0.1)
    found = drawing(column, [[0.4, 1.1]])
    places, _ = column.places(np.array([[0.4, 1.1]]))
    foot, joint = (places[name][0].tolist() for name in list(places)[:2])
    for kind in (Element.TORSION_SPRING, Element.TORSION_DAMPER):
        at = [spring[0] for spring in ends(found, kind)[0]]
        np.testing.assert_allclose(at, [foot, joint], atol=1e-12)
    cart = drawing(fm.mechanisms.cart_pendulum(), [[0.3, 0.7]])
    ((spring,),) = ends(cart, Element.TORSION_SPRING)
    assert spring[0] == pytest.approx([0.3, 0.0])


def test_points_of_energies_alone_are_there_and_nothing_is_drawn_between_them() -> None:
    angle = fm.angles("q")
    rod = fm.Mechanism(
        angle, {"k": 2.0}, points={"T": (sympy.sin(angle), sympy.cos(angle))}, kinetic=angle.dot**2,
        potential=sympy.cos(angle),
    )  # fmt: skip
    points, elements = rod.places([[0.5]])
    np.testing.assert_allclose(points["T"], [[np.sin(0.5), np.cos(0.5)]])
    assert elements == []
    assert drawing(rod, np.array([[0.5]])).ends.shape[0] == 1


def test_the_definition_tells_free_lengths_free_angles_and_moments_of_inertia() -> None:
    a = fm.angles("a", -1.0, 2.0)
    m, J, k, n, c, d = sympy.symbols("m J k n c d")
    point = (sympy.cos(a), sympy.sin(a))
    device = fm.Mechanism(
        a,
        {"m": 1.0, "J": 0.2, "k": 5.0, "n": 0.4, "c": 2.0, "d": 0.3},
        points={"O": (0, 2), "A": point, "B": (-1, 0)},
        masses=[fm.Body("A", m, J, a)],
        springs=[
            fm.Spring("O", "A", k, free_length=n),
            fm.Spring("B", "A", k),
            fm.TorsionSpring(a, c, free_angle=d),
        ],
    )
    rows = dict(device.definition())
    assert rows["mass m, moment of inertia J, on a"] == "at A"
    assert rows["spring k, free length n"] == "from O to A"
    assert rows["spring k"] == "from B to A"
    assert rows["torsion spring c, free angle d"] == "on a"
