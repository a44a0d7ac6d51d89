"""The oracle and the reference data against each other, closed forms and the paper; no fastmech here."""

from __future__ import annotations

import tomllib
from fnmatch import fnmatch
from functools import cache
from math import cos, hypot, pi, sin, sqrt
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose
from oracles import DIGITS, TABLE_1, oracle
from scipy.integrate import solve_ivp

DATA = Path(__file__).parents[1] / "data"
EXACT = 1e-30


@pytest.fixture(autouse=True)
def _many_digits() -> Any:
    """Sums and differences formed in the tests keep the oracle's digits."""
    with mpmath.workdps(DIGITS):
        yield


@cache
def read(name: str) -> dict[str, Any]:
    return tomllib.loads((DATA / name).read_text(encoding="utf-8"))


def printed_numbers() -> dict[str, Any]:
    path = DATA.parent / "fastmech" / "studies" / "paper" / "printed.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))


def draw(seed: int) -> tuple[dict[str, float], tuple[float, ...], float]:
    """Random parameters over decades, a random state and a random time."""
    random = np.random.default_rng(seed)
    params = {key: 10 ** random.uniform(-1, 2) for key in ("m1", "m2", "m3")}
    params |= {key: 10 ** random.uniform(0, 3) for key in ("c1", "c2", "beta")}
    params |= {"l": random.uniform(0.2, 4), "g": random.uniform(0, 20)}
    params |= {"F0": random.uniform(-200, 200), "alpha": random.uniform(0, 2)}
    return params, (*random.uniform(-pi, pi, 2), *random.uniform(-5, 5, 2)), random.uniform(0, 3)


def close(actual: Any, expected: Any, scale: Any, tolerance: float = EXACT) -> bool:
    return bool(abs(actual - expected) <= tolerance * (1 + abs(scale)))


SEEDS = pytest.mark.parametrize("seed", range(6))


@SEEDS
def test_covariant_equations_agree_with_lagrange(seed: int) -> None:
    """Paper (13), from metric, Christoffel symbols and virtual work, against d/dt dL/dq' - dL/dq."""
    params, y, t = draw(seed)
    q, v = y[:2], y[2:]
    a, gamma = oracle().metric(params, q), oracle().christoffel(params, q)
    Q, qdd = oracle().generalized_forces(params, q, v, t), oracle().accelerations(params, y, t)
    for k in range(2):
        left = sum(a[k][i] * qdd[i] for i in range(2))
        left += sum(gamma[k][i][j] * v[i] * v[j] for i in range(2) for j in range(2))
        assert close(left, Q[k], max(map(abs, Q)))


@SEEDS
def test_hamilton_agrees_with_lagrange(seed: int) -> None:
    params, y, t = draw(seed)
    q, v = y[:2], y[2:]
    p = oracle().momenta(params, q, v)
    a, gamma = oracle().metric(params, q), oracle().christoffel(params, q)
    qdd = oracle().accelerations(params, y, t)
    rhs = oracle().hamilton_rhs(params, q, p, t)
    assert close(rhs[0], v[0], v[0])
    assert close(rhs[1], v[1], v[1])
    for k in range(2):
        # p = a q', and da/dt follows from d_j a_ki = Gamma_{jk,i} + Gamma_{ji,k}.
        rate = sum(a[k][i] * qdd[i] for i in range(2))
        rate += sum((gamma[i][j][k] + gamma[k][j][i]) * v[i] * v[j] for i in range(2) for j in range(2))
        assert close(rhs[2 + k], rate, max(map(abs, rhs)))
    energy = oracle().kinetic_energy(params, y) + oracle().potential(params, q)
    assert close(oracle().hamiltonian(params, q, p), energy, energy)


@SEEDS
def test_newtons_equations_leave_no_residual(seed: int) -> None:
    params, y, t = draw(seed)
    reactions = oracle().reactions(params, y, t)
    assert reactions.residual <= EXACT * (1 + abs(reactions.OM1) + abs(reactions.M1M2) + abs(reactions.M1M3))


