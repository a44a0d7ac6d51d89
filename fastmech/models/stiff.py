"""The balance beside a stiff spring, by equations that know which way its force points."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from fastmech.models.balance import jumping
from fastmech.models.statics import Statics
from fastmech.models.writer import simplest

#: Random places at which springs are compared.
PLACES = 64


def beside_stiffest(statics: Statics, values: Sequence[float]) -> Statics | None:
    """Forces of two coordinates along the stiffest spring's and across it; None without a spring.

    A stiff spring holds a mechanism to a narrow curve, on which its force is whatever balances the others.
    Over a box there it is hardly bounded. With forces f = -k e grad e + s, and d a multiple of grad e, the
    part across, d x f = d x s, does not depend on it. Together with d . f it is zero where f is, unless d is.
    """
    springs, stiffnesses = _springs(statics)
    if not springs:
        return None
    random = np.random.default_rng(0)
    places = [random.uniform(c.low, c.high, PLACES) for c in statics.coordinates]
    with np.errstate(all="ignore"):
        found = [float(np.nanmedian(x)) for x in stiffnesses(*places, *values)]
    return _beside(statics, *springs[int(np.argmax(found))])


@lru_cache(maxsize=64)
def _springs(statics: Statics) -> tuple[list[Any], Any]:
    """Springs, also those that touch, and a function of their stiffnesses along the coordinates.

    Of each its term of U, stiffness k, extension e, e as it is where it touches, and d.
    """
    q = [coordinate.symbol for coordinate in statics.coordinates]
    springs = []
    for stored in statics.stored if len(q) == 2 else ():
        term = simplest(stored, q)  # as forces have it
        factor, square = term.as_independent(*q, as_Add=False)
        if square.is_Pow and square.exp == 2:
            e = square.base
            touching = isinstance(e, sympy.Max) and len(e.args) == 2 and e.args[0] == 0
            core = e.args[1] if touching else e
            roots = [x for x in core.atoms(sympy.Pow) if x.exp == sympy.S.Half]
            root = next((x.base for x in roots if not core.xreplace({x: 1}).has(*q)), core)
            d = tuple(sympy.diff(root, a) for a in q)
            if all(d) and (touching or not e.has(sympy.Max, sympy.Min, sympy.Heaviside)):
                springs.append((term, 2 * factor, e, core, d))
    each = [k * sum(sympy.diff(core, a) ** 2 for a in q) for _, k, _, core, _ in springs]
    return springs, sympy.lambdify([*q, *statics.parameters], each, "numpy", cse=True)


@lru_cache(maxsize=64)
def _beside(statics: Statics, term: Any, k: Any, e: Any, core: Any, d: tuple[Any, Any]) -> Statics:
    statics = jumping(statics)
    q = [coordinate.symbol for coordinate in statics.coordinates]
    s = [force + sympy.diff(term, a) for force, a in zip(statics.forces, q, strict=True)]
    turned = k * e * (sympy.diff(core, q[0]) * d[0] + sympy.diff(core, q[1]) * d[1])
    forces = s[0] * d[0] + s[1] * d[1] - turned, s[1] * d[0] - s[0] * d[1]
    regular = d[0] ** 2 + d[1] ** 2
    return statics._replace(forces=forces, conservative=False, also=statics.forces, regular=regular)
