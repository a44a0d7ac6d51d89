"""The variables of a basin map: names, dimensions, units and meanings, in one place."""

from __future__ import annotations

import numpy as np

from fastmech.basins.map import BasinMap
from fastmech.basins.status import BasinStatus
from fastmech.results import NO_CODE, STATE_UNITS, Variable, flags, numbers


def basin_variables(found: BasinMap) -> dict[str, Variable]:
    """Everything known of the starts, of the basins and of the scene's equilibria."""
    return _coordinates(found) | _grid_variables(found) | _wells(found)


def _coordinates(found: BasinMap) -> dict[str, Variable]:
    described = {
        "phi": "angle phi",
        "theta": "angle theta",
        "phi_dot": "rate of phi",
        "theta_dot": "rate of theta",
    }
    return {
        name: Variable((name,), values, STATE_UNITS[name], f"{described[name]} at the start")
        for name, values in found.axes.items()
    }


def _grid_variables(found: BasinMap) -> dict[str, Variable]:
    names = tuple(found.axes)
    label, table = found.labels
    share = np.array([np.mean(label == i) for i in range(len(table))])
    unknown = np.mean(label < 0)
    variables = {
        "label": Variable(names, label.astype(np.int32), "1", "basin of the start", NO_CODE),
        "well": Variable(names, found.well, "1", "equilibrium that captures the start", NO_CODE),
        "turns_phi": Variable(names, found.turns[..., 0], "1", "full turns of phi of that well"),
        "turns_theta": Variable(names, found.turns[..., 1], "1", "full turns of theta of that well"),
        "capture_time": Variable(
            names, found.time, "s", "time of capture, NaN: not captured or not computed"
        ),
        "status": Variable(names, found.status, "1", "what is known of the start", flags(BasinStatus)),
        "computed": Variable(names, found.computed, "1", "computed, not filled in between equal labels"),
        **numbers("basin", len(table), "number of the basin"),
        "basin_well": Variable(("basin",), table[:, 0].astype(np.int8), "1", "equilibrium of the basin"),
        "basin_turns_phi": Variable(("basin",), table[:, 1].astype(np.int32), "1", "its full turns of phi"),
        "basin_turns_theta": Variable(
            ("basin",), table[:, 2].astype(np.int32), "1", "its full turns of theta"
        ),
        "basin_share": Variable(("basin",), share, "1", "share of the starts"),
        "basin_share_at_most": Variable(
            ("basin",), share + unknown, "1", "share of the starts if all without a label ended there"
        ),
    }
    if found.settle_time is not None:
        variables["settle_time"] = Variable(
            names,
            found.settle_time,
            "s",
            "time from which on the motion stays in the settling ball, NaN: none",
        )
    return variables


def _wells(found: BasinMap) -> dict[str, Variable]:
    assert found.tree is not None  # a scene's map has one
    equilibria, each = found.tree.equilibria, ("equilibrium",)
    barrier = np.full(len(equilibria), np.nan)
    barrier[list(found.tree.wells)] = found.tree.barrier
    return {
        **numbers("equilibrium", len(equilibria), "number of the equilibrium"),
        "equilibrium_phi": Variable(each, equilibria.phi, "rad", "angle phi of the equilibrium"),
        "equilibrium_theta": Variable(each, equilibria.theta, "rad", "angle theta of the equilibrium"),
        "equilibrium_energy": Variable(each, equilibria.energy, "J", "potential energy of the equilibrium"),
        "equilibrium_morse_index": Variable(
            each, equilibria.morse_index, "1", "unstable directions, 0: a well"
        ),
        "barrier": Variable(each, barrier, "J", "energy at which the well first meets another, NaN: no well"),
        "force": Variable((), np.array(equilibria.force), "N", "constant force that the wells hold for"),
    }
