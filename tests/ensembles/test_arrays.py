"""Systems of many states, whose right-hand sides take arrays."""

from __future__ import annotations

import math
import time
import tracemalloc
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.sparse import csr_array, random_array

import fastmech as fm
from fastmech.errors import InputError

Floats = NDArray[np.float64]

N, CONDUCTIVITY = 300, 40.0


def heat(t: float, y: Any, p: Any, rates: Any) -> None:
    """A chain between walls at temperature 0."""
    n = y.size
    rates[0] = p[0] * (y[1] - 2.0 * y[0])
    for k in range(1, n - 1):
        rates[k] = p[0] * (y[k - 1] - 2.0 * y[k] + y[k + 1])
    rates[n - 1] = p[0] * (y[n - 2] - 2.0 * y[n - 1])


def conduction(n: int) -> Floats:
    return CONDUCTIVITY * (np.eye(n, k=1) - 2.0 * np.eye(n) + np.eye(n, k=-1))


def chain(n: int, **stop: Any) -> fm.System:
    return fm.System(heat, ("x", n), {"a": CONDUCTIVITY}, **stop)


@pytest.mark.parametrize(
    ("method", "dt"), [("rk4", 2e-3), ("tsit5", 4e-3), ("ab6", 2.0**-12), ("abm8", 1e-3)]
)
def test_heat_in_a_chain(method: str, dt: float) -> None:
    """Against the matrix exponential; every trajectory is what it is alone."""
    system, random = chain(N), np.random.default_rng(4)
    starts = random.uniform(-1.0, 1.0, (5, N))
    starts[0] = np.sin(np.pi * 3 * np.arange(1, N + 1) / (N + 1))
    run = fm.integrate(system, starts, 0.25, dt, method)
    right = starts @ expm(0.25 * conduction(N))
    np.testing.assert_allclose(run.y[0], right, rtol=0, atol=2e-6)
    rate = -4.0 * CONDUCTIVITY * np.sin(1.5 * np.pi / (N + 1)) ** 2  # an eigenvector
    np.testing.assert_allclose(run.y[0, 0], starts[0] * np.exp(0.25 * rate), rtol=0, atol=2e-9)
    for i in (0, 3):
        np.testing.assert_array_equal(fm.integrate(system, starts[i], 0.25, dt, method).y[:, 0], run.y[:, i])


def test_it_compiles_in_seconds() -> None:
    def own(t: float, y: Any, p: Any, rates: Any) -> None:
        for k in range(y.size):
            rates[k] = -p[0] * y[k]

    began = time.process_time()
    run = fm.integrate(fm.System(own, ("x", N), {"a": 1.0}), np.ones((2, N)), 1.0, 0.1, "dop853")
    assert time.process_time() - began < 30.0  # the driver's compilation included, where it is not there yet
    np.testing.assert_allclose(run.y[0], np.exp(-1.0), rtol=1e-8)


def test_implicitly_with_own_parameters_and_in_float32() -> None:
    n, a = 6, np.array([1.0, 40.0, 4000.0])
    starts = np.ones((3, n))
    run = fm.integrate(chain(n), starts, 0.1, 0.005, "radau5", parameters={"a": a})
    for i in range(3):
        right = expm(0.1 * a[i] / CONDUCTIVITY * conduction(n)) @ starts[i]
        np.testing.assert_allclose(run.y[0, i], right, rtol=0, atol=1e-6)
    single = fm.integrate(chain(n), starts[:1], 0.1, 0.005, "rk4", dtype="float32")
    np.testing.assert_allclose(single.y[0, 0], run.y[0, 1], atol=2e-5)


def test_to_a_tolerance_and_with_a_stop() -> None:
    n, starts = 4, np.ones((2, 4))
    run = fm.integrate(chain(n), starts, 0.1, tol=1e-7)
    right = expm(0.1 * conduction(n)) @ starts[0]
    np.testing.assert_allclose(run.y[0], np.tile(right, (2, 1)), rtol=0, atol=1e-7)

    def cold(t: float, y: Any) -> float:
        return 3.0 if y[0] < 0.5 else 0.0

    stopped = fm.integrate(chain(n, stop=cold), starts, 0.1, 1e-4)
    assert stopped.stop_code is not None
    assert stopped.stop_code.tolist() == [3, 3]
    assert (stopped.y[0, :, 0] < 0.5).all()


