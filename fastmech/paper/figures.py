"""All pictures of the report, in the paper's order, with their captions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from fastmech.paper.compare import Row
from fastmech.paper.compute import DISTURBED_SPAN, MOTION_SPAN, Computed
from fastmech.paper.datasets import DISTURBED, TABLES
from fastmech.paper.draw_disturbed import draw_disturbed, draw_norms
from fastmech.paper.draw_equilibria import draw_positions, draw_potential
from fastmech.paper.draw_motion import PANELS, draw_constraints, draw_over_time
from fastmech.paper.draw_tables import draw_table
from fastmech.results import Dataset

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Picture(NamedTuple):
    """A picture to be drawn: its file name without ending, heading, caption."""

    name: str
    heading: str
    caption: str
    draw: Callable[[], Figure]


#: Titles of the tables, and of the figures of disturbed motion.
TITLES = {
    "Table 1": "Numerical values",
    "Table 2": "Static equilibria [rad]",
    "Table 3": "Hessian of U = Π − F x₂ at the equilibria",
    "Table 4": "Characteristic polynomials, with the sign of the print",
    "figure_7": "Cases 1 and 3: disturbed motion and roots of the polynomial",
    "figure_8": "Cases 1 and 3: nonlinear and linearized equations",
    "figure_9": "Case 2: nonlinear and linearized equations, roots of the polynomial",
    "figure_10": "Case 4: disturbed motion and roots of the polynomial",
    "figure_11": "Case 4: nonlinear and linearized equations",
}
_ONLY_NONLINEAR = ("figure_7", "figure_10")
_KICK = "After the disturbance ξ1 = 0.1 rad, η1 = 0.1 rad/s."


def table_pictures(rows: Sequence[Row]) -> list[Picture]:
    """Tables 1 to 4."""
    pictures = []
    for name in TABLES:
        own = [row for row in rows if row.section == name]
        draw = partial(draw_table, f"{name}  {TITLES[name]}", own)
        pictures.append(Picture(name.lower().replace(" ", "_"), name, TITLES[name], draw))
    return pictures


def figure_pictures(computed: Computed, data: Mapping[str, Dataset]) -> list[Picture]:
    """Figures 2 to 11 and the norm of the disturbances."""
    start = f"From Table 1's start with the decaying force, {MOTION_SPAN:g} s."
    over_time = {
        "figure_2": "Generalized coordinates.",
        "figure_3": "Coordinates of the points.",
        "figure_4": "Left sides of the constraints (2) to (5), of (2) as corrected.",
        "figure_5": "Generalized momenta, from the canonical equations.",
    }
    pictures = []
    for name, caption in over_time.items():
        draw = partial(draw_over_time, name) if name in PANELS else draw_constraints
        pictures.append(Picture(name, f"Figure {name[-1]}", f"{caption} {start}", partial(draw, data[name])))
    crossings = (
        "Potential under the constant force, both curves of (20), and the equilibria at their crossings."
    )
    scale = "The mechanism at its equilibria, to scale."
    pictures += [
        Picture("figure_6a", "Figure 6 (a)", crossings, partial(draw_potential, data["figure_6"])),
        Picture("figure_6b", "Figure 6 (b)", scale, partial(draw_positions, computed.cases)),
    ]
    for name, numbers in DISTURBED.items():
        number, cases = name.removeprefix("figure_"), [computed.cases[case - 1] for case in numbers]
        linearized, caption = name not in _ONLY_NONLINEAR, f"{TITLES[name]}. {_KICK}"
        if linearized and any(case.verdict == "unstable" for case in cases):
            caption += " The linearized motion leaves the picture; the time shown is twice as long."
        title = f"Fig. {number}  {TITLES[name]}"
        draw = partial(draw_disturbed, cases, title, linearized=linearized)
        pictures.append(Picture(name, f"Figure {number}", caption, draw))
    norm = (
        "Size of the disturbance in the kinetic-energy norm (radians of θ): it falls to zero in the stable "
        f"case alone. {_KICK} {DISTURBED_SPAN:g} s."
    )
    draw = partial(draw_norms, computed.cases)
    return [*pictures, Picture("figure_norm", "Norm of the disturbances", norm, draw)]
