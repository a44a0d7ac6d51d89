"""Growth of small disturbances of an equilibrium before the eigenvalues rule, measured in energy.

The norm of (xi, eta) is xi |K| xi + eta M eta with the small motion's matrices: twice the energy at a
minimum; elsewhere the directions in which U falls count as if it rose, so that the norm stays one.
Reactivity and amplification: Neubert, Caswell, Ecology 78 (1997); Trefethen, Embree, *Spectra and
Pseudospectra*, chapter 14.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg

from fastmech.ensembles import checks
from fastmech.errors import InputError
from fastmech.scene import Scene
from fastmech.stability.linearize import Rest, jacobian, linearized

#: Times looked at between 0 and the end.
TIMES = 400


class TransientGrowth(NamedTuple):
    """What disturbances of an equilibrium do first."""

    reactivity: float  #: largest initial growth rate of the norm [1/s]; 0 at a minimum: power only leaves
    amplification: float  #: largest growth of the norm up to ``until``; 1 at a minimum
    time: float  #: when that is reached [s]
    until: float  #: [s]


def transient_growth(scene: Scene, equilibrium: Rest, until: float = 10.0) -> TransientGrowth:
    """Reactivity and largest amplification of small disturbances in the energy norm.

    The force is the equilibrium's, frozen. At a saddle or maximum disturbances grow for ever, so that the
    amplification is that at ``until`` [s].

    Raises:
        InputError: an argument is wrong.
    """
    until = checks.number("until", until, "s", above=0.0)
    _, s = linearized(scene, equilibrium)
    M = np.array([[s.m11, s.s12], [s.s12, 1.0]])
    K = np.array([[s.k11, s.k12], [s.k12, s.k22]])
    # |K| in the normal coordinates of M, where both are symmetric.
    squares, modes = scipy.linalg.eigh(K, M)
    back = modes.T @ M
    norm = scipy.linalg.block_diag(back.T @ np.diag(np.abs(squares)) @ back, M)
    root = np.linalg.cholesky(norm).T
    A = root @ jacobian(scene, equilibrium) @ np.linalg.inv(root)
    reactivity = float(np.linalg.eigvalsh((A + A.T) / 2.0)[-1])
    times = np.linspace(0.0, until, TIMES + 1)
    sizes, flow = [1.0], np.eye(4)
    with np.errstate(over="ignore", invalid="ignore"):
        step = scipy.linalg.expm(A * times[1])
    for _ in times[1:]:
        with np.errstate(over="ignore", invalid="ignore"):
            flow = step @ flow
        if not np.isfinite(flow).all():
            raise InputError(f"until = {until:g} s: by then disturbances are beyond doubles")
        sizes.append(float(np.linalg.norm(flow, 2)))
    best = int(np.argmax(sizes))
    return TransientGrowth(reactivity, sizes[best], float(times[best]), until)
