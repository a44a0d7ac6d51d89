"""The shipped file, which has one scan of every kind, keeps to the CF conventions."""

from __future__ import annotations

import re
from pathlib import Path

import h5py
import numpy as np
import pytest

from fastmech.store.read import Results, open_results

SHIPPED = Path(__file__).parents[2] / "data" / "small.h5"

#: Names of UDUNITS-2 (udunits2-base.xml, -derived.xml, -common.xml) that results use: symbols, and the names
#: that their documentation gives beside them.
SYMBOLS = {"m", "kg", "s", "N", "J", "W", "Pa", "Hz", "rad", "1"}

#: One factor: a symbol with an integer exponent written behind it, as UDUNITS reads `m2` and `s-1`.
FACTOR = re.compile(r"([A-Za-z]+|1)(-?[1-9]\d*)?")


def reads(unit: str) -> bool:
    """UDUNITS's grammar, as far as it is needed: factors with blanks between them, `/` and factors again."""
    products = unit.split("/")
    factors = [FACTOR.fullmatch(f) for product in products for f in product.split(" ")]
    return len(products) <= 2 and all(f is not None and f[1] in SYMBOLS for f in factors)


@pytest.fixture(scope="module")
def results() -> Results:
    return open_results(SHIPPED)


def units(results: Results) -> dict[str, str]:
    found = {name: parameter.units for name, parameter in results.parameters.items()}
    return found | {
        f"{place}.{name}": results[place].about(name).units
        for place in results.groups
        for name in results[place]
    }


def test_the_grammar_refuses_what_udunits_does() -> None:
    assert all(reads(unit) for unit in ("1", "rad", "rad/s", "kg m2/s", "1/s", "s-10", "N s/m", "J2"))
    wrong = ("rad or rad/s", "rad, rad/s", "m2 (third: m)", "J^order", "1/s^k, k = 0 to 4", "", "see unit")
    assert not any(reads(unit) for unit in wrong)


def test_every_variable_has_one_unit(results: Results) -> None:
    found = units(results)
    assert len(found) > 150
    assert {name: unit for name, unit in found.items() if not reads(unit)} == {}


def test_udunits_reads_every_unit(results: Results) -> None:
    cf_units = pytest.importorskip("cf_units")
    for name, unit in units(results).items():
        assert not cf_units.Unit(unit).is_unknown(), name


def test_the_file_says_its_conventions_and_history(results: Results) -> None:
    assert results.attrs["Conventions"] == "CF-1.11"
    assert "fastmech run scans/small.toml" in results.attrs["history"]


def test_dimensions_have_coordinates(results: Results) -> None:
    wanted = {"equilibrium", "trajectory", "basin", "root", "sheet", "quantile", "time"}
    for place in results.groups:
        assert wanted & set(results[place].sizes) <= set(results[place]), place
        assert not {"component", "angle"} & set(results[place].sizes), place


def test_codes_that_are_none_say_so() -> None:
    none = {
        "disturbed": ("outcome", "end_equilibrium"),
        "map_F0_c1": ("morse_index", "sheet", "verdict", "verdict_hurwitz"),
        "basins": ("label", "well"),
        "snapping": ("well", "window_well"),
    }
    with h5py.File(SHIPPED) as file:
        for section, names in none.items():
            for name in names:
                stored = file[section][name] if name in file[section] else file[section]["windows"][name]
                assert stored.attrs["_FillValue"].dtype == stored.dtype, name
                assert stored.attrs["_FillValue"] == -1, name
                assert -1 not in np.atleast_1d(stored.attrs.get("flag_values", 0)), name


def test_a_table_of_a_map_has_a_row_for_each_slot(results: Results) -> None:
    pytest.importorskip("pandas")
    section = results["map_F0_c1"]
    table = section.to_xarray().to_dataframe()
    assert len(table) == section["count"].data.size * 6
    here = table.xs((0.0, 200.0), level=("F0", "c1"))
    assert here["phi"].notna().sum() == section.select(["count"], F0=0.0, c1=200.0)["count"].data


@pytest.mark.parametrize("place", ["disturbed", "disturbed_map", "basins", "snapping"])
def test_small_tables_do_not_multiply_rows(results: Results, place: str) -> None:
    """A row for each trajectory, sheet of a point, start or motion; the rest are tables of groups."""
    pytest.importorskip("pandas")
    section = results[place]
    along = {
        "disturbed": ("equilibrium", "trajectory"),
        "disturbed_map": ("F0", "c1", "sheet"),
        "basins": ("phi", "theta"),
        "snapping": ("alpha", "F0"),
    }[place]
    table = section.to_xarray().to_dataframe()
    assert len(table) == np.prod([section.sizes[dim] for dim in along])
    assert set(table.index.names) == set(along)
    assert all(len(group.to_xarray().to_dataframe()) for group in section.groups.values())
