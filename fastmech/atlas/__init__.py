"""Equilibria over parameters: maps, critical values and curves, and the load at which a position ends."""
