"""Every method by its name, and which one to use.

Measured on the mechanism (largest error of final states, right-hand sides a trajectory): the Adams methods
need the fewest right-hand sides at every accuracy, because each step costs one or two. With steps fitted to
each trajectory (:mod:`fastmech.ensembles.fitting`) ``abm8`` leads down to errors of 1e-5, ``abm10`` to 1e-9,
``abm12`` below, with ``ab6`` and ``ab7`` close behind; of the Runge-Kutta methods ``tsit5`` leads down to
1e-4, ``verner6`` and ``dop853`` to 1e-7, ``hairer10`` below. Choose a Runge-Kutta method where outputs are
close together or unevenly spaced (an Adams method starts anew whenever its step changes), where trajectories
are short, or where the step is large for the system: the Adams methods' stability intervals are short and end
abruptly,

    =========  ====  =====  =====  =====  ====  =====  =====
    method     ab5   ab6    ab7    ab8    abm8  abm10  abm12
    -h lambda  0.16  0.087  0.046  0.024  0.58  0.34   0.21
    =========  ====  =====  =====  =====  ====  =====  =====

for y' = lambda y with real lambda < 0.

The implicit methods are stable at any step for every decaying motion: ``gauss2``, ``gauss4`` and ``gauss6``
(A-stable) keep the energy of conservative scenes over long times in Hamilton's formulation; ``radau3``,
``radau5`` and ``sdirk4`` (L-stable) are for heavy damping, where the explicit methods' limit and not the
accuracy would set the step.
"""

from __future__ import annotations

from fastmech.errors import InputError, shown
from fastmech.integrators.method import Adams, ImplicitRungeKutta, Method, RungeKutta
from fastmech.integrators.tableaus import TABLEAUS
from fastmech.integrators.tableaus.implicit import IMPLICIT_TABLEAUS

_EXPLICIT = "Adams; Bashforth, Adams, Theories of Capillary Action, 1883; weights derived exactly"
_CORRECTED = (
    "Moulton, New Methods in Exterior Ballistics, 1926, with Adams-Bashforth of one order less as predictor"
)

_ALL: tuple[Method, ...] = (
    *map(RungeKutta, TABLEAUS.values()),
    Adams("ab5", 5, False, TABLEAUS["tsit5"], _EXPLICIT),
    Adams("ab6", 6, False, TABLEAUS["tsit5"], _EXPLICIT),
    Adams("ab7", 7, False, TABLEAUS["verner6"], _EXPLICIT),
    Adams("ab8", 8, False, TABLEAUS["verner7"], _EXPLICIT),
    Adams("abm8", 8, True, TABLEAUS["dop853"], _CORRECTED),
    Adams("abm10", 10, True, TABLEAUS["dop853"], _CORRECTED),
    Adams("abm12", 12, True, TABLEAUS["dop853"], _CORRECTED),
    *map(ImplicitRungeKutta, IMPLICIT_TABLEAUS.values()),
)

#: Every method by its name.
METHODS: dict[str, Method] = {method.name: method for method in _ALL}

#: What other libraries call them, in lower case.
_ELSEWHERE = {"rk45": "dopri5", "ode45": "dopri5", "dp5": "dopri5", "radau": "radau5", "vern6": "verner6"}


def find_method(name: str) -> Method:
    """The method of this name.

    Raises:
        InputError: no such method; the message lists the known ones, after the one that is meant by a name in
            capitals or another library's.
    """
    if isinstance(name, str) and name in METHODS:
        return METHODS[name]
    low = name.lower() if isinstance(name, str) else ""
    meant = _ELSEWHERE.get(low, low if low in METHODS else None)
    hint = "" if meant is None else f"did you mean {meant!r}? "
    raise InputError(f"method = {shown(name)}: unknown; {hint}known: {', '.join(METHODS)}")