@SEEDS
def test_forces_are_minus_gradient_plus_projections(seed: int) -> None:
    """Virtual work of weights and springs is -dPi/dq; damper -beta (dx3/dphi)^2 phi', force F dx2/dq."""
    params, y, t = draw(seed)
    P = {key: mpmath.mpf(value) for key, value in params.items()}
    phi, theta, u, _ = map(mpmath.mpf, y)
    Q = oracle().generalized_forces(params, y[:2], y[2:], t)
    slope = oracle().gradient(params, y[:2])
    F = P["F0"] * mpmath.exp(-P["alpha"] * mpmath.mpf(t))
    k = mpmath.sin(phi) * (1 + mpmath.cos(phi) / mpmath.sqrt(4 - mpmath.sin(phi) ** 2))
    f = F * P["l"]
    assert close(
        Q[0], -P["beta"] * (P["l"] * k) ** 2 * u - f * mpmath.sin(phi) - slope[0], max(map(abs, slope))
    )
    assert close(Q[1], -f * mpmath.cos(theta) - slope[1], max(map(abs, slope)))


@SEEDS
def test_closed_forms(seed: int) -> None:
    """Pi, det a, paper (12) with Gamma_11,1 corrected, constraints (2) to (5) of the paper."""
    params, y, _ = draw(seed)
    P = {key: mpmath.mpf(value) for key, value in params.items()}
    m1, m2, m3, l, g = (P[key] for key in ("m1", "m2", "m3", "l", "g"))
    phi, theta = map(mpmath.mpf, y[:2])
    s, c = mpmath.sin(phi), mpmath.cos(phi)
    root = mpmath.sqrt(4 - s**2)
    total = (m1 + m2) * g * l * s - m2 * g * l * mpmath.cos(theta)
    total += P["c1"] * l**2 * (1 - mpmath.sin(phi + theta)) + P["c2"] * l**2 * (1 - s)
    assert close(oracle().potential(params, y[:2]), total, total)

    a = oracle().metric(params, y[:2])
    k = s * (1 + c / root)
    det = m2 * l**4 * (m1 + m2 * mpmath.cos(phi + theta) ** 2 + m3 * k**2)
    assert close(a[0][0] * a[1][1] - a[0][1] * a[1][0], det, a[0][0] * a[1][1])

    gamma = oracle().christoffel(params, y[:2])
    printed = -m3 * l**2 * s * (c + root) ** 2 * (-4 * c + s**2 * root) / (s**2 - 4) ** 2
    assert close(gamma[0][0][0], printed, printed)
    bend = m2 * l**2 * mpmath.cos(phi + theta)
    assert close(gamma[0][1][1], bend, bend)
    assert close(gamma[1][0][0], bend, bend)
    zeros = [gamma[0][0][1], gamma[0][1][0], gamma[1][0][1], gamma[1][1][0], gamma[1][1][1]]
    assert max(map(abs, zeros)) < EXACT

    x1, y1, x2, y2, x3, y3 = oracle().positions(params, y[:2])
    rods = (mpmath.hypot(x1, y1), mpmath.hypot(x2 - x1, y2 - y1), mpmath.hypot(x3 - x1, y3 - y1) / 2)
    assert y3 == 0
    assert all(close(length, l, l) for length in rods)


@SEEDS
def test_jacobian_against_differences(seed: int) -> None:
    params, y, t = draw(seed)
    J = oracle().jacobian(params, y, t)
    h = mpmath.mpf(10) ** -13
    for j in range(4):
        ends = [[mpmath.mpf(x) + (sign * h if i == j else 0) for i, x in enumerate(y)] for sign in (1, -1)]
        up, down = (oracle().accelerations(params, end, t) for end in ends)
        for i in range(2):
            scale = max(abs(J[2 + i][n]) for n in range(4)) + max(map(abs, up))
            assert close(J[2 + i][j], (up[i] - down[i]) / (2 * h), scale, 1e-18)


