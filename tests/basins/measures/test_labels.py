from __future__ import annotations

import numpy as np
import pytest

from fastmech.basins.measures.labels import ask, check_axes, check_map, known_labels, number_turns
from fastmech.errors import InputError


def test_negative_labels_are_none_and_gaps_are_kept() -> None:
    assert known_labels(np.array([[7, -1], [-3, 2]])).tolist() == [2, 7]


def test_copies_of_an_attractor_get_labels_of_their_own() -> None:
    label = np.array([3, 3, -1, 0, 3])
    turns = np.array([[0, 1], [0, 0], [5, 5], [-1, 0], [0, 1]])
    numbered, table = number_turns(label, turns)
    assert numbered.tolist() == [2, 1, -1, 0, 2]
    assert table.tolist() == [[0, -1, 0], [3, 0, 0], [3, 0, 1]]


def test_numbered_copies_keep_a_map_s_shape() -> None:
    numbered, table = number_turns(np.full((2, 3), -1), np.zeros((2, 3, 2), dtype=int))
    assert numbered.shape == (2, 3)
    assert table.shape == (0, 3)


def test_wrong_labels_and_axes_are_refused() -> None:
    with pytest.raises(InputError, match=r"^labels: must be integers"):
        check_map([[0.0, 1.0], [0.0, 1.0]])
    with pytest.raises(InputError, match=r"^labels: has shape \(1, 3\), must be a grid"):
        check_map([[0, 1, 2]])
    with pytest.raises(InputError, match=r"^axes\[1\]: must rise in equal steps"):
        check_axes([[0.0, 1.0], [0.0, 1.0, 3.0]], (2, 3))
    with pytest.raises(InputError, match=r"^label_of\(starts\): has shape \(3,\), must be \(2,\)"):
        ask(lambda y: np.zeros(3, dtype=int), np.zeros((2, 4)))
    with pytest.raises(InputError, match=r"^turns: has shape \(3, 2\)"):
        number_turns([0, 1], np.zeros((3, 2), dtype=int))
