"""Interval arithmetic rounded outward, and what it proves about the zeros of forces."""