def test_reactions_of_the_hanging_mechanism() -> None:
    """By hand: everything at rest below O, the springs' forces 2 c1 l and 2 c2 l pull upwards."""
    P = {**TABLE_1, "F0": 0.0}
    r = oracle().reactions(P, (-mpmath.pi / 2, 0, 0, 0), 0)
    weight, pull = (P["m1"] + P["m2"]) * P["g"], 2 * P["l"]
    assert_allclose(float(r.M1M2), P["m2"] * P["g"] - P["c1"] * pull, rtol=1e-14)
    assert_allclose(float(r.OM1), weight - (P["c1"] + P["c2"]) * pull, rtol=1e-14)
    assert_allclose(float(r.M1M3), 0, atol=1e-12)
    assert_allclose(float(r.N), P["m3"] * P["g"], rtol=1e-14)


@cache
def equilibrium(case: str) -> tuple[Any, ...]:
    """The equilibrium of Table 2, by Newton's method on the oracle's gradient; c2 is the double of 1100/3."""
    printed = printed_numbers()["table_2"][case]
    start = (float(printed["phi"]), float(printed["theta"]))
    with mpmath.workdps(DIGITS):
        return tuple(mpmath.findroot(lambda *q: oracle().gradient(TABLE_1, q, F=100), start, tol=1e-50))


def rounds_to(value: Any, printed: str) -> bool:
    """Whether ``value`` rounds to the printed decimals."""
    decimals = len(printed.partition(".")[2])
    return f"{float(value):.{decimals}f}" == printed


@pytest.mark.parametrize("case", ["case_1", "case_2", "case_3", "case_4"])
def test_table_2(case: str) -> None:
    printed = printed_numbers()["table_2"][case]
    phi, theta = equilibrium(case)
    assert rounds_to(phi, printed["phi"])
    assert rounds_to(theta, printed["theta"])


@pytest.mark.parametrize("case", ["case_2", "case_3", "case_4"])
def test_table_3(case: str) -> None:
    """To the printed digit, but for the two misprinted elements of case 4."""
    printed = printed_numbers()["table_3"][case]["hessian"]
    H = oracle().hessian(TABLE_1, equilibrium(case), F=100)
    wrong = {(i, j) for i in range(2) for j in range(2) if not rounds_to(H[i][j], printed[i][j])}
    assert wrong == ({(0, 1), (1, 1)} if case == "case_4" else set())


@pytest.mark.parametrize("case", ["case_2", "case_3", "case_4"])
def test_table_4(case: str) -> None:
    """The computed coefficients, rounded as read, fit the legible digits."""
    printed = printed_numbers()["table_4"][case]
    coefficients = oracle().characteristic_polynomial(TABLE_1, equilibrium(case), F=100)
    readings, patterns = printed["read_as"], printed["coefficients"]
    for value, reading, pattern in zip(reversed(coefficients), readings, patterns, strict=True):
        assert rounds_to(-value, reading)
        assert fnmatch(reading, pattern)


def test_case_1_is_a_copy_of_case_3() -> None:
    """Tables 3 and 4 repeat case 3; the true values were computed independently of this oracle."""
    printed = printed_numbers()
    for table in ("table_3", "table_4"):
        first, third = printed[table]["case_1"], printed[table]["case_3"]
        assert {key: first[key] for key in third} == third
    H = oracle().hessian(TABLE_1, equilibrium("case_1"), F=100)
    assert_allclose(np.array(H, dtype=float), [[87.916, -201.204], [-201.204, -316.435]], atol=5e-4)
    polynomial = oracle().characteristic_polynomial(TABLE_1, equilibrium("case_1"), F=100)
    assert_allclose(np.array(polynomial, dtype=float), [1, 4.634, -30.063, -78.206, -111.798], atol=5e-4)


def total(terms: list[dict[str, str]], phi: float, theta: float) -> tuple[float, float]:
    """Sum of printed terms, and the largest error that their rounding explains."""
    names = {"sin": sin, "cos": cos, "sqrt": sqrt, "phi": phi, "theta": theta}
    value = error = 0.0
    for term in terms:
        factor = float(eval(term["factor"], {"__builtins__": {}}, names))
        decimals = len(term["value"].partition(".")[2])
        value += float(term["value"]) * factor
        error += abs(factor) * (0.5 * 10**-decimals if decimals else 0.0)
    return value, error


