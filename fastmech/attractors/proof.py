"""A place of rest of a system and a ball that it attracts, both proved by interval arithmetic.

The right-hand side is called once with SymPy's symbols; what cannot be called so is not proved. That a box
holds one zero of it is Krawczyk's test (Neumaier, *Interval Methods for Systems of Equations*, section 5.1).
V = e' P e falls on the whole ellipsoid V < 1 about the zero if P J + J' P is negative definite for all
Jacobians J over a box that holds the ellipsoid: f(x) is the mean of J along the line from the zero to x,
applied to e (Hahn, *Stability of Motion*, section 25). Then all motions from there come to the place.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from fastmech.arrays import Floats
from fastmech.ensembles.system import System
from fastmech.kernels.rebuilding import rebuilt
from fastmech.kernels.sincos import cos, sin

#: Most states of a system for which this is tried; halvings of the box, and refinements of the ball.
MOST_STATES, HALVINGS, REFINEMENTS = 12, 40, 4

#: Sizes of boxes in which the zero is looked for, as shares of the scale.
BOXES = (1e-12, 1e-10, 1e-8, 1e-6)


class RestProof(NamedTuple):
    """One place of rest, and what it attracts."""

    box: Floats  #: holds one place of rest (dim, 2)
    form: Floats  #: every motion from e' P e < 1 about it comes to it (dim, dim)


def lyapunov_form(solve: Callable[[], Floats]) -> Floats:
    """What SciPy's solver gives, without its warnings: whether V falls is tried, or proved, in any case."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return solve()


def prove_rest(system: System, place: Floats, scale: Floats) -> RestProof | None:
    """Prove a place of rest near ``place`` (dim,), states being of size ``scale`` (dim,); None: no proof."""
    try:
        equations = _Equations(system, scale)
    except Exception:  # whatever a function makes of symbols: it is then not proved
        return None
    near = place / scale
    try:
        box = equations.zero_near(near)
        form = None if box is None else equations.ball_about(box)
    except (ArithmeticError, ValueError, NotImplementedError):
        return None
    if box is None or form is None:
        return None
    return RestProof(box * scale[:, None], form / np.outer(scale, scale))


