"""Everything that takes part: the package, what users write by hand, and the libraries that are installed.

To add a library, write a file like ``heyoka_series.py`` (``NEEDS``, the module that it imports, and
``entrants``) and name it here.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
from types import ModuleType

from fastmech.bench import (
    cyrk_solvers,
    diffrax_solvers,
    fused,
    heyoka_series,
    numbalsoda_solvers,
    package,
    plain,
    pynamicalsys_solvers,
    scipy_solvers,
    torch_step,
)
from fastmech.bench.entrant import Entrant
from fastmech.bench.problem import Problem

ALWAYS = (package, fused, plain, scipy_solvers)

#: Need the extra ``bench``, or more.
IF_INSTALLED = (
    heyoka_series,
    torch_step,
    diffrax_solvers,
    numbalsoda_solvers,
    cyrk_solvers,
    pynamicalsys_solvers,
)


def installed() -> list[ModuleType]:
    """Files whose libraries are there."""
    return [module for module in IF_INSTALLED if find_spec(module.NEEDS) is not None]


def missing() -> list[str]:
    """Libraries that are not installed."""
    return [module.NEEDS for module in IF_INSTALLED if find_spec(module.NEEDS) is None]


def entrants(problem: Problem, quick: bool) -> Iterator[Entrant]:
    """Every entrant, the package's first; quick: every third of its own and one of what is always there."""
    if quick:
        yield from list(package.entrants(problem))[::3]
        for module in ALWAYS[1:]:
            yield next(module.entrants(problem))
    else:
        for module in (*ALWAYS, *installed()):
            yield from module.entrants(problem)
