from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from kernels.blocks_of_lanes import COMBINATIONS, TERMS, kernel

from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.kernels.select import right_hand_side, terms

pytestmark = pytest.mark.nojit


@pytest.mark.parametrize(("formulation", "combination"), COMBINATIONS)
def test_a_scene_is_given_the_kernel_of_its_terms(formulation: str, combination: str) -> None:
    scene = Scene().replace(**TERMS[combination])
    assert terms(reduce(scene)) == combination
    assert right_hand_side(reduce(scene), formulation) is kernel(formulation, combination)


@pytest.mark.parametrize(
    ("change", "combination"),
    [
        ({"F0": -1e-300}, "damped_decaying"),
        ({"F0": 0.0, "alpha": 0.0}, "damped"),
        ({"beta": 1e-300, "F0": 0.0}, "damped"),
        ({"beta": 0.0, "F0": -0.0}, "free"),
        ({"alpha": 1e-300}, "damped_decaying"),
    ],
)
def test_edges(change: dict[str, Any], combination: str) -> None:
    assert terms(reduce(Scene().replace(**change))) == combination


def test_default_formulation_is_lagrange() -> None:
    assert right_hand_side(reduce(Scene())) is kernel("lagrange", "damped_decaying")


def test_every_kernel_is_another_one() -> None:
    assert len({id(kernel(*combination)) for combination in COMBINATIONS}) == len(COMBINATIONS) == 12
    assert np.unique([kernel(*combination).__name__ for combination in COMBINATIONS]).size == 12
