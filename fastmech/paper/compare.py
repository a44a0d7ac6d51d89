"""Rows of the report: one printed number or word beside the computed one, and what to think of it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from enum import StrEnum

from fastmech.paper.printed import agrees, agrees_legibly, evaluate


class Verdict(StrEnum):
    """What a comparison of a printed number came to."""

    AGREES = "agrees to the printed digit"
    SAME = "says the same"
    LEGIBLE = "agrees to the legible digits"
    ROUNDING = "rounding of the print"
    MISPRINT = "misprint"
    DIFFERS = "differs"

    @property
    def good(self) -> bool:
        """Whether print and computation say the same."""
        return self not in (Verdict.MISPRINT, Verdict.DIFFERS)


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
        *explanations: str,
    ) -> Row:
        """A row with its verdict; ``explanations``: keys of misprints that would explain a difference."""
        verdict, see = compare(printed, computed), ""
        if verdict == Verdict.DIFFERS:
            see = next((key for key in explanations if key in self.misprints), "")
            verdict = Verdict.MISPRINT if see else verdict
        return Row(section, place, symbol, unit, printed, computed, verdict, see)


def compare(printed: str, computed: float | str) -> Verdict:
    """Verdict of a print by itself."""
    if isinstance(computed, str):
        return Verdict.SAME if printed == computed else Verdict.DIFFERS
    if "*" in printed:
        return Verdict.LEGIBLE if agrees_legibly(printed, computed) else Verdict.DIFFERS
    same = number(printed) == computed if "pi" in printed else agrees(printed, computed)
    return Verdict.AGREES if same else Verdict.DIFFERS
