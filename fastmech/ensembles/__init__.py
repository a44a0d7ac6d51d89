"""Thousands of trajectories at once: blocks of lanes on threads, statuses, disturbed motion."""
