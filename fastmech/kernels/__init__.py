"""Block right-hand sides: the physics over lanes, one compiled kernel for every combination of terms."""
