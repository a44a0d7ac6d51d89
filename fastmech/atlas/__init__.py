"""Equilibria over parameters: certified maps, sheets, folds, wells, and loads at which a position snaps."""
