"""Capture certificate: proof, long before rest, of the well and the turn in which a motion will end."""
