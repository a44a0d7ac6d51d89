"""The capture certificate of whatever has one, ``fm.barrier_tree`` and ``fm.trapped``."""

from __future__ import annotations

from typing import Any

from fastmech.capture.certificate import CaptureCertificate, Captured
from fastmech.capture.mechanism import mechanism_certificate, require_falling
from fastmech.capture.wells import ProvedWells, damping_as_force, prove_wells
from fastmech.ensembles import checks
from fastmech.errors import InputError
from fastmech.models.mechanism import Mechanism
from fastmech.samplers import Starts
from fastmech.scene import Scene, require_scene
from fastmech.slider.capture.certificate import BarrierTree, scene_certificate
from fastmech.slider.capture.certificate import barrier_tree as tree_of_scene

#: What is wrong with a scene that nothing damps.
NO_DAMPER = "scene.beta = 0: must be greater than 0 N s/m"

#: Certificates of mechanisms that are kept, the oldest first, by what tells mechanisms apart.
_kept: dict[tuple[Any, ...], CaptureCertificate] = {}
MOST_KEPT = 16


def certificate_of(system: Scene | Mechanism) -> CaptureCertificate:
    """The capture certificate of a scene or a mechanism, kept for the next starts.

    Raises:
        InputError: its wells are not certain, or a mechanism's energy is not known to fall.
    """
    if not isinstance(system, Mechanism):
        return scene_certificate(system)
    ranges = tuple(coordinate[1:] for coordinate in system.coordinates)
    key = system.prints, system.name, tuple(system.parameters.items()), ranges
    if key not in _kept:
        while len(_kept) >= MOST_KEPT:
            del _kept[next(iter(_kept))]
        _kept[key] = mechanism_certificate(system)
    return _kept[key]


def require_damper(system: Any) -> None:
    """Refuse what does not come to rest.

    Raises:
        InputError: nothing damps, a mechanism's energy is not known to fall, or it is neither of both.
    """
    if not isinstance(system, Mechanism):
        require_scene(system)
    if not system.damped:
        own = isinstance(system, Mechanism)
        lacks = f"{system.name}: has no dampers" if own else NO_DAMPER
        raise InputError(
            f"{lacks}: without damper nothing comes to rest and there is no attractor; fastmech.trapped "
            f"tells which states can never leave their well{damping_as_force(system) if own else ''}"
        )
    if isinstance(system, Mechanism):
        require_falling(system)


def barrier_tree(system: Scene | Mechanism) -> BarrierTree | ProvedWells:
    """The wells of a scene or a mechanism, and the energies [J] at which they open.

    Of a scene whose force decays they are those of springs and weights; a mechanism's loads are at their
    means, or at what they come to.

    Raises:
        InputError: the wells are not certain, or a mechanism's forces are not known to have a potential.
    """
    return prove_wells(system) if isinstance(system, Mechanism) else tree_of_scene(system)


def trapped(scene: Scene | Mechanism, states: Starts) -> Captured:
    """Which states at t = 0 can never leave their well, whatever the damper does: the certificate at once.

    Without damper nothing comes to rest, and this is all that can be said about wells.

    Args:
        scene: the mechanism. Where its loads fade, the wells are those of what is left.
        states: a sampler, or coordinates [rad or m], then rates, shape (n, states) or (states,).

    Raises:
        InputError: not states, or the wells are not certain.
    """
    if not isinstance(scene, Mechanism):
        require_scene(scene)
    certificate = certificate_of(scene)
    return certificate.captured(checks.starts("states", states, scene.state))
