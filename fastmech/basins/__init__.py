"""Basins of attraction: where every start ends, and what follows from it."""
