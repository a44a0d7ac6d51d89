"""Stability of an equilibrium: linearization, three criteria and their joint verdict."""
