"""Slow, independent equations of the mechanism, derived by SymPy and evaluated by mpmath at 40 digits.

Nothing is taken from ``fastmech``.  The derivation starts from the positions, paper (6), and from the forces:
weights, the zero-length springs O-M2 (c1) and A-M1 (c2) with A = (0, l), the damper -beta x3' on the slider
and the force F = F0 exp(-alpha t) along +x on M2.  Everything else follows by differentiation.

    from oracles import TABLE_1, oracle
    oracle().accelerations(TABLE_1, (0.9, 0.4, 1.0, -2.0), t=0.5)     # a tuple of mpmath numbers

``params`` is a mapping with the keys m1 m2 m3 l c1 c2 beta g F0 alpha (SI units).  Floats are taken as the
exact binary numbers that they are.  Results are (nested) tuples of ``mpmath.mpf``, which
``numpy.array(result, dtype=float)`` rounds to doubles.  ``q = (phi, theta)`` [rad], ``qd`` [rad/s],
``y = (phi, theta, phi', theta')``, ``p`` [J s].

:func:`motion_rates` is for SciPy: Newton's equations of the three points in doubles, compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import mpmath
import numpy as np
from numba import njit
from numpy.typing import NDArray

DIGITS = 40

#: Table 1 with the stiffness that the paper computed with (printed: 366.67) and the g that fits its numbers.
TABLE_1: Mapping[str, float] = {
    "m1": 10.0, "m2": 12.0, "m3": 8.0, "l": 1.25, "c1": 162.5, "c2": 1100 / 3,
    "beta": 121.0, "g": 9.80665, "F0": 100.0, "alpha": 0.7,
}  # fmt: skip

_CONSTANTS = ("m1", "m2", "m3", "l", "c1", "c2", "beta", "g")

Params = Mapping[str, Any]
Numbers = Sequence[Any]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Reactions:
    """Rod tensions (positive: the rod pulls) and the guide's force on the slider (positive: along +y), in N.

    ``residual`` [N] is the norm of what six Newton equations leave over after fitting the four reactions: it
    is zero, to rounding, exactly when the accelerations that were used obey the constraints' dynamics.
    """

    OM1: Any
    M1M2: Any
    M1M3: Any
    N: Any
    residual: Any


@cache
def oracle() -> Oracle:
    """The one oracle; the first call derives the equations (a few seconds)."""
    return Oracle(_derive())


class Oracle:
    """Evaluates the derived equations; every method returns mpmath numbers with about 40 correct digits."""

    def __init__(self, functions: Mapping[str, Callable[..., Any]]) -> None:
        self._functions = functions

    def _call(self, name: str, params: Params, *groups: Numbers, F: Any = 0) -> tuple[Any, ...]:
        constants = [mpmath.mpf(params[key]) for key in _CONSTANTS]
        arguments = [mpmath.mpf(x) for group in groups for x in group]
        return tuple(mpmath.mpf(x) for x in self._functions[name](*constants, mpmath.mpf(F), *arguments))

    def _matrix(self, name: str, shape: tuple[int, int], params: Params, *groups: Numbers, F: Any = 0) -> Any:
        rows, columns = shape
        flat = self._call(name, params, *groups, F=F)
        return mpmath.matrix([flat[i * columns : (i + 1) * columns] for i in range(rows)])

    def force(self, params: Params, t: Any) -> Any:
        """F(t) = F0 exp(-alpha t) [N]."""
        with mpmath.workdps(DIGITS):
            return mpmath.mpf(params["F0"]) * mpmath.exp(-mpmath.mpf(params["alpha"]) * mpmath.mpf(t))

    def positions(self, params: Params, q: Numbers) -> tuple[Any, ...]:
        """(x1, y1, x2, y2, x3, y3) [m], paper (6)."""
        with mpmath.workdps(DIGITS):
            return self._call("positions", params, q)

    def velocities(self, params: Params, y: Numbers) -> tuple[Any, ...]:
        """Time derivatives of ``positions`` [m/s]."""
        with mpmath.workdps(DIGITS):
            return self._call("velocities", params, y)

    def kinetic_energy(self, params: Params, y: Numbers) -> Any:
        """T [J], paper (8)."""
        with mpmath.workdps(DIGITS):
            return self._call("kinetic", params, y)[0]

    def potential(self, params: Params, q: Numbers, F: Any = 0) -> Any:
        """U = Pi - F x2 [J] with Pi of paper (10), corrected; ``F`` = 0 gives Pi."""
        with mpmath.workdps(DIGITS):
            return self._call("potential", params, q, F=F)[0]

    def gradient(self, params: Params, q: Numbers, F: Any = 0) -> tuple[Any, ...]:
        """dU/dq [J], two numbers."""
        with mpmath.workdps(DIGITS):
            return self._call("gradient", params, q, F=F)

    def hessian(self, params: Params, q: Numbers, F: Any = 0) -> tuple[tuple[Any, ...], ...]:
        """d2U/dq2 [J], paper (19), 2 x 2."""
        with mpmath.workdps(DIGITS):
            return _rows(self._matrix("hessian", (2, 2), params, q, F=F))

    def metric(self, params: Params, q: Numbers) -> tuple[tuple[Any, ...], ...]:
        """a_alpha_beta = d2T/dq'2 [kg m2], paper (11), 2 x 2."""
        with mpmath.workdps(DIGITS):
            return _rows(self._matrix("metric", (2, 2), params, q))

    def christoffel(self, params: Params, q: Numbers) -> tuple[tuple[tuple[Any, ...], ...], ...]:
        """First kind, paper (12), [kg m2]: ``result[alpha][beta][gamma]`` = Gamma_{beta gamma, alpha}."""
        with mpmath.workdps(DIGITS):
            flat = self._call("christoffel", params, q)
        return tuple((flat[4 * k : 4 * k + 2], flat[4 * k + 2 : 4 * k + 4]) for k in range(2))

    def generalized_forces(self, params: Params, q: Numbers, qd: Numbers, t: Any) -> tuple[Any, ...]:
        """Q_alpha of paper (13) [N m]: virtual work of weights, springs, damper and force, two numbers."""
        with mpmath.workdps(DIGITS):
            return self._call("forces", params, q, qd, F=self.force(params, t))

    def accelerations(self, params: Params, y: Numbers, t: Any) -> tuple[Any, ...]:
        """(phi'', theta'') [rad/s2] from Lagrange's equations d/dt dL/dq' - dL/dq = Q_nonpotential."""
        with mpmath.workdps(DIGITS):
            return tuple(self._solve_motion(params, y, self.force(params, t)))

    def _solve_motion(self, params: Params, y: Numbers, F: Any) -> Any:
        inertia = self._matrix("inertia", (2, 2), params, y)
        return mpmath.lu_solve(inertia, mpmath.matrix(self._call("drive", params, y, F=F)))

    def jacobian(self, params: Params, y: Numbers, t: Any) -> tuple[tuple[Any, ...], ...]:
        """d(y')/dy of the first-order system at time ``t`` (the explicit time dependence apart), 4 x 4."""
        with mpmath.workdps(DIGITS):
            F = self.force(params, t)
            inertia = self._matrix("inertia", (2, 2), params, y)
            acceleration = self._solve_motion(params, y, F)
            # inertia a = drive, so da = inertia^-1 (d drive - d(inertia) a).
            rest = self._matrix("residual_jacobian", (2, 4), params, y, acceleration, F=F)
            columns = [mpmath.lu_solve(inertia, rest[:, j]) for j in range(4)]
            zero, one = mpmath.mpf(0), mpmath.mpf(1)
            below = tuple(tuple(columns[j][i] for j in range(4)) for i in range(2))
            return ((zero, zero, one, zero), (zero, zero, zero, one), *below)

    def characteristic_polynomial(self, params: Params, q: Numbers, F: Any = 0) -> tuple[Any, ...]:
        """det(lambda - J) at rest in ``q`` under a constant force ``F``: five numbers, powers falling."""
        frozen = {**params, "F0": F, "alpha": 0}
        with mpmath.workdps(DIGITS):
            J = mpmath.matrix(self.jacobian(frozen, (*q, 0, 0), 0))
            coefficients = [mpmath.mpf(1)]
            M = mpmath.zeros(4)
            for k in range(1, 5):  # Faddeev-LeVerrier
                M = J * M + coefficients[-1] * mpmath.eye(4)
                product = J * M
                coefficients.append(-sum(product[i, i] for i in range(4)) / k)
            return tuple(coefficients)

    def momenta(self, params: Params, q: Numbers, qd: Numbers) -> tuple[Any, ...]:
        """p = dT/dq' [J s], two numbers."""
        with mpmath.workdps(DIGITS):
            return self._call("momenta", params, q, qd)

    def hamiltonian(self, params: Params, q: Numbers, p: Numbers) -> Any:
        """H = p q' - T + Pi [J], paper (15)."""
        with mpmath.workdps(DIGITS):
            return self._call("hamiltonian", params, q, p)[0]

    def hamilton_rhs(self, params: Params, q: Numbers, p: Numbers, t: Any) -> tuple[Any, ...]:
        """(phi', theta', p_phi', p_theta') of paper (14) with dp/dt = -dH/dq + Q_nonpotential."""
        with mpmath.workdps(DIGITS):
            return self._call("canonical", params, q, p, F=self.force(params, t))

    def reactions(self, params: Params, y: Numbers, t: Any) -> Reactions:
        """Lagrange multipliers: four reactions fitted to the six Newton equations of M1, M2 and M3."""
        with mpmath.workdps(DIGITS):
            F = self.force(params, t)
            acceleration = self._solve_motion(params, y, F)
            missing = mpmath.matrix(self._call("newton_missing", params, y, acceleration, F=F))
            directions = self._matrix("newton_directions", (6, 4), params, y)
            # The columns are unit vectors far from dependent, so the normal equations lose no digits.
            fitted = mpmath.lu_solve(directions.T * directions, directions.T * missing)
            return Reactions(*[*fitted, mpmath.norm(missing - directions * fitted)])


