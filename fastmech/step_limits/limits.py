"""How much a motion may grow in the steps of a run, and how many of them are taken where it is."""

from __future__ import annotations

from typing import Any

import numpy as np

from fastmech.jit import inlined

#: Growth a step that is let pass where a motion only crosses the configurations that set the limit.
PASSING = 0.01

#: Logarithm of the growth that is let pass in the steps taken at a place.
ALLOWED = float(np.log1p(PASSING))

#: Growth of an Adams method's errors in a run that is warned of: those of its starter are far above rounding.
SPURIOUS = 1e4

#: Angle [rad] by which a body may turn in one step.
TURN = 1.0

#: Last term of an Adams method's predictor in an angle [rad] that is let pass.
LAST_TERM = 0.01

#: Share of a growth that is let pass up to which a bound acquits: the rest is for what a table misses between
#: its places.
CERTAIN = 0.8

#: By how much rounding may make a step longer than the dt that it was to be.
ROUNDED = 1e-6

#: Verdicts on trajectories; those of which a pass is unsure are settled by LAPACK's eigenvalues.
INNOCENT, GROWS, UNSURE = 0, 1, 2


@inlined
def steps_there(time: Any, dt: Any, number: Any) -> Any:
    """Steps of dt [s] that are taken in a time [s], at least one, at most those of the run."""
    return np.fmin(np.fmax(time / dt, 1.0), number)


@inlined
def factor_of(there: Any) -> Any:
    """The growth a step that makes what is let pass in so many steps."""
    return np.exp(ALLOWED / there)


@inlined
def errors_of(number: Any, spurious: Any) -> Any:
    """The growth a step that makes ``spurious`` of errors in so many steps."""
    return np.exp(np.log(spurious) / number)
