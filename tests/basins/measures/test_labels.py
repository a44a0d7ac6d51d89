from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fastmech.basins.measures.labels import (
    GONE,
    ask,
    check_axes,
    check_labels,
    check_map,
    known_labels,
    number_turns,
    numbered,
)
from fastmech.ensembles.status import Status
from fastmech.errors import InputError


def test_negative_labels_are_none_and_gaps_are_kept() -> None:
    assert known_labels(np.array([[7, -1], [-3, 2]])).tolist() == [2, 7]


def test_what_escapes_or_leaves_its_range_has_a_label_of_its_own() -> None:
    """Undecided and failed starts have none; a status does not change the label of a well."""
    status = [Status.OK, Status.ESCAPED, Status.OUT_OF_RANGE, Status.UNDECIDED, Status.NOT_FINITE]
    ends = SimpleNamespace(well=np.array([2, -1, -1, -1, -1]), status=np.array(status))
    assert check_labels(ends).tolist() == [2, GONE, GONE, -1, -1]


def test_labels_with_gaps_are_numbered_for_filters_that_count_in_doubles() -> None:
    labels = np.array([[7, GONE - 1], [-3, GONE]])
    assert numbered(labels).tolist() == [[0, 1], [-1, 2]]


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
