"""Barrier tree of the potential on the unwrapped plane: which wells, and which copies, join at which energy.

The plane of unwrapped angles repeats every 2 pi in both directions, and a well's copies count their turns.
Flooding it, every saddle joins the two sides below it, and nothing else does (Morse). Saddles in rising order
therefore give the components of {U < E} for every E: a component is a list of wells with turns, and the
turns by which it repeats. One that repeats is unbounded: along one direction a strip, along two the plane.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np

from fastmech.arrays import Floats
from fastmech.errors import InputError
from fastmech.objects import Printed, counted
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.descent import convex_radius, descend, step_off
from fastmech.slider.equilibria import Equilibria, find_equilibria

Turns = tuple[int, int]


class Effect(IntEnum):
    """What a saddle does when the flood reaches it."""

    JOINS = 0  #: two components become one
    REPEATS = 1  #: a component meets a copy of itself: a strip, or a strip becomes the plane
    ENCLOSES = 2  #: a component meets itself around a maximum: nothing new is connected


@dataclass(frozen=True)
class Opening:
    """A saddle and the copies of wells on its two sides."""

    saddle: int  #: which equilibrium
    energy: float  #: of the saddle [J]
    wells: tuple[int, int]  #: which equilibria
    turns: tuple[Turns, Turns]  #: full turns of phi and theta of either well, the saddle at its listed place
    effect: Effect


@dataclass
class Component:
    """A component of a sublevel set: its wells with their turns, and the turns by which it repeats."""

    members: dict[int, Turns]
    periods: list[Turns] = field(default_factory=list)  #: independent, at most two

    @property
    def bounded(self) -> bool:
        """Whether it has an end in every direction."""
        return not self.periods


@dataclass(frozen=True, repr=False)
class BarrierTree(Printed):
    """How the wells of a scene are connected."""

    equilibria: Equilibria
    openings: tuple[Opening, ...]  #: in rising order of energy
    wells: tuple[int, ...]  #: which equilibria are minima, the deepest first
    barrier: Floats  #: B of every well [J]: the least energy at which it meets another well, copies included
    radius: Floats  #: of every well [rad]: U is convex in a ball of this radius

    def told(self) -> str:
        """Each well and how deep it is."""
        each = (
            f"well {well} at {self.equilibria.place(well)}: {barrier - self.equilibria[well].energy:.6g} J"
            for well, barrier in zip(self.wells, self.barrier, strict=True)
        )
        wells, saddles = counted(len(self.wells), "well"), counted(len(self.openings), "saddle")
        return "\n".join([f"{wells}, {saddles}", *each])

    def components(self, energy: float) -> list[Component]:
        """Components of {U < energy}, one for all copies; wells that are not flooded are left out."""
        flooded = [o for o in self.openings if o.energy < energy]
        every, _ = _flood(self.wells, flooded)
        depth = self.equilibria.energy
        return [part for part in every if any(depth[well] < energy for well in part.members)]


def barrier_tree(scene: Scene) -> BarrierTree:
    """The barrier tree of U = Pi - F x2, or of Pi alone where the force decays.

    Raises:
        InputError: the scene's equilibria are not proved to be complete, or no ball about a minimum is
            proved to be convex (too near a fold).
    """
    equilibria = find_equilibria(scene)
    if not equilibria.certificate.complete:
        raise InputError(f"scene: its wells are not certain: {equilibria.certificate.sentence}")
    c, index = frozen_coefficients(scene, equilibria), equilibria.morse_index
    wells, openings = np.flatnonzero(index == 0).tolist(), []
    phis, thetas = equilibria.phi[wells], equilibria.theta[wells]
    with np.errstate(all="ignore"):
        radius = np.array([convex_radius(c, *place) for place in zip(phis, thetas, strict=True)])
        for saddle in np.flatnonzero(index == 1).tolist():
            here = equilibria[saddle]
            off = [step_off(c, here.phi, here.theta, way) for way in (1.0, -1.0)]
            (i, *a), (j, *b) = (map(int, descend(c, *q, phis, thetas, radius, len(wells))) for q in off)
            if not (radius > 0.0).all() or min(i, j) < 0:
                told = "a minimum and a saddle are too near to each other to tell their sides apart"
                raise InputError(f"scene: {told}")
            turns = ((a[0], a[1]), (b[0], b[1]))
            openings.append(Opening(saddle, here.energy, (wells[i], wells[j]), turns, Effect.ENCLOSES))
    _, effects = _flood(tuple(wells), openings)
    named = tuple(replace(o, effect=effect) for o, effect in zip(openings, effects, strict=True))
    first = [
        min(
            o.energy
            for o in named
            if well in o.wells and (o.wells[0] != o.wells[1] or o.turns[0] != o.turns[1])
        )
        for well in wells
    ]
    return BarrierTree(equilibria, named, tuple(wells), np.array(first), radius)


def frozen_coefficients(scene: Scene, equilibria: Equilibria) -> Floats:
    """Reduced coefficients (8,) with the force that the equilibria hold for."""
    return np.array(reduce(scene)._replace(force=equilibria.force / (scene.m2 * scene.l)), dtype=np.float64)


def _flood(wells: tuple[int, ...], openings: list[Opening]) -> tuple[list[Component], list[Effect]]:
    """Components after the openings, which come in rising order, and what each opening did.

    A component that holds a well with ``turns`` holds all its wells with the turns listed beside theirs less
    those listed for that well (union-find with offsets).
    """
    home = {well: Component({well: (0, 0)}) for well in wells}
    effects = []
    for opening in openings:
        (i, j), (a, b) = opening.wells, opening.turns
        one, two = home[i], home[j]
        shift = _minus(_minus(b, two.members[j]), _minus(a, one.members[i]))
        if one is not two:
            for well, turns in two.members.items():
                one.members[well] = _plus(turns, shift)
                home[well] = one
            one.periods = _lattice([*one.periods, *two.periods])
            effects.append(Effect.JOINS)
            continue
        wider = _lattice([*one.periods, shift])
        effects.append(Effect.ENCLOSES if wider == one.periods else Effect.REPEATS)
        one.periods = wider
    return list({id(part): part for part in home.values()}.values()), effects


def _plus(a: Turns, b: Turns) -> Turns:
    return a[0] + b[0], a[1] + b[1]


def _minus(a: Turns, b: Turns) -> Turns:
    return a[0] - b[0], a[1] - b[1]


def _lattice(vectors: list[Turns]) -> list[Turns]:
    """The basis in Hermite normal form of all integer combinations of ``vectors``."""
    basis: list[Turns] = []
    rest = [v for v in vectors if v != (0, 0)]
    while sum(v[0] != 0 for v in rest) > 1:  # Euclid's algorithm on the first turns
        rest.sort(key=lambda v: (v[0] == 0, abs(v[0])))
        pivot = rest[0]
        rest[1:] = [
            (v[0] - v[0] // pivot[0] * pivot[0], v[1] - v[0] // pivot[0] * pivot[1]) for v in rest[1:]
        ]
    second = int(np.gcd.reduce([v[1] for v in rest if v[0] == 0] or [0]))
    for v in rest:
        if v[0] != 0:
            sign = 1 if v[0] > 0 else -1
            last = sign * v[1]
            basis.append((sign * v[0], last % second if second else last))
    return basis + ([(0, second)] if second else [])
