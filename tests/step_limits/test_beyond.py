"""Each trajectory's step is judged by itself: alone as in company, by growth that shows, at start and end."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from ensembles.references import motions_of

import fastmech as fm
from fastmech.ensembles.threads import in_parts
from fastmech.integrators.implicit_method import ImplicitRungeKutta
from fastmech.integrators.method import Adams
from fastmech.integrators.methods import METHODS
from fastmech.mechanism.coefficients import Coefficients, reduce
from fastmech.stability.linearize import jacobian
from fastmech.step_limits.amplification import amplifies, companion, principal_root, stability_function
from fastmech.step_limits.beyond import StepJudge, StepsTaken
from fastmech.step_limits.growth import mark_growing, stiffest_growing
from fastmech.step_limits.limits import CERTAIN
from fastmech.step_limits.local import eigenvalue_bound, eigenvalues, local_motion, part, state_matrices
from fastmech.step_limits.modes import factored, polished
from fastmech.step_limits.predict import stable_step
from fastmech.step_limits.region import region, rows_of, sectors_of
from fastmech.step_limits.warning import step_limit, step_warning

SCENE = fm.Scene(c2=1100 / 3, alpha=0.0)
TOO_LARGE = fm.Status.STEP_TOO_LARGE
EXPLICIT = [name for name, method in METHODS.items() if not isinstance(method, ImplicitRungeKutta)]


def run(scene: fm.Scene, starts: np.ndarray, own: dict[str, np.ndarray], dt: float) -> tuple[list[int], bool]:
    """Statuses, and whether the step was warned of."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        status = fm.integrate(scene, starts, 0.3, dt=dt, parameters=own).status
    return status.tolist(), any(issubclass(w.category, fm.StepWarning) for w in told)


def alone(
    scene: fm.Scene, starts: np.ndarray, own: dict[str, np.ndarray], dt: float
) -> list[tuple[int, bool]]:
    each = []
    for k in range(len(starts)):
        status, told = run(scene, starts[k : k + 1], {n: v[k : k + 1] for n, v in own.items()}, dt)
        each.append((status[0], told))
    return each


@pytest.mark.parametrize(
    ("start", "last"), [([0.3, 0.2, 0.0, 0.0], TOO_LARGE), ([1.0, 0.5, 0.0, 0.0], fm.Status.NOT_FINITE)]
)
def test_no_parameter_of_the_worst_trajectory_is_extreme(start: list[float], last: fm.Status) -> None:
    """Light masses and a strong damper together, neither of them the lightest or the strongest there is."""
    own = {
        "beta": np.array([2500.0, 10.0, 10.0, 2400.0]),
        "m1": np.array([1000.0, 2.0, 1000.0, 2.5]),
        "m2": np.array([1000.0, 1000.0, 2.0, 2.5]),
    }
    starts = np.tile(start, (4, 1))
    status, told = run(fm.Scene(), starts, own, 0.02)
    assert status == [fm.Status.OK] * 3 + [last]
    assert told
    assert alone(fm.Scene(), starts, own, 0.02) == [(fm.Status.OK, False)] * 3 + [(last, True)]


def test_a_trajectory_has_the_same_status_alone_and_in_company() -> None:
    """Many parameters that differ, some in the third digit only, on both sides of the limit."""
    rng = np.random.default_rng(0)
    own = {
        "beta": np.append(10.0 ** rng.uniform(2.5, 3.6, 15), 2000.0 * (1.0 + 2e-3 * np.arange(-12, 13))),
        "m1": np.append(10.0 ** rng.uniform(0.3, 1.7, 15), np.full(25, 9.37)),
    }
    starts = np.tile([1.0, 0.5, 0.0, 0.0], (40, 1))
    status, told = run(fm.Scene(), starts, own, 0.03)
    each = alone(fm.Scene(), starts, own, 0.03)
    assert status == [s for s, _ in each]
    assert told == any(t for _, t in each)
    assert {fm.Status.OK, TOO_LARGE} <= set(status)
    assert len(set(status[15:])) == 2


