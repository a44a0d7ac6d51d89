"""One number for every copy of every well of a scene, as measures want labels; and their default metric."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastmech.basins.label import How, Labels, label_starts, require_damper
from fastmech.basins.measures.labels import Floats, Integers, LabelOf, check_point
from fastmech.basins.measures.norm import kinetic_norm
from fastmech.ensembles import checks
from fastmech.equilibria.find import Equilibrium
from fastmech.errors import InputError
from fastmech.scene import STATE, Scene

#: Bits for the well (a scene has at most six equilibria) and for each angle's turns.
WELL_BITS, TURN_BITS = 3, 30
_MIDDLE = 1 << (TURN_BITS - 1)


@dataclass(frozen=True)
class CopyLabels:
    """Labels starts (n, 4) with one number for each copy of each well, -1 where not proved."""

    scene: Scene
    t_end: float  #: s
    threads: int | None

    def __call__(self, starts: Floats) -> Integers:
        """Labels (n,) of starts (n, 4)."""
        return copy_numbers(label_starts(self.scene, starts, self.t_end, How(threads=self.threads)))


def copy_labels(scene: Scene, t_end: float = 60.0, *, threads: int | None = None) -> CopyLabels:
    """A function that labels starts (n, 4) with one number for each copy of each well, -1 where not proved.

    It is what :func:`fastmech.basins.shock.minimal_shock`, :func:`fastmech.basins.edge.track_edge` and
    :func:`fastmech.basins.measures.uncertainty.uncertainty_exponent` ask; :func:`copy_of_label` reads its
    numbers.

    Args:
        scene: the mechanism, with a damper.
        t_end: end of the runs [s], see :func:`fastmech.basins.label.labels_of`.
        threads: threads to use.

    Raises:
        InputError: the scene has no damper, or ``t_end`` is wrong.
    """
    require_damper(scene)
    return CopyLabels(scene, checks.number("t_end", t_end, "s", above=0.0), threads)


def copy_numbers(ends: Labels) -> Integers:
    """One number for each copy of each well (n,), -1 without a label or too many turns away to count."""
    turns = ends.turns.astype(np.int64) + _MIDDLE
    number = (((turns[:, 0] << TURN_BITS) + turns[:, 1]) << WELL_BITS) + ends.well
    counted = ((turns >= 0) & (turns < 2 * _MIDDLE)).all(axis=1)
    return np.where((ends.well < 0) | ~counted, -1, number)


def copy_of_label(label: int) -> tuple[int, tuple[int, int]]:
    """The equilibrium's index and its full turns of phi and theta that a number of ``copy_labels`` means.

    Raises:
        InputError: the label is negative: it means no copy.
    """
    label = checks.whole_number("label", label, least=0)
    turns = label >> WELL_BITS
    return label % (1 << WELL_BITS), ((turns >> TURN_BITS) - _MIDDLE, turns % (1 << TURN_BITS) - _MIDDLE)


def label_name(label_of: LabelOf, label: int) -> str:
    """What a label means, in words: of ``copy_labels`` the well and its turns, else the number itself."""
    if label < 0:
        return "no label"
    if not isinstance(label_of, CopyLabels):
        return f"the label {label}"
    well, turns = copy_of_label(label)
    made = [f"{t:+d} turn{'s' * (abs(t) > 1)} of {name}" for t, name in zip(turns, STATE, strict=False) if t]
    return ", ".join([f"well {well}", *made])


def with_defaults(
    label_of: LabelOf | Scene, attractor: ArrayLike | Equilibrium, norm: ArrayLike | None
) -> tuple[LabelOf, Floats, ArrayLike]:
    """Labels, place (dim,) and norm; of a scene's equilibrium the copies' labels and the kinetic-energy norm.

    Raises:
        InputError: no norm is given, and there is no equilibrium of a scene to give one.
    """
    place = (
        np.array([attractor.phi, attractor.theta, 0.0, 0.0])
        if isinstance(attractor, Equilibrium)
        else check_point("attractor", attractor)
    )
    if norm is None:
        if not isinstance(label_of, Scene) or not isinstance(attractor, Equilibrium):
            raise InputError(
                "norm: missing; only an equilibrium of a scene has one by default, the kinetic-energy norm"
            )
        norm = kinetic_norm(label_of, attractor)
    return copy_labels(label_of) if isinstance(label_of, Scene) else label_of, place, norm
