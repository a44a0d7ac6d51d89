from __future__ import annotations

import ast

import numpy as np
import pytest

from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.status import ENDS, FAILURES, LABELS, Status
from fastmech.kernel_cache import PACKAGE
from fastmech.scene import Scene

SCENE = Scene()
START = [0.9, 0.4, 0.0, 0.0]


def test_starts_that_are_not_finite_and_steps_that_explode() -> None:
    starts = np.array([START, [np.nan, 0, 0, 0], START, [0, 0, 1e200, 0]])
    run = integrate(SCENE, starts, 1.0, dt=0.1)
    assert run.status.tolist() == [Status.OK, Status.START_NOT_FINITE, Status.OK, Status.NOT_FINITE]
    assert run.status.dtype == np.int8
    np.testing.assert_array_equal(run.y[:, 0], run.y[:, 2])


@pytest.mark.parametrize("formulation", ["lagrange", "hamilton"])
def test_a_step_too_large_for_the_scene(formulation: str) -> None:
    """A stiff spring, 1000 rad/s, with steps of 0.1 s: the motion explodes, and is said to."""
    run = integrate(SCENE.replace(c1=1.2e7), START, 50.0, dt=0.1, method="euler", formulation=formulation)
    assert run.status.tolist() == [Status.NOT_FINITE]


def test_every_output_counts() -> None:
    """The start itself is not finite, and is an output."""
    run = integrate(SCENE, [0.0, 0.0, np.inf, 0.0], t_eval=[0.0])
    assert run.status.tolist() == [Status.START_NOT_FINITE]


@pytest.mark.parametrize("formulation", ["lagrange", "hamilton"])
@pytest.mark.parametrize("force", [{"F0": 0.0}, {"alpha": 0.0}, {"F0": 10.0, "alpha": 5.0}])
def test_a_motion_that_stays_finite_with_an_impossible_energy(
    formulation: str, force: dict[str, float]
) -> None:
    """Without damper energy does not get lost: RK4 with steps of 0.5 s brings the motion to rest."""
    conservative = SCENE.replace(beta=0.0, **force)
    fine, coarse = (
        integrate(conservative, [1.0, 0.3, 0.0, 0.0], 20.0, dt=dt, formulation=formulation)
        for dt in (0.01, 0.5)
    )
    assert np.isfinite(coarse.y).all()
    assert fine.status.tolist() == [Status.OK]
    assert coarse.status.tolist() == [Status.STEP_TOO_LARGE]


@pytest.mark.parametrize(
    "change", [{}, {"alpha": 0.0}, {"F0": -300.0}, {"beta": 0.0}, {"F0": 900.0, "alpha": 5.0}]
)
def test_resolved_motions_keep_within_the_energy_bounds(change: dict[str, float]) -> None:
    """Lively starts of scenes with and without force and damper: nothing is suspected wrongly."""
    starts = np.random.default_rng(0).uniform([-3, -3, -5, -5], [3, 3, 5, 5], (500, 4))
    run = integrate(SCENE.replace(**change), starts, 5.0, dt=0.005, method="dop853")
    assert not run.status.any()


@pytest.mark.nojit
def test_every_status_has_its_own_advice() -> None:
    assert all(status.advice for status in Status)
    assert len({status.advice for status in Status}) == len(Status)
    assert all(status.advice[-1].isalnum() or status.advice[-1] == ")" for status in Status)  # not cut


@pytest.mark.nojit
def test_no_other_enumeration_tells_what_became_of_a_motion() -> None:
    """A name of a status has one number, whoever uses it."""
    names = set(Status.__members__)
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and node.name != "Status":
                members = {
                    t.id
                    for a in node.body
                    if isinstance(a, ast.Assign)
                    for t in a.targets
                    if isinstance(t, ast.Name)
                }
                assert not names & members - {"UNDECIDED"}, f"{path}: {node.name}"
    assert len({int(status) for status in Status}) == len(Status)
    for kinds in (FAILURES, LABELS, ENDS):
        assert len(set(kinds)) == len(kinds)
