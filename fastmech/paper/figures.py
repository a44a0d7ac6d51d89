"""All pictures of the report, in the paper's order, with their captions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fastmech.paper.compare import Row
from fastmech.paper.compute import DISTURBED_SPAN, MOTION_SPAN, Computed
from fastmech.paper.datasets import DISTURBED, TABLES
from fastmech.paper.draw_disturbed import draw_disturbed, draw_norms
from fastmech.paper.draw_equilibria import draw_positions, draw_potential
from fastmech.paper.draw_motion import draw_angles, draw_constraints, draw_coordinates, draw_momenta
from fastmech.paper.draw_tables import draw_table
from fastmech.results import Dataset

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Picture:
    """A picture to be drawn: its file name without ending, heading, caption."""

    name: str
    heading: str
    caption: str
    draw: Callable[[], Figure]


_TABLE_TITLES = {
    "Table 1": "Numerical values",
    "Table 2": "Static equilibria [rad]",
    "Table 3": "Hessian of U = Π − F x₂ at the equilibria",
    "Table 4": "Characteristic polynomials, with the sign of the print",
}
_DISTURBED_TITLES = {
    "figure_7": "Cases 1 and 3: disturbed motion and roots of the polynomial",
    "figure_8": "Cases 1 and 3: nonlinear and linearized equations",
    "figure_9": "Case 2: nonlinear and linearized equations, roots of the polynomial",
    "figure_10": "Case 4: disturbed motion and roots of the polynomial",
    "figure_11": "Case 4: nonlinear and linearized equations",
}
_ONLY_NONLINEAR = ("figure_7", "figure_10")


def table_pictures(rows: Sequence[Row]) -> list[Picture]:
    """Tables 1 to 4."""

    def picture(name: str) -> Picture:
        title = f"{name}  {_TABLE_TITLES[name]}"
        own = [row for row in rows if row.section == name]
        return Picture(
            name.lower().replace(" ", "_"), name, _TABLE_TITLES[name], lambda: draw_table(title, own)
        )

    return [picture(name) for name in TABLES]


def figure_pictures(computed: Computed, data: Mapping[str, Dataset]) -> list[Picture]:
    """Figures 2 to 11 and the norm of the disturbances."""
    start = f"From Table 1's start with the decaying force, {MOTION_SPAN:g} s."
    kick = "After the disturbance ξ1 = 0.1 rad, η1 = 0.1 rad/s."

    def disturbed(name: str) -> Picture:
        number, title = name.removeprefix("figure_"), _DISTURBED_TITLES[name]
        cases = [computed.cases[case - 1] for case in DISTURBED[name]]
        linearized = name not in _ONLY_NONLINEAR
        caption = f"{title}. {kick}"
        if linearized and any(case.verdict == "unstable" for case in cases):
            caption += " The linearized motion leaves the picture; the time shown is twice as long."
        return Picture(
            name,
            f"Figure {number}",
            caption,
            lambda: draw_disturbed(cases, f"Fig. {number}  {title}", linearized=linearized),
        )

    return [
        Picture(
            "figure_2", "Figure 2", f"Generalized coordinates. {start}", lambda: draw_angles(data["figure_2"])
        ),
        Picture(
            "figure_3",
            "Figure 3",
            f"Coordinates of the points. {start}",
            lambda: draw_coordinates(data["figure_3"]),
        ),
        Picture(
            "figure_4",
            "Figure 4",
            f"Left sides of the constraints (2) to (5), of (2) as corrected. {start}",
            lambda: draw_constraints(data["figure_4"]),
        ),
        Picture(
            "figure_5",
            "Figure 5",
            f"Generalized momenta, from the canonical equations. {start}",
            lambda: draw_momenta(data["figure_5"]),
        ),
        Picture(
            "figure_6a",
            "Figure 6 (a)",
            "Potential under the constant force, both curves of (20), and the equilibria at their crossings.",
            lambda: draw_potential(data["figure_6"]),
        ),
        Picture(
            "figure_6b",
            "Figure 6 (b)",
            "The mechanism at its equilibria, to scale.",
            lambda: draw_positions(computed.cases),
        ),
        *(disturbed(name) for name in DISTURBED),
        Picture(
            "figure_norm",
            "Norm of the disturbances",
            "Size of the disturbance in the kinetic-energy norm (radians of θ): "
            f"it falls to zero in the stable case alone. {kick} {DISTURBED_SPAN:g} s.",
            lambda: draw_norms(computed.cases),
        ),
    ]
