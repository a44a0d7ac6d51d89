"""What the tests of block kernels share: kernels by name, blocks of lanes, what they must equal."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from slider.draws import canonical_equations

from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.kernels.select import FORMULATIONS, with_terms
from fastmech.slider.lagrange import angular_accelerations, unit

Floats = NDArray[np.float64]

#: Combination of terms -> the parameters that lack what it lacks.
TERMS: dict[str, dict[str, float]] = {
    "free": {"beta": 0.0, "F0": 0.0},
    "damped": {"F0": 0.0},
    "constant": {"beta": 0.0, "alpha": 0.0},
    "damped_constant": {"alpha": 0.0},
    "decaying": {"beta": 0.0},
    "damped_decaying": {},
}

COMBINATIONS = [(formulation, terms) for formulation in FORMULATIONS for terms in TERMS]


def kernel(formulation: str, terms: str) -> Any:
    return with_terms(formulation, terms)


def evaluate(rhs: Any, scene: Scene, Y: Floats, t: float = 0.0) -> Floats:
    """Derivatives of the lanes of ``Y`` (dim, lanes); it starts as NaN: nothing stays unwritten."""
    dY = np.full(Y.shape, np.nan)
    with np.errstate(all="ignore"):  # plain Python warns where compiled code is silent
        params = np.repeat(np.array(reduce(scene))[:, None], Y.shape[1], axis=1)
        rhs(t, np.ascontiguousarray(Y), dY, params)
    return dY


def expected(formulation: str, scene: Scene, Y: Floats, t: float) -> Floats:
    """The mechanism's functions on the same lanes, library trigonometry; momenta over m2 l^2."""
    y = Y.T
    if formulation == "lagrange":
        return np.concatenate([y[:, 2:], angular_accelerations(scene, y, t)], axis=1).T
    scale = np.array([1.0, 1.0, unit(scene), unit(scene)])
    return (canonical_equations(scene, y[:, :2], y[:, 2:] * unit(scene), t) / scale).T


def lanes(n: int, seed: int = 0, angle: float = 10.0, rate: float = 5.0) -> Floats:
    random = np.random.default_rng(seed)
    return np.concatenate([random.uniform(-angle, angle, (2, n)), random.uniform(-rate, rate, (2, n))])
