from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from oracles import TABLE_1, oracle

from fastmech.errors import InputError
from fastmech.slider.balance import energy_balance
from fastmech.studies.paper.compute import PAPER_SCENE, START

TIMES = [1.0, 2.0, 5.0, 10.0, 20.0]


def test_energy_is_what_the_works_leave() -> None:
    balance = energy_balance(PAPER_SCENE, START, TIMES)
    assert balance.relative_residual < 1e-12
    assert np.all(np.diff(balance.work_damper) < 0.0)
    assert np.all(balance.work_damper < 0.0)


def test_states_are_the_reference_motions() -> None:
    path = Path(__file__).parents[3] / "data" / "paper_motion.toml"
    reference = tomllib.loads(path.read_text(encoding="utf-8"))["state"]
    balance = energy_balance(PAPER_SCENE, START, [state["t"] for state in reference])
    names = ("phi", "theta", "phi_dot", "theta_dot")
    true = [[float(state[name]) for name in names] for state in reference]
    np.testing.assert_allclose(balance.y, true, atol=1e-12)


def test_energies_are_the_oracles() -> None:
    balance = energy_balance(PAPER_SCENE, START, TIMES)
    for i, y in enumerate(balance.y):
        assert balance.kinetic[i] == pytest.approx(float(oracle().kinetic_energy(TABLE_1, y)), rel=1e-12)
        assert balance.potential[i] == pytest.approx(float(oracle().potential(TABLE_1, y[:2])), rel=1e-12)


def test_a_coarse_step_shows_in_the_residual() -> None:
    fine = energy_balance(PAPER_SCENE, START, TIMES, dt=0.01, method="rk4")
    coarse = energy_balance(PAPER_SCENE, START, TIMES, dt=0.1, method="rk4")
    assert coarse.relative_residual > 100.0 * fine.relative_residual


def test_without_damper_and_force_no_work_is_done() -> None:
    balance = energy_balance(PAPER_SCENE.replace(beta=0.0, F0=0.0), START, TIMES)
    assert not balance.work_damper.any()
    assert not balance.work_force.any()
    assert balance.relative_residual < 1e-10


def test_a_constant_force_works_like_its_potential() -> None:
    scene = PAPER_SCENE.replace(alpha=0.0, beta=0.0)
    balance = energy_balance(scene, START, TIMES)
    x2 = np.array([float(oracle().positions(TABLE_1, y[:2])[2]) for y in balance.y])
    start = float(oracle().positions(TABLE_1, START[:2])[2])
    np.testing.assert_allclose(balance.work_force, 100.0 * (x2 - start), atol=1e-9)


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(InputError, match="t_eval"):
        energy_balance(PAPER_SCENE, START, [2.0, 1.0])
    with pytest.raises(InputError, match="y0"):
        energy_balance(PAPER_SCENE, START[:3], TIMES)
