"""Mechanisms as data: what any holonomic mechanism is made of, and what follows from it."""
