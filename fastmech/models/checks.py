"""What a mechanism has to satisfy beside its names, tried at states all over its ranges when it is built."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats, Integers
from fastmech.errors import InputError, shown

if TYPE_CHECKING:
    from fastmech.models.mechanism import Mechanism


#: States that are tried, and relative rounding of what is compared there.
TRIED, ROUNDING = 256, 1e-6

#: Share of the states tried at which a potential may be no number: a spring's or magnet's length is zero in a
#: place, not all over a part of the ranges.
UNDEFINED = 0.05

#: Full turns after which a mechanism must be the same: many tell cos((1 + 1e-9) q) from cos(q).
TURNS = (1, 1000)

#: Times that a least eigenvalue is looked for closer by, and what is none beside the diagonal's.
CLOSER, SINGULAR = 20, 1e-12

#: Shares of the rates tried at which friction that stays is all there is.
SLOW = (1e-50, 1e-100)

#: Units by their powers of kg, m and s.
UNITS = {
    "1": (0, 0, 0), "rad": (0, 0, 0), "kg": (1, 0, 0), "m": (0, 1, 0), "s": (0, 0, 1), "N": (1, 1, -2),
    "J": (1, 2, -2), "W": (1, 2, -3), "Pa": (1, -1, -2), "Hz": (0, 0, -1),
}  # fmt: skip

#: Other sizes of kg, m and s, in which a physical law holds as it does in these.
SIZES = np.array([1.3, 0.7, 1.9])


def check(mechanism: Mechanism) -> tuple[bool, bool]:
    """Refuse what is no mechanism; whether the metric is proved positive definite, and dissipation passive.

    Raises:
        InputError: the potential is no number in a part of the ranges, the metric is not positive definite,
            dampers feed energy in, or an angle that turns fully does not come back to the same.
    """
    from fastmech.models.definite import definite, passive  # SymPy: only where a mechanism is there

    y, n = trial_states(mechanism), len(mechanism.coordinates)
    _check_potential(mechanism, y)
    _check_metric(mechanism, y[:, :n])
    proved, place = definite(mechanism)
    if proved is False:
        raise _not_definite(mechanism, place)
    takes, place = passive(mechanism)
    tried = y.copy()
    tried[TRIED // 2 :, :n] = y[TRIED // 2 :, :n] if takes is not False else place
    for half in (tried[: TRIED // 2], tried[TRIED // 2 :]):
        states = np.concatenate([half, _least_damped(mechanism, half)])
        damped = mechanism.evaluate("powers", [0.0, *states.T])[1]
        known = np.isfinite(damped)
        if not known.any():
            raise InputError("dissipation: is nowhere a finite number")
        least = int(np.argmin(np.where(known, damped, np.inf)))
        if damped[least] < -ROUNDING * np.abs(damped[known]).max():
            raise InputError(
                f"dissipation: feeds energy in, as at {_told(mechanism, states[least])}; "
                "coefficients of dampers must not be negative"
            )
    before = _potential_and_motion(mechanism, y)
    for k, turns in product(np.flatnonzero(mechanism.turning), TURNS):
        coordinate, turned, beside = mechanism.coordinates[k], y.copy(), y.copy()
        turned[:, k] += turns * 2.0 * math.pi
        beside[:, k] += 4.0 * np.spacing(turned[:, k])  # what rounding of the turned angle explains
        rounding = _changes(before, _potential_and_motion(mechanism, beside))
        if (_changes(before, _potential_and_motion(mechanism, turned)) - rounding).max() > 1.0:
            raise InputError(
                f"{coordinate.symbol}: the mechanism is not the same after a full turn of it; "
                f"give the angle a range: fm.angles('{coordinate.symbol}', low, high)"
            )
    return proved is True, takes is True


def check_values(mechanism: Mechanism, values: Mapping[str, ArrayLike], where: str) -> None:
    """Refuse values of parameters, one each of any number of mechanisms, of which one is none.

    A few are checked as :func:`check` does, those that trials show to be most likely wrong.
    ``where`` is put in front of names, such as "axes.".

    Raises:
        InputError: as :func:`check`, with the values.
    """
    own = {name: np.ravel(np.asarray(column, dtype=np.float64)) for name, column in values.items()}
    ends = [int(row) for column in own.values() for row in (np.argmin(column), np.argmax(column))]
    tries: dict[int, Any] = dict.fromkeys(ends, mechanism.with_values)
    known = all(np.isfinite(column).all() for column in own.values())
    tries |= dict.fromkeys(_suspects(mechanism, own) if known else [], lambda own: mechanism.replace(**own))
    for row, made in tries.items():
        chosen = {name: float(column[row]) for name, column in own.items()}
        try:
            made(chosen)
        except InputError as error:
            told = ", ".join(f"{where}{name} = {value:g}" for name, value in chosen.items())
            raise InputError(f"{told}: {error}") from None


def _suspects(mechanism: Mechanism, own: Mapping[str, Floats]) -> list[int]:
    """Rows of values: metric nearest to singular, dampers that lose least, turns that change most."""
    from fastmech.models.definite import definite, passive

    y, n = trial_states(mechanism), len(mechanism.coordinates)
    count = len(next(iter(own.values())))
    over = {name: (float(column.min()), float(column.max())) for name, column in own.items()}
    found: list[int] = []

    def tried(each: int) -> tuple[Integers, dict[str, Floats], Floats]:
        """Rows, each at some states or more, their values and states."""
        row = np.arange(max(TRIED, each * count)) % count
        states = y[np.random.default_rng(2).permutation(len(row)) % TRIED]
        return row, {name: column[row] for name, column in own.items()}, states

    row, each, states = tried(1)
    before = _potential_and_motion(mechanism, states, each)
    for k in [k for k, coordinate in enumerate(mechanism.coordinates) if coordinate.periodic]:
        turned = states.copy()
        turned[:, k] += 2.0 * math.pi
        changes = _changes(before, _potential_and_motion(mechanism, turned, each))
        found += [int(row[np.argmax(changes)])] * bool(changes.max() > 1.0)
    closely = int(np.clip(4 * TRIED**2 / count, 4, TRIED))
    if definite(mechanism, over)[0] is not True:
        row, each, states = tried(closely)
        a = np.nan_to_num(mechanism.metric(states[:, :n], each), nan=0.0, posinf=0.0, neginf=0.0)
        size = np.sqrt(np.abs(np.diagonal(a, axis1=1, axis2=2)) + 1e-300)
        found.append(int(row[np.linalg.eigvalsh(a / size[:, :, None] / size[:, None])[:, 0].argmin()]))
    if passive(mechanism, over)[0] is not True:
        row, each, states = tried(closely)
        damped = mechanism.evaluate("powers", [0.0, *states.T], each)[1]
        found.append(int(row[np.where(np.isfinite(damped), damped, np.inf).argmin()]))
    return found


def _check_potential(mechanism: Mechanism, y: Floats) -> None:
    potential = mechanism.evaluate("energies", y.T)[1]
    undefined = np.isnan(potential) if np.isfinite(potential).any() else ~np.isfinite(potential)
    if (share := float(undefined.mean())) > UNDEFINED:
        raise InputError(
            f"potential: is no finite number at {share:.0%} of the places tried all over the ranges, as at "
            f"{_told(mechanism, y[np.argmax(undefined)])}; it may be none in single places only"
        )


def _check_metric(mechanism: Mechanism, q: Floats) -> None:
    """The least eigenvalue, looked for ever closer around the places (TRIED, n) where it is least."""
    random, spread = np.random.default_rng(1), np.ptp(q, axis=0)
    scale: Any = None
    for closer in range(CLOSER):
        a = mechanism.metric(q)
        a[~np.isfinite(a).all(axis=(1, 2))] = 0.0
        diagonal = np.abs(np.diagonal(a, axis1=1, axis2=2))
        scale = np.sqrt(np.median(diagonal, axis=0) + 1e-300) if scale is None else scale
        least = np.linalg.eigvalsh(a / scale[:, None] / scale)[:, 0]
        order = np.argsort(least)
        if least[order[0]] < SINGULAR:
            raise _not_definite(mechanism, q[order[0]])
        best = q[order[: TRIED // 16]].repeat(16, axis=0)
        q = best + 0.4**closer * spread * random.normal(size=best.shape)
        q[::16] = best[::16]
        q = np.clip(q, [c.low for c in mechanism.coordinates], [c.high for c in mechanism.coordinates])


def _not_definite(mechanism: Mechanism, place: Floats) -> InputError:
    told = _told(mechanism, place)
    return InputError(f"kinetic: is not positive definite, as at {told}; every motion needs a mass")


def _least_damped(mechanism: Mechanism, y: Floats) -> Floats:
    """States at the same places with rates that lose least: eigenvectors, where power is quadratic."""
    n = len(mechanism.coordinates)
    pairs = np.eye(n)[:, None] + np.eye(n)  # their powers are of a coordinate alone four times its own
    states = np.concatenate(np.broadcast_arrays(y[:, None, None, :n], pairs), axis=-1)
    lost = mechanism.evaluate("powers", [0.0, *np.moveaxis(states, -1, 0)])[1]
    lost = np.where(np.isfinite(lost), lost, 0.0)
    alone = np.diagonal(lost, axis1=1, axis2=2) / 4.0
    damping = lost - alone[:, :, None] - alone[:, None]
    return np.concatenate([y[:, :n], np.linalg.eigh(damping)[1][:, :, 0]], axis=1)


def _told(mechanism: Mechanism, place: Floats) -> str:
    return ", ".join(f"{c.symbol} = {x:.3g}" for c, x in zip(mechanism.coordinates, place, strict=False))


def trial_states(mechanism: Mechanism) -> Floats:
    """States all over the ranges (TRIED, 2 n), of an endless one within some sizes."""
    random, columns = np.random.default_rng(0), []
    for _, low, high, _ in mechanism.coordinates:
        size = 10.0 ** random.uniform(-2.0, 2.0, TRIED)
        if math.isfinite(low) and math.isfinite(high):
            columns.append(random.uniform(low, high, TRIED))
        elif math.isfinite(low):
            columns.append(low + size)
        else:
            columns.append(high - size if math.isfinite(high) else size * random.choice([-1.0, 1.0], TRIED))
    return np.stack([*columns, *random.normal(size=(len(columns), TRIED))], axis=-1)


def sticks(mechanism: Mechanism) -> bool:
    """Whether friction stays as rates vanish, as Coulomb's does, at some of the states tried.

    The power is then in proportion to the rates. That of forces at rest changes its sign with them.
    """
    y = trial_states(mechanism)
    moving = np.arange(y.shape[1]) >= len(mechanism.coordinates)
    both = [np.where(moving, [[[share], [-share]]], 1.0) * y[:, None] for share in SLOW]
    slow, slower = (mechanism.powers(0.0, states).lost.sum(axis=1) for states in both)
    return bool(((slow > 0.0) & (slower * SLOW[0] > 0.5 * slow * SLOW[1])).any())


def _potential_and_motion(mechanism: Mechanism, y: Floats, own: Mapping[str, Floats] | None = None) -> Floats:
    potential = mechanism.evaluate("energies", y.T, own)[1:]
    return np.concatenate([potential, mechanism.accelerations(0.0, y, own).T])


def _changes(before: Floats, after: Floats) -> Floats:
    """Greatest difference of each state, over what rounding explains."""
    known = np.isfinite(before) & np.isfinite(after)
    scale = np.max(np.abs(before), axis=1, where=known, initial=1e-300)[:, None]
    return np.max(np.abs(after - before) / (ROUNDING * scale), axis=0, where=known, initial=0.0)


def powers_of(unit: str, where: str = "") -> tuple[int, ...]:
    """Powers of kg, m and s of a unit such as "N s/m" or "m/s2".

    Raises:
        InputError: it cannot be read.
    """
    total, sign = np.zeros(3, dtype=np.int64), 1
    for part in unit.split("/"):
        for word in part.replace("*", " ").split():
            match = re.fullmatch(r"([A-Za-z]+|1)\^?(-?\d+)?", word)
            if match is None or match[1] not in UNITS:
                raise InputError(
                    f"{where}unit = {shown(unit)}: must be made of {', '.join(UNITS)}, as in 'N s/m'"
                )
            total += sign * int(match[2] or 1) * np.array(UNITS[match[1]])
        sign = -1
    return tuple(total.tolist())


def _size(unit: str) -> float:
    return float(np.prod(SIZES ** powers_of(unit)))


def check_units(mechanism: Mechanism, terms: Sequence[tuple[str, str, Any]]) -> None:
    """Refuse a term of another unit: with units of other sizes the numbers are others, and the laws the same.

    ``terms`` are where each comes from, its unit, and an expression. A parameter that is zero counts as one.

    Raises:
        InputError: a term has another unit.
    """
    import sympy

    y, units = trial_states(mechanism), [mechanism.units.get(name, "1") for name in mechanism.parameters]
    values = np.array([value or 1.0 for value in mechanism.parameters.values()])
    lengths = ["m" if c.symbol.name in mechanism.lengths else "1" for c in mechanism.coordinates]
    symbols = [sympy.Symbol(name, real=True) for name in (*mechanism.state, *mechanism.parameters)]
    sizes = np.array(list(map(_size, [*lengths, *(f"{unit}/s" for unit in lengths), *units])))
    numbers = np.concatenate([y.T, np.tile(values[:, None], TRIED)])
    found = sympy.lambdify(symbols, [expression for _, _, expression in terms], "numpy", cse=True)
    with np.errstate(all="ignore"):
        both = found(*numbers), found(*(sizes[:, None] * numbers))
    for (where, unit, _), *values_of in zip(terms, *both, strict=True):
        one, other = map(np.atleast_1d, values_of)
        known = np.isfinite(one) & np.isfinite(other)
        if not np.allclose(other[known], _size(unit) * one[known], rtol=ROUNDING, atol=0.0):
            raise InputError(
                f"{where}: has another unit than {unit} with the units given: see those of its parameters "
                "(of a spring N/m between points, N m/rad on an angle); plain numbers other than 0 have no "
                'unit: give each as a parameter with its unit, as in {"d": (0.7, "m")}'
            )
