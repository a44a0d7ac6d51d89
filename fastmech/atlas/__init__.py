"""Equilibria over parameters: certified maps, sheets, folds, wells, and the load at which one snaps."""
