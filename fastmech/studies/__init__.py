"""Studies of the product itself, each behind a command of its own; nothing that a user imports needs them.

``paper`` computes the source paper again (``fastmech paper``), ``hardcases`` goes through what is numerically
hard (``fastmech hardcases``), ``bench`` measures speed against error beside other libraries (``fastmech
bench``).
"""
