"""Two runs may agree by luck: a trajectory whose error has an extremum just where both steps are."""

from __future__ import annotations

import math

import numpy as np
from ensembles.references import errors, motions_of

from fastmech.ensembles.doubling import Doubling
from fastmech.ensembles.problem import scene_problem
from fastmech.ensembles.richardson import RATIO
from fastmech.ensembles.solve import Settings, solve
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
OUTPUTS = np.array([5.45803345097768])
TOL = 1.83e-5
SETTINGS = Settings(find_method("ab6"), 0.002692691755700642, (0.0,))
PROBLEM = scene_problem(SCENE, 1, {}, "lagrange")


def test_a_run_with_longer_steps_may_agree_by_luck() -> None:
    """The classical estimate from it is ten times too small here, and below the tolerance."""
    longer = Settings(SETTINGS.method, RATIO * float(SETTINGS.dt), SETTINGS.fit)
    run, other = (solve(PROBLEM, START, OUTPUTS, settings).y for settings in (SETTINGS, longer))
    estimate = np.abs(run - other).max() / (math.sqrt(2.0) ** 6 - 1.0)
    true = errors(run, motions_of(SCENE, START, OUTPUTS))[0]
    assert true > 5.0 * TOL
    assert estimate < TOL
    assert estimate < 0.1 * true


def test_a_run_with_shorter_steps_tells_the_error() -> None:
    solution, estimate, remark = Doubling(PROBLEM, START, OUTPUTS, SETTINGS, TOL, 1).run(None)
    true = errors(solution.y, motions_of(SCENE, START, OUTPUTS))[0]
    assert true <= TOL
    assert true / 3.0 <= estimate[0] <= 3.0 * true
    assert not remark
