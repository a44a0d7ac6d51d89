"""The paper's print: every number with exactly its printed digits, read from ``printed.toml``."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from decimal import Decimal
from fnmatch import fnmatchcase
from importlib import resources
from typing import Any

import numpy as np

Printed = Mapping[str, Any]

CASES = ("case_1", "case_2", "case_3", "case_4")

#: Finest rounding tried when characters of a printed number are lost.
MOST_DECIMALS = 6

_FUNCTIONS = {"pi": np.pi, "sin": np.sin, "cos": np.cos, "sqrt": np.sqrt}


def load_printed() -> dict[str, Any]:
    """Content of ``printed.toml``."""
    return tomllib.loads(resources.files(__package__).joinpath("printed.toml").read_text(encoding="utf-8"))


def evaluate(expression: str, **names: Any) -> Any:
    """Value of an expression of ``printed.toml`` (Python's syntax) for the quantities it names.

    Beside those it knows ``sin``, ``cos``, ``sqrt`` and ``pi``. Only the package's own file is evaluated.
    """
    return eval(expression, {"__builtins__": {}}, {**_FUNCTIONS, **names})


def half_unit(printed: str) -> float:
    """Half a unit in the last printed place: the largest rounding error of a right print."""
    exponent = Decimal(printed).as_tuple().exponent
    assert isinstance(exponent, int)
    return 0.5 * 10.0**exponent


def agrees(printed: str, computed: float) -> bool:
    """Whether a print is a rounding of the computed value; a tie may have been rounded either way."""
    return abs(float(printed) - computed) <= half_unit(printed) * (1.0 + 1e-9)


def agrees_legibly(pattern: str, computed: float) -> bool:
    """Whether some rounding of the computed value fits a print of which characters are lost.

    ``*`` stands for any lost characters, as in the file.
    """
    return any(fnmatchcase(f"{computed:.{places}f}", pattern) for places in range(MOST_DECIMALS + 1))