def _rows(matrix: Any) -> tuple[tuple[Any, ...], ...]:
    return tuple(tuple(matrix[i, j] for j in range(matrix.cols)) for i in range(matrix.rows))


def _derive() -> dict[str, Callable[..., Any]]:
    """Derive everything from positions and forces; return one mpmath function for each quantity."""
    import sympy as sp

    m1, m2, m3, l, c1, c2, beta, g = constants = sp.symbols(" ".join(_CONSTANTS))
    F, t = sp.symbols("F t")
    q, v, a, p = (sp.Matrix(sp.symbols(names)) for names in ("phi theta", "v1 v2", "a1 a2", "p1 p2"))
    phi, theta = q
    half = sp.Rational(1, 2)

    # Positions, paper (6), and velocities by the chain rule.
    r1 = sp.Matrix([l * sp.cos(phi), l * sp.sin(phi)])
    r2 = r1 - sp.Matrix([l * sp.sin(theta), l * sp.cos(theta)])
    r3 = sp.Matrix([l * (sp.cos(phi) + sp.sqrt(4 - sp.sin(phi) ** 2)), 0])
    r = sp.Matrix([r1, r2, r3])
    dr = r.jacobian(q)
    velocity = dr * v
    masses = (m1, m1, m2, m2, m3, m3)

    # Energies, paper (8) and (10).
    T = half * sum(m * w**2 for m, w in zip(masses, velocity, strict=True))
    A = sp.Matrix([0, l])
    Pi = g * (m1 * r1[1] + m2 * r2[1] + m3 * r3[1]) + half * (c1 * r2.dot(r2) + c2 * (r1 - A).dot(r1 - A))
    U = Pi - F * r2[0]

    # Applied forces on the six Cartesian coordinates, and their virtual work.
    potential_forces = sp.Matrix([c2 * (A - r1), -c1 * r2, sp.zeros(2, 1)])
    potential_forces -= sp.Matrix([0, m1 * g, 0, m2 * g, 0, m3 * g])
    other_forces = sp.Matrix([0, 0, F, 0, -beta * velocity[4], 0])
    applied = potential_forces + other_forces
    Q = dr.T * applied
    Q_other = dr.T * other_forces

    # Metric and Christoffel symbols of the first kind, [beta gamma, alpha].
    metric = sp.hessian(T, list(v))
    christoffel = [
        half * (metric[k, j].diff(q[i]) + metric[k, i].diff(q[j]) - metric[i, j].diff(q[k]))
        for k in range(2)
        for i in range(2)
        for j in range(2)
    ]

    # Lagrange's equations with q(t) as functions of time, so that d/dt is SymPy's own.
    in_time = sp.Matrix([sp.Function("phi")(t), sp.Function("theta")(t)])
    to_time = {**dict(zip(q, in_time, strict=True)), **dict(zip(v, in_time.diff(t), strict=True))}
    second = dict(zip(in_time.diff(t, 2), a, strict=True))
    first = dict(zip(in_time.diff(t), v, strict=True))
    zeroth = dict(zip(in_time, q, strict=True))
    L = T - Pi
    momenta = sp.Matrix([L.diff(v[0]), L.diff(v[1])])
    momentum_rate = momenta.subs(to_time, simultaneous=True).diff(t).subs(second).subs(first).subs(zeroth)
    equations = momentum_rate - sp.Matrix([L.diff(phi), L.diff(theta)])
    inertia = equations.jacobian(a)
    at_zero = equations.subs({a[0]: 0, a[1]: 0})
    drive = Q_other - at_zero
    y = sp.Matrix([q, v])
    residual_jacobian = (drive - inertia * a).jacobian(y)

    # Canonical equations: invert p = dT/dq', H = p q' - L, and differentiate.
    qd_of_p = metric.adjugate() * p / metric.det()
    H = (p.dot(v) - L).subs(dict(zip(v, qd_of_p, strict=True)), simultaneous=True)
    Q_of_p = Q_other.subs(dict(zip(v, qd_of_p, strict=True)), simultaneous=True)
    canonical = [H.diff(p[0]), H.diff(p[1]), -H.diff(phi) + Q_of_p[0], -H.diff(theta) + Q_of_p[1]]

    # Newton's equations m r'' = applied + directions * (OM1, M1M2, M1M3, N); a tension pulls both ends in.
    acceleration = dr * a + velocity.jacobian(q) * v
    newton_missing = sp.diag(*masses) * acceleration - applied
    directions = sp.zeros(6, 4)
    directions[0:2, 0] = -r1 / l
    directions[0:2, 1] = (r2 - r1) / l
    directions[2:4, 1] = (r1 - r2) / l
    directions[0:2, 2] = (r3 - r1) / (2 * l)
    directions[4:6, 2] = (r1 - r3) / (2 * l)
    directions[5, 3] = 1

    def function(quantity: Any, *groups: Any) -> Callable[..., Any]:
        arguments = [*constants, F, *(x for group in groups for x in group)]
        result: Callable[..., Any] = sp.lambdify(arguments, list(quantity), modules="mpmath", cse=True)
        return result

    return {
        "positions": function(r, q),
        "velocities": function(velocity, y),
        "kinetic": function([T], y),
        "potential": function([U], q),
        "gradient": function([U.diff(x) for x in q], q),
        "hessian": function(sp.hessian(U, list(q)), q),
        "metric": function(metric, q),
        "christoffel": function(christoffel, q),
        "forces": function(Q, y),
        "inertia": function(inertia, y),
        "drive": function(drive, y),
        "residual_jacobian": function(residual_jacobian, y, a),
        "momenta": function(momenta, y),
        "hamiltonian": function([H], q, p),
        "canonical": function(canonical, q, p),
        "newton_missing": function(newton_missing, y, a),
        "newton_directions": function(directions, y),
    }


