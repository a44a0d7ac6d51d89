"""The two searches beside the proof: they find what the 50-digit reference lists, and they can contradict."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fastmech.equilibria import find
from fastmech.equilibria.evidence import gather
from fastmech.equilibria.find import find_equilibria
from fastmech.equilibria.outcome import Outcome
from fastmech.equilibria.polynomial import rest_polynomial
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene

DATA = Path(__file__).parents[2] / "data" / "equilibria.toml"
REFERENCE: list[dict[str, Any]] = tomllib.loads(DATA.read_text())["scene"]
PAPER = Scene(c2=1100 / 3, alpha=0.0)


@pytest.mark.parametrize("case", REFERENCE, ids=lambda case: str(case["name"]))
def test_both_searches_agree_with_the_reference(case: dict[str, Any]) -> None:
    scene = Scene(**{name: float(value) for name, value in case["parameters"].items()})
    phi, theta = (np.array([float(e[name]) for e in case["equilibria"]]) for name in ("phi", "theta"))
    evidence = gather(reduce(scene), phi, theta)
    assert (evidence.reached, evidence.unlisted) == (phi.size, 0)
    assert evidence.polynomial.agrees


def test_a_missing_equilibrium_is_noticed_by_both() -> None:
    listed = find_equilibria(PAPER)
    evidence = gather(reduce(PAPER), listed.phi[1:], listed.theta[1:])
    assert evidence.contradicts
    assert evidence.polynomial.unexplained == 1


def test_an_invented_equilibrium_matches_no_root() -> None:
    listed = find_equilibria(PAPER)
    evidence = gather(reduce(PAPER), np.append(listed.phi, 0.1), np.append(listed.theta, 0.2))
    assert evidence.polynomial.unmatched == 1
    assert evidence.reached == 4


def test_a_contradiction_takes_the_certificate_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(find, "gather", lambda c, phi, theta: gather(c, phi[1:], theta[1:]))
    certificate = find_equilibria(PAPER).certificate
    assert certificate.outcome is Outcome.UNPROVED


def test_the_polynomial_vanishes_at_table_2() -> None:
    c = reduce(PAPER)
    polynomial = rest_polynomial(c.lift, c.spring, c.gravity, c.force)
    printed = np.array([0.68803, 1.45058, -1.35581, -2.44693])
    assert np.abs(polynomial(np.exp(1j * printed))).max() < 1e-4
    assert abs(polynomial(np.exp(0.5j))) > 1e-2
