"""What a mechanism has to satisfy beside its names, tried at states all over its ranges when it is built."""

from __future__ import annotations

import math
import re
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from fastmech.arrays import Floats
from fastmech.errors import InputError, shown
from fastmech.loads import Load

if TYPE_CHECKING:
    from fastmech.models.mechanism import Mechanism


#: States that are tried, and relative rounding of what is compared there.
TRIED, ROUNDING = 256, 1e-6

#: Times that a least eigenvalue is looked for closer by, and what is none beside the diagonal's.
CLOSER, SINGULAR = 20, 1e-12

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
        InputError: the metric is not positive definite, dampers feed energy in, an angle that turns fully
            does not come back to the same, or units do not fit.
    """
    from fastmech.models.definite import definite, passive  # SymPy: only where a mechanism is there

    y, n = trial_states(mechanism), len(mechanism.coordinates)
    _check_metric(mechanism, y[:, :n])
    proved, place = definite(mechanism)
    if proved is False:
        raise _not_definite(mechanism, place)
    takes, place = passive(mechanism)
    tried = y.copy()
    tried[TRIED // 2 :, :n] = y[TRIED // 2 :, :n] if takes is not False else place
    for states in (tried[: TRIED // 2], tried[TRIED // 2 :]):
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
    for k, coordinate in enumerate(mechanism.coordinates):
        turned = y.copy()
        turned[:, k] += 2.0 * math.pi
        if coordinate.periodic and not _alike(_potential_and_motion(mechanism, y), mechanism, turned):
            raise InputError(
                f"{coordinate.symbol}: the mechanism is not the same after a full turn of it; "
                f"give the angle a range: fm.angles('{coordinate.symbol}', low, high)"
            )
    if mechanism.units:
        _check_units(mechanism, y)
    return proved is True, takes is True


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


def _potential_and_motion(mechanism: Mechanism, y: Floats) -> Floats:
    return np.concatenate([mechanism.evaluate("energies", y.T)[1:], mechanism.accelerations(0.0, y).T])


def _alike(before: Floats, mechanism: Mechanism, y: Floats) -> bool:
    after = _potential_and_motion(mechanism, y)
    known = np.isfinite(before) & np.isfinite(after)
    scale = np.max(np.abs(before), axis=1, where=known, initial=1e-300)[:, None]
    return bool((np.abs(after - before)[known] <= (ROUNDING * scale + 0.0 * before)[known]).all())


def powers_of(unit: str) -> tuple[int, ...]:
    """Powers of kg, m and s of a unit such as "N s/m" or "m/s2".

    Raises:
        InputError: it cannot be read.
    """
    total, sign = np.zeros(3, dtype=np.int64), 1
    for part in unit.split("/"):
        for word in part.replace("*", " ").split():
            match = re.fullmatch(r"([A-Za-z]+|1)\^?(-?\d+)?", word)
            if match is None or match[1] not in UNITS:
                raise InputError(f"unit = {shown(unit)}: must be made of {', '.join(UNITS)}, as in 'N s/m'")
            total += sign * int(match[2] or 1) * np.array(UNITS[match[1]])
        sign = -1
    return tuple(total.tolist())


def _in_symbols(load: Load) -> bool:
    """Whether a load is made of parameters: of a plain number the unit is not known."""
    numbers = [getattr(load, each.name) for each in fields(load)]
    return all(getattr(x, "free_symbols", ()) or (np.ndim(x) == 0 and x == 0) for x in numbers)


def _check_units(mechanism: Mechanism, y: Floats) -> None:
    """In units of other sizes the numbers are others, and the laws the same."""
    sized = {
        name: value * float(np.prod(SIZES ** powers_of(mechanism.units.get(name, "1"))))
        for name, value in mechanism.parameters.items()
    }
    lengths = np.array(
        [SIZES[1] if name in mechanism.lengths else 1.0 for name in mechanism.state[: len(y.T) // 2]]
    )
    other = y * np.concatenate([lengths, lengths / SIZES[2]])
    joule = SIZES[0] * SIZES[1] ** 2 / SIZES[2] ** 2
    for what, name, unit, arguments in (
        ("kinetic", "energies", joule, [y.T, other.T]),
        ("potential", "energies", joule, [y.T, other.T]),
        ("forces", "powers", joule / SIZES[2], [[1.0, *y.T], [SIZES[2], *other.T]]),
        ("dissipation", "powers", joule / SIZES[2], [[1.0, *y.T], [SIZES[2], *other.T]]),
    ):
        row = int(what in ("potential", "dissipation"))
        if what == "forces" and not all(_in_symbols(acting.load) for acting in mechanism.acting):
            continue
        before, after = (
            mechanism.evaluate(name, arguments[0])[row],
            mechanism.evaluate(name, arguments[1], sized)[row],
        )
        known = np.isfinite(before) & np.isfinite(after)
        if not np.allclose(after[known], unit * before[known], rtol=ROUNDING, atol=0.0):
            raise InputError(
                f"{_wrong_term(mechanism, what, y, other, sized, unit=unit)}: has another unit than "
                f"{'J' if name == 'energies' else 'W'} with the units given; plain numbers other than 0 have "
                'no unit: give such a length as a parameter, as in {"d": (0.7, "m")}'
            )


def _wrong_term(
    mechanism: Mechanism, what: str, y: Floats, other: Floats, sized: dict[str, float], unit: float
) -> str:
    """The spring, damper or mass that has another unit; ``what`` where none is found."""
    import sympy

    for where, kind, expression in mechanism.terms:
        if kind == what:
            states = [sympy.Symbol(name, real=True) for name in mechanism.state]
            constants = [sympy.Symbol(name, real=True) for name in mechanism.parameters]
            term = sympy.lambdify([*states, *constants], expression)
            with np.errstate(all="ignore"):
                before = np.asarray(term(*y.T, *mechanism.parameters.values()) * unit)
                after = np.asarray(term(*other.T, *sized.values()))
            known = np.isfinite(before) & np.isfinite(after)
            if not np.allclose(after[known], before[known], rtol=ROUNDING, atol=0.0):
                return where
    return what
