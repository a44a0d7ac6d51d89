"""``fm.find_snap``: the load, or any other parameter's value, at which a resting position ends."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastmech.arrays import Floats
from fastmech.atlas.branch import End, EndlessError, How, RestBranch, ending
from fastmech.atlas.defining import Balance
from fastmech.ensembles import checks
from fastmech.errors import InputError, shown
from fastmech.models.checks import check_values
from fastmech.models.equilibria import RestingPlace, find_equilibria
from fastmech.models.mechanism import Mechanism, short_way
from fastmech.models.stability import assess
from fastmech.objects import Printed, coordinate_units, spaced
from fastmech.scene import Scene, require_scene
from fastmech.slider.atlas.snap import branch_of, fold_free, moving, range_of_folds
from fastmech.slider.equilibria import Equilibrium, Listed, held, require_one

#: Units of loads; and how far, over the present value or 1, a mechanism's positions may end under them.
LOAD_UNITS = ("N", "N m")
DECADES = (1.0, 10.0, 100.0, 1e3, 1e4)

#: Values of the range at which the mechanism is checked to be one.
VALUES_TRIED = 64

#: A position that is given is the stable one within so many rad, lengths over their ranges by 2 pi.
NEAR = 0.1


@dataclass(frozen=True, repr=False)
class Snap(Printed):
    """Values of a parameter at which a resting position ends."""

    parameter: str
    unit: str  #: of the parameter
    position: tuple[float, ...]  #: at the present value [rad or m]
    place: str  #: the same in words
    value: float  #: the present value
    below: float | None  #: value at which it ends when the parameter is lowered; None: at no value
    above: float | None  #: value at which it ends when the parameter is raised; None: at no value
    how: tuple[How | None, How | None]  #: what it does there, below and above; None: it does not end
    joins: tuple[float | None, float | None]
    """Values below and above at which others first merge with it and a stable one goes on; None: at none."""
    searched: tuple[float, float]  #: values that were searched
    exhaustive: bool  #: no fold lies beyond the values searched, so None means never
    fading: str = ""  #: of a scene's load that decays, what it is and that it counts as 0

    @property
    def answer(self) -> str:
        """Where it ends, in words."""
        unit = spaced(self.unit)
        sides = zip((self.below, self.above), self.how, ("below", "above"), strict=True)
        ends: dict[str, list[str]] = {}  #: where, by what it does there
        for value, how, side in sides:
            if how is not None:
                ends.setdefault(how, []).append(f"{side} {value:.6g}{unit}")
        merges = " and ".join(f"{value:.6g}{unit}" for value in self.joins if value is not None)
        joins = f"; at {merges} it merges with others, and one stable position goes on" if merges else ""
        what = "load" if self.parameter == "F0" else self.parameter
        span = f"from {self.searched[0]:.6g} to {self.searched[1]:.6g}{unit}"
        beyond = "; no end lies beyond" if self.exhaustive else ""
        if ends:
            ended = " and ".join(f"{how} {' and '.join(where)}" for how, where in ends.items())
            return f"{ended} (searched {span}{beyond}){joins}"
        return f"does not end at any {what} {f'(searched {span}{beyond})' if beyond else span}{joins}"

    def told(self) -> str:
        """The answer in words."""
        return self.sentence

    @property
    def sentence(self) -> str:
        """The position, the present value and the answer in words."""
        name = "" if self.parameter == "F0" else f"{self.parameter} = "
        at = f"{name}{self.value:g}{spaced(self.unit)}"
        return f"the position ({self.place}) at {at} {self.answer}{self.fading}"


def find_snap(
    system: Scene | Mechanism,
    equilibrium: Any = None,
    searched: tuple[float, float] | None = None,
    *,
    parameter: str | None = None,
) -> Snap:
    """The values of a parameter, below and above the present one, at which a stable position ends.

    From its present value the parameter is lowered, and then raised, in small steps, and the position is
    followed. It ends in one of three ways:

    - It meets an unstable position, and both vanish: a fold. The mechanism snaps to another position.
    - Other positions cross it, as happens in symmetric mechanisms, and it is unstable from there on.
    - It begins to flutter: it is still there, but swings about it grow.

    A contact that opens or closes ends nothing where the position goes on beyond it and is stable there.

    Where other positions only merge with it and a stable one goes on, nothing snaps. That one is followed
    further. What is returned says of each side at which value the position ends (``below``, ``above``; None:
    at no value that was searched), how it ends (``how``), and at which value it first merged with others and
    went on (``joins``; None: nowhere). ``searched`` is the range of values. Where ``exhaustive`` is true, it
    is proved that no fold lies beyond that range, so None means at no value at all. Printed, it says all that
    in one sentence, which is also its ``sentence``.

    Loads that change are held: a mechanism's at their means, a scene's at F0 where alpha = 0 and at 0 where
    alpha > 0, as in ``find_equilibria``. Where a symmetry is broken by no more than rounding, positions meet
    as symmetric ones.

    Args:
        system: the mechanism at its present load.
        equilibrium: a stable one of it, or about where it is: coordinates [rad or m], of a scene
            (phi, theta). By default the deepest, of a mechanism the first stable one.
        searched: (low, high) to search. By default all at which a scene may have a fold, ``fold_free``, but
            not more than 100 times the present ones. Of a mechanism 0.01 to 3 times the present one; of loads
            (N, N m), and of what is 0, as far as the present one or 1 in both directions, and 10, 100, 1,000
            and 1e4 times as far until both ends are found; a side that takes too many steps is left where
            it is.
        parameter: its name; of a scene one of F0, c1, c2, m1, m2, l, g, and F0 by default.

    Raises:
        InputError: the equilibrium is not stable or not one of the system, there is no stable one, the
            parameter moves no equilibrium, or the range does not hold its present value or takes too many
            steps.
    """
    if isinstance(searched, str):
        raise InputError(f"searched = {shown(searched)}: must be (low, high); a name is for parameter=")
    of = _of_mechanism if isinstance(system, Mechanism) else _of_scene
    tried: list[Any] = [searched]
    if isinstance(system, Mechanism) and searched is None:
        tried = [*_ranges(system, moved_by(system, parameter))]
    ends, far, endless = [End(None)] * 2, [math.nan] * 2, [False] * 2
    for wanted in tried:
        branch, start, name, chosen, within, exhaustive = of(system, equilibrium, wanted, parameter)
        for side in (0, 1):
            if ends[side].value is None and not endless[side]:
                try:
                    ends[side] = ending(branch, start, (-1.0, 1.0)[side])
                except EndlessError:
                    if math.isnan(far[side]):
                        told = "takes too many steps to follow the position; give a narrower range"
                        raise InputError(f"searched = ({within[0]:g}, {within[1]:g}): {told}") from None
                    endless[side] = True
            far[side] = far[side] if endless[side] else within[side]
        if all(end.value is not None or gone for end, gone in zip(ends, endless, strict=True)):
            break
    now = held(system, chosen) if isinstance(system, Scene) else system
    present, unit, _ = now.described()[name]
    below, above = ends
    position = tuple(map(float, chosen.position))
    fading = ""
    if isinstance(system, Scene) and chosen.force == 0.0 != system.F0:
        decays = f"decays (alpha = {system.alpha:g} 1/s) and counts as 0 N in the end"
        fading = f"; the load F0 = {system.F0:g} N {decays}"
    return Snap(
        parameter=name,
        unit=unit,
        position=position,
        place=_place(system, position),
        value=present,
        below=below.value,
        above=above.value,
        how=(below.how, above.how),
        joins=(below.joins, above.joins),
        searched=(far[0], far[1]),
        exhaustive=bool(exhaustive),
        fading=fading,
    )


def _place(system: Scene | Mechanism, position: tuple[float, ...]) -> str:
    """Coordinates in words, with units after the last one of each."""
    names, units = zip(*coordinate_units(system).items(), strict=True)
    told = [
        f"{name} = {round(x, 12) + 0.0:.4g}" + f" {unit}" * (unit != after)
        for name, x, unit, after in zip(names, position, units, [*units[1:], ""], strict=True)
    ]
    return ", ".join(told)


Beginning = tuple[RestBranch, Floats, str, Any, tuple[float, float], bool]


def _ranges(mechanism: Mechanism, parameter: str) -> list[tuple[float, float]]:
    """Values of a parameter to search, one after the other until both ends are found."""
    present, unit, _ = mechanism.described()[parameter]
    if present == 0.0 or unit in LOAD_UNITS:  # it may act the other way, too
        return [(-far * max(abs(present), 1.0), far * max(abs(present), 1.0)) for far in DECADES]
    low, high = sorted((0.01 * present, 3.0 * present))
    return [(low, high)]


def ending_parameters(mechanism: Mechanism) -> tuple[str, ...]:
    """With which equilibria move or, where forces have no potential, may begin to flutter."""
    return mechanism.moving if mechanism.statics().conservative else tuple(mechanism.parameters)


def moved_by(mechanism: Mechanism, parameter: str | None) -> str:
    """The parameter, if equilibria move with it, or may flutter."""
    known = ending_parameters(mechanism)
    if not isinstance(parameter, str) or parameter not in known:
        given = "parameter: missing;" if parameter is None else f"parameter = {shown(parameter)}:"
        raise InputError(f"{given} must be one that moves equilibria: {', '.join(known) or 'none does'}")
    return parameter


def _of_scene(scene: Any, equilibrium: Any, searched: Any, parameter: str | None) -> Beginning:
    """Branch, start, parameter, position, values to search, and whether there is no fold beyond."""
    require_scene(scene)
    parameter = moving("F0" if parameter is None else parameter)
    chosen = stable_place(scene, equilibrium)
    scene = held(scene, chosen)
    low, high = (
        range_of_folds(scene, parameter) if searched is None else range_searched(scene, searched, parameter)
    )
    branch, start = branch_of(scene, parameter, chosen, (low, high))
    below, above = fold_free(scene, parameter)
    return branch, start, parameter, chosen, (low, high), low <= below and high >= above


def _of_mechanism(mechanism: Any, equilibrium: Any, searched: Any, parameter: str | None) -> Beginning:
    """The same; what is beyond is not known."""
    parameter, known = moved_by(mechanism, parameter), mechanism.parameters
    low, high = range_searched(mechanism, searched, parameter)
    balance = Balance(mechanism, {parameter: (low, high)})
    chosen = stable_place(mechanism, equilibrium)
    start = balance.point(chosen.position, np.array([known[parameter]]))
    balance.rescale(start)
    side = np.sign(balance.determinant(start))
    follows = not mechanism.statics().conservative
    branch = RestBranch(
        balance.rest,
        balance.singular,
        lambda z: float(side * balance.determinant(z)),
        value=lambda z: float(balance.values(z)[0]),
        flutters=lambda z: follows and balance.flutters(z),
        flutter=balance.flutter,
        in_range=balance.in_range,
    )
    return branch, start, parameter, chosen, (low, high), False


def stable_places(system: Scene | Mechanism) -> tuple[Any, list[int]]:
    """All resting positions, and which of them are stable; a scene's come with the deepest first."""
    found: Any = find_equilibria(system)
    if isinstance(system, Scene):
        return found, [k for k, place in enumerate(found) if place.morse_index == 0]
    regular = ((k, place) for k, place in enumerate(found) if place.orientation != 0)
    # Where nothing damps and forces follow, swings that keep their size have to do.
    verdicts = ((k, assess(system.linear(place.position), place.morse_index)) for k, place in regular)
    return found, [k for k, judged in verdicts if judged.verdict != "unstable"]