class _Equations:
    """The right-hand side and its Jacobian in units of the scale, over boxes."""

    def __init__(self, system: System, scale: Floats) -> None:
        import sympy

        dim = len(system.state)
        if dim > MOST_STATES:
            raise ValueError
        t, states = sympy.Symbol("t"), sympy.symbols(f"y0:{dim}", real=True)
        swaps: Any = {sin: sympy.sin, cos: sympy.cos}
        swaps |= {getattr(m, n): getattr(sympy, n) for m in (math, np) for n in ("sin", "cos", "exp", "sqrt")}
        rhs: Any = system.rhs
        function: Any = rebuilt(rhs, "fastmech_proof", swaps, plain=True)
        units = [sympy.Rational(float(s)) for s in scale]
        y = [unit * state for unit, state in zip(units, states, strict=True)]
        values = {name: sympy.Rational(value) for name, value in system.parameters.items()}
        if system.vector:
            found = np.empty(dim, dtype=object)
            function(t, np.array(y, dtype=object), np.array(list(values.values()), dtype=object), found)
        else:
            found = function(t, *y, *(values[name] for name in system.parameter_order))
        self.f = [_exact(sympy.sympify(rate)) / unit for rate, unit in zip(found, units, strict=True)]
        if len(self.f) != dim or any(rate.free_symbols - set(states) for rate in self.f):
            raise ValueError
        self.states, self.J = states, [[rate.diff(state) for state in states] for rate in self.f]

    def at(self, expressions: list[Any], box: list[Any]) -> list[Any]:
        """Intervals that expressions take over a box."""
        known = dict(zip(self.states, box, strict=True))
        return [_enclosed(expression, known) for expression in expressions]

    def jacobian(self, box: list[Any]) -> tuple[Floats, Floats]:
        """Middles and half widths, rounded outwards, of the Jacobian over a box (dim, dim)."""
        rows = [self.at(row, box) for row in self.J]
        low = np.array([[float(x.a) for x in row] for row in rows])
        high = np.array([[float(x.b) for x in row] for row in rows])
        with np.errstate(invalid="ignore"):  # over a box that holds a pole
            middle = 0.5 * (low + high)
            width = np.maximum(high - middle, middle - low)
        return middle, width * (1.0 + 1e-15) + np.spacing(np.abs(middle)) * 4.0

    def zero_near(self, place: Floats) -> Floats | None:
        """A box (dim, 2) with exactly one zero."""
        from mpmath import iv

        n = len(place)
        for size in BOXES:
            box = [iv.mpf([x - size, x + size]) for x in place.tolist()]
            middle = [iv.mpf(x) for x in place.tolist()]
            J = [self.at(row, box) for row in self.J]
            A = np.linalg.inv(self.jacobian(middle)[0]).tolist()
            f = self.at(self.f, middle)
            image = []
            for i in range(n):
                total = middle[i] - sum((iv.mpf(A[i][k]) * f[k] for k in range(n)), iv.mpf(0))
                for j in range(n):
                    rest = iv.mpf(int(i == j)) - sum((iv.mpf(A[i][k]) * J[k][j] for k in range(n)), iv.mpf(0))
                    total += rest * (box[j] - middle[j])
                image.append(total)
            if all(b.a < k.a and k.b < b.b for k, b in zip(image, box, strict=True)):
                return np.array([[float(b.a), float(b.b)] for b in box])
        return None

    def ball_about(self, box: Floats) -> Floats | None:
        """The form P of an ellipsoid, the largest of those tried, on which V falls."""
        from mpmath import iv

        middle = self.jacobian([iv.mpf(x) for x in box.mean(axis=1).tolist()])[0]
        if np.linalg.eigvals(middle).real.max() >= 0.0:
            return None
        P = lyapunov_form(lambda: solve_continuous_lyapunov(middle.T, -np.eye(len(box))))
        P = 0.5 * (P + P.T)
        if np.linalg.eigvalsh(P)[0] <= 0.0:
            return None
        half = np.sqrt(np.diag(np.linalg.inv(P)))  # of the box about V < 1

        def falls(level: float) -> bool:
            reach = half * (math.sqrt(level) * (1.0 + 1e-10))
            sides = np.stack([box[:, 0] - reach, box[:, 1] + reach], axis=1).tolist()
            J, width = self.jacobian([iv.mpf(side) for side in sides])
            S, R = P @ J, np.abs(P) @ width
            S, R = S + S.T, R + R.T
            slack = np.abs(R).sum(axis=1).max() + 1e-12 * len(S) * np.abs(S).sum(axis=1).max()
            return bool(np.linalg.eigvalsh(S)[-1] + slack < 0.0)

        level = 1.0 / float(half.max()) ** 2 * 16.0
        for _ in range(HALVINGS):
            if falls(level):
                break
            level *= 0.25
        else:
            return None
        low, high = level, 4.0 * level
        for _ in range(REFINEMENTS):
            level = math.sqrt(low * high)
            low, high = (level, high) if falls(level) else (low, level)
        return P / low


def _exact(expression: Any) -> Any:
    """The same with its floats as the fractions that they are."""
    import sympy

    return expression.xreplace({x: sympy.Rational(x) for x in expression.atoms(sympy.Float)})


def _enclosed(e: Any, known: dict[Any, Any]) -> Any:
    """An interval that holds all values of an expression for symbols in intervals."""
    from mpmath import iv

    if e in known:
        return known[e]
    if e.is_Rational:
        return iv.mpf(int(e.p)) / iv.mpf(int(e.q))
    if e.is_Add:
        return sum((_enclosed(x, known) for x in e.args), iv.mpf(0))
    if e.is_Mul:
        product = iv.mpf(1)
        for x in e.args:
            product *= _enclosed(x, known)
        return product
    if e.is_Pow and e.exp.is_Rational and int(e.exp.q) in (1, 2):
        base = _enclosed(e.base, known)
        base = base if int(e.exp.q) == 1 else iv.sqrt(base)
        power = base ** abs(int(e.exp.p))
        return power if e.exp > 0 else 1 / power
    enclosed = {"sin": iv.sin, "cos": iv.cos, "exp": iv.exp}.get(type(e).__name__)
    if enclosed is None:
        raise NotImplementedError(type(e).__name__)
    return enclosed(_enclosed(e.args[0], known))
