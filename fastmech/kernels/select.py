"""Which kernel an ensemble is given: only the terms that its scenes have."""

from __future__ import annotations

from typing import Any

import numpy as np

from fastmech.kernels import canonical, lagrange
from fastmech.mechanism.coefficients import Coefficients

#: Formulations, and the modules of their kernels.
FORMULATIONS = {"lagrange": lagrange, "hamilton": canonical}


def terms(coefficients: Coefficients) -> str:
    """Name of the combination of terms: free, damped, constant, damped_constant, ...

    Coefficients may be arrays over trajectories: a term is there if any trajectory has it.
    """
    present = []
    if np.any(coefficients.damping):
        present.append("damped")
    if np.any(coefficients.force):
        present.append("decaying" if np.any(coefficients.decay) else "constant")
    return "_".join(present) or "free"


def right_hand_side(coefficients: Coefficients, formulation: str = "lagrange") -> Any:
    """Block right-hand side of a formulation, ``"lagrange"`` or ``"hamilton"``, with these terms."""
    module = FORMULATIONS[formulation]
    return getattr(module, f"{module.__name__.rpartition('.')[2]}_{terms(coefficients)}")