def misfit_of_equation_16(q: tuple[float, float], p: tuple[float, float], closed_at_end: bool) -> float:
    """|H printed - H| in units of what the rounding of the printed coefficients explains."""
    printed = printed_numbers()["equation_16"]
    weights = {"p_phi_2": p[0] ** 2, "p_theta_2": p[1] ** 2, "p_phi_p_theta": p[0] * p[1]}
    parts = {key: total(printed[key], *q) for key in ("potential", *weights)}
    numerator = sum(weights[key] * parts[key][0] for key in weights)
    slack = sum(abs(weights[key]) * parts[key][1] for key in weights)
    bracket = printed["denominator"]
    outside, inside, after = (total(bracket[key], *q)[0] for key in ("outside", "inside", "after"))
    s2 = sin(q[0]) ** 2
    denominator = outside + s2 * (inside + after) if closed_at_end else outside + s2 * inside + after
    # 303.24 contradicts (20)'s 303.234, so its error is 0.001 more than half its last digit.
    explained = parts["potential"][1] + 0.001 * abs(sin(q[0])) + slack / abs(denominator)
    H = float(oracle().hamiltonian(TABLE_1, q, p))
    return abs(parts["potential"][0] + numerator / denominator - H) / explained


@SEEDS
def test_equation_16_once_its_bracket_is_closed_at_the_end(seed: int) -> None:
    _, (phi, theta, p1, p2), _ = draw(seed)
    assert misfit_of_equation_16((phi, theta), (10 * p1, 10 * p2), closed_at_end=True) <= 1


def test_equation_16_as_printed_is_wrong() -> None:
    assert misfit_of_equation_16((0.3, 0.5), (20.0, -50.0), closed_at_end=False) > 5


@SEEDS
def test_equation_20(seed: int) -> None:
    _, (phi, theta, *_), _ = draw(seed)
    slopes = oracle().gradient(TABLE_1, (phi, theta), F=100)
    for name, slope in zip(("phi", "theta"), slopes, strict=True):
        value, error = total(printed_numbers()["equation_20"][name], phi, theta)
        assert abs(value - float(slope)) <= error


def test_reference_equilibria() -> None:
    """Every gradient vanishes to the stored digits, and the Morse index is the Hessian's."""
    for scene in read("equilibria.toml")["scene"]:
        params = scene["parameters"]
        census = [0, 0, 0]
        for e in scene["equilibria"]:
            q = (mpmath.mpf(e["phi"]), mpmath.mpf(e["theta"]))
            assert all(-mpmath.pi < x <= mpmath.pi + 1e-28 for x in q), scene["name"]
            H = mpmath.matrix(oracle().hessian(params, q, F=params["F0"]))
            slope = oracle().gradient(params, q, F=params["F0"])
            assert hypot(*map(float, slope)) <= 1e-28 * float(mpmath.norm(H)), scene["name"]
            signs = [int(mpmath.sign(x)) for x in mpmath.eigsy(H, eigvals_only=True)]
            assert signs == e["hessian_signs"], scene["name"]
            assert signs.count(-1) == e["morse_index"], scene["name"]
            census[e["morse_index"]] += 1
        assert census in ([1, 2, 1], [2, 3, 1], [1, 3, 2]), scene["name"]


def test_reference_motion() -> None:
    """SciPy's DOP853 on the oracle's accelerations reaches the stored states of the first two seconds."""
    data = read("paper_motion.toml")
    assert data["parameters"] == dict(TABLE_1)
    names = ("phi", "theta", "phi_dot", "theta_dot")
    start = [data["start"][name] for name in names]
    assert start == [4 * pi / 13, pi / 7, 0.0, 0.0]

    def rhs(t: float, y: np.ndarray) -> list[float]:
        return [*y[2:], *map(float, oracle().accelerations(TABLE_1, tuple(map(float, y)), t))]

    stored = [s for s in data["state"] if s["t"] <= 2]
    solution = solve_ivp(rhs, (0, 2), start, "DOP853", t_eval=[1, 2], rtol=1e-13, atol=1e-13)
    assert_allclose(solution.y, [[float(s[name]) for s in stored] for name in names], atol=1e-11)
