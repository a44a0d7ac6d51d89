"""What scenes hand to the engine: their equations, and what their energy tells of motions before they begin.

With a constant force T + U never grows, without damper it is conserved; under a decaying force T + Pi grows
by at most F0 (2 l - sgn(F0) x2), the work done if M2 went to the far end of its reach at full force, and
without damper falls by at most F0 (2 l + sgn(F0) x2). Half the square of the rates' kinetic-energy norm is T
over m2 l^2, so no rate of that norm can exceed sqrt(2 (E - U_min)).

A pass goes through :data:`LANES` trajectories at a time, the last time through copies of the last one too:
loops that always have that length are packed instructions for all of them, so a trajectory's numbers depend
neither on its place nor on its companions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import types

from fastmech.arrays import Flags, Floats, Integers
from fastmech.ensembles.fitting import SLACK
from fastmech.ensembles.threads import in_parts
from fastmech.jit import INVERSE_SIGNATURE, MATRIX, kernel
from fastmech.kernels.blocks import Block
from fastmech.kernels.sincos import REDUCTION_LIMIT, sincos
from fastmech.slider.coefficients import Coefficients
from fastmech.slider.kernels.select import right_hand_side
from fastmech.slider.reduced import (
    kinetic,
    metric_11,
    metric_determinant,
    momenta_from_rates,
    potential,
    rates_from_momenta,
    slider_ratio,
)

#: States (n, 4), which a user may have locked.
STATES = types.Array(types.float64, 2, "C", readonly=True)

#: Trajectories that are in the caches together; whole vectors of any processor.
LANES = 64


@kernel(types.void(STATES, MATRIX, MATRIX))
def tell_energies(states: Floats, own: Floats, told: Floats) -> None:
    """See :meth:`SceneMotion.energies`; ``own`` are coefficients (8, n), or (8, 1) where all share them."""
    n, shared = states.shape[0], own.shape[1] == 1
    Y, p, found = np.empty((8, LANES)), np.empty((8, LANES)), np.empty((4, LANES))
    for first in range(0, n, LANES):
        for i in range(LANES):
            row = min(first + i, n - 1)
            for d in range(4):
                Y[d, i] = states[row, d]
            for k in range(8):
                p[k, i] = own[k, 0 if shared else row]
        for angle in range(2):
            beyond = 0
            for i in range(LANES):
                beyond |= abs(Y[angle, i]) > REDUCTION_LIMIT
                Y[4 + 2 * angle, i], Y[5 + 2 * angle, i] = sincos(Y[angle, i])
            if beyond:
                for i in range(LANES):
                    if abs(Y[angle, i]) > REDUCTION_LIMIT:
                        Y[4 + 2 * angle, i], Y[5 + 2 * angle, i] = np.sin(Y[angle, i]), np.cos(Y[angle, i])
        for i in range(LANES):
            s1, c1, s2, c2 = Y[4, i], Y[5, i], Y[6, i], Y[7, i]
            s12, force = s1 * c2 + c1 * s2, p[5, i]
            constant = force if p[7, i] == 0.0 else 0.0
            T = kinetic(metric_11(p[0, i], p[1, i], slider_ratio(s1, c1)[0]), s12, Y[2, i], Y[3, i])
            u = potential((s1, c1, s2, c2), s12, (p[2, i], p[3, i], p[4, i]), constant)
            most, way = abs(force - constant), 2.0 - (c1 - s2 if force > 0.0 else s2 - c1)
            found[0, i], found[1, i], found[2, i] = T + u, most * way, most * (4.0 - way)
            found[3, i] = T + abs(p[2, i]) + p[4, i] + p[3, i] + 2.0 * abs(force)
        for i in range(min(LANES, n - first)):
            for k in range(4):
                told[k, first + i] = found[k, i]


@kernel(INVERSE_SIGNATURE)
def lagrange_inverse(J: Block, mu: complex, G: Block, X: Block, V: Block) -> None:
    """X + i V = (mu - J)^-1 of two angles and their velocities, see :data:`fastmech.jit.INVERSE_SIGNATURE`.

    What solves the systems of implicit methods for Lagrange's equations, in two unknowns in place of four.
    With q' = v these reduce to S dq = r_v + (mu - J_v) r_q with the 2 x 2 matrix S = mu^2 - mu J_v - J_q, and
    dv = mu dq - r_q.
    """
    re, im = mu.real, mu.imag
    for i in range(J.shape[1]):
        q00, q01, q10, q11 = J[8, i], J[9, i], J[12, i], J[13, i]
        v00, v01, v10, v11 = J[10, i], J[11, i], J[14, i], J[15, i]
        square, twice = re * re - im * im, 2.0 * re * im
        s00, s01 = square - re * v00 - q00, -re * v01 - q01
        s10, s11 = -re * v10 - q10, square - re * v11 - q11
        z00, z01, z10, z11 = twice - im * v00, -im * v01, -im * v10, twice - im * v11
        d_re = s00 * s11 - z00 * z11 - (s01 * s10 - z01 * z10)
        d_im = s00 * z11 + z00 * s11 - (s01 * z10 + z01 * s10)
        size = d_re * d_re + d_im * d_im
        e_re, e_im = d_re / size, -d_im / size
        # The inverse of S, real and imaginary parts.
        a00, b00 = e_re * s11 - e_im * z11, e_re * z11 + e_im * s11
        a01, b01 = -(e_re * s01 - e_im * z01), -(e_re * z01 + e_im * s01)
        a10, b10 = -(e_re * s10 - e_im * z10), -(e_re * z10 + e_im * s10)
        a11, b11 = e_re * s00 - e_im * z00, e_re * z00 + e_im * s00
        # Its product with mu - J_v.
        c00 = a00 * (re - v00) - b00 * im - a01 * v10
        c01 = a01 * (re - v11) - b01 * im - a00 * v01
        c10 = a10 * (re - v00) - b10 * im - a11 * v10
        c11 = a11 * (re - v11) - b11 * im - a10 * v01
        X[0, i], X[1, i], X[2, i], X[3, i] = c00, c01, a00, a01
        X[4, i], X[5, i], X[6, i], X[7, i] = c10, c11, a10, a11
        f00 = b00 * (re - v00) + a00 * im - b01 * v10
        f01 = b01 * (re - v11) + a01 * im - b00 * v01
        f10 = b10 * (re - v00) + a10 * im - b11 * v10
        f11 = b11 * (re - v11) + a11 * im - b10 * v01
        X[8, i], X[9, i] = re * c00 - im * f00 - 1.0, re * c01 - im * f01
        X[10, i], X[11, i] = re * a00 - im * b00, re * a01 - im * b01
        X[12, i], X[13, i] = re * c10 - im * f10, re * c11 - im * f11 - 1.0
        X[14, i], X[15, i] = re * a10 - im * b10, re * a11 - im * b11
        if im != 0.0:
            V[0, i], V[1, i], V[2, i], V[3, i] = f00, f01, b00, b01
            V[4, i], V[5, i], V[6, i], V[7, i] = f10, f11, b10, b11
            V[8, i], V[9, i] = re * f00 + im * c00, re * f01 + im * c01
            V[10, i], V[11, i] = re * b00 + im * a00, re * b01 + im * a01
            V[12, i], V[13, i] = re * f10 + im * c10, re * f11 + im * c11
            V[14, i], V[15, i] = re * b10 + im * a10, re * b11 + im * a11


_PHI = np.linspace(0.0, np.pi, 1001)

#: Largest square of the slider's speed over the crank's, in units of l.
_SLIDER_RATIO = float(np.max(np.asarray(slider_ratio(np.sin(_PHI), np.cos(_PHI))[0]) ** 2))


@dataclass(frozen=True)
class SceneMotion:
    """Motions of a scene, or of scenes that differ; see :class:`fastmech.ensembles.fitting.Moving`."""

    c: Coefficients  #: numbers, or one a trajectory

    #: Additions and products, two divisions and two pairs of sine and cosine, each pair as one function.
    operations = 110.0
    inverse = staticmethod(lagrange_inverse)
    rests = 0.0

    @property
    def bounds(self) -> SceneMotion:
        """All that is known beforehand."""
        return self

    def equations(self, formulation: str) -> tuple[Any, tuple[Floats, ...], None]:
        """Right-hand side with the terms that are there, and its parameters."""
        columns = tuple(np.asarray(value, dtype=np.float64) for value in self.c)
        return right_hand_side(self.c, formulation), columns, None

    def part(self, members: Integers) -> SceneMotion:
        """Of some of the trajectories."""
        values: Any = (np.asarray(c)[members] if np.ndim(c) else c for c in self.c)
        return SceneMotion(Coefficients(*values))

    def to_momenta(self, y: Floats) -> Floats:
        """(phi, theta, p_phi, p_theta) with momenta over m2 l^2 from angles and rates."""
        c, (phi, theta, phi_dot, theta_dot) = self.c, np.moveaxis(y, -1, 0)
        with np.errstate(invalid="ignore", over="ignore"):  # states that are not finite have a status
            k, _ = slider_ratio(np.sin(phi), np.cos(phi))
            p = momenta_from_rates(phi_dot, theta_dot, c.mass, c.slider, k, s12=np.sin(phi + theta))
        return np.stack([phi, theta, *p], axis=-1)

    def to_rates(self, y: Floats) -> Floats:
        """Angles and rates from (phi, theta, p_phi, p_theta) with momenta over m2 l^2."""
        c, (phi, theta, p1, p2) = self.c, np.moveaxis(y, -1, 0)
        with np.errstate(invalid="ignore", over="ignore"):
            k, _ = slider_ratio(np.sin(phi), np.cos(phi))
            determinant = metric_determinant(c.mass, c.slider, k, np.cos(phi + theta))
            rates = rates_from_momenta(p1, p2, np.sin(phi + theta), determinant)
        return np.stack([phi, theta, *rates], axis=-1)

    def energies(self, states: Floats, members: slice = slice(None)) -> Floats:
        """T + U of states (n, 4), of all or of some, and what it may become; over m2 l^2 [1/s^2], (4, n).

        A row each: T + U with U = Pi - F x2 of a constant force and Pi of one that decays; the most that a
        decaying force can add to it; the most that it can take; the scale to compare it with, the sum of its
        terms.
        """
        values: Any = [np.asarray(value) for value in self.c]
        some = np.ascontiguousarray(states[members], dtype=np.float64)
        if any(value.ndim and value.strides[0] for value in values):
            own = np.empty((len(values), len(some)))
            for row, value in zip(own, values, strict=True):
                row[:] = value[members] if value.ndim else value
        else:
            own = np.array([value.flat[0] for value in values], dtype=np.float64)[:, None]
        told = np.empty((4, len(some)))
        tell_energies(some, own, told)
        return told

    def impossible(self, start: Floats, final: Floats, threads: int | None = 1) -> Flags:
        """Which motions from states (n, 4) have an energy that they cannot have in any of others (n,)."""
        broken = np.zeros(len(start), dtype=np.bool_)
        damped = np.broadcast_to(self.c.damping, len(start)) != 0.0

        def tell(part: slice) -> None:
            before, gain, fall, scale = self.energies(start, part)
            for states in final if final.ndim > 2 else final[None]:
                after = self.energies(states, part)[0]
                # An energy beyond a double's range is none that a motion can have.
                broken[part] |= ~np.isfinite(after) | (after - before - gain > SLACK * scale)
                broken[part] |= ~damped[part] & (before - after - fall > SLACK * scale)

        in_parts(tell, len(start), threads)
        return broken

    def speed(self, starts: Floats, threads: int | None = None) -> Floats:
        """Bound (n,) on the kinetic-energy norm of the rates, sqrt(2 T / (m2 l^2)) [rad/s], for all time."""
        c, highest = self.c, np.empty(len(starts))  # T + U to which a motion can come

        def tell(part: slice) -> None:
            total, gain, _, _ = self.energies(starts, part)
            np.add(total, gain, out=highest[part])

        in_parts(tell, len(starts), threads)
        force = np.where(np.asarray(c.decay) == 0.0, c.force, 0.0)
        # U = lift sin phi - force cos phi + force sin theta - gravity cos theta - spring sin(phi + theta)
        lowest = -np.hypot(c.lift, force) - np.hypot(c.gravity, force) - np.abs(c.spring)
        with np.errstate(invalid="ignore", over="ignore"):
            highest -= lowest
            np.maximum(highest, 0.0, out=highest)
            highest *= 2.0
        return np.sqrt(highest, out=highest)

    @property
    def turn(self) -> Floats:
        """Of rates of norm 1 none is greater: no inverse of the mass matrix has a greater diagonal entry."""
        return np.sqrt(np.add(self.c.mass, 1.0) / self.c.mass)

    @property
    def frequency(self) -> Floats:
        """Scale [rad/s] of the linear vibrations' frequencies: curvatures of U over their inertia."""
        c = self.c
        phi = (np.hypot(c.lift, c.force) + np.abs(c.spring)) / (c.mass + 1.0)
        theta = np.hypot(c.gravity, c.force) + np.abs(c.spring)
        return np.asarray(np.sqrt(np.maximum(np.maximum(phi, theta), np.finfo(np.float64).tiny)))

    @property
    def damping(self) -> Floats:
        """Bound [1/s] on the rate at which the damper stops motion, over all configurations; 0 without."""
        square = _SLIDER_RATIO
        return np.asarray(self.c.damping * square / (self.c.mass + self.c.slider * square))

    @property
    def fading(self) -> Floats:
        """Rate [1/s] at which the force decays; 0 where there is none, or it is constant."""
        return np.where(np.asarray(self.c.force) != 0.0, self.c.decay, 0.0)