def test_a_motion_that_only_ends_where_the_step_is_too_long() -> None:
    scene, starts = SCENE.replace(beta=4e3), np.array([[1.9, 0.4, 0.0, 0.0], [1.9, 0.6, 0.0, 0.0]])
    with pytest.warns(fm.StepWarning):
        found = fm.integrate(scene, starts, 1.0, dt=0.02)
    each = np.full(2, 0.02)
    taken = StepsTaken(each, each, np.full(2, 50), 1.0)
    judge = StepJudge(scene, {}, starts, "rk4")
    assert judge.beyond(None, taken).tolist() == [False, False]
    assert judge.beyond(starts, taken).tolist() == [False, False]
    assert judge.beyond(found.y[-1], taken).tolist() == [True, True]
    assert found.status.tolist() == [TOO_LARGE] * 2


@pytest.mark.parametrize(
    ("beta", "method", "dt", "error"),
    [
        (1e-6, "ab5", 0.005, 1e-5),
        (1e-6, "midpoint", 0.002, 1e-3),
        (1e-6, "midpoint", 0.005, 1e-2),
    ],
)
def test_accurate_runs_are_not_failed(beta: float, method: str, dt: float, error: float) -> None:
    scene, start = fm.Scene(beta=beta, F0=0.0), [0.3, 0.2, 0.0, 0.0]
    expected = fm.integrate(scene, start, 5.0, dt=5e-4, method="dop853").y[-1]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fm.StepWarning)
        found = fm.integrate(scene, start, 5.0, dt=dt, method=method)
    assert np.abs(found.y[-1] - expected).max() < error
    assert found.status.tolist() == [fm.Status.OK]


@pytest.mark.parametrize(
    ("t_end", "status", "error"), [(5.0, fm.Status.OK, (0.0, 1e-6)), (14.0, TOO_LARGE, (1e-2, np.inf))]
)
def test_errors_of_an_adams_method_count_once_they_show(
    t_end: float, status: fm.Status, error: tuple[float, float]
) -> None:
    """Its parasitic root is 1.08 a step at the minima, about which the motion goes to and fro."""
    scene, start = fm.Scene(beta=1.0, F0=0.0), [0.3, 0.2, 0.0, 0.0]
    with pytest.warns(fm.StepWarning):
        run = fm.integrate(scene, start, t_end, dt=0.02, method="abm12")
    assert run.status.tolist() == [status]
    least, most = error
    assert least <= np.abs(run.y[-1, 0] - motions_of(scene, np.array([start]), [t_end])[0, 0]).max() < most


def test_growth_at_rest_counts_over_the_whole_run() -> None:
    """1e-5 beyond RK4's interval: so many steps as make 0.9 % of the fastest mode, and 1.1 %."""
    rest = next(e for e in fm.find_equilibria(SCENE) if e.morse_index == 0)
    start = np.array([[rest.phi, rest.theta, 0.0, 0.0]])
    limit = fm.largest_stable_step(SCENE, rest, "rk4")
    h = np.array([limit * (1.0 + 1e-5)])
    z = h[0] * np.linalg.eigvals(jacobian(SCENE, rest))
    growth = np.log(np.abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24).max())
    for share, expected in ((0.9, False), (1.1, True)):
        number = int(np.log1p(share * 0.01) / growth)
        taken = StepsTaken(h, h, np.array([number]), 1.0)
        assert StepJudge(SCENE, {}, start, "rk4").beyond(None, taken).tolist() == [expected]


@pytest.mark.parametrize("method", ["midpoint", "heun2", "ab5", "abm12", "tsit5", "rk4"])
def test_a_weak_damper_is_as_none(method: str) -> None:
    none = step_limit(fm.Scene(beta=0.0, F0=0.0), method)
    assert none > 0.0
    for beta in (1e-12, 1e-9, 1e-6):
        assert step_limit(fm.Scene(beta=beta, F0=0.0), method) == pytest.approx(none, rel=0.02)
        within = step_warning(fm.Scene(beta=beta, F0=0.0), 0.95 * none, method)
        assert within is None


