"""One number for every copy of every well of a scene, as measures want labels; and their default metric."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastmech.arrays import Floats, Integers
from fastmech.basins.label import How, Labels, label_states
from fastmech.basins.measures.labels import GONE, LabelOf, check_labels
from fastmech.capture.select import certificate_of, require_damper
from fastmech.ensembles import checks
from fastmech.models.mechanism import Mechanism
from fastmech.scene import Scene

#: Bits for the well (there are at most 128 equilibria), and for the turns of all coordinates together.
WELL_BITS, TURN_BITS = 7, 56


@dataclass(frozen=True)
class WellNumbers:
    """Labels starts (n, states) with one number for each copy of each well, -1 where not proved."""

    scene: Scene | Mechanism
    t_end: float | None  #: s
    threads: int | None

    def __call__(self, starts: Floats) -> Integers:
        """Labels (n,) of starts (n, states)."""
        return number_wells(label_states(self.scene, starts, self.t_end, How(threads=self.threads)))


def well_numbers(
    scene: Scene | Mechanism, t_end: float | None = None, *, threads: int | None = None
) -> WellNumbers:
    """A function that labels starts (n, states) with a number for each copy of each well, -1: not proved.

    It is what :func:`fastmech.basins.shock.minimal_shock`, :func:`fastmech.basins.edge.track_edge` and
    :func:`fastmech.basins.measures.slopes.uncertainty_exponent` ask; :func:`well_of_number` reads its
    numbers.

    Args:
        scene: the mechanism, with a damper.
        t_end: end of the runs [s], see :func:`fastmech.label_starts`.
        threads: threads to use.

    Raises:
        InputError: the scene has no damper, or ``t_end`` is wrong.
    """
    require_damper(scene)
    t_end = None if t_end is None else checks.number("t_end", t_end, "s", above=0.0)
    return WellNumbers(scene, t_end, threads)


def number_wells(ends: Labels) -> Integers:
    """One number for each copy of each well (n,), -1 without a label or too many turns away to count.

    What has left its range is :data:`fastmech.basins.measures.labels.GONE`.
    """
    coordinates = ends.turns.shape[1]
    bits = TURN_BITS // coordinates
    turns = ends.turns.astype(np.int64) + (1 << (bits - 1))
    number = np.zeros(len(turns), dtype=np.int64)
    for column in turns.T:
        number = (number << bits) + column
    counted = ((turns >= 0) & (turns < 1 << bits)).all(axis=1)
    labels = check_labels(ends)
    return np.where(
        (ends.well >= 0) & counted, (number << WELL_BITS) + ends.well, np.where(labels == GONE, GONE, -1)
    )


def well_of_number(label: int, coordinates: int = 2) -> tuple[int, tuple[int, ...]]:
    """The equilibrium's index and its full turns of each coordinate that a number of ``well_numbers`` means.

    Raises:
        InputError: the label is negative, or that of what is gone for good: it means no copy.
    """
    label = checks.whole_number("label", label, least=0, most=GONE - 1)
    coordinates = checks.whole_number("coordinates", coordinates, least=1)
    turns, bits, each = label >> WELL_BITS, TURN_BITS // coordinates, []
    for _ in range(coordinates):
        each.append(turns % (1 << bits) - (1 << (bits - 1)))
        turns >>= bits
    return label % (1 << WELL_BITS), tuple(reversed(each))


def label_name(label_of: LabelOf, label: int) -> str:
    """What a label means, in words: of ``well_numbers`` the well and its turns, else the number itself."""
    if label < 0:
        return "no label"
    if label == GONE:
        return "no attractor, gone for good"
    if not isinstance(label_of, WellNumbers):
        return f"the label {label}"
    names = certificate_of(label_of.scene).names
    well, turns = well_of_number(label, len(names))
    made = [f"{t:+d} turn{'s' * (abs(t) > 1)} of {name}" for t, name in zip(turns, names, strict=True) if t]
    return ", ".join([f"well {well}", *made])
