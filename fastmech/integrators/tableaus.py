"""Explicit Runge-Kutta methods, one constant each.

To add one, write one constant here: its tableau, order and source. It is checked when the module is
imported (shapes, row sums, every order condition), appears under its name in :data:`METHODS`, and the tests
that walk the registry measure its order.
"""

from __future__ import annotations

from fastmech.errors import InputError
from fastmech.integrators.tableau import Tableau

EULER = Tableau(
    name="euler",
    order=1,
    a=[[]],
    b=[1.0],
    c=[0.0],
    source="Euler, Institutionum calculi integralis, 1768",
)

MIDPOINT = Tableau(
    name="midpoint",
    order=2,
    a=[[], [1 / 2]],
    b=[0.0, 1.0],
    c=[0.0, 1 / 2],
    source="Runge, Math. Ann. 46 (1895)",
)

HEUN2 = Tableau(
    name="heun2",
    order=2,
    a=[[], [1.0]],
    b=[1 / 2, 1 / 2],
    c=[0.0, 1.0],
    source="Heun, Z. Math. Phys. 45 (1900)",
)

RALSTON2 = Tableau(
    name="ralston2",
    order=2,
    a=[[], [2 / 3]],
    b=[1 / 4, 3 / 4],
    c=[0.0, 2 / 3],
    source="Ralston, Math. Comp. 16 (1962): least bound of the truncation error",
)

HEUN3 = Tableau(
    name="heun3",
    order=3,
    a=[[], [1 / 3], [0.0, 2 / 3]],
    b=[1 / 4, 0.0, 3 / 4],
    c=[0.0, 1 / 3, 2 / 3],
    source="Heun, Z. Math. Phys. 45 (1900)",
)

RK4 = Tableau(
    name="rk4",
    order=4,
    a=[[], [1 / 2], [0.0, 1 / 2], [0.0, 0.0, 1.0]],
    b=[1 / 6, 1 / 3, 1 / 3, 1 / 6],
    c=[0.0, 1 / 2, 1 / 2, 1.0],
    source="Kutta, Z. Math. Phys. 46 (1901)",
)

RK38 = Tableau(
    name="rk38",
    order=4,
    a=[[], [1 / 3], [-1 / 3, 1.0], [1.0, -1.0, 1.0]],
    b=[1 / 8, 3 / 8, 3 / 8, 1 / 8],
    c=[0.0, 1 / 3, 2 / 3, 1.0],
    source="Kutta, Z. Math. Phys. 46 (1901): the 3/8 rule",
)

DOPRI5 = Tableau(
    name="dopri5",
    order=5,
    a=[
        [],
        [1 / 5],
        [3 / 40, 9 / 40],
        [44 / 45, -56 / 15, 32 / 9],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
    ],
    b=[35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    c=[0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0],
    source="Dormand, Prince, J. Comput. Appl. Math. 6 (1980): the formula of order 5; with a fixed step the "
    "seventh stage, which serves error control only, is not needed",
)

TSIT5 = Tableau(
    name="tsit5",
    order=5,
    a=[
        [],
        [0.161],
        [-0.008480655492356989, 0.335480655492357],
        [2.8971530571054935, -6.359448489975075, 4.3622954328695815],
        [5.325864828439257, -11.748883564062828, 7.4955393428898365, -0.09249506636175525],
        [5.86145544294642, -12.92096931784711, 8.159367898576159, -0.071584973281401, -0.028269050394068383],
    ],
    b=[
        0.09646076681806523,
        0.01,
        0.4798896504144996,
        1.379008574103742,
        -3.290069515436081,
        2.324710524099774,
    ],
    c=[0.0, 0.161, 0.327, 0.9, 0.9800255409045097, 1.0],
    source="Tsitouras, Comput. Math. Appl. 62 (2011): the formula of order 5",
)

DOP853 = Tableau(
    name="dop853",
    order=8,
    a=[
        [],
        [0.05260015195876773],
        [0.0197250569845379, 0.0591751709536137],
        [0.02958758547680685, 0.0, 0.08876275643042054],
        [0.2413651341592667, 0.0, -0.8845494793282861, 0.924834003261792],
        [0.037037037037037035, 0.0, 0.0, 0.17082860872947386, 0.12546768756682242],
        [0.037109375, 0.0, 0.0, 0.17025221101954405, 0.06021653898045596, -0.017578125],
        [
            0.03709200011850479,
            0.0,
            0.0,
            0.17038392571223998,
            0.10726203044637328,
            -0.015319437748624402,
            0.008273789163814023,
        ],
        [
            0.6241109587160757,
            0.0,
            0.0,
            -3.3608926294469414,
            -0.868219346841726,
            27.59209969944671,
            20.154067550477894,
            -43.48988418106996,
        ],
        [
            0.47766253643826434,
            0.0,
            0.0,
            -2.4881146199716677,
            -0.590290826836843,
            21.230051448181193,
            15.279233632882423,
            -33.28821096898486,
            -0.020331201708508627,
        ],
        [
            -0.9371424300859873,
            0.0,
            0.0,
            5.186372428844064,
            1.0914373489967295,
            -8.149787010746927,
            -18.52006565999696,
            22.739487099350505,
            2.4936055526796523,
            -3.0467644718982196,
        ],
        [
            2.273310147516538,
            0.0,
            0.0,
            -10.53449546673725,
            -2.0008720582248625,
            -17.9589318631188,
            27.94888452941996,
            -2.8589982771350235,
            -8.87285693353063,
            12.360567175794303,
            0.6433927460157636,
        ],
    ],
    b=[
        0.054293734116568765,
        0.0,
        0.0,
        0.0,
        0.0,
        4.450312892752409,
        1.8915178993145003,
        -5.801203960010585,
        0.3111643669578199,
        -0.1521609496625161,
        0.20136540080403034,
        0.04471061572777259,
    ],
    c=[
        0.0,
        0.05260015195876773,
        0.0789002279381516,
        0.1183503419072274,
        0.2816496580927726,
        0.3333333333333333,
        0.25,
        0.3076923076923077,
        0.6512820512820513,
        0.6,
        0.8571428571428571,
        1.0,
    ],
    source="Dormand, Prince; coefficients of DOP853 in Hairer, Norsett, Wanner, Solving ODEs I, "
    "section II.5: the twelve-stage formula of order 8",
)

#: Every method by its name.
METHODS: dict[str, Tableau] = {
    value.name: value for value in list(globals().values()) if isinstance(value, Tableau)
}


def find_method(name: str) -> Tableau:
    """The tableau of a method by its name.

    Raises:
        InputError: no such method; the message lists the known ones.
    """
    if name not in METHODS:
        raise InputError(f"method = {name!r}: unknown; known: {', '.join(METHODS)}")
    return METHODS[name]
