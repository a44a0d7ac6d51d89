"""Attractors of any system: found without knowing them, and who ends at which."""