def stable_place(system: Scene | Mechanism, wanted: Any = None) -> Any:
    """The stable one that is given, or that is about these coordinates [rad or m]; by default the first.

    Raises:
        InputError: it is none of the system's, or not stable.
    """
    found, stable = stable_places(system)
    if not stable:
        sure, told = found.certificate.complete, found.certificate.sentence
        why = "there is no stable one" if sure else f"none is known to be stable, and the list is not: {told}"
        raise InputError(f"equilibrium: {why}")
    if wanted is None:
        return found[stable[0]]
    places = np.array([found[k].position for k in stable])
    if isinstance(wanted, Equilibrium | RestingPlace):
        if (k := found.index_of(wanted)) in stable:
            return found[k]
        told = ", ".join(f"{x:.6g}" for x in wanted.position)
        raise InputError(f"equilibrium = ({told}): must be a stable one")
    if isinstance(wanted, Listed):
        require_one(wanted, RestingPlace)
    allowed = "one of fm.find_equilibria(...), such as E[0], or its coordinates"
    near = checks.reals(f"equilibrium = {shown(wanted)}", wanted, allowed)
    if near.shape != places.shape[1:]:
        raise InputError(f"equilibrium = {shown(wanted)}: must be {allowed}")
    ranges = np.full(near.size, 2.0 * np.pi)
    if isinstance(system, Mechanism):
        ranges = np.where(system.turning, ranges, [c.high - c.low for c in system.coordinates])
    away = np.abs(short_way(places - near, system.turning) * (2.0 * np.pi / ranges)).max(axis=1)
    if away.min() <= NEAR:
        return found[stable[int(away.argmin())]]
    told = "; ".join(f"({', '.join(f'{x:.4g}' for x in place)})" for place in places)
    raise InputError(f"equilibrium = {shown(near.tolist())}: is near no stable one; they are at {told}")


def range_searched(system: Scene | Mechanism, searched: object, parameter: str) -> tuple[float, float]:
    """A range that holds the present value, and all over which the system is one."""
    present, unit, _ = system.described()[parameter]
    try:
        ends = np.asarray(searched)
    except ValueError:
        ends = np.array(None)
    if ends.dtype.kind in "iuf" and ends.shape == (2,) and np.isfinite(ends).all():
        low, high = (float(end) for end in ends)
        if low < high and low <= present <= high:
            if isinstance(system, Mechanism):
                check_values(system, {parameter: np.linspace(low, high, VALUES_TRIED)}, "")
            else:
                for end in (low, high):
                    system.replace(**{parameter: end})
            return low, high
    raise InputError(
        f"searched = {shown(searched)}: must be a range of {parameter} that holds {present:g}" + spaced(unit)
    )
