"""All equilibria of the scene with the proof that they are all, and their stability by three criteria."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastmech.equilibria.find import KINDS, find_equilibria
from fastmech.results import Dataset, Variable, flags, numbers, parts
from fastmech.scan_types.map_layout import HESSIAN, eigenvalue_variables
from fastmech.scan_types.request import RunContext, Scan
from fastmech.scene import Scene
from fastmech.stability.classify import classify

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Kind(IntEnum):
    """Kind of an equilibrium by the Hessian of the potential."""

    MINIMUM = 0
    SADDLE = 1
    MAXIMUM = 2
    DEGENERATE = 3


class StabilityVerdict(IntEnum):
    """Verdict of a criterion of stability."""

    ASYMPTOTICALLY_STABLE = 0
    STABLE = 1
    UNSTABLE = 2
    CRITICAL = 3


class EquilibriaScan(Scan):
    """Equilibria with the force at rest: F0 where alpha = 0, else none."""

    kind: ClassVar[str] = "equilibria"

    def run(self, scene: Scene, context: RunContext) -> Dataset:
        """Find and classify."""
        equilibria = find_equilibria(scene)
        found = [classify(scene, equilibrium) for equilibrium in equilibria]
        each = ("equilibrium",)

        def column(values: list[object], *shape: int) -> NDArray[np.float64]:
            return np.array(values, dtype=np.float64).reshape(len(found), *shape)

        def columns(
            name: str, values: list[object], units: tuple[str, ...], about: str
        ) -> dict[str, Variable]:
            entries = {str(k): unit for k, unit in enumerate(units, start=1)}
            return parts(name, each, column(values, len(units)), entries, about)

        def verdicts(values: list[str], criterion: str) -> Variable:
            codes = [StabilityVerdict[value.upper().replace(" ", "_")] for value in values]
            return Variable(
                each, np.array(codes, dtype=np.int8), "1", f"verdict: {criterion}", flags(StabilityVerdict)
            )

        eigenvalues = np.array([f.eigenvalues for f in found]).reshape(-1, 4)
        kinds = np.array([Kind[KINDS[int(index)].upper()] for index in equilibria.morse_index], dtype=np.int8)
        variables = {
            **numbers("equilibrium", len(found), "number of the equilibrium"),
            "phi": Variable(each, equilibria.phi, "rad", "angle phi"),
            "theta": Variable(each, equilibria.theta, "rad", "angle theta"),
            "energy": Variable(each, equilibria.energy, "J", "potential energy Pi - F x2"),
            "kind": Variable(each, kinds, "1", "kind of equilibrium", flags(Kind)),
            "morse_index": Variable(each, equilibria.morse_index, "1", "negative eigenvalues of the Hessian"),
            **parts(
                "hessian",
                each,
                equilibria.hessian.reshape(-1, 4)[:, [0, 1, 3]],
                HESSIAN,
                "Hessian of Pi - F x2, paper (19): {}",
            ),
            **columns(
                "minor", [f.minors for f in found], ("J", "J2"), "Sylvester's leading minor {} of the Hessian"
            ),
            **columns(
                "polynomial",
                [f.polynomial[1:] for f in found],
                ("s-1", "s-2", "s-3", "s-4"),
                "monic characteristic polynomial of degree 4: coefficient of power 4 - {}",
            ),
            **columns(
                "hurwitz",
                [f.hurwitz_determinants for f in found],
                ("s-1", "s-3", "s-6", "s-10"),
                "Hurwitz determinant {}",
            ),
            **eigenvalue_variables(each, eigenvalues),
            **columns(
                "natural_frequency",
                [f.natural_frequencies for f in found],
                ("rad/s", "rad/s"),
                "undamped natural frequency {}, NaN for a direction that grows",
            ),
            "decay_time": Variable(
                each,
                column([f.decay_time for f in found]),
                "s",
                "slowest linear mode falls to 1/e; NaN: unstable",
            ),
            "verdict_sylvester": verdicts([f.sylvester.verdict for f in found], "Lagrange-Dirichlet"),
            "verdict_hurwitz": verdicts([f.hurwitz.verdict for f in found], "Hurwitz"),
            "verdict_eigenvalues": verdicts([f.spectrum.verdict for f in found], "eigenvalues"),
            "verdict": verdicts([f.verdict for f in found], "joint"),
            "explanation": Variable(
                each, np.array([f.explanation for f in found], dtype=object), "1", "why, and what disagrees"
            ),
        }
        attrs = {
            "force": equilibria.force,
            "certificate": equilibria.certificate.sentence,
            "outcome": equilibria.certificate.outcome.name.lower(),
        }
        return Dataset(variables, attrs)

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Potential with the equilibria, and the eigenvalues in the complex plane."""
        from fastmech.plots.equilibria import draw_equilibria

        return draw_equilibria(dataset, scene)
