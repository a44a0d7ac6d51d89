"""Equilibria of scenes over parameters: certified maps, sheets, all folds, wells, vanishing damping."""