def motion_rates(params: Params) -> Callable[[float, Floats], Floats]:
    """Rates of states (..., 4): Newton's equations of x1, y1, x2, y2, x3, projected on the free motions."""
    names = ("m1", "m2", "m3", "l", "g", "c1", "c2", "beta", "F0", "alpha")
    values = tuple(float(params[name]) for name in names)

    def rates(t: float, y: Floats) -> Floats:
        states = np.ascontiguousarray(y, dtype=np.float64).reshape(-1, 4)
        found = np.empty_like(states)
        _projected(values, t, states, found)
        return found.reshape(np.shape(y))

    return rates


@njit
def _projected(values: Any, t: float, states: Floats, found: Floats) -> None:
    """Compiled: SciPy asks thousands of times, for one state or for many together."""
    m1, m2, m3, l, g, spring1, spring2, beta, F0, alpha = values
    mass, force = (m1, m1, m2, m2, m3), F0 * np.exp(-alpha * t)
    for i in range(len(states)):
        phi, theta, u, w = states[i]
        s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
        root = np.sqrt(4.0 - s1 * s1)
        k = -l * (s1 + s1 * c1 / root)
        dk = -l * (c1 + (c1 * c1 - s1 * s1) / root + (s1 * c1) ** 2 / root**3)
        by_phi = (-l * s1, l * c1, -l * s1, l * c1, k)
        by_theta = (0.0, 0.0, -l * c2, l * s2, 0.0)
        bending = (
            -l * c1 * u * u,
            -l * s1 * u * u,
            -l * c1 * u * u + l * s2 * w * w,
            -l * s1 * u * u + l * c2 * w * w,
            dk * u * u,
        )
        x2, y2 = l * (c1 - s2), l * (s1 - c2)
        applied = (
            -spring2 * l * c1,
            spring2 * l * (1.0 - s1) - m1 * g,
            force - spring1 * x2,
            -spring1 * y2 - m2 * g,
            -beta * k * u,
        )
        a11 = a12 = a22 = q1 = q2 = 0.0
        for j in range(5):
            drive = applied[j] - mass[j] * bending[j]
            a11 += mass[j] * by_phi[j] * by_phi[j]
            a12 += mass[j] * by_phi[j] * by_theta[j]
            a22 += mass[j] * by_theta[j] * by_theta[j]
            q1 += by_phi[j] * drive
            q2 += by_theta[j] * drive
        determinant = a11 * a22 - a12 * a12
        found[i, 0], found[i, 1] = u, w
        found[i, 2] = (a22 * q1 - a12 * q2) / determinant
        found[i, 3] = (a11 * q2 - a12 * q1) / determinant
