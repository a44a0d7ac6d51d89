"""The capture certificate of whatever has one, and ``fm.trapped``."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from numpy.typing import ArrayLike

from fastmech.capture.certificate import Captured, Certificate
from fastmech.capture.mechanism import MechanismCertificate, mechanism_certificate
from fastmech.capture.scene import scene_certificate
from fastmech.ensembles import checks
from fastmech.errors import InputError
from fastmech.models.mechanism import Mechanism
from fastmech.scene import Scene, require_scene


def certificate_of(system: Scene | Mechanism) -> Certificate:
    """The capture certificate of a scene or a mechanism, kept for the next starts.

    Raises:
        InputError: its wells are not certain, or a mechanism's energy is not known to fall.
    """
    if isinstance(system, Mechanism):
        values = tuple(system.parameters.items()), tuple(c[1:] for c in system.coordinates)
        return _of_mechanism(system.prints, system.name, values, _Kept(system))
    return scene_certificate(system)


class _Kept:
    """A mechanism beside what tells it apart."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Kept)

    def __hash__(self) -> int:
        return 0


@lru_cache(maxsize=16)
def _of_mechanism(prints: str, name: str, values: Any, kept: _Kept) -> MechanismCertificate:
    return mechanism_certificate(kept.mechanism)


def require_damper(system: Any) -> None:
    """Refuse what does not come to rest.

    Raises:
        InputError: nothing damps, or it is neither scene nor mechanism.
    """
    if isinstance(system, Mechanism):
        if system.damped:
            return
        raise InputError(
            f"{system.name}: has no dampers: without, nothing comes to rest and there is no attractor; "
            "fastmech.trapped tells which states can never leave their well"
        )
    require_scene(system)
    if system.beta == 0.0:
        raise InputError(
            "scene.beta = 0: must be greater than 0 N s/m: without damper nothing comes to rest and there "
            "is no attractor; fastmech.trapped tells which states can never leave their well"
        )


def trapped(scene: Scene | Mechanism, states: ArrayLike) -> Captured:
    """Which states at t = 0 can never leave their well, whatever the damper does: the certificate at once.

    Without damper nothing comes to rest, and this is all that can be said about wells.

    Args:
        scene: the mechanism. Where its loads fade, the wells are those of what is left.
        states: phi, theta [rad], phi', theta' [rad/s], shape (n, 4) or (4,); of a ``Mechanism`` coordinates,
            then rates.

    Raises:
        InputError: not states, or the wells are not certain.
    """
    if not isinstance(scene, Mechanism):
        require_scene(scene)
    certificate = certificate_of(scene)
    return certificate.captured(checks.states("states", states, 2 * len(certificate.names)))