def graph(n: int = N) -> csr_array:
    links = random_array((n, n), density=min(0.8, 8.0 / n), rng=np.random.default_rng(5), format="coo")
    return csr_array(((links + links.T) != 0).astype(np.float64))


def kuramoto(t: float, y: Any, p: Any, rates: Any, links: Any, omega: Any) -> None:
    for i in range(y.size):
        pull = 0.0
        for k in range(links.indptr[i], links.indptr[i + 1]):
            pull += links.data[k] * math.sin(y[links.indices[k]] - y[i])
        rates[i] = omega[i] + p[0] * pull


OMEGA = np.random.default_rng(6).normal(0.0, 0.3, N)
NETWORK = fm.System(kuramoto, ("x", N), {"K": 0.3}, constants={"omega": OMEGA, "links": graph().tocoo()})


def test_a_network_is_a_sparse_matrix() -> None:
    """Kuramoto's oscillators on a random graph, against SciPy."""
    starts = fm.samplers.Uniform(dict.fromkeys(NETWORK.state, (-3.0, 3.0)), n=3)
    run = fm.integrate(NETWORK, starts, 5.0, 0.05, "dop853")
    pull = graph()
    rows = np.repeat(np.arange(N), np.diff(pull.indptr))

    def rates(t: float, y: Any) -> Any:
        each = pull.data * np.sin(y[pull.indices] - y[rows])
        return OMEGA + 0.3 * np.bincount(rows, each, N)

    for i, start in enumerate(starts.draw(3, NETWORK.state)):
        right = solve_ivp(rates, (0.0, 5.0), start, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(run.y[0, i], right, rtol=0, atol=1e-9)
    assert NETWORK.replace(K=0.1).constants is NETWORK.constants


def test_other_constants_are_another_system() -> None:
    one, two = (
        fm.System(kuramoto, ("x", 3), {"K": 1.0}, constants={"links": graph(3) * w, "omega": [0.0] * 3})
        for w in (1.0, 2.0)
    )
    assert one.prints != two.prints
    start = [0.1, 0.2, -0.3]
    once = fm.integrate(one.replace(K=2.0), start, 1.0, 0.1).y
    np.testing.assert_allclose(once, fm.integrate(two, start, 1.0, 0.1).y, rtol=1e-13)
    with pytest.raises(InputError, match=r"^rhs: takes \(t, y, p, rates, links, omega\), must take"):
        fm.System(kuramoto, ("x", 3), {}, constants={"links": graph(3)})
    with pytest.raises(InputError, match=r"^constants: only of a family of states"):
        fm.System(lambda t, x: (x,), ["x"], {}, constants={"links": graph(3)})
    with pytest.raises(InputError, match=r"^constants.links: must be real numbers"):
        fm.System(kuramoto, ("x", 3), {}, constants={"links": "all", "omega": [0.0]})


def test_memory_is_told_before_the_run() -> None:
    starts = np.zeros((400, N))
    fm.integrate(NETWORK, starts[:2], 0.1, 0.1)  # compiled
    for times in (1, 20):
        tracemalloc.start()
        fm.integrate(NETWORK, starts, t_eval=np.linspace(0.0, 0.1, times + 1)[1:], dt=0.1)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert 0.3 * fm.memory(NETWORK, 400, times) < peak < fm.memory(NETWORK, 400, times) + 2**22
    with pytest.raises(InputError, match=r"^n = 0: must be"):
        fm.memory(NETWORK, 0)


def gives(t: float, y: Any, p: Any, rates: Any) -> Any:
    return y


def unknown(t: float, y: Any, p: Any, rates: Any) -> None:
    rates[0] = nowhere(y)  # type: ignore[name-defined]  # noqa: F821


@pytest.mark.parametrize(
    ("rhs", "state", "message"),
    [
        (gives, ("x", 3), r"^rhs: returns something, must write the rates into its last argument$"),
        (unknown, ("x", 3), r"^rhs: cannot be compiled .*nowhere"),
        (heat, ("x", 0), r"^state = \('x', 0\): must be a name and a number from 1 to 10000$"),
        (lambda t, x0, x1: (x0, x1), ("x", 2), r"^rhs: takes \(t, x0, x1\), must take \(t, y, p, rates\)$"),
    ],
)
def test_what_is_refused(rhs: Any, state: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        fm.integrate(fm.System(rhs, state, {}), np.ones((1, max(state[1], 1))), 1.0, 0.1)
