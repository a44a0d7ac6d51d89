"""Two runs may agree by luck: a trajectory whose error has an extremum just where both steps are."""

from __future__ import annotations

import numpy as np
import pytest
from ensembles.references import errors, motions_of

from fastmech.ensembles import doubling
from fastmech.ensembles.doubling import Doubling
from fastmech.ensembles.ladder import Calibrated
from fastmech.ensembles.problem import scene_problem
from fastmech.ensembles.solve import Settings
from fastmech.integrators.methods import find_method
from fastmech.scene import Scene

SCENE = Scene(
    m1=0.3759105510241518,
    m2=4.308581918313485,
    m3=0.0,
    l=1.9351991662543027,
    c1=12.978439817110909,
    c2=36.07236713007997,
    beta=0.0,
    F0=-12.327038718355379,
    alpha=0.0,
)
START = np.array([[-1.7296843669375868, -0.9660317050342266, 2.683717782857358, 1.7236364840787326]])
T_END = 5.45803345097768
#: What a calibration on other trajectories of the scene has found.
STEP, MEDIAN, COVER, TOL = 0.002692691755700642, 0.1154, 0.1783, 1.83e-5


def run(doubted: bool, monkeypatch: pytest.MonkeyPatch) -> tuple[float, float]:
    """Estimated and true error; the trajectory is not among the worst that are measured in any case."""
    monkeypatch.setattr(doubling, "AUDITED", 0)
    monkeypatch.setattr(doubling, "LUCK", doubling.LUCK if doubted else 1e-9)
    settings = Settings(find_method("ab6"), STEP, (0.0,))
    found = Calibrated(settings, "", MEDIAN, COVER, np.empty((1, 0, 4)), np.empty(0), 0.0)
    outputs = np.array([T_END])
    solution, estimate, _ = Doubling(
        scene_problem(SCENE, 1, {}, "lagrange"), START, outputs, found, TOL, 1
    ).run(None)
    return float(estimate[0]), float(errors(solution.y, motions_of(SCENE, START, outputs))[0])


def test_a_lucky_difference_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    estimate, true = run(True, monkeypatch)
    assert true <= TOL
    assert true / 3.0 <= estimate <= 3.0 * true


def test_without_the_longer_steps_luck_would_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    estimate, true = run(False, monkeypatch)
    assert estimate < 0.1 * TOL
    assert true > 5.0 * TOL
