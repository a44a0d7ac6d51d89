"""Explicit Runge-Kutta methods of order 1 to 5, one constant each."""

from __future__ import annotations

from fastmech.integrators.tableau import Tableau

EULER = Tableau(
    name="euler", order=1, a=[[]], b=[1.0], c=[0.0], source="Euler, Institutionum calculi integralis, 1768"
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
