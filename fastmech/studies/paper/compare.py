"""The paper's print, read from ``printed.toml``, and its comparison with what is computed.

Every number has exactly its printed digits; ``*`` stands for lost characters.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from enum import StrEnum
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

import numpy as np

from fastmech.studies.reporting import content

Printed = Mapping[str, Any]

CASES = ("case_1", "case_2", "case_3", "case_4")

#: Finest rounding tried when characters of a printed number are lost.
MOST_DECIMALS = 6

_FUNCTIONS = {"pi": np.pi, "sin": np.sin, "cos": np.cos, "sqrt": np.sqrt}


def evaluate(expression: str, **names: Any) -> Any:
    """Value of an expression of ``printed.toml`` (Python's syntax) for the quantities it names.

    Beside those it knows ``sin``, ``cos``, ``sqrt`` and ``pi``. Only the package's own file is evaluated.
    """
    return eval(expression, {"__builtins__": {}}, {**_FUNCTIONS, **names})


def half_unit(printed: str) -> float:
    """Half a unit in the last printed place: the largest rounding error of a right print."""
    return 0.5 * 10.0 ** -len(printed.partition(".")[2])


def agrees(printed: str, computed: float) -> bool:
    """Whether a print is a rounding of the computed value; a tie may have been rounded either way."""
    return abs(float(printed) - computed) <= half_unit(printed) * (1.0 + 1e-9)


def agrees_legibly(pattern: str, computed: float) -> bool:
    """Whether some rounding of the computed value fits a print of which characters are lost."""
    return any(fnmatchcase(f"{computed:.{places}f}", pattern) for places in range(MOST_DECIMALS + 1))


HEADINGS = ("Case, part", "Symbol", "Unit", "Printed", "Computed", "Difference", "Verdict")

_NEGLIGIBLE = 1e-9


class Agreement(StrEnum):
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
        return self not in (Agreement.MISPRINT, Agreement.DIFFERS)


class PaperRow(NamedTuple):
    """One printed number or word of the paper."""

    section: str  #: "Table 2", "Equation (16)", ...
    place: str  #: case, or part of the equation
    symbol: str
    unit: str
    printed: str
    computed: float  #: NaN for words
    computed_text: str  #: empty for numbers
    verdict: Agreement
    see: str = ""  #: key of the misprint that explains it

    @property
    def is_number(self) -> bool:
        """Whether it is a number, not a word."""
        return not self.computed_text

    @property
    def difference(self) -> float:
        """Computed less printed; NaN for words and for prints that lost characters."""
        return self.computed - number(self.printed) if self.is_number and "*" not in self.printed else np.nan

    @property
    def cells(self) -> tuple[str, ...]:
        """Its texts in the order of ``HEADINGS``: a dash where there is no number to subtract.

        The computed value has three digits more than the print, or as many as are needed.
        """
        computed, difference = self.computed_text or f"{self.computed:.7g}", "–"
        if not np.isnan(self.difference):
            differs = abs(self.difference) > _NEGLIGIBLE
            difference = f"{self.difference:+.3g}" if differs else "0"
            if "pi" not in self.printed:
                computed = f"{self.computed:.{len(self.printed.partition('.')[2]) + 3 * differs}f}"
        symbol = content(__package__, "printed.toml")["symbols"].get(self.symbol, self.symbol)
        return self.place, symbol, self.unit, self.printed, computed, difference, str(self.verdict)


def number(printed: str) -> float:
    """Value of a print: a decimal number, or a fraction of pi such as ``4 pi / 13``."""
    return float(evaluate(printed.replace(" pi", "*pi")) if "pi" in printed else printed)


def compare(printed: str, computed: float | str) -> Agreement:
    """Verdict of a print by itself."""
    if isinstance(computed, str):
        return Agreement.SAME if printed == computed else Agreement.DIFFERS
    if "*" in printed:
        return Agreement.LEGIBLE if agrees_legibly(printed, computed) else Agreement.DIFFERS
    same = number(printed) == computed if "pi" in printed else agrees(printed, computed)
    return Agreement.AGREES if same else Agreement.DIFFERS


#: Of a print: section of the paper, place in it, symbol, unit.
About = tuple[str, str, str, str]


def judged(
    misprints: Collection[str], about: About, printed: str, computed: float | str, *keys: str
) -> PaperRow:
    """A row with its verdict; a misprint of ``keys`` that the evidence confirms explains a difference."""
    verdict, see = compare(printed, computed), ""
    if verdict == Agreement.DIFFERS:
        see = next((key for key in keys if key in misprints), "")
        verdict = Agreement.MISPRINT if see else verdict
    value, text = (np.nan, computed) if isinstance(computed, str) else (computed, "")
    return PaperRow(*about, printed, computed=value, computed_text=text, verdict=verdict, see=see)
