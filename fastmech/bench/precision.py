"""Speed at equal error: from the settings measured to the errors asked for."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fastmech.bench.measure import Row

#: Largest errors [rad, rad/s] at which integrators are compared.
TARGETS = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)


def frontier(rows: Iterable[Row], count: int | None = None) -> list[Row]:
    """Settings that no other beats in both speed and error, the most accurate first."""
    best: list[Row] = []
    # Errors that differ by rounding alone are equal.
    for row in sorted(rows, key=lambda row: (float(f"{row.max_error(count):.2e}"), -row.rate)):
        if np.isfinite(row.max_error(count)) and (not best or row.rate > best[-1].rate):
            best.append(row)
    return best


def rate_at(rows: Iterable[Row], error: float, count: int | None = None) -> float | None:
    """Trajectories per second at a largest error, between neighbours on the frontier in logarithms.

    An integrator whose every setting is more accurate than that gives its fastest one; ``None`` where none
    is as accurate.
    """
    best = frontier(rows, count)
    errors = [row.max_error(count) for row in best]
    if not best or error < errors[0]:
        return None
    logs = np.log(np.maximum(errors, 1e-300))
    return float(np.exp(np.interp(np.log(error), logs, np.log([row.rate for row in best]))))


def fastest_at(rows: Iterable[Row], error: float, count: int | None = None) -> tuple[str, float] | None:
    """The family that is fastest at an error, and its rate."""
    families: dict[str, list[Row]] = {}
    for row in rows:
        families.setdefault(row.family, []).append(row)
    found = {name: rate_at(own, error, count) for name, own in families.items()}
    known = {name: rate for name, rate in found.items() if rate is not None}
    return max(known.items(), key=lambda item: item[1]) if known else None
