"""Tables and figures as labelled data: the groups of ``paper.h5``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fastmech.arrays import Floats
from fastmech.mechanism.geometry import constraints, positions
from fastmech.mechanism.lagrange import potential_energy, potential_gradient
from fastmech.paper.compare import Row, Verdict
from fastmech.paper.compute import PAPER_SCENE, STATIC_SCENE, Case, Computed
from fastmech.reports import columns
from fastmech.results import Dataset, Variable

TABLES = ("Table 1", "Table 2", "Table 3", "Table 4")
#: Cases that each figure of disturbed motion shows.
DISTURBED = {"figure_7": (1, 3), "figure_8": (1, 3), "figure_9": (2,), "figure_10": (4,), "figure_11": (4,)}
GRID = 181

_DISTURBANCES = {
    "xi_1": ("rad", "disturbance of phi"),
    "xi_2": ("rad", "disturbance of theta"),
    "eta_1": ("rad/s", "disturbance of phi'"),
    "eta_2": ("rad/s", "disturbance of theta'"),
}


def all_datasets(computed: Computed, rows: Sequence[Row]) -> dict[str, Dataset]:
    """One dataset for every table and figure, and the rows of all printed numbers."""
    tables = {
        name.lower().replace(" ", "_"): rows_dataset([row for row in rows if row.section == name])
        for name in TABLES
    }
    motion = computed.motion
    points = positions(PAPER_SCENE, motion.y)
    constrained = enumerate(constraints(PAPER_SCENE, points), start=1)
    p_phi, p_theta = computed.momenta.T
    over_time: dict[str, dict[str, tuple[str, Floats]]] = {
        "figure_2": {"phi": ("rad", motion.y[:, 0]), "theta": ("rad", motion.y[:, 1])},
        "figure_3": {name: ("m", value) for name, value in points._asdict().items()},
        "figure_4": {f"f_{i}": ("m" if i == 3 else "m2", residual) for i, residual in constrained},
        "figure_5": {"p_phi": ("kg m2/s", p_phi), "p_theta": ("kg m2/s", p_theta)},
        "energy_balance": {
            "kinetic_energy": ("J", motion.kinetic),
            "potential_energy": ("J", motion.potential),
            "work_damper": ("J", motion.work_damper),
            "work_force": ("J", motion.work_force),
            "energy_residual": ("J", motion.residual),
        },
    }
    moving = {name: _over_time(computed, values) for name, values in over_time.items()}
    balance = moving.pop("energy_balance")
    disturbed = {
        name: _disturbed([computed.cases[number - 1] for number in numbers])
        for name, numbers in DISTURBED.items()
    }
    resting = {"figure_6": _equilibria(computed.cases)}
    last = {"energy_balance": balance, "printed_numbers": rows_dataset(rows)}
    return tables | moving | resting | disturbed | last


_LONG_NAMES = {
    "phi": "angle phi",
    "theta": "angle theta",
    "p_phi": "generalized momentum of phi, canonical equations",
    "p_theta": "generalized momentum of theta, canonical equations",
    "kinetic_energy": "kinetic energy T",
    "potential_energy": "potential energy Pi",
    "work_damper": "work of the damper since t = 0",
    "work_force": "work of the force since t = 0",
    "energy_residual": "change of T + Pi less both works",
    **{f"f_{i}": f"residual of constraint ({i + 1})" for i in range(1, 5)},
    **{f"{axis}{i}": f"coordinate {axis} of M{i}" for axis in "xy" for i in (1, 2, 3)},
}


def _over_time(computed: Computed, values: dict[str, tuple[str, Floats]]) -> Dataset:
    moving = {name: Variable(("time",), v, unit, _LONG_NAMES[name]) for name, (unit, v) in values.items()}
    return Dataset({"time": Variable(("time",), computed.motion.t, "s", "time")} | moving)


def _numbers(cases: Sequence[Case]) -> Variable:
    return Variable(("case",), np.array([case.number for case in cases]), "1", "case of Table 2")


def _equilibria(cases: Sequence[Case]) -> Dataset:
    angles = np.linspace(-np.pi, np.pi, GRID)
    grid = np.stack(np.meshgrid(angles, angles, indexing="ij"), axis=-1)
    force = STATIC_SCENE.F0
    gradient = potential_gradient(STATIC_SCENE, grid, force)
    found = [case.equilibrium for case in cases]
    rest = np.array([(e.phi, e.theta, 0.0, 0.0) for e in found])
    plane, along = ("phi", "theta"), ("case",)
    points = positions(STATIC_SCENE, rest)._asdict().items()
    return Dataset(
        {
            "phi": Variable(("phi",), angles, "rad", "angle phi"),
            "theta": Variable(("theta",), angles, "rad", "angle theta"),
            "potential": Variable(plane, potential_energy(STATIC_SCENE, grid, force), "J", "U = Pi - F x2"),
            "condition_phi": Variable(plane, gradient[..., 0], "J", "dU/dphi, first of (20)"),
            "condition_theta": Variable(plane, gradient[..., 1], "J", "dU/dtheta, second of (20)"),
            "case": _numbers(cases),
            "phi_st": Variable(along, rest[:, 0], "rad", "angle phi at rest"),
            "theta_st": Variable(along, rest[:, 1], "rad", "angle theta at rest"),
            **columns("case", found, {"energy": ("J", "U at rest"), "kind": ("1", "kind of equilibrium")}),
            **{name: Variable(along, x, "m", f"{_LONG_NAMES[name]} at rest") for name, x in points},
        }
    )


def _disturbed(cases: Sequence[Case]) -> Dataset:
    along = ("case", "time")
    variables = {"case": _numbers(cases), "time": Variable(("time",), cases[0].disturbed.t, "s", "time")}
    for which in ("nonlinear", "linearized"):
        for i, (name, (unit, long_name)) in enumerate(_DISTURBANCES.items()):
            data = np.stack([getattr(case.disturbed, which)[:, 0, i] for case in cases])
            variables[f"{name}_{which}"] = Variable(along, data, unit, f"{long_name}, {which} equations")
        norm, about = np.stack([getattr(case, f"norm_{which}") for case in cases]), "size of the disturbance"
        variables[f"norm_{which}"] = Variable(along, norm, "rad", f"{about}, {which} equations")
    roots, about = np.stack([case.classification.eigenvalues for case in cases]), "characteristic polynomial"
    for part, data in (("re", roots.real), ("im", roots.imag)):
        variables[f"root_{part}"] = Variable(("case", "root"), data, "1/s", f"root of the {about}, {part}")
    return Dataset(variables)


#: Columns of the printed numbers.
_ROWS = {
    "section": ("1", "where it is printed"),
    "place": ("1", "case or part"),
    "symbol": ("1", "symbol"),
    "unit": ("1", "unit of the values"),
    "printed": ("1", "as printed, * for lost characters"),
    "word": ("1", "the computed word, for words"),
    "verdict": ("1", "what the comparison came to"),
    "see": ("1", "key of the misprint that explains it"),
    "value": ("1", "value in its unit, NaN for words"),
    "difference": ("1", "computed less printed in that unit"),
}
_ROW_NAMES = {"word": "computed_text", "value": "computed"}


def rows_dataset(rows: Sequence[Row]) -> Dataset:
    """Rows of printed against computed values."""
    found = {_ROW_NAMES.get(name, name): column for name, column in columns("row", rows, _ROWS).items()}
    return Dataset(found, {"disagreeing": sum(row.verdict == Verdict.DIFFERS for row in rows)})
