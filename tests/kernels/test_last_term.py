"""The last term of an Adams predictor: Hairer's gamma times a backward difference, kept by both drivers."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from ensembles.starts import Floats, random_starts

from fastmech.ensembles.problem import scene_problem
from fastmech.ensembles.run import Ensemble, run_ensemble
from fastmech.integrators.method import Adams
from fastmech.integrators.methods import METHODS
from fastmech.integrators.multistep_weights import bashforth
from fastmech.kernels.last_term import EVERY, term_weights
from fastmech.scene import Scene

#: gamma_0, gamma_1, ... (Hairer, Norsett, Wanner, Solving ODEs I, table III.1.1).
GAMMA = [Fraction(*g) for g in ((1, 1), (1, 2), (5, 12), (3, 8), (251, 720), (95, 288), (19087, 60480))]

H, STEPS = 0.02, 60


@pytest.mark.parametrize("k", range(1, 8))
def test_weights_are_those_of_the_difference(k: int) -> None:
    """The last term of t^(k-1) is gamma_(k-1) (k-1)!, and polynomials of lower degree have none."""
    weights = term_weights(np.array(bashforth(k), dtype=np.float64))
    times = -np.arange(float(k))
    for degree in range(k):
        expected = float(GAMMA[k - 1]) * float(np.prod(np.arange(1.0, k))) if degree == k - 1 else 0.0
        rounding = 1e-15 * np.abs(weights) @ np.abs(times**degree)
        assert weights @ times**degree == pytest.approx(expected, abs=rounding)


def kept(name: str, formulation: str, outputs: Floats, starts: Floats) -> Ensemble:
    problem = scene_problem(Scene(alpha=0.0), len(starts), {}, formulation)
    times = np.concatenate([[0.0], outputs])
    return run_ensemble(problem.rhs, problem.params, problem.inward(starts), times, H, METHODS[name])


@pytest.mark.parametrize("formulation", ["lagrange", "hamilton"])
@pytest.mark.parametrize("name", ["ab6", "abm8"])
def test_the_greatest_is_kept(name: str, formulation: str) -> None:
    """Against NumPy's differences of the rates at every step; one piece is looked at every few steps."""
    starts, method = random_starts(20), METHODS[name]
    assert isinstance(method, Adams)
    problem = scene_problem(Scene(alpha=0.0), 20, {}, formulation)
    every = kept(name, formulation, H * np.arange(1.0, STEPS + 1.0), starts)
    rates = np.concatenate([starts[None], problem.outward(every.states)])[:, :, 2:]
    k = method.predictor.size
    terms = np.abs(np.diff(rates, n=k - 1, axis=0)).max(axis=2) * H * float(GAMMA[k - 1])
    # Of one step each: before every step but the first ones. A step's history ends where it begins.
    np.testing.assert_allclose(every.last_term, terms[:-1].max(axis=0), rtol=1e-6)
    looked = [step - k + 1 for step in range(0, STEPS, EVERY) if step >= k - 1]
    whole = kept(name, formulation, np.array([H * STEPS]), starts)
    np.testing.assert_allclose(whole.last_term, terms[looked].max(axis=0), rtol=1e-6)
    assert (whole.last_term < every.last_term).any()


def test_a_one_step_method_has_none() -> None:
    assert not kept("rk4", "lagrange", np.array([1.0]), random_starts(5)).last_term.any()
