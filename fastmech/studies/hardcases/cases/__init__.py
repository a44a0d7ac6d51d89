"""The cases, a few to a file.

To add one, append a :class:`fastmech.studies.hardcases.walk.HardCase` to the ``CASES`` of a module here; a
new module is named in :mod:`fastmech.studies.hardcases.report`.
"""
