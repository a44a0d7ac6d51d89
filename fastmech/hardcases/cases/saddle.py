"""A start on a saddle's stable manifold to 1e-12: the smallest difference decides where it ends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.integrate import integrate
from fastmech.equilibria.find import find_equilibria
from fastmech.hardcases.case import HardCase, Row, row_of
from fastmech.scene import Scene
from fastmech.stability.linearize import jacobian

SCENE = Scene(c1=294.9, c2=92.85, F0=85.3, alpha=0.0)
DT, CLOSEST = 0.02, 1e-12

#: How far behind the saddle sides are told [rad], and how long that may take [s].
NEAR, LONGEST = 0.3, 40.0


def _run(quick: bool) -> Sequence[Row]:
    saddle = next(e for e in find_equilibria(SCENE) if e.morse_index == 1)
    values, vectors = np.linalg.eig(jacobian(SCENE, saddle))
    fast = int(np.argmax(values.real))
    growth, out = float(values[fast].real), vectors[:, fast].real
    slow = min((k for k in range(4) if values[k].real < 0.0), key=lambda k: abs(values[k].imag))
    along = vectors[:, slow].real
    centre = np.array([saddle.phi, saddle.theta, 0.0, 0.0])
    left = np.linalg.inv(np.column_stack([vectors.real, vectors.imag])[:, _basis(values)])[0]
    times = np.arange(DT, LONGEST, 10 * DT)
    rows = []
    for method in ("dop853",) if quick else ("rk4", "dop853", "abm8", "gauss6", "radau5"):

        def leave(
            offset: NDArray[np.float64], method: str = method
        ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            starts = (
                centre + 0.1 * along / np.abs(along).max() + offset[:, None] * out / np.abs(out[:2]).max()
            )
            run = integrate(SCENE, starts, t_eval=times, dt=DT, method=method)
            aside = (run.y - centre) @ left
            far = np.abs(aside) > NEAR * np.abs(left @ out) / np.abs(out[:2]).max()
            first = np.argmax(far, axis=0)
            when = np.where(far.any(axis=0), times[first], np.inf)
            return np.sign(aside[first, np.arange(offset.size)]), when

        low, high = -0.1, 0.1
        while high - low > CLOSEST:
            middle = np.linspace(low, high, 18)
            side, _ = leave(middle)
            change = int(np.argmax(side != side[0]))
            low, high = middle[change - 1], middle[change]
        root = 0.5 * (low + high)
        distances = np.array([1e-3, 1e-10])
        _, when = leave(root + distances)
        # Each factor of ten nearer stays longer by ln(10)/growth.
        measured = float(np.log(distances[0] / distances[1]) / (when[1] - when[0]))
        run = integrate(SCENE, centre, DT, DT, method)
        rows.append(row_of(run, abs(measured / growth - 1.0), 0.05, remark=f"growth {measured:.4f} 1/s"))
    return rows


def _basis(values: NDArray[np.complex128]) -> list[int]:
    """Columns of [real, imaginary] that form a basis, the fastest growing direction first."""
    order = np.argsort(-values.real)
    return [int(k) if values[k].imag >= 0.0 else 4 + int(k) for k in order]


CASES = (
    HardCase(
        "saddle_manifold",
        "starts on a saddle's stable manifold to 1e-12, found by bisection: the last digits decide",
        "the saddle's growing eigenvalue; error: relative difference of the growth seen in times of leaving",
        "the manifold is found, and starts ten times nearer stay longer by ln(10) over the eigenvalue",
        _run,
    ),
)
