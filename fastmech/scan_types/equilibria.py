"""All equilibria with the proof that they are all, their stability by three criteria, and what is drawn."""

from __future__ import annotations

from enum import IntEnum
from itertools import product
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np
import scipy.linalg

from fastmech.models.equilibria import find_equilibria
from fastmech.models.mechanism import Mechanism
from fastmech.models.stability import classify
from fastmech.objects import coordinate_units
from fastmech.plots.equilibria import draw_equilibria
from fastmech.results import Dataset, columns, flags, numbers, told
from fastmech.scan_types.map_layout import HESSIAN, drawing_group, eigenvalue_rows
from fastmech.scan_types.request import Each, Scan, Tiling
from fastmech.scene import Scene
from fastmech.slider.stability import Verdict

#: Kind of an equilibrium by the Hessian, without a potential by the stiffness' determinant.
Kind = IntEnum("Kind", "MINIMUM SADDLE MAXIMUM DEGENERATE POSITIVE NEGATIVE", start=0)


class EquilibriaScan(Scan):
    """Equilibria with loads at rest: of the paper's force F0 where alpha = 0, else none."""

    kind: ClassVar[str] = "equilibria"
    draw = staticmethod(draw_equilibria)
    of_mechanisms = True
    taken = frozenset(
        {"equilibrium", "energy", "kind", "morse_index", "decay_time", "verdict", "explanation"}
    )

    def tiling(self, scene: Scene | Mechanism) -> Tiling:
        """One tile; what is drawn of a mechanism is added to it."""

        def join(tiles: list[Dataset]) -> Dataset:
            (found,) = tiles
            if isinstance(scene, Scene):
                return found
            q = np.stack([found[name].data for name in coordinate_units(scene)], axis=-1)
            return Dataset(found.variables, found.attrs, drawing_group(scene, q))

        return Each("equilibria", 1, lambda _: equilibria_dataset(find_equilibria(scene)), join)


def equilibria_dataset(equilibria: Any) -> Dataset:
    """The section of a list of equilibria, classified."""
    scene = equilibria.system
    found: list[Any] = [classify(scene, equilibrium) for equilibrium in equilibria]
    coordinates, of_paper = coordinate_units(scene), isinstance(scene, Scene)
    n = len(coordinates)

    def numbered(values: list[Any], units: list[str], about: str) -> tuple[Any, ...]:
        entries = {str(k): unit for k, unit in enumerate(units, start=1)}
        return np.array(values, dtype=np.float64).reshape(len(found), len(entries)), entries, about

    def verdicts(criterion: str, about: str) -> tuple[Any, ...]:
        words = [attrgetter(criterion)(one).upper().replace(" ", "_") for one in found]
        codes = np.array([Verdict[word] for word in words], dtype=np.int8)
        return codes, "1", f"verdict: {about}", flags(list(Verdict)[1:])

    kinds = np.array([Kind[name.upper()] for name in equilibria.kind], dtype=np.int8)
    index = np.array([-1 if e.morse_index is None else e.morse_index for e in equilibria], dtype=np.int8)
    energy = "potential energy Pi - F x2" if of_paper else "potential energy, loads at their means"
    swings = [_swings(scene, e, f) for e, f in zip(equilibria, found, strict=True)]
    decays = [f.decay_time for f in found]
    why = np.array([f.explanation for f in found], dtype=object)
    ranks, about = range(1, 2 * n + 1), "undamped natural frequency {}, NaN for a direction that grows"
    polynomial = f"monic characteristic polynomial of degree {2 * n}: coefficient of power {2 * n} - {{}}"
    determinants = [f.hurwitz_determinants for f in found], [f"s-{k * (k + 1) // 2}" for k in ranks]
    rows = {
        "": (equilibria.position, coordinates, "{1} {0}"),
        "energy": (equilibria.energy, "J", energy),
        "kind": (kinds, "1", "kind of equilibrium", flags(list(Kind)[: 4 if of_paper else None])),
        "morse_index": (index, "1", "negative eigenvalues of the Hessian, -1: no potential"),
        **_stiffness(scene, equilibria, found),
        "polynomial": numbered([f.polynomial[1:] for f in found], [f"s-{k}" for k in ranks], polynomial),
        "hurwitz": numbered(*determinants, "Hurwitz determinant {}"),
        **eigenvalue_rows(np.array([f.eigenvalues for f in found]).reshape(-1, 2 * n)),
        "natural_frequency": numbered(swings, ["rad/s"] * n, about),
        "decay_time": (decays, "s", "slowest linear mode falls to 1/e; NaN: unstable"),
        **({"verdict_sylvester": verdicts("sylvester.verdict", "Lagrange-Dirichlet")} if of_paper else {}),
        "verdict_hurwitz": verdicts("hurwitz.verdict", "Hurwitz"),
        "verdict_eigenvalues": verdicts("spectrum.verdict", "eigenvalues"),
        "verdict": verdicts("verdict", "joint"),
        "explanation": (why, "1", "why, and what disagrees"),
    }
    variables = numbers("equilibrium", len(found), "number of the equilibrium")
    variables |= columns(("equilibrium",), rows)
    attrs = {
        **({"force": equilibria.force} if of_paper else told(scene)),
        "certificate": equilibria.certificate.sentence,
        "outcome": equilibria.certificate.outcome.name.lower(),
    }
    return Dataset(variables, attrs)


def _stiffness(scene: Scene | Mechanism, equilibria: Any, found: list[Any]) -> dict[str, tuple[Any, ...]]:
    """Of the paper's mechanism the Hessian with its minors, of any other minus the forces' derivatives."""
    if isinstance(scene, Scene):
        entries = equilibria.hessian.reshape(-1, 4)[:, [0, 1, 3]]
        minors = np.array([f.minors for f in found]).reshape(-1, 2)
        return {
            "hessian": (entries, HESSIAN, "Hessian of Pi - F x2, paper (19): {}"),
            "minor": (minors, {"1": "J", "2": "J2"}, "Sylvester's leading minor {} of the Hessian"),
        }
    names = coordinate_units(scene)
    force = {0: "J", 1: "N", 2: "N/m"}
    units = {f"{a}_{b}": force[(names[a] == "m") + (names[b] == "m")] for a, b in product(names, names)}
    stiffness = np.array([e.stiffness for e in equilibria]).reshape(-1, len(units))
    return {"stiffness": (stiffness, units, "minus the derivative of a force by a coordinate: {}")}


def _swings(scene: Scene | Mechanism, e: Any, f: Any) -> Any:
    """Undamped natural frequencies [rad/s], rising."""
    if isinstance(scene, Scene):
        return f.natural_frequencies
    mass, _, stiffness = scene.linear(e.position)
    squares = scipy.linalg.eigvals(stiffness, mass)
    swings = (np.abs(squares.imag) <= 1e-12 * np.abs(squares).max()) & (squares.real > 0.0)
    return np.sort(np.where(swings, np.sqrt(squares).real, np.nan))
