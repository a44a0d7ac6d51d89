"""Axes of requests, and what no request may ask for: refused before anything is computed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scan_types.values import run_scan

import fastmech as fm
from fastmech.ensembles import checks
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.equilibrium_map import EquilibriumMapScan
from fastmech.scan_types.request import Axis, RunContext, read_request
from fastmech.scan_types.snapping import DecayRates
from fastmech.slider.capture.steps import coarse_steps, fastest_followed, shortest_step
from fastmech.slider.coefficients import reduce


@pytest.mark.parametrize(
    ("table", "values"),
    [
        ({"start": 0.0, "stop": 1.0, "num": 5}, [0.0, 0.25, 0.5, 0.75, 1.0]),
        ({"start": 1, "stop": -1, "num": 3}, [1.0, 0.0, -1.0]),
        ({"start": 3.0, "stop": 9.0, "num": 1}, [3.0]),
        ({"start": 1.0, "stop": 1000.0, "num": 4, "spacing": "log"}, [1.0, 10.0, 100.0, 1000.0]),
        ({"start": -8.0, "stop": -1.0, "num": 4, "spacing": "log"}, [-8.0, -4.0, -2.0, -1.0]),
        ({"values": [1, 2.5, 7]}, [1.0, 2.5, 7.0]),
        ({"values": [7.0, -1.0]}, [7.0, -1.0]),
        ({"values": [3.0]}, [3.0]),
    ],
)
def test_values(table: dict[str, Any], values: list[float]) -> None:
    axis = Axis(**table)
    np.testing.assert_allclose(axis.array, values, rtol=1e-15)
    assert axis.size == len(values)
    assert axis.rises == (values[-1] >= values[0])


def test_decay_rates_are_logarithmic_unless_said_otherwise() -> None:
    np.testing.assert_allclose(DecayRates(start=1.0, stop=100.0, num=3).array, [1.0, 10.0, 100.0], rtol=1e-15)
    assert DecayRates(start=1.0, stop=3.0, num=3, spacing="linear").array.tolist() == [1.0, 2.0, 3.0]
    assert DecayRates(values=[1.0, 4.0]).array.tolist() == [1.0, 4.0]


@pytest.mark.parametrize(
    "table",
    [
        {},
        {"start": 0.0, "stop": 1.0},
        {"num": 3, "stop": 1.0},
        {"values": [1.0], "num": 1},
        {"values": [1.0], "spacing": "log"},
        {"values": []},
        {"values": 3.0},
        {"values": [1.0, "2"]},
        {"values": [1.0, np.nan]},
        {"values": [1.0, 1e300]},
        {"values": [1.0, 1.0]},
        {"values": [1.0, 3.0, 2.0]},
        {"start": 1.0, "stop": 1.0, "num": 2},
        {"start": 1.0, "stop": 1.0 + 1e-15, "num": 100},
        {"start": 0.0, "stop": 1.0, "num": 0},
        {"start": 0.0, "stop": 1.0, "num": 10**12},
        {"start": 0.0, "stop": 1.0, "num": 3.0},
        {"start": 0.0, "stop": 1.0, "num": 3, "spacing": "log"},
        {"start": -1.0, "stop": 1.0, "num": 3, "spacing": "log"},
        {"start": 1.0, "stop": 2.0, "num": 3, "spacing": "cubic"},
        {"start": 0.0, "stop": 1.0, "num": 3, "step": 0.5},
    ],
)
def test_no_axes(table: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Axis(**table)


def test_a_map_is_over_the_values_asked_for() -> None:
    """Beside the fold at c2 = 98.59 N/m, unevenly; each point is what the scene there has."""
    values = [99.5, 98.0, 40.0]
    scene = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)
    found = run_scan(EquilibriumMapScan(axes={"c2": {"values": values}}), scene, RunContext(threads=1))
    assert found["c2"].data.tolist() == values
    assert found["count"].data.tolist() == [len(fm.find_equilibria(scene.replace(c2=c2))) for c2 in values]
    assert len(set(found["count"].data.tolist())) == 2


def test_rates_that_steps_follow_end_where_steps_become_no_shorter() -> None:
    c = reduce(fm.Scene())
    rates = np.array([0.2, 1.0, 1.5, 100.0]) * fastest_followed(c)
    steps = coarse_steps(c, np.outer(rates, [0.0, 0.0, 0.0, 1.0]))
    assert steps[0] > steps[1] == steps[2] == steps[3] == shortest_step(c)


SCENE = "[scene]\nalpha = 0.0\n"
PHI, THETA = (f"axes.{name} = {{start = 0.0, stop = 1.0, num = 3}}\n" for name in ("phi", "theta"))
ALONG = "along.F0 = {start = 0.0, stop = 1.0, num = 3}\n"
FORCES, RATES = "F0 = {start = 1.0, stop = 2.0, num = 3}\n", "alpha = {start = 1.0, stop = 2.0, num = 3}\n"

IMPOSSIBLE = {
    "degrees": ("basins", PHI.replace("1.0", "180.0") + THETA, "axes.phi: reaches 180, beyond 4 turns"),
    "rates": (
        "basins",
        PHI + "axes.phi_dot = {start=0.0, stop=1e12, num=3}",
        "axes.phi_dot = 1e+12 rad/s: steps",
    ),
    "a fixed rate": ("basins", PHI + THETA + "fixed.phi_dot = 1e300", "fixed.phi_dot = 1e+300 rad/s: steps"),
    "too long": ("basins", PHI + THETA + "t_end = 1e300", "t_end = 1e+300 s: must be at most"),
    "too fine": ("basins", PHI + THETA + "dt = 1e-300", "t_end = 60 s: must be at most"),
    "a huge ball": (
        "basins",
        PHI + THETA + "settle_radius = 1e300",
        "settle_radius = 1e+300: must not exceed",
    ),
    "falling": ("basins", PHI.replace("1.0", "-1.0") + THETA, "axes.phi: falls from 0 to -1, must rise"),
    "too many starts": (
        "basins",
        PHI.replace("3", "100000") + THETA.replace("3", "100000"),
        "axes: ask for 1e+10 starts, at most 2e+07",
    ),
    "no parameter to go along": ("erosion", PHI, "along: missing"),
    "no such shock": (
        "erosion",
        PHI + ALONG + "most_shock = 1e300",
        "most_shock = 1e+300: input should be less",
    ),
    "an uneven window": ("erosion", "axes.phi = {values = [0.0, 1.0]}\n" + ALONG, "must rise evenly"),
    "force without end": ("erosion", PHI + ALONG.replace("1.0", "1e30"), "t_end = 60 s: must be at most"),
    "steps": ("motion", "t_end = 1e300", "t_end = 1e+300 s: takes 1e+302 steps of 0.01 s, at most"),
    "steps of small motion": ("disturbed_motion", "dt = 1e-300", "t_end = 20 s: takes 2e+301 steps"),
    "steps of ensembles": ("disturbed", "t_end = 1e12", "t_end = 1e+12 s: must be at most"),
    "a horizon": ("disturbed", "linear_horizon = 1e300", "linear_horizon = 1e+300 s: takes "),
    "years of work": ("disturbed", "trajectories = 100000000\nt_end = 5e5", "right-hand sides"),
    "a long seed": ("disturbed", f"seed = {2**128}", f"seed = {2**128}: input should be less than {2**128}"),
    "no such range": (
        "snap",
        "searched = [1.0, 2.0]",
        "searched = [1.0, 2.0]: must be a range of F0 that holds 100",
    ),
    "a wide range": ("snap", "searched = [-1e300, 1e300]", "searched.0 = -1e+300: must not exceed"),
    "slow decay": (
        "snapping",
        FORCES + RATES.replace("1.0", "1e-20"),
        "t_end = 1.38155e+21 s: must be at most",
    ),
    "both signs": (
        "snapping",
        FORCES.replace("1.0", "-1.0") + RATES,
        "F0: goes from -1 to 2 N: must be of one",
    ),
    "rounding": (
        "snapping",
        FORCES + RATES + "tolerance = 1e-300",
        "tolerance = 1e-300: must not be less than",
    ),
    "method": ("motion", 'method = "RK45"', "method = 'RK45': unknown; did you mean 'dopri5'? known: euler"),
}


@pytest.mark.nojit
@pytest.mark.parametrize("what", IMPOSSIBLE)
def test_what_cannot_be_computed_is_refused(tmp_path: Path, what: str) -> None:
    kind, text, message = IMPOSSIBLE[what]
    path = tmp_path / "request.toml"
    path.write_text(f'{SCENE}[scan.a]\nkind = "{kind}"\n{text}', encoding="utf-8")
    with pytest.raises(fm.InputError) as error:
        read_request(path, scan_kinds())
    assert str(error.value).startswith("scan.a.")
    assert message in str(error.value)


@pytest.mark.nojit
@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("motion", "outputs = 10000000"),
        ("disturbed_motion", "outputs = 10000000"),
        ("basins", PHI.replace("3", "4000") + THETA.replace("3", "4000")),
        (
            "equilibrium_map",
            "axes.F0 = {values = [0.0]}\n"
            "axes.c1 = {start = 1.0, stop = 2.0, num = 5000}\n"
            "axes.c2 = {start = 1.0, stop = 2.0, num = 5000}",
        ),
    ],
)
def test_what_memory_cannot_hold_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, text: str
) -> None:
    path = tmp_path / "request.toml"
    path.write_text(f'{SCENE}[scan.a]\nkind = "{kind}"\n{text}', encoding="utf-8")
    monkeypatch.setattr(checks, "free_memory", lambda: 2.0**40)
    read_request(path, scan_kinds())
    monkeypatch.setattr(checks, "free_memory", lambda: 2.0**30)
    with pytest.raises(fm.InputError, match=r"^scan\.a\..* GiB on the way, 1 GiB are free; ask for fewer "):
        read_request(path, scan_kinds())
