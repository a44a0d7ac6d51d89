"""Methods' limits on the axes, the largest stable step as the method itself shows it, and pictures of both.

That is where its differenced one-step map turns unstable. The map of one step about the equilibrium is
differenced (central differences through the compiled driver and the nonlinear equations of motion) and its
spectral radius watched: growth just beyond the limit may be 1e-5 a step, which no trajectory would show. An
Adams method's map takes its history, so its formula is applied to histories around the equilibrium, with the
compiled right-hand side.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.arrays import Flags, Floats
from fastmech.ensembles.run import run_ensemble
from fastmech.integrators import methods
from fastmech.integrators.methods import METHODS, Adams, ImplicitRungeKutta, Method, RungeKutta, find_method
from fastmech.plots.style import PALETTE, entry, legend_below, new_figure, style, swatch
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.equilibria import Equilibrium
from fastmech.slider.kernels.select import right_hand_side
from fastmech.slider.linearize import jacobian
from fastmech.slider.motion import lagrange_inverse
from fastmech.step_limits.amplification import (
    amplifies,
    first_crossing,
    history_row,
    stability_function,
    stability_polynomial,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Half width of the differences [rad, rad/s]: its square and the rounding over it are both near 1e-11.
WIDTH = 1e-5


def measured_stable_step(scene: Scene, equilibrium: Equilibrium, method: str) -> float:
    """Least step [s] at which the spectral radius of the differenced one-step map crosses 1; inf if none.

    Raises:
        InputError: an argument is wrong.
    """
    formula = methods.with_inverse(find_method(method), lagrange_inverse)
    fastest = float(np.abs(np.linalg.eigvals(jacobian(scene, equilibrium))).max())
    frozen = reduce(scene.replace(F0=equilibrium.force, alpha=0.0))
    at, params = np.array([*equilibrium.position, 0.0, 0.0]), np.array(frozen, dtype=np.float64)
    rhs = right_hand_side(frozen)

    def step_map(h: float) -> Floats:
        if isinstance(formula, Adams):
            return _history_map(formula, rhs, params, at, h)
        run = run_ensemble(rhs, params, _around(at).T, np.array([0.0, h]), h, method=formula, threads=1)
        return _difference(run.states[-1].T)

    def grow(steps: Floats) -> Flags:
        matrices = np.array([step_map(h) for h in steps.tolist()])
        return np.asarray(np.abs(np.linalg.eigvals(matrices)).max(axis=1) > 1.0)

    return first_crossing(grow, 0.01 / fastest, 100.0 / fastest)


def _around(at: Floats) -> Floats:
    """Columns: ``at`` with each component ahead by WIDTH, then each behind."""
    shifts = WIDTH * np.eye(at.size)
    return np.ascontiguousarray(at[:, None] + np.concatenate([shifts, -shifts], axis=1))


def _difference(after: Floats) -> Floats:
    ahead, behind = np.split(after, 2, axis=1)
    return np.asarray((ahead - behind) / (2.0 * WIDTH))


def _history_map(method: Adams, rhs: Any, params: Floats, at: Floats, h: float) -> Floats:
    rows = method.predictor.size
    history = _around(np.tile(at, rows)).reshape(rows, at.size, -1)
    own = np.repeat(params[:, None], history.shape[2], axis=1)

    def slope(Y: Floats) -> Floats:
        dY = np.empty_like(Y)
        rhs(0.0, np.ascontiguousarray(Y), dY, own)
        return dY

    slopes = np.array([slope(Y) for Y in history])
    ahead = history[0] + h * np.tensordot(method.predictor, slopes, 1)
    if method.corrects:
        corrected = method.corrector[0] * slope(ahead) + np.tensordot(method.corrector[1:], slopes, 1)
        ahead = history[0] + h * corrected
    return _difference(np.concatenate([ahead[None], history[:-1]]).reshape(rows * at.size, -1))


def companion(method: Adams, z: ArrayLike) -> NDArray[np.complex128]:
    """The matrices (..., k, k) that take the history (y_n, y_(n-1), ...) of y' = lambda y one step on."""
    row = history_row(method, z)
    size = row.shape[-1]
    matrices = np.tile(np.eye(size, k=-1, dtype=np.complex128), (*row.shape[:-1], 1, 1))
    matrices[..., 0, :] = row
    return matrices


