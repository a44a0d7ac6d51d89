"""Disturbed motion about an equilibrium: single, in ensembles, nonlinear beside linearized, paper (21)."""
