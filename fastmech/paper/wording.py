"""How rows and numbers are written in the report and in pictures."""

from __future__ import annotations

from fastmech.paper.compare import Row, Verdict

HEADINGS = ("Case, part", "Symbol", "Unit", "Printed", "Computed", "Difference", "Verdict")

_NEGLIGIBLE = 1e-9
_SYMBOLS = {
    "beta": "β",
    "alpha": "α",
    "phi_0": "φ₀",
    "theta_0": "θ₀",
    "phi_dot_0": "φ₀′",
    "theta_dot_0": "θ₀′",
    "F0": "F₀",
}


def cells(row: Row) -> tuple[str, ...]:
    """The row's texts in the order of ``HEADINGS``."""
    verdict = f"{row.verdict}" if row.verdict != Verdict.MISPRINT else "misprint"
    symbol = _SYMBOLS.get(row.symbol, row.symbol)
    return row.place, symbol, row.unit, row.printed, computed_text(row), difference_text(row), verdict


def computed_text(row: Row) -> str:
    """The computed value with three digits more than the print has, or as many as are needed."""
    if isinstance(row.computed, str):
        return row.computed
    if row.difference is None or "pi" in row.printed:
        return f"{row.computed:.7g}"
    decimals = len(row.printed.partition(".")[2])
    extra = 3 if abs(row.difference) > _NEGLIGIBLE else 0
    return f"{row.computed:.{decimals + extra}f}"


def difference_text(row: Row) -> str:
    """Computed less printed, three digits; a dash where there is no number to subtract."""
    if row.difference is None:
        return "–"
    return "0" if abs(row.difference) <= _NEGLIGIBLE else f"{row.difference:+.3g}"