@pytest.mark.parametrize("method", ["midpoint", "heun2", "ralston2"])
def test_a_mode_that_the_damper_does_not_reach_leaves_a_limit(method: str) -> None:
    """At this equilibrium sin(phi + theta) = 0: a mode's real part is rounding, of either sign."""
    scene = fm.Scene(alpha=0.0, F0=89.2075641978, c1=96.0, c2=50.0327795757)
    assert step_limit(scene, method) > 1e-3
    for real in (-1e-17, 0.0, 1e-17, -1e-13):
        limit = stable_step(METHODS[method], [real + 1j, real - 1j])
        assert limit == pytest.approx(0.02, rel=1e-3)  # |R(iy)|^2 = 1 + y^4/4, so y^3/8 = 1e-6


@pytest.mark.parametrize("name", METHODS)
def test_what_is_amplified(name: str) -> None:
    """Against R itself, and the eigenvalues of the history's map."""
    rng, method = np.random.default_rng(1), METHODS[name]
    z = (-rng.uniform(0, 1.5, 400) + 1j * rng.uniform(0, 1.5, 400)) * np.repeat([1.0, 0.1], 200)
    factor = 1.0 + 10.0 ** rng.uniform(-7, -1, 400)
    if not isinstance(method, Adams):
        expected = np.abs(stability_function(method, z))
    else:
        roots = np.linalg.eigvals(companion(method, z))
        expected = np.abs(roots).max(axis=-1)
        near = np.abs(z) < 0.05
        nearest = np.abs(roots - np.exp(z)[:, None]).argmin(axis=-1)[:, None]
        own = np.take_along_axis(roots, nearest, axis=-1)[:, 0]
        np.testing.assert_allclose(principal_root(method, z[near]), own[near], rtol=1e-10)
    assert amplifies(method, z, factor).tolist() == (expected > factor).tolist()


def test_bound_and_dwelling() -> None:
    """No eigenvalue exceeds the bound; a motion is where it was for as long as an integration says."""
    rng = np.random.default_rng(2)
    scene = fm.Scene(alpha=0.0, beta=300.0)
    undamped = fm.Scene(alpha=0.0, beta=0.0)
    states = np.column_stack([rng.uniform(-3, 3, (50, 2)), np.zeros((50, 2))])
    largest = np.abs(eigenvalues(state_matrices(reduce(scene), *states[:, :2].T))).max(axis=1)
    assert (largest <= eigenvalue_bound(local_motion(reduce(scene), states)) * (1 + 1e-12)).all()
    # From rest, for a hundredth of the time that the acceleration needs for 1 rad: 1e-4 rad.
    times = local_motion(reduce(undamped), states).time
    for state, time in zip(states[:10], times[:10], strict=True):
        end = fm.integrate(undamped, state, time / 100.0, dt=time / 400.0).y[-1, 0]
        assert np.abs(end - state)[:2].max() == pytest.approx(1e-4, rel=1e-2)


def random_motions(seed: int, n: int) -> tuple[Coefficients, np.ndarray]:
    """Scenes of every damping, where they may be and how fast."""
    rng = np.random.default_rng(seed)
    wide = 10.0 ** rng.uniform([[-1], [-1], [0], [1], [0], [-3]], [[1], [1], [3], [3], [2], [6]], (6, n))
    mass, slider, lift, spring, force, damping = wide
    c = Coefficients(mass, slider, lift, spring, np.full(n, 9.8), force, damping, np.zeros(n))  # type: ignore[arg-type]
    return c, np.column_stack([rng.uniform(-3, 3, (n, 2)), rng.uniform(-5, 5, (n, 2))])


def test_modes_are_the_eigenvalues() -> None:
    """Against LAPACK's of the state matrices, whose rounding is relative to the fastest mode."""
    c, states = random_motions(3, 1000)
    c.damping[:300] *= 1e-3
    motion = local_motion(c, states)
    expected = eigenvalues(state_matrices(c, *states[:, :2].T))
    found = 0
    for k in range(len(states)):
        polynomial = [float(p[k]) for p in motion[:4]]
        with np.errstate(all="ignore"):
            a, b, c_, d, sure = factored(*(np.float64(p) for p in polynomial))
            if not sure:
                continue
            rough = np.concatenate([np.roots([1.0, a, b]), np.roots([1.0, c_, d])]).astype(complex)
            parts = [polished(np.float64(z.real), np.float64(z.imag), *polynomial) for z in rough]
        own = np.sort_complex(np.array([real + 1j * imaginary for real, imaginary, exact in parts if exact]))
        exact = np.sort_complex(expected[k])
        assert own.size == 4
        np.testing.assert_allclose(own, exact, rtol=1e-7, atol=1e-12 * np.abs(exact).max())
        found += 1
    assert found > 500


