"""Random scenes and states, and the natural scale of every quantity: the sum of the magnitudes of its terms.

A difference is judged against that scale, because a sum whose terms cancel cannot be known any better.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray
from oracles import TABLE_1, oracle

from fastmech.scene import Scene
from fastmech.slider.coefficients import force, reduce
from fastmech.slider.lagrange import unit
from fastmech.slider.reduced import canonical_rates

Floats = NDArray[np.float64]


#: Stiffness and damping over four decades.
decades = st.floats(0.0, 4.0).map(lambda power: 10.0**power)


def held_scenes(**more: Any) -> Any:
    """Scenes under a constant force, for Hypothesis; ``more`` parameters as strategies."""
    return st.builds(
        Scene,
        m1=st.floats(0.1, 100.0),
        m2=st.floats(0.1, 100.0),
        m3=st.floats(0.0, 100.0),
        l=st.floats(0.2, 4.0),
        c1=decades,
        c2=decades,
        F0=st.floats(-2000.0, 2000.0),
        alpha=st.just(0.0),
        **more,
    )


@dataclass(frozen=True)
class Draw:
    """A scene, a state ``y``, momenta ``p`` and a time ``t``."""

    scene: Scene
    y: Floats
    p: Floats
    t: float

    @property
    def params(self) -> dict[str, float]:
        return self.scene.parameters

    @property
    def q(self) -> Floats:
        return self.y[:2]

    @property
    def rates(self) -> Floats:
        return self.y[2:]


@cache
def draws(count: int = 120) -> tuple[Draw, ...]:
    """Table 1, then random draws: the terms that a scene may lack are missing in every combination."""
    return (_draw(0, dict(TABLE_1)), *(_draw(seed, _parameters(seed)) for seed in range(1, count)))


def _parameters(seed: int) -> dict[str, float]:
    random = np.random.default_rng([1, seed])
    params = {key: 10 ** random.uniform(-2, 2) for key in ("m1", "m2", "m3")}
    params |= {key: 10 ** random.uniform(-1, 3.5) for key in ("c1", "c2", "beta")}
    params |= {"l": 10 ** random.uniform(-1, 1), "g": random.uniform(0, 25)}
    params |= {"F0": random.choice([-1.0, 1.0]) * 10 ** random.uniform(0, 3), "alpha": random.uniform(0.1, 2)}
    absent = ("m3", "beta", "F0", "alpha", "c1", "c2", "g")
    params |= {key: 0.0 for bit, key in enumerate(absent) if seed >> bit & 1 and seed % 3 == 0}
    params |= {key: 0.0 for bit, key in enumerate(absent[:4]) if seed >> bit & 1 and seed % 3 == 1}
    return params


def _draw(seed: int, params: dict[str, float]) -> Draw:
    random = np.random.default_rng([2, seed])
    turn = 50.0 if seed % 2 else np.pi
    y = np.concatenate([random.uniform(-turn, turn, 2), random.uniform(-8, 8, 2)])
    scene = Scene(**params)
    return Draw(scene, y, random.uniform(-5, 5, 2) * scene.m2 * scene.l**2, float(random.uniform(0, 3)))


def doubles(values: Any) -> Floats:
    """The oracle's numbers rounded to doubles."""
    return np.array(values, dtype=np.float64)


def energy_scale(d: Draw) -> float:
    """Weights, springs and force, each at its largest [J]."""
    s = d.scene
    stiffness = 2 * (s.c1 + s.c2) * s.l**2
    return (s.m1 + 2 * s.m2) * s.g * s.l + stiffness + 2 * abs(s.F0) * s.l


def metric_scale(d: Draw) -> Floats:
    return np.abs(doubles(oracle().metric(d.params, d.q)))


def kinetic_scale(d: Draw) -> float:
    rates = np.abs(d.rates)
    return float(rates @ metric_scale(d) @ rates) / 2


def force_scale(d: Draw) -> float:
    """Potential forces and the damper [J]."""
    return energy_scale(d) + d.scene.beta * d.scene.l**2 * abs(d.rates[0])


def acceleration_scale(d: Draw) -> Floats:
    """|a^-1| times forces and velocity terms [rad/s2]."""
    gamma, rates = np.abs(doubles(oracle().christoffel(d.params, d.q))), np.abs(d.rates)
    terms = force_scale(d) + np.einsum("kij,i,j->k", gamma, rates, rates)
    return np.abs(np.linalg.inv(doubles(oracle().metric(d.params, d.q)))) @ terms


def rates_scale(d: Draw) -> Floats:
    """|a^-1| |p| [rad/s]."""
    return np.abs(np.linalg.inv(doubles(oracle().metric(d.params, d.q)))) @ np.abs(d.p)


def canonical_scale(d: Draw) -> Floats:
    s, rates = d.scene, rates_scale(d)
    squares = (s.m2 + s.m3) * s.l**2 * rates[0] * rates.sum()
    momentum = energy_scale(d) + squares + s.beta * s.l**2 * rates[0]
    return np.array([*rates, momentum, momentum])


def reaction_scale(d: Draw) -> float:
    """Inertia, weights, springs, force and damper [N]."""
    s = d.scene
    motion = acceleration_scale(d).sum() + np.abs(d.rates).sum() ** 2
    inertia = (s.m1 + s.m2 + s.m3) * (s.l * motion + s.g)
    return float(inertia + 2 * (s.c1 + s.c2) * s.l + abs(s.F0) + s.beta * s.l * abs(d.rates[0]))


def canonical_equations(scene: Scene, q: ArrayLike, p: ArrayLike, t: ArrayLike) -> Floats:
    """(phi', theta', p_phi', p_theta'), paper (14) with dH/dq where it prints dH/dp twice; shape (..., 4)."""
    q = np.asarray(q, dtype=np.float64)
    p = np.asarray(p, dtype=np.float64) / unit(scene)
    c = reduce(scene)
    now = force(scene, t) / (scene.m2 * scene.l)
    trig = np.sin(q[..., 0]), np.cos(q[..., 0]), np.sin(q[..., 1]), np.cos(q[..., 1])
    derivatives = canonical_rates(trig, (p[..., 0], p[..., 1]), c[:5], now, c.damping)
    scale = np.array([1.0, 1.0, unit(scene), unit(scene)])
    return np.stack(np.broadcast_arrays(*derivatives), axis=-1) * scale
