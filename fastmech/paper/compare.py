"""Rows of the report: one printed number or word beside the computed one, and what to think of it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from enum import StrEnum

from fastmech.paper.printed import agrees, agrees_legibly


class Verdict(StrEnum):
    """What a comparison of a printed number came to."""

    AGREES = "agrees to the printed digit"
    LEGIBLE = "agrees to the legible digits"
    ROUNDING = "rounding of the print"
    MISPRINT = "misprint"
    DIFFERS = "differs"

    @property
    def good(self) -> bool:
        """Whether print and computation say the same."""
        return self in (Verdict.AGREES, Verdict.LEGIBLE, Verdict.ROUNDING)


@dataclass(frozen=True)
class Row:
    """One printed number or word of the paper."""

    section: str  #: "Table 2", "Equation (16)", ...
    place: str  #: case, or part of the equation
    symbol: str
    unit: str
    printed: str  #: exactly as printed, lost characters as ``*``
    computed: float | str
    verdict: Verdict
    see: str = ""  #: key of the misprint that explains it

    @property
    def difference(self) -> float | None:
        """Computed less printed; none for words and for prints that lost characters."""
        if isinstance(self.computed, str) or "*" in self.printed:
            return None
        return self.computed - number(self.printed)

    @property
    def is_number(self) -> bool:
        """Whether it is a number, not a word."""
        return not isinstance(self.computed, str)


def number(printed: str) -> float:
    """Value of a print: a decimal number, or a fraction of pi such as ``4 pi / 13``."""
    if "pi" not in printed:
        return float(printed)
    from fastmech.paper.printed import evaluate

    return float(evaluate(printed.replace(" pi", "*pi")))


@dataclass(frozen=True)
class Judge:
    """Compares prints with computed values; knows which misprints are proved."""

    misprints: Collection[str]  #: keys of the misprints that the evidence confirms

    def row(
        self,
        section: str,
        place: str,
        symbol: str,
        unit: str,
        printed: str,
        computed: float | str,
        explanation: str = "",
    ) -> Row:
        """A row with its verdict. ``explanation`` is the key of the misprint that would explain a difference."""
        verdict = self._verdict(printed, computed, explanation)
        see = explanation if verdict == Verdict.MISPRINT else ""
        return Row(section, place, symbol, unit, printed, computed, verdict, see)

    def _verdict(self, printed: str, computed: float | str, explanation: str) -> Verdict:
        if isinstance(computed, str):
            same = printed == computed
        elif "*" in printed:
            same = agrees_legibly(printed, computed)
        elif "pi" in printed:
            same = number(printed) == computed
        else:
            same = agrees(printed, computed)
        if same:
            return Verdict.LEGIBLE if "*" in printed else Verdict.AGREES
        return Verdict.MISPRINT if explanation in self.misprints else Verdict.DIFFERS