def amplification(method: Method, z: ArrayLike) -> Floats:
    """Factor by which a step multiplies small motions: |R(z)|, or the history map's spectral radius."""
    if not isinstance(method, Adams):
        return np.abs(stability_function(method, z))
    return np.asarray(np.abs(np.linalg.eigvals(companion(method, z))).max(axis=-1))


#: Growth a step that rounding explains.
ROUNDED = 1e-11

#: Where the search begins and ends: a method that is stable to the end has no limit.
NEAREST, FARTHEST = 1e-3, 1e8

#: Where growth is looked for that begins at once, and decimal digits that show it: y to the power 14.
SMALL, DIGITS = 1e-4, 100


def real_limit(method: Method) -> float:
    """Largest x such that the method is stable at every -x' with 0 < x' <= x; inf if A-stable there."""
    return first_crossing(lambda x: amplifies(method, -x, 1.0 + ROUNDED), NEAREST, FARTHEST)


def imaginary_limit(method: Method) -> float:
    """Largest y such that the method is stable at every i y', 0 < y' <= y; 0 if growth begins at once."""
    if isinstance(method, RungeKutta):
        return _explicit_imaginary(method)
    if isinstance(method, Adams) and _grows_at_once(method):
        return 0.0
    return first_crossing(lambda y: amplifies(method, 1j * y, 1.0 + ROUNDED), NEAREST, FARTHEST)


def _grows_at_once(method: Adams) -> bool:
    """Whether motion grows at z = iy however small y is; in digits that show the growth's leading power."""
    import mpmath  # takes longer to import than a first run

    past = methods.bashforth(method.start_steps + 1)
    with mpmath.workdps(DIGITS):
        z: Any = mpmath.mpc(0, SMALL)
        exact: Any = lambda w: mpmath.mpf(w.numerator) / w.denominator  # noqa: E731
        row = [int(age == 0) + z * exact(weight) for age, weight in enumerate(past)]
        if method.corrects:
            new, *others = map(exact, methods.moulton(method.order))
            row = [int(age == 0) + z * (w + new * row[age]) for age, w in enumerate(others)]
        root = mpmath.findroot(lambda x: x - sum(w * x**-age for age, w in enumerate(row)), mpmath.exp(z))
        return bool(abs(root) > 1)


def _explicit_imaginary(method: RungeKutta) -> float:
    """From |R(iy)|^2 - 1, a polynomial in y^2 whose powers up to the order vanish."""
    r = stability_polynomial(method)
    powers = np.arange(r.size)
    signed = r * (-1.0) ** (powers // 2)  # coefficients by rising powers of y
    even, odd = np.where(powers % 2, 0.0, signed), np.where(powers % 2, signed, 0.0)
    growth = np.convolve(even, even) + np.convolve(odd, odd)
    growth[: method.order + 1] = 0.0
    magnitude = np.convolve(np.abs(even), np.abs(even)) + np.convolve(np.abs(odd), np.abs(odd))
    growth[np.abs(growth) < 1e-13 * magnitude] = 0.0
    present = np.flatnonzero(growth)
    if not present.size or growth[present[0]] > 0.0:
        return 0.0
    roots = np.roots(growth[present[0] : present[-1] + 1][::-1])
    real = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0.0)]
    return float(real.min())


#: Points a side of the fields of |R|, and panels in a row.
SIDE, ACROSS = 181, 4

#: Step [s] for the eigenvalues of a method that has no limit, and half width of its panel.
WITHOUT_LIMIT, WIDE = 2.0, 14.0

#: Pages of stability regions: methods on them, title.
REGIONS = {
    "explicit": (RungeKutta, "Stability regions |R(z)| ≤ 1 of the explicit Runge-Kutta methods"),
    "adams": (Adams, "Stability regions of the Adams methods, by the roots of the history's map"),
    "implicit": (ImplicitRungeKutta, "Stability regions |R(z)| ≤ 1 of the implicit Runge-Kutta methods"),
}

#: Marks of a panel: marker, edge, face.
PREDICTED = {"marker": "o", "mec": PALETTE["vermillion"], "mfc": PALETTE["vermillion"], "ms": 6, "ls": ""}
MEASURED = PREDICTED | {"marker": "x", "mec": PALETTE["black"]}
ON_REAL = PREDICTED | {"marker": "D", "mec": PALETTE["black"], "mfc": "white", "ms": 5}
ON_IMAGINARY = ON_REAL | {"marker": "s"}