def test_factors_where_both_modes_are_equally_fast() -> None:
    """Quadratics of equal last coefficients, told apart by the damping alone."""
    cases = [
        (a, b, c, d) for a, c in ((0.5, 0.1), (2.0, 0.2)) for b, d in ((4, 4), (4, 4 + 1e-7), (4.0001, 4))
    ]
    for a, b, c, d in cases:
        product = np.polymul([1.0, a, b], [1.0, c, d])
        with np.errstate(invalid="ignore"):
            found = factored(*(np.float64(p) for p in product[1:]))
        assert found.found
        pairs = sorted([(found.a, found.b), (found.c, found.d)])
        np.testing.assert_allclose(pairs, sorted([(a, b), (c, d)]), rtol=1e-6)


@pytest.mark.parametrize("name", EXPLICIT)
def test_no_table_acquits_what_grows(name: str) -> None:
    """At random places of the half plane, most of them near the region's boundary."""
    rng, method, table = np.random.default_rng(4), METHODS[name], region(name)
    edge = np.array([1e-3 * 1.06 ** np.argmax(column > 1e-4) for column in table.sector.T])
    inward = rng.uniform(0, 1, 4000) ** 2
    z = -inward + 1j * (1.0 - inward)
    z *= edge[sectors_of(z.real, z.imag)] * rng.uniform(0.5, 1.1, z.size) / np.abs(z)
    growth = table.sector[rows_of(np.abs(z)), sectors_of(z.real, z.imag)]
    allowed = 10.0 ** rng.uniform(-6, -2, z.size)
    acquits = growth <= CERTAIN * allowed
    assert not amplifies(method, z[acquits], np.exp(allowed[acquits])).any()
    assert acquits.mean() > 0.2  # and it does acquit


def judged(name: str, c: Coefficients, states: np.ndarray, dt: np.ndarray, number: np.ndarray) -> list[bool]:
    verdicts = np.zeros(len(states), dtype=np.int8)
    mark_growing(METHODS[name], c, states, dt, number, verdicts)
    assert verdicts.max() <= 1
    return [bool(v) for v in verdicts]


def by_definition(
    name: str, c: Coefficients, states: np.ndarray, dt: np.ndarray, number: np.ndarray, spurious: float
) -> list[bool | None]:
    """The rule itself from LAPACK's eigenvalues of every matrix; None where rounding decides."""
    method, motion, expected = METHODS[name], local_motion(c, states), []
    values = eigenvalues(state_matrices(c, *states[:, :2].T))
    there = np.minimum(np.maximum(motion.time / dt, 1.0), number)
    for k in range(len(states)):
        z = dt[k] * values[k]
        z = z[(z.real < -1e-6 * np.abs(z)) & (z.imag >= 0.0)]
        if isinstance(method, Adams):
            roots = np.linalg.eigvals(companion(method, z)) if z.size else np.zeros((0, 1))
            own, largest = np.log(np.abs(principal_root(method, z))), np.log(np.abs(roots).max(axis=-1))
            own = np.where(np.isnan(own), -1.0, own)
            grown = np.maximum(own * there[k] / np.log(1.01), largest * number[k] / np.log(spurious))
            grown = np.minimum(grown, largest * there[k] / np.log(1.01))
        else:
            grown = np.log(np.abs(stability_function(method, z))) * there[k] / np.log(1.01)
        most = grown.max(initial=0.0)
        expected.append(None if abs(most - 1.0) < 1e-6 else bool(most > 1.0))
    return expected


