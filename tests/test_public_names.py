from __future__ import annotations

import inspect
import json
import os
import re
import subprocess
import sys

import pytest

import fastmech as fm


@pytest.mark.parametrize("name", fm.__all__)
def test_every_public_name_exists_and_is_described(name: str) -> None:
    value = getattr(fm, name)
    assert inspect.getdoc(value)
    assert getattr(fm, name) is value
    assert value.__name__ == name
    assert name in dir(fm)


def test_public_names() -> None:
    promised = {"Scene", "InputError", "find_equilibria", "classify", "integrate", "disturb", "open_results"}
    promised |= {"map_basins", "label_starts", "well_numbers", "well_of_number", "number_turns"}
    promised |= {"basin_fractions", "basin_stability", "finite_time_basin_stability", "wilson"}
    promised |= {"integrity", "kinetic_norm", "minimal_shock", "brute_force_shock", "erosion"}
    promised |= {"uncertainty_exponent", "boundary_dimension", "basin_entropy", "fractal_boundary_test"}
    promised |= {"wada_merge_test", "track_edge", "nearest_saddle"}
    promised |= {"map_snapping", "critical_forces", "shock_limit", "impulse_start"}
    assert promised <= set(fm.__all__)
    assert fm.__all__ == sorted(fm.__all__)


#: Functions that return a number, an array or a text, of which their first sentence tells.
PLAIN = {
    "angles", "cos", "critical_forces", "impulse_start", "kinetic_norm", "lengths", "nearest_saddle", "sin",
    "step_warning", "system_info", "tipping_probabilities", "well_of_number", "wilson",
}  # fmt: skip


@pytest.mark.parametrize("name", [name for name in fm.__all__ if not isinstance(getattr(fm, name), type)])
def test_help_on_a_function_tells_what_its_result_holds(name: str) -> None:
    about = str(inspect.getdoc(getattr(fm, name)))
    returns = about.partition("Returns:\n")[2].partition("Raises:")[0]
    assert bool(returns) == (name not in PLAIN)
    assert about.count("Returns:") == bool(returns)
    kinds = [kind for kind in map(fm.__dict__.get, fm.__all__) if isinstance(kind, type)]
    for kind in kinds:
        if f"    {kind.__name__}: " in returns:
            assert ("plot()" in returns) >= hasattr(kind, "plot")
            assert ("save()" in returns) >= hasattr(kind, "save")
            assert {*getattr(kind, "__dataclass_fields__", {})} <= {*re.findall(r"\w+", returns)}


def test_map_basins_gives_what_its_help_names() -> None:
    returns = str(inspect.getdoc(fm.map_basins)).partition("    BasinMap: ")[2].partition(".")[0]
    assert {"axes", "fixed", "tree", "well", "turns", "time"} <= {*re.findall(r"\w+", returns)}
    assert "F0" in str(inspect.getdoc(fm.map_snapping)).partition("Returns:")[2]


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'fastmech' has no attribute 'integrat'"):
        fm.integrat  # noqa: B018


def test_version() -> None:
    assert fm.__version__.split(".")[0].isdigit()


def test_import_is_cheap() -> None:
    """Nothing numerical is loaded before it is used."""
    heavy = ["numba", "numpy", "scipy", "h5py", "pydantic", "matplotlib"]
    script = f"import sys, fastmech; print([m for m in {heavy} if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


STATE = """
import json, os, signal, sys, threading, warnings, locale
def state():
    return [dict(os.environ), [str(signal.getsignal(s)) for s in (signal.SIGINT, signal.SIGTERM)],
            threading.active_count(), len(warnings.filters), locale.setlocale(locale.LC_ALL), os.getcwd(),
            sys.path, sys.getrecursionlimit(), str(sys.excepthook)]
def numba_state():
    from numba import config
    return [config.CACHE_DIR, config.CPU_NAME, config.CPU_FEATURES]
import numpy, numba, scipy.optimize, pydantic
before, ours = state(), numba_state()
errors = numpy.geterr()
import fastmech as fm
fm.integrate
fm.Scene
print(json.dumps([before == state(), ours == numba_state(), errors == numpy.geterr()]))
"""


def test_importing_the_library_changes_nothing_of_the_process():
    done = subprocess.run(
        [sys.executable, "-c", STATE], capture_output=True, text=True, check=True, env=os.environ
    )
    assert json.loads(done.stdout) == [True, True, True]


def test_sympy_is_imported_only_where_a_mechanism_is_built() -> None:
    code = "import sys, fastmech as fm; fm.find_equilibria(fm.Scene()); assert 'sympy' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
