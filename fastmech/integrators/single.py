"""The drivers for lanes of float32: the same source, compiled when a run first asks for them."""

from __future__ import annotations

from numba import types

from fastmech.integrators import driver, explicit, multistep
from fastmech.jit import driver_signature, single

integrate_blocks = single(explicit.integrate_blocks, driver_signature(types.float32, *driver.TABLEAU))
integrate_multistep_blocks = single(
    multistep.integrate_multistep_blocks, driver_signature(types.float32, *multistep.adams(types.float32))
)