@pytest.mark.parametrize(
    ("name", "size", "least"),
    [("rk4", 3.0, 40), ("dop853", 5.0, 40), ("abm8", 1.0, 5), ("abm12", 0.8, 20)],
)
def test_verdicts_are_the_rule(name: str, size: float, least: int) -> None:
    """And nobody's company changes them, nor which of them is found the stiffest.

    An Adams mode's own root rarely grows: its other roots are no verdict after a run, only warned of before.
    """
    c, states = random_motions(5, 400)
    c.damping[:200] *= 1e-3
    number = np.full(400, 300)
    dt = size * np.random.default_rng(6).uniform(0.1, 1.5, 400) / eigenvalue_bound(local_motion(c, states))
    verdicts = judged(name, c, states, dt, number)
    expected = by_definition(name, c, states, dt, number, np.inf)
    sure = [k for k, e in enumerate(expected) if e is not None]
    assert len(sure) > 390
    assert [verdicts[k] for k in sure] == [expected[k] for k in sure]
    assert least <= sum(verdicts) < 360
    one = [slice(k, k + 1) for k in range(400)]
    alone = [judged(name, part(c, k), states[k], dt[k], number[k])[0] for k in one]
    assert alone == verdicts
    same = float(np.median(dt))
    place, far = stiffest_growing(METHODS[name], c, states, same, 300.0)
    growing = by_definition(name, c, states, np.full(400, same), number, 1e4)
    assert None not in growing
    assert any(growing)
    assert place == np.argmax(np.where(growing, eigenvalue_bound(local_motion(c, states)), 0.0))
    assert not far
    assert stiffest_growing(METHODS[name], c, states, 1e-9, 300.0) == (None, True)


def test_who_is_condemned_is_judged_no_more() -> None:
    c, states = random_motions(8, 70)
    c.damping[:] = 0.0
    verdicts = np.ones(70, dtype=np.int8)
    mark_growing(METHODS["rk4"], c, states, np.ones(70), np.ones(70), verdicts)
    assert verdicts.tolist() == [1] * 70


def shared(threads: int, work: Callable[[slice], None], n: int, part: int) -> None:
    in_parts(work, n, threads, part // 4 - 25)


def test_parts_in_threads_have_the_verdicts_of_the_whole() -> None:
    """Steps about the limit, angles beyond the packed trigonometry's range, and some that are no numbers."""
    n = 3 * 2**12 + 5
    scene = fm.Scene(alpha=0.0)
    rng = np.random.default_rng(9)
    starts = np.column_stack([rng.uniform(-3, 3, (n, 2)), np.zeros((n, 2))])
    starts[::77, 0] += 2e6
    starts[5, 1], starts[n - 1, 0] = np.nan, np.inf
    own = {"beta": rng.uniform(100, 4e3, n)}
    each = np.full(n, 0.02)
    judge, taken = StepJudge(scene, own, starts, "rk4"), StepsTaken(each, each, np.full(n, 50), 1.0)
    whole = judge.beyond(starts[::-1], taken)
    for threads in (1, 3):
        share = partial(shared, threads)
        assert judge.beyond(starts[::-1], taken, share).tolist() == whole.tolist()
    assert 0.05 < whole.mean() < 0.95


@pytest.mark.parametrize("method", ["rk4", "ab6", "dop853", "tsit5"])
@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_no_trajectories_are_judged_without_a_word(method: str, alpha: float) -> None:
    run = fm.integrate(fm.Scene(alpha=alpha), np.zeros((0, 4)), 1.0, dt=0.5, method=method)
    assert run.status.shape == (0,)


def test_a_start_that_grows_is_told_after_a_warning_too() -> None:
    """What is known of starts from before the run spares no trajectory whose end alone is innocent."""
    scene, dt, random = fm.Scene(alpha=0.0), 0.02, np.random.default_rng(3)
    own = {"beta": 10.0 ** random.uniform(2.0, 4.0, 400)}
    starts = random.uniform(-3.0, 3.0, (400, 4)) * [1.0, 1.0, 0.0, 0.0]
    taken = StepsTaken(np.full(400, dt), np.full(400, dt), np.full(400, 500.0), 10.0)
    grow = StepJudge(scene, own, starts, "rk4").beyond(None, taken)
    ends, harmless = starts.copy(), ~grow
    for _ in range(50):  # places where those that grow would not
        there = random.permutation(starts)
        spared = ~StepJudge(scene, own, there, "rk4").beyond(None, taken) & ~harmless
        ends[spared], harmless = there[spared], harmless | spared
    assert np.count_nonzero(grow & harmless) > 5
    judge = StepJudge(scene, own, starts, "rk4")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        judge.warn([scene], dt, 500.0)
    np.testing.assert_array_equal(judge.beyond(ends, taken)[harmless], grow[harmless])