class Limits(NamedTuple):
    """How far a method is stable; inf: it has no limit."""

    method: str
    real_limit: float
    imaginary_limit: float
    predicted_step: float  #: s
    measured_step: float  #: s


def stability_pages(limits: Sequence[Limits], eigenvalues: NDArray[np.complex128]) -> dict[str, Figure]:
    """Where steps do not amplify, by name: a page a family, about sixteen methods; eigenvalues in 1/s."""
    pages = {}
    for name, (family, title) in REGIONS.items():
        mine = [row for row in limits if isinstance(METHODS[row.method], family)]
        if mine:
            with style():
                pages[f"stability_{name}"] = figure = new_figure(12.0, 3.6 * -(-len(mine) // ACROSS) + 0.9)
                panels = figure.subplots(-(-len(mine) // ACROSS), ACROSS, squeeze=False)
                for axes in panels.flat[len(mine) :]:
                    axes.remove()
                for axes, row in zip(panels.flat, mine, strict=False):
                    _panel(axes, row, eigenvalues)
                title += "\nλ: eigenvalues at the minimum of Table 1 under the constant force"
                figure.suptitle(title)
                marks = {f"h λ of the scene at h = {WITHOUT_LIMIT:g} s: no step is too long": PREDICTED}
                if np.isfinite(mine[0].predicted_step):
                    marks = {
                        "h λ of the scene, h predicted": PREDICTED,
                        "h λ of the scene, h measured": MEASURED,
                        "limit on the real axis": ON_REAL,
                        "limit on the imaginary axis": ON_IMAGINARY,
                    }
                handles = [entry(told, **look) for told, look in marks.items()]
                handles.insert(0, swatch("no step amplifies", PALETTE["sky"], PALETTE["blue"]))
                legend_below(figure, handles, len(handles))
    return pages


def _panel(axes: Axes, limits: Limits, eigenvalues: NDArray[np.complex128]) -> None:
    name, real, imaginary, predicted, measured = limits
    method, bounded = METHODS[name], np.isfinite(predicted)
    scaled = (predicted if bounded else WITHOUT_LIMIT) * eigenvalues
    reach = 1.2 * max(real, imaginary, float(np.abs(scaled).max())) if bounded else WIDE
    left, right = -reach, 0.5 * reach if bounded else reach
    x, y = np.linspace(left, right, SIDE), np.linspace(-reach, reach, SIDE)
    field = amplification(method, x[None, :] + 1j * y[:, None])
    axes.contourf(x, y, field, levels=[0.0, 1.0], colors=[PALETTE["sky"]], alpha=0.35)
    axes.contour(x, y, field, levels=[1.0], colors=[PALETTE["blue"]], linewidths=1.1)
    axes.axhline(0.0, color="0.5", lw=0.6)
    axes.axvline(0.0, color="0.5", lw=0.6)
    axes.plot(scaled.real, scaled.imag, **PREDICTED)  # type: ignore[arg-type]
    if bounded:
        again = measured * eigenvalues
        axes.plot(again.real, again.imag, **MEASURED)  # type: ignore[arg-type]
        axes.plot([-real], [0.0], clip_on=False, **ON_REAL)  # type: ignore[arg-type]
        axes.plot([0.0, 0.0], [-imaginary, imaginary], **ON_IMAGINARY)  # type: ignore[arg-type]
    told = [
        f"{sign}{value:{form}}" if np.isfinite(value) else "no limit"
        for sign, value, form in (
            ("", predicted, ".5f"), ("", measured, ".5f"), ("−", real, ".3g"), ("±", imaginary, ".3g")
        )
    ]  # fmt: skip
    text = "h predicted {} s\nh measured {} s\nreal {}, imaginary {}".format(*told)
    axes.set(aspect="equal", xlim=(left, right), ylim=(-reach, reach))
    axes.locator_params(axis="x", nbins=4)
    axes.locator_params(axis="y", nbins=5)
    axes.set_title(f"{name}, order {method.order}", loc="left", fontsize=10, pad=44, weight="bold")
    text = text.replace("limit s", "limit")
    axes.text(0.0, 1.02, text, transform=axes.transAxes, fontsize=8.5, va="bottom", linespacing=1.25)
    axes.set_xlabel("Re z", labelpad=1)
    axes.set_ylabel("Im z", labelpad=1)
